//! Stresses under a ball with friction, against closed forms of the literature and against the
//! numerical integration of point forces.

use std::array;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

use fretwork_engine::contact::yielding::{Rubbing, Stress};
use fretwork_engine::numeric::{integrate, maximum};
use fretwork_engine::reference::Hertz;
use fretwork_engine::scenario;
use serde_json::{Value, json};

use crate::engine::steel_ball;

const NO_FRICTION: Rubbing = Rubbing { friction: 0.0, stick: 0.0 };
const POISSON: [f64; 4] = [-0.9, 0.0, 0.3, 0.5];

fn assert_close(found: f64, expected: f64, tolerance: f64, at: impl std::fmt::Debug) {
    assert!((found - expected).abs() < tolerance, "{found} instead of {expected} at {at:?}");
}

/// Components xx, yy, zz, xy, yz and zx of a stress.
type Tensor = [f64; 6];

/// The stress at (x, y, z) by a unit force at the origin that presses on the surface. Source: J.
/// Boussinesq; K. L. Johnson, *Contact Mechanics* (1985), §3.3.
fn boussinesq(nu: f64, [x, y, z]: [f64; 3]) -> Tensor {
    let r = x.hypot(y).max(1e-150);
    let rho = r.hypot(z);
    let (cos, sin) = (x / r, y / r);
    let near = 1.0 / (rho * (rho + z));
    let along = (1.0 - 2.0 * nu) * near - 3.0 * z * r * r / rho.powi(5);
    let around = (1.0 - 2.0 * nu) * (z / rho.powi(3) - near);
    let shear = -3.0 * r * z * z / rho.powi(5);
    [
        along * cos * cos + around * sin * sin,
        along * sin * sin + around * cos * cos,
        -3.0 * z.powi(3) / rho.powi(5),
        (along - around) * sin * cos,
        shear * sin,
        shear * cos,
    ]
    .map(|stress| stress / TAU)
}

/// The stress at (x, y, z) by a unit force at the origin that pulls in the direction of x. Source:
/// V. Cerruti; Johnson §3.6.
fn cerruti(nu: f64, [x, y, z]: [f64; 3]) -> Tensor {
    let rho = x.hypot(y).hypot(z);
    let sum = rho + z;
    let incompressible = -3.0 * x / rho.powi(5);
    let [cube, near] = [rho.powi(-3), 1.0 / (rho * sum * sum)];
    let bent = 1.0 / (rho.powi(3) * sum * sum) + 2.0 / (rho * rho * sum.powi(3));
    let rest = 1.0 - 2.0 * nu;
    [
        incompressible * x * x + rest * x * (cube - 3.0 * near + x * x * bent),
        incompressible * y * y + rest * x * (cube - near + y * y * bent),
        incompressible * z * z,
        incompressible * x * y + rest * y * (x * x * bent - near),
        incompressible * y * z,
        incompressible * x * z,
    ]
    .map(|stress| stress / TAU)
}

/// The stress at a point by the traction √(1 − r²/R²) on the disc of radius R, from the stress by a
/// point force.
fn integrated(radius: f64, [x, y, z]: [f64; 3], point: impl Fn([f64; 3]) -> f64) -> f64 {
    const ANGLES: u32 = 192;
    let ring = |alpha: f64| {
        let r = radius * alpha.sin();
        let angles = (0..ANGLES).map(|i| TAU * f64::from(i) / f64::from(ANGLES));
        let sum: f64 = angles.map(|t| point([x - r * t.cos(), y - r * t.sin(), z])).sum();
        sum * r * radius * alpha.cos() * alpha.cos() * TAU / f64::from(ANGLES)
    };
    integrate(0.0, FRAC_PI_4, ring) + integrate(FRAC_PI_4, FRAC_PI_2, ring)
}

