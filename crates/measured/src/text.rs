//! The bytes of a file as text.

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

/// Decodes UTF-8, UTF-16 and Latin-1. Adds a note if the text is not UTF-8.
///
/// # Errors
/// The file is no text.
pub fn decode(bytes: &[u8], notes: &mut Vec<String>) -> Result<String, String> {
    let utf16 = |unit: fn([u8; 2]) -> u16| {
        let units: Vec<u16> = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]])).collect();
        (String::from_utf16_lossy(&units), Some("UTF-16"))
    };
    let (text, encoding) = match (bytes, str::from_utf8(bytes)) {
        ([0xFF, 0xFE, ..] | [1..=u8::MAX, 0, 1..=u8::MAX, 0, ..], _) => utf16(u16::from_le_bytes),
        ([0xFE, 0xFF, ..] | [0, 1..=u8::MAX, 0, 1..=u8::MAX, ..], _) => utf16(u16::from_be_bytes),
        (_, Ok(text)) => (text.to_owned(), None),
        (_, Err(_)) => (bytes.iter().map(|byte| char::from(*byte)).collect(), Some("Latin-1")),
    };
    let kind = OTHERS.iter().find(|(first, _)| bytes.trim_ascii_start().starts_with(first));
    let is_binary = text.contains(|letter: char| letter < ' ' && !"\t\r\n".contains(letter));
    if let Some(kind) = kind.map(|(_, kind)| *kind).or(is_binary.then_some("no text")) {
        return Err(format!("The file is {kind}. Save the table as CSV and send that file"));
    }
    notes.extend(encoding.map(|encoding| format!("The file was read as {encoding}.")));
    Ok(text.trim_start_matches('\u{FEFF}').replace("\r\n", "\n").replace('\r', "\n"))
}
