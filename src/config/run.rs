//! The settings of `run`.

use std::fmt;
use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::values::file_name;
use fretwork_format::{Format, QUANTITIES, Quantity};

/// The settings of `run`.
#[derive(Debug, Args)]
pub struct Run {
    /// Input files, such as those in examples/, or directories of them; - reads standard input.
    #[arg(required_unless_present = "join")]
    pub files: Vec<PathBuf>,
    /// Compute only one of several parts of a study, such as 3/16, and keep it in the file of --store.
    #[arg(long, value_name = "PART/PARTS", requires = "store")]
    pub part: Option<StudyPart>,
    /// The file of the part. If the command was killed, it continues from this file.
    #[arg(long, value_name = "FILE", requires = "part", conflicts_with_all = ["file", "plot"])]
    pub store: Option<PathBuf>,
    /// Put the files of all parts together. The result is that of a run in one piece.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["files", "part", "set"])]
    pub join: Option<Vec<PathBuf>>,
    /// The changes of the scenario.
    #[command(flatten)]
    pub change: ScenarioChange,
    /// Where the result goes, and how.
    #[command(flatten)]
    pub output: Destination,
    /// Also draw a figure to this SVG file. With several input files, a directory.
    #[arg(long, value_name = "FIGURE.svg", value_parser = file_name)]
    pub plot: Option<PathBuf>,
    /// Also write a report to this HTML file. With several input files, a directory.
    #[arg(long, value_name = "REPORT.html", value_parser = file_name, conflicts_with = "store")]
    pub report: Option<PathBuf>,
    /// Print faults, but neither summaries nor warnings.
    #[arg(short, long)]
    pub quiet: bool,
    /// The quantity in the figure of a run: a profile, a history, or the loops.
    #[arg(long, default_value = "worn", requires = "plot",
        value_parser = one_of(&QUANTITIES, |quantity| quantity.name))]
    pub quantity: &'static Quantity,
}

/// A part of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StudyPart {
    /// The number of the part, from 1.
    pub number: usize,
    /// The number of all parts.
    pub of: usize,
}

impl fmt::Display for StudyPart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for StudyPart {
    type Err = &'static str;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let numbers = text.split_once('/').map(|(number, of)| (number.parse(), of.parse()));
        match numbers {
            Some((Ok(number), Ok(of))) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err("expected a part such as 3/16: its number, from 1, and the number of parts"),
        }
    }
}

/// The changes of a scenario.
#[derive(Debug, Args)]
pub struct ScenarioChange {
    /// Change a member of the scenario, such as /friction=0.6 or "/motion/amplitude=3 um"; may be repeated.
    #[arg(long, value_name = "POINTER=VALUE", value_parser = change)]
    pub set: Vec<(String, Value)>,
}

/// Where a result goes, and how.
#[derive(Debug, Args)]
pub struct Destination {
    /// The format: json and npz hold the whole result; csv, ndjson and arrow hold the history, or the table of a study
    /// [default: the suffix of the output file, or json].
    #[arg(long, value_parser = one_of(&Format::ALL, |format| format.name()))]
    pub format: Option<&'static Format>,
    /// Output file, whose suffix names the format, or a directory, which several results need [default: standard output].
    #[arg(short = 'o', long = "output", value_name = "FILE", value_parser = file_name)]
    pub file: Option<PathBuf>,
    /// The units of numbers: si, or um, mm^3, MPa and mJ.
    #[arg(long, value_parser = ["si", "engineering"], default_value = "si")]
    pub units: String,
}

impl Destination {
    /// The format of the result.
    pub fn format(&self) -> Result<Format, String> {
        let Some(file) = self.file.as_deref().filter(|file| !file.is_dir()) else {
            return Ok(self.format.copied().unwrap_or(Format::Json));
        };
        if let Some(format) = self.format {
            return Ok(*format);
        }
        let suffix = file.extension().unwrap_or_default();
        let found = Format::ALL.into_iter().find(|format| suffix == format.name());
        found.ok_or_else(|| {
            let all = Format::ALL.map(|format| format!(".{}", format.name())).join(", ");
            format!(
                "{}: the suffix names no format. End the name with one of {all}",
                file.display()
            )
        })
    }
}

/// Parses POINTER=VALUE. A value that is not JSON is a text, such as 3 um.
fn change(text: &str) -> Result<(String, Value), &'static str> {
    let parts = text.split_once('=').filter(|(pointer, _)| pointer.starts_with('/'));
    let (pointer, value) = parts.ok_or("write POINTER=VALUE, such as /friction=0.6")?;
    let value = serde_json::from_str(value).unwrap_or_else(|_| value.into());
    Ok((pointer.to_owned(), value))
}

/// Parses the name of one of these items.
pub(super) fn one_of<T: Clone + Send + Sync>(
    items: &'static [T],
    name: fn(&T) -> &'static str,
) -> impl TypedValueParser<Value = &'static T> {
    PossibleValuesParser::new(items.iter().map(name)).try_map(move |text| {
        items.iter().find(|item| name(item) == text).ok_or("the name is unknown")
    })
}
