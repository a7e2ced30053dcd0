//! Matrices as whole numbers that tell how each number differs from what its neighbours lead one to
//! expect. What is smooth over radii and instants then takes a few bits a number once it is compressed,
//! where the digits themselves would take as many as they are.

use std::mem;

use serde::ser::SerializeMap as _;
use serde::{Serialize, Serializer};

/// The digits of the largest number of a matrix, unless others are asked for.
pub const USUAL: u8 = 7;
/// The most there are: the numbers and their differences are then exact in every language.
pub const DIGITS: u8 = 12;

/// How often the numbers of a row may be replaced by their differences.
const ALONG: u8 = 4;

/// A matrix by its differences: summed up once from row to row and so many times along each row they are
/// the numbers again, in steps. Rows may differ in length: what a row does not have stays as it was.
#[derive(Debug, Clone, PartialEq)]
pub struct Differences {
    /// What 1 is worth: a power of ten, by which the largest number has the digits asked for.
    step: f64,
    /// How often to sum up from row to row, and along each row: what takes the fewest bits.
    sums: (u8, u8),
    rows: Vec<Vec<i64>>,
    /// Row and place of what is infinite; there stands what stands before it.
    missing: Vec<(usize, usize)>,
}

impl Differences {
    /// A matrix whose largest number is told with so many digits, at most [`DIGITS`].
    pub fn of(matrix: &[Vec<f64>], digits: u8) -> Self {
        let sizes =
            matrix.iter().flatten().filter(|number| number.is_finite()).copied().map(f64::abs);
        let largest = sizes.fold(0.0, f64::max);
        // As it is written, so that no rounding of a logarithm moves it.
        let power: i32 =
            format!("{largest:e}").rsplit('e').next().map_or(0, |power| power.parse().unwrap_or(0));
        let step = format!("1e{}", power + 1 - i32::from(digits)).parse().ok();
        // Below the smallest numbers there are no steps.
        let step = step.filter(|step| *step > 0.0 && largest > 0.0).unwrap_or(1.0);
        let mut missing = Vec::new();
        let mut steps: Vec<Vec<i64>> = Vec::with_capacity(matrix.len());
        for (row, numbers) in matrix.iter().enumerate() {
            let mut last = 0;
            let here = numbers.iter().enumerate().map(|(place, number)| {
                if number.is_finite() {
                    last = (number / step).round() as i64;
                } else {
                    missing.push((row, place));
                }
                last
            });
            steps.push(here.collect());
        }
        let ways = (1..=ALONG).map(|along| {
            for row in &mut steps {
                for place in (1..row.len()).rev() {
                    row[place] -= row[place - 1];
                }
            }
            let rows = from_row_to_row(&steps);
            let bits: u64 = rows.iter().flatten().map(|number| bits(*number)).sum();
            (bits, along, rows)
        });
        let best = ways.min_by_key(|(bits, along, _)| (*bits, *along));
        let (along, rows) = best.map_or((1, Vec::new()), |(_, along, rows)| (along, rows));
        Self { step, sums: (1, along), rows, missing }
    }
}

/// By how much each number differs from the one above it, in the last row that had one.
fn from_row_to_row(rows: &[Vec<i64>]) -> Vec<Vec<i64>> {
    let width = rows.iter().map(Vec::len).max().unwrap_or(0);
    let mut above = vec![0; width];
    let row = |row: &Vec<i64>| {
        let change = |(number, above): (&i64, &mut i64)| *number - mem::replace(above, *number);
        row.iter().zip(&mut above).map(change).collect()
    };
    rows.iter().map(row).collect()
}

/// About what a number takes once it is compressed.
fn bits(number: i64) -> u64 {
    u64::from(u64::BITS - number.unsigned_abs().leading_zeros())
}

impl Serialize for Differences {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        let mut map = json.serialize_map(None)?;
        map.serialize_entry("step", &self.step)?;
        map.serialize_entry("sums", &self.sums)?;
        map.serialize_entry("differences", &self.rows)?;
        if !self.missing.is_empty() {
            map.serialize_entry("missing", &self.missing)?;
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use std::iter;

    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    /// The numbers, in steps, as a client finds them.
    fn summed(told: &Differences) -> Vec<Vec<i64>> {
        let width = told.rows.iter().map(Vec::len).max().unwrap_or(0);
        let pad = |row: &Vec<i64>| row.iter().copied().chain(iter::repeat(0)).take(width).collect();
        let mut full: Vec<Vec<i64>> = told.rows.iter().map(pad).collect();
        for _ in 0..told.sums.0 {
            for row in 1..full.len() {
                let (before, from) = full.split_at_mut(row);
                from[0]
                    .iter_mut()
                    .zip(&before[row - 1])
                    .for_each(|(number, above)| *number += above);
            }
        }
        for row in &mut full {
            for _ in 0..told.sums.1 {
                (1..width).for_each(|place| row[place] += row[place - 1]);
            }
        }
        full.iter().zip(&told.rows).map(|(full, row)| full[..row.len()].to_vec()).collect()
    }

    proptest! {
        #[test]
        fn every_number_comes_back_within_half_a_step(
            matrix in vec(vec(prop_oneof![8 => -1e3..1e3, 1 => Just(f64::NAN)], 0..9), 0..7),
            power in -300_i32..300,
            digits in 1..=DIGITS,
        ) {
            let scale: f64 = format!("1e{power}").parse().unwrap();
            let matrix: Vec<Vec<f64>> =
                matrix.iter().map(|row| row.iter().map(|number| number * scale).collect()).collect();
            let told = Differences::of(&matrix, digits);
            let largest = matrix.iter().flatten().copied().map(f64::abs).fold(0.0, f64::max);
            let room: f64 = format!("1e{digits}").parse().unwrap();
            prop_assert!(largest < told.step * room || largest == 0.0);
            let mut missing = Vec::new();
            for (i, (row, numbers)) in summed(&told).iter().zip(&matrix).enumerate() {
                prop_assert_eq!(row.len(), numbers.len());
                for (j, (steps, number)) in row.iter().zip(numbers).enumerate() {
                    if number.is_nan() {
                        missing.push((i, j));
                        prop_assert_eq!(*steps, if j == 0 { 0 } else { row[j - 1] });
                    } else {
                        prop_assert!((*steps as f64 - number / told.step).abs() < 0.501);
                    }
                }
            }
            prop_assert_eq!(missing, told.missing);
        }
    }

    #[test]
    fn what_is_straight_and_stays_is_nothing_but_zeros() {
        let straight = vec![(0..5).map(|i| 1e-6 * f64::from(i)).collect::<Vec<_>>(); 3];
        let told = serde_json::to_string(&Differences::of(&straight, 2)).unwrap();
        let rows = "[[0,10,0,0,0],[0,0,0,0,0],[0,0,0,0,0]]";
        assert_eq!(told, format!("{{\"step\":1e-7,\"sums\":[1,2],\"differences\":{rows}}}"));
        let none = Differences::of(&[vec![f64::NAN, 0.0]], 3);
        let expected = "{\"step\":1.0,\"sums\":[1,1],\"differences\":[[0,0]],\"missing\":[[0,0]]}";
        assert_eq!(serde_json::to_string(&none).unwrap(), expected);
    }
}
