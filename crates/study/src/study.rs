//! A study of any kind: its canonical form, its points, and its document.

use std::mem;
use std::ops::Range;

use fretwork_engine::input::quantity;
use fretwork_engine::{Dimension, Faults, Valid};
use serde::Serialize;
use serde_json::{Map, Number, Value, json};

use super::output::Output;
use super::plan::{Column, GoesOn, Kind, MAX_POINTS, OrRun, Plan, Read, Tried};
use super::problem::{Found, Lack, Problem};
use super::rows::{MAX_REASON, NUMBER, Rows};
use super::run::Run;
use super::totals;
use fretwork_json as json;
use fretwork_random::Stream;

/// The version of the rules by which a canonical study gives its rows. It is a part of the study's key. Increase it
/// when a random sequence, a text in a row or a default of scenarios changes.
const VERSION: u32 = 1;
/// Estimated time of a chunk, in seconds. A chunk takes about half of it, because estimates of short runs are twice too
/// long.
const CHUNK: f64 = 0.1;
/// Maximum estimated time of the findings, in seconds. It is limited because they are computed in one step.
const MAX_FINDINGS: f64 = 5.0;
/// Estimated memory of a run without its result, in bytes.
pub const RUN_MEMORY: usize = 1 << 20;
/// Maximum number of points of a chunk.
const MAX_CHUNK: usize = 4096;
/// Intended maximum size of the rows of a chunk, in bytes. The allocator uses the freed memory of small chunks again at once, and
/// keeps that of large ones for a while.
const CHUNK_BYTES: usize = 2 << 20;
/// Minimum and maximum number of sampled points from which the time of all points is estimated.
const SAMPLES: (usize, usize) = (4, 64);
/// Intended time to prepare the sampled points, in seconds. It decides how many points are sampled.
const SAMPLING: f64 = 5e-3;
/// Maximum number of values of a member that [`Study::memory`] counts.
const LISTED: usize = 100_000;
/// The members that are names. They stay as they are, even if they look like quantities.
const NAMES: [&str; 3] = ["name", "specimen", "for"];
/// Maximum bytes of a document without its table, findings and canonical form.
const HEAD: usize = 4096;

/// A valid study.
#[derive(Debug)]
pub struct Study {
    /// The kind.
    pub kind: &'static Kind,
    /// The study in SI, with all defaults. It has the same key and the same rows.
    pub canonical: Value,
    /// The problem that is computed at each point.
    pub problem: Problem,
    plan: Box<dyn Plan>,
    /// Estimated processor time, in seconds.
    pub seconds: f64,
}

/// The computation of one point.
#[derive(Debug, Default)]
pub(super) struct PointRun {
    tried: Vec<Tried>,
    running: Option<(Vec<f64>, Run)>,
}

impl PointRun {
    /// Continues for at most about 30 ms. `end` returns the outcome from all runs so far, or the values of the run that
    /// it needs next.
    pub(super) fn step<T>(
        &mut self,
        plan: &dyn Plan,
        problem: &Problem,
        end: impl Fn(&[Tried]) -> OrRun<T>,
    ) -> Option<T> {
        loop {
            if let Some((values, run)) = &mut self.running {
                let found = plan.asked(problem, values).0.found(&run.step()?);
                self.tried.push(Tried { values: mem::take(values), found });
                self.running = None;
            }
            let values = match end(&self.tried) {
                Ok(outcome) => return Some(outcome),
                Err(values) => values,
            };
            let is_first = self.tried.is_empty();
            let (own_problem, own) = plan.asked(problem, &values);
            match own_problem.start(own) {
                Ok(run) => self.running = Some((values, run)),
                Err(found) => self.tried.push(Tried { values, found }),
            }
            // Returns after each run, so that a point of many short runs does not exceed the time of a step.
            if !is_first {
                return None;
            }
        }
    }
}

