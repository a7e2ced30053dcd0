//! The settings of `run`.

use std::path::PathBuf;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};

use fretwork_format::{Format, QUANTITIES, Quantity};

/// The settings of `run`.
#[derive(Debug, Args)]
pub struct Run {
    /// Input file, such as those in examples/; - reads standard input.
    pub file: PathBuf,
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

/// Parses the name of one of these items.
fn one_of<T: Clone + Send + Sync>(
    items: &'static [T],
    name: fn(&T) -> &'static str,
) -> impl TypedValueParser<Value = &'static T> {
    PossibleValuesParser::new(items.iter().map(name)).try_map(move |text| {
        items.iter().find(|item| name(item) == text).ok_or("the name is unknown")
    })
}
