//! Files of measured numbers: tables as instruments and spreadsheets write them, and what fits take from them.
//!
//! A file has lines of text, a row of names and rows of numbers. [`read`] finds the table in it, converts its columns to
//! SI, and tells in notes all that it has done. It never guesses in silence. A profilometer trace becomes wear depths over
//! radii, and a friction loop the energy of a cycle.

mod cell;
mod curve;
mod lines;
mod loops;
mod names;
mod notes;
mod record;
mod table;
mod text;
mod trace;
mod units;

use fretwork_engine::input::fault::Faults;
use fretwork_engine::input::quantity::Dimension;
use fretwork_engine::outcome::{History, Quantity};
use serde::Serialize;
use serde_json::{Value, json};

use names::{is_increment, is_index};
use notes::Notes;
use table::{SIGMA, Table};
use units::{MASSES, unit};

pub use lines::MAX_ROWS;
pub use table::Column;
pub use text::marked;
pub use trace::{ENDS, Prepare, Up, Wanted, ends};

/// The output that is the wear volume times a density.
const MASS_LOSS: &str = "mass_loss";

/// The units of y that say which output it is, and units that people use for it.
const OUTPUTS: [(&str, &str, &str); 3] =
    [("m^3", "wear_volume", "mm^3"), ("m", "wear_depth", "um"), ("kg", MASS_LOSS, "mg")];

/// What was read from a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measured {
    /// The columns of numbers, in SI.
    pub columns: Vec<Column>,
    /// The first line and the number of rows of each table in the file.
    pub tables: Vec<[usize; 2]>,
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
    let mut table = Table::read(bytes, wanted.table.unwrap_or(1), wanted.decimal)?;
    let of_x = (wanted.prepare != Prepare::Points).then_some(Dimension::Length);
    let is_loop = wanted.prepare == Prepare::Loop;
    let of_y = if is_loop { Some(Dimension::Force) } else { of_x };
    if is_loop {
        table.weigh();
    }
    let mut faults = Faults::default();
    let least = if of_x == of_y { 2 } else { 1 };
    let x = faults.keep("/x", table.column(None, wanted.x, (of_x, least)));
    let first = table.columns.first().map(|column| column.name.clone());
    let taken = x.as_ref().map(|x| x.name.clone()).or(first);
    let y = faults.keep("/y", table.column(taken.as_deref(), wanted.y, (of_y, least)));
    let (Some(x), Some(y)) = (x, y) else { return Err(faults) };
    let Table { columns, mut notes, all: tables } = table;
    notes.push(format!("x is “{}”, and y is “{}”.", x.name, y.name));
    let sigma = format!("{}{SIGMA}", y.name);
    let others =
        columns.iter().map(|it| &*it.name).filter(|it| ![&*x.name, &y.name, &sigma].contains(it));
    let others = others.collect::<Vec<_>>().join("”, “");
    if !others.is_empty() {
        let errors = format!(" Name standard deviations of y “{sigma}”.");
        let errors = if wanted.prepare == Prepare::Points { &*errors } else { "" };
        notes.push(format!("Columns that were not used: “{others}”.{errors}"));
    }
    let rows = x.values.iter().zip(&y.values).filter_map(|(x, y)| Some(((*x)?, (*y)?)));
    let rows: Vec<(f64, f64)> = rows.collect();
    let prepared = match wanted.prepare {
        Prepare::Points => {
            let sigma = columns.iter().find(|column| column.name == sigma);
            let sigma = sigma.and_then(|sigma| sigma.errors_of(&y, &mut notes));
            Ok(points(&x, &y, sigma.as_ref(), &mut notes)?)
        }
        Prepare::Loop => loops::loops(rows, &mut notes),
        _ => trace::profile(rows, wanted, &mut notes),
    };
    let prepared = prepared.map_err(|detail| Faults::one("/prepare", detail))?;
    Ok(Measured { columns, tables, prepared, notes })
}

/// Points as the data of a fit. The unit of y says which output it is, unless its name is that of an output. The data are
/// null if x is neither a number of cycles nor an energy, or if the unit of y is unknown or missing.
fn points(
    x: &Column,
    y: &Column,
    sigma: Option<&Column>,
    notes: &mut Notes,
) -> Result<Value, Faults> {
    let name = &y.name;
    if is_increment(name) {
        let detail = "has the increments between readings, as its name says. Add them up: a fit needs the total at each reading. If its numbers are totals, change its name";
        return Err(Faults::one("/y", detail));
    }
    let is_output = name == MASS_LOSS || History::MEMBERS.iter().any(|it| it.name == name);
    let by_unit = OUTPUTS.iter().find(|it| y.unit.as_deref() == Some(it.0) && !is_output);
    let output = by_unit.map_or(&**name, |it| it.1);
    let needed = Quantity::named(output).map_or("kg", |quantity| quantity.unit);
    let own = y.unit.as_deref().or((is_output && needed == "1").then_some("1"));
    if let Some(own) = own.filter(|own| is_output && *own != needed) {
        let other = if needed == "kg" { MASSES.map(|it| it.0).join(", ") } else { "1".into() };
        let dimension = Dimension::all().find(|it| it.si() == needed);
        let accepted = dimension.map_or(other, Dimension::accepted);
        let detail = format!(
            "is the output {output} in the unit {own}. Accepted units: {accepted}. Convert the numbers to one of them"
        );
        return Err(Faults::one("/y", detail));
    }
    let mut without = |why: String| {
        notes.push(why);
        Ok(json!({"data": null}))
    };
    let Some(own) = own else {
        let example = OUTPUTS.iter().find(|it| it.0 == needed).map_or(needed, |it| it.2);
        let examples = if is_output {
            format!("{name} [{example}]")
        } else {
            format!("{name} [mm^3] for volumes, {name} [um] for depths, or {name} [mg] for masses")
        };
        return without(format!(
            "“{name}” has no unit, so there are no data for a fit. Write the unit into the row of names, or choose the column \
             with its unit as y: {examples}."
        ));
    };
    let is_plain = x.unit.as_ref().is_none_or(|unit| ["1", "J"].contains(&&**unit));
    if !is_plain || is_index(&x.name) || unit(own).is_none() {
        let why =
            "There are no data for a fit: x must be cycles or an energy, and y needs a known unit.";
        return without(why.to_owned());
    }
    let is_energy = x.dimension == Some(Dimension::Energy) || x.name == "dissipated_energy";
    let over = if is_energy { "dissipated_energy" } else { "cycles" };
    notes.push(format!("y was taken as the output {output} over {over}, in {own}."));
    let known = |column: &Column| -> Value {
        let rows = x.values.iter().zip(&column.values).filter(|(x, _)| x.is_some());
        rows.map(|(_, value)| *value).collect()
    };
    let mut data = json!({"output": output, "over": over, "x": known(x), "y": known(y)});
    if let Some(sigma) = sigma {
        data["sigma"] = known(sigma);
    }
    Ok(json!({"data": data}))
}
