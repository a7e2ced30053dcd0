//! Tasks: what a job computes. A task is prepared once and computed step by step.

use std::num::NonZeroU32;
use std::ops::Add;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use fretwork_engine::{
    Case, Fault, History, Outcome, ResultUnits, Scenario, Simulation, Valid, Warning, scenario,
    simulation,
};
use serde::Serialize;
use serde_json::Value;

use super::canonical::StoredText;
use super::document::{outline_of, summarize};
use super::{Canonical, ENGINE, Engine, Key, Outline, ResultDocument, TaskKind};
use fretwork_json as json;
use fretwork_study::{Points, RUN_MEMORY, Rows, Study};

/// Something that a worker computes in steps of at most about 50 ms, so that it can be stopped.
pub trait Work: Send {
    /// Computes the next step.
    fn step(&mut self) -> Step;

    /// Estimated memory, in bytes.
    fn bytes(&self) -> usize {
        0
    }

    /// The rows that a run has computed so far; `None` if the work is not one run.
    fn so_far(&self) -> Option<History> {
        None
    }
}

/// The state of a computation after a step.
#[derive(Debug)]
pub enum Step<T = Answer> {
    /// It needs more steps.
    Working {
        /// The share of the work that is done, in 0…1.
        progress: f64,
    },
    /// It is done.
    Done(T),
}

/// The result of finished work.
#[derive(Debug, Clone, PartialEq)]
pub struct Answer {
    /// The result document as it is served: JSON that depends only on the key.
    pub body: Bytes,
    /// The short form that a job shows: the last history entry and the regime.
    pub summary: Value,
    /// The words and numbers by which users search for the result.
    pub outline: Box<Outline>,
}

impl Answer {
    /// The answer of a study from the rows of all its points.
    pub fn of_study(key: Key, study: &Study, rows: Rows) -> Self {
        let summary = study.counts(&rows);
        Self::with_document(study, summary, study.document(&key, &ENGINE, rows))
    }

    /// As [`of_study`](Self::of_study), but returns `None` if `goes_on` becomes false.
    pub fn of_study_while(
        key: Key,
        study: &Study,
        rows: Rows,
        goes_on: &mut dyn FnMut() -> bool,
    ) -> Option<Self> {
        let summary = study.counts(&rows);
        let document = study.document_while(&key, &ENGINE, rows, goes_on)?;
        Some(Self::with_document(study, summary, document))
    }

    fn with_document(study: &Study, summary: Value, document: String) -> Self {
        let outline = outline_of(TaskKind::Study(study.kind), &summary);
        Self { body: document.into(), summary, outline: Box::new(outline) }
    }

    /// The answer whose JSON is `body`. `document` is the parsed body.
    pub fn new(body: Bytes, document: &ResultDocument) -> Self {
        Self {
            body,
            summary: document.summary.clone(),
            outline: Box::new(document.outline.clone()),
        }
    }
}

/// The cost of a computation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Cost {
    /// Elapsed time.
    pub wall: Duration,
    /// Processor time; `None` if the system does not report it.
    pub cpu: Option<Duration>,
}

impl Cost {
    /// The cost of doing nothing.
    pub const ZERO: Self = Self { wall: Duration::ZERO, cpu: Some(Duration::ZERO) };
}

impl Add for Cost {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let cpu = self.cpu.zip(other.cpu).map(|(one, other)| one + other);
        Self { wall: self.wall + other.wall, cpu }
    }
}

/// A valid task that is ready to start, with everything that is derived from it. Clones share the task.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// The key of its result.
    pub key: Key,
    /// Its stored form, from which [`Task::start`] can prepare it again.
    pub stored: Arc<str>,
    /// Estimated processor time, in seconds.
    pub seconds: f64,
    /// Warnings about the two bodies. They belong to the submission: the task does not contain the bodies, and its
    /// result does not contain these warnings.
    pub submission_warnings: Vec<Warning>,
    /// What it computes.
    pub task: Task,
}

