//! What the rows of the inputs say, and those of the forms that the objects of a scenario have. The JSON Schema, the form of the page,
//! studies, figures and reports follow from the rows, which stand beside the types that read the inputs.

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
pub(super) const fn between(least: f64, most: f64) -> Measure {
    measure(Number, "", [least, least, most, most])
}

/// A plain number, or no number.
pub(super) const PLAIN: Measure =
    Measure { dimension: Number, units: "", usual: None, bare: f64::NEG_INFINITY };
pub(super) const RATIO: Measure = between(0.0, 1.0);
pub(super) const FRICTION: Measure = between(0.05, 1.5);
const MILLI: &str = "mm, m, um, nm, cm, in, mil";
pub(super) const RADIUS: Measure =
    Measure { bare: 5e-5, ..measure(Length, MILLI, [1e-6, 1e-6, 2.0, 100.0]) };
pub(super) const MICRO: Measure =
    measure(Length, "um, m, mm, nm, cm, in, mil", [1e-10, 1e-10, 2e-3, 2e-3]);
pub(super) const ANGLE: Measure = measure(Angle, "deg, rad, mrad", [1e-5, 1e-3, 1.57, 1.57]);
// MPa comes before the others: it is meant most often by a number that no field has in GPa.
const GIGA: &str = "GPa, MPa, kPa, Pa, N/mm^2";
pub(super) const MODULUS: Measure = measure(Stress, GIGA, [1e4, 1e9, 2e12, 2e12]);
pub(super) const STRENGTH: Measure =
    measure(Stress, "MPa, GPa, kPa, Pa, N/mm^2", [1e4, 1e7, 1e10, 2e10]);
pub(super) const HARDNESS: Measure = measure(Stress, GIGA, [1e5, 1e7, 1e11, 1e12]);
const PER_LOAD: &str = "mm^3/(N m), m^3/(N m), um^3/(N m), mm^2/N, 1/Pa, 1/kPa, 1/MPa, 1/GPa";
pub(super) const WEAR: Measure = measure(WearCoefficient, PER_LOAD, [1e-20, 1e-20, 1e-10, 1e-10]);
const PER_ENERGY: &str = "mm^3/J, m^3/J, um^3/J, mm^3/kJ";
pub(super) const ENERGY_WEAR: Measure = measure(EnergyWear, PER_ENERGY, [1e-20, 1e-20, 1e-9, 1e-9]);
pub(super) const FORCE: Measure = measure(Force, "N, mN, kN, uN, MN", [1e-6, 1e-6, 1e6, 1e6]);
const STIFF: &str = "N/um, N/m, N/mm, kN/mm, MN/m";
pub(super) const STIFFNESS: Measure = measure(Stiffness, STIFF, [1e2, 1e5, 1e10, 1e12]);
pub(super) const ENERGY: Measure = measure(Energy, "J, mJ, kJ, uJ", [1e-9, 1e-9, 1e9, 1e9]);
pub(super) const VOLUME: Measure =
    measure(Volume, "mm^3, m^3, um^3, cm^3", [1e-22, 1e-22, 1e-5, 1e-5]);

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

/// A form of an object.
#[derive(Debug, Clone, Copy)]
pub struct ObjectForm {
    /// Its name in the schema.
    pub name: &'static str,
    /// What it is, in sentences.
    pub about: &'static str,
    /// The pointer of the object, with `#` in place of the place in a list.
    pub pointer: &'static str,
    /// The geometry of the contact, `round` or `line`, if it needs one.
    pub geometry: &'static str,
    /// The members that it must have. After `=` is the value.
    pub required: &'static [&'static str],
    /// The members that it can have.
    pub optional: &'static [&'static str],
    /// An example, as JSON; empty if there is none.
    pub example: &'static str,
}

/// Defines inputs: what each is, its pointer, form, name and symbol, and what it measures. After `forms:` it defines the forms of the
/// objects: what each is, its name, the pointer of the object, perhaps the geometry, the members that it must have and those that it can
/// have, and perhaps an example.
macro_rules! rows {
    ($($(#[doc = $about:literal])* $pointer:literal: $form:ident $(($($part:expr),*))?, $words:literal, $symbol:literal, $measure:ident $(($($end:literal),*))?;)*
    forms:
    $($(#[doc = $said:literal])* $name:ident $object:literal $($geometry:ident)? [$($required:literal),*] [$($optional:literal),*] $($example:literal)?;)*) => {
        pub(super) const INPUTS: &[$crate::input::rows::Input] = &[$($crate::input::rows::Input {
            pointer: $pointer,
            about: concat!($($about),*),
            form: $crate::input::rows::Form::$form $(($($part),*))?,
            words: $words,
            symbol: $symbol,
            measure: $crate::input::rows::$measure $(($($end),*))?,
        }),*];
        pub(super) const FORMS: &[$crate::input::rows::ObjectForm] = &[$($crate::input::rows::ObjectForm {
            name: stringify!($name),
            about: concat!($($said),*),
            pointer: $object,
            geometry: concat!($(stringify!($geometry))?),
            required: &[$($required),*],
            optional: &[$($optional),*],
            example: concat!($($example)?),
        }),*];
    };
}
pub(super) use rows;
