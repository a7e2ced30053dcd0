//! The table of the numbers of a result: their units, symbols and names, the sections that contain them, and their
//! meaning in each section.
//!
//! A new column of the history is a line in [`QUANTITIES`], a line in [`History`], and its computation. The units, the
//! outputs of studies, the derivatives, figures, exports, schemas and the texts of the page are derived from these
//! lines.

use std::array;

use serde::Serialize;
use utoipa::ToSchema;

/// A quantity. Its name has the same meaning everywhere.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Quantity {
    /// The name in documents.
    pub name: &'static str,
    /// The SI unit, or `1`.
    pub unit: &'static str,
    /// The name for people.
    pub words: &'static str,
    /// The symbol, with the letters of the equations between `$`; empty if it has none.
    pub symbol: &'static str,
}

/// All quantities, in the order of the member `units` of a result.
pub const QUANTITIES: &[Quantity] = &[
    quantity(["cycles", "1", "Cycles", "$N$"]),
    quantity(["normalized_cycles", "1", "Normalized cycles", "$Ñ$"]),
    quantity(["contact_radius", "m", "Contact radius", "$a$"]),
    quantity(["stick_radius", "m", "Stick radius", "$c$"]),
    quantity(["scar_radius", "m", "Scar radius", ""]),
    quantity(["indentation_depth", "m", "Indentation depth", "$d$"]),
    quantity(["normal_force", "N", "Normal force", "$F$"]),
    quantity(["tangential_force", "N", "Tangential force amplitude", "$Q$"]),
    quantity(["amplitude", "m", "Amplitude at the contact", "$U$"]),
    quantity(["gross_slip_amplitude", "m", "Gross-slip threshold at the contact", ""]),
    quantity(["normal_modulus", "Pa", "Normal modulus", "$E$*"]),
    quantity(["tangential_modulus", "Pa", "Tangential modulus", "$G$*"]),
    quantity(["wear_coefficient", "1/Pa", "Wear coefficient", "$k_w$"]),
    quantity(["peak_pressure", "Pa", "Peak pressure", ""]),
    quantity(["mean_pressure", "Pa", "Mean pressure", ""]),
    quantity(["wear_volume", "m^3", "Wear volume", "$V$"]),
    quantity(["wear_depth", "m", "Largest wear depth", ""]),
    quantity(["wear_depth_radius", "m", "Radius of the largest wear depth", ""]),
    quantity(["energy_per_cycle", "J", "Energy per cycle", "$W$"]),
    quantity(["dissipated_energy", "J", "Dissipated energy", "Σ$W$"]),
    quantity(["wear_volume_error", "1", "Relative error of the wear volume", ""]),
    quantity(["wear_depth_error", "1", "Relative error of the wear depth", ""]),
    quantity(["radius", "m", "Radius", "$r$"]),
    quantity(["initial", "m", "Unworn profile", "$f$₀"]),
    quantity(["limiting", "m", "Limiting profile", "$f$∞"]),
    quantity(["worn", "m", "Worn profile", "$f$"]),
    quantity(["wear", "m", "Wear depth", "$w$"]),
    quantity(["image", "m", "MDR image", "$g$"]),
    quantity(["pressure", "Pa", "Pressure", "$p$"]),
    quantity(["slip", "m", "Slip amplitude", ""]),
    quantity(["displacement", "m", "Displacement at the contact", "$u$"]),
    quantity(["energy_ratio", "1", "Energy ratio", "$A$"]),
    quantity(["slip_ratio", "1", "Slip ratio", "$D$"]),
    quantity(["free_ratio", "1", "System-free ratio", "$B$"]),
    quantity(["actuator_amplitude", "m", "Actuator amplitude", ""]),
    quantity(["actuator_energy_ratio", "1", "Energy ratio at the actuator", ""]),
    quantity(["actuator_slip_ratio", "1", "Slip ratio at the actuator", ""]),
    quantity(["actuator_gross_slip_amplitude", "m", "Gross-slip threshold at the actuator", ""]),
    quantity(["scar_half_length", "m", "Half-length of the scar", ""]),
];

/// The names of quantities that differ for a line contact.
pub const LINE_WORDS: &[(&str, &str)] = &[
    ("contact_radius", "Contact half-width"),
    ("stick_radius", "Stick half-width"),
    ("scar_radius", "Scar half-width"),
    ("radius", "Distance x from the middle"),
    // `loop_stiffness` contains the machine.
    ("amplitude", "Amplitude at the reference"),
    ("gross_slip_amplitude", "Gross-slip threshold at the reference"),
    ("displacement", "Displacement at the reference"),
];

/// The sections of a result besides the history: how the names of their numbers begin, and how the symbols end.
pub const SECTION_WORDS: &[(&str, [&str; 2])] =
    &[("scales", ["Unworn", "₀"]), ("unworn", ["Unworn", ""]), ("limit", ["Limiting", ""])];

