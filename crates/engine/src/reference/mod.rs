//! Reference solutions in closed form for contact, partial slip and its wear.
//!
//! These solutions come from the literature and share no code with the methods of this crate. They
//! can therefore verify these methods, and other programs too.
//!
//! # Units
//! [`Hertz`], [`Cone`], [`PowerLaw`], [`Sphere`] and [`CattaneoMindlin`] use SI units, or any other
//! coherent system of units.
//! The functions of an exponent are dimensionless: lengths in a₀, heights in d₀, forces in E*a₀d₀ and volumes in
//! a₀²d₀ of the unworn contact, amplitudes in U_gs = μ(E*/G*)d₀ and cycles in N₀ = a₀/(4Uk_wE*).
//!
//! # Symbols
//! ```text
//! E*, G*   effective moduli,  1/E* = Σ (1−ν²)/E,  1/G* = Σ (2−ν)/(4G)
//! F, d, a  normal force, indentation depth, contact radius
//! Q, U, c  tangential force, tangential displacement (or half of the stroke), stick radius
//! q        Q/(μF)
//! ```
//!
//! # Sources
//! - *Handbook*: V. L. Popov, M. Heß, E. Willert, *Handbook of Contact Mechanics: Exact Solutions of
//!   Axisymmetric Contact Problems*, Springer (2019)
//! - *Johnson*: K. L. Johnson, *Contact Mechanics*, Cambridge University Press (1985)
//! - *limits of wear*: V. L. Popov, *Sci. Rep.* 4 (2014) 3749; (11)–(13) of the paper
//!
//! # Examples
//! A steel ball of 10 mm under 100 N:
//! ```
//! use fretwork_engine::reference::{CattaneoMindlin, Hertz};
//!
//! let hertz = Hertz::under(100.0, 112.64e9, 0.01);
//! assert!((hertz.contact_radius() / 0.18813e-3 - 1.0).abs() < 1e-4);
//! assert!((hertz.peak_pressure() / 1349e6 - 1.0).abs() < 1e-3);
//!
//! let contact = CattaneoMindlin { hertz, tangential_modulus: 92.76e9, friction: 0.7 };
//! let force = contact.force(2.256e-6);
//! assert!((contact.stick_radius(force) / hertz.contact_radius() - 0.5).abs() < 1e-3);
//! assert!((contact.energy_per_cycle(force) / 57.9e-6 - 1.0).abs() < 1e-3);
//! ```

/// Numbers from other programs, as JSON. They are closed forms of V. L. Popov, Sci. Rep. 4 (2014)
/// 3749, and exact runs, extrapolated from two discretisations.
pub const TABLE: &str = include_str!("reference.json");

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, PI};

/// A paraboloid f = r²/(2R) at the indentation depth d. Sources: H. Hertz, *J. reine angew. Math.*
/// 92 (1882) 156; *Johnson* §4.2(a); *Handbook* §2.5.3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hertz {
    /// Normal modulus E* in Pa.
    pub modulus: f64,
    /// Radius R of the paraboloid in m.
    pub radius: f64,
    /// Indentation depth d in m.
    pub depth: f64,
}

impl Hertz {
    /// The contact under a force F in N: d = (9F²/(16E*²R))^(1/3).
    pub fn under(force: f64, modulus: f64, radius: f64) -> Self {
        let root = 3.0 * force / (4.0 * modulus);
        Self { modulus, radius, depth: libm::cbrt(root * root / radius) }
    }

    /// Contact radius a = √(Rd) in m.
    pub fn contact_radius(&self) -> f64 {
        (self.radius * self.depth).sqrt()
    }

    /// Normal force F = (4/3) E* √R d^(3/2) in N.
    pub fn force(&self) -> f64 {
        4.0 / 3.0 * self.modulus * self.depth * (self.radius * self.depth).sqrt()
    }

