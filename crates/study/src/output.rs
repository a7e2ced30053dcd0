//! Outputs: the scalars of a result, by name.
//!
//! | name | value |
//! |---|---|
//! | `wear_volume` | a column of the history, in its last row |
//! | `wear_volume@10000` | a column of the history at an output cycle, written as in `cycles` of the scenario |
//! | `limit.wear_volume`, `unworn.tangential_force`, `scales.cycles` | a member of this section of the result |
//! | `events.shakedown` | the number of cycles at which this event happened first |
//!
//! # Units
//! SI.

use std::str::FromStr;
use std::sync::LazyLock;

use deserr::{Deserr, IntoValue, Value};
use fretwork_engine::input::instants::{Cycles, Measure};
use fretwork_engine::input::quantity;
use fretwork_engine::{
    Case, ContactScales, Dimension, EVENTS, EventKind, Faults, History, LimitState, Outcome,
    Pointer, Preview, SectionMember, Unworn, Valid, outcome, unknown,
};
use fretwork_json::typed;
use serde_json::json;

/// Separates the name of a column from an output cycle.
const AT: char = '@';
/// Maximum number of output cycles that an error text lists.
const LISTED: usize = 12;
/// Relative error of values in closed form. The sums over springs are the least accurate ones.
const CLOSED: f64 = 1e-9;
/// The columns of the simplified rule that are computed on a mesh, even if the others have a closed form.
const ON_MESH: [&str; 5] =
    ["wear_volume", "wear_depth", "scar_radius", "wear_volume_error", "wear_depth_error"];
/// Error of the contact radius and the scar radius, in units of the cell width of a uniform mesh. The error rises and
/// falls as the edge of the contact crosses a cell.
const EDGE_IN_CELL: f64 = 0.5;
/// Errors of the forces, of the indentation depth and of the energy per cycle, relative to the unworn value and in
/// units of the stated relative error of the wear volume. These errors also vary as the edge of the contact crosses a
/// cell.
const BY_EDGE: [(&str, f64); 4] = [
    ("normal_force", 3.0),
    ("tangential_force", 3.0),
    ("indentation_depth", 3.0),
    ("energy_per_cycle", 5.0),
];

/// A scalar of a result, at any output cycle.
#[derive(Debug, PartialEq)]
struct ScalarQuantity {
    name: Box<str>,
    /// The name without the name of the section.
    column: &'static str,
    source: Source,
}

/// Where the value of a quantity is in a result. The numbers are indices into the columns or members of a section.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Source {
    Column(usize),
    Event(EventKind),
    Scales(usize),
    Unworn(usize),
    Limit(usize),
}

/// All quantities. A quantity of a section is named `section.member`, except the columns of the history.
static QUANTITIES: LazyLock<Vec<ScalarQuantity>> = LazyLock::new(|| {
    let section = |section: &str, members: &[SectionMember], source: fn(usize) -> Source| {
        let named = members.iter().enumerate().map(|(place, member)| {
            let name = [section, member.name].concat();
            ScalarQuantity { name: name.into(), column: member.name, source: source(place) }
        });
        named.collect::<Vec<_>>()
    };
    let events = EVENTS.iter().map(|(kind, _)| {
        let name = format!("events.{}", json!(kind).as_str().unwrap_or_default());
        ScalarQuantity { name: name.into(), column: "", source: Source::Event(*kind) }
    });
    let sections = [
        section("", History::MEMBERS, Source::Column),
        section("scales.", ContactScales::MEMBERS, Source::Scales),
        section("unworn.", Unworn::MEMBERS, Source::Unworn),
        section("limit.", LimitState::MEMBERS, Source::Limit),
    ];
    sections.into_iter().flatten().chain(events).collect()
});

/// An output as a client names it.
#[derive(Debug, Clone, PartialEq)]
pub struct OutputName {
    text: Box<str>,
    quantity: &'static ScalarQuantity,
    /// The index in the text at which the output cycle begins, if the name has one.
    cycle: Option<usize>,
}

/// An output of a scenario: a quantity, perhaps at one of its output cycles.
#[derive(Debug, Clone)]
pub struct Output {
    name: Box<str>,
    quantity: &'static ScalarQuantity,
    /// The row of the history; `None` for the last one.
    row: Option<usize>,
}

