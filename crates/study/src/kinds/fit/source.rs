//! Runs that predict measured numbers, as a function of the parameters.

use fretwork_engine::numeric::twelve_digits;
use fretwork_engine::request::fault::Faults;
use serde_json::{Value, json};

use super::model::{Parameter, Quantity, Set};
use crate::member::Member;
use crate::output::OutputName;
use crate::problem::{Found, Problem};
use crate::profile::CommonProfiles;

/// The wear coefficients. They only rescale the cycles if nothing else depends on them.
const COEFFICIENTS: [&str; 2] = ["/wear/coefficient", ENERGY_COEFFICIENT];
const ENERGY_COEFFICIENT: &str = "/wear/energy_coefficient";
/// Members of a scenario that depend on the cycles in another way.
const CYCLIC: [&str; 4] = ["/until", "/motion/blocks", "/motion/reversals", "/wear/bodies"];
/// The columns that are counted over the cycles. All others follow from the wear so far.
const COUNTED: [&str; 2] = ["dissipated_energy", "cycles"];
/// A run is shared by coefficients up to this factor above and below its own.
const SHARED: f64 = std::f64::consts::SQRT_2;
/// The ratio of consecutive output cycles of a run that several coefficients share. Cubic interpolation between them
/// has an error of about 1e-6.
const RATIO: f64 = 1.19;
/// Maximum number of these output cycles.
const MAX_NODES: f64 = 240.0;

