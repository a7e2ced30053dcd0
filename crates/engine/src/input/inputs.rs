//! The inputs: what they are, their forms, names, dimensions and usual sizes, from which the JSON Schema, the form of the page, studies,
//! figures and reports take them.

use serde_json::Value;

use self::Form::{Either, Flag, List, Of, Part, Whole, Word};
use super::fields::POINTS_RANGE;
use super::held::{MAX_BLOCKS, MAX_REVERSALS};
use super::indenter::MAX_ROWS;
use super::quantity::Dimension::{
    self, Angle, Energy, EnergyWear, Force, Length, Number, Stiffness, Stress, Volume,
    WearCoefficient,
};
use super::wear::MAX_LAYERS;

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

/// The form of the value of an input, for the JSON Schema.
#[derive(Debug, Clone, Copy)]
pub enum Form {
    /// The form with this name: a quantity, or an object.
    Of(&'static str),
    /// One of the forms with these names.
    Either(&'static [&'static str]),
    /// A list of items of the form with this name; the least and the greatest number of items.
    List(&'static str, usize, usize),
    /// One of these words.
    Word(&'static [&'static str]),
    /// A whole number between these ends.
    Whole(u16, u16),
    /// True or false.
    Flag,
    /// A part of the value of another input, whose form contains it.
    Part,
}

/// An input of a scenario.
#[derive(Debug, Clone, Copy)]
pub struct Input {
    /// Its pointer, with `#` in place of the place in a list. After `?` is a member that the scenario must have: a sibling,
    /// or a pointer. After `=` is its value.
    pub pointer: &'static str,
    /// What it is, in sentences.
    pub about: &'static str,
    /// The form of its value.
    pub form: Form,
    /// The name for people, with `#` in place of the place in a list, counted from 1, and `@` where an amplitude says its place.
    pub words: &'static str,
    /// The symbol, with the letters of the equations between `$`; empty if it has none.
    pub symbol: &'static str,
    /// What its number measures.
    pub measure: Measure,
}

