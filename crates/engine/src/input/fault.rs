//! Faults of a request. Each has a JSON pointer and says what to change.
//!
//! `deserr` reports its errors to [`Faults`], which turns them into sentences and collects them.

use std::ops::ControlFlow;

use deserr::{
    DeserializeError, ErrorKind, IntoValue, MergeWithError, Sequence, Value, ValueKind,
    ValuePointerRef, take_cf_content,
};
use serde::Serialize;

/// Maximum number of listed faults. The other faults are only counted.
const MAX_FAULTS: usize = 100;

/// The place of a value in a request.
pub type Pointer<'a> = ValuePointerRef<'a>;

/// A value without faults, or its faults.
pub type Valid<T> = Result<T, Faults>;

/// One fault of a request.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Fault {
    /// JSON pointer (RFC 6901) to the faulty member of the request.
    pub pointer: String,
    /// What is wrong and what to change.
    pub detail: String,
}

/// All faults of a request.
#[derive(Debug, Clone, Default, PartialEq, Eq, thiserror::Error)]
#[error("{} fault(s) in the request", .0.len())]
pub struct Faults(pub Vec<Fault>);

impl Faults {
    /// One fault.
    pub fn one(pointer: &str, detail: impl Into<String>) -> Self {
        Self(vec![Fault { pointer: pointer.to_owned(), detail: detail.into() }])
    }

    /// One fault at a location.
    pub fn at(location: Pointer<'_>, detail: impl Into<String>) -> Self {
        Self(vec![Fault { pointer: pointer(location), detail: detail.into() }])
    }

    /// Adds a fault.
    pub fn add(&mut self, pointer: impl Into<String>, detail: impl Into<String>) {
        self.0.push(Fault { pointer: pointer.into(), detail: detail.into() });
    }

    /// Returns the value that was read at `place`. If it was not read, adds its faults and returns `None`.
    pub fn keep<T>(&mut self, place: &str, read: Result<T, impl Into<Self>>) -> Option<T> {
        read.map_err(|faults| self.0.extend(faults.into().below(place).0)).ok()
    }

    /// Returns the items that were read at the places `/0`, `/1` and so on.
    ///
    /// # Errors
    /// The faults of all items.
    pub fn list<T, E: Into<Self>>(
        items: impl IntoIterator<Item = Result<T, E>>,
    ) -> Result<Vec<T>, Self> {
        let mut faults = Self::default();
        let items = items.into_iter().enumerate();
        let list = items.filter_map(|(at, item)| faults.keep(&format!("/{at}"), item)).collect();
        faults.or(list)
    }

    /// Returns `value` if there are no faults.
    ///
    /// # Errors
    /// The collected faults.
    pub fn or<T>(self, value: T) -> Result<T, Self> {
        if self.0.is_empty() { Ok(value) } else { Err(self) }
    }

    /// Keeps the first `MAX_FAULTS` faults, and adds an entry with the number of the other faults.
    #[must_use]
    pub fn capped(mut self) -> Self {
        if self.0.len() > MAX_FAULTS {
            let more = self.0.len() - MAX_FAULTS;
            self.0.truncate(MAX_FAULTS);
            let detail = format!(
                "has at least {more} more faults, which are not listed. Correct the listed faults first"
            );
            self.0.push(Fault { pointer: String::new(), detail });
        }
        self
    }

    /// Inserts `prefix` before the pointer of every fault.
    #[must_use]
    pub fn below(mut self, prefix: &str) -> Self {
        for fault in &mut self.0 {
            fault.pointer.insert_str(0, prefix);
        }
        self
    }
}

/// Makes a fault from a sentence about the place that was read.
impl From<String> for Faults {
    fn from(detail: String) -> Self {
        Self::one("", detail)
    }
}

impl MergeWithError<Faults> for Faults {
    fn merge(earlier: Option<Self>, later: Faults, _: Pointer<'_>) -> ControlFlow<Self, Self> {
        let mut all = earlier.unwrap_or(Self(Vec::new()));
        all.0.extend(later.0);
        if all.0.len() > MAX_FAULTS {
            return ControlFlow::Break(all.capped());
        }
        ControlFlow::Continue(all)
    }
}

