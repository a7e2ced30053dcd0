//! The elements of a report. [`text`] escapes all texts of results and users.

use std::fmt::Write as _;

pub use fretwork_plot::text::escape as text;

/// On paper, pages are white and no figure is cut.
const STYLE: &str = "\
:root{color-scheme:light dark;--muted:#555;--line:#ccc;--soft:#f3f5f7}\
body{font:15px/1.4 system-ui,'Liberation Sans',sans-serif;max-width:62rem;margin:1.5rem auto;padding:0 1rem}\
h1{font-size:1.5em;margin:0;overflow-wrap:anywhere}h2{font-size:1.05em;margin:1.1em 0 .3em;break-after:avoid}\
header p,dt{color:var(--muted)}header p,p{margin:.2em 0}\
dl{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(20rem,100%),1fr));gap:.1em 1.5em;margin:0}\
dl div{display:flex;gap:.5em;break-inside:avoid}dt{flex:none;max-width:60%}dd{margin:0;overflow-wrap:anywhere}\
dl .long{grid-column:1/-1}.columns{display:flex;flex-wrap:wrap;gap:0 2em}\
.columns section{flex:1 1 20rem;min-width:0}.columns section:first-child{flex-grow:1.7}\
.wide{overflow-x:auto}table{border-collapse:collapse;width:100%}th,td{text-align:left;padding:.1em .6em .1em 0;\
border-bottom:1px solid var(--line);font-weight:400;vertical-align:top}thead th{color:var(--muted)}tr{break-inside:avoid}\
.figures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(26rem,100%),1fr));gap:.6em;margin:.8em 0}\
figure{margin:0;break-inside:avoid}svg{display:block;width:100%;height:auto}ul{margin:0;padding-left:1.2em}\
pre{font-size:.75em;line-height:1.25;background:var(--soft);padding:.5em;white-space:pre-wrap;overflow-wrap:anywhere;margin:.3em 0}\
@media screen and (prefers-color-scheme:dark){:root{--muted:#b5bcc4;--line:#444;--soft:#222}body{background:#181818;color:#ddd}}\
@media print{@page{margin:8mm 10mm}:root{color-scheme:light}\
body{font-size:8pt;line-height:1.2;max-width:none;margin:0;padding:0}h2{margin:.4em 0 .1em}\
.wide{overflow:visible}.columns{flex-wrap:nowrap;gap:1.2em}.columns section{min-width:auto}.columns tbody th,.columns td{white-space:nowrap}\
.figures{grid-template-columns:1fr 1fr;gap:1mm 2mm;margin:1mm 0;max-width:184mm}dl{grid-template-columns:repeat(3,1fr)}pre{font-size:6pt;padding:1mm;break-before:avoid;break-inside:avoid}}";

/// The whole page, which is also well-formed XML. Its policy also holds for a saved file.
pub fn page(title: &str, body: &str) -> String {
    let title = text(title);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\"/>\
         <meta name=\"viewport\" content=\"width=device-width\"/><title>{title} · fretwork</title>\
         <style>{STYLE}</style></head>\n<body><main>{body}</main></body></html>\n"
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
