//! Points of the unit cube by the Sobol sequence, scrambled by the method of Owen.
//!
//! The first 2ᵏ points are a net: every box of a family of boxes of equal volume contains the same
//! number of points. So means over the points converge faster than those over random points. The
//! scrambling permutes the halves of each axis at random, then the quarters within each half, and so on. It keeps the
//! net, makes every coordinate uniformly distributed, and makes the mean over the points an unbiased estimate.
//!
//! Point i is computed from i, the seed and the dimension alone. A longer sequence begins with the points of a
//! shorter one. The direction numbers are those of S. Joe and F. Y. Kuo, and the order is that of the Gray code, as
//! in SciPy. The first point belongs to the net and is not left out.
//!
//! # Accuracy
//! A sequence has at most 2³² points, because a point has 32 digits before scrambling. After it, a coordinate has 52
//! digits: the scrambled digits after the 32nd are random. The coordinate is the centre of its cell, so it is never 0
//! or 1.
//!
//! # Sources
//! - I. M. Sobol, USSR Comput. Math. Math. Phys. 7 (1967) 86.
//! - I. A. Antonov, V. M. Saleev, USSR Comput. Math. Math. Phys. 19 (1979) 252: the order.
//! - S. Joe, F. Y. Kuo, SIAM J. Sci. Comput. 30 (2008) 2635: the direction numbers. `new-joe-kuo-6.256.txt` contains
//!   the first 256 dimensions of the file `new-joe-kuo-6.21201` at <https://web.maths.unsw.edu.au/~fkuo/sobol/>.
//! - A. B. Owen, *Randomly permuted (t,m,s)-nets and (t,s)-sequences* (1995): nested uniform scrambling.
//! - A. B. Owen, *On dropping the first Sobol' point* (2020): why the first point is kept.

use fretwork_random::Stream;

/// The largest number of dimensions.
pub const MAX_DIMENSIONS: usize = 256;

/// A digit of a coordinate is a bit. An unscrambled coordinate has 32.
const DIGITS: usize = 32;

/// Direction numbers: for each dimension from the second on its number d, the degree s and the inner coefficients a
/// of its polynomial, and the first s numbers m.
const JOE_KUO: &str = include_str!("new-joe-kuo-6.256.txt");

/// A scrambled Sobol sequence.
#[derive(Debug, Clone)]
pub struct Sobol {
    dimensions: Vec<Dimension>,
}

/// One coordinate of all points.
#[derive(Debug, Clone)]
struct Dimension {
    /// The direction numbers v₁, v₂, … as fractions of 2³².
    directions: [u32; DIGITS],
    /// The random bits of the scrambling.
    bits: Stream,
}

impl Sobol {
    /// The sequence in this number of dimensions. Each seed gives another scrambling.
    ///
    /// # Panics
    /// If there are more than [`MAX_DIMENSIONS`].
    pub fn new(dimensions: usize, seed: u64) -> Self {
        assert!(dimensions <= MAX_DIMENSIONS, "the caller checks the number of dimensions");
        let bits = Stream::new(seed);
        let first = std::iter::once([1; DIGITS]);
        let others = JOE_KUO.lines().skip(1).map(direction_integers);
        let dimensions = first.chain(others).take(dimensions).enumerate().map(|(place, m)| {
            let mut directions = m;
            for (i, direction) in directions.iter_mut().enumerate() {
                *direction <<= DIGITS - 1 - i;
            }
            Dimension { directions, bits: bits.child(place as u64) }
        });
        Self { dimensions: dimensions.collect() }
    }

    /// One coordinate of the point with this index, greater than 0 and less than 1.
    pub fn coordinate(&self, index: u32, dimension: usize) -> f64 {
        let dimension = &self.dimensions[dimension];
        scramble(dimension.digits(index), dimension.bits)
    }
}

impl Dimension {
    /// The unscrambled coordinate as a fraction of 2³².
    fn digits(&self, index: u32) -> u32 {
        let mut gray = index ^ (index >> 1);
        let mut digits = 0;
        while gray != 0 {
            digits ^= self.directions[gray.trailing_zeros() as usize];
            gray &= gray - 1;
        }
        digits
    }
}

