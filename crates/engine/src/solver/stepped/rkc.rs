//! Runge–Kutta–Chebyshev (RKC) integration: explicit, second order, and stable over a long part of
//! the negative real axis.
//!
//! Wear is a stiff problem, similar to diffusion. With a usual explicit method, the small cells
//! next to the stick edge would require very small steps. A step of s stages is stable for h·ρ up
//! to about 0.65 s², where ρ is the spectral radius. A step of twice the size therefore costs only
//! √2 times the work. No system of equations is solved.
//!
//! # Accuracy
//! Second order. The step control keeps the root mean square of the local error below 1. The unit
//! of this error is `tolerance`·(largest value + 1 % of the expected final value).
//!
//! # Sources
//! B. P. Sommeijer, L. F. Shampine, J. G. Verwer, *J. Comput. Appl. Math.* 88 (1998) 315, equations
//! (2.1)–(2.8). Step control: K. Gustafsson, *ACM Trans. Math. Softw.* 17 (1991) 533.

/// The right-hand side f of y′ = f(t, y).
pub trait Rates {
    /// Writes f(t, y) into `rates`.
    fn rates(&mut self, time: f64, values: &[f64], rates: &mut [f64]);
    /// An upper bound of the spectral radius of ∂f/∂y at the values last passed to `rates`.
    fn radius(&self) -> f64;
    /// The number of components, starting with the second, that count in the error norm.
    fn live(&self) -> usize;
    /// The maximum scale of the error norm, even if components are larger.
    fn most(&self) -> f64;
}

/// The coefficients of an RKC step.
#[derive(Debug, Clone)]
struct Stages {
    /// μ̃ of the first stage.
    first: f64,
    /// μ, ν, μ̃ and γ̃ of stages 2 to s.
    rest: Vec<[f64; 4]>,
    /// The times of stages 1 to s, as shares of the step.
    times: Vec<f64>,
}

impl Stages {
    fn new(stages: usize) -> Self {
        const DAMPING: f64 = 2.0 / 13.0;
        let w0 = 1.0 + DAMPING / (stages * stages) as f64;
        // Chebyshev polynomials at w0 with their first two derivatives.
        let mut t = vec![[1.0, 0.0, 0.0], [w0, 1.0, 0.0]];
        for j in 2..=stages {
            let ([a, a1, a2], [b, b1, b2]) = (t[j - 1], t[j - 2]);
            t.push([2.0 * w0 * a - b, 2.0 * a + 2.0 * w0 * a1 - b1, 4.0 * a1 + 2.0 * w0 * a2 - b2]);
        }
        let w1 = t[stages][1] / t[stages][2];
        let b = |j: usize| {
            let [_, first, second] = t[j.max(2)];
            second / (first * first)
        };
        let rest: Vec<[f64; 4]> = (2..=stages)
            .map(|j| {
                let (mu, nu) = (2.0 * w0 * b(j) / b(j - 1), -b(j) / b(j - 2));
                let mu_rate = 2.0 * w1 * b(j) / b(j - 1);
                let gamma = -(1.0 - b(j - 1) * t[j - 1][0]) * mu_rate;
                [mu, nu, mu_rate, gamma]
            })
            .collect();
        let first = b(1) * w1;
        // The stages of y′ = 1.
        let mut times = vec![first];
        let mut earlier = 0.0;
        for [mu, nu, mu_rate, gamma] in &rest {
            let now = times[times.len() - 1];
            times.push(mu * now + nu * earlier + mu_rate + gamma);
            earlier = now;
        }
        Self { first, rest, times }
    }
}

/// An integration and its present state.
#[derive(Debug, Clone)]
pub struct Rkc {
    /// The relative error that a step may have.
    pub(crate) tolerance: f64,
    /// The time scale of slow changes.
    pub(crate) scale: f64,
    /// The expected size of the values.
    pub(super) size: f64,
    /// The present time.
    pub(crate) time: f64,
    /// The values y at the present time.
    pub(crate) values: Vec<f64>,
    /// The rates f(y) at the present time.
    pub(super) rates: Vec<f64>,
    /// The state before the last step, for interpolation within the step.
    before: (f64, Vec<f64>, Vec<f64>),
    step: f64,
    /// The logarithm of the error of the last step.
    last_error: f64,
    scratch: [Vec<f64>; 3],
    stages: Vec<Option<Stages>>,
    /// Number of accepted steps.
    pub accepted: usize,
    /// Number of evaluations of the right-hand side.
    pub evaluations: usize,
}

