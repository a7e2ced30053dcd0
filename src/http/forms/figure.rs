//! A result as a figure: what is drawn of it, and on which axes.
//!
//! Instants differ by their marks as well as by their colours, so a figure can be read in grey and by
//! the colour-blind; what a run starts from and tends to is dashed. An infinite pressure is a gap:
//! the curve rises to the frame on both sides of it.

use std::fmt;

use serde_json::Value;

use super::document::Document;
use super::table::{Table, Values, spread};
use super::units::round;
use super::{Ask, Complaint, Error, Part};
use crate::plot::text::power_of_ten;
use crate::plot::{About, Axis, Dash, Figure, GREY, Series, Style};

/// How many instants are drawn unless told, and at most.
const USUAL: usize = 6;
pub const MOST: usize = 12;
/// Width and height in px: the least, the usual, the most.
pub const LEAST: (u16, u16) = (320, 240);
pub const SIZE: (u16, u16) = (640, 440);
pub const LARGEST: u16 = 4000;
/// How many times a history may spread from its first to its last instant on a linear axis.
const LINEAR: f64 = 20.0;
/// By how much the limiting state may stretch the axis of a history, if it is to be shown.
const STRETCH: f64 = 2.0;
/// A pressure has a pole where it is so many times as high as on most of its way; the axis then ends
/// at so many times that height.
const POLE: f64 = 5.0;
const POLE_ROOM: f64 = 2.0;

const INITIAL: Style = Style { color: GREY, dash: Dash::Dashed, width: 1.3, mark: None };
const LIMITING: Style = Style { color: "#000000", dash: Dash::ShortDashed, width: 1.3, mark: None };

/// A quantity that can be drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
pub struct Quantity {
    /// Its name in documents and addresses.
    pub name: &'static str,
    part: Part,
    title: &'static str,
    /// The label of the vertical axis, without the unit.
    label: &'static str,
}

const fn quantity(
    part: Part,
    name: &'static str,
    title: &'static str,
    label: &'static str,
) -> Quantity {
    Quantity { name, part, title, label }
}

/// All of them; the first is drawn unless told.
pub const QUANTITIES: [Quantity; 15] = [
    quantity(Part::Profiles, "worn", "Worn profile", "Height $f$"),
    quantity(Part::Profiles, "wear", "Wear depth over the radius", "Wear depth $w$"),
    quantity(Part::Profiles, "image", "One-dimensional image", "Image $g$"),
    quantity(Part::Profiles, "pressure", "Contact pressure", "Pressure $p$"),
    quantity(Part::Profiles, "slip", "Slip amplitude over the radius", "Slip amplitude"),
    quantity(Part::History, "wear_volume", "Wear volume", "Wear volume $V$"),
    quantity(Part::History, "wear_depth", "Largest wear depth", "Largest wear depth"),
    quantity(Part::History, "normal_force", "Normal force", "Normal force $F$"),
    quantity(Part::History, "indentation_depth", "Indentation depth", "Indentation depth $d$"),
    quantity(Part::History, "contact_radius", "Contact and stick radius", "Radius"),
    quantity(Part::History, "energy_per_cycle", "Energy per cycle", "Energy per cycle $W$"),
    quantity(Part::History, "dissipated_energy", "Dissipated energy", "Dissipated energy Σ$W$"),
    quantity(
        Part::History,
        "tangential_force",
        "Tangential force amplitude",
        "Tangential force amplitude $Q$",
    ),
    quantity(Part::History, "amplitude", "Displacement amplitude", "Displacement amplitude $U$"),
    quantity(Part::Loops, "loops", "Force–displacement loops", "Tangential force"),
];

