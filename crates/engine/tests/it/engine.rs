//! Compares the engine with independent calculations: closed forms, tabulated reference solutions,
//! a step-by-step simulation of the springs, and quadrature of the integrals that define the
//! curves.

use std::f64::consts::{FRAC_2_PI, PI};

use fretwork_engine::contact::Flank;
use fretwork_engine::contact::hysteresis::Backbone;
use fretwork_engine::contact::profile::Shape;
use fretwork_engine::contact::row::SpringRow;
use fretwork_engine::contact::unworn::{Contact, Decay, Regime};
use fretwork_engine::numeric::integrate;
use fretwork_engine::outcome::{History, Outcome};
use fretwork_engine::scenario::{self, Scenario};
use fretwork_engine::simulation::{Advance, Simulation};
use fretwork_engine::solver::closed::simplified::Simplified;
use serde_json::{Value, json};

use crate::literal;

pub fn steel_ball() -> Value {
    json!({
        "profile": {"shape": "paraboloid", "radius": "10 mm"},
        "bodies": [
            {"youngs_modulus": "205 GPa", "poisson_ratio": 0.3},
            {"youngs_modulus": "205 GPa", "poisson_ratio": 0.3}
        ],
        "friction": 0.7,
        "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
        "load": {"normal_force": "100 N", "held": "depth"},
        "motion": {"amplitude": "2.256 um"},
        "cycles": [1000, 3000, 10000, 30000],
        "model": {"method": "simplified", "xi": 0.8, "points": 256}
    })
}

fn scenario(value: &Value) -> Scenario {
    scenario::check(value, "").unwrap_or_else(|faults| panic!("{value}: {faults:?}")).0
}

fn run(value: &Value) -> Outcome {
    Simulation::of(&scenario(value)).expect("a contact").run()
}

fn close(value: f64, expected: f64, tolerance: f64) {
    assert!(
        (value / expected - 1.0).abs() <= tolerance,
        "{value} is not {expected} within {tolerance}"
    );
}

/// Compares the closed form of (14)–(16) with a simulation of the springs in every cycle.
#[test]
fn step_by_step_simulation_converges_to_the_closed_form() {
    for (exponent, c) in [(2.0, 0.5), (1.0, 0.21)] {
        let shape = Shape::power(exponent);
        let contact = Contact::sticking(shape, c).expect("a limit");
        let springs: Vec<f64> =
            (0..24).map(|i| contact.limit.radius * (f64::from(i) + 0.5) / 24.0).collect();
        let worst = |cycles_per_unit: u32| {
            let mut worst: f64 = 0.0;
            let mut row = literal::Springs::new(&contact, &springs, 0.8, cycles_per_unit, 400);
            let mut reached = 0;
            for half_units in [1, 2, 4, 8, 16, 32] {
                row.run(half_units * cycles_per_unit / 2 - reached);
                reached = half_units * cycles_per_unit / 2;
                let decay = Decay::after(0.8 * f64::from(half_units) / 2.0 / contact.limit.radius);
                for (x, stepped) in springs.iter().zip(row.images()) {
                    let closed = if *x < c {
                        contact.shape.image(*x)
                    } else {
                        1.0 - contact.compression(*x - c, decay)
                    };
                    worst = worst.max((stepped - closed).abs());
                }
            }
            worst
        };
        let (coarse, fine) = (worst(1000), worst(2000));
        println!("exponent {exponent}: at most {coarse:.2e} d₀ at N₀ = 1000, {fine:.2e} at 2000");
        assert!(coarse <= 2e-6, "{coarse}");
        let ratio = coarse / fine;
        assert!((1.9..2.1).contains(&ratio), "halving the wear per cycle: {coarse} → {fine}");
    }
}

/// Shapes and stick radii for the comparison of curves with their defining integrals.
fn contacts() -> Vec<Contact> {
    [
        (Shape::power(2.0), 0.5),
        (Shape::power(1.0), 0.21),
        (Shape::power(2.0), 0.9),
        (Shape::power(3.3), 0.4),
        (Shape::power(8.0), 0.7),
        (Shape::sphere(2.0), 0.6),
        (Shape::truncated(Flank::Paraboloid, 0.3), 0.6),
        (Shape::truncated(Flank::Cone, 0.5), 0.51),
    ]
    .into_iter()
    .map(|(shape, c)| Contact::sticking(shape, c).expect("a limit"))
    .chain(
        [
            (Shape::power(2.0), 1.3),
            (Shape::power(1.0), 4.0),
            (Shape::truncated(Flank::Paraboloid, 0.6), 1.2),
            (Shape::truncated(Flank::Cone, 0.2), 2.0),
        ]
        .into_iter()
        .map(|(shape, threshold)| Contact::new(shape, threshold).expect("a limit")),
    )
    .collect()
}

