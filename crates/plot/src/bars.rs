//! Bar charts: horizontal bars in named groups, with intervals.

use super::canvas::{About, Anchor, Area, Canvas};
use super::legend::Legend;
use super::scale::{Axis, Scale, TICK_ROOM};
use super::series::{Dash, Style};
use super::text::{GAP, LABEL, LEADING, SINK, SMALL, TITLE, width};

/// The bars of a group fill this share of its height.
const FILLED: f64 = 0.72;
/// Largest height of a bar, in px.
const HIGHEST: f64 = 26.0;
/// Largest share of the width that the names of the groups may take. The beginning of a longer name is cut off.
const NAMES: f64 = 0.45;
/// The colours of the bars of a group. The second colour is much lighter, so that it differs also in greyscale.
const FILLS: [&str; 2] = ["#0072b2", "#a6cbe3"];
const ZERO: Style = Style { color: "#000000", dash: Dash::Solid, width: 1.0, mark: None };
const WHISKER: Style = Style { color: "#000000", dash: Dash::Solid, width: 1.2, mark: None };

/// A bar from 0 to a value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bar {
    /// The value of the bar; not finite if it is unknown.
    pub value: f64,
    /// The interval of the value, drawn as a whisker.
    pub interval: Option<(f64, f64)>,
}

/// A group of bars with a common name.
#[derive(Debug, Clone, PartialEq)]
pub struct Group {
    /// The name.
    pub label: String,
    /// The bars of the group, in the order of `names` of the chart.
    pub bars: Vec<Bar>,
}

/// A bar chart.
#[derive(Debug, Clone, PartialEq)]
pub struct BarChart {
    /// The title, above the chart.
    pub title: String,
    /// The axis of the values.
    pub axis: Axis,
    /// The names of the bars of each group for the legend, at most two.
    pub names: Vec<String>,
    /// The groups, from top to bottom.
    pub groups: Vec<Group>,
    /// Width and height in px.
    pub size: (f64, f64),
    /// Metadata for screen readers and programs.
    pub about: Option<About>,
}

impl BarChart {
    /// The chart as an SVG document.
    pub fn svg(&self) -> String {
        let mut canvas = Canvas::default();
        let (area, scale) = self.layout();
        canvas.title((2.0 * GAP, TITLE), TITLE, self.size.0 - 4.0 * GAP, &self.title);
        if let Some(legend) = self.legend() {
            legend.draw_rows(&mut canvas, (area.left, TITLE * LEADING), area.width);
        }
        self.draw_axis(&mut canvas, &area, &scale);
        let height = area.height / self.groups.len().max(1) as f64;
        for (i, group) in self.groups.iter().enumerate() {
            let own = Area { top: area.top + i as f64 * height, height, ..area };
            draw_group(&mut canvas, &own, &scale, group);
        }
        if let Some(zero) = scale.share(0.0).filter(|share| (0.0..=1.0).contains(share)) {
            canvas.line(area.at(zero, 0.0), area.at(zero, 1.0), &ZERO);
        }
        canvas.rectangle(&area, false);
        canvas.document(self.size, &self.title, self.about.as_ref())
    }

    fn legend(&self) -> Option<Legend> {
        let styles = FILLS.map(|color| Style { color, dash: Dash::Solid, width: 9.0, mark: None });
        Legend::of(self.names.iter().map(String::as_str).zip(styles))
    }

    fn layout(&self) -> (Area, Scale) {
        let widest = self.groups.iter().map(|group| width(&group.label) * SMALL);
        let widest = widest.fold(0.0, f64::max).min(NAMES * self.size.0);
        let left = widest + 4.0 * GAP;
        let wide = (self.size.0 - left - 4.0 * GAP).max(1.0);
        let named = self.legend().map_or(0.0, |legend| legend.height(wide));
        let top = TITLE * LEADING + named + GAP;
        let bottom = self.size.1 - (SMALL + LABEL) * LEADING - 2.0 * GAP;
        let area = Area { left, top, width: wide, height: (bottom - top).max(1.0) };
        let ends = self.groups.iter().flat_map(|group| &group.bars).flat_map(|bar| {
            let (low, high) = bar.interval.unwrap_or((bar.value, bar.value));
            [0.0, bar.value, low, high]
        });
        (area, Scale::new(&self.axis, ends, wide / TICK_ROOM.0))
    }

