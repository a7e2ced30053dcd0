//! Morris screening: which members have an effect on an output, from few points.
//!
//! A trajectory starts at a random point and changes one member after the other, in random order. Each change gives
//! an elementary effect: the difference of the output over the difference of the coordinate. Over all trajectories,
//! μ* shows how strong a member is, μ also shows the direction, and σ shows whether the effect depends on where it is
//! measured, because of a nonlinearity or of an interaction with other members.
//!
//! The coordinates take p equidistant levels, and a change is p/2 levels. The levels reach from the first percentile
//! to the 99th, because the ends of a normal distribution are infinite. An elementary effect extrapolates the
//! change in one step linearly to the whole distribution of the member.
//!
//! The trajectories are random and not optimised for their distance. So trajectory t is computed from the seed and t
//! alone, and a larger design with the same seed begins with the same trajectories.
//!
//! # Equations
//! ```text
//! Eᵢ = (f(x + Δeᵢ) − f(x)) / Δ,   Δ = ±0.98·p/(2(p − 1))
//! μᵢ = ⟨Eᵢ⟩,   μᵢ* = ⟨|Eᵢ|⟩,   σᵢ² = Σ(Eᵢ − μᵢ)² / (r − 1)
//! ```
//!
//! # Units
//! Effects have the unit of the output.
//!
//! # Sources
//! - M. D. Morris, Technometrics 33 (1991) 161: trajectories, μ and σ.
//! - F. Campolongo, J. Cariboni, A. Saltelli, Environ. Model. Softw. 22 (2007) 1509: μ*.

use super::{Bootstrap, Estimate};
use fretwork_random::Stream;

/// The lowest level of a coordinate. The highest one is 1 − `MARGIN`.
const MARGIN: f64 = 0.01;

/// The points of a screening.
#[derive(Debug, Clone)]
pub struct Morris {
    members: usize,
    levels: usize,
    random: Stream,
}

/// A trajectory: at which levels it starts, and in which order the members change.
struct Trajectory {
    start: Vec<usize>,
    /// The place of a member in the order of changes.
    turns: Vec<usize>,
}

impl Morris {
    /// The design for this number of members, with an even number of levels, usually 4.
    pub fn new(members: usize, levels: usize, seed: u64) -> Self {
        Self { members, levels, random: Stream::new(seed) }
    }

    /// The number of points of a trajectory, d + 1.
    pub fn trajectory(&self) -> usize {
        self.members + 1
    }

    /// The coordinates of a point in the unit cube. Points 0 to d are the first trajectory, and so on.
    pub fn point(&self, index: usize) -> Vec<f64> {
        let Trajectory { start, turns } = self.draw(index / self.trajectory());
        let changes = index % self.trajectory();
        let level = |(start, turn): (usize, usize)| {
            let level = if turn < changes { self.other(start) } else { start };
            self.coordinate(level)
        };
        start.into_iter().zip(turns).map(level).collect()
    }

    fn coordinate(&self, level: usize) -> f64 {
        MARGIN + (1.0 - 2.0 * MARGIN) * level as f64 / (self.levels - 1) as f64
    }

    /// The level after a change: upwards from the lower half, and downwards from the upper half.
    fn other(&self, level: usize) -> usize {
        (level + self.levels / 2) % self.levels
    }

    fn draw(&self, trajectory: usize) -> Trajectory {
        let bits = self.random.child(trajectory as u64);
        let (places, order) = (bits.child(0), bits.child(1));
        let level = |member| places.below(member, self.levels as u64) as usize;
        let mut turns: Vec<usize> = (0..self.members).collect();
        // Fisher–Yates shuffle.
        for last in (1..self.members).rev() {
            turns.swap(last, order.below(last as u64, last as u64 + 1) as usize);
        }
        Trajectory { start: (0..self.members as u64).map(level).collect(), turns }
    }
}

