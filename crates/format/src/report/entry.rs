//! What a report says of one result.

use serde_json::Value;

use super::html::{self, pairs, section};
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
}

/// A number of a run.
pub struct Number {
    pub(super) words: String,
    /// The value in the unit of the report; `None` if it is no finite number.
    pub(super) value: Option<f64>,
    pub(super) unit: String,
    /// Its numerical error and its model error, in words.
    pub(super) errors: [String; 2],
}

/// What a report says of one result.
pub struct Entry {
    pub(super) kind: TaskKind,
    pub(super) label: Option<String>,
    pub(super) title: String,
    pub(super) subtitle: String,
    /// The inputs as submitted if that is known, otherwise as computed.
    pub(super) inputs: Vec<(String, String)>,
    /// The inputs as computed: pointers and values.
    pub(super) asked: Vec<(String, String)>,
    /// What the numbers are.
    pub(super) results: String,
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
}

/// Where a result comes from, and how it is computed again.
pub fn origin(entry: &Entry) -> String {
    let again = entry.command.as_ref().map_or_else(
        || {
            let member = entry.kind.member();
            format!(
                "<p>To compute it again, submit the member <code>{member}</code> of the result with this key.</p>"
            )
        },
        |command| format!("<p>To compute it again:</p><pre>{}</pre>", html::lines(command)),
    );
    section("Origin", &(pairs(&entry.origin) + &again))
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
