//! The inputs of a result in words, in the notation of the page. Long lists are shortened.

use serde_json::{Map, Value};

use crate::figure::words::{capital, short, whole};
use crate::notation::{Notation, cycles, digits, percent};
use fretwork_engine::outcome::Quantity;
use fretwork_engine::request::inputs::VALUES;
use fretwork_engine::request::inputs::measure_at;
use fretwork_engine::request::quantity::{Dimension, parse};
use fretwork_study::{Kind, Member};

/// Maximum number of inputs, and of items of a list that is written out.
const MOST: usize = 60;
const ITEMS: usize = 6;
/// Digits of numbers as submitted, and as the engine computed them.
pub const TYPED: u8 = 12;
pub const COMPUTED: u8 = 4;
/// Longest text, in characters.
const TEXT: usize = 200;

/// An input of a scenario or a study.
pub struct Input {
    pub pointer: String,
    pub name: String,
    pub text: String,
}

/// The inputs of a scenario or a study. A number that the study varies or estimates is not an input of its scenario.
pub fn listed(asked: &Value, notation: Notation, digits: u8) -> Vec<Input> {
    let scenario = asked.get("scenario").unwrap_or(asked);
    let mut found = Vec::new();
    collect(scenario, String::new(), &mut found);
    let reader = Reader { scenario, notation, digits };
    let is_own =
        |name: &str| asked.get("scenario").is_some() && !["scenario", "version"].contains(&name);
    let members = asked.as_object().into_iter().flatten().filter(|(name, _)| is_own(name));
    let members =
        members.flat_map(|(name, value)| items(value).iter().map(move |item| (name, item)));
    let members: Vec<_> = members.collect();
    let varied: Vec<_> = members.iter().filter_map(|(name, item)| pointer_of(name, item)).collect();
    let fixed = found.into_iter().filter(|(pointer, _)| !varied.contains(&pointer.as_str()));
    let fixed = fixed.map(|(pointer, value)| reader.input(pointer, value));
    let mut inputs: Vec<Input> =
        fixed.chain(members.iter().map(|(name, item)| reader.of_study(name, item))).collect();
    let more = inputs.len().saturating_sub(MOST);
    inputs.truncate(MOST);
    let rest =
        Input { pointer: "…".to_owned(), name: "More inputs".to_owned(), text: more.to_string() };
    inputs.extend((more > 0).then_some(rest));
    inputs
}

/// Collects the members of objects. A short list of objects has lines for each of them.
fn collect<'a>(value: &'a Value, pointer: String, out: &mut Vec<(String, &'a Value)>) {
    match value {
        Value::Object(members) if !members.contains_key("spacing") => {
            for (name, value) in members.iter().filter(|(_, value)| !value.is_null()) {
                collect(value, format!("{pointer}/{name}"), out);
            }
        }
        Value::Array(items) if items.len() <= ITEMS && items.iter().any(Value::is_object) => {
            for (place, item) in items.iter().enumerate() {
                collect(item, format!("{pointer}/{place}"), out);
            }
        }
        _ => out.push((pointer, value)),
    }
}

/// The items of a member of a study: those of a list of objects, or the member itself.
fn items(value: &Value) -> &[Value] {
    match value {
        Value::Array(items) if items.iter().any(Value::is_object) => items,
        _ => std::slice::from_ref(value),
    }
}

/// The pointer of the number that an item of a member of a study varies or estimates.
fn pointer_of<'a>(name: &str, item: &'a Value) -> Option<&'a str> {
    let mut axes = Kind::ALL.iter().flat_map(|kind| kind.axes);
    item["pointer"].as_str().or(axes.find(|(axis, _)| *axis == name).map(|(_, pointer)| *pointer))
}

struct Reader<'a> {
    scenario: &'a Value,
    notation: Notation,
    digits: u8,
}

