//! The table of a study: a row for each point.

use std::iter;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::problem::{Found, Lack};
use fretwork_json as json;

/// Maximum bytes of a reason as JSON, with the comma after it. So the largest size of a document is known in advance.
pub const MAX_REASON: usize = 120;
/// Maximum bytes of a number as JSON, with the comma after it.
pub const NUMBER: usize = 20;

/// The rows of consecutive points, in columns: the values of the members in SI, the outputs, the reason why an output
/// is missing, and the curves.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Rows {
    /// The number of rows.
    pub count: usize,
    /// Number of points whose scenario is not valid.
    pub refused: u64,
    /// Number of points with a valid scenario that lack an output.
    pub incomplete: u64,
    /// For each column, its cells as JSON, separated by commas, in a text for each chunk. Such a text is stored.
    #[serde(serialize_with = "serialize", deserialize_with = "deserialize")]
    columns: Vec<Vec<String>>,
}

impl Rows {
    /// Adds the row of a point.
    pub fn push(&mut self, values: &[f64], found: &Found) {
        let reason = found.lack.as_ref().map(|lack| match lack {
            Lack::Refused(reason) => {
                self.refused += 1;
                reason
            }
            Lack::Incomplete(reason) => {
                self.incomplete += 1;
                reason
            }
        });
        let values = values.iter().map(|value| json::write(value, NUMBER));
        let outputs = found.outputs.iter().map(|output| json::write(output, NUMBER));
        let curves = found.profiles.iter().map(|curve| json::write(curve, NUMBER * curve.len()));
        let reason = iter::once_with(|| written(reason));
        let cells = values.chain(outputs).chain(reason).chain(curves);
        self.columns.resize_with(self.columns.len().max(cells.size_hint().0), Vec::new);
        self.count += 1;
        for (column, cell) in self.columns.iter_mut().zip(cells) {
            match column.last_mut() {
                Some(text) => text.extend([",", &cell]),
                None => column.push(cell),
            }
        }
    }

    /// Appends the rows of the next chunk of points.
    pub fn append(&mut self, next: Self) {
        self.columns.resize_with(next.columns.len().max(self.columns.len()), Vec::new);
        for (column, more) in self.columns.iter_mut().zip(next.columns) {
            column.extend(more);
        }
        self.count += next.count;
        self.refused += next.refused;
        self.incomplete += next.incomplete;
    }

    /// The form in which the rows of a chunk are stored.
    ///
    /// # Panics
    /// The rows cannot be written as JSON.
    #[expect(clippy::expect_used, reason = "rows must not be lost silently")]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.bytes() + self.bytes() / 16 + 1024);
        serde_json::to_writer(&mut bytes, self).expect("rows are numbers and texts");
        bytes
    }

    /// Reads what [`Self::to_bytes`] has written; `None` if the bytes are not rows.
    pub fn from_bytes(bytes: &[u8]) -> Option<Self> {
        serde_json::from_slice(bytes).ok()
    }

    /// The texts of each column: cells as JSON, separated by commas. A comma separates one text from the next.
    pub fn into_columns(self) -> impl Iterator<Item = Vec<String>> {
        self.columns.into_iter()
    }

    /// The cells of each column as JSON, separated by commas.
    pub fn columns(&self) -> impl Iterator<Item = String> {
        self.columns.iter().map(|texts| texts.join(","))
    }

    /// The numbers of a column.
    ///
    /// # Panics
    /// The column does not contain numbers.
    #[expect(clippy::expect_used, reason = "the rows were written by this program")]
    pub fn numbers(&self, column: usize) -> Vec<Option<f64>> {
        let texts = self.columns.get(column).into_iter().flatten();
        let numbers = texts.map(|cells| serde_json::from_str::<Vec<_>>(&format!("[{cells}]")));
        numbers.flat_map(|cells| cells.expect("the cells are numbers or null")).collect()
    }

    /// The size of all texts, in bytes.
    pub fn bytes(&self) -> usize {
        self.columns.iter().flatten().map(|text| text.len() + 1).sum()
    }
}

/// A reason as JSON, shortened to [`MAX_REASON`] bytes.
fn written(reason: Option<&String>) -> String {
    let mut reason = reason.map(String::as_str);
    loop {
        let text = json::write(&reason, MAX_REASON);
        match reason {
            Some(long) if text.len() >= MAX_REASON => {
                // A byte of the text takes at most six bytes as JSON, so at least this many bytes must be removed.
                let excess = (text.len() + 1 - MAX_REASON).div_ceil(6);
                let kept = long.len().saturating_sub(excess);
                reason = Some(&long[..long.floor_char_boundary(kept)]);
            }
            _ => return text,
        }
    }
}

fn serialize<S: Serializer>(columns: &[Vec<String>], to: S) -> Result<S::Ok, S::Error> {
    to.collect_seq(columns.iter().map(|texts| texts.join(",")))
}

fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<Vec<String>>, D::Error> {
    Ok(Vec::deserialize(from)?.into_iter().map(|text| vec![text]).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_of_three_chunks_equal_the_rows_of_all_points() {
        let lacks = [
            None,
            Some(Lack::Refused("\u{e9}\"".repeat(MAX_REASON))),
            Some(Lack::Incomplete("no \"run\"".to_owned())),
        ];
        let (mut all, mut joined) = (Rows::default(), Rows::default());
        for (value, lack) in lacks.into_iter().enumerate() {
            let mut one = Rows::default();
            for rows in [&mut one, &mut all] {
                rows.push(
                    &[value as f64],
                    &Found {
                        outputs: vec![Some(1.5), None],
                        profiles: vec![vec![Some(0.5), None]],
                        lack: lack.clone(),
                    },
                );
            }
            joined.append(Rows::from_bytes(&one.to_bytes()).unwrap());
        }
        assert_eq!(joined.to_bytes(), all.to_bytes());
        assert_eq!(joined.numbers(1), [Some(1.5); 3]);
        assert_eq!((all.count, all.refused, all.incomplete), (3, 1, 1));
        let expected = ["0.0,1.0,2.0", "1.5,1.5,1.5", "null,null,null"];
        assert_eq!(all.columns().take(3).collect::<Vec<_>>(), expected);
        assert_eq!(all.columns().last().unwrap(), "[0.5,null],[0.5,null],[0.5,null]");
        let reasons = format!("[{}]", all.columns().nth(3).unwrap());
        let reasons: [Option<String>; 3] = serde_json::from_str(&reasons).unwrap();
        let shortened = json::write(&reasons[1], MAX_REASON);
        assert!((MAX_REASON - 5..MAX_REASON).contains(&shortened.len()), "{shortened}");
        assert_eq!(reasons[2].as_deref(), Some("no \"run\""));
    }
}
