//! The parts of the page, written as Markdown with one table per section.

use std::fmt;

/// The introduction, then a heading and a text for each section.
const WORDS: &str = include_str!("page.md");

/// The heading and the text of the section about the random runs in `accuracy.md`. These runs take too long to be
/// repeated whenever the page is computed.
const RANDOM: &str = include_str!("random.md");

/// Whom the program is compared with, and the sources of these checks.
const GROUPS: [(&str, &[&str]); 8] = [
    ("runs and limiting states of two other discretisations", &["table"]),
    (
        "formulas for the contact, and worked examples",
        &[
            "Archard 1953",
            "Cattaneo 1938, Mindlin 1949",
            "Fouvry et al. 1995",
            "Galin 1953",
            "Hertz 1882",
            "Mindlin & Deresiewicz 1953",
            "Segedin 1957",
            "Sneddon 1965",
            "q < 0.57735",
            "2I/(1 − cⁿ)",
            "c(1 − c²) = 2q/3",
            "late gross slip",
            "worked example",
        ],
    ),
    ("CONTACT by Vollebregt and Kalker", &["CONTACT"]),
    ("the worn flat by finite elements", &["Llavori 2026"]),
    (
        "tests of wear",
        &[
            "Arnaud et al. 2021",
            "Fouvry et al. 2007",
            "Fouvry et al. 2017",
            "McColl et al. 2004",
            "van Peteghem et al. 2011",
        ],
    ),
    ("the energy balance and the area of the loop", &["dV/dN = (k_w/μ)W", "W"]),
    (
        "itself on finer meshes, or by a closed form",
        &["amplitude", "closed form", "extrapolated", "one block", "tolerance 3e-4"],
    ),
    ("the simplified rule beside the exact method", &["exact method"]),
];

/// The comparison of one computed number with the same number from another source.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// The name of the number.
    pub what: String,
    /// The source of the reference.
    pub source: &'static str,
    /// The expected value.
    pub reference: f64,
    /// The value that this program computes; NaN if it cannot compute the value.
    pub value: f64,
    /// The expected relative error, which an inexact reference causes. It is 0 if the reference is exact.
    pub expected: f64,
    /// The check passes if the error differs from `expected` by at most this number. `None` if the error is only
    /// reported.
    pub accepted: Option<f64>,
}

impl Check {
    /// A check without an accepted error, which cannot fail.
    pub fn reported(
        what: impl Into<String>,
        source: &'static str,
        reference: f64,
        value: f64,
    ) -> Self {
        Self { what: what.into(), source, reference, value, expected: 0.0, accepted: None }
    }

    /// The relative error; the value itself where the reference is 0.
    pub fn error(&self) -> f64 {
        if self.reference == 0.0 { self.value } else { self.value / self.reference - 1.0 }
    }

    /// The distance from the expected error, divided by the accepted one. 1 or less passes; NaN never passes.
    pub fn share(&self) -> f64 {
        let error = (self.error() - self.expected).abs();
        match self.accepted {
            _ if error.is_nan() => f64::INFINITY,
            None => 0.0,
            // The accepted error may be 0.
            Some(_) if error == 0.0 => 0.0,
            Some(accepted) => error / accepted,
        }
    }

    /// Whether the error is accepted. A number that is only reported always passes.
    pub fn passes(&self) -> bool {
        self.share() <= 1.0
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, source, reference, value, expected, accepted } = self;
        // Small errors are easier to read as powers of ten.
        let in_percent = *reference != 0.0 && accepted.is_none_or(|accepted| accepted > 2.5e-4);
        let error = match self.error() {
            // Prints 0 instead of −0.
            error if in_percent => format!("{:.3} %", (1e5 * error).round() / 1e3 + 0.0),
            error => digits(error, 2),
        };
        let (accepted, verdict) = match accepted {
            None => ("–".to_owned(), "reported"),
            Some(accepted) => {
                let verdict = if self.passes() { "pass" } else { "**FAIL**" };
                let percent = || digits(100.0 * accepted, 2) + " %";
                let size = if in_percent { percent() } else { digits(*accepted, 2) };
                let around = format!("{} ± ", digits(100.0 * expected, 3));
                (if *expected == 0.0 { size } else { around + &size }, verdict)
            }
        };
        let (reference, value) = (digits(*reference, 6), digits(*value, 6));
        write!(
            f,
            "| {what} | {source} | {reference} | {value} | {error} | {accepted} | {verdict} |"
        )
    }
}