/// The angle arccos(c/r); 0 for r < c.
fn angle(c: f64, r: f64) -> f64 {
    (c / r).min(1.0).acos()
}

/// The signed compression η(x) of the simplified rule.
fn signed_compression(contact: &Contact, x: f64, decay: Decay) -> f64 {
    let unworn = 1.0 - contact.shape.image(x);
    if x <= contact.stick || x > contact.limit.radius {
        return unworn;
    }
    let delta = x - contact.stick;
    let (worn, compression) = (contact.worn(delta, decay), contact.compression(delta, decay));
    assert!((unworn - worn - compression).abs() < 1e-14, "two forms of the same logistic");
    compression
}

/// ∫ over from…to, in panels that become smaller towards both ends and towards the `kinks`.
fn panels(from: f64, to: f64, kinks: &[f64], f: impl Fn(f64) -> f64) -> f64 {
    let mut edges = vec![from, to];
    edges.extend(kinks.iter().copied().filter(|k| (from..to).contains(k)));
    edges.sort_by(f64::total_cmp);
    edges
        .windows(2)
        .map(|pair| {
            let half = 0.5 * (pair[1] - pair[0]);
            (0..40)
                .map(|k| {
                    let (near, far) = (0.5_f64.powi(k + 1), 0.5_f64.powi(k));
                    let near = if k == 39 { 0.0 } else { near };
                    integrate(pair[0] + half * near, pair[0] + half * far, &f)
                        + integrate(pair[1] - half * far, pair[1] - half * near, &f)
                })
                .sum::<f64>()
        })
        .sum()
}

/// The kinks of the unworn image, and the additional kinks `more`.
fn kinks(contact: &Contact, more: &[f64]) -> Vec<f64> {
    [contact.shape.kinks(), more].concat()
}

/// Compares force, energy and volume with a quadrature in panels that become smaller towards the
/// stick edge.
#[test]
fn spring_row_sums_agree_with_numerical_integrals() {
    for contact in contacts() {
        let row = SpringRow::new(&contact);
        let outer = contact.limit.radius;
        for exponent in [0.0, 0.1, 1.0, 5.0, 12.0, 20.0, 30.0, 60.0] {
            let decay = Decay::after(exponent);
            let sums = row.sums(decay);
            let eta = |x: f64| signed_compression(&contact, x, decay);
            let over =
                |f: &dyn Fn(f64) -> f64| panels(0.0, 1.0, &kinks(&contact, &[contact.stick]), f);
            let normal = over(&eta);
            let energy = over(&|x| eta(x) * (contact.threshold - eta(x)).max(0.0));
            let chord = |x: f64| ((outer - x) * (outer + x)).max(0.0).sqrt();
            let volume = 4.0
                * panels(0.0, outer, &kinks(&contact, &[contact.stick, 1.0]), |x| {
                    (1.0 - contact.shape.image(x) - eta(x)) * chord(x)
                });
            let scale = contact.limit.volume;
            for (name, value, exact) in [
                ("normal", sums.normal, normal),
                ("energy", sums.energy, energy),
                ("volume", sums.volume / scale, volume / scale),
            ] {
                let error = (value - exact).abs();
                assert!(error < 1e-9, "{name} {value} for {exact} at {exponent}: {contact:?}");
            }
        }
    }
}

/// About `count` of the output radii, with their indices. With many radii some lie next to the edge
/// of a flat. In gross slip the curves are singular there, and the mesh is coarse.
fn visited(contact: &Contact, solver: &Simplified, count: usize) -> Vec<(usize, f64)> {
    let points = solver.radii().len();
    let near = |r: f64| contact.shape.kinks().iter().any(|edge| (r - edge).abs() < 0.01);
    let singular = |r: f64| points > 256 && contact.stick == 0.0 && near(r);
    let radii = solver.radii().iter().copied().enumerate().skip(points / 256);
    radii.step_by(points / count).filter(|(_, r)| !singular(*r)).collect()
}

