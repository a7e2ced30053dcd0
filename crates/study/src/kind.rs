//! A study of any kind: its canonical form, its points, and its document.

use fretwork_engine::request::fault::Faults;
use fretwork_engine::request::quantity::{self, Dimension};
use serde::Serialize;
use serde_json::{Map, Number, Value, json};

use super::design::Design;
use super::map::{self, Map as FrettingMap};
use super::output::Output;
use super::problem::{Found, Lack, Problem, Read, Running};
use super::rows::{MAX_REASON, NUMBER, Rows};
use super::sensitivity::{self, Sensitivity};
use super::sweep;
use fretwork_json as json;
use fretwork_random::Stream;

/// The version of the rules that make rows from a canonical study. It is a part of the study's key. A change of a random
/// sequence, of a text in a row, or of a default of scenarios needs a new version.
const VERSION: u32 = 1;
/// Estimated time of a chunk, in seconds. A chunk takes about half of it, because estimates of short runs are twice too long.
const CHUNK: f64 = 0.1;
/// Longest estimate of what follows from the rows, in seconds: it is computed in one step.
const MAX_FINDINGS: f64 = 5.0;
/// Most points of a chunk.
const MAX_CHUNK: usize = 4096;
/// Most points of a study on any server.
const MAX_POINTS: usize = 1 << 22;
/// Fewest and most points by which the cost of all points is estimated.
const SAMPLES: (usize, usize) = (4, 64);
/// Time to prepare these points, in seconds.
const SAMPLING: f64 = 5e-3;
/// Most listed values of a member that are counted as memory.
const LISTED: usize = 100_000;
/// Bytes of a document beside its table and its canonical form.
const HEAD: usize = 4096;

/// The kinds of studies.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// The outputs of a scenario for many values of its numbers.
    Sweep,
    /// Which numbers of a scenario matter for its outputs.
    Sensitivity,
    /// Regimes and outputs over normal force and amplitude.
    Map,
}

impl Kind {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Sweep, Self::Sensitivity, Self::Map];

    /// The name: the member of a job body that holds the study.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Sweep => "sweep",
            Self::Sensitivity => "sensitivity",
            Self::Map => "map",
        }
    }

    fn read(self, study: Value) -> Result<Read<Plan>, Faults> {
        match self {
            Self::Sweep => sweep::read(study).map(|read| read.with(Plan::Sweep)),
            Self::Sensitivity => sensitivity::read(study).map(|read| read.with(Plan::Sensitivity)),
            Self::Map => map::read(study).map(|read| read.with(Plan::Map)),
        }
    }
}

/// A valid study.
#[derive(Debug)]
pub struct Study {
    kind: Kind,
    canonical: Value,
    problem: Problem,
    plan: Plan,
    /// Estimated processor time.
    seconds: f64,
}

/// Which points a study has, and what it makes of their rows.
#[derive(Debug)]
enum Plan {
    Sweep(Design),
    Sensitivity(Sensitivity),
    Map(FrettingMap),
}

impl Plan {
    fn points(&self) -> usize {
        match self {
            Self::Sweep(design) => design.points(),
            Self::Sensitivity(sensitivity) => sensitivity.points(),
            Self::Map(map) => map.points(),
        }
    }

    /// Estimated processor time of what follows from the rows, in seconds.
    fn findings_seconds(&self, problem: &Problem) -> f64 {
        match self {
            Self::Sweep(_) => 0.0,
            Self::Sensitivity(sensitivity) => {
                sensitivity.findings_seconds(problem.members.len(), problem.outputs.len())
            }
            Self::Map(map) => map.findings_seconds(problem),
        }
    }
}

/// A column of the table of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its name: the pointer of a member, or the name of an output.
    pub name: String,
    /// The SI unit of its numbers, or `1`; `None` for a column of texts.
    pub unit: Option<&'static str>,
}

