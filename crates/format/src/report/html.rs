//! What a report shows without scripts. [`text`] escapes all texts of results and users.

use fretwork_plot::text::escape as text;

use super::entry::ReportedResult;

/// The content of the page, which is also well-formed XML.
pub fn body(title: &str, entries: &[ReportedResult]) -> String {
    let mut out = format!("<h1><bdi>{}</bdi></h1>", text(title));
    for entry in entries {
        let name = if entries.len() > 1 { format!(" of {}", entry.name()) } else { String::new() };
        out += &section(&format!("Inputs{name}"), "", &pairs(&entry.inputs));
        out += &section(&format!("Results{name}"), "", &pairs(&entry.numbers));
        let warning = |detail: &str| format!("<p class=\"warning\">{}</p>", text(detail));
        out.extend(entry.warnings.iter().map(|detail| warning(detail)));
    }
    // A single command is printed.
    let open = if entries.len() == 1 { " open=\"\"" } else { "" };
    let origin = |entry: &ReportedResult| {
        let again = match &entry.command {
            Some(command) => command.lines().map(text).collect::<Vec<_>>().join("\n"),
            None => format!("Submit the member {} of the result.", entry.kind.member()),
        };
        format!(
            "<div>{}<details{open}><summary>To compute it again</summary><pre tabindex=\"0\">{again}</pre></details></div>",
            pairs(&entry.origin)
        )
    };
    out + &section("Origin", " id=\"origin\"", &entries.iter().map(origin).collect::<String>())
}

/// A section. The content is HTML.
fn section(title: &str, id: &str, content: &str) -> String {
    format!("<section class=\"card\"{id}><h2>{}</h2>{content}</section>\n", text(title))
}

/// A table of names and values.
fn pairs(pairs: &[(String, String)]) -> String {
    let row = |(name, value): &(String, String)| {
        format!("<tr><th scope=\"row\">{}</th><td>{}</td></tr>", text(name), text(value))
    };
    format!(
        "<table class=\"written\"><tbody>{}</tbody></table>",
        pairs.iter().map(row).collect::<String>()
    )
}
