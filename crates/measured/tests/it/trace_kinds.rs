//! Random traces of many kinds, whose removed volume is known, and traces that must be refused.
//!
//! With `FRETWORK_TEST_LONG`, 1 000 traces are made, otherwise 100.

use std::f64::consts::PI;
use std::fmt::Write as _;

use fretwork_measured::{Measured, Prepare, Up, Wanted, read};
use fretwork_random::Random;
use serde_json::Value;

const TRACE: Wanted<'_> = Wanted::of(Prepare::Trace);

/// Where material is removed or added. Lengths are in µm.
#[derive(Debug, Clone, Copy)]
struct Part {
    kind: Kind,
    middle: f64,
    half: f64,
    /// The greatest height, below 0 where material is removed.
    height: f64,
    /// How much deeper the right side is than the left one.
    skew: f64,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// A parabola: a flat worn on a ball, or a ball pressed into a plane.
    Round,
    /// A flat bottom with steep sides.
    Flat,
    /// Deeper near the ends than in the middle.
    Ring,
    /// A hump with smooth ends.
    Hump,
    /// A flat bottom between two steps.
    Box,
    /// Two planes that meet at an edge.
    Edge,
    /// Nearly flat in the middle: a fault of the form.
    Quartic,
}

impl Part {
    fn at(&self, x: f64) -> f64 {
        let u = (x - self.middle) / self.half;
        if u.abs() >= 1.0 {
            return 0.0;
        }
        let shape = match self.kind {
            Kind::Round => 1.0 - u * u,
            Kind::Flat => 1.0 - u.powi(8),
            Kind::Ring => (1.0 - u * u) * (0.4 + 2.4 * u * u) / 0.817,
            Kind::Hump => (1.0 - u * u) * (1.0 - u * u),
            Kind::Box => 1.0,
            Kind::Edge => 1.0 - u.abs(),
            Kind::Quartic => 1.0 - u.powi(4),
        };
        self.height * shape * (1.0 + self.skew * u)
    }

    /// The volume about an axis: each side is half of a body of revolution.
    fn volume(&self, axis: f64) -> f64 {
        let steps = 4000;
        let width = 2.0 * self.half / f64::from(steps);
        let x = |at| self.middle - self.half + (f64::from(at) + 0.5) * width;
        (0..steps).map(|at| PI * (x(at) - axis).abs() * self.at(x(at)) * width).sum()
    }

    fn extreme(&self) -> f64 {
        (0..400)
            .map(|at| self.at(self.middle + self.half * (f64::from(at) / 200.0 - 1.0)).abs())
            .fold(0.0, f64::max)
    }
}

/// What is to be done with a trace.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Verdict {
    Sound,
    TwoScars,
    Step,
    Bump,
}

/// A trace, and the truth about it. Lengths are in µm.
#[derive(Debug)]
struct Made {
    verdict: Verdict,
    length: f64,
    count: usize,
    /// The radius of the surface; infinite for a plane, below 0 for a bore.
    radius: f64,
    /// The angle by which the specimen is turned, and by which the instrument turned the trace back.
    turned: f64,
    levelled: bool,
    noise: f64,
    wave: [f64; 3],
    parts: Vec<Part>,
    /// The place and the height of a step of the surface.
    step: [f64; 2],
    /// The share of the depth below which the range ends.
    clipped: Option<f64>,
    /// The number of drop-outs, and what is written for them.
    dropped: (usize, f64),
    seed: u64,
}

fn text(rows: impl IntoIterator<Item = [f64; 2]>) -> String {
    rows.into_iter().fold("x [um],z [um]\n".to_owned(), |mut text, [x, z]| {
        writeln!(text, "{x:.4},{z:.5}").unwrap();
        text
    })
}

