//! The numbers of a scenario that a study varies.

use std::collections::HashMap;

use fretwork_engine::request::Request;
use fretwork_engine::request::fault::{Fault, unknown};
use fretwork_engine::request::quantity::{self, Dimension};
use serde_json::{Number, Value};

use fretwork_json::escaped;

/// Maximum number of pointers that an error text lists.
const LISTED: usize = 40;
/// A text that is no quantity. If a scenario has it in place of a quantity, the fault says which dimension is expected
/// there.
const PROBE: &str = "?";

/// A number of a scenario, which a JSON pointer names.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// The pointer (RFC 6901), such as `/friction`.
    pub pointer: String,
    /// The dimension of the number.
    pub dimension: Dimension,
    /// Its value in the scenario, in SI.
    pub value: f64,
}

impl Member {
    /// The pointers of all numbers of a scenario that are not in lists.
    pub fn outside_lists(scenario: &Value) -> Vec<String> {
        let mut found = Vec::new();
        numbers(scenario, None, &mut String::new(), &mut found);
        found
    }

    /// Finds a number in a scenario. See [`Self::find_all`].
    ///
    /// # Errors
    /// A sentence for the client: the pointer names no number.
    pub fn find(scenario: &Value, pointer: &str) -> Result<Self, String> {
        Self::find_all(scenario, [pointer]).remove(0)
    }

    /// Finds numbers in a scenario that has the form in which the client wrote it.
    ///
    /// # Errors
    /// For each pointer that names no number, a sentence for the client.
    pub fn find_all<'a>(
        scenario: &Value,
        pointers: impl IntoIterator<Item = &'a str>,
    ) -> Vec<Result<Self, String>> {
        let found = |pointer| found(scenario, pointer).map(|found| (pointer, found));
        let found: Vec<Result<_, _>> = pointers.into_iter().map(found).collect();
        let mut dimensions = dimensions(scenario, found.iter().flatten().copied()).into_iter();
        let member = |found: Result<(&str, &Value), String>| {
            let (pointer, value) = found?;
            let dimension = dimensions.next().unwrap_or(Dimension::Number);
            let value = read(value, dimension)?;
            Ok(Self { pointer: pointer.to_owned(), dimension, value })
        };
        found.into_iter().map(member).collect()
    }

    /// Reads a value of this number: in SI, or with a unit.
    ///
    /// # Errors
    /// A sentence for the client: it is not a number, or has another unit.
    pub fn read(&self, value: &Value) -> Result<f64, String> {
        read(value, self.dimension)
    }

    /// Puts a value in SI into a scenario.
    ///
    /// # Panics
    /// The scenario is not the one in which the number was found.
    #[expect(clippy::expect_used, reason = "the pointer was found in this scenario")]
    pub fn put(&self, scenario: &mut Value, value: f64) {
        // Some members accept only integers. A value such as 64.0 is written as 64.
        let whole = value.fract() == 0.0 && value.abs() < 1e15;
        let number = if whole { Some((value as i64).into()) } else { Number::from_f64(value) };
        *scenario.pointer_mut(&self.pointer).expect("the scenario has this number") =
            number.map_or(Value::Null, Value::Number);
    }
}

fn is_number(value: &Value) -> bool {
    match value {
        Value::Number(_) => true,
        Value::String(text) => {
            text.starts_with(|first: char| first.is_ascii_digit() || "+-.".contains(first))
        }
        _ => false,
    }
}

fn read(value: &Value, dimension: Dimension) -> Result<f64, String> {
    match value {
        Value::Number(number) => number.as_f64().ok_or_else(|| format!("{number} is too large")),
        Value::String(text) => quantity::parse(text, dimension),
        _ => Err("must be a number, or a text with a unit".to_owned()),
    }
}

/// The value at this pointer, as the client wrote it: a number, or a text with a unit.
fn found<'a>(scenario: &'a Value, pointer: &str) -> Result<&'a Value, String> {
    let found = scenario.pointer(pointer).ok_or_else(|| {
        let mut known = Vec::new();
        numbers(scenario, Some(LISTED), &mut String::new(), &mut known);
        let known: Vec<&str> = known.iter().map(String::as_str).collect();
        unknown("number of the scenario", pointer, &known)
    })?;
    if is_number(found) {
        Ok(found)
    } else {
        let mut inner = Vec::new();
        numbers(found, Some(LISTED), &mut pointer.to_owned(), &mut inner);
        let number = inner.last().map_or("/friction", String::as_str);
        Err(format!(
            "`{pointer}` is not a number. Enter the pointer of a number in the scenario, such as `{number}`"
        ))
    }
}

