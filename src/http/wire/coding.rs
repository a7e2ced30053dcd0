//! Compressed answers: Zstandard or gzip, as the client accepts.
//!
//! Answers made from results are compressed once for all clients; other answers are compressed each time.

use std::io::{self, Read, Write};
use std::{iter, mem};

use axum::body::{Bytes, HttpBody as _};
use axum::http::header::{
    ACCEPT_ENCODING, CONTENT_ENCODING, CONTENT_LENGTH, CONTENT_TYPE, ETAG, VARY,
};
use axum::http::{HeaderMap, HeaderValue};
use axum::response::{IntoResponse as _, Response};
use bytes::Buf as _;
use flate2::Compression;
use flate2::write::GzEncoder;
use http_body_util::BodyExt as _;
use tokio::task;
use zstd::zstd_safe::CParameter;

use super::negotiation::{preferred, weighted};
use crate::http::problem::Problem;

/// Smallest body that is compressed, in bytes: less fits into one or two packets.
const MIN_SIZE: u64 = 1 << 10;

/// Largest body that is compressed for one client only, in bytes: it is in memory as a whole.
const MAX_SIZE: u64 = 1 << 20;

/// Largest body that is compressed on an async thread, in bytes: more would delay other requests.
const SHORT: usize = 1 << 14;

/// Memory that [`decoded`] takes, in bytes.
pub const DECODER: usize = 1 << 20;

/// A compression (`Content-Encoding`).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Coding {
    /// No compression.
    Identity,
    /// RFC 1952.
    Gzip,
    /// RFC 8878.
    Zstd,
}

impl Coding {
    /// All codings, in the order of the enum.
    pub const ALL: [Self; 3] = [Self::Identity, Self::Gzip, Self::Zstd];

    /// The name in a header, or `None` without compression.
    pub fn name(self) -> Option<&'static str> {
        match self {
            Self::Identity => None,
            Self::Gzip => Some("gzip"),
            Self::Zstd => Some("zstd"),
        }
    }

    /// The coding that the client prefers (RFC 9110, 12.5.3), or none.
    ///
    /// A client that rejects the identity coding may get it nevertheless. An error would be worse, above all after a
    /// request that changed something.
    pub fn choose(headers: &HeaderMap) -> Self {
        let accepted = weighted(headers, ACCEPT_ENCODING);
        let weight = |coding: Self| {
            let find = |name: &str| accepted.iter().find(|(own, _)| own.eq_ignore_ascii_case(name));
            coding.name().and_then(find).or_else(|| find("*")).map_or(0.0, |(_, weight)| *weight)
        };
        preferred(&[Self::Zstd, Self::Gzip], weight).unwrap_or(Self::Identity)
    }

    /// Compresses an answer for one client, if it is a text of known size without a strong entity tag. Answers with a strong
    /// tag are made from results or files, and were compressed if that makes them shorter.
    pub async fn compress(self, mut answer: Response) -> Response {
        if !is_compressible(&answer) {
            return answer;
        }
        answer.headers_mut().append(VARY, HeaderValue::from_static("accept-encoding"));
        let Some(name) = self.name() else { return answer };
        let (mut head, body) = answer.into_parts();
        let text = match body.collect().await {
            Ok(text) => text.to_bytes(),
            Err(error) => return Problem::bug(error).into_response(),
        };
        let packed = self.packed(text.clone()).await;
        match &packed {
            Ok(_) => {
                head.headers.insert(CONTENT_ENCODING, HeaderValue::from_static(name));
                head.headers.remove(CONTENT_LENGTH);
            }
            Err(error) => tracing::error!(%error, "cannot compress an answer"),
        }
        Response::from_parts(head, packed.unwrap_or(text).into())
    }

    /// Compresses a text quickly. A long text is compressed on a blocking thread.
    async fn packed(self, text: Bytes) -> io::Result<Bytes> {
        let size = text.len();
        let pack = move || match self {
            Self::Identity => Ok(text),
            Self::Gzip => self.encode(&text).map(|(packed, _)| packed),
            Self::Zstd => {
                zstd::bulk::compress(&text, zstd::DEFAULT_COMPRESSION_LEVEL).map(Bytes::from)
            }
        };
        if size <= SHORT { pack() } else { task::spawn_blocking(pack).await? }
    }

    /// An encoder that compresses what is written to it.
    pub fn encoder(self) -> Encoder {
        Encoder { coding: self, waiting: Vec::new(), written: 0, stream: None }
    }

    /// Compresses a text.
    pub fn encode(self, text: &[u8]) -> io::Result<(Bytes, Self)> {
        let mut encoder = self.encoder();
        encoder.write_all(text)?;
        encoder.finish()
    }
}

