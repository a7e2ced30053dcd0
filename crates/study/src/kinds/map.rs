//! Maps: regimes, forces and wear over normal force and amplitude (running-condition fretting maps).
//!
//! The unworn contact at each point is known in closed form, see [`Condition`]. Runs are computed only if the map has
//! `outputs`, such as the wear volume.
//!
//! Gross slip begins at the amplitude U = μ(E*/G*)·d(F), where d is the indentation depth at the normal force F. For a
//! paraboloid with contact radius a this is the formula of Hertz and Mindlin, U = 3μF/(4G*a). The amplitude of a line
//! contact is measured against the reference of the scenario. Behind a rig, all amplitudes are those of the actuator.
//!
//! # Sources
//! O. Vingsbo, S. Söderberg, Wear 126 (1988) 131: fretting maps.

use std::sync::OnceLock;

use deserr::Deserr;
use fretwork_engine::input::fields::Length;
use fretwork_engine::{Case, Condition, Faults, Given, Valid, scenario};
use serde_json::{Value, json};

use crate::plan::StudyFigure::{Curves, Heat, Regimes};
use crate::plan::{Regions, number_cells};
use crate::problem::outputs_of;
use crate::{
    Column, Findings, Found, GoesOn, Hints, Kind, Lack, Member, NUMBER, Offer, OrRun, Output, Plan,
    Problem, Read, Rows, Tried, Values, Varied, small_members,
};
use fretwork_json::{Whole, both, typed};

/// The kind of maps.
pub const KIND: Kind = Kind {
    name: "map",
    title: "Fretting map",
    rows: "table",
    keeps_profiles: false,
    axes: &[(AXES[0], MEMBERS[0]), (AXES[1], MEMBERS[1])],
    design: "",
    designs: &[(
        "",
        Hints {
            is_grid: true,
            regions: Some(Regions {
                boundary: "boundary",
                label: "gross slip begins, unworn",
                later: "after_run",
                title: "Regimes of the unworn contact",
                names: ["partial slip", "gross slip"],
            }),
            ..Hints::of(&[Regimes, Heat, Curves])
        },
    )],
    offers: &[Offer {
        id: "map",
        title: "Fretting map",
        meaning: "regimes and wear over normal force and amplitude",
        members: "{}",
        sample: None,
    }],
    read,
};

/// The pointers of the two numbers that a map varies.
const MEMBERS: [&str; 2] = ["/load/normal_force", "/motion/amplitude"];
/// The members of a map that give the values of the numbers in [`MEMBERS`].
const AXES: [&str; 2] = ["normal_force", "amplitude"];
/// Maximum number of values of an axis. It is limited because a contact is kept in memory for each normal force.
const MAX_VALUES: usize = 4096;
/// The columns of the unworn contact and their units, between the members and the outputs.
const CLOSED: [(&str, &str); 3] =
    [("unworn.force_ratio", "1"), ("unworn.stick_ratio", "1"), ("unworn.energy_per_cycle", "J")];
/// Index of the stick ratio in [`CLOSED`].
const STICK_RATIO: usize = 1;
/// The name of the column of texts that follows from the stick ratio.
const REGIME: &str = "regime";
/// The stiffness of a rig.
const RIG: &str = "/motion/rig_stiffness";
/// The outputs of a run that say at which amplitude the worn contact slips as a whole: without and with a rig.
const THRESHOLDS: [&str; 2] = ["gross_slip_amplitude", "actuator_gross_slip_amplitude"];
/// The columns of the boundary besides [`MEMBERS`]: the amplitude at the contact, if there is a rig, and the boundary
/// after the runs, if there are runs.
const BESIDE: [&str; 2] = ["unworn.gross_slip_amplitude", "after_run"];
/// Processor time of a point without a run, in seconds.
const SECONDS: f64 = 2e-6;

/// The body of a map.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct MapBody {
    #[deserr(default, rename = "version")]
    _version: Given<Whole<1, 1>>,
    scenario: Value,
    normal_force: Value,
    amplitude: Value,
    #[deserr(default)]
    outputs: Given<Value>,
}

/// The points of a map: all amplitudes at the first normal force, then at the second, and so on.
#[derive(Debug)]
struct Map {
    forces: Vec<f64>,
    amplitudes: Vec<f64>,
    has_rig: bool,
    /// The index of the output of [`THRESHOLDS`], if the map has runs. The boundary after the runs follows from it.
    threshold: Option<usize>,
    /// For each normal force a case with one of the amplitudes, or why there is none. Each is computed when it is first
    /// needed.
    cases: Vec<OnceLock<Result<Box<Case>, String>>>,
}

