//! Traces with known tilt, offset, noise and radius, and with the scar of an engine's run.

use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use fretwork_measured::{Measured, Prepare, Up, Wanted, read};
use fretwork_random::Stream;
use serde_json::{Value, json};

use crate::normal;

const TRACE: Wanted<'_> = Wanted::of(Prepare::Trace);
const RADIUS: f64 = 10e-3;

/// Wear depth over radius of a steel ball, as a run computes it.
struct Scar(Vec<f64>, Vec<f64>);

impl Scar {
    fn of_the_engine() -> Self {
        let body = json!({"youngs_modulus": "205 GPa", "poisson_ratio": 0.3});
        let request = json!({
            "profile": {"shape": "paraboloid", "radius": RADIUS}, "bodies": [body, body], "friction": 0.7,
            "wear": {"coefficient": "3e-5 mm^3/(N m)"}, "load": {"normal_force": "20 N"},
            "motion": {"amplitude": "50 um"}, "cycles": [20_000],
        });
        let (scenario, _) = scenario::check(&request, "").unwrap();
        let outcome = serde_json::to_value(Simulation::of(&scenario).unwrap().run()).unwrap();
        let last = |name: &str| -> Vec<f64> {
            let lists = outcome["profiles"][name].as_array().unwrap();
            let list = if lists[0].is_array() {
                lists.last().unwrap()
            } else {
                &outcome["profiles"][name]
            };
            serde_json::from_value(list.clone()).unwrap()
        };
        Self(last("radius"), last("wear"))
    }

    fn at(&self, r: f64) -> f64 {
        let Self(radius, wear) = self;
        let after = radius.partition_point(|known| *known <= r);
        if after == radius.len() {
            return 0.0;
        }
        let share = (r - radius[after - 1]) / (radius[after] - radius[after - 1]);
        wear[after - 1] + share * (wear[after] - wear[after - 1])
    }

    fn deepest(&self) -> f64 {
        self.1.iter().copied().fold(0.0, f64::max)
    }

    fn end(&self) -> f64 {
        let last = self.1.iter().rposition(|wear| *wear > 0.01 * self.deepest()).unwrap();
        self.0[last]
    }
}

/// A measured trace.
#[derive(Clone, Copy)]
struct Trace {
    /// The radius of the surface; 0 for a plane.
    radius: f64,
    axis: f64,
    tilt: f64,
    noise: f64,
    points: usize,
    /// Ends of x.
    from: f64,
    to: f64,
    seed: u64,
}