impl DeserializeError for Faults {
    fn error<V: IntoValue>(
        earlier: Option<Self>,
        error: ErrorKind<'_, V>,
        location: Pointer<'_>,
    ) -> ControlFlow<Self, Self> {
        let fault = match error {
            ErrorKind::IncorrectValueKind { actual, accepted } => {
                let advice = match accepted {
                    [ValueKind::Sequence, ..] => ". Enter a list in brackets: […]",
                    [ValueKind::Map] => ". Enter its members in braces: {…}",
                    _ => "",
                };
                let accepted: Vec<_> = accepted.iter().map(|kind| kind_name(*kind)).collect();
                let (accepted, actual) = (accepted.join(" or "), kind_name(actual.kind()));
                Self::at(location, format!("must be {accepted}, not {actual}{advice}"))
            }
            ErrorKind::MissingField { field } => {
                Self::at(location.push_key(field), format!("is missing. Enter `{field}`"))
            }
            ErrorKind::UnknownKey { key, accepted } => {
                Self::at(location.push_key(key), unknown("member", key, accepted))
            }
            ErrorKind::UnknownValue { value, accepted } => {
                Self::at(location, unknown("value", value, accepted))
            }
            ErrorKind::BadSequenceLen { actual, expected } => {
                Self::at(location, format!("must have {expected} entries, not {}", actual.len()))
            }
            ErrorKind::Unexpected { msg } => Self::at(location, msg),
        };
        Self::merge(earlier, fault, location)
    }
}

/// The fault of a value whose JSON type is wrong.
pub(crate) fn wrong_kind<V: IntoValue>(
    actual: Value<V>,
    accepted: &[ValueKind],
    location: Pointer<'_>,
) -> Faults {
    let error = ErrorKind::IncorrectValueKind { actual, accepted };
    take_cf_content(Faults::error(None, error, location))
}

pub(crate) fn pointer(location: Pointer<'_>) -> String {
    match location {
        ValuePointerRef::Origin => String::new(),
        ValuePointerRef::Key { key, prev } => {
            format!("{}/{}", pointer(*prev), key.replace('~', "~0").replace('/', "~1"))
        }
        ValuePointerRef::Index { index, prev } => format!("{}/{index}", pointer(*prev)),
    }
}

fn kind_name(kind: ValueKind) -> &'static str {
    match kind {
        ValueKind::Null => "null",
        ValueKind::Boolean => "a boolean",
        ValueKind::Integer | ValueKind::NegativeInteger | ValueKind::Float => "a number",
        ValueKind::String => "a string",
        ValueKind::Sequence => "a list",
        ValueKind::Map => "an object",
    }
}

/// What users call members and values, their names here, and what to note.
const OTHER_NAMES: [(&str, &str, &str); 10] = [
    ("ball", "sphere", ""),
    ("hertz", "paraboloid", ""),
    ("parabola", "paraboloid", ""),
    ("stroke", "amplitude", " It is half of the stroke from one end to the other."),
    ("diameter", "radius", " It is half of the diameter."),
    ("displacement_amplitude", "amplitude", ""),
    ("mu", "friction", ""),
    ("force", "normal_force", ""),
    ("e", "youngs_modulus", ""),
    ("nu", "poisson_ratio", ""),
];

/// The error text for an unknown name. It contains the most similar accepted name and all accepted names.
pub fn unknown(what: &str, given: &str, accepted: &[&str]) -> String {
    let lower = given.to_lowercase();
    let is_meant = |name: &str| lower == name || name.len() > 4 && lower.contains(name);
    let other = OTHER_NAMES.iter().find(|it| is_meant(it.0) && accepted.contains(&it.1));
    let similar = || {
        accepted
            .iter()
            .map(|known| (strsim::jaro_winkler(given, known), known))
            .filter(|(likeness, _)| *likeness > 0.8)
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map_or(String::new(), |(_, known)| format!(" Did you mean `{known}`?"))
    };
    let near = other.map_or_else(similar, |(_, known, note)| format!(" Enter `{known}`.{note}"));
    // Limit the length, because a name in a request can be megabytes long.
    let given: String = given.chars().take(60).collect();
    format!("unknown {what} `{given}`.{near} Accepted here: {}.", accepted.join(", "))
}
