//! The pages that explain the types of problems.

use std::fmt::Write as _;

use super::kinds::ALL;

/// The page around a document.
const FRAME: &str = include_str!("../dashboard/docs.html");

fn html(title: &str, body: &str) -> String {
    FRAME.replace("{title}", title).replace("{body}", &code(body))
}

/// Changes `` `code` `` to HTML.
fn code(text: &str) -> String {
    let mut parts = text.split('`');
    let mut out = parts.next().unwrap_or_default().to_owned();
    for (index, part) in parts.enumerate() {
        let _ = write!(out, "<{}code>{part}", if index % 2 == 0 { "" } else { "/" });
    }
    out
}

/// The page that lists all problem types.
pub fn index() -> String {
    let mut body = "<h1>Problems</h1><p>Every error is \
        <code>application/problem+json</code>. Its <code>type</code> is one of these.</p><ul>"
        .to_owned();
    for kind in ALL {
        let (slug, status, [title, ..]) = (kind.slug, kind.status.as_u16(), kind.texts());
        let _ = write!(body, "<li>{status} <a href=\"/problems/{slug}\">{title}</a>");
    }
    body.push_str("</ul>");
    html("Problems", &body)
}

/// The page of one problem type.
pub fn page(slug: &str) -> Option<String> {
    let kind = ALL.iter().find(|kind| kind.slug == slug)?;
    let (status, [title, meaning, remedy]) = (kind.status, kind.texts());
    let body = format!(
        "<small>{status}</small><h1>{title}</h1><p>{meaning}</p><h2>What to do</h2><p>{remedy}</p>\
         <p><a href=\"/problems\">All problems</a></p>"
    );
    Some(html(title, &body))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_problem_type_has_a_unique_slug_and_a_page() {
        for (place, kind) in ALL.iter().enumerate() {
            assert!(ALL[..place].iter().all(|other| other.slug != kind.slug), "{}", kind.slug);
            let [title, _, remedy] = kind.texts();
            assert!(page(kind.slug).is_some_and(|page| page.contains(&code(remedy))));
            assert!(index().contains(title));
        }
        assert!(page("no-such-problem").is_none());
    }
}
