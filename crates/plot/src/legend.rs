//! Legends: line samples with names, in a column in a figure or in rows below a sheet.

use super::canvas::{Anchor, Area, Canvas, Point};
use super::series::Style;
use super::text::{GAP, LEADING, SINK, SMALL, width};

/// Length of a line sample, in px.
const SAMPLE: f64 = 30.0;
/// Distance between two lines of the legend, in px.
const LINE: f64 = SMALL * LEADING;
/// Number of positions to try in each direction.
const PLACES: u32 = 8;

/// Names and styles of series.
#[derive(Debug)]
pub struct Legend {
    entries: Vec<(String, Style)>,
}

impl Legend {
    /// The legend of all series with a name; `None` without any.
    pub fn of<'a>(series: impl Iterator<Item = (&'a str, Style)>) -> Option<Self> {
        let named = series.filter(|(label, _)| !label.is_empty());
        let entries: Vec<_> = named.map(|(label, style)| (label.to_owned(), style)).collect();
        (!entries.is_empty()).then_some(Self { entries })
    }

    /// Width of an entry including the space after it.
    fn advance(label: &str) -> f64 {
        SAMPLE + width(label) * SMALL + 3.0 * GAP
    }

    /// Width and height of the legend as a column.
    pub fn size(&self) -> Point {
        let widest = self.entries.iter().map(|(label, _)| Self::advance(label)).fold(0.0, f64::max);
        (widest, self.entries.len() as f64 * LINE + GAP)
    }

    /// A position in the area at which no line crosses the legend, preferably in a corner.
    pub fn place(&self, area: &Area, lines: &[(Point, Point)]) -> Option<Point> {
        let (width, height) = self.size();
        let room = (area.width - width - 2.0 * GAP, area.height - height - 2.0 * GAP);
        if room.0 < 0.0 || room.1 < 0.0 {
            return None;
        }
        let (left, top) = (area.left + GAP, area.top + GAP);
        // The tried positions alternate between both ends of the area and move inwards.
        let share = |i: u32| {
            let inward = f64::from(i / 2) / f64::from(PLACES);
            if i.is_multiple_of(2) { inward } else { 1.0 - inward }
        };
        let free = |(x, y): &Point| {
            let wanted = Area {
                left: x - GAP,
                top: y - GAP,
                width: width + 2.0 * GAP,
                height: height + 2.0 * GAP,
            };
            !lines.iter().any(|(from, to)| wanted.meets(*from, *to))
        };
        let rank = |(i, j): &(u32, u32)| (i + j, *j);
        let mut order: Vec<(u32, u32)> =
            (0..=PLACES).flat_map(|i| (0..=PLACES).map(move |j| (i, j))).collect();
        order.sort_by_key(rank);
        order
            .into_iter()
            .map(|(i, j)| (left + (1.0 - share(i)) * room.0, top + share(j) * room.1))
            .find(free)
    }

    /// Draws a column at its upper left corner.
    pub fn draw(&self, canvas: &mut Canvas, (left, top): Point) {
        let (width, height) = self.size();
        canvas.rectangle(&Area { left, top, width, height }, true);
        for (i, (label, style)) in self.entries.iter().enumerate() {
            Self::entry(canvas, (left, top + 0.5 * GAP + i as f64 * LINE), label, style);
        }
    }

    /// The positions of all entries in rows of width `measure`, and the total height.
    fn rows(&self, measure: f64) -> (Vec<Point>, f64) {
        let (mut x, mut y) = (0.0, 0.0);
        let mut places = Vec::new();
        for (label, _) in &self.entries {
            let advance = Self::advance(label);
            if x > 0.0 && x + advance > measure {
                (x, y) = (0.0, y + LINE + 0.5 * GAP);
            }
            places.push((x, y));
            x += advance;
        }
        (places, y + LINE + 0.5 * GAP)
    }

    /// The height of the legend in rows of width `measure`.
    pub fn height(&self, measure: f64) -> f64 {
        self.rows(measure).1
    }

    /// Draws rows of width `measure` at their upper left corner.
    pub fn draw_rows(&self, canvas: &mut Canvas, (left, top): Point, measure: f64) {
        for ((x, y), (label, style)) in self.rows(measure).0.iter().zip(&self.entries) {
            Self::entry(canvas, (left + x, top + y), label, style);
        }
    }

    fn entry(canvas: &mut Canvas, (left, top): Point, label: &str, style: &Style) {
        let middle = top + 0.5 * LINE;
        let start = left + GAP;
        let sample: Vec<Point> =
            [0.0, 0.5, 1.0].iter().map(|share| (start + share * SAMPLE, middle)).collect();
        canvas.line(sample[0], sample[2], style);
        canvas.curve(&sample[1..2], style, 0.0);
        canvas.text((start + SAMPLE + GAP, middle + SINK), Anchor::Start, SMALL, label);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_legend_is_placed_where_no_line_crosses_it() {
        let series = ["one", "two"].into_iter().zip((0..).map(Style::numbered));
        let legend = Legend::of(series).expect("two names");
        let area = Area { left: 0.0, top: 0.0, width: 300.0, height: 200.0 };
        let (width, height) = legend.size();
        let corner = legend.place(&area, &[]).expect("a place");
        assert_eq!(corner, (300.0 - width - GAP, GAP));
        // A line crosses the upper right corner, so the legend moves to another one.
        let falling = [((0.0, 0.0), (300.0, 200.0))];
        let place = legend.place(&area, &[((150.0, 0.0), (300.0, 30.0))]).expect("a place");
        assert_eq!(place, (GAP, GAP));
        assert_eq!(legend.place(&area, &falling), Some(corner));
        // Dense vertical lines leave no position.
        let comb: Vec<_> =
            (0..30).map(|i| f64::from(i) * 10.0).map(|x| ((x, 0.0), (x, 200.0))).collect();
        assert_eq!(legend.place(&area, &comb), None);
        assert!(height > 2.0 * SMALL);
    }
}
