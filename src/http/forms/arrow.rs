//! Tables as Arrow: an IPC file of one record batch, also known as Feather.

use std::collections::HashMap;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float32Array, Float64Array, RecordBatch};
use arrow_ipc::writer::FileWriter;
use arrow_schema::{Field, Schema};

use super::document::Document;
use super::table::Table;
use super::units::fits_single;
use super::{Ask, Error, Sink};

/// A table of the rows that CSV has, with plain names: the unit of a column is in its metadata, key,
/// engine and all units in that of the table. Numbers that are infinite or not defined are null.
pub fn table(
    out: &mut impl Sink,
    document: &Document<'_>,
    table: &Table,
    ask: &Ask,
) -> Result<(), Error> {
    let units = &document.telling.units;
    let mut fields = Vec::new();
    let mut columns = Vec::new();
    for (name, values) in &table.columns {
        let numbers: Vec<f64> =
            table.rows().map(|(instant, place)| values.at(instant, place)).collect();
        let finite = numbers.iter().map(|number| Some(*number).filter(|n| n.is_finite()));
        let column: ArrayRef = if fits_single(ask.digits, &numbers) {
            Arc::new(finite.map(|number| number.map(|n| n as f32)).collect::<Float32Array>())
        } else {
            Arc::new(finite.collect::<Float64Array>())
        };
        let unit = units.of(name).unwrap_or("1").to_owned();
        let about = HashMap::from([("unit".to_owned(), unit)]);
        fields.push(Field::new(name, column.data_type().clone(), true).with_metadata(about));
        columns.push(column);
    }
    let about = HashMap::from([
        ("key".to_owned(), document.key.to_string()),
        ("engine".to_owned(), document.engine.to_string()),
        ("units".to_owned(), serde_json::to_string(units)?),
        ("part".to_owned(), table.part.name().to_owned()),
    ]);
    let schema = Arc::new(Schema::new(fields).with_metadata(about));
    let batch = RecordBatch::try_new(Arc::clone(&schema), columns)?;
    let mut writer = FileWriter::try_new(out, &schema)?;
    writer.write(&batch)?;
    Ok(writer.finish()?)
}
