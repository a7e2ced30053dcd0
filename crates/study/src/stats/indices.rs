//! Sobol indices: which share of the variance of an output is due to which member.
//!
//! The first-order index Sᵢ is the share of the variance that member i causes alone: the expected decrease of the
//! variance if xᵢ were known. The total index Tᵢ is the share that member i causes alone or by interactions with other
//! members: the share that would remain if all other members were known. Sᵢ ≤ Tᵢ, and the difference is due to
//! interactions. A member with Tᵢ ≈ 0 can be fixed.
//!
//! The design has groups of d + 2 points for d members: A, then Aᵢ for every member, then B. A and B are independent
//! points: the first and the second half of one point of a Sobol sequence in 2d dimensions. Aᵢ is A with the
//! coordinate xᵢ of B.
//!
//! # Equations
//! ```text
//! V  = variance of all f(A) and f(B)
//! Sᵢ = ⟨f(B)·(f(Aᵢ) − f(A))⟩ / V     Saltelli et al. (2010), table 2 (b)
//! Tᵢ = ⟨(f(A) − f(Aᵢ))²⟩ / 2V        Jansen (1999)
//! ```
//! ⟨…⟩ is the mean over the groups. The mean of all values is subtracted from f first, which makes Sᵢ more accurate.
//!
//! # Accuracy
//! The estimates have intervals by the [bootstrap](Bootstrap) over groups. With 256 groups of the Ishigami function
//! and the level 0.95, 595 of 600 intervals contain the index. Intervals of larger samples are many times wider than
//! the error, because Sobol points are more even than the random points that the bootstrap assumes.
//!
//! An estimate can be negative, although an index cannot. Following A. Saltelli et al., *Global Sensitivity Analysis.
//! The Primer* (2008), it is kept as it is: a negative value shows the size of the error, and values
//! that are set to 0 would be biased. [`Indices::cautions`] says what to do.
//!
//! # Sources
//! - I. M. Sobol, Math. Comput. Simul. 55 (2001) 271: the indices.
//! - A. Saltelli et al., Comput. Phys. Commun. 181 (2010) 259: the design and Sᵢ.
//! - M. J. W. Jansen, Comput. Phys. Commun. 117 (1999) 35: Tᵢ.

use super::design::sobol::Sobol;
use super::{Bootstrap, Estimate};

/// Results have 12 significant digits. Outputs that differ by less, relative to the largest one, are constant.
const ROUNDING: f64 = 1e-11;

/// What is said of an output without variance.
const CONSTANT: &str = "The output has the same value at all points, so there is no variance to share. Choose another \
                        output, or vary other members or wider ranges.";
/// What is said of a member whose first-order index is negative.
const NEGATIVE: &str = "The first-order index is estimated below 0, because the sample is small. Read it as 0, or use \
                        more groups.";

/// The points at which Sobol indices need the outputs.
#[derive(Debug, Clone)]
pub struct Saltelli {
    sobol: Sobol,
    members: usize,
}

impl Saltelli {
    /// The design for this number of members. More groups with the same seed begin with the same points.
    pub fn new(members: usize, seed: u64) -> Self {
        Self { sobol: Sobol::new(2 * members, seed), members }
    }

    /// The number of points of a group, d + 2.
    pub fn group(&self) -> usize {
        self.members + 2
    }

    /// The coordinates of a point in the unit cube. Points 0 to d + 1 are the first group, and so on.
    pub fn point(&self, index: usize) -> Vec<f64> {
        let (group, place) = (index / self.group(), index % self.group());
        let from_second = |member| place == self.members + 1 || place == member + 1;
        (0..self.members)
            .map(|member| {
                let column = if from_second(member) { self.members + member } else { member };
                self.sobol.coordinate(group as u32, column)
            })
            .collect()
    }
}

/// The indices of one output.
#[derive(Debug, Clone, PartialEq)]
pub struct Indices {
    /// The indices of each member.
    pub members: Vec<Index>,
    /// The number of groups that the indices are computed from.
    pub groups: usize,
    /// The number of groups that are left out, because a point of them has no value.
    pub left_out: usize,
}

/// The indices of one member.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Index {
    /// The first-order index Sᵢ.
    pub first: Estimate,
    /// The total index Tᵢ.
    pub total: Estimate,
}