/// Minimum step, in units of the time scale and of the present time; the larger one applies. Small
/// steps must stay possible late in a run, because wear can become fast again after a long rest.
const LEAST_STEP: (f64, f64) = (1e-10, 1e-13);
/// First step, in units of the time scale.
const FIRST_STEP: f64 = 0.02;
/// Maximum step: the sum of one part in units of the time scale and one part in units of the
/// present time. With this limit, the interpolation within a step is as accurate as the
/// integration.
const LONGEST_STEP: (f64, f64) = (1.5, 0.15);
/// Components below this share of the largest component are not counted in the mean of the error.
const GROWN: f64 = 0.01;
/// Maximum number of stages of a step.
const MOST_STAGES: usize = 1000;
/// Above the first number of stages, only multiples of the second number are used, so that fewer sets of coefficients
/// are needed.
const STAGES_APART: (usize, usize) = (200, 50);
/// The tolerance doubles after this number of steps, and again each time the number of steps has
/// doubled. Every run therefore ends, and its error estimate includes the larger tolerance.
const PATIENCE: usize = 2000;

/// The number of stages at which a step of size h is stable.
fn stages(h: f64, radius: f64) -> usize {
    let stages = ((1.0 + 1.54 * h * radius).sqrt().ceil() as usize).clamp(2, MOST_STAGES);
    if stages > STAGES_APART.0 { stages.next_multiple_of(STAGES_APART.1) } else { stages }
}

impl Rkc {
    /// Starts at time 0. `scale` is the time scale of slow changes. `size` is the expected final
    /// size of the values.
    pub fn new(
        system: &mut impl Rates,
        values: Vec<f64>,
        tolerance: f64,
        (scale, size): (f64, f64),
    ) -> Self {
        let zeros = vec![0.0; values.len()];
        let mut rates = zeros.clone();
        system.rates(0.0, &values, &mut rates);
        Self {
            tolerance,
            scale,
            size,
            time: 0.0,
            before: (0.0, values.clone(), rates.clone()),
            values,
            rates,
            step: FIRST_STEP * scale,
            last_error: 0.0,
            scratch: [zeros.clone(), zeros.clone(), zeros],
            stages: Vec::new(),
            accepted: 0,
            evaluations: 1,
        }
    }

    /// The time at the start of the last step.
    pub(crate) fn began(&self) -> f64 {
        self.before.0
    }

    /// The values at the start of the last step.
    pub(super) fn values_before(&self) -> &[f64] {
        &self.before.1
    }

    /// The length of the shortest step at a time.
    fn shortest(&self, time: f64) -> f64 {
        (LEAST_STEP.0 * self.scale).max(LEAST_STEP.1 * time)
    }

    /// Whether the last step could not be shorter.
    pub(super) fn is_shortest(&self) -> bool {
        self.time - self.before.0 <= 2.0 * self.shortest(self.before.0)
    }

    /// Takes the last step back. The next one is at most half as long.
    pub(super) fn retreat(&mut self, system: &mut impl Rates) {
        self.step = 0.5 * (self.time - self.before.0);
        self.time = self.before.0;
        let values = std::mem::take(&mut self.before.1);
        self.restart(system, Some(values));
    }

    /// Continues with a changed right-hand side, or from other values.
    pub fn restart(&mut self, system: &mut impl Rates, values: Option<Vec<f64>>) {
        if let Some(values) = values {
            self.values = values;
        }
        let Self { time, values, rates, .. } = self;
        system.rates(*time, values, rates);
        self.evaluations += 1;
        self.before = (self.time, self.values.clone(), self.rates.clone());
    }

    /// Limits the next step, because the rates have grown: they are `times` times as large as the rates that correspond
    /// to the time scale.
    pub(crate) fn hurry(&mut self, times: f64) {
        self.step = self.step.min(FIRST_STEP * self.scale / times.max(1.0));
    }

    /// Moves to a later time without a change of the values.
    pub(crate) fn rest_until(&mut self, time: f64) {
        self.rates.fill(0.0);
        self.before = (self.time, self.values.clone(), self.rates.clone());
        self.time = time;
    }

