//! Text of a figure: its width, its line breaks, its SVG markup.
//!
//! The width of a character is the larger width of two fonts: Helvetica, which has the same widths as Arial and
//! Liberation Sans, and DejaVu Sans, which is used if no other font is installed.

/// Font sizes in px: titles of sheets, titles of figures, labels of axes, all other text.
pub(super) const HEADING: f64 = 15.0;
pub(super) const TITLE: f64 = 12.5;
pub(super) const LABEL: f64 = 12.0;
pub(super) const SMALL: f64 = 10.5;
/// Distance between two lines of text, in font sizes.
pub(super) const LEADING: f64 = 1.3;
/// Distance between elements, in px.
pub(super) const GAP: f64 = 6.0;
/// Distance from the middle of small text down to its baseline, in px.
pub(super) const SINK: f64 = 0.35 * SMALL;

/// The width of a label in units of its font size. `$` signs mark italics and have no width.
pub fn width(label: &str) -> f64 {
    label.chars().map(advance).sum()
}

/// Advance widths of characters in font sizes, rounded up within each class.
const ADVANCES: [(&str, f64); 7] = [
    ("ijl'", 0.28),
    (" ,./:;I\\|", 0.34),
    ("!()-[]frt·₀₁₂₃₄₅₆₇₈₉⁰¹²³⁴⁵⁶⁷⁸⁹", 0.41),
    ("cksvxyzJ⁻", 0.6),
    ("ABEFKLPSTVXYZ", 0.69),
    ("CDGHNÑOQRUw&ΔΩ", 0.82),
    ("+<=>~^#−×≤≥≈", 0.84),
];

fn advance(c: char) -> f64 {
    match c {
        '$' | '\u{300}'..='\u{36f}' => 0.0,
        'M' | 'm' | 'W' | '%' | '—' => 1.0,
        // Characters of scripts without lower case are about as wide as high.
        '\u{1100}'.. if !('\u{2000}'..'\u{2e80}').contains(&c) => 1.0,
        _ => {
            let class = ADVANCES.iter().find(|(characters, _)| characters.contains(c));
            class.map_or(0.64, |(_, advance)| *advance)
        }
    }
}

/// Breaks a text into lines of at most `measure` font sizes. A longer word has its own line.
pub fn wrap(text: &str, measure: f64) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if width(line) + width(word) + advance(' ') <= measure => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// A label as the content of a `text` element: escaped, with text between `$` signs in italics. If the
/// number of signs is odd, they are dollar signs.
pub fn markup(label: &str) -> String {
    let pieces: Vec<&str> = label.split('$').collect();
    if pieces.len().is_multiple_of(2) {
        return escape(label);
    }
    let italic = |(i, piece): (usize, &&str)| match i % 2 {
        1 => format!("<tspan font-style=\"italic\">{}</tspan>", escape(piece)),
        _ => escape(piece),
    };
    pieces.iter().enumerate().map(italic).collect()
}

/// Escapes a text for XML 1.0 elements and quoted attributes.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\0'..' ' | '\u{fffe}' | '\u{ffff}' => out.push(' '),
            c => out.push(c),
        }
    }
    out
}

/// 10 with a superscript exponent.
pub fn power_of_ten(exponent: i32) -> String {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let raised = |c: char| c.to_digit(10).map_or('⁻', |digit| DIGITS[digit as usize]);
    format!("10{}", exponent.to_string().chars().map(raised).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_between_dollar_signs_is_italic_and_xml_is_escaped() {
        assert_eq!(markup("$a$₀ < 1"), "<tspan font-style=\"italic\">a</tspan>₀ &lt; 1");
        assert_eq!(markup("5 $ & \u{1}"), "5 $ &amp;  ");
        assert!((width("$a$₀") - width("a₀")).abs() < 1e-15);
    }

    #[test]
    fn wrapped_lines_are_as_long_as_possible() {
        let text = "one two three four five";
        for measure in [1.0, 4.0, 8.0, 100.0] {
            let lines = wrap(text, measure);
            assert_eq!(lines.join(" "), text);
            for pair in lines.windows(2) {
                let next = pair[1].split(' ').next().unwrap_or_default();
                assert!(width(&format!("{} {next}", pair[0])) > measure);
                assert!(width(&pair[0]) <= measure || !pair[0].contains(' '));
            }
        }
        assert!(wrap("  ", 3.0).is_empty());
    }
}