/// What the runs of a source have in common: the test; cycles or energies; the cycle and the body of a profile.
pub type Need = (usize, &'static str, Option<(f64, Option<usize>)>);

/// The runs of a test: its scenario at some output cycles, with parameters as members.
#[derive(Debug)]
pub struct Source {
    pub problem: Problem,
    /// The parameter of each member of the problem.
    pub parameters: Vec<usize>,
    /// The index among the members of the parameter that only rescales the cycles.
    rescaled: Option<usize>,
    /// The output cycles, or the energies, ascending.
    nodes: Vec<f64>,
    /// The names of the columns of the history. The outputs of the problem are all nodes of the first column, then of
    /// the second one, and so on.
    columns: Vec<&'static str>,
    /// The energy coefficient, if the wear volume is this number times the energy: the index among the members, and the
    /// value in the scenario. Then the volume needs no run.
    line: Option<(Option<usize>, f64)>,
}

/// The need of a set.
pub fn need(set: &Set) -> Need {
    let profile = match set.quantity {
        Quantity::Profile { at, body, .. } => Some((at, body)),
        Quantity::Column { .. } => None,
    };
    (set.test, set.over(), profile)
}

/// Whether a coefficient with this pointer only rescales the cycles of a scenario.
fn only_rescales(pointer: &str, scenario: &Value) -> bool {
    let is_number = |value: &Value| value.is_number() || value.is_string();
    COEFFICIENTS.contains(&pointer)
        && scenario.pointer(pointer).is_some_and(is_number)
        && scenario.get("friction").is_some_and(is_number)
        && CYCLIC.iter().all(|pointer| scenario.pointer(pointer).is_none())
}

/// The output cycles of a run that several coefficients share.
fn shared_nodes(low: f64, high: f64) -> Vec<f64> {
    let (from, to) = (low / (SHARED * RATIO * RATIO), high * SHARED * RATIO * RATIO);
    let count = (libm::log(to / from) / libm::log(RATIO)).ceil().min(MAX_NODES);
    let node = |place: u32| twelve_digits(from * libm::pow(to / from, f64::from(place) / count));
    (0..=count as u32).map(node).collect()
}

impl Source {
    /// The runs that predict these sets, which have the same need. `own` are the parameters of their test, with their
    /// indices.
    ///
    /// # Errors
    /// The scenario or a parameter is not valid.
    pub fn new(
        mut scenario: Value,
        sets: &[&Set],
        own: &[(usize, &Parameter)],
    ) -> Result<Self, Faults> {
        let (mut nodes, mut columns) = (Vec::new(), Vec::new());
        let mut curves = CommonProfiles { radii: Vec::new(), fields: Vec::new(), body: None };
        for set in sets {
            match set.quantity {
                Quantity::Column { column, .. } => {
                    nodes.extend_from_slice(&set.x);
                    columns.push(column);
                }
                Quantity::Profile { field, at, body } => {
                    curves.body = body;
                    nodes.push(at);
                    curves.radii.extend_from_slice(&set.x);
                    curves.fields.push(field);
                    // The error of a profile is that of the depth.
                    columns.push("wear_depth");
                }
            }
        }
        for list in [&mut nodes, &mut curves.radii] {
            list.sort_by(f64::total_cmp);
            list.dedup();
        }
        columns.sort_unstable();
        columns.dedup();
        let is_profile = !curves.fields.is_empty();
        let rescaled = own.iter().position(|(_, it)| only_rescales(&it.pointer, &scenario));
        let rescaled = rescaled.filter(|_| !is_profile);
        if rescaled.is_some() {
            nodes = shared_nodes(nodes[0], nodes[nodes.len() - 1]);
        }
        let is_over_energy = sets[0].over() == "dissipated_energy";
        scenario["cycles"] =
            if is_over_energy { json!({"dissipated_energy": nodes}) } else { json!(nodes) };
        let below = |faults: Faults| faults.below("/scenario");
        fretwork_engine::scenario::prepare(scenario.clone(), "").map_err(below)?;
        let mut members = Vec::<Member>::new();
        let found = Member::find_all(&scenario, own.iter().map(|(_, it)| it.pointer.as_str()));
        for ((place, _), member) in own.iter().zip(found) {
            let twice = Err("is listed twice for this test".to_owned());
            let member = member.and_then(|it| if members.contains(&it) { twice } else { Ok(it) });
            let pointer = format!("/parameters/{place}/pointer");
            members.push(member.map_err(|detail| Faults::one(&pointer, detail))?);
        }
        let names = columns.iter().flat_map(|column| {
            nodes.iter().map(move |node| format!("{column}@{node}").parse::<OutputName>())
        });
        let names = names.collect::<Result<_, _>>().map_err(|it| Faults::one("/tests", it))?;
        let outputs = OutputName::all_among(names, &scenario).map_err(below)?;
        let wear = scenario["wear"].as_object().filter(|wear| wear.len() == 1);
        let coefficient = wear.and_then(|_| Member::find(&scenario, ENERGY_COEFFICIENT).ok());
        let line = coefficient.filter(|_| sets.iter().all(|set| set.is_over_energy()));
        let line =
            line.map(|it| (own.iter().position(|own| own.1.pointer == it.pointer), it.value));
        let mut problem = Problem::new(scenario, members, outputs);
        problem.has_errors = true;
        problem.profiles = is_profile.then_some(curves);
        problem.prepare(&own.iter().map(|own| own.1.start).collect::<Vec<_>>()).map_err(below)?;
        let parameters = own.iter().map(|own| own.0).collect();
        Ok(Self { problem, parameters, rescaled, nodes, columns, line })
    }

    /// Whether a parameter only rescales the cycles of the runs.
    pub fn is_rescaled_by(&self, parameter: usize) -> bool {
        self.rescaled.is_some_and(|member| self.parameters[member] == parameter)
    }

    /// The values of the members in the run for these parameters; `None` if no run is necessary.
    pub fn values(&self, theta: &[f64]) -> Option<Vec<f64>> {
        let mut values: Vec<f64> = self.parameters.iter().map(|it| theta[*it]).collect();
        if let Some(member) = self.rescaled {
            // The coefficients of runs are powers of 2, so that near coefficients share runs.
            let power = (libm::log2(values[member]) / libm::log2(SHARED * SHARED)).round();
            values[member] = twelve_digits(libm::exp2(power));
        }
        self.line.is_none().then_some(values)
    }

    /// The prediction of an entry of a set for these parameters, from the run with these values, and the relative
    /// numerical error of the prediction.
    pub fn predicted(
        &self,
        set: &Set,
        entry: usize,
        theta: &[f64],
        run: Option<(&[f64], &Found)>,
    ) -> Option<(f64, f64)> {
        let x = set.x[entry];
        let (column, factor) = match set.quantity {
            Quantity::Column { column, factor, .. } => (column, factor),
            Quantity::Profile { .. } => ("wear_depth", 1.0),
        };
        if let Some((member, value)) = self.line {
            let coefficient = member.map_or(value, |member| theta[self.parameters[member]]);
            return Some((factor * coefficient * x, 0.0));
        }
        let (values, found) = run?;
        let first = self.columns.partition_point(|known| *known < column) * self.nodes.len();
        let ratio = self.rescaled.map_or(1.0, |it| theta[self.parameters[it]] / values[it]);
        let at = if let Quantity::Profile { at, .. } = set.quantity { at } else { x * ratio };
        let node = self.nodes.partition_point(|node| *node < at).min(self.nodes.len() - 1);
        let error = (*found.outputs.get(self.problem.outputs.len() + first + node)?)?;
        let outputs = &found.outputs[first..first + self.nodes.len()];
        let value = match set.quantity {
            Quantity::Profile { field, .. } => {
                let CommonProfiles { radii, fields, .. } = self.problem.profiles.as_ref()?;
                let curve = fields.iter().position(|known| *known == field)?;
                return Some((found.profiles[curve][radii.partition_point(|it| *it < x)]?, error));
            }
            Quantity::Column { .. } if self.rescaled.is_none() => outputs[node]?,
            Quantity::Column { .. } => {
                let value = interpolated(&self.nodes, outputs, at)?;
                if COUNTED.contains(&column) { value / ratio } else { value }
            }
        };
        Some((factor * value, error))
    }
}

/// The number at x of a curve through numbers over the logarithm of the nodes: a cubic through the next four.
fn interpolated(nodes: &[f64], outputs: &[Option<f64>], x: f64) -> Option<f64> {
    let next = nodes.partition_point(|node| *node < x);
    let first = next.saturating_sub(2).min(nodes.len() - 4);
    let near = first..first + 4;
    let y: Vec<f64> = outputs[near.clone()].iter().copied().collect::<Option<_>>()?;
    let s: Vec<f64> = nodes[near].iter().map(|node| libm::log(*node)).collect();
    let is_positive = y.iter().all(|y| *y > 0.0);
    let at = libm::log(x);
    let term = |(i, y): (usize, &f64)| {
        let others = (0..4).filter(|j| *j != i);
        let weight: f64 = others.map(|j| (at - s[j]) / (s[i] - s[j])).product();
        weight * if is_positive { libm::log(*y) } else { *y }
    };
    let value: f64 = y.iter().enumerate().map(term).sum();
    Some(if is_positive { libm::exp(value) } else { value })
}
