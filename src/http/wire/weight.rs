//! The memory that a JSON text needs when it is parsed, counted before it is parsed.
//!
//! A tree of values can need a hundred times the memory of its text.

use crate::http::problem::{Problem, Result, kinds};

/// Maximum number of objects and arrays. A block or an output cycle can be one of them.
const GROUPS: usize = 10_000;
/// Maximum number of values.
const VALUES: usize = 250_000;
/// Maximum number of members of all objects together.
const MEMBERS: usize = 50_000;
/// Maximum depth of objects and arrays inside each other.
const DEPTH: usize = 32;

/// Memory of an object or an array, of a member with its name, and of a value while they are parsed and read, in bytes.
/// Measured: 120 for each value of a table, 650 for a block with one member.
const BYTES: [usize; 3] = [300, 250, 120];

/// Counts the parts of a JSON text, and returns the bytes of its tree. The text need not be valid JSON.
///
/// # Errors
/// The text has too many parts.
pub fn tree_bytes(text: &[u8]) -> Result<usize> {
    let (mut groups, mut members, mut commas, mut depth, mut deepest) = (0, 0, 0, 0_usize, 0);
    let mut letters = 0;
    let mut bytes = text.iter();
    while let Some(byte) = bytes.next() {
        match byte {
            b'"' => {
                // Skips the text to its closing quote.
                let rest = bytes.len();
                while let Some(byte) = bytes.next() {
                    match byte {
                        b'"' => break,
                        b'\\' => _ = bytes.next(),
                        _ => {}
                    }
                }
                letters += rest - bytes.len();
            }
            b'{' | b'[' => {
                groups += 1;
                depth += 1;
                deepest = deepest.max(depth);
            }
            b'}' | b']' => depth = depth.saturating_sub(1),
            b':' => members += 1,
            b',' => commas += 1,
            _ => {}
        }
    }
    // In an object or an array, each value except the first has a comma before it.
    let values = commas + groups + 1;
    let excess = [
        (groups, GROUPS, "objects and arrays"),
        (members, MEMBERS, "members"),
        (values, VALUES, "values"),
        (deepest, DEPTH, "levels of objects and arrays"),
    ];
    match excess.into_iter().find(|(count, most, _)| count > most) {
        None => Ok(BYTES[0] * groups + BYTES[1] * members + BYTES[2] * values + letters),
        Some((count, most, what)) => {
            let detail = format!(
                "The body has {count} {what}; the limit is {most}. Submit a smaller document."
            );
            Err(Problem::new(&kinds::BODY_TOO_LARGE, detail))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn brackets_and_commas_inside_strings_are_not_counted() {
        let bytes = |text: &str| tree_bytes(text.as_bytes()).unwrap();
        assert_eq!(bytes("[1, 2, 3]"), BYTES[0] + 4 * BYTES[2]);
        assert_eq!(bytes(r#"{"a": {}}"#), 2 * BYTES[0] + BYTES[1] + 3 * BYTES[2] + 2);
        assert_eq!(bytes(r#""[{:,\"]\\""#), BYTES[2] + 10);
        // An unfinished string extends to the end of the text.
        assert_eq!(bytes(r#"["\"#), BYTES[0] + 2 * BYTES[2] + 1);
    }

    #[test]
    fn a_text_with_too_many_parts_is_refused() {
        let table = format!("[{}1]", "1,".repeat(VALUES - 10));
        assert!(tree_bytes(table.as_bytes()).is_ok());
        for bad in [
            format!("[{}]", "{},".repeat(GROUPS)),
            format!("[{}1]", "1,".repeat(VALUES)),
            format!("{{{}}}", "\"x\":1,".repeat(MEMBERS + 1)),
            "[".repeat(DEPTH + 1),
        ] {
            assert!(tree_bytes(bad.as_bytes()).is_err(), "{bad:.20}");
        }
    }
}
