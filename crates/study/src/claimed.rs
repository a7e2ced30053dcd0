//! The rows of a study's document that another program has computed. They are compared with new computations.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use super::{Found, Lack, Rows, Study};
use fretwork_json as json;

/// The rows of a document. Each can be compared with a new computation.
#[derive(Debug)]
pub struct Claimed {
    outputs: Vec<Vec<Option<f64>>>,
    reasons: Vec<Option<String>>,
    curves: Vec<Vec<Vec<Option<f64>>>>,
    counts: Counts,
    /// Number of points whose scenario is not valid, among the points that were computed again.
    refused: AtomicU64,
}

#[derive(Debug, Deserialize)]
struct Counts {
    refused: u64,
    incomplete: u64,
}

/// The members of a document that must be read from it, because the study alone does not determine them.
#[derive(Deserialize)]
struct Members<'a> {
    counts: Counts,
    #[serde(borrow)]
    table: Columns<'a>,
    samples: Option<Columns<'a>>,
    searches: Option<Columns<'a>>,
    profiles: Option<Columns<'a>>,
}

/// The columns of a table, as JSON.
pub(super) type Columns<'a> = BTreeMap<Cow<'a, str>, &'a RawValue>;

/// Reads the cells of a column, one for each point.
pub(super) fn column_of<T: DeserializeOwned>(
    table: &Columns<'_>,
    name: &str,
    points: usize,
) -> Result<Vec<T>, String> {
    let column = table.get(name).and_then(|column| serde_json::from_str(column.get()).ok());
    let column = column.filter(|column: &Vec<T>| column.len() == points);
    column.ok_or_else(|| {
        format!(
            "column `{name}` does not have {points} valid cells, one for each point of the study"
        )
    })
}

impl Claimed {
    /// Reads the rows of a document. Checks that all other numbers of the document follow from the rows.
    ///
    /// # Errors
    /// A message that says what is wrong.
    pub fn read(
        study: &Study,
        key: &impl Serialize,
        engine: &impl Serialize,
        document: &str,
    ) -> Result<Self, String> {
        let Members { counts, table, samples, searches, profiles } =
            serde_json::from_str(document).map_err(|error| error.to_string())?;
        let (table, profiles) =
            (samples.or(searches).unwrap_or(table), profiles.unwrap_or_default());
        let (columns, points) = (study.columns(), study.points());
        let outputs = &columns[study.problem.members.len()..columns.len() - 1];
        let outputs = outputs.iter().map(|column| column_of(&table, &column.name, points));
        let fields = study.problem.profiles.iter().flat_map(|profiles| &profiles.fields);
        let curves = fields.map(|field| column_of(&profiles, field.as_str(), points));
        let claimed = Self {
            outputs: outputs.collect::<Result<_, _>>()?,
            reasons: column_of(&table, "reason", points)?,
            curves: curves.collect::<Result<_, _>>()?,
            counts,
            refused: AtomicU64::new(0),
        };
        let own = study.document(key, engine, claimed.rows(study)?);
        if own == document { Ok(claimed) } else { Err(json::difference("", document, &own)) }
    }

    /// All rows, as the study writes them.
    ///
    /// # Errors
    /// The counts contradict the rows.
    pub fn rows(&self, study: &Study) -> Result<Rows, String> {
        let mut rows = Rows::default();
        for number in 0..study.points() {
            rows.push(&study.point(number), &self.row(number));
        }
        let Counts { refused, incomplete } = self.counts;
        if refused.checked_add(incomplete) != Some(rows.incomplete) {
            let detail = "`refused` and `incomplete` in `counts` do not add up to the number of rows with a `reason`";
            return Err(detail.to_owned());
        }
        (rows.refused, rows.incomplete) = (refused, incomplete);
        Ok(rows)
    }

    fn row(&self, number: usize) -> Found {
        Found {
            outputs: self.outputs.iter().map(|column| column[number]).collect(),
            profiles: self.curves.iter().map(|column| column[number].clone()).collect(),
            // A row does not say whether its point was refused or only incomplete. Only `counts` says how many were
            // refused.
            lack: self.reasons[number].clone().map(Lack::Incomplete),
        }
    }

    /// Compares a row with the row that this program computes.
    ///
    /// # Errors
    /// A message that names the place where the rows differ.
    pub fn compare(&self, study: &Study, number: usize, own: &Rows) -> Result<(), String> {
        self.refused.fetch_add(own.refused, Ordering::Relaxed);
        let mut row = Rows::default();
        row.push(&study.point(number), &self.row(number));
        let fields = study.problem.profiles.iter().flat_map(|profiles| &profiles.fields);
        let names = study.columns().into_iter().map(|column| column.name);
        let names = names.chain(fields.map(ToString::to_string));
        let mut cells = names.zip(row.columns().zip(own.columns()));
        match cells.find(|(_, (theirs, own))| theirs != own) {
            Some((name, (theirs, own))) => {
                Err(json::difference(&format!("{name}[{number}]"), &theirs, &own))
            }
            None => Ok(()),
        }
    }

    /// Compares `counts.refused` with the number of refused points that this program has found. All rows must have been
    /// computed again.
    ///
    /// # Errors
    /// A message with both numbers, if they differ.
    pub fn compare_counts(&self) -> Result<(), String> {
        let (theirs, own) = (self.counts.refused, self.refused.load(Ordering::Relaxed));
        let told = || json::difference("counts.refused", &theirs.to_string(), &own.to_string());
        if theirs == own { Ok(()) } else { Err(told()) }
    }
}
