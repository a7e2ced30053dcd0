//! Sweeps: the outputs of a scenario for many values of some of its numbers.

use deserr::Deserr;
use fretwork_engine::{Faults, Given, Valid};
use serde::Serialize;
use serde_json::{Value, json};

use crate::plan::StudyFigure::{Curves, Heat, Scatter};
use crate::plan::{Hints, Kind, MAX_POINTS, Offer, Plan, Read};
use crate::problem::{MAX_SEED, Problem, small_members, varied_and_outputs};
use crate::profile::CommonProfiles;
use crate::stats::design::Design;
use crate::vary::{self, Values, Varied};
use fretwork_json::{Whole, both, typed};

/// The kind of sweeps.
pub const KIND: Kind = Kind {
    name: "sweep",
    title: "Sweep",
    rows: "table",
    keeps_profiles: true,
    axes: &[],
    design: "design",
    designs: &[
        ("grid", Hints { is_grid: true, ..Hints::of(&[Curves, Heat]) }),
        ("zip", Hints::of(&[Curves, Scatter])),
        ("latin_hypercube", Hints::of(&[Scatter])),
        ("sobol", Hints::of(&[Scatter])),
    ],
    offers: &[
        Offer {
            id: "sweep",
            title: "Sweep",
            meaning: "all combinations of the values",
            members: r#"{"design": "grid"}"#,
            sample: None,
        },
        Offer {
            id: "random",
            title: "Random sample",
            meaning: "points spread evenly over the ranges (Latin hypercube)",
            members: r#"{"design": "latin_hypercube", "seed": 0}"#,
            sample: Some((1, 0)),
        },
    ],
    read,
};

/// The body of a sweep.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct SweepBody {
    #[deserr(default, rename = "version")]
    _version: Given<Whole<1, 1>>,
    scenario: Value,
    vary: Vec<Value>,
    #[deserr(default)]
    design: Given<DesignName>,
    #[deserr(default)]
    samples: Given<Whole<1, MAX_POINTS>>,
    #[deserr(default)]
    seed: Given<Whole<0, MAX_SEED>>,
    outputs: Value,
    #[deserr(default)]
    profiles: Given<Value>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr, Serialize)]
#[deserr(error = Faults, rename_all = lowercase)]
#[serde(rename_all = "snake_case")]
enum DesignName {
    Grid,
    Zip,
    #[deserr(rename = "latin_hypercube")]
    LatinHypercube,
    Sobol,
}

/// Reads a sweep.
///
/// # Errors
/// All faults, with pointers relative to the sweep.
fn read(sweep: Value) -> Valid<Read> {
    let mut complete = small_members(&sweep);
    let SweepBody { scenario, vary, design, samples, seed, outputs, profiles, .. } = typed(sweep)?;
    let profiles = profiles.0.map(CommonProfiles::read).transpose();
    let profiles = profiles.map_err(|faults| faults.below("/profiles"));
    // If a member or an output has a fault, no design can be made.
    let read = varied_and_outputs(&scenario, &vary, outputs);
    let ((varied, outputs), profiles) = both(read, profiles)?;
    let members = varied.iter().map(|one| one.member.clone()).collect();
    let (name, seed) = (design.0.unwrap_or(DesignName::Grid), seed.0.map_or(0, |seed| seed.0));
    let design = design_of(name, varied, samples.0.map(|samples| samples.0), seed)?;
    complete.insert("design".to_owned(), json!(name));
    if name.is_random() {
        complete.insert("seed".to_owned(), json!(seed));
    } else {
        complete.remove("seed");
    }
    complete.insert("vary".to_owned(), vary.into());
    match &profiles {
        Some(profiles) => complete["profiles"]["fields"] = json!(profiles.fields),
        None => _ = complete.remove("profiles"),
    }
    let problem = Problem { profiles, ..Problem::new(scenario, members, outputs) };
    Ok(Read::new(complete, problem, design))
}

impl Plan for Design {
    fn points(&self) -> usize {
        self.points()
    }

    fn point(&self, number: usize) -> Vec<f64> {
        self.point(number)
    }
}

impl DesignName {
    /// Whether the design draws the values from distributions.
    fn is_random(self) -> bool {
        matches!(self, Self::LatinHypercube | Self::Sobol)
    }
}

