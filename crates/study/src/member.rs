//! The numbers of a scenario that a study varies.

use fretwork_engine::input::inputs::measure_at;
use fretwork_engine::input::quantity;
use fretwork_engine::{Dimension, unknown};
use serde_json::{Number, Value};

use fretwork_json::escaped;

/// Maximum number of pointers that an error text lists.
const LISTED: usize = 40;

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

    /// Finds a number in a scenario that has the form in which the client wrote it.
    ///
    /// # Errors
    /// A sentence for the client: the pointer names no number.
    pub fn find(scenario: &Value, pointer: &str) -> Result<Self, String> {
        let found = found(scenario, pointer)?;
        let dimension = measured(found, measure_at(pointer, scenario).dimension);
        let value = read(found, dimension)?;
        Ok(Self { pointer: pointer.to_owned(), dimension, value })
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

/// Reads a number in SI, or with a unit.
pub(crate) fn read(value: &Value, dimension: Dimension) -> Result<f64, String> {
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

/// The dimension of a value: a line contact can state forces and stiffnesses per length.
fn measured(value: &Value, total: Dimension) -> Dimension {
    let is = |it: &Dimension| value.as_str().is_some_and(|text| quantity::parse(text, *it).is_ok());
    total.per_length().filter(|per_length| !is(&total) && is(per_length)).unwrap_or(total)
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
    use fretwork_engine::input::Request;
    use fretwork_engine::input::fault::Fault;
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

    /// The fault of a text that is no quantity says which dimension the parser expects at a place.
    #[test]
    fn the_table_of_inputs_has_the_dimensions_of_the_parser() {
        let coefficient =
            json!({"over": "dissipated_energy", "at": [0, 1, 2], "values": [1e-14, 2e-14, 3e-14]});
        let run_in = json!({"run_in": {"cycles": 100, "from": 0.5, "to": 0.7}});
        let layered = json!({"bodies": [{"layers": [{"thickness": 1e-6, "coefficient": 1e-14}], "coefficient": 2e-14},
            {"coefficient": 1e-14}]});
        let line =
            json!({"shape": "punch", "flat_half_width": 1e-3, "edge_radius": 1e-2, "length": 0.01});
        let changes = [
            json!({}),
            json!({"friction": {"over": "cycles", "at": [0, 100, 200], "values": [0.5, 0.6, 0.7]}}),
            json!({"friction": run_in, "wear": {"coefficient": coefficient, "share": 0.3}}),
            json!({"wear": {"coefficient": {"run_in": {"cycles": 100, "from": 1e-14, "to": 2e-14}}}}),
            json!({"wear": {"coefficient": {"run_in": {"cycles": 100, "from": 1e-4, "to": 2e-4}}, "hardness": 1e9}}),
            json!({"wear": {"coefficient": 1e-4, "hardness": 1e9}}),
            json!({"wear": {"energy_coefficient": 1e-14}}),
            json!({"wear": layered}),
            json!({"profile": {"shape": "table", "radius": [0, 1e-6, 3e-6], "height": [0, 1e-9, 4e-9]}}),
            json!({"profile": {"shape": "crossed_cylinders", "radii": [0.01, 0.012]}}),
            json!({"profile": {"shape": "power", "exponent": 3, "height": 1e-6, "at_radius": 1e-3}}),
            json!({"profile": {"shape": "truncated_cone", "slope_angle": 0.01, "flat_radius": 1e-5}}),
            json!({"profile": line, "motion": {"amplitude": 1e-6, "reference_distance": 0.03, "rig_stiffness": 1e7}}),
            json!({"profile": line, "motion": {"amplitude": 1e-6, "loop_stiffness": 1e7}}),
            json!({"profile": line, "motion": {"sliding_amplitude": 1e-5}}),
            json!({"motion": {"loop_aperture": 1e-5}}),
            json!({"profile": line, "motion": {"blocks": [{"tangential_force": 10, "cycles": 5}]}}),
            json!({"motion": {"stick_ratio": 0.5}, "moduli": {"normal": 1e11, "tangential": 9e10}, "bodies": null}),
            json!({"motion": {"tangential_force": 10}, "cycles": {"normalized": [0.5, 2]}}),
            json!({"motion": {"blocks": [{"amplitude": 1e-6, "cycles": 10}]}, "cycles": [1, 5], "profiles_at": [5]}),
            json!({"motion": {"reversals": [1e-6, -2e-6]}, "cycles": {"from": 1, "to": 10, "count": 3}}),
            json!({"cycles": {"dissipated_energy": {"from": 1e-3, "to": 10, "count": 3}}, "until": {"wear_depth": 1e-6}}),
            json!({"load": {"indentation_depth": 1e-6}, "until": {"wear_volume": 1e-13}}),
            json!({"until": {"dissipated_energy": 1}, "model": {"method": "simplified", "xi": 0.8, "tolerance": 0.01}}),
        ];
        let mut known = 0;
        for change in changes {
            let mut scenario = scenario();
            scenario["bodies"][0]["yield_strength"] = json!(4e8);
            let own = scenario.as_object_mut().unwrap();
            own.extend(change.as_object().unwrap().clone());
            own.retain(|_, value| !value.is_null());
            let mut pointers = Vec::new();
            numbers(&scenario, Some(LISTED), &mut String::new(), &mut pointers);
            for pointer in pointers {
                let mut probe = scenario.clone();
                *probe.pointer_mut(&pointer).unwrap() = json!("?");
                let Fault { detail, .. } = Request::read(probe)
                    .expect_err(&pointer)
                    .0
                    .into_iter()
                    .find(|fault| fault.pointer == pointer)
                    .unwrap_or_else(|| panic!("{pointer} {scenario}"));
                let expects = |it: &Dimension| quantity::parse("?", *it).as_ref() == Err(&detail);
                let expected = Dimension::all().find(expects);
                let dimension = Member::find(&scenario, &pointer).unwrap().dimension;
                assert_eq!(dimension, expected.unwrap_or(Dimension::Number), "{pointer} {detail}");
                known += usize::from(expected.is_some_and(|it| it != Dimension::Number));
            }
        }
        assert!(known > 150, "{known}");
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