/// Compares every curve with a quadrature of its defining integral. With 2048 radii, the curves are
/// interpolated between mesh nodes.
#[test]
fn the_curves_agree_with_numerical_integrals() {
    let contacts = contacts();
    for (contact, points) in contacts.iter().flat_map(|contact| [(contact, 256), (contact, 2048)]) {
        let solver = Simplified::new(contact, points);
        let (c, outer) = (contact.stick, contact.limit.radius);
        for normalized in [0.0, 0.5, 4.0, 16.0] {
            let decay = solver.decay(0.8, normalized);
            let state = solver.states(&[(decay, true)]).remove(0);
            let curves = state.curves.expect("curves");
            let eta = |x: f64| signed_compression(contact, x, decay);
            let unworn = |x: f64| 1.0 - contact.shape.image(x);
            for (index, r) in visited(contact, &solver, 50) {
                // Wear: (4) of g − g₀. The substitution by an angle removes the root.
                let kinks = kinks(contact, &[1.0, outer]);
                let kinks: Vec<f64> = kinks.iter().map(|kink| angle(*kink, r)).collect();
                let wear = if r > outer {
                    0.0
                } else {
                    FRAC_2_PI
                        * panels(0.0, angle(c, r), &kinks, |psi| {
                            let x = r * psi.cos();
                            unworn(x) - eta(x)
                        })
                };
                let tolerance = 2e-4 * contact.limit.depth;
                assert!(
                    (curves.wear[index] - wear.max(0.0)).abs() < tolerance,
                    "wear {} for {wear} at r = {r}, Ñ = {normalized}: {contact:?}",
                    curves.wear[index]
                );
                // The slip is the same integral of ω.
                let slip = FRAC_2_PI
                    * panels(0.0, angle(c, r), &kinks, |psi| {
                        (1.0 - eta(r * psi.cos()).max(0.0) / contact.threshold).max(0.0)
                    });
                let tolerance = 1.5e-4 * (1.0 + contact.limit.depth / contact.threshold);
                assert!(
                    (curves.slip[index] - slip).abs() < tolerance,
                    "slip {} for {slip} at r = {r}, Ñ = {normalized}: {contact:?}",
                    curves.slip[index]
                );
            }
        }
    }
}

/// Just above the gross-slip threshold, the image forms a step on the axis that no mesh can
/// resolve.
#[test]
fn wear_is_accurate_even_if_the_step_of_the_image_is_thinner_than_a_cell() {
    for exponent in [1.0, 1.5, 2.0, 8.0] {
        for threshold in [1.0, 1.0 + 1e-9, 1.0 + 1e-6, 1.0 + 1e-3] {
            let contact = Contact::new(Shape::power(exponent), threshold).expect("a limit");
            let solver = Simplified::new(&contact, 256);
            let wanted: Vec<_> =
                [5.0, 20.0, 50.0, 1e3].iter().map(|n| (solver.decay(0.8, *n), true)).collect();
            for (state, (decay, _)) in solver.states(&wanted).iter().zip(&wanted) {
                assert!(state.depth <= 1.0 + 1e-12, "{} of {exponent} {threshold}", state.depth);
                let curves = state.curves.as_ref().expect("curves");
                for (r, wear) in solver.radii().iter().zip(&curves.wear).skip(1).step_by(7) {
                    if *r > contact.limit.radius {
                        continue;
                    }
                    let kinks = [angle(1.0, *r)];
                    let exact = FRAC_2_PI
                        * panels(0.0, angle(0.0, *r), &kinks, |psi| {
                            let x = r * psi.cos();
                            1.0 - contact.shape.image(x) - signed_compression(&contact, x, *decay)
                        });
                    // Next to the axis, the largest error is that of a cone at Ñ = 20.
                    let tolerance = if *r < 0.1 { 0.1 } else { 2e-3 };
                    let error = (wear - exact.max(0.0)).abs();
                    assert!(error < tolerance, "{error} at {r} of {exponent} {threshold}");
                }
            }
        }
    }
}