impl Study {
    /// Reads a study with units, or in its canonical form.
    ///
    /// # Errors
    /// All faults, with pointers relative to the study.
    pub fn read(kind: &'static Kind, mut typed: Value) -> Valid<Self> {
        totals::of_study(&mut typed, kind.axes)?;
        let Read { complete, problem, plan } = (kind.read)(typed).map_err(Faults::capped)?;
        if plan.points() as u64 > MAX_POINTS {
            let detail = format!(
                "gives {} points, but a study may have at most {MAX_POINTS}. Enter fewer samples or values",
                plan.points()
            );
            let axes = kind.axes.iter().rev().map(|(name, _)| *name);
            let mut names = ["samples", "vary"].into_iter().chain(axes);
            let name = names.find(|name| complete.contains_key(*name)).unwrap_or_default();
            return Err(Faults::one(&format!("/{name}"), detail));
        }
        let findings = plan.findings_seconds(&problem);
        if findings > MAX_FINDINGS {
            let detail = format!(
                "need about {findings:.0} s for the estimates of their intervals; the limit of a study is \
                 {MAX_FINDINGS} s. Enter fewer outputs, fewer numbers in `vary`, fewer samples, or a lower `confidence`"
            );
            return Err(Faults::one("/outputs", detail));
        }
        drop((problem, plan));
        // The problem and the plan are read from the canonical form, so that studies with the same key give the same
        // rows.
        let Read { complete, problem, plan } = (kind.read)(canonical(complete.into()))?;
        let mut canonical = Value::Object(complete);
        canonical.sort_all_objects();
        let mut study = Self { kind, canonical, problem, plan, seconds: 0.0 };
        study.seconds = study.estimate();
        Ok(study)
    }

    /// The mean of the estimates for some points, times the number of all points.
    fn estimate(&self) -> f64 {
        let of = |place| self.plan.seconds(&self.problem, &self.point(place));
        // To prepare one point of a scenario with long lists takes milliseconds, so fewer points are sampled.
        let samples = (SAMPLING / self.problem.preparation()) as usize;
        let samples = samples.clamp(SAMPLES.0, SAMPLES.1);
        let mean = self.sample(samples).map(of).sum::<f64>() / samples as f64;
        mean * self.points() as f64 + self.plan.findings_seconds(&self.problem)
    }

    /// Random points. Evenly spaced points could all lie on one line of a grid.
    fn sample(&self, count: usize) -> impl Iterator<Item = usize> {
        let (stream, points) = (Stream::new(0), self.points() as u64);
        (0..count as u64).map(move |place| stream.below(place, points) as usize)
    }

    /// Continues to compute a point for at most about 30 ms. Returns its row when it is known.
    pub(super) fn step(
        &self,
        number: usize,
        earlier: &Rows,
        point: &mut PointRun,
    ) -> Option<Tried> {
        point.step(&*self.plan, &self.problem, |tried| {
            self.plan.row(&self.problem, number, earlier, tried)
        })
    }

    /// The row of a point that lacks all outputs, for this reason.
    pub(super) fn lacks_all(&self, number: usize, lack: Lack) -> Tried {
        // All columns are outputs except the members and the reason.
        let outputs = vec![None; self.columns().len() - self.problem.members.len() - 1];
        let found = Found { outputs, lack: Some(lack), ..self.problem.no_run() };
        Tried { values: self.point(number), found }
    }

    /// The number of points.
    pub fn points(&self) -> usize {
        self.plan.points()
    }

    /// The values of the members in the first run of a point, in SI.
    ///
    /// # Panics
    /// There is no such point.
    pub fn point(&self, number: usize) -> Vec<f64> {
        self.plan.point(number)
    }

    /// The largest possible size of the document, in bytes.
    pub fn bytes(&self) -> usize {
        let row = NUMBER * (self.columns().len() - 1) + MAX_REASON;
        // The 3 bytes are the brackets and the comma of a curve. Each point also has its index.
        let curves = self.problem.profiles.as_ref().map_or(0, |profiles| {
            NUMBER + profiles.fields.len() * (NUMBER * profiles.radii.len() + 3)
        });
        self.head() + (row + curves) * self.points()
    }

    /// Estimated size of the document without its rows, in bytes.
    fn head(&self) -> usize {
        let radii = self.problem.profiles.as_ref().map_or(0, |it| NUMBER * it.radii.len());
        let found = radii + self.plan.findings_bytes(&self.problem);
        HEAD + self.canonical.to_string().len() + found
    }

    /// Estimated memory of a prepared study without the text of its canonical form, in bytes.
    pub fn memory(&self) -> usize {
        size_of::<Self>()
            + 8 * self.problem.members.len() * LISTED.min(self.points())
            + self.plan.memory()
    }

