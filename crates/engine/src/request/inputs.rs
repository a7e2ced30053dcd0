//! The inputs: their names, dimensions and usual sizes, from which the form, studies, figures and reports take them.

use serde_json::Value;

use super::quantity::Dimension::{
    self, Angle, Energy, EnergyWear, Force, Length, Number, Stiffness, Stress, Volume,
    WearCoefficient,
};

/// What the number of an input measures.
#[derive(Debug, Clone, Copy)]
pub struct Measure {
    /// The dimension.
    pub dimension: Dimension,
    /// The units in which people write it, that of its field first; empty for a plain number.
    pub units: &'static str,
    /// Sizes in SI, ascending: the least that a contact has, the range that most contacts have, and the largest that a contact
    /// has. Beyond the range, another unit is meant more often. The ends are those of the slider of a plain number.
    pub usual: Option<[f64; 4]>,
    /// The least usual size of a number without a unit.
    pub bare: f64,
}

const fn measure(dimension: Dimension, units: &'static str, usual: [f64; 4]) -> Measure {
    Measure { dimension, units, usual: Some(usual), bare: usual[0] }
}

/// A plain number between these ends.
const fn between(least: f64, most: f64) -> Measure {
    measure(Number, "", [least, least, most, most])
}

/// A plain number, or no number.
const PLAIN: Measure =
    Measure { dimension: Number, units: "", usual: None, bare: f64::NEG_INFINITY };
const RATIO: Measure = between(0.0, 1.0);
const FRICTION: Measure = between(0.05, 1.5);
const MILLI: &str = "mm, m, um, nm, cm, in, mil";
const RADIUS: Measure = Measure { bare: 5e-5, ..measure(Length, MILLI, [1e-6, 1e-6, 2.0, 100.0]) };
const MICRO: Measure = measure(Length, "um, m, mm, nm, cm, in, mil", [1e-10, 1e-10, 2e-3, 2e-3]);
const ANGLE: Measure = measure(Angle, "deg, rad, mrad", [1e-5, 1e-3, 1.57, 1.57]);
// MPa comes before the others: it is meant most often by a number that no field has in GPa.
const GIGA: &str = "GPa, MPa, kPa, Pa, N/mm^2";
const MODULUS: Measure = measure(Stress, GIGA, [1e4, 1e9, 2e12, 2e12]);
const STRENGTH: Measure = measure(Stress, "MPa, GPa, kPa, Pa, N/mm^2", [1e4, 1e7, 1e10, 2e10]);
const HARDNESS: Measure = measure(Stress, GIGA, [1e5, 1e7, 1e11, 1e12]);
const PER_LOAD: &str = "mm^3/(N m), m^3/(N m), um^3/(N m), mm^2/N, 1/Pa, 1/kPa, 1/MPa, 1/GPa";
const WEAR: Measure = measure(WearCoefficient, PER_LOAD, [1e-20, 1e-20, 1e-10, 1e-10]);
const PER_ENERGY: &str = "mm^3/J, m^3/J, um^3/J, mm^3/kJ";
const ENERGY_WEAR: Measure = measure(EnergyWear, PER_ENERGY, [1e-20, 1e-20, 1e-9, 1e-9]);
const FORCE: Measure = measure(Force, "N, mN, kN, uN, MN", [1e-6, 1e-6, 1e6, 1e6]);
const STIFF: &str = "N/um, N/m, N/mm, kN/mm, MN/m";
const STIFFNESS: Measure = measure(Stiffness, STIFF, [1e2, 1e5, 1e10, 1e12]);
const ENERGY: Measure = measure(Energy, "J, mJ, kJ, uJ", [1e-9, 1e-9, 1e9, 1e9]);
const VOLUME: Measure = measure(Volume, "mm^3, m^3, um^3, cm^3", [1e-22, 1e-22, 1e-5, 1e-5]);