/// A stress in cylindrical components at the angle θ, in the order of [`Stress`].
fn cylindrical([xx, yy, zz, xy, yz, zx]: Tensor, theta: f64) -> Stress {
    let (sin, cos) = theta.sin_cos();
    [
        xx * cos * cos + yy * sin * sin + 2.0 * xy * sin * cos,
        xx * sin * sin + yy * cos * cos - 2.0 * xy * sin * cos,
        zz,
        zx * cos + yz * sin,
        (yy - xx) * sin * cos + xy * (cos * cos - sin * sin),
        yz * cos - zx * sin,
    ]
}

/// The stress at the angle θ on a circle.
fn stress(rubbing: Rubbing, nu: f64, (r, theta, z): (f64, f64, f64)) -> Stress {
    let [pressed, rubbed] = rubbing.stresses(nu, r, z);
    let (sin, cos) = theta.sin_cos();
    array::from_fn(|k| pressed[k] + rubbed[k] * if k < 4 { cos } else { sin })
}

fn von_mises([r, t, z, rz, rt, tz]: Stress) -> f64 {
    let shear = rz * rz + rt * rt + tz * tz;
    (r * r + t * t + z * z - r * t - t * z - z * r + 3.0 * shear).sqrt()
}

/// σ on the axis without friction, along z and across. Source: Johnson §3.4(c).
fn on_the_axis(nu: f64, z: f64) -> (f64, f64) {
    let along = -1.0 / (1.0 + z * z);
    (along, -(1.0 + nu) * (1.0 - z * (FRAC_PI_2 - z.atan())) - 0.5 * along)
}

/// The largest von Mises stress on the surface along the line of sliding, behind the centre of the contact. Sources:
/// Johnson §3.4(c) for the pressure, Hamilton (1983) for the traction.
fn on_the_surface(nu: f64, friction: f64) -> f64 {
    let at = |step: u32| {
        let r = f64::from(step) / 1e4;
        let pressure = (1.0 - r * r).sqrt();
        let bulge = (1.0 - 2.0 * nu) / (3.0 * r * r) * (1.0 - pressure.powi(3));
        let along = bulge - pressure + (4.0 + nu) / 8.0 * PI * friction * r;
        let across = -bulge - 2.0 * nu * pressure + 3.0 / 8.0 * PI * nu * friction * r;
        von_mises([along, across, -pressure, -friction * pressure, 0.0, 0.0])
    };
    (1..=10_000).map(at).fold(0.0, f64::max)
}

#[test]
fn stresses_without_friction_agree_with_closed_forms() {
    for nu in POISSON {
        for z in [0.0, 1e-9, 0.01, 0.3, 0.48, 1.0, 3.0, 100.0] {
            let (along, across) = on_the_axis(nu, z);
            let [found, _] = NO_FRICTION.stresses(nu, 0.0, z);
            for (found, expected) in found.into_iter().zip([across, across, along, 0.0, 0.0, 0.0]) {
                assert_close(found, expected, 1e-12, (nu, z));
            }
        }
        // The surface inside and outside of the contact. Source: Johnson §3.4(c).
        for r in [1e-3_f64, 0.2, 0.7, 0.999, 1.0, 1.001, 2.0, 50.0] {
            let pressure = (1.0 - r * r).max(0.0).sqrt();
            let bulge = (1.0 - 2.0 * nu) / (3.0 * r * r) * (1.0 - pressure.powi(3));
            let [found, _] = NO_FRICTION.stresses(nu, r, 0.0);
            let around = -bulge - 2.0 * nu * pressure;
            let expected = [bulge - pressure, around, -pressure, 0.0, 0.0, 0.0];
            for (found, expected) in found.into_iter().zip(expected) {
                assert_close(found, expected, 1e-9, (nu, r));
            }
        }
    }
}