impl Indices {
    /// The limitations of these indices, with the place of the member that one is about. Each text says what to change.
    pub fn cautions(&self) -> Vec<(Option<usize>, String)> {
        let (left_out, planned) = (self.left_out, self.groups + self.left_out);
        let size = (!planned.is_power_of_two()).then(|| {
            format!(
                "The number of groups, {planned}, is not a power of two. The estimates are valid but less accurate than \
                 with {}.",
                planned.next_power_of_two()
            )
        });
        let missing = (left_out > 0).then(|| {
            format!(
                "{left_out} of {planned} groups of points are left out, because a point of them has no value. The \
                 indices hold for the other points only."
            )
        });
        let members = self.members.iter().enumerate();
        let negative = members.filter(|(_, member)| member.first.value < 0.0);
        let of_all = size.into_iter().chain(missing).map(|text| (None, text));
        of_all.chain(negative.map(|(member, _)| (Some(member), NEGATIVE.to_owned()))).collect()
    }
}

/// The indices of one output from its values at the points of a [`Saltelli`] design, in their order. A point without
/// a value is left out with its group.
///
/// # Errors
/// The reason why there are no indices, and what to change.
///
/// # Panics
/// If the last group is not complete.
pub fn indices(
    outputs: &[Option<f64>],
    members: usize,
    bootstrap: &Bootstrap,
) -> Result<Indices, String> {
    let planned = outputs.len() / (members + 2);
    assert_eq!(planned * (members + 2), outputs.len(), "the caller gives whole groups");
    let groups: Vec<Option<Vec<f64>>> = outputs.chunks(members + 2).map(complete_group).collect();
    let values = || groups.iter().flatten();
    let complete = values().count();
    if complete < 2 {
        return Err(format!(
            "Only {complete} of {planned} groups of points have all their values, and at least 2 are needed. Choose \
             ranges in which fewer points fail, or more groups."
        ));
    }
    let (low, high) = values()
        .flatten()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| (y.min(low), y.max(high)));
    let range = high - low;
    if range <= ROUNDING * high.abs().max(low.abs()) {
        return Err(CONSTANT.to_owned());
    }
    let count = (complete * (members + 2)) as f64;
    let mean = values().flatten().map(|y| y / count).sum::<f64>();

    // Values are scaled by their range, so that squares neither overflow nor underflow.
    let scaled = |y: f64| (y - mean) / range;
    // The columns: 1, a + b, a² + b², then b(aᵢ − a) and (a − aᵢ)² of each member.
    let width = 3 + 2 * members;
    let row = |group: Option<&[f64]>| -> Vec<f64> {
        let Some(group) = group else { return vec![0.0; width] };
        let (a, b) = (scaled(group[0]), scaled(group[members + 1]));
        let mixed = group[1..=members].iter().map(|value| scaled(*value));
        let own = mixed.flat_map(|mixed| [b * (mixed - a), (a - mixed) * (a - mixed)]);
        [1.0, a + b, a * a + b * b].into_iter().chain(own).collect()
    };
    let rows: Vec<f64> = groups.iter().flat_map(|group| row(group.as_deref())).collect();
    let estimates = bootstrap.estimate(&rows, width, |sums| {
        let values = 2.0 * sums[0];
        let (mean, square) = (sums[1] / values, sums[2] / values);
        let variance = square - mean * mean;
        let shares = sums[3..].chunks_exact(2).flat_map(|pair| [pair[0], 0.5 * pair[1]]);
        let shares = shares.map(|sum| sum / sums[0] / variance);
        // A drawn sample in which all values are equal has no indices.
        (variance > 1e-12).then(|| shares.collect())
    });
    let estimates = estimates.ok_or(CONSTANT)?;
    Ok(Indices {
        members: estimates
            .chunks_exact(2)
            .map(|pair| Index { first: pair[0], total: pair[1] })
            .collect(),
        groups: complete,
        left_out: planned - complete,
    })
}