/// The names and symbols of numbers of sections that do not follow from the quantity.
pub const SPECIAL_WORDS: &[(&str, [&str; 2])] = &[
    ("scales.cycles", ["Characteristic cycles", "$N$₀"]),
    ("unworn.force_ratio", ["Unworn force ratio", "$Q$/($μF$)"]),
    ("unworn.stick_ratio", ["Unworn stick ratio", "$c$/$a$₀"]),
    ("limit.wear_depth", ["Limiting wear depth", ""]),
];

/// The name and the symbol of a number of a section of a result.
pub fn words_in(section: &str, name: &str, is_line: bool) -> Option<[String; 2]> {
    let whole = [section, ".", name].concat();
    if let Some((_, special)) = SPECIAL_WORDS.iter().find(|(name, _)| *name == whole) {
        return Some(special.map(str::to_owned));
    }
    let (_, [begin, end]) = SECTION_WORDS.iter().find(|(name, _)| *name == section)?;
    let quantity = Quantity::named(name)?;
    let end = if quantity.symbol.is_empty() { "" } else { end };
    let words = quantity.words_of(is_line).to_lowercase();
    Some([format!("{begin} {words}"), format!("{}{end}", quantity.symbol)])
}

const fn quantity([name, unit, words, symbol]: [&'static str; 4]) -> Quantity {
    Quantity { name, unit, words, symbol }
}

impl Quantity {
    /// The quantity with this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        QUANTITIES.iter().find(|quantity| quantity.name == name)
    }

    /// Its name for people, in a line contact or a round one.
    pub fn words_of(&self, is_line: bool) -> &'static str {
        let mut of_line = LINE_WORDS.iter().filter(|_| is_line);
        of_line.find(|(name, _)| *name == self.name).map_or(self.words, |(_, words)| words)
    }
}

/// [`QUANTITIES`] as a JSON object of their units.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ResultUnits;

impl Serialize for ResultUnits {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(QUANTITIES.iter().map(|quantity| (quantity.name, quantity.unit)))
    }
}

/// A number of a section of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SectionMember {
    /// The name of the quantity.
    pub name: &'static str,
    /// The meaning of the quantity in this section.
    pub meaning: &'static str,
}

