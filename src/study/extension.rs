//! Studies that extend an earlier one: the points of a Sobol sweep begin with those of the same sweep with fewer samples, so
//! their rows can be taken from its document.

use std::collections::BTreeMap;
use std::ops::Range;

use serde::Deserialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::kind::{Kind, Study};
use super::rows::Rows;

/// How the points of a study are divided into chunks.
#[derive(Debug, Clone, Copy)]
pub struct Division {
    points: usize,
    /// The points of the earlier study; 0 if there is none.
    earlier: usize,
    chunks: usize,
}

impl Division {
    /// The points of a study in `chunks` chunks of about the same size. A chunk has points of the earlier study or new
    /// points, but not both.
    #[must_use]
    pub fn new(study: &Study, chunks: usize) -> Self {
        Self { points: study.points(), earlier: study.earlier(), chunks }
    }

    /// The first chunks, which have the points of the earlier study.
    #[must_use]
    pub fn earlier_chunks(self) -> usize {
        if self.earlier == 0 || self.chunks < 2 {
            return 0;
        }
        let share = (self.chunks * self.earlier + self.points / 2) / self.points;
        share.clamp(1, self.chunks - 1)
    }

    /// The points of a chunk.
    #[must_use]
    pub fn points_of(self, number: usize) -> Range<usize> {
        let split = self.earlier_chunks();
        let (start, points, number, chunks) = if split == 0 {
            (0, self.points, number, self.chunks)
        } else if number < split {
            (0, self.earlier, number, split)
        } else {
            (self.earlier, self.points - self.earlier, number - split, self.chunks - split)
        };
        start + number * points / chunks..start + (number + 1) * points / chunks
    }
}

/// The members of a document that have its rows.
#[derive(Deserialize)]
struct Document<'a> {
    counts: Counts,
    #[serde(borrow)]
    table: BTreeMap<String, Vec<&'a RawValue>>,
    #[serde(borrow, default)]
    profiles: BTreeMap<String, Vec<&'a RawValue>>,
}

#[derive(Deserialize, PartialEq)]
struct Counts {
    points: usize,
    refused: u64,
    incomplete: u64,
}

impl Study {
    /// Whether it is a sweep whose points begin with those of the same sweep with fewer samples.
    #[must_use]
    pub fn can_extend(&self) -> bool {
        self.kind() == Kind::Sweep && self.canonical()["design"] == json!("sobol")
    }

    /// The canonical form of this sweep with another number of samples.
    #[must_use]
    pub fn with_samples(&self, samples: usize) -> Value {
        let mut canonical = self.canonical().clone();
        canonical["samples"] = json!(samples);
        canonical
    }

    /// The rows of the earlier study in the document of its result: one [`Rows`] for each of the first of `chunks` chunks. Their
    /// texts are those of the document. Returns `None` if the document is not that of the earlier study.
    #[must_use]
    pub fn earlier_rows(&self, document: &[u8], chunks: usize) -> Option<Vec<Rows>> {
        let Document { counts, mut table, mut profiles } = serde_json::from_slice(document).ok()?;
        let columns = self.columns().into_iter().map(|column| table.remove(&column.name));
        let fields = self.problem().profiles.iter().flat_map(|common| &common.fields);
        let curves = fields.map(|field| profiles.remove(field.name()));
        let columns: Vec<Vec<&RawValue>> = columns.chain(curves).collect::<Option<_>>()?;
        let reasons = self.columns().len() - 1;
        if columns.iter().any(|column| column.len() != self.earlier()) {
            return None;
        }
        let division = Division::new(self, chunks);
        let parts = (0..division.earlier_chunks()).map(|number| {
            let mut rows = Rows::default();
            for place in division.points_of(number) {
                let cells = columns.iter().map(|column| column[place].get());
                let reason: Option<String> =
                    serde_json::from_str(cells.clone().nth(reasons)?).ok()?;
                let lack = reason.map(|reason| self.problem().lack(reason));
                rows.push_cells(cells, lack.as_ref());
            }
            Some(rows)
        });
        let parts: Vec<Rows> = parts.collect::<Option<_>>()?;
        let sum = |count: fn(&Rows) -> u64| parts.iter().map(count).sum();
        let (refused, incomplete) = (sum(|rows| rows.refused), sum(|rows| rows.incomplete));
        (counts == Counts { points: self.earlier(), refused, incomplete }).then_some(parts)
    }
}

#[cfg(test)]
mod tests {
    use std::iter;
    use std::sync::Arc;

    use super::*;
    use crate::study::Points;

