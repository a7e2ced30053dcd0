//! Figures of a study: reads the rows, draws the chosen figure, and describes it.

use serde::de::Error as _;
use serde_json::Value;

use super::axes;
use super::choice::{Choice, Offer};
use super::grid::{self, StudyTable};
use super::run::numbers;
use super::words::{self, member};
use super::{fit, scatter, tornado};
use crate::{Document, Error, Part, PartTable, Result, Values, View};
use fretwork_plot::{Axis, Figure};
use fretwork_study::{Hints, Kind, Regions, StudyFigure};

/// The note about the boundary after the runs. The legend has no room for it.
const LATER: &str = " Thin: the boundary after the last cycle, within one amplitude step.";

/// Draws the requested figure of a study as an SVG document.
pub fn svg(document: &Document<'_>, kind: &'static Kind, view: &View) -> Result<String> {
    DrawnStudy::open(document, kind, view)?.drawn(view)
}

/// The members and outputs of a study. A column whose name is a JSON pointer is a member; every other column of numbers
/// is an output.
fn offer(hints: Hints, rows: &PartTable) -> Offer {
    let is_number = |values: &Values| matches!(values, Values::Cycles(_));
    let columns = || rows.columns.iter().filter(|(_, values)| is_number(values));
    let members = columns().filter(|(name, _)| name.starts_with('/'));
    let members = members.map(|(name, _)| (name.clone(), axes::distinct(rows.axis(name)).len()));
    let outputs = columns().filter(|(name, _)| !name.starts_with('/'));
    Offer {
        hints,
        members: members.collect(),
        outputs: outputs.map(|(name, _)| name.clone()).collect(),
    }
}

/// A study while it is drawn.
struct DrawnStudy<'a> {
    document: &'a Document<'a>,
    view: &'a View,
    kind: &'static Kind,
    table: StudyTable<'a>,
}

impl<'a> DrawnStudy<'a> {
    fn open(document: &'a Document<'a>, kind: &'static Kind, view: &'a View) -> Result<Self> {
        let mut asked = document.value(kind.name)?;
        let rows = document.rows(kind)?;
        let mut offer = offer(kind.hints(&asked), &rows);
        if offer.hints.figures.contains(&StudyFigure::Bands) {
            offer.outputs = fit::outputs(document)?;
        }
        let least = if offer.hints.regions.is_some() { 2 } else { 1 };
        if offer.members.len() < least || offer.outputs.is_empty() {
            return Err(serde_json::Error::custom(
                "the table of the study has no columns of varied numbers, or no columns of outputs",
            )
            .into());
        }
        let scenario = asked.get_mut("scenario").map(Value::take).unwrap_or_default();
        let table = StudyTable { offer, rows, units: &document.head.units, scenario };
        Ok(Self { document, view, kind, table })
    }

    /// The figure that a view requests of this study.
    fn drawn(&self, view: &View) -> Result<String> {
        let choice = self.table.offer.choose(view).map_err(Error::Missing)?;
        let Choice { kind, output, over, by } = choice;
        match (kind, by) {
            (StudyFigure::Tornado, _) => self.tornado(output),
            (StudyFigure::Scatter, _) => self.scatter(output, over),
            (StudyFigure::Heat, Some(by)) => self.heat(choice, by),
            (StudyFigure::Heat | StudyFigure::Curves, _) => self.curves(choice),
            (StudyFigure::Regimes, _) => self.regimes(),
            (StudyFigure::Profile, _) => {
                let name = self.member(over);
                let axis = self.axis(&member(name, &self.table.scenario), name);
                self.finished(fit::profile(self.document, name, axis)?, "", "")
            }
            (StudyFigure::Bands | StudyFigure::Residuals | StudyFigure::Energy, _) => {
                let output = &self.table.offer.outputs[output];
                let engineering = self.view.engineering;
                self.finished(fit::measured(self.document, kind, output, engineering)?, "", "")
            }
        }
    }

