//! The limiting state of wear with held indentation depth and amplitude: (11)–(13).
//!
//! Inside the stick radius nothing wears. Outside, every spring wears until it carries no load. The image is then
//! flat, g = d, up to the limiting radius ã, where the worn profile meets the unworn profile.
//!
//! # Equations
//! ```text
//! w∞(r) = (2/π) ∫ᶜʳ (d − g₀(x))/√(r²−x²) dx      for c < r < ã       (12) − f₀
//! w∞(ã) = 0, ã > c                                                   (13)
//! V∞    = 4 ∫ᶜᵃ (d − g₀(x)) √(ã²−x²) dx          (the upper end is ã)
//! ```
//! Equation (19) of the paper is up to 3.6 % below the root of (13). This module solves (13).
//!
//! # Accuracy
//! Radius and volume to 1e-9 (the volume to 3e-7 in gross slip with an exponent between 1 and 2). The depth to
//! 1e-11, and its radius to 1e-8 (1e-6 for c below 0.01).
//!
//! # Sources
//! V. L. Popov, *Sci. Rep.* 4 (2014) 3749.

use std::f64::consts::FRAC_2_PI;

use super::profile::Shape;
use crate::numeric::{Bracket, integrate, integrate_pieces, maximum, root};

/// Largest scar radius in a₀ in gross slip under a held force. The scales of the unworn contact do not fit
/// larger scars.
pub const WIDEST: f64 = 100.0;
/// Largest wear depth in d₀ in this case.
pub const DEEPEST: f64 = 1000.0;

/// Most steps of 2 % in the search for ã, to each side.
const MOST_STEPS: usize = 500;
/// Relative accuracy of ã. Each evaluation sums over all rows of a table.
const SCAR_DIGITS: f64 = 1e-13;

/// The limiting state in units of a₀, d₀ and a₀²d₀.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// ã: the outer radius of the scar, where the limiting profile meets the unworn profile.
    pub radius: f64,
    /// V∞.
    pub volume: f64,
    /// The largest wear depth.
    pub depth: f64,
    /// The radius of the largest wear depth.
    pub depth_radius: f64,
}

impl Limit {
    /// Solves (13) for a stick radius 0 ≤ c < 1 at the unworn depth. c = 0 is gross slip, where all springs wear.
    ///
    /// `None` if the scar would become larger than the shape, such as a sphere loaded to its equator.
    #[must_use]
    pub fn solve(shape: &Shape, c: f64) -> Option<Self> {
        Self::at_depth(shape, c, 1.0)
    }

    /// Solves (13) for a depth d ≥ 1 in units of d₀.
    ///
    /// `None` as for [`Limit::solve`].
    pub(crate) fn at_depth(shape: &Shape, c: f64, d: f64) -> Option<Self> {
        // w∞ is positive at r = 1, or just outside a larger c, and falls further out. The loop goes outwards until
        // the sign changes.
        let wear = |r: f64| limiting_wear(shape, c, d, r, chord_and_angle(c, r));
        let (mut inner, mut step) = (c.max(1.0), (1.0 - c).max(1e-12));
        let outer = loop {
            let outer = (inner + step).min(shape.extent());
            if wear(outer) < 0.0 {
                break outer;
            }
            if outer >= shape.extent() {
                return None;
            }
            inner = outer;
            step *= 1.5;
        };
        let radius = root(inner, outer, wear);
        let chord = |x: f64| ((radius - x) * (radius + x)).max(0.0).sqrt();
        // For a kink near c, subtracts the part inside c, as in `integrate_beyond`. Otherwise x = ã − (ã − c)s²
        // removes the square root at the end of the integrand.
        let width = radius - c;
        let volume = if shape.kinks().iter().any(|kink| c - kink < width) {
            let of_spring = |x: f64| (d - shape.image(x)) * chord(x);
            let part = |to: f64| integrate_pieces(0.0, to, shape.kinks(), of_spring);
            4.0 * (part(radius) - part(c))
        } else {
            8.0 * width
                * integrate(0.0, 1.0, |s| {
                    let x = radius - width * s * s;
                    s * (d - shape.image(x)) * chord(x)
                })
        };
        let (depth, depth_radius) = if c == 0.0 {
            (d, 0.0)
        } else {
            let deepest = maximum(c, radius, wear);
            (wear(deepest), deepest)
        };
        Some(Self { radius, volume, depth, depth_radius })
    }
}