/// Declares a section of a result, and the table of its numbers.
macro_rules! section {
    ($(#[$about:meta])* $name:ident: $view:ty = $get:path; $($(#[$attribute:meta])* $member:ident: $type:ty = $meaning:literal;)+) => {
        #[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
        $(#[$about])*
        pub struct $name {
            $(#[doc = $meaning] $(#[$attribute])* pub $member: $type,)+
        }

        impl $name {
            /// Its numbers, in the order of the JSON.
            pub const MEMBERS: &[SectionMember] =
                &[$(SectionMember { name: stringify!($member), meaning: $meaning }),+];

            /// The values of [`Self::MEMBERS`].
            pub fn values(&self) -> [$view; Self::MEMBERS.len()] {
                [$($get(&self.$member)),+]
            }
        }
    };
}

/// Converts a number, or a number that some results do not have, to an `Option`.
fn number<T: Copy + Into<Option<f64>>>(number: &T) -> Option<f64> {
    (*number).into()
}

section! {
    /// The scales of the unworn contact. All results are multiples of them.
    #[derive(Copy)]
    #[schema(as = Scales)]
    ContactScales: Option<f64> = number;
    contact_radius: f64 = "Length scale a₀: the contact radius";
    indentation_depth: f64 = "Depth scale d₀: the indentation depth, or 2F/(πE*·length) of a line contact";
    normal_force: f64 = "Force scale F₀ of the unworn contact";
    cycles: f64 = "Characteristic cycles N₀, after which wear is significant";
}

section! {
    /// The state before the first cycle.
    #[derive(Copy)]
    Unworn: Option<f64> = number;
    normal_modulus: f64 = "E*";
    #[schema(value_type = Option<f64>, required)]
    tangential_modulus: f64 = "G*; null for a line contact, where it has no meaning";
    wear_coefficient: f64 = "k_w";
    #[schema(value_type = Option<f64>, required)]
    peak_pressure: f64 = "The largest pressure. It is infinite for a cone and at the edge of a flat: then it is null in JSON";
    mean_pressure: f64 = "F/(πa²), or F/(2a·length) of a line contact";
    #[schema(value_type = Option<f64>, required)]
    gross_slip_amplitude: f64 = "The amplitude U at the contact, or at the reference of a line contact, at which the whole contact slips; null for a line contact without a reference";
    stick_radius: f64 = "The stick radius c; 0 in gross slip";
    #[schema(value_type = Option<f64>, required)]
    amplitude: f64 = "The amplitude U at the contact, or at the reference of a line contact; null for a line contact without a reference";
    tangential_force: f64 = "The amplitude Q of the tangential force";
    energy_per_cycle: f64 = "The energy W lost per cycle";
    #[schema(value_type = Option<f64>, required)]
    energy_ratio: f64 = "A = W/(4QU), the energy ratio of the sliding transition. It is 0.2 for a paraboloid at the gross-slip threshold; null for a line contact without a reference";
    #[schema(value_type = Option<f64>, required)]
    slip_ratio: f64 = "D = δ₀/U, the slip ratio: half of the loop width at Q = 0, divided by the amplitude. It is 0.26 for a paraboloid at the gross-slip threshold; null for a line contact without a reference";
    free_ratio: f64 = "B = W/(4Qδ₀), the system-free ratio; 0 if the loop is closed. It is 0.77 for a paraboloid at the gross-slip threshold. It is the same for the stroke at the actuator, because the rig is elastic";
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    actuator_amplitude: Option<f64> = "The amplitude of the actuator, U_rig = U + Q/k_rig. Only with a rig";
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    actuator_energy_ratio: Option<f64> = "The energy ratio for the stroke at the actuator, W/(4QU_rig). Only with a rig";
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    actuator_slip_ratio: Option<f64> = "The slip ratio for the stroke at the actuator, δ₀/U_rig. Only with a rig";
    #[schema(nullable = false)]
    #[serde(skip_serializing_if = "Option::is_none")]
    actuator_gross_slip_amplitude: Option<f64> = "The amplitude of the actuator at which the whole contact slips, `gross_slip_amplitude` + μF/k_rig. Only with a rig";
}

section! {
    /// The limiting state for many cycles; null without a closed form.
    #[derive(Copy)]
    #[schema(as = Limit)]
    LimitState: Option<f64> = number;
    contact_radius: f64 = "ã: the outer radius of the limiting profile";
    stick_radius: f64 = "The limiting stick radius c";
    wear_volume: f64 = "The limiting wear volume V∞";
    wear_depth: f64 = "The largest wear depth";
    wear_depth_radius: f64 = "The radius of the largest wear depth";
    normal_force: f64 = "The limiting normal force F∞. Only the core inside c carries it";
    #[schema(value_type = Option<f64>)]
    indentation_depth: f64 = "The limiting indentation depth d; null for a line contact";
    tangential_force: f64 = "The limiting tangential force Q∞ = 2G*U·c";
}

section! {
    /// One array per quantity, all of the same length. Entry 0 is the unworn state. A run that ends early has fewer entries than
    /// requested.
    #[derive(Default)]
    #[schema(as = Columns)]
    History: &[f64] = Vec::as_slice;
    cycles: Vec<f64> = "Load cycles N; the first entry is 0";
    normalized_cycles: Vec<f64> = "Ñ = N/N₀";
    wear_volume: Vec<f64> = "Wear volume V of both bodies together";
    wear_depth: Vec<f64> = "Largest depth of the wear scar";
    scar_radius: Vec<f64> = "Largest radius with wear, as seen in a microscope; 0 without wear";
    contact_radius: Vec<f64> = "Contact radius a. The simplified rule with held depth keeps it at a₀";
    stick_radius: Vec<f64> = "Stick radius c; 0 in gross slip";
    normal_force: Vec<f64> = "Normal force F";
    #[schema(value_type = Vec<Option<f64>>)]
    indentation_depth: Vec<f64> = "Indentation depth d. Of a line contact it is measured against `reference_distance`, and null without it";
    #[schema(value_type = Vec<Option<f64>>)]
    amplitude: Vec<f64> = "U, half of the peak-to-peak displacement at the contact, or at the reference of a line contact; null for a line contact without a reference";
    tangential_force: Vec<f64> = "Amplitude Q of the tangential force";
    energy_per_cycle: Vec<f64> = "Energy W dissipated in one cycle";
    dissipated_energy: Vec<f64> = "Energy Σ W dissipated since the start";
    #[serde(default)]
    wear_volume_error: Vec<f64> = "Estimated relative error of `wear_volume` due to discretisation; 0 at cycle 0. Results of version 0.3.0 and earlier do not have it";
    #[serde(default)]
    wear_depth_error: Vec<f64> = "Estimated relative error of `wear_depth` due to discretisation; 0 at cycle 0. Results of version 0.3.0 and earlier do not have it";
    #[schema(value_type = Vec<Option<f64>>)]
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    gross_slip_amplitude: Vec<f64> = "The amplitude U, at the same place, at which the whole contact would slip as it is worn at this cycle; null for a line contact without a reference. Results of version 0.4.0 and earlier do not have it";
    #[schema(value_type = Vec<Option<f64>>)]
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    actuator_gross_slip_amplitude: Vec<f64> = "The same at the actuator. Only with a rig";
}

impl History {
    /// The columns with their names, in the order of the JSON.
    pub fn columns(&self) -> [(&'static str, &[f64]); Self::MEMBERS.len()] {
        let values = self.values();
        array::from_fn(|place| (Self::MEMBERS[place].name, values[place]))
    }
}