/// Decompresses a Zstandard text, piece by piece. The first error ends the text.
pub fn decoded(packed: Bytes) -> impl Iterator<Item = io::Result<Bytes>> + Send {
    /// Size of a piece, in bytes.
    const PIECE: u64 = 64 << 10;
    let mut decoder = zstd::Decoder::with_buffer(packed.reader());
    iter::from_fn(move || {
        let mut piece = Vec::with_capacity(PIECE as usize);
        let read = match &mut decoder {
            Ok(text) => text.take(PIECE).read_to_end(&mut piece),
            Err(error) => Err(mem::replace(error, io::ErrorKind::Other.into())),
        };
        match read {
            Ok(0) => None,
            read => Some(read.map(|_| piece.into())),
        }
    })
}

/// Compresses a text while it is written, so that a large text is never fully in memory.
pub struct Encoder {
    coding: Coding,
    /// The bytes that were written but not compressed yet. Without compression this is the whole text.
    waiting: Vec<u8>,
    /// The number of bytes that were written.
    written: usize,
    stream: Option<Stream>,
}

enum Stream {
    Gzip(GzEncoder<Vec<u8>>),
    Zstd(zstd::Encoder<'static, Vec<u8>>),
}

impl Encoder {
    /// Number of bytes that are compressed at once. The compressor knows the size of a text that is
    /// not longer.
    const CHUNK: usize = 1 << 21;

    /// The number of bytes of the text so far.
    pub fn written(&self) -> usize {
        self.written
    }

    /// The compressed bytes, and their coding: none if the text is too short.
    pub fn finish(mut self) -> io::Result<(Bytes, Coding)> {
        let size = self.waiting.len() as u64;
        if self.stream.is_none() && (size < MIN_SIZE || self.coding == Coding::Identity) {
            self.waiting.shrink_to_fit();
            return Ok((self.waiting.into(), Coding::Identity));
        }
        self.compress(Some(size))?;
        let mut compressed = match self.stream {
            Some(Stream::Gzip(gzip)) => gzip.finish()?,
            Some(Stream::Zstd(zstd)) => zstd.finish()?,
            None => self.waiting,
        };
        // The bytes may stay in the cache for long.
        compressed.shrink_to_fit();
        Ok((compressed.into(), self.coding))
    }