/// Why an output has no value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NoValue {
    /// Only a run finds the value.
    #[error("only a run finds it")]
    NoRun,
    /// The run ended before this output cycle.
    #[error("the run ended before this output cycle")]
    Ended,
    /// The event did not happen.
    #[error("this event did not happen")]
    NoEvent,
    /// The limiting state is not known without a run.
    #[error("the limiting state of this scenario cannot be computed in advance")]
    NoLimit,
    /// The scenario has no rig.
    #[error("only a scenario with `rig_stiffness` has it")]
    NoRig,
    /// A line contact has no such value, or needs a reference for it.
    #[error(
        "a line contact has it only with `reference_distance` or `loop_stiffness`, or not at all"
    )]
    NoReference,
    /// The value is infinite.
    #[error("it is infinite")]
    Infinite,
}

impl OutputName {
    /// The names of all outputs, without output cycles. The columns of the history come first. An output cycle can
    /// follow them.
    pub fn all() -> impl Iterator<Item = &'static str> {
        QUANTITIES.iter().map(|quantity| &*quantity.name)
    }

    /// Finds the output cycle of this name among the output cycles of a scenario.
    ///
    /// # Errors
    /// A sentence for the client: the scenario does not have this output cycle.
    pub fn among(self, cycles: &Cycles) -> Result<Output, String> {
        let Self { text, quantity, cycle } = self;
        let row = cycle.map(|start| row_of(&text[start..], cycles)).transpose()?;
        Ok(Output { name: text, quantity, row })
    }

    /// The outputs of a scenario with these names. The list is empty if `cycles` of the scenario has faults, because
    /// the scenario is refused then.
    ///
    /// # Errors
    /// The faults of the names, with pointers such as `/0`.
    pub fn all_among(names: Vec<Self>, scenario: &serde_json::Value) -> Valid<Vec<Output>> {
        let cycles = scenario.get("cycles").cloned().unwrap_or_default();
        let Ok(cycles) = typed::<Cycles>(cycles) else { return Ok(Vec::new()) };
        Faults::list(names.into_iter().map(|name| name.among(&cycles)))
    }
}

impl FromStr for OutputName {
    /// A sentence for the client: what is wrong, and which names are accepted.
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, cycle) = match text.find(AT) {
            Some(at) => (&text[..at], Some(at + AT.len_utf8())),
            None => (text, None),
        };
        let quantity = QUANTITIES.iter().find(|quantity| &*quantity.name == name);
        let quantity = quantity.ok_or_else(|| {
            let unknown = unknown("output", name, &Self::all().collect::<Vec<_>>());
            let columns = History::MEMBERS.len();
            format!(
                "{unknown} `{AT}` and an output cycle can follow the first {columns} names, as in \
                 `wear_volume{AT}10000`"
            )
        })?;
        if cycle.is_some() && !matches!(quantity.source, Source::Column(_)) {
            return Err(format!(
                "`{name}` has one value in a result, not one for each output cycle. Remove `{AT}` and the text after \
                 `{AT}`"
            ));
        }
        Ok(Self { text: text.into(), quantity, cycle })
    }
}

impl Deserr<Faults> for OutputName {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        let text: String = Deserr::<Faults>::deserialize_from_value(value, location)?;
        text.parse().map_err(|detail: String| Faults::at(location, detail))
    }
}

/// The row of the history at an output cycle. `text` has the form of the output cycles in the scenario.
fn row_of(text: &str, cycles: &Cycles) -> Result<usize, String> {
    let dimension = match cycles.measure {
        Measure::Cycles | Measure::Normalized => Dimension::Number,
        Measure::DissipatedEnergy => Dimension::Energy,
    };
    let number = quantity::parse(text, dimension)
        .map_err(|fault| format!("has no output cycle after `{AT}`: {fault}"))?;
    cycles.row(number).ok_or_else(|| {
        let known: Vec<_> = cycles.instants.iter().take(LISTED).map(f64::to_string).collect();
        let more = if cycles.instants.len() > LISTED { ", …" } else { "" };
        format!(
            "names an output cycle that `cycles` of the scenario does not contain. Add this output cycle to `cycles`, \
             or choose one of {}{more}",
            known.join(", ")
        )
    })
}

