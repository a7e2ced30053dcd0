//! The dashboard: a page for people, from files inside the program.
//!
//! It holds no data and asks this server for everything, like any other client; so it is open to all,
//! and what it shows is not.

use std::sync::LazyLock;

use axum::body::Bytes;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_ENCODING, CONTENT_SECURITY_POLICY, CONTENT_TYPE, ETAG, VARY,
};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use xxhash_rust::xxh3::xxh3_64;

use super::coding::Coding;
use super::format::Format;
use super::problem::{self, Problem};
use super::representation::held;
use super::wire::{NoQuery, Segment};

/// A file: its name under `/assets/`, what it is, its bytes.
type File = (&'static str, &'static str, &'static [u8]);

/// What is at `/`.
const INDEX: File = ("", "text/html; charset=utf-8", include_bytes!("dashboard/index.html"));

macro_rules! files {
    ($kind:literal: $($name:literal),*) => {
        &[$(($name, $kind, include_bytes!(concat!("dashboard/", $name)))),*]
    };
}

const SCRIPTS: &[File] = files!("text/javascript": "about.js", "actions.js", "api.js", "dom.js",
    "fields.js", "form.js", "known.js", "library.js", "main.js", "names.js", "plots.js", "queue.js",
    "result.js", "run.js", "sketch.js", "units.js", "vendor/uPlot.iife.min.js");
const STYLES: &[File] = files!("text/css": "style.css", "vendor/uPlot.min.css");
const IMAGES: &[File] = files!("image/svg+xml": "icon.svg");
const TEXTS: &[File] = files!("text/plain; charset=utf-8": "vendor/uPlot-LICENSE.txt");

/// The page runs what comes from here and asks nobody else, so what somebody writes into a label or
/// a note cannot become a program.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; \
    connect-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

/// A file as it is sent: as it is and compressed, once for all who ask.
struct Asset {
    name: &'static str,
    kind: &'static str,
    tag: String,
    bodies: [(Coding, Bytes, Coding); 3],
}

impl Asset {
    fn new(&(name, kind, bytes): &File) -> Self {
        let bodies = [Coding::Identity, Coding::Gzip, Coding::Zstd].map(|asked| {
            let plain = Bytes::from_static(bytes);
            // What cannot be compressed is sent as it is.
            let (body, done) = asked.encode(&plain, true).unwrap_or((plain, Coding::Identity));
            (asked, body, done)
        });
        Self { name, kind, tag: format!("\"{:016x}\"", xxh3_64(bytes)), bodies }
    }
}

static ASSETS: LazyLock<Vec<Asset>> = LazyLock::new(|| {
    let files = [&[INDEX][..], SCRIPTS, STYLES, IMAGES, TEXTS];
    files.concat().iter().map(Asset::new).collect()
});

/// The page.
pub async fn page(headers: HeaderMap, _: NoQuery) -> Result<Response, Problem> {
    file("", &headers)
}

/// What the page is made of.
pub async fn asset(
    Segment(name): Segment,
    headers: HeaderMap,
    _: NoQuery,
) -> Result<Response, Problem> {
    file(&name, &headers)
}

/// A file in the coding that the client takes, or nothing where it holds it. A browser asks each time,
/// so that after an upgrade all files are of one release.
fn file(name: &str, headers: &HeaderMap) -> Result<Response, Problem> {
    let asset = ASSETS.iter().find(|asset| asset.name == name).ok_or_else(|| {
        Problem::new(&problem::NOT_FOUND, "The dashboard has no such file; it starts at /.")
    })?;
    let shared =
        [(CACHE_CONTROL, "no-cache"), (CONTENT_SECURITY_POLICY, POLICY), (VARY, "accept-encoding")];
    if let Some(tag) = held(headers, &asset.tag) {
        return Ok((StatusCode::NOT_MODIFIED, [(ETAG, tag)], shared).into_response());
    }
    let chosen = Coding::choose(headers, Format::Json);
    let (_, body, done) =
        asset.bodies.iter().find(|(asked, ..)| *asked == chosen).ok_or_else(Problem::internal)?;
    let own = [(ETAG, tagged(&asset.tag, *done)), (CONTENT_TYPE, asset.kind.to_owned())];
    let coding = done.name().map(|name| [(CONTENT_ENCODING, name)]);
    Ok((own, coding, shared, body.clone()).into_response())
}

/// A tag is weak where the bytes are compressed.
fn tagged(tag: &str, done: Coding) -> String {
    if done == Coding::Identity { tag.to_owned() } else { format!("W/{tag}") }
}
