//! Whether a document from elsewhere can be that of a study.

use std::collections::HashSet;
use std::iter;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::points::guarded;
use super::problem::{Found, Lack};
use super::rows::Rows;
use super::study::{Point, Study};

/// Rows that are computed anew.
const SAMPLES: usize = 16;
/// Longest estimate of a point that is computed anew, in seconds.
const LONGEST: f64 = 0.05;

/// The members of a document that do not follow from the study alone.
#[derive(Deserialize)]
struct Members {
    counts: Counts,
    table: Map<String, Value>,
    samples: Option<Map<String, Value>>,
    profiles: Option<Map<String, Value>>,
}

#[derive(Deserialize)]
struct Counts {
    refused: u64,
    incomplete: u64,
}

impl Study {
    /// Checks a document: it must be written as [`Study::document`] writes it, with the points of this study. Some of its
    /// rows are computed anew.
    ///
    /// # Errors
    /// A message: what is wrong.
    pub fn judge(
        &self,
        key: &impl Serialize,
        engine: &impl Serialize,
        document: &[u8],
    ) -> Result<(), String> {
        let Members { counts, table, samples, profiles } =
            serde_json::from_slice(document).map_err(|error| error.to_string())?;
        let rows = samples.unwrap_or(table);
        let own = self.columns().len();
        let columns: Vec<&Vec<Value>> =
            rows.values().take(own).filter_map(Value::as_array).collect();
        let profiles = profiles.unwrap_or_default();
        let fields = self.problem().profiles.iter().flat_map(|common| &common.fields);
        let curves: Option<Vec<&Vec<Value>>> =
            fields.map(|field| profiles.get(field.name())?.as_array()).collect();
        let curves = curves.unwrap_or_default();
        let lengths_are =
            |points| columns.iter().chain(&curves).all(|column| column.len() == points);
        if columns.len() != own || !lengths_are(self.points()) {
            return Err(format!("it does not have {} rows of its columns", self.points()));
        }
        let mut rows = Rows::default();
        let sampled: HashSet<usize> = self.sample(SAMPLES).collect();
        for number in 0..self.points() {
            let cells: Vec<&Value> = columns.iter().map(|column| &column[number]).collect();
            let values = self.point(number);
            let curves = curves.iter().map(|column| &column[number]);
            let found = found(cells.get(values.len()..).unwrap_or_default(), curves);
            let found = found.ok_or_else(|| format!("a cell of row {number} has a wrong type"))?;
            if sampled.contains(&number) && self.computes_another(number, &found) {
                return Err(format!("this server computes another row {number}"));
            }
            rows.push(&values, &found);
        }
        if rows.incomplete != counts.refused + counts.incomplete {
            return Err("its counts contradict its rows".to_owned());
        }
        (rows.refused, rows.incomplete) = (counts.refused, counts.incomplete);
        if self.document(key, engine, &rows).as_bytes() == document {
            Ok(())
        } else {
            Err("it is not written as this version writes studies, or has other points".to_owned())
        }
    }

    /// Whether this program computes another row for a point. Does not compute long runs.
    fn computes_another(&self, number: usize, claimed: &Found) -> bool {
        let values = self.point(number);
        if self.point_seconds(&values) > LONGEST {
            return false;
        }
        let found = guarded(|| {
            let mut point = Point::default();
            iter::repeat_with(|| self.step(number, &mut point)).find_map(|row| row)
        });
        let text = |found: &Found| {
            let mut row = Rows::default();
            row.push(&values, found);
            row.columns().collect::<Vec<_>>().join(",")
        };
        found.flatten().is_some_and(|row| text(&row.found) != text(claimed))
    }
}

/// The outputs of a row, its curves, and its reason. Whether a point was refused or is incomplete is only in the counts.
fn found<'a>(cells: &[&Value], curves: impl Iterator<Item = &'a Value>) -> Option<Found> {
    let (reason, outputs) = cells.split_last()?;
    let number = |cell: &Value| match cell {
        Value::Null => Some(None),
        cell => cell.as_f64().map(Some),
    };
    let outputs = outputs.iter().map(|cell| number(cell));
    let profiles = curves.map(|curve| curve.as_array()?.iter().map(number).collect());
    let lack = match reason {
        Value::Null => None,
        reason => Some(Lack::Incomplete(reason.as_str()?.to_owned())),
    };
    let (outputs, profiles) = (outputs.collect::<Option<_>>()?, profiles.collect::<Option<_>>()?);
    Some(Found { outputs, profiles, lack })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use serde_json::json;

    use crate::{Kind, Points, Study};

    #[test]
    fn a_document_with_any_change_is_refused() {
        let sweep = json!({
            "scenario": {
                "profile": {"shape": "paraboloid", "radius": 0.01},
                "moduli": {"normal": 113e9, "tangential": 93e9}, "friction": 0.7,
                "wear": {"coefficient": 3.03e-14}, "load": {"normal_force": 100.0},
                "motion": {"amplitude": 2e-6}, "cycles": [1000],
                "model": {"method": "simplified", "points": 16}},
            "vary": [{"pointer": "/friction", "values": [0.5, -1.0, 0.7]}],
            "outputs": ["wear_volume"],
            "profiles": {"radius": [0, 1e-3], "fields": ["wear", "slip"]}});
        let study = Arc::new(Study::read(Kind::named("sweep").unwrap(), sweep).unwrap());
        let mut points = Points::whole(Arc::clone(&study));
        let rows = std::iter::repeat_with(|| points.step()).find_map(|rows| rows).unwrap();
        let document = study.document(&"key", &"engine", &rows);
        let judge = |text: &str| study.judge(&"key", &"engine", text.as_bytes());
        assert_eq!(judge(&document), Ok(()));
        for (old, new) in [
            ("\"refused\":1", "\"refused\":0"),
            ("[0.5,", "[0.6,"),
            ("null]", "1.0]"),
            ("\"points\":3", "\"points\":4"),
            ("\"units\"", "\"more\":1,\"units\""),
            ("\"point\":[0,", "\"point\":[1,"),
            ("\"radius\":[0.0,0.001]", "\"radius\":[0.0,0.002]"),
            ("\"wear\":[[0.0,0.0]", "\"wear\":[[0.0,1e-9]"),
            ("\"slip\":[[", "\"slip\":[[0.0,"),
            ("\"slip\":[[", "\"slip\":[[0.0],["),
            ("\"wear_volume\":\"m^3\"", "\"wear_volume\":\"mm^3\""),
        ] {
            assert!(document.contains(old), "{old} in {document}");
            assert!(judge(&document.replacen(old, new, 1)).is_err(), "{old}");
        }
        let volume = document.split("\"wear_volume\":[").nth(1).unwrap();
        let volume = volume.split(',').next().unwrap();
        assert!(judge(&document.replace(volume, "1e-15")).unwrap_err().contains("another row 0"));
    }
}
