//! Coefficients that may change during a run.
//!
//! A coefficient is a number, a table over the cycles or over the dissipated energy, or a run-in. Between the rows of
//! a table the coefficient is linear. Before the first row and after the last row it is constant. If an abscissa
//! stands twice, the coefficient has a step there.

use std::cmp::Ordering;
use std::marker::PhantomData;

use deserr::{Deserr, IntoValue, Map, Value};
use serde::Serialize;

use super::fault::{Faults, Pointer, Valid, pointer};
use super::fields::{BlockCycles, DissipatedEnergy, Instant, List, NumberOrText, Rounded, within};
use super::quantity::Dimension;
use crate::numeric::twelve_digits;

/// Maximum number of rows of a table of a coefficient.
pub const MAX_CHANGES: usize = 1000;

/// A coefficient in SI with 12 digits.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Changing {
    /// The coefficient does not change. A table of equal values has this form too.
    Constant(f64),
    /// The coefficient changes.
    Table(ChangeTable),
}

/// The rows of a coefficient that changes: at least two values differ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChangeTable {
    /// The quantity that the abscissae measure.
    pub over: Over,
    /// The abscissae, ascending. An abscissa that stands twice is a step. There is no step at 0.
    pub at: Vec<f64>,
    /// The value at each abscissa.
    pub values: Vec<f64>,
}

/// The quantity over which a coefficient changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr, Serialize)]
#[deserr(error = Faults)]
#[serde(rename_all = "snake_case")]
pub enum Over {
    /// The number of cycles.
    #[deserr(rename = "cycles")]
    Cycles,
    /// The energy in J that was dissipated since the start.
    #[deserr(rename = "dissipated_energy")]
    DissipatedEnergy,
}

impl Over {
    fn dimension(self) -> Dimension {
        match self {
            Self::Cycles => Dimension::Number,
            Self::DissipatedEnergy => Dimension::Energy,
        }
    }

    fn range(self) -> (f64, f64) {
        match self {
            Self::Cycles => Instant::RANGE,
            Self::DissipatedEnergy => (0.0, DissipatedEnergy::RANGE.1),
        }
    }
}

impl Changing {
    fn of(over: Over, at: Vec<f64>, values: Vec<f64>) -> Self {
        if values.windows(2).all(|pair| pair[0].total_cmp(&pair[1]).is_eq()) {
            return Self::Constant(values[0]);
        }
        Self::Table(ChangeTable { over, at, values })
    }

    /// The coefficient times `factor`, rounded to 12 digits.
    pub(crate) fn times(&self, factor: f64) -> Self {
        let product = |value: &f64| twelve_digits(value * factor);
        match self {
            Self::Constant(value) => Self::Constant(product(value)),
            Self::Table(ChangeTable { over, at, values }) => {
                Self::of(*over, at.clone(), values.iter().map(product).collect())
            }
        }
    }

    /// All values of the coefficient.
    pub fn values(&self) -> &[f64] {
        match self {
            Self::Constant(value) => std::slice::from_ref(value),
            Self::Table(table) => &table.values,
        }
    }
}

/// A coefficient of type `T`, whose unit is known without other members.
#[derive(Debug, Clone, PartialEq)]
pub struct Course<T>(pub Changing, PhantomData<T>);

impl<T: Deserr<Faults> + Into<f64>> Deserr<Faults> for Course<T> {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        let given = GivenChanging::<T>::deserialize_from_value(value, location)?;
        let course = given.resolve(location, |value, _| Ok(value.into()))?;
        Ok(Self(course, PhantomData))
    }
}

/// A coefficient as the client gives it. The unit of its values may depend on other members.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum GivenChanging<T> {
    Constant(T),
    RunIn(RunIn<T>),
    Table(GivenTable<T>),
}

/// A coefficient that goes from one value to another during the first cycles, and stays there.
#[derive(Debug, Clone, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub(super) struct RunIn<T> {
    cycles: Rounded<BlockCycles>,
    from: T,
    to: T,
}

#[derive(Debug, Clone, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub(super) struct GivenTable<T> {
    #[deserr(missing_field_error = without_abscissa)]
    over: Over,
    at: List<NumberOrText, 2, MAX_CHANGES>,
    values: List<T, 2, MAX_CHANGES>,
}

