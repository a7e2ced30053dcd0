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

use crate::http::{NoQuery, Result, Segment};
use asset::{Asset, Assets};

use fretwork_engine::input::inputs::{VALUES, forms, inputs};
use fretwork_engine::input::quantity::factor_to_si;
use fretwork_engine::input::rows::{Measure, ObjectForm};
use fretwork_engine::outcome::{LINE_WORDS, Quantity, SECTION_WORDS, SPECIAL_WORDS};
use fretwork_engine::{EVENTS, History, QUANTITIES, Unworn};
use fretwork_format::notation::LADDERS;
use fretwork_job::WORDS;
use fretwork_study::{Kind, OutputName};

/// A file: its name under `/assets/`, its media type and its content.
type File = (&'static str, &'static str, &'static str);

/// The file at `/`.
const INDEX: File = ("", "text/html; charset=utf-8", include_str!("index.html"));

macro_rules! scripts {
    ($($folder:literal: $($name:literal)*;)*) => {
        &[$($((
            concat!($folder, "/", $name, ".js"),
            "text/javascript",
            include_str!(concat!($folder, "/", $name, ".js"))
        )),*),*]
    };
}

/// The modules of each folder. A folder uses only folders above it, and modules do not depend on each other in a circle.
const SCRIPTS: &[File] = scripts!(
    // Elements, dropped files and addresses, for all views.
    "page": "address" "csv" "dom" "dropped";
    // Numbers, units and names, as people read and type them.
    "quantities": "explain" "input-rows" "kinds" "limits" "pointer" "scaling" "system" "typed" "units";
    // Requests to the server, the user, errors and access keys.
    "access": "allowed" "api" "error" "keys" "sign-in";
    // Curves with axes, zoom and readings, and the figures of a run.
    "figure": "axis" "curves" "draw" "figure" "labels" "player" "reader" "run" "save" "zoom";
    // Stored results: their names and buttons, and the table of all.
    "library": "actions" "columns" "derived" "library" "owners" "selected" "stored" "summary" "table"
        "thumbnails";
    // Studies: their ranges, figures and tables.
    "study": "bars" "chart" "contours" "curves" "figure" "heat" "measured" "open" "plan" "scatter"
        "so-far" "statistics" "study" "table" "vary" "verdict" "view" "words";
    // Measured sets beside a run.
    "measure": "dialog" "energy" "file" "kept" "measure" "model" "overlay" "panel" "sets" "trace" "units"
        "words";
    // The form and the page of a fit.
    "fit": "figures" "form" "names" "page";
    // A job while it runs, and its result.
    "run": "again" "details" "estimate" "figure-3" "headline" "profile-menu" "result" "run" "runs" "section"
        "sketch" "smooth" "so-far" "warnings";
    // The comparison of runs.
    "compare": "compare" "figures" "rows" "table";
    // The form of a new run or study.
    "form": "doubts" "draft" "editors" "faults" "field" "field-groups" "field-list" "form" "kept-input"
        "live" "plan" "preview" "repair" "rows" "slider" "trace" "trace-editor" "undo";
    // The page in the file of a report.
    "report": "offline" "report";
);
const MAIN: File = ("main.js", "text/javascript", include_str!("main.js"));
/// The module of `clients/javascript`, which pages of other origins load, too.
const CLIENT: File =
    ("fretwork.js", "text/javascript", include_str!("../../../clients/javascript/fretwork.js"));
const STYLE: File = ("style.css", "text/css", include_str!("style.css"));
const ICON: File = ("icon.svg", "image/svg+xml", include_str!("icon.svg"));

/// Content security policy. The browser runs scripts of this server only, so a label or a note cannot
/// inject one.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
    connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

static ASSETS: Assets = Assets {
    all: LazyLock::new(|| {
        let files = [INDEX, MAIN, CLIENT, STYLE, ICON].into_iter().chain(scripts());
        files.map(|(name, kind, text)| Asset::new(name, kind, text.as_bytes())).collect()
    }),
    policy: POLICY,
    none: "The dashboard has no file of this name. Open / instead.",
};

static WORDS_SCRIPT: LazyLock<String> = LazyLock::new(words);

/// The modules of all folders.
fn scripts() -> impl Iterator<Item = File> {
    let words = ("quantities/words.js", "text/javascript", WORDS_SCRIPT.as_str());
    SCRIPTS.iter().copied().chain([words])
}

/// The module with words that other crates define: the kinds of studies, the names, symbols and meanings of quantities
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
    let inputs: Value = inputs()
        .map(|it| json!([it.pointer, it.words, it.symbol, measured(it.measure), it.about.trim()]))
        .collect();
    let form = |it: &ObjectForm| {
        let ObjectForm { pointer, geometry, optional, .. } = it;
        json!({"pointer": pointer, "geometry": geometry, "optional": optional, "example": it.example()})
    };
    let forms: Value = forms().map(form).collect();
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
         /** The forms of objects of a scenario: pointers, the geometry that they need, members that they can have, and examples or null. */\nexport const FORMS = {forms};\n\n\
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
