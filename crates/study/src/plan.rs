//! What a kind of study is: a [`Kind`] says how it is read and shown, and a [`Plan`] what a study of this kind computes.
//!
//! A new kind is one file in `kinds/`, a line in its list, and its schema. Documents, formats, figures, search and the page
//! ask the kind.

use std::fmt;

use fretwork_engine::numeric::twelve_digits;
use fretwork_engine::request::fault::Faults;
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::output::Output;
use super::problem::{Found, Problem};
use super::rows::Rows;

/// Most points of a study on any server.
pub const MAX_POINTS: u64 = 1 << 22;

/// A kind of study. Kinds with the same name are equal.
#[derive(Clone, Copy, Serialize)]
pub struct Kind {
    /// The member of a job body and of a result that holds the study, and the word by which users search for it.
    pub name: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// The member of the document that has the rows of all points. If it is not `table`, the findings have the table.
    pub rows: &'static str,
    /// Whether the study can keep profiles.
    pub keeps_profiles: bool,
    /// The numbers that vary, by the names of their members in the study. Empty if the study has a list `vary`.
    pub axes: &'static [(&'static str, &'static str)],
    /// The member of the study that decides how its points lie.
    pub design: &'static str,
    /// The figures for each value of this member. The last ones hold for all other values.
    pub designs: &'static [(&'static str, Hints)],
    /// What the form of the page offers.
    pub offers: &'static [Offer],
    /// Reads a study. All faults have pointers relative to the study.
    #[serde(skip)]
    pub(crate) read: fn(Value) -> Result<Read, Faults>,
}

impl PartialEq for Kind {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for Kind {}

impl fmt::Debug for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name)
    }
}

impl Kind {
    /// The figures of a study, from its canonical form.
    ///
    /// # Panics
    /// The kind has no designs.
    #[must_use]
    #[expect(clippy::expect_used, reason = "a test reads the hints of all kinds")]
    pub fn hints(&self, study: &Value) -> Hints {
        let own = study[self.design].as_str();
        let known = self.designs.iter().find(|(design, _)| Some(*design) == own);
        known.or(self.designs.last()).expect("a kind has figures").1
    }
}

/// A study in the form of the page: a scenario, ranges of some of its numbers, outputs, and perhaps a number of samples.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Offer {
    /// Its id in the page.
    pub id: &'static str,
    /// Its name for people.
    pub title: &'static str,
    /// What it computes.
    pub meaning: &'static str,
    /// The other members of the study, as JSON.
    pub members: &'static str,
    /// If the study draws samples: the points of a sample, as a constant and as a factor of the numbers that vary.
    pub sample: Option<(u8, u8)>,
}

/// A kind of figure of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum StudyFigure {
    /// An output over one number, with one curve for each value of a second one.
    Curves,
    /// A dot for each point.
    Scatter,
    /// Colours and contour lines over two numbers.
    Heat,
    /// Two regions, and the boundary between them.
    Regimes,
    /// Bars of the findings about each number that varies.
    Tornado,
}

impl StudyFigure {
    /// All kinds.
    pub const ALL: [Self; 5] =
        [Self::Curves, Self::Scatter, Self::Heat, Self::Regimes, Self::Tornado];

    /// The name in addresses.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Curves => "curves",
            Self::Scatter => "scatter",
            Self::Heat => "heat",
            Self::Regimes => "regimes",
            Self::Tornado => "tornado",
        }
    }

    /// Whether it shows one of the outputs.
    #[must_use]
    pub fn has_output(self) -> bool {
        self != Self::Regimes
    }

    /// Whether it has axes for numbers that vary, which clients can choose.
    #[must_use]
    pub fn has_axes(self) -> bool {
        !matches!(self, Self::Regimes | Self::Tornado)
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
    /// Figures that need nothing but the rows.
    #[must_use]
    pub const fn of(figures: &'static [StudyFigure]) -> Self {
        Self { figures, is_grid: false, regions: None, bars: None }
    }
}

/// Two regions of a plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Regions {
    /// The table of the findings with the boundary: two columns with the names of the two numbers.
    pub boundary: &'static str,
    /// What the boundary is.
    pub label: &'static str,
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