#[test]
fn a_blunt_contact_near_gross_slip_keeps_its_sticking_core() {
    // For n = 20 and c = 0.35 the threshold is 1 − 8e-10, which is still partial slip.
    let mut request = steel_ball();
    request["profile"] =
        json!({"shape": "power", "exponent": 20, "height": "1 um", "at_radius": "0.1 mm"});
    request["motion"] = json!({"stick_ratio": 0.35});
    let outcome = run(&request);
    assert_eq!(outcome.regime, Regime::PartialSlip);
    close(outcome.unworn.stick_radius / outcome.scales.contact_radius, 0.35, 1e-3);
    let limit = outcome.limit.expect("a limit");
    close(limit.normal_force / outcome.scales.normal_force, 0.3675, 1e-3);
    // The engine refuses a stick ratio that 12 digits of the amplitude cannot distinguish from
    // gross slip.
    request["motion"] = json!({"stick_ratio": 0.2});
    let faults = scenario::check(&request, "").expect_err("a fault");
    assert_eq!(faults.0[0].pointer, "/motion/stick_ratio");
}

/// Compares the sampled pressure with (1/π) ∫ −y′/√(x²−r²) dx of the exact −y′.
#[test]
fn the_pressure_agrees_with_the_integral_of_the_image_slope() {
    let contacts = contacts();
    for (contact, points) in contacts.iter().flat_map(|contact| [(contact, 256), (contact, 2048)]) {
        let solver = Simplified::new(contact, points);
        for normalized in [0.0, 0.5, 4.0] {
            let decay = solver.decay(0.8, normalized);
            let curves = solver.states(&[(decay, true)]).remove(0).curves.expect("curves");
            // The exact slope −y′(x) = g₀′·Δ²e/(y₀e + Δ − y₀)² outside c.
            let slope = |x: f64| {
                let unworn = 1.0 - contact.shape.image(x);
                let rest = contact.threshold - unworn;
                let ratio = contact.threshold / (unworn * decay.left + rest);
                let factor = if x < contact.stick { 1.0 } else { decay.left * ratio * ratio };
                // The slope is infinite at the edge of a flat, so it is limited for the quadrature.
                contact.shape.image_slope(x).min(1e9) * factor
            };
            for (index, r) in visited(contact, &solver, 85) {
                if r >= 1.0 {
                    assert_eq!(curves.pressure[index], 0.0, "outside the contact");
                    continue;
                }
                // The substitution x = r cosh s removes the root.
                let panel_ends: Vec<f64> = kinks(contact, &[contact.stick])
                    .iter()
                    .map(|kink| libm::acosh((kink / r).max(1.0)))
                    .collect();
                let exact =
                    panels(0.0, libm::acosh(1.0 / r), &panel_ends, |s| slope(r * s.cosh())) / PI;
                // Next to the stick edge the pressure has a peak that is only a few mesh cells
                // wide. It is a mean over a ring, which matters next to a tip and next to the
                // edge of the contact.
                let near = |edge: &f64, width| (r - edge).abs() < width;
                let edge = near(&contact.stick, 0.02)
                    || near(&1.0, 0.02)
                    || contact.shape.peak_pressure().is_infinite() && near(&0.0, 0.05)
                    || contact.shape.kinks().iter().any(|kink| near(kink, 0.05));
                let tolerance = if edge { 0.03 } else { 2e-3 } * (0.2 + exact);
                assert!(
                    (curves.pressure[index] - exact).abs() < tolerance,
                    "{} for {exact} at r = {r}, Ñ = {normalized}: {contact:?}",
                    curves.pressure[index]
                );
            }
        }
    }
}

#[test]
fn the_pressure_integrates_to_the_force_and_the_wear_to_the_volume() {
    // 2π ∫ p r dr = F. Pressure and force are computed from different sums.
    for contact in contacts() {
        let solver = Simplified::new(&contact, 512);
        for normalized in [0.0, 1.0, 4.0] {
            let state = solver.states(&[(solver.decay(0.8, normalized), true)]).remove(0);
            let curves = state.curves.as_ref().expect("curves");
            let radii = solver.radii();
            let force: f64 = (1..radii.len())
                .map(|i| {
                    let low = curves.pressure[i - 1] * radii[i - 1];
                    let low = if low.is_finite() { low } else { 0.0 };
                    PI * (low + curves.pressure[i] * radii[i]) * (radii[i] - radii[i - 1])
                })
                .sum();
            // The pressure at the edge of a flat is infinite but integrable.
            let tolerance = if contact.shape.kinks().is_empty() { 3e-3 } else { 8e-3 };
            close(force, 2.0 * state.sums.normal, tolerance);
            if normalized > 0.0 {
                assert!(state.errors.volume < 3e-4, "{}", state.errors.volume);
            }
        }
    }
}

