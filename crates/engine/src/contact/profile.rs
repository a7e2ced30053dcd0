//! Shapes of the indenter and their one-dimensional images, in dimensionless form.
//!
//! Lengths are in units of the unworn contact radius a₀, heights in units of the unworn indentation
//! depth d₀. So g₀(1) = 1 for every shape, and a power law depends on its exponent only.
//!
//! # Equations
//! ```text
//! f = A rⁿ        g = κₙ A xⁿ,  κₙ = √π n Γ(n/2) / (2 Γ((n+1)/2))      κ₁ = π/2, κ₂ = 2
//! sphere          g = (x/2) ln((R+x)/(R−x)) = x·artanh(x/R)
//! ```
//! Truncated paraboloids and cones are in the module `truncated`; measured tables are in
//! `table_shape`.
//!
//! # Accuracy
//! Closed forms for integer exponents. Otherwise one Gauss rule of 32 points, better than 1e-9.
//!
//! # Sources
//! M. Heß, *Phys. Mesomech.* 15 (2012) 264 (power laws); K. L. Johnson, *Contact Mechanics* (1987),
//! §5.3 (the rigid sphere beyond the parabola, after Sneddon).

use std::f64::consts::{FRAC_1_PI, FRAC_2_PI, FRAC_PI_2, PI};

use super::geometry::Geometry;
use super::punch::Punch;
use super::splits::Falls;
use super::table_shape::{PressedTable, Split};
use super::truncated::{Flank, Truncated};
use crate::numeric::{integrate, integrate_beyond, integrate_pieces, maximum, root, whole_power};

/// A sphere with a larger radius than this, in contact radii, is described by the power law of
/// a paraboloid, from which it differs by less than 1 % of d₀.
const SHALLOW: f64 = 3.0;

/// κₙ: the image of rⁿ is κₙ xⁿ.
///
/// # Examples
/// ```
/// use fretwork_engine::contact::profile::kappa;
/// assert!((kappa(1.0) - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// assert!((kappa(2.0) - 2.0).abs() < 1e-14);
/// ```
pub fn kappa(n: f64) -> f64 {
    PI.sqrt() * n * libm::tgamma(0.5 * n) / (2.0 * libm::tgamma(0.5 * (n + 1.0)))
}

/// The height of a line contact f ∝ xⁿ at the edge of the contact, in h₀: n ∫ uⁿ⁻¹ arcosh(1/u) du over 0…1.
///
/// # Examples
/// ```
/// use fretwork_engine::contact::profile::line_height;
/// assert!((line_height(1.0) - std::f64::consts::FRAC_PI_2).abs() < 1e-15);
/// assert!((line_height(2.0) - 1.0).abs() < 1e-15);
/// ```
pub fn line_height(n: f64) -> f64 {
    PI.sqrt() * libm::tgamma(0.5 * n) / (2.0 * libm::tgamma(0.5 * (n + 1.0)))
}

/// The shape of an indenter, normalised so that g₀(1) = 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    kind: ShapeKind,
    /// The height of the profile at the contact radius, f₀(1).
    height: f64,
    geometry: Geometry,
}

#[derive(Debug, Clone, PartialEq)]
enum ShapeKind {
    /// g = xⁿ with an integer n: paraboloid 2, cone 1.
    Whole(u32),
    /// g = xⁿ.
    Power(f64),
    /// A sphere of radius ρ = R/a₀.
    Sphere { rho: f64, scale: f64 },
    /// A paraboloid or a cone with a flat tip.
    Truncated(Truncated),
    /// A flat between rounded edges.
    Punch(Punch),
    /// A measured table.
    Table(PressedTable),
}

impl Shape {
    /// f ∝ rⁿ. An exponent of 1 is a cone, 2 a paraboloid.
    pub fn power(exponent: f64) -> Self {
        Self::of_power(exponent, 1.0 / kappa(exponent), Geometry::Round)
    }

    /// A line contact with f ∝ xⁿ. An exponent of 1 is a wedge, 2 a cylinder.
    pub fn line_power(exponent: f64) -> Self {
        Self::of_power(exponent, line_height(exponent), Geometry::Line)
    }