impl Made {
    fn of(seed: u64) -> Self {
        let draw = &mut Random::new(seed);
        let chance = |draw: &mut Random, share: f64| draw.between(0.0, 1.0) < share;
        let length = draw.log_between(800.0, 4000.0);
        let count = draw.log_between(300.0, 2500.0) as usize;
        let noise = draw.log_between(0.005, 0.2);
        let round = draw.between(0.0, 1.0);
        // A plane, a ball, a cylinder of a larger radius, or a bore.
        let radius = match round {
            _ if round < 0.4 => f64::INFINITY,
            _ if round < 0.7 => draw.log_between(3000.0, 20_000.0),
            _ if round < 0.92 => draw.log_between(10_000.0, 100_000.0),
            _ => -draw.log_between(10_000.0, 50_000.0),
        };
        let half = length * draw.between(0.08, 0.28);
        let reach = 0.5 * length - 0.14 * length - half;
        let middle = 0.5 * length + reach * draw.between(-1.0, 1.0);
        let kind = draw.one_of(&[Kind::Round, Kind::Flat, Kind::Ring, Kind::Hump]);
        let depth = draw.log_between(1.0, 20.0).max(20.0 * noise);
        let skew = if chance(draw, 0.15) { draw.one_of(&[-0.5, -0.25, 0.25, 0.5]) } else { 0.0 };
        let mut parts = vec![Part { kind, middle, half, height: -depth, skew }];
        let hump =
            |middle, half, height| Part { kind: Kind::Hump, middle, half, height, skew: 0.0 };
        // Ridges beside the scar.
        let sides: &[f64] = match draw.between(0.0, 1.0) {
            it if it < 0.25 => &[-1.0, 1.0],
            it if it < 0.35 => &[1.0],
            _ => &[],
        };
        for side in sides {
            let width = draw.between(0.03, 0.12) * half;
            parts.push(hump(
                middle + side * (half + width),
                width,
                depth * draw.between(0.05, 0.5),
            ));
        }
        // A lump on the surface.
        let outside = [middle - half - 0.1 * length, length - middle - half - 0.1 * length];
        if sides.is_empty() && chance(draw, 0.15) {
            let width = 0.25 * outside[0].max(outside[1]).min(0.2 * half);
            let at = draw.between(1.2, 2.0) * width;
            let place =
                if outside[0] > outside[1] { middle - half - at } else { middle + half + at };
            parts.push(hump(place, width, depth * draw.between(0.1, 0.8)));
        }
        let wave = if chance(draw, 0.4) {
            [
                draw.log_between(0.01, 0.2).min(depth / 20.0),
                draw.log_between(0.03, 0.15) * length,
                draw.between(0.0, 6.0),
            ]
        } else {
            [0.0, 1.0, 0.0]
        };
        let most = if radius.is_finite() { 0.015 } else { 0.05 };
        let mut made = Self {
            verdict: Verdict::Sound,
            length,
            count,
            radius,
            turned: draw.between(-most, most),
            levelled: chance(draw, 0.4),
            noise,
            wave,
            parts,
            step: [0.0, 0.0],
            clipped: None,
            dropped: (0, 0.0),
            seed,
        };
        made.spoil(draw, outside[1]);
        made
    }

    /// Some traces have faults of the instrument, or must be refused.
    fn spoil(&mut self, draw: &mut Random, right: f64) {
        let made = self;
        let Part { middle, half, height, .. } = made.parts[0];
        let (length, depth) = (made.length, -height);
        let kind = draw.between(0.0, 1.0);
        if kind < 0.03 {
            made.verdict = Verdict::TwoScars;
            let half = length * draw.between(0.06, 0.1);
            let part = |middle| Part { middle, half, ..made.parts[0] };
            made.parts = vec![part(0.3 * length), part(0.7 * length)];
        } else if kind < 0.06 {
            made.verdict = Verdict::Step;
            let place = draw.one_of(&[middle, middle + half + 0.5 * right]);
            made.step = [place, draw.one_of(&[-1.0, 1.0]) * depth * draw.between(0.1, 0.4)];
            made.wave[0] = 0.0;
            made.noise = made.noise.min(depth / 200.0);
        } else if kind < 0.09 {
            made.verdict = Verdict::Bump;
            made.radius = f64::INFINITY;
            made.parts = vec![Part { kind: Kind::Hump, middle, half, height: depth, skew: 0.0 }];
        } else if kind < 0.13 {
            made.clipped = Some(draw.between(0.6, 0.95));
            (made.radius, made.turned) = (f64::INFINITY, 0.0);
        } else if kind < 0.21 {
            made.dropped =
                (draw.between(4.0, 60.0) as usize, draw.one_of(&[0.0, 0.0, -9999.0, -32_768.0]));
        }
    }

