//! Serves the files of the dashboard, which are compiled into the program.
//!
//! The files need no access key. They contain no data: the dashboard uses the API like any other client.

use std::sync::LazyLock;

use axum::body::Bytes;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_ENCODING, CONTENT_SECURITY_POLICY, CONTENT_TYPE, ETAG, VARY,
};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use xxhash_rust::xxh3::xxh3_64;

use crate::http::answer::representation::held;
use crate::http::problem::{Problem, kinds};
use crate::http::wire::coding::Coding;
use crate::http::wire::{NoQuery, Segment};

use fretwork_engine::outcome::{QUANTITIES, Quantity};
use fretwork_study::Kind;

/// A file: its name under `/assets/`, its media type and its content.
type File = (&'static str, &'static str, &'static [u8]);

/// The file at `/`.
const INDEX: File = ("", "text/html; charset=utf-8", include_bytes!("index.html"));

macro_rules! files {
    ($kind:literal: $($name:literal),*) => {
        &[$(($name, $kind, include_bytes!($name))),*]
    };
}

const SCRIPTS: &[File] = files!("text/javascript": "actions.js", "api.js", "details.js", "dom.js",
    "error.js", "estimate.js", "fields.js", "form.js", "library.js", "limits.js", "main.js", "plan.js",
    "plots.js", "queue.js", "result.js", "run.js", "sketch.js", "study.js", "summary.js", "units.js",
    "vary.js", "vendor/uPlot.iife.min.js");
const STYLES: &[File] = files!("text/css": "style.css", "vendor/uPlot.min.css");
const IMAGES: &[File] = files!("image/svg+xml": "icon.svg");
const TEXTS: &[File] = files!("text/plain; charset=utf-8": "vendor/uPlot-LICENSE.txt");

/// Content security policy. The browser runs scripts of this server only, so a label or a note cannot
/// inject one.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
    connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// A file with its body in each coding. Files are compressed once.
struct Asset {
    name: &'static str,
    media_type: &'static str,
    tag: String,
    /// For each coding that a client can accept: the body, and the coding that it has. A short body is not compressed.
    bodies: [(Bytes, Coding); Coding::ALL.len()],
}

impl Asset {
    fn new(name: &'static str, media_type: &'static str, bytes: &[u8]) -> Self {
        #[expect(clippy::expect_used, reason = "writing to memory cannot fail")]
        let encode = |coding: Coding| coding.encode(bytes).expect("compresses a file in memory");
        let bodies = Coding::ALL.map(encode);
        Self { name, media_type, tag: format!("\"{:016x}\"", xxh3_64(bytes)), bodies }
    }
}

static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let files = [&[INDEX][..], SCRIPTS, STYLES, IMAGES, TEXTS];
    let files = files.concat().into_iter().map(|(name, kind, bytes)| Asset::new(name, kind, bytes));
    files.chain([Asset::new("words.js", "text/javascript", words().as_bytes())]).collect()
});

/// The script with words that other crates define: the kinds of studies and the names of quantities.
fn words() -> String {
    let kinds: Value = Kind::ALL.into_iter().map(|kind| (kind.name, json!(kind))).collect();
    let words = |quantity: &Quantity| (quantity.name, json!(quantity.words));
    let names: Value = QUANTITIES.iter().map(words).collect();
    format!(
        "/** The kinds of studies. */\nexport const KINDS = {kinds};\n\n/** The names of quantities. */\nexport const NAMES = {names};\n"
    )
}

/// `GET /`.
pub async fn page(headers: HeaderMap, _: NoQuery) -> Result<Response, Problem> {
    file("", &headers)
}

/// `GET /assets/{name}`.
pub async fn asset(
    Segment(name): Segment,
    headers: HeaderMap,
    _: NoQuery,
) -> Result<Response, Problem> {
    file(&name, &headers)
}

/// Answers with a file, or with 304 if the client has it. Browsers revalidate each file at each load, so
/// that after an upgrade all files are of one release.
fn file(name: &str, headers: &HeaderMap) -> Result<Response, Problem> {
    let asset = ASSETS.iter().find(|asset| asset.name == name).ok_or_else(|| {
        Problem::new(&kinds::NOT_FOUND, "The dashboard has no file of this name. Open / instead.")
    })?;
    let shared =
        [(CACHE_CONTROL, "no-cache"), (CONTENT_SECURITY_POLICY, POLICY), (VARY, "accept-encoding")];
    if let Some(tag) = held(headers, &asset.tag) {
        return Ok((StatusCode::NOT_MODIFIED, [(ETAG, tag)], shared).into_response());
    }
    let (body, used) = &asset.bodies[Coding::choose(headers) as usize];
    let own = [(ETAG, tagged(&asset.tag, *used)), (CONTENT_TYPE, asset.media_type.to_owned())];
    let coding = used.name().map(|name| [(CONTENT_ENCODING, name)]);
    Ok((own, coding, shared, body.clone()).into_response())
}

/// The entity tag, which is weak for a compressed body.
fn tagged(tag: &str, used: Coding) -> String {
    if used == Coding::Identity { tag.to_owned() } else { format!("W/{tag}") }
}