    fn of_power(exponent: f64, height: f64, geometry: Geometry) -> Self {
        let whole = exponent.round();
        let kind = if (exponent - whole).abs() == 0.0 && whole >= 1.0 {
            ShapeKind::Whole(whole as u32)
        } else {
            ShapeKind::Power(exponent)
        };
        Self { kind, height, geometry }
    }

    /// A punch with a flat of half-width 0 < β < 1, in half-widths of the contact.
    pub fn punch(flat: f64) -> Self {
        let punch = Punch::new(flat);
        Self { height: punch.profile(1.0), kind: ShapeKind::Punch(punch), geometry: Geometry::Line }
    }

    /// A sphere with a radius of ρ > 1 contact radii.
    pub fn sphere(rho: f64) -> Self {
        let scale = 1.0 / libm::atanh(1.0 / rho);
        let height = scale / (rho + ((rho - 1.0) * (rho + 1.0)).sqrt());
        Self { kind: ShapeKind::Sphere { rho, scale }, height, geometry: Geometry::Round }
    }

    /// A paraboloid or a cone with a flat tip of radius 0 < β < 1, in contact radii.
    pub fn truncated(flank: Flank, flat: f64) -> Self {
        let (shape, geometry) = (Truncated::new(flank, flat), Geometry::Round);
        Self { kind: ShapeKind::Truncated(shape), height: shape.profile(1.0), geometry }
    }

    /// A measured table.
    pub(crate) fn table(table: PressedTable) -> Self {
        let (height, geometry) = (table.profile(1.0), table.geometry());
        Self { kind: ShapeKind::Table(table), height, geometry }
    }

    /// The geometry of the contact.
    pub fn geometry(&self) -> Geometry {
        self.geometry
    }

    pub(super) fn as_table(&self) -> Option<&PressedTable> {
        if let ShapeKind::Table(table) = &self.kind { Some(table) } else { None }
    }

    /// Whether the contact is that of a ball: a paraboloid or a sphere.
    pub(crate) fn is_ball(&self) -> bool {
        self.geometry == Geometry::Round
            && matches!(self.kind, ShapeKind::Whole(2) | ShapeKind::Sphere { .. })
    }

    /// Radii inside the contact at which the image has a kink, in ascending order. A mesh should
    /// have a node at each kink, and a quadrature should be split there. A table is smooth enough
    /// and has no kinks.
    pub fn kinks(&self) -> &[f64] {
        match &self.kind {
            ShapeKind::Truncated(shape) => shape.kinks(),
            ShapeKind::Punch(punch) => punch.kinks(),
            _ => &[],
        }
    }

    /// The radius of a sharp tip (0) or of the edge of a flat. In gross slip, wear begins there with a depth that
    /// grows much faster than elsewhere. `None` if the profile is smooth.
    pub(crate) fn sharp_radius(&self) -> Option<f64> {
        match &self.kind {
            ShapeKind::Whole(1) => Some(0.0),
            ShapeKind::Power(n) => (*n < 2.0).then_some(0.0),
            ShapeKind::Truncated(shape) => shape.kinks().first().copied(),
            ShapeKind::Punch(punch) => punch.kinks().first().copied(),
            _ => None,
        }
    }

    /// Number of pieces over which the integrals of the shape are summed.
    pub(crate) fn pieces(&self) -> usize {
        self.as_table().map_or(1, PressedTable::pieces)
    }

    /// The split of the unworn contact into a core and rings, if there is one.
    pub(crate) fn split(&self) -> Option<Split> {
        self.as_table()?.split()
    }

    /// The image of a measured profile outside the unworn contact, where it can fall again. The
    /// images of the other shapes increase everywhere.
    pub(crate) fn falls(&self) -> Option<Falls> {
        self.as_table().filter(|_| self.geometry == Geometry::Round).map(PressedTable::falls)
    }

    /// The exponent n of the power law that describes the shape, exactly or in a shallow contact.
    pub(crate) fn exponent(&self) -> Option<f64> {
        match self.kind {
            ShapeKind::Whole(n) => Some(f64::from(n)),
            ShapeKind::Power(n) => Some(n),
            ShapeKind::Sphere { rho, .. } => (rho > SHALLOW).then_some(2.0),
            ShapeKind::Truncated(_) | ShapeKind::Punch(_) | ShapeKind::Table(_) => None,
        }
    }