    fn rows(&self) -> Vec<[f64; 2]> {
        let draw = &mut Random::new(self.seed ^ 0xf00d);
        let apex = 0.5 * self.length;
        let row = |place: usize| {
            let x = self.length * place as f64 / (self.count - 1) as f64;
            // The circle turned about its apex is the circle with its apex shifted, and lower.
            let shift = self.turned * self.radius;
            let bow = |x: f64| {
                if self.radius.is_finite() {
                    let r = self.radius.abs();
                    (r - (r * r - x * x).sqrt()).copysign(self.radius)
                } else {
                    self.turned * x
                }
            };
            let shift = if self.radius.is_finite() { shift } else { 0.0 };
            let mut z = -bow(x - apex - shift);
            if self.step[1] != 0.0 && x > self.step[0] {
                z += self.step[1];
            }
            z += self.parts.iter().map(|part| part.at(x)).sum::<f64>();
            if let Some(share) = self.clipped {
                z = z.max(self.parts[0].height * share);
            }
            z += self.wave[0] * libm::sin(2.0 * PI * x / self.wave[1] + self.wave[2]);
            [x, z]
        };
        let mut rows: Vec<[f64; 2]> = (0..self.count).map(row).collect();
        let floor = self.clipped.map(|share| self.parts[0].height * share);
        for row in &mut rows {
            row[1] += self.noise * (0..12).map(|_| draw.between(-0.5, 0.5)).sum::<f64>();
            if let Some(floor) = floor {
                row[1] = row[1].max(floor);
            }
        }
        if self.levelled && self.clipped.is_none() {
            let mean = |of: &dyn Fn(&[f64; 2]) -> f64| {
                rows.iter().map(of).sum::<f64>() / rows.len() as f64
            };
            let (x, z) = (mean(&|row| row[0]), mean(&|row| row[1]));
            let slope =
                mean(&|row| (row[0] - x) * (row[1] - z)) / mean(&|row| (row[0] - x) * (row[0] - x));
            for row in &mut rows {
                row[1] -= z + slope * (row[0] - x);
            }
        }
        let mut left = self.dropped.0;
        while left > 0 {
            let part = self.parts[0];
            let from = part.middle + part.half * draw.between(-1.2, 1.1);
            let begin = (from / self.length * self.count as f64) as usize;
            let run = (draw.between(1.0, 9.0) as usize).min(left);
            for row in rows.iter_mut().skip(begin).take(run) {
                row[1] = self.dropped.1;
            }
            left -= run;
        }
        rows
    }

    fn file(&self) -> String {
        text(self.rows())
    }

    fn axis(&self) -> f64 {
        self.parts[0].middle
    }

    /// The removed volume about the axis, in m³.
    fn removed(&self) -> f64 {
        -self.parts[0].volume(self.axis()) * 1e-18
    }
}

fn answer(made: &Made, wanted: &Wanted<'_>) -> Result<Measured, String> {
    read(made.file().as_bytes(), wanted).map_err(|faults| faults.0[0].detail.clone())
}

/// How far the answer is off: the removed volume, and twice its stated error, as shares; the depth in units of what is
/// accepted.
fn off(made: &Made, measured: &Measured) -> [f64; 3] {
    let trace = &measured.prepared["trace"];
    let number = |value: &Value| value.as_f64().unwrap_or(f64::NAN);
    let pair = |name: &str| [number(&trace[name]["value"]), number(&trace[name]["error"])];
    let [mut volume, error] = pair("volume_removed");
    let numbers = |name: &str| -> Vec<f64> {
        serde_json::from_value(measured.prepared["data"][name].clone()).unwrap_or_default()
    };
    let (radius, depth) = (numbers("radius"), numbers("depth"));
    let mut deepest = pair("depth")[0];
    if volume.is_nan() {
        let rings = radius.windows(2).zip(depth.windows(2));
        volume = rings.map(|(r, d)| PI * (r[0] + r[1]) * (r[1] - r[0]) * 0.5 * (d[0] + d[1])).sum();
        deepest = depth.iter().copied().fold(0.0, f64::max);
    }
    let sigma = number(&measured.prepared["data"]["sigma"]);
    let truth = made.parts[0].extreme() * 1e-6;
    [
        volume / made.removed() - 1.0,
        2.0 * error / made.removed(),
        (deepest - truth).abs() / (0.02 * truth + 3.0 * sigma),
    ]
}

/// Whether the answer is right, and whether it is far off without a note that names the cause.
fn judged(made: &Made, measured: &Measured) -> (bool, bool) {
    let [volume, error, depth] = off(made, measured);
    // A clipped depth is a lower limit.
    let is_deep = depth <= 1.0 || made.clipped.is_some() && depth.is_finite();
    let told = ["are clipped", "volume is uncertain"];
    let is_told = measured.notes.iter().any(|note| told.iter().any(|told| note.contains(told)));
    let is_near = volume.abs() <= 0.1;
    (volume.abs() <= 0.03_f64.max(error) && is_deep, !is_near && !is_told)
}

/// With the ends of its scar, a trace with two scars or a step has the right volume, too.
fn is_right_with_ends(made: &Made) -> bool {
    let Part { middle, half, .. } = made.parts[0];
    let reach = if made.verdict == Verdict::TwoScars { 1.25 } else { 1.05 } * half;
    let scar = Some([1e-6 * (middle - reach), 1e-6 * (middle + reach)]);
    answer(made, &Wanted { scar, ..TRACE }).is_ok_and(|measured| {
        let [volume, error, _] = off(made, &measured);
        volume.abs() <= 0.03_f64.max(error)
    })
}

