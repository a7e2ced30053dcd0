//! Lists in pages: the parameter `limit`, and the address of the next page.

use std::fmt::Display;

use axum::http::{HeaderName, Uri, header};

use super::Query;

/// Reads `limit` from the query: the maximum number of entries of a page.
pub fn limit(query: &mut Query, default: u32, most: u32) -> u32 {
    let accepted = format_args!("a number from 1 to {most}");
    let read = |text: &str| text.parse().ok().filter(|limit| (1..=most).contains(limit));
    query.value("limit", accepted, read).unwrap_or(default)
}

/// A header that links to the next page.
pub type Link = Option<[(HeaderName, String); 1]>;

/// The address of the request with another cursor, and the header that links to it.
pub fn next_page(uri: &Uri, cursor: Option<impl Display>) -> (Option<String>, Link) {
    let query = uri.query().unwrap_or_default().as_bytes();
    let rest = form_urlencoded::parse(query).filter(|(name, _)| name != "cursor");
    let next = cursor.map(|cursor| {
        let query = form_urlencoded::Serializer::new(String::new())
            .extend_pairs(rest)
            .append_pair("cursor", &cursor.to_string())
            .finish();
        format!("{}?{query}", uri.path())
    });
    let link = next.as_ref().map(|next| [(header::LINK, format!("<{next}>; rel=\"next\""))]);
    (next, link)
}
