//! Sensitivities: which numbers of a scenario matter for its outputs.
//!
//! | method | numbers for each output and member | points for d members |
//! |---|---|---|
//! | `sobol` | the shares of the variance, see [`indices`](crate::stats::indices) | `samples`·(d + 2) |
//! | `morris` | elementary effects, see [`morris`](crate::stats::morris) | `samples`·(d + 1) |
//! | `local` | elasticities x/y·dy/dx at the values of the scenario, see [`derivative`](crate::stats::derivative) | 1 + 80·d |
//!
//! All points are known in advance, so they are computed in chunks like those of a sweep. The table is made from their
//! rows, see [`findings`].

mod findings;

use deserr::Deserr;
use fretwork_engine::{Case, Faults, Given, Method as RunMethod, Valid};
use serde::Serialize;
use serde_json::{Value, json};

use self::findings::{EstimateTable, Named};
use crate::output::Output;
use crate::plan::StudyFigure::{Scatter, Tornado};
use crate::plan::{Bars, Column, Findings, GoesOn, Hints, Kind, Offer, Plan, Read, StudyFigure};
use crate::problem::{MAX_SEED, Problem, small_members, varied_and_outputs};
use crate::rows::{NUMBER, Rows};
use crate::stats::derivative::{Derivative, MAX_ROUNDS, SearchPoint, derivatives, neighbours};
use crate::stats::distribution::Distribution;
use crate::stats::indices::Saltelli;
use crate::stats::morris::{Morris, effects};
use crate::stats::{Bootstrap, MAX_BLOCKS};
use crate::vary::{Values, Varied};
use fretwork_json::{Whole, typed};

/// The kind of sensitivity studies.
pub const KIND: Kind = Kind {
    name: "sensitivity",
    title: "Sensitivity study",
    rows: "samples",
    keeps_profiles: false,
    axes: &[],
    design: "method",
    designs: &[
        ("local", bars(&[Tornado], "Elasticity", &[("elasticity", "")], false)),
        ("morris", bars(&[Tornado, Scatter], "Elementary effect", EFFECTS, true)),
        ("sobol", bars(&[Tornado, Scatter], "Share of the variance", SHARES, false)),
    ],
    offers: &[Offer {
        id: "sensitivity",
        title: "Sensitivity",
        meaning: "which number matters most (Sobol indices)",
        members: r#"{"method": "sobol", "seed": 0, "confidence": 0.95}"#,
        sample: Some((2, 1)),
    }],
    read,
};

/// The columns that figures show as bars, with their names in the legend: for Morris screenings, then for Sobol
/// indices.
const EFFECTS: &[(&str, &str)] =
    &[("strength", "$μ$* (mean size)"), ("deviation", "$σ$ (deviation)")];
const SHARES: &[(&str, &str)] = &[("total", "total"), ("first_order", "first order")];

const fn bars(
    figures: &'static [StudyFigure],
    label: &'static str,
    columns: &'static [(&'static str, &'static str)],
    have_unit: bool,
) -> Hints {
    Hints { bars: Some(Bars { label, columns, have_unit }), ..Hints::of(figures) }
}

/// Number of levels of each coordinate in a Morris screening.
const LEVELS: usize = 4;
/// Processor time of one addition when the sums of a resample are computed, in seconds.
const ADDITION: f64 = 1e-9;
/// Default of `confidence`: the share of the resamples whose estimates lie in an interval.
const CONFIDENCE: f64 = 0.95;
/// Minimum and maximum number of resamples of an interval. Between these limits, ten of them lie outside of the
/// interval.
const RESAMPLES: (f64, f64) = (400.0, 10_000.0);
/// Relative error of outputs that are known without a run. They are rounded to 12 digits.
const ROUNDING: f64 = 1e-11;
/// Maximum bytes of a note, without the names of the output and the member.
const NOTE: usize = 320;
/// Relative error of the simplified rule.
const RULE: f64 = 1e-3;

