//! Scatter plots of points with drawn values.
//!
//! A figure with 10⁵ dots would have megabytes, and the dots would merge into one dark area. So only some points are
//! drawn, evenly spaced in the order of the study. The median is that of all points. If each bin contains the points of
//! one abscissa, such as a level of a screening, percentiles are drawn too. Otherwise the points of a bin also differ
//! because of their abscissae, so percentiles would overstate the scatter of the output at one abscissa.

use crate::table::evenly_spaced;
use fretwork_plot::{Dash, Mark, PALETTE, Series, Style};

/// Maximum number of dots in a figure.
const MAX_DOTS: usize = 4000;
/// Up to this many points are drawn as discs. If there are more, they are drawn as dots, with a median.
const FEW: usize = 200;
/// Maximum number of bins, which have equally many points, and the minimum number of points of a bin.
const BINS: usize = 20;
const FEWEST: usize = 25;
/// The percentiles beside the median.
const TAILS: [f64; 2] = [0.05, 0.95];

/// The dots and the curves of a scatter plot, and a note about them.
pub fn series(x: &[f64], y: &[f64]) -> (Vec<Series>, String) {
    let points = x.iter().copied().zip(y.iter().copied());
    let points: Vec<_> = points.filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    let count = points.len();
    let mut note = String::new();
    let label = if count > MAX_DOTS {
        note = format!(" The figure shows {MAX_DOTS} of {count} points.");
        format!("{MAX_DOTS} of {count} points")
    } else {
        String::new()
    };
    let mark = if count > FEW { Mark::Dot } else { Mark::Disc };
    let style = Style { color: PALETTE[0], dash: Dash::Solid, width: 0.0, mark: Some(mark) };
    let drawn = evenly_spaced(count, MAX_DOTS).into_iter();
    let (dots_x, dots_y) = drawn.map(|place| points[place]).unzip();
    let mut out = vec![Series::new(&label, dots_x, dots_y, style)];
    if count > FEW {
        let (curves, words) = percentiles(points);
        out.extend(curves);
        note.push_str(words);
    }
    (out, note)
}

/// The median in bins over the abscissa, and the note about it. Points of one abscissa are in one bin. If each bin has
/// only one abscissa, the percentiles [`TAILS`] are drawn too.
fn percentiles(mut points: Vec<(f64, f64)>) -> (Vec<Series>, &'static str) {
    points.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let mut share_abscissae = true;
    let bins = BINS.min(points.len() / FEWEST);
    let mut x = Vec::new();
    let mut y = [Vec::new(), Vec::new(), Vec::new()];
    let end = |bin: usize| {
        let end = (bin + 1) * points.len() / bins;
        let last = points[end - 1].0;
        end + points[end..].partition_point(|(x, _)| x.total_cmp(&last).is_le())
    };
    let mut start = 0;
    for bin in 0..bins {
        let own = &points[start..end(bin).max(start)];
        if own.is_empty() {
            continue;
        }
        start += own.len();
        share_abscissae &= own[0].0.total_cmp(&own[own.len() - 1].0).is_eq();
        x.push(own[own.len() / 2].0);
        let mut values: Vec<f64> = own.iter().map(|(_, value)| *value).collect();
        values.sort_unstable_by(f64::total_cmp);
        for (column, share) in y.iter_mut().zip([0.5, TAILS[0], TAILS[1]]) {
            column.push(values[((values.len() - 1) as f64 * share + 0.5) as usize]);
        }
    }
    let line = |dash| Style { color: "#000000", dash, width: 1.4, mark: None };
    let styles = [line(Dash::Solid), line(Dash::Dashed), line(Dash::Dashed)];
    let (count, labels, words) = if share_abscissae {
        let labels = ["median", "5 % and 95 % of the points", ""];
        (3, labels, " Median and percentiles are those of all points of an abscissa.")
    } else {
        (
            1,
            ["median in bins", "", ""],
            " The median is that of all points, in bins over the abscissa.",
        )
    };
    let columns = labels.into_iter().zip(y).zip(styles).take(count);
    let curve = |((label, y), style)| Series::new(label, x.clone(), y, style);
    (columns.map(curve).collect(), words)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_points_are_thinned_and_the_median_uses_all_points() {
        let x: Vec<f64> = (0..20_000).map(|i| f64::from(i * 7919 % 20_000) / 20_000.0).collect();
        let y: Vec<f64> = (0..20_000).map(|i| f64::from(i * 104_729 % 1000) / 999.0).collect();
        let (series, note) = series(&x, &y);
        // No two points have the same abscissa, so there are no percentiles.
        assert_eq!((series.len(), series[0].x.len(), series[1].x.len()), (2, MAX_DOTS, BINS));
        assert!(note.contains("shows 4000 of 20000 points"), "{note}");
        assert!(!note.contains("percentiles") && series[1].label == "median in bins", "{note}");
        assert!(series[1].y.iter().all(|value| (value - 0.5).abs() < 0.05), "{:?}", series[1]);
    }

    #[test]
    fn points_that_share_abscissae_have_percentiles() {
        let x: Vec<f64> = (0..20_000).map(|i| f64::from(i % 8)).collect();
        let y: Vec<f64> = (0..20_000).map(|i| f64::from(i * 104_729 % 1000) / 999.0).collect();
        let (series, note) = series(&x, &y);
        assert_eq!((series.len(), &*series[2].label), (4, "5 % and 95 % of the points"));
        assert!(note.contains("percentiles are those of all points of an abscissa"), "{note}");
        for (column, share) in series[1..].iter().zip([0.5, 0.05, 0.95]) {
            assert!(column.y.iter().all(|value| (value - share).abs() < 0.05), "{column:?}");
        }
    }

    #[test]
    fn points_of_one_abscissa_are_in_one_bin() {
        // Four abscissae, like the levels of a Morris screening.
        let x: Vec<f64> = (0..1000).map(|i| f64::from(i % 4)).collect();
        let y: Vec<f64> = x.iter().map(|x| 10.0 * x).collect();
        let (series, _) = series(&x, &y);
        assert_eq!(series.len(), 4);
        for column in &series[1..] {
            assert_eq!(
                (&column.x[..], &column.y[..]),
                (&[0.0, 1.0, 2.0, 3.0][..], &[0.0, 10.0, 20.0, 30.0][..])
            );
        }
    }

    #[test]
    fn few_points_are_all_drawn_if_they_have_a_value() {
        let (series, note) = series(&[1.0, 2.0, 3.0], &[1.0, f64::NAN, 2.0]);
        assert_eq!((series.len(), &series[0].x), (1, &vec![1.0, 3.0]));
        assert_eq!(note, "");
    }
}