/// An input of a scenario.
#[derive(Debug, Clone, Copy)]
pub struct Input {
    /// Its pointer, with `#` in place of the place in a list. After `?` is a member that the scenario must have: a sibling,
    /// or a pointer. After `=` is its value.
    pub pointer: &'static str,
    /// The name for people, with `#` in place of the place in a list, counted from 1, and `@` where an amplitude says its place.
    pub words: &'static str,
    /// The symbol, with the letters of the equations between `$`; empty if it has none.
    pub symbol: &'static str,
    /// What its number measures.
    pub measure: Measure,
}

/// All inputs. The first that applies counts.
pub const INPUTS: &[Input] = &[
    input("/profile/shape", "Shape", "", PLAIN),
    input("/profile/geometry", "Geometry", "", PLAIN),
    input("/profile/radius", "Radius", "$R$", RADIUS),
    input("/profile/radius/#", "Radius of point #", "", MICRO),
    input("/profile/radii/0", "Radius, axis along the motion", "", RADIUS),
    input("/profile/radii/1", "Radius, axis across the motion", "", RADIUS),
    input("/profile/slope_angle", "Slope angle", "$θ$", ANGLE),
    input("/profile/exponent", "Exponent", "$n$", between(1.0, 10.0)),
    input("/profile/at_radius", "Reference radius", "", RADIUS),
    input("/profile/height?at_radius", "Height at reference radius", "", MICRO),
    input("/profile/height", "Height", "", MICRO),
    input("/profile/height/#", "Height of point #", "", MICRO),
    input("/profile/flat_radius", "Flat radius", "$b$", MICRO),
    input("/profile/flat_half_width", "Half-width of the flat", "$b$", RADIUS),
    input("/profile/edge_radius", "Edge radius", "$R$", RADIUS),
    input("/profile/length", "Length of the contact", "", RADIUS),
    input("/moduli/normal", "Normal modulus", "$E$*", MODULUS),
    input("/moduli/tangential", "Tangential modulus", "$G$*", MODULUS),
    input("/bodies/#/youngs_modulus", "Body #: Young's modulus", "$E$", MODULUS),
    input("/bodies/#/poisson_ratio", "Body #: Poisson's ratio", "$ν$", between(0.0, 0.5)),
    input("/bodies/#/yield_strength", "Body #: yield strength", "", STRENGTH),
    input("/friction", "Friction coefficient", "$μ$", FRICTION),
    input("/friction/run_in/cycles", "Run-in cycles of μ", "", PLAIN),
    input("/friction/run_in/from", "μ at the start", "", FRICTION),
    input("/friction/run_in/to", "μ after the run-in", "", FRICTION),
    input("/friction/over", "μ changes over", "", PLAIN),
    input("/friction/at?over=dissipated_energy", "Points of the table of μ", "", ENERGY),
    input("/friction/at", "Points of the table of μ", "", PLAIN),
    input("/friction/values", "Values of μ", "", FRICTION),
    input("/wear/coefficient?hardness", "Archard coefficient", "$k$", PLAIN),
    input("/wear/coefficient", "Wear coefficient", "$k_w$", WEAR),
    input("/wear/coefficient/run_in/cycles", "Run-in cycles of k_w", "", PLAIN),
    input("/wear/coefficient/run_in/from?/wear/hardness", "k at the start", "", PLAIN),
    input("/wear/coefficient/run_in/to?/wear/hardness", "k after the run-in", "", PLAIN),
    input("/wear/coefficient/values?/wear/hardness", "Values of k", "", PLAIN),
    input("/wear/coefficient/run_in/from", "k_w at the start", "", WEAR),
    input("/wear/coefficient/run_in/to", "k_w after the run-in", "", WEAR),
    input("/wear/coefficient/over", "k_w changes over", "", PLAIN),
    input("/wear/coefficient/at?over=dissipated_energy", "Points of the table of k_w", "", ENERGY),
    input("/wear/coefficient/at", "Points of the table of k_w", "", PLAIN),
    input("/wear/coefficient/values", "Values of k_w", "", WEAR),
    input("/wear/hardness", "Hardness", "", HARDNESS),
    input("/wear/energy_coefficient", "Energy coefficient", "$α$", ENERGY_WEAR),
    input("/wear/share", "Wear share of body 1", "", RATIO),
    input("/wear/bodies/#/coefficient?layers", "Body #, below the layers:", "$k_w$", WEAR),
    input("/wear/bodies/#/coefficient", "Body #:", "$k_w$", WEAR),
    input("/wear/bodies/#/layers/#/thickness", "Body #, layer #: thickness", "", MICRO),
    input("/wear/bodies/#/layers/#/coefficient", "Body #, layer #:", "$k_w$", WEAR),
    input("/load/normal_force", "Normal force", "$F$", FORCE),
    input("/load/indentation_depth", "Indentation depth", "$d$", MICRO),
    input("/load/held", "Load: kept constant", "", PLAIN),
    input("/motion/amplitude", "Amplitude@", "$U$", MICRO),
    input("/motion/sliding_amplitude", "Sliding amplitude", "", MICRO),
    input("/motion/loop_aperture", "Aperture of the loop", "$δ$₀", MICRO),
    input("/motion/stick_ratio", "Stick ratio", "$c$/$a$₀", RATIO),
    input("/motion/tangential_force", "Tangential force", "$Q$", FORCE),
    input("/motion/reference_distance", "Reference distance", "", RADIUS),
    input("/motion/rig_stiffness", "Rig stiffness", "", STIFFNESS),
    input("/motion/loop_stiffness", "Loop stiffness", "", STIFFNESS),
    input("/motion/held", "Motion: kept constant", "", PLAIN),
    input("/motion/blocks", "Amplitude blocks", "", PLAIN),
    input("/motion/blocks/#/amplitude", "Block #: amplitude@", "", MICRO),
    input("/motion/blocks/#/tangential_force", "Block #: tangential force", "", FORCE),
    input("/motion/blocks/#/loop_aperture", "Block #: aperture of the loop", "", MICRO),
    input("/motion/blocks/#/cycles", "Block #: cycles", "", PLAIN),
    input("/motion/reversals", "Displacement record", "", MICRO),
    input("/motion/reversals/#", "Position #", "", MICRO),
    input("/cycles", "Output cycles", "", PLAIN),
    input("/cycles/normalized", "Output cycles in N₀", "", PLAIN),
    input("/cycles/dissipated_energy", "Dissipated energies of the outputs", "", ENERGY),
    input("/profiles_at", "Cycles with profiles", "", PLAIN),
    input("/until/wear_depth", "Stop at wear depth", "", MICRO),
    input("/until/wear_volume", "Stop at wear volume", "", VOLUME),
    input("/until/dissipated_energy", "Stop at dissipated energy", "", ENERGY),
    input("/model/method", "Method", "", PLAIN),
    input("/model/xi", "Fitting parameter", "$ξ$", PLAIN),
    input("/model/tolerance", "Tolerance", "", PLAIN),
    input("/model/compare", "Compare with simplified rule", "", PLAIN),
    input("/model/points", "Output radii", "", PLAIN),
];

