//! Measures the cost of a simplified run, compared with a simulation of every cycle and with the
//! matrix products of the run.
//!
//! All work is measured in one process, in turns of about 1 ms. A slow machine therefore affects
//! all measurements equally. The reported ratios are medians over the turns.

#![expect(
    clippy::disallowed_methods,
    clippy::expect_used,
    clippy::print_stdout,
    reason = "a benchmark prints its results, and may panic"
)]

use std::hint::black_box;
use std::time::Instant;

use fretwork_engine::contact::control::{Control, Held, Normal};
use fretwork_engine::contact::profile::Shape;
use fretwork_engine::contact::row::SpringRow;
use fretwork_engine::contact::transform::Kernels;
use fretwork_engine::contact::unworn::{Contact, Decay};
use fretwork_engine::scenario::{self, Scenario};
use fretwork_engine::simulation::{Advance, Simulation};
use fretwork_engine::solver::closed::simplified::Simplified;
use fretwork_engine::solver::stepped::law::{Law, WearProblem};
use fretwork_engine::solver::stepped::march::March;
use serde_json::{Value, json};

#[path = "../tests/it/literal.rs"]
mod literal;
mod uniform;

const SNAPSHOTS: [f64; 5] = [0.5, 2.0, 4.5, 8.0, 16.0];
const LATER_SNAPSHOTS: [f64; 6] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0];
const ROUNDS: usize = 500;

/// The steel ball example in partial slip, c = a₀/2.
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
    ball(&SNAPSHOTS, &json!({"method": "simplified", "points": points}), "all")
}

