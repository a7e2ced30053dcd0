//! The wear of earlier meshes. With blocks, each amplitude has a mesh of its own. It starts on the
//! surface that the meshes before have left, and only adds to it.
//!
//! # Equations
//! The prior wear w is linear in t = r² between its nodes, and its slope changes by κⱼ at node j. Its image,
//! and the integral of its image:
//! ```text
//! g(x)    = w(0) + 2x Σ κⱼ √(x²−tⱼ)
//! ∫₀ˣ g   = w(0)·x + ⅔ Σ κⱼ (x²−tⱼ)^{3/2}       over the nodes with tⱼ < x²
//! ```
//! In a line contact the wear is linear in x, the image is (2/π) Σ κⱼ √(s²−xⱼ²), and its integral is that over ds/s.
//!
//! # Accuracy
//! Exact. Only if there are many nodes, those are left out that change the wear least.

use std::f64::consts::FRAC_2_PI;
use std::ops::RangeInclusive;
use std::sync::OnceLock;

use crate::contact::Geometry;
use crate::numeric::weighted;
use crate::solver::pressures::kernel_area;

/// Maximum number of nodes per cell of a mesh. More are left when many blocks have different meshes.
const NODES_PER_CELL: usize = 4;

/// A node is left out if the volume changes by less than this share.
const NEGLIGIBLE: f64 = 1e-8;

/// Number of cells on each side of the cell with an old stick edge that are smoothed.
const BESIDE: usize = 2;

/// Wear that is this many times as deep as a bump of the surface removes the bump.
const LEVELS: f64 = 3.0;

/// Wear that is linear in t = r² between nodes, or in x in a line contact. It is constant inside the first node and
/// outside the last one. Without nodes it is 0.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PriorWear {
    geometry: Geometry,
    /// The nodes, as t = r² or x.
    places: Vec<f64>,
    wear: Vec<f64>,
    /// The change of the slope dw/dt at each node, for images.
    kinks: OnceLock<Vec<f64>>,
    /// The image at each node, for curves.
    images: OnceLock<Vec<f64>>,
    /// The outer radius of the scar. It is 0 without wear.
    pub(super) radius: f64,
    /// The stick edges of earlier meshes, as t = r² or x.
    edges: Vec<f64>,
}

impl PriorWear {
    /// The wear at some places, and its outer radius.
    pub(super) fn of(geometry: Geometry, places: Vec<f64>, wear: Vec<f64>, radius: f64) -> Self {
        Self { geometry, places, wear, radius, ..Self::default() }
    }

    /// This wear with the wear of another mesh on top of it, and its new outer radius. `profile` is the unworn
    /// profile at t.
    pub(super) fn with(
        &self,
        geometry: Geometry,
        places: &[f64],
        wear: &[f64],
        radius: f64,
        profile: impl Fn(f64) -> f64,
    ) -> Self {
        if self.is_empty() {
            return Self::of(geometry, places.to_vec(), wear.to_vec(), radius);
        }
        let added =
            Self::of(geometry, places.to_vec(), self.evened(places, wear, &profile), radius);
        let mut nodes = [&self.places[..], places].concat();
        nodes.sort_by(f64::total_cmp);
        nodes.dedup();
        let (mut below, mut above) = (self.along(), added.along());
        let mut sum: Vec<f64> = nodes.iter().map(|t| below(*t) + above(*t)).collect();
        let mut edges = self.edges.clone();
        edges.retain(|edge| match Window::around(*edge, (places, wear), &nodes) {
            Some(window) => window.smooth(&nodes, &mut sum, &profile) < 1.0,
            None => true,
        });
        Self { edges, ..Self::of(geometry, nodes, sum, radius) }
    }

    /// The wear of another mesh without waves from node to node of the surface. The springs hardly feel them, and the
    /// next mesh would make them larger. The filter is exact for cubics, and the volume stays the same.
    fn evened(&self, places: &[f64], wear: &[f64], profile: impl Fn(f64) -> f64) -> Vec<f64> {
        let mut below = self.along();
        let surface: Vec<f64> =
            places.iter().zip(wear).map(|(t, w)| below(*t) + w + profile(*t)).collect();
        let mut even = wear.to_vec();
        let (mut lost, mut area) = (0.0, 0.0);
        let mut changed = Vec::new();
        for j in 2..places.len().saturating_sub(2) {
            let near = &surface[j - 2..=j + 2];
            let wave = (near[0] - 4.0 * near[1] + 6.0 * near[2] - 4.0 * near[3] + near[4]) / 16.0;
            let least = wear[j - 2..=j + 2].iter().copied().fold(f64::INFINITY, f64::min);
            if least <= LEVELS * wave.abs() {
                continue;
            }
            let width = places[j + 1] - places[j - 1];
            even[j] -= wave;
            lost += width * wave;
            area += width;
            changed.push(j);
        }
        for j in changed {
            even[j] += lost / area;
        }
        even
    }

