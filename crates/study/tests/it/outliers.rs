//! Outliers among the residuals of linear fits.

use fretwork_random::Stream;
use fretwork_study::stats::outliers::outliers;

use crate::normal;

/// The columns of a constant, and of a line.
fn columns(count: usize, parameters: usize) -> Vec<Vec<f64>> {
    let line = (0..count).map(|it| 2.0 + it as f64).collect();
    [vec![3.0; count], line].into_iter().take(parameters).collect()
}

#[test]
fn the_studentised_residuals_of_a_line_agree_with_lines_through_the_others() {
    // Distances from the lines through the seven other points, from the formulas of linear regression.
    let y = [1.0, 3.0, 2.0, 5.0, 4.0, 9.0, 6.0, 8.0];
    let columns = columns(8, 2);
    let found = outliers(&y, &columns, true);
    let known = [
        -0.200_000_000_000,
        0.551_677_284_367,
        -0.905_569_562_445,
        0.501_795_337_913,
        -0.876_480_310_592,
        3.274_373_067_832,
        -0.973_650_690_086,
        -0.200_000_000_000,
    ];
    for (found, known) in found.studentized.iter().zip(known) {
        assert!((found - known).abs() < 1e-9, "{found} {known}");
    }
    // A point that is left out has the same one.
    assert!(found.places.is_empty());
}

/// The share of campaigns in which all outliers of five deviations are named. Without outliers, the share in which one is.
fn named(count: usize, wrong: usize, parameters: usize, is_estimated: bool) -> f64 {
    let tries = 400;
    let hits = (0..tries).filter(|seed| {
        let stream = Stream::new(*seed).child(count as u64 + 100 * wrong as u64);
        let mut values: Vec<f64> = (0..count).map(|it| normal(stream, it as u64)).collect();
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by_key(|place| stream.at(1000 + *place as u64));
        let places = &order[..wrong];
        for place in places {
            values[*place] +=
                if stream.at(2000 + *place as u64).is_multiple_of(2) { 5.0 } else { -5.0 };
        }
        let found = outliers(&values, &columns(count, parameters), is_estimated).places;
        if wrong == 0 {
            !found.is_empty()
        } else {
            places.iter().all(|place| found.contains(place))
        }
    });
    100.0 * hits.count() as f64 / tries as f64
}

#[test]
fn outliers_of_five_deviations_are_named_and_others_seldom() {
    // The least share in %, below which chance brings it in one of a thousand campaigns.
    for (count, wrong, parameters, is_estimated, least) in [
        (8, 1, 1, false, 94.0),
        (8, 3, 1, false, 83.0),
        (12, 3, 1, false, 86.0),
        (20, 3, 2, false, 80.0),
        (12, 1, 1, true, 75.0),
        (24, 1, 1, true, 85.0),
    ] {
        let share = named(count, wrong, parameters, is_estimated);
        assert!(share >= least, "{count} {wrong} {parameters} {is_estimated}: {share} %");
        let falsely = named(count, 0, parameters, is_estimated);
        assert!(falsely <= 8.0, "{count} {parameters} {is_estimated}: {falsely} %");
    }
}