    /// Compresses the waiting bytes; `size` is their number if they are the whole text.
    fn compress(&mut self, size: Option<u64>) -> io::Result<()> {
        if self.stream.is_none() {
            let gzip = || Stream::Gzip(GzEncoder::new(Vec::new(), Compression::new(GZIP_LEVEL)));
            self.stream = match self.coding {
                Coding::Identity => None,
                Coding::Gzip => Some(gzip()),
                Coding::Zstd => Some(Stream::Zstd(zstd_encoder(size)?)),
            };
        }
        match &mut self.stream {
            Some(Stream::Gzip(gzip)) => gzip.write_all(&self.waiting)?,
            Some(Stream::Zstd(zstd)) => zstd.write_all(&self.waiting)?,
            None => return Ok(()),
        }
        self.waiting.clear();
        Ok(())
    }
}

/// The level of gzip. On tables of numbers it takes half the time of the default level 6, for 2 % more bytes.
const GZIP_LEVEL: u32 = 3;

/// A compressor for tables of numbers, in which repetitions are near: at most one row back.
///
/// Other requests wait while a large answer is made, so long texts, whose size is unknown, are compressed quickly. With a
/// larger hash table than usual, level 1 compresses 172 MB of NDJSON in 0.7 s instead of the 3.4 s of level 9, to fewer bytes.
/// The window is as large as that of stored results: 27.6 MB of NDJSON become 2.7 MB, against 3.8 MB with 128 KiB, and a
/// decompressor takes less than [`DECODER`].
fn zstd_encoder(size: Option<u64>) -> io::Result<zstd::Encoder<'static, Vec<u8>>> {
    let level = if size.is_some() { 9 } else { 1 };
    let mut zstd = zstd::Encoder::new(Vec::new(), level)?;
    zstd.set_pledged_src_size(size)?;
    for parameter in [CParameter::WindowLog(19), CParameter::HashLog(18)] {
        zstd.set_parameter(parameter)?;
    }
    Ok(zstd)
}

impl Write for Encoder {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.waiting.extend_from_slice(bytes);
        self.written += bytes.len();
        if self.coding != Coding::Identity && self.waiting.len() >= Self::CHUNK {
            self.compress(None)?;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Whether an answer is a text that is not compressed and would become shorter.
fn is_compressible(answer: &Response) -> bool {
    let headers = answer.headers();
    let kind = headers.get(CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
    let is_text = |kind: &str| {
        let words = ["json", "xml", "javascript", "text/"];
        words.iter().any(|word| kind.contains(word)) && !kind.contains("event-stream")
    };
    let size = answer.body().size_hint().exact();
    let tag = headers.get(ETAG).map(HeaderValue::as_bytes);
    tag.is_none_or(|tag| tag.starts_with(b"W/"))
        && !headers.contains_key(CONTENT_ENCODING)
        && size.is_some_and(|size| (MIN_SIZE..=MAX_SIZE).contains(&size))
        && kind.is_some_and(is_text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_accept_encoding_header_selects_the_compression() {
        let choose = |value| {
            let headers =
                HeaderMap::from_iter([(ACCEPT_ENCODING, HeaderValue::from_static(value))]);
            Coding::choose(&headers)
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
    }

    #[test]
    fn a_text_is_decompressed_in_pieces_and_a_damaged_one_ends_with_an_error() {
        let text = b"[0.0,1.5e-7]".repeat(50_000);
        let (packed, _) = Coding::Zstd.encode(&text).unwrap();
        let pieces: Vec<Bytes> = decoded(packed.clone()).collect::<io::Result<_>>().unwrap();
        assert!(pieces.len() > 1 && pieces.concat() == text);
        for length in [3, packed.len() - 1] {
            let cut = decoded(packed.slice(..length)).find(Result::is_err);
            assert!(cut.is_some(), "{length}");
        }
    }

    #[test]
    fn a_compressed_body_decompresses_to_the_original() {
        let pack = |coding: Coding, text: &[u8]| coding.encode(text).unwrap();
        for times in [1000, 100_000, 400_000] {
            let body = b"[0.0,1.5e-7]".repeat(times);
            let (packed, coding) = pack(Coding::Zstd, &body);
            let room = body.len() + 1;
            assert!(packed.len() < body.len() / 100);
            assert_eq!(coding, Coding::Zstd);
            assert!(zstd::bulk::decompress(&packed, room).unwrap() == body);
            let (packed, coding) = pack(Coding::Gzip, &body);
            let mut out = Vec::new();
            io::copy(&mut flate2::read::GzDecoder::new(&*packed), &mut out).unwrap();
            assert_eq!(coding, Coding::Gzip);
            assert!(out == body);
            assert!(pack(Coding::Identity, &body) == (body.into(), Coding::Identity));
        }
        assert_eq!(pack(Coding::Zstd, b"[]"), (Bytes::from_static(b"[]"), Coding::Identity));
    }
}
