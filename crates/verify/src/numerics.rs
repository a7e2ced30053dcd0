//! Checks of the numerical method: its energy balance, its convergence and its tolerance.

use serde_json::{Value, json};

use super::known::{paraboloid, request, run};
use super::page::{Section, TitledSection};
use super::problem::{ContactProblem, at};
use fretwork_engine::DEFAULT_TOLERANCE;
use fretwork_engine::contact::control::Normal::Depth;
use fretwork_engine::solver::stepped::law::{Law, PAPER_XI};
use fretwork_engine::solver::stepped::march::March;

/// Tolerance of the time steps. The steps are so small that practically only the mesh causes errors.
const FINE_STEPS: f64 = 1e-5;

pub const SECTIONS: &[TitledSection] = &[
    ("Energy balance over runs", sums),
    ("Error and cost", cells),
    ("Tolerance", tolerance),
    ("Blocks", blocks),
];

fn sums(section: &mut Section) -> Option<()> {
    for problem in ContactProblem::modes()? {
        for (law, method, accepted) in
            [(Law::Exact, "exact", Some(1e-3)), (Law::Simplified(PAPER_XI), "simplified", None)]
        {
            let end = problem.states(law, &[16.0])?.pop()?;
            let what = format!("{}: {method}", problem.name);
            let value = end.worn_by_energy / end.worn.volume;
            section.check(what, "dV/dN = (k_w/μ)W", 1.0, value, accepted);
        }
    }
    Some(())
}

/// V at Ñ = 2 on a mesh of `cells` cells, and the number of multiplications of the run.
fn volume(problem: &ContactProblem, cells: usize) -> Option<(f64, f64)> {
    let mut run = March::with_cells(problem.under(Law::Exact), cells, FINE_STEPS, 2.0)?;
    let volume = at(&mut run, 2.0).worn.volume;
    let (_, evaluations) = run.work();
    Some((volume, (evaluations * cells * cells) as f64))
}

fn cells(section: &mut Section) -> Option<()> {
    let problem = ContactProblem::amplitude(Depth, 2.0, 0.5)?;
    let (coarse, fine) = (volume(&problem, 256)?.0, volume(&problem, 512)?.0);
    let limit = fine + (fine - coarse) / 3.0;
    for cells in [32, 64, 128, 256, 512] {
        let (volume, cost) = volume(&problem, cells)?;
        let (what, share) =
            (format!("{cells} cells, {cost:.1e} multiplications"), 2.0 / cells as f64);
        section.check(what, "extrapolated", limit, volume, share * share);
    }
    Some(())
}

fn tolerance(section: &mut Section) -> Option<()> {
    const INSTANTS: [f64; 3] = [1.0, 4.0, 16.0];
    let mut problems = ContactProblem::modes()?;
    problems.push(ContactProblem::amplitude(Depth, 1.0, 0.21)?);
    problems.push(ContactProblem::amplitude(Depth, 4.0, 0.7)?);
    for problem in problems {
        let mut fine = problem.march(Law::Exact, 0.1 * DEFAULT_TOLERANCE, INSTANTS[2])?;
        for (instant, state) in INSTANTS.into_iter().zip(problem.states(Law::Exact, &INSTANTS)?) {
            let reference = at(&mut fine, instant).worn.volume;
            let what = format!("{}: V at Ñ = {instant}", problem.name);
            let (value, stated) = (state.worn.volume, state.errors.volume);
            section.check(what, "tolerance 3e-4", reference, value, stated);
        }
    }
    Some(())
}

fn blocks(section: &mut Section) -> Option<()> {
    for held in ["depth", "force"] {
        let volume = |motion: Value| {
            let request = request(&paraboloid(), held, &motion, &json!([20_000]));
            Some(1e9 * run(&request)?.history.wear_volume.last()?)
        };
        let block = |cycles: u32| json!({"amplitude": 2.256e-6, "cycles": cycles});
        let one = volume(json!({"blocks": [block(20_000)]}))?;
        let two = volume(json!({"blocks": [block(7000), block(13_000)]}))?;
        let none = volume(json!({"amplitude": 2.256e-6}))?;
        section.check(format!("{held} held: two blocks"), "one block", one, two, 2e-4);
        section.check(format!("{held} held: one block"), "amplitude", none, one, 1e-3);
    }
    Some(())
}
