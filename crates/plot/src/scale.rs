//! Scales: the range of an axis, and its ticks.

use super::canvas::{Anchor, Area, Canvas};
use super::series::{GRID, TICK};
use super::text::{GAP, SMALL, power_of_ten, width};

/// Decimal exponents of numbers that tick labels show without a power of ten.
const PLAIN: std::ops::RangeInclusive<i32> = -3..=4;

/// Values with a smaller relative difference than this are drawn as one value.
const SAME: f64 = 1e-6;
/// A logarithmic axis over fewer decades than this has ticks at equal steps, like a linear axis.
const MIN_DECADES: f64 = 0.6;

/// Width and height in px that a tick with its label needs.
pub const TICK_ROOM: (f64, f64) = (58.0, 42.0);

/// An axis.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Axis {
    /// The quantity and the unit of the axis.
    pub label: String,
    /// Whether the axis is logarithmic.
    pub log: bool,
    /// The ends of the axis. By default they are the ends of the data.
    pub range: Option<(f64, f64)>,
    /// Named values, marked by dashed lines across the figure.
    pub marks: Vec<(f64, String)>,
}

impl Axis {
    /// A linear axis with the range of the data.
    pub fn labelled(label: &str) -> Self {
        Self { label: label.to_owned(), ..Self::default() }
    }

    /// The names of the visible marks and their distances from the lower end.
    pub(super) fn names(&self, scale: &Scale, length: f64) -> Vec<(f64, &str)> {
        let shares = self.marks.iter().filter_map(|(value, name)| {
            let share = scale.share(*value).filter(|share| (0.0..=1.0).contains(share))?;
            Some((share * length, name.as_str()))
        });
        let mut names: Vec<(f64, &str)> = shares.collect();
        names.sort_by(|a, b| a.0.total_cmp(&b.0));
        names
    }
}

/// A tick of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// The position of the tick on its axis: 0 at the lower and 1 at the upper end.
    pub share: f64,
    /// The label of the tick; a minor tick has none.
    pub label: Option<String>,
}

impl Tick {
    /// The length of the tick, in px.
    pub fn length(&self) -> f64 {
        if self.label.is_some() { 4.0 } else { 2.0 }
    }
}

/// The map from values to positions on an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    /// The ends; on a logarithmic axis their base-10 logarithms.
    low: f64,
    high: f64,
    log: bool,
    /// Ticks in ascending order.
    pub ticks: Vec<Tick>,
    /// The power of ten by which the labels are multiplied.
    pub power: i32,
}

impl Scale {
    /// The scale of an axis for values, with about `count` labels.
    pub fn new(axis: &Axis, values: impl Iterator<Item = f64>, count: f64) -> Self {
        let log = axis.log;
        let place = |value: f64| if log { libm::log10(value) } else { value };
        let (low, high) = match axis.range {
            Some((low, high)) => (place(low), place(high)),
            None => padded(values.map(place).filter(|value| value.is_finite()), log),
        };
        let sane = low.is_finite() && high.is_finite() && low < high;
        let (low, high) = if sane { (low, high) } else { (0.0, 1.0) };
        let mut scale = Self { low, high, log, ticks: Vec::new(), power: 0 };
        if !log {
            scale.mark_steps(count);
        } else if high - low < MIN_DECADES {
            scale.mark_part_of_decade(count);
        } else {
            scale.mark_decades(count);
        }
        scale
    }

    /// The position of a value: 0 at the lower and 1 at the upper end. `None` if the value has no position, for example
    /// a negative value on a logarithmic axis.
    pub fn share(&self, value: f64) -> Option<f64> {
        let place = if self.log { libm::log10(value) } else { value };
        let share = (place - self.low) / (self.high - self.low);
        // Renderers fail with very large coordinates.
        share.is_finite().then(|| share.clamp(-9.0, 10.0))
    }

    /// Whether the value at a tick of a logarithmic scale is 1, 2 or 5 times a power of ten.
    pub fn is_round(&self, share: f64) -> bool {
        let place = self.low + share * (self.high - self.low);
        let digit = libm::exp10(place - libm::floor(place + 1e-9));
        self.log && [1.0, 2.0, 5.0].iter().any(|round| (digit - round).abs() < 1e-6)
    }

    /// The factor by which the labels are multiplied, as text; empty if it is 1.
    pub fn factor(&self) -> String {
        if self.power == 0 { String::new() } else { format!("×{}", power_of_ten(self.power)) }
    }