impl fmt::Debug for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl Quantity {
    /// The quantity of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        QUANTITIES.iter().find(|quantity| quantity.name == name)
    }

    /// Whether there is a curve for each instant, so that instants can be chosen.
    #[must_use]
    pub fn has_instants(&self) -> bool {
        self.part != Part::History
    }

    /// Whether it is drawn on both sides of 0, where a logarithmic axis has no place for it.
    #[must_use]
    pub fn has_sign(&self) -> bool {
        self.part == Part::Loops
    }

    /// Whether it changes at once when the motion does.
    fn follows_motion(&self) -> bool {
        matches!(
            self.name,
            "amplitude" | "tangential_force" | "energy_per_cycle" | "contact_radius"
        )
    }

    /// Columns drawn together, each with its name in the legend.
    fn columns(&self) -> Vec<(&'static str, &'static str)> {
        match self.name {
            "contact_radius" => {
                vec![("contact_radius", "contact radius $a$"), ("stick_radius", "stick radius $c$")]
            }
            name => vec![(name, "")],
        }
    }
}

/// How a figure is to look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Look {
    /// What is drawn.
    pub quantity: &'static Quantity,
    /// Whether the axes are logarithmic; as suits the values if not given.
    pub log: (Option<bool>, Option<bool>),
    /// Width and height in px.
    pub size: (u16, u16),
}

impl Default for Look {
    fn default() -> Self {
        Self { quantity: &QUANTITIES[0], log: (None, None), size: SIZE }
    }
}

/// Draws what is asked for as an SVG document.
pub fn svg(document: &Document<'_>, ask: &Ask) -> Result<Vec<u8>, Error> {
    let Look { quantity, log, size } = ask.look;
    let drawing = Drawing { document, ask, quantity };
    let mut figure = match quantity.part {
        Part::History => drawing.history()?,
        Part::Loops => drawing.loops()?,
        _ => drawing.profiles()?,
    };
    figure.x.log = log.0.unwrap_or(figure.x.log);
    figure.y.log = log.1.unwrap_or(false);
    let mut impossible = Vec::new();
    for (name, axis) in [("x", &figure.x), ("y", &figure.y)] {
        let mut values = figure.series.iter().flat_map(|series| match name {
            "x" => &series.x,
            _ => &series.y,
        });
        if axis.log && !values.any(|value| value.is_finite() && *value > 0.0) {
            let detail = "must be \"linear\" here: no value is positive";
            impossible.push(Complaint::parameter(name, detail));
        }
    }
    if !impossible.is_empty() {
        return Err(Error::NotThere(impossible));
    }
    if quantity.name == "pressure" && !figure.y.log {
        figure.y.range = below_poles(&figure.series);
    }
    quantity.title.clone_into(&mut figure.title);
    figure.size = (f64::from(size.0), f64::from(size.1));
    figure.about = Some(About {
        description: drawing.description(&figure)?,
        identifier: document.key.to_string(),
        creator: document.made_by.to_string(),
    });
    Ok(figure.svg().into_bytes())
}

struct Drawing<'a> {
    document: &'a Document<'a>,
    ask: &'a Ask,
    quantity: &'static Quantity,
}