/// Reads a map.
///
/// # Errors
/// All faults, with pointers relative to the map.
fn read(map: Value) -> Valid<Read> {
    let complete = small_members(&map);
    let MapBody { scenario, normal_force, amplitude, outputs, .. } = typed(map)?;
    let mut faults = Faults::default();
    faults.keep("", scenario::prepare(scenario.clone(), "/scenario"));
    faults.keep("/scenario", plain(&scenario));
    let names = outputs.0.filter(|names| *names != json!([]));
    let outputs = names.map_or(Ok(Vec::new()), |names| outputs_of(names, &scenario));
    let mut outputs = faults.keep("/outputs", outputs).unwrap_or_default();
    if let Some(place) =
        outputs.iter().position(|output| CLOSED.iter().any(|(own, _)| *own == output.name()))
    {
        faults.add(format!("/outputs/{place}"), "is a column of every map. Remove it");
    }
    faults.or(())?;
    let has_rig = scenario.pointer(RIG).is_some();
    let name = THRESHOLDS[usize::from(has_rig)];
    let place = |outputs: &[Output]| outputs.iter().position(|output| output.name() == name);
    if !outputs.is_empty() && place(&outputs).is_none() {
        outputs.extend(outputs_of(json!([name]), &scenario)?);
    }
    let threshold = place(&outputs);
    let [force, amplitude] =
        [(0, normal_force), (1, amplitude)].map(|(place, given)| axis(place, given, &scenario));
    let ((force, forces), (amplitude, amplitudes)) = both(force, amplitude)?;
    let cases = forces.iter().map(|_| OnceLock::new()).collect();
    let plan = Map { forces, amplitudes, has_rig, threshold, cases };
    Ok(Read::new(complete, Problem::new(scenario, vec![force, amplitude], outputs), plan))
}

/// Checks that a scenario has a normal force and an amplitude of the contact, which a map varies.
fn plain(scenario: &Value) -> Valid<()> {
    let mut faults = Faults::default();
    for (pointer, name) in MEMBERS.into_iter().zip(AXES) {
        let section = pointer.rsplit_once('/').map_or("", |(section, _)| section);
        if scenario.pointer(section).is_some() && scenario.pointer(pointer).is_none() {
            let mut detail = format!(
                "has no `{name}`, but a map varies this number. Enter any value of `{name}` in place of the given \
                 quantity"
            );
            if name == AXES[1] && scenario.pointer("/profile/length").is_some() {
                detail +=
                    ", and what it is measured against: `reference_distance` or `loop_stiffness`";
            }
            faults.add(section, detail);
        }
    }
    faults.or(())
}

/// The number that an axis varies, and its values. Faults have pointers relative to the map.
fn axis(place: usize, mut entry: Value, scenario: &Value) -> Valid<(Member, Vec<f64>)> {
    let wrong = |detail: &str| Err(Faults::one("", detail));
    let read = match entry.as_object_mut() {
        Some(members) if !members.contains_key("pointer") => {
            members.insert("pointer".to_owned(), json!(MEMBERS[place]));
            Varied::read(entry, Member::find(scenario, MEMBERS[place]))
        }
        Some(_) => wrong(
            "has a `pointer`, but the name of the axis says which number varies. Remove `pointer`",
        ),
        None => wrong(
            "must be a range, such as {\"from\": 1, \"to\": 100, \"count\": 64, \"spacing\": \"log\"}",
        ),
    };
    let values = read.and_then(|Varied { member, values }| match values {
        Values::List(list) if list.len() <= MAX_VALUES => Ok((member, list)),
        Values::List(list) => {
            let detail = format!("has {} values. At most {MAX_VALUES} are accepted", list.len());
            Err(Faults::one("", detail))
        }
        Values::Range(..) => {
            Err(Faults::one("", "needs `count`, the number of values from `from` to `to`"))
        }
        Values::Base | Values::Distribution(_) => {
            Err(Faults::one("", "must have `from`, `to` and `count`, or `values`"))
        }
    });
    values.map_err(|faults| faults.below(&format!("/{}", AXES[place])))
}

