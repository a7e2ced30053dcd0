//! The two geometries of a contact: round (axisymmetric), and a line (plane strain).
//!
//! A row of independent springs gives the forces of both. In both, the wear rate is p·σ, and the slip σ follows
//! from the springs by the same matrix A. Only the files of the kernel, of the balance of forces and of the scales
//! ask for the geometry.
//!
//! # Equations
//! θ is the compression below which a spring slips, and v the weight of a spring:
//! ```text
//!           round                               line
//! unit      a₀, d₀, E*d₀/a₀                     a₀, h₀ = 2F/(πE*), F/a₀ (F per length)
//! image     g(x) = x ∫ f′/√(x²−r²) dr           F(s)/F₀ = (2/π) ∫ x f′/√(s²−x²) dx: the load on half-width s
//! y         d − g                               (F − F(s))/F₀
//! θ         Δ = G*U/(μE*d₀)                     Q/(μF₀)
//! v         the width of the cell               ln of the ratio of its ends
//! slip      A·σ = (θ − y)₊                      the same
//! wear      dw/dÑ = p·σ/Δ₀                      dw/dÑ = p·σ
//! volume    dV/dÑ = 2 Σ v y (θ − y)₊/Δ₀         dV/dÑ = Σ v y (θ − y)₊
//! N₀        a₀/(4 U k_w E*)                     a₀/(4 k_w μ F)
//! ```
//! In a line contact, uniform wear changes no image. So a contact that slips as a whole has a slip at its centre that
//! the springs do not contain, and its wear is free there.
//!
//! # Sources
//! K. L. Johnson, *Contact Mechanics* (1985), §4.2 and §7.2; M. Ciavarella, *Int. J. Solids Struct.* 35 (1998) 2349;
//! J. Jäger, *J. Tribol.* 120 (1998) 677.

use std::f64::consts::PI;

pub use crate::input::indenter::Geometry;
use crate::numeric::positive_area;

impl Geometry {
    /// The coordinate in which the wear between two nodes is linear: r², or x in a line contact.
    pub(crate) fn place(self, r: f64) -> f64 {
        match self {
            Self::Round => r * r,
            Self::Line => r,
        }
    }

    /// The radius at a [`place`](Self::place).
    pub(crate) fn radius(self, place: f64) -> f64 {
        match self {
            Self::Round => place.sqrt(),
            Self::Line => place,
        }
    }

    /// The volume under `twice` the area over the places, and under the area `inside` the first one. In a line contact
    /// it is the area of the worn section, on both sides of the middle.
    pub(crate) fn volume(self, twice: f64, inside: f64) -> f64 {
        match self {
            Self::Round => 0.5 * PI * twice,
            Self::Line => twice + 2.0 * inside,
        }
    }

    /// The volume of the positive part of wear that is linear between places.
    pub(crate) fn positive_volume(self, places: &[f64], wear: &[f64]) -> f64 {
        let cells = places.windows(2).zip(wear.windows(2));
        let areas: f64 = cells.map(|(t, w)| positive_area([t[0], t[1]], [w[0], w[1]])).sum();
        self.volume(2.0 * areas, places[0] * wear[0].max(0.0))
    }

    /// The weight of a spring of width `width` at x.
    pub(crate) fn weight(self, x: f64, width: f64) -> f64 {
        match self {
            Self::Round => width,
            Self::Line => width / x,
        }
    }

    /// κ: dV/dÑ = κ Σ v y (θ − y)₊ in the unit of N₀.
    pub(crate) fn energy_factor(self) -> f64 {
        match self {
            Self::Round => 2.0,
            Self::Line => 1.0,
        }
    }
}
