//! The derivatives of all outputs of a model with respect to some of its numbers.
//!
//! The runs around the point are computed one after another, in steps of about 30 ms. Between two steps the caller can
//! pause or stop. See [`derivative`](super::stats::derivative) for the search and for the stated errors.

use std::sync::Arc;
use std::{iter, mem, vec};

use fretwork_engine::{Dimension, Valid};

use super::model::{Model, PointValues};
use super::stats::derivative::{Derivative, MAX_ROUNDS, SearchPoint, derivatives};
use super::{NoValue, Run};

/// Typical number of runs for each number that varies: one interval usually suffices.
const RUNS: f64 = 17.0;

/// Estimated time to prepare a run, in seconds.
const PREPARATION: f64 = 1e-4;

/// A search for the derivatives of a model at a point.
#[derive(Debug)]
pub struct Jacobian {
    model: Arc<Model>,
    point: Vec<f64>,
    /// Estimated time of one run, in seconds.
    seconds: f64,
    /// The run that is being computed.
    run: Option<Run>,
    /// The values at the point, after the first run.
    at_point: Option<PointValues>,
    /// The indices of the numbers whose derivatives are not known yet.
    rest: vec::IntoIter<usize>,
    /// For the first of these numbers, the values at the points that its search has asked for so far.
    around: Vec<Vec<Option<f64>>>,
    /// The first fault of an invalid scenario among these points.
    fault: Option<String>,
    found: Vec<Entry>,
}

/// The derivative of one output with respect to one number.
#[derive(Debug, Clone)]
pub struct Entry {
    /// The index of the output.
    pub output: usize,
    /// The index of the number.
    pub member: usize,
    /// The derivative, or why there is none.
    pub derivative: Result<Derivative, String>,
    /// Whether the output has a closed form.
    pub is_closed: bool,
    /// Whether the output has a value at the point.
    pub has_value: bool,
}

impl Jacobian {
    /// Starts a search at a point. `members` has the indices of the numbers with respect to which derivatives are
    /// computed.
    ///
    /// # Errors
    /// The scenario of the point has faults.
    pub fn new(model: &Arc<Model>, point: &[f64], members: Vec<usize>) -> Valid<Self> {
        let run = model.run(point)?;
        Ok(Self {
            model: Arc::clone(model),
            point: point.to_vec(),
            seconds: run.seconds(),
            run: Some(run),
            at_point: None,
            rest: members.into_iter(),
            around: Vec::new(),
            fault: None,
            found: Vec::new(),
        })
    }

    /// Estimated processor time, in seconds, if one interval suffices for each number. More intervals take longer.
    pub fn seconds(&self) -> f64 {
        (self.seconds + PREPARATION) * (1.0 + RUNS * self.rest.len() as f64)
    }

    /// Computes one step: about 30 ms of a run. Returns the derivatives after the last run.
    pub fn step(&mut self) -> Option<Vec<Entry>> {
        if let Some(run) = &mut self.run {
            let values = self.model.values(&run.step()?);
            self.run = None;
            match self.at_point {
                Some(_) => self.around.push(numbers(&values)),
                None => self.at_point = Some(values),
            }
        }
        self.start_run()
    }

    /// Starts the next run. Returns the derivatives if no more run is needed.
    fn start_run(&mut self) -> Option<Vec<Entry>> {
        let at_point = self.at_point.as_ref()?;
        while let Some(member) = self.rest.as_slice().first().copied() {
            let x = match self.entries(member, at_point) {
                Err(x) => x,
                Ok(entries) => {
                    self.found.extend(entries);
                    self.rest.next();
                    (self.around, self.fault) = (Vec::new(), None);
                    continue;
                }
            };
            let mut point = self.point.clone();
            point[member] = x;
            match self.model.run(&point) {
                Ok(run) => {
                    self.run = Some(run);
                    return None;
                }
                Err(faults) => {
                    let fault = faults.0.first().map(|it| format!("{} {}", it.pointer, it.detail));
                    self.fault = self.fault.take().or(fault);
                    self.around.push(vec![None; at_point.values.len()]);
                }
            }
        }
        Some(mem::take(&mut self.found))
    }