fn without_abscissa(field: &str, location: Pointer<'_>) -> Faults {
    let detail = "is missing. Enter \"cycles\" or \"dissipated_energy\"";
    Faults::at(location.push_key(field), detail)
}

impl<T: Deserr<Faults>> Deserr<Faults> for GivenChanging<T> {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        let mut map = match value {
            Value::Map(map) => map,
            Value::Sequence(_) => {
                let detail = "must not be a list. Enter a number, or a table such as {\"over\": \"cycles\", \"at\": \
                              [0, 1000], \"values\": [0.2, 0.8]}";
                return Err(Faults::at(location, detail));
            }
            _ => return T::deserialize_from_value(value, location).map(Self::Constant),
        };
        let others = map.len() > 1;
        if let Some(run_in) = map.remove("run_in") {
            let here = location.push_key("run_in");
            if others {
                let detail =
                    "cannot be combined with other members. Enter `run_in` alone, or a table";
                return Err(Faults::at(here, detail));
            }
            return Deserr::deserialize_from_value(run_in.into_value(), here).map(Self::RunIn);
        }
        Deserr::deserialize_from_value(Value::<V>::Map(map), location).map(Self::Table)
    }
}

impl<T> GivenChanging<T> {
    /// Reads all values with `read`, which gets each value and its location.
    pub(super) fn resolve(
        self,
        location: Pointer<'_>,
        read: impl Fn(T, Pointer<'_>) -> Valid<f64>,
    ) -> Valid<Changing> {
        let read = |value: T, here: Pointer<'_>| read(value, here).map(twelve_digits);
        match self {
            Self::Constant(value) => read(value, location).map(Changing::Constant),
            Self::RunIn(RunIn { cycles, from, to }) => {
                let here = location.push_key("run_in");
                let mut faults = Faults::default();
                let from = faults.keep("", read(from, here.push_key("from")));
                let to = faults.keep("", read(to, here.push_key("to")));
                faults.or(())?;
                let values = [from, to].into_iter().flatten().collect();
                Ok(Changing::of(Over::Cycles, vec![0.0, cycles.0], values))
            }
            Self::Table(GivenTable { over, at: List(at), values: List(values) }) => {
                let mut faults = Faults::default();
                let here = location.push_key("at");
                let abscissa = |(row, given): (usize, NumberOrText)| {
                    let here = here.push_index(row);
                    let x = given.read(over.dimension(), here)?;
                    within(x, over.range(), over.dimension().si(), here).map(twelve_digits)
                };
                let rows = at.len();
                let at = at.into_iter().enumerate().map(abscissa);
                let at: Vec<f64> = at.filter_map(|x| faults.keep("", x)).collect();
                if at.len() == rows {
                    ascending(&at, here, &mut faults);
                }
                let here = location.push_key("values");
                if values.len() != rows {
                    let detail =
                        format!("must have as many entries as `at`: {rows}, not {}", values.len());
                    faults.add(pointer(here), detail);
                }
                let values = values.into_iter().enumerate();
                let values = values.map(|(row, value)| read(value, here.push_index(row)));
                let values = values.filter_map(|value| faults.keep("", value)).collect();
                faults.or(())?;
                Ok(Changing::of(over, at, values))
            }
        }
    }
}

/// Checks that abscissae ascend. An abscissa may stand twice, but not if it is 0: the value before the step would have
/// no cycles.
fn ascending(at: &[f64], location: Pointer<'_>, faults: &mut Faults) {
    for (row, pair) in at.windows(2).enumerate() {
        let detail = match pair[0].total_cmp(&pair[1]) {
            Ordering::Greater => format!(
                "must not be less than the entry before it. Here {} follows {}. Sort the rows",
                pair[1], pair[0]
            ),
            Ordering::Equal if pair[0] == 0.0 => {
                "repeats 0, but a step at 0 has no cycles before it. Remove the first row"
                    .to_owned()
            }
            Ordering::Equal if row > 0 && at[row - 1].total_cmp(&pair[0]).is_eq() => {
                format!("stands more than twice ({}). Enter it once, or twice for a step", pair[1])
            }
            Ordering::Less | Ordering::Equal => continue,
        };
        faults.add(pointer(location.push_index(row + 1)), detail);
    }
}
