//! Tables as Arrow: an IPC file with one record batch, also known as Feather.

use std::collections::HashMap;
use std::io::Write;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float32Array, Float64Array, RecordBatch};
use arrow_ipc::writer::FileWriter;
use arrow_schema::{Field, Schema};

use super::document::Document;
use super::error::Error;
use super::table::Table;
use super::units::fits_single;
use super::view::View;

/// Writes a table with the rows of CSV.
///
/// Names are plain: the metadata of a column hold its unit, and the metadata of the table hold the key,
/// the engine and all units. Infinite and undefined numbers are null.
pub fn table(
    out: &mut impl Write,
    document: &Document<'_>,
    table: &Table,
    view: &View,
) -> Result<(), Error> {
    let units = &document.units;
    let mut fields = Vec::new();
    let mut columns = Vec::new();
    for (name, values) in &table.columns {
        let numbers: Vec<f64> =
            table.rows().map(|(cycle, point)| values.at(cycle, point)).collect();
        let finite = numbers.iter().map(|number| Some(*number).filter(|n| n.is_finite()));
        let column: ArrayRef = if fits_single(view.digits, &numbers) {
            Arc::new(finite.map(|number| number.map(|n| n as f32)).collect::<Float32Array>())
        } else {
            Arc::new(finite.collect::<Float64Array>())
        };
        let unit = units.of(name).unwrap_or("1").to_owned();
        let metadata = HashMap::from([("unit".to_owned(), unit)]);
        fields.push(Field::new(name, column.data_type().clone(), true).with_metadata(metadata));
        columns.push(column);
    }
    let metadata = HashMap::from([
        ("key".to_owned(), document.key.clone()),
        ("engine".to_owned(), document.engine_text.to_string()),
        ("units".to_owned(), serde_json::to_string(units)?),
        ("part".to_owned(), table.part.name().to_owned()),
    ]);
    let schema = Arc::new(Schema::new(fields).with_metadata(metadata));
    let batch = RecordBatch::try_new(Arc::clone(&schema), columns)?;
    let mut writer = FileWriter::try_new(out, &schema)?;
    writer.write(&batch)?;
    Ok(writer.finish()?)
}