    /// Pressure on the axis, p₀ = (2/π) E* √(d/R) = 3F/(2πa²), in Pa.
    pub fn peak_pressure(&self) -> f64 {
        FRAC_2_PI * self.modulus * (self.depth / self.radius).sqrt()
    }
}

/// A cone f = r·tan θ at the indentation depth d. Sources: I. N. Sneddon, *Int. J. Eng. Sci.* 3
/// (1965) 47; *Johnson* §5.2; *Handbook* §2.5.2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cone {
    /// Normal modulus E* in Pa.
    pub modulus: f64,
    /// tan θ, with the slope angle θ measured from the plane.
    pub slope: f64,
    /// Indentation depth d in m.
    pub depth: f64,
}

impl Cone {
    /// The contact under a force F in N: d² = (π/2) F tan θ/E*.
    pub fn under(force: f64, modulus: f64, slope: f64) -> Self {
        Self { modulus, slope, depth: (FRAC_PI_2 * force * slope / modulus).sqrt() }
    }

    /// Contact radius a = (2/π) d/tan θ in m.
    pub fn contact_radius(&self) -> f64 {
        FRAC_2_PI * self.depth / self.slope
    }
}

/// A power law f = A rⁿ at the indentation depth d. Sources: L. A. Galin, *Contact Problems in the
/// Theory of Elasticity* (1953); M. Heß, *Phys. Mesomech.* 15 (2012) 264; *Handbook* §2.5.6.
///
/// # Examples
/// ```
/// use fretwork_engine::reference::{Hertz, PowerLaw};
/// // f = r²/(2R) with R = 10 mm is the paraboloid of Hertz.
/// let power = PowerLaw { modulus: 113e9, exponent: 2.0, coefficient: 50.0, depth: 3e-6 };
/// let hertz = Hertz { modulus: 113e9, radius: 0.01, depth: 3e-6 };
/// assert!((power.force() / hertz.force() - 1.0).abs() < 1e-13);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PowerLaw {
    /// Normal modulus E* in Pa.
    pub modulus: f64,
    /// Exponent n > 0.
    pub exponent: f64,
    /// Coefficient A in m^(1−n).
    pub coefficient: f64,
    /// Indentation depth d in m.
    pub depth: f64,
}

impl PowerLaw {
    /// The contact under a force F in N.
    pub fn under(force: f64, modulus: f64, exponent: f64, coefficient: f64) -> Self {
        // F is proportional to d^((n+1)/n).
        let unit = Self { modulus, exponent, coefficient, depth: 1.0 };
        let depth = libm::pow(force / unit.force(), exponent / (exponent + 1.0));
        Self { depth, ..unit }
    }

    /// Contact radius a = (d/(κₙA))^(1/n) in m, with κₙ = √π Γ(n/2 + 1)/Γ((n+1)/2).
    pub fn contact_radius(&self) -> f64 {
        let n = self.exponent;
        libm::pow(self.depth / (stretch(n) * self.coefficient), 1.0 / n)
    }

    /// Normal force F = (2n/(n+1)) E*ad in N.
    pub fn force(&self) -> f64 {
        let n = self.exponent;
        2.0 * n / (n + 1.0) * self.modulus * self.contact_radius() * self.depth
    }
}

/// κₙ = √π Γ(n/2 + 1)/Γ((n+1)/2): the ratio of the depth to the profile at the contact radius.
fn stretch(n: f64) -> f64 {
    let logarithm = libm::lgamma(0.5 * n + 1.0) - libm::lgamma(0.5 * (n + 1.0));
    PI.sqrt() * libm::exp(logarithm)
}

/// A sphere of radius R with a contact radius a < R. C. M. Segedin, *Mathematika* 4 (1957) 156;
/// I. N. Sneddon, *Int. J. Eng. Sci.* 3 (1965) 47; *Handbook* §2.5.4.
///
/// The formulas assume a plane half-space, which is not valid for a/R above about 0.3.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sphere {
    /// Normal modulus E* in Pa.
    pub modulus: f64,
    /// Radius R of the sphere in m.
    pub radius: f64,
    /// Contact radius a in m.
    pub contact_radius: f64,
}

