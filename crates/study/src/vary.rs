//! What a study varies, as its client writes it: a number of the scenario, and a list of values, a range or a
//! distribution.

use std::collections::HashSet;

use deserr::Deserr;
use fretwork_engine::{Dimension, Fault, Faults, Given, Valid};
use serde_json::Value;

use super::member::Member;
use super::stats::distribution::Distribution;
use fretwork_json::{Whole, typed};

/// Maximum number of values of one member, listed or in a range.
const MAX_VALUES: u64 = 100_000;
/// Maximum number of radii at which a study keeps profiles.
pub const MAX_RADII: u64 = 1000;
/// Maximum number of members that a study varies.
const MAX_MEMBERS: usize = 100;
/// Maximum number of values of all members together.
const MAX_LISTED: u64 = 1 << 20;
/// The fault of an entry that does not say which values the number takes.
pub const NO_VALUES: &str = "must have either `values`, or `from` and `to`, or a `distribution`";

/// A number of the scenario, and how it varies.
#[derive(Debug)]
pub struct Varied {
    /// The number.
    pub member: Member,
    /// How the number varies.
    pub values: Values,
}

/// How a number varies.
#[derive(Debug)]
pub enum Values {
    /// The entry gives no values. The study uses the value in the scenario.
    Base,
    /// These values, in SI.
    List(Vec<f64>),
    /// All values from the first to the second one, without a count.
    Range(f64, f64, Spacing),
    /// A distribution of values in SI.
    Distribution(Distribution),
}

/// An entry of `vary`.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct Entry {
    #[deserr(rename = "pointer")]
    _pointer: String,
    #[deserr(default)]
    values: Given<Vec<Value>>,
    #[deserr(default)]
    from: Given<Value>,
    #[deserr(default)]
    to: Given<Value>,
    #[deserr(default)]
    count: Given<Whole<2, MAX_VALUES>>,
    #[deserr(default)]
    spacing: Given<Spacing>,
    #[deserr(default)]
    distribution: Given<Value>,
}

/// A range of quantities that a study does not vary.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct Range {
    from: Value,
    to: Value,
    count: Whole<2, MAX_RADII>,
    #[deserr(default)]
    spacing: Given<Spacing>,
}

/// How the values of a range are spaced.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserr)]
#[deserr(error = Faults, rename_all = lowercase)]
pub enum Spacing {
    /// The differences of neighbours are equal.
    #[default]
    Linear,
    /// The ratios of neighbours are equal.
    #[deserr(rename = "log")]
    Logarithmic,
}

/// Reads the list `vary` of a study of this scenario.
///
/// # Errors
/// The faults of all entries, with pointers such as `/0/from`.
pub fn list(entries: &[Value], scenario: &Value) -> Valid<Vec<Varied>> {
    if entries.is_empty() || entries.len() > MAX_MEMBERS {
        let detail =
            format!("must list 1 to {MAX_MEMBERS} numbers of the scenario, not {}", entries.len());
        return Err(Faults::one("", detail));
    }
    let listed: u64 = entries.iter().map(values_in).fold(0, u64::saturating_add);
    if listed > MAX_LISTED {
        let detail = format!(
            "has {listed} values in all, but at most {MAX_LISTED} are accepted. Shorten `values`, or enter a \
             smaller `count`"
        );
        return Err(Faults::one("", detail));
    }
    let pointers = entries.iter().map(|entry| entry["pointer"].as_str());
    let members = pointers.clone().map(|it| Member::find(scenario, it.unwrap_or_default()));
    let mut distinct = HashSet::new();
    let is_new = pointers.map(|pointer| pointer.is_none_or(|pointer| distinct.insert(pointer)));
    Faults::list(entries.iter().zip(members).zip(is_new).map(|((entry, member), is_new)| {
        if is_new {
            Varied::read(entry.clone(), member)
        } else {
            Err(Faults::one("/pointer", "is listed twice"))
        }
    }))
}

impl Values {
    /// The distribution from which a study draws values. A range gives a uniform or log-uniform
    /// distribution.
    ///
    /// # Errors
    /// A sentence for the client: values cannot be drawn from a list or from the scenario.
    pub fn drawn(self) -> Result<Distribution, String> {
        let (from, to, spacing) = match self {
            Self::Distribution(distribution) => return Ok(distribution),
            Self::Range(from, to, spacing) => (from, to, spacing),
            Self::List(_) => {
                let detail = "lists values, but this study draws them. Enter a range (`from` and `to`, without \
                              `count`) or a `distribution`";
                return Err(detail.to_owned());
            }
            Self::Base => return Err(NO_VALUES.to_owned()),
        };
        let make = match spacing {
            Spacing::Linear => Distribution::uniform,
            Spacing::Logarithmic => Distribution::log_uniform,
        };
        make(from.min(to), from.max(to)).map_err(|fault| {
            format!(
                "is not a range, with `low` and `high` the smaller and the larger of `from` and `to`: `{}` {}",
                &fault.pointer[1..],
                fault.detail
            )
        })
    }
}

