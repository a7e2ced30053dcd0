//! Areas and volumes of the removed and the added material, with their errors.
//!
//! # Equations
//! ```text
//! A = Σ w·d        V = π Σ w·|x − a|·d        ∂V/∂a = −π Σ w·sgn(x − a)·d
//! ```
//! d is the depth or height, w the length for which a point stands, and a the axis. So each side of the trace is half of a
//! body of revolution. The errors are standard deviations: from the scatter of the points, of which neighbours go together,
//! from the covariance of the unworn surface and what its nearer half or an edge changes, for volumes from the axis, and from
//! points that are clipped or left out.

use std::f64::consts::PI;

use serde_json::{Value, json};

use super::parts::Part;
use super::scar::{Gap, Scar};

/// Left and right are alike if the centroid is this near to the middle, as a share of the width. Noise moves the ends by
/// about its share of the depth.
const ALIKE: f64 = 0.007;

/// A number with its standard deviation.
pub struct Size {
    /// The number.
    pub value: f64,
    /// Contributions of the scatter, of the unworn surface, of the axis with the difference of both sides (of a depth: of the width of
    /// the means), and of clipped or missing points.
    pub errors: [f64; 4],
}

impl Size {
    /// The standard deviation.
    pub fn error(&self) -> f64 {
        self.errors.into_iter().fold(0.0, libm::hypot)
    }

    /// As JSON, without the sign of added material.
    pub fn json(&self) -> Value {
        json!({"value": self.value.abs(), "error": self.error()})
    }

    /// As text, in a unit.
    pub fn text(&self, unit: f64) -> String {
        format!("{:.5} ± {:.2}", unit * self.value.abs(), unit * self.error())
    }

    /// What most of the error comes from.
    pub fn cause(&self) -> &'static str {
        let causes = [
            "the scatter of the points",
            "the unworn surface, of which too little was measured or which is no plane or circle. Measure farther",
            "the axis, because left and right differ",
            "points that are clipped or left out",
        ];
        let all = self.errors.iter().zip(causes);
        all.max_by(|one, other| one.0.total_cmp(other.0)).map_or("", |(_, cause)| cause)
    }
}

/// The axis, and the sizes about it.
pub struct Sizes<'a> {
    pub scar: &'a Scar,
    /// The axis in x, and its standard deviation.
    pub axis: (f64, f64),
}

impl<'a> Sizes<'a> {
    /// The axis of a scar is its centroid, or where x is 0. Without a scar, it is the apex, or the middle of a plane.
    pub fn new(scar: &'a Scar, is_centred: bool) -> Self {
        let (mut own, surface) = (Self { scar, axis: (0.0, 0.0) }, &scar.trace.surface);
        if is_centred && scar.range.is_empty() {
            own.axis.0 = surface.apex();
        } else if is_centred {
            let core = &scar.trace.inside(&scar.removed, &scar.range);
            let area = own.area(core).value;
            let [first, last] = scar.middle();
            let (middle, width) = (0.5 * (first + last), last - first);
            let axis = middle + own.sum(core, &|x| x - middle).value / area;
            let moment = own.sum(core, &|x| (x - axis) / area).error();
            let distance = (axis - middle).abs();
            // The centroid is more accurate if left and right are alike. If they are not, the contact lies between the ends.
            let alike = (ALIKE + surface.scatter * width / area) * width;
            let are_alike = distance < alike.max(3.0 * moment);
            own.axis = (if are_alike { axis } else { middle }, libm::hypot(moment, 0.5 * distance));
        }
        own
    }
    /// The sum of the depths or heights of parts, each with a weight.
    fn sum(&self, parts: &[Part], weight: &dyn Fn(f64) -> f64) -> Size {
        let Scar { trace, gaps, .. } = self.scar;
        let all = || parts.iter().flat_map(|part| part.range.clone());
        let weights = || all().map(|at| (trace.points[at].0, trace.share(at, weight)));
        let value: f64 = all().zip(weights()).map(|(at, own)| own.1 * trace.depths[at]).sum();
        let [scatter, surface] = self.scar.error(&weights());
        let inside = gaps.iter().filter(|gap| all().any(|at| gap.range.contains(&at)));
        let missing = inside.map(|Gap { range, error }| {
            let [from, to] = trace.ends(range);
            let middle = 4.0 * weight(0.5 * (from + to)).abs();
            error * (to - from) * (weight(from).abs() + middle + weight(to).abs()) / 6.0
        });
        let errors = [scatter, surface, 0.0, missing.sum()];
        Size { value, errors }
    }

    /// The area of parts.
    pub fn area(&self, parts: &[Part]) -> Size {
        self.sum(parts, &|_| 1.0)
    }

    /// The volume of parts about the axis.
    pub fn volume(&self, parts: &[Part]) -> Size {
        let [left, right] = [-1.0, 1.0].map(|side| self.side(parts, side));
        let mut volume = self.sum(parts, &|x| PI * (x - self.axis.0).abs());
        // Both sides are two samples of the same volume, so half of their difference is the error of their mean.
        let shift = 0.5 * (left.errors[2] - right.errors[2]);
        volume.errors[2] = libm::hypot(shift, 0.5 * (left.value - right.value));
        volume
    }

    /// The volume that the parts have if both sides are like this one: the right side is 1, the left one −1.
    pub fn side(&self, parts: &[Part], side: f64) -> Size {
        let (axis, error) = self.axis;
        let twice = |x: f64| PI * (1.0 + ((x - axis) * side).signum());
        let mut volume = self.sum(parts, &|x| twice(x) * (x - axis).abs());
        volume.errors[2] = error * self.sum(parts, &twice).value;
        volume
    }
}
