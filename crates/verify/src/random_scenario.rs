//! Random scenarios of the exact method. A third of the round contacts have blocks, a third of all contacts are lines,
//! and a third of the runs without blocks have layers or coefficients that change.

use std::f64::consts::PI;

use serde_json::{Value, json};

use fretwork_engine::{Preview, scenario};
use fretwork_random::Random;

/// The quantities that can be held constant in the normal direction. A line contact holds its force.
pub const HELD: [&str; 3] = ["depth", "force", "line"];
/// The kinds of motion.
pub const MODES: [&str; 9] = [
    "amplitude",
    "tangential force",
    "rig",
    "blocks",
    "record",
    "gross slip",
    "loop",
    "sliding",
    "force blocks",
];
/// The shapes of the profile. The names of the power laws contain the exponent. Those of line contacts are the last.
pub const SHAPES: [&str; 18] = [
    "sphere",
    "truncated paraboloid",
    "truncated cone",
    "r^1",
    "r^1.3",
    "r^1.5",
    "r^2",
    "r^3",
    "r^6",
    "noisy r^2",
    "noisy r^4",
    "cylinder",
    "wedge",
    "punch",
    "x^1.3",
    "x^3",
    "x^6",
    SHARP,
];
/// A punch with a small edge radius, whose ring of contact around the flat is thin.
const SHARP: &str = "sharp punch";
/// The number of shapes of round contacts in [`SHAPES`].
const ROUND: usize = 11;
/// The kinds of wear coefficients and of friction.
pub const COEFFICIENTS: [&str; 3] = ["constant", "layers", "changing"];
/// The output cycles of a run without blocks, as shares of the last one.
const SHARES: [f64; 6] = [0.01, 0.05, 0.125, 0.25, 0.5, 1.0];
/// The output cycles of each block, as shares of its length.
const BLOCK_SHARES: [f64; 2] = [0.1, 0.9];
const FRICTION: f64 = 0.6;
/// The largest coefficient of friction that changes.
const MOST_FRICTION: f64 = 1.5;
const WEAR: f64 = 1e-14;
const NORMAL_MODULUS: f64 = 110e9;
/// The length of the line contacts in m.
const LENGTH: f64 = 0.01;
/// The distance in m from the middle of a line contact to the points that define its stroke.
const REACH: f64 = 0.02;

/// A random scenario of the exact method.
pub struct RandomScenario {
    /// One of `HELD`.
    pub held: &'static str,
    /// One of `MODES`.
    pub mode: &'static str,
    /// One of `SHAPES`.
    pub shape: &'static str,
    /// One of `COEFFICIENTS`.
    pub coefficients: &'static str,
    /// Whether the ring that slips is at most 0.05 contact radii wide at the stick ratio of the scenario.
    pub is_thin: bool,
    /// The scenario as JSON.
    pub request: Value,
}

