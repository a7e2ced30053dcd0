//! The report of several runs: what differs, the differences of all numbers to the first run, and their curves together.

use super::entry::{Entry, Number, origin};
use super::html::{self, section};
use super::inputs::Input;
use crate::notation::{cycles, percent};
use fretwork_plot::{About, Figure, Style};

/// Significant digits of a value, and of a difference.
const DIGITS: u8 = 4;
const DIFFERENCE: u8 = 3;
/// Relative differences below this come from rounding.
const ROUNDING: f64 = 1e-9;

/// The name of a run on the page.
fn letter(place: usize) -> String {
    format!("Run {}", char::from(b'A' + place as u8))
}

/// The body of the page.
pub fn body(entries: &[Entry]) -> String {
    let letters: Vec<String> = (0..entries.len()).map(letter).collect();
    let runs = letters.iter().zip(entries);
    let runs = runs
        .map(|(letter, entry)| (letter.clone(), format!("{} · {}", entry.name(), entry.subtitle)));
    let head = |first| -> Vec<&str> {
        [first].into_iter().chain(letters.iter().map(String::as_str)).collect()
    };
    let about = format!("{} runs. Differences are relative to run A.", entries.len());
    let mut body = html::heading("Comparison of runs", &about);
    body += &section("Runs", &html::pairs(&runs.collect::<Vec<_>>()));
    body += &section("Inputs that differ", &html::table(&head("Input"), differing(entries)));
    let results = html::table(&head("Quantity"), results(entries));
    body += &section("Results at the last output cycle", &results);
    body += &html::figures(&figures(entries));
    for (letter, entry) in letters.iter().zip(entries) {
        body += &html::warnings(&format!("Warnings of {letter}"), &entry.warnings);
    }
    let origins = letters.iter().zip(entries);
    body + &origins
        .map(|(letter, entry)| origin(&format!("Origin of {letter}"), entry))
        .collect::<String>()
}

/// Each item once, in the order of its first appearance.
fn each_once<'a>(items: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut found: Vec<&str> = Vec::new();
    for item in items {
        if !found.contains(&item) {
            found.push(item);
        }
    }
    found
}

/// The inputs whose values differ between some runs.
fn differing(entries: &[Entry]) -> Vec<Vec<String>> {
    let row = |pointer: &str| {
        let own = entries.iter().map(|entry| entry.asked.iter().find(|own| own.pointer == pointer));
        let own: Vec<Option<&Input>> = own.collect();
        let texts: Vec<&str> =
            own.iter().map(|own| own.map_or("–", |own| own.text.as_str())).collect();
        let name = own.into_iter().flatten().next()?.name.as_str();
        let differ = texts.iter().any(|text| *text != texts[0]);
        differ.then(|| [name].into_iter().chain(texts).map(str::to_owned).collect())
    };
    let pointers = entries.iter().flat_map(|entry| &entry.asked).map(|own| own.pointer.as_str());
    each_once(pointers).into_iter().filter_map(row).collect()
}

/// The numbers of all runs with their differences to the first run, and their errors.
fn results(entries: &[Entry]) -> Vec<Vec<String>> {
    let row = |name: &str, cells: Vec<String>| [vec![name.to_owned()], cells].concat();
    let at = entries.iter().map(|entry| cycles(entry.cycles));
    let mut rows = vec![row("Cycles N", at.collect())];
    for name in each_once(entries.iter().flat_map(|entry| &entry.numbers).map(|own| &*own.name)) {
        let own = entries.iter().map(|entry| entry.numbers.iter().find(|own| own.name == name));
        let own: Vec<Option<&Number>> = own.collect();
        rows.push(row(name, values(entries, &own)));
        for (kind, words) in ["numerical error", "model error"].into_iter().enumerate() {
            let errors: Vec<String> = own
                .iter()
                .map(|own| own.map_or_else(String::new, |own| own.errors[kind].clone()))
                .collect();
            if errors.iter().any(|error| !error.is_empty()) {
                rows.push(row(&format!("{name}: {words}"), errors));
            }
        }
    }
    rows
}

/// The values of a number in all runs, in one unit, with their differences to the first run.
fn values(entries: &[Entry], own: &[Option<&Number>]) -> Vec<String> {
    let sizes = own.iter().flatten().map(|number| number.value.abs());
    let most = sizes.filter(|size| size.is_finite()).fold(0.0, f64::max);
    let first = own[0].map_or(f64::NAN, |number| number.value);
    let cell = |(place, number): (usize, Option<&Number>)| {
        let Some(number) = number else { return "–".to_owned() };
        let text = number.text(entries[0].notation, most, DIGITS);
        let change = (number.value - first) / first.abs();
        match change {
            _ if place == 0 || !change.is_finite() => text,
            change if change.abs() <= ROUNDING => format!("{text} (±0)"),
            change if change > 0.0 => format!("{text} (+{})", percent(change, DIFFERENCE)),
            change => format!("{text} ({})", percent(change, DIFFERENCE)),
        }
    };
    own.iter().copied().enumerate().map(cell).collect()
}

/// The curves of all runs at their last output cycles.
fn figures(entries: &[Entry]) -> Vec<String> {
    let together = |first: &Figure| {
        let mut all = Figure { series: Vec::new(), ..first.clone() };
        for (place, entry) in entries.iter().enumerate() {
            let own = entry.curves.iter().find(|figure| figure.title == first.title);
            let own = own.into_iter().flat_map(|figure| figure.series.clone());
            for (i, series) in own.enumerate() {
                // A history has markers at its output cycles. A curve of points has none.
                let own = series.style.unwrap_or_else(|| Style::numbered(place));
                let mark = own
                    .mark
                    .and(Style::marked(place).mark)
                    .filter(|_| first.x.label.starts_with("Cycles"));
                let style = Style { width: own.width, mark, ..Style::numbered(place) };
                let mut series = series.styled(style);
                series.label = if i == 0 { letter(place) } else { String::new() };
                all.series.push(series);
            }
        }
        let description = format!("{} of {} runs", first.title, entries.len());
        all.about = Some(About { description, ..About::default() });
        all.svg()
    };
    entries[0].curves.iter().map(together).collect()
}