    /// Takes one step that ends at `end` or earlier.
    pub fn advance(&mut self, system: &mut impl Rates, end: f64) {
        // Evaluate both before the first trial, because a trial can change the state of the system.
        let (radius, live) = (system.radius(), system.live());
        let least = self.shortest(self.time);
        loop {
            let limit = (MOST_STAGES * MOST_STAGES) as f64 / (1.54 * radius.max(1e-300));
            // A step that would stop just before `end` is extended to `end`.
            let left = end - self.time;
            let whole = self.step.min(limit) >= 0.999 * left;
            let h = if whole { left } else { self.step.min(limit) };
            self.compute(system, h, stages(h, radius));
            let error = self.error(h, live.max(system.live()), system.most());
            let [next, next_rates, _] = &mut self.scratch;
            if error <= 1.0 || h <= least {
                std::mem::swap(&mut self.before.1, &mut self.values);
                std::mem::swap(&mut self.before.2, &mut self.rates);
                std::mem::swap(&mut self.values, next);
                std::mem::swap(&mut self.rates, next_rates);
                self.before.0 = self.time;
                self.time = if whole { end } else { self.time + h };
                self.accepted += 1;
                let patience = self.accepted / PATIENCE;
                if self.accepted == patience * PATIENCE && patience.is_power_of_two() {
                    // Discontinuous rates would otherwise keep all steps small.
                    self.tolerance *= 2.0;
                }
                // Proportional–integral control prevents an oscillating step size.
                let error = libm::log(error.max(1e-4));
                let growth = 0.8 * libm::exp(0.2 * self.last_error - 0.35 * error);
                self.last_error = error;
                let longest = LONGEST_STEP.0 * self.scale + LONGEST_STEP.1 * self.time;
                // A step that was shortened by `end` does not limit the next step.
                let base = if whole { h.max(self.step) } else { h };
                self.step = (base * growth.clamp(0.2, 3.0)).clamp(least, longest);
                return;
            }
            let shrink = (0.8 / error.sqrt()).max(0.1);
            self.step = (h * shrink).max(least);
        }
    }

    /// Computes the values after a step (first scratch vector) and their rates (second scratch
    /// vector).
    fn compute(&mut self, system: &mut impl Rates, h: f64, stages: usize) {
        if self.stages.len() <= stages {
            self.stages.resize(stages + 1, None);
        }
        let coefficients = self.stages[stages].get_or_insert_with(|| Stages::new(stages));
        let (start, start_rates) = (&self.values, &self.rates);
        let [now, rates, earlier] = &mut self.scratch;
        earlier.copy_from_slice(start);
        for ((now, y), f) in now.iter_mut().zip(start).zip(start_rates) {
            *now = y + coefficients.first * h * f;
        }
        for ([mu, nu, mu_rate, gamma], share) in coefficients.rest.iter().zip(&coefficients.times) {
            system.rates(self.time + share * h, now, rates);
            let known = rates.iter().zip(start).zip(start_rates);
            for ((now, earlier), ((rate, start), start_rate)) in
                now.iter_mut().zip(&mut *earlier).zip(known)
            {
                let next = (1.0 - mu - nu) * start
                    + mu * *now
                    + nu * *earlier
                    + h * (mu_rate * rate + gamma * start_rate);
                *earlier = std::mem::replace(now, next);
            }
        }
        system.rates(self.time + h, now, rates);
        self.evaluations += stages;
    }

    /// The root mean square of the estimated local error, divided by the permitted error.
    fn error(&self, h: f64, live: usize, limit: f64) -> f64 {
        let [next, next_rates, _] = &self.scratch;
        let most = next.iter().copied().fold(0.0, f64::max);
        let allowed = self.tolerance * (0.01 * self.size.min(limit) + most.min(limit));
        let (sum, count) = (1..self.values.len().min(live + 1))
            .map(|j| {
                let error =
                    0.8 * (self.values[j] - next[j]) + 0.4 * h * (self.rates[j] + next_rates[j]);
                (error * error, usize::from(next[j] > GROWN * most))
            })
            .fold((0.0, 0), |(sum, count), (error, grown)| (sum + error, count + grown));
        (sum / count.max(1) as f64).sqrt() / allowed
    }

    /// The values at a time within the last step, computed by a shorter step from the same start,
    /// and the number of evaluations. Interpolation from the rates is not accurate for stiff
    /// components.
    pub(crate) fn again(&self, system: &mut impl Rates, time: f64) -> (Vec<f64>, usize) {
        let mut shorter = self.clone();
        shorter.time = self.before.0;
        shorter.restart(system, Some(self.before.1.clone()));
        let h = time - self.before.0;
        let stages = stages(h, system.radius());
        shorter.compute(system, h, stages);
        let [mut values, ..] = shorter.scratch;
        for (value, (from, to)) in values.iter_mut().zip(self.before.1.iter().zip(&self.values)) {
            *value = value.clamp(from.min(*to), from.max(*to));
        }
        (values, shorter.evaluations - self.evaluations)
    }

