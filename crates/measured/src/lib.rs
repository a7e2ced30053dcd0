//! Files of measured numbers: tables as instruments and spreadsheets write them, and what fits take from them.
//!
//! A file has lines of text, a row of names and rows of numbers. [`read`] finds the table in it, converts its columns to
//! SI, and tells in notes all that it has done. It never guesses in silence. A profilometer trace becomes wear depths over
//! radii, and a friction loop the energy of a cycle.

mod cell;
mod table;
mod text;
mod trace;

use fretwork_engine::outcome::History;
use fretwork_engine::request::fault::Faults;
use fretwork_engine::request::quantity::Dimension;
use serde::Serialize;
use serde_json::{Value, json};

use table::Table;

pub use table::{Column, MAX_BYTES, MAX_ROWS};

/// What is wanted from a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Wanted<'a> {
    /// The name of the first column, with a unit if the file states none. By default the first column of the file.
    pub x: Option<&'a str>,
    /// The name of the second column. By default the next column of the file.
    pub y: Option<&'a str>,
    /// What becomes of the two columns.
    pub prepare: Prepare,
    /// Whether the tilt of a trace is removed.
    pub level: bool,
    /// Whether the middle of the scar becomes the axis. Otherwise it is where x is 0.
    pub centre: bool,
}

/// What becomes of two columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Prepare {
    /// Points of an output.
    Points,
    /// A profilometer trace across the whole scar becomes a profile.
    Trace,
    /// A trace from the axis outwards becomes a profile.
    Half,
    /// Friction force over displacement in one cycle becomes its energy.
    Loop,
}

impl Prepare {
    /// All of them, with their names.
    pub const ALL: [(&'static str, Self); 4] = [
        ("points", Self::Points),
        ("trace", Self::Trace),
        ("half", Self::Half),
        ("loop", Self::Loop),
    ];
}

/// What was read from a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// The columns of numbers, in SI.
    pub columns: Vec<Column>,
    /// What was made from two columns. Null if the file has only one.
    pub prepared: Value,
    /// What was done, in words.
    pub notes: Vec<String>,
}

/// Reads a file, and prepares two of its columns.
///
/// # Errors
/// Faults of the file have an empty pointer, and those of the wish the pointer `/x`, `/y` or `/prepare`.
pub fn read(bytes: &[u8], wanted: &Wanted<'_>) -> Result<Measured, Faults> {
    let mut table = Table::read(bytes)?;
    let mut faults = Faults::default();
    let x = faults.keep("/x", table.column(0, wanted.x));
    let next =
        x.as_ref().and_then(|x| table.columns.iter().position(|column| column.name != x.name));
    let y = faults.keep("/y", table.column(next.unwrap_or(1), wanted.y));
    let Table { columns, mut notes } = table;
    let (Some(x), Some(y)) = (x, y) else { return Err(faults) };
    if columns.len() > 2 {
        notes.push(format!("x is “{}”, and y is “{}”.", x.name, y.name));
    }
    let dimensions = match wanted.prepare {
        Prepare::Points => None,
        Prepare::Trace | Prepare::Half => Some([Dimension::Length, Dimension::Length]),
        Prepare::Loop => Some([Dimension::Length, Dimension::Force]),
    };
    let needed = dimensions.into_iter().flatten().zip([("x", &x), ("y", &y)]);
    for (dimension, (name, column)) in
        needed.filter(|(it, (_, column))| column.dimension != Some(*it))
    {
        let (needs, si) = (dimension.name(), dimension.si());
        faults.add(
            format!("/{name}"),
            format!("must be {needs}. Add its unit, such as {} [{si}]", column.name),
        );
    }
    faults.or(())?;
    let made = |made: Result<Value, String>| made.map_err(|detail| Faults::one("/prepare", detail));
    let prepared = match wanted.prepare {
        Prepare::Points => json!({"data": points(&x, &y, &mut notes)}),
        Prepare::Trace | Prepare::Half => {
            made(trace::profile((&x.values, &y.values), wanted, &mut notes))?
        }
        Prepare::Loop => made(trace::energy(&x.values, &y.values, &mut notes))?,
    };
    Ok(Measured { columns, prepared, notes })
}

/// Points as the data of a fit. If the name of y is no output, its dimension says which output it is.
fn points(x: &Column, y: &Column, notes: &mut Vec<String>) -> Value {
    let name = History::MEMBERS.iter().map(|member| member.name).find(|name| *name == y.name);
    let output = name.or(match y.dimension {
        Some(Dimension::Volume) => Some("wear_volume"),
        Some(Dimension::Length) => Some("wear_depth"),
        Some(Dimension::Energy) => Some("dissipated_energy"),
        _ => None,
    });
    let over = if x.dimension == Some(Dimension::Energy) { "dissipated_energy" } else { "cycles" };
    if let Some(output) = output.filter(|output| *output != y.name) {
        notes.push(format!("“{}” was taken as the output {output} over {over}.", y.name));
    }
    let known = x.values.iter().zip(&y.values).filter_map(|(x, y)| Some(((*x)?, *y)));
    let (places, values): (Vec<f64>, Vec<Option<f64>>) = known.unzip();
    json!({"output": output.unwrap_or(&y.name), "over": over, "x": places, "y": values})
}