impl Study {
    /// Reads a study with units, or in its canonical form.
    ///
    /// # Errors
    /// All faults, with pointers relative to the study.
    pub fn read(kind: Kind, typed: Value) -> Result<Self, Faults> {
        let Read { complete, problem, plan } = kind.read(typed).map_err(Faults::capped)?;
        if plan.points() > MAX_POINTS {
            let detail =
                format!("gives {} points. A study may have at most {MAX_POINTS}", plan.points());
            let mut names = ["samples", "vary", "amplitude"].into_iter();
            let name = names.find(|name| complete.contains_key(*name)).unwrap_or_default();
            return Err(Faults::one(&format!("/{name}"), detail));
        }
        let findings = plan.findings_seconds(&problem);
        if findings > MAX_FINDINGS {
            let detail = format!(
                "need about {findings:.0} s to estimate their intervals, more than the {MAX_FINDINGS} s that a study may \
                 take for it. Enter fewer outputs, numbers or samples, or a lower `confidence`"
            );
            return Err(Faults::one("/outputs", detail));
        }
        drop((problem, plan));
        // What is computed follows from the canonical form alone, with its order of members.
        let Read { complete, problem, plan } = kind.read(canonical(complete.into()))?;
        let mut canonical = Value::Object(complete);
        canonical.sort_all_objects();
        let mut study = Self { kind, canonical, problem, plan, seconds: 0.0 };
        study.seconds = study.estimate();
        Ok(study)
    }

    /// The mean of the estimates for some points, times the number of all points.
    fn estimate(&self) -> f64 {
        let of = |place| self.point_seconds(&self.point(place));
        // A sample of a scenario with long lists takes milliseconds.
        let samples = (SAMPLING / self.problem.preparation) as usize;
        let samples = samples.clamp(SAMPLES.0, SAMPLES.1);
        let mean = self.sample(samples).map(of).sum::<f64>() / samples as f64;
        mean * self.points() as f64 + self.plan.findings_seconds(&self.problem)
    }

    /// Some points, at random: evenly spaced ones could all lie on one line of a grid.
    fn sample(&self, count: usize) -> impl Iterator<Item = usize> {
        let (stream, points) = (Stream::new(0), self.points() as u64);
        (0..count as u64).map(move |place| stream.below(place, points) as usize)
    }

    /// Estimated processor time of a point with these values.
    fn point_seconds(&self, values: &[f64]) -> f64 {
        match &self.plan {
            Plan::Map(_) => FrettingMap::seconds(&self.problem, values),
            Plan::Sweep(_) | Plan::Sensitivity(_) => self.problem.seconds(values),
        }
    }

    /// Begins to compute the row of a point.
    pub(super) fn start(&self, values: &[f64]) -> Running {
        match &self.plan {
            Plan::Map(_) if self.problem.outputs.is_empty() => {
                Running::Known(Found { outputs: Vec::new(), profiles: Vec::new(), lack: None })
            }
            _ => self.problem.start(values),
        }
    }

    /// Continues to compute the row of a point for at most about 30 ms. Returns it when it is known.
    pub(super) fn step(&self, number: usize, running: &mut Running) -> Option<Found> {
        let found = self.problem.step(running)?;
        Some(match &self.plan {
            Plan::Map(map) => map.row(&self.problem, number, found),
            Plan::Sweep(_) | Plan::Sensitivity(_) => found,
        })
    }

    /// The row of a point without outputs.
    pub(super) fn lacks_all(&self, lack: Lack) -> Found {
        // Beside the outputs there are the members and the reason.
        let outputs = self.columns().len() - self.problem.members.len() - 1;
        Found { outputs: vec![None; outputs], ..self.problem.lacks_all(lack) }
    }

    /// The kind.
    #[must_use]
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// The study in SI, with all defaults. It has the same key and the same rows.
    #[must_use]
    pub fn canonical(&self) -> &Value {
        &self.canonical
    }

    /// The problem that is computed at each point.
    #[must_use]
    pub fn problem(&self) -> &Problem {
        &self.problem
    }

    /// The number of points.
    #[must_use]
    pub fn points(&self) -> usize {
        self.plan.points()
    }

    /// The values of the members at a point, in SI.
    ///
    /// # Panics
    /// There is no such point.
    #[must_use]
    pub fn point(&self, number: usize) -> Vec<f64> {
        match &self.plan {
            Plan::Sweep(design) => design.point(number),
            Plan::Sensitivity(sensitivity) => sensitivity.point(number),
            Plan::Map(map) => map.point(number).to_vec(),
        }
    }