    /// Width of the widest label, in px.
    pub fn widest_label(&self) -> f64 {
        let labels = self.ticks.iter().filter_map(|tick| tick.label.as_deref());
        labels.map(width).fold(0.0, f64::max) * SMALL
    }

    /// Draws the ticks below an area, and the lines across it.
    pub fn draw_below(&self, canvas: &mut Canvas, area: &Area) {
        for tick in &self.ticks {
            let foot = area.at(tick.share, 0.0);
            canvas.line(foot, (foot.0, foot.1 + tick.length()), &TICK);
            if let Some(label) = &tick.label {
                canvas.line(foot, area.at(tick.share, 1.0), &GRID);
                canvas.text((foot.0, foot.1 + SMALL + GAP), Anchor::Middle, SMALL, label);
            }
        }
    }

    fn mark_steps(&mut self, count: f64) {
        let (low, high) = (self.low, self.high);
        let rough = (high - low) / count.max(1.0);
        let decade = libm::exp10(libm::floor(libm::log10(rough)));
        let steps = [0.5, 1.0, 2.0, 5.0, 10.0].map(|nice| nice * decade);
        let wide = (1..4).find(|i| steps[*i] >= rough * (1.0 - 1e-9)).unwrap_or(4);
        let slack = 1e-9 * (high - low);
        let ends = |step: f64| {
            (libm::ceil((low - slack) / step) as i64, libm::floor((high + slack) / step) as i64)
        };
        // A scale needs at least two ticks: with a single tick the reader does not know the step.
        let alone = ends(steps[wide]).0 >= ends(steps[wide]).1;
        let step = steps[if alone { wide - 1 } else { wide }];
        let most = libm::floor(libm::log10(low.abs().max(high.abs())) + 1e-9) as i32;
        if !PLAIN.contains(&most) {
            self.power = 3 * most.div_euclid(3);
        }
        let unit = libm::exp10(f64::from(self.power));
        let decimals = -libm::floor(libm::log10(step / unit) + 1e-9);
        let (first, last) = ends(step);
        self.ticks = (first..=last)
            .map(|k| Tick {
                share: (k as f64 * step - low) / (high - low),
                label: Some(number(k as f64 * step / unit, decimals.max(0.0) as usize)),
            })
            .collect();
    }

    /// Ticks at equal steps on a short logarithmic axis.
    fn mark_part_of_decade(&mut self, count: f64) {
        let (low, high) = (libm::exp10(self.low), libm::exp10(self.high));
        let mut even = Self { low, high, log: false, ticks: Vec::new(), power: 0 };
        even.mark_steps(count);
        let place = |share: f64| libm::log10(low + share * (high - low));
        for Tick { share, label } in even.ticks {
            let share = (place(share) - self.low) / (self.high - self.low);
            self.ticks.push(Tick { share, label });
        }
        self.power = even.power;
    }

    fn mark_decades(&mut self, count: f64) {
        let (low, high) = (self.low - 1e-9, self.high + 1e-9);
        let (first, last) = (libm::floor(low) as i32, libm::floor(high) as i32);
        let decades = high - low;
        let labelled = labelled(decades, count);
        let plain = PLAIN.contains(&first) && PLAIN.contains(&last);
        let every = libm::ceil(decades / count.max(1.0)).max(1.0) as i32;
        for exponent in first..=last {
            for digit in 1..=9 {
                let place = f64::from(exponent) + libm::log10(f64::from(digit));
                let named = labelled.contains(&digit) && exponent.rem_euclid(every) == 0;
                if !(low..=high).contains(&place) || (!named && digit > 1 && decades > 8.0) {
                    continue;
                }
                let label = named.then(|| {
                    if plain {
                        number(
                            f64::from(digit) * libm::exp10(f64::from(exponent)),
                            (-exponent).max(0) as usize,
                        )
                    } else if digit == 1 {
                        power_of_ten(exponent)
                    } else {
                        format!("{digit}×{}", power_of_ten(exponent))
                    }
                });
                let share = (place - self.low) / (self.high - self.low);
                self.ticks.push(Tick { share, label });
            }
        }
    }
}

/// The digits that are labelled in each decade. There are as many as fit without overlap, if the axis has space for
/// about `count` labels.
fn labelled(decades: f64, count: f64) -> &'static [i32] {
    let sets: [(f64, &[i32]); 3] =
        [(1.2, &[1, 2, 3, 4, 5, 6, 7, 8, 9]), (1.2, &[1, 2, 3, 5, 7]), (2.2, &[1, 2, 5])];
    let fits = |(most, digits): &(f64, &[i32])| {
        let apart = |pair: &[i32]| libm::log10(f64::from(pair[1]) / f64::from(pair[0]));
        let nearest = digits.windows(2).map(apart).fold(1.0, f64::min);
        decades < *most && nearest * count >= 0.7 * decades
    };
    sets.into_iter().find(fits).map_or(&[1], |(_, digits)| digits)
}