#[test]
fn random_traces_have_the_volumes_of_which_they_were_made() {
    let is_long = std::env::var_os("FRETWORK_TEST_LONG").is_some();
    let count = if is_long { 1000 } else { 100 };
    let (mut right, mut refused, mut silent, mut chosen, mut doubtful) = (0, 0, 0, 0, 0);
    for seed in 0..count {
        let made = Made::of(seed);
        let found = answer(&made, &TRACE);
        let told = |words: &str| found.as_ref().is_err_and(|detail| detail.contains(words));
        let is_right = match (made.verdict, &found) {
            (Verdict::Sound, Ok(measured)) => {
                let (is_right, is_silent) = judged(&made, measured);
                silent += u64::from(is_silent);
                is_right
            }
            (Verdict::Sound, Err(_)) => {
                refused += 1;
                false
            }
            (Verdict::Bump, _) => told("write up=in"),
            (Verdict::TwoScars | Verdict::Step, _) => {
                doubtful += 1;
                let is_right = is_right_with_ends(&made);
                chosen += u64::from(is_right);
                if !is_right {
                    println!("with the ends of the scar: {made:?}");
                }
                told("such as scar=") || told("Choose one with scar=")
            }
        };
        right += u64::from(is_right);
        if !is_right {
            let errors = found.map(|measured| off(&made, &measured));
            println!("{errors:?} of {made:?}");
        }
    }
    println!(
        "{right} of {count} right, {refused} sound ones refused, {silent} far off without a note; {chosen} of {doubtful} \
         right with the ends of the scar"
    );
    assert!(20 * right >= 19 * count, "{right} of {count}");
    assert!(100 * refused <= 3 * count, "{refused} of {count} were refused");
    assert_eq!(silent, 0);
    assert!(10 * chosen >= 9 * doubtful, "{chosen} of {doubtful}");
}

/// A scar in the middle of a trace.
const SCAR: Part = Part { kind: Kind::Round, middle: 700.0, half: 210.0, height: -4.0, skew: 0.0 };

fn made(radius: f64, parts: &[Part]) -> Made {
    Made {
        verdict: Verdict::Sound,
        length: 1400.0,
        count: 701,
        radius,
        turned: 0.0,
        levelled: false,
        noise: 0.015,
        wave: [0.0, 1.0, 0.0],
        parts: parts.to_vec(),
        step: [0.0, 0.0],
        clipped: None,
        dropped: (0, 0.0),
        seed: 59,
    }
}

fn refusal(made: &Made) -> String {
    answer(made, &TRACE).unwrap_err()
}

#[test]
fn ridges_and_a_lump_do_not_change_what_was_removed() {
    let ridge = |side: f64| {
        let middle = SCAR.middle + side * 1.1 * SCAR.half;
        Part { kind: Kind::Hump, middle, half: 0.1 * SCAR.half, height: 0.8, skew: 0.0 }
    };
    let ridges = made(f64::INFINITY, &[SCAR, ridge(-1.0), ridge(1.0)]);
    let measured = answer(&ridges, &TRACE).unwrap();
    assert!(off(&ridges, &measured)[0].abs() < 0.01, "{:?}", measured.notes);
    let number = |measured: &Measured, name: &str| {
        measured.prepared["trace"][name]["value"].as_f64().unwrap()
    };
    // The area of such a hump is 16/15 of its height and half-width.
    let area = 2.0 * 16.0 / 15.0 * 0.8 * 0.1 * SCAR.half * 1e-12;
    assert!((number(&measured, "area_added") / area - 1.0).abs() < 0.05, "{:?}", measured.notes);
    assert!(number(&measured, "volume_added") > 0.0);
    assert!(measured.prepared["trace"]["sides"].is_null());
    let lump = Part { height: 2.5, ..ridge(1.3) };
    let ball = made(6000.0, &[SCAR, lump]);
    let measured = answer(&ball, &TRACE).unwrap();
    assert!(off(&ball, &measured)[0].abs() < 0.01, "{:?}", measured.notes);
    assert!((measured.prepared["trace"]["centre"].as_f64().unwrap() - 700e-6).abs() < 1e-6);
    // A lump inside hides a part of one side. The other side shows the whole volume.
    let inside = made(6000.0, &[SCAR, Part { middle: 700.0 + 0.5 * SCAR.half, ..lump }]);
    let measured = answer(&inside, &TRACE).unwrap();
    let left = &measured.prepared["trace"]["sides"]["left"]["volume_removed"]["value"];
    assert!((left.as_f64().unwrap() / inside.removed() - 1.0).abs() < 0.02, "{left}");
    let [volume, error, _] = off(&inside, &measured);
    assert!(volume < -0.02 && -volume < error, "{volume} {error}");
}

