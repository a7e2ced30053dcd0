//! The largest von Mises stress under a ball with friction. A warning compares it with the yield
//! strength.
//!
//! A ball presses with the pressure of Hertz. At a turning point of the motion the traction is μ
//! times the pressure where the contact slips, and less where it sticks: it is the difference of
//! two tractions of sliding (Cattaneo, Mindlin).
//!
//! # Equations
//! ```text
//! p = √(1 − r²),   q = μ (√(1 − r²) − c √(1 − r²/c²)),   c: stick radius, 0 in gross slip
//! σ = N(r, z) + μ (T(r, z) − c T(r/c, z/c)),             N by p, T by sliding with μ = 1
//! ```
//! The potential of p is that of point sources at the depths z + it, −1 < t < 1, with the weight
//! (π/2)(1 − t²). So all derivatives of the potentials of Boussinesq and Cerruti are closed forms of
//! R = √(r² + ζ²), ζ = z + i. Hamilton gives the same stresses in another explicit form.
//!
//! With the angle θ from the direction of the motion, N is constant on a circle around the axis, and
//! the components of T are proportional to cos θ or sin θ. The square of the von Mises stress is
//! therefore a quadratic function of cos θ, whose maximum is known. The search needs only r and z.
//!
//! # Units
//! Lengths are in contact radii a, stresses in peak pressures p₀.
//!
//! # Accuracy
//! The search finds the largest stress to 1e-6. A sphere is treated as a paraboloid with the same
//! contact radius and peak pressure. Its pressure near the edge of the contact is larger by the
//! relative amount 0.44 (a/R)².
//!
//! # Sources
//! G. M. Hamilton, *Proc. Inst. Mech. Eng. C* 197 (1983) 53; K. L. Johnson, *Contact Mechanics*
//! (1985), §3.2 (the potentials), §7.1(b) (sliding), §7.2(d) (partial slip).

use std::array;
use std::ops::RangeInclusive;

/// Number of steps of the grid in which the search begins, over a contact radius.
const STEPS: u32 = 8;
/// Distance of points at which the search ends. The error of a smooth maximum is about its square.
const LAST_STEP: f64 = 1e-4;

/// The components σ_r, σ_θ, σ_z, τ_rz, τ_rθ and τ_θz of a stress. Tension is positive; z points into
/// the body.
pub type Stress = [f64; 6];

/// Friction under a ball at a turning point of the motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rubbing {
    /// The coefficient of friction μ.
    pub friction: f64,
    /// The stick radius c; 0 in gross slip.
    pub stick: f64,
}

impl Rubbing {
    /// The largest von Mises stress in a body with Poisson's ratio ν.
    ///
    /// # Examples
    /// Without friction, steel yields at p₀ = 1.61 times its yield strength, and with μ = 0.5 at 1.05
    /// times.
    /// ```
    /// use fretwork_engine::contact::yielding::Rubbing;
    /// let sliding = |friction| Rubbing { friction, stick: 0.0 };
    /// assert!((1.0 / sliding(0.0).largest_von_mises(0.3) - 1.61).abs() < 0.01);
    /// assert!((1.0 / sliding(0.5).largest_von_mises(0.3) - 1.05).abs() < 0.01);
    /// ```
    pub fn largest_von_mises(&self, poisson: f64) -> f64 {
        // The surface and the interior can each have a maximum.
        self.search(poisson, 0..=0).max(self.search(poisson, 1..=STEPS))
    }

    /// Climbs from the best point of a grid with these rows below the surface.
    fn search(&self, poisson: f64, rows: RangeInclusive<u32>) -> f64 {
        let at = |(r, z): (f64, f64)| self.largest_on_circle(poisson, r.abs(), z.abs());
        let place = |step| f64::from(step) / f64::from(STEPS);
        let (mut best, mut most) = ((0.0, 0.0), 0.0);
        for (r, z) in rows.flat_map(|z| (0..=STEPS).map(move |r| (place(r), place(z)))) {
            let found = at((r, z));
            if found > most {
                (best, most) = ((r, z), found);
            }
        }
        let mut step = 0.5 / f64::from(STEPS);
        while step > LAST_STEP {
            let (r, z) = best;
            let around = [(r - step, z), (r + step, z), (r, z - step), (r, z + step)];
            match around.into_iter().find(|point| at(*point) > most) {
                Some(point) => (best, most) = (point, at(point)),
                None => step *= 0.5,
            }
        }
        most
    }