impl Drawing<'_> {
    /// A label with the unit in which the quantity of this name is told.
    fn labelled(&self, label: &str, name: &str) -> Axis {
        Axis::labelled(&match self.document.telling.units.of(name) {
            Some(unit) => format!("{label} ({})", typeset(unit)),
            None => label.to_owned(),
        })
    }

    /// A table of which something is there, cut to the instants asked for.
    fn table(&self) -> Result<Table, Error> {
        let part = self.quantity.part;
        let axes = Ask { fields: Some(Vec::new()), ..Ask::default() };
        if self.document.table(part, &axes)?.instants() == 0 {
            let histories: Vec<_> =
                QUANTITIES.iter().filter(|one| !one.has_instants()).map(|one| one.name).collect();
            let detail = format!(
                "{} needs what the result was computed without (profiles_at: \"none\"); there are {}",
                self.quantity.name,
                histories.join(", ")
            );
            return Err(Error::NotThere(vec![Complaint::parameter("quantity", detail)]));
        }
        self.document.table(part, &Ask { cycles: self.ask.cycles.clone(), ..Ask::default() })
    }

    /// The rows that are drawn: all that were asked for, or some, evenly chosen.
    fn rows(&self, table: &Table, unworn: bool) -> Vec<usize> {
        if self.ask.cycles.is_some() {
            return (0..table.instants()).collect();
        }
        let first = usize::from(!unworn && table.instants() > 1 && table.axis("cycles")[0] == 0.0);
        spread(table.instants() - first, USUAL).into_iter().map(|row| first + row).collect()
    }

    /// A curve for each row.
    fn instants(
        table: &Table,
        rows: &[usize],
        curve: impl Fn(usize) -> (Vec<f64>, Vec<f64>),
    ) -> Vec<Series> {
        let cycles: Vec<f64> = rows.iter().map(|row| table.axis("cycles")[*row]).collect();
        let labels = names(&cycles);
        let styled = |(i, (row, label)): (usize, (&usize, String))| {
            let (x, y) = curve(*row);
            Series::new(&label, x, y).styled(Style::marked(i))
        };
        rows.iter().zip(labels).enumerate().map(styled).collect()
    }

    fn profiles(&self) -> Result<Figure, Error> {
        let name = self.quantity.name;
        let table = self.table()?;
        let radius = table.axis("radius");
        let reference = |column: &str, style| match table.column(column) {
            Some(Values::Places(row)) if name == "worn" => {
                Some(Series::new(column, radius.to_vec(), row.clone()).styled(style))
            }
            _ => None,
        };
        // Before there is wear there is none to draw, and the initial profile is drawn anyway.
        let rows = self.rows(&table, !matches!(name, "worn" | "wear"));
        let values = table.column(name).unwrap_or(&Values::Absent);
        let mut series = Self::instants(&table, &rows, |row| {
            let at = |place| Some(values.at(row, place)).filter(|value| !value.is_nan());
            let y = (0..radius.len()).map(|place| at(place).unwrap_or(f64::INFINITY));
            (radius.to_vec(), y.collect())
        });
        series.splice(0..0, reference("initial", INITIAL));
        // On top, for worn profiles come to lie on it.
        series.extend(reference("limiting", LIMITING));
        let along = if name == "image" { "Coordinate $x$" } else { "Radius $r$" };
        let (x, y) = (self.labelled(along, "radius"), self.labelled(self.quantity.label, name));
        Ok(Figure { x, y, series, ..Figure::default() })
    }

    fn loops(&self) -> Result<Figure, Error> {
        let table = self.table()?;
        let rows = self.rows(&table, true);
        let column = |name: &str, row: usize| match table.column(name) {
            Some(Values::Both(rows)) => rows[row].clone(),
            _ => Vec::new(),
        };
        let series = Self::instants(&table, &rows, |row| {
            (column("displacement", row), column("tangential_force", row))
        });
        let x = self.labelled("Displacement $u$", "displacement");
        let y = self.labelled(self.quantity.label, "tangential_force");
        Ok(Figure { x, y, series, ..Figure::default() })
    }

    fn history(&self) -> Result<Figure, Error> {
        let table = self.table()?;
        let cycles = table.axis("cycles");
        let columns = self.quantity.columns();
        let mut series: Vec<Series> = Vec::new();
        for (name, label) in &columns {
            let y =
                (0..cycles.len()).map(|row| table.column(name).map_or(f64::NAN, |v| v.at(row, 0)));
            series.push(Series::new(label, cycles.to_vec(), y.collect()));
        }
        let comparison = self.document.value("comparison")?;
        if comparison.is_object() {
            let rule =
                format!("rule, ξ = {}", shortly(comparison["xi"].as_f64().unwrap_or(0.0), 4));
            let named = |label: &str, method: &str| match label {
                "" => method.to_owned(),
                label => format!("{label}, {method}"),
            };
            let x = numbers(&comparison["history"]["cycles"]);
            for (i, (name, label)) in columns.iter().enumerate() {
                series[i].label = named(label, "exact");
                let y = numbers(&comparison["history"][*name]);
                series.push(Series::new(&named(label, &rule), x.clone(), y));
            }
        }
        let scenario = self.document.value("scenario")?;
        // Between two blocks these jump, and no line shows where.
        let jumps = scenario["motion"]["blocks"].is_array() && self.quantity.follows_motion();
        for (i, one) in series.iter_mut().enumerate() {
            let style = Style::marked(i);
            let dash = if i < columns.len() { Dash::Solid } else { Dash::Dashed };
            let width = if jumps { 0.0 } else { style.width };
            one.style = Some(Style { dash, width, ..style });
        }
        let first = cycles.iter().copied().find(|cycles| *cycles > 0.0);
        let last = cycles.last().copied().unwrap_or(0.0);
        let log = first.is_some_and(|first| last >= LINEAR * first);
        let log = self.ask.look.log.0.unwrap_or(log);
        let start = first.filter(|_| log).unwrap_or(0.0);
        let limit = self.document.value("limit")?;
        for (name, label) in &columns {
            let Some(value) = limit[*name].as_f64() else { continue };
            let label = match label.rsplit_once(' ') {
                Some((_, symbol)) => format!("limit of {symbol}"),
                None => "limiting state".to_owned(),
            };
            if within_reach(value, &series) {
                let dash = if series.iter().any(|one| one.style == Some(LIMITING)) {
                    Dash::Dotted
                } else {
                    LIMITING.dash
                };
                let line = Series::new(&label, vec![start, last], vec![value, value]);
                series.push(line.styled(Style { dash, ..LIMITING }));
            }
        }
        let y = self.labelled(self.quantity.label, self.quantity.name);
        let marks = self.events(start, last)?;
        let x = Axis { log, marks, ..Axis::labelled("Cycles $N$") };
        Ok(Figure { x, y, series, ..Figure::default() })
    }

    /// What happened in the time that is shown: the first of each kind.
    fn events(&self, start: f64, end: f64) -> Result<Vec<(f64, String)>, Error> {
        let events = self.document.value("events")?;
        let mut marks: Vec<(f64, String)> = Vec::new();
        for event in events.as_array().into_iter().flatten() {
            let name = event["kind"].as_str().unwrap_or_default().replace('_', " ");
            let when = event["cycles"].as_f64().unwrap_or(f64::NAN);
            if (start..=end).contains(&when)
                && when > 0.0
                && marks.iter().all(|mark| mark.1 != name)
            {
                marks.push((when, name));
            }
        }
        Ok(marks)
    }

    /// The figure in words, for those who cannot see it.
    fn description(&self, figure: &Figure) -> Result<String, Error> {
        let scenario = self.document.value("scenario")?;
        let regime = self.document.value("regime")?;
        let word = |value: &Value| match value {
            Value::String(text) => text.replace('_', " "),
            Value::Null => "none".to_owned(),
            other => other.to_string(),
        };
        let mut out = format!(
            "{} against {} of a {} in {}, friction {}, by the {} method, computed by {}.",
            figure.y.label,
            figure.x.label,
            word(&scenario["profile"]["shape"]),
            word(&regime),
            word(&scenario["friction"]),
            word(&scenario["model"]["method"]),
            self.document.made_by,
        );
        let labels: Vec<&str> = figure.series.iter().map(|series| series.label.as_str()).collect();
        let labels: Vec<&str> = labels.into_iter().filter(|label| !label.is_empty()).collect();
        if !labels.is_empty() {
            out = format!("{out} Curves: {}.", labels.join(", "));
        }
        Ok(out.replace('$', ""))
    }
}