impl RandomScenario {
    /// Draws a scenario. `None` if the program refuses its contact.
    pub fn draw(random: &mut Random) -> Option<Self> {
        let is_line = random.between(0.0, 1.0) < 0.4;
        let (held, mode, shape) = if is_line {
            // All kinds but a record. Three of four have a reference.
            let modes: Vec<_> = MODES.into_iter().filter(|mode| *mode != "record").collect();
            ("line", random.one_of(&modes), random.one_of(&SHAPES[ROUND..]))
        } else {
            (random.one_of(&HELD[..2]), mode(random), shape(random))
        };
        let is_thin = shape == SHARP || random.between(0.0, 1.0) < 0.1;
        let stick_ratio =
            if is_thin { 1.0 - random.log_between(1e-3, 0.05) } else { random.between(0.05, 0.98) };
        let mut request = json!({
            "profile": profile(shape, random)?,
            "moduli": {"normal": NORMAL_MODULUS, "tangential": "90 GPa"},
            "friction": FRICTION,
            "wear": {"coefficient": WEAR},
            "load": {"normal_force": if is_line { "200 N" } else { "50 N" }},
            "motion": {"stick_ratio": stick_ratio},
            "cycles": [1],
            "profiles_at": "none",
        });
        if is_line {
            request["motion"]["reference_distance"] = json!(REACH);
        } else {
            request["load"]["held"] = json!(held);
        }
        let preview = scenario::check(&request, "").ok()?.0.preview().ok()?;
        let shortest = if shape == SHARP { 0.01 } else { 0.5 };
        let mut last = random.log_between(shortest, 16.0) * preview.scales.cycles;
        if mode.ends_with("blocks") {
            (request["motion"], request["cycles"]) = blocks(is_line, mode, &preview, random);
            return Some(Self { held, mode, shape, coefficients: "constant", is_thin, request });
        }
        request["motion"] = if is_line {
            let (motion, pace) = line_motion(mode, stick_ratio, &preview, random);
            last /= pace;
            motion
        } else {
            motion(mode, stick_ratio, &preview, random)
        };
        request["cycles"] = SHARES.map(|share| json!(share * last)).into();
        let energy = preview.unworn.energy_per_cycle;
        // Layers keep the tip of a wedge sharp, so half of the wedges have layers.
        let usual = if shape == "wedge" { "layers" } else { "constant" };
        let coefficients = random.one_of(&["constant", usual, "layers", "changing"]);
        match coefficients {
            "layers" => {
                request["wear"] = layers(preview.scales.indentation_depth, random);
                if random.between(0.0, 1.0) < 0.3 {
                    let end = last * random.log_between(2e-3, 1.0);
                    request["friction"] = friction(end, energy, random);
                }
            }
            "changing" => change(&mut request, last, energy, random),
            _ => {}
        }
        Some(Self { held, mode, shape, coefficients, is_thin, request })
    }

    /// Whether the motion has blocks.
    pub fn has_blocks(&self) -> bool {
        self.mode.ends_with("blocks")
    }
}

/// One or two layers on each body. The depth is the unit of wear.
fn layers(depth: f64, random: &mut Random) -> Value {
    let mut coefficient = || 0.5 * WEAR * random.log_between(0.02, 10.0);
    let below = [coefficient(), coefficient()];
    let mut body = |below: f64, count: u8| {
        let mut layer = || {
            let (thickness, coefficient) =
                (depth * random.log_between(0.02, 1.0), 0.5 * WEAR * random.log_between(0.1, 10.0));
            json!({"thickness": thickness, "coefficient": coefficient})
        };
        json!({"layers": (0..count).map(|_| layer()).collect::<Vec<_>>(), "coefficient": below})
    };
    let first = body(below[0], 1);
    json!({"bodies": [first, body(below[1], if below[1] > below[0] { 2 } else { 0 })]})
}

/// Lets the friction or the wear coefficient change, or both, until the cycle `last` or until the energy that the unworn
/// contact would dissipate.
fn change(request: &mut Value, last: f64, energy_per_cycle: f64, random: &mut Random) {
    let kind = random.one_of(&["friction", "wear", "both"]);
    if kind != "wear" {
        let end = last * random.log_between(2e-3, 1.0);
        request["friction"] = friction(end, energy_per_cycle, random);
    }
    if kind != "friction" {
        // The coefficient has a step.
        let mut other = || WEAR * random.log_between(0.3, 3.0);
        let (first, second) = (other(), other());
        let step = last * random.between(0.1, 0.4);
        let at = [0.0, step, step, 2.0 * step];
        request["wear"]["coefficient"] =
            json!({"over": "cycles", "at": at, "values": [WEAR, first, second, WEAR]});
    }
}

/// A coefficient of friction that rises or falls by up to a factor of 4.
fn friction(cycles: f64, energy_per_cycle: f64, random: &mut Random) -> Value {
    let mut other = || FRICTION * random.log_between(0.25, 4.0).min(MOST_FRICTION / FRICTION);
    let values = [FRICTION, other(), other(), other()];
    let at = [0.0, 0.2, 0.6, 1.0].map(|share| share * cycles);
    match random.one_of(&["run-in", "over cycles", "over energy"]) {
        "run-in" => json!({"run_in": {"cycles": cycles, "from": FRICTION, "to": values[1]}}),
        "over cycles" => json!({"over": "cycles", "at": at, "values": values}),
        _ => {
            let at = at.map(|cycles| cycles * energy_per_cycle);
            json!({"over": "dissipated_energy", "at": at, "values": values})
        }
    }
}

