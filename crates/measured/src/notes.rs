//! What was done to a file, in words.

/// Sentences for the user.
pub type Notes = Vec<String>;