fn numbers(column: &Value) -> Vec<f64> {
    column.as_array().into_iter().flatten().map(|cell| cell.as_f64().unwrap_or(f64::NAN)).collect()
}

/// Whether a value can be shown beside curves without flattening them.
fn within_reach(value: f64, series: &[Series]) -> bool {
    let values = series.iter().flat_map(|series| &series.y).copied().filter(|y| y.is_finite());
    let whole = (f64::INFINITY, f64::NEG_INFINITY);
    let (low, high) = values.fold(whole, |(low, high), y| (low.min(y), high.max(y)));
    high.max(value) - low.min(value) <= STRETCH * (high - low).max(0.05 * high.abs())
}

/// The range of pressures that have poles, so that what lies between them can be seen; none where
/// the values as they are show it. Late in a run a pole can be a very large number.
fn below_poles(series: &[Series]) -> Option<(f64, f64)> {
    let usual = series.iter().map(usual_height).fold(0.0, f64::max);
    let top = series.iter().flat_map(|series| &series.y).copied().fold(0.0, f64::max);
    (usual > 0.0 && top > POLE * usual).then_some((0.0, POLE_ROOM * usual))
}

/// What the ordinates of a curve stay below on nineteen twentieths of the way on which they are
/// positive and finite.
fn usual_height(series: &Series) -> f64 {
    let places = series.x.windows(2).zip(series.y.windows(2));
    let mut steps: Vec<(f64, f64)> = places
        .map(|(x, y)| (y[0].max(y[1]), x[1] - x[0]))
        .filter(|(height, _)| height.is_finite() && *height > 0.0)
        .collect();
    steps.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut left = 0.05 * steps.iter().map(|(_, width)| width).sum::<f64>();
    for (height, width) in steps {
        left -= width;
        if left < 0.0 {
            return height;
        }
    }
    0.0
}

