//! The limiting state at constant indentation depth and amplitude: (11)–(13).
//!
//! Nothing wears inside the stick radius c. Outside c, every spring is worn until it carries no
//! load. The image is therefore flat, g = d, between c and the limiting radius ã. At ã the worn
//! profile meets the unworn profile.
//!
//! # Equations
//! ```text
//! w∞(r) = (2/π) ∫ᶜʳ (d − g₀(x))/√(r²−x²) dx      for c < r < ã       (12) − f₀
//! w∞(ã) = 0, ã > c                                                   (13)
//! V∞    = 4 ∫ᶜᵃ (d − g₀(x)) √(ã²−x²) dx          (the upper end is ã)
//! ```
//! In a line contact with its force and tangential force held, F(s)/F₀ is the image:
//! ```text
//! w∞(x) = x ∫ᶜˣ (1 − F(s)/F₀)/(s √(x²−s²)) ds,   V∞ = 2 ∫ᶜᵃ (1 − F(s)/F₀) √(ã²−s²) ds/s
//! ```
//! If everything slips, a line contact has no limiting state: its scar grows for ever.
//!
//! Equation (19) of the paper gives values up to 3.6 % below the root of (13). This module solves
//! (13) itself.
//!
//! # Accuracy
//! Radius and volume: 1e-9. In gross slip with a non-integer exponent between 1 and 2 the volume is
//! accurate to 3e-7. Depth: 1e-11. Radius of the greatest depth: 1e-8 (1e-6 for c below 0.01).
//!
//! # Sources
//! V. L. Popov, *Sci. Rep.* 4 (2014) 3749.

use std::f64::consts::FRAC_2_PI;

use super::{Geometry, Shape};
use crate::numeric::{integrate, integrate_pieces, maximum, root, root_between};

/// Maximum scar radius, in a₀, in gross slip at constant force. Further out the shape is unknown,
/// because the scar is much larger than the unworn contact.
pub const WIDEST: f64 = 100.0;
/// Maximum wear depth, in d₀, in gross slip at constant force.
pub const DEEPEST: f64 = 1000.0;

/// Maximum number of steps of 2 % to either side in the search for ã.
const MOST_STEPS: usize = 500;
/// Relative tolerance of the scar radius. It limits the number of evaluations, because each
/// evaluation of a table sums over all its rows.
const SCAR_DIGITS: f64 = 1e-13;

/// The limiting state in units of a₀, d₀ and a₀²d₀.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limit {
    /// ã, the radius of the scar, where the limiting profile meets the unworn profile.
    pub radius: f64,
    /// V∞, the limiting volume.
    pub volume: f64,
    /// The greatest wear depth.
    pub depth: f64,
    /// The radius at which the wear is deepest.
    pub depth_radius: f64,
}

impl Limit {
    /// Solves (13) for a stick radius 0 ≤ c < 1 at the unworn depth. c = 0 means gross slip, where
    /// all springs wear.
    ///
    /// `None` if the scar would become larger than the shape (a sphere loaded to its equator), and for a line contact in
    /// gross slip.
    pub fn solve(shape: &Shape, c: f64) -> Option<Self> {
        Self::at_depth(shape, c, 1.0)
    }