/// What a job computes: one variant for each kind of work.
#[derive(Debug, Clone)]
pub enum Task {
    /// One simulation: its canonical scenario and the case built from it.
    Run(Arc<(Scenario, Case)>),
    /// A study of many runs.
    Study(Arc<Study>),
}

impl Prepared {
    /// Prepares a task. `asked` is the scenario or the study of a job body. The pointers of faults begin with the name
    /// of this member.
    ///
    /// # Errors
    /// Every fault.
    pub fn read(kind: TaskKind, asked: Value) -> Valid<Self> {
        match kind {
            TaskKind::Run => Self::from_scenario(asked, "/scenario"),
            TaskKind::Study(study) => {
                let prefix = format!("/{}", study.name);
                let study = Study::read(study, asked).map_err(|faults| faults.below(&prefix))?;
                Ok(Self::new(Task::Study(Arc::new(study)), Vec::new()))
            }
        }
    }

    /// Prepares the run of a scenario; `prefix` goes before the pointer of each fault.
    ///
    /// # Errors
    /// Every fault of the scenario.
    pub fn from_scenario(scenario: Value, prefix: &str) -> Valid<Self> {
        Ok(Self::of_run(scenario::prepare(scenario, prefix)?))
    }

    /// The run of a case of a canonical scenario, with the warnings about the two bodies.
    pub fn of_run((scenario, case, warnings): (Scenario, Case, Vec<Warning>)) -> Self {
        Self::new(Task::Run(Arc::new((scenario, case))), warnings)
    }

    fn new(task: Task, submission_warnings: Vec<Warning>) -> Self {
        let kind = task.kind();
        let (key, stored, seconds) = match &task {
            Task::Run(run) => {
                let (scenario, case) = &**run;
                (kind.key(ENGINE.numerics, scenario), kind.stored(scenario), case.seconds())
            }
            Task::Study(study) => {
                let canonical = &study.canonical;
                (kind.key(ENGINE.numerics, canonical), kind.stored(canonical), study.seconds)
            }
        };
        Self { key, stored: stored.into(), seconds, submission_warnings, task }
    }

    /// Prepares a stored task again, for instance after a restart.
    ///
    /// # Errors
    /// A message: this version of the program cannot compute the task, or the task has another key.
    pub fn from_stored(key: &Key, stored: &str) -> Result<Self, String> {
        let stored = StoredText::read(stored).map_err(|error| error.to_string())?;
        if stored.is_later() {
            return Err(
                "a newer version of fretwork stored the job; update this program".to_owned()
            );
        }
        let (kind, asked) = stored.asked().ok_or("the stored job does not say what to compute")?;
        let asked = serde_json::from_str(asked.get()).map_err(|error| error.to_string())?;
        let prepared = Self::read(kind, asked).map_err(|faults| {
            let told = |Fault { pointer, detail }: &Fault| format!("{pointer}: {detail}");
            faults.0.iter().map(told).collect::<Vec<_>>().join("; ")
        })?;
        // If `numerics` has changed since, this version would store other digits under the old key.
        if prepared.key != *key {
            return Err("another version of the engine stored the job".to_owned());
        }
        Ok(prepared)
    }

    /// The number of chunks into which the task is divided; `None` if one worker computes all of it.
    pub fn chunks(&self) -> Option<NonZeroU32> {
        match &self.task {
            Task::Run(_) => None,
            Task::Study(study) => {
                let chunks = u32::try_from(study.chunks()).ok().filter(|chunks| *chunks > 1);
                chunks.and_then(NonZeroU32::new)
            }
        }
    }

    /// The chunks with which the later stages of the task begin, separated by commas. Their workers need the rows of all
    /// chunks before them.
    pub fn stages(&self) -> String {
        let stages = match &self.task {
            Task::Study(study) if study.chunks() > 1 => study.stages(),
            _ => Vec::new(),
        };
        stages.iter().map(usize::to_string).collect::<Vec<_>>().join(",")
    }

