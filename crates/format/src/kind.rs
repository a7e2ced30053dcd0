//! File formats, and the parts of a result that they can hold.

use fretwork_json::words;

/// A file format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// `application/json`.
    Json,
    /// `application/x-ndjson`: one JSON object per line.
    Ndjson,
    /// `text/csv`: comment lines (`#`), one header row, `,` and `\n`.
    Csv,
    /// `application/x-npz`: an archive of NumPy arrays.
    Npz,
    /// `application/vnd.apache.arrow.file`: an Arrow IPC file, also known as Feather.
    Arrow,
    /// `image/svg+xml`: figures only.
    Svg,
}

impl Format {
    /// All formats of tables, the default first.
    pub const ALL: [Self; 5] = [Self::Json, Self::Ndjson, Self::Csv, Self::Npz, Self::Arrow];

    /// The name and the media type.
    fn words(self) -> (&'static str, &'static str) {
        match self {
            Self::Json => ("json", "application/json"),
            Self::Ndjson => ("ndjson", "application/x-ndjson"),
            Self::Csv => ("csv", "text/csv; charset=utf-8"),
            Self::Npz => ("npz", "application/x-npz"),
            Self::Arrow => ("arrow", "application/vnd.apache.arrow.file"),
            Self::Svg => ("svg", "image/svg+xml"),
        }
    }

    /// The value of `?format=`, and the extension of a file name.
    pub fn name(self) -> &'static str {
        self.words().0
    }

    /// The media type with its parameters.
    pub fn media_type(self) -> &'static str {
        self.words().1
    }

    /// The media type without parameters.
    pub fn essence(self) -> &'static str {
        self.media_type().split_once(';').map_or(self.media_type(), |(essence, _)| essence)
    }

    /// Whether a browser should save the file instead of showing it.
    pub fn is_file(self) -> bool {
        matches!(self, Self::Csv | Self::Npz | Self::Arrow)
    }
}

words! {
    /// A part of a result, by its name in addresses and documents.
    pub enum Part: "part of a result" {
        /// The whole result.
        Whole = "result",
        /// One row per output cycle.
        History = "history",
        /// Matrices over output cycles and radii.
        Profiles = "profiles",
        /// The force–displacement loops.
        Loops = "loops",
        /// The table of a study.
        Table = "table",
        /// Statistics of the outputs of a study: one row per output.
        Statistics = "statistics",
        /// Histograms of the outputs of a study: one row per bin.
        Histogram = "histogram",
        /// A figure.
        Plot = "plot",
    }
}

impl Part {
    /// The parts that are tables, in the order of the document.
    pub const TABLES: [Self; 4] = [Self::History, Self::Profiles, Self::Loops, Self::Table];

    /// Whether the part summarises the outputs of a study.
    pub fn is_summary(self) -> bool {
        matches!(self, Self::Statistics | Self::Histogram)
    }

    /// The formats that can hold this part, the default first.
    pub fn formats(self) -> &'static [Format] {
        match self {
            Self::Whole => &[Format::Json, Format::Npz],
            Self::Plot => &[Format::Svg],
            _ => &Format::ALL,
        }
    }
}