    /// Estimated processor time, in seconds.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.seconds
    }

    /// The largest possible size of the document, in bytes.
    #[must_use]
    pub fn bytes(&self) -> usize {
        let row = NUMBER * (self.columns().len() - 1) + MAX_REASON + self.derived().len() * NUMBER;
        // A curve has brackets, and a point its number.
        let curves = self.problem.profiles.as_ref().map_or(0, |profiles| {
            NUMBER + profiles.fields.len() * (NUMBER * profiles.radii.len() + 3)
        });
        self.head() + (row + curves) * self.points()
    }

    /// Size of the document without its rows, about.
    fn head(&self) -> usize {
        let found = match &self.plan {
            Plan::Sweep(_) => {
                self.problem.profiles.as_ref().map_or(0, |it| NUMBER * it.radii.len())
            }
            Plan::Sensitivity(sensitivity) => sensitivity.bytes(&self.problem),
            Plan::Map(map) => map.bytes(),
        };
        HEAD + self.canonical.to_string().len() + found
    }

    /// Memory of a prepared study, in bytes, beside its canonical form as text.
    #[must_use]
    pub fn memory(&self) -> usize {
        let contacts = match &self.plan {
            Plan::Map(map) => map.memory(),
            Plan::Sweep(_) | Plan::Sensitivity(_) => 0,
        };
        size_of::<Self>() + 8 * self.problem.members.len() * LISTED.min(self.points()) + contacts
    }

    /// How many chunks of about 50 ms the study has.
    #[must_use]
    pub fn chunks(&self) -> usize {
        let least = self.points().div_ceil(MAX_CHUNK);
        ((self.seconds / CHUNK).ceil() as usize).clamp(least, self.points())
    }

    /// The member of the document that has the rows of all points. The table of a sensitivity study is what follows from
    /// them.
    #[must_use]
    pub fn rows_member(&self) -> &'static str {
        match self.plan {
            Plan::Sensitivity(_) => "samples",
            Plan::Sweep(_) | Plan::Map(_) => "table",
        }
    }

    /// The columns of the rows: members, outputs, and the reason why one is missing.
    #[must_use]
    pub fn columns(&self) -> Vec<Column> {
        let members = self.problem.members.iter().map(|member| Column {
            name: member.pointer.clone(),
            unit: Some(match member.dimension.si() {
                "" => "1",
                unit => unit,
            }),
        });
        let closed: &[_] = match self.plan {
            Plan::Map(_) => &map::CLOSED,
            Plan::Sweep(_) | Plan::Sensitivity(_) => &[],
        };
        let closed = closed
            .iter()
            .map(|(name, unit)| Column { name: (*name).to_owned(), unit: Some(*unit) });
        let outputs = self.problem.outputs.iter();
        let outputs = outputs.map(|output: &Output| Column {
            name: output.name().to_owned(),
            unit: Some(output.unit()),
        });
        let reason = Column { name: "reason".to_owned(), unit: None };
        members.chain(closed).chain(outputs).chain([reason]).collect()
    }

    /// The names of the columns of texts that follow from the rows. The document has them after the others.
    pub(super) fn derived(&self) -> &'static [&'static str] {
        match self.plan {
            Plan::Map(_) => &[map::REGIME],
            Plan::Sweep(_) | Plan::Sensitivity(_) => &[],
        }
    }

    /// The units of the columns of numbers, by their names.
    #[must_use]
    pub fn units(&self) -> Map<String, Value> {
        let columns = self.columns().into_iter();
        let columns = columns.filter_map(|column| Some((column.name, column.unit?.into())));
        let (found, unit): (&[_], _) = match &self.plan {
            Plan::Sensitivity(sensitivity) => (sensitivity.columns(), sensitivity.unit()),
            Plan::Sweep(_) | Plan::Map(_) => (&[], ""),
        };
        let found = found.iter().map(|name| (*name, unit));
        let curves = self.problem.profiles.iter().flat_map(|profiles| {
            let fields = profiles.fields.iter().map(|field| (field.name(), field.unit()));
            [("point", "1"), ("radius", "m")].into_iter().chain(fields)
        });
        let others = found.chain(curves).map(|(name, unit)| (name.to_owned(), unit.into()));
        columns.chain(others).collect()
    }

    /// The document of the study from the rows of all its points, under this key.
    ///
    /// # Panics
    /// The members cannot be written as JSON.
    #[must_use]
    #[expect(clippy::expect_used, reason = "nothing stops it")]
    pub fn document(&self, key: &impl Serialize, engine: &impl Serialize, rows: &Rows) -> String {
        self.document_while(key, engine, rows, &mut || true).expect("it goes on")
    }

    /// As [`document`](Self::document), but `None` if `goes_on` becomes false. It is asked before the intervals of each output
    /// are estimated.
    ///
    /// # Panics
    /// The members cannot be written as JSON.
    #[must_use]
    #[expect(clippy::expect_used, reason = "a damaged document must not be stored")]
    pub fn document_while(
        &self,
        key: &impl Serialize,
        engine: &impl Serialize,
        rows: &Rows,
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Option<String> {
        let mut head = json!({
            "key": key,
            "engine": engine,
            self.kind.name(): self.canonical,
            "units": self.units(),
            "counts": self.counts(rows),
        });
        let found = match &self.plan {
            Plan::Sweep(_) => Map::new(),
            Plan::Sensitivity(sensitivity) => sensitivity.findings(&self.problem, rows, goes_on)?,
            Plan::Map(map) => map.findings(&self.problem),
        };
        head.as_object_mut().expect("it is an object").extend(found);
        let mut text = String::with_capacity(rows.bytes() + self.head());
        text.push_str(&head.to_string());
        let end = text.pop().expect("an object ends with a brace");
        text.push_str(",\"");
        text.push_str(self.rows_member());
        text.push_str("\":");
        let columns = self.columns();
        let derived = self.derived().iter().map(|name| (*name, FrettingMap::regimes(rows)));
        let derived: Vec<_> = derived.collect();
        let cells = rows.columns().take(columns.len());
        let names = columns.iter().map(|column| column.name.as_str());
        let derived = derived.iter().map(|(name, cells)| (*name, cells.as_str()));
        add_columns(&mut text, names.zip(cells).chain(derived));
        if let Some(profiles) = &self.problem.profiles {
            text.push_str(",\"profiles\":");
            let points: Vec<_> = (0..rows.count).map(|point| point.to_string()).collect();
            let radii = json::write(&profiles.radii, NUMBER * profiles.radii.len());
            let axes = [("point", &*points.join(",")), ("radius", &radii[1..radii.len() - 1])];
            let names = profiles.fields.iter().map(|field| field.name());
            let curves = names.zip(rows.columns().skip(columns.len()));
            add_columns(&mut text, axes.into_iter().chain(curves));
        }
        text.push(end);
        Some(text)
    }

    /// How many points there are, and how many of them lack outputs.
    #[must_use]
    pub fn counts(&self, rows: &Rows) -> Value {
        json!({"points": self.points(), "refused": rows.refused, "incomplete": rows.incomplete})
    }
}

