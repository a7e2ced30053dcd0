//! Limiting states in closed form, written from the literature alone. Lengths are in a₀, heights in d₀ and
//! volumes in a₀²d₀ of the unworn contact.

use std::f64::consts::{FRAC_2_PI, FRAC_PI_2, PI};

use fretwork_engine::numeric::{integrate, root};
use fretwork_engine::reference::{shakedown_limit, stick_ratio};

/// The limiting state of fretting wear for a power law f ∝ rⁿ. Source: *limits of wear*.
///
/// The profile is unworn inside the stick radius c. Between c and the scar radius ã it carries no
/// load.
///
/// # Derivation
/// Let cos φ = c/ã and Cₙ(φ) = ∫ cosⁿψ dψ over 0…φ. The limiting profile meets the unworn profile
/// at ã, (13). This condition becomes dφ = ãⁿCₙ(φ), or
/// ```text
/// d/cⁿ = Cₙ(φ)/(φ cosⁿφ)           cone: tan φ/φ = d/c     paraboloid: sec²φ + tan φ/φ = 2d/c²
/// ```
/// At the greatest depth w is stationary. Its radius r = c/cos ϑ follows from d/cⁿ = 1 + n tan ϑ
/// Cₙ(ϑ)/cosⁿϑ. With φ known, the volume is elementary for every n:
/// ```text
/// V = (2n/(n+2)) dã²φ − 2c√(ã²−c²) (d − 2cⁿ/(n+2))
/// w(r) = (2/π) (dϑ − rⁿCₙ(ϑ)),  cos ϑ = c/r
/// ```
///
/// Accuracy of the radii: 1e-12. Accuracy of volume and depth: 1e-15/(1−c)², because of cancellation. The errors were
/// measured with 40 digits for n from 1 to 11.3 and c from 0.001 to 0.999.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimitingState {
    /// Stick radius c.
    pub stick_radius: f64,
    /// Indentation depth d.
    pub indentation_depth: f64,
    /// Scar radius ã.
    pub radius: f64,
    /// Wear volume V.
    pub volume: f64,
    /// The greatest wear depth.
    pub depth: f64,
    /// The radius at which the wear is deepest.
    pub depth_radius: f64,
    /// F/F₀ = ((n+1)dc − cⁿ⁺¹)/n, because only the core carries load.
    pub force_ratio: f64,
}

impl LimitingState {
    /// The limiting state at constant depth and amplitude. The springs inside 0 < c < 1 stick from
    /// the first cycle on.
    pub fn depth_and_amplitude_held(n: f64, c: f64) -> Self {
        Self::of(n, c, 1.0)
    }

    /// The limiting state at constant normal and tangential force, 0 < q < 1. The stick radius c =
    /// (1−q)^(1/(n+1)) is constant. The core carries F₀, so d = n/((n+1)c) + cⁿ/(n+1).
    pub fn forces_held(n: f64, q: f64) -> Self {
        let c = stick_ratio(n, q);
        Self::of(n, c, (n / c + libm::pow(c, n)) / (n + 1.0))
    }

    /// The limiting state at constant depth and tangential force, q = Q/(μF₀). c is the larger root
    /// of q = ((n+1)/n) c(1 − cⁿ). `None` if q is at least `shakedown_limit`.
    pub fn depth_and_tangential_force_held(n: f64, q: f64) -> Option<Self> {
        let least = shakedown_limit(n);
        if q >= least {
            return None;
        }
        let excess = |c: f64| (n + 1.0) / n * c * (1.0 - libm::pow(c, n)) - q;
        Some(Self::of(n, root(least, 1.0, excess), 1.0))
    }

    /// The limiting state in gross slip at constant depth: the contact carries no load. ã =
    /// κₙ^(1/n), V = πn/(n+2)·ã²: √2 and π for a paraboloid, π/2 and π³/12 for a cone.
    pub fn gross_slip(n: f64) -> Self {
        let logarithm = libm::lgamma(0.5 * n + 1.0) - libm::lgamma(0.5 * (n + 1.0));
        let kappa = PI.sqrt() * libm::exp(logarithm);
        let radius = libm::pow(kappa, 1.0 / n);
        Self {
            stick_radius: 0.0,
            indentation_depth: 1.0,
            radius,
            volume: PI * n / (n + 2.0) * radius * radius,
            depth: 1.0,
            depth_radius: 0.0,
            force_ratio: 0.0,
        }
    }

    fn of(n: f64, c: f64, d: f64) -> Self {
        let power = libm::pow(c, n);
        let relative = |angle: f64| libm::pow(libm::cos(angle), n);
        // Both conditions are multiplied by the power of the cosine, so that they have no poles.
        let end =
            root(1e-9, FRAC_PI_2, |phi| cosine_integral(n, phi) / phi - d / power * relative(phi));
        let deepest = root(0.0, FRAC_PI_2, |theta| {
            let slope = n * libm::sin(theta) * cosine_integral(n, theta);
            slope - (d / power - 1.0) * relative(theta) * libm::cos(theta)
        });
        // The formula c/cos φ is not used, because it loses digits if φ is close to π/2.
        let radius = libm::pow(d * end / cosine_integral(n, end), 1.0 / n);
        let depth_radius = c / libm::cos(deepest);
        // The condition for the greatest depth gives rⁿCₙ(ϑ) without an integral.
        let lifted = (d - power) / (n * libm::tan(deepest));
        Self {
            stick_radius: c,
            indentation_depth: d,
            radius,
            volume: 2.0 * n / (n + 2.0) * d * radius * radius * end
                - 2.0 * c * radius * libm::sin(end) * (d - 2.0 * power / (n + 2.0)),
            depth: FRAC_2_PI * (d * deepest - lifted),
            depth_radius,
            force_ratio: ((n + 1.0) * d * c - power * c) / n,
        }
    }
}

