//! A stored result document, taken apart as far as its forms need.

use std::borrow::Cow;
use std::fmt;

use serde::de::{Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::value::RawValue;
use serde_json::{Number, Value};

use super::table::Table;
use super::units::{Unit, round};
use super::{Ask, DIGITS, Error, Part};

/// A JSON object whose members keep their order and their text.
pub struct Members<'a>(pub Vec<(Cow<'a, str>, &'a RawValue)>);

impl<'a> Members<'a> {
    /// The text of a member.
    pub fn get(&self, name: &str) -> Option<&'a RawValue> {
        self.0.iter().find(|(member, _)| member == name).map(|(_, text)| *text)
    }
}

impl<'de: 'a, 'a> Deserialize<'de> for Members<'a> {
    fn deserialize<D: Deserializer<'de>>(json: D) -> Result<Self, D::Error> {
        struct Collect;
        impl<'de> Visitor<'de> for Collect {
            type Value = Members<'de>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Members<'de>, A::Error> {
                let mut members = Vec::new();
                while let Some(member) = map.next_entry()? {
                    members.push(member);
                }
                Ok(Members(members))
            }
        }
        json.deserialize_map(Collect)
    }
}

/// Whose digits a document holds.
#[derive(Debug, Deserialize)]
pub struct Engine {
    name: String,
    numerics: u32,
}

impl fmt::Display for Engine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.name, self.numerics)
    }
}

/// The unit of every quantity, as the document has it and as it is told.
pub struct Units(Vec<(String, String, Option<Unit>)>);

impl Units {
    fn find(&self, name: &str) -> Option<&(String, String, Option<Unit>)> {
        self.0.iter().find(|(quantity, ..)| quantity == name)
    }

    /// The unit in which a quantity is told; none for plain numbers.
    pub fn of(&self, name: &str) -> Option<&str> {
        let (_, si, told) = self.find(name)?;
        let unit = told.map_or(si.as_str(), |unit| unit.name);
        Some(unit).filter(|unit| *unit != "1")
    }

    /// The name of a column with its unit, as tables without metadata have it.
    pub fn header<'n>(&self, name: &'n str) -> Cow<'n, str> {
        match self.of(name) {
            Some(unit) => format!("{name}[{unit}]").into(),
            None => name.into(),
        }
    }
}

impl Serialize for Units {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        let told = |unit: &Option<Unit>| unit.map(|unit| unit.name);
        json.collect_map(self.0.iter().map(|(name, si, unit)| (name, told(unit).unwrap_or(si))))
    }
}

/// How numbers are told.
pub struct Telling {
    /// The units.
    pub units: Units,
    digits: Option<u8>,
}

impl Telling {
    /// What becomes of the numbers of a quantity; none if nothing does.
    pub fn of(&self, name: &str) -> Option<impl Fn(f64) -> f64 + use<>> {
        self.with(name, self.digits)
    }

    /// The same without rounding, for what is rounded otherwise.
    pub fn unrounded(&self, name: &str) -> Option<impl Fn(f64) -> f64 + use<>> {
        self.with(name, None)
    }

    fn with(&self, name: &str, digits: Option<u8>) -> Option<impl Fn(f64) -> f64 + use<>> {
        let unit = self.units.find(name).and_then(|(_, _, unit)| *unit);
        (unit.is_some() || digits.is_some()).then_some(move |number| {
            let told = unit.map_or(number, |unit| unit.tell(number));
            digits.map_or(told, |digits| round(told, digits))
        })
    }

    /// Tells every number in `value`, which stands under `name`. Counts are not touched.
    fn tell(&self, name: &str, value: &mut Value) {
        match value {
            Value::Number(number) if number.is_f64() => {
                if let (Some(tell), Some(found)) = (self.of(name), number.as_f64())
                    && let Some(told) = Number::from_f64(tell(found))
                {
                    *number = told;
                }
            }
            Value::Array(items) => items.iter_mut().for_each(|item| self.tell(name, item)),
            // Relative errors, each under the name of what it is the error of.
            Value::Object(members) if name == "errors" => {
                members.values_mut().for_each(|value| self.tell("", value));
            }
            Value::Object(members) => {
                members.iter_mut().for_each(|(name, value)| self.tell(name, value));
            }
            _ => {}
        }
    }
}

