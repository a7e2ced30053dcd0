//! Line contacts: closed forms, converged reference runs, and the balance of energy.

use fretwork_engine::contact::control::{Control, Normal, Series, Tangential};
use fretwork_engine::contact::profile::Shape;
use fretwork_engine::contact::unworn::Contact;
use fretwork_engine::solver::stepped::law::WearProblem;
use fretwork_engine::solver::stepped::march::{March, MarchState};

/// A cylinder that sticks inside `c`.
fn cylinder(c: f64) -> Contact {
    Contact::sticking(Shape::line_power(2.0), c).expect("a limit")
}

fn at(run: &mut March, time: f64) -> MarchState {
    while run.advance(time) {}
    run.at(time)
}

fn both_forces() -> Control {
    Control { normal: Normal::Depth, tangential: Tangential::Amplitude }
}

/// The stroke, in μh₀, of the unworn cylinder that sticks inside `c`, against points at the distance `reach`: θ·C and the
/// integral of (θ − y)₊ by quadrature.
fn stroke(c: f64, reach: f64) -> f64 {
    let theta = 1.0 - c * c;
    let slope = |s: f64| reach / (s * ((reach - s) * (reach + s)).sqrt());
    let cells = 200_000;
    let width = (1.0 - c) / f64::from(cells);
    let inside: f64 = (0..cells)
        .map(|i| c + width * (f64::from(i) + 0.5))
        .map(|s| (theta - 1.0 + s * s) * slope(s) * width)
        .sum();
    inside + theta * libm::acosh(reach)
}

/// Converged runs of a prototype with another code: V at Ñ, both forces held.
#[test]
fn volumes_with_both_forces_held_agree_with_converged_runs() {
    let times = [1.0, 2.0, 5.0, 10.0, 20.0, 50.0];
    for (c, volumes) in [
        (0.5, [0.066_046, 0.139_656, 0.369_867, 0.580_010, 0.632_352, 0.633_904]),
        (0.7, [0.015_971, 0.032_991, 0.084_021, 0.137_170, 0.154_123, 0.154_810]),
    ] {
        let (contact, control) = (cylinder(c), both_forces());
        let mut run = March::new(WearProblem::exact(&contact, &control), 3e-3, 50.0).expect("fits");
        for (time, known) in times.into_iter().zip(volumes) {
            let MarchState { worn, errors, worn_by_energy, .. } = at(&mut run, time);
            let error = worn.volume / known - 1.0;
            println!("{c} {time}: {} {error:.1e} {:.1e} {:.1e} {}", worn.volume, errors.volume, worn_by_energy / worn.volume - 1.0, run.cells());
            assert!(error.abs() < 1e-3);
        }
    }
}

#[test]
fn volumes_with_a_stroke_held_agree_with_converged_runs() {
    for (reach, volumes) in [
        (10.0, [0.06431, 0.33543, 0.58063, 0.58295]),
        (1000.0, [0.06526, 0.35381, 0.60737, 0.60921]),
    ] {
        let series = Series { reach, compliance: 0.0 };
        let contact = cylinder(0.5).measured_against(Some(series));
        let tangential = Tangential::Stroke(stroke(0.5, reach));
        let control = Control { normal: Normal::Depth, tangential };
        let mut run = March::new(WearProblem::exact(&contact, &control), 3e-3, 50.0).expect("fits");
        for (time, known) in [1.0, 5.0, 20.0, 50.0].into_iter().zip(volumes) {
            let MarchState { worn, errors, worn_by_energy, .. } = at(&mut run, time);
            let error = worn.volume / known - 1.0;
            println!("{reach} {time}: {} {error:.1e} {:.1e} {:.1e} c {} Q {} {}", worn.volume, errors.volume, worn_by_energy / worn.volume - 1.0, worn.stick, worn.threshold / 0.75, run.cells());
            assert!(error.abs() < 1e-2);
        }
    }
}