/// Builds the design of a sweep. Faults have pointers relative to the sweep.
fn design_of(
    name: DesignName,
    varied: Vec<Varied>,
    samples: Option<u64>,
    seed: u64,
) -> Valid<Design> {
    let random = name.is_random();
    let (mut lists, mut distributions, mut faults) = (Vec::new(), Vec::new(), Faults::default());
    for (place, one) in varied.into_iter().enumerate() {
        let mut wrong = |detail: &str| faults.add(format!("/vary/{place}"), detail);
        match one.values {
            Values::List(_) if random => wrong(
                "lists values, but this design draws them. Enter a range (`from`, `to`) or a `distribution`, or use \
                 the design grid or zip",
            ),
            values if random => match values.drawn() {
                Ok(distribution) => distributions.push(distribution),
                Err(detail) => wrong(&detail),
            },
            Values::List(values) => lists.push(values),
            Values::Range(..) => wrong("needs `count`, the number of values from `from` to `to`"),
            Values::Distribution(_) => wrong(
                "has a distribution, but this design needs values. Enter `values` or a range, or use the design \
                 latin_hypercube or sobol",
            ),
            Values::Base => wrong(vary::NO_VALUES),
        }
    }
    match samples {
        None if random => {
            faults.add("/samples", "is missing. Enter the number of points, such as 1024");
        }
        Some(_) if !random => faults.add(
            "/samples",
            "belongs to the designs latin_hypercube and sobol. The values give the points of this design",
        ),
        _ => {}
    }
    faults.or(())?;
    let points = samples.unwrap_or_default() as usize;
    let made = match name {
        DesignName::Grid => Ok(Design::grid(lists)),
        DesignName::Zip => Design::zip(lists),
        DesignName::LatinHypercube => Ok(Design::latin_hypercube(distributions, points, seed)),
        DesignName::Sobol => Ok(Design::sobol(distributions, points, seed)),
    };
    made.map_err(|fault| Faults(vec![fault]).below("/vary"))
}

#[cfg(test)]
mod tests {
    use fretwork_engine::scenario;
    use std::sync::Arc;

    use fretwork_engine::simulation::Simulation;

    use super::*;
    use crate::Study;
    use crate::kinds::tests;
    use fretwork_json as json;

    fn sweep(change: impl FnOnce(&mut Value)) -> Valid<Arc<Study>> {
        let mut sweep = json!({
            "scenario": {
                "profile": {"shape": "paraboloid", "radius": "10 mm"},
                "moduli": {"normal": "113 GPa", "tangential": "93 GPa"},
                "friction": 0.7,
                "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
                "load": {"normal_force": "100 N", "held": "depth"},
                "motion": {"amplitude": "2 um"},
                "cycles": [1000, 10000],
                "model": {"method": "simplified", "points": 16},
            },
            "vary": [
                {"pointer": "/friction", "values": [0.5, 0.7]},
                {"pointer": "/motion/amplitude", "from": "1 um", "to": "4 um", "count": 4},
            ],
            "outputs": ["wear_volume", "wear_volume@1000", "unworn.stick_radius"],
        });
        change(&mut sweep);
        Study::read(&KIND, sweep).map(Arc::new)
    }

    fn rows(study: &Arc<Study>) -> Vec<Vec<Value>> {
        let document = tests::document(study, 1);
        let table = document["table"].as_object().unwrap();
        let row = |number: usize| table.values().map(|column| column[number].clone()).collect();
        (0..study.points()).map(row).collect()
    }