    /// Solves (13) for a depth d ≥ 1 in units of d₀.
    ///
    /// `None` under the same condition as for [`Limit::solve`].
    pub(crate) fn at_depth(shape: &Shape, c: f64, d: f64) -> Option<Self> {
        let geometry = shape.geometry();
        if geometry == Geometry::Line && c == 0.0 {
            return None;
        }
        // w∞ is positive at r = 1, or just outside c if c > 1, and decreases further out. Search
        // outwards until w∞ changes sign.
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
        // If a kink is close to c, subtract the integral inside c, as in `integrate_beyond`.
        // Otherwise the substitution x = ã − (ã − c)s² removes the square root at the end.
        let width = radius - c;
        let volume = if geometry == Geometry::Line {
            // With s = ã (c/ã)^v² the root at the end is smooth, and small s/ã have their share.
            let ratio = libm::log(c / radius);
            let of_spring = |v: f64| {
                let s = radius * libm::exp(ratio * v * v);
                v * (d - shape.image(s)) * chord(s)
            };
            let kinks: Vec<f64> = shape
                .kinks()
                .iter()
                .map(|kink| (libm::log(kink / radius) / ratio).max(0.0).sqrt())
                .collect();
            -4.0 * ratio * integrate_pieces(0.0, 1.0, &kinks, of_spring)
        } else if shape.kinks().iter().any(|kink| c - kink < width) {
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

    /// The scar radius ã: the root of (13), found from a first guess.
    pub(crate) fn scar(shape: &Shape, c: f64, d: f64, guess: f64) -> f64 {
        let wear = |r: f64| limiting_wear(shape, c, d, r, chord_and_angle(c, r));
        // The wear is positive where the unworn image is below d. (13) has another root at c, which
        // is excluded.
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
        root_between(SCAR_DIGITS, (inner, wear(inner)), (outer, wear(outer)), wear)
    }
}

/// √(r²−c²) and arccos(c/r), without loss of digits if r is close to c.
pub(crate) fn chord_and_angle(c: f64, r: f64) -> (f64, f64) {
    let chord = ((r - c) * (r + c)).max(0.0).sqrt();
    (chord, libm::atan(chord / c))
}

/// w∞(r) for r ≥ c at a depth d. In a line contact d is the force in units of F₀.
pub(crate) fn limiting_wear(
    shape: &Shape,
    c: f64,
    d: f64,
    r: f64,
    (chord, angle): (f64, f64),
) -> f64 {
    step(shape.geometry(), 1.0, c, (chord, angle)) * d - shape.inverse_outside(c, r, chord, angle)
}

/// The inverse transform at r of an image that is 0 inside c and `height` outside: (2/π) arccos(c/r) times the height, or
/// arcosh(r/c) in a line contact.
pub(crate) fn step(geometry: Geometry, height: f64, c: f64, (chord, angle): (f64, f64)) -> f64 {
    match geometry {
        Geometry::Round => height * FRAC_2_PI * angle,
        Geometry::Line => height * libm::asinh(chord / c),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Flank;
    use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

    #[test]
    fn the_cone_obeys_equation_20_of_the_paper() {
        for c in [0.05, 0.21, 0.368, 0.522, 0.9, 0.9999] {
            let a = Limit::solve(&Shape::power(1.0), c).expect("a root").radius;
            let left = FRAC_PI_2 - libm::asin(c / a);
            assert!((left - (a * a - c * c).sqrt()).abs() < 1e-12, "c = {c}");
        }
    }

    /// The table of the limiting states of a cylinder: V∞, ã and the greatest depth with its radius.
    #[test]
    fn a_cylinder_has_the_limiting_state_of_its_closed_form() {
        for (c, radius, volume, depth) in
            [(0.5_f64, 1.32728, 0.633_897, 0.547_596), (0.7, 1.17397, 0.154_809, 0.234_243)]
        {
            let limit = Limit::solve(&Shape::line_power(2.0), c).expect("a root");
            for (found, known) in
                [(limit.radius, radius), (limit.volume, volume), (limit.depth, depth)]
            {
                assert!((found / known - 1.0).abs() < 4e-6, "{c}: {found} {known}");
            }
            // ã from arcosh(ã/c) = ã √(ã²−c²); the depth is greatest at x² = (1 + c²)/2.
            let a = limit.radius;
            assert!((libm::acosh(a / c) - a * (a * a - c * c).sqrt()).abs() < 1e-12);
            assert!((limit.depth_radius - (0.5 * (1.0 + c * c)).sqrt()).abs() < 1e-7);
        }
        assert!(Limit::solve(&Shape::line_power(2.0), 0.0).is_none());
    }

    #[test]
    fn gross_slip_removes_the_tip_down_to_the_indentation_depth() {
        let paraboloid = Limit::solve(&Shape::power(2.0), 0.0).expect("a root");
        assert!((paraboloid.radius - SQRT_2).abs() < 1e-12);
        assert!((paraboloid.volume - PI).abs() < 1e-12);
        assert_eq!((paraboloid.depth, paraboloid.depth_radius), (1.0, 0.0));
        let cone = Limit::solve(&Shape::power(1.0), 0.0).expect("a root");
        assert!((cone.radius - FRAC_PI_2).abs() < 1e-12);
    }

    #[test]
    fn the_volume_of_a_line_contact_agrees_with_its_limiting_profile_however_small_the_core() {
        for (shape, c) in [1.0, 2.0]
            .into_iter()
            .flat_map(|exponent| [0.5, 0.02, 1e-3, 1e-7].map(|c| (Shape::line_power(exponent), c)))
        {
            let limit = Limit::solve(&shape, c).expect("a root");
            // With r = c·(ã/c)^u² the profile is smooth at the core, and has its share near it.
            let ratio = libm::log(limit.radius / c);
            let of = |u: f64| {
                let r = c * libm::exp(ratio * u * u);
                4.0 * ratio * u * r * limiting_wear(&shape, c, 1.0, r, chord_and_angle(c, r))
            };
            let volume = integrate_pieces(0.0, 1.0, &[0.3, 0.6, 0.9], of);
            assert!(
                (volume / limit.volume - 1.0).abs() < 1e-6,
                "{shape:?} {c}: {volume} {limit:?}"
            );
        }
    }

    #[test]
    fn the_volume_formula_agrees_with_the_volume_of_the_limiting_profile() {
        // 2π ∫ w r dr over the profile is an independent calculation of the volume.
        for (shape, c) in [
            (Shape::power(2.0), 0.5),
            (Shape::power(1.0), 0.21),
            (Shape::power(2.5), 0.3),
            (Shape::power(6.0), 0.8),
            (Shape::sphere(2.5), 0.4),
            (Shape::power(2.0), 0.999),
            (Shape::truncated(Flank::Paraboloid, 0.4), 0.6),
            (Shape::truncated(Flank::Paraboloid, 0.4), 0.400_001),
            (Shape::truncated(Flank::Paraboloid, 0.9), 0.0),
            (Shape::truncated(Flank::Cone, 0.2), 0.0),
            (Shape::truncated(Flank::Cone, 0.7), 0.9),
        ] {
            let limit = Limit::solve(&shape, c).expect("a root");
            // w∞ has a square root at c: r = c + width·s² removes it.
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
