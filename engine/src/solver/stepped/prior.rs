//! The wear of earlier meshes. With blocks, each amplitude has a mesh of its own. It starts on the
//! surface that the meshes before have left, and only adds to it.
//!
//! # Equations
//! The prior wear w is linear in t = r² between its nodes. Its image, and the integral of its image:
//! ```text
//! g(x)    = w(0) + 2x Σ w′ⱼ [√(x²−tⱼ) − √(x²−tⱼ₊₁)]
//! ∫₀ˣ g   = w(0)·x + ⅔ Σ w′ⱼ [(x²−tⱼ)^{3/2} − (x²−tⱼ₊₁)^{3/2}]       (terms with x² < t are 0)
//! ```
//!
//! # Accuracy
//! Exact. Only if there are many nodes, those are left out that change the wear least.

use std::f64::consts::{FRAC_1_PI, PI};

/// Maximum number of nodes. More are left when many blocks have different meshes.
const MOST_NODES: usize = 1000;

/// Wear that is linear in t = r² between nodes. It is constant inside the first node and outside the
/// last one. Without nodes it is 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PriorWear {
    squares: Vec<f64>,
    wear: Vec<f64>,
    /// The outer radius of the scar.
    radius: f64,
}

impl PriorWear {
    /// The wear at the squares of some radii, and its outer radius.
    pub(super) fn of(squares: Vec<f64>, wear: Vec<f64>, radius: f64) -> Self {
        Self { squares, wear, radius }
    }

    /// This wear with the wear of another mesh on top of it, and its new outer radius.
    pub(super) fn with(&self, squares: &[f64], wear: &[f64], radius: f64) -> Self {
        let added = Self::of(squares.to_vec(), wear.to_vec(), radius);
        if self.is_empty() {
            return added;
        }
        let mut nodes = [&self.squares[..], squares].concat();
        nodes.sort_by(f64::total_cmp);
        nodes.dedup();
        let (mut below, mut above) = (self.along(), added.along());
        let wear = nodes.iter().map(|t| below(*t) + above(*t)).collect();
        Self { squares: nodes, wear, radius }
    }

    /// Leaves out nodes until there are at most [`MOST_NODES`].
    pub(super) fn thinned(mut self) -> Self {
        while self.squares.len() > MOST_NODES {
            let last = self.squares.len() - 1;
            let bump = |j: usize| {
                let (t, w) = (&self.squares[j - 1..=j + 1], &self.wear[j - 1..=j + 1]);
                ((t[1] - t[0]) * (w[2] - w[0]) - (t[2] - t[0]) * (w[1] - w[0])).abs()
            };
            let bumps: Vec<f64> = (1..last).map(bump).collect();
            let mut sorted = bumps.clone();
            sorted.sort_by(f64::total_cmp);
            let small = sorted[sorted.len() / 2];
            // Every second node at most, so that neighbours do not vanish together.
            let stays = |j: usize| j == 0 || j == last || j % 2 == 0 || bumps[j - 1] > small;
            let keep = |list: &[f64]| -> Vec<f64> {
                let kept = list.iter().enumerate().filter(|(j, _)| stays(*j));
                kept.map(|(_, value)| *value).collect()
            };
            self = Self { squares: keep(&self.squares), wear: keep(&self.wear), ..self };
        }
        self
    }

    /// Whether nothing is worn.
    pub(super) fn is_empty(&self) -> bool {
        self.squares.is_empty()
    }

    /// The outer radius of the scar. It is 0 without wear.
    pub(super) fn radius(&self) -> f64 {
        self.radius
    }

    /// The squares of the nodes, and the wear at the nodes.
    pub(super) fn into_lists(self) -> (Vec<f64>, Vec<f64>) {
        (self.squares, self.wear)
    }

    /// The wear volume.
    pub(super) fn volume(&self) -> f64 {
        let cells = self.squares.windows(2).zip(self.wear.windows(2));
        0.5 * PI * cells.map(|(t, w)| (t[1] - t[0]) * (w[0] + w[1])).sum::<f64>()
    }

    /// The wear at t = r².
    pub(super) fn at(&self, square: f64) -> f64 {
        self.piece(self.squares.partition_point(|t| *t <= square), square)
    }

    /// A function that gives the wear at ascending t.
    fn along(&self) -> impl FnMut(f64) -> f64 {
        let mut right = 0;
        move |square| {
            right += self.squares[right..].iter().take_while(|t| **t <= square).count();
            self.piece(right, square)
        }
    }

    fn piece(&self, right: usize, square: f64) -> f64 {
        let Self { squares: t, wear: w, .. } = self;
        match right {
            0 => w.first().copied().unwrap_or(0.0),
            _ if right == t.len() => w[right - 1],
            _ => {
                let share = (square - t[right - 1]) / (t[right] - t[right - 1]);
                w[right - 1] + share * (w[right] - w[right - 1])
            }
        }
    }

