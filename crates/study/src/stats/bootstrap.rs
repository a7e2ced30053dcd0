//! Bootstrap: an interval for the true value of an estimate, from the sample alone.
//!
//! Many new samples are drawn from the rows of the sample, with replacement, and the estimate is computed from each of
//! them. The interval contains the middle share `level` of these estimates (percentile method).
//!
//! A large sample is drawn in blocks of consecutive rows. This takes less time. In a Sobol sequence a block
//! is itself evenly spread, so the intervals also come closer to the true error. They
//! remain too wide for such points, because the blocks are drawn as if they were independent.
//!
//! # Sources
//! B. Efron, R. J. Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13.

use fretwork_random::Stream;

/// The largest number of blocks.
pub const MAX_BLOCKS: usize = 1024;

/// How intervals are computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bootstrap {
    pub(crate) resamples: usize,
    level: f64,
    seed: u64,
}

/// An estimate with its interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// The estimate from the whole sample.
    pub value: f64,
    /// The lower end of the interval.
    pub low: f64,
    /// The upper end of the interval.
    pub high: f64,
}

impl Bootstrap {
    /// Intervals that contain the share `level` of the estimates from `resamples` drawn samples. Choose `resamples` so
    /// that several estimates lie below and above each interval.
    ///
    /// # Errors
    /// What is wrong with the level.
    pub fn new(resamples: usize, level: f64, seed: u64) -> Result<Self, &'static str> {
        if (0.5..=0.999).contains(&level) {
            Ok(Self { resamples, level, seed })
        } else {
            Err("must be from 0.5 to 0.999. Use 0.95 for intervals of 95 %")
        }
    }

    /// Estimates from the sums of all rows, with intervals. Each row has `width` numbers in `rows`.
    ///
    /// `estimate` computes the estimates from the sums over a sample. Rows without values are zeros, and a column of
    /// ones counts the other rows. If `estimate` returns `None` for a drawn sample, another sample is drawn. It must
    /// return estimates for the whole sample.
    pub(super) fn estimate(
        &self,
        rows: &[f64],
        width: usize,
        estimate: impl Fn(&[f64]) -> Option<Vec<f64>>,
    ) -> Option<Vec<Estimate>> {
        let blocks = blocks(rows, width);
        let values = estimate(&sum(blocks.iter().map(Vec::as_slice), width))?;
        let random = Stream::new(self.seed);
        let count = blocks.len() as u64;
        let samples = (0..).filter_map(|sample| {
            let bits = random.child(sample);
            let drawn = (0..count).map(|i| &*blocks[bits.below(i, count) as usize]);
            estimate(&sum(drawn, width))
        });
        let mut drawn = vec![Vec::with_capacity(self.resamples); values.len()];
        for sample in samples.take(self.resamples) {
            for (list, value) in drawn.iter_mut().zip(sample) {
                list.push(value);
            }
        }
        let tail = 0.5 * (1.0 - self.level);
        let interval = |(value, mut drawn): (f64, Vec<f64>)| {
            drawn.sort_unstable_by(f64::total_cmp);
            Estimate { value, low: percentile(&drawn, tail), high: percentile(&drawn, 1.0 - tail) }
        };
        Some(values.into_iter().zip(drawn).map(interval).collect())
    }
}

/// The sums over blocks of consecutive rows.
fn blocks(rows: &[f64], width: usize) -> Vec<Vec<f64>> {
    // The length is a power of two, so that each block of a Sobol sequence is evenly spread.
    let length = (rows.len() / width).div_ceil(MAX_BLOCKS).next_power_of_two();
    rows.chunks(length * width).map(|block| sum(block.chunks(width), width)).collect()
}

/// The sum of some rows or blocks, in their order.
fn sum<'a>(rows: impl Iterator<Item = &'a [f64]>, width: usize) -> Vec<f64> {
    let mut sum = vec![0.0; width];
    for row in rows {
        for (sum, value) in sum.iter_mut().zip(row) {
            *sum += value;
        }
    }
    sum
}

/// The value below which the share `share` of sorted values lies, interpolated between neighbours.
pub(super) fn percentile(sorted: &[f64], share: f64) -> f64 {
    let place = share * (sorted.len() - 1) as f64;
    let (below, part) = (place as usize, place.fract());
    if part == 0.0 {
        sorted[below]
    } else {
        sorted[below] * (1.0 - part) + sorted[below + 1] * part
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::distribution::normal_quantile;
    use fretwork_random::Random;

    #[expect(clippy::unnecessary_wraps, reason = "the form of an estimate")]
    fn mean(sums: &[f64]) -> Option<Vec<f64>> {
        Some(vec![sums[0] / sums[1]])
    }

    /// The interval of 95 % for the mean of normal numbers is mean ± 1.96σ/√n.
    #[test]
    fn the_interval_of_a_mean_has_the_theoretical_width() {
        let mut random = Random::new(3);
        for rows in [400, 40_000] {
            let sample: Vec<f64> = (0..rows)
                .flat_map(|_| [normal_quantile(random.between(1e-12, 1.0)), 1.0])
                .collect();
            let bootstrap = Bootstrap::new(2000, 0.95, 1).unwrap();
            let estimate = bootstrap.estimate(&sample, 2, mean).unwrap()[0];
            let theory = 2.0 * 1.959_964 / f64::from(rows).sqrt();
            let ratio = (estimate.high - estimate.low) / theory;
            assert!((ratio - 1.0).abs() < 0.1, "{rows} rows: {ratio} of the width");
            assert!(estimate.low < estimate.value && estimate.value < estimate.high);
        }
    }

    #[test]
    fn percentiles_are_interpolated() {
        let values = [0.0, 0.75, 1.0].map(|share| percentile(&[1.0, 2.0, 4.0], share));
        assert_eq!(values.map(f64::to_bits), [1.0, 3.0, 4.0].map(f64::to_bits));
    }
}
