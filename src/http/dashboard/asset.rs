//! Files that browsers keep.

use std::sync::LazyLock;

use axum::body::Bytes;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_ENCODING, CONTENT_SECURITY_POLICY, CONTENT_TYPE, ETAG, VARY,
};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use xxhash_rust::xxh3::xxh3_64;

use crate::http::answer::representation::held;
use crate::http::wire::coding::Coding;
use crate::http::{Problem, Result, blocking, kinds};

/// The files of some pages. They are made, with all their codings, at the first request.
pub struct Assets {
    pub all: LazyLock<Vec<Asset>>,
    /// The content security policy.
    pub policy: &'static str,
    /// The detail of the problem if no file has a name.
    pub none: &'static str,
}

impl Assets {
    /// Answers with a file.
    pub async fn answer(&'static self, name: &str, headers: &HeaderMap) -> Result<Response> {
        let all = match LazyLock::get(&self.all) {
            Some(all) => all,
            // The first call compresses the files, which takes tens of milliseconds.
            None => blocking(|| LazyLock::force(&self.all)).await?,
        };
        let asset = all.iter().find(|asset| asset.name == name);
        let none = || Problem::new(&kinds::NOT_FOUND, self.none);
        Ok(asset.ok_or_else(none)?.answer(headers, self.policy))
    }
}

/// A file with its body in each coding. Files are compressed once.
pub struct Asset {
    name: String,
    media_type: &'static str,
    tag: String,
    /// For each coding that a client can accept: the body, and the coding that it has. A short body is not compressed.
    bodies: [(Bytes, Coding); Coding::ALL.len()],
}

impl Asset {
    pub fn new(name: impl Into<String>, media_type: &'static str, bytes: &[u8]) -> Self {
        #[expect(clippy::expect_used, reason = "writing to memory cannot fail")]
        let encode = |coding: Coding| coding.encode(bytes).expect("compresses a file in memory");
        let bodies = Coding::ALL.map(encode);
        let name = name.into();
        Self { name, media_type, tag: format!("\"{:016x}\"", xxh3_64(bytes)), bodies }
    }

    /// Answers with the file, or with 304 if the client has it. Browsers revalidate each file at each load, so that after
    /// an upgrade all files are of one release.
    fn answer(&self, headers: &HeaderMap, policy: &'static str) -> Response {
        let shared = [
            (CACHE_CONTROL, "no-cache"),
            (CONTENT_SECURITY_POLICY, policy),
            (VARY, "accept-encoding"),
        ];
        if let Some(tag) = held(headers, &self.tag) {
            return (StatusCode::NOT_MODIFIED, [(ETAG, tag)], shared).into_response();
        }
        let (body, used) = &self.bodies[Coding::choose(headers) as usize];
        let own = [(ETAG, tagged(&self.tag, *used)), (CONTENT_TYPE, self.media_type.to_owned())];
        let coding = used.name().map(|name| [(CONTENT_ENCODING, name)]);
        (own, coding, shared, body.clone()).into_response()
    }
}

/// The entity tag, which is weak for a compressed body.
fn tagged(tag: &str, used: Coding) -> String {
    if used == Coding::Identity { tag.to_owned() } else { format!("W/{tag}") }
}