    #[test]
    fn profiles_of_a_sweep_agree_with_those_of_single_runs() {
        for (method, points) in [("simplified", 64), ("exact", 64)] {
            let study = sweep(|sweep| {
                sweep["scenario"]["model"] = json!({"method": method, "points": points});
                sweep["vary"][0]["values"] = json!([0.5, -1.0]);
                sweep["vary"][1]["count"] = json!(2);
                sweep["outputs"] = json!(["unworn.stick_radius"]);
                let radius = json!({"from": 0, "to": "400 um", "count": 81});
                let fields = ["slip", "wear", "pressure", "worn"];
                sweep["profiles"] = json!({"radius": radius, "fields": fields});
            })
            .unwrap();
            let document = tests::document(&study, 1);
            let profiles = &document["profiles"];
            assert_eq!(profiles["point"], json!([0, 1, 2, 3]));
            assert_eq!(document["units"]["pressure"], "Pa");
            let names: Vec<_> = profiles.as_object().unwrap().keys().collect();
            assert_eq!(names, ["point", "radius", "slip", "wear", "pressure", "worn"]);
            let radii: Vec<f64> = serde_json::from_value(profiles["radius"].clone()).unwrap();
            assert_eq!((radii.len(), radii[1]), (81, 5e-6));

            // A single run has profiles at other radii. So each value of the sweep must lie between two values of the
            // run.
            let mut scenario = study.problem.base.clone();
            scenario["friction"] = json!(0.5);
            scenario["motion"]["amplitude"] = json!(4e-6);
            scenario["profiles_at"] = json!("last");
            let (_, case, _) = scenario::prepare(scenario, "").unwrap();
            let single = Simulation::new(case, Vec::new()).run().profiles.unwrap();
            let beyond = *single.radius.last().unwrap();
            assert!((300e-6..400e-6).contains(&beyond), "{beyond}");
            for (place, radius) in radii.iter().enumerate() {
                let cell = |name: &str| profiles[name][1][place].as_f64();
                let next = single.radius.partition_point(|known| known < radius);
                if next == single.radius.len() {
                    let expected = [None, Some(0.0), Some(0.0), None];
                    assert_eq!(["slip", "wear", "pressure", "worn"].map(cell), expected);
                    continue;
                }
                for (name, curve) in [
                    ("slip", single.slip.last().unwrap()),
                    ("wear", single.wear.last().unwrap()),
                    ("pressure", single.pressure.last().unwrap()),
                    ("worn", single.worn.last().unwrap()),
                ] {
                    let (low, high) = (curve[next.max(1) - 1], curve[next]);
                    let (low, high) = (low.min(high), low.max(high));
                    let found = cell(name).unwrap();
                    let rounding = 1e-11 * high.abs();
                    let is_between = low - rounding <= found && found <= high + rounding;
                    assert!(is_between, "{method} {name}: {low} {found} {high}");
                }
            }
            let deepest = profiles["wear"][1].as_array().unwrap().iter();
            let deepest = deepest.filter_map(Value::as_f64).fold(0.0, f64::max);
            let expected = single.wear.last().unwrap().iter().copied().fold(0.0, f64::max);
            assert!((0.9..=1.0 + 1e-11).contains(&(deepest / expected)), "{deepest} of {expected}");
            assert!(profiles["wear"][2].as_array().unwrap().iter().all(Value::is_null));
        }
    }

    #[test]
    fn a_run_that_ends_early_has_the_profiles_of_its_end() {
        let study = sweep(|sweep| {
            sweep["vary"] = json!([{"pointer": "/until/wear_depth", "values": ["0.1 um", "1 m"]}]);
            sweep["scenario"]["until"] = json!({"wear_depth": "0.1 um"});
            sweep["scenario"]["model"]["points"] = json!(512);
            sweep["outputs"] = json!(["wear_depth", "cycles"]);
            sweep["profiles"] = json!({"radius": {"from": 0, "to": "400 um", "count": 801}});
        });
        let study = study.unwrap();
        let document = tests::document(&study, 2);
        for point in 0..2 {
            let depth = document["table"]["wear_depth"][point].as_f64().unwrap();
            let curve = document["profiles"]["wear"][point].as_array().unwrap().iter();
            let deepest = curve.filter_map(Value::as_f64).fold(0.0, f64::max);
            assert!((0.95..=1.0).contains(&(deepest / depth)), "{deepest} {depth}");
        }
        assert!(document["table"]["cycles"][0].as_f64() < document["table"]["cycles"][1].as_f64());
    }

    #[test]
    fn a_run_that_does_not_reach_its_energies_has_the_profiles_of_its_end() {
        for method in ["simplified", "exact"] {
            let study = sweep(|sweep| {
                sweep["scenario"]["model"]["method"] = json!(method);
                sweep["scenario"]["cycles"] = json!({"dissipated_energy": ["1 mJ", 1e9, 2e9]});
                sweep["outputs"] = json!(["wear_volume"]);
                sweep["profiles"] = json!({"radius": [0, "100 um"]});
            });
            let study = study.unwrap();
            let document = tests::document(&study, 1);
            assert_eq!(document["counts"]["incomplete"], 0, "{method} {document}");
            assert!(document["profiles"]["wear"][7][1].as_f64() > Some(0.0), "{method}");
        }
    }

    #[test]
    fn faults_of_profiles_and_of_other_members_are_in_one_list() {
        let faults = sweep(|sweep| {
            sweep["profiles"] = json!({"radius": [], "field": []});
            sweep["vary"][0]["pointer"] = json!("/frction");
        });
        let Faults(faults) = faults.unwrap_err();
        let pointers: Vec<_> = faults.iter().map(|fault| fault.pointer.as_str()).collect();
        assert_eq!(pointers, ["/vary/0/pointer", "/profiles/field"]);
    }