/// The names of values whose names are not their words.
pub const VALUES: &[(&str, &str)] = &[
    ("power", "Power law"),
    ("table", "Measured profile"),
    ("exact", "Exact method"),
    ("simplified", "Simplified rule"),
    ("log", "Logarithmic"),
];

const fn input(
    pointer: &'static str,
    words: &'static str,
    symbol: &'static str,
    measure: Measure,
) -> Input {
    Input { pointer, words, symbol, measure }
}

impl Input {
    /// The input at a pointer of a scenario, which is divided into its parts.
    fn at(parts: &[&str], scenario: &Value) -> Option<&'static Self> {
        INPUTS.iter().find(|input| {
            let (own, condition) = input.pointer.split_once('?').unwrap_or((input.pointer, ""));
            let is_own = |(own, part): (&str, &&str)| own == *part || own == "#" && is_place(part);
            own.split('/').count() == parts.len()
                && own.split('/').zip(parts).all(is_own)
                && (condition.is_empty() || holds(condition, parts, scenario))
        })
    }
}

fn is_place(part: &str) -> bool {
    part.parse::<usize>().is_ok()
}

/// Whether a scenario has the member of a condition.
fn holds(condition: &str, parts: &[&str], scenario: &Value) -> bool {
    let (member, value) = condition.split_once('=').unwrap_or((condition, ""));
    let pointer = if member.starts_with('/') {
        member.to_owned()
    } else {
        format!("{}/{member}", parts[..parts.len() - 1].join("/"))
    };
    scenario.pointer(&pointer).is_some_and(|found| value.is_empty() || found == value)
}

