//! The output cycles of a request, and the output cycles with profiles.

use deserr::{Deserr, IntoValue, Map, Value, ValueKind};
use serde::Serialize;

use super::fault::{Faults, Pointer, Valid, wrong_kind};
use super::fields::{self, Count, DissipatedEnergy, Instant, MAX_CYCLES, Rounded};
use crate::numeric::twelve_digits;

/// The output cycles.
#[derive(Debug, Clone, PartialEq)]
pub struct Cycles {
    /// The numbers that define the output cycles, strictly ascending, rounded to 12 digits.
    pub instants: Vec<f64>,
    /// The measure of these numbers: cycles, cycles in units of N₀, or dissipated energies.
    pub measure: Measure,
}

/// The measure by which a request gives its output cycles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Measure {
    /// Numbers of cycles.
    Cycles,
    /// Numbers of cycles in units of N₀.
    Normalized,
    /// Dissipated energies in J. Only the run can find the cycles.
    DissipatedEnergy,
}

impl Cycles {
    /// The index of an output cycle among the rows of the history. Every history begins with the unworn state, at 0.
    /// `None` if there is no such output cycle.
    pub fn row(&self, number: f64) -> Option<usize> {
        let unworn = (self.instants[0] > 0.0).then_some(0.0);
        let number = twelve_digits(number);
        let mut rows = unworn.into_iter().chain(self.instants.iter().copied());
        rows.position(|known| known.total_cmp(&number).is_eq())
    }
}

impl Deserr<Faults> for Cycles {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        match value {
            Value::Map(mut map) if map.len() == 1 => {
                if let Some(inner) = map.remove("normalized") {
                    let here = location.push_key("normalized");
                    let instants = list::<Instant, V>(inner.into_value(), here)?;
                    return Ok(Self { instants, measure: Measure::Normalized });
                }
                if let Some(inner) = map.remove("dissipated_energy") {
                    let here = location.push_key("dissipated_energy");
                    let instants = list::<DissipatedEnergy, V>(inner.into_value(), here)?;
                    return Ok(Self { instants, measure: Measure::DissipatedEnergy });
                }
                let instants = list::<Instant, V>(Value::Map(map), location)?;
                Ok(Self { instants, measure: Measure::Cycles })
            }
            other => {
                let instants = list::<Instant, V>(other, location)?;
                Ok(Self { instants, measure: Measure::Cycles })
            }
        }
    }
}

/// Reads a list of items, or a range of them.
fn list<T: Deserr<Faults> + Into<f64>, V: IntoValue>(
    value: Value<V>,
    location: Pointer<'_>,
) -> Valid<Vec<f64>> {
    match value {
        list @ Value::Sequence(_) => {
            let list: Vec<Rounded<T>> =
                fields::list(list, location, 1..=MAX_CYCLES, "output cycles")?;
            let list: Vec<f64> = list.into_iter().map(|item| item.0).collect();
            match list.windows(2).position(|pair| pair[0] >= pair[1]) {
                Some(before) => Err(Faults::at(
                    location.push_index(before + 1),
                    format!(
                        "must increase: {} comes after {}. Sort the list, or remove repeated numbers \
                         (equal in 12 digits)",
                        list[before + 1],
                        list[before]
                    ),
                )),
                None => Ok(list),
            }
        }
        map @ Value::Map(_) => {
            EvenInstants::<T>::deserialize_from_value(map, location)?.instants(location)
        }
        other => Err(wrong_kind(other, &[ValueKind::Sequence, ValueKind::Map], location)),
    }
}

/// Evenly spaced output cycles.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields, where_predicate = T: Deserr<Faults>)]
struct EvenInstants<T> {
    from: T,
    to: T,
    count: Count<2, { MAX_CYCLES as u16 }>,
    #[deserr(default)]
    spacing: Spacing,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
enum Spacing {
    #[default]
    Log,
    Linear,
}

impl<T: Into<f64>> EvenInstants<T> {
    fn instants(self, location: Pointer<'_>) -> Valid<Vec<f64>> {
        let (from, to) = (self.from.into(), self.to.into());
        if self.spacing == Spacing::Log && from <= 0.0 {
            let detail = "must be greater than 0 for logarithmic spacing. Enter a larger number, or \
                          \"spacing\": \"linear\"";
            return Err(Faults::at(location.push_key("from"), detail));
        }
        let last = f64::from(self.count.0 - 1);
        let list: Vec<f64> = (0..self.count.0)
            .map(|i| {
                let share = f64::from(i) / last;
                let x = match self.spacing {
                    _ if i + 1 == self.count.0 => to,
                    Spacing::Log => from * libm::pow(to / from, share),
                    Spacing::Linear => from + (to - from) * share,
                };
                twelve_digits(x)
            })
            .collect();
        if list.windows(2).any(|pair| pair[0] >= pair[1]) {
            let detail = format!(
                "must be larger. Between `from` ({from}) and `to`, some of the output cycles are \
                 equal to 12 digits. Enter a larger `to`, or a smaller `count`"
            );
            return Err(Faults::at(location.push_key("to"), detail));
        }
        Ok(list)
    }
}

/// The output cycles with profiles.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum ProfilesAt {
    /// A word instead of a list.
    Word(ProfilesWord),
    /// A list of output cycles, in the unit of `cycles`.
    At(Vec<f64>),
}

/// A single word for a common choice of output cycles.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr, Serialize)]
#[deserr(error = Faults, rename_all = lowercase)]
#[serde(rename_all = "lowercase")]
pub enum ProfilesWord {
    /// All output cycles.
    All,
    /// Only the last output cycle.
    Last,
    /// No output cycle: the result has no profiles.
    None,
}

impl Deserr<Faults> for ProfilesAt {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        match value {
            sequence @ Value::Sequence(_) => list::<Instant, V>(sequence, location).map(Self::At),
            word @ Value::String(_) => {
                ProfilesWord::deserialize_from_value(word, location).map(Self::Word)
            }
            other => Err(wrong_kind(other, &[ValueKind::Sequence, ValueKind::String], location)),
        }
    }
}
