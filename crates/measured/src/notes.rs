//! What was done to a file, in words.

use std::fmt::Display;

/// Sentences for the user.
pub type Notes = Vec<String>;

/// Tells a number of things, if there are any.
pub fn counted(notes: &mut Notes, count: usize, told: impl Display) {
    if count > 0 {
        notes.push(format!("{count} {told}"));
    }
}
