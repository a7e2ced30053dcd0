//! What the axes of all figures have in common: their spacing, their size, and the metadata.

use crate::view::FigureOptions;
use crate::{Head, Missing, Result, evenly_spaced, refuse_if_any, typeset};
use fretwork_plot::{About, Axis, Figure, Series};

/// An axis of drawn values or of cycles is logarithmic if the ratio of its ends is at least this.
pub const LOG_RATIO: f64 = 20.0;
/// A vertical axis is logarithmic if its values are positive and the ratio of its ends is at least this.
const LOG_HEIGHT: f64 = 100.0;
/// Values count as spaced logarithmically if the ratio of the largest to the smallest step is larger by this factor on
/// a linear axis than on a logarithmic one.
const UNEVEN: f64 = 1.5;

/// Gives a figure the size and the axes that the client requests. Refuses a logarithmic axis without positive values.
pub fn choose(figure: &mut Figure, options: &FigureOptions) -> Result<()> {
    figure.x.log = options.log_x.unwrap_or(figure.x.log);
    figure.y.log = options.log_y.unwrap_or(figure.y.log);
    figure.size = size(options);
    let field = figure.field.as_ref();
    let positive = |values: fn(&Series) -> &Vec<f64>, places: Option<&Vec<f64>>| {
        let drawn = figure.series.iter().flat_map(values).chain(places.into_iter().flatten());
        drawn.into_iter().any(|value| value.is_finite() && *value > 0.0)
    };
    let x = figure.x.log && !positive(|series| &series.x, field.map(|field| &field.x));
    let y = figure.y.log && !positive(|series| &series.y, field.map(|field| &field.y));
    refuse_logarithms([("x", x), ("y", y)], "no value is positive")
}

/// Refuses the logarithmic axes that are impossible, for a reason.
pub fn refuse_logarithms(axes: [(&'static str, bool); 2], reason: &str) -> Result<()> {
    let impossible = axes.into_iter().filter(|(_, is_impossible)| *is_impossible);
    let missing = |(parameter, _)| {
        let detail = format!("must be \"linear\" for this figure, because {reason}");
        Missing { parameter, detail }
    };
    refuse_if_any(impossible.map(missing).collect())
}

/// An axis with a label and a unit.
pub fn in_unit(label: &str, unit: Option<&str>) -> Axis {
    Axis::labelled(&match unit {
        Some(unit) => format!("{label} ({})", typeset(unit)),
        None => label.to_owned(),
    })
}

/// A sentence with the names of all curves of a figure; empty if none has a name.
pub fn curves_in_words(figure: &Figure, separator: &str) -> String {
    let names = figure.series.iter().map(|series| series.label.as_str());
    let names: Vec<&str> = names.filter(|name| !name.is_empty()).collect();
    if names.is_empty() { String::new() } else { format!(" Curves: {}.", names.join(separator)) }
}

/// Width and height in px.
pub fn size(options: &FigureOptions) -> (f64, f64) {
    (f64::from(options.size.0), f64::from(options.size.1))
}

/// The metadata of a figure.
pub fn about(head: &Head, description: String) -> About {
    About { description, identifier: head.key.clone(), creator: head.engine.to_string() }
}

/// The finite values, ascending, each once.
pub fn distinct(values: &[f64]) -> Vec<f64> {
    let mut values: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    values
}

/// Whether ascending values are spaced like a geometric sequence. Five of them are compared.
pub fn is_log_spaced(ascending: &[f64]) -> bool {
    let places = evenly_spaced(ascending.len(), 5);
    let some: Vec<f64> = places.into_iter().map(|place| ascending[place]).collect();
    if some.len() < 3 || some[0] <= 0.0 {
        return false;
    }
    let unevenness = |values: &[f64]| {
        let steps = || values.windows(2).map(|pair| pair[1] - pair[0]);
        steps().fold(0.0, f64::max) / steps().fold(f64::INFINITY, f64::min)
    };
    let logs: Vec<f64> = some.iter().map(|value| libm::log(*value)).collect();
    unevenness(&some) > UNEVEN * unevenness(&logs)
}

/// Whether values of an output are positive and span so many decades that they need a logarithmic scale.
pub fn spans_decades(values: impl Iterator<Item = f64>) -> bool {
    let values = values.filter(|value| value.is_finite());
    let (low, high) = values
        .fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(value), high.max(value)));
    low > 0.0 && low.is_finite() && high >= LOG_HEIGHT * low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geometric_sequences_are_log_spaced_and_arithmetic_ones_are_not() {
        let geometric: Vec<f64> = (0..16).map(|i| libm::exp2(f64::from(i) / 8.0)).collect();
        let arithmetic: Vec<f64> = (1..17).map(f64::from).collect();
        assert!(is_log_spaced(&geometric) && is_log_spaced(&[1.0, 2.0, 5.0, 10.0]));
        assert!(!is_log_spaced(&arithmetic) && !is_log_spaced(&[0.5, 0.6, 0.7, 0.8]));
        assert!(!is_log_spaced(&[]) && !is_log_spaced(&[1.0, 10.0]));
        assert!(!is_log_spaced(&[0.0, 1.0, 10.0, 100.0]));
    }

    #[test]
    fn only_positive_values_can_span_decades() {
        let spans = |values: &[f64]| spans_decades(values.iter().copied());
        assert!(spans(&[1e-9, f64::NAN, 1e-6]));
        assert!(
            !spans(&[0.0, 1.0]) && !spans(&[-1.0, 500.0]) && !spans(&[]) && !spans(&[1.0, 2.0])
        );
        assert_eq!(distinct(&[3.0, f64::NAN, 1.0, 3.0]), [1.0, 3.0]);
    }
}