impl Limit {
    /// Only ã, the root of (13), from a guess close to it.
    pub(crate) fn scar(shape: &Shape, c: f64, d: f64, guess: f64) -> f64 {
        let wear = |r: f64| limiting_wear(shape, c, d, r, chord_and_angle(c, r));
        // The wear is positive where the unworn image is below d. It has another root at c.
        let worn = |r: f64| r <= c || shape.image(r) < d || wear(r) > 0.0;
        let step = |r: f64| 0.02 * (r - c).max(0.01 * r);
        let (mut inner, mut outer) = (guess, guess);
        for _ in 0..MOST_STEPS {
            if worn(inner) {
                break;
            }
            outer = inner;
            inner -= step(inner);
        }
        for _ in 0..MOST_STEPS {
            if outer > inner && !worn(outer) || outer >= shape.extent() {
                break;
            }
            inner = outer;
            outer = (outer + step(outer)).min(shape.extent());
        }
        let mut bracket = Bracket::new((inner, wear(inner)), (outer, wear(outer)));
        while let Some(r) = bracket.next().filter(|_| bracket.width() > SCAR_DIGITS) {
            bracket.narrow(r, wear(r));
        }
        bracket.found()
    }
}

/// √(r²−c²) and arccos(c/r), without loss of digits for r close to c.
pub(crate) fn chord_and_angle(c: f64, r: f64) -> (f64, f64) {
    let chord = ((r - c) * (r + c)).max(0.0).sqrt();
    (chord, libm::atan(chord / c))
}

/// w∞(r) for r ≥ c at a depth d.
pub(crate) fn limiting_wear(
    shape: &Shape,
    c: f64,
    d: f64,
    r: f64,
    (chord, angle): (f64, f64),
) -> f64 {
    FRAC_2_PI * angle * d - shape.inverse_outside(c, r, chord, angle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

    #[test]
    fn the_cone_obeys_the_papers_equation_20() {
        for c in [0.05, 0.21, 0.368, 0.522, 0.9, 0.9999] {
            let a = Limit::solve(&Shape::power(1.0), c).expect("a root").radius;
            let left = FRAC_PI_2 - libm::asin(c / a);
            assert!((left - (a * a - c * c).sqrt()).abs() < 1e-12, "c = {c}");
        }
    }

    #[test]
    fn gross_slip_wears_until_the_apex_touches_no_more() {
        let paraboloid = Limit::solve(&Shape::power(2.0), 0.0).expect("a root");
        assert!((paraboloid.radius - SQRT_2).abs() < 1e-12);
        assert!((paraboloid.volume - PI).abs() < 1e-12);
        assert_eq!((paraboloid.depth, paraboloid.depth_radius), (1.0, 0.0));
        let cone = Limit::solve(&Shape::power(1.0), 0.0).expect("a root");
        assert!((cone.radius - FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn the_volume_of_the_1d_formula_is_that_of_the_profile() {
        // 2π ∫ w r dr over the profile itself: an independent way to the same number.
        for (shape, c) in [
            (Shape::power(2.0), 0.5),
            (Shape::power(1.0), 0.21),
            (Shape::power(2.5), 0.3),
            (Shape::power(6.0), 0.8),
            (Shape::sphere(2.5), 0.4),
            (Shape::power(2.0), 0.999),
            (Shape::truncated_paraboloid(0.4), 0.6),
            (Shape::truncated_paraboloid(0.4), 0.400_001),
            (Shape::truncated_paraboloid(0.9), 0.0),
            (Shape::truncated_cone(0.2), 0.0),
            (Shape::truncated_cone(0.7), 0.9),
        ] {
            let limit = Limit::solve(&shape, c).expect("a root");
            // Square-root behaviour at c: r = c + width·s².
            let width = limit.radius - c;
            let at = |s: f64| {
                let r = c + width * s * s;
                s * r * limiting_wear(&shape, c, 1.0, r, chord_and_angle(c, r))
            };
            let kinks: Vec<f64> = shape
                .kinks()
                .iter()
                .filter(|kink| **kink > c)
                .map(|kink| ((kink - c) / width).sqrt())
                .collect();
            let volume = 4.0 * PI * width * integrate_pieces(0.0, 1.0, &kinks, at);
            assert!((volume / limit.volume - 1.0).abs() < 1e-9, "{shape:?} {c}: {volume}");
        }
    }
}
