//! The documents that the views of the page read, at the addresses of the API after the key.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::value::{RawValue, to_raw_value};
use serde_json::{Value, json};

use super::entry::{About, ReportedResult};
use super::smooth::smooth;
use crate::statistics;
use crate::{Document, Part, Result, Verdict, View, evenly_spaced};
use fretwork_job::{TaskKind, earlier};

/// Size of the results of one file, in bytes. Of a larger one, the file has some of the output cycles or the first rows.
const SIZE: usize = 4 << 20;
/// Maximum number of rows of a study, as on the page.
const ROWS: usize = 20_000;

/// The documents of one of `count` results.
pub fn documents(
    stored: &[u8],
    si: &Document<'_>,
    warnings: &Value,
    count: usize,
) -> Result<Vec<(&'static str, Box<RawValue>)>> {
    let share = (SIZE as f64 / count as f64 / stored.len() as f64).min(1.0);
    let part = |rows: usize| ((rows as f64 * share) as usize).max(1);
    let mut found = vec![("/warnings", to_raw_value(&json!({"warnings": warnings}))?)];
    let view = match si.kind() {
        TaskKind::Run => {
            found.extend(smooth(si)?.map(|own| ("/history/smooth", own)));
            let profiles = si.table(Part::Profiles, &View::default())?;
            let cycles = profiles.axis("cycles");
            let rows = evenly_spaced(cycles.len(), part(cycles.len()));
            let cycles = rows.into_iter().map(|row| cycles[row]).collect();
            View { cycles: (share < 1.0).then_some(cycles), ..View::default() }
        }
        TaskKind::Study(_) => {
            match Verdict::of(si)? {
                Some(verdict) => found.push(("/verdict", to_raw_value(&verdict)?)),
                None => {
                    for (end, part) in
                        [("/statistics", Part::Statistics), ("/histogram", Part::Histogram)]
                    {
                        let table = statistics::table(si, part)?;
                        found.push((end, to_raw_value(&json!({part.as_str(): table}))?));
                    }
                }
            }
            let points = si.value("counts")?["points"].as_u64().unwrap_or(0) as usize;
            View { rows: Some(part(points).min(ROWS)), ..View::default() }
        }
    };
    found.push(("", to_raw_value(&Document::open(stored, &view)?.object()?)?));
    Ok(found)
}

/// The warnings that the result does not contain.
pub fn warnings(si: &Document<'_>, asked: &Value, about: &About) -> Value {
    let earlier = earlier::doubt(si.head.engine.numerics, asked);
    let earlier = earlier.map(|detail| json!({"kind": "earlier_version", "detail": detail}));
    about.warnings.as_array().into_iter().flatten().cloned().chain(earlier).collect()
}

/// The texts of lists of warnings.
pub fn details(lists: &[&Value]) -> Vec<String> {
    let all = lists.iter().filter_map(|list| list.as_array()).flatten();
    all.filter_map(|warning| warning["detail"].as_str().map(str::to_owned)).collect()
}

/// What the views show.
#[derive(Serialize)]
#[serde(rename_all = "camelCase")]
struct Data<'a> {
    key: &'a str,
    /// The words of the address, as a guest has them.
    query: Vec<(&'static str, String)>,
    is_si: bool,
    measured: &'a [Value],
    documents: BTreeMap<String, &'a RawValue>,
}

/// The data of a file as JSON without the signs that mean something to HTML.
pub fn text(entries: &[ReportedResult], engineering: bool, measured: &[Value]) -> Result<String> {
    let listed =
        |of: fn(&ReportedResult) -> &str| entries.iter().map(of).collect::<Vec<_>>().join(",");
    let link = || "report".to_owned();
    let label = |entry: &ReportedResult| entry.label.clone().unwrap_or_default();
    let query = if let [entry] = entries {
        let typed = entry.submitted.as_ref().map(|typed| ("typed", typed.to_string()));
        [("link", link()), ("label", label(entry))].into_iter().chain(typed).collect()
    } else {
        let own = entries.iter().map(|entry| ("name", label(entry)));
        let keys = [("keys", listed(|entry| &entry.key)), ("links", listed(|_| "report"))];
        keys.into_iter().chain(own).collect()
    };
    let documents = entries.iter().flat_map(|entry| {
        let own = entry.documents.iter();
        own.map(|(end, text)| (format!("{}{end}", entry.key), &**text))
    });
    let data = Data {
        key: entries.first().map_or("", |entry| &entry.key),
        query,
        is_si: !engineering,
        measured,
        documents: documents.collect(),
    };
    Ok(serde_json::to_string(&data)?.replace('<', "\\u003c").replace('&', "\\u0026"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The document of a stored result in a report with one result.
    fn shown(stored: &Value) -> (usize, Value) {
        let (stored, view) = (stored.to_string(), View::default());
        assert!(stored.len() > SIZE);
        let si = Document::open(stored.as_bytes(), &view).unwrap();
        let found = documents(stored.as_bytes(), &si, &Value::Null, 1).unwrap();
        let whole = found.last().unwrap();
        assert_eq!(whole.0, "");
        (whole.1.get().len(), serde_json::from_str(whole.1.get()).unwrap())
    }

    #[test]
    fn a_large_run_keeps_its_history_and_some_of_its_profiles() {
        let cycles: Vec<f64> = (1..=100).map(f64::from).collect();
        let row = vec![1.234_567_890_123_456e-7; 3000];
        let (size, shown) = shown(&json!({
            "key": "ab", "engine": {"name": "fretwork", "numerics": 5}, "units": {"worn": "m", "radius": "m", "cycles": "1"},
            "history": {"cycles": &cycles, "wear_volume": &cycles},
            "profiles": {"cycles": &cycles, "radius": &row, "worn": vec![&row; 100]},
            "loops": {"cycles": &cycles, "displacement": vec![[1.0, 2.0]; 100]}
        }));
        assert!(size < SIZE + SIZE / 10, "{size}");
        let [history, profiles, loops] =
            ["history", "profiles", "loops"].map(|part| &shown[part]["cycles"]);
        assert_eq!(history.as_array().unwrap().len(), 100);
        let kept = profiles.as_array().unwrap();
        assert!((50..90).contains(&kept.len()), "{}", kept.len());
        assert_eq!((&kept[0], kept.last(), profiles), (&json!(1.0), Some(&json!(100.0)), loops));
    }

    #[test]
    fn a_large_study_keeps_its_first_rows() {
        let column: Vec<f64> = (0..300_000).map(f64::from).collect();
        let (size, shown) = shown(&json!({
            "key": "ab", "engine": {"name": "fretwork", "numerics": 5}, "units": {"/friction": "1", "wear_volume": "m^3"},
            "sweep": {"scenario": {}}, "counts": {"points": 300_000},
            "table": {"/friction": &column, "wear_volume": &column}
        }));
        assert!(size < SIZE, "{size}");
        let kept = shown["table"]["wear_volume"].as_array().unwrap();
        assert_eq!((kept.len(), kept.last()), (ROWS, Some(&json!(19_999.0))));
    }
}