impl Trace {
    fn file(&self, scar: &Scar) -> String {
        let row = |place: usize| {
            let x = self.from + (self.to - self.from) * place as f64 / (self.points - 1) as f64;
            let r = (x - self.axis).abs();
            let round = if self.radius > 0.0 {
                self.radius - (self.radius * self.radius - r * r).sqrt()
            } else {
                0.0
            };
            let noise = self.noise * normal(Stream::new(self.seed), place as u64);
            let z = 12e-6 - round - scar.at(r) + noise;
            // The specimen is turned by the tilt around x = 0.
            let (sine, cosine) = (self.tilt, (1.0 - self.tilt * self.tilt).sqrt());
            let (x, z) = (cosine * x - sine * z, sine * x + cosine * z);
            format!("{:.5};{:.5}\n", x * 1e6, z * 1e6).replace('.', ",")
        };
        "x [µm];z [µm]\n".to_owned() + &(0..self.points).map(row).collect::<String>()
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    serde_json::from_value(value.clone()).unwrap()
}

/// Root mean square and largest error of the depths.
fn errors(measured: &Measured, scar: &Scar) -> (f64, f64) {
    let data = &measured.prepared["data"];
    let pairs = numbers(&data["radius"]).into_iter().zip(numbers(&data["depth"]));
    let errors: Vec<f64> = pairs.map(|(r, depth)| depth - scar.at(r)).collect();
    let square = errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64;
    (square.sqrt(), errors.iter().fold(0.0, |most, error| error.abs().max(most)))
}

/// The largest errors of traces with these numbers: radius (relative), axis, tilt, depths (root mean square), depth, and
/// radius of the scar.
fn accuracy(scar: &Scar, trace: Trace) -> [f64; 6] {
    let mut most = [0.0_f64; 6];
    for seed in 0..20 {
        let measured = read(Trace { seed, ..trace }.file(scar).as_bytes(), &TRACE).unwrap();
        let found = &measured.prepared["trace"];
        let number = |name: &str| found[name].as_f64().unwrap();
        let (rms, largest) = errors(&measured, scar);
        let radius = if trace.radius > 0.0 { number("radius") / trace.radius - 1.0 } else { 0.0 };
        assert_eq!(found["radius"].is_null(), trace.radius == 0.0);
        let ends = numbers(&found["scar"]);
        let edge = 0.5 * (ends[1] - ends[0]) - scar.end();
        // The axis is turned with the specimen.
        let axis = number("centre") - trace.axis;
        let all = [radius, axis, number("tilt") - trace.tilt, rms, largest, edge];
        for (most, own) in most.iter_mut().zip(all) {
            *most = most.max(own.abs());
        }
    }
    most
}

const BALL: Trace = Trace {
    radius: RADIUS,
    axis: 37e-6,
    tilt: 0.004,
    noise: 20e-9,
    points: 1000,
    from: -900e-6,
    to: 1000e-6,
    seed: 1,
};

#[test]
fn a_trace_gives_back_what_it_was_made_of() {
    let scar = Scar::of_the_engine();
    println!("scar {:.3e} m deep, radius {:.3e} m", scar.deepest(), scar.end());
    // Accepted errors of the radius (relative), the axis, the tilt, the depths (root mean square and largest), the end of
    // the scar.
    for (trace, accepted) in [
        (Trace { noise: 0.0, ..BALL }, [1e-7, 1e-7, 2e-6, 2e-9, 1e-8, 1e-7]),
        (BALL, [3e-4, 2e-7, 2e-5, 1e-8, 4e-8, 2e-6]),
        (Trace { noise: 100e-9, ..BALL }, [1.5e-3, 1e-6, 1e-4, 5e-8, 2e-7, 1e-5]),
        (Trace { noise: 500e-9, ..BALL }, [6e-3, 1e-5, 1e-3, 3e-7, 1e-6, 6e-5]),
        (Trace { radius: 0.0, ..BALL }, [0.0, 2e-7, 1e-5, 1e-8, 4e-8, 2e-6]),
        (Trace { radius: 3e-3, ..BALL }, [3e-4, 2e-7, 1e-4, 2e-8, 4e-8, 2e-6]),
        (Trace { radius: 3e-3, tilt: 0.03, ..BALL }, [3e-4, 3e-7, 2e-4, 2e-8, 4e-8, 2e-6]),
        (Trace { points: 100, ..BALL }, [1e-3, 1e-6, 1e-4, 5e-8, 2e-7, 2e-5]),
        (Trace { points: 60_000, ..BALL }, [4e-5, 1e-7, 1e-5, 3e-9, 2e-8, 2e-6]),
    ] {
        let most = accuracy(&scar, trace);
        println!(
            "{:e} m, {:e} m, {}, {} points: {most:?}",
            trace.radius, trace.noise, trace.tilt, trace.points
        );
        assert!(most.iter().zip(accepted).all(|(most, accepted)| *most <= accepted), "{most:?}");
    }
}

fn prepared(text: &str, wanted: &Wanted<'_>) -> Measured {
    read(text.as_bytes(), wanted).unwrap()
}

#[test]
fn spikes_hardly_change_a_profile() {
    let scar = Scar::of_the_engine();
    let spiked = |(at, line): (usize, &str)| match (line.split_once(';'), at) {
        (Some((x, z)), 100 | 400 | 903) => {
            let z: f64 = z.replace(',', ".").parse().unwrap();
            format!("{x};{}\n", (z + 5.0).to_string().replace('.', ","))
        }
        _ => format!("{line}\n"),
    };
    let text: String = BALL.file(&scar).lines().enumerate().map(spiked).collect();
    let measured = prepared(&text, &TRACE);
    let (rms, _) = errors(&measured, &scar);
    assert!(rms < 1e-8, "{rms}");
    let sigma = measured.prepared["data"]["sigma"].as_f64().unwrap();
    assert!((sigma / BALL.noise - 1.0).abs() < 0.1, "{sigma}");
    let told = "3 isolated spike point(s) were dropped.";
    assert!(measured.notes.iter().any(|note| note == told), "{:?}", measured.notes);
}

/// A surface with a curvature in 1/m and a tilt in um/mm, with a parabolic scar with a depth in um.
fn bowed(sign: f64, curvature: f64, tilt: f64, depth: f64) -> String {
    let row = |place: u32| {
        let x = f64::from(place) * 2.0 - 500.0;
        let scar = depth * (1.0 - x * x / 4e4).max(0.0);
        let noise = 0.02 * normal(Stream::new(5), u64::from(place));
        let z = sign * (5e-7 * curvature * x * x + 1e-3 * tilt * x - scar) + noise;
        format!("{x};{z}\n")
    };
    "x [um];z [um]\n".to_owned() + &(0..501).map(row).collect::<String>()
}

#[test]
fn wear_is_positive_on_every_surface() {
    let half = Wanted { prepare: Prepare::Half, ..TRACE };
    let turned = Wanted { up: Some(Up::In), ..TRACE };
    for (sign, curvature, tilt, wanted, most) in [
        (1.0, 20.0, 0.0, &TRACE, 0.03),
        (1.0, 3.3, 0.0, &TRACE, 0.03),
        (1.0, 1.0, 0.0, &TRACE, 0.03),
        (1.0, 0.0, 2.0, &TRACE, 0.03),
        (1.0, -1.0, 0.0, &TRACE, 0.03),
        (1.0, -100.0, 0.0, &TRACE, 0.03),
        (-1.0, -100.0, 0.0, &TRACE, 0.03),
        (-1.0, 0.0, 0.0, &turned, 0.03),
        (1.0, 0.0, 1.0, &half, 0.05),
        (1.0, 0.0, -1.0, &half, 0.05),
    ] {
        let measured = prepared(&bowed(sign, curvature, tilt, 1.0), wanted);
        let depths = numbers(&measured.prepared["data"]["depth"]);
        let deepest = 1e6 * depths.iter().copied().fold(0.0, f64::max);
        assert!((deepest - 1.0).abs() < most, "{curvature} {tilt}: {deepest}");
        // A pit in a surface that is nearly plane is no indenter: a scenario would refuse it.
        let has_indenter = !measured.prepared["indenter"].is_null();
        assert!(has_indenter == (curvature < -50.0), "{curvature} {tilt} {:?}", measured.notes);
    }
    let refused = |text: &str| read(text.as_bytes(), &TRACE).unwrap_err().0[0].detail.clone();
    assert!(refused(&bowed(-1.0, 20.0, 0.0, 1.0)).contains("write up=in"));
    assert!(refused(&bowed(1.0, 0.0, 2.0, 0.0)).contains("has no scar"));
}

#[test]
fn level_and_centre_can_be_switched_off() {
    let scar = Scar::of_the_engine();
    let text = BALL.file(&scar);
    let heights = |measured: &Measured| numbers(&measured.prepared["indenter"]["height"]);
    let all = prepared(&text, &TRACE);
    let tilted = prepared(&text, &Wanted { level: false, ..TRACE });
    assert_eq!(all.prepared["data"], tilted.prepared["data"], "a tilt is no wear");
    assert!(heights(&all) != heights(&tilted));
    let shifted = prepared(&text, &Wanted { centre: false, ..TRACE });
    assert_eq!(shifted.prepared["trace"]["centre"], 0.0);
    let difference =
        |measured: &Measured| measured.prepared["trace"]["difference"].as_f64().unwrap();
    assert!(difference(&shifted) > 10.0 * difference(&all));
    assert!(
        tilted.notes.iter().any(|note| note.contains("stays in the heights")),
        "{:?}",
        tilted.notes
    );
}

#[test]
fn half_of_a_trace_and_a_reversed_one_give_the_same_profile() {
    let scar = Scar::of_the_engine();
    let half = Trace { axis: 0.0, tilt: 0.0, from: 0.0, points: 500, ..BALL }.file(&scar);
    let measured = prepared(&half, &Wanted { prepare: Prepare::Half, ..TRACE });
    assert!(errors(&measured, &scar).1 < 4e-8);
    assert!(
        measured.notes.iter().any(|note| note.contains("was mirrored")),
        "{:?}",
        measured.notes
    );
    let text = BALL.file(&scar);
    let mut lines: Vec<&str> = text.lines().collect();
    lines[1..].reverse();
    let reversed = prepared(&lines.join("\n"), &TRACE);
    assert_eq!(reversed.prepared, prepared(&text, &TRACE).prepared);
}

#[test]
fn the_indenter_of_an_unworn_trace_makes_a_contact() {
    let unworn = Scar(vec![0.0, 1.0], vec![0.0, 0.0]);
    let measured = prepared(&BALL.file(&unworn), &TRACE);
    assert!(
        measured.notes.iter().any(|note| note.starts_with("No scar was found")),
        "{:?}",
        measured.notes
    );
    assert!(measured.prepared["data"].is_null());
    let request = json!({
        "profile": measured.prepared["indenter"], "moduli": {"normal": "113 GPa", "tangential": "93 GPa"},
        "friction": 0.7, "wear": {"coefficient": 1e-14}, "load": {"normal_force": "20 N"},
        "motion": {"amplitude": "1 um"}, "cycles": [1000],
    });
    let (scenario, _) = scenario::check(&request, "").unwrap();
    // a³ = 3FR/(4E*)
    let hertz = libm::cbrt(0.75 * 20.0 * RADIUS / 113e9);
    let found = scenario.preview().unwrap().scales.contact_radius;
    assert!((found / hertz - 1.0).abs() < 0.01, "{found} {hertz}");
}

#[test]
fn what_is_no_trace_is_refused() {
    let scar = Scar::of_the_engine();
    let refused = |text: &str, wanted: &Wanted<'_>| {
        read(text.as_bytes(), wanted).unwrap_err().0[0].detail.clone()
    };
    let narrow = Trace { from: -400e-6, to: 500e-6, ..BALL }.file(&scar);
    assert!(refused(&narrow, &TRACE).contains("Measure farther"));
    let left = Trace { to: -200e-6, ..BALL }.file(&scar);
    let half = Wanted { prepare: Prepare::Half, ..TRACE };
    assert!(refused(&left, &half).contains("too few points with x above 0"));
    let one = Trace { from: 37e-6, ..BALL }.file(&scar);
    assert!(refused(&one, &TRACE).contains("write prepare=half"));
    let circle = |place: usize| {
        let angle = std::f64::consts::TAU * place as f64 / 400.0;
        format!("{},{}\n", 5.0 * libm::cos(angle), 20.0 * libm::sin(angle))
    };
    let ring = |names: &str| names.to_owned() + "\n" + &(0..400).map(circle).collect::<String>();
    assert!(refused(&ring("x [um],z [um]"), &TRACE).contains("is no trace: x turns back"));
    let cycle = Wanted { prepare: Prepare::Loop, ..TRACE };
    let energy =
        prepared(&ring("delta [um],Q [N]"), &cycle).prepared["energy_per_cycle"].as_f64().unwrap();
    assert!((energy / (std::f64::consts::PI * 5e-6 * 20.0) - 1.0).abs() < 1e-4, "{energy}");
    // Rows of several cycles, from any place of a loop whose force changes at once.
    let rows = |rows: std::ops::Range<u32>| {
        let row = |at: u32| {
            let angle = std::f64::consts::TAU * (f64::from(at) + 0.5) / 100.0;
            format!(
                "{};{};{}\n",
                at / 100,
                5.0 * libm::sin(angle),
                20.0 * libm::cos(angle).signum()
            )
        };
        "cycle;delta [um];Q [N]\n".to_owned() + &rows.map(row).collect::<String>()
    };
    let of = Wanted { x: Some("delta"), y: Some("Q"), ..cycle };
    for (begin, end, cycles) in [(0, 100, 1), (25, 125, 1), (0, 300, 3), (25, 525, 5), (70, 270, 2)]
    {
        let measured = prepared(&rows(begin..end), &of);
        let energy = measured.prepared["energy_per_cycle"].as_f64().unwrap();
        assert!((energy / 4e-4 - 1.0).abs() < 0.02, "{begin} {end}: {energy}");
        let told = format!("The rows are {cycles} cycle(s)");
        assert!(measured.notes.iter().any(|note| note.starts_with(&told)), "{:?}", measured.notes);
    }
    // Parts of cycles at the ends are left out.
    for (begin, end, cycles, [before, after]) in
        [(0, 250, 2, [0, 50]), (25, 175, 1, [25, 25]), (0, 140, 1, [0, 40])]
    {
        let measured = prepared(&rows(begin..end), &of);
        let energy = measured.prepared["energy_per_cycle"].as_f64().unwrap();
        assert!((energy / 4e-4 - 1.0).abs() < 0.02, "{begin} {end}: {energy}");
        assert_eq!(measured.prepared["cycles"], cycles, "{begin} {end}");
        let told = format!(
            "{before} row(s) before the first whole cycle and {after} row(s) after the last one were left out"
        );
        assert!(measured.notes.iter().any(|note| note.contains(&told)), "{:?}", measured.notes);
    }
    assert!(refused(&rows(10..60), &of).contains("does not end where it begins"));
    let line = "x [um],Q [N]\n".to_owned()
        + &(0..40).fold(String::new(), |text, x| format!("{text}{x},1\n"));
    assert!(refused(&line, &cycle).contains("is no loop"));
}

