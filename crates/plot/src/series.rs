//! Series of points, and their styles.

/// Colours after Okabe and Ito, darker where their contrast with white paper is low. The dashboard has the same.
pub const PALETTE: [&str; 7] =
    ["#0072b2", "#bf4f00", "#007a5a", "#a64d83", "#8a6d00", "#5b4bb5", "#000000"];
/// Grey, for reference curves.
pub const GREY: &str = "#6b7785";

/// The dashes of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Dash {
    /// No dashes.
    Solid,
    /// Long strokes.
    Dashed,
    /// Dots.
    Dotted,
    /// Alternating strokes and dots.
    DashDotted,
    /// Short strokes.
    ShortDashed,
}

impl Dash {
    /// All variants, in the order of the series.
    pub const ALL: [Self; 5] =
        [Self::Solid, Self::Dashed, Self::DashDotted, Self::ShortDashed, Self::Dotted];
}

/// The style of a series.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Style {
    /// An SVG colour.
    pub color: &'static str,
    /// The dashes of its line.
    pub dash: Dash,
    /// The width of its line in px; 0 draws no line.
    pub width: f64,
    /// The marker of its points. If points are dense, only some have markers.
    pub mark: Option<Mark>,
}

/// The ticks of an axis.
pub const TICK: Style = Style { color: "#000", dash: Dash::Solid, width: 0.8, mark: None };
/// The lines across a figure at labelled ticks.
pub const GRID: Style = Style { color: "#e4e9ee", dash: Dash::Solid, width: 0.6, mark: None };

/// A marker of the points of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A filled circle.
    Disc,
    /// An empty circle.
    Ring,
    /// An empty square.
    Square,
    /// An empty square that stands on its corner.
    Diamond,
    /// An empty triangle that points up.
    Triangle,
    /// An empty triangle that points down.
    Wedge,
    /// A small translucent dot, for thousands of points.
    Dot,
}

impl Mark {
    /// The markers of curves, in the order of the series.
    pub const ALL: [Self; 6] =
        [Self::Ring, Self::Square, Self::Triangle, Self::Diamond, Self::Wedge, Self::Disc];
}

impl Style {
    /// A style without markers for series `i`, counted from 0.
    pub fn numbered(i: usize) -> Self {
        let color = PALETTE[i % PALETTE.len()];
        Self { color, dash: Dash::ALL[i % Dash::ALL.len()], width: 1.6, mark: None }
    }

    /// A style with a marker and a solid line for series `i`.
    pub fn marked(i: usize) -> Self {
        let mark = Some(Mark::ALL[i % Mark::ALL.len()]);
        Self { dash: Dash::Solid, width: 1.4, mark, ..Self::numbered(i) }
    }
}

/// A curve through points.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// The name of the series in the legend. A series with an empty name is not in the legend.
    pub label: String,
    /// Abscissae.
    pub x: Vec<f64>,
    /// Ordinates. The curve has a gap where a value is not finite, or not positive on a logarithmic axis.
    /// At +∞ it rises to the frame on both sides.
    pub y: Vec<f64>,
    /// Its style, such as [`Style::numbered`].
    pub style: Style,
}

impl Series {
    /// A series with a label and a style.
    pub fn new(label: &str, x: Vec<f64>, y: Vec<f64>, style: Style) -> Self {
        Self { label: label.to_owned(), x, y, style }
    }
}
