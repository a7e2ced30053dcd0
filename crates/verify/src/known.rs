//! Checks against the literature: the unworn contact, the start of wear and gross slip. The program computes each value
//! from a scenario in SI units, as a user writes it.

use serde_json::{Value, json};

use super::page::{Section, TitledSection, digits};
use fretwork_engine::reference::{
    CattaneoMindlin, Cone, Hertz, PowerLaw, SlidingTransition, Sphere, elastic_amplitude_ratio,
    gross_slip_volume, initial_wear_rate,
};
use fretwork_engine::{Outcome, Preview, Scenario, Simulation, scenario};

const MODULUS: f64 = 112.64e9;
const RADIUS: f64 = 0.01;
const LOAD: f64 = 100.0;
const WEAR: f64 = 3.03e-14;
/// Accepted relative error of values that differ only by rounding: a scenario rounds its numbers to 12 digits.
const ROUNDED: f64 = 1e-9;

/// The contact of a paraboloid that all sections use.
const CONTACT: fn() -> CattaneoMindlin = || CattaneoMindlin {
    hertz: Hertz::under(LOAD, MODULUS, RADIUS),
    tangential_modulus: 92.76e9,
    friction: 0.7,
};

pub const SECTIONS: &[TitledSection] = &[
    ("Normal contact", pressed),
    ("Tangential contact", rubbed),
    ("Sliding transition", transition),
    ("Steel ball", steel_ball),
    ("Start of wear", beginning),
    ("Gross slip", gross_slip),
    ("Area of the loop", loops),
];

pub fn paraboloid() -> Value {
    json!({"shape": "paraboloid", "radius": RADIUS})
}

fn cone() -> Value {
    json!({"shape": "cone", "slope_angle": 0.02})
}

/// A scenario of the exact method with a normal force of 100 N.
pub fn request(profile: &Value, held: &str, motion: &Value, cycles: &Value) -> Value {
    json!({
        "profile": profile,
        "moduli": {"normal": MODULUS, "tangential": CONTACT().tangential_modulus},
        "friction": CONTACT().friction,
        "wear": {"coefficient": WEAR},
        "load": {"normal_force": LOAD, "held": held},
        "motion": motion,
        "cycles": cycles,
        "profiles_at": "all",
        "model": {"method": "exact"},
    })
}

fn checked(request: &Value) -> Option<Scenario> {
    scenario::check(request, "").ok().map(|(scenario, _)| scenario)
}

pub fn run(request: &Value) -> Option<Outcome> {
    Some(Simulation::of(&checked(request)?).ok()?.run())
}

fn preview(profile: &Value, motion: &Value) -> Option<Preview> {
    checked(&request(profile, "depth", motion, &json!([1])))?.preview().ok()
}

fn pressed(section: &mut Section) -> Option<()> {
    let of = |profile: Value| preview(&profile, &json!({"stick_ratio": 0.5}));
    let mut both = |name: &str, source, known: (f64, f64), found: &Preview| {
        let (a, d) = (found.scales.contact_radius, found.scales.indentation_depth);
        section.check(format!("{name}: a, mm"), source, 1e3 * known.0, 1e3 * a, ROUNDED);
        section.check(format!("{name}: d, µm"), source, 1e6 * known.1, 1e6 * d, ROUNDED);
    };
    let (hertz, round) = (CONTACT().hertz, of(paraboloid())?);
    both("paraboloid", "Hertz 1882", (hertz.contact_radius(), hertz.depth), &round);
    let known = Cone::under(LOAD, MODULUS, libm::tan(0.02));
    both("cone", "Sneddon 1965", (known.contact_radius(), known.depth), &of(cone())?);
    let known = PowerLaw::under(LOAD, MODULUS, 3.5, 1e-6 / libm::pow(1e-4, 3.5));
    let power = json!({"shape": "power", "exponent": 3.5, "height": 1e-6, "at_radius": 1e-4});
    both("n = 3.5", "Galin 1953", (known.contact_radius(), known.depth), &of(power)?);
    let found = of(json!({"shape": "sphere", "radius": RADIUS}))?;
    let contact_radius = found.scales.contact_radius;
    let known = Sphere { modulus: MODULUS, radius: RADIUS, contact_radius };
    both("sphere", "Segedin 1957", (contact_radius, known.depth()), &found);
    let force = found.scales.normal_force;
    section.check("sphere: F at this a, N", "Segedin 1957", known.force(), force, ROUNDED);
    let peak = (1e-6 * hertz.peak_pressure(), 1e-6 * round.unworn.peak_pressure);
    section.check("paraboloid: largest p, MPa", "Hertz 1882", peak.0, peak.1, ROUNDED);
    Some(())
}

fn rubbed(section: &mut Section) -> Option<()> {
    const CATTANEO: &str = "Cattaneo 1938, Mindlin 1949";
    const DERESIEWICZ: &str = "Mindlin & Deresiewicz 1953";
    for microns in [0.5, 2.256, 3.0] {
        let amplitude = 1e-6 * microns;
        let found = preview(&paraboloid(), &json!({"amplitude": amplitude}))?.unworn;
        let force = CONTACT().force(amplitude);
        let (c, energy) = (CONTACT().stick_radius(force), CONTACT().energy_per_cycle(force));
        for (symbol, source, reference, value) in [
            ("Q, N", CATTANEO, force, found.tangential_force),
            ("c, mm", CATTANEO, 1e3 * c, 1e3 * found.stick_radius),
            ("W, µJ", DERESIEWICZ, 1e6 * energy, 1e6 * found.energy_per_cycle),
        ] {
            let what = format!("U = {microns} µm: {symbol}");
            section.check(what, source, reference, value, ROUNDED);
        }
    }
    Some(())
}