/// Relative error of the contact radius and the scar radius, divided by the square root of the tolerance. The error is
/// half a cell, and the number of cells is inversely proportional to the square root of the tolerance: 52 cells at
/// 0.003.
const EDGE: f64 = 0.18;

/// The body of a sensitivity study.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct SensitivityBody {
    #[deserr(default, rename = "version")]
    _version: Given<Whole<1, 1>>,
    scenario: Value,
    vary: Vec<Value>,
    #[deserr(default)]
    method: Given<MethodName>,
    #[deserr(default)]
    samples: Given<Whole<2, 0xffff_ffff>>,
    #[deserr(default)]
    seed: Given<Whole<0, MAX_SEED>>,
    #[deserr(default)]
    confidence: Given<f64>,
    outputs: Value,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr, Serialize)]
#[deserr(error = Faults, rename_all = lowercase)]
#[serde(rename_all = "snake_case")]
enum MethodName {
    Sobol,
    Morris,
    Local,
}

/// The points of a sensitivity study, and how its table follows from their rows.
#[derive(Debug)]
enum Sensitivity {
    Sobol { design: Saltelli, groups: usize, from: Vec<Distribution>, bootstrap: Bootstrap },
    Morris { design: Morris, trajectories: usize, from: Vec<Distribution>, bootstrap: Bootstrap },
    Local(Vec<Neighbourhood>),
}

/// The points at which the derivative with respect to one member is computed.
#[derive(Debug)]
struct Neighbourhood {
    place: SearchPoint,
    /// The index of the first of these points among the points of the study.
    first: usize,
    /// Those of all intervals. The point itself is the first point of the study.
    points: Vec<f64>,
}

impl Neighbourhood {
    /// The derivative of an output, from its values at the points of the study.
    fn derivative(&self, values: &[Option<f64>], accuracy: f64) -> Option<Derivative> {
        let mut own = values[..1].iter().chain(&values[self.first..]).map(|value| vec![*value]);
        let next = |_| own.next().ok_or(());
        derivatives(self.place, &[accuracy], MAX_ROUNDS, next).ok()?[0]
    }
}

/// Reads a sensitivity study.
///
/// # Errors
/// All faults, with pointers relative to the study.
fn read(study: Value) -> Valid<Read> {
    let mut complete = small_members(&study);
    let SensitivityBody { scenario, vary, method, samples, seed, confidence, outputs, .. } =
        typed(study)?;
    // If a member or an output has a fault, no design can be made.
    let (varied, outputs) = varied_and_outputs(&scenario, &vary, outputs)?;
    let members = varied.iter().map(|one| one.member.clone()).collect();
    let name = method.0.unwrap_or(MethodName::Sobol);
    let samples = samples.0.map(|samples| samples.0 as usize);
    let mut add = |member: &str, value| complete.insert(member.to_owned(), value);
    add("method", json!(name));
    add("vary", vary.into());
    let plan = if name == MethodName::Local {
        for drawn in ["seed", "confidence"] {
            complete.remove(drawn);
        }
        Sensitivity::local(varied, samples)?
    } else {
        let (seed, confidence) =
            (seed.0.map_or(0, |seed| seed.0), confidence.0.unwrap_or(CONFIDENCE));
        add("seed", json!(seed));
        add("confidence", json!(confidence));
        Sensitivity::drawn(name, varied, samples, seed, confidence)?
    };
    Ok(Read::new(complete, Problem::new(scenario, members, outputs), plan))
}