    /// The values at a time within the last step, by cubic Hermite interpolation.
    pub(crate) fn at(&self, time: f64) -> Vec<f64> {
        let (start, from, from_rates) = &self.before;
        let h = self.time - start;
        if h <= 0.0 {
            return self.values.clone();
        }
        let u = (time - start) / h;
        let (v, uu) = (1.0 - u, u * u);
        let (rest, gone) = (v * v * (1.0 + 2.0 * u), uu * (3.0 - 2.0 * u));
        let (early, late) = (h * u * v * v, h * uu * v);
        let three_per_step = 3.0 / h;
        let ends = from.iter().zip(&self.values);
        let rates = from_rates.iter().zip(&self.rates);
        ends.zip(rates)
            .map(|((from, to), (from_rate, to_rate))| {
                // Limit the slopes. The cubic is then monotone and does not overshoot.
                let steepest = three_per_step * (to - from);
                let (low, high) = (steepest.min(0.0), steepest.max(0.0));
                let slope = |rate: &f64| rate.max(low).min(high);
                rest * from + gone * to + early * slope(from_rate) - late * slope(to_rate)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y′ = −λⱼ(yⱼ − 1): the values relax from 0 to 1 at different rates, so the problem is stiff.
    struct Relaxation(Vec<f64>);

    impl Rates for Relaxation {
        fn rates(&mut self, _: f64, values: &[f64], rates: &mut [f64]) {
            for ((rate, y), lambda) in rates.iter_mut().zip(values).zip(&self.0) {
                *rate = lambda * (1.0 - y);
            }
        }
        fn radius(&self) -> f64 {
            self.0.iter().copied().fold(0.0, f64::max)
        }
        fn most(&self) -> f64 {
            f64::INFINITY
        }
        fn live(&self) -> usize {
            self.0.len()
        }
    }

    fn worst_at(end: f64, tolerance: f64) -> (f64, Rkc) {
        // The first component is not counted in the error.
        let mut system = Relaxation(vec![0.3, 0.3, 1.0, 20.0, 3000.0]);
        let mut run = Rkc::new(&mut system, vec![0.0; 5], tolerance, (1.0, 1.0));
        while run.time < end {
            run.advance(&mut system, f64::INFINITY);
        }
        let values = run.at(end);
        let exact = system.0.iter().map(|lambda| -libm::expm1(-lambda * end));
        let worst = values.iter().zip(exact).map(|(y, e)| (y - e).abs()).fold(0.0, f64::max);
        (worst, run)
    }

    #[test]
    fn a_smaller_tolerance_gives_a_smaller_error() {
        let (coarse, _) = worst_at(1.0, 1e-3);
        let (fine, _) = worst_at(1.0, 1e-5);
        assert!(coarse < 3e-3 && fine < 3e-5, "{coarse} {fine}");
    }

    /// y′ = 2t.
    struct Square;

    impl Rates for Square {
        fn rates(&mut self, time: f64, _: &[f64], rates: &mut [f64]) {
            rates.fill(2.0 * time);
        }
        fn radius(&self) -> f64 {
            500.0
        }
        fn most(&self) -> f64 {
            f64::INFINITY
        }
        fn live(&self) -> usize {
            1
        }
    }

    #[test]
    fn rates_that_depend_on_the_time_are_integrated_with_second_order() {
        let mut run = Rkc::new(&mut Square, vec![0.0; 2], 1e-3, (1.0, 1.0));
        while run.time < 2.0 {
            run.advance(&mut Square, 2.0);
        }
        assert!((run.values[1] - 4.0).abs() < 1e-12, "{}", run.values[1]);
    }

    #[test]
    fn a_stiff_problem_needs_few_evaluations() {
        let (_, run) = worst_at(10.0, 1e-3);
        // The explicit Euler method would need 15 000 steps to be stable.
        assert!(run.evaluations < 1500, "{} evaluations", run.evaluations);
    }

    #[test]
    fn rkc_steps_are_stable_in_their_range_and_second_order_accurate() {
        for stages in [2, 3, 7, 20] {
            let coefficients = Stages::new(stages);
            let amplify = |z: f64| {
                let (mut earlier, mut now) = (1.0, 1.0 + coefficients.first * z);
                for [mu, nu, mu_rate, gamma] in &coefficients.rest {
                    let next =
                        (1.0 - mu - nu) + mu * now + nu * earlier + z * (mu_rate * now + gamma);
                    (earlier, now) = (now, next);
                }
                now
            };
            let reach = ((stages * stages) as f64 - 1.0) / 1.54;
            for i in 0..=1000 {
                assert!(amplify(-reach * f64::from(i) / 1000.0).abs() <= 1.0 + 1e-12);
            }
            for z in [-1e-2, -1e-3] {
                let error = (amplify(z) - libm::exp(z)).abs();
                assert!(error < z.abs() * z * z, "{stages} stages at {z}: {error}");
            }
        }
    }
}
