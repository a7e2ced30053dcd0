//! The documents of the project as pages. They are part of the program, so they work without a network.
//!
//! Links between the documents lead to files in the repository. A page has links to other pages instead. A link to a
//! file that has no page is only text. Files of `deploy` are pages as they are.

use std::collections::HashSet;
use std::sync::LazyLock;

use axum::http::HeaderMap;
use axum::response::Response;
use pulldown_cmark::{Event, Options, Parser, Tag, TagEnd, html};

use super::asset::{Asset, Assets};
use crate::http::{NoQuery, Result, Segment};

macro_rules! pages {
    ($($path:literal),* $(,)?) => {
        &[$(($path, include_str!(concat!("../../../", $path)))),*]
    };
}

/// The files of all pages: the path in the repository, and the text. A new page is one line.
const PAGES: &[(&str, &str)] = pages![
    "docs/README.md",
    "docs/accuracy.md",
    "docs/calibration.md",
    "docs/changed-answers.md",
    "docs/installation.md",
    "docs/operating.md",
    "docs/results.md",
    "docs/scale.md",
    "docs/scenario.md",
    "docs/sharing.md",
    "docs/studies.md",
    "docs/third-party-licenses.md",
    "docs/decisions/README.md",
    "docs/decisions/an-early-end-is-a-result.md",
    "docs/decisions/checks-against-damage.md",
    "docs/decisions/derivatives-are-fits.md",
    "docs/decisions/digits-are-equal-everywhere.md",
    "docs/decisions/evaluations-leave-nothing.md",
    "docs/decisions/exact-method-is-the-default.md",
    "docs/decisions/faults-all-at-once.md",
    "docs/decisions/fits-work-in-stages.md",
    "docs/decisions/imports-compute-again.md",
    "docs/decisions/kinds-of-studies.md",
    "docs/decisions/leases-in-postgresql.md",
    "docs/decisions/memory-has-owners.md",
    "docs/decisions/results-can-be-evicted.md",
    "docs/decisions/sobol-points-are-computed-here.md",
    "docs/decisions/springs-for-every-mode.md",
    "docs/decisions/studies-are-chunks.md",
    "docs/decisions/the-build-is-plain.md",
    "docs/decisions/the-dashboard-is-a-client.md",
    "docs/decisions/the-queue-of-sqlite-is-in-memory.md",
    "docs/decisions/two-databases-one-set-of-verbs.md",
    "docs/decisions/warnings-about-bodies.md",
    "ARCHITECTURE.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "VERIFICATION.md",
    "clients/README.md",
    "clients/command-line.md",
    "clients/javascript/README.md",
    "clients/python/README.md",
    "deploy/alerts.yml",
    "deploy/haproxy-single.cfg",
];

/// The page around a document.
const FRAME: &str = include_str!("docs.html");
/// The pages have no scripts, and load files of this server only.
pub const POLICY: &str = "default-src 'none'; style-src 'self'; img-src 'self'; frame-ancestors 'none'; \
    base-uri 'none'; form-action 'none'";

static ASSETS: Assets = Assets {
    all: LazyLock::new(|| {
        let page = |(path, text): &(&str, &str)| {
            let is_page = !path.starts_with("deploy/");
            let kind =
                if is_page { "text/html; charset=utf-8" } else { "text/plain; charset=utf-8" };
            let text = if is_page { render(path, text) } else { (*text).to_owned() };
            Asset::new(name_of(path), kind, text.as_bytes())
        };
        PAGES.iter().map(page).collect()
    }),
    policy: POLICY,
    none: "The documentation does not have this page. Open /docs/ for a list of all pages.",
};

/// `GET /docs/`.
pub async fn start(headers: HeaderMap, _: NoQuery) -> Result<Response> {
    ASSETS.answer("", &headers).await
}

/// `GET /docs/{name}`.
pub async fn page(name: Segment, headers: HeaderMap, _: NoQuery) -> Result<Response> {
    ASSETS.answer(name.trim_end_matches('/'), &headers).await
}

/// The name of the page of a file: `scenario` for `docs/scenario.md`, and empty for `docs/README.md`.
fn name_of(path: &str) -> String {
    let name = path.trim_start_matches("docs/").trim_end_matches(".md").trim_end_matches("README");
    name.trim_end_matches('/').to_lowercase()
}

/// Renders a document. `path` is its file.
fn render(path: &str, text: &str) -> String {
    let mut is_linked = true;
    let events = Parser::new_ext(text, Options::ENABLE_TABLES).filter_map(|event| match event {
        Event::Start(Tag::Link { link_type, dest_url, title, id }) => {
            let address = address(path, &dest_url);
            is_linked = address.is_some();
            let dest_url = address?.into();
            Some(Event::Start(Tag::Link { link_type, dest_url, title, id }))
        }
        Event::End(TagEnd::Link) if !is_linked => None,
        // The program does not contain the images. Their texts stay.
        Event::Start(Tag::Image { .. }) | Event::End(TagEnd::Image) => None,
        event => Some(event),
    });
    let mut events: Vec<_> = events.collect();
    let mut title = String::new();
    let mut known = HashSet::new();
    for start in 0..events.len() {
        let heading = heading(&events[start..]);
        let Event::Start(Tag::Heading { id, .. }) = &mut events[start] else { continue };
        let anchor = anchor_of(&heading);
        *id = known.insert(anchor.clone()).then(|| anchor.into());
        if title.is_empty() {
            title = heading;
        }
    }
    let mut body = String::with_capacity(2 * text.len());
    html::push_html(&mut body, events.into_iter());
    // The policy forbids styles in the page. Wide tables and code scroll, also by the keyboard.
    let replaced = [
        (" style=\"text-align: right\"", " class=\"number\""),
        ("<pre>", "<pre tabindex=\"0\">"),
        ("<table>", "<div class=\"scroll\" tabindex=\"0\"><table>"),
        ("</table>", "</table></div>"),
    ];
    let body = replaced.iter().fold(body, |body, (old, new)| body.replace(old, new));
    FRAME.replace("{title}", &title).replace("{body}", &body)
}

/// The text of a heading. Empty if the first event does not begin a heading.
fn heading(events: &[Event<'_>]) -> String {
    let is_heading = matches!(events.first(), Some(Event::Start(Tag::Heading { .. })));
    let events = if is_heading { events } else { &[] };
    let inside = events.iter().take_while(|event| !matches!(event, Event::End(TagEnd::Heading(_))));
    let texts = inside.filter_map(|event| match event {
        Event::Text(text) | Event::Code(text) => Some(&**text),
        _ => None,
    });
    texts.collect()
}

/// The anchor of a heading, as GitHub makes it.
fn anchor_of(heading: &str) -> String {
    let kept = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_');
    heading.to_lowercase().chars().filter(kept).collect::<String>().replace(' ', "-")
}

/// The address for a link in a file; `None` if no page has the linked file.
fn address(path: &str, link: &str) -> Option<String> {
    if link.starts_with('#') || link.contains("://") {
        return Some(link.to_owned());
    }
    let (file, anchor) = link.split_at(link.find('#').unwrap_or(link.len()));
    let mut parts: Vec<&str> = path.split('/').collect();
    parts.pop();
    for part in file.split('/') {
        match part {
            ".." => drop(parts.pop()),
            part => parts.push(part),
        }
    }
    let file = parts.join("/");
    let (page, _) = PAGES.iter().find(|(path, _)| *path == file)?;
    Some(format!("/docs/{}{anchor}", name_of(page)))
}