impl Sensitivity {
    /// A study by the method Sobol or Morris, which draw the values of the members.
    fn drawn(
        name: MethodName,
        varied: Vec<Varied>,
        samples: Option<usize>,
        seed: u64,
        confidence: f64,
    ) -> Valid<Self> {
        let mut faults = Faults::default();
        let from = Faults::list(varied.into_iter().map(|one| one.values.drawn()));
        let from = faults.keep("/vary", from);
        if samples.is_none() {
            let detail = match name {
                MethodName::Sobol => {
                    "is missing. Enter the number of groups of points, best a power of two such as 1024. Each group \
                     has 2 points more than there are numbers in `vary`"
                }
                _ => {
                    "is missing. Enter the number of trajectories, such as 20. Each trajectory has 1 point more than \
                     there are numbers in `vary`"
                }
            };
            faults.add("/samples", detail);
        }
        let resamples = (10.0 / (1.0 - confidence)).ceil().clamp(RESAMPLES.0, RESAMPLES.1);
        let bootstrap = Bootstrap::new(resamples as usize, confidence, seed);
        let bootstrap = faults.keep("/confidence", bootstrap.map_err(str::to_owned));
        let (Some(from), Some(samples), Some(bootstrap)) = (from, samples, bootstrap) else {
            return Err(faults);
        };
        let members = from.len();
        Ok(if name == MethodName::Sobol {
            let design = Saltelli::new(members, seed);
            Self::Sobol { design, groups: samples, from, bootstrap }
        } else {
            let design = Morris::new(members, LEVELS, seed);
            Self::Morris { design, trajectories: samples, from, bootstrap }
        })
    }

    /// A study by the method `local`, at the values of the scenario.
    fn local(varied: Vec<Varied>, samples: Option<usize>) -> Valid<Self> {
        let mut faults = Faults::default();
        if samples.is_some() {
            faults.add("/samples", "belongs to the methods sobol and morris. Remove it");
        }
        let (mut around, mut first) = (Vec::new(), 1);
        for (place, Varied { member, values }) in varied.into_iter().enumerate() {
            let wrong = match values {
                Values::Base if member.value != 0.0 => None,
                Values::Base => Some(
                    "is 0 in the scenario. An elasticity is relative to the value of the scenario, so choose another \
                     number, or another value",
                ),
                _ => Some(
                    "has values, but elasticities hold for the value in the scenario. Enter only the `pointer`, or use \
                     the method sobol or morris",
                ),
            };
            if let Some(detail) = wrong {
                faults.add(format!("/vary/{place}"), detail);
                continue;
            }
            let x = member.value;
            let place =
                SearchPoint { x, scale: x.abs(), low: f64::NEG_INFINITY, high: f64::INFINITY };
            let points: Vec<f64> =
                (0..MAX_ROUNDS).flat_map(|round| neighbours(place, round)).collect();
            let next = first + points.len();
            around.push(Neighbourhood { place, first, points });
            first = next;
        }
        faults.or(Self::Local(around))
    }

    /// The columns of numbers in the table.
    fn numbers(&self) -> &'static [&'static str] {
        match self {
            Self::Sobol { .. } => &[
                "first_order",
                "first_order_low",
                "first_order_high",
                "total",
                "total_low",
                "total_high",
            ],
            Self::Morris { .. } => {
                &["mean", "strength", "strength_low", "strength_high", "deviation"]
            }
            Self::Local(_) => &["elasticity", "elasticity_low", "elasticity_high"],
        }
    }

    fn table(
        &self,
        members: &[&str],
        outputs: &[Named<'_>],
        rows: &Rows,
        goes_on: GoesOn<'_>,
    ) -> Option<Findings> {
        let mut table = EstimateTable::new(self.numbers());
        for (place, output) in outputs.iter().enumerate() {
            if !goes_on() {
                return None;
            }
            let values = rows.numbers(members.len() + place);
            match self {
                Self::Sobol { bootstrap, .. } => {
                    table.shares(*output, members, &values, bootstrap);
                }
                Self::Morris { design, trajectories, bootstrap, .. } => {
                    let found = effects(design, &values, bootstrap);
                    table.effects(*output, members, &found, *trajectories);
                }
                Self::Local(around) => {
                    let y = values[0].unwrap_or_default();
                    for (member, one) in members.iter().zip(around) {
                        let found = one.derivative(&values, output.accuracy);
                        table.elasticity(*output, member, (one.place.x, y), found);
                    }
                }
            }
        }
        Some(table.finished())
    }
}