/// The dimensions of numbers in a scenario. The unit of a text gives its dimension. To find those of the plain numbers,
/// the scenario is read with [`PROBE`] in place of each of them: the faults name the expected dimensions.
fn dimensions<'a>(
    scenario: &Value,
    found: impl Iterator<Item = (&'a str, &'a Value)>,
) -> Vec<Dimension> {
    let by_unit = |value: &Value| {
        let text = value.as_str().filter(|text| quantity::parse(text, Dimension::Number).is_err());
        text.map(|text| first(|it| quantity::parse(text, it).is_ok()))
    };
    let found: Vec<_> = found.map(|(pointer, value)| (pointer, by_unit(value))).collect();
    let plain = found.iter().filter(|(_, dimension)| dimension.is_none());
    let mut plain: Vec<&str> = plain.map(|(pointer, _)| *pointer).collect();
    let mut known = HashMap::new();
    // A fault can hide that of another place, for which the scenario is read again.
    while !plain.is_empty() {
        let before = plain.len();
        let faults = faults_with_probes(scenario, &plain);
        plain.retain(|pointer| {
            let fault = faults.iter().find(|fault| fault.pointer == **pointer);
            let Some(Fault { detail, .. }) = fault else { return true };
            let measured = first(|it| quantity::parse(PROBE, it).as_ref() == Err(detail));
            known.insert(*pointer, measured);
            false
        });
        if plain.len() == before {
            break;
        }
    }
    let dimension = |(pointer, by_unit): (&str, Option<Dimension>)| {
        by_unit.or(known.get(pointer).copied()).unwrap_or(Dimension::Number)
    };
    found.into_iter().map(dimension).collect()
}

/// The faults of a scenario with [`PROBE`] in these places.
fn faults_with_probes(scenario: &Value, places: &[&str]) -> Vec<Fault> {
    let mut changed = scenario.clone();
    for pointer in places {
        if let Some(place) = changed.pointer_mut(pointer) {
            *place = Value::from(PROBE);
        }
    }
    Request::read(changed).map_or_else(|faults| faults.0, |_| Vec::new())
}

fn first(is_measured: impl Fn(Dimension) -> bool) -> Dimension {
    Dimension::ALL.into_iter().find(|it| is_measured(*it)).unwrap_or(Dimension::Number)
}