    /// The canonical scenario or study.
    ///
    /// # Panics
    /// The stored form was changed.
    #[expect(clippy::expect_used, reason = "the stored form was written by this program")]
    pub fn asked(&self) -> Canonical {
        Canonical::in_stored(&self.stored).expect("a prepared task asks for something")
    }

    /// What the client should know about the task: the warnings of the submission, and those of the result.
    pub fn warnings(&self) -> Vec<Warning> {
        let of_result = match &self.task {
            Task::Run(run) => run.0.warnings(&run.1),
            Task::Study(_) => Vec::new(),
        };
        self.submission_warnings.iter().cloned().chain(of_result).collect()
    }

    /// The estimated memory, in bytes. Measured memory was 0.5 to 1.4 times this estimate, for plain runs, records of
    /// 500 and 10 000 reversals, and tables of 300 and 5000 points.
    pub fn bytes(&self) -> usize {
        let task = match &self.task {
            Task::Run(_) => size_of::<(Scenario, Case)>(),
            Task::Study(study) => study.memory(),
        };
        size_of::<Self>() + task + 4 * self.stored.len()
    }

    /// Computes the whole answer on this thread. Calls `progress` after each step with the share of the work that is
    /// done, in 0…1.
    pub fn compute(&self, mut progress: impl FnMut(f64)) -> Answer {
        let mut work = self.start();
        loop {
            match work.step() {
                Step::Done(answer) => return answer,
                Step::Working { progress: share } => progress(share),
            }
        }
    }

    /// Begins the work.
    pub fn start(&self) -> Box<dyn Work> {
        match &self.task {
            Task::Run(run) => {
                let (scenario, case) = &**run;
                let simulation = Simulation::new(case.clone(), scenario.warnings(case));
                Box::new(RunWork { key: self.key, run: Arc::clone(run), simulation })
            }
            Task::Study(study) => {
                let points = Points::whole(Arc::clone(study));
                Box::new(StudyWork { key: self.key, study: Arc::clone(study), points })
            }
        }
    }
}

impl Task {
    /// What the task computes.
    pub fn kind(&self) -> TaskKind {
        match self {
            Self::Run(_) => TaskKind::Run,
            Self::Study(study) => TaskKind::Study(study.kind),
        }
    }

    /// Begins the work of a task. Without `prepared`, the task is prepared again from its stored form.
    ///
    /// # Errors
    /// As [`Prepared::from_stored`].
    pub fn start(
        key: &Key,
        stored: &str,
        prepared: Option<Prepared>,
    ) -> Result<Box<dyn Work>, String> {
        let prepared = prepared.map_or_else(|| Prepared::from_stored(key, stored), Ok)?;
        Ok(prepared.start())
    }
}

/// A function that begins the work of a task. The program uses [`Task::start`]; tests use functions of their own.
pub type Begin =
    Arc<dyn Fn(&Key, &str, Option<Prepared>) -> Result<Box<dyn Work>, String> + Send + Sync>;

/// A simulation in progress.
struct RunWork {
    key: Key,
    run: Arc<(Scenario, Case)>,
    simulation: Simulation,
}

impl Work for RunWork {
    fn step(&mut self) -> Step {
        match self.simulation.step() {
            simulation::Advance::Working(progress) => Step::Working { progress },
            simulation::Advance::Done(outcome) => Step::Done(self.answer(&outcome)),
        }
    }

    fn bytes(&self) -> usize {
        self.run.1.answer_bytes() + RUN_MEMORY
    }

    fn so_far(&self) -> Option<History> {
        Some(self.simulation.so_far())
    }
}

impl RunWork {
    fn answer(&self, outcome: &Outcome) -> Answer {
        let scenario = &self.run.0;
        let mut body = write(self.key, scenario, outcome, self.run.1.answer_bytes()).into_bytes();
        // The memory cache may keep the body for a long time.
        body.shrink_to_fit();
        let (summary, outline) = summarize(scenario, outcome);
        Answer { body: body.into(), summary, outline: Box::new(outline) }
    }
}

