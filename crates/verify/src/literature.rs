//! Checks against published results. The inputs are the files of `examples/literature`, which also names the sources
//! and licences.

use std::f64::consts::LN_2;

use serde_json::{Value, json};

use super::known::run;
use super::page::{Check, Section, TitledSection};
use fretwork_engine::Outcome;
use fretwork_engine::numeric::{linear, root};

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

const LLAVORI: &str = "Llavori 2026";
const MCCOLL: &str = "McColl et al. 2004";
const CYLINDER: &str = include_str!("../../../examples/cylinder-on-flat.json");
/// Points of the worn flat by finite elements, and measured: cycles, x in mm and depth in µm.
const NODES: &str = include_str!("../../../examples/literature/mccoll-2004-finite-elements.csv");
const FLAT: &str = include_str!("../../../examples/literature/mccoll-2004-measured.csv");
/// The scars in these files: the row of the history, and the half-length in mm. By finite elements, it is extrapolated
/// from the two outermost worn nodes of each side.
const SCARS: [(usize, &str, f64); 5] = [
    (1, LLAVORI, 0.1101),
    (2, LLAVORI, 0.1758),
    (3, LLAVORI, 0.2146),
    (4, LLAVORI, 0.2557),
    (4, MCCOLL, 0.29),
];

/// Depth in µm and area in µm² of the worn flat by level sets on a fixed mesh, for each row of the history.
const LEVEL_SETS: [(usize, f64, f64); 4] =
    [(1, 0.378_41, 52.6), (2, 1.131_08, 261.0), (3, 1.814_55, 521.5), (4, 2.713_02, 938.2)];

/// The thickness of the TiC coating in µm, and the energy per area in J/µm² at which it failed.
const COATING: (f64, f64) = (1.6, 2.7e-3);

const APPENDIX: &str = "Fouvry et al. 2017";
/// The columns are test, radius and length in mm, force in N/mm, frequency in Hz, cycles, volume in mm³ and energy in J.
const CYLINDERS: &str = include_str!("../../../examples/literature/fouvry-2017.csv");

const PETEGHEM: &str = "van Peteghem et al. 2011";
/// The columns are number, cycles, frequency in Hz, stroke of the slip in µm, energy in J and volume in µm³.
const TESTS: &str = include_str!("../../../examples/literature/van-peteghem-2011.csv");
const TEST_3: &str = include_str!("../../../examples/literature/van-peteghem-2011-test-3.json");
const TEST_14: &str = include_str!("../../../examples/literature/van-peteghem-2011-test-14.json");

pub const SECTIONS: &[TitledSection] = &[
    ("CONTACT, ball on a flat", ball),
    ("CONTACT, two spheres", spheres),
    ("Ball in gross slip", gross_slip),
    ("Endurance of a coating", endurance),
    ("Cylinder in gross slip", cylinder),
    ("Titanium cylinder in gross slip", titanium),
    ("Titanium cylinders with a held aperture", apertures),
    ("Energy wear coefficients", coefficients),
];

/// The scenario in a job body.
fn scenario(body: &str) -> Option<Value> {
    Some(serde_json::from_str::<Value>(body).ok()?["scenario"].take())
}

fn ball(section: &mut Section) -> Option<()> {
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
    let slip = |mm: f64| Some(1e6 * linear(&profiles.radius, profiles.slip.first()?, 1e-3 * mm)?);
    for (radius, contact, closed) in RINGS {
        let what = format!("mean slip at r = {radius} mm, µm");
        section.checks.push(beside(what, (contact, closed), slip(radius)?));
    }
    for (radius, along, across) in DIRECTIONS {
        for (direction, contact) in [("along", along), ("across", across)] {
            let what = format!("slip {direction} the motion at r = {radius} mm, µm");
            section.check(what, CONTACT, contact, slip(radius)?, None);
        }
    }
    Some(())
}