/// The title of a section, and the function that adds its checks as in [`Section::of`].
pub type TitledSection = (&'static str, fn(&mut Section) -> Option<()>);

/// A group of checks.
#[derive(Debug, Clone, PartialEq)]
pub struct Section {
    /// The heading of the section.
    pub title: &'static str,
    /// The checks of the section.
    pub checks: Vec<Check>,
}

impl Section {
    /// A section to which `fill` adds checks. If `fill` returns `None`, the section gets a check that fails.
    pub fn of(title: &'static str, fill: impl FnOnce(&mut Self) -> Option<()>) -> Self {
        let mut section = Self { title, checks: Vec::new() };
        if fill(&mut section).is_none() {
            section.check("cannot be computed", "–", f64::NAN, f64::NAN, 0.0);
        }
        section
    }

    /// Adds a check. Without an accepted error it cannot fail.
    pub fn check(
        &mut self,
        what: impl Into<String>,
        source: &'static str,
        reference: f64,
        value: f64,
        accepted: impl Into<Option<f64>>,
    ) {
        let number = Check::reported(what, source, reference, value);
        self.checks.push(Check { accepted: accepted.into(), ..number });
    }

    /// The check with the largest ratio of error to accepted error.
    pub fn closest(&self) -> Option<&Check> {
        let judged = self.checks.iter().filter(|check| check.accepted.is_some());
        judged.max_by(|a, b| a.share().total_cmp(&b.share()))
    }

    /// The text below the heading in `page.md`.
    fn words(&self) -> Option<&'static str> {
        let mut sections = WORDS.split("\n## ").skip(1);
        sections.find_map(|words| words.strip_prefix(self.title)?.strip_prefix('\n'))
    }
}

impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "\n## {}\n\n{}\n", self.title, self.words().unwrap_or_default().trim())?;
        writeln!(f, "| what | source | reference | computed | error | accepted | |")?;
        writeln!(f, "|---|---|---:|---:|---:|---:|---|")?;
        self.checks.iter().try_for_each(|check| writeln!(f, "{check}"))
    }
}

/// The whole verification page.
#[derive(Debug, Clone, PartialEq)]
pub struct VerificationPage {
    /// The sections of the page.
    pub sections: Vec<Section>,
}

impl VerificationPage {
    fn checks(&self) -> impl Iterator<Item = &Check> {
        self.sections.iter().flat_map(|section| &section.checks)
    }

    /// The checks that fail.
    pub fn failures(&self) -> impl Iterator<Item = &Check> {
        self.checks().filter(|check| !check.passes())
    }

    /// The number of checks, and for each group of sources the largest relative differences.
    fn summary(&self) -> String {
        let judged = self.checks().filter(|check| check.accepted.is_some()).count();
        let verdict = match self.failures().count() {
            0 => "**all pass**".to_owned(),
            failed => format!("**{failed} FAIL**"),
        };
        let reported = self.checks().count() - judged;
        let rows = GROUPS.into_iter().filter_map(|(group, sources)| {
            let checks = self.checks().filter(|check| sources.contains(&check.source));
            // The error of a reference of 0 is not relative.
            let (mut checks, absolute): (Vec<_>, Vec<_>) =
                checks.partition(|check| check.reference != 0.0);
            checks.sort_by(|a, b| a.error().abs().total_cmp(&b.error().abs()));
            let (median, largest) = (checks.get(checks.len() / 2)?, checks.last()?);
            let percent = |check: &Check| digits(100.0 * check.error().abs(), 2) + " %";
            let (count, what) = (checks.len() + absolute.len(), &largest.what);
            let (median, largest) = (percent(median), percent(largest));
            Some(format!("\n| {group} | {count} | {median} | {largest} | {what} |"))
        });
        let rows: String = rows.collect();
        format!(
            "{judged} checks: {verdict}. {reported} more numbers are reported.\n\n\
             | compared with | numbers | median difference | largest difference | where |\n\
             |---|---:|---:|---:|---|{rows}"
        )
    }
}