#[test]
fn stresses_of_sliding_and_sticking_surfaces_agree_with_closed_forms() {
    for nu in POISSON {
        for r in [0.0_f64, 0.1, 0.6, 0.9, 1.0] {
            let [_, found] = Rubbing { friction: 1.0, stick: 0.0 }.stresses(nu, r, 0.0);
            let traction = (1.0 - r * r).sqrt();
            let (along, across) = (-FRAC_PI_2 * (1.0 + 0.25 * nu), -3.0 / 8.0 * PI * nu);
            let shear = FRAC_PI_4 * (1.0 - 0.5 * nu);
            let expected = [along * r, across * r, 0.0, -traction, shear * r, traction];
            for (found, expected) in found.into_iter().zip(expected) {
                assert_close(found, expected, 1e-12, (nu, r));
            }
            // Where the surface sticks, it moves as a whole, so friction does not strain it.
            let [_, stuck] = Rubbing { friction: 1.0, stick: 0.8 }.stresses(nu, 0.8 * r, 0.0);
            for component in [0, 1, 2, 4] {
                assert_close(stuck[component], 0.0, 1e-12, (nu, r));
            }
        }
    }
}

#[test]
fn stresses_agree_with_the_integration_of_point_forces() {
    for nu in [-0.9, 0.0, 0.3, 0.5] {
        for (friction, stick) in [(0.3, 0.0), (0.7, 0.5), (2.0, 0.9)] {
            for point in [(0.0, 0.0, 0.3), (0.4, 0.7, 0.25), (1.0, PI, 0.3), (1.4, -2.0, 0.8)] {
                let (r, theta, z) = point;
                let at = [r * theta.cos(), r * theta.sin(), z];
                let tensor = array::from_fn(|k| {
                    let slid = |from| cerruti(nu, from)[k];
                    let stuck = if stick > 0.0 { integrated(stick, at, slid) } else { 0.0 };
                    integrated(1.0, at, |from| boussinesq(nu, from)[k])
                        + friction * (integrated(1.0, at, slid) - stick * stuck)
                });
                let found = stress(Rubbing { friction, stick }, nu, point);
                for (found, expected) in found.into_iter().zip(cylindrical(tensor, theta)) {
                    assert_close(found, expected, 1e-9, (nu, stick, point));
                }
            }
        }
    }
}

#[test]
fn without_friction_steel_yields_under_the_surface_at_1_6_times_its_strength() {
    let shear = |z: f64| {
        let (along, across) = on_the_axis(0.3, z);
        0.5 * (across - along)
    };
    let depth = maximum(0.0, 2.0, shear);
    assert_close(depth, 0.48, 0.005, "depth");
    assert_close(shear(depth), 0.31, 0.001, "shear");
    let largest = NO_FRICTION.largest_von_mises(0.3);
    assert_close(largest, 2.0 * shear(depth), 1e-7, "von Mises");
    assert_close(1.0 / largest, 1.6, 0.02, "first yield");
}

/// Source: Johnson §7.1(b).
#[test]
fn above_a_friction_of_0_3_steel_yields_first_at_the_surface() {
    let ratio = |friction| {
        let largest = Rubbing { friction, stick: 0.0 }.largest_von_mises(0.3);
        largest / on_the_surface(0.3, friction)
    };
    for friction in [0.31, 0.4, 0.7, 1.0, 2.0, 100.0] {
        assert_close(ratio(friction), 1.0, 1e-6, friction);
    }
    for friction in [0.0, 0.1, 0.2, 0.3] {
        assert!(ratio(friction) > 1.005, "{friction}: {}", ratio(friction));
    }
}

#[test]
fn no_point_of_a_fine_grid_has_a_larger_stress() {
    for nu in POISSON {
        for (friction, stick) in
            [(0.0, 0.0), (0.2, 0.0), (0.31, 0.0), (0.3, 0.6), (0.8, 0.3), (0.8, 0.9), (50.0, 0.99)]
        {
            let rubbing = Rubbing { friction, stick };
            let largest = rubbing.largest_von_mises(nu);
            let mut on_grid = 0.0_f64;
            for (i, j, k) in
                (0..75).flat_map(|i| (0..75).flat_map(move |j| (0..=12).map(move |k| (i, j, k))))
            {
                let [r, z] = [i, j].map(|step| 0.02 * f64::from(step));
                let point = (r, PI * f64::from(k) / 12.0, z);
                on_grid = on_grid.max(von_mises(stress(rubbing, nu, point)));
            }
            let at = (nu, friction, stick);
            assert!(largest > on_grid * (1.0 - 1e-6), "{largest} {on_grid} {at:?}");
            assert_close(largest / on_grid, 1.0, 2e-3, at);
        }
    }
}

