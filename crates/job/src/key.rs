//! The key of a result, and the engine that is a part of it.

use std::fmt;
use std::str::FromStr;

use data_encoding::HEXLOWER;
use fretwork_engine::scenario;
use serde::{Serialize, Serializer};
use sha2::{Digest, Sha256};

/// Name and `numerics` version of the engine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Engine {
    /// Its name.
    pub name: &'static str,
    /// Increases with each version that changes a digit of a result.
    pub numerics: u32,
}

/// The engine of this program.
pub const ENGINE: Engine = Engine { name: "fretwork", numerics: scenario::NUMERICS };

/// The key of a result: SHA-256 of the engine's name, its `numerics` version and the canonical scenario
/// (RFC 8785). Its text form is lower-case hexadecimal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Key([u8; 32]);

impl Key {
    /// The 32 bytes of the digest.
    pub fn bytes(&self) -> &[u8; 32] {
        &self.0
    }

    /// The key with this digest.
    pub fn from_bytes(bytes: [u8; 32]) -> Self {
        Self(bytes)
    }

    /// The key of a canonical task, for instance `{"scenario": {…}}`, under this `numerics` version.
    ///
    /// # Panics
    /// The task cannot be written as JSON.
    #[expect(clippy::expect_used, reason = "a wrong key would name another result")]
    pub fn of(numerics: u32, task: &impl Serialize) -> Self {
        #[derive(Serialize)]
        struct Identity<'a, T> {
            engine: &'static str,
            numerics: u32,
            #[serde(flatten)]
            task: &'a T,
        }
        let identity = Identity { engine: ENGINE.name, numerics, task };
        let bytes = serde_json_canonicalizer::to_vec(&identity);
        Self::digest(&bytes.expect("a task is made of finite numbers and strings"))
    }

    pub(super) fn digest(document: &[u8]) -> Self {
        Self(Sha256::digest(document).into())
    }
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut digits = [0; 64];
        f.write_str(HEXLOWER.encode_mut_str(&self.0, &mut digits))
    }
}

/// The text is not a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a key is 64 lower-case hexadecimal digits")]
pub struct BadKey;

impl FromStr for Key {
    type Err = BadKey;
    fn from_str(text: &str) -> Result<Self, BadKey> {
        let mut bytes = [0; 32];
        let is_key = text.len() == 64 && HEXLOWER.decode_mut(text.as_bytes(), &mut bytes).is_ok();
        is_key.then_some(Self(bytes)).ok_or(BadKey)
    }
}

impl Serialize for Key {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_can_be_parsed_from_its_text() {
        let key = Key::digest(b"a scenario");
        assert_eq!(key.to_string().parse(), Ok(key));
        assert_eq!(key.to_string().to_uppercase().parse::<Key>(), Err(BadKey));
        assert_eq!("12".parse::<Key>(), Err(BadKey));
    }
}