impl Reader<'_> {
    fn input(&self, pointer: String, value: &Value) -> Input {
        // Numbers without a unit, and lists of them, are in SI.
        let first = value.as_array().and_then(|items| items.first()).unwrap_or(value);
        let dimension = first.is_number().then(|| measure_at(&pointer, self.scenario).dimension);
        let unit = dimension.map_or("1", Dimension::si);
        Input { name: whole(&pointer, self.scenario), text: self.text(value, unit), pointer }
    }

    /// The SI unit of the number at a pointer.
    fn unit(&self, pointer: &str) -> &'static str {
        Member::find(self.scenario, pointer).map_or("1", |member| member.dimension.si())
    }

    /// The line of an item of a member of a study.
    fn of_study(&self, name: &str, item: &Value) -> Input {
        let pointer = pointer_of(name, item);
        let words = match (pointer, item["name"].as_str()) {
            (Some(pointer), _) if name == "parameters" => {
                format!("Estimated: {}", whole(pointer, self.scenario))
            }
            (Some(pointer), _) => format!("Varied: {}", whole(pointer, self.scenario)),
            (_, Some(test)) => format!("Test {test}"),
            _ => capital(&name.replace('_', " ")),
        };
        let text = self.text(item, pointer.map_or("1", |pointer| self.unit(pointer)));
        Input { pointer: words.clone(), name: words, text }
    }

    /// A value on one line. Numbers without a unit have the given one. Of a long list, only the ends are written.
    fn text(&self, value: &Value, unit: &str) -> String {
        let text = match value {
            Value::Null => "–".to_owned(),
            Value::Bool(yes) => if *yes { "Yes" } else { "No" }.to_owned(),
            Value::String(text) => self.typed(text),
            Value::Number(number) => match number.as_f64().unwrap_or(f64::NAN) {
                whole if unit == "1" && whole.fract() == 0.0 => cycles(whole),
                number => self.notation.quantity(number, unit, self.digits),
            },
            Value::Array(items) if items.len() > ITEMS => {
                let [first, second, last] = [&items[0], &items[1], &items[items.len() - 1]]
                    .map(|item| self.text(item, unit));
                format!("{first}, {second}, … {last} ({} values)", items.len())
            }
            Value::Array(items) => {
                items.iter().map(|item| self.text(item, unit)).collect::<Vec<_>>().join(", ")
            }
            Value::Object(members) => self.members(members, unit),
        };
        match text.char_indices().nth(TEXT) {
            Some((end, _)) => format!("{}…", &text[..end]),
            None => text,
        }
    }

    /// A text of a scenario or a study: a number with a unit, or a word.
    fn typed(&self, text: &str) -> String {
        if let Ok(number) = text.parse::<f64>() {
            return digits(number, self.digits);
        }
        let dimensions = Dimension::ALL.into_iter().filter(|it| *it != Dimension::Number);
        let mut numbers = dimensions.filter_map(|it| Some((parse(text, it).ok()?, it.si())));
        if let Some((number, si)) = numbers.next() {
            return self.notation.quantity(number, si, self.digits);
        }
        let word = VALUES.iter().find(|(value, _)| *value == text).map(|(_, words)| *words);
        word.map_or_else(|| capital(&text.replace('_', " ")), str::to_owned)
    }

    /// The members of an object of a study, such as a range, a distribution or a test.
    fn members(&self, members: &Map<String, Value>, unit: &str) -> String {
        let known = |name: &str| members.get(name).and_then(Value::as_str).unwrap_or_default();
        let of_y = Quantity::named(known("output")).map_or(unit, |quantity| quantity.unit);
        let of_x = match known("over") {
            "radius" => "m",
            "dissipated_energy" => "J",
            _ => "cycles",
        };
        let member = |(name, value): (&String, &Value)| {
            let text = |unit| self.text(value, unit);
            Some(match name.as_str() {
                "pointer" | "name" | "over" => return None,
                "data" | "changes" | "output" | "spacing" => text(unit),
                "x" => format!("at {}", text(of_x)),
                "y" => format!("measured {}", text(of_y)),
                "count" => format!("{} values", text("1")),
                "relative" => format!("±{}", percent(value.as_f64().unwrap_or(f64::NAN), 3)),
                _ if name.starts_with('/') => {
                    format!("{} = {}", short(name, self.scenario), text(self.unit(name)))
                }
                _ => format!("{} {}", name.replace('_', " "), text(unit)),
            })
        };
        members.iter().filter_map(member).collect::<Vec<_>>().join(", ")
    }
}
