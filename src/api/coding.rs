//! Compressed answers: Zstandard or gzip, as the client takes them.
//!
//! Representations of results are compressed here, once for all who ask for them, and apart from the
//! threads that answer requests. Everything else that is worth it is compressed while it is sent, by
//! a layer around the routes.

use std::io::{self, Write as _};

use axum::body::Bytes;
use axum::http::header::{ACCEPT_ENCODING, CONTENT_TYPE, ETAG};
use axum::http::{HeaderMap, Response};
use flate2::Compression;
use flate2::write::GzEncoder;
use tower_http::compression::predicate::Predicate;

use super::wire::{Format, words};

/// What is smaller is sent as it is: it fits into a packet or two.
const WORTH: u64 = 1 << 10;

/// What is larger is not compressed while it is sent, which would occupy a thread that answers
/// requests.
const TOO_LARGE: u64 = 1 << 20;

/// What is done to the bytes of an answer (`Content-Encoding`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// Nothing.
    Identity,
    /// RFC 1952.
    Gzip,
    /// RFC 8878.
    Zstd,
}

impl Coding {
    /// The name in a header; none where nothing is done.
    pub fn name(self) -> Option<&'static str> {
        match self {
            Self::Identity => None,
            Self::Gzip => Some("gzip"),
            Self::Zstd => Some("zstd"),
        }
    }

    /// The best coding that the client takes; arrays in an archive are compressed already.
    pub fn choose(headers: &HeaderMap, format: Format) -> Self {
        if format == Format::Npz {
            return Self::Identity;
        }
        let mut best = (0.0, Self::Identity);
        for coding in [Self::Zstd, Self::Gzip] {
            let quality = coding.quality(headers);
            if quality > best.0 {
                best = (quality, coding);
            }
        }
        best.1
    }

    /// The weight that the client gives to this coding (RFC 9110, 12.5.3); 0 if it does not take it.
    fn quality(self, headers: &HeaderMap) -> f64 {
        let mut any = 0.0;
        for word in words(headers, ACCEPT_ENCODING) {
            let mut parts = word.split(';').map(str::trim);
            let name = parts.next().unwrap_or_default();
            let weight = parts.find_map(|part| part.strip_prefix("q=")?.parse().ok());
            let weight = weight.unwrap_or(1.0);
            if self.name().is_some_and(|own| own.eq_ignore_ascii_case(name)) {
                return weight;
            }
            if name == "*" {
                any = weight;
            }
        }
        any
    }

    /// Compresses a body, if it is worth it; returns what was done. It takes a while for a large one,
    /// and several times as long where it is to be `small`.
    pub fn encode(self, body: Bytes, small: bool) -> io::Result<(Bytes, Self)> {
        if (body.len() as u64) < WORTH || self == Self::Identity {
            return Ok((body, Self::Identity));
        }
        let mut packed = if self == Self::Zstd {
            // Rounded profiles as JSON come out a tenth smaller with 9 than with the usual 3, and their
            // differences another tenth with 15.
            zstd::bulk::compress(&body, if small { 15 } else { 9 })?
        } else {
            let room = Vec::with_capacity(body.len());
            let mut gzip = GzEncoder::new(room, Compression::default());
            gzip.write_all(&body)?;
            gzip.finish()?
        };
        // It may stay in memory for long.
        packed.shrink_to_fit();
        Ok((packed.into(), self))
    }
}

/// Says which answers are compressed while they are sent: texts of some size that end, and that have
/// no tag; those that have one are results.
#[derive(Debug, Clone, Copy)]
pub struct OnTheWay;

impl Predicate for OnTheWay {
    fn should_compress<B: axum::body::HttpBody>(&self, response: &Response<B>) -> bool {
        let headers = response.headers();
        let kind = headers.get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
        let is_text = kind.is_some_and(|kind| {
            let words = ["json", "xml", "javascript", "text/"];
            words.iter().any(|word| kind.contains(word)) && !kind.contains("event-stream")
        });
        let size = response.body().size_hint().exact();
        is_text
            && !headers.contains_key(ETAG)
            && size.is_some_and(|size| (WORTH..=TOO_LARGE).contains(&size))
    }
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderValue;

    use super::*;

    #[test]
    fn the_client_says_what_it_takes() {
        let choose = |value| {
            let headers =
                HeaderMap::from_iter([(ACCEPT_ENCODING, HeaderValue::from_static(value))]);
            Coding::choose(&headers, Format::Json)
        };
        for (value, coding) in [
            ("gzip, deflate, br, zstd", Coding::Zstd),
            ("gzip;q=1.0, zstd;q=0.5", Coding::Gzip),
            ("GZIP", Coding::Gzip),
            ("*", Coding::Zstd),
            ("zstd;q=0, *", Coding::Gzip),
            ("br, deflate", Coding::Identity),
            ("identity, gzip;q=0", Coding::Identity),
            ("", Coding::Identity),
        ] {
            assert_eq!(choose(value), coding, "{value}");
        }
        let headers = HeaderMap::from_iter([(ACCEPT_ENCODING, HeaderValue::from_static("*"))]);
        assert_eq!(Coding::choose(&headers, Format::Npz), Coding::Identity);
    }

    #[test]
    fn what_is_compressed_comes_out_as_it_was() {
        let body = Bytes::from(b"[0.0,1.5e-7]".repeat(1000));
        let (packed, coding) = Coding::Zstd.encode(body.clone(), true).unwrap();
        assert_eq!(
            (coding, zstd::bulk::decompress(&packed, 1 << 20).unwrap()),
            (Coding::Zstd, body.to_vec())
        );
        let (packed, coding) = Coding::Gzip.encode(body.clone(), false).unwrap();
        let mut out = Vec::new();
        io::copy(&mut flate2::read::GzDecoder::new(&*packed), &mut out).unwrap();
        assert_eq!((coding, out), (Coding::Gzip, body.to_vec()));
        let small = Bytes::from_static(b"[]");
        assert_eq!(Coding::Zstd.encode(small.clone(), false).unwrap(), (small, Coding::Identity));
    }
}
