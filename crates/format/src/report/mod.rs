//! Reports: one HTML page of a result, or of several runs side by side, to be read, printed and archived.
//!
//! A page has no script and needs no other file. All texts pass [`html::text`], which escapes them. An [`Entry`] is what a
//! page says of one result. It is small, so a comparison of large results holds only one of them at a time.

mod compared;
mod entry;
mod html;
mod inputs;
mod measured;
mod run;
pub mod smooth;
mod study;

use crate::document::Document;
use crate::error::{Error, Missing, Result};
use crate::notation::Notation;
use crate::view::{FigureOptions, View};
use entry::{origin, warnings};
use fretwork_job::{TaskKind, earlier};
use html::{pairs, section};

pub use entry::{About, Entry};
pub use measured::Measured;

/// Maximum number of results on one page.
pub const MOST: usize = 8;
/// The size of each figure, in px. Two of them fill the width of a page.
const SIZE: (u16, u16) = (400, 196);
/// Longest command that recomputes a result, in bytes.
const COMMAND: usize = 4000;

impl Entry {
    /// Reads a stored result.
    ///
    /// # Errors
    /// The bytes are not a result.
    pub fn read(stored: &[u8], about: &About, engineering: bool) -> Result<Self> {
        let notation = Notation { is_si: !engineering };
        let figure = FigureOptions { size: SIZE, ..FigureOptions::default() };
        let view = View { engineering, figure, ..View::default() };
        let (drawn, plain) = (Document::open(stored, &view)?, View::default());
        let si = Document::open(stored, &plain)?;
        let kind = si.kind();
        let asked = si.value(kind.member())?;
        let typed = about.submitted.as_ref().unwrap_or(&asked);
        let body = format!("{{\"{}\":{typed}}}", kind.member());
        let mut entry = Self {
            kind,
            notation,
            label: about.label.clone(),
            inputs: inputs::listed(typed, notation, inputs::TYPED),
            asked: inputs::listed(&asked, notation, inputs::COMPUTED),
            cycles: f64::NAN,
            warnings: warnings(&[&si.value("warnings")?, &about.warnings]),
            origin: vec![
                ("Key".to_owned(), si.head.key.clone()),
                ("Engine".to_owned(), si.head.engine.to_string()),
            ],
            command: (body.len() <= COMMAND)
                .then(|| format!("fretwork run - <<'END'\n{body}\nEND")),
            ..Self::default()
        };
        let computed = about.computed.as_deref().and_then(|time| time.split_once('T'));
        let computed =
            computed.map(|(date, time)| format!("{date} {} UTC", &time[..5.min(time.len())]));
        let version = about.version.as_ref().map(|version| format!("fretwork {version}"));
        let known = [("Program", version), ("Computed", computed)];
        let known = known.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?)));
        entry.origin.extend(known);
        // The verdict of a fit says it, too.
        if entry.kind.word() != "fit" {
            entry.warnings.extend(earlier::doubt(si.head.engine.numerics, &asked));
        }
        match kind {
            TaskKind::Run => run::fill(&mut entry, [&si, &drawn], &view, &asked, &about.measured)?,
            TaskKind::Study(kind) => study::fill(&mut entry, [&si, &drawn], &view, kind)?,
        }
        Ok(entry)
    }
}

/// Writes the report of one result, or of several runs, whose differences to the first it shows.
///
/// # Errors
/// Several results are not all runs.
pub fn page(entries: &[Entry]) -> Result<String> {
    match entries {
        [entry] => Ok(html::page(entry.name(), &alone(entry))),
        _ if entries.iter().any(|entry| entry.kind != TaskKind::Run) => {
            let detail = "compares runs, and one of these results is a study. Make a report of each result alone";
            Err(Error::Missing(vec![Missing { parameter: "with", detail: detail.to_owned() }]))
        }
        _ => Ok(html::page("Comparison of runs", &compared::body(entries))),
    }
}

/// The body of the page of one result.
fn alone(entry: &Entry) -> String {
    let mut body = html::heading(entry.name(), &entry.about());
    let list = |title, of_scenario| {
        let own = entry.inputs.iter().filter(|input| input.pointer.starts_with('/') == of_scenario);
        let own = own.map(|input| (input.name.clone(), input.text.clone()));
        section(title, &pairs(&own.collect::<Vec<_>>()))
    };
    body += &match entry.kind {
        TaskKind::Run => list("Inputs", true),
        TaskKind::Study(_) => list("Fixed inputs of the scenario", true) + &list("Study", false),
    };
    if entry.numbers.is_empty() {
        body += &entry.sections;
    } else {
        let parts = ["<div class=\"columns\">", &run::results(entry), &entry.sections, "</div>"];
        body += &parts.concat();
    }
    body += &html::figures(&entry.figures);
    body + &entry.table + &html::warnings("Warnings", &entry.warnings) + &origin("Origin", entry)
}