    /// The same wear, with the present stick edge as another place where it is not smooth.
    pub(super) fn with_edge(mut self, stick: f64) -> Self {
        if stick > 0.0 {
            self.edges.push(self.geometry.place(stick));
        }
        self
    }

    /// The last stick edge between two radii that later wear has not yet made smooth.
    pub(super) fn edge_between(&self, inner: f64, outer: f64) -> Option<f64> {
        let edges = self.edges.iter().rev().map(|edge| self.geometry.radius(*edge));
        edges.into_iter().find(|edge| *edge > inner && *edge < outer)
    }

    /// Leaves out nodes that hardly change the wear, and more until there are few enough for a mesh of `cells` cells.
    pub(super) fn thinned(mut self, cells: usize) -> Self {
        let negligible = NEGLIGIBLE * self.volume().abs();
        loop {
            let last = self.places.len() - 1;
            // Twice the change of the volume without the node.
            let bump = |j: usize| {
                let (t, w) = (&self.places[j - 1..=j + 1], &self.wear[j - 1..=j + 1]);
                ((t[1] - t[0]) * (w[2] - w[0]) - (t[2] - t[0]) * (w[1] - w[0])).abs()
            };
            let bumps: Vec<f64> = (1..last).map(bump).collect();
            let mut small = negligible;
            if last >= NODES_PER_CELL * cells {
                let mut sorted = bumps.clone();
                sorted.sort_by(f64::total_cmp);
                small = small.max(sorted[sorted.len() / 2]);
            }
            // Every second node at most, so that neighbours do not vanish together.
            let stays =
                |j: usize| j == 0 || j == last || j.is_multiple_of(2) || bumps[j - 1] > small;
            let kept: Vec<usize> = (0..=last).filter(|j| stays(*j)).collect();
            if kept.len() > last {
                return self;
            }
            let keep = |list: &[f64]| kept.iter().map(|j| list[*j]).collect();
            let edges = std::mem::take(&mut self.edges);
            self = Self {
                edges,
                ..Self::of(self.geometry, keep(&self.places), keep(&self.wear), self.radius)
            };
        }
    }

    /// Whether nothing is worn.
    pub(super) fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// The nodes, as t = r² or x, and the wear at the nodes.
    pub(super) fn into_lists(self) -> (Vec<f64>, Vec<f64>) {
        (self.places, self.wear)
    }

    /// The wear volume.
    pub(super) fn volume(&self) -> f64 {
        let cells = self.places.windows(2).zip(self.wear.windows(2));
        let twice: f64 = cells.map(|(t, w)| (t[1] - t[0]) * (w[0] + w[1])).sum();
        self.geometry.volume(twice, self.places.first().copied().unwrap_or(0.0) * self.innermost())
    }

    /// The wear at t = r² or x.
    pub(super) fn at(&self, place: f64) -> f64 {
        between(&self.places, &self.wear, self.places.partition_point(|t| *t <= place), place)
    }

    /// A function that gives the wear at ascending t.
    fn along(&self) -> impl FnMut(f64) -> f64 {
        let mut right = 0;
        move |place| {
            right += self.places[right..].iter().take_while(|t| **t <= place).count();
            between(&self.places, &self.wear, right, place)
        }
    }

    fn changes_of_slope(&self) -> Vec<f64> {
        let cells = self.places.windows(2).zip(self.wear.windows(2));
        let slopes = cells.map(|(t, w)| (w[1] - w[0]) / (t[1] - t[0])).chain([0.0]);
        let mut before = 0.0;
        slopes.map(|here| here - std::mem::replace(&mut before, here)).collect()
    }

    /// Σ of the kinks of w inside x, each times `f` of its place.
    fn kinks(&self, x: f64, f: impl Fn(f64) -> f64) -> f64 {
        let place = self.geometry.place(x);
        let inside = self.places.partition_point(|t| *t < place);
        let kinks = self.kinks.get_or_init(|| self.changes_of_slope());
        weighted(&kinks[..inside], &self.places[..inside], f)
    }

    fn innermost(&self) -> f64 {
        self.wear.first().copied().unwrap_or(0.0)
    }

    /// The image of the wear at x.
    pub(super) fn image(&self, x: f64) -> f64 {
        let square = x * x;
        match self.geometry {
            Geometry::Round => self.innermost() + 2.0 * x * self.kinks(x, |t| (square - t).sqrt()),
            Geometry::Line => FRAC_2_PI * self.kinks(x, |node| (square - node * node).sqrt()),
        }
    }

