//! Checks of the numerical method: its energy balance, its order of convergence and its tolerance.

use serde_json::{Value, json};

use super::known::{paraboloid, request, run};
use super::page::{Check, Section};
use super::problem::{ContactProblem, at};
use fretwork_engine::contact::control::Normal::Depth;
use fretwork_engine::contact::record::DisplacementRecord;
use fretwork_engine::scenario::{DEFAULT_TOLERANCE, DEFAULT_XI};
use fretwork_engine::solver::stepped::law::Law;
use fretwork_engine::solver::stepped::march::March;
use fretwork_engine::solver::stepped::plan::MeshPlan;
use fretwork_engine::solver::stepped::rkc::Rkc;
use fretwork_engine::solver::stepped::wearing::Wearing;

/// Tolerance of the time steps at which only the mesh causes errors.
const FINE_STEPS: f64 = 1e-5;

pub fn sections() -> Vec<Section> {
    vec![states(), sums(), order(), cells(), tolerance(), blocks(), records()]
}

fn states() -> Section {
    const CELLS: usize = 64;
    Section::of("Energy balance in every state", |section| {
        for ContactProblem { name, contact, control } in ContactProblem::modes()? {
            let plan = MeshPlan::first(&contact, &control, CELLS)?;
            let mut wearing = Wearing::new(&contact, &control, Law::Exact, plan, CELLS);
            let mut rkc = Rkc::new(&mut wearing, vec![0.0; CELLS + 1], 3e-3, (1.0, 0.3));
            let mut worst = 0.0_f64;
            for _ in 0..40 {
                worst =
                    worst.max((wearing.volume(rkc.rates()) / wearing.energy_rate() - 1.0).abs());
                rkc.advance(&mut wearing, f64::INFINITY);
            }
            section.check(name, "dV/dN = (k_w/μ)W", 0.0, worst, 1e-12);
        }
        Some(())
    })
}

fn sums() -> Section {
    Section::of("Energy balance over runs", |section| {
        for problem in ContactProblem::modes()? {
            for (law, method, accepted) in [
                (Law::Exact, "exact", Some(1e-3)),
                (Law::Simplified(DEFAULT_XI), "simplified", None),
            ] {
                let end = problem.states(law, &[16.0])?.pop()?;
                section.checks.push(Check {
                    what: format!("{}: {method}", problem.name),
                    source: "dV/dN = (k_w/μ)W",
                    reference: 1.0,
                    value: end.worn_by_energy / end.worn.volume,
                    accepted,
                });
            }
        }
        Some(())
    })
}

/// V at Ñ = 2 on a mesh of `cells` cells, and the multiplications of the run.
fn volume(problem: &ContactProblem, cells: usize) -> Option<(f64, f64)> {
    let ContactProblem { contact, control, .. } = problem;
    let mut run = March::with_cells(contact, control, Law::Exact, cells, FINE_STEPS, 2.0)?;
    let volume = at(&mut run, 2.0).worn.volume;
    let (_, evaluations) = run.work();
    Some((volume, (evaluations * cells * cells) as f64))
}

fn order() -> Section {
    Section::of("Order of convergence", |section| {
        for (n, c) in [(2.0, 0.5), (1.0, 0.21), (4.0, 0.7)] {
            let problem = ContactProblem::amplitude(Depth, n, c)?;
            let distance = |cells: usize| {
                Some((volume(&problem, cells)?.0 - volume(&problem, 4 * cells)?.0).abs())
            };
            let [coarse, middle, fine] = [distance(32)?, distance(64)?, distance(128)?];
            for (cells, ratio) in [(32, coarse / middle), (64, middle / fine)] {
                let what = format!("{}: order from {cells} cells", problem.name);
                section.check(what, "second order", 2.0, libm::log2(ratio), 0.15);
            }
        }
        Some(())
    })
}

fn cells() -> Section {
    Section::of("Error and cost", |section| {
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
    })
}

fn tolerance() -> Section {
    const INSTANTS: [f64; 3] = [1.0, 4.0, 16.0];
    Section::of("Tolerance", |section| {
        let mut problems = ContactProblem::modes()?;
        problems.push(ContactProblem::amplitude(Depth, 1.0, 0.21)?);
        problems.push(ContactProblem::amplitude(Depth, 4.0, 0.7)?);
        for problem in problems {
            let mut fine = problem.march(Law::Exact, 0.1 * DEFAULT_TOLERANCE, INSTANTS[2])?;
            for (instant, state) in INSTANTS.into_iter().zip(problem.states(Law::Exact, &INSTANTS)?)
            {
                let reference = at(&mut fine, instant).worn.volume;
                let what = format!("{}: V at Ñ = {instant}", problem.name);
                let (value, stated) = (state.worn.volume, state.volume_error);
                section.check(what, "tolerance 3e-4", reference, value, stated);
            }
        }
        Some(())
    })
}

fn blocks() -> Section {
    Section::of("Blocks", |section| {
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
    })
}

fn records() -> Section {
    Section::of("Records", |section| {
        let alternating: Vec<f64> =
            dice().take(10_000).enumerate().map(|(i, u)| if i % 2 == 0 { u } else { -u }).collect();
        // Its loops are nested deeply.
        let wandering: Vec<f64> = alternating
            .iter()
            .scan(0.0, |position, swing| {
                *position += swing;
                Some(*position)
            })
            .collect();
        for (name, displacements) in [("alternating", alternating), ("wandering", wandering)] {
            let record = DisplacementRecord::new(&displacements)?;
            for share in [0.0, 0.1, 0.5, 0.9, 0.99] {
                let (amplitude, limit) = (record.amplitude(), share * record.amplitude());
                let what = format!("{name}: path at a slip limit of {share} U");
                let stepped = dragged(&displacements, limit) / amplitude;
                section.check(what, "stepping", stepped, record.path(limit) / amplitude, 1e-9);
            }
        }
        Some(())
    })
}

/// Random numbers between 0 and 1: the upper half of the MMIX generator. D. E. Knuth, *The Art of
/// Computer Programming* 2, 3.3.4.
fn dice() -> impl Iterator<Item = f64> {
    let step = |state: &u64| {
        Some(state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407))
    };
    std::iter::successors(Some(1), step)
        .map(|state| f64::from((state >> 32) as u32) / f64::from(u32::MAX))
}

/// The path that a spring slips when it is dragged through the record for the second time.
fn dragged(displacements: &[f64], limit: f64) -> f64 {
    let (mut before, mut deflection, mut path) = (displacements[0], 0.0, 0.0);
    for _ in 0..2 {
        path = 0.0;
        for u in displacements.iter().skip(1).chain(&displacements[..1]) {
            let pulled: f64 = deflection + (u - before);
            before = *u;
            deflection = pulled.clamp(-limit, limit);
            path += (pulled - deflection).abs();
        }
    }
    path
}
