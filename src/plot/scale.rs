//! Scales: the range of an axis, and where its ticks stand.

use super::Axis;

/// Most digits before the point, and most zeros after it, that a tick shows.
const PLAIN: std::ops::RangeInclusive<i32> = -3..=4;

/// A mark on an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Tick {
    /// Its place, 0 at the lower and 1 at the upper end.
    pub share: f64,
    /// Its number; a minor tick has none.
    pub label: Option<String>,
}

/// The map from values to shares of an axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Scale {
    /// The ends; their decadic logarithms on a logarithmic axis.
    low: f64,
    high: f64,
    log: bool,
    /// Ticks in ascending order.
    pub ticks: Vec<Tick>,
    /// The power of ten that the labels are multiplied by.
    pub power: i32,
}

impl Scale {
    /// The scale of an axis over values, with about `count` labels.
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
        if log {
            scale.mark_decades(count);
        } else {
            scale.mark_steps(count);
        }
        scale
    }

    /// Where a value stands, 0 at the lower and 1 at the upper end; `None` if nowhere.
    pub fn share(&self, value: f64) -> Option<f64> {
        let place = if self.log { libm::log10(value) } else { value };
        let share = (place - self.low) / (self.high - self.low);
        // Far outside is outside; renderers stumble over larger numbers.
        share.is_finite().then(|| share.clamp(-9.0, 10.0))
    }

    /// What the labels are multiplied by, if by anything.
    pub fn factor(&self) -> String {
        if self.power == 0 { String::new() } else { format!("×{}", power_of_ten(self.power)) }
    }

    fn mark_steps(&mut self, count: f64) {
        let (low, high) = (self.low, self.high);
        let rough = (high - low) / count.max(1.0);
        let decade = libm::exp10(libm::floor(libm::log10(rough)));
        let step = [1.0, 2.0, 5.0, 10.0].map(|nice| nice * decade);
        let step = step.into_iter().find(|step| *step >= rough * (1.0 - 1e-9)).unwrap_or(rough);
        let most = libm::floor(libm::log10(low.abs().max(high.abs())) + 1e-9) as i32;
        if !PLAIN.contains(&most) {
            self.power = 3 * most.div_euclid(3);
        }
        let unit = libm::exp10(f64::from(self.power));
        let decimals = -libm::floor(libm::log10(step / unit) + 1e-9);
        let slack = 1e-9 * (high - low);
        let first = libm::ceil((low - slack) / step) as i64;
        let last = libm::floor((high + slack) / step) as i64;
        self.ticks = (first..=last)
            .map(|k| Tick {
                share: (k as f64 * step - low) / (high - low),
                label: Some(number(k as f64 * step / unit, decimals.max(0.0) as usize)),
            })
            .collect();
    }

    fn mark_decades(&mut self, count: f64) {
        let (low, high) = (self.low - 1e-9, self.high + 1e-9);
        let (first, last) = (libm::floor(low) as i32, libm::floor(high) as i32);
        let decades = high - low;
        let labelled: &[i32] = match decades {
            ..1.2 => &[1, 2, 3, 4, 5, 6, 7, 8, 9],
            ..2.2 => &[1, 2, 5],
            _ => &[1],
        };
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

/// The range of some values with a little room around them; 0 stays an end.
fn padded(values: impl Iterator<Item = f64>, log: bool) -> (f64, f64) {
    let whole = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.fold(whole, |(low, high), x| (low.min(x), high.max(x)));
    let room = 0.04 * (high - low);
    let room =
        if room > 0.0 { room } else { (0.1 * high.abs()).max(if log { 0.3 } else { 1e-12 }) };
    let keep = |end: f64| !log && end == 0.0;
    (if keep(low) { low } else { low - room }, if keep(high) { high } else { high + room })
}

/// A number with a proper minus sign.
fn number(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    if text.bytes().all(|byte| matches!(byte, b'-' | b'0' | b'.')) {
        return text.replace('-', "");
    }
    text.replace('-', "−")
}

/// 10 with a raised exponent.
fn power_of_ten(exponent: i32) -> String {
    let raised = |c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        _ => '⁰',
    };
    format!("10{}", exponent.to_string().chars().map(raised).collect::<String>())
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
        assert_eq!(labels(false, (0.0, 3.2e-6)), "0 1 2 3 (-6)");
        assert_eq!(labels(false, (0.0, 44_000.0)), "0 10000 20000 30000 40000 (0)");
        assert_eq!(labels(true, (0.1, 1000.0)), "0.1 1.0 10 100 1000 (0)".replace("1.0", "1"));
        assert_eq!(labels(true, (1e-6, 1e-2)), "10⁻⁶ 10⁻⁵ 10⁻⁴ 10⁻³ 10⁻² (0)");
        assert_eq!(labels(true, (1.0, 50.0)), "1 2 5 10 20 50 (0)");
        assert_eq!(labels(true, (2e5, 9e5)).split(' ').next(), Some("2×10⁵"));
    }

    #[test]
    fn whatever_the_values_the_ends_are_apart() {
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