/// A study in progress.
struct StudyWork {
    key: Key,
    study: Arc<Study>,
    points: Points,
}

impl Work for StudyWork {
    fn bytes(&self) -> usize {
        self.study.memory_of_chunk(1)
    }

    fn step(&mut self) -> Step {
        match self.points.step() {
            None => Step::Working { progress: self.points.progress() },
            Some(rows) => Step::Done(Answer::of_study(self.key, &self.study, rows)),
        }
    }
}

/// The JSON of a result of about `bytes` bytes.
fn write(key: Key, scenario: &Scenario, outcome: &Outcome, bytes: usize) -> String {
    #[derive(Serialize)]
    struct Whole<'a> {
        key: Key,
        engine: Engine,
        scenario: &'a Scenario,
        units: ResultUnits,
        #[serde(flatten)]
        outcome: &'a Outcome,
    }
    json::write(&Whole { key, engine: ENGINE, scenario, units: ResultUnits, outcome }, bytes)
}

#[cfg(test)]
pub(super) mod tests {
    use serde_json::json;

    use super::*;

    fn prepared(scenario: &Value) -> Prepared {
        let prepared = Prepared::from_scenario(scenario.clone(), "/scenario");
        prepared.unwrap_or_else(|faults| panic!("{faults:?}"))
    }

    /// A steel ball on a steel flat.
    pub fn ball() -> Value {
        json!({
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "bodies": [
                {"youngs_modulus": "205 GPa", "poisson_ratio": 0.3},
                {"youngs_modulus": "205 GPa", "poisson_ratio": 0.3}
            ],
            "friction": 0.7,
            "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
            "load": {"normal_force": "100 N", "held": "depth"},
            "motion": {"amplitude": "2.256 um"},
            "cycles": [1000, 3000, 10000, 30000],
            "model": {"method": "simplified", "xi": 0.8},
        })
    }

    fn key(scenario: &Value) -> Key {
        prepared(scenario).key
    }

    #[test]
    fn equivalent_scenarios_have_the_same_key() {
        let expected = key(&ball());
        let same = |change: &dyn Fn(&mut Value)| {
            let mut scenario = ball();
            change(&mut scenario);
            assert_eq!(key(&scenario), expected, "{scenario}");
        };
        same(&|s| s["profile"]["radius"] = json!(0.01));
        same(&|s| s["profile"]["radius"] = json!("1 cm"));
        same(&|s| s["load"]["normal_force"] = json!("0.1 kN"));
        same(&|s| s["motion"] = json!({"amplitude": "2256 nm", "held": "amplitude"}));
        same(&|s| s["wear"] = json!({"coefficient": 3.03e-14}));
        same(&|s| s["wear"] = json!({"coefficient": 3.03e-5, "hardness": 1e9}));
        same(&|s| s["wear"] = json!({"energy_coefficient": 3.03e-14 / 0.7}));
        same(&|s| s["cycles"] = json!([0, 1000, 3000, 10000, 30000]));
        same(&|s| s["profiles_at"] = json!("all"));
        same(&|s| s["profiles_at"] = json!([1000, 3000, 10000, 30000]));
        same(&|s| s["model"] = json!({"points": 256, "xi": 0.8, "method": "simplified"}));
        // E* = E/(2(1−ν²)), G* = E/((1+ν)(2−ν)): to 15 digits.
        same(&|s| {
            s.as_object_mut().expect("an object").remove("bodies");
            s["moduli"] =
                json!({"normal": 112_637_362_637.363, "tangential": 92_760_180_995.475_1});
        });
        // The indentation depth at 100 N.
        let canonical = prepared(&ball()).asked().value;
        same(&|s| s["load"] = json!({"indentation_depth": canonical["load"]["indentation_depth"]}));
        same(&|s| *s = canonical.clone());
    }