impl Sphere {
    /// Indentation depth d = a artanh(a/R) in m.
    pub fn depth(&self) -> f64 {
        self.contact_radius * libm::atanh(self.contact_radius / self.radius)
    }

    /// Normal force F = E* ((R² + a²) artanh(a/R) − aR) in N. For a ≪ R the terms cancel, and the
    /// relative rounding error is multiplied by R²/a².
    pub fn force(&self) -> f64 {
        let (r, a) = (self.radius, self.contact_radius);
        self.modulus * ((r * r + a * a) * libm::atanh(a / r) - a * r)
    }
}

/// A paraboloid under a constant normal force and a varying tangential force. A core sticks, and a ring around it
/// slips. C. Cattaneo, *Rend. Accad. Lincei* 27 (1938) 342; R. D. Mindlin, *J. Appl. Mech.* 16
/// (1949) 259; R. D. Mindlin, H. Deresiewicz, *J. Appl. Mech.* 20 (1953) 327; *Johnson* §7.2(d),
/// §7.4; *Handbook* §4.6.
///
/// Tangential forces Q are in N, with 0 ≤ Q ≤ μF. Gross slip starts at Q = μF.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CattaneoMindlin {
    /// The normal contact, which Hertz describes.
    pub hertz: Hertz,
    /// Tangential modulus G* in Pa.
    pub tangential_modulus: f64,
    /// Coefficient of friction μ.
    pub friction: f64,
}

impl CattaneoMindlin {
    /// The friction limit μF in N.
    pub(crate) fn sliding_force(&self) -> f64 {
        self.friction * self.hertz.force()
    }

    /// The displacement U in m at Q = μF: μ(E*/G*)d = 3μF/(4G*a).
    pub fn sliding_displacement(&self) -> f64 {
        0.75 * self.sliding_force() / (self.tangential_modulus * self.hertz.contact_radius())
    }

    /// Stick radius c = a (1 − Q/(μF))^(1/3) in m.
    pub fn stick_radius(&self, force: f64) -> f64 {
        self.hertz.contact_radius() * libm::cbrt(self.reserve(force))
    }

    /// Tangential force Q in N at a displacement U in m. In gross slip it is μF.
    pub fn force(&self, displacement: f64) -> f64 {
        let left = (1.0 - displacement / self.sliding_displacement()).max(0.0);
        self.sliding_force() * (1.0 - left * left.sqrt())
    }

    /// The energy lost in a cycle of amplitude Q*, in J:
    /// (18μ²F²/(5G*a)) (1 − (1−q)^(5/3) − (5q/6)(1 + (1−q)^(2/3))), q = Q*/(μF).
    ///
    /// For small q the result is proportional to q³ and the terms cancel: the relative error is
    /// 1e-15/q³.
    pub fn energy_per_cycle(&self, amplitude: f64) -> f64 {
        let left = self.reserve(amplitude);
        let (q, power) = (1.0 - left, two_thirds(left));
        let braces = 1.0 - left * power - 5.0 / 6.0 * q * (1.0 + power);
        4.8 * self.sliding_force() * self.sliding_displacement() * braces
    }

    /// The share of the friction limit that the tangential force does not use, 1 − Q/(μF).
    fn reserve(&self, force: f64) -> f64 {
        (1.0 - force / self.sliding_force()).max(0.0)
    }
}

/// x^(2/3).
fn two_thirds(x: f64) -> f64 {
    let root = libm::cbrt(x);
    root * root
}

/// The stick ratio c/a = (1 − q)^(1/(n+1)) of a power law with exponent n at Q = qμF. The stick
/// zone is the contact area of a smaller normal force. Sources: J. Jäger, *Arch. Appl. Mech.* 65
/// (1995) 478; M. Ciavarella, *J. Appl. Mech.* 65 (1998) 998.
///
/// # Examples
/// ```
/// use fretwork_engine::reference::stick_ratio;
/// assert!((stick_ratio(2.0, 0.875) - 0.5).abs() < 1e-15);
/// ```
pub fn stick_ratio(n: f64, q: f64) -> f64 {
    libm::pow(1.0 - q, 1.0 / (n + 1.0))
}