/// The number of values that an entry of `vary` has: the length of `values`, or `count`.
fn values_in(entry: &Value) -> u64 {
    let count = entry.get("count").and_then(Value::as_u64);
    let listed = entry.get("values").and_then(Value::as_array).map(|values| values.len() as u64);
    count.unwrap_or(0).saturating_add(listed.unwrap_or(0))
}

impl Varied {
    /// Reads an entry of `vary` about this number of the scenario.
    ///
    /// # Errors
    /// The faults of the entry, with pointers relative to it.
    pub fn read(entry: Value, member: Result<Member, String>) -> Valid<Self> {
        let entry: Entry = typed(entry)?;
        let member = member.map_err(|detail| Faults::one("/pointer", detail))?;
        let values = entry.values(&member)?;
        Ok(Self { member, values })
    }
}

impl Entry {
    fn values(self, member: &Member) -> Valid<Values> {
        let is_range = self.from.0.is_some() || self.to.0.is_some();
        let given = [self.values.0.is_some(), is_range, self.distribution.0.is_some()];
        if given.into_iter().filter(|given| *given).count() > 1 {
            return Err(Faults::one("", NO_VALUES));
        }
        if !is_range && (self.count.0.is_some() || self.spacing.0.is_some()) {
            return Err(Faults::one(
                "",
                "has `count` or `spacing`, which belong to `from` and `to`. Enter `from` and `to`, or remove `count` \
                 and `spacing`",
            ));
        }
        if let Some(list) = self.values.0 {
            let list = list_of(&list, member).map(Values::List);
            return list.map_err(|faults| faults.below("/values"));
        }
        if let Some(distribution) = self.distribution.0 {
            let read = distribution_of(&distribution, member).map(Values::Distribution);
            return read.map_err(|faults| faults.below("/distribution"));
        }
        if !is_range {
            return Ok(Values::Base);
        }
        let end = |name: &str, value: Option<Value>| match value {
            None => Err(Faults::one(&format!("/{name}"), format!("is missing. Enter `{name}`"))),
            Some(value) => end_of(name, &value, member),
        };
        let (from, to) = (end("from", self.from.0)?, end("to", self.to.0)?);
        let spacing = self.spacing.0.unwrap_or_default();
        match self.count.0 {
            None => Ok(Values::Range(from, to, spacing)),
            Some(Whole(count)) => range(from, to, count as usize, spacing).map(Values::List),
        }
    }
}

/// Reads the member `name` of a range.
///
/// # Errors
/// It is not a number, or has another unit.
pub fn end_of(name: &str, value: &Value, member: &Member) -> Valid<f64> {
    member.read(value).map_err(|detail| Faults::one(&format!("/{name}"), detail))
}

/// Reads quantities that a study does not vary: a list, or a range.
///
/// # Errors
/// All faults, with pointers such as `/0` or `/from`.
pub fn list_or_range(given: Value, dimension: Dimension) -> Valid<Vec<f64>> {
    let member = Member { pointer: String::new(), dimension, value: 0.0 };
    if let Value::Array(list) = given {
        return list_of(&list, &member);
    }
    let Range { from, to, count: Whole(count), spacing } = typed(given)?;
    let (from, to) = (end_of("from", &from, &member)?, end_of("to", &to, &member)?);
    range(from, to, count as usize, spacing.0.unwrap_or_default())
}

/// The values of a range: `count` values from `from` to `to`, both included. `to` may be less than `from`. `count` is
/// at least 2.
///
/// # Errors
/// The fault at `/from` or `/to`.
fn range(from: f64, to: f64, count: usize, spacing: Spacing) -> Valid<Vec<f64>> {
    let wrong = |member: &str, detail: &str| Err(Faults::one(&format!("/{member}"), detail));
    for (member, end) in [("from", from), ("to", to)] {
        if !end.is_finite() {
            return wrong(member, "must be a finite number");
        }
        if spacing == Spacing::Logarithmic && end <= 0.0 {
            return wrong(member, "must be greater than 0. Otherwise use linear spacing");
        }
    }
    if !(to - from).is_finite() {
        return wrong("to", "is too far from `from`. Enter a narrower range");
    }
    let last = count - 1;
    Ok((0..count)
        .map(|i| {
            let share = i as f64 / last as f64;
            match spacing {
                _ if i == 0 => from,
                _ if i == last => to,
                Spacing::Linear => from + (to - from) * share,
                Spacing::Logarithmic => {
                    libm::exp(libm::log(from) * (1.0 - share) + libm::log(to) * share)
                }
            }
        })
        .collect())
}