/// Time in seconds per call of `work`, measured over about 1 ms.
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

    // The matrix products of this run: five inverse transforms, and five pressures inside a₀.
    let mesh = solver.mesh();
    let kernels = Kernels::with_cells(mesh.len() - 1);
    let inside = mesh.iter().filter(|r| **r < 1.0).count();
    let shorten = |vectors: &[Vec<f64>]| -> Vec<Vec<f64>> {
        vectors.iter().map(|vector| vector[..=inside].to_vec()).collect()
    };
    let vectors: Vec<Vec<f64>> =
        SNAPSHOTS.map(|n| kernels.tau().iter().map(|tau| libm::cos(n * tau)).collect()).to_vec();
    let changes = shorten(&vectors);
    let mut curves = vectors.clone();

    let row = SpringRow::new(&contact);
    let one_dimensional = || {
        for n in SNAPSHOTS {
            black_box(row.sums(black_box(solver.decay(0.8, n))));
        }
    };
    let (mut runs, mut products, mut sums, mut states) = (vec![], vec![], vec![], vec![]);
    for _ in 0..ROUNDS {
        runs.push(seconds(|| drop(black_box(Simulation::of(&scenario).expect("a run").run()))));
        products.push(seconds(|| {
            kernels.inverse(black_box(&vectors), &mut curves);
            kernels.pressure(black_box(&changes), inside, &mut curves);
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

    growth();
    exact_runs(&scenario);
    line_runs();
    longest_steps();

    // The simulation of every cycle: 256 springs, 400 steps per cycle, N₀ = 1000, up to Ñ = 16.
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

/// How the cost grows with the number of output radii, for runs with every output. The unit of the
/// time-stepped runs is the product of a triangular 64 × 64 matrix and a vector.
fn growth() {
    let kernels = Kernels::with_cells(63);
    let vector = [kernels.tau().iter().map(|tau| libm::cos(*tau)).collect::<Vec<f64>>()];
    let mut product = [vec![0.0; 64]];
    let mut one_product = || {
        seconds(|| {
            kernels.inverse(black_box(&vector), &mut product);
            black_box(&product);
        })
    };
    let run = |scenario: &Scenario| {
        seconds(|| drop(black_box(Simulation::of(scenario).expect("a run").run())))
    };
    let common = run_of(256);
    println!("points   closed form, 5 snapshots   exact method, 6 snapshots");
    println!("         / that of 256 points       / triangular products 64 × 64");
    for points in [64, 128, 256, 512, 1024, 2048, 4096] {
        let closed = run_of(points);
        let model = json!({"method": "exact", "points": points});
        let stepped = ball(&LATER_SNAPSHOTS, &model, "all");
        let ratios = (0..40).map(|_| {
            let (closed, common) = (run(&closed), run(&common));
            (closed / common, run(&stepped) / one_product())
        });
        let (closed, stepped) = ratios.unzip();
        println!("{points:6} {:20.2} {:27.0}", median(closed), median(stepped));
    }
}

/// The cost of a line contact, relative to a round contact with the same quantities held.
fn line_runs() {
    let with = |profile: Value, load: &str, motion: Value| {
        let request = json!({
            "profile": profile,
            "moduli": {"normal": "112.64 GPa", "tangential": "92.76 GPa"},
            "friction": 0.7,
            "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
            "load": {"normal_force": load, "held": "force"},
            "motion": motion,
            "cycles": {"normalized": LATER_SNAPSHOTS},
            "model": {"method": "exact"},
        });
        scenario::check(&request, "").expect("a valid scenario").0
    };
    let round = |motion| with(json!({"shape": "paraboloid", "radius": "10 mm"}), "100 N", motion);
    let profile = json!({"shape": "cylinder", "radius": "10 mm", "length": "10 mm"});
    let line = |motion| with(profile.clone(), "1 kN", motion);
    let stroke = json!({"amplitude": "1.6 um", "reference_distance": "10 mm"});
    let pairs = [
        (
            "force",
            round(json!({"tangential_force": "35 N"})),
            line(json!({"tangential_force": "350 N"})),
        ),
        ("amplitude", round(json!({"stick_ratio": 0.5})), line(stroke)),
    ];
    for (held, round, line) in pairs {
        let run = |scenario: &Scenario| {
            seconds(|| drop(black_box(Simulation::of(scenario).expect("a run").run())))
        };
        let ratios = (0..50).map(|_| run(&line) / run(&round)).collect();
        println!("line / round, {held} held = {:.2}   (at most 1.5)", median(ratios));
    }
}

/// The cost of the exact method, relative to a simplified run of 256 points.
fn exact_runs(simplified: &Scenario) {
    let beside = |scenario: &Scenario| {
        let ratios = (0..50).map(|_| {
            let exact = seconds(|| drop(black_box(Simulation::of(scenario).expect("a run").run())));
            let run = seconds(|| drop(black_box(Simulation::of(simplified).expect("a run").run())));
            exact / run
        });
        median(ratios.collect())
    };
    for profiles in ["none", "all"] {
        let exact = ball(&LATER_SNAPSHOTS, &json!({"method": "exact"}), profiles);
        let ratio = beside(&exact);
        println!("exact run at defaults, profiles {profiles} / simplified run = {ratio:.1}");
    }
    // Only the fine run, without the coarse run for the error estimate.
    let contact = Contact::sticking(Shape::power(2.0), 0.5).expect("a limit");
    let control = Control::constant(Normal::Depth, Held::Threshold, contact.threshold);
    let problem = WearProblem { contact: &contact, control: &control, law: Law::Exact };
    let march = |cells: usize, tolerance: f64, last: f64| {
        let run = March::with_cells(problem, cells, tolerance, last);
        let mut run = run.expect("a scar that fits");
        while run.advance(last) {}
        run.at(last)
    };
    let all = seconds(|| drop(black_box(march(64, 3e-3, 16.0))));
    let half = seconds(|| drop(black_box(march(32, 1.2e-2, 16.0))));
    println!(
        "  of it, both meshes to Ñ = 16: {:.0} µs; with half the cells {:.0} µs",
        1e6 * all,
        1e6 * half
    );

    let mut held =
        serde_json::to_value(ball(&[32.0], &json!({"method": "exact"}), "none")).expect("JSON");
    held["load"] = json!({"normal_force": 100.0});
    held["motion"] = json!({"stick_ratio": 0.55});
    held["cycles"] = json!({"normalized": [0.5, 1, 2, 4, 8, 16, 32]});
    let (held, _) = scenario::check(&held, "").expect("a valid scenario");
    println!(
        "exact run, force and amplitude held, to Ñ = 32 / simplified run = {:.1}   (at most 40)",
        beside(&held)
    );

    // The error of V at Ñ = 4, and the cost.
    let reference = march(512, 2e-5, 4.0).worn.volume;
    let mut known = Vec::new();
    println!("cells   V error at Ñ = 4   µs");
    for cells in [32, 64, 128, 256, 512] {
        let tolerance = 3e-3 * (64.0 / cells as f64) * (64.0 / cells as f64);
        let error = (march(cells, tolerance, 4.0).worn.volume / reference - 1.0).abs();
        let cost = seconds(|| drop(black_box(march(cells, tolerance, 4.0))));
        println!("{cells:5}   {error:.1e}            {:.0}", 1e6 * cost);
        known.push((error, cost));
    }
    let start = Instant::now();
    let volume = uniform::Procedure::new(&contact, black_box(256)).run(4.0);
    let cost = start.elapsed().as_secs_f64();
    let error = (volume / reference - 1.0).abs();
    let equal = known.iter().filter(|(known, _)| *known <= error).map(|(_, cost)| *cost);
    let equal = equal.fold(f64::INFINITY, f64::min);
    println!("literal exact procedure, 256 even cells: V error {error:.1e}, {:.0} ms", 1e3 * cost);
    println!("  / exact run at equal error = {:.0}   (at least 150)", cost / equal);
}

/// The longest step of a run, which is the maximum delay of a cancellation. The scenarios have the
/// largest steps.
fn longest_steps() {
    let radii: Vec<f64> = (0..10_000).map(|i| 1e-7 * f64::from(i)).collect();
    let heights: Vec<f64> = radii.iter().map(|r| r * r / 0.02).collect();
    let table = json!({"shape": "table", "radius": radii, "height": heights});
    let rule = json!({"method": "simplified", "points": 4096});
    let closed = json!({"model": rule, "until": {"wear_depth": "0.5 um"}});
    let dead_weight = json!({"normal_force": "100 N", "held": "force"});
    let rough = json!({"profile": table, "load": dead_weight, "motion": {"amplitude": "4 um"}});
    let fine = json!({"load": dead_weight, "model": {"method": "exact", "tolerance": 1e-4}});
    for (what, changes) in [
        ("closed form, 4096 points, until a depth", closed),
        ("rule, all slips, a table of 10 000 rows", rough),
        ("exact, force and amplitude held, tolerance 1e-4", fine),
    ] {
        let mut request = serde_json::to_value(run_of(256)).expect("JSON");
        for (member, value) in changes.as_object().expect("members") {
            request[member] = value.clone();
        }
        let (scenario, _) = scenario::check(&request, "").expect("a valid scenario");
        // The minimum of three measurements excludes other work of the machine.
        let longest = (0..3).map(|_| {
            let mut run = Simulation::of(&scenario).expect("a run");
            let (mut longest, mut whole) = (0.0_f64, 0.0);
            loop {
                let start = Instant::now();
                let step = run.step();
                let time = start.elapsed().as_secs_f64();
                (longest, whole) = (longest.max(time), whole + time);
                if let Advance::Done(_) = step {
                    return (longest, whole);
                }
            }
        });
        let (longest, whole) = longest.min_by(|a, b| a.0.total_cmp(&b.0)).expect("three of them");
        println!(
            "longest step: {:.0} ms of {:.0} ms   (at most 50): {what}",
            1e3 * longest,
            1e3 * whole
        );
    }
}
