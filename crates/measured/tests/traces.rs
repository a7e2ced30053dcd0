//! Traces with known tilt, offset, noise and radius, and with the scar of an engine's run.

use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use fretwork_measured::{Measured, Prepare, Wanted, read};
use fretwork_random::Stream;
use serde_json::{Value, json};

const TRACE: Wanted<'_> =
    Wanted { x: None, y: None, prepare: Prepare::Trace, level: true, centre: true };
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

/// A normal random number, from twelve uniform ones.
fn normal(stream: Stream, place: u64) -> f64 {
    let uniform = |at| stream.at(12 * place + at) as f64 / 2f64.powi(64);
    (0..12).map(uniform).sum::<f64>() - 6.0
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
    for trace in [
        Trace { noise: 0.0, ..BALL },
        BALL,
        Trace { noise: 100e-9, ..BALL },
        Trace { noise: 500e-9, ..BALL },
        Trace { radius: 0.0, ..BALL },
        Trace { radius: 3e-3, ..BALL },
        Trace { radius: 3e-3, tilt: 0.03, ..BALL },
        Trace { points: 100, ..BALL },
        Trace { points: 60_000, ..BALL },
    ] {
        let most = accuracy(&scar, trace);
        println!(
            "{:e} {:e} {} {}: radius {:.1e}, axis {:.1e} m, tilt {:.1e}, depth rms {:.1e} m, largest {:.1e} m, edge {:.1e} m",
            trace.radius,
            trace.noise,
            trace.tilt,
            trace.points,
            most[0],
            most[1],
            most[2],
            most[3],
            most[4],
            most[5]
        );
    }
}

#[test]
fn spikes() {
    let scar = Scar::of_the_engine();
    let text = BALL.file(&scar);
    let lines: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(at, line)| {
            if at == 100 || at == 903 || at == 400 {
                let (x, z) = line.split_once(';').unwrap();
                let z: f64 = z.replace(',', ".").parse().unwrap();
                format!("{x};{}", (z + 5.0).to_string().replace('.', ","))
            } else {
                line.to_owned()
            }
        })
        .collect();
    let measured = read(lines.join("\n").as_bytes(), &TRACE).unwrap();
    println!("{:#?} {:?}", measured.notes, errors(&measured, &scar));
    for wanted in [Wanted { level: false, ..TRACE }, Wanted { centre: false, ..TRACE }] {
        let measured = read(text.as_bytes(), &wanted).unwrap();
        println!("{:#?} {:?}", measured.notes, errors(&measured, &scar));
        println!("{:?}", &numbers(&measured.prepared["indenter"]["height"])[..5]);
    }
    let half = Trace { axis: 0.0, tilt: 0.0, from: 0.0, points: 500, ..BALL }.file(&scar);
    let measured = read(half.as_bytes(), &Wanted { prepare: Prepare::Half, ..TRACE }).unwrap();
    println!("{:#?} {:?}", measured.notes, errors(&measured, &scar));
    println!("{:?}", read(half.as_bytes(), &TRACE).map(|measured| measured.notes));
    let unworn = read(BALL.file(&Scar(vec![0.0, 1.0], vec![0.0, 0.0])).as_bytes(), &TRACE).unwrap();
    println!("{:#?}", unworn.notes);
    println!("{:?}", numbers(&unworn.prepared["indenter"]["height"]).len());
}