    /// The largest radius at which the shape is defined.
    pub(crate) fn extent(&self) -> f64 {
        match &self.kind {
            ShapeKind::Sphere { rho, .. } => *rho,
            ShapeKind::Table(table) => table.extent,
            _ => f64::INFINITY,
        }
    }

    /// f₀(r): the gap without load.
    pub fn profile(&self, r: f64) -> f64 {
        match self.kind {
            ShapeKind::Whole(n) => self.height * whole_power(r, n),
            ShapeKind::Power(n) => self.height * libm::pow(r, n),
            ShapeKind::Sphere { rho, scale } => {
                scale * r * r / (rho + ((rho - r) * (rho + r)).max(0.0).sqrt())
            }
            ShapeKind::Truncated(ref shape) => shape.profile(r),
            ShapeKind::Punch(ref punch) => punch.profile(r),
            ShapeKind::Table(ref table) => table.profile(r),
        }
    }

    /// The slope of the profile, f₀′(r).
    pub(crate) fn slope(&self, r: f64) -> f64 {
        match self.kind {
            ShapeKind::Whole(n) => self.height * f64::from(n) * whole_power(r, n - 1),
            ShapeKind::Power(n) => self.height * n * libm::pow(r, n - 1.0),
            ShapeKind::Sphere { rho, scale } => scale * r / ((rho - r) * (rho + r)).max(0.0).sqrt(),
            ShapeKind::Truncated(ref shape) => shape.slope(r),
            ShapeKind::Punch(ref punch) => punch.slope(r),
            ShapeKind::Table(ref table) => table.slope(r),
        }
    }

    /// g₀(x), the image (3) of the profile.
    pub fn image(&self, x: f64) -> f64 {
        match self.kind {
            ShapeKind::Whole(n) => whole_power(x, n),
            ShapeKind::Power(n) => libm::pow(x, n),
            ShapeKind::Sphere { rho, scale } => scale * x * libm::atanh(x / rho),
            ShapeKind::Truncated(ref shape) => shape.image(x),
            ShapeKind::Punch(ref punch) => punch.image(x),
            ShapeKind::Table(ref table) => table.image(x),
        }
    }

    /// The rise of the image, g₀(c + δ) − g₀(c), without cancellation.
    pub(crate) fn image_rise(&self, c: f64, delta: f64) -> f64 {
        let x = c + delta;
        match self.kind {
            ShapeKind::Whole(1) => delta,
            ShapeKind::Whole(2) => delta * (x + c),
            // xⁿ − cⁿ = (x − c)(xⁿ⁻¹ + xⁿ⁻²c + … + cⁿ⁻¹)
            ShapeKind::Whole(n) => delta * (0..n).fold(0.0, |sum, k| sum * x + whole_power(c, k)),
            ShapeKind::Power(n) if c > 0.0 => {
                libm::pow(c, n) * libm::expm1(n * libm::log1p(delta / c))
            }
            ShapeKind::Truncated(ref shape) => shape.image_rise(c, delta),
            ShapeKind::Table(ref table) => table.image_rise(c, delta),
            _ => self.image(x) - self.image(c),
        }
    }

    /// The largest pressure of the unworn contact, in E*d₀/a₀. It is on the axis, or on a ring if
    /// the profile is blunter than a paraboloid. It is infinite for a cone and at the edge of a
    /// flat.
    pub fn peak_pressure(&self) -> f64 {
        let blunt = match self.kind {
            ShapeKind::Whole(n) => n > 2,
            ShapeKind::Power(n) => n > 2.0,
            ShapeKind::Sphere { .. } => false,
            ShapeKind::Punch(_) => true,
            ShapeKind::Truncated(_) => return f64::INFINITY,
            ShapeKind::Table(ref table) => return table.peak_pressure(),
        };
        let at = if blunt { maximum(0.0, 1.0, |r| self.pressure_inside(r, 1.0)) } else { 0.0 };
        self.pressure_inside(at, 1.0)
    }

