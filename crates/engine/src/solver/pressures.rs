//! Mean pressures at the output radii.
//!
//! The pressure can be infinite at a tip, at a sharp edge and at a worn stick edge. Therefore the pressure of a profile
//! is a mean over a ring around the radius. So a trapezoid over the profile gives the normal force, however thin a peak
//! is.
//!
//! # Equations
//! A place t is r², or x in a line contact. Springs outside c, with constant y in each cell, carry outside r ≤ c:
//! ```text
//! ∫ p dt = y(c)·K(r,c) + Σ y_q [K(r,r_{q+1}) − K(r,r_q)]
//! K(r,x) = (2/π)·√(x²−r²)   round,   (1/π)·arccos(r/x)   line
//! ∫ K dx² = (4/3π)·(x²−r²)^{3/2},    (1/π)·(x² arccos(r/x) − r√(x²−r²))
//! ```
//! The last line is for images that are linear in x² between nodes.

use std::f64::consts::{FRAC_1_PI, FRAC_2_PI};
use std::sync::OnceLock;

use crate::contact::Geometry;
use crate::numeric::Gauss;

/// A kink nearer than this share to the end of a piece is at its end. Between both, points would round to the end, where the
/// pressure can be infinite.
const ROUNDED: f64 = 1e-12;

/// The rings around the output radii. They meet between neighbours: where r² is the product of both radii, or in the
/// middle in a line contact. So the area of a ring is its weight in a trapezoid over 2πr·p or over p.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Rings {
    geometry: Geometry,
    /// The ends of the rings; the first is the axis, the last is the last radius. The first ring is a small one around
    /// the axis.
    pub(crate) ends: Vec<f64>,
}

impl Rings {
    pub(crate) fn around(geometry: Geometry, radii: &[f64]) -> Self {
        let between = |r: &[f64]| match geometry {
            Geometry::Round if r[0] > 0.0 => (r[0] * r[1]).sqrt(),
            _ => 0.5 * (r[0] + r[1]),
        };
        let ends = radii.windows(2).map(between).chain(radii.last().copied());
        Self { geometry, ends: std::iter::once(0.0).chain(ends).collect() }
    }

    /// The load of each ring, from the load outside each of its ends.
    pub(crate) fn between(outside: &[f64]) -> Vec<f64> {
        outside.windows(2).map(|ends| ends[0] - ends[1]).collect()
    }

    /// The loads ∫ p dt of the rings inside `edge`, of a pressure that can be infinite at `kinks` and on the axis.
    pub(crate) fn loads(
        &self,
        edge: f64,
        kinks: &[f64],
        pressure: impl Fn(f64) -> f64,
    ) -> Vec<f64> {
        static RULE: OnceLock<Gauss<8>> = OnceLock::new();
        let rule = RULE.get_or_init(Gauss::new);
        // Points are dense at both ends, because a pressure can be infinite or steep there.
        let piece = |from: f64, to: f64| -> f64 {
            let points = rule.nodes.iter().zip(&rule.weights).map(|(s, weight)| {
                let r = from + (to - from) * s * s * (3.0 - 2.0 * s);
                let place = if self.geometry == Geometry::Round { 2.0 * r } else { 1.0 };
                6.0 * s * (1.0 - s) * weight * place * pressure(r)
            });
            (to - from) * points.sum::<f64>()
        };
        let inside = self.ends.windows(2).take_while(|ends| ends[0] < edge);
        inside
            .map(|ends| {
                let (mut load, mut from, to) = (0.0, ends[0], ends[1].min(edge));
                let before = (1.0 - ROUNDED) * to;
                for kink in kinks.iter().filter(|kink| ends[0] < **kink && **kink < before) {
                    load += piece(from, *kink);
                    from = *kink;
                }
                load + piece(from, to)
            })
            .collect()
    }

    /// The mean pressures of rings with these loads. Noise can make a load negative; the next rings carry it.
    pub(crate) fn means(&self, loads: &[f64]) -> Vec<f64> {
        let mut owed = 0.0;
        let mean = |(ring, load): (usize, &f64)| {
            // A trapezoid over 2πr·p gives the axis no weight, so the ring of the first radius extends to the axis.
            let axis = if ring == 1 && self.geometry == Geometry::Round { loads[0] } else { 0.0 };
            let carried = (load + axis + owed).max(0.0);
            owed += load + axis - carried;
            carried / self.area(ring)
        };
        loads.iter().enumerate().map(mean).collect()
    }

    /// Lets the last ring before the ring `edge` carry all that the rings from there on carry.
    pub(crate) fn end_before(&self, edge: usize, pressure: &mut [f64]) {
        let outside: f64 = (edge..pressure.len()).map(|i| pressure[i] * self.area(i)).sum();
        pressure[edge - 1] += outside / self.area(edge - 1);
        pressure[edge..].fill(0.0);
    }

    /// The weight of a ring in a trapezoid: its width in its place.
    pub(crate) fn area(&self, ring: usize) -> f64 {
        let inner =
            if ring == 1 && self.geometry == Geometry::Round { 0.0 } else { self.ends[ring] };
        self.geometry.place(self.ends[ring + 1]) - self.geometry.place(inner)
    }
}

/// The kernel K(r, x) for r ≤ x.
pub(crate) fn kernel(geometry: Geometry, r: f64, x: f64) -> f64 {
    match geometry {
        Geometry::Round => FRAC_2_PI * ((x - r) * (x + r)).max(0.0).sqrt(),
        Geometry::Line => FRAC_1_PI * libm::acos((r / x).min(1.0)),
    }
}

/// ∫ K(r, x) dx² from r to x.
pub(crate) fn kernel_area(geometry: Geometry, r: f64, x: f64) -> f64 {
    let square = ((x - r) * (x + r)).max(0.0);
    match geometry {
        Geometry::Round => FRAC_2_PI / 1.5 * square * square.sqrt(),
        Geometry::Line => x * x * kernel(geometry, r, x) - FRAC_1_PI * r * square.sqrt(),
    }
}