impl Plan for Sensitivity {
    fn points(&self) -> usize {
        match self {
            Self::Sobol { design, groups, .. } => groups * design.group(),
            Self::Morris { design, trajectories, .. } => trajectories * design.trajectory(),
            Self::Local(around) => 1 + around.iter().map(|one| one.points.len()).sum::<usize>(),
        }
    }

    fn point(&self, number: usize) -> Vec<f64> {
        let quantiles = |from: &[Distribution], at: Vec<f64>| {
            from.iter().zip(at).map(|(distribution, at)| distribution.quantile(at)).collect()
        };
        match self {
            Self::Sobol { design, from, .. } => quantiles(from, design.point(number)),
            Self::Morris { design, from, .. } => quantiles(from, design.point(number)),
            Self::Local(around) => around
                .iter()
                .map(|one| {
                    let own = number.checked_sub(one.first).and_then(|own| one.points.get(own));
                    own.copied().unwrap_or(one.place.x)
                })
                .collect(),
        }
    }

    fn found_columns(&self) -> Vec<Column> {
        let unit = match self {
            // These columns have the unit of the output, which the column `unit` states in each row.
            Self::Morris { .. } => "as in column unit",
            Self::Sobol { .. } | Self::Local(_) => "1",
        };
        self.numbers().iter().map(|name| Column::new(name, unit)).collect()
    }

    fn findings(&self, problem: &Problem, rows: &Rows, goes_on: GoesOn<'_>) -> Option<Findings> {
        let members: Vec<_> =
            problem.members.iter().map(|member| member.pointer.as_str()).collect();
        let base: Vec<f64> = problem.members.iter().map(|member| member.value).collect();
        let case = problem.case(&base).ok();
        let outputs = problem.outputs.iter().map(|output| Named {
            name: output.name(),
            unit: output.unit(),
            accuracy: accuracy(case.as_ref(), output),
        });
        self.table(&members, &outputs.collect::<Vec<_>>(), rows, goes_on)
    }

    fn findings_seconds(&self, problem: &Problem) -> f64 {
        let members = problem.members.len();
        // `drawn` is the number of rows or blocks in a resample, and `additions` the number of columns that are summed.
        let (bootstrap, drawn, additions) = match self {
            Self::Sobol { groups, bootstrap, .. } => (bootstrap, *groups, 2 * members + 4),
            Self::Morris { trajectories, bootstrap, .. } => (bootstrap, *trajectories, 8 * members),
            Self::Local(_) => return 0.0,
        };
        let drawn = bootstrap.resamples * drawn.min(MAX_BLOCKS) * problem.outputs.len();
        ADDITION * drawn as f64 * additions as f64
    }

    fn findings_bytes(&self, problem: &Problem) -> usize {
        // The names of the output and of the member are in the table, and again in a note.
        let cells = NUMBER * (self.numbers().len() + 1) + NOTE;
        let of_members = |output: &Output| -> usize {
            let members = problem.members.iter();
            members.map(|member| cells + 2 * (member.pointer.len() + output.name().len())).sum()
        };
        let of_output = |output: &Output| of_members(output) + 2 * (NOTE + output.name().len());
        problem.outputs.iter().map(of_output).sum()
    }
}