#[test]
fn the_sign_of_heights_is_not_guessed() {
    let bump = made(f64::INFINITY, &[Part { kind: Kind::Hump, height: 1.5, ..SCAR }]);
    let told = refusal(&bump);
    assert!(told.contains("more added than removed") && told.contains("write up=in"), "{told}");
    let turned = answer(&bump, &Wanted { up: Some(Up::In), ..TRACE }).unwrap();
    let volume = turned.prepared["trace"]["volume_removed"]["value"].as_f64().unwrap();
    assert!((volume / -bump.removed() - 1.0).abs() < 0.01, "{volume}");
    // A ball whose heights count into it looks like a hollow surface with a hump. Its curvature decides.
    let into = made(-6000.0, &[Part { height: 1.5, ..SCAR }]);
    let measured = answer(&into, &TRACE).unwrap();
    assert!(measured.notes.iter().any(|note| note.contains("they were turned")));
    let out = answer(&into, &Wanted { up: Some(Up::Out), ..TRACE });
    assert!(out.is_err_and(|told| told.contains("write up=in")));
}

#[test]
fn one_scar_is_chosen() {
    let at = |middle| Part { middle, half: 110.0, ..SCAR };
    let two = made(f64::INFINITY, &[at(400.0), at(1000.0)]);
    let told = refusal(&two);
    assert!(told.contains("has two scars or more. Choose one with scar="), "{told}");
    for middle in [400e-6, 1000e-6] {
        let scar = Some([middle - 130e-6, middle + 130e-6]);
        let measured = answer(&two, &Wanted { scar, ..TRACE }).unwrap();
        let volume = measured.prepared["trace"]["volume_removed"]["value"].as_f64().unwrap();
        assert!((volume / two.removed() - 1.0).abs() < 0.01, "{:?}", measured.notes);
    }
    let narrow = answer(&two, &Wanted { scar: Some([330e-6, 530e-6]), ..TRACE }).unwrap();
    let told: Vec<_> =
        narrow.notes.iter().filter(|note| note.contains("an end of scar=")).collect();
    assert!(told.len() == 1 && told[0].contains("x = 328"), "{told:?}");
    // Partial slip wears a ring, whose middle sticks.
    let ring = made(8000.0, &[at(500.0), at(900.0)]);
    let measured = answer(&ring, &TRACE).unwrap();
    assert!(measured.notes.iter().any(|note| note.contains("one ring")), "{:?}", measured.notes);
    let truth: f64 = ring.parts.iter().map(|part| -part.volume(700.0) * 1e-18).sum();
    let volume = measured.prepared["trace"]["volume_removed"]["value"].as_f64().unwrap();
    assert!((volume / truth - 1.0).abs() < 0.01, "{volume} {truth}");
    for (place, radius) in [(700.0, f64::INFINITY), (1100.0, f64::INFINITY), (750.0, 20_000.0)] {
        let stepped = Made { step: [place, 0.4], ..made(radius, &[SCAR]) };
        let told = refusal(&stepped);
        assert!(told.contains("rises by 0.") && told.contains("such as scar="), "{told}");
        let scar = Some([480e-6, 920e-6]);
        let measured = answer(&stepped, &Wanted { scar, ..TRACE }).unwrap();
        let [volume, error, _] = off(&stepped, &measured);
        assert!(
            volume.abs() < 0.01_f64.max(error),
            "{place} {volume} {error} {:?}",
            measured.notes
        );
    }
    for scar in [[0.1, 0.2], [690e-6, 692e-6], [-1.0, 1.0]] {
        let told = answer(&two, &Wanted { scar: Some(scar), ..TRACE }).unwrap_err();
        assert!(told.contains("Write other ends"), "{told}");
    }
    let empty = answer(&two, &Wanted { scar: Some([600e-6, 800e-6]), ..TRACE }).unwrap_err();
    assert!(empty.contains("has no scar in scar=0.6000..0.8000mm"), "{empty}");
}

#[test]
fn the_edge_of_a_sample_beside_a_chosen_scar_is_left_out() {
    let drop = Part { kind: Kind::Box, middle: 1300.0, half: 100.0, height: -60.0, skew: 0.0 };
    let made = made(f64::INFINITY, &[SCAR, drop]);
    let measured = answer(&made, &Wanted { scar: Some([460e-6, 940e-6]), ..TRACE }).unwrap();
    assert!(off(&made, &measured)[0].abs() < 0.01, "{:?}", measured.prepared["trace"]);
}

#[test]
fn wide_ridges_beside_a_chosen_scar_are_added_material() {
    let ridge = |middle| Part { kind: Kind::Hump, middle, half: 105.0, height: 1.0, skew: 0.0 };
    let made = made(f64::INFINITY, &[SCAR, ridge(385.0), ridge(1015.0)]);
    let measured = answer(&made, &Wanted { scar: Some([490e-6, 910e-6]), ..TRACE }).unwrap();
    assert!(off(&made, &measured)[0].abs() < 0.03, "{:?}", measured.prepared["trace"]);
}