/// The values of a group if all of them are finite.
fn complete_group(group: &[Option<f64>]) -> Option<Vec<f64>> {
    group.iter().map(|value| value.filter(|y| y.is_finite())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    /// A test function on the unit cube, with the first-order and the total index of each member.
    struct Problem {
        name: &'static str,
        f: fn(&[f64]) -> f64,
        indices: Vec<(f64, f64)>,
    }

    /// sin x₁ + 7 sin² x₂ + 0.1 x₃⁴ sin x₁ on −π…π. T. Ishigami, T. Homma, ISUMA '90, p. 398; the indices are in
    /// Saltelli et al., *Global Sensitivity Analysis. The Primer* (2008).
    fn ishigami() -> Problem {
        let (a, b, quartic) = (7.0, 0.1, PI * PI * PI * PI);
        let first = 0.5 * (1.0 + 0.2 * b * quartic) * (1.0 + 0.2 * b * quartic);
        let second = a * a / 8.0;
        let first_and_third = 8.0 / 225.0 * b * b * quartic * quartic;
        let variance = first + second + first_and_third;
        let indices = [(first, first + first_and_third), (second, second), (0.0, first_and_third)];
        Problem {
            name: "Ishigami",
            f: |u| {
                let sin = |u: f64| libm::sin(PI * (2.0 * u - 1.0));
                let third = PI * (2.0 * u[2] - 1.0);
                let square = third * third;
                sin(u[0]) * (1.0 + 0.1 * square * square) + 7.0 * sin(u[1]) * sin(u[1])
            },
            indices: indices.map(|(s, t)| (s / variance, t / variance)).to_vec(),
        }
    }

    /// Πᵢ (|4xᵢ − 2| + aᵢ)/(1 + aᵢ). The indices are in A. Saltelli, I. M. Sobol, Reliab. Eng. Syst. Saf. 50 (1995)
    /// 225, and the coefficients in Saltelli et al. (2010).
    fn sobol_g() -> Problem {
        const A: [f64; 8] = [0.0, 1.0, 4.5, 9.0, 99.0, 99.0, 99.0, 99.0];
        let own = A.map(|a| 1.0 / (3.0 * (1.0 + a) * (1.0 + a)));
        let product: f64 = own.iter().map(|v| 1.0 + v).product();
        let variance = product - 1.0;
        Problem {
            name: "Sobol G",
            f: |u| u.iter().zip(A).map(|(u, a)| ((4.0 * u - 2.0).abs() + a) / (1.0 + a)).product(),
            indices: own.map(|v| (v / variance, v * product / (1.0 + v) / variance)).to_vec(),
        }
    }

    impl Problem {
        fn outputs(&self, groups: usize, seed: u64) -> Vec<Option<f64>> {
            let design = Saltelli::new(self.indices.len(), seed);
            (0..groups * design.group()).map(|index| Some((self.f)(&design.point(index)))).collect()
        }

        /// The number of intervals that contain the true index, of 2d intervals.
        fn covered(&self, found: &Indices) -> usize {
            let contains = |e: Estimate, index: f64| usize::from(e.low <= index && index <= e.high);
            let pairs = found.members.iter().zip(&self.indices);
            pairs.map(|(m, (s, t))| contains(m.first, *s) + contains(m.total, *t)).sum()
        }
    }

    fn bootstrap(resamples: usize) -> Bootstrap {
        Bootstrap::new(resamples, 0.95, 1).unwrap()
    }

    #[test]
    fn intervals_of_16384_groups_contain_the_true_indices() {
        for problem in [ishigami(), sobol_g()] {
            let count = problem.indices.len();
            let found = indices(&problem.outputs(1 << 14, 1), count, &bootstrap(200)).unwrap();
            assert_eq!(problem.covered(&found), 2 * count, "{}: {found:?}", problem.name);
            for (member, (first, total)) in found.members.iter().zip(&problem.indices) {
                let errors = [member.first.value - first, member.total.value - total];
                assert!(
                    errors.iter().all(|error| error.abs() < 4e-3),
                    "{}: {errors:?}",
                    problem.name
                );
            }
        }
    }

    #[test]
    fn intervals_of_95_percent_contain_595_of_600_true_indices() {
        let problem = ishigami();
        let covered = (0..100).map(|seed| {
            let found = indices(&problem.outputs(256, seed), 3, &bootstrap(200)).unwrap();
            problem.covered(&found)
        });
        // The documentation of this module quotes the number.
        assert_eq!(covered.sum::<usize>(), 595, "of 600");
    }

    /// The expected values are from `SALib.analyze.sobol` 1.6.0 without second-order indices, from the same outputs.
    #[test]
    fn the_estimates_agree_with_salib() {
        let found = indices(&ishigami().outputs(64, 1), 3, &bootstrap(200)).unwrap();
        for (member, (first, total)) in found.members.iter().zip([
            (0.276_222_368_039_952_7, 0.564_242_005_742_284_7),
            (0.419_386_400_938_642_05, 0.476_951_781_751_152_55),
            (-0.038_114_265_832_281_21, 0.265_186_408_399_183_1),
        ]) {
            assert!((member.first.value - first).abs() < 1e-12);
            assert!((member.total.value - total).abs() < 1e-12);
        }
        assert_eq!(found.cautions(), [(Some(2), NEGATIVE.to_owned())]);
    }

    #[test]
    fn scaling_and_shifting_the_output_does_not_change_the_indices() {
        let outputs = ishigami().outputs(1024, 3);
        let found = indices(&outputs, 3, &bootstrap(100)).unwrap();
        let other: Vec<_> = outputs.iter().map(|y| y.map(|y| 1e-200 * (y + 1e4))).collect();
        let other = indices(&other, 3, &bootstrap(100)).unwrap();
        for (one, other) in found.members.iter().zip(&other.members) {
            assert!((one.first.value - other.first.value).abs() < 1e-9);
            assert!((one.total.high - other.total.high).abs() < 1e-9);
        }
    }

    #[test]
    fn a_group_with_a_failed_point_is_left_out() {
        let problem = ishigami();
        let mut outputs = problem.outputs(1024, 1);
        (outputs[7], outputs[5 * 100], outputs[5 * 100 + 4]) = (None, None, Some(f64::NAN));
        let found = indices(&outputs, 3, &bootstrap(100)).unwrap();
        assert_eq!((found.groups, found.left_out), (1022, 2));
        let [(None, caution)] = &found.cautions()[..] else {
            panic!("one caution about all members")
        };
        assert!(caution.starts_with("2 of 1024 groups of points are left out"), "{caution}");
        let whole = indices(&problem.outputs(1024, 1), 3, &bootstrap(100)).unwrap();
        for (found, whole) in found.members.iter().zip(&whole.members) {
            let change = found.first.value - whole.first.value;
            assert!(change != 0.0 && change.abs() < 0.02);
        }
    }

    #[test]
    fn a_number_of_groups_that_is_no_power_of_two_gives_a_caution() {
        let problem = ishigami();
        let found = indices(&problem.outputs(1000, 1), 3, &bootstrap(100)).unwrap();
        let [(None, caution)] = &found.cautions()[..] else {
            panic!("one caution about all members")
        };
        assert!(caution.contains("1000") && caution.ends_with("less accurate than with 1024."));
        assert_eq!(problem.covered(&found), 6);
    }

    #[test]
    fn an_output_without_variance_has_a_reason() {
        let constant: Vec<_> = (0..50).map(|i| Some(1.0 + 1e-13 * f64::from(i % 3))).collect();
        assert_eq!(indices(&constant, 3, &bootstrap(100)), Err(CONSTANT.to_owned()));
        assert_eq!(indices(&[Some(0.0); 50], 3, &bootstrap(100)), Err(CONSTANT.to_owned()));
        let mut failed = vec![None; 50];
        failed[..5].fill(Some(1.0));
        let few = indices(&failed, 3, &bootstrap(100)).unwrap_err();
        assert!(few.starts_with("Only 1 of 10 groups"), "{few}");
    }

    /// In many drawn samples of this output all values are equal. They give no estimate and are drawn again.
    #[test]
    fn an_output_that_differs_in_one_group_has_finite_indices() {
        let mut outputs = vec![Some(1.0); 100];
        outputs[4] = Some(2.0);
        for member in indices(&outputs, 3, &bootstrap(100)).unwrap().members {
            for e in [member.first, member.total] {
                assert!([e.value, e.low, e.high].iter().all(|x| x.is_finite()), "{e:?}");
            }
        }
    }

    #[test]
    fn each_point_of_a_group_replaces_one_coordinate_of_a_by_that_of_b() {
        let design = Saltelli::new(3, 1);
        let [a, one, two, three, b] = [10, 11, 12, 13, 14].map(|index| design.point(index));
        assert_eq!(one, [b[0], a[1], a[2]]);
        assert_eq!(two, [a[0], b[1], a[2]]);
        assert_eq!(three, [a[0], a[1], b[2]]);
    }
}
