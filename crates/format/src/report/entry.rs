//! What a report says of one result.

use serde_json::Value;

use super::html::{self, pairs, section};
use super::inputs::Input;
use super::measured::Measured;
use crate::notation::{Notation, cycles, digits, with_unit};
use fretwork_job::TaskKind;
use fretwork_plot::Figure;

/// What is known about a result besides its document.
#[derive(Debug, Clone, Default)]
pub struct About {
    /// The label of a job.
    pub label: Option<String>,
    /// The scenario or study as the client wrote it.
    pub submitted: Option<Value>,
    /// When the result was computed.
    pub computed: Option<String>,
    /// The version of the program that computed it.
    pub version: Option<String>,
    /// The warnings about the bodies, as a JSON array.
    pub warnings: Value,
    /// What was measured in the test that a run simulates.
    pub measured: Vec<Measured>,
}

/// A number of a run.
pub struct Number {
    pub(super) name: String,
    /// The value in SI.
    pub(super) value: f64,
    pub(super) unit: &'static str,
    /// Whether it belongs to the unworn contact or the limiting state.
    pub(super) is_unworn: bool,
    /// Its numerical error and its model error, in words.
    pub(super) errors: [String; 2],
}

impl Number {
    pub(super) fn new(name: String, value: f64, unit: &'static str) -> Self {
        Self { name, value, unit, is_unworn: false, errors: Default::default() }
    }

    /// The value in the unit for values up to `size`.
    pub(super) fn text(&self, notation: Notation, size: f64, count: u8) -> String {
        let (unit, factor) = notation.scale(self.unit, size);
        match self.value {
            value if value.is_infinite() => "Infinite".to_owned(),
            value if self.unit == "1" && value >= 100.0 => cycles(value),
            value => with_unit(&digits(value * factor, count), &unit),
        }
    }
}

/// What a report says of one result.
#[derive(Default)]
pub struct Entry {
    pub(super) kind: TaskKind,
    pub(super) notation: Notation,
    pub(super) label: Option<String>,
    pub(super) title: String,
    pub(super) subtitle: String,
    /// The inputs as submitted if that is known, otherwise as computed.
    pub(super) inputs: Vec<Input>,
    /// The inputs as computed.
    pub(super) asked: Vec<Input>,
    /// The last output cycle of a run, and the numbers: those of this cycle, then those of the unworn contact.
    pub(super) cycles: f64,
    pub(super) numbers: Vec<Number>,
    /// Sections above and below the figures, as HTML.
    pub(super) sections: String,
    pub(super) figures: Vec<String>,
    pub(super) table: String,
    /// Figures with one curve, which a comparison draws together.
    pub(super) curves: Vec<Figure>,
    pub(super) warnings: Vec<String>,
    /// Where the result comes from: names and values.
    pub(super) origin: Vec<(String, String)>,
    /// The command that computes it again; `None` if it would be long.
    pub(super) command: Option<String>,
}

impl Entry {
    /// Its label, or a name made of its values.
    pub(super) fn name(&self) -> &str {
        self.label.as_deref().unwrap_or(&self.title)
    }

    /// What it is, besides its name.
    pub(super) fn about(&self) -> String {
        match &self.label {
            Some(_) => format!("{} · {}", self.title, self.subtitle),
            None => self.subtitle.clone(),
        }
    }
}

/// Where a result comes from, and how it is computed again.
pub fn origin(title: &str, entry: &Entry) -> String {
    let again = match &entry.command {
        Some(command) => format!("<p>To compute it again:</p><pre>{}</pre>", html::lines(command)),
        None => format!(
            "<p>To compute it again, submit the member <code>{}</code> of the result with this key.</p>",
            entry.kind.member()
        ),
    };
    section(title, &(pairs(&entry.origin) + &again))
}

/// The texts of lists of warnings, each once.
pub fn warnings(lists: &[&Value]) -> Vec<String> {
    let mut texts: Vec<String> = Vec::new();
    for warning in lists.iter().filter_map(|list| list.as_array()).flatten() {
        let detail = warning["detail"].as_str().unwrap_or_default();
        let about = ["output", "member"].map(|name| warning[name].as_str());
        let detail = match about.into_iter().flatten().next() {
            Some(about) => format!("{about}: {detail}"),
            None => detail.to_owned(),
        };
        if !texts.contains(&detail) {
            texts.push(detail);
        }
    }
    texts
}