impl Map {
    /// A case with this normal force. Its amplitude is the first, the middle or the last one.
    fn case(&self, problem: &Problem, force: usize) -> Result<&Case, &String> {
        let case = self.cases[force].get_or_init(|| {
            let of =
                |amplitude: &f64| problem.case(&[self.forces[force], *amplitude]).map(Box::new);
            // The scenario may be invalid with the smallest or the largest amplitude. Then another amplitude is tried.
            let last = self.amplitudes.len() - 1;
            let [first, others @ ..] = [0, last / 2, last].map(|place| &self.amplitudes[place]);
            others.into_iter().fold(of(first), |case, other| case.or_else(|_| of(other)))
        });
        case.as_deref()
    }

    /// The unworn contact of a point: the values of [`CLOSED`], or why there are none.
    fn unworn(&self, problem: &Problem, number: usize) -> Result<[f64; CLOSED.len()], String> {
        let amplitude = self.point(number)[1];
        let case = self.case(problem, number / self.amplitudes.len());
        let (low, high) = Length::RANGE;
        if !(low..=high).contains(&amplitude) {
            return Err(format!("{}: must be from {low:e} to {high:e} m", MEMBERS[1]));
        }
        let Condition { force_ratio, stick_ratio, energy_per_cycle, .. } =
            Condition::of(case.map_err(Clone::clone)?, amplitude);
        Ok([force_ratio, stick_ratio, energy_per_cycle])
    }

    /// The amplitude above which the whole contact still slips at the end of the runs, estimated from the amplitudes of the
    /// map around it. `None` if it is not among them. `is_steep`: if the depth is held, a contact that slips as a whole
    /// loses its load, and the threshold falls steeply just above the boundary.
    fn after_run(&self, force: usize, thresholds: &[Option<f64>], is_steep: bool) -> Option<f64> {
        let count = self.amplitudes.len();
        let own = self.amplitudes.iter().zip(&thresholds[force * count..]);
        let mut points: Vec<[f64; 2]> =
            own.filter_map(|(amplitude, at)| Some([*amplitude, amplitude - (*at)?])).collect();
        points.sort_by(|one, other| one[0].total_cmp(&other[0]));
        points.dedup_by(|next, before| next[0].total_cmp(&before[0]).is_eq());
        let above = points.iter().rposition(|[_, rest]| *rest < 0.0)? + 1;
        let (high, [low, rest]) = (points.get(above)?[0], points[above - 1]);
        // A steep threshold is continued from below.
        let slope = match above.checked_sub(2).filter(|_| is_steep) {
            Some(before) => (rest - points[before][1]) / (low - points[before][0]),
            None => (points[above][1] - rest) / (high - low),
        };
        Some((low - rest / slope).clamp(low, high))
    }
}

/// The cells of the column of regimes, which follow from the stick ratios.
fn regimes(rows: &Rows) -> String {
    let ratios = rows.numbers(MEMBERS.len() + STICK_RATIO);
    let regimes = ratios.into_iter().map(|ratio| match ratio {
        None => "null",
        Some(0.0) => "\"gross_slip\"",
        Some(_) => "\"partial_slip\"",
    });
    regimes.collect::<Vec<_>>().join(",")
}

impl Plan for Map {
    fn points(&self) -> usize {
        self.forces.len() * self.amplitudes.len()
    }

    fn point(&self, number: usize) -> Vec<f64> {
        let count = self.amplitudes.len();
        vec![self.forces[number / count], self.amplitudes[number % count]]
    }

    /// The row of a point: first the columns of the unworn contact, then the outputs of its run. A map without outputs
    /// needs no run.
    fn row(&self, problem: &Problem, number: usize, _: &Rows, tried: &[Tried]) -> OrRun<Tried> {
        let run = match tried.last() {
            None if !problem.outputs.is_empty() => return Err(self.point(number)),
            run => run.map_or_else(|| problem.no_run(), |tried| tried.found.clone()),
        };
        let (closed, refused) = match self.unworn(problem, number) {
            Ok(closed) => (closed.map(Some), None),
            Err(reason) => ([None; CLOSED.len()], Some(Lack::Refused(reason))),
        };
        let outputs = closed.into_iter().chain(run.outputs).collect();
        let found = Found { outputs, lack: run.lack.or(refused), profiles: Vec::new() };
        Ok(Tried { values: self.point(number), found })
    }

    fn seconds(&self, problem: &Problem, values: &[f64]) -> f64 {
        let is_closed = problem.outputs.is_empty();
        SECONDS + if is_closed { 0.0 } else { problem.seconds(values) }
    }