    /// Estimated memory of a chunk in progress, of `chunks`, in bytes. A later stage has the rows of all earlier ones.
    pub fn memory_of_chunk(&self, chunks: usize) -> usize {
        let rows = if self.plan.stages().len() > 1 { 1 } else { chunks };
        self.memory() + self.bytes() / rows + RUN_MEMORY
    }

    /// How many chunks of about 50 ms the study has. If the study has several stages, each chunk is one point.
    pub fn chunks(&self) -> usize {
        if self.plan.stages().len() > 1 {
            return if self.seconds > CHUNK { self.points() } else { 1 };
        }
        let least = self.points().div_ceil(MAX_CHUNK).max(self.bytes() / CHUNK_BYTES);
        ((self.seconds / CHUNK).ceil() as usize).max(least).min(self.points())
    }

    /// The points of chunk number `number` of `chunks`, whose sizes differ by at most one point.
    pub fn points_of(&self, number: usize, chunks: usize) -> Range<usize> {
        let start = |number| number * self.points() / chunks;
        start(number)..start(number + 1)
    }

    /// The points with which the later stages begin.
    pub fn stages(&self) -> Vec<usize> {
        self.plan.stages().split_off(1)
    }

    /// The number of chunks, from the first one on, whose rows this chunk of `chunks` needs: those of earlier stages.
    pub fn earlier_chunks(&self, number: usize, chunks: usize) -> usize {
        let stages = self.plan.stages().into_iter();
        if chunks == 1 { 0 } else { stages.filter(|first| *first <= number).max().unwrap_or(0) }
    }

    /// The columns of the rows: members, outputs, and the reason why one is missing.
    pub fn columns(&self) -> Vec<Column> {
        let members = self.problem.members.iter().map(|member| {
            let unit = member.dimension.si();
            Column::new(&member.pointer, if unit.is_empty() { "1" } else { unit })
        });
        let outputs = self.problem.outputs.iter();
        let outputs = outputs.map(|output: &Output| Column::new(output.name(), output.unit()));
        let reason = Column { name: "reason".to_owned(), unit: None };
        members.chain(self.plan.columns()).chain(outputs).chain([reason]).collect()
    }

    /// The units of the columns of numbers, by their names.
    pub fn units(&self) -> Map<String, Value> {
        let columns = self.columns().into_iter().chain(self.plan.found_columns());
        let columns = columns.filter_map(|column| Some((column.name, column.unit?.into())));
        let curves = self.problem.profiles.iter().flat_map(|profiles| {
            let fields = profiles.fields.iter().map(|field| (field.as_str(), field.unit()));
            [("point", "1"), ("radius", "m")].into_iter().chain(fields)
        });
        columns.chain(curves.map(|(name, unit)| (name.to_owned(), unit.into()))).collect()
    }

    /// The document of the study from the rows of all its points, under this key.
    ///
    /// # Panics
    /// The members cannot be written as JSON.
    #[expect(clippy::expect_used, reason = "nothing stops it")]
    pub fn document(&self, key: &impl Serialize, engine: &impl Serialize, rows: Rows) -> String {
        self.document_while(key, engine, rows, &mut || true).expect("it goes on")
    }

    /// As [`document`](Self::document), but returns `None` if `goes_on` becomes false. It is called before the
    /// intervals of each output are estimated.
    ///
    /// # Panics
    /// The members cannot be written as JSON.
    #[expect(clippy::expect_used, reason = "a damaged document must not be stored")]
    pub fn document_while(
        &self,
        key: &impl Serialize,
        engine: &impl Serialize,
        rows: Rows,
        goes_on: GoesOn<'_>,
    ) -> Option<String> {
        let mut head = json!({
            "key": key,
            "engine": engine,
            self.kind.name: self.canonical,
            "units": self.units(),
            "counts": self.counts(&rows),
        });
        let findings = self.plan.findings(&self.problem, &rows, goes_on)?;
        let members = findings.members.into_iter().map(|(name, value)| (name.to_owned(), value));
        head.as_object_mut().expect("it is an object").extend(members);
        let mut text = String::with_capacity(rows.bytes() + self.head());
        text.push_str(&head.to_string());
        let end = text.pop().expect("an object ends with a brace");
        text.push_str(",\"");
        text.push_str(self.kind.rows);
        text.push_str("\":");
        let columns = self.columns();
        let count = rows.count;
        let mut cells = rows.into_columns();
        let names = columns.iter().map(|column| column.name.as_str());
        let beside = findings.beside.into_iter().map(|(name, cells)| (name, vec![cells]));
        add_columns(&mut text, names.zip(cells.by_ref()).chain(beside));
        if let Some(profiles) = &self.problem.profiles {
            text.push_str(",\"profiles\":");
            let points: Vec<_> = (0..count).map(|point| point.to_string()).collect();
            let radii = json::write(&profiles.radii, NUMBER * profiles.radii.len());
            let radii = radii[1..radii.len() - 1].to_owned();
            let names = profiles.fields.iter().map(|field| field.as_str());
            let axes = [("point", points), ("radius", vec![radii])];
            add_columns(&mut text, axes.into_iter().chain(names.zip(cells)));
        }
        text.push(end);
        Some(text)
    }