    #[test]
    fn scenarios_that_differ_within_12_digits_have_different_keys() {
        let expected = key(&ball());
        for (pointer, value) in [
            ("/friction", json!(0.700_000_000_01)),
            ("/profile/shape", json!("sphere")),
            ("/cycles/0", json!(1001)),
            ("/motion/amplitude", json!("2.257 um")),
        ] {
            let mut scenario = ball();
            *scenario.pointer_mut(pointer).expect(pointer) = value;
            assert_ne!(key(&scenario), expected, "{pointer}");
        }
        let mut scenario = ball();
        scenario["model"] = json!({"method": "simplified", "points": 255});
        assert_ne!(key(&scenario), expected);
    }

    #[test]
    fn the_exact_method_is_the_default() {
        let (mut unnamed, mut exact) = (ball(), ball());
        unnamed.as_object_mut().expect("an object").remove("model");
        exact["model"] = json!({"method": "exact", "tolerance": 0.003, "compare": false});
        assert_eq!(key(&unnamed), key(&exact));
    }

    /// Fails if digits of a result change without a new `NUMERICS`. The digests depend on every digit.
    #[test]
    fn results_of_numerics_5_are_unchanged() {
        assert_eq!(ENGINE.numerics, 5, "new digits: compute the digests below anew");
        let digest = |scenario: &Value| {
            let prepared = prepared(scenario);
            let mut work = prepared.start();
            let answer = loop {
                if let Step::Done(answer) = work.step() {
                    break answer;
                }
            };
            format!("{} {}", prepared.key, Key::digest(&answer.body))
        };
        let mut exact = ball();
        exact["model"] = json!({"method": "exact"});
        let mut cone = ball();
        cone["profile"] = json!({"shape": "power", "exponent": 2.5, "height": "1 um",
                                 "at_radius": "0.1 mm"});
        cone["motion"] = json!({"stick_ratio": 0.3});
        cone["cycles"] = json!({"normalized": [0.5, 4, 16]});
        let [ball, cone, exact] = [ball(), cone, exact].map(|scenario| digest(&scenario));
        assert_eq!(
            [ball.as_str(), cone.as_str(), exact.as_str()],
            [
                "7c8a93bba29436f9d4dd515a180cf9a08080fc91b95c800bb49ac548638c9fa3 \
                 87ea46034ff9766fa19b9d1384cab219f3267b3ef77543c8a7f7672628d0025f",
                "dba8c367f3340e4bc903272c94ee7c46f5de4a7e15d63f9519b8485c25bc00df \
                 359a1df68e5c996183386d80b3fa164410c43e2398afef2485545fcb78d804d9",
                "2d83f5fadc42f74756530ab0e09771be745763bbf0dca8ed11e093a9b5f3c409 \
                 18f85043267a33d7e9b3d0a2ad510b92130d49762b1f109cbd6c6a3fca811586",
            ]
        );
    }

    #[test]
    fn a_stored_task_is_refused_under_another_key() {
        let Prepared { key, stored, .. } = prepared(&ball());
        assert_eq!(
            Prepared::from_stored(&key, &stored).map(|again| again.stored),
            Ok(stored.clone())
        );
        // An engine with other digits would have another key.
        let refused = Prepared::from_stored(&Key::digest(b"numerics 0"), &stored).map(drop);
        assert_eq!(refused, Err("another version of the engine stored the job".to_owned()));
    }

    #[test]
    fn older_stored_tasks_are_read_and_newer_ones_are_refused() {
        let prepared = prepared(&ball());
        let Prepared { key, stored, .. } = &prepared;
        assert!(stored.starts_with(r#"{"version":2,"scenario":{"profile":"#), "{stored}");
        // Version 1 had no number.
        let first = json!(prepared.asked()).to_string();
        assert_eq!(Prepared::from_stored(key, &first).map(|again| again.key), Ok(*key));
        let later = stored.replacen("\"version\":2", "\"version\":4", 1);
        let refused = Prepared::from_stored(key, &later).map(drop);
        assert_eq!(
            refused,
            Err("a newer version of fretwork stored the job; update this program".to_owned())
        );
    }
}