/// The relative error that an output of a case can have.
fn accuracy(case: Option<&Case>, output: &Output) -> f64 {
    match case.map(|case| case.method) {
        _ if !output.needs_run() => ROUNDING,
        // The estimate of an error may itself be wrong by 100 %.
        _ if output.is_error() => 1.0,
        Some(RunMethod::Exact { tolerance, .. }) if output.is_edge() => {
            tolerance.max(EDGE * tolerance.sqrt())
        }
        Some(RunMethod::Exact { tolerance, .. }) => tolerance,
        Some(RunMethod::Simplified { .. }) | None => RULE,
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;
    use std::sync::Arc;

    use super::*;
    use crate::Study;
    use crate::kinds::tests::{document, rows};
    use crate::problem::Found;

    /// A test function in place of the engine, with the Sobol indices Sᵢ and Tᵢ of each member.
    struct Model {
        from: Distribution,
        f: fn(&[f64]) -> f64,
        indices: Vec<[f64; 2]>,
    }

    /// The Ishigami function. The tests of the module `indices` name the sources of the test functions.
    fn ishigami() -> Model {
        let quartic = PI * PI * PI * PI;
        let first = 0.5 * (1.0 + 0.02 * quartic) * (1.0 + 0.02 * quartic);
        let (second, mixed) = (49.0 / 8.0, 8.0 / 225.0 * 0.01 * quartic * quartic);
        let variance = first + second + mixed;
        let indices = [[first, first + mixed], [second, second], [0.0, mixed]];
        Model {
            from: Distribution::uniform(-PI, PI).unwrap(),
            f: |x| {
                let [a, b] = [libm::sin(x[0]), libm::sin(x[1])];
                a + 7.0 * b * b + 0.1 * libm::pow(x[2], 4.0) * a
            },
            indices: indices.map(|pair| pair.map(|part| part / variance)).to_vec(),
        }
    }

    fn sobol_g() -> Model {
        const A: [f64; 8] = [0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0];
        let own = A.map(|a| 1.0 / (3.0 * (1.0 + a) * (1.0 + a)));
        let product: f64 = own.iter().map(|v| 1.0 + v).product();
        let variance = product - 1.0;
        Model {
            from: Distribution::uniform(0.0, 1.0).unwrap(),
            f: |x| x.iter().zip(A).map(|(x, a)| ((4.0 * x - 2.0).abs() + a) / (1.0 + a)).product(),
            indices: own.map(|v| [v / variance, v * product / (1.0 + v) / variance]).to_vec(),
        }
    }

    impl Model {
        /// The table and the notes of a study of this function.
        fn study(&self, name: MethodName, samples: usize, seed: u64) -> Value {
            let from = vec![self.from; self.indices.len()];
            let bootstrap = Bootstrap::new(200, 0.95, 1).unwrap();
            let members = from.len();
            let study = if name == MethodName::Sobol {
                let design = Saltelli::new(members, seed);
                Sensitivity::Sobol { design, groups: samples, from, bootstrap }
            } else {
                let design = Morris::new(members, LEVELS, seed);
                Sensitivity::Morris { design, trajectories: samples, from, bootstrap }
            };
            let mut rows = Rows::default();
            for number in 0..study.points() {
                let values = study.point(number);
                let outputs = vec![Some((self.f)(&values))];
                rows.push(&values, &Found { outputs, profiles: Vec::new(), lack: None });
            }
            let members = ["a", "b", "c", "d", "e", "f", "g", "h"];
            let output = Named { name: "y", unit: "1", accuracy: ROUNDING };
            let members = &members[..self.indices.len()];
            let findings = study.table(members, &[output], &rows, &mut || true).unwrap();
            findings.members.into_iter().collect()
        }

        /// How many of the intervals of the Sobol indices contain the index.
        fn covered(&self, samples: usize, seed: u64) -> usize {
            let found = self.study(MethodName::Sobol, samples, seed);
            let number =
                |column: &str, place: usize| found["table"][column][place].as_f64().unwrap();
            let contains = |name: &str, place: usize, index: f64| {
                let low = number(&format!("{name}_low"), place);
                low <= index && index <= number(&format!("{name}_high"), place)
            };
            let indices = self.indices.iter().enumerate();
            indices
                .map(|(place, [first, total])| {
                    usize::from(contains("first_order", place, *first))
                        + usize::from(contains("total", place, *total))
                })
                .sum()
        }
    }

    #[test]
    fn intervals_of_16384_groups_contain_the_true_indices() {
        for model in [ishigami(), sobol_g()] {
            assert_eq!(model.covered(1 << 14, 1), 2 * model.indices.len());
        }
    }

    #[test]
    fn intervals_of_95_percent_contain_595_of_600_true_indices() {
        let model = ishigami();
        let covered: usize = (0..100).map(|seed| model.covered(256, seed)).sum();
        assert_eq!(covered, 595, "of 600");
    }

    #[test]
    fn a_screening_finds_the_strong_members() {
        let found = sobol_g().study(MethodName::Morris, 100, 1);
        let strength = |place: usize| found["table"]["strength"][place].as_f64().unwrap();
        assert!(strength(0) > 2.0 * strength(2) && strength(2) > 5.0 * strength(5), "{found:?}");
        assert_eq!(found["notes"], json!([]));
    }

    fn study(change: impl FnOnce(&mut Value)) -> Valid<Arc<Study>> {
        let mut study = json!({
            "scenario": {
                "profile": {"shape": "paraboloid", "radius": "10 mm"},
                "moduli": {"normal": "113 GPa", "tangential": "93 GPa"},
                "friction": 0.7,
                "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
                "load": {"normal_force": "100 N", "held": "force"},
                "motion": {"amplitude": "2 um"},
                "cycles": [1000],
                "model": {"method": "simplified", "points": 16}
            },
            "vary": [
                {"pointer": "/friction", "from": 0.5, "to": 0.9},
                {"pointer": "/load/normal_force", "distribution": {"normal": {"mean": "100 N", "standard_deviation": "5 N"}}},
            ],
            "samples": 64,
            "outputs": ["unworn.gross_slip_amplitude"],
        });
        change(&mut study);
        Study::read(&KIND, study).map(Arc::new)
    }

    #[test]
    fn the_findings_ask_before_each_output_whether_to_continue() {
        let outputs = json!(["unworn.gross_slip_amplitude", "wear_volume", "wear_depth"]);
        let study = study(|study| study["outputs"] = outputs).unwrap();
        let mut asked = 0;
        let mut goes_on = || {
            asked += 1;
            asked < 2
        };
        assert_eq!(study.document_while(&"key", &"engine", rows(&study, 1), &mut goes_on), None);
        assert_eq!(asked, 2);
    }

    fn local(study: &mut Value, outputs: &Value) {
        study["method"] = json!("local");
        study["outputs"] = outputs.clone();
        study["vary"] = ["/friction", "/load/normal_force", "/profile/radius"]
            .into_iter()
            .map(|pointer| json!({"pointer": pointer}))
            .collect();
        study.as_object_mut().unwrap().remove("samples");
    }

    #[test]
    fn the_unit_of_elementary_effects_is_the_unit_column_of_the_table() {
        let study = study(|study| study["method"] = json!("morris")).unwrap();
        let document = document(&study, 1);
        assert_eq!(document["table"]["unit"][0], "m");
        assert_eq!(document["units"]["strength"], "as in column unit");
    }

    #[test]
    fn the_elasticities_of_a_power_law_equal_its_exponents() {
        // U = μ(E*/G*)·d with d³ = 9F²/(16E*²R).
        let study = study(|study| local(study, &json!(["unworn.gross_slip_amplitude"]))).unwrap();
        assert_eq!(study.points(), 1 + 80 * 3);
        let table = document(&study, 1)["table"].take();
        assert_eq!(table["member"], json!(["/friction", "/load/normal_force", "/profile/radius"]));
        for (place, exponent) in [1.0, 2.0 / 3.0, -1.0 / 3.0].into_iter().enumerate() {
            let [value, low, high] = ["elasticity", "elasticity_low", "elasticity_high"]
                .map(|column| table[column][place].as_f64().unwrap());
            assert!((value - exponent).abs() < 1e-7, "{table}");
            assert!(low <= exponent && exponent <= high && high - low < 1e-6, "{table}");
        }
    }

    #[test]
    fn the_interval_of_the_elasticity_of_wear_contains_the_true_value() {
        // In the first cycles, the wear volume is proportional to the wear coefficient, so the elasticity is 1.
        let study = study(|study| {
            local(study, &json!(["wear_volume", "events.rim_reached"]));
            study["vary"] = json!([{"pointer": "/wear/coefficient"}]);
            study["scenario"]["cycles"] = json!([1]);
        });
        let document = document(&study.unwrap(), 1);
        let [value, low, high] = ["elasticity", "elasticity_low", "elasticity_high"]
            .map(|column| document["table"][column][0].as_f64().unwrap());
        assert!(low <= 1.0 && 1.0 <= high && (value - 1.0).abs() < 1e-3, "{value} {low} {high}");
        assert_eq!(document["table"]["elasticity"][1], Value::Null);
        let note = &document["notes"][0];
        assert_eq!(
            (&note["output"], &note["member"]),
            (&json!("events.rim_reached"), &json!("/wear/coefficient"))
        );
    }

    #[test]
    fn notes_say_what_limits_the_estimates() {
        let details = |change: &dyn Fn(&mut Value)| {
            let document = document(&study(|study| change(study)).unwrap(), 1);
            let notes = document["notes"].as_array().unwrap().clone();
            let text = |note: &Value| note["detail"].as_str().unwrap().to_owned();
            (document, notes.iter().map(text).collect::<Vec<_>>())
        };
        let (document, notes) = details(&|_| {});
        assert!(notes.is_empty(), "{notes:?}");
        let total = document["table"]["total"][0].as_f64().unwrap();
        assert!((0.8..1.0).contains(&total), "{total}");
        assert_eq!(document["samples"]["reason"].as_array().unwrap().len(), 64 * 4);
        assert_eq!(document["units"]["/load/normal_force"], json!("N"));

        let (_, notes) = details(&|study| study["samples"] = json!(65));
        assert!(notes[0].contains("65, is not a power of two"), "{notes:?}");

        let (document, notes) =
            details(&|study| study["outputs"] = json!(["unworn.normal_modulus"]));
        assert!(notes[0].contains("same value at all points"), "{notes:?}");
        assert_eq!(document["table"]["first_order"], json!([null, null]));

        let wide = |study: &mut Value| study["vary"][0]["from"] = json!(-0.02);
        let (document, notes) = details(&wide);
        assert!(document["counts"]["refused"].as_u64().unwrap() > 0);
        assert!(notes[0].contains("of 64 groups of points are left out"), "{notes:?}");

        let screened = |study: &mut Value| {
            wide(study);
            study["method"] = json!("morris");
        };
        let (document, notes) = details(&screened);
        assert_eq!(document["table"]["unit"], json!(["m", "m"]));
        assert!(notes[0].contains("of 64 elementary effects are left out"), "{notes:?}");
    }

    #[test]
    fn a_fault_of_a_sensitivity_study_says_what_to_enter() {
        let fault = |change: &dyn Fn(&mut Value)| {
            let fault = study(|study| change(study)).unwrap_err().0.swap_remove(0);
            format!("{}: {}", fault.pointer, fault.detail)
        };
        let without = |study: &mut Value| {
            study.as_object_mut().unwrap().remove("samples");
        };
        assert!(fault(&without).starts_with("/samples: is missing. Enter the number of groups"));
        assert!(
            fault(&|study| study["samples"] = json!(1))
                .starts_with("/samples: must be a whole number")
        );
        assert!(
            fault(&|study| study["confidence"] = json!(95))
                .starts_with("/confidence: must be from 0.5")
        );
        assert!(
            fault(&|study| study["vary"][0]["count"] = json!(3))
                .starts_with("/vary/0: lists values")
        );
        assert!(
            fault(&|study| study["vary"][0] = json!({"pointer": "/friction"}))
                .starts_with("/vary/0: must have either")
        );
        assert!(fault(&|study| study["method"] = json!("sobl")).contains("sobol"));
        let sampled = |study: &mut Value| {
            local(study, &json!(["unworn.stick_radius"]));
            study["samples"] = json!(4);
        };
        assert!(fault(&sampled).starts_with("/samples: belongs to"));
        let ranged = |study: &mut Value| {
            local(study, &json!(["unworn.stick_radius"]));
            study["vary"][1]["from"] = json!(1);
            study["vary"][1]["to"] = json!(2);
        };
        assert!(fault(&ranged).starts_with("/vary/1: has values, but elasticities"));
    }
}
