//! The report of several runs: their inputs, the differences of all numbers to the first run, and their curves together.

use super::entry::{Entry, Number, origin};
use super::html::{self, section};
use super::inputs::Input;
use crate::notation::{cycles, digits, percent, with_unit};
use fretwork_plot::{About, Figure, Style};

/// Significant digits of a value, and of a difference.
const DIGITS: u8 = 4;
const DIFFERENCE: u8 = 3;
/// Longest label in headings and legends, in characters.
const LABEL: usize = 30;
/// Relative differences below this come from rounding.
const ROUNDING: f64 = 1e-9;

/// The name of a run in headings and legends: its letter, and its label if it has one.
fn name(place: usize, entry: &Entry) -> String {
    let letter = char::from(b'A' + place as u8);
    let Some(label) = &entry.label else { return format!("Run {letter}") };
    let cut = label.char_indices().nth(LABEL).map_or("", |_| "…");
    format!("{letter} · {}{cut}", label.chars().take(LABEL).collect::<String>())
}

/// The body of the page.
pub fn body(entries: &[Entry]) -> String {
    let names: Vec<String> = entries.iter().enumerate().map(|(i, own)| name(i, own)).collect();
    let whole = |entry: &Entry| format!("{} · {}", entry.name(), entry.about());
    let runs = names.iter().zip(entries).map(|(name, entry)| (name.clone(), whole(entry)));
    let head = |first| -> Vec<&str> {
        [first].into_iter().chain(names.iter().map(String::as_str)).collect()
    };
    let about = format!("{} runs. Differences are those to {}.", entries.len(), names[0]);
    let mut body = html::heading("Comparison of runs", &about);
    body += &section("Runs", &html::pairs(&runs.collect::<Vec<_>>()));
    let (differing, common) = inputs(entries);
    body += &section("Inputs that differ", &html::table(&head("Input"), differing));
    let results = html::table(&head("Quantity"), results(entries));
    body += &section("Results at the last output cycle", &results);
    body += &html::figures(&figures(entries, &names));
    body += &section("Inputs of all runs", &html::pairs(&common));
    for (name, entry) in names.iter().zip(entries) {
        body += &html::warnings(&format!("Warnings of {name}"), &entry.warnings);
    }
    let origins = names.iter().zip(entries);
    body + &origins.map(|(name, own)| origin(&format!("Origin of {name}"), own)).collect::<String>()
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

/// The inputs that differ, with the text of each run, and those that all runs have in common.
fn inputs(entries: &[Entry]) -> (Vec<Vec<String>>, Vec<(String, String)>) {
    let (mut differing, mut common) = (Vec::new(), Vec::new());
    let pointers = entries.iter().flat_map(|entry| &entry.asked).map(|own| own.pointer.as_str());
    for pointer in each_once(pointers) {
        let own = entries.iter().map(|entry| entry.asked.iter().find(|own| own.pointer == pointer));
        let own: Vec<Option<&Input>> = own.collect();
        let Some(name) = own.iter().flatten().next().map(|own| own.name.clone()) else { continue };
        let texts = own.iter().map(|own| own.map_or("–", |own| own.text.as_str()).to_owned());
        let texts: Vec<String> = texts.collect();
        if texts.iter().all(|text| *text == texts[0]) {
            common.push((name, texts[0].clone()));
        } else {
            differing.push([vec![name], texts].concat());
        }
    }
    (differing, common)
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

/// The values of a number in all runs, in one unit, with their absolute and relative differences to the first run.
fn values(entries: &[Entry], own: &[Option<&Number>]) -> Vec<String> {
    let sizes = own.iter().flatten().map(|number| number.value.abs());
    let most = sizes.filter(|size| size.is_finite()).fold(0.0, f64::max);
    let first = own[0].map_or(f64::NAN, |number| number.value);
    let cell = |(place, number): (usize, Option<&Number>)| {
        let Some(number) = number else { return "–".to_owned() };
        let text = number.text(entries[0].notation, most, DIGITS);
        let by = number.value - first;
        if place == 0 || !by.is_finite() {
            return text;
        }
        if by.abs() <= ROUNDING * first.abs() {
            return format!("{text} (±0)");
        }
        let sign = if by > 0.0 { "+" } else { "" };
        let (unit, factor) = entries[0].notation.scale(number.unit, most);
        let difference = with_unit(&digits(by * factor, DIFFERENCE), &unit);
        let share = Some(by / first.abs()).filter(|share| share.is_finite());
        let share = share.map(|share| format!(", {sign}{}", percent(share, DIFFERENCE)));
        format!("{text} ({sign}{difference}{})", share.unwrap_or_default())
    };
    own.iter().copied().enumerate().map(cell).collect()
}

/// The curves of all runs at their last output cycles.
fn figures(entries: &[Entry], names: &[String]) -> Vec<String> {
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
                series.label = if i == 0 { names[place].clone() } else { String::new() };
                all.series.push(series);
            }
        }
        let description = format!("{} of {} runs", first.title, entries.len());
        all.about = Some(About { description, ..About::default() });
        all.svg()
    };
    entries[0].curves.iter().map(together).collect()
}
