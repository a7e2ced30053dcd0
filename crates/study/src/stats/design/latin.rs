//! Latin hypercube: of n points, each lies in a stratum of its own in every dimension.
//!
//! A stratum is one of n intervals of equal width. In each dimension a random permutation gives the stratum of a
//! point, and the point lies at a random place in it. The permutation is a Feistel network, so the stratum of point i
//! is computed from i alone. Designs with different numbers of points have different points.
//!
//! # Sources
//! - M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979) 239: the design.
//! - J. Black, P. Rogaway, *Ciphers with arbitrary finite domains*, CT-RSA 2002: the permutation.

use fretwork_random::Stream;

/// A stratum has 2²⁰ cells. A point is the centre of a cell.
const CELLS: u64 = 1 << 20;

/// A Latin hypercube with a seed.
#[derive(Debug, Clone)]
pub struct LatinHypercube {
    points: u64,
    /// The random bits of the permutation and of the places in the strata, for each dimension.
    dimensions: Vec<[Stream; 2]>,
}

impl LatinHypercube {
    /// The design with this number of points.
    pub fn new(points: usize, dimensions: usize, seed: u64) -> Self {
        let dimension = |place| [0, 1].map(|use_of| Stream::new(seed).child(place).child(use_of));
        let dimensions = (0..dimensions as u64).map(dimension).collect();
        Self { points: points as u64, dimensions }
    }

    /// One coordinate of the point with this index, greater than 0 and less than 1.
    pub fn coordinate(&self, index: usize, dimension: usize) -> f64 {
        let [permutation, cells] = self.dimensions[dimension];
        let stratum = permute(index as u64, self.points, permutation);
        let cell = cells.below(index as u64, CELLS);
        (stratum as f64 + (cell as f64 + 0.5) / CELLS as f64) / self.points as f64
    }
}

/// The place of `index` in a random permutation of the numbers below `end`.
///
/// A Feistel network permutes the numbers of an even number of bits. Results beyond `end` are permuted again until
/// one is below it. There are at most 4 times as many numbers as `end`, so this takes at most 4 permutations on
/// average.
fn permute(index: u64, end: u64, bits: Stream) -> u64 {
    /// With 4 rounds, the strata of two points would not be independent if `end` is small.
    const ROUNDS: u64 = 8;
    let half = (64 - (end - 1).leading_zeros()).div_ceil(2).max(1);
    let mask = (1 << half) - 1;
    let mut place = index;
    loop {
        let (mut left, mut right) = (place >> half, place & mask);
        for round in 0..ROUNDS {
            let image = bits.at(round << 32 | right) & mask;
            (left, right) = (right, left ^ image);
        }
        place = left << half | right;
        if place < end {
            return place;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOST: usize = 1 << 31;

    #[test]
    fn each_stratum_contains_one_point() {
        for points in [1, 2, 3, 7, 64, 1000, 4097] {
            let latin = LatinHypercube::new(points, 4, 5);
            for dimension in 0..4 {
                let mut strata: Vec<_> = (0..points)
                    .map(|index| (latin.coordinate(index, dimension) * points as f64) as usize)
                    .collect();
                strata.sort_unstable();
                assert_eq!(strata, (0..points).collect::<Vec<_>>());
            }
        }
    }

    #[test]
    fn coordinates_of_the_largest_design_stay_in_their_strata() {
        let latin = LatinHypercube::new(MOST, 1, 5);
        for index in (0..MOST).step_by(1_234_567) {
            let x = latin.coordinate(index, 0) * MOST as f64;
            assert!(x > 0.0 && x < MOST as f64 && x.fract() > 0.0, "{x}");
        }
    }

    /// The variance of a mean over the design depends on the strata of pairs of points. A χ² test over all pairs of
    /// strata shows that they are equally probable.
    #[test]
    fn all_pairs_of_strata_of_two_points_are_equally_probable() {
        for end in [2, 3, 4, 5, 6, 9, 17] {
            let pairs = end * (end - 1);
            let mut counts = std::collections::BTreeMap::new();
            for seed in 0..500 * pairs {
                let place = |index| permute(index, end, Stream::new(seed));
                *counts.entry((place(0), place(end - 1))).or_insert(0) += 1;
            }
            assert_eq!(counts.len() as u64, pairs);
            let excess: f64 =
                counts.values().map(|n| f64::from(n - 500) * f64::from(n - 500) / 500.0).sum();
            let freedom = (pairs - 1) as f64;
            let deviations = (excess - freedom) / (2.0 * freedom).sqrt();
            assert!(
                deviations.abs() < 3.5,
                "{end}: χ² is {deviations} standard deviations from its mean"
            );
        }
    }

    /// The correlation of two independent permutations of n places has the variance 1/(n − 1).
    #[test]
    fn dimensions_are_uncorrelated() {
        let (points, seeds) = (50, 400);
        let squares: f64 = (0..seeds)
            .map(|seed| {
                let latin = LatinHypercube::new(points, 2, seed);
                let x = |index, dimension| latin.coordinate(index, dimension) - 0.5;
                let product: f64 = (0..points).map(|i| x(i, 0) * x(i, 1)).sum();
                let correlation = 12.0 * product / points as f64;
                correlation * correlation
            })
            .sum();
        let ratio = squares / seeds as f64 * (points - 1) as f64;
        // The standard deviation of the ratio is √(2/400) = 0.07.
        assert!(
            (ratio - 1.0).abs() < 0.25,
            "the variance is {ratio} of that of random permutations"
        );
    }
}
