//! Kinds of studies. A [`Kind`] says how a study of this kind is read and shown. A [`Plan`] says what a study computes.
//!
//! A new kind needs one file in `kinds/`, a line in the list of kinds, and a schema. Documents, formats, figures,
//! search and the dashboard get everything else from the [`Kind`].

use std::fmt;

use fretwork_engine::{Valid, twelve_digits};
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::{Found, Output, Problem, Rows};
use fretwork_json::words;

/// Maximum number of points of a study. A server can set a lower limit.
pub const MAX_POINTS: u64 = 1 << 22;

/// A kind of study. Kinds with the same name are equal.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Kind {
    /// The member of a job body and of a result that holds the study, and the word by which users search for it.
    pub name: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// The member of the document that has the rows of all points. If it is not `table`, the findings contain the
    /// member `table`.
    pub rows: &'static str,
    /// Whether the study can keep profiles.
    pub keeps_profiles: bool,
    /// The numbers that vary, by the names of their members in the study. Empty if the study has a list `vary`.
    pub axes: &'static [(&'static str, &'static str)],
    /// The name of the member of the study that selects its design or method.
    pub design: &'static str,
    /// The figures for each value of the member `design`. The last entry is also used for all other values.
    pub designs: &'static [(&'static str, Hints)],
    /// The studies of this kind that the form of the dashboard offers.
    pub offers: &'static [Offer],
    /// Reads a study. All faults have pointers relative to the study.
    #[serde(skip)]
    pub(crate) read: fn(Value) -> Valid<Read>,
}

impl PartialEq for Kind {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Kind {}

impl Kind {
    /// The figures of a study, from its canonical form.
    ///
    /// # Panics
    /// The kind has no designs.
    #[expect(clippy::expect_used, reason = "a test reads the hints of all kinds")]
    pub fn hints(&self, study: &Value) -> Hints {
        let own = study[self.design].as_str();
        let known = self.designs.iter().find(|(design, _)| Some(*design) == own);
        known.or(self.designs.last()).expect("a kind has figures").1
    }
}

/// A study that the form of the dashboard offers: a scenario, ranges of some of its numbers, outputs, and perhaps a
/// number of samples.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Offer {
    /// Its id in the dashboard.
    pub id: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// What it computes.
    pub meaning: &'static str,
    /// The other members of the study, as JSON.
    pub members: &'static str,
    /// If the study draws samples: (a, b), where a sample has a + b·d points for d numbers that vary.
    pub sample: Option<(u8, u8)>,
}

words! {
    /// A kind of figure of a study.
    pub enum StudyFigure: "kind of figure" {
        /// An output over one number, with one curve for each value of a second one.
        Curves = "curves",
        /// A dot for each point.
        Scatter = "scatter",
        /// Colours and contour lines over two numbers.
        Heat = "heat",
        /// Two regions, and the boundary between them.
        Regimes = "regimes",
        /// Bars of the findings about each number that varies.
        Tornado = "tornado",
        /// Measured numbers of a fit, with predictions and bands.
        Bands = "bands",
        /// The residuals of a fit.
        Residuals = "residuals",
        /// Wear volumes over dissipated energies, with a line through the origin.
        Energy = "energy",
        /// The least sum of squares of a fit over a parameter.
        Profile = "profile",
    }
}

impl StudyFigure {
    /// Whether the figure shows one of the outputs, which clients can choose.
    pub fn has_output(self) -> bool {
        !matches!(self, Self::Regimes | Self::Profile)
    }

    /// Whether clients can choose the numbers that vary on the axes.
    pub fn has_axes(self) -> bool {
        matches!(self, Self::Curves | Self::Scatter | Self::Heat | Self::Profile)
    }
}

/// Which figures a study has, and what they need.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Hints {
    /// The figures, the default first.
    pub figures: &'static [StudyFigure],
    /// Whether the points are all combinations of the values of the numbers that vary.
    pub is_grid: bool,
    /// The two regions of a plane over the first two numbers.
    pub regions: Option<Regions>,
    /// The bars of a tornado.
    pub bars: Option<Bars>,
}

impl Hints {
    /// Hints for figures that need only the rows.
    pub const fn of(figures: &'static [StudyFigure]) -> Self {
        Self { figures, is_grid: false, regions: None, bars: None }
    }
}

/// Two regions of a plane, separated by a boundary.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Regions {
    /// The member of the findings that has the boundary: a table with one column for each of the two numbers.
    pub boundary: &'static str,
    /// The label of the boundary.
    pub label: &'static str,
    /// The column of the boundary, if it has one, that is the boundary after the runs, in place of the second number.
    pub later: &'static str,
    /// The title of the figure.
    pub title: &'static str,
    /// The names of the regions below and above the boundary.
    pub names: [&'static str; 2],
}

/// Bars for each number that varies. They are columns of a table with the columns `output` and `member`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Bars {
    /// The label of the axis, without a unit.
    pub label: &'static str,
    /// The columns, and their names in the legend. A column `x` can have an interval from `x_low` to `x_high`.
    pub columns: &'static [(&'static str, &'static str)],
    /// Whether the numbers have the unit of the output.
    pub have_unit: bool,
}

