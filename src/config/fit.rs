//! The settings of `fit`.

use std::path::PathBuf;

use clap::Args;
use fretwork_measured::{ENDS, Up, ends};

use super::run::one_of;

/// The settings of `fit`.
#[derive(Debug, Args)]
pub struct Fit {
    /// A file with the measured numbers of one test, such as CSV; - reads standard input.
    pub file: PathBuf,
    /// Input file: a job, such as those in examples/, or a scenario alone.
    pub scenario: PathBuf,
    /// The column with the cycles or the dissipated energies, or with the positions of a trace [default: the first].
    #[arg(long, value_name = "COLUMN")]
    pub x: Option<String>,
    /// The column with the measured numbers, such as "wear_volume [mm^3]" [default: the next].
    #[arg(long, value_name = "COLUMN")]
    pub y: Option<String>,
    /// Which table of the file, such as 2 for its second one [default: 1].
    #[arg(long, value_name = "NUMBER")]
    pub table: Option<usize>,
    /// The decimal mark, if 1,000 can be 1 or 1000 [default: the one that the numbers show].
    #[arg(long, value_name = "MARK", value_parser = decimal_mark)]
    pub decimal: Option<char>,
    /// A number of the scenario to fit, such as /friction=0.1..1.5; may be repeated [default: the wear coefficient, and
    /// the friction if the data can tell it].
    #[arg(long, value_name = "POINTER=LOW..HIGH", value_parser = range)]
    pub parameter: Vec<(String, String, String)>,
    /// The standard deviation of the measured numbers, such as "0.3 um" [default: estimated from the residuals].
    #[arg(long)]
    pub sigma: Option<String>,
    /// The standard deviation as a share of each true number, such as 0.05.
    #[arg(long)]
    pub relative: Option<f64>,
    /// The numbers scatter by factors: the logarithms have normal errors, with the standard deviation --relative.
    #[arg(long, conflicts_with = "sigma")]
    pub lognormal: bool,
    /// The density of the worn body in kg/m³, for the output `mass_loss`.
    #[arg(long, value_name = "KG/M^3")]
    pub density: Option<f64>,
    /// The cycles after which a profilometer trace was measured. The file then has this trace across the scar.
    #[arg(long, value_name = "CYCLES")]
    pub at: Option<f64>,
    /// Where the heights of a trace point: out of the material, or into it [default: out].
    #[arg(long, value_name = "WHERE", value_parser = one_of(&Up::ALL, |up| up.as_str()), requires = "at")]
    pub up: Option<&'static Up>,
    /// The ends of the scar in a trace, such as 0.4..1.6mm [default: found].
    #[arg(long, value_name = "FROM..TO", value_parser = scar, requires = "at", allow_hyphen_values = true)]
    pub scar: Option<[f64; 2]>,
    /// Only print the input file of the fit, which POST /v1/jobs takes.
    #[arg(long)]
    pub print: bool,
}

/// Parses the ends of a scar.
fn scar(text: &str) -> Result<[f64; 2], String> {
    ends(text).ok_or_else(|| format!("write {ENDS}"))
}

/// Parses a decimal mark.
fn decimal_mark(text: &str) -> Result<char, &'static str> {
    let mark = text.parse().ok().filter(|mark| ['.', ','].contains(mark));
    mark.ok_or("expected . or ,")
}

/// Parses a range of a number of the scenario.
fn range(text: &str) -> Result<(String, String, String), &'static str> {
    let parts =
        text.split_once('=').and_then(|(name, range)| Some((name, range.split_once("..")?)));
    let (name, (low, high)) = parts.ok_or("write POINTER=LOW..HIGH, such as /friction=0.1..1.5")?;
    Ok((name.to_owned(), low.to_owned(), high.to_owned()))
}