#[test]
fn friction_does_not_change_the_stress_of_a_contact_that_sticks() {
    let largest = |stick| Rubbing { friction: 0.7, stick }.largest_von_mises(0.3);
    assert_close(largest(1.0), NO_FRICTION.largest_von_mises(0.3), 1e-12, 1.0);
    let ratios = [1.0, 0.9, 0.7, 0.5, 0.0];
    assert!(ratios.is_sorted_by(|more, less| largest(*more) < largest(*less)));
}

/// The warnings `yield` of a ball with this motion, if body 0 has this yield strength in Pa.
fn yields(request: &Value, strength: f64) -> Vec<String> {
    let mut request = request.clone();
    request["bodies"][0]["yield_strength"] = json!(strength);
    let (_, warnings) = scenario::check(&request, "").expect("a valid scenario");
    let yields = warnings.into_iter().filter(|warning| warning.kind == "yield");
    yields.map(|warning| warning.detail).collect()
}

#[test]
fn a_ball_has_a_warning_if_its_von_mises_stress_exceeds_the_yield_strength() {
    for (motion, stick) in [
        (json!({"stick_ratio": 0.5}), 0.5),
        (json!({"stick_ratio": 0.5, "held": "tangential_force"}), 0.5),
        (json!({"amplitude": "10 um"}), 0.0),
        (
            json!({"blocks": [
                {"amplitude": "1 um", "cycles": 1e5}, {"amplitude": "10 um", "cycles": 1e9},
            ]}),
            0.0,
        ),
    ] {
        let mut request = steel_ball();
        request["motion"] = motion;
        request["load"] = json!({"normal_force": "100 N", "held": "force"});
        let steel = 205e9 / (2.0 * (1.0 - 0.3 * 0.3));
        let peak = Hertz::under(100.0, steel, 0.01).peak_pressure();
        let rubbing = Rubbing { friction: 0.7, stick };
        let stress = peak * rubbing.largest_von_mises(0.3);
        assert_eq!(yields(&request, 1.0001 * stress), [""; 0], "{stick}");
        let told = yields(&request, 0.9999 * stress);
        let start = format!(
            "The largest von Mises stress of the unworn contact ({:.0} MPa) exceeds the yield \
             strength of the first body",
            stress / 1e6
        );
        assert!(told.len() == 1 && told[0].starts_with(&start), "{told:?}");
    }
}

#[test]
fn other_shapes_have_a_warning_if_their_peak_pressure_exceeds_1_6_times_the_yield_strength() {
    let mut request = steel_ball();
    request["profile"] = json!({"shape": "cone", "slope_angle": "2 deg"});
    let told = yields(&request, 1e15);
    assert!(told[0].contains("(infinite at an apex or an edge) exceeds 1.6 times"), "{told:?}");
    request["profile"] =
        json!({"shape": "power", "exponent": 4, "height": "1 um", "at_radius": "0.2 mm"});
    let (scenario, _) = scenario::check(&request, "").expect("a valid scenario");
    let case = scenario.case().expect("a contact");
    let shape = &case.contact.shape;
    let pressure =
        shape.peak_pressure() * case.scales.normal_modulus * case.scales.indentation_depth
            / case.scales.contact_radius;
    assert_eq!(yields(&request, pressure / 1.5999), [""; 0]);
    let told = yields(&request, pressure / 1.6001);
    assert!(told.len() == 1 && told[0].starts_with("The unworn peak pressure ("), "{told:?}");
}