    /// The cells that begin inside x: the slope of w over t, and x² − t at both ends, but at least 0.
    fn slopes(&self, x: f64) -> impl Iterator<Item = (f64, f64, f64)> {
        let square = x * x;
        let cells = self.squares.windows(2).zip(self.wear.windows(2));
        cells.take_while(move |(t, _)| t[0] < square).map(move |(t, w)| {
            ((w[1] - w[0]) / (t[1] - t[0]), square - t[0], (square - t[1]).max(0.0))
        })
    }

    fn innermost(&self) -> f64 {
        self.wear.first().copied().unwrap_or(0.0)
    }

    /// The image of the wear at x.
    pub(super) fn image(&self, x: f64) -> f64 {
        let sum: f64 =
            self.slopes(x).map(|(slope, near, far)| slope * (near.sqrt() - far.sqrt())).sum();
        self.innermost() + 2.0 * x * sum
    }

    /// The integral of the image over 0…x.
    pub(super) fn image_area(&self, x: f64) -> f64 {
        let cubes = self
            .slopes(x)
            .map(|(slope, near, far)| slope * (near * near.sqrt() - far * far.sqrt()));
        self.innermost() * x + 2.0 / 3.0 * cubes.sum::<f64>()
    }

    /// (1/π) ∫ g′/√(x²−r²) dx over r…end, for an image that is linear in x² between the nodes.
    pub(super) fn pressure(&self, r: f64, end: f64) -> f64 {
        let (from, to) = (r * r, end * end);
        let inside = self.squares.iter().copied().filter(|t| *t > from && *t < to);
        let mut before = (0.0, self.image(r));
        let sum: f64 = inside
            .chain([to])
            .map(|t| {
                let here = ((t - from).max(0.0).sqrt(), self.image(t.sqrt()));
                let term = 2.0 * (here.1 - before.1) / (here.0 + before.0);
                before = here;
                term
            })
            .sum();
        if self.is_empty() { 0.0 } else { FRAC_1_PI * sum }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ring of wear, linear in t on each side of its deepest point.
    fn ring() -> PriorWear {
        PriorWear { squares: vec![0.25, 0.49, 1.0], wear: vec![0.0, 0.3, 0.0], radius: 1.0 }
    }

    #[test]
    fn the_image_is_that_of_the_transform_and_its_integral_agrees_with_a_sum() {
        let prior = ring();
        // x ∫ w′(r)/√(x²−r²) dr by the substitution r = x sin θ.
        let slope = |t: f64| match t {
            t if t < 0.25 || t > 1.0 => 0.0,
            t if t < 0.49 => 0.3 / 0.24,
            _ => -0.3 / 0.51,
        };
        let midpoint = |from: f64, to: f64, f: &dyn Fn(f64) -> f64| {
            let cells = 200_000;
            let width = (to - from) / f64::from(cells);
            (0..cells).map(|i| f(from + width * (f64::from(i) + 0.5))).sum::<f64>() * width
        };
        for x in [0.4, 0.6, 0.9, 1.3] {
            let image = midpoint(0.0, std::f64::consts::FRAC_PI_2, &|angle| {
                let r = x * libm::sin(angle);
                x * 2.0 * r * slope(r * r)
            });
            assert!((prior.image(x) - image).abs() < 1e-5, "{x}: {} {image}", prior.image(x));
            let area = midpoint(0.0, x, &|x| prior.image(x));
            assert!((prior.image_area(x) - area).abs() < 1e-6, "{x}");
        }
    }

    #[test]
    fn wear_on_top_of_wear_adds_up_at_every_radius() {
        let sum = ring().with(&[0.0, 0.36, 0.64], &[0.1, 0.1, 0.0], 1.0);
        for t in [0.0, 0.2, 0.3, 0.5, 0.64, 0.9, 1.2] {
            let above = if t < 0.36 { 0.1 } else { 0.1 * ((0.64 - t) / 0.28_f64).max(0.0) };
            assert!((sum.at(t) - ring().at(t) - above).abs() < 1e-15, "{t}");
        }
    }

    #[test]
    fn many_nodes_are_thinned_without_a_change_of_the_wear() {
        let count = 5000;
        let squares: Vec<f64> = (0..=count).map(|i| f64::from(i) / f64::from(count)).collect();
        let wear = squares.iter().map(|t| t.sqrt() * (1.0 - t)).collect();
        let all = PriorWear { squares, wear, radius: 1.0 };
        let thinned = all.clone().thinned();
        assert!(thinned.squares.len() <= MOST_NODES, "{}", thinned.squares.len());
        let areas = |x: f64| (thinned.image_area(x), all.image_area(x));
        assert!([0.3, 0.9, 1.5].map(areas).iter().all(|(a, b)| (a - b).abs() < 1e-6));
        assert!([0.001, 0.01, 0.5, 0.9].iter().all(|t| (thinned.at(*t) - all.at(*t)).abs() < 1e-5));
    }
}
