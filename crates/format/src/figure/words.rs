//! The words of figures: numbers, units, and the names of members and outputs.

use serde_json::Value;

use crate::notation::{digits, typeset};
use fretwork_engine::input::inputs::named;
use fretwork_engine::outcome::{Quantity, words_in};

/// The name of the number at a pointer of a scenario, with a capital.
pub fn member(pointer: &str, scenario: &Value) -> String {
    capital(&named(pointer, scenario).0)
}

/// The symbol of the number at a pointer of a scenario, or its name if it has none.
pub fn short(pointer: &str, scenario: &Value) -> String {
    let (words, symbol) = named(pointer, scenario);
    if symbol.is_empty() { capital(&words) } else { symbol.replace('$', "") }
}

/// Name and symbol of the number at a pointer of a scenario, as plain text.
pub fn whole(pointer: &str, scenario: &Value) -> String {
    let (words, symbol) = named(pointer, scenario);
    format!("{} {symbol}", capital(&words)).replace('$', "").trim().to_owned()
}

/// An output in words. The first text is the quantity. The second text says when, such as ` after 1000 cycles`. An output
/// cycle without a unit is in the measure of the member `cycles` of the scenario.
pub fn output(name: &str, scenario: &Value) -> (String, String) {
    let (is_line, cycles) = (scenario.pointer("/profile/length").is_some(), &scenario["cycles"]);
    let spaced = |text: &str| text.replace('_', " ");
    if let Some((column, at)) = name.split_once('@') {
        // A name such as `wear_depth@1 mJ` already contains the unit of the energy.
        let unit = match at.parse::<f64>() {
            Err(_) => "",
            Ok(_) if cycles.get("dissipated_energy").is_some() => " J",
            Ok(_) if cycles.get("normalized").is_some() => " normalized cycles",
            Ok(_) => " cycles",
        };
        return (output(column, scenario).0, format!(" after {at}{unit}"));
    }
    let words = match name.split_once('.') {
        Some(("events", event)) => format!("Cycles until {}", spaced(event)),
        Some((section, column)) => {
            words_in(section, column, is_line).map_or_else(|| spaced(name), |[words, _]| words)
        }
        None => match Quantity::named(name) {
            Some(own) => return (own.words_of(is_line).into(), " after the last cycle".into()),
            None => capital(&spaced(name)),
        },
    };
    (words, String::new())
}

/// The text with a capital first letter.
pub fn capital(text: &str) -> String {
    let mut rest = text.chars();
    rest.next().map_or_else(String::new, |first| first.to_uppercase().chain(rest).collect())
}

/// Labels such as `friction = 0.5`, with enough digits to distinguish them.
pub fn values_of(name: &str, unit: Option<&str>, values: &[f64]) -> Vec<String> {
    let unit = unit.map_or_else(String::new, |unit| format!(" {}", typeset(unit)));
    distinct(values, [4, 12], |value, count| format!("{name} = {}{unit}", digits(value, count)))
}

/// Labels of values with few digits, or with many if two of them would be equal.
pub fn distinct(
    values: &[f64],
    [few, many]: [u8; 2],
    label: impl Fn(f64, u8) -> String,
) -> Vec<String> {
    let with = |digits| -> Vec<String> { values.iter().map(|x| label(*x, digits)).collect() };
    let short = with(few);
    let equal = short.iter().enumerate().any(|(i, label)| short[..i].contains(label));
    if equal { with(many) } else { short }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn members_and_outputs_are_named_in_words() {
        assert_eq!(member("/motion/amplitude", &Value::Null), "Amplitude");
        assert_eq!(short("/motion/amplitude", &Value::Null), "U");
        assert_eq!(short("/wear/hardness", &Value::Null), "Hardness");
        assert_eq!(whole("/motion/amplitude", &Value::Null), "Amplitude U");
        let in_words = |name| {
            let (quantity, rest) = output(name, &json!({"cycles": [1000]}));
            quantity + &rest
        };
        let after =
            |at: &str, cycles| output(&format!("wear_depth@{at}"), &json!({"cycles": cycles})).1;
        assert_eq!(after("0.01", json!({"dissipated_energy": ["10 mJ"]})), " after 0.01 J");
        assert_eq!(after("0.5", json!({"normalized": [0, 0.5]})), " after 0.5 normalized cycles");
        assert_eq!(in_words("wear_volume"), "Wear volume after the last cycle");
        assert_eq!(in_words("wear_depth@1000"), "Largest wear depth after 1000 cycles");
        assert_eq!(in_words("wear_depth@1 mJ"), "Largest wear depth after 1 mJ");
        let line = json!({"profile": {"length": 0.01}});
        let threshold = "Gross-slip threshold at the reference".to_owned();
        assert_eq!(
            output("gross_slip_amplitude", &line),
            (threshold, " after the last cycle".to_owned())
        );
        let unworn = output("unworn.gross_slip_amplitude", &line).0;
        assert_eq!(unworn, "Unworn gross-slip threshold at the reference");
        assert_eq!(in_words("unworn.energy_ratio"), "Unworn energy ratio");
        assert_eq!(in_words("events.rim_reached"), "Cycles until rim reached");
    }

    #[test]
    fn labels_of_values_are_short_and_distinct() {
        assert_eq!(values_of("friction", None, &[0.5, 0.7]), ["friction = 0.5", "friction = 0.7"]);
        let close = values_of("amplitude", Some("um"), &[1.00001, 1.00002]);
        assert_eq!(close, ["amplitude = 1.00001 µm", "amplitude = 1.00002 µm"]);
    }
}