/// The kind of motion of a round contact.
fn mode(random: &mut Random) -> &'static str {
    if random.between(0.0, 1.0) < 1.0 / 3.0 {
        return "blocks";
    }
    random.one_of(&["amplitude", "tangential force", "rig", "record", "gross slip"])
}

/// A shape of a round contact. The sphere and both truncated shapes together are a third of them.
fn shape(random: &mut Random) -> &'static str {
    let (others, powers) = SHAPES[..ROUND].split_at(3);
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
        "cylinder" => json!({"shape": "cylinder", "radius": "6 mm", "length": LENGTH}),
        "wedge" => json!({"shape": "wedge", "slope_angle": 0.02, "length": LENGTH}),
        "punch" => {
            let flat = random.log_between(5e-6, 2e-4);
            json!({"shape": "punch", "flat_half_width": flat, "edge_radius": "3 mm", "length": LENGTH})
        }
        SHARP => {
            let (flat, edge) = (random.log_between(1e-4, 1e-3), random.log_between(3e-5, 1e-3));
            json!({"shape": "punch", "flat_half_width": flat, "edge_radius": edge, "length": LENGTH})
        }
        noisy if noisy.starts_with("noisy") => {
            let exponent: f64 = noisy.split_once('^')?.1.parse().ok()?;
            let radius: Vec<f64> = (0..200).map(|i| f64::from(i) * 2.5e-6).collect();
            let height = radius.iter().map(|r| {
                5e-6 * libm::pow(r / 2e-4, exponent) * (1.0 + 0.01 * random.between(-1.7, 1.7))
            });
            json!({"shape": "table", "height": height.collect::<Vec<_>>(), "radius": radius})
        }
        power => {
            let (variable, exponent) = power.split_once('^')?;
            let exponent: f64 = exponent.parse().ok()?;
            let mut profile = json!({"shape": "power", "exponent": exponent, "height": "5 um", "at_radius": "0.2 mm"});
            if variable == "x" {
                (profile["geometry"], profile["length"]) = (json!("line"), json!(LENGTH));
            }
            profile
        }
    })
}

/// A motion of a line contact without blocks, and the wear rate relative to the rate on which its N₀ is based.
/// `preview` belongs to the stick ratio and to [`REACH`].
fn line_motion(
    mode: &str,
    stick_ratio: f64,
    preview: &Preview,
    random: &mut Random,
) -> (Value, f64) {
    let Preview { unworn, scales, .. } = preview;
    let (amplitude, force) = (unworn.amplitude, unworn.tangential_force);
    let threshold = force / (FRICTION * scales.normal_force);
    let slip = FRICTION * scales.indentation_depth;
    match mode {
        "amplitude" => (json!({"amplitude": amplitude, "reference_distance": REACH}), threshold),
        "tangential force" => (json!({"stick_ratio": stick_ratio}), threshold),
        "rig" => {
            let stiffness = force / amplitude * random.log_between(0.3, 30.0);
            let amplitude = amplitude + force / stiffness;
            let motion = json!({"amplitude": amplitude, "reference_distance": REACH, "rig_stiffness": stiffness});
            (motion, threshold)
        }
        "loop" => {
            // The slope of the loop of the unworn contact, which is measured against REACH.
            let stiffness =
                0.5 * PI * NORMAL_MODULUS * LENGTH / libm::acosh(REACH / scales.contact_radius);
            (json!({"amplitude": amplitude, "loop_stiffness": stiffness}), threshold)
        }
        "sliding" => {
            let sliding = random.log_between(20.5, 300.0);
            (json!({"sliding_amplitude": sliding * slip}), 1.0 + sliding)
        }
        _ => {
            let gross_slip = unworn.gross_slip_amplitude;
            let amplitude = gross_slip * random.log_between(1.02, 5.0);
            let motion = json!({"amplitude": amplitude, "reference_distance": REACH});
            (motion, 1.0 + (amplitude - gross_slip) / slip)
        }
    }
}

/// A motion of a round contact without blocks.
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

