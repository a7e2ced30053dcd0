//! The report of several runs: what differs, the differences of all numbers to the first run, and their curves together.

use super::entry::{Entry, Number, origin};
use super::html::{self, section};
use crate::figure::words::{capital, member, shortened};
use fretwork_plot::{About, Figure, Style};

/// The name of a run on the page.
fn letter(place: usize) -> String {
    format!("Run {}", char::from(b'A' + place as u8))
}

/// The body of the page.
pub fn body(entries: &[Entry]) -> String {
    let mut body = html::heading(
        "Comparison of runs",
        &format!("{} runs. Differences are relative to run A.", entries.len()),
    );
    let runs = entries.iter().enumerate();
    let runs = runs
        .map(|(place, entry)| (letter(place), format!("{} · {}", entry.name(), entry.subtitle)));
    body += &section("Runs", &html::pairs(&runs.collect::<Vec<_>>()));
    let letters: Vec<String> = (0..entries.len()).map(letter).collect();
    let head = |first| -> Vec<&str> {
        [first].into_iter().chain(letters.iter().map(String::as_str)).collect()
    };
    body += &section("Inputs that differ", &html::table(&head("Input"), differing(entries)));
    body += &section("Results", &html::table(&head("Quantity"), numbers(entries)));
    body += &html::figures(&figures(entries));
    for (letter, entry) in letters.iter().zip(entries) {
        body += &html::warnings(&format!("Warnings of {letter}"), &entry.warnings);
    }
    body + &entries.iter().map(origin).collect::<String>()
}

/// The inputs whose values differ between some runs.
fn differing(entries: &[Entry]) -> Vec<Vec<String>> {
    let mut pointers: Vec<&str> = Vec::new();
    for (pointer, _) in entries.iter().flat_map(|entry| &entry.asked) {
        if !pointers.contains(&pointer.as_str()) {
            pointers.push(pointer);
        }
    }
    let value = |entry: &Entry, pointer: &str| {
        let found = entry.asked.iter().find(|(own, _)| own == pointer);
        found.map_or_else(|| "–".to_owned(), |(_, value)| value.clone())
    };
    let row = |pointer: &str| {
        let values: Vec<String> = entries.iter().map(|entry| value(entry, pointer)).collect();
        let differ = values.iter().any(|value| *value != values[0]);
        differ.then(|| [vec![capital(&member(pointer))], values].concat())
    };
    pointers.into_iter().filter_map(row).collect()
}

/// The numbers of the first run, with those of the others and their differences, and the errors of all.
fn numbers(entries: &[Entry]) -> Vec<Vec<String>> {
    let row = |number: &Number| {
        let cells = entries.iter().enumerate().map(|(place, entry)| {
            let Some(own) = entry.numbers.iter().find(|own| own.words == number.words) else {
                return "–".to_owned();
            };
            let text = html::number(own.value, &own.unit);
            match (own.value, number.value) {
                (Some(value), Some(first)) if place > 0 && first != 0.0 => {
                    let change = 100.0 * (value - first) / first.abs();
                    let sign = if change > 0.0 { "+" } else { "" };
                    format!("{text}, {sign}{}\u{a0}%", shortened(change, 3))
                }
                _ => text,
            }
        });
        [number.words.clone()].into_iter().chain(cells).collect()
    };
    let errors = |number: &Number| -> Vec<Vec<String>> {
        let of = |entry: &Entry, kind: usize| {
            let own = entry.numbers.iter().find(|own| own.words == number.words);
            own.map_or_else(String::new, |own| own.errors[kind].clone())
        };
        let kinds = ["numerical error", "model error"].into_iter().enumerate();
        let kinds = kinds.filter(|(kind, _)| !number.errors[*kind].is_empty());
        let row = |(kind, words): (usize, &str)| {
            let cells = entries.iter().map(|entry| of(entry, kind));
            [format!("{}: {words}", number.words)].into_iter().chain(cells).collect()
        };
        kinds.map(row).collect()
    };
    let numbers = entries[0].numbers.iter();
    numbers.flat_map(|number| [vec![row(number)], errors(number)].concat()).collect()
}

/// The curves of all runs at their last output cycles.
fn figures(entries: &[Entry]) -> Vec<String> {
    let together = |first: &Figure| {
        let mut all = Figure { series: Vec::new(), ..first.clone() };
        for (place, entry) in entries.iter().enumerate() {
            let own = entry.curves.iter().find(|figure| figure.title == first.title);
            for series in own.into_iter().flat_map(|figure| figure.series.clone()) {
                // Some curves have markers alone.
                let own = series.style.unwrap_or_else(|| Style::numbered(place));
                let mark = own.mark.filter(|_| own.width == 0.0);
                let style = Style { width: own.width, mark, ..Style::numbered(place) };
                let mut series = series.styled(style);
                series.label = letter(place);
                all.series.push(series);
            }
        }
        let description = format!("{} of {} runs", first.title, entries.len());
        all.about = Some(About { description, ..About::default() });
        all.svg()
    };
    entries[0].curves.iter().map(together).collect()
}