/// A study as its own kind reads it.
pub struct Read {
    /// What was read, with all defaults.
    pub(crate) complete: Map<String, Value>,
    /// What is computed at each point.
    pub(crate) problem: Problem,
    /// Which points the study has, and what it makes of their rows.
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

/// Values of the members, and what their run has given.
#[derive(Debug, Clone, PartialEq)]
pub struct Tried {
    /// The values, in SI.
    pub values: Vec<f64>,
    /// The outputs of the run.
    pub found: Found,
}

/// Which points a study has, how each of them is computed, and what follows from their rows.
///
/// Workers compute the points in any order and on several machines. So a point knows only the study, its own number, and
/// the runs that it has tried itself. A kind whose later runs depend on earlier ones makes a sequence of runs one point:
/// [`next`](Self::next) chooses the values of each run from the runs before it, and [`row`](Self::row) makes one row
/// of all of them. A fit from several starts, for example, has one point for each start. Its
/// [`findings`](Self::findings) compare the rows of all points. A point that is interrupted starts again, so `next` must
/// depend on its arguments alone.
pub trait Plan: fmt::Debug + Send + Sync {
    /// The number of points.
    fn points(&self) -> usize;

    /// The values of the members in the first run of a point, in SI.
    fn point(&self, number: usize) -> Vec<f64>;

    /// The values of the next run of a point, from those that it has tried; `None` if no more run is necessary.
    fn next(&self, _: &Problem, number: usize, tried: &[Tried]) -> Option<Vec<f64>> {
        tried.is_empty().then(|| self.point(number))
    }

    /// The row of a point, from its runs.
    fn row(&self, problem: &Problem, number: usize, tried: Vec<Tried>) -> Tried {
        let none = || Tried { values: self.point(number), found: problem.no_run() };
        tried.into_iter().next_back().unwrap_or_else(none)
    }

    /// Estimated processor time of a point whose first run has these values, in seconds.
    fn seconds(&self, problem: &Problem, values: &[f64]) -> f64 {
        problem.seconds(values)
    }

    /// The columns that a row has before its outputs.
    fn columns(&self) -> Vec<Column> {
        Vec::new()
    }

    /// The columns of numbers that only the findings have.
    fn found_columns(&self) -> Vec<Column> {
        Vec::new()
    }

    /// What follows from the rows of all points. `goes_on` is asked before each long computation; `None` if it is false.
    fn findings(
        &self,
        _: &Problem,
        _: &Rows,
        _goes_on: &mut dyn FnMut() -> bool,
    ) -> Option<Findings> {
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

    /// Memory of what the plan has computed, in bytes.
    fn memory(&self) -> usize {
        0
    }
}

/// What follows from the rows of a study.
#[derive(Debug, Default)]
pub struct Findings {
    /// What its reader must know; `None` if the kind has no notes.
    pub notes: Option<Vec<Note>>,
    /// Tables, by their members in the document.
    pub tables: Vec<(&'static str, Vec<(String, Cells)>)>,
    /// Columns that the table of rows has after its others: their names, and their cells as JSON, separated by commas.
    pub beside: Vec<(&'static str, String)>,
}

/// The cells of a column.
#[derive(Debug)]
pub enum Cells {
    /// Numbers in SI.
    Numbers(Vec<Option<f64>>),
    /// Words.
    Texts(Vec<String>),
}

/// A remark about an output.
#[derive(Debug, Serialize)]
pub struct Note {
    /// The name of the output.
    pub output: String,
    /// What its reader must know.
    pub detail: String,
    /// The pointer of a number that varies, if the note is about one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub member: Option<String>,
}

impl Findings {
    /// The notes and the tables as members of the document.
    pub(crate) fn members(&self) -> Map<String, Value> {
        let cells = |cells: &Cells| match cells {
            Cells::Texts(texts) => json!(texts),
            Cells::Numbers(numbers) => {
                numbers.iter().map(|number| json!(number.map(twelve_digits))).collect()
            }
        };
        let notes = self.notes.iter().map(|notes| ("notes", json!(notes)));
        let table = |(name, columns): &(&'static str, Vec<(String, Cells)>)| {
            let columns = columns.iter().map(|(name, own)| (name.clone(), cells(own)));
            (*name, Value::Object(columns.collect()))
        };
        let tables = self.tables.iter().map(table);
        notes.chain(tables).map(|(name, value)| (name.to_owned(), value)).collect()
    }
}