    fn columns(&self) -> Vec<Column> {
        CLOSED.map(|(name, unit)| Column::new(name, unit)).to_vec()
    }

    fn found_columns(&self) -> Vec<Column> {
        let has = BESIDE.into_iter().zip([self.has_rig, self.threshold.is_some()]);
        has.filter(|(_, has)| *has).map(|(name, _)| Column::new(name, "m")).collect()
    }

    /// The boundary: the amplitude at which gross slip begins, for each normal force, unworn and after the runs. And the
    /// regimes of all rows.
    fn findings(&self, problem: &Problem, rows: &Rows, _: GoesOn<'_>) -> Option<Findings> {
        let each = |of: &dyn Fn(usize) -> Option<f64>| number_cells((0..self.forces.len()).map(of));
        let case = |force| self.case(problem, force).ok();
        let at_contact = |force| Some(case(force)?.gross_slip_amplitude());
        let at_actuator = |force| case(force)?.actuator_gross_slip_amplitude();
        let mut columns = vec![
            (MEMBERS[0], number_cells(self.forces.iter().copied().map(Some))),
            (MEMBERS[1], each(if self.has_rig { &at_actuator } else { &at_contact })),
        ];
        if self.has_rig {
            columns.push((BESIDE[0], each(&at_contact)));
        }
        if let Some(place) = self.threshold {
            let thresholds = rows.numbers(MEMBERS.len() + CLOSED.len() + place);
            let is_steep = problem.base.pointer("/load/held") == Some(&json!("depth"));
            columns.push((BESIDE[1], each(&|force| self.after_run(force, &thresholds, is_steep))));
        }
        Some(Findings {
            members: vec![("boundary", columns.into_iter().collect())],
            beside: vec![(REGIME, regimes(rows))],
        })
    }

    /// Time to compute the cases of all normal forces.
    fn findings_seconds(&self, problem: &Problem) -> f64 {
        self.forces.len() as f64 * problem.preparation()
    }

    fn findings_bytes(&self, _: &Problem) -> usize {
        let columns = MEMBERS.len() + BESIDE.len();
        NUMBER * (columns * (self.forces.len() + 1) + self.points())
    }

