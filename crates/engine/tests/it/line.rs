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
            let MarchState { worn, errors, worn_by_energy } = at(&mut run, time);
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
            let MarchState { worn, errors, worn_by_energy } = at(&mut run, time);
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
        let MarchState { worn, errors, worn_by_energy } = at(&mut run, n / 11_218.0);
        println!("{n}: depth {} {depth} a {} {width} V {} {area} errors {:.1e} {:.1e} energy {:.1e} {} {:?} {:?}", worn.deepest * 0.1073 * 2.9 / 4.8, worn.contact_radius * 0.0359, worn.volume * 35.9 * 0.1073, errors.volume, errors.depth, worn_by_energy / worn.volume - 1.0, run.cells(), run.work(), begun.elapsed());
    }
}
