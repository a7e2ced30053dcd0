//! The settings of `run`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde::{Deserialize, Serialize};

use fretwork_format::{Format, QUANTITIES, Quantity};

/// The settings of `run`.
#[derive(Debug, Args)]
pub struct Run {
    /// Input file, such as those in examples/; - reads standard input.
    #[arg(required_unless_present = "join")]
    pub file: Option<PathBuf>,
    /// Compute only one of several parts of a study, such as 3/16, and keep it in the file of --store.
    #[arg(long, value_name = "PART/PARTS", requires = "store")]
    pub part: Option<Part>,
    /// The file of the part. If the command was killed, it continues from this file.
    #[arg(long, value_name = "FILE", requires = "part", conflicts_with_all = ["output", "plot"])]
    pub store: Option<PathBuf>,
    /// Put the files of all parts together. The result is that of a run in one piece.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["file", "part"])]
    pub join: Option<Vec<PathBuf>>,
    /// The format: json and npz hold the whole result; csv, ndjson and arrow hold the history.
    #[arg(long, default_value = "json", value_parser = one_of(&Format::ALL, |format| format.name()))]
    pub format: &'static Format,
    /// Output file [default: standard output].
    #[arg(long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Also draw a figure to this SVG file.
    #[arg(long, value_name = "FIGURE.svg")]
    pub plot: Option<PathBuf>,
    /// The quantity in the figure of a run: a profile, a history, or the loops.
    #[arg(long, default_value = "worn", requires = "plot",
        value_parser = one_of(&QUANTITIES, |quantity| quantity.name))]
    pub quantity: &'static Quantity,
}

/// A part of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// The number of the part, from 1.
    pub number: usize,
    /// The number of all parts.
    pub of: usize,
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Part {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers = text.split_once('/').map(|(number, of)| (number.parse(), of.parse()));
        match numbers {
            Some((Ok(number), Ok(of))) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err("expected a part such as 3/16: its number, from 1, and the number of parts"),
        }
    }
}

/// Parses the name of one of these items.
fn one_of<T: Clone + Send + Sync>(
    items: &'static [T],
    name: fn(&T) -> &'static str,
) -> impl TypedValueParser<Value = &'static T> {
    PossibleValuesParser::new(items.iter().map(name)).try_map(move |text| {
        items.iter().find(|item| name(item) == text).ok_or("the name is unknown")
    })
}
