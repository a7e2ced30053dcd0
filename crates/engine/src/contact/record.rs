//! The slip of springs under an arbitrary displacement record that repeats indefinitely.
//!
//! A spring sticks until its deflection reaches the limit s, and slips beyond it: a play (Prandtl)
//! element. Only the reversals of the displacement record matter to a spring. One pass of the
//! record is one cycle.
//!
//! # Equations
//! ```text
//! P(s) = Σ 2 max(0, R − 2s) = 4 Σ max(0, R/2 − s)      slip path of one pass, over closed loops
//! ω(ρ) = P(ρU) / 4U                                    in units of the path 4U of a harmonic cycle
//! ```
//! R is the range of a loop, U half of the largest range. On each of the two branches of a loop a
//! spring first sticks over a distance of 2s. When the loop closes, the spring is in the same state
//! as at the start of the loop. A closed loop can therefore be removed from the record and counted
//! separately: larger swings erase the memory of a play element. A spring of compression y has ρ =
//! y/Δ with Δ = G*U/(μE*d₀). The harmonic record has a single loop, ω = 1 − ρ.
//!
//! Rainflow counting finds the loops. The count starts at the highest position, so that all loops
//! close. The count describes the steady state, which is reached within the first pass: between its
//! extremes the contact moves by 2U. There a spring with s < U reaches its limit, whatever its
//! initial state. A spring with s ≥ U does not slip again after it has passed both extremes.
//! # Accuracy
//! P is convex and piecewise linear, with a corner at each R/2. The sum starts at the largest loop,
//! where P = 0, and adds one interval between corners after the other. All terms are positive, so
//! there is no cancellation even if s is close to U. The sum is compensated. Only the rounding of
//! the ranges remains.
//!
//! # Sources
//! Play operators: M. A. Krasnosel'skii, A. V. Pokrovskii, *Systems with Hysteresis*, Springer
//! 1989. Loops: M. Matsuishi, T. Endo, *Fatigue of metals subjected to varying stress*, Japan Soc.
//! Mech. Engrs. 1968; ASTM E1049-85, 5.4.5 (repeating histories). Their dissipation: M. Brokate,
//! K. Dressler, P. Krejčí, *Eur. J. Mech. A/Solids* 15 (1996) 705.

use crate::numeric;

/// A displacement record that repeats indefinitely, reduced to the data that determine the slip.
///
/// Two records are equal if their loops have the same ranges. The starting point, the sign, the
/// direction in time and the points between reversals have no influence.
#[derive(Debug, Clone, PartialEq)]
pub struct DisplacementRecord {
    /// U: half of the largest range, in the unit of the displacements.
    pub(crate) amplitude: f64,
    /// Corners of ω, from the largest loop to the smallest loop.
    corners: Vec<Corner>,
}

/// A corner of ω(ρ): a spring with a lower limit slips in more loops.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Corner {
    /// The position of the corner, ρ = R/2U, for loops of range R.
    ratio: f64,
    /// The slip at the corner, ω(ρ).
    slip: f64,
    /// Number of loops of at least this size: −dω/dρ just below ρ.
    loops: usize,
}

impl DisplacementRecord {
    /// The record that passes through `displacements` in order, in any unit of length, and returns
    /// from the last to the first. Points between two reversals are ignored.
    ///
    /// `None` if there is no motion, if a value is not finite, or if the largest range is not
    /// finite.
    pub fn new(displacements: &[f64]) -> Option<Self> {
        if !displacements.iter().all(|u| u.is_finite()) {
            return None;
        }
        let mut ranges = loops(displacements);
        ranges.sort_unstable_by(|a, b| b.total_cmp(a));
        let amplitude = 0.5 * ranges.first()?;
        let moves = amplitude > 0.0 && amplitude.is_finite();
        moves.then(|| Self { amplitude, corners: corners(&ranges) })
    }

    /// ω(ρ) = P(ρU)/4U: the slip path in units of one complete harmonic cycle of the same
    /// amplitude. Without stick, at ρ ≤ 0, ω exceeds 1 if the record has more than one loop.
    pub fn slip(&self, ratio: f64) -> f64 {
        self.strokes(ratio, 1.0)
    }

    /// P/4, in a unit of length in which the amplitude is `amplitude`.
    ///
    /// The code scales the corners and not the limit, because rounding of the limit would be
    /// visible close to U.
    fn strokes(&self, limit: f64, amplitude: f64) -> f64 {
        let limit = limit.max(0.0);
        let slipping = self.corners.partition_point(|corner| corner.ratio * amplitude > limit);
        self.corners[..slipping].last().map_or(0.0, |corner| {
            corner.slip * amplitude + corner.loops as f64 * (corner.ratio * amplitude - limit)
        })
    }
}

