//! Paraboloids and cones with a flat tip of radius β, in units of a₀ and d₀. The tip is worn or cut
//! off.
//!
//! # Equations
//! Outside the flat (inside it, f and g are 0):
//! ```text
//! paraboloid   f = (A/2)(r² − β²)    g = A x √(x²−β²)
//! cone         f = A (r − β)         g = A x arccos(β/x)
//! ```
//! The factor A makes g(1) = 1. All springs under the flat have the compression d, so either all of
//! them slip or none of them slips: in partial slip c ≥ β. The pressure is infinite at r = β.
//!
//! # Accuracy
//! Closed forms are exact to rounding. The pressure uses Gauss rules, better than 1e-12.
//!
//! # Sources
//! U. B. C. O. Ejike, *Int. J. Eng. Sci.* 19 (1981) 865; D. Maugis, M. Barquins, *J. Phys. D* 16
//! (1983) 1843; the images: V. L. Popov, M. Heß, E. Willert, *Handbook of Contact Mechanics* (2019),
//! §2.5.9 and §2.5.10.

use std::f64::consts::{FRAC_1_PI, FRAC_2_PI};

use crate::numeric::{integrate, root};

/// The shape outside the flat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Flank {
    /// A paraboloid.
    Paraboloid,
    /// A cone.
    Cone,
}

/// A truncated paraboloid or cone with g(1) = 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Truncated {
    flank: Flank,
    /// β, the radius of the flat.
    flat: f64,
    /// The factor A that makes g(1) = 1.
    scale: f64,
}

/// √(x² − b²) outside b, and 0 inside b.
fn chord(x: f64, b: f64) -> f64 {
    ((x - b) * (x + b)).max(0.0).sqrt()
}

impl Truncated {
    /// A paraboloid or a cone with a flat of radius 0 < β < 1.
    pub(super) fn new(flank: Flank, flat: f64) -> Self {
        let chord = chord(1.0, flat);
        let scale = match flank {
            Flank::Paraboloid => 1.0 / chord,
            Flank::Cone => 1.0 / libm::atan2(chord, flat),
        };
        Self { flank, flat, scale }
    }

    /// The kinks of the image: only β.
    pub(super) fn kinks(&self) -> &[f64] {
        std::slice::from_ref(&self.flat)
    }

    /// arccos(β/x) for x ≥ β.
    fn angle(&self, x: f64) -> f64 {
        libm::atan2(chord(x, self.flat), self.flat)
    }

    pub(super) fn profile(&self, r: f64) -> f64 {
        let b = self.flat;
        let beyond = (r - b).max(0.0);
        match self.flank {
            Flank::Paraboloid => 0.5 * self.scale * beyond * (r + b),
            Flank::Cone => self.scale * beyond,
        }
    }

    pub(super) fn slope(&self, r: f64) -> f64 {
        match self.flank {
            _ if r < self.flat => 0.0,
            Flank::Paraboloid => self.scale * r,
            Flank::Cone => self.scale,
        }
    }

    pub(super) fn image(&self, x: f64) -> f64 {
        match self.flank {
            Flank::Paraboloid => self.scale * x * chord(x, self.flat),
            Flank::Cone => self.scale * x * self.angle(x),
        }
    }

    /// The rise of the image, g(c + δ) − g(c), without cancellation.
    pub(super) fn image_rise(&self, c: f64, delta: f64) -> f64 {
        let b = self.flat;
        if c <= b {
            return self.image(c + delta);
        }
        let x = c + delta;
        let inner = chord(c, b);
        let outer = ((c - b + delta) * (x + b)).sqrt();
        // The difference √(x²−β²) − √(c²−β²), without cancellation.
        let growth = delta * (x + c) / (outer + inner);
        self.scale
            * match self.flank {
                Flank::Paraboloid => delta * outer + c * growth,
                Flank::Cone => {
                    delta * libm::atan2(outer, b)
                        + c * libm::atan2(b * growth, b * b + inner * outer)
                }
            }
    }

    pub(super) fn image_slope(&self, x: f64) -> f64 {
        let b = self.flat;
        if x < b {
            return 0.0;
        }
        self.scale
            * match self.flank {
                Flank::Paraboloid => (x * x + (x - b) * (x + b)) / chord(x, b),
                Flank::Cone => self.angle(x) + b / chord(x, b),
            }
    }

    /// The radius at which the image equals `value` in 0…1. The result for 0 is β.
    pub(super) fn image_inverse(&self, value: f64) -> f64 {
        match self.flank {
            Flank::Paraboloid => {
                // The solution x of x²(x² − β²) = q².
                let (b, q) = (self.flat * self.flat, value / self.scale);
                (0.5 * (b + (b * b + 4.0 * q * q).sqrt())).sqrt()
            }
            // The upper end is slightly more than 1, because rounding may leave the image at 1
            // below `value`.
            Flank::Cone => root(self.flat, 1.0 + 1e-12, |x| self.image(x) - value),
        }
    }

    pub(super) fn half_force(&self) -> f64 {
        let b = self.flat;
        match self.flank {
            Flank::Paraboloid => (2.0 + b * b) / 3.0,
            Flank::Cone => 0.5 * (1.0 + self.scale * b * chord(1.0, b)),
        }
    }

    pub(super) fn inverse_outside(&self, c: f64, r: f64, chord_of_c: f64) -> f64 {
        let b = self.flat;
        if c <= b {
            return self.profile(r);
        }
        let inner = chord(c, b);
        let turn = libm::atan2(chord_of_c, inner);
        match self.flank {
            Flank::Paraboloid => {
                FRAC_1_PI * self.scale * ((r - b) * (r + b) * turn + inner * chord_of_c)
            }
            Flank::Cone => {
                let rest = r * libm::atan2(b * chord_of_c, r * inner) - b * turn;
                FRAC_2_PI * self.scale * (chord_of_c * self.angle(c) + rest)
            }
        }
    }

    /// (1/π) ∫ g′/√(x²−r²) dx from r to `end`. The result is infinite at r = β.
    pub(super) fn pressure_inside(&self, r: f64, end: f64) -> f64 {
        /// Maximum length of one integration panel. The integrand is analytic for |Im v| < π/2, so
        /// the Gauss rule is accurate on such a panel.
        const PANEL: f64 = 4.0;
        let b = self.flat;
        if r >= end || b >= end {
            return 0.0;
        }
        // The two roots may be zero at nearly the same x. Let m be the larger and l the smaller of
        // r and β. The substitution x² = m² + (m² − l²) sinh²v transforms dx/√((x²−r²)(x²−β²)) into
        // dv/x.
        let (larger, smaller) = (r.max(b), r.min(b));
        let gap = chord(larger, smaller);
        if gap == 0.0 {
            return f64::INFINITY;
        }
        let last = libm::asinh(chord(end, larger) / gap);
        let integrand = |v: f64| {
            let sine = gap * libm::sinh(v);
            let x = (larger * larger + sine * sine).sqrt();
            // The root √(x²−β²).
            let beyond = if r < b { sine } else { gap * libm::cosh(v) };
            match self.flank {
                Flank::Paraboloid => (x * x + beyond * beyond) / x,
                Flank::Cone => (b + beyond * libm::atan2(beyond, b)) / x,
            }
        };
        let panels = (last / PANEL).ceil();
        let width = last / panels;
        let sum: f64 = (0..panels as u32)
            .map(|k| integrate(f64::from(k) * width, f64::from(k + 1) * width, integrand))
            .sum();
        FRAC_1_PI * self.scale * sum
    }
}