    /// The largest von Mises stress on a circle around the axis.
    fn largest_on_circle(&self, poisson: f64, r: f64, z: f64) -> f64 {
        let [pressed, [radial, hoop, normal, shear, beside @ ..]] = self.stresses(poisson, r, z);
        let ahead = [radial, hoop, normal, shear, 0.0, 0.0];
        let beside = [0.0, 0.0, 0.0, 0.0, beside[0], beside[1]];
        // The square of the stress is constant + 2 linear·cos θ + square·cos² θ.
        let across = product(&beside, &beside);
        let constant = product(&pressed, &pressed) + across;
        let linear = product(&pressed, &ahead).abs();
        let square = product(&ahead, &ahead) - across;
        let cos = if linear < -square { linear / -square } else { 1.0 };
        (constant + (2.0 * linear + square * cos) * cos).sqrt()
    }

    /// The stresses at (r, z) by the pressure and by the traction, in a body with Poisson's ratio ν.
    /// The first four components of the second stress are multiplied by cos θ, and the last two by
    /// sin θ.
    pub fn stresses(&self, poisson: f64, r: f64, z: f64) -> [Stress; 2] {
        let Self { friction, stick } = *self;
        let [pressed, slid] = hertz(poisson, r, z);
        let [_, stuck] =
            if stick > 0.0 { hertz(poisson, r / stick, z / stick) } else { Default::default() };
        [pressed, array::from_fn(|k| friction * (slid[k] - stick * stuck[k]))]
    }
}

/// The bilinear form B(a, b) for which B(a, a) is the square of the von Mises stress of a.
fn product(a: &Stress, b: &Stress) -> f64 {
    let normal = (a[0] - a[1]) * (b[0] - b[1])
        + (a[1] - a[2]) * (b[1] - b[2])
        + (a[2] - a[0]) * (b[2] - b[0]);
    0.5 * normal + 3.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
}

/// N and T: the stresses at (r, z) by the pressure √(1 − r²), and by the same traction.
///
/// ```text
/// V = (1/2π) ∫∫ p/ρ,   ∂H/∂z = V,   ∂F/∂z = H,   D = (1/r) ∂/∂r
/// φ = Im ln(R + ζ),    q = 1/(R + ζ),   w = ζq
/// ```
/// `d_v` is DV, `d_d_h` is D²H, `v_z` is ∂V/∂z, and `z_v_zz` is z ∂²V/∂z². The other derivatives
/// follow from the equation of Laplace.
fn hertz(poisson: f64, r: f64, z: f64) -> [Stress; 2] {
    // Write R as m + in. Neither part is negative, and mn = z.
    let excess = (r - 1.0) * (r + 1.0) + z * z;
    let square = (excess * excess + 4.0 * z * z).sqrt();
    let larger = (0.5 * (square + excess.abs())).sqrt();
    let smaller = if larger > 0.0 { z / larger } else { 0.0 };
    let (m, n) = if excess > 0.0 { (larger, smaller) } else { (smaller, larger) };
    // 1/R is infinite at the edge of the contact, but z/R tends to 0 there.
    let z_over_square = if z > 0.0 { z / square } else { 0.0 };

    let (re, im) = (m + z, n + 1.0);
    let norm = re * re + im * im;
    let (q_re, q_im) = (re / norm, -im / norm);
    let (w_re, w_im) = ((z * re + im) / norm, (m - z * n) / norm);
    let phi = libm::atan2(im, re);
    // The product q(2 − w).
    let product_re = q_re * (2.0 - w_re) + q_im * w_im;
    let product_im = q_im * (2.0 - w_re) - q_re * w_im;

    let v_z = z * phi - n;
    let z_v_zz = z * phi - m * z_over_square;
    let z_d_v_z = -z * q_im - (q_re * m + q_im * n) * z_over_square;
    let d_v = q_re - 0.5 * (phi + w_im);
    let d_h = (n + w_re) / 3.0 - 0.5 * z * phi - z * w_im / 6.0;
    let d_d_h = product_im / 6.0 + 0.5 * (q_re * q_re - q_im * q_im);
    let d_d_f = phi / 8.0 + w_im * (5.0 - 2.0 * w_re) / 24.0 - product_re / 6.0;

    let nu = poisson;
    let pressed = [
        v_z + (1.0 - 2.0 * nu) * d_h + z_v_zz + z * d_v,
        2.0 * nu * v_z - (1.0 - 2.0 * nu) * d_h - z * d_v,
        v_z - z_v_zz,
        -r * z_d_v_z,
        0.0,
        0.0,
    ];
    let slid = [
        r * (2.0 * d_v - 2.0 * nu * d_d_f + z_d_v_z + z * d_d_h),
        r * (2.0 * nu * (d_v + d_d_f) - z * d_d_h),
        -r * z_d_v_z,
        v_z + z_v_zz + z * d_v,
        -r * (d_v + 2.0 * nu * d_d_f - z * d_d_h),
        z * d_v - v_z,
    ];
    [pressed, slid]
}