/// Collects the pointers of the numbers in a document: those of the first `most` numbers, or of all that are not in
/// lists.
fn numbers(value: &Value, most: Option<usize>, pointer: &mut String, found: &mut Vec<String>) {
    let length = pointer.len();
    let mut enter = |name: &str, inner: &Value| {
        if most.is_none_or(|most| found.len() < most) {
            pointer.push('/');
            pointer.push_str(&escaped(name));
            numbers(inner, most, pointer, found);
            pointer.truncate(length);
        }
    };
    match value {
        Value::Object(members) => members.iter().for_each(|(name, inner)| enter(name, inner)),
        Value::Array(items) if most.is_some() => {
            items.iter().enumerate().for_each(|(place, inner)| enter(&place.to_string(), inner));
        }
        _ if is_number(value) => found.push(pointer.clone()),
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fretwork_engine::scenario;
    use serde_json::json;

    fn scenario() -> Value {
        json!({
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "bodies": [
                {"youngs_modulus": 205e9, "poisson_ratio": 0.3},
                {"youngs_modulus": "205 GPa", "poisson_ratio": 0.3}
            ],
            "friction": 0.7,
            "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
            "load": {"normal_force": "100 N", "held": "depth"},
            "motion": {"amplitude": 2e-6},
            "cycles": {"dissipated_energy": [1.0, "2 J"]},
            "model": {"points": 64},
        })
    }

    #[test]
    fn the_dimension_of_a_number_is_known_with_and_without_its_unit() {
        for (pointer, dimension, value) in [
            ("/profile/radius", Dimension::Length, 0.01),
            ("/bodies/0/youngs_modulus", Dimension::Stress, 205e9),
            ("/bodies/1/youngs_modulus", Dimension::Stress, 205e9),
            ("/bodies/0/poisson_ratio", Dimension::Number, 0.3),
            ("/friction", Dimension::Number, 0.7),
            ("/wear/coefficient", Dimension::WearCoefficient, 3.03e-14),
            ("/motion/amplitude", Dimension::Length, 2e-6),
            ("/cycles/dissipated_energy/0", Dimension::Energy, 1.0),
            ("/model/points", Dimension::Number, 64.0),
            ("/motion/reversals/4", Dimension::Length, 5e-6),
            ("/motion/blocks/4/amplitude", Dimension::Length, 0.0),
            ("/motion/blocks/4/cycles", Dimension::Number, 5.0),
            ("/profile/height/3", Dimension::Length, 9e-9),
            ("/profile/radius/0", Dimension::Length, 0.0),
            ("/profile/radius/3", Dimension::Length, 3e-6),
        ] {
            let mut scenario = scenario();
            if pointer.starts_with("/motion/reversals") {
                scenario["motion"] =
                    json!({"reversals": [1e-6, -2e-6, "3 um", -4e-6, 5e-6, -6e-6]});
            } else if pointer.starts_with("/motion/blocks") {
                let block = |place: u32| {
                    json!({"amplitude": if place == 4 { 0.0 } else { 1e-6 },
                    "cycles": place + 1})
                };
                scenario["motion"] = json!({"blocks": (0..6).map(block).collect::<Vec<_>>()});
            } else if pointer.starts_with("/profile/height/")
                || pointer.starts_with("/profile/radius/")
            {
                scenario["profile"] = json!({"shape": "table", "radius": [0.0, 1e-6, 2e-6, 3e-6, 4e-6, 5e-6],
                    "height": [0.0, 1e-9, 4e-9, 9e-9, 16e-9, 25e-9]});
            }
            let member = Member::find(&scenario, pointer).unwrap();
            assert_eq!(member.dimension, dimension, "{pointer}");
            let difference = (member.value - value).abs();
            assert!(difference <= 1e-14 * value, "{pointer}: {}", member.value);
        }
    }

    #[test]
    fn find_all_finds_the_same_numbers_as_find() {
        let mut scenario = scenario();
        let together = |scenario: &Value| {
            let mut pointers = Vec::new();
            numbers(scenario, Some(LISTED), &mut String::new(), &mut pointers);
            let all = Member::find_all(scenario, pointers.iter().map(String::as_str));
            for (pointer, member) in pointers.iter().zip(all) {
                assert_eq!(member, Member::find(scenario, pointer));
            }
            pointers.len()
        };
        assert_eq!(together(&scenario), 12);
        scenario["profile"] =
            json!({"shape": "table", "radius": [0, 1e-6, 3e-6], "height": [0, 1e-9, 4e-9]});
        scenario["motion"] = json!({"blocks": [{"amplitude": 1e-6, "cycles": 10},
            {"amplitude": "2 um", "cycles": 100}], "rig_stiffness": 1e7});
        // The fault of a share hides that of the coefficient.
        scenario["wear"] = json!({"coefficient": 3.03e-14, "share": 0.3});
        assert_eq!(together(&scenario), 22);
        let coefficient = Member::find(&scenario, "/wear/coefficient").unwrap();
        assert_eq!(coefficient.dimension, Dimension::WearCoefficient);
    }

    #[test]
    fn a_value_takes_the_place_of_the_number() {
        let mut changed = scenario();
        let radius = Member::find(&changed, "/profile/radius").unwrap();
        radius.put(&mut changed, radius.read(&json!("20 mm")).unwrap());
        assert_eq!(changed["profile"]["radius"], json!(0.02));
        let points = Member::find(&changed, "/model/points").unwrap();
        points.put(&mut changed, 128.0);
        assert_eq!(changed["model"]["points"], json!(128));
        assert!(scenario::prepare(changed, "").is_ok());
    }

    #[test]
    fn a_fault_names_a_similar_number_or_the_expected_dimension() {
        let refused = |pointer| Member::find(&scenario(), pointer).unwrap_err();
        assert!(refused("/frction").contains("Did you mean `/friction`?"));
        assert!(refused("/profile/shape").contains("is not a number"));
        assert!(refused("/profile").ends_with("such as `/profile/radius`"));
        let radius = Member::find(&scenario(), "/profile/radius").unwrap();
        assert!(radius.read(&json!("20 GPa")).unwrap_err().contains("a length is needed"));
    }
}