fn spheres(section: &mut Section) -> Option<()> {
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

/// A run of the test: cycles, dissipated energy in J, and volume in µm³, depth in µm and half-length in mm of the flat.
struct Worn {
    cycles: Vec<f64>,
    energy: Vec<f64>,
    volume: Vec<f64>,
    depth: Vec<f64>,
    half_length: Vec<f64>,
}

impl Worn {
    fn of(request: &Value) -> Option<Self> {
        let Outcome { history, bodies: [_, flat], .. } = run(request)?;
        Some(Self {
            cycles: history.cycles,
            energy: history.dissipated_energy,
            volume: flat.wear_volume?.iter().map(|v| 1e18 * v).collect(),
            depth: flat.wear_depth?.iter().map(|w| 1e6 * w).collect(),
            half_length: flat.scar_half_length.iter().map(|half| 1e3 * half).collect(),
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

fn gross_slip(section: &mut Section) -> Option<()> {
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
    for row in rows(MEASURED)? {
        let [energy, measured] = row[..] else { return None };
        let (volume, _) = worn.at(energy)?;
        differences.push(1e-4 * (volume - measured));
        let what = format!("V at {energy} J, 10⁴ µm³");
        section.check(what, FOUVRY, 1e-4 * measured, 1e-4 * volume, None);
    }
    let count = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / count;
    let square = differences.iter().map(|difference| difference * difference).sum::<f64>();
    for (what, value) in [("mean", mean), ("root mean square", (square / count).sqrt())] {
        let what = format!("difference of V, {what}, 10⁴ µm³");
        section.check(what, FOUVRY, 0.0, value, None);
    }
    Some(())
}

/// The life of the coating: until the program has worn it through, and by the energy per area at which coatings failed.
fn endurance(section: &mut Section) -> Option<()> {
    let (thickness, critical) = COATING;
    for (stroke, body) in STROKES {
        let mut request = scenario(body)?;
        // k_w = αμ
        let layer = format!("{} um^3/(N m)", COEFFICIENT * request["friction"].as_f64()?);
        let layers = json!([{"thickness": format!("{thickness} um"), "coefficient": layer}]);
        request["wear"] =
            json!({"bodies": [{"coefficient": 0}, {"layers": layers, "coefficient": 1e-12}]});
        request["cycles"] = json!([1e6]);
        request["until"] = json!({"wear_depth": format!("{} um", 1.01 * thickness)});
        let outcome = run(&request)?;
        let worn = outcome.events.iter().find(|event| event.layer.is_some())?.cycles;
        // The energy per area and cycle is thickness/(αN) on average, and the coating fails at its sum `critical`.
        let failed = critical * worn * COEFFICIENT / thickness;
        let what = format!("U = {stroke} µm: cycles until the coating is worn through");
        section.check(what, FOUVRY, failed, worn, None);
    }
    Some(())
}

fn cylinder(section: &mut Section) -> Option<()> {
    let worn = Worn::of(&scenario(CYLINDER)?)?;
    let points = [rows(NODES)?, rows(FLAT)?].concat();
    let strip = |pair: &[Vec<f64>]| 500.0 * (pair[1][1] - pair[0][1]) * (pair[0][2] + pair[1][2]);
    for (row, depth, area) in LEVEL_SETS {
        let cycles = worn.cycles[row];
        for (what, known, found, accepted) in [
            ("depth, level sets, µm", depth, worn.depth[row], 0.05),
            ("area, level sets, µm²", area, 1e-4 * worn.volume[row], 0.03),
        ] {
            section.check(format!("N = {cycles}: {what}"), LLAVORI, known, found, accepted);
        }
    }
    // The measured scar follows that of the same cycles by finite elements, but begins further left.
    let scars = points.chunk_by(|a, b| a[0].total_cmp(&b[0]).is_eq() && a[1] < b[1]);
    for (scar, (row, source, half_length)) in scars.zip(SCARS) {
        let depth = scar.iter().map(|point| point[2]).fold(0.0, f64::max);
        let area = scar.windows(2).map(strip).sum::<f64>();
        let accept = |error| (source == LLAVORI).then_some(error);
        for (what, known, found, accepted) in [
            ("depth, µm", depth, worn.depth[row], accept(0.05)),
            // The cylinder is 10 mm long.
            ("area, µm²", area, 1e-4 * worn.volume[row], accept(0.03)),
            ("half-length, mm", half_length, worn.half_length[row], None),
        ] {
            let what = format!("N = {}: {what}", scar[0][0]);
            section.check(what, source, known, found, accepted);
        }
    }
    Some(())
}

fn titanium(section: &mut Section) -> Option<()> {
    let tests = rows(TESTS)?;
    for (row, body, frequency, measured) in [(1, TEST_3, 2.0, 65.0), (6, TEST_14, 0.1, 155.0)] {
        let Outcome { history, scales, .. } = run(&scenario(body)?)?;
        let (number, cycles, energy) = (tests[row][0], tests[row][1], tests[row][4]);
        let (a, depth) = (1e3 * history.contact_radius.last()?, 1e6 * history.wear_depth.last()?);
        // In mm: the cylinder has a radius of 80 mm and a length of 8 mm.
        let cube = 1.5 * 80.0 * (1e9 * history.wear_volume.last()? / 8.0);
        let late = libm::cbrt(cube);
        let hertz = libm::pow(1e3 * scales.contact_radius, 2.0);
        let elastic = root(late, 2.0 * late, |a| a * (a * a - 0.75 * hertz) - cube);
        let drop = |square: f64| 1e3 * square / (2.0 * 80.0);
        let next = libm::pow(hertz / (elastic * elastic), 2.0);
        for (what, reference, elastic, value) in [
            ("a, mm", late, elastic, a),
            ("total depth, µm", drop(late * late), drop(elastic * elastic - LN_2 * hertz), depth),
        ] {
            let what = format!("test {number}: {what}");
            let check = Check::reported(what, "late gross slip", reference, value);
            let expected = elastic / reference - 1.0;
            section.checks.push(Check { expected, accepted: Some(next), ..check });
        }
        let what = format!("test {number}: N at {energy} J");
        section.check(what, PETEGHEM, cycles, *history.cycles.last()?, None);
        let what = format!("test {number}: total depth, measured at {frequency} Hz, µm");
        section.check(what, "Arnaud et al. 2021", measured, depth, None);
    }
    for test in &tests {
        let [number, cycles, _, stroke, energy, _] = test[..] else { return None };
        let what = format!("test {number}: 4μF(δ_g/2)N, J");
        let work = 4.0 * 0.6 * 8523.0 * 0.5e-6 * stroke * cycles;
        section.check(what, PETEGHEM, energy, work, None);
    }
    Some(())
}

/// Tests in gross slip whose aperture was held.
fn apertures(section: &mut Section) -> Option<()> {
    let (mut ratios, mut tests) = (Vec::new(), CYLINDERS.lines());
    for test in tests.by_ref().filter(|line| !line.starts_with('#')).skip(1) {
        let (name, numbers) = test.split_once(',')?;
        let number = |index| numbers.split(',').nth(index)?.parse::<f64>().ok();
        let energy = number(6)?;
        // Without a printed volume, the coefficient is that of the test before, which hardly changes the energy.
        let coefficient = number(5).map_or(3e-4, |volume| volume / energy);
        let outcome = run(&json!({
            "profile": {"shape": "cylinder", "radius": 1e-3 * number(0)?, "length": 1e-3 * number(1)?},
            "bodies": [{"youngs_modulus": 119e9, "poisson_ratio": 0.29},
                       {"youngs_modulus": 119e9, "poisson_ratio": 0.29}],
            "friction": 0.6,
            "wear": {"energy_coefficient": 1e-9 * coefficient},
            "load": {"normal_force": number(1)? * number(2)?},
            "motion": {"loop_aperture": 75e-6},
            "cycles": [number(4)?],
        }))?;
        let found = *outcome.history.dissipated_energy.last()?;
        ratios.push(found / energy);
        let (force, frequency) = (number(2)?, number(3)?);
        let what = format!("{name}: {force} N/mm, {frequency} Hz: ΣW, J");
        section.check(what, APPENDIX, energy, found, None);
    }
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    section.check("mean ratio of the energies", APPENDIX, 1.0, mean, None);
    Some(())
}

fn coefficients(section: &mut Section) -> Option<()> {
    let tests = rows(TESTS)?;
    let at = |frequency: f64| {
        let tests = tests.iter().filter(|test| (test[2] - frequency).abs() < 1e-9);
        tests.map(|test| test[4..].to_vec()).collect()
    };
    for (what, source, published, points) in [
        ("TiC coating", FOUVRY, COEFFICIENT, rows(MEASURED)?),
        ("five tests at 5 Hz", PETEGHEM, 97_500.0, at(5.0)),
        ("two tests at 0.11 Hz", PETEGHEM, 534_900.0, at(0.11)),
    ] {
        let sum = |of: fn(&[f64]) -> f64| points.iter().map(|point| of(point)).sum::<f64>();
        let slope = sum(|point| point[0] * point[1]) / sum(|point| point[0] * point[0]);
        let what = format!("{what}: α, µm³/J");
        section.check(what, source, published, slope, None);
    }
    Some(())
}

/// The rows of a CSV file with comments and a header.
fn rows(csv: &str) -> Option<Vec<Vec<f64>>> {
    let rows = csv.lines().filter(|line| !line.starts_with('#')).skip(1);
    rows.map(|row| row.split(',').map(|number| number.parse().ok()).collect()).collect()
}
