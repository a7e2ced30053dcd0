//! Checks of the simplified rule: its closed form, and its distance from the exact method.

use super::page::{Check, Section};
use super::problem::{ContactProblem, DEEPEST, DEPTH, FORCE, STICK, VOLUME, numbers};
use super::table::{RUNS, rows};
use fretwork_engine::contact::control::Normal::Depth;
use fretwork_engine::scenario::DEFAULT_POINTS;
use fretwork_engine::solver::closed::simplified::Simplified;
use fretwork_engine::solver::stepped::law::{Law, PAPER_XI, fitted_xi};

const CONTACTS: [(f64, f64); 2] = [(2.0, 0.5), (1.0, 0.21)];

pub fn sections() -> Vec<Section> {
    vec![marching(), differences()]
}

fn marching() -> Section {
    const INSTANTS: [f64; 6] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
    Section::of("Simplified rule by marching", |section| {
        for (n, c) in CONTACTS {
            let problem = ContactProblem::amplitude(Depth, n, c)?;
            let marched = problem.states(Law::Simplified(PAPER_XI), &INSTANTS)?;
            let solver = Simplified::new(&problem.contact, usize::from(DEFAULT_POINTS));
            let wanted = INSTANTS.map(|instant| (solver.decay(PAPER_XI, instant), false));
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
                let xi = fitted_xi(problem.contact.stick);
                let rule = problem.states(Law::Simplified(xi), &instants)?;
                let held = title.trim_start_matches("Runs, ");
                for (symbol, _, of) in [VOLUME, DEEPEST, FORCE, DEPTH, STICK] {
                    let runs = instants.iter().zip(exact.iter().zip(&rule));
                    let mut lines: Vec<Check> = runs
                        .map(|(instant, (exact, rule))| Check {
                            what: format!("{held}, {}: {symbol} at Ñ = {instant}", problem.name),
                            source: "exact method",
                            reference: of(&exact.worn),
                            value: of(&rule.worn),
                            expected: 0.0,
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
