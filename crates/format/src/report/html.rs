//! The elements of a report. [`text`] escapes all texts of results and users.

use std::fmt::Write as _;

pub use fretwork_plot::text::escape as text;

/// On paper, pages are white and no figure is cut.
const STYLE: &str = include_str!("style.css");

/// The whole page, which is also well-formed XML. Its policy also holds for a saved file.
pub fn page(title: &str, body: &str) -> String {
    let (title, style) = (text(title), STYLE.replace('\n', ""));
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\"/>\
         <meta name=\"viewport\" content=\"width=device-width\"/><title>{title} · fretwork</title>\
         <style>{style}</style></head>\n<body><main>{body}</main></body></html>\n"
    )
}

/// The title of the page, and a line below it.
pub fn heading(title: &str, about: &str) -> String {
    format!("<header><h1><bdi>{}</bdi></h1><p>{}</p></header>", text(title), text(about))
}

/// A section. The content is HTML.
pub fn section(title: &str, content: &str) -> String {
    format!("<section><h2>{}</h2>{content}</section>\n", text(title))
}

/// Names and values.
pub fn pairs(pairs: &[(String, String)]) -> String {
    let row = |(name, value): &(String, String)| {
        let class =
            if (name.chars().chain(value.chars())).count() > 45 { " class=\"long\"" } else { "" };
        format!("<div{class}><dt>{}</dt><dd>{}</dd></div>", text(name), text(value))
    };
    format!("<dl>{}</dl>", pairs.iter().map(row).collect::<String>())
}

/// A table. The first cell of each row is its heading.
pub fn table(head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    // A wide table scrolls on a narrow screen, also with the keys.
    let mut out = "<div class=\"wide\" tabindex=\"0\"><table><thead><tr>".to_owned();
    for name in head {
        let _ = write!(out, "<th scope=\"col\">{}</th>", text(name));
    }
    out.push_str("</tr></thead><tbody>");
    for row in rows {
        out.push_str("<tr>");
        for (place, cell) in row.iter().enumerate() {
            let cell = text(cell);
            let _ = match place {
                0 => write!(out, "<th scope=\"row\">{cell}</th>"),
                _ => write!(out, "<td>{cell}</td>"),
            };
        }
        out.push_str("</tr>");
    }
    out + "</tbody></table></div>"
}

/// Figures side by side. They are SVG documents with their own descriptions.
pub fn figures(figures: &[String]) -> String {
    if figures.is_empty() {
        return String::new();
    }
    let figure = |svg: &String| format!("<figure>{svg}</figure>");
    format!("<div class=\"figures\">{}</div>", figures.iter().map(figure).collect::<String>())
}

/// A section with warnings, if there are any.
pub fn warnings(title: &str, warnings: &[String]) -> String {
    if warnings.is_empty() {
        return String::new();
    }
    let items = warnings.iter().map(|warning| format!("<li>{}</li>", text(warning)));
    section(title, &format!("<ul>{}</ul>", items.collect::<String>()))
}

/// Several lines of code.
pub fn lines(code: &str) -> String {
    code.lines().map(text).collect::<Vec<_>>().join("\n")
}
