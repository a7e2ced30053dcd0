//! Areas and volumes of the removed and the added material, with their errors.
//!
//! # Equations
//! ```text
//! A = Σ w·d        V = π Σ w·|x − a|·d        ∂V/∂a = −π Σ w·sgn(x − a)·d
//! ```
//! d is the depth or height, w the length for which a point stands, and a the axis. So each side of the trace is half of a
//! body of revolution. The errors are standard deviations: from the scatter of the points, of which neighbours go together,
//! from the covariance of the unworn surface, for volumes from the axis, and from points beyond the range of the instrument.

use std::f64::consts::PI;

use serde_json::{Value, json};

use super::parts::{Part, widths};
use super::scar::Scar;

/// Left and right are alike if the centroid is this near to the middle, as a share of the width.
const ALIKE: f64 = 0.02;

/// A number with its standard deviation.
#[derive(Debug, Clone, Copy, Default)]
pub struct Size {
    /// The number.
    pub value: f64,
    /// Contributions of the scatter, of the unworn surface, of the axis, and of points beyond the range of the instrument.
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
        let [scatter, surface, axis, clipped] = self.errors;
        if clipped > scatter.max(surface).max(axis) {
            "the points beyond the range of the instrument"
        } else if axis > scatter.max(surface) {
            "the axis, because left and right differ"
        } else if surface > scatter {
            "the unworn surface, of which too little was measured or which is wavy. Measure farther"
        } else {
            "the scatter of the points"
        }
    }
}

/// The axis, and the sizes about it.
#[derive(Debug)]
pub struct Sizes<'a> {
    points: &'a [(f64, f64)],
    scar: &'a Scar,
    widths: Vec<f64>,
    /// The axis in x, and its standard deviation.
    pub axis: (f64, f64),
}

impl<'a> Sizes<'a> {
    /// The axis of a scar is its centroid, or where x is 0. Without a scar, it is the apex, or the middle of a plane.
    pub fn new(points: &'a [(f64, f64)], scar: &'a Scar, is_centred: bool) -> Self {
        let mut own = Self { points, scar, widths: widths(points), axis: (0.0, 0.0) };
        let surface = &scar.found.surface;
        if is_centred && scar.range.is_empty() {
            let middle = 0.5 * (points[0].0 + points[points.len() - 1].0);
            own.axis.0 = if surface.is_round { surface.vertex() } else { middle };
        } else if is_centred {
            let area = own.sum(&scar.removed, |_| 1.0).value;
            let axis = own.sum(&scar.removed, |x| x).value / area;
            let moment = own.sum(&scar.removed, |x| (x - axis) / area);
            let ends = scar.ends(points).unwrap_or([axis; 2]);
            let middle = 0.5 * (ends[0] + ends[1]);
            let distance = (axis - middle).abs();
            // The centroid is more accurate if left and right are alike. If they are not, the contact lies between the ends.
            let are_alike = distance < (ALIKE * (ends[1] - ends[0])).max(3.0 * moment.error());
            own.axis =
                (if are_alike { axis } else { middle }, moment.error().hypot(0.5 * distance));
        }
        own
    }

    /// The sum of depths of removed parts, or of heights of added ones, each with a weight.
    fn sum(&self, parts: &[Part], weight: impl Fn(f64) -> f64) -> Size {
        let surface = &self.scar.found.surface;
        let all = || parts.iter().flat_map(|part| part.range.clone());
        let weights =
            || all().map(|at| (self.points[at].0, self.widths[at] * weight(self.points[at].0)));
        let heights = all().map(|at| self.scar.found.heights[at]);
        let value =
            weights().zip(heights).map(|((_, weight), height)| weight * height).sum::<f64>();
        let squares: f64 = weights().map(|(_, weight)| weight * weight).sum();
        let sign = if parts.first().is_some_and(|part| part.area < 0.0) { -1.0 } else { 1.0 };
        let scatter = surface.scatter * (surface.together * squares).sqrt();
        let beyond = self.scar.beyond.as_ref().filter(|beyond| value * beyond.height > 0.0);
        let clipped = beyond.map_or(0.0, |beyond| {
            let inside = all().zip(weights()).filter(|(at, _)| beyond.range.contains(at));
            inside.map(|(_, (_, weight))| weight * beyond.height).sum::<f64>()
        });
        Size { value: sign * value, errors: [scatter, surface.error(weights()), 0.0, clipped] }
    }

    /// The area of parts.
    pub fn area(&self, parts: &[Part]) -> Size {
        self.sum(parts, |_| 1.0)
    }

    /// The volume of parts about the axis. With a `side` of 1 or −1, only this side counts, for a whole revolution.
    pub fn volume(&self, parts: &[Part], side: f64) -> Size {
        let (axis, error) = self.axis;
        let share =
            |x: f64| if side == 0.0 { PI } else { PI * (1.0 + ((x - axis) * side).signum()) };
        let volume = self.sum(parts, |x| share(x) * (x - axis).abs());
        let slope = self.sum(parts, |x| share(x) * (x - axis).signum()).value;
        let [scatter, surface, _, clipped] = volume.errors;
        Size { errors: [scatter, surface, (slope * error).abs(), clipped], ..volume }
    }
}
