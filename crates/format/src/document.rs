//! A stored result document, parsed only as far as the formats need.

use std::fmt;

use serde::de::Error as _;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;
use serde_json::value::RawValue;

use super::{Error, Part, PartTable, Result, Units, View};
use fretwork_job::TaskKind;
use fretwork_json::Members;
use fretwork_study::Kind;

/// The engine that computed a result.
#[derive(Debug, Deserialize)]
pub struct DocumentEngine {
    name: String,
    /// The version of the numbers.
    pub numerics: u32,
}

impl fmt::Display for DocumentEngine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.name, self.numerics)
    }
}

/// A member of a document in the form in which it is written. It owns its data, so that the stored bytes can be dropped
/// before a slow client has read the answer.
#[derive(Serialize)]
#[serde(untagged)]
pub enum Member {
    /// The stored text.
    Stored(Box<RawValue>),
    /// A value with rounded or converted numbers.
    Converted(Value),
    /// The member `units`.
    Units(Units),
    /// A table, cut to the selection.
    Table(PartTable),
}

/// The members of a document in the form and the order in which they are written.
pub struct Object(pub Vec<(String, Member)>);

impl Serialize for Object {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        json.collect_map(self.0.iter().map(|(name, member)| (name, member)))
    }
}

/// What every format says about a result.
pub struct Head {
    /// The key of the result.
    pub key: String,
    /// The member `engine`.
    pub engine_text: Box<RawValue>,
    /// The member `engine`, parsed.
    pub engine: DocumentEngine,
    /// Units and rounding of all numbers.
    pub units: Units,
}

/// A result document and the view that a client requests of it.
pub struct Document<'a> {
    pub head: Head,
    members: Members<'a>,
    view: &'a View,
}

impl<'a> Document<'a> {
    /// Parses a stored document.
    pub fn open(stored: &'a [u8], view: &'a View) -> Result<Self> {
        let members: Members<'a> = serde_json::from_slice(stored)?;
        let member = |name: &str| {
            members
                .get(name)
                .ok_or_else(|| serde_json::Error::custom(format!("the document has no `{name}`")))
        };
        let engine_text = member("engine")?;
        let head = Head {
            key: serde_json::from_str(member("key")?.get())?,
            engine_text: engine_text.to_owned(),
            engine: serde_json::from_str(engine_text.get())?,
            units: Units::new(serde_json::from_str(member("units")?.get())?, view)?,
        };
        Ok(Self { head, members, view })
    }

    /// Checks that a result of this kind can have the part. The error says which parts it has.
    pub fn must_have(&self, part: Part) -> Result<()> {
        let has = match (self.kind(), part) {
            (TaskKind::Run, Part::Table) => "history, profiles and loops, because it is a run",
            (TaskKind::Study(_), Part::History | Part::Loops) => {
                "a table and figures, because it is a study"
            }
            (TaskKind::Study(kind), Part::Profiles)
                if self.members.get(part.as_str()).is_none() =>
            {
                if kind.keeps_profiles {
                    "a table and figures. Submit the study with `profiles` to have them"
                } else {
                    "a table and figures, because it is a study"
                }
            }
            _ => return Ok(()),
        };
        Err(Error::OtherKind(part, has))
    }

    /// Whether the result is a run or a study, and of which kind.
    pub fn kind(&self) -> TaskKind {
        let mut kinds = TaskKind::all().filter(|kind| *kind != TaskKind::Run);
        kinds.find(|kind| self.members.get(kind.member()).is_some()).unwrap_or(TaskKind::Run)
    }

    /// The rows of all points of a study, converted.
    pub fn rows(&self, kind: &Kind) -> Result<PartTable> {
        self.read(Part::Table, self.members.get(kind.rows), &View::default())
    }

    /// The rows of all points of a study in SI, unrounded.
    pub fn rows_in_si(&self, kind: &Kind) -> Result<PartTable> {
        let text = self.members.get(kind.rows);
        PartTable::read(Part::Table, text, &self.head.units, &View::default())
    }

    /// A table, cut to a selection and converted.
    pub fn table(&self, part: Part, selection: &View) -> Result<PartTable> {
        self.must_have(part)?;
        self.read(part, self.members.get(part.as_str()), selection)
    }

    fn read(&self, part: Part, text: Option<&RawValue>, selection: &View) -> Result<PartTable> {
        let mut table = PartTable::read(part, text, &self.head.units, selection)?;
        table.convert(&self.head.units);
        Ok(table)
    }

    /// The value of a member with converted numbers; null if the document does not have it.
    pub fn value(&self, name: &str) -> Result<Value> {
        let Some(text) = self.members.get(name) else { return Ok(Value::Null) };
        let mut value = serde_json::from_str(text.get())?;
        if TaskKind::of_member(name).is_none() {
            self.head.units.convert(name, &mut value);
        }
        Ok(value)
    }

    /// All members in the form in which they are written.
    pub fn object(&self) -> Result<Object> {
        let members = self.members.0.iter();
        let members = members.map(|(name, text)| Ok((name.to_string(), self.member(name, text)?)));
        Ok(Object(members.collect::<Result<_>>()?))
    }

    fn member(&self, name: &str, text: &RawValue) -> Result<Member> {
        if name == "units" {
            return Ok(Member::Units(self.head.units.clone()));
        }
        if matches!(self.kind(), TaskKind::Study(kind) if kind.rows == name) {
            return Ok(Member::Table(self.read(Part::Table, Some(text), self.view)?));
        }
        if let Some(part) = Part::TABLES.into_iter().find(|part| part.as_str() == name) {
            let selection = match part {
                // The whole history is written: it is short, and other members refer to its rows.
                Part::History => View::default(),
                Part::Loops => View { points: None, ..self.view.clone() },
                _ => self.view.clone(),
            };
            return Ok(Member::Table(self.table(part, &selection)?));
        }
        // The canonical scenario or study stays in SI and unrounded. If a client submits it again, it must have the
        // same key.
        let asked = TaskKind::of_member(name).is_some();
        let computed =
            !asked && !matches!(name, "key" | "engine" | "regime" | "warnings" | "counts");
        if computed && self.head.units.convert {
            return Ok(Member::Converted(self.value(name)?));
        }
        Ok(Member::Stored(text.to_owned()))
    }
}
