//! Checks of the simplified rule: a time integration against its closed form, and its errors relative to the exact
//! method.

use super::page::{Check, Section, TitledSection};
use super::problem::{
    ContactProblem, DEEPEST, DEPTH, FORCE, RULE_TOLERANCE, STICK, VOLUME, at, numbers,
};
use super::table::{RUNS, rows};
use fretwork_engine::DEFAULT_TOLERANCE;
use fretwork_engine::contact::control::Normal::{Depth, Force};
use fretwork_engine::contact::{Control, Held, UnwornSums};
use fretwork_engine::scenario::DEFAULT_POINTS;
use fretwork_engine::solver::closed::simplified::Simplified;
use fretwork_engine::solver::stepped::law::{Law, PAPER_XI, fitted_xi};

/// Output cycles Ñ, and stick ratios, at which the page shows the errors of the simplified rule.
const INSTANTS: [f64; 6] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
const STICK_RATIOS: [f64; 8] = [0.1, 0.3, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95];

const CONTACTS: [(f64, f64); 2] = [(2.0, 0.5), (1.0, 0.21)];

pub const SECTIONS: &[TitledSection] = &[
    ("Simplified rule by marching", marching),
    ("Simplified rule beside the exact method", differences),
    ("Error of the simplified rule", errors),
];

fn marching(section: &mut Section) -> Option<()> {
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
}

fn differences(section: &mut Section) -> Option<()> {
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
                    .map(|(instant, (exact, rule))| {
                        let what = format!("{held}, {}: {symbol} at Ñ = {instant}", problem.name);
                        Check::reported(what, "exact method", of(&exact.worn), of(&rule.worn))
                    })
                    // A held quantity is equal for both methods, so it needs no line.
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
}

/// The largest errors of the volume by the simplified rule for a paraboloid, for several stick ratios and held
/// quantities.
fn errors(section: &mut Section) -> Option<()> {
    for (held, normal, by_force) in [
        ("depth and amplitude", Depth, false),
        ("force and amplitude", Force, false),
        ("depth and Q", Depth, true),
        ("force and Q", Force, true),
    ] {
        for c in STICK_RATIOS {
            let mut problem = ContactProblem::amplitude(normal, 2.0, c)?;
            if by_force {
                let half = UnwornSums::of(&problem.contact, None).tangential;
                let threshold = problem.contact.threshold;
                problem.control = Control::constant(normal, Held::Force(half), threshold);
            }
            section.checks.extend(largest_error(&format!("{held} held, c = {c}"), &problem));
        }
    }
    Some(())
}

/// The largest error of the volume by the simplified rule, over the output cycles that both runs reach. `None` if one
/// of them ends before the first output cycle.
fn largest_error(name: &str, problem: &ContactProblem) -> Option<Check> {
    let xi = fitted_xi(problem.contact.stick);
    let volumes = |law, tolerance| -> Option<Vec<f64>> {
        let mut march = problem.march(law, tolerance, INSTANTS[INSTANTS.len() - 1])?;
        let states = INSTANTS.map(|instant| {
            let worn = at(&mut march, instant).worn;
            march.ended().is_none_or(|end| end >= instant).then_some(worn.volume)
        });
        Some(states.into_iter().map_while(|volume| volume).collect())
    };
    let exact = volumes(Law::Exact, DEFAULT_TOLERANCE)?;
    let rule = volumes(Law::Simplified(xi), RULE_TOLERANCE)?;
    let checks = INSTANTS.iter().zip(exact.iter().zip(&rule)).map(|(instant, (exact, rule))| {
        Check::reported(format!("{name}: V at Ñ = {instant}"), "exact method", *exact, *rule)
    });
    checks.max_by(|a, b| a.error().abs().total_cmp(&b.error().abs()))
}
