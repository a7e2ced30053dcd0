//! Checks against the table of reference numbers: limiting states and runs of the exact method.

use serde_json::Value;

use super::page::Section;
use super::problem::{
    ContactProblem, DEEPEST, DEPTH, FORCE, RADIUS, STICK, TableColumn, VOLUME, at, number, numbers,
};
use fretwork_engine::contact::control::Normal::{self, Depth, Force};
use fretwork_engine::numeric::{integrate, root};
use fretwork_engine::reference::{TABLE, shakedown_limit};
use fretwork_engine::solver::stepped::law::Law;
use fretwork_engine::{DEFAULT_TOLERANCE, EventKind};

/// Ñ at which a run has practically reached its limiting state.
const ARRIVED: f64 = 200.0;

/// The runs of the table: section title, part of the table, and the quantity that is held constant in the normal
/// direction.
pub const RUNS: [(&str, &str, Normal); 4] = [
    ("Runs, depth and amplitude held", "exact_depth_and_amplitude_held", Depth),
    ("Runs, force and amplitude held", "exact_force_and_amplitude_held", Force),
    ("Runs, depth and Q held", "exact_depth_and_tangential_force_held", Depth),
    ("Runs, both forces held", "exact_force_and_tangential_force_held", Force),
];

pub fn sections() -> Vec<Section> {
    let amplitude = "limit_depth_and_amplitude_held";
    let (forces, force) =
        ("limit_force_and_tangential_force_held", "limit_depth_and_tangential_force_held");
    let quantities: [&[(TableColumn, f64)]; 4] = [
        &[(VOLUME, 1.5e-3), (FORCE, 1.5e-3), (DEEPEST, 1.5e-3), (RADIUS, 5e-3)],
        &[(VOLUME, 5e-3), (DEPTH, 5e-3), (STICK, 5e-3), (DEEPEST, 5e-3), (RADIUS, 5e-3)],
        &[(VOLUME, 5e-3)],
        &[(VOLUME, 5e-3)],
    ];
    let mut sections = vec![
        limits("Limits, depth and amplitude held", amplitude, Depth),
        limits("Limits, both forces held", forces, Force),
        limits("Limits, depth and Q held", force, Depth),
    ];
    sections.extend(RUNS.into_iter().zip(quantities).map(|(part, columns)| runs(part, columns)));
    sections.push(Section::of("Shakedown boundary", shakedown));
    sections
}

/// The rows of one part of the table.
pub fn rows(part: &str) -> Option<Vec<Value>> {
    let table: Value = serde_json::from_str(TABLE).ok()?;
    table.get(part)?.as_array().filter(|rows| !rows.is_empty()).cloned()
}

fn limits(title: &'static str, part: &str, normal: Normal) -> Section {
    Section::of(title, |section| {
        for row in &rows(part)? {
            let problem = ContactProblem::of_row(normal, row)?;
            let end = problem.control.tends_to(&problem.contact)?;
            let shape = &problem.contact.shape;
            let inside = integrate(0.0, end.stick, |x| end.depth - shape.image(x));
            let worn = problem.states(Law::Exact, &[ARRIVED])?.pop()?.worn;
            let (limit, whole, name) = (end.limit, shape.half_force(), &problem.name);
            // Without `q`, the stick radius is an input of the row and no result, so it is not compared.
            let known = |column: &str| {
                let given = column == "stick_radius" && row.get("q").is_none();
                number(row, column).filter(|_| !given)
            };
            for (symbol, column, value, run) in [
                ("c", "stick_radius", end.stick, Some((worn.stick, 1e-3))),
                ("d", "indentation_depth", end.depth, Some((worn.depth, 1e-3))),
                ("F/F₀", "normal_force_ratio", inside / whole, Some((worn.normal / whole, 1e-3))),
                ("V", "wear_volume", limit.volume, Some((worn.volume, 2e-3))),
                ("w", "wear_depth", limit.depth, Some((worn.deepest, 2e-3))),
                ("r_w", "depth_radius", limit.depth_radius, None),
                ("ã", "limiting_radius", limit.radius, None),
            ] {
                let Some(reference) = known(column) else { continue };
                // The table is rounded, so half a unit of its last decimal is accepted, plus rounding errors.
                let unit = if column == "depth_radius" { 6e-5 } else { 6e-6 };
                let what = format!("{name}: {symbol}");
                section.check(what, "table", reference, value, unit / reference);
                if let Some((value, accepted)) = run {
                    let what = format!("{name}: {symbol} of a run");
                    section.check(what, "table", reference, value, accepted);
                }
            }
        }
        Some(())
    })
}

fn runs(
    (title, part, normal): (&'static str, &str, Normal),
    columns: &[(TableColumn, f64)],
) -> Section {
    Section::of(title, |section| {
        for row in &rows(part)? {
            let problem = ContactProblem::of_row(normal, row)?;
            let name = &problem.name;
            let instants = numbers(row, "normalized_cycles")?;
            let states = problem.states(Law::Exact, &instants)?;
            for ((symbol, column, of), accepted) in columns {
                let table = numbers(row, column)?;
                for ((instant, state), reference) in instants.iter().zip(&states).zip(table) {
                    let what = format!("{name}: {symbol} at Ñ = {instant}");
                    section.check(what, "table", reference, of(&state.worn), *accepted);
                }
            }
            if let Some(text) = row.get("gross_slip_at") {
                // The text is a number with its error, for example "21.28 +- 0.03".
                let reference: f64 = text.as_str()?.split(' ').next()?.parse().ok()?;
                let value = slides_at(&problem, 2.0 * reference)?;
                let what = format!("{name}: Ñ at which all slips");
                section.check(what, "table", reference, value, 1e-2);
            }
        }
        Some(())
    })
}

/// Ñ at which gross slip begins; infinite if it does not.
fn slides_at(problem: &ContactProblem, last: f64) -> Option<f64> {
    let mut march = problem.march(Law::Exact, DEFAULT_TOLERANCE, last)?;
    at(&mut march, last);
    let event = march.events().iter().find(|event| event.kind == EventKind::GrossSlip);
    Some(event.map_or(f64::INFINITY, |event| event.at))
}

fn shakedown(section: &mut Section) -> Option<()> {
    for q in [0.57, 0.585] {
        let problem = ContactProblem::force(Depth, 2.0, q)?;
        let count = |slides: bool| if slides { 1.0 } else { 0.0 };
        let expected = count(q > shakedown_limit(2.0));
        let slides = count(slides_at(&problem, 500.0)?.is_finite());
        let endless = count(problem.control.tends_to(&problem.contact).is_none());
        let source = "q < 0.57735";
        section.check(format!("q = {q}: loses its grip"), source, expected, slides, 0.0);
        section.check(format!("q = {q}: has no limit"), source, expected, endless, 0.0);
        if q < shakedown_limit(2.0) {
            let stick = root(shakedown_limit(2.0), 1.0, |c| 1.5 * c * (1.0 - c * c) - q);
            let value = problem.states(Law::Exact, &[500.0])?.pop()?.worn.stick;
            let what = format!("q = {q}: c at Ñ = 500");
            section.check(what, "c(1 − c²) = 2q/3", stick, value, 1e-3);
        }
    }
    Some(())
}