/// The name and the symbol of the input at a pointer of a scenario. Without a name, it is the last member in words.
#[must_use]
pub fn named(pointer: &str, scenario: &Value) -> (String, &'static str) {
    let parts: Vec<&str> = pointer.split('/').collect();
    let Some(input) = Input::at(&parts, scenario) else {
        return (parts[parts.len() - 1].replace('_', " "), "");
    };
    let at = |pointer, place| scenario.pointer(pointer).map(|_| place);
    let rig = at("/motion/rig_stiffness", " at the actuator");
    let place = rig.or_else(|| at("/profile/length", " at the reference")).unwrap_or_default();
    let places = parts.iter().filter_map(|part| part.parse::<usize>().ok());
    let words = places.fold(input.words.to_owned(), |words, place| {
        words.replacen('#', &(place + 1).to_string(), 1)
    });
    (words.replace('@', place), input.symbol)
}

/// What the number at a pointer of a scenario measures. The numbers of a list or range measure what it measures.
#[must_use]
pub fn measure_at(pointer: &str, scenario: &Value) -> Measure {
    let parts: Vec<&str> = pointer.split('/').collect();
    let own = Input::at(&parts, scenario);
    let list =
        parts.split_last().filter(|(last, _)| is_place(last) || ["from", "to"].contains(last));
    let input = own.or_else(|| list.and_then(|(_, list)| Input::at(list, scenario)));
    input.map_or(PLAIN, |input| input.measure)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn inputs_have_the_names_of_their_places() {
        let named = |pointer, scenario| named(pointer, &scenario);
        assert_eq!(named("/friction", json!({})), ("Friction coefficient".to_owned(), "$μ$"));
        assert_eq!(named("/bodies/1/youngs_modulus", json!({})).0, "Body 2: Young's modulus");
        let layer = "/wear/bodies/0/layers/2/thickness";
        assert_eq!(named(layer, json!({})).0, "Body 1, layer 3: thickness");
        assert_eq!(named("/profile/radii/1", json!({})).0, "Radius, axis across the motion");
        let archard = json!({"wear": {"coefficient": 1e-4, "hardness": "3 GPa"}});
        assert_eq!(named("/wear/coefficient", archard), ("Archard coefficient".to_owned(), "$k$"));
        assert_eq!(named("/wear/coefficient", json!({})).0, "Wear coefficient");
        let rig = json!({"motion": {"amplitude": 1e-6, "rig_stiffness": 2e7}});
        assert_eq!(named("/motion/amplitude", rig).0, "Amplitude at the actuator");
        assert_eq!(named("/motion/amplitude", json!({})).0, "Amplitude");
        let (line, block) = (json!({"profile": {"length": 0.01}}), "/motion/blocks/0/amplitude");
        assert_eq!(named("/motion/amplitude", line.clone()).0, "Amplitude at the reference");
        assert_eq!(named(block, line).0, "Block 1: amplitude at the reference");
        let rig = json!({"profile": {"length": 0.01}, "motion": {"rig_stiffness": 2e7}});
        assert_eq!(named(block, rig).0, "Block 1: amplitude at the actuator");
        assert_eq!(named(block, json!({})).0, "Block 1: amplitude");
        assert_eq!(named("/motion/other_number", json!({})), ("other number".to_owned(), ""));
    }
}