#[test]
fn a_sliding_cylinder_of_mccoll() {
    // a₀ = 35.9 µm, h₀ = 0.107 µm, N₀ = 11 218, U = 25 µm.
    let contact = Contact::new(Shape::line_power(2.0), 1.0).expect("scales");
    let tangential = Tangential::Sliding(25.0 / (0.9 * 0.1073));
    let control = Control { normal: Normal::Depth, tangential };
    let last = 18_000.0 / 11_218.0;
    let begun = std::time::Instant::now();
    let mut run = March::new(WearProblem::exact(&contact, &control), 3e-3, last).expect("fits");
    for (n, depth, width, area) in [(1e3, 0.412, 0.095, 86.0), (5e3, 1.234, 0.159, 433.0), (1e4, 1.967, 0.2, 866.0), (18e3, 2.918, 0.242, 1561.0)] {
        let MarchState { worn, errors, worn_by_energy, .. } = at(&mut run, n / 11_218.0);
        println!("{n}: depth {} {depth} a {} {width} V {} {area} errors {:.1e} {:.1e} energy {:.1e} {} {:?} {:?}", worn.deepest * 0.1073 * 2.9 / 4.8, worn.contact_radius * 0.0359, worn.volume * 35.9 * 0.1073, errors.volume, errors.depth, worn_by_energy / worn.volume - 1.0, run.cells(), run.work(), begun.elapsed());
    }
}

#[test]
#[ignore = "a survey"]
fn survey() {
    let mut seed = 12345_u64;
    let mut random = move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 11) as f64 / (1u64 << 53) as f64
    };
    let mut ratios: Vec<(f64, f64, f64, String)> = Vec::new();
    for case in 0..400 {
        let shape = match (random() * 7.0) as usize {
            0 => Shape::line_power(1.0),
            1 => Shape::line_power(1.0 + random()),
            2 => Shape::line_power(2.0),
            3 => Shape::line_power(2.0),
            4 => Shape::line_power(2.0 + 6.0 * random()),
            _ => Shape::punch(0.05 + 0.93 * random()),
        };
        let reach = 10_f64.powf(0.1 + 3.0 * random());
        let rig = if random() < 0.5 { 0.0 } else { 3.0 * random() };
        let series = if random() < 0.7 { Series { reach, compliance: rig } } else { Series { reach: f64::INFINITY, compliance: 1.0 + 5.0 * random() } };
        let theta = (0.05 + 0.94 * random()).min(0.99);
        let kind = (random() * 4.0) as usize;
        let (threshold, tangential) = match kind {
            0 => (theta, Tangential::Amplitude),
            1 => (theta, Tangential::Stroke(f64::NAN)),
            2 => (1.0, Tangential::Stroke(1.001 + 9.0 * random() * random())),
            _ => (1.0, Tangential::Sliding(20.0 * 10_f64.powf(1.5 * random()))),
        };
        let contact = Contact::new(shape.clone(), threshold).expect("a limit").measured_against(Some(series));
        let full = |theta: f64| {
            // the stroke of the unworn contact
            let c = contact.stick;
            let slope = |s: f64| if series.reach.is_infinite() { 1.0 / s } else { series.reach / (s * ((series.reach - s) * (series.reach + s)).sqrt()) };
            let n = 20000;
            let from = c;
            let sum: f64 = (0..n).map(|i| { let u = (i as f64 + 0.5) / n as f64; let s = from + (1.0 - from) * u * u; (theta - 1.0 + shape.image(s)).max(0.0) * slope(s) * 2.0 * u * (1.0 - from) / n as f64 }).sum();
            let outside = if series.reach.is_infinite() { series.compliance } else { series.compliance + libm::acosh(series.reach) };
            sum + theta * outside
        };
        let tangential = match tangential {
            Tangential::Stroke(x) if x.is_nan() => Tangential::Stroke(full(theta)),
            Tangential::Stroke(x) => Tangential::Stroke(x * full(1.0)),
            other => other,
        };
        let control = Control { normal: Normal::Depth, tangential: tangential.clone() };
        let speed = match tangential { Tangential::Sliding(s) => s, Tangential::Stroke(s) if kind == 2 => (s - full(1.0)) + 0.25, _ => 0.1 };
        let last = 10_f64.powf(-1.5 + 3.0 * random()) / speed;
        let name = format!("{case} {shape:?} {tangential:?} theta {threshold} c {} series {series:?} last {last}", contact.stick);
        let problem = WearProblem::exact(&contact, &control);
        let (Some(mut run), Some(mut fine)) = (March::new(problem, 3e-3, last), March::new(problem, 1e-4, last)) else { println!("refused {name}"); continue };
        for share in [0.1, 0.3, 1.0] {
            let (a, b) = (at(&mut run, share * last), at(&mut fine, share * last));
            if b.worn.volume == 0.0 { continue }
            let (dv, dd) = ((a.worn.volume / b.worn.volume - 1.0).abs(), (a.worn.deepest / b.worn.deepest - 1.0).abs());
            if !(dv.is_finite() && dd.is_finite()) { println!("NaN {name}"); continue }
            ratios.push((dv, dd, a.errors.volume, name.clone()));
            if dv > a.errors.volume + b.errors.volume || dd > a.errors.depth + b.errors.depth || dv > 0.01 || dd > 0.02 {
                println!("{share} dv {dv:.1e} stated {:.1e} dd {dd:.1e} stated {:.1e} fine {:.1e} {:.1e}: {name}", a.errors.volume, a.errors.depth, b.errors.volume, b.errors.depth);
            }
        }
    }
    ratios.sort_by(|a, b| a.0.total_cmp(&b.0));
    let n = ratios.len();
    println!("median dv {:.1e} 95 % {:.1e} max {:.1e}", ratios[n / 2].0, ratios[n * 95 / 100].0, ratios[n - 1].0);
    ratios.sort_by(|a, b| a.1.total_cmp(&b.1));
    println!("median dd {:.1e} 95 % {:.1e} max {:.1e}", ratios[n / 2].1, ratios[n * 95 / 100].1, ratios[n - 1].1);
}