    fn memory(&self) -> usize {
        self.forces.len() * size_of::<Case>()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use fretwork_engine::outcome::Preview;
    use fretwork_engine::simulation::Simulation;

    use super::*;
    use crate::Study;
    use crate::kinds::tests;
    use fretwork_json as json;

    fn map(change: impl FnOnce(&mut Value)) -> Valid<Arc<Study>> {
        let mut map = json!({
            "scenario": {
                "profile": {"shape": "paraboloid", "radius": "10 mm"},
                "moduli": {"normal": "113 GPa", "tangential": "93 GPa"},
                "friction": 0.7,
                "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
                "load": {"normal_force": "100 N", "held": "depth"},
                "motion": {"amplitude": "2 um"},
                "cycles": [1000],
                "model": {"method": "simplified", "points": 16}
            },
            "normal_force": {"from": "1 N", "to": "1 kN", "count": 7, "spacing": "log"},
            "amplitude": {"from": "0.1 um", "to": "20 um", "count": 12},
        });
        change(&mut map);
        Study::read(&KIND, map).map(Arc::new)
    }

    fn document(study: &Arc<Study>) -> Value {
        let document = tests::document(study, 1);
        assert_eq!(document, tests::document(study, 5));
        document
    }

    fn rounded(number: f64) -> Value {
        serde_json::from_str(&json::write(&number, 20)).unwrap()
    }

    #[test]
    fn the_boundary_of_gross_slip_agrees_with_hertz_and_mindlin() {
        let document = document(&map(|_| {}).unwrap());
        let column = |name: &str| document["boundary"][name].as_array().unwrap().clone();
        let pairs = column(MEMBERS[0]).into_iter().zip(column(MEMBERS[1]));
        let pairs: Vec<_> =
            pairs.map(|(f, u)| (f.as_f64().unwrap(), u.as_f64().unwrap())).collect();
        assert_eq!(pairs.len(), 7);
        for (force, amplitude) in &pairs {
            // K. L. Johnson, Contact Mechanics (1985), (4.22) and (7.41).
            let radius = libm::cbrt(3.0 * force * 0.01 / (4.0 * 113e9));
            let known = 3.0 * 0.7 * force / (4.0 * 93e9 * radius);
            assert!((amplitude - known).abs() < 1e-6 * known, "{force} N: {amplitude} {known}");
        }
        // The regimes of the table change at this curve.
        let table = &document["table"];
        for number in 0..7 * 12 {
            let (force, amplitude) = pairs[number / 12];
            assert_eq!(table[MEMBERS[0]][number].as_f64(), Some(force));
            let slips = table[MEMBERS[1]][number].as_f64().unwrap() > amplitude;
            let regime = if slips { "gross_slip" } else { "partial_slip" };
            assert_eq!(table[REGIME][number], regime, "{number}");
        }
    }

    /// Runs with amplitudes just below and above the boundary show it, unworn and after the last cycle.
    #[test]
    fn the_boundaries_behind_a_rig_separate_partial_and_gross_slip() {
        let changes: [fn(&mut Value); 3] = [
            |map| map["scenario"]["load"]["held"] = json!("force"),
            |map| map["scenario"]["model"]["method"] = json!("exact"),
            |map| {
                map["scenario"]["profile"] =
                    json!({"shape": "cylinder", "radius": "6 mm", "length": "10 mm"});
                map["scenario"]["load"] = json!({"normal_force": "18.5 N/mm"});
                map["scenario"]["motion"]["reference_distance"] = json!("36 mm");
                map["scenario"]["model"] = json!({"points": 16});
                map["normal_force"]["values"] = json!(["8 N/mm", "18.5 N/mm"]);
            },
        ];
        for change in changes {
            let study = map(|map| {
                map["scenario"]["motion"]["rig_stiffness"] = json!("20 N/um");
                map["normal_force"] = json!({"values": ["60 N", "100 N"]});
                map["amplitude"] =
                    json!({"from": "0.5 um", "to": "40 um", "count": 240, "spacing": "log"});
                map["outputs"] = json!(["gross_slip_amplitude"]);
                change(map);
            })
            .unwrap();
            let document = document(&study);
            let regimes = |amplitude: f64, row: usize| {
                let force = document["boundary"][MEMBERS[0]][row].as_f64().unwrap();
                let outcome =
                    Simulation::new(study.problem.case(&[force, amplitude]).unwrap(), Vec::new())
                        .run();
                let stick = outcome.history.stick_radius;
                [stick[0] > 0.0, *stick.last().unwrap() > 0.0]
            };
            for row in [0, 1] {
                let at = |name: &str| document["boundary"][name][row].as_f64().unwrap();
                let [unworn, later] = [at(MEMBERS[1]), at(BESIDE[1])];
                assert!(at(BESIDE[0]) < unworn);
                assert!(regimes(0.999 * unworn, row)[0] && !regimes(1.001 * unworn, row)[0]);
                assert!(
                    regimes(0.998 * later, row)[1] && !regimes(1.002 * later, row)[1],
                    "{unworn} {later}"
                );
            }
            // The rows agree with their own runs, and with the boundary.
            let table = &document["table"];
            for number in (0..480).step_by(37) {
                let amplitude = table[MEMBERS[1]][number].as_f64().unwrap();
                let is_partial = table[REGIME][number] == "partial_slip";
                assert_eq!(is_partial, regimes(amplitude, number / 240)[0], "{number}");
            }
        }
    }

    #[test]
    fn the_unworn_contact_agrees_with_cattaneo_and_mindlin() {
        let document = document(&map(|_| {}).unwrap());
        let [table, boundary] = [&document["table"], &document["boundary"][MEMBERS[1]]];
        for number in 0..7 * 12 {
            let cell = |name: &str| table[name][number].as_f64().unwrap();
            let threshold = cell(MEMBERS[1]) / boundary[number / 12].as_f64().unwrap();
            // With the amplitude Δ in units of the gross-slip threshold: c/a = √(1 − Δ) and Q/μF = 1 − (1 − Δ)^(3/2).
            let rest = (1.0 - threshold).max(0.0).sqrt();
            assert!((cell("unworn.stick_ratio") - rest).abs() < 1e-9, "{number}");
            assert!(
                (cell("unworn.force_ratio") - (1.0 - rest * rest * rest)).abs() < 1e-9,
                "{number}"
            );
        }
    }

    #[test]
    fn the_outputs_of_a_row_equal_those_of_a_single_run() {
        let outputs = |map: &mut Value| map["outputs"] = json!(["wear_volume", "wear_depth@1000"]);
        let line = |map: &mut Value| {
            outputs(map);
            map["scenario"]["profile"] =
                json!({"shape": "cylinder", "radius": "6 mm", "length": "10 mm"});
            map["scenario"]["load"] = json!({"normal_force": "18.5 N/mm"});
            map["scenario"]["motion"] =
                json!({"amplitude": "25 um", "reference_distance": "36 mm"});
            map["scenario"]["model"] = json!({"points": 16});
            map["amplitude"] =
                json!({"from": "0.05 um", "to": "20 um", "count": 12, "spacing": "log"});
            map["normal_force"] = json!({"from": "10 N/mm", "to": "100 N/mm", "count": 3});
        };
        for (study, numbers) in [(map(outputs), [0, 30, 83]), (map(line), [0, 14, 35])] {
            let study = study.unwrap();
            let table = document(&study)["table"].take();
            for number in numbers {
                let case = study.problem.case(&study.point(number)).unwrap();
                let unworn = Preview::of(&case).unworn;
                let history = Simulation::new(case, Vec::new()).run().history;
                let energy = table["unworn.energy_per_cycle"][number].as_f64().unwrap();
                assert!((energy - unworn.energy_per_cycle).abs() < 1e-9 * energy);
                assert_eq!(table["wear_volume"][number], rounded(history.wear_volume[1]));
                assert_eq!(table["wear_depth@1000"][number], rounded(history.wear_depth[1]));
            }
        }
    }

    #[test]
    fn rows_of_a_force_without_a_valid_contact_state_the_reason() {
        let study = map(|map| {
            map["scenario"]["profile"] = json!({"shape": "sphere", "radius": "0.1 mm"});
            map["scenario"]["load"]["normal_force"] = json!("1 N");
            map["normal_force"] = json!({"values": ["1 N", "1 MN"]});
        });
        let document = document(&study.unwrap());
        assert_eq!(document["counts"]["refused"], 12);
        let table = &document["table"];
        assert_eq!(
            (&table[REGIME][12], &document["boundary"][MEMBERS[1]][1]),
            (&Value::Null, &Value::Null)
        );
        assert!(table["reason"][12].as_str().unwrap().contains("/load/normal_force"), "{table}");
        assert_eq!(table["reason"][11], Value::Null);
    }

    #[test]
    fn a_fault_of_a_map_says_what_to_enter() {
        let fault = |change: &dyn Fn(&mut Value)| {
            let fault = map(|map| change(map)).unwrap_err().0.swap_remove(0);
            format!("{}: {}", fault.pointer, fault.detail)
        };
        let depth =
            |map: &mut Value| map["scenario"]["load"] = json!({"indentation_depth": "1 um"});
        assert!(fault(&depth).starts_with("/scenario/load: has no `normal_force`"));
        let ratio = |map: &mut Value| map["scenario"]["motion"] = json!({"stick_ratio": 0.5});
        assert!(fault(&ratio).starts_with("/scenario/motion: has no `amplitude`"));
        let line = |motion: Value| {
            move |map: &mut Value| {
                map["scenario"]["profile"] =
                    json!({"shape": "cylinder", "radius": "6 mm", "length": "10 mm"});
                map["scenario"]["load"] = json!({"normal_force": "18.5 N/mm"});
                map["scenario"]["motion"] = motion.clone();
                map["scenario"]["model"] = json!({});
            }
        };
        assert!(fault(&line(json!({"sliding_amplitude": 1e-5}))).ends_with("`loop_stiffness`"));
        let unmeasured = fault(&line(json!({"amplitude": 1e-5})));
        assert!(unmeasured.starts_with("/scenario/motion/amplitude: needs a reference"));
        assert!(fault(&|map| map["amplitude"]["to"] = json!("1 N")).starts_with("/amplitude/to: "));
        assert!(
            fault(&|map| map["normal_force"]["from"] = json!(0))
                .starts_with("/normal_force/from: must be greater")
        );
        assert!(
            fault(&|map| map["amplitude"] = json!({"from": 1e-6, "to": 2e-6}))
                .starts_with("/amplitude: needs `count`")
        );
        assert!(
            fault(&|map| map["amplitude"] = json!(3)).starts_with("/amplitude: must be a range")
        );
        assert!(
            fault(&|map| map["amplitude"]["count"] = json!(5000))
                .starts_with("/amplitude: has 5000 values")
        );
        assert!(fault(&|map| map["outputs"] = json!(["wear_volum"])).contains("wear_volume"));
    }
}
