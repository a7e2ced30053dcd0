//! Matrices as whole numbers that tell how each number differs from what its neighbours lead one to
//! expect. What is smooth over radii and instants then takes a few bits a number once it is compressed,
//! where the digits themselves would take as many as they are.

use serde::ser::SerializeMap as _;
use serde::{Serialize, Serializer};

/// The largest number of digits: the numbers and their differences are then exact in every language.
pub const DIGITS: u8 = 12;

/// A matrix by its differences. Summed up once from row to row and twice along each row they are the
/// numbers again, in steps; a row that is longer than the one above goes on from 0. In NumPy:
/// `step * np.cumsum(np.cumsum(np.cumsum(differences, 0), 1), 1)`.
#[derive(Debug, Clone, PartialEq)]
pub struct Differences {
    /// What 1 is worth: a power of ten, by which the largest number has the digits asked for.
    step: f64,
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
        let mut rows: Vec<Vec<i64>> = Vec::with_capacity(matrix.len());
        for (row, numbers) in matrix.iter().enumerate() {
            let (mut last, mut rise) = (0, 0);
            let bends = numbers.iter().enumerate().map(|(place, number)| {
                let here = if number.is_finite() {
                    (number / step).round() as i64
                } else {
                    missing.push((row, place));
                    last
                };
                let bend = here - last - rise;
                (last, rise) = (here, here - last);
                bend
            });
            rows.push(bends.collect());
        }
        for row in (1..rows.len()).rev() {
            let (before, from) = rows.split_at_mut(row);
            for (bend, above) in from[0].iter_mut().zip(&before[row - 1]) {
                *bend -= above;
            }
        }
        Self { step, rows, missing }
    }
}

impl Serialize for Differences {
    fn serialize<S: Serializer>(&self, json: S) -> Result<S::Ok, S::Error> {
        let mut map = json.serialize_map(None)?;
        map.serialize_entry("step", &self.step)?;
        map.serialize_entry("differences", &self.rows)?;
        if !self.missing.is_empty() {
            map.serialize_entry("missing", &self.missing)?;
        }
        map.end()
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    /// The numbers, in steps, as a client finds them.
    fn summed(rows: &[Vec<i64>]) -> Vec<Vec<i64>> {
        let mut above: Vec<i64> = Vec::new();
        let row = |row: &Vec<i64>| {
            above = (0..row.len()).map(|i| row[i] + above.get(i).unwrap_or(&0)).collect();
            let sum = |sums: &[i64]| -> Vec<i64> {
                sums.iter()
                    .scan(0, |sum, next| {
                        *sum += next;
                        Some(*sum)
                    })
                    .collect()
            };
            sum(&sum(&above))
        };
        rows.iter().map(row).collect()
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
            for (i, (row, numbers)) in summed(&told.rows).iter().zip(&matrix).enumerate() {
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
        assert_eq!(told, format!("{{\"step\":1e-7,\"differences\":{rows}}}"));
        let none = Differences::of(&[vec![f64::NAN, 0.0]], 3);
        let expected = "{\"step\":1.0,\"differences\":[[0,0]],\"missing\":[[0,0]]}";
        assert_eq!(serde_json::to_string(&none).unwrap(), expected);
    }
}
