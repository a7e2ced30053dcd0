//! The bytes of a file as text.

use crate::notes::Notes;

/// The first bytes of files that are no text.
const OTHERS: [(&[u8], &str); 8] = [
    (b"PK\x03\x04", "a ZIP archive, such as a workbook (.xlsx, .ods)"),
    (b"\xD0\xCF\x11\xE0", "an Excel workbook (.xls)"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xFF\xD8\xFF", "a JPEG picture"),
    (b"%PDF", "a PDF document"),
    (b"\x1F\x8B", "compressed by gzip"),
    (b"{", "a JSON document"),
    (b"[[", "a JSON document"),
];

/// UTF-16, and UTF-8 with the mark of an editor, as text. `None` for other bytes.
pub fn marked(bytes: &[u8]) -> Option<String> {
    let utf16 = |unit: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]])).collect();
        Some(String::from_utf16_lossy(&units).trim_start_matches('\u{FEFF}').to_owned())
    };
    match bytes {
        [0xFF, 0xFE, ..] | [1..=u8::MAX, 0, 1..=u8::MAX, 0, ..] => utf16(u16::from_le_bytes),
        [0xFE, 0xFF, ..] | [0, 1..=u8::MAX, 0, 1..=u8::MAX, ..] => utf16(u16::from_be_bytes),
        [0xEF, 0xBB, 0xBF, rest @ ..] => str::from_utf8(rest).ok().map(str::to_owned),
        _ => None,
    }
}

/// Decodes UTF-8, UTF-16 and Latin-1. Adds a note if the text is not UTF-8.
///
/// # Errors
/// The file is no text.
pub fn decode(bytes: &[u8], notes: &mut Notes) -> Result<String, String> {
    let (text, encoding) = match (marked(bytes), str::from_utf8(bytes)) {
        (Some(text), Err(_)) => (text, Some("UTF-16")),
        (Some(text), Ok(_)) if bytes.contains(&0) => (text, Some("UTF-16")),
        (Some(text), Ok(_)) => (text, None),
        (None, Ok(text)) => (text.to_owned(), None),
        (None, Err(_)) => (bytes.iter().map(|byte| char::from(*byte)).collect(), Some("Latin-1")),
    };
    let kind = OTHERS.iter().find(|(first, _)| bytes.trim_ascii_start().starts_with(first));
    let is_binary = text.contains(|letter: char| letter < ' ' && !"\t\r\n".contains(letter));
    if let Some(kind) = kind.map(|(_, kind)| *kind).or(is_binary.then_some("no text")) {
        return Err(format!("The file is {kind}. Save the table as CSV and send that file"));
    }
    notes.extend(encoding.map(|encoding| format!("The file was read as {encoding}.")));
    // Some instruments write CR CR LF, which editors show as the end of one line.
    let text = text.replace("\r\r\n", "\n");
    Ok(text.replace("\r\n", "\n").replace('\r', "\n"))
}
