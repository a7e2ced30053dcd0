//! The outline of a result: the words and numbers by which users search for it.

use std::array;

use serde_json::{Map, Value, json};

use fretwork_engine::outcome::Quantity;
use fretwork_engine::request::quantity::Dimension::{
    self, Angle, Energy, Force, Length, Number, Stiffness, Stress, Volume, WearCoefficient,
};
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
    #[must_use]
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

/// All words that users can search by.
pub const WORDS: [Word; 6] = [
    Word { name: "kind", values: &KINDS, pointer: "/kind" },
    Word {
        name: "shape",
        values: &[
            "paraboloid",
            "sphere",
            "cone",
            "power",
            "truncated_paraboloid",
            "truncated_cone",
            "table",
        ],
        pointer: "/scenario/profile/shape",
    },
    Word { name: "method", values: &["simplified", "exact"], pointer: "/scenario/model/method" },
    Word {
        name: "regime",
        values: &["full_stick", "partial_slip", "gross_slip"],
        pointer: "/summary/regime",
    },
    Word { name: "held", values: &["depth", "force"], pointer: "/scenario/load/held" },
    Word {
        name: "motion",
        values: &["amplitude", "tangential_force", "rig", "blocks", "reversals"],
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
    #[must_use]
    pub fn of(document: &Value) -> Self {
        let word = |word: &Word| match at(document, word.pointer)? {
            Value::String(text) => Some(text.clone()),
            motion => motion_kind(motion),
        };
        let number = |scalar: &Scalar| at(document, scalar.pointer)?.as_f64();
        Self {
            words: array::from_fn(|place| word(&WORDS[place])),
            scalars: array::from_fn(|place| number(&SCALARS[place])),
        }
    }

    /// The words as members of a JSON object.
    #[must_use]
    pub fn words(&self) -> Map<String, Value> {
        let members = WORDS.iter().zip(&self.words);
        members.map(|(word, value)| (word.name.into(), json!(value))).collect()
    }

    /// The numbers as members of a JSON object.
    #[must_use]
    pub fn scalars(&self) -> Map<String, Value> {
        let members = SCALARS.iter().zip(&self.scalars);
        members.map(|(scalar, value)| (scalar.name.into(), json!(value))).collect()
    }
}

/// The value at a JSON pointer without escapes. `Value::pointer` allocates for each member.
fn at<'a>(document: &'a Value, pointer: &str) -> Option<&'a Value> {
    pointer.split('/').skip(1).try_fold(document, |value, member| value.get(member))
}

/// How a canonical scenario gives the tangential motion.
fn motion_kind(motion: &Value) -> Option<String> {
    let kinds = [("rig_stiffness", "rig"), ("blocks", "blocks"), ("reversals", "reversals")];
    let kind = kinds.iter().find(|(member, _)| motion.get(member).is_some());
    Some(kind.map_or_else(|| motion.get("held")?.as_str(), |(_, kind)| Some(*kind))?.to_owned())
}
