//! The outline of a result: the words and numbers by which users search for it.

use std::array;

use serde_json::{Map, Value, json};

use fretwork_engine::input::indenter::SHAPES;
use fretwork_engine::input::quantity::Dimension::{
    self, Angle, Energy, Force, Length, Number, Stiffness, Stress, Volume, WearCoefficient,
};
use fretwork_engine::outcome::Quantity;
use fretwork_study::Kind;

/// A number that users can search by.
#[derive(Debug)]
pub struct Scalar {
    /// Its name, in the API and in the tables.
    pub name: &'static str,
    /// Its physical dimension.
    pub dimension: Dimension,
    /// Whether it is an input. The distance of two scenarios is computed from their inputs.
    pub is_input: bool,
    /// JSON pointer into the document of [`Outline::of`].
    pointer: &'static str,
}

macro_rules! scalars {
    ($($is_input:literal $name:ident $dimension:ident $pointer:literal;)*) => {
        /// All numbers that users can search by.
        pub const SCALARS: [Scalar; [$($pointer),*].len()] = [$(Scalar {
            name: stringify!($name),
            dimension: $dimension,
            is_input: $is_input,
            pointer: $pointer,
        }),*];
    };
}

scalars! {
    true  friction             Number          "/scenario/friction";
    true  normal_modulus       Stress          "/scenario/moduli/normal";
    true  tangential_modulus   Stress          "/scenario/moduli/tangential";
    true  wear_coefficient     WearCoefficient "/scenario/wear/coefficient";
    true  radius               Length          "/scenario/profile/radius";
    true  slope_angle          Angle           "/scenario/profile/slope_angle";
    true  flat_radius          Length          "/scenario/profile/flat_radius";
    true  exponent             Number          "/scenario/profile/exponent";
    true  normal_force         Force           "/scales/normal_force";
    false indentation_depth    Length          "/scales/indentation_depth";
    false contact_radius       Length          "/scales/contact_radius";
    false stick_radius         Length          "/unworn/stick_radius";
    true  amplitude            Length          "/unworn/amplitude";
    false gross_slip_amplitude Length          "/unworn/gross_slip_amplitude";
    false tangential_force     Force           "/unworn/tangential_force";
    true  rig_stiffness        Stiffness       "/scenario/motion/rig_stiffness";
    true  points               Number          "/scenario/model/points";
    true  cycles               Number          "/summary/cycles";
    false wear_volume          Volume          "/summary/wear_volume";
    false wear_depth           Length          "/summary/wear_depth";
    false scar_radius          Length          "/summary/scar_radius";
    false dissipated_energy    Energy          "/summary/dissipated_energy";
}

impl Scalar {
    /// The SI unit; `1` for dimensionless numbers.
    pub fn unit(&self) -> &'static str {
        match (Quantity::named(self.name), self.dimension) {
            (Some(quantity), _) => quantity.unit,
            (None, Number) => "1",
            (None, dimension) => dimension.si(),
        }
    }
}

/// A word of a closed set that users can search by.
#[derive(Debug)]
pub struct Word {
    /// Its name, in the API and in the tables.
    pub name: &'static str,
    /// All its values.
    pub values: &'static [&'static str],
    /// JSON pointer into the document of [`Outline::of`].
    pointer: &'static str,
}

/// The words of all kinds of results.
const KINDS: [&str; 1 + Kind::ALL.len()] = {
    let mut words = ["run"; 1 + Kind::ALL.len()];
    let mut place = 0;
    while place < Kind::ALL.len() {
        words[place + 1] = Kind::ALL[place].name;
        place += 1;
    }
    words
};

const GEOMETRY: &str = "geometry";

/// All words that users can search by.
pub const WORDS: [Word; 7] = [
    Word { name: "kind", values: &KINDS, pointer: "/kind" },
    Word { name: "shape", values: SHAPES, pointer: "/scenario/profile/shape" },
    Word { name: GEOMETRY, values: &["round", "line"], pointer: "/scenario/profile" },
    Word { name: "method", values: &["simplified", "exact"], pointer: "/scenario/model/method" },
    Word {
        name: "regime",
        values: &["full_stick", "partial_slip", "gross_slip"],
        pointer: "/summary/regime",
    },
    Word { name: "held", values: &["depth", "force"], pointer: "/scenario/load/held" },
    Word {
        name: "motion",
        values: &[
            "amplitude",
            "tangential_force",
            "rig",
            "blocks",
            "reversals",
            "sliding",
            "aperture",
        ],
        pointer: "/scenario/motion",
    },
];

/// The values of [`WORDS`] and [`SCALARS`] for one result, in the same order. Numbers are in SI.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outline {
    /// The values of [`WORDS`].
    pub words: [Option<String>; WORDS.len()],
    /// The values of [`SCALARS`].
    pub scalars: [Option<f64>; SCALARS.len()],
}

impl Outline {
    /// Reads a document with the members `kind`, `scenario`, `scales`, `unworn` and `summary`.
    /// A value is `None` where the document does not have it.
    pub fn of(document: &Value) -> Self {
        let word = |word: &Word| match (word.name, at(document, word.pointer)?) {
            (GEOMETRY, profile) => Some(geometry(profile).to_owned()),
            (_, Value::String(text)) => Some(text.clone()),
            (_, motion) => motion_kind(motion).map(str::to_owned),
        };
        let number = |scalar: &Scalar| {
            let value = at(document, scalar.pointer)?;
            // A coefficient that changes counts with its value at cycle 0.
            value.as_f64().or_else(|| value.get("values")?.get(0)?.as_f64())
        };
        Self {
            words: array::from_fn(|place| word(&WORDS[place])),
            scalars: array::from_fn(|place| number(&SCALARS[place])),
        }
    }