/// The integers m₁, m₂, … m₃₂ of a dimension, from its line in the file. mᵢ/2ⁱ is the i-th direction number.
///
/// P. Bratley, B. L. Fox, ACM Trans. Math. Softw. 14 (1988) 88.
#[expect(
    clippy::expect_used,
    reason = "the file is part of the program, and a test reads all of it"
)]
fn direction_integers(line: &str) -> [u32; DIGITS] {
    let mut columns = line.split_ascii_whitespace().map(|n| n.parse().expect("a number"));
    let mut next = || columns.next().expect("a column");
    let (_dimension, degree, inner) = (next(), next() as usize, next());
    let mut m = [0; DIGITS];
    for i in 0..DIGITS {
        m[i] = if i < degree {
            next()
        } else {
            let highest = m[i - degree] ^ (m[i - degree] << degree);
            (1..degree)
                .filter(|k| inner >> (degree - 1 - k) & 1 == 1)
                .fold(highest, |sum, k| sum ^ (m[i - k] << k))
        };
    }
    m
}

/// Nested uniform scrambling: whether a digit is flipped is a random bit that depends on all digits before it. The
/// result is the centre of a cell of width 2⁻⁵².
///
/// A word of random bits decides over six digits. These bits are the nodes of a binary tree, numbered as in a heap:
/// node 1 flips the first digit, nodes 2 and 3 the second digit if the first one is 0 or 1, and so on to node 63.
fn scramble(digits: u32, bits: Stream) -> f64 {
    const PLACES: u32 = 52;
    const WORD: u32 = 6;
    let digits = u64::from(digits) << (PLACES - DIGITS as u32);
    // Six words flip the first 36 digits. A 1 before the digits distinguishes prefixes of different lengths.
    let prefix = |length: u32| 1 << length | digits >> (PLACES - length);
    let mut flips = 0;
    for length in (WORD..=36).step_by(WORD as usize) {
        let word = bits.at(prefix(length - WORD));
        let own = prefix(length) & ((1 << WORD) - 1);
        for depth in 0..WORD {
            let node = 1 << depth | own >> (WORD - depth);
            flips |= (word >> node & 1) << (PLACES - 1 - (length - WORD) - depth);
        }
    }
    // The remaining 16 digits are 0, so one random bit each flips them.
    flips |= bits.at(prefix(36)) >> (64 - 16);
    ((digits ^ flips) as f64 + 0.5) / (1_u64 << PLACES) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unscrambled(sobol: &Sobol, index: u32, dimension: usize) -> u32 {
        sobol.dimensions[dimension].digits(index)
    }

    /// The points of `scipy.stats.qmc.Sobol(256, scramble=False, bits=32)`, SciPy 1.17.1, as fractions of 2³².
    #[test]
    fn the_unscrambled_points_equal_those_of_scipy_in_the_same_order() {
        let sobol = Sobol::new(MAX_DIMENSIONS, 0);
        let mut checksum = 0xcbf2_9ce4_8422_2325_u64;
        for index in 0..1 << 12 {
            for dimension in 0..MAX_DIMENSIONS {
                let digits = unscrambled(&sobol, index, dimension);
                checksum = (checksum ^ u64::from(digits)).wrapping_mul(0x0100_0000_01b3);
            }
        }
        // FNV-1a over the words of the first 4096 points.
        assert_eq!(checksum, 0x51a1_a457_b7a2_2325);
        let some = [0, 1, 2, 3, 10, 40, 127, 255];
        for (index, expected) in [
            (0, [0; 8]),
            (100, [1696, 1056, 3168, 2976, 1888, 2912, 1888, 2336].map(|n: u32| n << 20)),
            (4095, [1, 3855, 1369, 3693, 2333, 823, 1071, 2511].map(|n: u32| n << 20)),
            (
                1_000_003,
                [
                    1_187_450_880,
                    2_413_424_640,
                    334_991_360,
                    1_796_354_048,
                    3_815_354_368,
                    3_916_083_200,
                    1_969_033_216,
                    3_460_722_688,
                ],
            ),
            (
                2_147_495_993,
                [
                    2_752_774_147,
                    2_238_272_853,
                    1_645_001_659,
                    4_141_547_569,
                    1_299_451_447,
                    2_677_556_307,
                    1_635_435_653,
                    1_557_921_969,
                ],
            ),
        ] {
            assert_eq!(some.map(|dimension| unscrambled(&sobol, index, dimension)), expected);
        }
    }

    #[test]
    fn scrambled_points_are_a_net_of_the_same_quality() {
        let sobol = Sobol::new(2, 3);
        // The first two dimensions are a (0,k,2)-net: each box of volume 2⁻¹⁰ contains one of 1024 points.
        for start in [0, 1024, 5 * 1024] {
            for across in 0..=10 {
                let mut boxes = vec![0; 1024];
                for index in start..start + 1024 {
                    let column = sobol.coordinate(index, 0) * f64::from(1 << across);
                    let row = sobol.coordinate(index, 1) * f64::from(1 << (10 - across));
                    boxes[((column as usize) << (10 - across)) + row as usize] += 1;
                }
                assert!(boxes.iter().all(|points| *points == 1), "2^{across} columns from {start}");
            }
        }
    }

    /// In one dimension n = 2ᵏ scrambled points lie in one stratum each, uniformly and independently. The variance of
    /// the mean of x is then exactly 1/(12n³). Points with fewer random bits, such as those of a digital shift, fail
    /// here.
    #[test]
    fn the_scrambling_has_the_variance_of_independent_strata() {
        let (points, seeds) = (16, 4000);
        for dimension in [0, 7] {
            let errors = (0..seeds).map(|seed| {
                let sobol = Sobol::new(dimension + 1, seed);
                let sum: f64 = (0..points).map(|index| sobol.coordinate(index, dimension)).sum();
                sum / f64::from(points) - 0.5
            });
            let (sum, squares) = errors.fold((0.0, 0.0), |(s, q), e| (s + e, q + e * e));
            let cube = f64::from(points * points * points);
            let variance = 1.0 / (12.0 * cube);
            let mean = sum / seeds as f64 / (variance / seeds as f64).sqrt();
            let ratio = squares / seeds as f64 / variance;
            // The standard deviation of the ratio is √(2/4000) = 0.022.
            assert!(mean.abs() < 3.5, "the mean error is {mean} standard deviations");
            assert!((ratio - 1.0).abs() < 0.08, "the variance is {ratio} of that of strata");
        }
    }

    /// The root mean square error of smooth integrals falls like n^-1.5 up to logarithms (Owen 1997). Random points
    /// have n^-0.5.
    #[test]
    fn integrals_converge_faster_than_with_random_points() {
        let error = |points: u32| {
            let squares = (0..20).map(|seed| {
                let sobol = Sobol::new(5, seed);
                let value = |index| {
                    let x = |dimension| sobol.coordinate(index, dimension) - 0.5;
                    (0..5).map(|dimension| 1.0 + x(dimension)).product::<f64>()
                };
                let mean = (0..points).map(value).sum::<f64>() / f64::from(points);
                (mean - 1.0) * (mean - 1.0)
            });
            (squares.sum::<f64>() / 20.0).sqrt()
        };
        let (few, many) = (error(64), error(4096));
        assert!(few / many > 64.0, "64 times as many points: the error falls {} times", few / many);
    }

    #[test]
    fn coordinates_are_between_0_and_1_and_never_repeat() {
        let sobol = Sobol::new(3, 1);
        let mut seen: Vec<_> =
            (0..4096).map(|index| sobol.coordinate(index, 2).to_bits()).collect();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), 4096);
        assert!(scramble(u32::MAX, Stream::new(0)) < 1.0 && scramble(0, Stream::new(0)) > 0.0);
        assert!(sobol.coordinate(u32::MAX, 2) < 1.0);
    }
}