    /// The derivatives with respect to a number, or its value in the run that they need next.
    fn entries(&self, member: usize, at_point: &PointValues) -> Result<Vec<Entry>, f64> {
        let entry = |output: usize, derivative| {
            let (is_closed, has_value) = (at_point.closed[output], at_point.values[output].is_ok());
            Entry { output, member, derivative, is_closed, has_value }
        };
        let x = self.point[member];
        if x == 0.0 && self.model.members()[member].dimension != Dimension::Number {
            let reason = "the number is 0, so a suitable step for the derivative is not known";
            let none = |output| entry(output, Err(reason.to_owned()));
            return Ok((0..at_point.values.len()).map(none).collect());
        }
        let scale = if x == 0.0 { 1.0 } else { x.abs() };
        // The domain of the number is not known. Beyond it the scenario has faults, so the point has no values.
        let place = SearchPoint { x, scale, low: f64::NEG_INFINITY, high: f64::INFINITY };
        let mut known = iter::once(numbers(at_point)).chain(self.around.iter().cloned());
        let values = |x: f64| known.next().ok_or(x);
        let found = derivatives(place, &at_point.accuracies, MAX_ROUNDS, values)?;
        let found = found.into_iter().zip(&at_point.values).enumerate();
        let found = found.map(|(output, (derivative, value))| {
            entry(output, derivative.ok_or_else(|| self.lack(value)))
        });
        Ok(found.collect())
    }

    /// Why an output with this value at the point has no derivative.
    fn lack(&self, value: &Result<f64, NoValue>) -> String {
        match (value, &self.fault) {
            (Err(reason), _) => reason.to_string(),
            (Ok(_), Some(fault)) => {
                format!("too few scenarios with nearby values of this number are valid: {fault}")
            }
            (Ok(_), None) => {
                "the output has no value at too many nearby values of this number".to_owned()
            }
        }
    }
}

fn numbers(values: &PointValues) -> Vec<Option<f64>> {
    values.values.iter().map(|value| value.ok()).collect()
}

#[cfg(test)]
mod tests {
    use fretwork_engine::numeric::root;
    use fretwork_engine::scenario;
    use serde_json::{Value, json};

    use super::*;
    use fretwork_random::Random;

    fn found(config: Value) -> Vec<Entry> {
        let model = Arc::new(Model::read(config).unwrap());
        let members = (0..model.members().len()).collect();
        let mut search = Jacobian::new(&model, &model.origin(), members).unwrap();
        loop {
            if let Some(found) = search.step() {
                return found;
            }
        }
    }

    fn ball() -> Value {
        json!({
            "profile": {"shape": "paraboloid", "radius": 0.01},
            "moduli": {"normal": 113e9, "tangential": 93e9}, "friction": 0.7,
            "wear": {"coefficient": 3.03e-14}, "load": {"normal_force": 100, "held": "depth"},
            "motion": {"amplitude": 2e-6}, "cycles": [10000],
            "model": {"method": "simplified", "xi": 0.8},
        })
    }

    /// The expected derivatives follow from the formulas of Hertz, Cattaneo and Mindlin.
    #[test]
    fn closed_derivatives_agree_with_hertz_and_mindlin() {
        let found = found(json!({"scenario": ball(),
            "parameters": ["/load/normal_force", "/profile/radius", "/moduli/normal", "/motion/amplitude"],
            "outputs": ["scales.contact_radius", "unworn.peak_pressure", "unworn.tangential_force"]}));
        let (force, radius, normal, tangential, friction) = (100.0_f64, 0.01, 113e9_f64, 93e9, 0.7);
        let contact = libm::cbrt(0.75 * force * radius / normal);
        let peak = 1.5 * force / (std::f64::consts::PI * contact * contact);
        // Q = μF (1 − (c/a)³), where c follows from the amplitude.
        let shear = |force: f64, radius: f64, normal: f64, amplitude: f64| {
            let contact = libm::cbrt(0.75 * force * radius / normal);
            let full = friction * normal / tangential * contact * contact / radius;
            let stick = contact * root(0.0, 1.0, |c| full * (1.0 - c * c) - amplitude);
            friction * force * (1.0 - libm::pow(stick / contact, 3.0))
        };
        let at = [force, radius, normal, 2e-6];
        let slope = |place: usize| {
            let value = |factor: f64| {
                let mut x = at;
                x[place] *= factor;
                shear(x[0], x[1], x[2], x[3])
            };
            (value(1.0 + 1e-5) - value(1.0 - 1e-5)) / (2e-5 * at[place])
        };
        for entry in found {
            let third = [1.0, 1.0, -1.0, 0.0][entry.member] / 3.0;
            let expected = match entry.output {
                0 => third * contact / at[entry.member],
                1 => [1.0, -2.0, 2.0, 0.0][entry.member] / 3.0 * peak / at[entry.member],
                _ => slope(entry.member),
            };
            let Derivative { value, error } = entry.derivative.unwrap();
            let scale = expected.abs().max(
                [contact, peak, shear(force, radius, normal, 2e-6)][entry.output]
                    / at[entry.member],
            );
            let (output, member) = (entry.output, entry.member);
            assert!(
                (value - expected).abs() <= error + 1e-8 * scale,
                "{output} {member}: {value} {expected}"
            );
            assert!(error < 1e-5 * scale && entry.is_closed, "{output} {member}: {error:e}");
        }
    }