    /// The words as members of a JSON object.
    pub fn words(&self) -> Map<String, Value> {
        let members = WORDS.iter().zip(&self.words);
        members.map(|(word, value)| (word.name.into(), json!(value))).collect()
    }

    /// The numbers as members of a JSON object.
    pub fn scalars(&self) -> Map<String, Value> {
        let members = SCALARS.iter().zip(&self.scalars);
        members.map(|(scalar, value)| (scalar.name.into(), json!(value))).collect()
    }
}

/// The value at a JSON pointer without escapes. `Value::pointer` allocates for each member.
fn at<'a>(document: &'a Value, pointer: &str) -> Option<&'a Value> {
    pointer.split('/').skip(1).try_fold(document, |value, member| value.get(member))
}

/// The geometry of the contact. Only a line contact has a length.
fn geometry(profile: &Value) -> &'static str {
    if profile.get("length").is_some() { "line" } else { "round" }
}

/// How a canonical scenario gives the tangential motion. A stroke of a line contact against a reference is an
/// amplitude, or that of a rig.
fn motion_kind(motion: &Value) -> Option<&str> {
    let held = motion.get("held").and_then(Value::as_str);
    // Under a held force, the stiffness of the rig only gives the displacements of the loops.
    let has_rig = motion.get("rig_stiffness").is_some() && held != Some("tangential_force");
    let kinds = ["blocks", "reversals"].into_iter().find(|kind| motion.get(kind).is_some());
    let own = [("sliding_amplitude", "sliding"), ("loop_aperture", "aperture")];
    let own = own.into_iter().find_map(|(member, kind)| motion.get(member).map(|_| kind));
    kinds.or(own).or(has_rig.then_some("rig")).or(held)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Prepared;

    /// The words and numbers of a scenario with these members.
    fn outline(members: &Value) -> [Map<String, Value>; 2] {
        let mut scenario = json!({
            "profile": {"shape": "cylinder", "radius": "6 mm", "length": "10 mm"},
            "moduli": {"normal": "110 GPa", "tangential": "93 GPa"}, "friction": 0.9,
            "wear": {"coefficient": 4.8e-14}, "load": {"normal_force": "185 N"},
            "motion": {"sliding_amplitude": "25 um"}, "cycles": [10],
        });
        scenario.as_object_mut().unwrap().extend(members.as_object().unwrap().clone());
        let outline = Prepared::from_scenario(scenario, "").unwrap().compute(|_| {}).outline;
        [outline.words(), outline.scalars()]
    }

    #[test]
    fn geometry_and_motion_of_a_line_contact_are_words_of_the_search() {
        for (motion, kind) in [
            (json!({"sliding_amplitude": "25 um"}), "sliding"),
            (json!({"loop_aperture": "25 um"}), "aperture"),
            (json!({"amplitude": "25 um", "reference_distance": "36 mm"}), "amplitude"),
            (json!({"amplitude": "25 um", "loop_stiffness": "20 N/um"}), "amplitude"),
            (
                json!({"amplitude": "25 um", "reference_distance": "36 mm", "rig_stiffness": "20 N/um"}),
                "rig",
            ),
            (json!({"tangential_force": "5 N/mm"}), "tangential_force"),
            (
                json!({"tangential_force": 50, "reference_distance": "36 mm", "rig_stiffness": 2e7}),
                "tangential_force",
            ),
            (
                json!({"blocks": [{"tangential_force": 50, "cycles": 9}, {"tangential_force": 40, "cycles": 9}]}),
                "blocks",
            ),
        ] {
            let [words, scalars] = outline(&json!({"motion": motion}));
            assert_eq!((&words["geometry"], &words["motion"]), (&json!("line"), &json!(kind)));
            let is_known = !["tangential_force", "aperture", "blocks"].contains(&kind)
                || motion.get("reference_distance").is_some();
            assert_eq!(scalars["amplitude"].is_number(), is_known, "{motion} {scalars:?}");
            assert_eq!(scalars["tangential_modulus"], Value::Null);
        }
        let ball = json!({"shape": "paraboloid", "radius": "10 mm"});
        let [words, scalars] = outline(&json!({"profile": ball, "motion": {"amplitude": "1 um"}}));
        assert_eq!((&words["geometry"], &scalars["amplitude"]), (&json!("round"), &json!(1e-6)));
    }

    #[test]
    fn a_coefficient_that_changes_counts_with_its_value_at_cycle_0() {
        let run_in = json!({"run_in": {"cycles": 100, "from": 0.3, "to": 0.9}});
        let table = json!({"over": "cycles", "at": [0, 100], "values": [1e-14, 2e-14]});
        let [_, scalars] = outline(&json!({"friction": run_in, "wear": {"coefficient": table}}));
        assert_eq!(
            (&scalars["friction"], &scalars["wear_coefficient"]),
            (&json!(0.3), &json!(1e-14))
        );
        let layers = json!([{"thickness": "1 um", "coefficient": 1e-15}]);
        let bodies = json!([{"layers": layers, "coefficient": 1e-14}, {"coefficient": 2e-14}]);
        let [_, scalars] = outline(&json!({"wear": {"bodies": bodies}}));
        assert_eq!(scalars["wear_coefficient"], Value::Null);
    }
}
