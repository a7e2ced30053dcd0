//! Which numbers of a result a client requests, and how they are written.

use super::quantity::{QUANTITIES, Quantity};
use fretwork_study::StudyFigure;

/// A selection of columns, output cycles and points, with layout, units and rounding.
///
/// The default selects everything as it was computed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct View {
    /// Whether JSON has a list of rows instead of columns.
    pub records: bool,
    /// Rounds all numbers to this many significant decimal digits, 1 to 17. Up to 7 digits, arrays in
    /// NPZ and Arrow are float32, whose relative step of 6e-8 is smaller than the rounding. A column
    /// that float32 cannot represent (below 1.2e-38, such as the last energies of a contact that
    /// comes to rest) stays float64.
    pub digits: Option<u8>,
    /// µm, mm³, MPa and mJ instead of SI units.
    pub engineering: bool,
    /// Names of the columns. The axes `cycles` and `radius` are always included.
    pub fields: Option<Vec<String>>,
    /// Output cycles. In a whole result they select rows of the profiles and loops only.
    pub cycles: Option<Vec<f64>>,
    /// Maximum number of radii. The radii are selected evenly from the first to the last.
    pub points: Option<usize>,
    /// Studies: maximum number of rows of each table. The first rows are selected.
    pub rows: Option<usize>,
    /// CSV only: leaves out the comment lines before the header row.
    pub without_comments: bool,
    /// Figures only: the quantity and the axes.
    pub figure: FigureOptions,
}

impl View {
    /// A figure with default options, in engineering units.
    pub fn figure(quantity: &'static Quantity) -> Self {
        let figure = FigureOptions { quantity, ..FigureOptions::default() };
        Self { engineering: true, figure, ..Self::default() }
    }

    /// The same view with sorted lists, so that equal selections compare equal.
    pub fn sorted(mut self) -> Self {
        if let Some(fields) = &mut self.fields {
            fields.sort_unstable();
            fields.dedup();
        }
        if let Some(cycles) = &mut self.cycles {
            cycles.sort_unstable_by(f64::total_cmp);
            cycles.dedup();
        }
        self
    }
}

/// Which figure of a study is drawn. What is `None` follows from the study.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct StudyOptions {
    /// The kind of figure.
    pub kind: Option<StudyFigure>,
    /// The name of the output.
    pub output: Option<String>,
    /// The JSON pointer of the number on the horizontal axis.
    pub over: Option<String>,
    /// The JSON pointer of the second number: on the vertical axis of a heat map, or with one curve for each value.
    pub by: Option<String>,
}

impl StudyOptions {
    /// The names of the options that are given.
    pub fn given(&self) -> Vec<&'static str> {
        let texts = [("output", &self.output), ("over", &self.over), ("by", &self.by)];
        let texts = texts.into_iter().filter(|(_, text)| text.is_some()).map(|(name, _)| name);
        self.kind.iter().map(|_| "kind").chain(texts).collect()
    }
}

/// Which quantity a figure shows, on which axes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FigureOptions {
    /// The quantity on the vertical axis of a figure of a run.
    pub quantity: &'static Quantity,
    /// Whether the horizontal axis is logarithmic; by default it depends on the values.
    pub log_x: Option<bool>,
    /// Whether the vertical axis is logarithmic; by default it is linear for a run. For a study
    /// it depends on the values.
    pub log_y: Option<bool>,
    /// Width and height in px.
    pub size: (u16, u16),
    /// The figure of a study.
    pub study: StudyOptions,
}

impl FigureOptions {
    /// Smallest width and height in px.
    pub const MIN_SIZE: (u16, u16) = (320, 240);
    /// Largest width and height in px.
    pub const MAX_SIZE: u16 = 4000;
    /// Largest number of output cycles in one figure.
    pub const MAX_CYCLES: usize = 12;
}

impl Default for FigureOptions {
    fn default() -> Self {
        Self {
            quantity: &QUANTITIES[0],
            log_x: None,
            log_y: None,
            size: (640, 440),
            study: StudyOptions::default(),
        }
    }
}
