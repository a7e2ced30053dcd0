//! Files of measured numbers: tables as instruments and spreadsheets write them, and what fits take from them.
//!
//! A file has lines of text, a row of names and rows of numbers. [`read`] finds the table in it, converts its columns to
//! SI, and tells in notes all that it has done. It never guesses in silence. A profilometer trace becomes wear depths over
//! radii, and a friction loop the energy of a cycle.

mod cell;
mod table;
mod text;
mod trace;

use fretwork_engine::outcome::{History, Quantity};
use fretwork_engine::request::fault::Faults;
use fretwork_engine::request::quantity::Dimension;
use serde::Serialize;
use serde_json::{Value, json};

use cell::{MASSES, unit};
use table::Table;

pub use table::{Column, MAX_ROWS};
pub use trace::{ENDS, Prepare, Up, Wanted, ends};

/// The output that is the wear volume times a density.
const MASS_LOSS: &str = "mass_loss";

/// What was read from a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// The columns of numbers, in SI.
    pub columns: Vec<Column>,
    /// What was made from two columns.
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
    let (of_x, of_y) = match wanted.prepare {
        Prepare::Points => (None, None),
        Prepare::Trace | Prepare::Half => (Some(Dimension::Length), Some(Dimension::Length)),
        Prepare::Loop => (Some(Dimension::Length), Some(Dimension::Force)),
    };
    let mut faults = Faults::default();
    let x = faults.keep("/x", table.column(0, wanted.x, of_x));
    let is_next = |column: &Column| x.as_ref().is_some_and(|x| column.name != x.name);
    let next = table.columns.iter().position(is_next).unwrap_or(1);
    let y = faults.keep("/y", table.column(next, wanted.y, of_y));
    let (Some(x), Some(y)) = (x, y) else { return Err(faults) };
    let Table { columns, mut notes } = table;
    notes.push(format!("x is “{}”, and y is “{}”.", x.name, y.name));
    let prepared = match wanted.prepare {
        Prepare::Points => Ok(points(&x, &y, &mut notes)?),
        Prepare::Loop => trace::energy(&x.values, &y.values, &mut notes),
        _ => trace::profile((&x.values, &y.values), wanted, &mut notes),
    };
    let prepared = prepared.map_err(|detail| Faults::one("/prepare", detail))?;
    Ok(Measured { columns, prepared, notes })
}

/// Points as the data of a fit. The unit of y says which output it is, unless its name is that of an output. The data are
/// null if x is neither a number of cycles nor an energy, or if the unit of y is unknown.
fn points(x: &Column, y: &Column, notes: &mut Vec<String>) -> Result<Value, Faults> {
    let is_output = y.name == MASS_LOSS || History::MEMBERS.iter().any(|it| it.name == y.name);
    let output = match y.unit.as_deref() {
        _ if is_output => &*y.name,
        Some("m^3") => "wear_volume",
        Some("m") => "wear_depth",
        Some("kg") => MASS_LOSS,
        _ => &*y.name,
    };
    let needed = Quantity::named(output).map_or("kg", |quantity| quantity.unit);
    let own = y.unit.as_deref().unwrap_or(needed);
    if is_output && own != needed {
        let other = if needed == "kg" { MASSES.map(|it| it.0).join(", ") } else { "1".into() };
        let dimension = Dimension::ALL.into_iter().find(|it| it.si() == needed);
        let accepted = dimension.map_or(other, Dimension::accepted);
        let detail = format!(
            "is the output {output} in the unit {own}. Accepted units: {accepted}. Convert the numbers to one of them"
        );
        return Err(Faults::one("/y", detail));
    }
    let is_over = x.unit.as_ref().is_none_or(|unit| ["1", "J"].contains(&&**unit));
    if !is_over || y.unit.as_ref().is_some_and(|own| unit(own).is_none()) {
        notes.push(
            "There are no data for a fit: x must be cycles or an energy, and y needs a known unit."
                .to_owned(),
        );
        return Ok(json!({"data": null}));
    }
    let is_energy = x.dimension == Some(Dimension::Energy) || x.name == "dissipated_energy";
    let over = if is_energy { "dissipated_energy" } else { "cycles" };
    notes.push(format!("y was taken as the output {output} over {over}, in {own}."));
    let known = x.values.iter().zip(&y.values).filter_map(|(x, y)| Some(((*x)?, *y)));
    let (x, y): (Vec<f64>, Vec<Option<f64>>) = known.unzip();
    Ok(json!({"data": {"output": output, "over": over, "x": x, "y": y}}))
}
