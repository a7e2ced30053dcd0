//! Serves the files of the dashboard, which are compiled into the program.
//!
//! The dashboard's files need no access key. They contain no data: the dashboard uses the API like any other client. `report`
//! puts the same modules and the documents of a result into one file.

mod asset;
pub mod docs;
pub mod report;
pub mod swagger;

use std::sync::LazyLock;

use axum::http::HeaderMap;
use axum::response::Response;
use serde_json::{Map, Value, json};

use crate::http::problem::Result;
use crate::http::wire::{NoQuery, Segment};
use asset::{Asset, Assets};

use fretwork_engine::outcome::{
    EVENTS, History, LINE_WORDS, QUANTITIES, Quantity, SECTION_WORDS, SPECIAL_WORDS, Unworn,
};
use fretwork_engine::request::forms::{FORMS, ObjectForm};
use fretwork_engine::request::inputs::{INPUTS, Measure, VALUES};
use fretwork_engine::request::quantity::factor_to_si;
use fretwork_format::notation::LADDERS;
use fretwork_job::WORDS;
use fretwork_study::{Kind, OutputName};

/// A file: its name under `/assets/`, its media type and its content.
type File = (&'static str, &'static str, &'static str);

/// The file at `/`.
const INDEX: File = ("", "text/html; charset=utf-8", include_str!("index.html"));

macro_rules! files {
    ($kind:literal: $($name:literal),*) => {
        &[$(($name, $kind, include_str!($name))),*]
    };
}

const SCRIPTS: &[File] = files!("text/javascript":
    "actions.js", "address.js", "again.js", "allowed.js", "api.js", "csv.js", "details.js", "dom.js", "error.js", "estimate.js", "fields.js",
    "form.js", "limits.js", "main.js", "plan.js", "pointer.js", "result.js", "run.js", "runs.js", "sign-in.js",
    "sketch.js", "stored.js", "summary.js", "units.js", "vary.js",
    // The library and the access keys.
    "keys.js", "library-actions.js", "library-columns.js", "library-table.js", "library.js",
    "thumbnails.js",
    // The live form.
    "doubts.js", "draft.js", "dropped.js", "editors.js", "faults.js", "fieldset.js", "inputs.js", "kept-input.js", "kinds.js", "live.js",
    "measured.js", "preview.js", "rows.js", "slider.js", "trace.js", "trace-editor.js", "typed.js",
    "undo.js", "warnings.js",
    // Figures and the views of results.
    "curves.js", "explain.js", "figure-axis.js", "figure-draw.js", "figure-labels.js",
    "figure-reader.js", "figure-save.js", "figure-zoom.js", "figure.js", "headline.js", "input-rows.js", "player.js",
    "repair.js", "result-figures.js", "scaling.js", "section.js", "smooth.js", "so-far.js",
    "system.js",
    // The comparison of runs, which is loaded when it is needed.
    "compare-figures.js", "compare-rows.js", "compare-table.js", "compare.js",
    "derived.js",
    // The views of studies, which are loaded when they are needed.
    "study-axes.js", "study-bars.js", "study-chart.js", "study-contours.js", "study-curves.js",
    "study-figure.js", "study-heat.js", "study-measured.js", "study-open.js", "study-scatter.js",
    "study-so-far.js", "study-statistics.js", "study-table.js", "study-verdict.js", "study-view.js",
    "study-words.js", "study.js",
    // Measurements and fits, which are loaded when they are needed.
    "fit-figures.js", "fit-form.js", "fit-names.js", "fit-page.js", "measure-dialog.js",
    "measure-energy.js", "measure-model.js", "measure-overlay.js", "measure-panel.js", "measure-sets.js", "measure-trace.js",
    "measure-units.js", "measure-words.js", "measure.js");
const STYLES: &[File] = files!("text/css": "style.css");
const IMAGES: &[File] = files!("image/svg+xml": "icon.svg");

/// Content security policy. The browser runs scripts of this server only, so a label or a note cannot
/// inject one.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
    connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

static ASSETS: Assets = Assets {
    all: LazyLock::new(|| {
        let files = [&[INDEX][..], SCRIPTS, STYLES, IMAGES].concat();
        let files =
            files.into_iter().map(|(name, kind, text)| Asset::new(name, kind, text.as_bytes()));
        files.chain([Asset::new("words.js", "text/javascript", words().as_bytes())]).collect()
    }),
    policy: POLICY,
    none: "The dashboard has no file of this name. Open / instead.",
};

/// The script with words that other crates define: the kinds of studies, the names, symbols and meanings of quantities
/// and inputs, their units for people, and what users search by.
fn words() -> String {
    let kinds: Value = Kind::ALL.into_iter().map(|kind| (kind.name, json!(kind))).collect();
    let of_quantities = |of: fn(&Quantity) -> &'static str| -> Value {
        QUANTITIES.iter().map(|quantity| (quantity.name, of(quantity))).collect()
    };
    let [names, units, symbols] =
        [of_quantities(|it| it.words), of_quantities(|it| it.unit), of_quantities(|it| it.symbol)];
    // A later meaning of a name replaces an earlier one: a column of the history means more to a reader than the
    // unworn contact.
    let members = Unworn::MEMBERS.iter().chain(History::MEMBERS);
    let meanings: Value = members.map(|member| (member.name, member.meaning)).collect();
    let line: Value = LINE_WORDS.iter().copied().collect();
    let [sections, special]: [Value; 2] = [SECTION_WORDS, SPECIAL_WORDS]
        .map(|list| list.iter().map(|(name, words)| (*name, json!(words))).collect());
    let values: Value = VALUES.iter().copied().collect();
    let inputs: Value = INPUTS
        .iter()
        .map(|it| json!([it.pointer, it.words, it.symbol, measured(it.measure), it.about.trim()]))
        .collect();
    let form = |it: &ObjectForm, example| {
        let ObjectForm { pointer, geometry, optional, .. } = it;
        json!({"pointer": pointer, "geometry": geometry, "optional": optional, "example": example})
    };
    let forms: Value = FORMS.iter().filter_map(|it| Some(form(it, it.example()?))).collect();
    let ladder = |(unit, usual, steps): &(&str, _, _)| {
        ((*unit).to_owned(), json!({"usual": usual, "steps": steps}))
    };
    let ladders: Value = LADDERS.iter().map(ladder).collect();
    let outputs: Value = OutputName::all().collect();
    let named = |(kind, words): &(_, _)| Some((json!(kind).as_str()?.to_owned(), json!(words)));
    let events: Value = EVENTS.iter().filter_map(named).collect();
    let searched: Value = WORDS.iter().map(|word| (word.name, json!(word.values))).collect();
    format!(
        "/** The kinds of studies. */\nexport const KINDS = {kinds};\n\n/** The names of quantities. */\nexport const NAMES = {names};\n\n\
         /** Their SI units. */\nexport const UNITS = {units};\n\n\
         /** Their symbols, with italics between `$`. */\nexport const SYMBOLS = {symbols};\n\n\
         /** The names of events. */\nexport const EVENTS = {events};\n\n\
         /** What they mean. */\nexport const MEANINGS = {meanings};\n\n\
         /** The names of quantities of a line contact. */\nexport const LINE_WORDS = {line};\n\n\
         /** The beginning of names of numbers of sections, and the end of their symbols. */\nexport const SECTIONS = {sections};\n\n\
         /** The names and symbols of other numbers of sections. */\nexport const SPECIAL = {special};\n\n\
         /** The names of values of inputs. */\nexport const VALUES = {values};\n\n\
         /** The inputs: patterns of their pointers, names, symbols, what they measure, and sentences about them. */\nexport const INPUTS = {inputs};\n\n\
         /** The forms of objects of a scenario: pointers, the geometry that they need, members that they can have, and examples. */\nexport const FORMS = {forms};\n\n\
         /** The units for people, each with its factor and the size from which it is used. */\nexport const LADDERS = {ladders};\n\n\
         /** The outputs of a study, without output cycles. */\nexport const OUTPUTS = {outputs};\n\n\
         /** The words that results are searched by. */\nexport const SEARCHED = {searched};\n"
    )
}

/// What an input measures, for the form. A plain number has no units, and its usual sizes are the ends of its slider.
fn measured(Measure { dimension, units, usual, bare }: Measure) -> Value {
    let names = units.split(", ").filter(|unit| !unit.is_empty());
    let slide = usual.map(|[from, .., to]| [from, to]);
    let units: Map<String, Value> =
        names.clone().map(|unit| (unit.to_owned(), json!(factor_to_si(unit)))).collect();
    match names.clone().next() {
        None => json!({"unit": "", "units": {}, "si": "", "slide": slide}),
        Some(unit) => {
            json!({"unit": unit, "units": units, "si": dimension.si(), "usual": usual, "bare": bare})
        }
    }
}

/// `GET /`.
pub async fn page(headers: HeaderMap, _: NoQuery) -> Result<Response> {
    ASSETS.answer("", &headers).await
}

/// `GET /assets/{name}`.
pub async fn asset(name: Segment, headers: HeaderMap, _: NoQuery) -> Result<Response> {
    ASSETS.answer(&name, &headers).await
}