/// The effect of one member on an output.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effect {
    /// μ, the mean of the elementary effects.
    pub mean: f64,
    /// μ*, the mean of their absolute values.
    pub strength: Estimate,
    /// σ, their standard deviation.
    pub deviation: f64,
    /// The number of elementary effects whose two points have a value. The others are left out.
    pub count: usize,
}

/// The effect of each member on one output, from the values at the points of a design in their order; or why it has none,
/// and what to change.
///
/// # Panics
/// If the last trajectory is not complete.
pub fn effects(
    design: &Morris,
    outputs: &[Option<f64>],
    bootstrap: &Bootstrap,
) -> Vec<Result<Effect, String>> {
    let planned = outputs.len() / design.trajectory();
    assert_eq!(planned * design.trajectory(), outputs.len(), "the caller gives whole trajectories");
    let mut elementary = vec![Vec::with_capacity(planned); design.members];
    for (place, values) in outputs.chunks(design.trajectory()).enumerate() {
        let Trajectory { start, turns } = design.draw(place);
        for ((list, level), turn) in elementary.iter_mut().zip(start).zip(turns) {
            let step = design.coordinate(design.other(level)) - design.coordinate(level);
            let effect =
                values[turn + 1].zip(values[turn]).map(|(after, before)| (after - before) / step);
            list.push(effect.filter(|effect| effect.is_finite()));
        }
    }
    elementary.iter().map(|list| effect(list, bootstrap)).collect()
}

