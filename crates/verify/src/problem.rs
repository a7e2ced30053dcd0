//! Wear problems for the checks: a contact, and the quantities that are held constant while it wears. In units of the
//! unworn contact.

use std::sync::Arc;

use serde_json::Value;

use fretwork_engine::DEFAULT_TOLERANCE;
use fretwork_engine::contact::record::DisplacementRecord;
use fretwork_engine::contact::{Block, Contact, Control, Held, Normal, Shape, UnwornSums};
use fretwork_engine::reference::stick_ratio;
use fretwork_engine::solver::stepped::law::{Law, WearProblem};
use fretwork_engine::solver::stepped::march::{March, MarchState};
use fretwork_engine::solver::stepped::wearing::WornContact;

/// The tolerance with which a scenario integrates the simplified rule in time.
pub const RULE_TOLERANCE: f64 = 7e-4;

/// A column of the table: its symbol, its name, and the function that computes its value for a worn contact.
pub type TableColumn = (&'static str, &'static str, fn(&WornContact) -> f64);

pub const VOLUME: TableColumn = ("V", "wear_volume", |worn| worn.volume);
pub const DEEPEST: TableColumn = ("w", "wear_depth", |worn| worn.deepest);
pub const FORCE: TableColumn = ("F", "normal_force", |worn| 2.0 * worn.normal);
pub const DEPTH: TableColumn = ("d", "indentation_depth", |worn| worn.depth);
pub const STICK: TableColumn = ("c", "stick_radius", |worn| worn.stick);
pub const RADIUS: TableColumn = ("a", "contact_radius", |worn| worn.contact_radius);

/// A contact, and the quantities that are held constant while it wears.
pub struct ContactProblem {
    pub name: String,
    pub contact: Contact,
    pub control: Control,
}

impl ContactProblem {
    /// A power law with exponent n and stick radius c. The amplitude is held.
    pub fn amplitude(normal: Normal, n: f64, c: f64) -> Option<Self> {
        let contact = Contact::sticking(Shape::power(n), c)?;
        let control = Control::constant(normal, Held::Threshold, contact.threshold);
        Some(Self { name: format!("{}, c = {c}", shape(n)), contact, control })
    }

    /// A power law with exponent n. The tangential force Q = qμF is held.
    pub fn force(normal: Normal, n: f64, q: f64) -> Option<Self> {
        let contact = Contact::sticking(Shape::power(n), stick_ratio(n, q))?;
        let held = Held::Force(q * contact.shape.half_force());
        let control = Control::constant(normal, held, contact.threshold);
        Some(Self { name: format!("{}, q = {q}", shape(n)), contact, control })
    }

    /// The problem that a row of the table describes.
    pub fn of_row(normal: Normal, row: &Value) -> Option<Self> {
        let n = number(row, "exponent")?;
        match (number(row, "q"), number(row, "stick_radius_initial")) {
            (Some(q), _) => Self::force(normal, n, q),
            (None, Some(c)) => Self::amplitude(normal, n, c),
            (None, None) => Self::amplitude(normal, n, number(row, "stick_radius")?),
        }
    }

    /// A paraboloid with each pair of held quantities.
    pub fn modes() -> Option<Vec<Self>> {
        use Normal::{Depth, Force};
        let contact = Contact::sticking(Shape::power(2.0), 0.5)?;
        let slipping = Contact::new(Shape::power(2.0), 1.8)?;
        let threshold = contact.threshold;
        let compliance = 0.5;
        let yielded = 2.0 * compliance * UnwornSums::of(&contact, None).tangential;
        let rig = Held::Rig { amplitude: threshold + yielded, compliance };
        let block = |share: f64, end: f64| Block::new(share * threshold, end);
        let blocks = [block(1.0, 2.0), block(0.6, 5.0), block(1.1, 1e9)];
        let record = Held::Record(Arc::new(DisplacementRecord::new(&[1.0, -1.0, 0.6, -0.4, 0.8])?));
        let mut modes = vec![Self::force(Depth, 2.0, 0.5)?, Self::force(Force, 2.0, 0.7)?];
        (modes[0].name, modes[1].name) = ("depth, Q".to_owned(), "force, Q".to_owned());
        for (name, contact, normal, held) in [
            ("depth, amplitude", &contact, Depth, Held::Threshold),
            ("force, amplitude", &contact, Force, Held::Threshold),
            ("depth, rig", &contact, Depth, rig.clone()),
            ("force, rig", &contact, Force, rig),
            ("depth, blocks", &contact, Depth, Held::Threshold),
            ("force, blocks", &contact, Force, Held::Threshold),
            ("depth, record", &contact, Depth, record),
            ("depth, gross slip", &slipping, Depth, Held::Threshold),
            ("force, gross slip", &slipping, Force, Held::Threshold),
        ] {
            let mut control = Control::constant(normal, held, contact.threshold);
            if name.ends_with("blocks") {
                control.blocks = blocks.clone().into();
            }
            modes.push(Self { name: name.to_owned(), contact: contact.clone(), control });
        }
        Some(modes)
    }

    /// The wear problem of this contact with a wear law.
    pub fn under(&self, law: Law) -> WearProblem<'_> {
        WearProblem { contact: &self.contact, control: &self.control, law }
    }

    /// Starts a run up to the output cycle `last`.
    pub fn march(&self, law: Law, tolerance: f64, last: f64) -> Option<March> {
        March::new(self.under(law), tolerance, last)
    }

    /// The states at the given output cycles, with the default tolerance.
    pub fn states(&self, law: Law, instants: &[f64]) -> Option<Vec<MarchState>> {
        let tolerance = if law == Law::Exact { DEFAULT_TOLERANCE } else { RULE_TOLERANCE };
        let mut march = self.march(law, tolerance, *instants.last()?)?;
        Some(instants.iter().map(|instant| at(&mut march, *instant)).collect())
    }
}

/// Runs to an output cycle and returns the state there.
pub fn at(march: &mut March, instant: f64) -> MarchState {
    while march.advance(instant) {}
    march.at(instant)
}

/// The name of a power law with exponent n.
pub fn shape(n: f64) -> String {
    match n {
        1.0 => "cone".to_owned(),
        2.0 => "paraboloid".to_owned(),
        _ => format!("n = {n}"),
    }
}

/// A number in a row of the table.
pub fn number(row: &Value, name: &str) -> Option<f64> {
    row.get(name)?.as_f64()
}

/// A list of numbers in a row of the table.
pub fn numbers(row: &Value, name: &str) -> Option<Vec<f64>> {
    row.get(name)?.as_array()?.iter().map(Value::as_f64).collect()
}