#[test]
fn joined_images_are_told() {
    let is_told = |parts: &[Part]| {
        let notes = answer(&made(f64::INFINITY, parts), &TRACE).unwrap().notes;
        notes.iter().any(|note| note.contains("joined images"))
    };
    // An image that lies lower than those beside it.
    let joined = |half, height| Part { kind: Kind::Box, half, height, ..SCAR };
    assert!(is_told(&[SCAR, joined(300.0, -0.5)]));
    assert!(is_told(&[SCAR, joined(150.0, -0.4)]));
    for kind in [Kind::Round, Kind::Flat, Kind::Ring, Kind::Hump] {
        assert!(!is_told(&[Part { kind, ..SCAR }]), "{kind:?}");
    }
}

#[test]
fn filters_and_few_points_are_told() {
    let hump = |middle, half, height| Part { kind: Kind::Hump, middle, half, height, skew: 0.0 };
    let humps = [hump(400.0, 100.0, 0.95), hump(700.0, 200.0, -1.0), hump(1000.0, 100.0, 0.95)];
    let filtered = answer(&made(f64::INFINITY, &humps), &TRACE).unwrap();
    let is_told = |measured: &Measured| {
        measured.notes.iter().any(|note| note.contains("A filter of the instrument"))
    };
    assert!(is_told(&filtered), "{:?}", filtered.notes);
    assert!(!is_told(&answer(&made(f64::INFINITY, &humps[..2]), &TRACE).unwrap()));
    for count in [30, 40, 60] {
        let few = Made { count, ..made(f64::INFINITY, &[SCAR]) };
        let measured = answer(&few, &TRACE).unwrap();
        let depth = &measured.prepared["trace"]["depth"];
        let [value, error] = ["value", "error"].map(|name| 1e6 * depth[name].as_f64().unwrap());
        assert!((value - SCAR.extreme()).abs() < 3.0 * error, "{count}: {value} ± {error}");
    }
}

#[test]
fn levelled_balls_and_faults_of_instruments_are_told() {
    let flat = Part { height: -210.0 * 210.0 / 10_000.0, ..SCAR };
    let levelled = Made { turned: 0.009, levelled: true, ..made(5000.0, &[flat]) };
    let measured = answer(&levelled, &TRACE).unwrap();
    assert!(off(&levelled, &measured)[0].abs() < 0.01, "{:?}", measured.notes);
    assert!(measured.notes.iter().any(|note| note.contains("A line was subtracted")));
    assert!(measured.prepared["indenter"]["radius"].is_array(), "{:?}", measured.notes);
    let clipped = Made { clipped: Some(0.8), ..made(f64::INFINITY, &[SCAR]) };
    let measured = answer(&clipped, &TRACE).unwrap();
    assert!(measured.notes.iter().any(|note| note.contains("points have the lowest height")));
    let [volume, error, _] = off(&clipped, &measured);
    assert!(volume < 0.0 && -volume < error, "{volume} {error}");
    for (value, told) in
        [(0.0, "are drop-outs and were left out"), (-9999.0, "were taken as unknown numbers")]
    {
        let dropped = Made { dropped: (30, value), ..made(f64::INFINITY, &[SCAR]) };
        let measured = answer(&dropped, &TRACE).unwrap();
        assert!(measured.notes.iter().any(|note| note.contains(told)), "{:?}", measured.notes);
        assert!(off(&dropped, &measured)[0].abs() < 0.01, "{:?}", measured.notes);
    }
    // Each position twice, with heights of opposite errors.
    let plain = made(f64::INFINITY, &[SCAR]);
    let rows = plain.rows().into_iter().flat_map(|[x, z]| [[x, z + 0.01], [x, z - 0.01]]);
    let measured = read(text(rows).as_bytes(), &TRACE).unwrap();
    assert!(measured.notes.iter().any(|note| note.starts_with("701 points have the x of")));
    assert!(off(&plain, &measured)[0].abs() < 0.01, "{:?}", measured.notes);
}

/// A height in place of a row, from the rows at both ends and this one.
type Fill<'a> = &'a dyn Fn(&[[f64; 2]]) -> Option<f64>;

/// A trace of [`SCAR`], of which some heights are replaced.
fn replaced(part: Part, from: f64, to: f64, by: Fill<'_>) -> String {
    let rows = made(f64::INFINITY, &[part]).rows();
    let (first, after) =
        (rows.partition_point(|it| it[0] < from), rows.partition_point(|it| it[0] < to));
    let ends = [rows[first - 1], rows[after]];
    let row = |(at, row): (usize, &[f64; 2])| {
        let z =
            if (first..after).contains(&at) { by(&[ends[0], ends[1], *row]) } else { Some(row[1]) };
        z.map(|z| [row[0], z])
    };
    text(rows.iter().enumerate().filter_map(row))
}

/// How many stated errors a size is off.
fn deviation(measured: &Measured, name: &str, truth: f64) -> f64 {
    let size = &measured.prepared["trace"][name];
    (size["value"].as_f64().unwrap() - truth) / size["error"].as_f64().unwrap()
}

