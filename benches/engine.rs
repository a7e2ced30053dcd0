//! What a simplified run costs, beside the literal procedure and beside its own matrix products.
//!
//! Everything is measured in one process, in turns of about a millisecond, so that what slows the
//! machine slows all alike; ratios are medians over the turns.

#![expect(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a benchmark prints, and may stop where it stands"
)]

use std::hint::black_box;
use std::time::Instant;

use fretwork::engine::contact::{Contact, Decay, Row};
use fretwork::engine::profile::Shape;
use fretwork::engine::scenario::{self, Scenario};
use fretwork::engine::simplified::Simplified;
use fretwork::engine::simulation::Simulation;
use fretwork::engine::transform::Kernels;
use serde_json::{Value, json};

#[path = "../tests/it/literal.rs"]
mod literal;

const SNAPSHOTS: [f64; 5] = [0.5, 2.0, 4.5, 8.0, 16.0];
const ROUNDS: usize = 500;

/// The steel ball with half of the contact sticking.
fn ball(normalized: &[f64], model: &Value, profiles_at: &str) -> Scenario {
    let request = json!({
        "profile": {"shape": "paraboloid", "radius": "10 mm"},
        "moduli": {"normal": "112.64 GPa", "tangential": "92.76 GPa"},
        "friction": 0.7,
        "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
        "load": {"normal_force": "100 N", "held": "depth"},
        "motion": {"stick_ratio": 0.5},
        "cycles": {"normalized": normalized},
        "profiles_at": profiles_at,
        "model": model,
    });
    scenario::check(&request, "").expect("a valid scenario").0
}

fn run_of(points: usize) -> Scenario {
    ball(&SNAPSHOTS, &json!({"points": points}), "all")
}

/// Seconds per call of `work`, over about a millisecond.
fn seconds(mut work: impl FnMut()) -> f64 {
    let start = Instant::now();
    work();
    let calls = (0.001 / start.elapsed().as_secs_f64().max(1e-7)).ceil().max(1.0) as u32;
    let start = Instant::now();
    (0..calls).for_each(|_| work());
    (start.elapsed() / calls).as_secs_f64()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let shape = Shape::power(2.0);
    let contact = Contact::new(shape, 0.75).expect("a limit");
    let scenario = run_of(256);
    let solver = Simplified::new(&contact, 256);
    let wanted: Vec<(Decay, bool)> = SNAPSHOTS.map(|n| (solver.decay(0.8, n), true)).to_vec();

    // The products that this run makes: five inverses, five pressures inside a₀.
    let mesh: Vec<f64> = solver
        .radii()
        .iter()
        .copied()
        .filter(|r| (0.5..=contact.limit.radius).contains(r))
        .collect();
    let kernels = Kernels::with_cells(mesh.len() - 1);
    let inside = mesh.iter().filter(|r| **r < 1.0).count();
    let shorten = |vectors: &[Vec<f64>]| -> Vec<Vec<f64>> {
        vectors.iter().map(|vector| vector[..=inside].to_vec()).collect()
    };
    let vectors: Vec<Vec<f64>> =
        SNAPSHOTS.map(|n| kernels.tau().iter().map(|tau| libm::cos(n * tau)).collect()).to_vec();
    let changes = shorten(&vectors);
    let mut curves = vectors.clone();

    let row = Row::new(&contact);
    let one_dimensional = || {
        for n in SNAPSHOTS {
            black_box(row.sums(black_box(solver.decay(0.8, n))));
        }
    };
    let (mut runs, mut products, mut sums, mut states) = (vec![], vec![], vec![], vec![]);
    for _ in 0..ROUNDS {
        runs.push(seconds(|| drop(black_box(Simulation::of(&scenario).expect("a run").run()))));
        products.push(seconds(|| {
            kernels.inverse(black_box(&vectors), &mut curves, 0);
            kernels.pressure(black_box(&changes), inside, &mut curves, 0);
            black_box(&curves);
        }));
        sums.push(seconds(one_dimensional));
        states.push(seconds(|| drop(black_box(solver.states(black_box(&wanted))))));
    }
    let ratio = |a: &[f64], b: &[f64]| median(a.iter().zip(b).map(|(a, b)| a / b).collect());
    let micro = |x: &[f64]| 1e6 * median(x.to_vec());
    println!(
        "simplified run, 256 points, 5 snapshots, every output: median {:.1} µs",
        micro(&runs)
    );
    println!(
        "  of it, its triangular products alone ({} cells): {:.1} µs",
        mesh.len() - 1,
        micro(&products)
    );
    println!("  of it, states on a laid-out contact: {:.1} µs", micro(&states));
    println!("  run / products = {:.2}   (at most 1.5)", ratio(&runs, &products));
    println!("1-D part alone (F, Q, W, V unclipped, 5 snapshots): {:.2} µs", micro(&sums));
    for points in [64, 1024, 4096] {
        let scenario = run_of(points);
        let time = seconds(|| drop(black_box(Simulation::of(&scenario).expect("a run").run())));
        println!(
            "simplified run, {points} points: {:.2} times that of 256",
            time / median(runs.clone())
        );
    }

    // The exact method at its defaults, to Ñ = 16, without curves and with them.
    for profiles in ["none", "all"] {
        let instants = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
        let exact = ball(&instants, &json!({"method": "exact"}), profiles);
        let mut ratios = Vec::new();
        for _ in 0..50 {
            let exact = seconds(|| drop(black_box(Simulation::of(&exact).expect("a run").run())));
            let run = seconds(|| drop(black_box(Simulation::of(&scenario).expect("a run").run())));
            ratios.push(exact / run);
        }
        let ratio = median(ratios);
        println!("exact run at defaults, profiles {profiles} / simplified run = {ratio:.1}");
    }

    // The literal procedure: 256 springs dragged through 400 steps a cycle, N₀ = 1000, to Ñ = 16.
    let springs: Vec<f64> =
        (0..256).map(|i| contact.limit.radius * (f64::from(i) + 0.5) / 256.0).collect();
    let mut ratios = Vec::new();
    for _ in 0..3 {
        let start = Instant::now();
        let mut row = literal::Springs::new(&contact, black_box(&springs), 0.8, 1000, 400);
        row.run(16_000);
        black_box(row.images());
        let literal = start.elapsed().as_secs_f64();
        let run = seconds(|| drop(black_box(Simulation::of(&scenario).expect("a run").run())));
        ratios.push(literal / run);
    }
    println!("literal stepping / simplified run = {:.0}   (at least 5000)", median(ratios));
}
