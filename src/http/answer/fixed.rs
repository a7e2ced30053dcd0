//! Texts that change only with the program: the OpenAPI document, the schema and the examples.

use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE, ETAG, VARY};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use xxhash_rust::xxh3::xxh3_64;

use super::representation::held;

/// Answers with a text, or with 304 if the client has it. Clients ask at each use, so that after an upgrade none has an old text.
/// The entity tag is weak, because it stands for the text in every coding.
pub fn fixed(
    headers: &HeaderMap,
    media_type: &'static str,
    text: impl AsRef<[u8]> + IntoResponse,
) -> Response {
    let tag = format!("\"{:016x}\"", xxh3_64(text.as_ref()));
    let shared = [(ETAG, format!("W/{tag}")), (CACHE_CONTROL, "no-cache".to_owned())];
    if held(headers, &tag).is_some() {
        return (StatusCode::NOT_MODIFIED, shared, [(VARY, "accept-encoding")]).into_response();
    }
    (shared, [(CONTENT_TYPE, media_type)], text).into_response()
}
