//! Compares the simplified rule with an exact run, and finds the ξ that fits best.
//!
//! The rule runs over the same output cycles with the same held quantities. The best ξ minimises the sum
//! of the squares of V_rule/V_exact − 1. A golden-section search finds it between 0.1 and 10.

use super::single::SingleRun;
use crate::case::{COMPARISON_RUNS, Case, Method, Outputs};
use crate::outcome::{Comparison, Errors, History};

/// The range of ξ in the search.
const XI_RANGE: (f64, f64) = (0.1, 10.0);
const GOLDEN: f64 = 0.618_033_988_749_894_9;

/// A comparison and its present state.
#[derive(Debug)]
pub(super) struct Comparing {
    case: Case,
    xi: f64,
    exact: History,
    run: SingleRun,
    trial: Trial,
    rule: History,
    /// Values of ln ξ: the two ends of the bracket and the two trial values inside it.
    bracket: [f64; 4],
    /// The errors of the two trials.
    errors: [f64; 2],
    /// The number of complete runs.
    runs: usize,
}

/// The purpose of the present run.
#[derive(Debug, Clone, Copy)]
enum Trial {
    /// Compute the history of the rule with the given ξ.
    Rule,
    /// Compute the error of the left trial, before the first right trial.
    FirstLeft,
    /// Compute the error of the left trial.
    Left,
    /// Compute the error of the right trial.
    Right,
}

impl Comparing {
    /// Starts a comparison of the simplified rule with the history of an exact run.
    pub(super) fn new(case: &Case, xi: f64, exact: &History) -> Self {
        let mut case = case.rule(xi);
        case.outputs = Outputs::Cycles(exact.cycles.clone());
        case.profiles = vec![false; exact.cycles.len()];
        let (low, high) = (libm::log(XI_RANGE.0), libm::log(XI_RANGE.1));
        let width = GOLDEN * (high - low);
        Self {
            run: SingleRun::new(case.clone()),
            case,
            xi,
            exact: exact.clone(),
            trial: Trial::Rule,
            rule: History::default(),
            bracket: [low, high - width, low + width, high],
            errors: [f64::INFINITY; 2],
            runs: 0,
        }
    }

    /// Computes for a short time. Returns the completed share of the comparison, or `None` at the
    /// end.
    pub(super) fn step(&mut self) -> Option<f64> {
        let mut progress = self.run.step();
        if self.run.has_ended() {
            let next = self.take()?;
            self.start(next);
            self.runs += 1;
            progress = 0.0;
        }
        Some((self.runs as f64 + progress) / COMPARISON_RUNS as f64)
    }

    fn start(&mut self, trial: Trial) {
        let log_xi = self.bracket[if matches!(trial, Trial::Right) { 2 } else { 1 }];
        let method = Method::Simplified { xi: libm::exp(log_xi) };
        self.run = SingleRun::new(Case { method, ..self.case.clone() });
        self.trial = trial;
    }

    /// Uses the result of the completed run. Returns the purpose of the next run.
    fn take(&mut self) -> Option<Trial> {
        let history = &self.run.recording.history;
        match self.trial {
            Trial::Rule => {
                self.rule = history.clone();
                return Some(Trial::FirstLeft);
            }
            Trial::FirstLeft | Trial::Left => self.errors[0] = self.error(history),
            Trial::Right => self.errors[1] = self.error(history),
        }
        if matches!(self.trial, Trial::FirstLeft) { Some(Trial::Right) } else { self.narrow() }
    }

    /// Does one round of golden section.
    fn narrow(&mut self) -> Option<Trial> {
        // `runs` does not yet count the present run, which is complete too.
        if self.runs + 1 == COMPARISON_RUNS {
            return None;
        }
        let ([low, at_left, at_right, high], [left, right]) = (self.bracket, self.errors);
        if left < right {
            self.bracket = [low, at_right - GOLDEN * (at_right - low), at_left, at_right];
            self.errors[1] = left;
            Some(Trial::Left)
        } else {
            self.bracket = [at_left, at_right, at_left + GOLDEN * (high - at_left), high];
            self.errors[0] = right;
            Some(Trial::Right)
        }
    }

    /// The number of output cycles that both histories contain. If the rule ended early, its last
    /// row is different.
    fn shared(&self, rule: &History) -> usize {
        let both = rule.cycles.iter().zip(&self.exact.cycles);
        both.take_while(|(rule, exact)| (*rule - *exact).abs() <= 1e-12 * exact.abs()).count()
    }

    /// The root mean square of V_rule/V_exact − 1. An output cycle that the rule did not reach
    /// counts as an error of 1.
    fn error(&self, rule: &History) -> f64 {
        let shared = self.shared(rule);
        let errors = relative(&rule.wear_volume[..shared], &self.exact.wear_volume);
        let missed = (self.exact.cycles.len() - shared) as f64;
        let worn = self.exact.cycles.len().saturating_sub(1).max(1) as f64;
        ((errors.iter().map(|error| error * error).sum::<f64>() + missed) / worn).sqrt()
    }

    /// The result of the comparison, after the last step.
    pub(super) fn finish(self) -> Comparison {
        let history = &self.rule;
        let shared = self.shared(history);
        let of = |column: fn(&History) -> &Vec<f64>| {
            relative(&column(history)[..shared], column(&self.exact))
        };
        let errors = Errors {
            wear_volume: of(|history| &history.wear_volume),
            wear_depth: of(|history| &history.wear_depth),
            normal_force: of(|history| &history.normal_force),
            indentation_depth: of(|history| &history.indentation_depth),
            dissipated_energy: of(|history| &history.dissipated_energy),
        };
        let [left, right] = self.errors;
        let (best, error) =
            if left < right { (self.bracket[1], left) } else { (self.bracket[2], right) };
        let inside = libm::log(XI_RANGE.0) + 1e-3 < best && best < libm::log(XI_RANGE.1) - 1e-3;
        let worn = self.exact.wear_volume.last().is_some_and(|volume| *volume > 0.0);
        let found = inside && worn && error.is_finite();
        Comparison {
            xi: self.xi,
            errors,
            best_xi: found.then(|| libm::exp(best)),
            best_error: found.then_some(error),
            history: self.rule,
        }
    }
}

/// a/b − 1 for each pair of values. The result is 0 where both are 0.
fn relative(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| if *b == 0.0 { 0.0 } else { a / b - 1.0 }).collect()
}