/// A member of a document as it is told.
pub enum Told<'a> {
    /// As it is stored.
    Stored(&'a RawValue),
    /// Its numbers rounded or in other units.
    Changed(Value),
    /// The units themselves.
    Units(&'a Units),
    /// One of the tables, cut to what is wanted.
    Table(Table),
}

impl Serialize for Told<'_> {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Stored(text) => text.serialize(json),
            Self::Changed(value) => value.serialize(json),
            Self::Units(units) => units.serialize(json),
            Self::Table(table) => table.serialize(json),
        }
    }
}

/// A result document, and how it is to be told.
pub struct Document<'a> {
    /// The key.
    pub key: Cow<'a, str>,
    /// The engine, as a document names it.
    pub engine: &'a RawValue,
    /// The engine in one word.
    pub made_by: Engine,
    /// Units and digits.
    pub telling: Telling,
    /// Whether matrices are told by their differences.
    pub by_differences: bool,
    members: Members<'a>,
    ask: &'a Ask,
}

impl<'a> Document<'a> {
    /// Opens a stored document.
    pub fn open(stored: &'a [u8], ask: &'a Ask) -> Result<Self, Error> {
        let members: Members<'a> = serde_json::from_slice(stored)?;
        let part = |name: &str| {
            members.get(name).ok_or_else(|| serde_json::Error::custom(format!("no `{name}`")))
        };
        let units: Members<'_> = serde_json::from_str(part("units")?.get())?;
        let units = units.0.into_iter().map(|(name, text)| {
            let si: String = serde_json::from_str(text.get())?;
            let told = ask.engineering.then(|| Unit::engineering(&si)).flatten();
            Ok((name.into_owned(), si, told))
        });
        let units = Units(units.collect::<Result<_, serde_json::Error>>()?);
        let engine = part("engine")?;
        Ok(Self {
            key: serde_json::from_str::<String>(part("key")?.get())?.into(),
            engine,
            made_by: serde_json::from_str(engine.get())?,
            telling: Telling { units, digits: ask.digits },
            by_differences: false,
            members,
            ask,
        })
    }

    /// One of the tables as it is told, cut to what is wanted.
    pub fn table(&self, part: Part, ask: &Ask) -> Result<Table, Error> {
        let mut table = Table::read(part, self.members.get(part.name()), ask)?;
        table.differences = self.by_differences.then(|| ask.digits.unwrap_or(DIGITS).min(DIGITS));
        table.tell(&self.telling);
        Ok(table)
    }

    /// A member, its numbers as they are told; null if there is none.
    pub fn value(&self, name: &str) -> Result<Value, Error> {
        let Some(text) = self.members.get(name) else { return Ok(Value::Null) };
        let mut value = serde_json::from_str(text.get())?;
        if name != "scenario" {
            self.telling.tell(name, &mut value);
        }
        Ok(value)
    }

    /// All members as they are told, in their order.
    pub fn members(&self) -> Result<Vec<(&str, Told<'_>)>, Error> {
        let mut out = Vec::new();
        for (name, text) in &self.members.0 {
            out.push((&**name, self.told(name, text)?));
        }
        Ok(out)
    }

    fn told(&self, name: &str, text: &'a RawValue) -> Result<Told<'_>, Error> {
        if name == "units" {
            return Ok(Told::Units(&self.telling.units));
        }
        if let Some(part) = Part::TABLES.into_iter().find(|part| part.name() == name) {
            let ask = match part {
                // It is small, and others go by its instants.
                Part::History => Ask::default(),
                Part::Loops => Ask { points: None, ..self.ask.clone() },
                _ => self.ask.clone(),
            };
            return Ok(Told::Table(self.table(part, &ask)?));
        }
        // A scenario is what was asked, not what was found: sent again it must be the same.
        let found = !matches!(name, "key" | "engine" | "scenario" | "regime" | "warnings");
        let telling = &self.telling;
        if found && (self.ask.engineering || self.ask.digits.is_some()) {
            let mut value = serde_json::from_str(text.get())?;
            telling.tell(name, &mut value);
            return Ok(Told::Changed(value));
        }
        Ok(Told::Stored(text))
    }
}