/// The ranges of the loops that close in one pass, by rainflow counting.
///
/// The code compares positions, not their differences, so rounding cannot add or remove a loop.
fn loops(displacements: &[f64]) -> Vec<f64> {
    let between = |x: f64, a: f64, b: f64| a.min(b) <= x && x <= a.max(b);
    let (before, after) = displacements.split_at(numeric::largest(displacements));
    let mut ranges = Vec::new();
    // Reversals of open loops: each swing lies inside the previous swing.
    let mut open: Vec<f64> = Vec::new();
    for &u in after.iter().chain(before).chain(after.first()) {
        while let [.., a, b] = open[..] {
            if between(b, a, u) {
                // Not a reversal: `b` lies between its neighbours, or the position has not changed.
                open.pop();
            } else if between(a, b, u) {
                // The motion has returned to the start of the swing from a to b, so this loop
                // closes.
                ranges.push((a - b).abs());
                open.truncate(open.len() - 2);
            } else {
                break;
            }
        }
        open.push(u);
    }
    ranges
}

/// The corners of ω for `ranges` in descending order.
fn corners(ranges: &[f64]) -> Vec<Corner> {
    let mut corner = Corner { ratio: 1.0, slip: 0.0, loops: 0 };
    // Kahan compensation: without it, 10⁵ terms could lose 1e-11 of the sum.
    let mut lost = 0.0;
    ranges
        .chunk_by(|a, b| a <= b)
        .map(|equal| {
            let ratio = equal[0] / ranges[0];
            let step = corner.loops as f64 * (corner.ratio - ratio) + lost;
            let slip = corner.slip + step;
            lost = step - (slip - corner.slip);
            corner = Corner { ratio, slip, loops: corner.loops + equal.len() };
            corner
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::ops::{Add, Neg, Sub};

    impl DisplacementRecord {
        /// The number of reversals in one pass: twice the number of loops.
        fn reversals(&self) -> usize {
            self.corners.last().map_or(0, |corner| 2 * corner.loops)
        }

        /// P(s): the path that a spring with slip limit `limit` slips in one pass, in the unit of
        /// the displacements. It is 0 for limits of at least U. For negative limits, as for 0, it
        /// is the whole path of the record.
        fn path(&self, limit: f64) -> f64 {
            4.0 * self.strokes(limit, self.amplitude)
        }
    }

    fn record(displacements: &[f64]) -> DisplacementRecord {
        DisplacementRecord::new(displacements).expect("motion")
    }

    fn same(a: f64, b: f64) {
        assert_eq!(a.to_bits(), b.to_bits(), "{a} {b}");
    }

    /// Ranges of the loops from the largest to the smallest, computed from the corners.
    fn ranges(record: &DisplacementRecord) -> Vec<f64> {
        let mut counted = 0;
        let mut ranges = Vec::new();
        for corner in &record.corners {
            let range = 2.0 * record.amplitude * corner.ratio;
            ranges.extend(vec![range; corner.loops - counted]);
            counted = corner.loops;
        }
        ranges
    }

    /// The splitmix64 random number generator.
    fn dice(mut state: u64) -> impl FnMut() -> u64 {
        move || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let z = (state ^ (state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        }
    }

    /// The slip path of a spring in the second pass, simulated from point to point.
    fn dragged<T>(displacements: &[T], limit: T) -> T
    where
        T: Copy + Default + PartialOrd + Neg<Output = T> + Add<Output = T> + Sub<Output = T>,
    {
        let (mut before, mut deflection, mut path) = (displacements[0], T::default(), T::default());
        for _ in 0..2 {
            path = T::default();
            for &u in displacements.iter().skip(1).chain(displacements.first()) {
                deflection = deflection + (u - before);
                before = u;
                if deflection > limit {
                    path = path + (deflection - limit);
                    deflection = limit;
                } else if deflection < -limit {
                    path = path + (-limit - deflection);
                    deflection = -limit;
                }
            }
        }
        path
    }

    #[test]
    fn a_harmonic_record_gives_exactly_the_slip_of_one_harmonic_cycle() {
        for amplitude in [1.0, 2.256e-6, 0.1, 3e200] {
            let harmonic = record(&[amplitude, -amplitude]);
            assert_eq!(harmonic.reversals(), 2);
            same(harmonic.amplitude, amplitude);
            for i in -10..=1010 {
                let ratio = f64::from(i) * 1e-3;
                same(harmonic.slip(ratio), (1.0 - ratio.max(0.0)).max(0.0));
                let limit = ratio * amplitude;
                same(harmonic.path(limit), 4.0 * (amplitude - limit.max(0.0)).max(0.0));
            }
            let below = amplitude.next_down();
            same(harmonic.path(below), 4.0 * (amplitude - below));
            same(harmonic.path(amplitude), 0.0);
            same(harmonic.slip(1.0_f64.next_down()), 1.0 - 1.0_f64.next_down());
            same(harmonic.slip(f64::INFINITY), 0.0);
        }
    }

    #[test]
    fn the_ranges_of_nested_loops_agree_with_a_count_by_hand() {
        // From 0 to 10 and back. On the way up the loop 6-3-6 with the loop 5-4-5 inside; on the
        // way down the loop 4-8-4.
        let nested = record(&[0.0, 6.0, 3.0, 5.0, 4.0, 10.0, 4.0, 8.0]);
        assert_eq!(ranges(&nested), [10.0, 4.0, 3.0, 1.0]);
        assert_eq!(nested.reversals(), 8);
        same(nested.amplitude, 5.0);
        for (limit, path) in [
            (5.0, 0.0),
            (4.0, 4.0),
            (2.0, 12.0),
            (1.5, 2.0 * (7.0 + 1.0)),
            (0.5, 2.0 * (9.0 + 3.0 + 2.0)),
            (0.0, 36.0),
            (-1.0, 36.0),
        ] {
            assert!((nested.path(limit) - path).abs() < 1e-14, "{limit}");
            assert!((nested.slip(limit / 5.0) - path / 20.0).abs() < 1e-15, "{limit}");
        }
        // Loops of equal size, and loops that share an end with a larger loop.
        assert_eq!(
            ranges(&record(&[0.0, 2.0, 1.0, 2.0, 1.0, 2.0, 0.0, 1.0])),
            [2.0, 1.0, 1.0, 1.0]
        );
    }

    /// Source: ASTM E1049-85, 5.4.5 and its figure.
    #[test]
    fn the_repeating_history_of_astm_e1049_gives_the_printed_ranges() {
        let history = record(&[-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0]);
        assert_eq!(ranges(&history), [9.0, 7.0, 4.0, 3.0]);
    }

    #[test]
    fn displacements_without_motion_or_with_infinite_values_give_no_record() {
        for nothing in [
            &[][..],
            &[1.0],
            &[0.0, -0.0, 0.0],
            &[3.0, 3.0],
            &[0.0, 1.0, f64::NAN],
            &[f64::INFINITY, 0.0],
            &[f64::MAX, -f64::MAX],
        ] {
            assert_eq!(DisplacementRecord::new(nothing), None, "{nothing:?}");
        }
        // The products of these steps would underflow.
        assert_eq!(record(&[0.0, 1e-200, 0.0, 2e-200]).reversals(), 4);
    }

    #[test]
    fn random_long_records_agree_with_a_simulated_spring() {
        for seed in 0..4 {
            let mut dice = dice(seed);
            let mut position = 0.0;
            let displacements: Vec<f64> = (0..10_000)
                .map(|i| {
                    let swing = dice() as f64 / u64::MAX as f64;
                    let swing = if i % 2 == 0 { swing } else { -swing };
                    // In half of the records the position is a random walk, so that loops are
                    // deeply nested.
                    position = if seed % 2 == 0 { swing } else { position + swing };
                    position
                })
                .collect();
            let record = record(&displacements);
            assert!(record.reversals().abs_diff(10_000) <= 2);
            for i in 0..100 {
                let ratio = 0.999 * libm::pow(f64::from(i) / 99.0, 2.0);
                let limit = ratio * record.amplitude;
                let expected = dragged(&displacements, limit);
                let error = (record.path(limit) / expected - 1.0).abs();
                assert!(error < 1e-9, "seed {seed}, ratio {ratio}: {error}");
                let slip = expected / (4.0 * record.amplitude);
                assert!((record.slip(ratio) / slip - 1.0).abs() < 1e-9, "seed {seed}, {ratio}");
            }
        }
    }

    #[test]
    fn sums_of_100_000_loops_are_accurate_to_1e_15_even_close_to_the_amplitude() {
        const AMPLITUDE: i64 = 1 << 40;
        // First loops of all sizes, then loops that differ in their last digits only.
        for spread in [AMPLITUDE, 1 << 12] {
            let mut dice = dice(spread.unsigned_abs());
            let mut displacements: Vec<i64> = (0..200_000)
                .map(|i| {
                    let position = AMPLITUDE - (dice() % spread.unsigned_abs()).cast_signed();
                    if i % 2 == 0 { position } else { -position }
                })
                .collect();
            displacements[0] = AMPLITUDE;
            displacements[1] = -AMPLITUDE;
            let floats: Vec<f64> = displacements.iter().map(|u| *u as f64).collect();
            let record = record(&floats);
            assert_eq!(record.reversals(), 200_000);
            for i in 0..=12 {
                for limit in [(1 << (3 * i)) - 1, AMPLITUDE - (1 << (3 * i))] {
                    let exact = dragged(&displacements, limit) as f64;
                    for path in [
                        record.path(limit as f64),
                        record.slip(limit as f64 / AMPLITUDE as f64) * 4.0 * AMPLITUDE as f64,
                    ] {
                        let error = (path / exact - 1.0).abs();
                        assert!(error < 1e-15, "spread {spread}, limit {limit}: {error}");
                    }
                }
            }
        }
    }

    fn any_displacements() -> impl Strategy<Value = Vec<f64>> {
        // Either few levels, so that many positions coincide, or arbitrary positions.
        let coarse = prop::collection::vec((-4..=4).prop_map(f64::from), 2..40);
        let fine = prop::collection::vec(-1.0..1.0, 2..40);
        prop_oneof![coarse, fine]
            .prop_filter("motion", |displacements| DisplacementRecord::new(displacements).is_some())
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

        #[test]
        fn rotating_reversing_or_negating_a_record_changes_nothing(
            displacements in any_displacements(),
            start in any::<prop::sample::Index>(),
        ) {
            let expected = record(&displacements);
            let mut changed = displacements;
            let start = start.index(changed.len());
            changed.rotate_left(start);
            prop_assert_eq!(&record(&changed), &expected);
            for u in &mut changed {
                *u = -*u;
            }
            prop_assert_eq!(&record(&changed), &expected);
            changed.reverse();
            prop_assert_eq!(&record(&changed), &expected);
        }

        #[test]
        fn points_between_reversals_change_nothing(
            displacements in any_displacements(),
            parts in prop::collection::vec(prop::collection::vec(0.0..=1.0, 0..4), 40),
        ) {
            let mut denser = Vec::new();
            let next = displacements.iter().cycle().skip(1);
            for ((from, to), mut parts) in displacements.iter().zip(next).zip(parts) {
                parts.sort_unstable_by(f64::total_cmp);
                denser.push(*from);
                // Rounding must not move a point outside the interval.
                let (low, high) = (from.min(*to), from.max(*to));
                denser.extend(parts.iter().map(|part| (from + part * (to - from)).clamp(low, high)));
            }
            prop_assert_eq!(record(&denser), record(&displacements));
        }

        #[test]
        fn the_slip_path_decreases_with_the_limit_to_zero_and_is_convex(
            displacements in any_displacements(),
            limits in prop::array::uniform3(0.0..1.2),
        ) {
            let record = record(&displacements);
            let closed = displacements.iter().zip(displacements.iter().cycle().skip(1));
            let whole: f64 = closed.map(|(from, to)| (to - from).abs()).sum();
            prop_assert!((record.path(0.0) / whole - 1.0).abs() < 1e-14);
            prop_assert!((record.slip(0.0) * 4.0 * record.amplitude / whole - 1.0).abs() < 1e-14);
            let mut limits = limits;
            limits.sort_unstable_by(f64::total_cmp);
            let [left, middle, right] = limits;
            let [high, between, low] = limits.map(|ratio| record.slip(ratio));
            prop_assert!(high >= between && between >= low && low >= 0.0);
            let chord = (high * (right - middle) + low * (middle - left)) / (right - left);
            prop_assert!(right <= left || between <= chord + 1e-14 * high);
            prop_assert_eq!(low > 0.0, right < 1.0);
        }

        #[test]
        fn random_short_records_agree_with_a_simulated_spring(
            displacements in any_displacements(),
            ratio in 0.0..1.0,
        ) {
            let record = record(&displacements);
            let limit = ratio * record.amplitude;
            let expected = dragged(&displacements, limit);
            prop_assert!((record.path(limit) - expected).abs() < 1e-13 * record.path(0.0));
        }
    }
}
