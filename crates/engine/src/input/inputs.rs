//! All inputs of a scenario and all forms of its objects, their names, and what their numbers measure.

use serde_json::Value;

use super::rows::{Form, Input, Measure, ObjectForm, PLAIN};
use super::{bodies, held, indenter, wear};

/// All inputs. The first that applies counts.
pub fn inputs() -> impl Iterator<Item = &'static Input> {
    [indenter::INPUTS, bodies::INPUTS, wear::INPUTS, held::INPUTS, super::INPUTS]
        .into_iter()
        .flatten()
}

/// All forms. Where an object has several forms, a request has one of them.
pub fn forms() -> impl Iterator<Item = &'static ObjectForm> {
    [indenter::FORMS, bodies::FORMS, wear::FORMS, held::FORMS, super::FORMS].into_iter().flatten()
}

/// The names of values whose names are not their words.
pub const VALUES: &[(&str, &str)] = &[
    ("power", "Power law"),
    ("table", "Measured profile"),
    ("exact", "Exact method"),
    ("simplified", "Simplified rule"),
    ("log", "Logarithmic"),
];

/// The input at a pointer of a scenario, which is divided into its parts.
fn input_at(parts: &[&str], scenario: &Value) -> Option<&'static Input> {
    inputs().find(|input| {
        let (own, condition) = input.pointer.split_once('?').unwrap_or((input.pointer, ""));
        let is_own = |(own, part): (&str, &&str)| own == *part || own == "#" && is_place(part);
        own.split('/').count() == parts.len()
            && own.split('/').zip(parts).all(is_own)
            && (condition.is_empty() || holds(condition, parts, scenario))
    })
}

fn is_place(part: &str) -> bool {
    part.parse::<usize>().is_ok()
}

/// Whether a scenario has the member of a condition.
fn holds(condition: &str, parts: &[&str], scenario: &Value) -> bool {
    let (member, value) = condition.split_once('=').unwrap_or((condition, ""));
    let pointer = if member.starts_with('/') {
        member.to_owned()
    } else {
        format!("{}/{member}", parts[..parts.len() - 1].join("/"))
    };
    scenario.pointer(&pointer).is_some_and(|found| value.is_empty() || found == value)
}

/// The name and the symbol of the input at a pointer of a scenario. Without a name, it is the last member in words.
pub fn named(pointer: &str, scenario: &Value) -> (String, &'static str) {
    let parts: Vec<&str> = pointer.split('/').collect();
    let Some(input) = input_at(&parts, scenario) else {
        return (parts[parts.len() - 1].replace('_', " "), "");
    };
    let at = |pointer, place| scenario.pointer(pointer).map(|_| place);
    let rig = at("/motion/rig_stiffness", " at the actuator");
    let place = rig.or_else(|| at("/profile/length", " at the reference")).unwrap_or_default();
    let places = parts.iter().filter_map(|part| part.parse::<usize>().ok());
    let words = places.fold(input.words.to_owned(), |words, place| {
        words.replacen('#', &(place + 1).to_string(), 1)
    });
    (words.replace('@', place), input.symbol)
}

/// What the number at a pointer of a scenario measures. The numbers of a list or range measure what it measures.
pub fn measure_at(pointer: &str, scenario: &Value) -> Measure {
    let parts: Vec<&str> = pointer.split('/').collect();
    let own = input_at(&parts, scenario);
    let list =
        parts.split_last().filter(|(last, _)| is_place(last) || ["from", "to"].contains(last));
    let input = own.or_else(|| list.and_then(|(_, list)| input_at(list, scenario)));
    input.map_or(PLAIN, |input| input.measure)
}

impl ObjectForm {
    /// The example.
    ///
    /// # Panics
    /// It is not JSON; a test reads all examples.
    #[expect(clippy::expect_used, reason = "a test reads all examples")]
    pub fn example(&self) -> Option<Value> {
        let example = Some(self.example).filter(|example| !example.is_empty());
        example.map(|example| serde_json::from_str(example).expect("valid JSON"))
    }

    /// The names of all members with the values that they must have.
    pub fn members(&self) -> impl Iterator<Item = (&'static str, Option<&'static str>)> {
        let all = self.required.iter().chain(self.optional);
        all.map(|member| {
            member.split_once('=').map_or((*member, None), |(name, value)| (name, Some(value)))
        })
    }

    /// The input that a member of this object is.
    pub fn input(&self, member: &str) -> Option<&'static Input> {
        let pointer = format!("{}/{member}", self.pointer);
        let has = |sibling: &str| self.members().any(|(name, _)| name == sibling);
        inputs().find(|input| {
            let (own, condition) = input.pointer.split_once('?').unwrap_or((input.pointer, ""));
            own == pointer
                && !matches!(input.form, Form::Part)
                && (condition.is_empty() || has(condition))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn inputs_have_the_names_of_their_places() {
        let named = |pointer, scenario| named(pointer, &scenario);
        assert_eq!(named("/friction", json!({})), ("Friction coefficient".to_owned(), "$μ$"));
        assert_eq!(named("/bodies/1/youngs_modulus", json!({})).0, "Body 2: Young's modulus");
        let layer = "/wear/bodies/0/layers/2/thickness";
        assert_eq!(named(layer, json!({})).0, "Body 1, layer 3: thickness");
        assert_eq!(named("/profile/radii/1", json!({})).0, "Radius, axis across the motion");
        let archard = json!({"wear": {"coefficient": 1e-4, "hardness": "3 GPa"}});
        assert_eq!(named("/wear/coefficient", archard), ("Archard coefficient".to_owned(), "$k$"));
        assert_eq!(named("/wear/coefficient", json!({})).0, "Wear coefficient");
        let rig = json!({"motion": {"amplitude": 1e-6, "rig_stiffness": 2e7}});
        assert_eq!(named("/motion/amplitude", rig).0, "Amplitude at the actuator");
        assert_eq!(named("/motion/amplitude", json!({})).0, "Amplitude");
        let (line, block) = (json!({"profile": {"length": 0.01}}), "/motion/blocks/0/amplitude");
        assert_eq!(named("/motion/amplitude", line.clone()).0, "Amplitude at the reference");
        assert_eq!(named(block, line).0, "Block 1: amplitude at the reference");
        let rig = json!({"profile": {"length": 0.01}, "motion": {"rig_stiffness": 2e7}});
        assert_eq!(named(block, rig).0, "Block 1: amplitude at the actuator");
        assert_eq!(named(block, json!({})).0, "Block 1: amplitude");
        assert_eq!(named("/motion/other_number", json!({})), ("other number".to_owned(), ""));
    }
}