    /// The integral of the image over 0…x. In a line contact it is that over ds/s.
    pub(super) fn image_area(&self, x: f64) -> f64 {
        let square = x * x;
        match self.geometry {
            Geometry::Round => {
                let of_kink = |t: f64| (square - t) * (square - t).sqrt();
                self.innermost() * x + 2.0 / 3.0 * self.kinks(x, of_kink)
            }
            Geometry::Line => {
                let of_kink = |node: f64| {
                    let chord = (square - node * node).sqrt();
                    chord - node * libm::atan2(chord, node)
                };
                FRAC_2_PI * self.kinks(x, of_kink)
            }
        }
    }

    /// The load ∫ p dt outside r, inside `end`, that follows from an image that is linear in x² between the nodes.
    pub(super) fn load_outside(&self, r: f64, end: f64) -> f64 {
        if self.is_empty() || r >= end {
            return 0.0;
        }
        let geometry = self.geometry;
        let (from, to) = (geometry.place(r), geometry.place(end));
        let images = || self.places.iter().map(|t| self.image(geometry.radius(*t))).collect();
        let images: &Vec<f64> = self.images.get_or_init(images);
        let first = self.places.partition_point(|t| *t <= from);
        let last = self.places.partition_point(|t| *t < to).max(first);
        let radii = self.places[first..last].iter().map(|t| geometry.radius(*t)).chain([end]);
        let values = images[first..last].iter().copied().chain([self.image(end)]);
        let (mut at, mut value, mut area) = (r, between(&self.places, images, first, from), 0.0);
        let mut load = 0.0;
        for (radius, image) in radii.zip(values) {
            let up_to = kernel_area(geometry, r, radius);
            load += (image - value) * (up_to - area) / ((radius - at) * (radius + at));
            (at, value, area) = (radius, image, up_to);
        }
        load
    }
}

/// The cells of a later mesh next to an old stick edge. There the wear begins like a square root. The later mesh
/// is too coarse for that, so the sum of both wears oscillates, although the surface has been worn smooth.
struct Window {
    /// The nodes of all meshes within the window, with its two ends.
    nodes: RangeInclusive<usize>,
    /// The nodes next to it.
    beyond: [usize; 2],
    /// The least later wear there.
    least: f64,
}

impl Window {
    /// `None` if the later mesh does not contain the window, or has not worn it.
    fn around(edge: f64, (places, wear): (&[f64], &[f64]), nodes: &[f64]) -> Option<Self> {
        let next = places.partition_point(|t| *t <= edge);
        let from = next.checked_sub(BESIDE + 2)?;
        let to = next + BESIDE + 1;
        let least = wear.get(from..=to)?.iter().copied().fold(f64::INFINITY, f64::min);
        let place = |node: usize| nodes.partition_point(|t| *t < places[node]);
        let beyond = [from, to].map(place);
        let nodes = place(from + 1)..=place(to - 1);
        (least > 0.0).then_some(Self { nodes, beyond, least })
    }

    /// Removes what deviates from a cubic that continues the surface beside the window, as far as the later wear is
    /// deeper. The volume stays the same. Returns the share that was removed.
    fn smooth(&self, nodes: &[f64], wear: &mut [f64], profile: impl Fn(f64) -> f64) -> f64 {
        let (first, last) = (*self.nodes.start(), *self.nodes.end());
        let length = nodes[last] - nodes[first];
        let surface = |j: usize| wear[j] + profile(nodes[j]);
        let slope = |i: usize, j: usize| length * (surface(j) - surface(i)) / (nodes[j] - nodes[i]);
        let ends = [surface(first), surface(last)];
        let slopes = [slope(self.beyond[0], first), slope(last, self.beyond[1])];
        let along = |j: usize| (nodes[j] - nodes[first]) / length;
        let deviations: Vec<f64> =
            self.nodes.clone().map(|j| surface(j) - hermite(ends, slopes, along(j))).collect();
        let arch = |j: usize| {
            let u = along(j);
            u * u * (1.0 - u) * (1.0 - u)
        };
        let (mut area, mut arches, mut highest) = (0.0, 0.0, 0.0_f64);
        for j in first + 1..last {
            let width = nodes[j + 1] - nodes[j - 1];
            area += width * deviations[j - first];
            arches += width * arch(j);
            highest = highest.max(deviations[j - first].abs());
        }
        let share = (self.least / (LEVELS * highest)).min(1.0);
        for j in first + 1..last {
            wear[j] -= share * (deviations[j - first] - area / arches * arch(j));
        }
        share
    }
}