/// The integral ∫ cosⁿψ dψ over 0…φ ≤ π/2.
fn cosine_integral(n: f64, phi: f64) -> f64 {
    // Graded towards φ, because a non-integer power has a kink at π/2.
    phi * integrate(0.0, 1.0, |t| {
        let psi = phi * (1.0 - t * t * t);
        3.0 * t * t * libm::pow(libm::cos(psi).max(0.0), n)
    })
}

fn close(value: f64, expected: f64, tolerance: f64) {
    assert!((value / expected - 1.0).abs() < tolerance, "{value}, not {expected}");
}

#[test]
fn the_limiting_radius_satisfies_the_conditions_of_the_paper() {
    for c in [1e-3, 0.05, 0.21, 0.5, 0.9, 0.999] {
        // Equation (20) of the paper, for the cone.
        let a = LimitingState::depth_and_amplitude_held(1.0, c).radius;
        let left = FRAC_PI_2 - libm::asin(c / a);
        assert!((left - ((a - c) * (a + c)).sqrt()).abs() < 1e-12, "cone {c}");
        // Equation (13) of the paper with g₀ = x² and f₀ = r²/2, integrated analytically.
        let a = LimitingState::depth_and_amplitude_held(2.0, c).radius;
        let (angle, chord) = (libm::acos(c / a), ((a - c) * (a + c)).sqrt());
        let core = 0.5 * (a * a * (FRAC_PI_2 - angle) - c * chord);
        assert!((FRAC_2_PI * (core + angle) - 0.5 * a * a).abs() < 1e-12, "paraboloid {c}");
        // Equation (19) of the paper gives lower values, by at most 3.6 %.
        let printed = (0.25 * c * c + 2.0).sqrt() - 0.5 * c;
        assert!((0.0..0.037).contains(&(1.0 - printed / a)), "{printed} {a}");
    }
}

#[test]
fn volume_depth_and_force_agree_with_the_limiting_profile() {
    for (n, c) in [(1.0, 0.3), (2.0, 0.5), (2.6, 0.2), (4.0, 0.7)] {
        for state in
            [LimitingState::depth_and_amplitude_held(n, c), LimitingState::forces_held(n, 1.0 - c)]
        {
            let (c, d) = (state.stick_radius, state.indentation_depth);
            let wear = |r: f64| {
                let theta = libm::acos(c / r);
                FRAC_2_PI * (d * theta - libm::pow(r, n) * cosine_integral(n, theta))
            };
            let width = state.radius - c;
            let volume = 4.0
                * PI
                * width
                * integrate(0.0, 1.0, |s| {
                    let r = c + width * s * s;
                    s * r * wear(r)
                });
            close(state.volume, volume, 1e-8);
            close(state.depth, wear(state.depth_radius), 1e-10);
            for near in [0.99, 1.01] {
                assert!(wear(near * state.depth_radius) < state.depth);
            }
            // Compare with F∞ = 2 ∫ (d − g₀) dx over the core.
            let core = integrate(0.0, c, |x| d - libm::pow(x, n));
            close(state.force_ratio, core * (n + 1.0) / n, 1e-7);
        }
    }
}

#[test]
fn the_limiting_state_preserves_the_constant_forces() {
    for n in [1.0, 2.0, 5.0] {
        for q in [0.1, 0.4, 0.9] {
            let state = LimitingState::forces_held(n, q);
            close(state.force_ratio, 1.0, 1e-13);
            let Some(state) = LimitingState::depth_and_tangential_force_held(n, q) else {
                assert!(q > shakedown_limit(n));
                continue;
            };
            // Compare with Q = 2G*U·c, where G*U = μE*(d − g₀(c)).
            let c = state.stick_radius;
            close(2.0 * c * (1.0 - libm::pow(c, n)) * (n + 1.0) / (2.0 * n), q, 1e-12);
            assert!(c > shakedown_limit(n));
        }
        let at = |q: f64| LimitingState::depth_and_tangential_force_held(n, q);
        let edge = shakedown_limit(n);
        assert!(at(edge * 1.0001).is_none() && at(edge * 0.9999).is_some());
    }
    close(shakedown_limit(2.0), 0.577_35, 1e-5);
    close(shakedown_limit(1.0), 0.5, 1e-15);
}

#[test]
fn the_limiting_state_approaches_gross_slip_as_the_core_shrinks() {
    let paraboloid = LimitingState::gross_slip(2.0);
    close(paraboloid.radius, 2_f64.sqrt(), 1e-14);
    close(paraboloid.volume, PI, 1e-14);
    let cone = LimitingState::gross_slip(1.0);
    close(cone.radius, FRAC_PI_2, 1e-14);
    close(cone.volume, PI * PI * PI / 12.0, 1e-14);
    for n in [1.0, 1.5, 2.0, 4.0] {
        let (gross, nearly) =
            (LimitingState::gross_slip(n), LimitingState::depth_and_amplitude_held(n, 1e-4));
        close(nearly.radius, gross.radius, 1e-4);
        close(nearly.volume, gross.volume, 4e-4);
    }
}
