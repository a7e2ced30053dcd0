//! The quantities that a figure can show.

use std::fmt;

use super::kind::Part;

/// A quantity that a figure can show.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Quantity {
    /// The name in documents and addresses.
    pub name: &'static str,
    /// The table that holds it.
    pub(super) part: Part,
    /// The title of the figure.
    pub(super) title: &'static str,
    /// The label of the vertical axis, without the unit.
    pub(super) label: &'static str,
}

const fn quantity(
    part: Part,
    name: &'static str,
    title: &'static str,
    label: &'static str,
) -> Quantity {
    Quantity { name, part, title, label }
}

/// All quantities, the default first.
pub const QUANTITIES: [Quantity; 15] = [
    quantity(Part::Profiles, "worn", "Worn profile", "Height $f$"),
    quantity(Part::Profiles, "wear", "Wear depth over the radius", "Wear depth $w$"),
    quantity(Part::Profiles, "image", "One-dimensional image", "Image $g$"),
    quantity(Part::Profiles, "pressure", "Contact pressure", "Pressure $p$"),
    quantity(Part::Profiles, "slip", "Slip amplitude over the radius", "Slip amplitude"),
    quantity(Part::History, "wear_volume", "Wear volume", "Wear volume $V$"),
    quantity(Part::History, "wear_depth", "Largest wear depth", "Largest wear depth"),
    quantity(Part::History, "normal_force", "Normal force", "Normal force $F$"),
    quantity(Part::History, "indentation_depth", "Indentation depth", "Indentation depth $d$"),
    quantity(Part::History, "contact_radius", "Contact and stick radius", "Radius"),
    quantity(Part::History, "energy_per_cycle", "Energy per cycle", "Energy per cycle $W$"),
    quantity(Part::History, "dissipated_energy", "Dissipated energy", "Dissipated energy Σ$W$"),
    quantity(
        Part::History,
        "tangential_force",
        "Tangential force amplitude",
        "Tangential force amplitude $Q$",
    ),
    quantity(Part::History, "amplitude", "Displacement amplitude", "Displacement amplitude $U$"),
    quantity(Part::Loops, "loops", "Force–displacement loops", "Tangential force"),
];

impl fmt::Debug for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl Quantity {
    /// The quantity with this name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        QUANTITIES.iter().find(|quantity| quantity.name == name)
    }

    /// Whether the figure has one curve per output cycle, so that cycles can be selected.
    #[must_use]
    pub fn has_curve_per_cycle(&self) -> bool {
        self.part != Part::History
    }

    /// Whether values are positive and negative, so that logarithmic axes are impossible.
    #[must_use]
    pub fn has_sign(&self) -> bool {
        self.part == Part::Loops
    }

    /// Whether the value jumps when a new block of the motion begins.
    pub(super) fn jumps_between_blocks(&self) -> bool {
        matches!(
            self.name,
            "amplitude" | "tangential_force" | "energy_per_cycle" | "contact_radius"
        )
    }

    /// The columns that are drawn together, each with its label in the legend.
    pub(super) fn columns(&self) -> Vec<(&'static str, &'static str)> {
        match self.name {
            "contact_radius" => {
                vec![("contact_radius", "contact radius $a$"), ("stick_radius", "stick radius $c$")]
            }
            name => vec![(name, "")],
        }
    }
}