/// The three criteria of the sliding transition, for the fretting loop at the gross-slip threshold.
/// Source: S. Fouvry, P. Kapsa, L. Vincent, *Wear* 185 (1995) 35.
///
/// δ* is half of the stroke, and δ₀ is half of the width of the loop at Q = 0. Q* = μF is the
/// height of the loop, and W is its area:
/// ```text
/// A = W/(4Q*δ*) = 1/(2n+1)        D = δ₀/δ* = 2^(1/(n+1)) − 1        B = W/(4Q*δ₀) = A/D
/// ```
/// For n = 2 these are 0.2, 0.26 and 0.77. Larger values mean gross slip. The compliance of the rig
/// changes A but not B.
///
/// # Derivation
/// At U = U_gs all springs slip: W = 8μE*(μE*/G*) ∫ y(d − y) dx with y = d(1 − (x/a)ⁿ). Over 0…1, ∫
/// xⁿ(1 − xⁿ) dx = n/((n+1)(2n+1)). The denominator of A follows from Q*δ* = μF·μ(E*/G*)d with F =
/// (2n/(n+1))E*ad. By Masing's rule the unloading branch from Q* is U* − 2U((Q*−Q)/2). At Q = 0 the
/// displacement on this branch is 2·2^(−n/(n+1)) − 1 of U*.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlidingTransition {
    /// The energy ratio A.
    pub energy_ratio: f64,
    /// The system-free ratio B.
    pub system_free_ratio: f64,
    /// The displacement ratio D.
    pub displacement_ratio: f64,
}

impl SlidingTransition {
    /// The criteria for a power law with exponent n.
    pub fn of(n: f64) -> Self {
        let energy_ratio = 1.0 / (2.0 * n + 1.0);
        let displacement_ratio = libm::exp2(1.0 / (n + 1.0)) - 1.0;
        let system_free_ratio = energy_ratio / displacement_ratio;
        Self { energy_ratio, system_free_ratio, displacement_ratio }
    }
}

/// The initial wear rate dV/dÑ, in a₀²d₀, of an unworn power law with a stick radius 0 < c < 1.
///
/// It is 2I/(1 − cⁿ) with I = (n/(n+1)) ((1 − c²ⁿ⁺¹)/(2n+1) − cⁿ + cⁿ⁺¹). For n = 2,
/// I is 2/15 − 2c²/3 + 2c³/3 − 2c⁵/15.
///
/// The formula follows from dV/dN = (k_w/μ)W. The loss W of the unworn contact is the integral of
/// y(Δ − y) over the ring, with y = 1 − xⁿ and Δ = 1 − cⁿ. Cancellation causes a relative error of
/// 1e-15/(1 − c)³.
///
/// # Examples
/// ```
/// use fretwork_engine::reference::initial_wear_rate;
/// assert!((initial_wear_rate(2.0, 0.5) - 0.1222).abs() < 1e-4);
/// ```
pub fn initial_wear_rate(n: f64, c: f64) -> f64 {
    let power = libm::pow(c, n);
    let integral =
        n / (n + 1.0) * ((1.0 - power * power * c) / (2.0 * n + 1.0) - power + power * c);
    2.0 * integral / (1.0 - power)
}

/// U_el/U_gs = 2n/(2n+1): the elastic part of the amplitude in gross slip of an unworn power law.
///
/// # Derivation
/// In gross slip W = 8μE* ∫ y(U − (μE*/G*)y) dx = 4μF(U − U_el), with U_el = μ(E*/G*) ∫y²dx/∫y dx.
/// For y = d(1 − (x/a)ⁿ) the quotient of the integrals is d·2n/(2n+1). For U = U_gs this result
/// gives A of [`SlidingTransition`]. A flat punch has U_el = U_gs = μF/(2G*a), which is a lower
/// bound of U_el during wear.
pub fn elastic_amplitude_ratio(n: f64) -> f64 {
    2.0 * n / (2.0 * n + 1.0)
}