fn transition(section: &mut Section) -> Option<()> {
    for (name, n, profile) in [("paraboloid", 2.0, paraboloid()), ("cone", 1.0, cone())] {
        let found = preview(&profile, &json!({"stick_ratio": 0}))?.unworn;
        let known = SlidingTransition::of(n);
        for (symbol, reference, value, accepted) in [
            ("A", known.energy_ratio, found.energy_ratio, 1e-8),
            ("D", known.displacement_ratio, found.slip_ratio, 1e-5),
            ("B", known.system_free_ratio, found.free_ratio, 1e-5),
        ] {
            let what = format!("{name}: {symbol}");
            section.check(what, "Fouvry et al. 1995", reference, value, accepted);
        }
    }
    Some(())
}

fn steel_ball(section: &mut Section) -> Option<()> {
    let motion = json!({"amplitude": "2.256 um"});
    let mut request = request(&paraboloid(), "depth", &motion, &json!([1]));
    let steel = json!({"youngs_modulus": "205 GPa", "poisson_ratio": 0.3});
    request.as_object_mut()?.remove("moduli");
    request["bodies"] = json!([steel, steel]);
    let Preview { scales, unworn, limit, .. } = checked(&request)?.preview().ok()?;
    let limit = limit?;
    let ratio = unworn.stick_radius / scales.contact_radius;
    for (what, reference, value, half_unit) in [
        ("E*, GPa", 112.64, 1e-9 * unworn.normal_modulus, 0.005),
        ("G*, GPa", 92.76, 1e-9 * unworn.tangential_modulus, 0.005),
        ("a₀, mm", 0.18813, 1e3 * scales.contact_radius, 5e-6),
        ("d₀, µm", 3.5393, 1e6 * scales.indentation_depth, 5e-5),
        ("largest p, MPa", 1349.0, 1e-6 * unworn.peak_pressure, 0.5),
        ("U_gs, µm", 3.008, 1e6 * unworn.gross_slip_amplitude, 5e-4),
        ("c/a₀", 0.5, ratio, 5e-4),
        ("N₀", 6108.5, scales.cycles, 0.05),
        ("W, µJ", 57.9, 1e6 * unworn.energy_per_cycle, 0.05),
        ("limit: V, 1e-5 mm³", 9.51, 1e14 * limit.wear_volume, 0.005),
        ("limit: w, µm", 1.05, 1e6 * limit.wear_depth, 0.005),
    ] {
        section.check(what, "worked example", reference, value, half_unit / reference);
    }
    Some(())
}

fn beginning(section: &mut Section) -> Option<()> {
    for (name, n, c, profile) in [
        ("paraboloid", 2.0, 0.5, paraboloid()),
        ("paraboloid", 2.0, 0.8, paraboloid()),
        ("cone", 1.0, 0.3, cone()),
    ] {
        let (motion, cycles) = (json!({"stick_ratio": c}), json!({"normalized": [1e-3]}));
        let Outcome { history, scales, .. } = run(&request(&profile, "depth", &motion, &cycles))?;
        let unit = scales.contact_radius * scales.contact_radius * scales.indentation_depth;
        let rate = history.wear_volume.last()? / unit / history.normalized_cycles.last()?;
        let what = format!("{name}, c = {c}: dV/dÑ");
        section.check(what, "2I/(1 − cⁿ)", initial_wear_rate(n, c), rate, 2e-3);
    }
    Some(())
}

fn gross_slip(section: &mut Section) -> Option<()> {
    for (strokes, normalized) in [(10.0, 1e-3), (100.0, 1e-2), (1e4, 1.0), (1e4, 16.0)] {
        let most = CONTACT().sliding_displacement();
        let (motion, cycles) =
            (json!({"amplitude": strokes * most}), json!({"normalized": [normalized]}));
        let history = run(&request(&paraboloid(), "force", &motion, &cycles))?.history;
        let slip = (strokes - elastic_amplitude_ratio(2.0)) * most;
        let known = gross_slip_volume(WEAR, LOAD, slip, *history.cycles.last()?);
        let what = format!("U = {strokes} U_gs: V at Ñ = {normalized}");
        let value = 1e9 * history.wear_volume.last()?;
        section.check(what, "Archard 1953", 1e9 * known, value, 1e-4);
    }
    Some(())
}

fn loops(section: &mut Section) -> Option<()> {
    for held in ["depth", "force"] {
        let (motion, cycles) = (json!({"amplitude": 2.256e-6}), json!({"normalized": [0.5, 2, 8]}));
        let Outcome { history, loops, .. } = run(&request(&paraboloid(), held, &motion, &cycles))?;
        let loops = loops?;
        for (i, energy) in history.energy_per_cycle.iter().enumerate() {
            let area = area(loops.displacement.get(i)?, loops.tangential_force.get(i)?);
            let instant = digits(history.normalized_cycles[i], 6);
            let what = format!("{held} held: area at Ñ = {instant}");
            section.check(what, "W", 1e6 * energy, 1e6 * area, 1e-6);
        }
    }
    Some(())
}

/// ∮ Q du along straight lines between points.
fn area(displacement: &[f64], force: &[f64]) -> f64 {
    let sides = displacement.windows(2).zip(force.windows(2));
    sides.map(|(u, force)| 0.5 * (u[1] - u[0]) * (force[0] + force[1])).sum::<f64>().abs()
}
