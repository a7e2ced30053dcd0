//! Random scenarios of the exact method. A third of them have blocks.

use serde_json::{Value, json};

use fretwork_engine::outcome::Preview;
use fretwork_engine::scenario;
use fretwork_random::Random;

/// The quantities that can be held constant in the normal direction.
pub const HELD: [&str; 2] = ["depth", "force"];
/// The kinds of motion.
pub const MODES: [&str; 6] =
    ["amplitude", "tangential force", "rig", "blocks", "record", "gross slip"];
/// The shapes of the profile. The names of the power laws contain the exponent.
pub const SHAPES: [&str; 9] = [
    "sphere",
    "truncated paraboloid",
    "truncated cone",
    "r^1",
    "r^1.3",
    "r^1.5",
    "r^2",
    "r^3",
    "r^6",
];
/// The output cycles of a run without blocks, as shares of the last one.
const SHARES: [f64; 6] = [0.01, 0.05, 0.125, 0.25, 0.5, 1.0];
/// The output cycles of each block, as shares of its length.
const BLOCK_SHARES: [f64; 2] = [0.1, 0.9];

/// A random scenario of the exact method.
pub struct RandomScenario {
    /// One of [`HELD`].
    pub held: &'static str,
    /// One of [`MODES`].
    pub mode: &'static str,
    /// One of [`SHAPES`].
    pub shape: &'static str,
    /// The scenario as JSON.
    pub request: Value,
}

impl RandomScenario {
    /// Draws a scenario. `None` if the program refuses its contact.
    pub fn draw(random: &mut Random) -> Option<Self> {
        let (held, mode) = (random.one_of(&HELD), mode(random));
        let shape = shape(random);
        let stick_ratio = random.between(0.05, 0.98);
        let mut request = json!({
            "profile": profile(shape, random)?,
            "moduli": {"normal": "110 GPa", "tangential": "90 GPa"},
            "friction": 0.6,
            "wear": {"coefficient": 1e-14},
            "load": {"normal_force": "50 N", "held": held},
            "motion": {"stick_ratio": stick_ratio},
            "cycles": [1],
            "profiles_at": "none",
        });
        let preview = scenario::check(&request, "").ok()?.0.preview().ok()?;
        (request["motion"], request["cycles"]) = if mode == "blocks" {
            blocks(&preview, random)
        } else {
            let last = random.log_between(0.5, 16.0) * preview.scales.cycles;
            let cycles = SHARES.map(|share| json!(share * last)).into();
            (motion(mode, stick_ratio, &preview, random), cycles)
        };
        Some(Self { held, mode, shape, request })
    }
}

fn mode(random: &mut Random) -> &'static str {
    if random.between(0.0, 1.0) < 1.0 / 3.0 {
        return "blocks";
    }
    random.one_of(&["amplitude", "tangential force", "rig", "record", "gross slip"])
}

/// One of [`SHAPES`]. The sphere and both truncated shapes together are a third of the scenarios.
fn shape(random: &mut Random) -> &'static str {
    let (others, powers) = SHAPES.split_at(3);
    let some = if random.between(0.0, 1.0) < 1.0 / 3.0 { others } else { powers };
    random.one_of(some)
}

fn profile(shape: &str, random: &mut Random) -> Option<Value> {
    Some(match shape {
        "sphere" => json!({"shape": "sphere", "radius": "10 mm"}),
        "truncated paraboloid" => {
            let flat = random.log_between(1e-5, 1.2e-4);
            json!({"shape": "truncated_paraboloid", "radius": "10 mm", "flat_radius": flat})
        }
        "truncated cone" => {
            let flat = random.log_between(1e-5, 1e-4);
            json!({"shape": "truncated_cone", "slope_angle": 0.02, "flat_radius": flat})
        }
        power => {
            let exponent: f64 = power.strip_prefix("r^")?.parse().ok()?;
            json!({"shape": "power", "exponent": exponent, "height": "5 um", "at_radius": "0.2 mm"})
        }
    })
}

/// A motion without blocks.
fn motion(mode: &str, stick_ratio: f64, preview: &Preview, random: &mut Random) -> Value {
    let unworn = &preview.unworn;
    let amplitude = unworn.amplitude;
    match mode {
        "amplitude" => json!({"stick_ratio": stick_ratio}),
        "tangential force" => json!({"stick_ratio": stick_ratio, "held": "tangential_force"}),
        "rig" => {
            let stiffness = unworn.tangential_force / amplitude * random.log_between(0.3, 30.0);
            json!({"stick_ratio": stick_ratio, "rig_stiffness": stiffness})
        }
        "record" => {
            let mut position = || amplitude * random.between(-0.9, 0.9);
            json!({"reversals": [amplitude, -amplitude, position(), position(), position()]})
        }
        _ => json!({"amplitude": unworn.gross_slip_amplitude * random.log_between(1.02, 5.0)}),
    }
}

/// Two to five random blocks, and output cycles in each of them. The last block lasts until the end of the run.
fn blocks(preview: &Preview, random: &mut Random) -> (Value, Value) {
    let count = random.one_of(&[2_u8, 3, 4, 5]);
    let amplitudes: Vec<f64> = (0..count)
        .map(|_| preview.unworn.gross_slip_amplitude * random.log_between(0.02, 1.3))
        .collect();
    // N₀ of the first block.
    let characteristic = preview.scales.cycles * preview.unworn.amplitude / amplitudes[0];
    let last = random.log_between(0.5, 30.0) * characteristic;
    let (mut start, mut blocks, mut outputs) = (0.0, Vec::new(), Vec::new());
    for (index, amplitude) in amplitudes.iter().enumerate() {
        let length = if index + 1 == amplitudes.len() {
            (last - start).max(0.05 * last)
        } else {
            last * random.between(0.2, 1.0) / f64::from(count)
        };
        blocks.push(json!({"amplitude": amplitude, "cycles": length}));
        outputs.extend(BLOCK_SHARES.map(|share| start + share * length));
        start += length;
    }
    (json!({"blocks": blocks}), outputs.into())
}
