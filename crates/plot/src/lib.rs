//! Figures as SVG: curves on linear or logarithmic axes, for the screen and for print.
//!
//! A [`Figure`] is one diagram; a [`Sheet`] contains several diagrams, with a common legend and a caption. The same
//! figure gives the same bytes on every machine. The numbered styles have colours after Okabe and Ito, which
//! colour-blind readers can distinguish, and different dashes, so that they also differ in greyscale. The legend is
//! placed where it covers no curve, or beside the diagram if there is no such place. In labels, `$` signs enclose
//! italics: `"$r$/$a$₀"`.
//!
//! # Examples
//! ```
//! use fretwork_plot::{Axis, Figure, Series, Style};
//! let radii: Vec<f64> = (0..=20).map(|i| f64::from(i) / 20.0).collect();
//! let hertz = radii.iter().map(|r| (1.0 - r * r).sqrt()).collect();
//! let figure = Figure {
//!     title: "Pressure of Hertz".to_owned(),
//!     x: Axis::labelled("$r$/$a$"),
//!     y: Axis::labelled("$p$/$p$₀"),
//!     series: vec![Series::new("elastic", radii, hertz, Style::numbered(0))],
//!     size: (480.0, 340.0),
//!     ..Figure::default()
//! };
//! assert!(figure.svg().starts_with("<svg xmlns="));
//! ```
//!
//! # Sources
//! M. Okabe, K. Ito, *Color Universal Design* (2008): the colours.

mod band;
mod bars;
mod canvas;
mod color;
mod contours;
mod field;
mod legend;
mod scale;
mod series;
pub mod text;

pub use band::Band;
pub use bars::{Bar, BarChart, Group};
pub use canvas::About;
pub use field::Field;
pub use scale::Axis;
pub use series::{Dash, GREY, Mark, PALETTE, Series, Style};

use canvas::{Anchor, Area, Canvas, Point};
use legend::Legend;
use scale::{Scale, TICK_ROOM};
use series::{GRID, TICK};
use text::{GAP, HEADING, LABEL, LEADING, SINK, SMALL, TITLE, width, wrap};

/// The largest share of the width that a legend beside the curves may take.
const WIDEST_MARGIN: f64 = 0.5;
/// Maximum number of lines of the note. The description contains the whole note.
const NOTE_LINES: usize = 3;
/// Height of a line of the note.
const NOTE: f64 = SMALL * LEADING;
/// A curve with an infinite value ends at this height, in heights of the diagram. It is above the diagram.
const ABOVE: f64 = 1.1;
const RULE: Style = Style { color: "#555", dash: Dash::ShortDashed, width: 0.8, mark: None };

/// A diagram.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Figure {
    /// The title, above the diagram.
    pub title: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// Coloured regions, drawn below everything else.
    pub bands: Vec<Band>,
    /// A heat map below the curves.
    pub field: Option<Field>,
    /// Curves; the last one is on top.
    pub series: Vec<Series>,
    /// A note below the figure about data that the figure does not show.
    pub note: String,
    /// Width and height in px (1/96 inch).
    pub size: (f64, f64),
    /// Metadata for screen readers and programs.
    pub about: Option<About>,
}

/// Diagrams side by side, in rows.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Sheet {
    /// The title, at the top.
    pub title: String,
    /// The caption, at the bottom.
    pub caption: String,
    /// Number of diagrams per row.
    pub columns: usize,
    /// The diagrams, row by row. All have the size of the first.
    pub figures: Vec<Figure>,
    /// A common legend below the diagrams. It uses the labels and styles of the series.
    pub legend: Vec<Series>,
}

/// The layout of a figure.
struct Plan {
    area: Area,
    x: Scale,
    y: Scale,
}

impl Plan {
    fn point(&self, x: f64, y: f64) -> Option<Point> {
        Some(self.area.at(self.x.share(x)?, self.y.share(y)?))
    }

    /// The pieces of a band between its gaps: points of its lower and upper curve.
    fn pieces(&self, band: &Band) -> Vec<Vec<(Point, Point)>> {
        let place = |(x, (low, high)): (&f64, &(f64, f64))| {
            Some((self.point(*x, *low)?, self.point(*x, *high)?))
        };
        let places: Vec<_> = band.x.iter().zip(&band.between).map(place).collect();
        let pieces = places.split(Option::is_none).filter(|piece| !piece.is_empty());
        pieces.map(|piece| piece.iter().flatten().copied().collect()).collect()
    }