fn effect(elementary: &[Option<f64>], bootstrap: &Bootstrap) -> Result<Effect, String> {
    let present = || elementary.iter().flatten();
    let count = present().count();
    let too_few = || {
        format!(
            "Only {count} of {} elementary effects have both values, and at least 2 are needed. Choose ranges in which \
             fewer points fail, or more trajectories.",
            elementary.len()
        )
    };
    if count < 2 {
        return Err(too_few());
    }
    let mean = present().sum::<f64>() / count as f64;
    let squares: f64 = present().map(|e| (e - mean) * (e - mean)).sum();
    let row = |e: &Option<f64>| e.map_or([0.0; 2], |e| [1.0, e.abs()]);
    let rows: Vec<f64> = elementary.iter().flat_map(row).collect();
    let strength = |sums: &[f64]| (sums[0] > 0.0).then(|| vec![sums[1] / sums[0]]);
    let strength = bootstrap.estimate(&rows, 2, strength).ok_or_else(too_few)?[0];
    Ok(Effect { mean, strength, deviation: (squares / (count - 1) as f64).sqrt(), count })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// The Ishigami function on the unit cube, see the tests of the Sobol indices.
    fn ishigami(u: &[f64]) -> f64 {
        let sin = |u: f64| libm::sin(PI * (2.0 * u - 1.0));
        let third = PI * (2.0 * u[2] - 1.0);
        let square = third * third;
        sin(u[0]) * (1.0 + 0.1 * square * square) + 7.0 * sin(u[1]) * sin(u[1])
    }

    fn screen(
        design: &Morris,
        trajectories: usize,
        f: impl Fn(&[f64]) -> f64,
    ) -> Vec<Result<Effect, String>> {
        let count = trajectories * design.trajectory();
        let outputs: Vec<_> = (0..count).map(|index| Some(f(&design.point(index)))).collect();
        effects(design, &outputs, &Bootstrap::new(200, 0.95, 1).unwrap())
    }

    #[test]
    fn the_effects_of_a_linear_function_are_its_coefficients() {
        let coefficients = [3.0, -2.0, 0.0, 0.5];
        let design = Morris::new(4, 6, 2);
        let found = screen(&design, 5, |u| u.iter().zip(coefficients).map(|(u, c)| u * c).sum());
        for (effect, coefficient) in found.into_iter().zip(coefficients) {
            let effect = effect.unwrap();
            assert!((effect.mean - coefficient).abs() < 1e-14);
            assert!((effect.strength.value - coefficient.abs()).abs() < 1e-14);
            assert!(effect.deviation < 1e-14 && effect.count == 5);
        }
    }

    /// The expected values are from `SALib.analyze.morris` 1.6.0 with 4 levels between 0.01 and 0.99, from the same 10
    /// trajectories. SALib divides by the step in units of these bounds, so its values are divided by 0.98.
    #[test]
    fn the_effects_agree_with_salib() {
        let found = screen(&Morris::new(3, 4, 1), 10, ishigami);
        for (effect, [mean, strength, deviation]) in found.into_iter().zip([
            [4.055_356_673_612_431, 4.055_356_673_612_431, 5.258_096_847_785_416],
            [1.559_368_646_179_65, 7.796_843_230_898_245, 8.052_545_063_002_384],
            [-1.982_429_787_565_569, 5.158_836_839_675_237, 7.490_436_212_085_052],
        ]) {
            let effect = effect.unwrap();
            assert!((effect.mean - mean).abs() < 1e-12);
            assert!((effect.strength.value - strength).abs() < 1e-12);
            assert!((effect.deviation - deviation).abs() < 1e-12);
        }
    }

    /// The members that do not change lie on random levels. So the expected values are means over all levels.
    #[test]
    fn the_effects_approach_the_means_over_all_levels() {
        let design = Morris::new(3, 4, 7);
        let trajectories = 4000;
        for (member, found) in screen(&design, trajectories, ishigami).into_iter().enumerate() {
            let all: Vec<f64> = (0..64)
                .map(|place| {
                    let mut levels = [place % 4, place / 4 % 4, place / 16];
                    let point = |levels: [usize; 3]| levels.map(|level| design.coordinate(level));
                    let before = point(levels);
                    levels[member] = design.other(levels[member]);
                    let after = point(levels);
                    (ishigami(&after) - ishigami(&before)) / (after[member] - before[member])
                })
                .collect();
            let mean = |f: &dyn Fn(f64) -> f64| all.iter().map(|e| f(*e)).sum::<f64>() / 64.0;
            let (mu, strength) = (mean(&|e| e), mean(&f64::abs));
            let sigma = mean(&|e| (e - mu) * (e - mu)).sqrt();
            let found = found.unwrap();
            let error = 4.0 * sigma / (trajectories as f64).sqrt();
            assert!((found.mean - mu).abs() < error, "μ of member {member}");
            assert!((found.strength.value - strength).abs() < error, "μ* of member {member}");
            assert!((found.deviation - sigma).abs() < error, "σ of member {member}");
            let spread = mean(&|e| (e.abs() - strength) * (e.abs() - strength)).sqrt();
            let theory = 2.0 * 1.96 * spread / (trajectories as f64).sqrt();
            let width = found.strength.high - found.strength.low;
            assert!((width - theory).abs() < 0.25 * theory + 1e-12, "interval of member {member}");
        }
    }

    #[test]
    fn a_trajectory_changes_each_member_once() {
        let design = Morris::new(6, 4, 3);
        for trajectory in 0..20_usize {
            let point = |place| design.point(7 * trajectory + place);
            let mut changed = Vec::new();
            for place in 0..6_usize {
                let (before, after) = (point(place), point(place + 1));
                let differs = |member: &usize| (before[*member] - after[*member]).abs() > 0.1;
                changed.extend((0..6).filter(differs));
            }
            changed.sort_unstable();
            assert_eq!(changed, [0, 1, 2, 3, 4, 5]);
            assert!(point(0).iter().all(|u| (MARGIN..=1.0 - MARGIN).contains(u)));
        }
    }

    #[test]
    fn effects_with_a_failed_point_are_left_out() {
        let design = Morris::new(3, 4, 1);
        let mut outputs: Vec<_> = (0..8).map(|i| Some(f64::from(i))).collect();
        outputs[0] = None;
        let bootstrap = Bootstrap::new(100, 0.95, 1).unwrap();
        let found = effects(&design, &outputs, &bootstrap);
        assert_eq!(found.iter().filter(|effect| effect.is_ok()).count(), 2);
        let missing = found.into_iter().find_map(Result::err).unwrap();
        assert!(missing.starts_with("Only 1 of 2 elementary effects"), "{missing}");
    }
}
