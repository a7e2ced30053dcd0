//! Checks against published results. The inputs are the files of `examples/literature`, which also names the sources
//! and licences.

use serde_json::{Value, json};

use super::known::run;
use super::page::{Check, Section};
use fretwork_engine::outcome::Outcome;

const CONTACT: &str = "CONTACT";
const BALL: &str = include_str!("../../../examples/literature/contact-cattaneo.json");
const SPHERES: &str = include_str!("../../../examples/literature/contact-catt-to-cart.json");

/// Slip on rings of the ball: the radius in mm, the slip in µm by the program CONTACT, and the slip in µm by the closed
/// form.
const RINGS: [(f64, f64, f64); 6] = [
    (0.596_28, 0.286, 0.2747),
    (0.666_67, 0.626, 0.6255),
    (0.754_25, 1.18, 1.1815),
    (0.8, 1.51, 1.5179),
    (0.894_43, 2.301, 2.3034),
    (0.942_81, 2.743, 2.7509),
];
/// Slip by CONTACT: the radius in mm, and the slip along and across the motion in µm.
const DIRECTIONS: [(f64, f64, f64); 4] = [
    (0.533_33, 0.0399, 0.0789),
    (0.666_67, 0.488, 0.767),
    (0.8, 1.21, 1.81),
    (0.933_33, 2.15, 3.13),
];

const FOUVRY: &str = "Fouvry et al. 2007";
/// The amplitude of each test in µm, and its job body.
const STROKES: [(u32, &str); 2] = [
    (50, include_str!("../../../examples/literature/fouvry-2007-50um.json")),
    (100, include_str!("../../../examples/literature/fouvry-2007-100um.json")),
];
const MEASURED: &str = include_str!("../../../examples/literature/fouvry-2007.csv");
/// The energy wear coefficient of TiC in µm³/J.
const COEFFICIENT: f64 = 415.1;
/// The energy in J at which the depth was measured, and the range of the depth in µm.
const DEPTH_AT: f64 = 263.0;
const DEPTHS: (f64, f64) = (1.05, 1.4);

const PETEGHEM: &str = include_str!("../../../examples/literature/van-peteghem-2011.csv");

pub fn sections() -> Vec<Section> {
    vec![ball(), spheres(), gross_slip(), coefficients()]
}

/// The scenario in a job body.
fn scenario(body: &str) -> Option<Value> {
    Some(serde_json::from_str::<Value>(body).ok()?["scenario"].take())
}

fn ball() -> Section {
    Section::of("CONTACT, ball on a flat", |section| {
        let outcome = run(&scenario(BALL)?)?;
        let pressed = 1e6 * normal_energy(&outcome);
        section.checks.push(beside("normal elastic energy, µJ", (73.5, 73.5632), pressed));
        first_loading(
            section,
            &outcome,
            [
                (3.218, 3.21839),
                (8.155, 8.17241),
                (19.98, 20.0),
                (4.393, 4.39048),
                (2.75, 2.75545),
                (85.25, 85.3365),
            ],
        );
        let profiles = outcome.profiles?;
        let slip =
            |mm: f64| Some(1e6 * between(&profiles.radius, profiles.slip.first()?, 1e-3 * mm)?);
        for (radius, contact, closed) in RINGS {
            let what = format!("mean slip at r = {radius} mm, µm");
            section.checks.push(beside(what, (contact, closed), slip(radius)?));
        }
        for (radius, along, across) in DIRECTIONS {
            for (direction, contact) in [("along", along), ("across", across)] {
                let what = format!("slip {direction} the motion at r = {radius} mm, µm");
                section.checks.push(Check::reported(what, CONTACT, contact, slip(radius)?));
            }
        }
        Some(())
    })
}

fn spheres() -> Section {
    Section::of("CONTACT, two spheres", |section| {
        first_loading(
            section,
            &run(&scenario(SPHERES)?)?,
            [
                (0.124, 0.124_049),
                (17.74, 17.7458),
                (72.58, 72.5921),
                (0.018_34, 0.018_338_9),
                (0.1261, 0.127_363),
                (14.7, 14.6988),
            ],
        );
        Some(())
    })
}

/// Compares a value with that of CONTACT. CONTACT differs from the closed form because its elements are coarse, so this
/// difference is the expected error.
fn beside(what: impl Into<String>, (contact, closed): (f64, f64), value: f64) -> Check {
    let number = Check::reported(what, CONTACT, contact, value);
    Check { expected: closed / contact - 1.0, accepted: Some(3e-3), ..number }
}

/// ∫F dd in J. F is proportional to d^(3/2).
fn normal_energy(outcome: &Outcome) -> f64 {
    0.4 * outcome.scales.normal_force * outcome.scales.indentation_depth
}

