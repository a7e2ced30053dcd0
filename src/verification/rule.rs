//! Checks of the simplified rule: its closed form, and its distance from the exact method.

use std::f64::consts::PI;

use super::page::{Check, Section};
use super::problem::{ContactProblem, DEEPEST, DEPTH, FORCE, STICK, VOLUME, numbers};
use super::table::{RUNS, rows};
use fretwork_engine::contact::control::Normal::Depth;
use fretwork_engine::contact::unworn::{Contact, Decay};
use fretwork_engine::scenario::{DEFAULT_POINTS, DEFAULT_XI};
use fretwork_engine::solver::closed::simplified::Simplified;
use fretwork_engine::solver::stepped::law::Law;

const CONTACTS: [(f64, f64); 2] = [(2.0, 0.5), (1.0, 0.21)];

pub fn sections() -> Vec<Section> {
    vec![stepping(), marching(), differences()]
}

fn stepping() -> Section {
    Section::of("Simplified rule by stepping", |section| {
        for (n, c) in CONTACTS {
            let ContactProblem { name, contact, .. } = ContactProblem::amplitude(Depth, n, c)?;
            let (coarse, fine) = (stepped_apart(&contact, 500), stepped_apart(&contact, 1000));
            let source = "(14)–(16)";
            section.check(format!("{name}: N₀ = 500"), source, 0.0, coarse, 4e-6);
            section.check(format!("{name}: N₀ = 1000"), source, 0.0, fine, 2e-6);
            section.check(format!("{name}: their ratio"), "1/N₀", 2.0, coarse / fine, 0.05);
        }
        Some(())
    })
}

/// The largest difference between the closed form and springs that are dragged through each cycle.
///
/// Tangential lengths are in μE*d₀/G*. A spring then sticks while its deflection is below its
/// compression, and the amplitude is Δ. By (14), a path of 4Δ wears ξ/ã per N₀ cycles.
fn stepped_apart(contact: &Contact, unit: u32) -> f64 {
    const SPRINGS: u32 = 12;
    const STEPS: u32 = 200;
    const UNTIL: u32 = 4;
    let Contact { shape, stick, threshold, limit, .. } = contact;
    let rate = DEFAULT_XI / limit.radius / (4.0 * threshold * f64::from(unit));
    let phase = |k: u32| threshold * libm::cos(2.0 * PI * f64::from(k) / f64::from(STEPS));
    let moves: Vec<f64> = (0..STEPS).map(|k| phase(k + 1) - phase(k)).collect();
    let decay = Decay::after(DEFAULT_XI * f64::from(UNTIL) / limit.radius);
    let apart = (0..SPRINGS).map(|i| {
        let x = limit.radius * (f64::from(i) + 0.5) / f64::from(SPRINGS);
        let mut image = shape.image(x);
        let mut deflection = threshold.min((1.0 - image).max(0.0));
        for _ in 0..UNTIL * unit {
            for moved in &moves {
                let compression = 1.0 - image;
                let pulled = deflection + moved;
                deflection = pulled.clamp(-compression.max(0.0), compression.max(0.0));
                image += rate * compression * (pulled - deflection).abs();
            }
        }
        let sticks = x < *stick;
        let worn = if sticks { 0.0 } else { contact.worn(x - stick, decay) };
        (image - shape.image(x) - worn).abs()
    });
    apart.fold(0.0, f64::max)
}

fn marching() -> Section {
    const INSTANTS: [f64; 6] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
    Section::of("Simplified rule by marching", |section| {
        for (n, c) in CONTACTS {
            let problem = ContactProblem::amplitude(Depth, n, c)?;
            let marched = problem.states(Law::Simplified(DEFAULT_XI), &INSTANTS)?;
            let solver = Simplified::new(&problem.contact, usize::from(DEFAULT_POINTS));
            let wanted = INSTANTS.map(|instant| (solver.decay(DEFAULT_XI, instant), false));
            let closed = solver.states(&wanted);
            for ((instant, marched), closed) in INSTANTS.iter().zip(&marched).zip(&closed) {
                let worn = &marched.worn;
                for (symbol, reference, value) in [
                    ("V", closed.volume, worn.volume),
                    ("w", closed.depth, worn.deepest),
                    ("F", 2.0 * closed.sums.normal, 2.0 * worn.normal),
                ] {
                    let what = format!("{}: {symbol} at Ñ = {instant}", problem.name);
                    section.check(what, "closed form", reference, value, 2e-3);
                }
            }
        }
        Some(())
    })
}

fn differences() -> Section {
    Section::of("Simplified rule beside the exact method", |section| {
        for (title, part, normal) in RUNS {
            for row in rows(part)? {
                let problem = ContactProblem::of_row(normal, &row)?;
                let instants = numbers(&row, "normalized_cycles")?;
                let exact = problem.states(Law::Exact, &instants)?;
                let rule = problem.states(Law::Simplified(DEFAULT_XI), &instants)?;
                let held = title.trim_start_matches("Runs, ");
                for (symbol, _, of) in [VOLUME, DEEPEST, FORCE, DEPTH, STICK] {
                    let runs = instants.iter().zip(exact.iter().zip(&rule));
                    let mut lines: Vec<Check> = runs
                        .map(|(instant, (exact, rule))| Check {
                            what: format!("{held}, {}: {symbol} at Ñ = {instant}", problem.name),
                            source: "exact method",
                            reference: of(&exact.worn),
                            value: of(&rule.worn),
                            accepted: None,
                        })
                        // A held quantity does not differ.
                        .filter(|check| check.error().abs() > 1e-9)
                        .collect();
                    lines.sort_by(|a, b| a.error().total_cmp(&b.error()));
                    if lines.len() > 2 {
                        lines.drain(1..lines.len() - 1);
                    }
                    section.checks.extend(lines);
                }
            }
        }
        Some(())
    })
}