/// Writes an object of lists: names, and cells as JSON, separated by commas.
fn add_columns<'a>(text: &mut String, columns: impl Iterator<Item = (&'a str, &'a str)>) {
    for (place, (name, cells)) in columns.enumerate() {
        text.push(if place == 0 { '{' } else { ',' });
        text.push_str(&json!(name).to_string());
        text.push_str(":[");
        text.push_str(cells);
        text.push(']');
    }
    text.push('}');
}

/// A study in SI: quantities become numbers of 12 digits, whole numbers become integers, and members are sorted.
#[expect(clippy::expect_used, reason = "another study would have another key")]
fn canonical(mut study: Value) -> Value {
    study["version"] = json!(VERSION);
    // The member `profiles` of the study says which curves are kept, so two studies that differ only here are one.
    study["scenario"]["profiles_at"] = json!("none");
    to_si(&mut study);
    let text = json::write(&study, 1 << 10);
    drop(study);
    let mut study: Value = serde_json::from_str(&text).expect("the writer writes JSON");
    to_whole(&mut study);
    study.sort_all_objects();
    study
}

/// Replaces each text that is a quantity by its value in SI.
fn to_si(value: &mut Value) {
    match value {
        Value::String(text) => {
            let parsed = Dimension::ALL
                .into_iter()
                .find_map(|dimension| quantity::parse(text, dimension).ok())
                .and_then(Number::from_f64);
            if let Some(number) = parsed {
                *value = Value::Number(number);
            }
        }
        Value::Array(items) => items.iter_mut().for_each(to_si),
        Value::Object(members) => members.values_mut().for_each(to_si),
        _ => {}
    }
}

/// Replaces each number without a fraction by an integer.
fn to_whole(value: &mut Value) {
    match value {
        Value::Number(number) => {
            let whole = number.as_f64().filter(|it| it.fract() == 0.0 && it.abs() < 1e15);
            if let Some(whole) = whole {
                *number = (whole as i64).into();
            }
        }
        Value::Array(items) => items.iter_mut().for_each(to_whole),
        Value::Object(members) => members.values_mut().for_each(to_whole),
        _ => {}
    }
}