    /// A sweep with refused and incomplete points, whose first points an earlier study has.
    fn sweep(samples: usize, earlier: usize) -> Arc<Study> {
        let sweep = json!({
            "scenario": {
                "profile": {"shape": "paraboloid", "radius": 0.01},
                "moduli": {"normal": 113e9, "tangential": 93e9}, "friction": 0.7,
                "wear": {"coefficient": 3.03e-14}, "load": {"normal_force": 100.0, "held": "depth"},
                "motion": {"amplitude": 2e-6}, "cycles": [1000],
                "model": {"method": "simplified", "points": 16}},
            "vary": [
                {"pointer": "/friction", "from": -0.2, "to": 0.8},
                {"pointer": "/motion/amplitude", "from": "1 um", "to": "9 um"}],
            "design": "sobol", "samples": samples, "seed": 7,
            "outputs": ["wear_volume", "limit.wear_volume", "unworn.actuator_amplitude"],
            "profiles": {"radius": [0, "50 um"]}});
        let study = Study::read(Kind::Sweep, sweep).unwrap();
        Arc::new(if earlier == 0 { study } else { study.extending(earlier) })
    }

    fn rows(study: &Arc<Study>, number: usize, chunks: usize) -> Rows {
        let mut points = Points::chunk(Arc::clone(study), number, chunks);
        iter::repeat_with(|| points.step()).find_map(|rows| rows).unwrap()
    }

    fn document(study: &Study, rows: &Rows) -> String {
        study.document(&"key", &"engine", rows)
    }

    #[test]
    fn chunks_cover_all_points_once_and_separate_the_earlier_ones() {
        for (samples, earlier) in [(2, 1), (9, 8), (9, 1), (100, 64), (1000, 13), (50, 0)] {
            let study = sweep(samples, earlier);
            for chunks in [2, 3, 7, 9, 50, 100, 1000] {
                if chunks > samples {
                    continue;
                }
                let division = Division::new(&study, chunks);
                let parts: Vec<_> = (0..chunks).map(|number| division.points_of(number)).collect();
                let all: Vec<usize> = parts.iter().cloned().flatten().collect();
                assert!(all.iter().copied().eq(0..samples), "{samples} in {chunks}: {parts:?}");
                assert!(parts.iter().all(|part| !part.is_empty()), "{parts:?}");
                let ends = parts[..division.earlier_chunks()].last().map_or(0, |part| part.end);
                assert_eq!(ends, earlier, "{parts:?}");
                let longest = parts.iter().map(Range::len).max().unwrap();
                if chunks > 2 {
                    assert!(longest <= 2 * samples.div_ceil(chunks), "{samples} in {chunks}");
                }
            }
        }
    }

    #[test]
    fn the_first_points_of_a_larger_sobol_sweep_are_those_of_the_smaller_one() {
        let (small, large) = (sweep(100, 0), sweep(300, 0));
        assert!((0..100).all(|number| small.point(number) == large.point(number)));
        assert_eq!(small.canonical().to_string(), large.with_samples(100).to_string());
    }

    #[test]
    fn an_extended_sweep_has_the_document_of_one_from_nothing() {
        let small = sweep(40, 0);
        let earlier = document(&small, &rows(&small, 0, 1));
        let whole = sweep(100, 0);
        let expected = document(&whole, &rows(&whole, 0, 1));
        for reason in ["/friction: ", "unworn.actuator_amplitude: "] {
            assert!(earlier.contains(reason), "{reason} in {earlier}");
        }
        let extended = sweep(100, 40);
        let mut all = Rows::default();
        for part in extended.earlier_rows(earlier.as_bytes(), 9).unwrap() {
            all.append(&part);
        }
        assert_eq!(all.count, 40);
        for number in Division::new(&extended, 9).earlier_chunks()..9 {
            all.append(&rows(&extended, number, 9));
        }
        assert_eq!(document(&extended, &all), expected);
    }

    #[test]
    fn another_document_is_not_that_of_the_earlier_study() {
        let small = sweep(40, 0);
        let earlier = document(&small, &rows(&small, 0, 1));
        let extended = sweep(100, 40);
        assert!(extended.earlier_rows(earlier.as_bytes(), 9).is_some());
        for (old, new) in [
            ("\"refused\":", "\"refused\":1"),
            ("\"points\":40", "\"points\":41"),
            ("\"wear_volume\":[", "\"wear_depth\":["),
            ("\"wear_volume\":[", "\"wear_volume\":[1.0,"),
            ("\"wear\":[", "\"wear\":[[0.0,0.0],"),
            ("\"wear\":[", "\"worn\":["),
        ] {
            assert!(earlier.contains(old), "{old} in {earlier}");
            let changed = earlier.replace(old, new);
            assert!(extended.earlier_rows(changed.as_bytes(), 9).is_none(), "{old}");
        }
    }

    #[test]
    fn only_the_new_points_of_an_extended_sweep_are_estimated() {
        let (whole, extended) = (sweep(100, 0), sweep(100, 75));
        assert!((extended.seconds() / whole.seconds() - 0.25).abs() < 1e-12);
        assert!(extended.chunks() >= 2);
    }
}
