//! Heat maps: a coloured cell around each point of a grid, contour lines, and the colour bar.

use super::canvas::{Anchor, Area, Canvas, Point};
use super::color::{hex, ink_on, shade};
use super::contours::contours;
use super::scale::{Axis, Scale, TICK_ROOM, Tick};
use super::series::{Dash, Style};
use super::text::{GAP, LABEL, LEADING, SINK, SMALL, width};

/// Number of different colours in a heat map.
const COLORS: usize = 64;
/// Width of the colour bar, in px.
const BAR: f64 = 14.0;
/// Largest relative difference of two numbers that differ only because they are rounded to 12 digits.
const ROUNDING: f64 = 1e-9;
/// Minimum number of contour lines, if the scale of the values has enough ticks.
const FEWEST_LINES: usize = 3;

/// Values at the points of a rectangular grid, drawn as colours.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// Abscissae of the columns, ascending.
    pub x: Vec<f64>,
    /// Ordinates of the rows, ascending.
    pub y: Vec<f64>,
    /// `values[j][i]` at (`x[i]`, `y[j]`). A value is a gap if it is not finite, or not positive on a logarithmic scale.
    pub values: Vec<Vec<f64>>,
    /// The scale of the colours.
    pub scale: Axis,
}

impl Field {
    /// The axis of the cells. If it has no range, it ends at the outer edges of the cells.
    pub(super) fn ends(axis: &Axis, places: &[f64]) -> Axis {
        let place = |value: &f64| if axis.log { libm::log10(*value) } else { *value };
        let value = |place: f64| if axis.log { libm::exp10(place) } else { place };
        let edges = edges(&places.iter().map(place).collect::<Vec<f64>>());
        let own = edges.first().zip(edges.last()).map(|(low, high)| (value(*low), value(*high)));
        Axis { range: axis.range.or(own), ..axis.clone() }
    }

    /// The scale of the colours on a bar of this height.
    pub(super) fn shades(&self, height: f64) -> Scale {
        let values = || self.values.iter().flatten().copied();
        let usable = |value: &f64| value.is_finite() && (*value > 0.0 || !self.scale.log);
        let low = values().filter(usable).fold(f64::INFINITY, f64::min);
        let high = values().filter(usable).fold(f64::NEG_INFINITY, f64::max);
        // The colours need no margin. If the values differ only by rounding, a margin keeps the colours from showing
        // these differences.
        let is_wide = high - low > ROUNDING * low.abs().max(high.abs());
        let margin = if is_wide { 0.0 } else { 0.1 * low.abs() };
        let tight = (low - margin, high + margin);
        let tight = (tight.0 < tight.1).then_some(tight);
        let axis = Axis { range: self.scale.range.or(tight), ..self.scale.clone() };
        Scale::new(&axis, values(), height / TICK_ROOM.1)
    }

    /// The width of a colour bar with its labels, in px.
    pub(super) fn room(scale: &Scale) -> f64 {
        3.0 * GAP + BAR + scale.widest_label() + LABEL * LEADING + GAP
    }

    /// Draws the cells and the contour lines. `across` and `up` are the axes of the area.
    pub(super) fn draw(
        &self,
        canvas: &mut Canvas,
        area: &Area,
        (across, up): (&Scale, &Scale),
        scale: &Scale,
    ) {
        let px = |share: Option<f64>, of: &dyn Fn(f64) -> f64| share.map_or(f64::NAN, of);
        let x: Vec<f64> =
            self.x.iter().map(|x| px(across.share(*x), &|share| area.at(share, 0.0).0)).collect();
        let y: Vec<f64> =
            self.y.iter().map(|y| px(up.share(*y), &|share| area.at(0.0, share).1)).collect();
        let shares: Vec<Vec<f64>> = self
            .values
            .iter()
            .map(|row| row.iter().map(|value| px(scale.share(*value), &|share| share)).collect())
            .collect();
        for (color, cells) in cells(&edges(&x), &edges(&y), &shares).into_iter().enumerate() {
            canvas.cells(&hex(shade((color as f64 + 0.5) / COLORS as f64)), &cells);
        }
        for level in levels(scale) {
            let style = contour(level);
            for line in contours(&x, &y, &shares, level) {
                canvas.curve(&line, &style, 0.0);
            }
        }
    }

