//! Passwords and keys of the settings, which no log shows.

use std::fmt;

/// A text that contains a password or a key. This type accepts any text, because an error of clap would print it. The
/// code that uses the secret checks it.
#[derive(Clone)]
pub struct Secret(pub String);

impl From<String> for Secret {
    fn from(text: String) -> Self {
        Self(text)
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("(not shown)")
    }
}