    /// The slope of the image, g₀′(x).
    pub fn image_slope(&self, x: f64) -> f64 {
        match self.kind {
            ShapeKind::Whole(n) => f64::from(n) * whole_power(x, n - 1),
            ShapeKind::Power(n) => n * libm::pow(x, n - 1.0),
            ShapeKind::Sphere { rho, scale } => {
                scale * (libm::atanh(x / rho) + x * rho / ((rho - x) * (rho + x)))
            }
            ShapeKind::Truncated(ref shape) => shape.image_slope(x),
            ShapeKind::Punch(ref punch) => punch.image_slope(x),
            ShapeKind::Table(ref table) => table.image_slope(x),
        }
    }

    /// The radius at which the image equals `value` in 0…1.
    pub fn image_inverse(&self, value: f64) -> f64 {
        match self.kind {
            ShapeKind::Whole(1) => value,
            ShapeKind::Whole(2) => value.sqrt(),
            ShapeKind::Whole(n) => libm::pow(value, 1.0 / f64::from(n)),
            ShapeKind::Power(n) => libm::pow(value, 1.0 / n),
            ShapeKind::Sphere { .. } => root(0.0, 1.0, |x| self.image(x) - value),
            ShapeKind::Truncated(ref shape) => shape.image_inverse(value),
            ShapeKind::Punch(ref punch) => punch.image_inverse(value),
            ShapeKind::Table(ref table) => table.image_inverse(value),
        }
    }

    /// The stick radius c of the unworn contact at the amplitude Δ; 0 in gross slip. At Δ = 1 springs under a flat still
    /// stick, but a line contact then carries μF and slips.
    pub(crate) fn stick_radius(&self, threshold: f64) -> f64 {
        let slips = match self.geometry {
            Geometry::Round => threshold > 1.0,
            Geometry::Line => threshold >= 1.0,
        };
        if slips { 0.0 } else { self.image_inverse(1.0 - threshold) }
    }

    /// The mean of g₀ over from…to, without cancellation. In a line contact it is the mean over ds/s.
    pub(crate) fn image_mean(&self, from: f64, to: f64) -> f64 {
        if self.geometry == Geometry::Line {
            return self.logarithmic_mean(from, to);
        }
        match self.kind {
            // (bⁿ⁺¹ − aⁿ⁺¹)/(b − a) = bⁿ + bⁿ⁻¹a + … + aⁿ
            ShapeKind::Whole(n) => {
                let sum = (0..=n).fold(0.0, |sum, k| sum * to + whole_power(from, k));
                sum / f64::from(n + 1)
            }
            _ => integrate_beyond(from, to, self.kinks(), |x| self.image(x)) / (to - from),
        }
    }

    fn logarithmic_mean(&self, from: f64, to: f64) -> f64 {
        let width = libm::log(to / from);
        match self.kind {
            ShapeKind::Whole(_) | ShapeKind::Power(_) => {
                let n = self.exponent().unwrap_or_default();
                libm::pow(from, n) * libm::expm1(n * width) / (n * width)
            }
            _ => integrate_beyond(from, to, self.kinks(), |s| self.image(s) / s) / width,
        }
    }

    /// The integral of the image, ∫₀ˣ g₀ dx.
    pub(crate) fn area(&self, x: f64) -> f64 {
        match self.kind {
            ShapeKind::Whole(n) => whole_power(x, n + 1) / f64::from(n + 1),
            ShapeKind::Power(n) => libm::pow(x, n + 1.0) / (n + 1.0),
            // The image of a table has too many pieces for a single Gauss rule.
            ShapeKind::Table(ref table) => table.area(x),
            _ => integrate_beyond(0.0, x, self.kinks(), |x| self.image(x)),
        }
    }

    /// Half of the unworn force: ∫₀¹ (1 − g₀) dx in units of E*a₀d₀. In a line contact the force is the unit.
    pub fn half_force(&self) -> f64 {
        match self.kind {
            _ if self.geometry == Geometry::Line => 0.5,
            ShapeKind::Whole(n) => f64::from(n) / (f64::from(n) + 1.0),
            ShapeKind::Power(n) => n / (n + 1.0),
            ShapeKind::Truncated(ref shape) => shape.half_force(),
            ShapeKind::Table(ref table) => table.half_force(),
            // Sneddon's closed form loses all digits for a large sphere, but the integrand is
            // smooth.
            _ => integrate(0.0, 1.0, |x| 1.0 - self.image(x)),
        }
    }