/// The range of values with a margin, except at 0.
fn padded(values: impl Iterator<Item = f64>, log: bool) -> (f64, f64) {
    let whole = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.fold(whole, |(low, high), x| (low.min(x), high.max(x)));
    let size = low.abs().max(high.abs());
    // Differences due to rounding must not fill the axis.
    let least = SAME * if log { 1.0 } else { size };
    let room = if high - low > least {
        0.04 * (high - low)
    } else {
        if log { 0.3_f64 } else { 1e-12_f64 }.max(0.1 * size)
    };
    let keep = |end: f64| !log && end == 0.0;
    (if keep(low) { low } else { low - room }, if keep(high) { high } else { high + room })
}

/// A number with a typographic minus sign, and without negative zero.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.')) {
        return text.replace('-', "");
    }
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(log: bool, range: (f64, f64)) -> String {
        let axis = Axis { log, range: Some(range), ..Axis::default() };
        let scale = Scale::new(&axis, std::iter::empty(), 5.0);
        let labels: Vec<String> = scale.ticks.into_iter().filter_map(|tick| tick.label).collect();
        format!("{} ({})", labels.join(" "), scale.power)
    }

    #[test]
    fn ticks_are_round_numbers() {
        assert_eq!(labels(false, (0.0, 1.5)), "0.0 0.5 1.0 1.5 (0)");
        assert_eq!(labels(false, (-1.0, 1.0)), "−1.0 −0.5 0.0 0.5 1.0 (0)");
        assert_eq!(labels(false, (0.0, 1.0)), "0.0 0.2 0.4 0.6 0.8 1.0 (0)");
        assert_eq!(labels(false, (-49.0, 49.0)), "−40 −20 0 20 40 (0)");
        assert_eq!(labels(false, (0.0, 3.2e-6)), "0 1 2 3 (-6)");
        assert_eq!(labels(false, (0.0, 44_000.0)), "0 10000 20000 30000 40000 (0)");
        assert_eq!(labels(true, (0.1, 1000.0)), "0.1 1.0 10 100 1000 (0)".replace("1.0", "1"));
        assert_eq!(labels(true, (1e-6, 1e-2)), "10⁻⁶ 10⁻⁵ 10⁻⁴ 10⁻³ 10⁻² (0)");
        assert_eq!(labels(true, (1.0, 50.0)), "1 2 5 10 20 50 (0)");
        assert_eq!(labels(true, (2e5, 9e5)).split(' ').next(), Some("2×10⁵"));
        assert_eq!(labels(true, (2.0, 20.0)), "2 3 5 7 10 20 (0)");
        assert_eq!(labels(true, (2.1e-7, 2.9e-7)), "220 240 260 280 (-9)");
    }

    #[test]
    fn a_constant_with_rounding_errors_is_drawn_as_a_horizontal_line() {
        let values = [50.0, 50.000_000_000_000_04, 49.999_999_999];
        for log in [false, true] {
            let axis = Axis { log, ..Axis::default() };
            let scale = Scale::new(&axis, values.iter().copied(), 6.0);
            let middle = |value| scale.share(value).is_some_and(|share| (share - 0.5).abs() < 1e-6);
            assert!(values.into_iter().all(middle), "{scale:?}");
            assert!(scale.ticks.iter().filter(|tick| tick.label.is_some()).count() > 1);
        }
    }

    #[test]
    fn a_scale_never_has_zero_length() {
        for values in [vec![], vec![0.0], vec![3.0, 3.0], vec![f64::NAN, -1.0], vec![0.0, 1e300]] {
            for log in [false, true] {
                let axis = Axis { log, ..Axis::default() };
                let scale = Scale::new(&axis, values.iter().copied(), 5.0);
                assert!(scale.low < scale.high, "{values:?}");
                for value in &values {
                    let share = scale.share(*value);
                    assert!(share.is_none_or(|share| (0.0..=1.0).contains(&share)), "{values:?}");
                }
                assert!(scale.ticks.iter().all(|tick| (-0.01..=1.01).contains(&tick.share)));
                assert!(scale.ticks.len() < 100 || log);
            }
        }
    }
}