/// For the simplified rule Σ W has a closed form. The test sums the energy per cycle instead.
#[test]
fn the_dissipated_energy_is_the_sum_of_the_energy_per_cycle() {
    let mut request = steel_ball();
    request["cycles"] = json!({"from": 0, "to": 60000, "count": 1000, "spacing": "linear"});
    request["profiles_at"] = json!("none");
    let history = run(&request).history;
    let last = history.cycles.len() - 1;
    let mut sum = 0.0;
    // Simpson's rule on pairs of equal steps. The trapezoidal rule is used for a single last step.
    let step = history.cycles[2] - history.cycles[1];
    for i in (0..last - 1).step_by(2) {
        let w = &history.energy_per_cycle[i..i + 3];
        sum += step / 3.0 * (w[0] + 4.0 * w[1] + w[2]);
    }
    if last % 2 == 1 {
        sum += 0.5 * step * (history.energy_per_cycle[last] + history.energy_per_cycle[last - 1]);
    }
    close(history.dissipated_energy[last], sum, 1e-8);
}

/// At the start of wear of a paraboloid, the exact method has dṼ/dÑ(0) = 2I/(1−c²). Both methods
/// use the same energy integral I: W̃(0) = 8·I in its unit.
#[test]
fn the_energy_integral_of_a_paraboloid_agrees_with_its_polynomial() {
    for c in [0.1_f64, 0.5, 0.9] {
        let contact = Contact::new(Shape::power(2.0), 1.0 - c * c).expect("a limit");
        let sums = SpringRow::new(&contact).sums(Decay::UNWORN);
        let polynomial =
            2.0 / 15.0 - 2.0 * c.powi(2) / 3.0 + 2.0 * c.powi(3) / 3.0 - 2.0 * c.powi(5) / 15.0;
        assert!((sums.energy - polynomial).abs() < 1e-12, "{c}");
    }
}

/// Source: the exact runs in reference.json. The test measures the error of the simplified rule.
#[test]
fn the_error_of_the_simplified_rule_stays_within_the_documented_range() {
    let table: Value =
        serde_json::from_str(fretwork_engine::reference::TABLE).expect("a JSON table");
    for row in table["exact_depth_and_amplitude_held"].as_array().expect("rows") {
        let column = |name: &str| -> Vec<f64> {
            row[name].as_array().expect(name).iter().map(|x| x.as_f64().expect(name)).collect()
        };
        let shape = Shape::power(row["exponent"].as_f64().expect("n"));
        let c = row["stick_radius"].as_f64().expect("c");
        let contact = Contact::sticking(shape, c).expect("a limit");
        let solver = Simplified::new(&contact, 256);
        let cycles = column("normalized_cycles");
        let wanted: Vec<_> = cycles.iter().map(|n| (solver.decay(0.8, *n), false)).collect();
        for (i, state) in solver.states(&wanted).iter().enumerate() {
            let volume = state.volume / column("wear_volume")[i] - 1.0;
            let depth = state.depth / column("wear_depth")[i] - 1.0;
            let force = 2.0 * state.sums.normal / column("normal_force")[i] - 1.0;
            assert!((-0.075..0.045).contains(&volume), "volume {volume} in {row}");
            assert!((-0.215..0.005).contains(&depth), "depth {depth} in {row}");
            assert!(force.abs() < 0.012, "force {force} in {row}");
        }
    }
}

/// The image of a sphere is infinite at its equator. The output radii around a large scar must stay
/// inside it.
#[test]
fn output_radii_around_a_large_scar_stay_inside_the_sphere() {
    let request = json!({
        "profile": {"shape": "sphere", "radius": 112.449_327_18},
        "moduli": {"normal": 187_090.257_306, "tangential": 149_672.205_845},
        "friction": 0.01, "wear": {"coefficient": 1e-9},
        "load": {"normal_force": 681_352_924.735, "held": "force"},
        "motion": {"amplitude": 0.512_253_256_058}, "cycles": [1000.0],
        "model": {"method": "exact", "tolerance": 0.02, "points": 16}
    });
    let profiles = run(&request).profiles.expect("profiles");
    assert!(profiles.image.iter().flatten().all(|g| g.is_finite()), "{:?}", profiles.image);
}

