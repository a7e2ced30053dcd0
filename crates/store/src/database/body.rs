//! The body of a result as it is stored: its JSON, compressed with Zstandard.
//!
//! Versions before 0.3 stored plain JSON. The first four bytes show which form a body has.

use std::cell::RefCell;
use std::io;

use bytes::Bytes;
use fretwork_engine::scenario::MAX_ANSWER;
use xxhash_rust::xxh3::xxh3_64;
use zstd::bulk::Compressor;
use zstd::zstd_safe::{self, CParameter};

/// The first bytes of a Zstandard frame (RFC 8878).
const MAGIC: [u8; 4] = 0xfd2f_b528_u32.to_le_bytes();

/// Largest JSON that is decompressed, in bytes. `MAX_ANSWER` limits the size that is estimated before a computation.
/// The factor 2 covers the error of the estimate.
const MAX_SIZE: usize = 2 * MAX_ANSWER;

/// A body as it is stored.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Body(Bytes);

impl Body {
    /// Compresses the JSON of a result.
    pub(crate) fn pack(json: &[u8]) -> io::Result<Self> {
        thread_local! {
            /// One compressor per thread. To allocate its tables takes longer than to compress a short result.
            static COMPRESSOR: RefCell<Option<Compressor<'static>>> = const { RefCell::new(None) };
        }
        COMPRESSOR.with_borrow_mut(|compressor| {
            let compressor = match compressor {
                Some(compressor) => compressor,
                none => none.insert(compressor_of_digits()?),
            };
            Ok(Self(compressor.compress(json)?.into()))
        })
    }

    /// A body that was read from the database.
    pub(crate) fn stored(bytes: Vec<u8>) -> Self {
        Self(bytes.into())
    }

    /// A body from bytes that were read and checked before.
    pub fn of(bytes: Bytes) -> Self {
        Self(bytes)
    }

    /// The bytes as they are stored.
    pub fn bytes(&self) -> &Bytes {
        &self.0
    }

    /// Whether the bytes are compressed with Zstandard. Otherwise they are JSON.
    pub fn is_compressed(&self) -> bool {
        self.0.starts_with(&MAGIC)
    }

    /// The JSON of the result.
    ///
    /// # Errors
    /// The bytes are damaged.
    pub fn json(&self) -> io::Result<Bytes> {
        if !self.is_compressed() {
            return Ok(self.0.clone());
        }
        let size = self.size().filter(|size| *size <= MAX_SIZE);
        let size = size.ok_or_else(|| {
            io::Error::other(
                "the compressed JSON of a result does not state its size, or is too large",
            )
        })?;
        zstd::bulk::decompress(&self.0, size).map(Bytes::from)
    }

    /// The number of bytes of the JSON, if the compressed body states it.
    pub fn size(&self) -> Option<usize> {
        let size = zstd_safe::get_frame_content_size(&self.0).ok().flatten();
        size.and_then(|size| usize::try_from(size).ok())
    }

    /// A hash of the stored bytes, by which damage is detected.
    pub(crate) fn checksum(&self) -> i64 {
        xxh3_64(&self.0).cast_signed()
    }
}

/// A compressor for numbers in text. Mostly short sequences of digits repeat, by chance. A reference to such a sequence
/// takes more space than the digits. So matches must have at least 7 bytes, and a small hash table suffices.
///
/// A result of 256 points and 6 output cycles shrinks from 160 kB to 54 kB. The usual parameters of the levels 1 to 9
/// give 58 to 64 kB, and take up to ten times as long.
fn compressor_of_digits() -> io::Result<Compressor<'static>> {
    let mut compressor = Compressor::new(1)?;
    compressor.set_parameter(CParameter::MinMatch(7))?;
    compressor.set_parameter(CParameter::HashLog(10))?;
    Ok(compressor)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_packed_body_unpacks_to_the_same_json() {
        for times in [0, 1, 100, 100_000] {
            let json = format!("[{}]", "1.23456789012e-7,0.0,".repeat(times));
            let body = Body::pack(json.as_bytes()).unwrap();
            assert!(body.is_compressed() && body.size() == Some(json.len()));
            assert!(body.json().unwrap() == json.as_bytes());
            assert!(Body::stored(body.bytes().to_vec()) == body);
        }
        let plain = Body::stored(b"{}".to_vec());
        assert!(!plain.is_compressed() && plain.json().unwrap() == "{}");
    }

    #[test]
    fn a_truncated_body_is_an_error() {
        let body = Body::pack(&b"[0.5]".repeat(1000)).unwrap();
        for length in [4, 5, 10, body.bytes().len() - 1] {
            assert!(Body::stored(body.bytes()[..length].to_vec()).json().is_err(), "{length}");
        }
    }
}