impl fmt::Display for VerificationPage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let introduction = WORDS.split("\n## ").take(2).collect::<Vec<_>>().join("\n## ");
        writeln!(f, "{}\n", introduction.trim().replace("{summary}", &self.summary()))?;
        writeln!(f, "| section | lines | closest to what is accepted | error / accepted |")?;
        writeln!(f, "|---|---:|---|---:|")?;
        for section in &self.sections {
            let (title, lines) = (section.title, section.checks.len());
            let link = title.to_lowercase().replace(',', "").replace(' ', "-");
            let (what, share) = section.closest().map_or(("–", "–".to_owned()), |check| {
                (check.what.as_str(), digits(check.share(), 2))
            });
            writeln!(f, "| [{title}](#{link}) | {lines} | {what} | {share} |")?;
        }
        self.sections.iter().try_for_each(|section| section.fmt(f))?;
        write!(f, "\n{RANDOM}\n{}", include_str!("accuracy.md"))?;
        write!(f, "\n{}", include_str!("fits.md"))
    }
}

/// A number rounded to `count` digits, without trailing zeros.
#[expect(clippy::expect_used, reason = "a formatted number always parses")]
pub fn digits(x: f64, count: usize) -> String {
    let rounded: f64 = format!("{x:.*e}", count - 1).parse().expect("a formatted number");
    match rounded.abs() {
        size if size.is_nan() => "none".to_owned(),
        0.0 => "0".to_owned(),
        1e-3..1e7 | f64::INFINITY => rounded.to_string(),
        _ => format!("{rounded:e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_printed_with_the_requested_significant_digits() {
        for (x, count, text) in [
            (0.497_063_21, 6, "0.497063"),
            (-1.0, 6, "-1"),
            (1_349_123.7, 3, "1350000"),
            (9.512_345e-14, 3, "9.51e-14"),
            (-0.0, 2, "0"),
            (f64::NAN, 6, "none"),
            (f64::NEG_INFINITY, 2, "-inf"),
        ] {
            assert_eq!(digits(x, count), text);
        }
    }

    #[test]
    fn a_check_fails_on_a_large_relative_error_or_a_missing_value() {
        let check = |reference, value, expected, accepted| Check {
            what: String::new(),
            source: "",
            reference,
            value,
            expected,
            accepted,
        };
        let passes = |reference, value, accepted| check(reference, value, 0.0, accepted).passes();
        assert!(passes(2.0, 2.02, Some(0.011)) && !passes(2.0, 2.02, Some(0.009)));
        assert!(passes(0.0, 0.0, Some(0.0)) && !passes(0.0, 1.0, Some(0.0)));
        assert!(passes(1.0, 3.0, None) && !passes(1.0, f64::NAN, Some(1.0)));
        assert!(!passes(1.0, f64::NAN, None));
        let beside = |value| check(2.0, value, 0.01, Some(3e-3));
        assert!(beside(2.025).passes() && !beside(2.0).passes() && !beside(2.03).passes());
        assert!(beside(2.025).to_string().contains("| 1.250 % | 1 ± 0.3 % | pass |"));
        let lost = Section::of("lost", |_| None);
        assert!(lost.words().is_none() && lost.checks.len() == 1);
        let page = VerificationPage { sections: vec![lost] };
        assert_eq!(page.failures().count(), 1);
        assert!(page.to_string().contains("**1 FAIL**"), "{page}");
    }

    #[test]
    fn every_section_has_a_text_and_every_text_has_a_section() {
        let page = crate::page();
        assert!(page.sections.iter().all(|section| section.words().is_some()));
        // One heading belongs to the introduction.
        assert_eq!(page.sections.len() + 1, WORDS.matches("\n## ").count());
        for check in page.checks() {
            let groups = GROUPS.iter().filter(|(_, sources)| sources.contains(&check.source));
            assert_eq!(groups.count(), 1, "{}", check.source);
        }
    }
}
