//! The canonical form of a job: the canonical scenario of a run, or the canonical form of a study.

use std::collections::BTreeMap;

use serde::{Serialize, Serializer};
use serde_json::Value;
use serde_json::value::RawValue;

use super::{ENGINE, Key};
use fretwork_json as json;
use fretwork_study::Kind;

/// The version of the form in which runs are stored. Version 1 was the job body of the HTTP interface, without a
/// version number.
const RUN_VERSION: u32 = 2;
/// The version of the form in which studies are stored.
const STUDY_VERSION: u32 = 3;

/// What a job computes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum TaskKind {
    /// The run of one scenario.
    #[default]
    Run,
    /// A study of many runs.
    Study(&'static Kind),
}

impl TaskKind {
    /// All kinds.
    pub fn all() -> impl Iterator<Item = Self> {
        [Self::Run].into_iter().chain(Kind::ALL.map(Self::Study))
    }

    /// The kind with this member of a job body.
    pub fn of_member(name: &str) -> Option<Self> {
        Self::all().find(|kind| kind.member() == name)
    }

    /// The member of a job body that says what to compute.
    pub fn member(self) -> &'static str {
        match self {
            Self::Run => "scenario",
            Self::Study(kind) => kind.name,
        }
    }

    /// The word by which users search for results of this kind.
    pub fn word(self) -> &'static str {
        match self {
            Self::Run => "run",
            Self::Study(kind) => kind.name,
        }
    }

    /// The key of a result of this kind under this `numerics` version. `canonical` is the canonical scenario or study.
    pub fn key(self, numerics: u32, canonical: &impl Serialize) -> Key {
        Key::of(numerics, &BTreeMap::from([(self.member(), canonical)]))
    }

    /// The stored form of a task.
    pub fn stored(self, canonical: &impl Serialize) -> String {
        #[derive(Serialize)]
        struct Stored<'a, T> {
            version: u32,
            #[serde(flatten)]
            task: BTreeMap<&'static str, &'a T>,
        }
        let version = match self {
            Self::Run => RUN_VERSION,
            Self::Study(_) => STUDY_VERSION,
        };
        let task = BTreeMap::from([(self.member(), canonical)]);
        json::write(&Stored { version, task }, 1 << 10)
    }
}

/// The canonical scenario of a run, or the canonical form of a study. Its JSON is a job body: if a client submits it,
/// the server computes the same result.
#[derive(Debug, Clone, PartialEq)]
pub struct Canonical {
    /// Whether it is a run or a study, and of which kind.
    pub kind: TaskKind,
    /// The canonical scenario or study.
    pub value: Value,
}

impl Canonical {
    /// The key of the result under this `numerics` version.
    pub fn key(&self, numerics: u32) -> Key {
        self.kind.key(numerics, &self.value)
    }

    /// Reads a stored task; `None` if the text is not one.
    pub fn in_stored(stored: &str) -> Option<Self> {
        let (kind, text) = asked_in(stored)?;
        Some(Self { kind, value: serde_json::from_str(text.get()).ok()? })
    }

    /// The key of a stored task for this version of the engine; `None` if the text is not a stored task.
    pub fn key_of(stored: &str) -> Option<Key> {
        Some(Self::in_stored(stored)?.key(ENGINE.numerics))
    }
}

impl Serialize for Canonical {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map([(self.kind.member(), &self.value)])
    }
}

/// The members of a stored task.
pub(super) struct StoredText<'a>(BTreeMap<&'a str, &'a RawValue>);

impl<'a> StoredText<'a> {
    /// Reads a stored task.
    pub(super) fn read(stored: &'a str) -> serde_json::Result<Self> {
        serde_json::from_str(stored).map(Self)
    }

    /// Whether a later version of the program stored this task. A task of version 1 has no version number.
    pub(super) fn is_later(&self) -> bool {
        let version = self.0.get("version").map(|text| text.get().parse());
        version.is_some_and(|version| version.map_or(true, |version: u32| version > STUDY_VERSION))
    }

    /// The kind of the task, and the stored scenario or study.
    pub(super) fn asked(&self) -> Option<(TaskKind, &'a RawValue)> {
        TaskKind::all().find_map(|kind| Some((kind, *self.0.get(kind.member())?)))
    }
}

/// The kind of a stored task, and the stored text of its scenario or study; `None` if the text is not a stored task.
pub fn asked_in(stored: &str) -> Option<(TaskKind, &RawValue)> {
    StoredText::read(stored).ok()?.asked()
}