/// An actuator can move a billion times the elastic displacement of the springs.
#[test]
fn a_loop_much_wider_than_the_elastic_displacement_has_ratios_of_one() {
    let widths: Vec<f64> = (1..40).map(|q| 0.01 + 0.001 * f64::from(q % 7)).collect();
    let compressions: Vec<f64> = (1..40).map(|q| 1e-6 / f64::from(q)).collect();
    let found = Backbone::of_cells(0.0, 1e9, &compressions, &widths, None).wind();
    for ratio in [found.energy_ratio, found.slip_ratio, found.free_ratio] {
        assert!((ratio - 1.0).abs() < 1e-9, "{ratio}");
    }
}

#[test]
fn the_closed_form_solver_converges_with_second_order() {
    for (exponent, c) in [(2.0, 0.5), (1.0, 0.21), (2.0, 0.0)] {
        let shape = Shape::power(exponent);
        let contact = Contact::sticking(shape, c).expect("a limit");
        let depth = |points: usize| {
            let solver = Simplified::new(&contact, points);
            let state = solver.states(&[(solver.decay(0.8, 2.0), false)]).remove(0);
            (state.depth, state.errors.volume)
        };
        let found = [64, 128, 256, 512].map(depth);
        let order = |first: f64, last: f64, doublings: f64| (first / last).abs().log2() / doublings;
        let volume = order(found[0].1, found[3].1, 3.0);
        assert!(volume > 1.7, "volume converges with order {volume}: {found:?}");
        if c > 0.0 {
            let depth = order(found[1].0 - found[0].0, found[3].0 - found[2].0, 2.0);
            assert!(depth > 1.7, "depth converges with order {depth}: {found:?}");
        }
    }
}

#[test]
fn the_rows_so_far_are_rows_of_the_result() {
    for model in [
        json!({"method": "simplified"}),
        json!({"method": "exact", "tolerance": 1e-4, "compare": true}),
    ] {
        let mut request = steel_ball();
        request["model"] = model;
        request["cycles"] = json!({"from": 10, "to": 1e6, "count": 300});
        let mut simulation = Simulation::of(&scenario(&request)).expect("a contact");
        let mut seen = vec![simulation.so_far()];
        let all = loop {
            match simulation.step() {
                Advance::Working(_) => seen.push(simulation.so_far()),
                Advance::Done(outcome) => break outcome.history,
            }
        };
        let is_part = |rows: &History| (2..all.cycles.len()).contains(&rows.cycles.len());
        assert!(seen.iter().any(is_part), "{}", seen.len());
        for rows in seen {
            let smoothed = request["model"]["method"] == "exact" && rows != all;
            for ((name, part), (_, whole)) in rows.columns().into_iter().zip(all.columns()) {
                let missing = smoothed && ["contact_radius", "scar_radius"].contains(&name);
                // This one has no actuator.
                let count = if missing { 0 } else { rows.cycles.len().min(whole.len()) };
                assert_eq!(part, &whole[..count], "{name}");
            }
        }
    }
}

#[test]
fn splitting_a_simplified_run_into_steps_changes_no_digit() {
    // 300 output cycles take several steps. Three of them are also computed in separate runs.
    let mut request = steel_ball();
    request["cycles"] = json!({"from": 10, "to": 1e6, "count": 300});
    request["profiles_at"] = json!("last");
    let mut simulation = Simulation::of(&scenario(&request)).expect("a contact");
    let mut progress = vec![0.0];
    let outcome = loop {
        match simulation.step() {
            Advance::Working(share) => {
                assert!(share > *progress.last().expect("one") && share < 1.0);
                progress.push(share);
            }
            Advance::Done(outcome) => break outcome,
        }
    };
    assert!(progress.len() > 3, "the run must take several steps");
    for index in [1, 150, 300] {
        request["cycles"] = json!([outcome.history.cycles[index]]);
        let alone = run(&request);
        assert_eq!(alone.history.wear_volume[1], outcome.history.wear_volume[index]);
        assert_eq!(alone.history.wear_depth[1], outcome.history.wear_depth[index]);
    }
}