/// The wear volume of N cycles of gross slip at constant force, in m³: V = 4k_wF(U − U_el)N. This
/// is Archard's law with the slip amplitude U − U_el. U_el is the elastic part of the amplitude.
/// [`elastic_amplitude_ratio`] gives U_el/U_gs.
///
/// `wear` is k_w in 1/Pa, `force` is F in N, `slip` is U − U_el ≥ 0 in m, and `cycles` is N. U_el
/// decreases during wear. For U_el ≪ U this decrease is negligible.
///
/// # Examples
/// ```
/// use fretwork_engine::reference::gross_slip_volume;
/// // An amplitude of 50 µm, with negligible U_el, at 10 N and 1e-5 mm³/(N m).
/// let volume = gross_slip_volume(1e-14, 10.0, 50e-6, 1e6);
/// assert!((volume / 0.02e-9 - 1.0).abs() < 1e-12);
/// ```
pub fn gross_slip_volume(wear: f64, force: f64, slip: f64, cycles: f64) -> f64 {
    4.0 * wear * force * slip * cycles
}

/// The shakedown limit of q₀ = Q/(μF₀) at constant depth and tangential force: (n+1)^(−1/n). It is
/// 0.577 for a paraboloid and 0.5 for a cone. Below the limit wear stops, and the final stick ratio
/// is at least (n+1)^(−1/n). Above the limit wear leads to gross slip.
pub fn shakedown_limit(n: f64) -> f64 {
    libm::pow(n + 1.0, -1.0 / n)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::integrate;

    const MODULUS: f64 = 113e9;

    impl Hertz {
        /// p(r) = p₀ √(1 − r²/a²) in Pa; 0 outside the contact.
        fn pressure(&self, r: f64) -> f64 {
            let ratio = r / self.contact_radius();
            self.peak_pressure() * (1.0 - ratio * ratio).max(0.0).sqrt()
        }
    }

    impl Cone {
        /// F = (2/π) E* d²/tan θ in N.
        fn force(&self) -> f64 {
            FRAC_2_PI * self.modulus * self.depth * self.depth / self.slope
        }

        /// p(r) = (E* tan θ/2) arcosh(a/r) in Pa: infinite at the apex, 0 outside the contact.
        fn pressure(&self, r: f64) -> f64 {
            let ratio = (self.contact_radius() / r).max(1.0);
            0.5 * self.modulus * self.slope * libm::acosh(ratio)
        }
    }

    impl CattaneoMindlin {
        /// U = (3μF/(4G*a)) (1 − (1 − Q/(μF))^(2/3)) in m.
        fn displacement(&self, force: f64) -> f64 {
            self.sliding_displacement() * (1.0 - two_thirds(self.reserve(force)))
        }

        /// The shear traction at r in Pa: μp₀(√(1 − r²/a²) − (c/a) √(1 − r²/c²)). Each root is 0
        /// outside its radius.
        fn shear(&self, force: f64, r: f64) -> f64 {
            let (a, c) = (self.hertz.contact_radius(), self.stick_radius(force));
            let chord = |radius: f64| ((radius - r) * (radius + r)).max(0.0).sqrt();
            self.friction * self.hertz.peak_pressure() * (chord(a) - chord(c)) / a
        }

        /// The displacement in m on the unloading branch from Q*, at a force −Q* ≤ Q ≤ Q*:
        /// (3μF/(4G*a)) (2(1 − (Q*−Q)/(2μF))^(2/3) − (1 − Q*/(μF))^(2/3) − 1).
        fn displacement_on_return(&self, amplitude: f64, force: f64) -> f64 {
            let returned = two_thirds(self.reserve(0.5 * (amplitude - force)));
            let turned = two_thirds(self.reserve(amplitude));
            self.sliding_displacement() * (2.0 * returned - turned - 1.0)
        }
    }

    /// U/U_gs = 1 − (1 − q)^(n/(n+1)) of a power law with exponent n under Q = qμF.
    fn displacement_ratio(n: f64, q: f64) -> f64 {
        1.0 - libm::pow(1.0 - q, n / (n + 1.0))
    }

    fn close(value: f64, expected: f64, tolerance: f64) {
        assert!((value / expected - 1.0).abs() < tolerance, "{value}, not {expected}");
    }

    /// The force by the springs: F = 2E* ∫ (d − g) dx over 0…a, (9).
    fn by_springs(radius: f64, image: impl Fn(f64) -> f64) -> f64 {
        let depth = image(radius);
        2.0 * MODULUS * integrate(0.0, radius, |x| depth - image(x))
    }

    /// The force by the pressure: F = 2π ∫ p r dr.
    fn by_pressure(radius: f64, pressure: impl Fn(f64) -> f64) -> f64 {
        // The points are denser towards the axis and the edge, where pressures have square roots and
        // logarithms.
        let half = |from: f64, to: f64| {
            integrate(0.0, 1.0, |s| {
                let r = from + (to - from) * s * s;
                4.0 * PI * (to - from) * s * r * pressure(r)
            })
        };
        half(0.0, 0.5 * radius) - half(radius, 0.5 * radius)
    }

    #[test]
    fn hertz_agrees_with_integrals_over_springs_and_pressure() {
        let hertz = Hertz { modulus: MODULUS, radius: 0.01, depth: 3.5e-6 };
        let a = hertz.contact_radius();
        close(hertz.force(), by_springs(a, |x| x * x / hertz.radius), 1e-12);
        close(hertz.force(), by_pressure(a, |r| hertz.pressure(r)), 1e-9);
        close(hertz.peak_pressure(), 1.5 * hertz.force() / (PI * a * a), 1e-14);
        close(Hertz::under(hertz.force(), MODULUS, 0.01).depth, hertz.depth, 1e-14);
        assert!(hertz.pressure(1.001 * a) == 0.0);
    }

    #[test]
    fn the_cone_agrees_with_integrals_over_springs_and_pressure() {
        let cone = Cone { modulus: MODULUS, slope: 0.02, depth: 3.5e-6 };
        let a = cone.contact_radius();
        close(cone.force(), by_springs(a, |x| FRAC_PI_2 * cone.slope * x), 1e-12);
        close(cone.force(), by_pressure(a, |r| cone.pressure(r)), 1e-5);
        close(Cone::under(cone.force(), MODULUS, 0.02).depth, cone.depth, 1e-14);
        assert!(cone.pressure(0.0).is_infinite() && cone.pressure(1.001 * a) == 0.0);
    }

    #[test]
    fn the_power_law_agrees_with_cone_and_paraboloid_and_with_quadrature() {
        let hertz = Hertz { modulus: MODULUS, radius: 0.01, depth: 3e-6 };
        let power = PowerLaw { modulus: MODULUS, exponent: 2.0, coefficient: 50.0, depth: 3e-6 };
        close(power.contact_radius(), hertz.contact_radius(), 1e-14);
        close(power.force(), hertz.force(), 1e-14);
        let cone = Cone { modulus: MODULUS, slope: 0.02, depth: 3e-6 };
        let power = PowerLaw { modulus: MODULUS, exponent: 1.0, coefficient: 0.02, depth: 3e-6 };
        close(power.contact_radius(), cone.contact_radius(), 1e-14);
        close(power.force(), cone.force(), 1e-14);
        for n in [1.0, 1.5, 2.0, 3.7, 8.0] {
            let power = PowerLaw { modulus: MODULUS, exponent: n, coefficient: 3.0, depth: 1e-3 };
            // (3) by quadrature: g(x) = A n xⁿ ∫ sinⁿ⁻¹ψ dψ over 0…π/2.
            let image = |x: f64| {
                let slope = |t: f64| libm::pow(libm::sin(FRAC_PI_2 * t * t * t), n - 1.0);
                let integral = FRAC_PI_2 * integrate(0.0, 1.0, |t| 3.0 * t * t * slope(t));
                3.0 * n * libm::pow(x, n) * integral
            };
            close(image(power.contact_radius()), power.depth, 1e-9);
            close(power.force(), by_springs(power.contact_radius(), image), 1e-6);
            close(PowerLaw::under(power.force(), MODULUS, n, 3.0).depth, power.depth, 1e-13);
        }
    }

    #[test]
    fn the_sphere_agrees_with_its_springs_and_with_hertz_for_small_contacts() {
        let sphere = Sphere { modulus: MODULUS, radius: 0.01, contact_radius: 3e-3 };
        close(sphere.depth(), 3e-3 * libm::atanh(0.3), 1e-14);
        close(sphere.force(), by_springs(3e-3, |x| x * libm::atanh(x / 0.01)), 1e-12);
        let small = Sphere { contact_radius: 1e-4, ..sphere };
        let hertz = Hertz { modulus: MODULUS, radius: 0.01, depth: small.depth() };
        close(small.force(), hertz.force(), 1e-4);
    }

    /// (8)–(10) for the springs of a paraboloid, without the formulas of Cattaneo and Mindlin.
    #[test]
    fn cattaneo_and_mindlin_agree_with_the_springs() {
        let hertz = Hertz::under(100.0, MODULUS, 0.01);
        let contact = CattaneoMindlin { hertz, tangential_modulus: 93e9, friction: 0.7 };
        let (a, sliding) = (hertz.contact_radius(), contact.sliding_force());
        close(sliding, 70.0, 1e-13);
        let limit = |x: f64| 0.7 * MODULUS * (hertz.depth - x * x / hertz.radius);
        let in_pieces = |c: f64, f: &dyn Fn(f64) -> f64| integrate(0.0, c, f) + integrate(c, a, f);
        for q in [0.05, 0.3, 0.7, 0.99] {
            let force = q * sliding;
            let (u, c) = (contact.displacement(force), contact.stick_radius(force));
            close(93e9 * u, limit(c), 1e-11);
            close(c / a, stick_ratio(2.0, q), 1e-13);
            close(u / contact.sliding_displacement(), displacement_ratio(2.0, q), 1e-12);
            close(force, 2.0 * in_pieces(c, &|x| limit(x).min(93e9 * u)), 1e-12);
            close(contact.force(u), force, 1e-12);
            close(
                force,
                by_pressure(c, |r| contact.shear(force, r)) + {
                    let ring = |s: f64| {
                        let r = a - (a - c) * s * s;
                        4.0 * PI * (a - c) * s * r * contact.shear(force, r)
                    };
                    integrate(0.0, 1.0, ring)
                },
                1e-4,
            );
            // Springs during unloading. By Masing's rule each spring slips again after twice its
            // limit.
            let back = 0.4 * u;
            let returned = 2.0
                * in_pieces(c, &|x| {
                    let start = limit(x).min(93e9 * u);
                    (start - 93e9 * (u - back)).max(-limit(x))
                });
            let displacement = contact.displacement_on_return(force, returned);
            assert!((displacement - back).abs() < 1e-3 * u, "{displacement} {back}");
            // W is the area of the loop. It also is the sum of the losses of the springs,
            // 4·limit·(U − limit/G*) each. The factor 8 covers both halves of the row.
            let lost = 8.0 * integrate(c, a, |x| limit(x) * (u - limit(x) / 93e9));
            close(contact.energy_per_cycle(force), lost, 1e-9);
            let area = 2.0
                * integrate(0.0, 1.0, |s| {
                    let q = force * (1.0 - 2.0 * s);
                    // ∮ u dQ. The loading branch is the unloading branch with the opposite sign.
                    2.0 * force * contact.displacement_on_return(force, q)
                });
            close(area, lost, 1e-4);
        }
        close(contact.displacement(sliding), contact.sliding_displacement(), 1e-15);
        close(contact.displacement_on_return(40.0, 40.0), contact.displacement(40.0), 1e-13);
        close(contact.displacement_on_return(40.0, -40.0), -contact.displacement(40.0), 1e-13);
    }

    #[test]
    fn the_transition_criteria_of_a_hertz_mindlin_contact_agree_with_fouvry() {
        let criteria = SlidingTransition::of(2.0);
        assert!((criteria.energy_ratio - 0.2).abs() < 1e-15);
        assert!((criteria.displacement_ratio - (2.0 * libm::exp2(-2.0 / 3.0) - 1.0)).abs() < 1e-15);
        assert!((criteria.system_free_ratio - 0.7695).abs() < 5e-5);
        let hertz = Hertz::under(100.0, MODULUS, 0.01);
        let contact = CattaneoMindlin { hertz, tangential_modulus: 93e9, friction: 0.7 };
        let (top, stroke) = (contact.sliding_force(), contact.sliding_displacement());
        close(contact.energy_per_cycle(top) / (4.0 * top * stroke), criteria.energy_ratio, 1e-13);
        let open = contact.displacement_on_return(top, 0.0) / stroke;
        close(open, criteria.displacement_ratio, 1e-13);
        // The loss of the cone by quadrature, with y = 1 − x.
        let lost = 8.0 * integrate(0.0, 1.0, |x| (1.0 - x) * x);
        close(lost / 4.0, SlidingTransition::of(1.0).energy_ratio, 1e-13);
    }

    #[test]
    fn the_initial_wear_rate_is_the_loss_of_the_unworn_springs() {
        for (n, c) in [(1.0_f64, 0.21), (2.0, 0.5), (2.5, 0.7), (4.0, 0.3)] {
            let threshold = 1.0 - libm::pow(c, n);
            let y = |x: f64| 1.0 - libm::pow(x, n);
            let lost = integrate(c, 1.0, |x| y(x) * (threshold - y(x)));
            close(initial_wear_rate(n, c), 2.0 * lost / threshold, 1e-11);
        }
        let c = 0.5_f64;
        let printed =
            2.0 / 15.0 - 2.0 * c * c / 3.0 + 2.0 * c * c * c / 3.0 - 2.0 * c * c * c * c * c / 15.0;
        close(initial_wear_rate(2.0, c), 2.0 * printed / (1.0 - c * c), 1e-13);
    }

    #[test]
    fn the_elastic_amplitude_ratio_agrees_with_quadrature_and_with_mindlin_and_deresiewicz() {
        close(elastic_amplitude_ratio(2.0), 0.8, 1e-15);
        for n in [1.0, 2.0, 3.0, 8.0] {
            let y = |x: f64| 1.0 - libm::pow(x, n);
            let (first, second) = (integrate(0.0, 1.0, y), integrate(0.0, 1.0, |x| y(x) * y(x)));
            close(elastic_amplitude_ratio(n), second / first, 1e-13);
            close(SlidingTransition::of(n).energy_ratio, 1.0 - second / first, 1e-13);
        }
        // At the gross-slip threshold the volume per cycle is (k_w/μ)·W, with W of Mindlin and
        // Deresiewicz.
        let hertz = Hertz::under(100.0, MODULUS, 0.01);
        let contact = CattaneoMindlin { hertz, tangential_modulus: 93e9, friction: 0.7 };
        let slip = contact.sliding_displacement() * (1.0 - elastic_amplitude_ratio(2.0));
        let lost = contact.energy_per_cycle(contact.sliding_force());
        close(gross_slip_volume(3e-14, 100.0, slip, 1.0), 3e-14 / 0.7 * lost, 1e-12);
    }
}