#[test]
fn the_errors_contain_what_gaps_hide() {
    let missing = |_: &[[f64; 2]]| None;
    let dropped = |_: &[[f64; 2]]| Some(-50.0);
    let held = |near: &[[f64; 2]]| Some(near[0][1]);
    let line = |near: &[[f64; 2]]| {
        let [[x0, z0], [x1, z1], [x, _]] = [near[0], near[1], near[2]];
        Some(z0 + (z1 - z0) * (x - x0) / (x1 - x0))
    };
    let fills: [Fill<'_>; 4] = [&missing, &dropped, &held, &line];
    for (kind, [from, to]) in
        [Kind::Round, Kind::Flat, Kind::Ring, Kind::Hump].into_iter().flat_map(|kind| {
            [[660.0, 740.0], [640.0, 760.0], [480.0, 560.0], [780.0, 870.0]].map(|it| (kind, it))
        })
    {
        let part = Part { kind, ..SCAR };
        let truth = made(f64::INFINITY, &[part]);
        for fill in fills {
            let measured = read(replaced(part, from, to, fill).as_bytes(), &TRACE).unwrap();
            // A held height that is the lowest one looks as if the range ended there.
            let words = ["gaps without measured heights: from x = ", "are clipped"];
            let told = measured.notes.iter().any(|note| words.iter().any(|it| note.contains(it)));
            assert!(told, "{:?}", measured.notes);
            let area = (0..4000)
                .map(|at| -part.at(490.0 + 0.105 * (f64::from(at) + 0.5)) * 0.105e-12)
                .sum();
            for (name, truth) in [
                ("depth", part.extreme() * 1e-6),
                ("area_removed", area),
                ("volume_removed", truth.removed()),
            ] {
                let off = deviation(&measured, name, truth);
                assert!(
                    off.abs() < 3.0,
                    "{kind:?} {from} {name}: {off} {:?}",
                    measured.prepared["trace"][name]
                );
            }
        }
    }
    for fill in [fills[0], fills[1], fills[3]] {
        let told = read(replaced(SCAR, 600.0, 800.0, fill).as_bytes(), &TRACE).unwrap_err().0[0]
            .detail
            .clone();
        assert!(
            told.contains("has no measured heights from x = ")
                && told.contains("Measure the trace again"),
            "{told}"
        );
    }
}

#[test]
fn planes_without_noise_and_rounded_heights_are_read() {
    for (half, turned, step) in [
        (210.0, 0.0, 0.0),
        (420.0, 0.0, 0.0),
        (210.0, 0.003, 0.0),
        (210.0, 0.0, 0.1),
        (210.0, 0.0, 0.4),
    ] {
        let scar = Part { half, ..SCAR };
        let exact = Made { noise: 0.0, turned, ..made(f64::INFINITY, &[scar]) };
        let rounded = |z: f64| if step > 0.0 { (z / step).round() * step } else { z };
        let rows = exact.rows().into_iter().map(|[x, z]| [x, rounded(z)]);
        let measured = read(text(rows).as_bytes(), &TRACE).unwrap();
        for (name, truth) in [("depth", 4e-6), ("volume_removed", exact.removed())] {
            let error = measured.prepared["trace"][name]["error"].as_f64().unwrap();
            let off = error * deviation(&measured, name, truth);
            assert!(
                off.abs() < 1e-3 * truth + 3.0 * error,
                "{half} {step} {name}: {off} ± {error}"
            );
        }
    }
}

#[test]
fn the_depth_of_noisy_scars_is_not_biased() {
    for kind in [Kind::Round, Kind::Flat, Kind::Ring] {
        let (mut sum, mut far) = (0.0, 0);
        for seed in 0..40 {
            let noisy = Made { noise: 0.8, seed, ..made(f64::INFINITY, &[Part { kind, ..SCAR }]) };
            let measured = answer(&noisy, &TRACE).unwrap();
            let off = deviation(&measured, "depth", noisy.parts[0].extreme() * 1e-6);
            sum += off;
            far += u32::from(off.abs() > 3.0);
        }
        assert!((sum / 40.0_f64).abs() < 1.0 && far <= 1, "{kind:?}: {sum} {far}");
    }
}

#[test]
fn errors_contain_long_waves() {
    for length in [420.0, 600.0] {
        let mut far = 0;
        for seed in 0..40 {
            let wave = [0.2, length, 0.157 * seed as f64];
            let wavy = Made { wave, seed, ..made(f64::INFINITY, &[SCAR]) };
            let off = deviation(&answer(&wavy, &TRACE).unwrap(), "volume_removed", wavy.removed());
            far += u32::from(off.abs() > 3.0);
        }
        assert!(far <= 1, "{length}: {far}");
    }
}

/// A circle through the sides of such a surface does not show what was removed.
#[test]
fn errors_contain_edges_and_faults_of_the_form() {
    for (kind, middle, height) in [
        (Kind::Edge, 700.0, 1.0),
        (Kind::Edge, 700.0, 0.3),
        (Kind::Edge, 700.0, -0.3),
        (Kind::Edge, 600.0, 0.6),
        (Kind::Edge, 800.0, 0.6),
        (Kind::Quartic, 700.0, 0.6),
        (Kind::Quartic, 700.0, 0.3),
        (Kind::Quartic, 700.0, -0.3),
    ] {
        let half = if kind == Kind::Edge { 900.0 } else { 700.0 };
        let form = Part { kind, middle, half, height, ..SCAR };
        let bent = made(f64::INFINITY, &[SCAR, form]);
        let measured = answer(&bent, &TRACE).unwrap();
        let far = [("volume_removed", bent.removed()), ("depth", 4e-6)]
            .map(|(name, truth)| deviation(&measured, name, truth).abs());
        assert!(far.iter().all(|far| *far < 3.0), "{kind:?} {middle} {height}: {far:?}");
        let is_told = measured.notes.iter().any(|note| note.contains("is no plane or circle"));
        let is_far = off(&bent, &measured)[0].abs() > 0.1;
        assert!(is_told || !is_far, "{kind:?} {height}: {:?}", measured.notes);
    }
}

/// Such a wave can look like a part of the scar, so the error cannot always contain it.
#[test]
fn most_waves_that_are_hardly_shorter_than_the_trace_are_told() {
    let (mut far, mut silent) = (0, 0);
    for (radius, kind, height) in [
        (f64::INFINITY, Kind::Round, 0.2),
        (f64::INFINITY, Kind::Ring, 0.4),
        (6000.0, Kind::Round, 0.2),
    ] {
        for seed in 0..40 {
            let draw = &mut Random::new(seed + 1000);
            let wave = [height, 1400.0 * draw.between(0.5, 1.0), draw.between(0.0, 2.0 * PI)];
            let wavy = Made { wave, seed, ..made(radius, &[Part { kind, ..SCAR }]) };
            let Ok(measured) = answer(&wavy, &TRACE) else { continue };
            let is_told = measured.notes.iter().any(|note| note.contains("volume is uncertain"));
            let is_far = off(&wavy, &measured)[0].abs() > 0.1;
            far += u32::from(is_far);
            silent += u32::from(is_far && !is_told);
        }
    }
    assert!(far >= 20 && 4 * silent <= far, "{silent} of {far}");
}

#[test]
fn wide_and_shallow_scars_are_read() {
    let mut refused = 0;
    for (seed, half) in (0..80).zip([490.0, 545.0].into_iter().cycle()) {
        let wide = Part { half, height: -1.5, ..SCAR };
        let wide = Made { noise: 0.07, count: 1401, seed, ..made(f64::INFINITY, &[wide]) };
        match answer(&wide, &TRACE) {
            Ok(measured) => {
                let off = deviation(&measured, "volume_removed", wide.removed());
                assert!(off.abs() < 4.0, "{off}");
            }
            Err(_) => refused += 1,
        }
    }
    assert!(refused <= 1, "{refused}");
    // Roughness hides a shallow scar, until its ends are given.
    let rough = |radius: f64| Made {
        wave: [0.2, 30.0, 1.0],
        noise: 0.1,
        ..made(radius, &[Part { height: -0.25, ..SCAR }])
    };
    let plane = rough(f64::INFINITY);
    assert!(refusal(&plane).contains("plane within its scatter of 0.1"), "{}", refusal(&plane));
    assert!(refusal(&plane).contains("choose it with scar=FROM..TO, such as scar="));
    let ball = answer(&rough(8000.0), &TRACE).unwrap();
    let told =
        |note: &String| note.starts_with("No scar was found") && note.contains("such as scar=");
    assert!(ball.notes.iter().any(told), "{:?}", ball.notes);
    let measured = answer(&plane, &Wanted { scar: Some([490e-6, 910e-6]), ..TRACE }).unwrap();
    let off = deviation(&measured, "volume_removed", plane.removed());
    assert!(off.abs() < 3.0, "{off}");
}

#[test]
fn half_of_a_ring_is_read_however_it_is_tilted() {
    let ring = Part { middle: 1020.0, half: 80.0, ..SCAR };
    let wanted = Wanted { prepare: Prepare::Half, ..TRACE };
    for tilt in [0.0, 0.001, 0.002, -0.002, 0.01, 0.1] {
        let rows = made(f64::INFINITY, &[ring]).rows().into_iter().filter(|row| row[0] >= 700.0);
        let half = text(rows.map(|[x, z]| [x - 700.0, z + tilt * x]));
        let measured = read(half.as_bytes(), &wanted).unwrap();
        let off = deviation(&measured, "volume_removed", -2e-18 * ring.volume(700.0));
        assert!(off.abs() < 3.0, "{tilt}: {off}");
    }
}