    /// The table of the rows that some of `of` chunks have computed, as JSON, and the counts of these rows. The column
    /// `point` has the number of each point.
    pub fn table_so_far(&self, chunks: Vec<(usize, Rows)>, of: usize) -> (String, Value) {
        let mut all = Rows::default();
        let mut points = Vec::new();
        for (number, rows) in chunks {
            points.extend(self.points_of(number, of).take(rows.count));
            all.append(rows);
        }
        let mut counts = self.counts(&all);
        counts["computed"] = json!(all.count);
        let points: Vec<_> = points.iter().map(usize::to_string).collect();
        let columns = self.columns();
        let names = columns.iter().map(|column| column.name.as_str());
        let mut text = String::with_capacity(all.bytes() + NUMBER * points.len() + HEAD);
        add_columns(
            &mut text,
            [("point", points)].into_iter().chain(names.zip(all.into_columns())),
        );
        (text, counts)
    }

    /// The number of points, and how many of them are refused or incomplete.
    pub fn counts(&self, rows: &Rows) -> Value {
        json!({"points": self.points(), "refused": rows.refused, "incomplete": rows.incomplete})
    }
}

/// Writes columns as a JSON object with a list for each column. Each column is a name and the texts of [`Rows`]. Each text is
/// dropped after it was copied, so that a large table is in memory little more than once.
fn add_columns<'a>(text: &mut String, columns: impl Iterator<Item = (&'a str, Vec<String>)>) {
    for (place, (name, texts)) in columns.enumerate() {
        text.push(if place == 0 { '{' } else { ',' });
        text.push_str(&json!(name).to_string());
        text.push_str(":[");
        for (place, cells) in texts.into_iter().enumerate() {
            text.extend([if place == 0 { "" } else { "," }, &cells]);
        }
        text.push(']');
    }
    text.push('}');
}

/// A study in SI: quantities become numbers of 12 digits, whole numbers become integers, and members are sorted.
#[expect(clippy::expect_used, reason = "another study would have another key")]
fn canonical(mut study: Value) -> Value {
    study["version"] = json!(VERSION);
    // A study ignores `profiles_at` of its scenario, so studies that differ only there must have the same key. Only the
    // member `profiles` of a study says which curves are kept.
    study["scenario"]["profiles_at"] = json!("none");
    change(&mut study, to_si);
    let text = json::write(&study, 1 << 10);
    drop(study);
    let mut study: Value = serde_json::from_str(&text).expect("the writer writes JSON");
    change(&mut study, to_whole);
    study.sort_all_objects();
    study
}

/// Replaces each text or number of a document for which `new` returns a number.
fn change(value: &mut Value, new: fn(&Value) -> Option<Number>) {
    match value {
        Value::Array(items) => items.iter_mut().for_each(|item| change(item, new)),
        Value::Object(members) => {
            let others = members.iter_mut().filter(|(name, _)| !NAMES.contains(&name.as_str()));
            others.for_each(|(_, member)| change(member, new));
        }
        other => {
            if let Some(number) = new(other) {
                *other = Value::Number(number);
            }
        }
    }
}

/// The value of a quantity in SI.
fn to_si(value: &Value) -> Option<Number> {
    let text = value.as_str()?;
    let parsed = |dimension| quantity::parse(text, dimension).ok();
    Dimension::all().find_map(parsed).and_then(Number::from_f64)
}

/// A number without a fraction as an integer.
fn to_whole(value: &Value) -> Option<Number> {
    let whole = value.as_f64().filter(|it| it.fract() == 0.0 && it.abs() < 1e15)?;
    Some((whole as i64).into())
}