fn list_of(list: &[Value], member: &Member) -> Valid<Vec<f64>> {
    if list.is_empty() || list.len() as u64 > MAX_VALUES {
        let detail = format!("must list 1 to {MAX_VALUES} values, not {}", list.len());
        return Err(Faults::one("", detail));
    }
    Faults::list(list.iter().map(|value| member.read(value)))
}

/// A form in which clients write a distribution: its name, its parameters, and the function that builds it from them.
type DistributionForm =
    (&'static str, &'static [&'static str], fn(&[f64]) -> Result<Distribution, Fault>);

/// All forms. `lognormal` has two: the first one applies if its first parameter is given.
const FORMS: [DistributionForm; 6] = [
    ("uniform", &["low", "high"], |p| Distribution::uniform(p[0], p[1])),
    ("log_uniform", &["low", "high"], |p| Distribution::log_uniform(p[0], p[1])),
    ("normal", &["mean", "standard_deviation"], |p| Distribution::normal(p[0], p[1])),
    ("lognormal", &["mean", "standard_deviation"], |p| {
        Distribution::lognormal_with_mean(p[0], p[1])
    }),
    ("lognormal", &["median", "factor"], |p| Distribution::lognormal(p[0], p[1])),
    ("triangular", &["low", "mode", "high"], |p| Distribution::triangular(p[0], p[1], p[2])),
];
/// The parameter that has no unit.
const FACTOR: &str = "factor";
const NAMES: &str = "uniform, log_uniform, normal, lognormal, triangular";

/// Reads a distribution of values of this number.
///
/// # Errors
/// All faults, with pointers such as `/normal/mean`.
pub fn distribution_of(value: &Value, member: &Member) -> Valid<Distribution> {
    let one = value.as_object().filter(|members| members.len() == 1);
    let pair = one.and_then(|members| members.iter().next());
    let Some((name, Some(given))) = pair.map(|(name, inner)| (name, inner.as_object())) else {
        let detail = format!(
            "must be an object with one of {NAMES}, such as {{\"uniform\": {{\"low\": …, \"high\": …}}}}"
        );
        return Err(Faults::one("", detail));
    };
    let fault =
        |parameter: &str, detail: &str| Faults::one(&format!("/{name}/{parameter}"), detail);
    let forms = || FORMS.iter().filter(|(known, ..)| known == name);
    let form = forms().find(|(_, parameters, _)| given.contains_key(parameters[0]));
    let Some((_, parameters, make)) = form.or(forms().next_back()) else {
        let detail = format!("is not a distribution. Accepted distributions: {NAMES}");
        return Err(Faults::one(&format!("/{name}"), detail));
    };
    if let Some(other) = given.keys().find(|name| !parameters.contains(&name.as_str())) {
        let accepted = parameters.join(", ");
        return Err(fault(
            other,
            &format!("is not a parameter of this distribution. Accepted parameters: {accepted}"),
        ));
    }
    let read = |parameter: &&str| {
        let value = given.get(*parameter).ok_or_else(|| format!("is missing. Enter `{parameter}`"));
        let read = value.and_then(|value| match value.as_f64() {
            None if *parameter == FACTOR => Err("must be a number".to_owned()),
            Some(factor) if *parameter == FACTOR => Ok(factor),
            _ => member.read(value),
        });
        read.map_err(|detail| fault(parameter, &detail))
    };
    let values: Vec<f64> = parameters.iter().map(read).collect::<Result<_, _>>()?;
    make(&values).map_err(|wrong| fault(&wrong.pointer[1..], &wrong.detail))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_contains_both_ends() {
        let linear = range(1.0, 2.0, 5, Spacing::Linear).unwrap();
        assert_eq!(linear, [1.0, 1.25, 1.5, 1.75, 2.0]);
        let falling = range(1e-3, 1e-6, 4, Spacing::Logarithmic).unwrap();
        for (value, expected) in falling.iter().zip([1e-3, 1e-4, 1e-5, 1e-6]) {
            assert!((value / expected - 1.0).abs() < 1e-14);
        }
        assert_eq!((falling[0], falling[3]), (1e-3, 1e-6));
    }

    #[test]
    fn the_fault_of_a_wrong_range_names_its_end() {
        for (from, to, spacing, pointer, words) in [
            (f64::NAN, 1.0, Spacing::Linear, "/from", "finite"),
            (-1.0, 1.0, Spacing::Logarithmic, "/from", "linear"),
            (-f64::MAX, f64::MAX, Spacing::Linear, "/to", "narrower"),
        ] {
            let fault = &range(from, to, 2, spacing).unwrap_err().0[0];
            assert_eq!(fault.pointer, pointer, "{}", fault.detail);
            assert!(fault.detail.contains(words), "{}", fault.detail);
        }
    }
}
