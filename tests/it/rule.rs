//! The error of the simplified rule with the default ξ, compared with the exact method.

use fretwork_engine::outcome::Outcome;
use fretwork_engine::scenario;
use fretwork_engine::simulation::Simulation;
use serde_json::{Value, json};

use fretwork_random::Random;

/// A power law with the given held quantities.
struct PowerContact {
    exponent: f64,
    stick_ratio: f64,
    held: (&'static str, &'static str),
    time: f64,
}

impl PowerContact {
    fn any(random: &mut Random) -> Self {
        let (load, motion) =
            (random.one_of(&["depth", "force"]), random.one_of(&["amplitude", "tangential_force"]));
        Self {
            exponent: random.one_of(&[1.0, 2.0, 6.0]),
            stick_ratio: random.between(0.05, 0.98),
            held: (load, motion),
            time: random.log_between(0.5, 16.0),
        }
    }

    /// `None` if the scenario is refused, because almost the whole contact slips.
    fn run(&self, model: &Value) -> Option<Outcome> {
        let (load, motion) = self.held;
        let request = json!({
            "profile": {"shape": "power", "exponent": self.exponent, "height": "5 um", "at_radius": "0.2 mm"},
            "moduli": {"normal": "110 GPa", "tangential": "90 GPa"},
            "friction": 0.6,
            "wear": {"coefficient": 1e-14},
            "load": {"normal_force": "50 N", "held": load},
            "motion": {"stick_ratio": self.stick_ratio, "held": motion},
            "cycles": {"normalized": [self.time]},
            "profiles_at": "none",
            "model": model,
        });
        let (scenario, _) = scenario::check(&request, "").ok()?;
        Some(Simulation::of(&scenario).expect("a contact").run())
    }
}

#[test]
fn the_default_rule_is_as_accurate_as_model_error_says() {
    const COUNT: usize = 400;
    let mut random = Random::new(16);
    let (mut count, mut covered, mut large, mut unknown) = (0, 0, 0, 0);
    while count < COUNT {
        let contact = PowerContact::any(&mut random);
        let Some(rule) = contact.run(&json!({"method": "simplified"})) else { continue };
        let Some(exact) = contact.run(&json!({})) else { continue };
        count += 1;
        let last = |outcome: &Outcome| *outcome.history.wear_volume.last().expect("a row");
        let error = (last(&rule) / last(&exact) - 1.0).abs();
        match rule.accuracy.model_error {
            Some(expected) => {
                covered += usize::from(error <= expected);
                large += usize::from(expected > 0.15);
            }
            None => unknown += 1,
        }
        let kinds: Vec<&str> = rule.warnings.iter().map(|warning| &*warning.kind).collect();
        let warns = kinds.contains(&"model_error");
        assert_eq!(warns, rule.accuracy.model_error.is_some_and(|error| error > 0.1), "{kinds:?}");
        assert_eq!(rule.accuracy.model_error.is_none(), kinds.contains(&"model_error_unknown"));
        let PowerContact { exponent, stick_ratio, held, time } = contact;
        if stick_ratio >= 0.7 && held.1 == "amplitude" {
            assert!(error < 0.08, "{error} for n = {exponent}, c = {stick_ratio}, Ñ = {time}");
        }
    }
    println!("covered {covered}, above 15 %: {large}, unknown {unknown} of {COUNT}");
    assert!(covered >= COUNT * 95 / 100, "{covered} covered, {unknown} unknown");
    assert!(3 * large <= COUNT, "{large}");
}
