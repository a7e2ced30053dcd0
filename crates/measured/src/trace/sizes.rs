//! Areas and volumes of the removed and the added material, with their errors.
//!
//! # Equations
//! ```text
//! A = Σ w·d        V = π Σ w·|x − a|·d        ∂V/∂a = −π Σ w·sgn(x − a)·d
//! ```
//! d is the depth or height, w the length for which a point stands, and a the axis. So each side of the trace is half of a
//! body of revolution. The errors are standard deviations: from the scatter of the points, of which neighbours go together,
//! from the covariance of the unworn surface, for volumes from the axis, and from points that are clipped or left out.

use std::f64::consts::PI;
use std::ops::Range;

use serde_json::{Value, json};

use super::parts::Part;
use super::scar::Scar;

/// Left and right are alike if the centroid is this near to the middle, as a share of the width. Noise moves the ends by
/// about its share of the depth.
const ALIKE: f64 = 0.007;

/// A number with its standard deviation.
#[derive(Debug, Clone, Copy, Default)]
pub struct Size {
    /// The number.
    pub value: f64,
    /// Contributions of the scatter, of the unworn surface, of the axis with the difference of both sides, and of clipped or missing
    /// points.
    pub errors: [f64; 4],
}

impl Size {
    /// The standard deviation.
    pub fn error(&self) -> f64 {
        self.errors.iter().map(|it| it * it).sum::<f64>().sqrt()
    }

    /// As JSON.
    pub fn json(&self) -> Value {
        json!({"value": self.value, "error": self.error()})
    }

    /// What most of the error comes from.
    pub fn cause(&self) -> &'static str {
        let causes = [
            "the scatter of the points",
            "the unworn surface, of which too little was measured or which is wavy. Measure farther",
            "the axis, because left and right differ",
            "points that are clipped or left out",
        ];
        let all = self.errors.iter().zip(causes);
        all.max_by(|one, other| one.0.total_cmp(other.0)).map_or("", |(_, cause)| cause)
    }
}

/// The axis, and the sizes about it.
#[derive(Debug)]
pub struct Sizes<'a> {
    points: &'a [(f64, f64)],
    scar: &'a Scar,
    /// The axis in x, and its standard deviation.
    pub axis: (f64, f64),
}

impl<'a> Sizes<'a> {
    /// The axis of a scar is its centroid, or where x is 0. Without a scar, it is the apex, or the middle of a plane.
    pub fn new(points: &'a [(f64, f64)], scar: &'a Scar, is_centred: bool) -> Self {
        let mut own = Self { points, scar, axis: (0.0, 0.0) };
        let surface = &scar.found.surface;
        if is_centred && scar.range.is_empty() {
            let middle = 0.5 * (points[0].0 + points[points.len() - 1].0);
            own.axis.0 = if surface.is_round { surface.vertex() } else { middle };
        } else if is_centred {
            let core: Vec<_> =
                scar.removed.iter().filter_map(|part| part.inside(&scar.range)).collect();
            let area = own.sum(&core, &|_| 1.0).value;
            let axis = own.sum(&core, &|x| x).value / area;
            let moment = own.sum(&core, &|x| (x - axis) / area);
            let [first, last] = scar.middle(points);
            let middle = 0.5 * (first + last);
            let distance = (axis - middle).abs();
            // The centroid is more accurate if left and right are alike. If they are not, the contact lies between the ends.
            let noise = surface.scatter * (last - first) / area;
            let alike = (ALIKE + noise) * (last - first);
            let are_alike = distance < alike.max(3.0 * moment.error());
            let square = moment.error() * moment.error() + 0.25 * distance * distance;
            own.axis = (if are_alike { axis } else { middle }, square.sqrt());
        }
        own
    }

    /// Positions, weights and heights of points for an integral of the heights times a weight, and its error from gaps. Lines
    /// join the part and its neighbours.
    fn weights(&self, part: &Part, weight: &dyn Fn(f64) -> f64) -> (Vec<(f64, f64, f64)>, f64) {
        let Range { start, end } = part.range;
        let (from, after) = (start.saturating_sub(1), (end + 1).min(self.points.len()));
        let heights = &self.scar.found.heights;
        let mut found: Vec<_> =
            (from..after).map(|at| (self.points[at].0, 0.0, heights[at])).collect();
        for at in 1..found.len() {
            let (x, length) = (found[at - 1].0, found[at].0 - found[at - 1].0);
            for (at, share) in [(at - 1, 0.25), (at, 0.75)] {
                found[at].1 += 0.5 * length * weight(x + share * length);
            }
        }
        let gaps = self.scar.gaps.iter().map(|gap| {
            let inside = gap.range.start.max(from)..gap.range.end.min(after);
            let inside = if inside.is_empty() { from..from } else { inside };
            let all: f64 = (inside.clone()).map(|at| found[at - from].1.abs()).sum();
            all * gap.error * gap.range.len() as f64 / inside.len().max(1) as f64
        });
        let gaps = gaps.sum();
        (found, gaps)
    }

    /// The sum of depths of removed parts, or of heights of added ones, each with a weight.
    fn sum(&self, parts: &[Part], weight: &dyn Fn(f64) -> f64) -> Size {
        let surface = &self.scar.found.surface;
        let (own, gaps): (Vec<_>, Vec<f64>) =
            parts.iter().map(|part| self.weights(part, weight)).unzip();
        let own = own.concat();
        let value: f64 = own.iter().map(|(_, weight, height)| weight * height).sum();
        let squares: f64 = own.iter().map(|(_, weight, _)| weight * weight).sum();
        let scatter = surface.scatter * (surface.together * squares).sqrt();
        let sign = if parts.first().is_some_and(|part| part.area < 0.0) { -1.0 } else { 1.0 };
        let missing = gaps.iter().sum();
        let weights = own.iter().map(|(x, weight, _)| (*x, *weight));
        let errors = [scatter, surface.error(weights), 0.0, missing];
        // The sum of nothing is −0.
        Size { value: sign * value + 0.0, errors }
    }

    /// The area of parts.
    pub fn area(&self, parts: &[Part]) -> Size {
        self.sum(parts, &|_| 1.0)
    }

    /// The volume of parts about the axis.
    pub fn volume(&self, parts: &[Part]) -> Size {
        let [left, right] = [-1.0, 1.0].map(|side| self.side(parts, side));
        let axis = self.axis.0;
        let mut volume = self.sum(parts, &|x| PI * (x - axis).abs());
        // Both sides are two samples of the same volume, so half of their difference is the error of their mean.
        let slope = self.sum(parts, &|x| PI * (x - axis).signum()).value;
        let (shift, half) = (slope * self.axis.1, 0.5 * (left.value - right.value));
        volume.errors[2] = (shift * shift + half * half).sqrt();
        volume
    }

    /// The volume that the parts have if both sides are like this one: the right side is 1, the left one −1.
    pub fn side(&self, parts: &[Part], side: f64) -> Size {
        let (axis, error) = self.axis;
        let share = |x: f64| PI * (1.0 + ((x - axis) * side).signum());
        let mut volume = self.sum(parts, &|x| share(x) * (x - axis).abs());
        volume.errors[2] = error * self.sum(parts, &share).value;
        volume
    }
}