    fn draw_axis(&self, canvas: &mut Canvas, area: &Area, scale: &Scale) {
        scale.draw_below(canvas, area);
        let below = area.bottom() + SMALL * LEADING + LABEL + GAP;
        let factor = scale.factor();
        canvas.text((area.right(), below), Anchor::End, SMALL, &factor);
        let most =
            area.right() - width(&factor) * SMALL - GAP - 0.5 * width(&self.axis.label) * LABEL;
        let middle = area.at(0.5, 0.0).0.min(most);
        canvas.text((middle, below), Anchor::Middle, LABEL, &self.axis.label);
    }
}

fn draw_group(canvas: &mut Canvas, area: &Area, scale: &Scale, group: &Group) {
    let name = shortened(&group.label, (area.left - 3.0 * GAP) / SMALL);
    let middle = area.at(0.0, 0.5).1;
    canvas.text((area.left - GAP, middle + SINK), Anchor::End, SMALL, &name);
    let count = group.bars.len().max(1) as f64;
    let high = (FILLED * area.height / count).min(HIGHEST);
    let first = middle - 0.5 * high * count;
    for (i, bar) in group.bars.iter().enumerate() {
        let top = first + i as f64 * high;
        let at = |value: f64| scale.share(value).map(|share| area.at(share, 0.0).0);
        let (Some(zero), Some(end)) = (at(0.0), at(bar.value)) else {
            let place = (at(0.0).unwrap_or(area.left) + GAP, top + 0.5 * high + SINK);
            canvas.text(place, Anchor::Start, SMALL, "–");
            continue;
        };
        canvas.cells(FILLS[i % FILLS.len()], &[[(zero, top), (end, top + high)]]);
        let ends = bar.interval.and_then(|(low, high)| Some((at(low)?, at(high)?)));
        if let Some((low, high_end)) = ends {
            let (y, tip) = (top + 0.5 * high, (0.25 * high).min(4.0));
            canvas.line((low, y), (high_end, y), &WHISKER);
            for x in [low, high_end] {
                canvas.line((x, y - tip), (x, y + tip), &WHISKER);
            }
        }
    }
}

/// The end of a name that fits into the width `measure` (in font sizes), after an ellipsis.
fn shortened(name: &str, measure: f64) -> String {
    if width(name) <= measure {
        return name.to_owned();
    }
    let starts = name.char_indices().map(|(place, _)| format!("…{}", &name[place..]));
    starts.skip(1).find(|rest| width(rest) <= measure).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_name_keeps_its_end() {
        assert_eq!(shortened("friction", 100.0), "friction");
        let short = shortened("bodies 1 youngs modulus", 8.0);
        assert!(short.starts_with('…') && short.ends_with("modulus") && width(&short) <= 8.0);
        assert_eq!(shortened("friction", 0.1), "");
    }

    #[test]
    fn bars_have_lengths_in_proportion_to_their_values() {
        let bar = |value| Bar { value, interval: None };
        let group = |value| Group { label: "a".to_owned(), bars: vec![bar(value)] };
        let chart = BarChart {
            title: String::new(),
            axis: Axis::labelled("x"),
            names: Vec::new(),
            groups: [0.5, -0.25, f64::NAN].map(group).to_vec(),
            size: (400.0, 300.0),
            about: None,
        };
        let (area, scale) = chart.layout();
        let at = |value| area.at(scale.share(value).unwrap(), 0.0).0;
        assert!((at(0.5) - at(0.0) - 2.0 * (at(0.0) - at(-0.25))).abs() < 1e-9);
        let svg = chart.svg();
        assert_eq!(svg.matches("fill=\"#0072b2\"").count(), 2);
        assert!(svg.contains(">–<") && !svg.contains("NaN"));
    }
}