/// Defines the inputs: what each is, its pointer, form, name and symbol, and what it measures.
macro_rules! inputs {
    ($($(#[doc = $about:literal])* $pointer:literal: $form:expr, $words:literal, $symbol:literal, $measure:expr;)*) => {
        /// All inputs. The first that applies counts.
        pub const INPUTS: &[Input] = &[$(Input {
            pointer: $pointer,
            about: concat!($($about),*),
            form: $form,
            words: $words,
            symbol: $symbol,
            measure: $measure,
        }),*];
    };
}

const BY_FORCE_OR_DEPTH: Form = Word(&["force", "depth"]);
const BY_AMPLITUDE_OR_FORCE: Form = Word(&["amplitude", "tangential_force"]);

inputs! {
    "/profile/shape": Part, "Shape", "", PLAIN;
    "/profile/geometry": Of("Geometry"), "Geometry", "", PLAIN;
    /// Radii, strictly increasing (at 12 digits) from 0 on the axis.
    "/profile/radius?height": List("Radius", 2, MAX_ROWS), "Radius", "$R$", RADIUS;
    /// Radius R.
    "/profile/radius": Of("Length"), "Radius", "$R$", RADIUS;
    "/profile/radius/#": Part, "Radius of point #", "", MICRO;
    /// The radius of the cylinder whose axis lies along the motion, then the radius of the other one.
    "/profile/radii": List("Length", 2, 2), "Radii", "", RADIUS;
    "/profile/radii/0": Part, "Radius, axis along the motion", "", RADIUS;
    "/profile/radii/1": Part, "Radius, axis across the motion", "", RADIUS;
    "/profile/slope_angle": Of("SlopeAngle"), "Slope angle", "$θ$", ANGLE;
    "/profile/exponent": Of("Exponent"), "Exponent", "$n$", between(1.0, 10.0);
    /// Where f is `height`.
    "/profile/at_radius": Of("Length"), "Reference radius", "", RADIUS;
    /// f at `at_radius`.
    "/profile/height?at_radius": Of("Length"), "Height at reference radius", "", MICRO;
    /// As many heights, none below the first.
    "/profile/height": List("Height", 2, MAX_ROWS), "Height", "", MICRO;
    "/profile/height/#": Part, "Height of point #", "", MICRO;
    /// Radius b of the flat.
    "/profile/flat_radius": Of("Length"), "Flat radius", "$b$", MICRO;
    /// Half of the width of the flat, b.
    "/profile/flat_half_width": Of("Length"), "Half-width of the flat", "$b$", RADIUS;
    /// Radius R of the edges.
    "/profile/edge_radius": Of("Length"), "Edge radius", "$R$", RADIUS;
    /// Length of a line contact, across the motion; not for a round contact.
    "/profile/length": Of("Length"), "Length of the contact", "", RADIUS;
    /// E*, 1/E* = Σ (1−ν²)/E.
    "/moduli/normal": Of("Stress"), "Normal modulus", "$E$*", MODULUS;
    /// G*, 1/G* = Σ (2−ν)/(4G). Required for a round contact; it has no meaning for a line contact.
    "/moduli/tangential": Of("Stress"), "Tangential modulus", "$G$*", MODULUS;
    /// Young's modulus E.
    "/bodies/#/youngs_modulus": Of("Stress"), "Body #: Young's modulus", "$E$", MODULUS;
    "/bodies/#/poisson_ratio": Of("PoissonRatio"), "Body #: Poisson's ratio", "$ν$", between(0.0, 0.5);
    /// Only for a warning. It is compared with the largest von Mises stress of the unworn contact, with friction, for a paraboloid
    /// and a sphere (Hamilton 1983). For other profiles it is compared with the peak pressure divided by 1.6.
    "/bodies/#/yield_strength": Of("Stress"), "Body #: yield strength", "", STRENGTH;
    "/friction": Part, "Friction coefficient", "$μ$", FRICTION;
    "/friction/run_in/cycles": Part, "Run-in cycles of μ", "", PLAIN;
    "/friction/run_in/from": Part, "μ at the start", "", FRICTION;
    "/friction/run_in/to": Part, "μ after the run-in", "", FRICTION;
    "/friction/over": Part, "μ changes over", "", PLAIN;
    "/friction/at?over=dissipated_energy": Part, "Points of the table of μ", "", ENERGY;
    "/friction/at": Part, "Points of the table of μ", "", PLAIN;
    "/friction/values": Part, "Values of μ", "", FRICTION;
    /// The dimensionless k; k_w = k/hardness must lie between 1e-30 and 1 1/Pa.
    "/wear/coefficient?hardness": Either(&["ArchardCoefficient", "ChangeTable", "RunIn"]), "Archard coefficient", "$k$", PLAIN;
    /// k_w, a table of it, or a run-in.
    "/wear/coefficient": Either(&["WearCoefficient", "ChangeTable", "RunIn"]), "Wear coefficient", "$k_w$", WEAR;
    "/wear/coefficient/run_in/cycles": Part, "Run-in cycles of k_w", "", PLAIN;
    "/wear/coefficient/run_in/from?/wear/hardness": Part, "k at the start", "", PLAIN;
    "/wear/coefficient/run_in/to?/wear/hardness": Part, "k after the run-in", "", PLAIN;
    "/wear/coefficient/values?/wear/hardness": Part, "Values of k", "", PLAIN;
    "/wear/coefficient/run_in/from": Part, "k_w at the start", "", WEAR;
    "/wear/coefficient/run_in/to": Part, "k_w after the run-in", "", WEAR;
    "/wear/coefficient/over": Part, "k_w changes over", "", PLAIN;
    "/wear/coefficient/at?over=dissipated_energy": Part, "Points of the table of k_w", "", ENERGY;
    "/wear/coefficient/at": Part, "Points of the table of k_w", "", PLAIN;
    "/wear/coefficient/values": Part, "Values of k_w", "", WEAR;
    /// Hardness σ₀ of the softer body.
    "/wear/hardness": Of("Stress"), "Hardness", "", HARDNESS;
    /// α; k_w = μα. It is constant, also if the friction changes.
    "/wear/energy_coefficient": Of("EnergyWear"), "Energy coefficient", "$α$", ENERGY_WEAR;
    /// The share of the wear volume that the first body, which carries the profile, loses; `bodies` of the result then says what each
    /// wears.
    "/wear/share": Of("Share"), "Wear share of body 1", "", RATIO;
    /// The two bodies, first the one that carries the profile. At least one body must never stop wearing: all its coefficients are
    /// above 0.
    "/wear/bodies": List("WornBody", 2, 2), "Wear of each body", "", PLAIN;
    /// The layers, from the surface inwards.
    "/wear/bodies/#/layers": List("Layer", 0, MAX_LAYERS), "Body #: layers", "", PLAIN;
    /// k_w of the material below the layers.
    "/wear/bodies/#/coefficient?layers": Of("WearRate"), "Body #, below the layers:", "$k_w$", WEAR;
    "/wear/bodies/#/coefficient": Part, "Body #:", "$k_w$", WEAR;
    /// Thickness of the layer.
    "/wear/bodies/#/layers/#/thickness": Of("Length"), "Body #, layer #: thickness", "", MICRO;
    /// k_w of the layer.
    "/wear/bodies/#/layers/#/coefficient": Of("WearRate"), "Body #, layer #:", "$k_w$", WEAR;
    /// Normal force F of the unworn contact; for a line contact also per length, such as "18.5 N/mm".
    "/load/normal_force": Of("Force"), "Normal force", "$F$", FORCE;
    /// Approach d of the bodies in the unworn contact; only for a round contact.
    "/load/indentation_depth": Of("Length"), "Indentation depth", "$d$", MICRO;
    /// What stays as it is while the contact wears. By default what is given. A line contact holds the force.
    "/load/held": BY_FORCE_OR_DEPTH, "Load: kept constant", "", PLAIN;
    /// Amplitude U: HALF of the peak-to-peak stroke, at the contact, of a line contact at its reference, or with `rig_stiffness` at
    /// the actuator. At least 1e-6 of the gross-slip amplitude.
    "/motion/amplitude": Of("Length"), "Amplitude@", "$U$", MICRO;
    /// Only for a line contact that slides as a whole: amplitude of the sliding at the contact, HALF of the peak-to-peak stroke, less
    /// what the bodies and the rig yield.
    "/motion/sliding_amplitude": Of("Length"), "Sliding amplitude", "", MICRO;
    /// Aperture δ₀ of the friction loop: HALF of its width where the tangential force is zero. What is linear in the force, such as a
    /// rig, does not change it. Below gross slip, a run ends when the core that carries the load begins to slip.
    "/motion/loop_aperture": Of("Length"), "Aperture of the loop", "$δ$₀", MICRO;
    /// c/a₀ of the unworn contact, which sets the amplitude at the contact, or for a line contact the tangential force; 0 is the onset
    /// of gross slip.
    "/motion/stick_ratio": Of("StickRatio"), "Stick ratio", "$c$/$a$₀", RATIO;
    /// Amplitude Q of the tangential force in the unworn contact, below μF.
    "/motion/tangential_force": Of("TangentialForce"), "Tangential force", "$Q$", FORCE;
    /// Only for a line contact: the distance from its middle to the points on the surfaces of both bodies whose relative motion is the
    /// stroke. With it, the result has displacements.
    "/motion/reference_distance": Of("Length"), "Reference distance", "", RADIUS;
    /// Stiffness of what lies between actuator and contact; only with the amplitude held, and for a line contact only beside
    /// `reference_distance`.
    "/motion/rig_stiffness": Of("Stiffness"), "Rig stiffness", "", STIFFNESS;
    /// Only for a line contact, instead of `reference_distance`: the slope dQ/dU of a measured loop just after a reversal. It contains
    /// the rig.
    "/motion/loop_stiffness": Of("Stiffness"), "Loop stiffness", "", STIFFNESS;
    /// What stays as it is while the contact wears. By default the amplitude, unless a tangential force is given. A line contact, blocks
    /// and reversals hold what is given.
    "/motion/held": BY_AMPLITUDE_OR_FORCE, "Motion: kept constant", "", PLAIN;
    /// Amplitudes one after the other, each for some cycles; cycles count through. N₀ is that of the first. All hold amplitudes, which
    /// for a line contact need a reference, or apertures, or for a line contact tangential forces.
    "/motion/blocks": List("Block", 1, MAX_BLOCKS), "Amplitude blocks", "", PLAIN;
    /// Amplitude U of the block; 0 lets the contact rest (not in the first block).
    "/motion/blocks/#/amplitude": Of("Stroke"), "Block #: amplitude@", "", MICRO;
    /// Amplitude Q of the tangential force of the block, as text also per length; 0 lets the contact rest (not in the first block).
    "/motion/blocks/#/tangential_force": Of("BlockForce"), "Block #: tangential force", "", FORCE;
    /// Aperture δ₀ of the loops of the block; 0 lets the contact rest (not in the first block).
    "/motion/blocks/#/loop_aperture": Of("Stroke"), "Block #: aperture of the loop", "", MICRO;
    /// How many cycles it lasts.
    "/motion/blocks/#/cycles": Of("BlockCycles"), "Block #: cycles", "", PLAIN;
    /// Only for a round contact: positions between which it moves, again and again. One cycle is one pass of the record, from its first
    /// position to its last and back to the first. Their mean does not matter.
    "/motion/reversals": List("Position", 2, MAX_REVERSALS), "Displacement record", "", MICRO;
    "/motion/reversals/#": Part, "Position #", "", MICRO;
    "/cycles": Part, "Output cycles", "", PLAIN;
    "/cycles/normalized": Part, "Output cycles in N₀", "", PLAIN;
    "/cycles/dissipated_energy": Part, "Dissipated energies of the outputs", "", ENERGY;
    "/profiles_at": Part, "Cycles with profiles", "", PLAIN;
    /// Largest wear depth.
    "/until/wear_depth": Of("Length"), "Stop at wear depth", "", MICRO;
    /// Wear volume of both bodies.
    "/until/wear_volume": Of("Volume"), "Stop at wear volume", "", VOLUME;
    /// Energy dissipated since the start.
    "/until/dissipated_energy": Of("DissipatedEnergy"), "Stop at dissipated energy", "", ENERGY;
    /// `exact` wears by local pressure times local slip. `simplified` is the rule (14) of the paper, an approximation for comparison with
    /// the paper. It is fast only with depth and amplitude held, and it needs a round contact, constant coefficients and no layers. By
    /// default `exact`.
    "/model/method": Word(&["exact", "simplified"]), "Method", "", PLAIN;
    /// The parameter ξ of the rule (14). `auto`, the default, computes ξ = √(0.33 + 0.20/(1 − c/a₀)) from the stick ratio c/a₀ of the
    /// unworn contact at the largest amplitude (0 in gross slip); the canonical scenario holds the number. The paper uses 0.8. The exact
    /// method uses ξ only for `compare`.
    "/model/xi": Either(&["Auto", "Xi"]), "Fitting parameter", "$ξ$", PLAIN;
    /// The relative error of wear volume and depth at which the exact method aims, no bound: the result states its errors. The simplified
    /// rule ignores it. By default 0.003.
    "/model/tolerance": Of("Tolerance"), "Tolerance", "", PLAIN;
    /// Run the simplified rule beside an exact run, where that rule applies: `comparison` then holds its history, its errors and the ξ that
    /// fits best. The simplified rule ignores it. By default false.
    "/model/compare": Flag, "Compare with simplified rule", "", PLAIN;
    /// Radii of a profile; the volume is right to about 1e-4 at 256, with second order up to 512. More radii only make the curves denser. By
    /// default 256.
    "/model/points": Whole(POINTS_RANGE.0, POINTS_RANGE.1), "Output radii", "", PLAIN;
}

/// The names of values whose names are not their words.
pub const VALUES: &[(&str, &str)] = &[
    ("power", "Power law"),
    ("table", "Measured profile"),
    ("exact", "Exact method"),
    ("simplified", "Simplified rule"),
    ("log", "Logarithmic"),
];

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