    /// The dashed lines at the marks of both axes.
    fn rules(&self, figure: &Figure) -> Vec<(Point, Point)> {
        let area = &self.area;
        let across = |share: f64| (area.at(0.0, share), area.at(1.0, share));
        let upright = |share: f64| (area.at(share, 0.0), area.at(share, 1.0));
        let marked = |axis: &Axis, scale: &Scale| -> Vec<f64> {
            axis.marks.iter().filter_map(|(value, _)| scale.share(*value)).collect()
        };
        let x = marked(&figure.x, &self.x).into_iter().map(upright);
        x.chain(marked(&figure.y, &self.y).into_iter().map(across)).collect()
    }
}

impl Figure {
    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        let mut canvas = Canvas::default();
        self.draw(&mut canvas, (0.0, 0.0), 0.0);
        canvas.document(self.size, &self.title, self.about.as_ref())
    }

    /// Draws the figure. `corner` is its upper left corner, `indent` the minimum indentation of its area.
    fn draw(&self, canvas: &mut Canvas, corner: Point, indent: f64) {
        let legend = Legend::of(self.series.iter().map(|series| (&*series.label, series.style)));
        // The exact height is not known yet, so the scale is computed for an estimate.
        let shades = self.field.as_ref().map(|field| (field, field.shades(0.8 * self.size.1)));
        let bar = shades.as_ref().map_or(0.0, |(_, scale)| Field::room(scale));
        let mut plan = self.plan(corner, indent, bar);
        let place = legend.as_ref().map(|legend| {
            let mut lines = plan.rules(self);
            for (curve, series) in self.curves(&plan).into_iter().zip(&self.series) {
                for run in curve {
                    if series.style.width > 0.0 {
                        lines.extend(run.windows(2).map(|pair| (pair[0], pair[1])));
                    }
                    lines.extend(run.iter().map(|point| (*point, *point)));
                }
            }
            let (wide, _) = legend.size();
            legend.place(&plan.area, &lines).unwrap_or_else(|| {
                if wide > WIDEST_MARGIN * self.size.0 {
                    // A margin would leave too little room for the curves, so the legend covers some of them.
                    return (plan.area.right() - wide, plan.area.top);
                }
                plan = self.plan(corner, indent, bar + wide);
                (corner.0 + self.size.0 - wide, plan.area.top)
            })
        });
        self.draw_axes(canvas, &plan, corner);
        self.draw_note(canvas, corner);
        canvas.open_window(&plan.area);
        for band in &self.bands {
            band.draw(canvas, &plan.area, &plan.pieces(band));
        }
        if let Some((field, scale)) = &shades {
            field.draw(canvas, &plan.area, (&plan.x, &plan.y), scale);
        }
        for (from, to) in plan.rules(self) {
            canvas.line(from, to, &RULE);
        }
        for (i, (curve, series)) in self.curves(&plan).iter().zip(&self.series).enumerate() {
            // Shifts the markers of each curve, so that overlapping curves can be distinguished.
            let lead = 12.0 + 10.0 * (i % Mark::ALL.len()) as f64;
            for run in curve {
                canvas.curve(run, &series.style, lead);
            }
        }
        canvas.close_window();
        canvas.rectangle(&plan.area, false);
        if let Some((field, scale)) = &shades {
            field.draw_bar(canvas, &plan.area, scale);
        }
        if let (Some(legend), Some(place)) = (legend, place) {
            legend.draw(canvas, place);
        }
    }

    /// The pieces of every series between gaps, in px.
    fn curves(&self, plan: &Plan) -> Vec<Vec<Vec<Point>>> {
        let runs = |series: &Series| {
            let mut runs: Vec<Vec<Point>> = vec![Vec::new()];
            for (x, y) in series.x.iter().zip(&series.y) {
                let rises = *y == f64::INFINITY;
                // The clip window cuts the curve off at the frame.
                let place = if rises {
                    plan.x.share(*x).map(|x| plan.area.at(x, ABOVE))
                } else {
                    plan.point(*x, *y)
                };
                if let (Some(place), Some(run)) = (place, runs.last_mut()) {
                    run.push(place);
                }
                if rises || place.is_none() {
                    runs.push(place.into_iter().collect());
                }
            }
            // A piece above the frame is invisible.
            let visible = |run: &&Vec<Point>| run.iter().any(|(_, y)| *y > plan.area.top - 1.0);
            runs.iter().filter(visible).cloned().collect()
        };
        self.series.iter().map(runs).collect()
    }

    /// The scale of the vertical axis, and the indentation that it needs.
    fn vertical(&self) -> (Scale, f64) {
        let values = self.series.iter().flat_map(|series| &series.y).copied();
        let axis = self.field.as_ref().map(|field| Field::ends(&self.y, &field.y));
        let axis = axis.as_ref().unwrap_or(&self.y);
        let scale = Scale::new(axis, values, (self.size.1 - 70.0) / TICK_ROOM.1);
        let least = line(LABEL, &self.y.label) + scale.widest_label() + 3.0 * GAP;
        (scale, least)
    }

    /// The layout with a free margin of width `beside` on the right side.
    fn plan(&self, corner: Point, indent: f64, beside: f64) -> Plan {
        let (y, least) = self.vertical();
        let names = |axis: &Axis| {
            axis.marks.iter().map(|(_, name)| width(name) * SMALL).fold(0.0, f64::max)
        };
        // The factor of a colour bar is written above the bar.
        let above = names(&self.x) > 0.0 || y.power != 0 || self.field.is_some();
        let top =
            corner.1 + line(TITLE, &self.title) + GAP + if above { SMALL * LEADING } else { 0.0 };
        let below = (SMALL + LABEL) * LEADING + 2.0 * GAP + self.note_lines().len() as f64 * NOTE;
        let bottom = corner.1 + self.size.1 - below;
        let left = corner.0 + indent.max(least);
        // Half of the last tick label extends beyond the area.
        let right = corner.0 + self.size.0 - (beside + names(&self.y) + GAP).max(3.0 * GAP);
        let values = self.series.iter().flat_map(|series| &series.x).copied();
        let axis = self.field.as_ref().map(|field| Field::ends(&self.x, &field.x));
        let axis = axis.as_ref().unwrap_or(&self.x);
        let x = Scale::new(axis, values, (right - left) / TICK_ROOM.0);
        let (width, height) = ((right - left).max(1.0), (bottom - top).max(1.0));
        Plan { area: Area { left, top, width, height }, x, y }
    }

    /// The lines of the note.
    fn note_lines(&self) -> Vec<String> {
        let mut lines = wrap(&self.note, (self.size.0 - 4.0 * GAP) / SMALL);
        if lines.len() > NOTE_LINES {
            lines.truncate(NOTE_LINES);
            lines.iter_mut().last().into_iter().for_each(|line| line.push('…'));
        }
        lines
    }

    fn draw_note(&self, canvas: &mut Canvas, corner: Point) {
        let bottom = corner.1 + self.size.1 - GAP;
        for (line, words) in self.note_lines().iter().rev().enumerate() {
            let place = (corner.0 + 2.0 * GAP, bottom - line as f64 * NOTE);
            canvas.text(place, Anchor::Start, SMALL, words);
        }
    }

    fn draw_axes(&self, canvas: &mut Canvas, plan: &Plan, corner: Point) {
        let area = &plan.area;
        plan.x.draw_below(canvas, area);
        for tick in &plan.y.ticks {
            let foot = area.at(0.0, tick.share);
            canvas.line(foot, (foot.0 - tick.length(), foot.1), &TICK);
            if let Some(label) = &tick.label {
                canvas.line(foot, area.at(1.0, tick.share), &GRID);
                canvas.text((foot.0 - GAP, foot.1 + SINK), Anchor::End, SMALL, label);
            }
        }
        let below = area.bottom() + SMALL * LEADING + LABEL + GAP;
        let above = area.top - 0.5 * GAP;
        let beside = corner.0 + self.size.0 - area.left - GAP;
        canvas.title((area.left, corner.1 + TITLE), TITLE, beside, &self.title);
        let halfway = area.at(0.0, 0.5).1;
        // A long label of a small figure is small. Half a pixel is for what rounding moves.
        let size = LABEL.min((2.0 * (halfway - corner.1) - 0.5) / width(&self.y.label));
        canvas.upward_text((corner.0 + LABEL + 2.0, halfway), size, &self.y.label);
        // The powers of ten are at the ends of the axes. Labels that would overlap them are moved.
        let (across, up) = (plan.x.factor(), plan.y.factor());
        canvas.text((area.right(), below), Anchor::End, SMALL, &across);
        canvas.text((area.left, above), Anchor::Start, SMALL, &up);
        let room = |factor: &str| if factor.is_empty() { 0.0 } else { width(factor) * SMALL + GAP };
        let most = area.right() - room(&across);
        let size = LABEL.min((most - corner.0 - 0.5) / width(&self.x.label));
        let middle = area.at(0.5, 0.0).0.min(most - 0.5 * width(&self.x.label) * size);
        canvas.text((middle, below), Anchor::Middle, size, &self.x.label);
        let names = self.x.names(&plan.x, area.width);
        let ends = (room(&up), area.width + 2.0 * GAP);
        for (x, name) in apart(names, ends, |name| width(name) * SMALL + GAP) {
            canvas.text((area.left + x, above), Anchor::Middle, SMALL, name);
        }
        let names = self.y.names(&plan.y, area.height);
        for (y, name) in apart(names, (0.0, f64::INFINITY), |_| SMALL) {
            let place = (area.right() + 0.5 * GAP, area.bottom() - y + SINK);
            canvas.text(place, Anchor::Start, SMALL, name);
        }
    }
}