    fn member(&self, place: usize) -> &str {
        &self.table.offer.members[place].0
    }

    /// An axis with the unit of a column.
    fn axis(&self, label: &str, name: &str) -> Axis {
        axes::in_unit(label, self.table.units.of(name))
    }

    /// The axis for the values of a member.
    fn across(&self, place: usize) -> Axis {
        let name = self.member(place);
        let log = axes::is_log_spaced(&axes::distinct(self.table.rows.axis(name)));
        Axis { log, ..self.axis(&member(name, &self.table.scenario), name) }
    }

    /// The axis and the title of an output.
    fn up(&self, place: usize) -> (Axis, String) {
        let name = &self.table.offer.outputs[place];
        let (quantity, rest) = words::output(name, &self.table.scenario);
        (self.axis(&quantity, name), quantity + &rest)
    }

    fn curves(&self, choice: Choice) -> Result<String> {
        let StudyTable { offer, rows, .. } = &self.table;
        let name = &offer.outputs[choice.output];
        let (axis, title) = self.up(choice.output);
        let across = self.across(choice.over);
        let (series, note) = if offer.hints.is_grid {
            self.table.curves(choice)
        } else {
            let x = rows.axis(self.member(choice.over));
            (vec![grid::list(x, rows.axis(name))], String::new())
        };
        let log = axes::spans_decades(series.iter().flat_map(|series| &series.y).copied());
        let figure =
            Figure { title, x: across, y: Axis { log, ..axis }, series, ..Figure::default() };
        self.finished(figure, &(note + &self.gaps(name)), "")
    }

    fn heat(&self, choice: Choice, by: usize) -> Result<String> {
        let name = &self.table.offer.outputs[choice.output];
        let (scale, title) = self.up(choice.output);
        let (mut x, mut y) = (self.across(choice.over), self.across(by));
        x.log = self.view.figure.log_x.unwrap_or(x.log);
        y.log = self.view.figure.log_y.unwrap_or(y.log);
        let (field, mut note) = self.table.field(choice, (x.log, y.log), scale);
        let mut series = Vec::new();
        if let Some(regions) = self.table.offer.hints.regions {
            let turned = |[first, second]: [Vec<f64>; 2]| {
                if choice.over == 0 { [first, second] } else { [second, first] }
            };
            let unworn = self.boundary(&regions, self.member(1))?;
            series.extend(grid::boundary(turned(unworn), regions.label));
            if let Some(later) = self.later(&regions)? {
                series.push(grid::later(turned(later)));
                note += LATER;
            }
        }
        let label = field.scale.label.clone();
        let figure = Figure { title, x, y, field: Some(field), series, ..Figure::default() };
        self.finished(figure, &(note + &self.gaps(name)), &format!(" Colours: {label}."))
    }

    /// The boundary after the runs.
    fn later(&self, regions: &Regions) -> Result<Option<[Vec<f64>; 2]>> {
        let boundary = self.boundary(regions, regions.later)?;
        Ok(Some(boundary).filter(|[_, second]| !second.is_empty()))
    }

    /// The boundary of two regions: the values of the first number, ascending, and those of a column. A missing value of
    /// the column is NaN.
    fn boundary(&self, regions: &Regions, column: &str) -> Result<[Vec<f64>; 2]> {
        let boundary = self.document.value(regions.boundary)?;
        let [first, second] = [self.member(0), column].map(|name| numbers(&boundary[name]));
        let mut pairs: Vec<_> = first.into_iter().zip(second).collect();
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (first, second) = pairs.into_iter().unzip();
        Ok([first, second])
    }