    #[test]
    fn a_row_equals_the_outputs_of_a_single_run() {
        let study = sweep(|_| ()).unwrap();
        let rows = rows(&study);
        assert_eq!((study.points(), rows.len()), (8, 8));
        let [friction, amplitude] = [&rows[5][0], &rows[5][1]];
        assert_eq!((friction, amplitude), (&json!(0.7), &json!(2e-6)));
        let (_, case, _) = scenario::prepare(study.problem.base.clone(), "").unwrap();
        let single = Simulation::new(case, Vec::new()).run();
        let rounded = |number: f64| json::write(&number, 20).parse::<f64>().unwrap();
        assert_eq!(rows[5][2], json!(rounded(single.history.wear_volume[2])));
        assert_eq!(rows[5][3], json!(rounded(single.history.wear_volume[1])));
        assert_eq!(rows[5][5], Value::Null, "there is no reason");
    }

    #[test]
    fn the_rows_do_not_depend_on_the_number_of_chunks() {
        let study = sweep(|_| ()).unwrap();
        let rows = |chunks| tests::rows(&study, chunks).to_bytes();
        for chunks in 2..=8 {
            assert_eq!(rows(chunks), rows(1), "{chunks} chunks");
        }
    }

    #[test]
    fn the_canonical_form_is_in_si_and_reading_it_again_changes_nothing() {
        let study = sweep(|_| ()).unwrap();
        let in_si = sweep(|sweep| {
            sweep["scenario"]["profile"]["radius"] = json!(0.01);
            sweep["scenario"]["load"] = json!({"held": "depth", "normal_force": "0.1 kN"});
            sweep["scenario"]["profiles_at"] = json!("last");
            sweep["vary"][1]["to"] = json!(4e-6);
            sweep["design"] = json!("grid");
            sweep["seed"] = json!(5);
        });
        assert_eq!(study.canonical.to_string(), in_si.unwrap().canonical.to_string());
        let again = Study::read(&KIND, study.canonical.clone()).unwrap();
        assert_eq!(study.canonical.to_string(), again.canonical.to_string());
        assert_eq!(study.canonical["scenario"]["profile"]["radius"], json!(0.01));
        assert_eq!(study.canonical["vary"][1]["from"], json!(1e-6));
    }

    #[test]
    fn the_row_of_an_invalid_scenario_states_the_reason() {
        let sweep = sweep(|sweep| {
            sweep["vary"][0]["values"] = json!([0.7, -0.1]);
        });
        let rows = rows(&sweep.unwrap());
        assert_eq!(rows[0][5], Value::Null);
        assert_eq!(rows[4][2], Value::Null);
        assert!(rows[4][5].as_str().unwrap().starts_with("/friction: must be greater than 0"));
    }

    #[test]
    fn all_faults_are_listed_with_their_pointers() {
        let faults = sweep(|sweep| {
            sweep["scenario"]["profile"]["radius"] = json!("-1 mm");
            sweep["vary"][0]["pointer"] = json!("/frction");
            sweep["vary"][1]["from"] = json!("1 GPa");
            sweep["outputs"][1] = json!("wear_volume@1001");
        });
        let mut pointers: Vec<String> =
            faults.unwrap_err().0.into_iter().map(|fault| fault.pointer).collect();
        pointers.sort_unstable();
        assert_eq!(
            pointers,
            ["/outputs/1", "/scenario/profile/radius", "/vary/0/pointer", "/vary/1/from"]
        );
    }

    #[test]
    fn a_design_refuses_values_that_it_cannot_use() {
        let fault = |change: &dyn Fn(&mut Value)| {
            let fault = sweep(|sweep| change(sweep)).unwrap_err().0.swap_remove(0);
            format!("{}: {}", fault.pointer, fault.detail)
        };
        let random = |sweep: &mut Value| {
            sweep["design"] = json!("sobol");
            sweep["samples"] = json!(8);
        };
        assert!(fault(&random).starts_with("/vary/0: lists values"));
        let without_samples = |sweep: &mut Value| {
            sweep["design"] = json!("sobol");
            sweep["vary"] = json!([{"pointer": "/friction", "from": 0.1, "to": 0.9}]);
        };
        assert!(fault(&without_samples).starts_with("/samples: is missing"));
        assert!(fault(&|sweep| sweep["samples"] = json!(8)).starts_with("/samples: belongs"));
        assert!(
            fault(&|sweep| sweep["design"] = json!("zip")).starts_with("/vary/1: has 4 values")
        );
        let twice = |sweep: &mut Value| sweep["vary"][1] = sweep["vary"][0].clone();
        assert_eq!(fault(&twice), "/vary/1/pointer: is listed twice");
    }
}