/// Blocks of amplitudes, or of forces of a line contact, and the output cycles.
fn blocks(is_line: bool, mode: &str, preview: &Preview, random: &mut Random) -> (Value, Value) {
    let Preview { unworn, scales, .. } = preview;
    let count = random.one_of(&[2_u8, 3, 4, 5]);
    let (member, most, [lowest, highest]) = match mode {
        "force blocks" => ("tangential_force", FRICTION * scales.normal_force, [0.05, 0.98]),
        _ => ("amplitude", unworn.gross_slip_amplitude, [if is_line { 0.05 } else { 0.02 }, 1.3]),
    };
    let motions: Vec<f64> =
        (0..count).map(|_| most * random.log_between(lowest, highest)).collect();
    // The characteristic cycles of a round contact are those of its first amplitude.
    let unit = if is_line { scales.cycles } else { scales.cycles * unworn.amplitude / motions[0] };
    let last = random.log_between(0.5, 30.0) * unit;
    let (blocks, outputs) = in_time(member, &motions, last, random);
    let mut motion = json!({"blocks": blocks});
    if is_line && member == "amplitude" {
        motion["reference_distance"] = json!(REACH);
    }
    (motion, outputs.into())
}

/// Blocks of these motions up to the cycle `last`, and output cycles in each of them.
fn in_time(
    member: &str,
    motions: &[f64],
    last: f64,
    random: &mut Random,
) -> (Vec<Value>, Vec<f64>) {
    let (mut start, mut blocks, mut outputs) = (0.0, Vec::new(), Vec::new());
    for (index, motion) in motions.iter().enumerate() {
        let length = if index + 1 == motions.len() {
            (last - start).max(0.05 * last)
        } else {
            last * random.between(0.2, 1.0) / motions.len() as f64
        };
        blocks.push(json!({member: motion, "cycles": length}));
        outputs.extend(BLOCK_SHARES.map(|share| start + share * length));
        start += length;
    }
    (blocks, outputs)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fretwork_engine::simulation::Simulation;

    /// The area below straight lines between points. Values that are not finite are left out.
    fn area(points: impl Iterator<Item = (f64, f64)>) -> f64 {
        let points: Vec<_> = points.filter(|(_, y)| y.is_finite()).collect();
        let below = |ends: &[(f64, f64)]| 0.5 * (ends[1].0 - ends[0].0) * (ends[0].1 + ends[1].1);
        points.windows(2).map(below).sum()
    }

    #[test]
    fn profiles_give_the_force_and_loops_the_energy_of_random_scenarios() {
        let mut random = Random::new(58);
        for _ in 0..100 {
            let Some(mut drawn) = RandomScenario::draw(&mut random) else { continue };
            drawn.request["profiles_at"] = json!("all");
            drawn.request["model"] = json!({"points": 64});
            let Ok((scenario, _)) = scenario::check(&drawn.request, "") else { continue };
            let outcome = Simulation::of(&scenario).expect("a contact").run();
            let (profiles, loops) =
                (outcome.profiles.expect("profiles"), outcome.loops.expect("loops"));
            let history = &outcome.history;
            for (shown, pressure) in profiles.pressure.iter().enumerate() {
                let is_shown = |cycles: &f64| *cycles >= profiles.cycles[shown];
                let row = history.cycles.iter().position(is_shown).expect("a row");
                let is_line = drawn.held == "line";
                let pairs = profiles.radius.iter().zip(pressure);
                let found =
                    area(pairs.map(|(r, p)| (*r, if is_line { LENGTH } else { PI * r } * 2.0 * p)));
                let force = history.normal_force[row];
                assert!(
                    (found - force).abs() <= 0.01 * force,
                    "{found} {force}: {}",
                    drawn.request
                );

                let (u, q) = (&loops.displacement[shown], &loops.tangential_force[shown]);
                let lost = history.energy_per_cycle[row];
                let error = (area(u.iter().copied().zip(q.iter().copied())).abs() - lost).abs();
                // Of a record, the loop is the largest of a pass. Rounding matters if a loop is almost closed.
                let is_known = u[0].is_finite() && drawn.mode != "record";
                let slack = 1e-3 * lost + 1e-14 * u[0] * q[0];
                assert!(!is_known || error <= slack, "{error} {lost}: {}", drawn.request);
            }
        }
    }
}
