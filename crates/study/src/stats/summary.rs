//! What describes the values of an output over all points: mean, standard deviation, percentiles and a histogram.
//!
//! Percentiles are interpolated between neighbours in the sorted values, as `numpy.percentile` does.

use super::bootstrap::percentile;

/// Maximum number of bins of a histogram.
const MAX_BINS: usize = 50;

/// The finite values of an output, sorted.
#[derive(Debug)]
pub struct Summary(Vec<f64>);

/// A bin of a histogram. It contains `from`; only the last bin contains `to`.
#[derive(Debug, PartialEq)]
pub struct Bin {
    /// The lower end.
    pub from: f64,
    /// The upper end.
    pub to: f64,
    /// The number of values.
    pub points: usize,
}

impl Summary {
    /// The summary of the finite values.
    pub fn new(values: &[f64]) -> Self {
        let mut values: Vec<f64> =
            values.iter().copied().filter(|value| value.is_finite()).collect();
        values.sort_unstable_by(f64::total_cmp);
        Self(values)
    }

    /// The number of values.
    pub fn points(&self) -> usize {
        self.0.len()
    }

    /// The mean; `None` without values.
    pub fn mean(&self) -> Option<f64> {
        // Large values are divided before they are added, so that the sum stays finite.
        let count = self.0.len() as f64;
        (!self.0.is_empty()).then(|| self.0.iter().map(|value| value / count).sum())
    }

    /// The standard deviation, with n − 1; `None` with fewer than two values.
    pub fn standard_deviation(&self) -> Option<f64> {
        let (mean, low, high) = (self.mean()?, self.0[0], self.0[self.0.len() - 1]);
        // The mean of equal values can have a rounding error.
        if low >= high {
            return (self.0.len() > 1).then_some(0.0);
        }
        let most = low.abs().max(high.abs());
        // The largest value is the unit, because squares of volumes in m³ can be smaller than any float64.
        let scaled = self.0.iter().map(|value| (value - mean) / most);
        let squares: f64 = scaled.map(|value| value * value).sum();
        (self.0.len() > 1).then(|| most * (squares / (self.0.len() - 1) as f64).sqrt())
    }

    /// The value below which this share of the values lies; `None` without values.
    pub fn percentile(&self, share: f64) -> Option<f64> {
        (!self.0.is_empty()).then(|| percentile(&self.0, share))
    }

    /// The ends of an interval that contains this percentile of the distribution with a confidence of 95 %, if the values
    /// are independent: the number of values below the percentile is binomial. `None` with too few values.
    pub fn percentile_interval(&self, share: f64) -> Option<[f64; 2]> {
        let count = self.0.len() as f64;
        let half = 1.96 * (share * (1.0 - share) / count).sqrt();
        // Nothing is known beyond the smallest and the largest value.
        let is_inside = (share - half).min(1.0 - share - half) * count >= 1.0;
        is_inside.then(|| [share - half, share + half].map(|end| percentile(&self.0, end)))
    }

    /// Bins of equal width from the smallest to the largest value: about √n, at most 50. Equal values have one bin.
    pub fn histogram(&self) -> Vec<Bin> {
        let (Some(low), Some(high)) = (self.percentile(0.0), self.percentile(1.0)) else {
            return Vec::new();
        };
        let count = self.0.len();
        let bins = if low < high { count.isqrt().clamp(1, MAX_BINS) } else { 1 };
        // Halves, so that the width stays finite. Each operation is monotonic, so the edges are in order.
        let half = high / 2.0 - low / 2.0;
        let edge = |bin: usize| {
            let inner = 2.0 * (low / 2.0 + half * (bin as f64 / bins as f64));
            if bin == bins { high } else { inner.min(high) }
        };
        let before = |bin: usize| {
            let end = edge(bin);
            if bin == bins { count } else { self.0.partition_point(|value| *value < end) }
        };
        let bin = |bin| Bin {
            from: edge(bin),
            to: edge(bin + 1),
            points: before(bin + 1) - if bin == 0 { 0 } else { before(bin) },
        };
        (0..bins).map(bin).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_of_few_values_is_known() {
        let summary = Summary::new(&[4.0, f64::NAN, 1.0, 2.0, 3.0]);
        assert_eq!((summary.points(), summary.mean()), (4, Some(2.5)));
        // numpy.std([1, 2, 3, 4], ddof=1) and numpy.percentile([1, 2, 3, 4], [5, 50]).
        let deviation = summary.standard_deviation().unwrap();
        assert!((deviation - 1.290_994_448_735_805_6).abs() < 1e-15, "{deviation}");
        let found = [0.05, 0.5].map(|share| summary.percentile(share).unwrap());
        assert!((found[0] - 1.15).abs() < 1e-15 && (found[1] - 2.5).abs() < 1e-15, "{found:?}");
        let bins = [(1.0, 2.5, 2), (2.5, 4.0, 2)];
        let expected = bins.map(|(from, to, points)| Bin { from, to, points });
        assert_eq!(summary.histogram(), expected);
    }

    #[test]
    fn the_deviation_of_tiny_values_does_not_underflow() {
        let deviation = Summary::new(&[1e-200, 3e-200]).standard_deviation().unwrap();
        assert!((deviation / 2.0_f64.sqrt() / 1e-200 - 1.0).abs() < 1e-15, "{deviation}");
        assert_eq!(Summary::new(&[0.1; 10]).standard_deviation(), Some(0.0));
    }

    #[test]
    fn the_interval_of_a_percentile_contains_it_as_often_as_it_says() {
        let mut random = fretwork_random::Random::new(1);
        for (count, share) in [(128, 0.05), (256, 0.95), (1000, 0.05), (100, 0.5)] {
            let contains = |_: &u32| {
                let values: Vec<f64> = (0..count).map(|_| random.between(0.0, 1.0)).collect();
                let [low, high] = Summary::new(&values).percentile_interval(share).unwrap();
                (low..=high).contains(&share)
            };
            let often = (0..2000).filter(contains).count();
            // 1900 are expected. Ranks are whole numbers, so the confidence is not exact.
            assert!((1850..1970).contains(&often), "{count} {share}: {often}");
        }
        assert_eq!(Summary::new(&[1.0; 60]).percentile_interval(0.05), None);
        assert_eq!(Summary::new(&[]).percentile_interval(0.5), None);
    }

    #[test]
    fn each_value_is_in_one_bin() {
        let values: Vec<f64> = (0..1000).map(|place| f64::from(place * 7919 % 1000)).collect();
        let bins = Summary::new(&values).histogram();
        assert_eq!((bins.len(), bins.iter().map(|bin| bin.points).sum::<usize>()), (31, 1000));
        assert!(bins.windows(2).all(|pair| pair[0].to.to_bits() == pair[1].from.to_bits()));
        let neighbours = [1.0, 1.0 + f64::EPSILON].repeat(1250);
        let bins = Summary::new(&neighbours).histogram();
        assert_eq!((bins.len(), bins.iter().map(|bin| bin.points).sum::<usize>()), (50, 2500));
        assert_eq!(Summary::new(&[2.0; 9]).histogram().len(), 1);
        let none = Summary::new(&[f64::NAN]);
        assert!(none.histogram().is_empty() && none.mean().is_none());
        assert_eq!(Summary::new(&[1.0]).standard_deviation(), None);
    }
}