    /// (2/π) ∫ g₀/√(r²−x²) dx over c…r: the part of the inverse transform (4) outside `c`. In a line contact it is
    /// r ∫ g₀/(x √(r²−x²)) dx.
    ///
    /// `chord` is √(r²−c²) and `angle` is arccos(c/r). The callers have already computed both.
    pub(crate) fn inverse_outside(&self, c: f64, r: f64, chord: f64, angle: f64) -> f64 {
        if c == 0.0 {
            return self.profile(r);
        }
        if self.geometry == Geometry::Line {
            return self.line_inverse_outside(c, r, chord, angle);
        }
        match self.kind {
            ShapeKind::Truncated(ref shape) => shape.inverse_outside(c, r, chord),
            ShapeKind::Table(ref table) => table.inverse_outside(c, r),
            ShapeKind::Whole(1) => FRAC_2_PI * chord,
            ShapeKind::Whole(2) => FRAC_1_PI * (c * chord + r * r * angle),
            ShapeKind::Whole(n) => {
                // ∫ xᵐ/√(r²−x²) dx from c to r, by a recursion that increases m by 2.
                let mut m = f64::from(n % 2);
                let (mut sum, mut power) = if n % 2 == 1 { (chord, c * c) } else { (angle, c) };
                for _ in 0..n / 2 {
                    m += 2.0;
                    sum = (power * chord + (m - 1.0) * r * r * sum) / m;
                    power *= c * c;
                }
                FRAC_2_PI * sum
            }
            // For a large c/r the integrand is smooth in the angle. For a small c/r the integral
            // inside c is easier; it is subtracted from the known total.
            _ if 2.0 * c < r => {
                let inner = FRAC_PI_2 - angle;
                let inside = integrate(0.0, 1.0, |s| {
                    3.0 * s * s * inner * self.image(r * libm::sin(inner * s * s * s))
                });
                self.profile(r) - FRAC_2_PI * inside
            }
            _ => FRAC_2_PI * integrate(0.0, angle, |psi| self.image(r * libm::cos(psi))),
        }
    }

    fn line_inverse_outside(&self, c: f64, r: f64, chord: f64, angle: f64) -> f64 {
        match self.kind {
            ShapeKind::Whole(1) => r * angle,
            ShapeKind::Whole(2) => r * chord,
            ShapeKind::Table(ref table) => table.inverse_outside(c, r),
            _ if 2.0 * c < r => {
                let of_spring = |s: f64| self.image(s) / (s * ((r - s) * (r + s)).sqrt());
                let inside = match self.kinks() {
                    // The cube makes a fractional power smooth at the middle.
                    [] => integrate(0.0, 1.0, |v| 3.0 * v * v * c * of_spring(c * v * v * v)),
                    kinks => integrate_pieces(0.0, c, kinks, of_spring),
                };
                self.profile(r) - r * inside
            }
            _ => {
                // In the angle the integrand is smooth outside a flat.
                let from = self.kinks().iter().copied().fold(c, f64::max).min(r);
                let wide = libm::acos((from / r).min(1.0));
                integrate(0.0, wide, |psi| self.image(r * libm::cos(psi)) / libm::cos(psi))
            }
        }
    }