    /// Draws the colour bar beside the area.
    pub(super) fn draw_bar(&self, canvas: &mut Canvas, area: &Area, scale: &Scale) {
        let bar = Area { left: area.right() + 2.0 * GAP, width: BAR, ..*area };
        for color in 0..COLORS {
            let [low, high] = [color, color + 1].map(|i| i as f64 / COLORS as f64);
            let cell = [bar.at(0.0, low), bar.at(1.0, high)];
            canvas.cells(&hex(shade(0.5 * (low + high))), &[cell]);
        }
        for level in levels(scale) {
            canvas.line(bar.at(0.0, level), bar.at(1.0, level), &contour(level));
        }
        canvas.rectangle(&bar, false);
        for tick in &scale.ticks {
            if let Some(label) = &tick.label {
                let (x, y) = bar.at(1.0, tick.share);
                canvas.text((x + GAP, y + SINK), Anchor::Start, SMALL, label);
            }
        }
        canvas.text((bar.left, area.top - 0.5 * GAP), Anchor::Start, SMALL, &scale.factor());
        let end = bar.right() + GAP + scale.widest_label() + LABEL + 0.5 * GAP;
        let size = LABEL.min((area.height + 3.0 * LABEL) / width(&self.scale.label));
        canvas.upward_text((end, area.at(0.0, 0.5).1), size, &self.scale.label);
    }
}

/// The positions of the contour lines on the scale (0 to 1). The lines are at the labels of the colour bar, which are
/// round numbers. If a logarithmic bar has few labels, there are also lines at its ticks at 2 and 5.
fn levels(scale: &Scale) -> Vec<f64> {
    let inside = || scale.ticks.iter().filter(|tick| (1e-6..1.0 - 1e-6).contains(&tick.share));
    let are_few = inside().filter(|tick| tick.label.is_some()).count() < FEWEST_LINES;
    let has_line = |tick: &&Tick| tick.label.is_some() || are_few && scale.is_round(tick.share);
    inside().filter(has_line).map(|tick| tick.share).collect()
}

fn contour(share: f64) -> Style {
    Style { color: ink_on(share), dash: Dash::Solid, width: 0.8, mark: None }
}

/// The edges between the cells: the middle between two points, and as far from the first and last point on their outer
/// sides.
fn edges(places: &[f64]) -> Vec<f64> {
    let [first, .., last] = places else {
        return places.iter().flat_map(|place| [place - 0.5, place + 0.5]).collect();
    };
    let between: Vec<f64> = places.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    let below = 2.0 * first - between[0];
    let above = 2.0 * last - between[between.len() - 1];
    [below].into_iter().chain(between).chain([above]).collect()
}

/// The rectangles of each colour. Neighbours in a row that have the same colour are one rectangle.
fn cells(x: &[f64], y: &[f64], shares: &[Vec<f64>]) -> Vec<Vec<[Point; 2]>> {
    let color = |share: &f64| {
        share.is_finite().then(|| ((share * COLORS as f64).max(0.0) as usize).min(COLORS - 1))
    };
    let mut out = vec![Vec::new(); COLORS];
    for (j, row) in shares.iter().enumerate() {
        let colors: Vec<Option<usize>> = row.iter().map(color).collect();
        let mut i = 0;
        for run in colors.chunk_by(|a, b| a == b) {
            if let Some(color) = run[0] {
                out[color].push([(x[i], y[j]), (x[i + run.len()], y[j + 1])]);
            }
            i += run.len();
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_meet_in_the_middle_between_their_points() {
        assert_eq!(edges(&[0.0, 2.0, 3.0]), [-1.0, 1.0, 2.5, 3.5]);
        assert_eq!(edges(&[4.0]), [3.5, 4.5]);
        assert!(edges(&[]).is_empty());
        let log = Axis { log: true, ..Axis::default() };
        let (low, high) = Field::ends(&log, &[1.0, 100.0]).range.unwrap();
        assert!((low - 0.1).abs() < 1e-12 && (high - 1000.0).abs() < 1e-9);
    }

    #[test]
    fn equal_neighbours_are_one_rectangle_and_missing_values_are_gaps() {
        let row = vec![0.5, 0.5, f64::NAN, 0.5];
        let cells = cells(&[0.0, 1.0, 2.0, 3.0, 4.0], &[0.0, 1.0], &[row]);
        assert_eq!(cells[32], [[(0.0, 0.0), (2.0, 1.0)], [(3.0, 0.0), (4.0, 1.0)]]);
        assert_eq!(cells.iter().map(Vec::len).sum::<usize>(), 2);
    }

    #[test]
    fn contour_levels_are_round_numbers() {
        let field = |log, values: &[f64]| Field {
            x: vec![0.0],
            y: vec![0.0],
            values: vec![values.to_vec()],
            scale: Axis { log, ..Axis::default() },
        };
        let linear = field(false, &[0.0, 1.0, f64::NAN]).shades(210.0);
        let expected = [0.2, 0.4, 0.6, 0.8];
        assert_eq!(levels(&linear).len(), 4);
        assert!(levels(&linear).iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
        let log = field(true, &[1e-3, 1e3, 0.0]).shades(400.0);
        assert!((levels(&log)[0] - 1.0 / 6.0).abs() < 1e-12, "{:?}", levels(&log));
        // The round numbers from 1 to 250 are 2, 5, 10, 20, 50, 100 and 200.
        let short = field(true, &[1.0, 250.0]).shades(400.0);
        assert_eq!(levels(&short).len(), 7, "{:?}", levels(&short));
        assert!(field(false, &[3.0]).shades(200.0).share(3.0).is_some());
    }
}