/// What instants are called: short where that is enough to tell them apart.
fn names(cycles: &[f64]) -> Vec<String> {
    let told = |digits| -> Vec<String> {
        let name = |cycles: &f64| match *cycles {
            0.0 => "unworn".to_owned(),
            cycles => format!("$N$ = {}", shortly(cycles, digits)),
        };
        cycles.iter().map(name).collect()
    };
    let short = told(6);
    let equal = short.iter().enumerate().any(|(i, name)| short[..i].contains(name));
    if equal { told(17) } else { short }
}

/// A number with at most so many digits, with a power of ten where zeros would be many.
fn shortly(number: f64, digits: u8) -> String {
    let number = round(number, digits);
    let text = format!("{number:e}");
    match text.split_once('e') {
        Some((mantissa, power)) if !(1e-4..1e7).contains(&number.abs()) => {
            let power = power_of_ten(power.parse().unwrap_or(0));
            if mantissa == "1" { power } else { format!("{mantissa}×{power}") }
        }
        _ => number.to_string(),
    }
}

/// A unit as print has it.
fn typeset(unit: &str) -> String {
    let unit = if unit == "um" { "µm" } else { unit };
    unit.replace("^3", "³")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn instants_have_short_names_that_tell_them_apart() {
        assert_eq!(
            names(&[0.0, 1000.0, 177.827_941_004]),
            ["unworn", "$N$ = 1000", "$N$ = 177.828"]
        );
        assert_eq!(names(&[2.5e7, 1e9, 5e-5]), ["$N$ = 2.5×10⁷", "$N$ = 10⁹", "$N$ = 5×10⁻⁵"]);
        assert_eq!(names(&[1000.001, 1000.002]), ["$N$ = 1000.001", "$N$ = 1000.002"]);
    }

    #[test]
    fn a_pole_does_not_flatten_what_is_beside_it() {
        let x: Vec<f64> = (0..=100).map(f64::from).collect();
        let with = |peak: f64| {
            let y = x.iter().map(|x| if (x - 50.0).abs() < 0.5 { peak } else { 2.0 }).collect();
            below_poles(&[Series::new("", x.clone(), y)])
        };
        assert_eq!(with(f64::INFINITY), Some((0.0, 4.0)));
        assert_eq!(with(1e9), Some((0.0, 4.0)));
        assert_eq!(with(9.0), None);
        assert_eq!(below_poles(&[Series::new("", x.clone(), vec![0.0; 101])]), None);
    }
}