impl Output {
    /// The name as the client wrote it.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The SI unit; `1` for a number without a unit, and for the cycles of an event.
    pub fn unit(&self) -> &'static str {
        outcome::Quantity::named(self.quantity.column).map_or("1", |quantity| quantity.unit)
    }

    /// Whether only a run finds the value. The others follow from the unworn contact.
    pub fn needs_run(&self) -> bool {
        matches!(self.quantity.source, Source::Column(_) | Source::Event(_))
    }

    /// The value in the result of a case, or in what is known of the case without a run.
    ///
    /// # Errors
    /// The result does not have this value, or only a run finds it.
    pub fn value(&self, case: &Case, found: Result<&Outcome, &Preview>) -> Result<f64, NoValue> {
        let (scales, unworn, limit) = match found {
            Ok(outcome) => (&outcome.scales, &outcome.unworn, &outcome.limit),
            Err(preview) => (&preview.scales, &preview.unworn, &preview.limit),
        };
        let value = match self.quantity.source {
            Source::Column(place) => {
                let history = &found.map_err(|_| NoValue::NoRun)?.history;
                let row = match self.row {
                    None => history.cycles.len() - 1,
                    Some(row) if history.has_reached(case, row) => row,
                    Some(_) => return Err(NoValue::Ended),
                };
                history.values()[place].get(row).copied()
            }
            Source::Event(kind) => {
                let mut events = found.map_err(|_| NoValue::NoRun)?.events.iter();
                let event = events.find(|event| event.kind == kind);
                return event.map(|event| event.cycles).ok_or(NoValue::NoEvent);
            }
            Source::Scales(place) => scales.values()[place],
            Source::Unworn(place) => unworn.values()[place],
            Source::Limit(place) => limit.as_ref().ok_or(NoValue::NoLimit)?.values()[place],
        };
        match value.ok_or(NoValue::NoRig)? {
            value if value.is_finite() => Ok(value),
            value if value.is_nan() => Err(NoValue::NoReference),
            _ => Err(NoValue::Infinite),
        }
    }

    /// Whether the value has a closed form. Formulas with quadratures and roots count as closed.
    pub fn is_closed(&self, case: &Case) -> bool {
        !self.needs_run() || case.is_closed() && !ON_MESH.contains(&&*self.quantity.name)
    }

    /// The largest expected relative error of the value. Only errors that vary with the numbers of the scenario count.
    ///
    /// A run states the errors of its wear volume and its wear depth. The test
    /// `stated_errors_of_derivatives_cover_the_noise_of_all_columns` checks the errors that are assumed for the other
    /// columns.
    pub fn accuracy(&self, case: &Case, outcome: Option<&Outcome>) -> f64 {
        let computed = outcome.filter(|_| !self.is_closed(case));
        computed.and_then(|outcome| self.roughness(outcome)).unwrap_or(CLOSED).max(CLOSED)
    }

    /// The relative error of an output of a run, see [`Self::accuracy`]. `None` if the run has no wear.
    fn roughness(&self, outcome: &Outcome) -> Option<f64> {
        let Outcome { accuracy, history, .. } = outcome;
        let volume = accuracy.numerical_error?;
        if self.is_error() {
            // The estimate of an error may itself be wrong by 100 %.
            return Some(1.0);
        }
        if self.is_edge() {
            let edge = accuracy.cells.map_or(0.0, |cells| EDGE_IN_CELL / cells as f64);
            return Some(volume.max(edge));
        }
        let at = |column: &[f64]| self.row.map_or(column.last(), |row| column.get(row)).copied();
        let Source::Column(place) = self.quantity.source else { return Some(volume) };
        let (name, column) = (self.quantity.column, history.values()[place]);
        if name == "wear_depth" {
            return at(&history.wear_depth_error);
        }
        let Some((_, factor)) = BY_EDGE.iter().find(|(known, _)| *known == name) else {
            return Some(volume);
        };
        let fall = (column[0] / at(column)?).max(1.0);
        Some((factor * volume * fall).min(1.0))
    }

    /// Whether this is the radius at which the contact or the scar of a run ends.
    pub fn is_edge(&self) -> bool {
        ["contact_radius", "scar_radius"].contains(&&*self.quantity.name)
    }

    /// Whether this is the estimated error of another output.
    pub fn is_error(&self) -> bool {
        self.quantity.name.ends_with("_error")
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use fretwork_engine::scenario;
    use fretwork_engine::simulation::Simulation;
    use serde_json::json;

    use super::*;

    /// A steel ball with these output cycles and other members.
    fn run(cycles: &serde_json::Value, members: &serde_json::Value) -> (Cycles, Case, Outcome) {
        let mut scenario = json!({
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "moduli": {"normal": "112.64 GPa", "tangential": "92.76 GPa"},
            "friction": 0.7,
            "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
            "load": {"normal_force": "100 N", "held": "depth"},
            "motion": {"stick_ratio": 0.5},
            "model": {"method": "simplified"},
            "cycles": cycles,
        });
        for (name, value) in members.as_object().unwrap() {
            scenario[name] = value.clone();
        }
        let cycles = Cycles::deserialize_from_value(
            scenario["cycles"].clone().into_value(),
            Pointer::Origin,
        );
        let (scenario, case, _) = scenario::prepare(scenario, "").unwrap();
        let outcome = Simulation::new(case.clone(), scenario.warnings(&case)).run();
        (cycles.unwrap(), case, outcome)
    }

    fn output(name: &str, cycles: &Cycles) -> Output {
        name.parse::<OutputName>().and_then(|name| name.among(cycles)).unwrap()
    }

    #[test]
    fn every_scalar_of_a_result_is_an_output() {
        let members = json!({"motion": {"amplitude": "3 um", "rig_stiffness": "50 N/um"}});
        let (.., outcome) = run(&json!([1000]), &members);
        let whole = serde_json::to_value(&outcome).unwrap();
        let names = |section: &str| whole[section].as_object().unwrap().keys().cloned();
        let mut expected: BTreeSet<String> = names("history").collect();
        for section in ["scales", "unworn", "limit"] {
            expected.extend(names(section).map(|name| format!("{section}.{name}")));
        }
        let kinds = EVENTS.iter().map(|(kind, _)| serde_json::to_value(kind).unwrap());
        expected.extend(kinds.map(|kind| format!("events.{}", kind.as_str().unwrap())));
        assert_eq!(OutputName::all().map(str::to_owned).collect::<BTreeSet<_>>(), expected);
    }

    #[test]
    fn the_value_of_an_output_equals_the_number_in_the_result() {
        let (cycles, case, outcome) = run(&json!([1000, 30000, 1e6]), &json!({}));
        let value = |name: &str| output(name, &cycles).value(&case, Ok(&outcome));
        let history = &outcome.history;
        assert_eq!(value("wear_volume"), Ok(history.wear_volume[3]));
        assert_eq!(value("wear_volume@1e6"), Ok(history.wear_volume[3]));
        assert_eq!(value("wear_volume@30000"), Ok(history.wear_volume[2]));
        assert_eq!(value("normal_force@0"), Ok(outcome.scales.normal_force));
        assert_eq!(value("limit.wear_depth"), Ok(outcome.limit.unwrap().wear_depth));
        assert_eq!(value("unworn.slip_ratio"), Ok(outcome.unworn.slip_ratio));
        let shakedown = value("events.shakedown").unwrap();
        assert!((30000.0..1e6).contains(&shakedown), "{shakedown}");
        assert_eq!(value("events.rim_reached"), Err(NoValue::NoEvent));
        assert_eq!(value("unworn.actuator_amplitude"), Err(NoValue::NoRig));
        let (cycles, case, outcome) =
            run(&json!([10]), &json!({"profile": {"shape": "cone", "slope_angle": "2 deg"}}));
        let value = |name: &str| output(name, &cycles).value(&case, Ok(&outcome));
        assert_eq!(value("unworn.peak_pressure"), Err(NoValue::Infinite));
        let slipping = json!({"motion": {"tangential_force": "69 N"}});
        let (cycles, case, outcome) = run(&json!([10]), &slipping);
        let value = output("limit.wear_depth", &cycles).value(&case, Ok(&outcome));
        assert_eq!(value, Err(NoValue::NoLimit));
    }

    #[test]
    fn output_cycles_are_named_in_the_measure_of_the_scenario() {
        let (cycles, case, outcome) =
            run(&json!({"normalized": [0, 0.5, 1.0 / 3.0 + 1.0]}), &json!({}));
        let value = |name: &str| output(name, &cycles).value(&case, Ok(&outcome));
        for (name, row) in [("cycles@0", 0), ("cycles@0.5", 1), ("cycles@1.33333333333", 2)] {
            assert_eq!(value(name), Ok(outcome.history.cycles[row]), "{name}");
        }
        let range = json!({"from": "10 mJ", "to": 0.1, "count": 3, "spacing": "linear"});
        let energies = json!({"dissipated_energy": range});
        let (cycles, case, outcome) = run(&energies, &json!({}));
        let value = |name: &str| output(name, &cycles).value(&case, Ok(&outcome));
        for (name, row) in [("cycles@0.01", 1), ("cycles@55 mJ", 2), ("cycles@0.1 J", 3)] {
            assert_eq!(value(name), Ok(outcome.history.cycles[row]), "{name}");
        }
    }

    #[test]
    fn an_output_cycle_after_the_end_of_the_run_has_no_value() {
        for list in [json!([10, 1e5]), json!([10, 1e5, 1e6]), json!([10, 1e5, 1e6, 1e7])] {
            let until = json!({"until": {"wear_depth": "0.3 um"}});
            let (cycles, case, outcome) = run(&list, &until);
            let value = |name: &str| output(name, &cycles).value(&case, Ok(&outcome));
            assert_eq!(value("cycles@10"), Ok(10.0));
            let end = value("events.until_reached").unwrap();
            assert!((10.0..1e5).contains(&end), "{end}");
            assert_eq!(value("cycles"), Ok(end));
            assert_eq!(value("cycles@1e5"), Err(NoValue::Ended));
        }
        let until = json!({"until": {"wear_depth": "0.3 um"}});
        let (cycles, case, outcome) = run(&json!({"dissipated_energy": [1e-3, "1 kJ"]}), &until);
        let value = |name: &str| output(name, &cycles).value(&case, Ok(&outcome));
        assert!(value("wear_depth@1 mJ").is_ok());
        assert_eq!(value("wear_depth@1 kJ"), Err(NoValue::Ended));
    }

    #[test]
    fn a_fault_in_a_name_says_what_to_enter() {
        let (cycles, ..) = run(&json!([1000, 30000]), &json!({}));
        let fault = |text: &str| {
            let name: Result<OutputName, _> = text.parse();
            name.and_then(|name| name.among(&cycles)).expect_err(text)
        };
        assert!(fault("wear_volumn").contains("Did you mean `wear_volume`?"));
        assert!(fault("").contains("limit.wear_depth, "));
        assert!(fault("limit.wear_volume@1000").contains("Remove `@`"));
        assert!(fault("wear_volume@2000").contains("choose one of 1000, 30000"));
        assert!(fault("wear_volume@").contains("does not begin with a number"));
        assert!(fault("wear_volume@1000 J").contains("plain number"));
        let (cycles, ..) = run(&json!({"dissipated_energy": ["1 J"]}), &json!({}));
        let name: OutputName = "wear_volume@1 N".parse().unwrap();
        assert!(name.among(&cycles).unwrap_err().contains("an energy"));
    }

    #[test]
    fn every_output_has_a_unit() {
        let (cycles, ..) = run(&json!([1000]), &json!({}));
        let unit = |name: &str| output(name, &cycles).unit();
        for name in OutputName::all().filter(|name| !name.starts_with("events.")) {
            let quantity = outcome::Quantity::named(name.rsplit('.').next().unwrap()).unwrap();
            assert_eq!(unit(name), quantity.unit, "{name}");
        }
        assert_eq!(unit("wear_volume@1000"), "m^3");
        assert_eq!(unit("limit.wear_depth"), "m");
        assert_eq!(unit("events.shakedown"), "1");
    }
}