    /// The wear volume V, the wear coefficient k and the energy per cycle W satisfy dV/dN = (k/μ)·W after N cycles. V
    /// depends on k and N only by their product, so dV/dk follows from W.
    #[test]
    fn derivatives_of_exact_runs_satisfy_the_energy_balance() {
        let mut scenario = ball();
        scenario["model"] = json!({"method": "exact"});
        let energy = json!({"scenario": scenario, "outputs": ["energy_per_cycle"]});
        let model = Arc::new(Model::read(energy).unwrap());
        let mut run = model.run(&[0.7]).unwrap();
        let mut steps = std::iter::repeat_with(|| run.step().map(|ended| model.values(&ended)));
        let values = steps.find_map(|values| values).unwrap();
        let per_cycle = 3.03e-14 / 0.7 * values.values[0].unwrap();
        let found = found(json!({"scenario": scenario,
            "parameters": ["/cycles/0", "/wear/coefficient"], "outputs": ["wear_volume"]}));
        for (entry, expected) in found.iter().zip([per_cycle, per_cycle * 1e4 / 3.03e-14]) {
            let Derivative { value, error } = entry.derivative.clone().unwrap();
            assert!((value - expected).abs() <= error, "{value:e} ± {error:e}, {expected:e}");
            assert!(error < 0.1 * expected && !entry.is_closed, "{error:e} of {expected:e}");
        }
    }

    /// The columns of the history that a run computes.
    const COMPUTED: [&str; 9] = [
        "wear_volume",
        "wear_depth",
        "scar_radius",
        "contact_radius",
        "normal_force",
        "indentation_depth",
        "tangential_force",
        "energy_per_cycle",
        "dissipated_energy",
    ];

    /// The expected values 0.265 and 0.286 are from runs with a tolerance of 1e-4. The computed radius has waves of
    /// 0.4 %: one for each cell that the edge of the contact crosses.
    #[test]
    fn the_stated_error_covers_the_noise_of_the_contact_radius_in_gross_slip() {
        let scenario = json!({
            "profile": {"shape": "paraboloid", "radius": 0.01},
            "moduli": {"normal": 113e9, "tangential": 93e9}, "friction": 0.7,
            "wear": {"coefficient": 3e-14}, "load": {"normal_force": 100.0, "held": "force"},
            "motion": {"amplitude": 9e-6}, "cycles": [3000.0, 30000.0],
        });
        let config = json!({"scenario": scenario, "outputs": ["contact_radius"],
            "parameters": ["/profile/radius", "/motion/amplitude"]});
        let model = Arc::new(Model::read(config.clone()).unwrap());
        let mut run = model.run(&model.origin()).unwrap();
        let mut steps = std::iter::repeat_with(|| run.step().map(|ended| model.values(&ended)));
        let values = steps.find_map(|values| values).unwrap();
        let radius = values.values[0].unwrap();
        for ((entry, x), expected) in found(config).iter().zip(model.origin()).zip([0.265, 0.286]) {
            let Derivative { value, error } = entry.derivative.clone().unwrap();
            let [value, error] = [value, error].map(|part| part * x / radius);
            assert!((value - expected).abs() <= error, "{value} ± {error}, {expected}");
            assert!(error < 0.15, "{value} ± {error}");
        }
    }