/// The cubic on 0…1 with these values and slopes at its ends.
fn hermite(ends: [f64; 2], slopes: [f64; 2], u: f64) -> f64 {
    let v = 1.0 - u;
    v * v * ((1.0 + 2.0 * u) * ends[0] + u * slopes[0])
        + u * u * ((1.0 + 2.0 * v) * ends[1] - v * slopes[1])
}

/// The linear interpolation of `values` at nodes, of which `right` is the first beyond `at`. Outside the nodes it is
/// the first or the last value; without nodes it is 0.
fn between(nodes: &[f64], values: &[f64], right: usize, at: f64) -> f64 {
    match right {
        0 => values.first().copied().unwrap_or(0.0),
        _ if right == nodes.len() => values[right - 1],
        _ => {
            let share = (at - nodes[right - 1]) / (nodes[right] - nodes[right - 1]);
            values[right - 1] + share * (values[right] - values[right - 1])
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// A ring of wear, linear in t on each side of its deepest point.
    fn ring() -> PriorWear {
        PriorWear::of(Geometry::Round, vec![0.25, 0.49, 1.0], vec![0.0, 0.3, 0.0], 1.0)
    }

    #[test]
    fn the_image_and_its_integral_agree_with_midpoint_sums() {
        let prior = ring();
        // x ∫ w′(r)/√(x²−r²) dr by the substitution r = x sin θ.
        let slope = |t: f64| match t {
            t if !(0.25..=1.0).contains(&t) => 0.0,
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
            assert!((prior.image(x) - image).abs() < 5e-5, "{x}: {} {image}", prior.image(x));
            let area = midpoint(0.0, x, &|x| prior.image(x));
            assert!((prior.image_area(x) - area).abs() < 1e-6, "{x}");
        }
    }

    #[test]
    fn wear_on_top_of_wear_adds_up_at_every_radius() {
        let sum = ring().with(Geometry::Round, &[0.0, 0.36, 0.64], &[0.1, 0.1, 0.0], 1.0, |_| 0.0);
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
        let all = PriorWear::of(Geometry::Round, squares, wear, 1.0);
        let thinned = all.clone().thinned(250);
        assert!(thinned.places.len() <= 1000, "{}", thinned.places.len());
        let areas = |x: f64| (thinned.image_area(x), all.image_area(x));
        assert!([0.3, 0.9, 1.5].map(areas).iter().all(|(a, b)| (a - b).abs() < 1e-5));
        let values = |t: f64| (thinned.at(t), all.at(t));
        assert!([0.001, 0.01, 0.5, 0.9].map(values).iter().all(|(a, b)| (a - b).abs() < 1e-4));
    }

    /// Nodes at equal distances in t, without wear.
    fn even_nodes(count: u32) -> Vec<f64> {
        (0..=count).map(|i| f64::from(i) / f64::from(count)).collect()
    }

    #[test]
    fn waves_from_node_to_node_are_removed_and_the_volume_stays() {
        let squares = even_nodes(40);
        let smooth: Vec<f64> = squares.iter().map(|t| 1.0 + t * t * (1.0 - t)).collect();
        let sign = |i: usize| if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        let waves: Vec<f64> = (0..=40).map(|i| smooth[i] + 0.01 * sign(i)).collect();
        let prior = PriorWear::of(Geometry::Round, vec![0.0, 1.0], vec![0.0, 0.0], 1.0);
        let volume = |wear: &[f64]| {
            PriorWear::of(Geometry::Round, squares.clone(), wear.to_vec(), 1.0).volume()
        };
        for wear in [&smooth, &waves] {
            let even = prior.evened(&squares, wear, |_| 0.0);
            assert!((volume(&even) - volume(wear)).abs() < 1e-12);
            for (even, smooth) in even[2..39].iter().zip(&smooth[2..39]) {
                assert!((even - smooth).abs() < 5e-4, "{even} {smooth}");
            }
        }
    }

    #[test]
    fn later_wear_smooths_the_surface_at_an_old_stick_edge() {
        let before = even_nodes(400);
        let ring = before.iter().map(|t| 0.1 * (t - 0.301).max(0.0).sqrt()).collect();
        let prior = PriorWear::of(Geometry::Round, before, ring, 1.0).with_edge(0.301_f64.sqrt());
        let squares = even_nodes(50);
        let bump = |later: f64| {
            let sum = prior.with(Geometry::Round, &squares, &[later; 51], 1.0, |_| 0.0);
            assert!((sum.volume() - prior.volume() - later * PI).abs() < 1e-12);
            // A sharp bend at the edge.
            sum.at(0.303) - 0.5 * (sum.at(0.301) + sum.at(0.305))
        };
        let (little, much) = (bump(1e-6), bump(1.0));
        assert!(little > 4e-4 && much.abs() < 0.2 * little, "{little} {much}");
    }
}
