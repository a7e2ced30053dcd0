//! The content of reports. A report shows a result, or several runs side by side, with the views of the page in one HTML file.
//!
//! The file has the documents that the views read. Without scripts, it shows inputs and main numbers as HTML. An [`ReportedResult`] is
//! what a file says of one result. Its size is bounded, so a comparison of large results holds only one of them at a time.

mod data;
mod entry;
mod html;
mod numbers;
pub mod smooth;

use serde_json::Value;

use super::{Document, Error, Missing, Notation, Result, View};
use fretwork_job::TaskKind;

pub use entry::{About, ReportedResult};

/// Maximum number of results in one file.
pub const MOST: usize = 8;
/// Longest command that recomputes a result, in bytes.
const COMMAND: usize = 4000;

/// The parts of a file.
pub struct Content {
    /// The title.
    pub title: String,
    /// What the file shows without scripts, as HTML. The views replace it, but for the section of the origin.
    pub body: String,
    /// What the views show, as JSON that can stand in HTML.
    pub data: String,
}

impl ReportedResult {
    /// Reads a stored result, which is one of `count` in the file.
    ///
    /// # Errors
    /// The bytes are not a result.
    pub fn read(stored: &[u8], about: &About, engineering: bool, count: usize) -> Result<Self> {
        let plain = View::default();
        let si = Document::open(stored, &plain)?;
        let kind = si.kind();
        let asked = si.value(kind.member())?;
        let typed = about.submitted.as_ref().unwrap_or(&asked);
        let body = format!("{{\"{}\":{typed}}}", kind.member());
        let notation = Notation { is_si: !engineering };
        let warnings = data::warnings(&si, &asked, about);
        let origin = [
            ("Label", about.label.clone().filter(|_| count > 1)),
            ("Key", Some(si.head.key.clone())),
            ("Engine", Some(si.head.engine.to_string())),
            ("Program", about.version.as_ref().map(|version| format!("fretwork {version}"))),
            ("Computed", about.computed.clone()),
        ];
        let origin = origin.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?)));
        Ok(Self {
            kind,
            key: si.head.key.clone(),
            label: about.label.clone(),
            submitted: about.submitted.clone().filter(|_| kind == TaskKind::Run),
            inputs: numbers::inputs(typed, notation),
            numbers: numbers::results(&si, &asked, notation)?,
            warnings: data::details(&[&si.value("warnings")?, &si.value("notes")?, &warnings]),
            origin: origin.collect(),
            command: (body.len() <= COMMAND)
                .then(|| format!("fretwork run - <<'END'\n{body}\nEND")),
            documents: data::documents(stored, &si, &warnings, count)?,
        })
    }
}

/// The content of the report of one result, or of several runs. `measured` was measured in the test that a run simulates: sets
/// of the page.
///
/// # Errors
/// Several results are not all runs.
pub fn content(
    entries: &[ReportedResult],
    engineering: bool,
    measured: &[Value],
) -> Result<Content> {
    if entries.len() > 1 && entries.iter().any(|entry| entry.kind != TaskKind::Run) {
        let detail = "compares runs, and one of these results is a study. Make a report of each result alone";
        return Err(Error::Missing(vec![Missing { parameter: "with", detail: detail.to_owned() }]));
    }
    let title = match entries {
        [entry] => entry.name(),
        _ => "Comparison of runs",
    };
    let data = data::text(entries, engineering, measured)?;
    Ok(Content { title: title.to_owned(), body: html::body(title, entries), data })
}
