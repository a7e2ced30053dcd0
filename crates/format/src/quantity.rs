//! The quantities that a figure can show.

use std::fmt;
use std::sync::LazyLock;

use fretwork_engine::{History, outcome};

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
    /// The label of the vertical axis, without symbol and unit.
    words: &'static str,
    symbol: &'static str,
}

/// The curves over the radius: their names, the titles of their figures, and the labels of their axes.
const PROFILES: [[&str; 3]; 5] = [
    ["worn", "Worn profile", "Height"],
    ["wear", "Wear depth over the radius", "Wear depth"],
    ["image", "MDR image", "Image"],
    ["pressure", "Contact pressure", "Pressure"],
    ["slip", "Slip amplitude over the radius", "Slip amplitude"],
];

/// All quantities, the default first: the profiles, the columns of the history, and the loops.
pub static QUANTITIES: LazyLock<Vec<Quantity>> = LazyLock::new(|| {
    let of = |part, name, title, words| {
        let symbol = outcome::Quantity::named(name).map_or("", |quantity| quantity.symbol);
        Quantity { name, part, title, words, symbol }
    };
    let profiles = PROFILES.map(|[name, title, words]| of(Part::Profiles, name, title, words));
    let columns =
        History::MEMBERS.iter().filter_map(|column| outcome::Quantity::named(column.name));
    let columns = columns.map(|column| match column.name {
        // The figure has two curves, the contact radius and the stick radius, so its axis has no symbol.
        "contact_radius" => Quantity {
            symbol: "",
            ..of(Part::History, column.name, "Contact and stick radius", "Radius")
        },
        name => of(Part::History, name, column.words, column.words),
    });
    let columns = columns.filter(|column| !column.name.ends_with("cycles"));
    let loops = of(Part::Loops, "loops", "Force–displacement loops", "Tangential force");
    profiles.into_iter().chain(columns).chain([loops]).collect()
});

impl fmt::Debug for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl Quantity {
    /// The quantity with this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        QUANTITIES.iter().find(|quantity| quantity.name == name)
    }

    /// The title of the figure, and the label of its vertical axis without the unit.
    pub(super) fn names(&self, is_line: bool) -> [String; 2] {
        let column = outcome::Quantity::named(self.name).filter(|_| self.part == Part::History);
        let [title, words] = match column {
            Some(column) if self.words == column.words => [column.words_of(is_line); 2],
            _ => [self.title, self.words],
        };
        [title.to_owned(), format!("{words} {}", self.symbol).trim_end().to_owned()]
    }

    /// Whether the figure has one curve per output cycle, so that cycles can be selected.
    pub fn has_curve_per_cycle(&self) -> bool {
        self.part != Part::History
    }

    /// Whether values are positive and negative, so that logarithmic axes are impossible.
    pub fn has_sign(&self) -> bool {
        self.part == Part::Loops
    }

    /// Whether the value jumps when a new block of the motion begins.
    pub(super) fn jumps_between_blocks(&self) -> bool {
        matches!(
            self.name,
            "amplitude"
                | "tangential_force"
                | "energy_per_cycle"
                | "contact_radius"
                | "stick_radius"
        )
    }

    /// The columns that are drawn together, each with its label in the legend.
    pub(super) fn columns(&self) -> Vec<(&'static str, &'static str)> {
        match self.name {
            "contact_radius" => {
                vec![("contact_radius", "Contact radius $a$"), ("stick_radius", "Stick radius $c$")]
            }
            name => vec![(name, "")],
        }
    }
}