/// Compares the state after the first loading. Each pair `known` is the value of CONTACT and that of the closed form.
fn first_loading(section: &mut Section, outcome: &Outcome, known: [(f64, f64); 6]) {
    let Outcome { scales, unworn, .. } = outcome;
    let (force, shift, loss) = (unworn.tangential_force, unworn.amplitude, unworn.energy_per_cycle);
    // By Masing's rule a cycle loses four times the energy of the first loading. The first loading takes
    // the work ∫Q dU = QU/2 + W/8.
    let work = 0.25 * loss;
    let elastic = normal_energy(outcome) + 0.5 * force * shift + 0.125 * loss - work;
    let found = [
        ("Q, N", force),
        ("shift, µm", 1e6 * shift),
        ("approach, µm", 1e6 * scales.indentation_depth),
        ("largest p, MPa", 1e-6 * unworn.peak_pressure),
        ("friction work, µJ", 1e6 * work),
        ("elastic energy, µJ", 1e6 * elastic),
    ];
    let checks =
        found.into_iter().zip(known).map(|((what, value), known)| beside(what, known, value));
    section.checks.extend(checks);
}

/// A run of the test: dissipated energy in J, and volume in µm³ and depth in µm of the flat.
struct Worn {
    energy: Vec<f64>,
    volume: Vec<f64>,
    depth: Vec<f64>,
}

impl Worn {
    fn of(request: &Value) -> Option<Self> {
        let Outcome { history, bodies: [_, flat], .. } = run(request)?;
        Some(Self {
            energy: history.dissipated_energy,
            volume: flat.wear_volume?.iter().map(|v| 1e18 * v).collect(),
            depth: flat.wear_depth?.iter().map(|w| 1e6 * w).collect(),
        })
    }

    /// V/ΣW at the last output cycle.
    fn slope(&self) -> Option<f64> {
        Some(self.volume.last()? / self.energy.last()?)
    }

    /// Volume and depth of the flat at the output cycle with this dissipated energy.
    fn at(&self, energy: f64) -> Option<(f64, f64)> {
        let row = self.energy.iter().position(|found| (found / energy - 1.0).abs() < 1e-6)?;
        Some((self.volume[row], self.depth[row]))
    }
}

fn gross_slip() -> Section {
    Section::of("Ball in gross slip", |section| {
        let (low, high) = DEPTHS;
        let middle = 0.5 * (low + high);
        for (stroke, body) in STROKES {
            let mut request = scenario(body)?;
            let worn = Worn::of(&request)?;
            let what = format!("U = {stroke} µm: V/ΣW, µm³/J");
            section.check(what, FOUVRY, COEFFICIENT, worn.slope()?, 1e-3);
            request["friction"] = json!(0.25);
            let what = format!("U = {stroke} µm, μ = 0.25: V/ΣW, µm³/J");
            section.check(what, FOUVRY, COEFFICIENT, Worn::of(&request)?.slope()?, 1e-3);
            let what = format!("U = {stroke} µm: depth at {DEPTH_AT} J, µm");
            let (_, depth) = worn.at(DEPTH_AT)?;
            section.check(what, FOUVRY, middle, depth, high / middle - 1.0);
        }
        let worn = Worn::of(&scenario(STROKES[0].1)?)?;
        let mut differences = Vec::new();
        for (energy, measured) in points(MEASURED)? {
            let (volume, _) = worn.at(energy)?;
            differences.push(1e-4 * (volume - measured));
            let what = format!("V at {energy} J, 10⁴ µm³");
            section.checks.push(Check::reported(what, FOUVRY, 1e-4 * measured, 1e-4 * volume));
        }
        let count = differences.len() as f64;
        let mean = differences.iter().sum::<f64>() / count;
        let square = differences.iter().map(|difference| difference * difference).sum::<f64>();
        for (what, value) in [("mean", mean), ("root mean square", (square / count).sqrt())] {
            let what = format!("difference of V, {what}, 10⁴ µm³");
            section.checks.push(Check::reported(what, FOUVRY, 0.0, value));
        }
        Some(())
    })
}

fn coefficients() -> Section {
    Section::of("Energy wear coefficients", |section| {
        for (what, source, published, measured) in [
            ("TiC coating", FOUVRY, COEFFICIENT, MEASURED),
            ("five tests at 5 Hz", "van Peteghem et al. 2011", 97_500.0, PETEGHEM),
        ] {
            let points = points(measured)?;
            let sum = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>();
            let slope =
                sum(|(energy, volume)| energy * volume) / sum(|(energy, _)| energy * energy);
            let what = format!("{what}: α, µm³/J");
            section.checks.push(Check::reported(what, source, published, slope));
        }
        Some(())
    })
}

/// Dissipated energy in J and wear volume in µm³, from a CSV file with comments and a header.
fn points(csv: &str) -> Option<Vec<(f64, f64)>> {
    let rows = csv.lines().filter(|line| !line.starts_with('#')).skip(1);
    let point = |row: &str| {
        let (energy, volume) = row.split_once(',')?;
        Some((energy.parse().ok()?, volume.parse().ok()?))
    };
    rows.map(point).collect()
}

/// The value at `at` on the straight lines between points with ascending x; none beyond them.
fn between(x: &[f64], y: &[f64], at: f64) -> Option<f64> {
    let i = x.windows(2).position(|pair| (pair[0]..=pair[1]).contains(&at))?;
    Some(y[i] + (y[i + 1] - y[i]) * (at - x[i]) / (x[i + 1] - x[i]))
}