#[test]
fn changing_friction() {
    use fretwork_engine::contact::course::{Course, Over, Track};
    // Gross slip of a ball with the depth held, mu from 1 to 3 times over time 4.
    let contact = Contact::new(Shape::power(2.0), 6.0).expect("a limit");
    for over in [Over::Time, Over::Energy] {
        let track = Track::through(over, vec![0.0, 2.0], vec![1.0, 3.0]);
        let changing = contact.clone().changing(Some(Course { friction: Some(track.clone()), wear: Some(track) }));
        for control in [Control::PAPER, Control { normal: Normal::Force, tangential: Tangential::Amplitude }] {
            let mut run = March::new(WearProblem::exact(&changing, &control), 3e-3, 5.0).expect("fits");
            let mut fine = March::new(WearProblem::exact(&changing, &control), 1e-4, 5.0).expect("fits");
            for time in [0.5, 1.0, 2.0, 5.0] {
                let (a, b) = (at(&mut run, time), at(&mut fine, time));
                println!("{over:?} {time} V {} {:.1e} stated {:.1e} energy {:.1e} dissipated {} {:.1e} friction {} c {}", a.worn.volume, a.worn.volume / b.worn.volume - 1.0, a.errors.volume, a.worn_by_energy / a.worn.volume - 1.0, a.dissipated, a.dissipated / b.dissipated - 1.0, a.worn.friction, a.worn.stick);
            }
        }
    }
    // Run-in: partial slip begins.
    for (shape, theta) in [(Shape::power(2.0), 1.5), (Shape::power(2.0), 0.9), (Shape::line_power(2.0), 0.95)] {
        for factor in [2.5, 0.8] {
            let contact = Contact::new(shape.clone(), theta).expect("a limit");
            let track = Track::through(Over::Time, vec![0.0, 2.0], vec![1.0, factor]);
            let changing = contact.changing(Some(Course { friction: Some(track), wear: None }));
            let control = Control { normal: Normal::Depth, tangential: Tangential::Amplitude };
            let mut run = March::new(WearProblem::exact(&changing, &control), 3e-3, 20.0).expect("fits");
            let mut fine = March::new(WearProblem::exact(&changing, &control), 1e-4, 20.0).expect("fits");
            for time in [0.5, 1.0, 2.0, 5.0, 20.0] {
                let (a, b) = (at(&mut run, time), at(&mut fine, time));
                println!("{theta} {factor} {time} V {} {:.1e} depth {:.1e} stated {:.1e} {:.1e} energy {:.1e} c {} cells {} ended {:?}", a.worn.volume, a.worn.volume / b.worn.volume - 1.0, a.worn.deepest / b.worn.deepest - 1.0, a.errors.volume, a.errors.depth, a.worn_by_energy / a.worn.volume - 1.0, a.worn.stick, run.cells(), run.ended());
            }
        }
    }
}