    #[expect(clippy::expect_used, reason = "a test reads the hints of all kinds")]
    fn regimes(&self) -> Result<String> {
        let regions = self.table.offer.hints.regions.expect("this figure has regions");
        let boundary = self.boundary(&regions, self.member(1))?;
        let [x, y] = [0, 1].map(|place| {
            let ends = axes::distinct(self.table.rows.axis(self.member(place)));
            let range = ends.first().zip(ends.last()).map(|(low, high)| (*low, *high));
            Axis { range: range.filter(|(low, high)| low < high), ..self.across(place) }
        });
        let bands = grid::regions(regions.names, &boundary, y.range);
        // The boundary needs no label, because the regions have names.
        let mut series = grid::boundary(boundary, "");
        let later = self.later(&regions)?;
        let note = if later.is_some() { LATER } else { "" };
        series.extend(later.map(grid::later));
        let title = regions.title.to_owned();
        self.finished(Figure { title, x, y, bands, series, ..Figure::default() }, note, "")
    }

    fn scatter(&self, output: usize, over: usize) -> Result<String> {
        let name = &self.table.offer.outputs[output];
        let (axis, title) = self.up(output);
        let (x, y) = (self.table.rows.axis(self.member(over)), self.table.rows.axis(name));
        let log = axes::spans_decades(y.iter().copied());
        let (series, note) = scatter::series(x, y);
        let mut across = self.across(over);
        let ends = axes::distinct(x);
        let wide = ends.first().zip(ends.last());
        across.log &= wide.is_some_and(|(low, high)| *high >= axes::LOG_RATIO * low);
        let figure =
            Figure { title, x: across, y: Axis { log, ..axis }, series, ..Figure::default() };
        self.finished(figure, &(note + &self.gaps(name)), "")
    }

    #[expect(clippy::expect_used, reason = "a test reads the hints of all kinds")]
    fn tornado(&self, output: usize) -> Result<String> {
        let bars = self.table.offer.hints.bars.expect("this figure has bars");
        let name = &self.table.offer.outputs[output];
        let table = self.document.table(Part::Table, &View::default())?;
        let mut chart = tornado::chart(&table, name, &bars, self.table.units, &self.table.scenario);
        chart.size = axes::size(&self.view.figure);
        let options = &self.view.figure;
        let log = [("x", options.log_x == Some(true)), ("y", options.log_y == Some(true))];
        axes::refuse_logarithms(log, "the bars begin at 0")?;
        let note = tornado::keep_what_fits(&mut chart);
        let (quantity, rest) = words::output(name, &self.table.scenario);
        chart.title = format!("Sensitivity: {}{rest}", quantity.to_lowercase());
        let groups: Vec<&str> = chart.groups.iter().map(|group| group.label.as_str()).collect();
        let description = format!(
            "{} of {}{rest} for {}, {}.{note}",
            chart.axis.label,
            quantity.to_lowercase(),
            groups.join(", "),
            self.origin(),
        );
        chart.about = Some(axes::about(&self.document.head, description.replace('$', "")));
        Ok(chart.svg())
    }

    /// How many points lack an output, in words.
    fn gaps(&self, name: &str) -> String {
        match self.table.rows.axis(name).iter().filter(|value| !value.is_finite()).count() {
            0 => String::new(),
            1 => " 1 point has no value.".to_owned(),
            count => format!(" {count} points have no value."),
        }
    }

    /// Where the numbers come from, in words.
    fn origin(&self) -> String {
        let (kind, engine) = (self.kind.name, &self.document.head.engine);
        format!("from {} points of a {kind} study, computed by {engine}", self.table.rows.cycles())
    }

    /// The figure with its metadata, as SVG. The note is printed below the figure. `colours` is only in its
    /// description.
    fn finished(&self, mut figure: Figure, note: &str, colours: &str) -> Result<String> {
        axes::choose(&mut figure, &self.view.figure)?;
        note.trim().clone_into(&mut figure.note);
        let curves = axes::curves_in_words(&figure, "; ");
        let description = format!(
            "{}: {} against {}, {}.{colours}{note}{curves}",
            figure.title,
            figure.y.label,
            figure.x.label,
            self.origin()
        );
        figure.about = Some(axes::about(&self.document.head, description.replace('$', "")));
        Ok(figure.svg())
    }
}