/// Traces of random shape and extreme numbers neither panic nor take long.
#[test]
fn random_traces_are_prepared_or_refused() {
    let is_long = std::env::var_os("FRETWORK_TEST_LONG").is_some();
    let stream = Stream::new(39);
    let (mut good, count) = (0, if is_long { 50_000 } else { 200 });
    for case in 0..count {
        let own = stream.child(case);
        let rows = 30 + own.below(0, 200);
        let scale = 10f64.powi(own.below(1, 40) as i32 - 20);
        let mut x = 0.0;
        let row = |place: u64| {
            x += 1.0 + own.below(3 * place + 5, 3) as f64;
            let step = [0.0, -scale, scale * x, normal(own, place)][own.below(2, 4) as usize];
            let z = step * f64::from(u8::from(own.below(3 * place + 6, 10) < own.below(3, 10)));
            format!("{x};{z:e}\n")
        };
        let text = "x [um];z [m]\n".to_owned() + &(0..rows).map(row).collect::<String>();
        for prepare in [Prepare::Trace, Prepare::Half, Prepare::Loop] {
            let end = 1e-6 * x;
            let mut is_good = false;
            for scar in [None, Some([0.2 * end, 0.8 * end]), Some([0.4 * end, 0.5 * end])] {
                for up in [None, Some(Up::In), Some(Up::Out)] {
                    let wanted = Wanted { prepare, up, scar, ..TRACE };
                    is_good |= read(text.as_bytes(), &wanted).is_ok();
                }
            }
            good += u64::from(is_good);
        }
    }
    assert!(5 * good > count, "{good}");
}
