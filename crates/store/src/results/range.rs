//! Reads ranges of numbers, quantities and times.

use fretwork_engine::input::quantity::{self, Dimension};
use fretwork_job::clock;

/// A closed interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    pub(super) low: f64,
    pub(super) high: f64,
}

/// Relative width by which bounds are extended. Computed numbers can differ in their last digits, and a user
/// who copies a displayed number must find it.
const SLACK: f64 = 1e-9;

impl Range {
    /// Reads `a..b`, `a..`, `..b` or a single value. `value` reads one bound. A bound is itself an interval, for
    /// example a whole day.
    pub(super) fn read(
        text: &str,
        value: impl Fn(&str) -> Result<Self, String>,
    ) -> Result<Self, String> {
        let (low, high) = text.split_once("..").unwrap_or((text, text));
        let (low, high) = (low.trim(), high.trim());
        if low.is_empty() && high.is_empty() {
            return Err("must be a value, or a range such as 1..2, 1.. or ..2".to_owned());
        }
        let open = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };
        let bound = |text: &str| if text.is_empty() { Ok(open) } else { value(text) };
        let Self { low, .. } = bound(low)?;
        let Self { high, .. } = bound(high)?;
        if low > high {
            return Err(format!(
                "must be a range whose first bound is the smaller one, got {text:?}"
            ));
        }
        Ok(Self { low, high })
    }

    /// Reads a range of a quantity. The bounds may have units.
    pub(super) fn quantity(text: &str, dimension: Dimension) -> Result<Self, String> {
        let text = &*written(text, dimension);
        let is_plain = |text: &str| text.trim().parse::<f64>().is_ok_and(|number| number != 0.0);
        let has_unit = |text: &str| !text.trim().is_empty() && text.trim().parse::<f64>().is_err();
        if let Some((low, high)) = text.split_once("..")
            && ((is_plain(low) && has_unit(high)) || (has_unit(low) && is_plain(high)))
        {
            // `0.1..0.2 kN` would be 0.1 N to 200 N, which is probably a mistake.
            return Err(format!("must have a unit at both bounds or at neither, got {text:?}"));
        }
        Self::read(text, |text| {
            let value = quantity::parse(text, dimension)?;
            let slack = SLACK * value.abs();
            Ok(Self { low: value - slack, high: value + slack })
        })
    }
}

/// The range `a..b` that is meant by a text such as `0.6-0.8`, `0,6..0,8` or `>0.6`.
fn written(text: &str, dimension: Dimension) -> String {
    let text = with_points(text.trim());
    for (signs, below) in [(["<=", "≤", "<"], true), ([">=", "≥", ">"], false)] {
        if let Some(bound) = signs.iter().find_map(|sign| text.strip_prefix(sign)) {
            return if below { format!("..{bound}") } else { format!("{bound}..") };
        }
    }
    dashed(&text, dimension).unwrap_or(text)
}

/// Replaces decimal commas. A comma before three digits stays, and gives an error: it can separate thousands.
fn with_points(text: &str) -> String {
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let decimal = |(at, _): &(usize, &str)| {
        let before = text[..*at].bytes().next_back().is_some_and(|byte| byte.is_ascii_digit());
        let is_zero = text[..*at].rsplit(|c: char| !c.is_ascii_digit()).next() == Some("0");
        let after = digits(&text[at + 1..]);
        before && after > 0 && (after != 3 || is_zero)
    };
    let mut text_with_points = text.to_owned();
    for (at, _) in text.match_indices(',').filter(decimal) {
        text_with_points.replace_range(at..=at, ".");
    }
    text_with_points
}

/// The range that is meant by `0.6-0.8`. A dash between two values is no sign.
fn dashed(text: &str, dimension: Dimension) -> Option<String> {
    let is_dash = |&(at, letter): &(usize, char)| {
        matches!(letter, '-' | '–' | '—') && !text[..at].ends_with(['e', 'E', '.'])
    };
    let (at, dash) = text.char_indices().skip(1).find(is_dash)?;
    let (low, high) = (text[..at].trim(), text[at + dash.len_utf8()..].trim());
    let are_values = [low, high].iter().all(|bound| quantity::parse(bound, dimension).is_ok());
    are_values.then(|| format!("{low}..{high}"))
}

/// Reads an RFC 3339 time or a day (UTC), in milliseconds since 1970. A day is read as the interval from its first to
/// its last millisecond.
pub(super) fn moment(text: &str) -> Result<Range, String> {
    let is_day = !text.contains(['T', 't', ' ']);
    let whole = if is_day { format!("{text}T00:00:00Z") } else { text.to_owned() };
    let low = clock::parse(&whole).ok_or_else(|| {
        format!("must be a time such as 2026-01-31 or 2026-01-31T12:00:00Z, got {text:?}")
    })? as f64;
    Ok(Range { low, high: if is_day { low + 86_399_999.0 } else { low } })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_parsed_with_and_without_units() {
        let range = |text| Range::quantity(text, Dimension::Force);
        let near = |text, low: f64, high: f64| {
            let Range { low: from, high: to } = range(text).unwrap();
            let close = |a: f64, b: f64| a.total_cmp(&b).is_eq() || (a / b - 1.0).abs() < 2e-9;
            assert!(close(from, low) && close(to, high), "{text}: {from} {to}");
            assert!(from <= low && to >= high, "{text}");
        };
        near("50 N..0.2 kN", 50.0, 200.0);
        near("50..200", 50.0, 200.0);
        near("50..", 50.0, f64::INFINITY);
        near(" .. 2 N", f64::NEG_INFINITY, 2.0);
        near("100", 100.0, 100.0);
        near("0..1 kN", 0.0, 1000.0);
        for bad in
            ["", "..", "2..1", "50..200 N", "0.1 kN..2", "a..b", "1 m", "1..2..3", "1e308 kN.."]
        {
            assert!(range(bad).is_err(), "{bad}");
        }
        near("50-200", 50.0, 200.0);
        near("50 N – 0.2 kN", 50.0, 200.0);
        near("1e-3-2", 1e-3, 2.0);
        near("0,6..0,8 ", 0.6, 0.8);
        near("0,125", 0.125, 0.125);
        near("> 50 N", 50.0, f64::INFINITY);
        near("<=0,2 kN", f64::NEG_INFINITY, 200.0);
        for bad in ["1,000", ">", "<1..2", ">50-200", "1,", ",5", "50-200 N"] {
            assert!(range(bad).is_err(), "{bad}");
        }
        near("-2..-1e-3", -2.0, -1e-3);
    }

    #[test]
    fn times_are_parsed_as_dates_or_timestamps() {
        let range = |text| Range::read(text, moment);
        let day = 86_400_000.0;
        assert_eq!(range("1970-01-02"), Ok(Range { low: day, high: 2.0 * day - 1.0 }));
        assert_eq!(range("1970-01-01..1970-01-03"), Ok(Range { low: 0.0, high: 3.0 * day - 1.0 }));
        assert_eq!(
            range("1970-01-01T00:00:01Z..1970-01-01T00:00:02.5Z"),
            Ok(Range { low: 1000.0, high: 2500.0 })
        );
        assert!(range("yesterday").is_err());
        assert!(range("1969-12-31").is_err());
        assert!(range("1970-01-03..1970-01-02").is_err());
    }
}