/// A column of the table of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// Its name: the pointer of a member, or the name of an output.
    pub name: String,
    /// The SI unit of its numbers, or `1`; `None` for a column of texts.
    pub unit: Option<&'static str>,
}

impl Column {
    /// A column of numbers.
    pub(crate) fn new(name: &str, unit: &'static str) -> Self {
        Self { name: name.to_owned(), unit: Some(unit) }
    }
}

/// A study as its kind has read it.
pub struct Read {
    /// The members of the study, with all defaults.
    pub(crate) complete: Map<String, Value>,
    /// What is computed at each point.
    pub(crate) problem: Problem,
    /// The points of the study, and the computation of the findings from their rows.
    pub(crate) plan: Box<dyn Plan>,
}

impl Read {
    /// A study with these members beside its scenario and its outputs.
    pub(crate) fn new(
        mut complete: Map<String, Value>,
        problem: Problem,
        plan: impl Plan + 'static,
    ) -> Self {
        complete.insert("scenario".to_owned(), problem.base.clone());
        if !problem.outputs.is_empty() {
            complete
                .insert("outputs".to_owned(), problem.outputs.iter().map(Output::name).collect());
        }
        Self { complete, problem, plan: Box::new(plan) }
    }
}

/// A run of a point: the values of the members, and the outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct Tried {
    /// The values, in SI.
    pub values: Vec<f64>,
    /// The outputs of the run.
    pub found: Found,
}

/// The values of the members in a run that a point needs.
pub type WantedRun = Vec<f64>;

/// What follows from the runs of a point, or the run that it needs next.
pub type OrRun<T> = Result<T, WantedRun>;

/// Whether a long computation goes on.
pub type GoesOn<'a> = &'a mut dyn FnMut() -> bool;

/// Which points a study has, how each of them is computed, and what follows from their rows.
///
/// Workers compute the points of a stage in any order and on several machines. So a point depends only on the study, on
/// its own number, on the rows of earlier [`stages`](Self::stages), and on its own earlier runs. A kind whose later runs
/// depend on earlier ones combines a sequence of runs into one point: [`row`](Self::row) chooses the values of each run
/// from the runs before it, and makes one row of all of them. A fit from several starts, for example, has one point for
/// each start, and its second stage begins at the best row. A point that is interrupted starts again, so `row` must
/// depend on its arguments alone.
pub trait Plan: fmt::Debug + Send + Sync {
    /// The number of points.
    fn points(&self) -> usize;

    /// The numbers of the points with which the stages begin, ascending from 0.
    fn stages(&self) -> Vec<usize> {
        vec![0]
    }

    /// The values of the members in the first run of a point, in SI. All rows of a point begin with them.
    fn point(&self, number: usize) -> Vec<f64>;

    /// The row of a point, from the rows of earlier stages and from its earlier runs. `earlier` has at least the rows of
    /// all points of earlier stages.
    ///
    /// # Errors
    /// One more run is necessary: the values of this run.
    fn row(&self, _: &Problem, number: usize, _earlier: &Rows, tried: &[Tried]) -> OrRun<Tried> {
        tried.last().cloned().ok_or_else(|| self.point(number))
    }

    /// The problem that [`row`](Self::row) asks for with these values, and the values of its members.
    fn asked<'a>(&'a self, problem: &'a Problem, values: &'a [f64]) -> (&'a Problem, &'a [f64]) {
        (problem, values)
    }

    /// Estimated processor time of a point whose first run has these values, in seconds.
    fn seconds(&self, problem: &Problem, values: &[f64]) -> f64 {
        problem.seconds(values)
    }

    /// The columns of numbers that a row has between its members and its outputs.
    fn columns(&self) -> Vec<Column> {
        Vec::new()
    }

    /// The columns of numbers in the findings that rows do not have.
    fn found_columns(&self) -> Vec<Column> {
        Vec::new()
    }

    /// Computes the findings from the rows of all points. Calls `goes_on` before each long computation, and returns
    /// `None` if that is false.
    fn findings(&self, _: &Problem, _: &Rows, _goes_on: GoesOn<'_>) -> Option<Findings> {
        Some(Findings::default())
    }

    /// Estimated processor time of the findings, in seconds.
    fn findings_seconds(&self, _: &Problem) -> f64 {
        0.0
    }

    /// The largest possible size of the findings in the document, in bytes.
    fn findings_bytes(&self, _: &Problem) -> usize {
        0
    }

    /// Maximum memory of intermediate results that the plan keeps, in bytes.
    fn memory(&self) -> usize {
        0
    }
}

/// Notes, tables and estimates that follow from the rows of a study.
#[derive(Debug, Default)]
pub struct Findings {
    /// Members of the document, in their order.
    pub members: Vec<(&'static str, Value)>,
    /// Additional columns at the end of the table of rows: their names, and their cells as JSON, separated by commas.
    pub beside: Vec<(&'static str, String)>,
}

/// A column of numbers in SI as JSON, with 12 digits.
pub fn number_cells(cells: impl IntoIterator<Item = Option<f64>>) -> Value {
    cells.into_iter().map(|cell| json!(cell.map(twelve_digits))).collect()
}
