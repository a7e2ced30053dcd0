//! Designs: which values a study gives to the numbers that it varies.
//!
//! | design | points |
//! |---|---|
//! | grid | all combinations of the listed values |
//! | zip | the first values of all lists, the second values, and so on |
//! | Latin hypercube | random, stratified in every dimension |
//! | Sobol | quasi-random, see [`sobol`] |
//!
//! Point i is computed from the design and i alone. So a chunk of a study does not need the chunks before it. A larger
//! Sobol design with the same seed begins with the same points.
//!
//! # Units
//! The values of a member have its unit.
//!
//! # Examples
//! ```
//! use fretwork_study::stats::design::Design;
//! let grid = Design::grid(vec![vec![0.3, 0.5], vec![1.0, 2.0, 3.0]]);
//! assert_eq!(grid.points(), 6);
//! assert_eq!(grid.point(4), [0.5, 2.0]);
//! ```

pub mod latin;
pub mod sobol;

use fretwork_engine::Fault;

use super::distribution::Distribution;
use latin::LatinHypercube;
use sobol::Sobol;

/// The points of a study, and the values of all members at each point.
#[derive(Debug, Clone)]
pub struct Design {
    points: usize,
    rule: Rule,
}

#[derive(Debug, Clone)]
enum Rule {
    Grid(Vec<Vec<f64>>),
    Zip(Vec<Vec<f64>>),
    Latin(LatinHypercube, Vec<Distribution>),
    Sobol(Sobol, Vec<Distribution>),
}

impl Design {
    /// All combinations of the values of each member. The values of the last member change from point to point.
    pub fn grid(values: Vec<Vec<f64>>) -> Self {
        let points = values.iter().map(Vec::len).fold(1, usize::saturating_mul);
        Self { points, rule: Rule::Grid(values) }
    }

    /// The i-th values of all members together are point i.
    ///
    /// # Errors
    /// The fault at a member such as `/1`: the number of its values differs from that of the first member.
    pub fn zip(values: Vec<Vec<f64>>) -> Result<Self, Fault> {
        let points = values[0].len();
        if let Some(place) = values.iter().position(|list| list.len() != points) {
            let detail = format!(
                "has {} values, but the first entry has {points}. Enter the same number of values in all entries, or \
                 use the design grid",
                values[place].len()
            );
            return Err(Fault { pointer: format!("/{place}"), detail });
        }
        Ok(Self { points, rule: Rule::Zip(values) })
    }

    /// A Latin hypercube: random points, one in each of `points` equally probable intervals of every member.
    pub fn latin_hypercube(members: Vec<Distribution>, points: usize, seed: u64) -> Self {
        let latin = LatinHypercube::new(points, members.len(), seed);
        Self { points, rule: Rule::Latin(latin, members) }
    }

    /// The first points of a scrambled Sobol sequence. Powers of two fill the space most evenly.
    pub fn sobol(members: Vec<Distribution>, points: usize, seed: u64) -> Self {
        Self { points, rule: Rule::Sobol(Sobol::new(members.len(), seed), members) }
    }

    /// The number of points.
    pub fn points(&self) -> usize {
        self.points
    }

    /// The values of all members at the point with this index.
    ///
    /// # Panics
    /// If the design has no such point.
    pub fn point(&self, index: usize) -> Vec<f64> {
        assert!(index < self.points, "the design has {} points", self.points);
        let quantiles = |members: &[Distribution], coordinate: &dyn Fn(usize) -> f64| {
            members.iter().enumerate().map(|(i, member)| member.quantile(coordinate(i))).collect()
        };
        match &self.rule {
            Rule::Grid(values) => {
                let mut rest = index;
                let mut point = vec![0.0; values.len()];
                for (value, list) in point.iter_mut().zip(values).rev() {
                    *value = list[rest % list.len()];
                    rest /= list.len();
                }
                point
            }
            Rule::Zip(values) => values.iter().map(|list| list[index]).collect(),
            Rule::Latin(latin, members) => quantiles(members, &|i| latin.coordinate(index, i)),
            Rule::Sobol(sobol, members) => {
                quantiles(members, &|i| sobol.coordinate(index as u32, i))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn members(count: usize) -> Vec<Distribution> {
        vec![Distribution::uniform(0.0, 1.0).unwrap(); count]
    }

    #[test]
    fn a_grid_has_all_combinations_in_order() {
        let grid = Design::grid(vec![vec![1.0, 2.0], vec![5.0], vec![7.0, 8.0, 9.0]]);
        let points: Vec<_> = (0..grid.points()).map(|index| grid.point(index)).collect();
        let expected = [
            [1.0, 5.0, 7.0],
            [1.0, 5.0, 8.0],
            [1.0, 5.0, 9.0],
            [2.0, 5.0, 7.0],
            [2.0, 5.0, 8.0],
            [2.0, 5.0, 9.0],
        ];
        assert_eq!(points, expected);
    }

    #[test]
    fn point_i_of_a_zip_has_the_ith_value_of_each_member() {
        let zip = Design::zip(vec![vec![1.0, 2.0], vec![5.0, 6.0]]).unwrap();
        assert_eq!((zip.points(), zip.point(0), zip.point(1)), (2, vec![1.0, 5.0], vec![2.0, 6.0]));
    }

    #[test]
    fn a_larger_sobol_design_begins_with_the_same_points() {
        let (small, large) =
            (Design::sobol(members(5), 100, 9), Design::sobol(members(5), 1000, 9));
        assert!((0..100).all(|index| small.point(index) == large.point(index)));
    }

    #[test]
    fn different_seeds_give_different_points() {
        let point = |seed| Design::sobol(members(5), 10, seed).point(3);
        assert_ne!(point(1), point(2));
        let point = |seed| Design::latin_hypercube(members(5), 10, seed).point(3);
        assert_ne!(point(1), point(2));
    }

    /// Keys of stored studies contain the seed, so the points of a seed must never change.
    #[test]
    fn the_points_of_a_seed_stay_the_same() {
        let sobol = Design::sobol(members(2), 4, 42);
        let latin = Design::latin_hypercube(members(2), 4, 42);
        let points: Vec<_> =
            (0..4).map(|index| [sobol.point(index), latin.point(index)].concat()).collect();
        assert_eq!(
            points,
            [
                [
                    0.573_911_686_814_825_8,
                    0.035_541_458_350_239_474,
                    0.639_016_985_893_249_5,
                    0.471_087_098_121_643_07
                ],
                [
                    0.343_344_861_416_331_14,
                    0.510_547_328_827_09,
                    0.028_389_811_515_808_105,
                    0.005_459_666_252_136_230_5
                ],
                [
                    0.238_553_062_334_153_96,
                    0.494_517_585_457_008_4,
                    0.456_856_131_553_649_9,
                    0.631_740_689_277_648_9
                ],
                [
                    0.835_066_635_834_881_4,
                    0.886_198_886_115_537_3,
                    0.909_016_251_564_025_9,
                    0.780_823_826_789_856
                ]
            ]
        );
    }

    #[test]
    fn a_wrong_design_is_refused_with_a_pointer() {
        let fault = Design::zip(vec![vec![1.0], vec![1.0, 2.0]]).unwrap_err();
        assert_eq!(fault.pointer, "/1", "{}", fault.detail);
        assert!(fault.detail.contains("same number"), "{}", fault.detail);
    }
}
