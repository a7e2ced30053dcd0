//! An exact run beside the simplified rule: how far the rule is off, and the ξ that fits best.
//!
//! The rule is run over the same instants under the same control. The ξ that fits best makes the
//! sum of the squares of V_rule/V_exact − 1 over the instants smallest; it is looked for by golden
//! section between 0.1 and 10.

use super::single::SingleRun;
use crate::case::{COMPARISON_RUNS, Case, Method};
use crate::outcome::{Comparison, Errors, History, Outcome};

/// Where ξ is looked for.
const XI_RANGE: (f64, f64) = (0.1, 10.0);
/// Rounds of golden section: ln ξ to 1e-5.
const ROUNDS: usize = COMPARISON_RUNS - 3;
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A comparison under way.
#[derive(Debug)]
pub struct Comparing {
    case: Case,
    xi: f64,
    exact: History,
    running: Option<Box<SingleRun>>,
    /// ln ξ of the run under way.
    trial: f64,
    rule: Option<History>,
    /// ln ξ and error of the tried ones: the ends of the bracket and the two within.
    bracket: [f64; 4],
    errors: [Option<f64>; 2],
    rounds: usize,
}

impl Comparing {
    /// Compares with the history of an exact run.
    pub(super) fn new(case: &Case, xi: f64, exact: &History) -> Self {
        let mut case = case.rule(xi);
        case.cycles.clone_from(&exact.cycles);
        case.profiles = vec![false; exact.cycles.len()];
        let (low, high) = (libm::log(XI_RANGE.0), libm::log(XI_RANGE.1));
        let width = GOLDEN * (high - low);
        let mut comparing = Self {
            case,
            xi,
            exact: exact.clone(),
            running: None,
            trial: libm::log(xi),
            rule: None,
            bracket: [low, high - width, low + width, high],
            errors: [None; 2],
            rounds: 0,
        };
        comparing.start(libm::log(xi));
        comparing
    }

    fn start(&mut self, trial: f64) {
        let mut case = self.case.clone();
        let xi = if self.rule.is_none() { self.xi } else { libm::exp(trial) };
        case.method = Method::Simplified { xi };
        self.trial = trial;
        self.running = Some(Box::new(SingleRun::new(case)));
    }

    /// Computes some more; the share of the whole job that is done, or none at the end.
    pub(super) fn step(&mut self) -> Option<f64> {
        let run = self.running.as_mut()?;
        run.step();
        if run.has_ended() {
            let outcome = run.outcome();
            self.running = None;
            self.take(outcome);
        }
        self.running.is_some().then_some(0.999)
    }

    /// Goes on with the next ξ.
    fn take(&mut self, outcome: Outcome) {
        if self.rule.is_none() {
            self.rule = Some(outcome.history);
            self.start(self.bracket[1]);
            return;
        }
        let error = self.error(&outcome.history);
        if self.errors[0].is_none() && self.trial <= self.bracket[1] {
            self.errors[0] = Some(error);
        } else {
            self.errors[1] = Some(error);
        }
        if self.errors[1].is_none() {
            self.start(self.bracket[2]);
            return;
        }
        let [Some(left), Some(right)] = self.errors else { return };
        self.rounds += 1;
        if self.rounds > ROUNDS {
            return;
        }
        let [low, at_left, at_right, high] = self.bracket;
        if left < right {
            let next = at_right - GOLDEN * (at_right - low);
            self.bracket = [low, next, at_left, at_right];
            self.errors = [None, Some(left)];
            self.start(next);
        } else {
            let next = at_left + GOLDEN * (high - at_left);
            self.bracket = [at_left, at_right, next, high];
            self.errors = [Some(right), None];
            self.start(next);
        }
    }

    /// How many instants both have: a rule that ends early has its last entry elsewhere.
    fn shared(&self, rule: &History) -> usize {
        let both = rule.cycles.iter().zip(&self.exact.cycles);
        both.take_while(|(rule, exact)| (*rule - *exact).abs() <= 1e-12 * exact.abs()).count()
    }

    /// The root mean square of V_rule/V_exact − 1; what a rule that ends early misses is all wrong.
    fn error(&self, rule: &History) -> f64 {
        let shared = self.shared(rule);
        let errors = relative(&rule.wear_volume[..shared], &self.exact.wear_volume);
        let missed = (self.exact.cycles.len() - shared) as f64;
        let worn = self.exact.cycles.len().saturating_sub(1).max(1) as f64;
        ((errors.iter().map(|error| error * error).sum::<f64>() + missed) / worn).sqrt()
    }

    /// The comparison, once it is made.
    pub(super) fn finish(mut self) -> Comparison {
        let history = self.rule.take().unwrap_or_default();
        let shared = self.shared(&history);
        let of = |column: fn(&History) -> &Vec<f64>| {
            relative(&column(&history)[..shared], column(&self.exact))
        };
        let errors = Errors {
            wear_volume: of(|history| &history.wear_volume),
            wear_depth: of(|history| &history.wear_depth),
            normal_force: of(|history| &history.normal_force),
            indentation_depth: of(|history| &history.indentation_depth),
            dissipated_energy: of(|history| &history.dissipated_energy),
        };
        let [left, right] = self.errors.map(|error| error.unwrap_or(f64::INFINITY));
        let (best, error) =
            if left < right { (self.bracket[1], left) } else { (self.bracket[2], right) };
        let inside = libm::log(XI_RANGE.0) + 1e-3 < best && best < libm::log(XI_RANGE.1) - 1e-3;
        let worn = self.exact.wear_volume.last().is_some_and(|volume| *volume > 0.0);
        let found = inside && worn && error.is_finite();
        Comparison {
            xi: self.xi,
            history,
            errors,
            best_xi: found.then(|| libm::exp(best)),
            best_error: found.then_some(error),
        }
    }
}

/// a/b − 1, term by term; 0 where both are 0.
fn relative(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| if *b == 0.0 { 0.0 } else { a / b - 1.0 }).collect()
}