    /// (1/π) ∫ g₀′/√(x²−r²) dx over r…b: the pressure, in E*d₀/a₀ (round) or F₀/a₀ (line), of springs that follow the
    /// unworn image inside b. It is infinite at the apex of a cone and at the edge of a flat.
    pub fn pressure_inside(&self, r: f64, b: f64) -> f64 {
        if r >= b {
            return 0.0;
        }
        let chord = ((b - r) * (b + r)).sqrt();
        match self.kind {
            ShapeKind::Whole(2) => FRAC_2_PI * chord,
            ShapeKind::Whole(n) => {
                // ∫ xᵐ/√(x²−r²) dx from r to b for m = n − 1, by a recursion that increases m by 2.
                let (mut sum, mut m) = if n % 2 == 0 {
                    (chord, 1)
                } else if r == 0.0 {
                    if n == 1 {
                        return f64::INFINITY;
                    }
                    (0.5 * b * b, 2)
                } else {
                    (libm::acosh(b / r), 0)
                };
                while m + 1 < n {
                    m += 2;
                    let m_real = f64::from(m);
                    sum = (whole_power(b, m - 1) * chord + (m_real - 1.0) * r * r * sum) / m_real;
                }
                f64::from(n) * sum / PI
            }
            ShapeKind::Power(n) if r == 0.0 => n / (PI * (n - 1.0)) * libm::pow(b, n - 1.0),
            ShapeKind::Power(_) => {
                integrate(0.0, libm::acosh(b / r), |s| self.image_slope(r * libm::cosh(s))) / PI
            }
            ShapeKind::Sphere { .. } => {
                chord / PI
                    * integrate(0.0, 1.0, |v| {
                        let x = (r * r + (v * chord) * (v * chord)).sqrt();
                        self.image_slope(x) / x
                    })
            }
            ShapeKind::Truncated(ref shape) => shape.pressure_inside(r, b),
            ShapeKind::Punch(ref punch) => punch.pressure_inside(r, b),
            ShapeKind::Table(ref table) => table.pressure_inside(r, b),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::GAUSS_POINTS;

    fn shapes() -> Vec<(&'static str, Shape)> {
        vec![
            ("cone", Shape::power(1.0)),
            ("1.5", Shape::power(1.5)),
            ("paraboloid", Shape::power(2.0)),
            ("2.5", Shape::power(2.5)),
            ("3", Shape::power(3.0)),
            ("4", Shape::power(4.0)),
            ("20", Shape::power(20.0)),
            ("sphere 2", Shape::sphere(2.0)),
            ("sphere 100", Shape::sphere(100.0)),
            ("truncated paraboloid 0.3", Shape::truncated(Flank::Paraboloid, 0.3)),
            ("truncated paraboloid 0.999", Shape::truncated(Flank::Paraboloid, 0.999)),
            ("truncated cone 0.001", Shape::truncated(Flank::Cone, 0.001)),
            ("truncated cone 0.45", Shape::truncated(Flank::Cone, 0.45)),
        ]
    }

    /// ∫ over from…to, split at every kink, for functions with square roots at the ends of the
    /// pieces.
    fn pieces(from: f64, to: f64, kinks: &[f64], f: impl Fn(f64) -> f64) -> f64 {
        let mut edges = vec![from];
        edges.extend(kinks.iter().filter(|kink| (from..to).contains(kink)));
        edges.push(to);
        edges
            .windows(2)
            .map(|ends| {
                let width = ends[1] - ends[0];
                integrate(0.0, 1.0, |s| {
                    6.0 * s * (1.0 - s) * width * f(ends[0] + width * s * s * (3.0 - 2.0 * s))
                })
            })
            .sum()
    }

    /// The angles of the kinks on a circle of radius r.
    fn angles(shape: &Shape, r: f64) -> Vec<f64> {
        shape.kinks().iter().filter(|kink| **kink < r).map(|kink| libm::asin(kink / r)).collect()
    }

    /// The profile f(r) that has the image `image(x)`, (4). The rule is graded towards x = 0, where the image may not be
    /// smooth. It is exact to rounding for smooth functions, and to 1e-10 for |x|ⁿ, n ≥ 1.
    fn inverse(image: impl Fn(f64) -> f64, r: f64) -> f64 {
        let theta = |s: f64| FRAC_PI_2 * s * s * s;
        let graded = |s: f64| s * s * image(r * libm::sin(theta(s)));
        FRAC_2_PI * (3.0 * FRAC_PI_2 * integrate(0.0, 1.0, graded))
    }

    fn transformed(shape: &Shape, r: f64, f: impl Fn(f64) -> f64) -> f64 {
        match angles(shape, r)[..] {
            [] if r < shape.kinks().first().copied().unwrap_or(0.0) => 0.0,
            [] => FRAC_PI_2 * inverse(f, r),
            ref kinks => pieces(0.0, FRAC_PI_2, kinks, |theta| f(r * libm::sin(theta))),
        }
    }

    #[test]
    fn image_and_profile_are_transforms_of_each_other() {
        for (name, shape) in shapes() {
            for r in [0.0, 0.1, 0.5, 0.9, 1.0, 1.2] {
                let g = r * transformed(&shape, r, |x| shape.slope(x));
                let f = FRAC_2_PI * transformed(&shape, r, |x| shape.image(x));
                assert!((g - shape.image(r)).abs() <= 1e-10 * shape.image(1.2), "{name} {r} {g}");
                assert!((f - shape.profile(r)).abs() <= 1e-10 * shape.image(1.2), "{name} {r} {f}");
            }
        }
    }

    #[test]
    fn the_partial_transforms_agree_with_a_midpoint_sum() {
        // Midpoint rule on 200 000 graded cells: an independent method, accurate to 1e-8. The
        // integral is split at a kink, and the cells are graded towards the kink from both sides.
        let fine = |kink: Option<f64>, f: &dyn Fn(f64) -> f64| {
            let cells = 200_000;
            let piece = |from: f64, to: f64| {
                (0..cells)
                    .map(|i| {
                        let s = (f64::from(i) + 0.5) / f64::from(cells);
                        f(from + (to - from) * s * s) * 2.0 * s * (to - from)
                    })
                    .sum::<f64>()
                    / f64::from(cells)
            };
            kink.map_or_else(|| piece(0.0, 1.0), |kink| piece(kink, 0.0).abs() + piece(kink, 1.0))
        };
        for (name, shape) in shapes() {
            for (c, r) in [(0.001_f64, 0.3_f64), (0.1, 1.1), (0.3, 0.5), (0.5, 0.501), (0.7, 1.15)]
            {
                let kink = shape.kinks().first().copied().filter(|kink| c < *kink && *kink < r);
                let angle = libm::acos(c / r);
                let at = kink.map(|kink| libm::acos(kink / r) / angle);
                let sum = FRAC_2_PI * angle * fine(at, &|t| shape.image(r * libm::cos(angle * t)));
                let value = shape.inverse_outside(c, r, (r * r - c * c).sqrt(), angle);
                assert!((value - sum).abs() < 1e-9 + 1e-8 * sum, "{name} {c} {r}: {value} {sum}");
                if shape.kinks().contains(&c) {
                    continue;
                }
                let limit = libm::acosh(r / c);
                let at = kink.map(|kink| 1.0 - libm::acosh(kink / c) / limit);
                let sum = limit / PI
                    * fine(at, &|t| shape.image_slope(c * libm::cosh(limit * (1.0 - t))));
                let value = shape.pressure_inside(c, r);
                assert!(
                    (value - sum).abs() < 1e-8 * (1.0 + sum),
                    "{name} p {c} {r}: {value} {sum}"
                );
            }
        }
        assert_eq!(GAUSS_POINTS, 32, "the accuracies stated above were measured with this rule");
    }

    #[test]
    fn forces_agree_with_hertz_and_sneddon() {
        assert!((2.0 * Shape::power(2.0).half_force() - 4.0 / 3.0).abs() < 1e-15);
        assert!((2.0 * Shape::power(1.0).half_force() - 1.0).abs() < 1e-15);
        for (name, shape) in shapes() {
            let by_quadrature = pieces(0.0, 1.0, shape.kinks(), |x| 1.0 - shape.image(x));
            assert!((shape.half_force() - by_quadrature).abs() < 1e-7, "{name}");
        }
        for rho in [1.5_f64, 2.0, 5.0] {
            let artanh = libm::atanh(1.0 / rho);
            let sneddon = 0.5 * (rho * rho + 1.0 - rho / artanh);
            assert!((Shape::sphere(rho).half_force() - sneddon).abs() < 1e-13, "{rho}");
        }
    }

    #[test]
    fn image_rise_has_no_cancellation() {
        for (name, shape) in shapes() {
            for c in [0.0, 0.3, 0.9] {
                let coarse = shape.image_rise(c, 0.05);
                let direct = shape.image(c + 0.05) - shape.image(c);
                assert!((coarse - direct).abs() < 1e-15 + 1e-13 * direct, "{name} {c}");
            }
            // Over a distance of 1e-12 the rise is slope × distance. A plain difference would have
            // only four digits.
            let at = shape.kinks().first().map_or(0.5, |flat| 0.5_f64.max(flat + 5e-4));
            let fine = shape.image_rise(at, 1e-12) / 1e-12;
            let digits = match shape.kinks() {
                _ if name.starts_with("sphere") => 1e-3,
                [] => 1e-10,
                _ => 1e-8,
            };
            assert!((fine / shape.image_slope(at) - 1.0).abs() < digits, "{name}: {fine}");
        }
    }

    #[test]
    fn the_pressure_never_exceeds_the_peak_pressure() {
        for (name, shape) in shapes().into_iter().skip(1) {
            if let [flat] = shape.kinks() {
                assert!(shape.peak_pressure().is_infinite());
                assert!(shape.pressure_inside(*flat, 1.0).is_infinite());
                continue;
            }
            let peak = shape.peak_pressure();
            let highest = (0..2000)
                .map(|i| shape.pressure_inside(f64::from(i) / 2000.0, 1.0))
                .fold(0.0, f64::max);
            assert!((0.0..1e-3).contains(&(peak / highest - 1.0)), "{name}: {peak} {highest}");
        }
    }

    #[test]
    fn the_pressure_integrates_to_the_force_and_is_logarithmic_at_the_edge_of_the_flat() {
        for shape in [Shape::truncated(Flank::Paraboloid, 0.4), Shape::truncated(Flank::Cone, 0.8)]
        {
            let force =
                2.0 * PI * pieces(0.0, 1.0, shape.kinks(), |r| r * shape.pressure_inside(r, 1.0));
            assert!((force / (2.0 * shape.half_force()) - 1.0).abs() < 1e-5, "{force}");
            for (near, far) in [(1e-3, 1e-4), (1e-9, 1e-10), (-1e-3, -1e-4), (-1e-9, -1e-10)] {
                // The pressure grows logarithmically, equally on both sides of the edge.
                let at = |distance: f64| shape.pressure_inside(shape.kinks()[0] + distance, 1.0);
                let growth = at(far) - at(near);
                let expected = at(1e-5) - at(1e-4);
                assert!((growth / expected - 1.0).abs() < 0.02, "{growth} {expected}");
            }
        }
    }

    #[test]
    fn a_very_small_flat_gives_the_results_of_the_pointed_shape() {
        for (flat, sharp) in [
            (Shape::truncated(Flank::Paraboloid, 1e-6), Shape::power(2.0)),
            (Shape::truncated(Flank::Cone, 1e-6), Shape::power(1.0)),
        ] {
            for r in [0.01, 0.5, 1.2] {
                assert!((flat.image(r) - sharp.image(r)).abs() < 1e-5);
                assert!((flat.profile(r) - sharp.profile(r)).abs() < 1e-5);
                assert!(
                    (flat.pressure_inside(r, 1.0) - sharp.pressure_inside(r, 1.0)).abs() < 1e-4
                );
            }
        }
    }

    #[test]
    fn image_inverse_inverts_the_image() {
        for (name, shape) in shapes() {
            for value in [0.0, 1e-12, 1e-6, 0.1, 0.7, 1.0] {
                let x = shape.image_inverse(value);
                // Near the edge of a flat the image grows like a square root, so rounding of x
                // changes it noticeably.
                let (below, above) = (shape.image((x - 1e-15).max(0.0)), shape.image(x + 1e-15));
                assert!((below - 1e-14..=above + 1e-14).contains(&value), "{name} {value}: {x}");
            }
            if let [flat] = shape.kinks() {
                assert!((shape.image_inverse(0.0) - flat).abs() < 1e-15, "{name}");
            }
        }
    }

    #[test]
    fn the_pressure_is_an_ellipse_for_a_paraboloid_and_an_inverse_hyperbolic_cosine_for_a_cone() {
        for r in [0.0_f64, 0.3, 0.9] {
            let hertz = FRAC_2_PI * (1.0 - r * r).sqrt();
            assert!((Shape::power(2.0).pressure_inside(r, 1.0) - hertz).abs() < 1e-15);
        }
        let cone = Shape::power(1.0).pressure_inside(0.3, 1.0);
        assert!((cone - libm::acosh(1.0 / 0.3) / PI).abs() < 1e-15);
        assert!(Shape::power(1.0).pressure_inside(0.0, 1.0).is_infinite());
    }
}