    /// A random scenario in gross slip, and the pointer to one of its numbers.
    fn slipping(chance: &mut Random) -> (Value, &'static str) {
        let radius = chance.between(0.002, 0.02);
        let blunt = |exponent: f64| json!({"shape": "power", "exponent": exponent, "height": 1.5e-6, "at_radius": 1.8e-4});
        let flat = radius.sqrt() * chance.between(2e-4, 1.2e-3);
        let profile = [
            json!({"shape": "paraboloid", "radius": radius}),
            json!({"shape": "sphere", "radius": radius}),
            json!({"shape": "cone", "slope_angle": radius}),
            json!({"shape": "truncated_paraboloid", "radius": radius, "flat_radius": flat}),
            blunt(1.5),
            blunt(4.0),
        ];
        let mut scenario = ball();
        scenario["profile"] = profile[chance.one_of(&[0, 1, 2, 3, 4, 5])].clone();
        scenario["friction"] = json!(chance.between(0.4, 0.9));
        scenario["load"]["held"] = json!(chance.one_of(&["force", "depth"]));
        scenario["model"] = json!({"method": "exact"});
        let case = |scenario: &Value| scenario::prepare(scenario.clone(), "").unwrap().1;
        let threshold = case(&scenario).gross_slip_amplitude();
        scenario["motion"]["amplitude"] = json!(threshold * chance.log_between(1.2, 4.0));
        scenario["cycles"] = json!([case(&scenario).scales.cycles * chance.log_between(0.1, 10.0)]);
        let numbers = ["/motion/amplitude", "/load/normal_force", "/friction", "/wear/coefficient"];
        (scenario, chance.one_of(&numbers))
    }

    /// The module `output` refers to this test. Derivatives of runs with a smaller tolerance serve as the true
    /// values.
    #[test]
    fn stated_errors_of_derivatives_cover_the_noise_of_all_columns() {
        let is_long = std::env::var_os("FRETWORK_TEST_LONG").is_some();
        let count = if is_long { 200 } else { 12 };
        let mut chance = Random::new(1);
        let mut ratios = vec![Vec::new(); COMPUTED.len()];
        for _ in 0..count {
            let (scenario, number) = slipping(&mut chance);
            let mut config =
                json!({"scenario": scenario, "parameters": [number], "outputs": COMPUTED});
            let tested = found(config.clone());
            config["scenario"]["model"]["tolerance"] = json!(1e-4);
            for (entry, truth) in tested.into_iter().zip(found(config)) {
                let (tested, truth) = (entry.derivative.unwrap(), truth.derivative.unwrap());
                let true_error = (tested.value - truth.value).abs();
                // The true error of a held quantity is 0, so the ratio is limited.
                ratios[entry.output].push((tested.error / true_error).min(1e3));
            }
        }
        let covered = |ratios: &[f64]| ratios.iter().filter(|ratio| **ratio >= 1.0).count();
        for (name, ratios) in COMPUTED.iter().zip(&mut ratios) {
            ratios.sort_by(f64::total_cmp);
            let (covered, median) = (covered(ratios), ratios[count / 2]);
            println!("{name}: {covered} of {count}, stated/true {median:.1}");
            assert!(10 * covered >= 9 * count, "{name}: {covered} of {count}");
        }
        let (covered, all) = (covered(&ratios.concat()), count * COMPUTED.len());
        println!("all: {covered} of {all}");
        assert!(100 * covered >= 95 * all, "{covered} of {all}");
    }

    #[test]
    fn a_missing_derivative_has_a_reason() {
        let mut scenario = ball();
        scenario["model"]["points"] = json!(64);
        let found =
            found(json!({"scenario": scenario, "parameters": ["/model/points", "/friction"],
            "outputs": ["wear_volume", "unworn.actuator_amplitude"]}));
        let reasons: Vec<Option<String>> =
            found.into_iter().map(|entry| entry.derivative.err()).collect();
        assert!(reasons[0].as_deref().unwrap().contains("/model/points"), "{reasons:?}");
        assert!(reasons[1].as_deref().unwrap().contains("rig_stiffness"), "{reasons:?}");
        assert_eq!(reasons[2], None);
        assert!(reasons[3].as_deref().unwrap().contains("rig_stiffness"), "{reasons:?}");
    }
}