/// Moves names along an axis so that they do not overlap: first upwards from the start, then back from the end. If
/// there is not enough space for all names, the last ones are left out.
fn apart(
    mut names: Vec<(f64, &str)>,
    (start, end): (f64, f64),
    extent: impl Fn(&str) -> f64,
) -> Vec<(f64, &str)> {
    while names.iter().map(|(_, name)| extent(name)).sum::<f64>() > end - start {
        names.pop();
    }
    let mut free = start;
    for (place, name) in &mut names {
        let half = 0.5 * extent(name);
        *place = place.max(free + half);
        free = *place + half;
    }
    let mut free = end;
    for (place, name) in names.iter_mut().rev() {
        let half = 0.5 * extent(name);
        *place = place.min(free - half);
        free = *place - half;
    }
    names
}

impl Sheet {
    /// The sheet as an SVG document.
    pub fn svg(&self) -> String {
        let mut canvas = Canvas::default();
        let columns = self.columns.max(1);
        let (wide, high) = self.figures.first().map_or((0.0, 0.0), |figure| figure.size);
        let measure = wide * columns as f64;
        let mut y = 0.5 * GAP;
        if !self.title.is_empty() {
            canvas.title((2.0 * GAP, y + HEADING), HEADING, measure, &self.title);
            y += HEADING * LEADING + GAP;
        }
        let indent = self.figures.iter().map(|figure| figure.vertical().1).fold(0.0, f64::max);
        for (i, figure) in self.figures.iter().enumerate() {
            let (row, column) = (i / columns, i % columns);
            figure.draw(&mut canvas, (column as f64 * wide, y + row as f64 * high), indent);
        }
        y += self.figures.len().div_ceil(columns) as f64 * high;
        let legend = self.legend.iter().map(|series| (&*series.label, series.style));
        if let Some(legend) = Legend::of(legend) {
            y += GAP;
            legend.draw_rows(&mut canvas, (GAP, y), measure - 2.0 * GAP);
            y += legend.height(measure - 2.0 * GAP);
        }
        for words in wrap(&self.caption, (measure - 4.0 * GAP) / SMALL) {
            y += SMALL * LEADING;
            canvas.text((2.0 * GAP, y), Anchor::Start, SMALL, &words);
        }
        let name = if self.title.is_empty() { &self.caption } else { &self.title };
        canvas.document((measure, y + 1.5 * GAP), name, None)
    }
}

/// The height of a line of text; 0 if it is empty.
fn line(size: f64, label: &str) -> f64 {
    if label.is_empty() { 0.0 } else { size * LEADING }
}
