//! Tables as Arrow: an IPC file, also known as Feather.

use std::collections::HashMap;
use std::mem;
use std::sync::Arc;

use arrow_array::{ArrayRef, Float32Array, Float64Array, RecordBatch, StringArray};
use arrow_ipc::writer::FileWriter;
use arrow_schema::{DataType, Field, Schema};

use super::{Head, Out, PartTable, Result, Values, View, fits_single};

/// Rows of a record batch. A large table has several batches, so that only one of them is in memory.
const BATCH: usize = 1 << 16;

/// Writes a table with the rows of CSV.
///
/// Names are plain: the metadata of a column hold its unit, and the metadata of the table hold the key,
/// the engine and all units. Infinite and undefined numbers are null.
pub fn table(out: &mut Out<'_>, head: &Head, table: &PartTable, view: &View) -> Result<()> {
    let single: Vec<bool> = table
        .columns
        .iter()
        .map(|(_, values)| {
            let numbers = table.rows().map(|(cycle, point)| values.at(cycle, point));
            fits_single(view.digits, numbers)
        })
        .collect();
    let field = |((name, values), single): (&(String, Values), &bool)| {
        let kind = match values {
            Values::Texts(_) => DataType::Utf8,
            _ if *single => DataType::Float32,
            _ => DataType::Float64,
        };
        let unit = head.units.of(name).unwrap_or("1").to_owned();
        let metadata = HashMap::from([("unit".to_owned(), unit)]);
        Field::new(name, kind, true).with_metadata(metadata)
    };
    let fields: Vec<Field> = table.columns.iter().zip(&single).map(field).collect();
    let metadata = HashMap::from([
        ("key".to_owned(), head.key.clone()),
        ("engine".to_owned(), head.engine_text.to_string()),
        ("units".to_owned(), serde_json::to_string(&head.units)?),
        ("part".to_owned(), table.part.as_str().to_owned()),
    ]);
    let schema = Arc::new(Schema::new(fields).with_metadata(metadata));
    let mut writer = FileWriter::try_new(out, &schema)?;
    let mut rows = table.rows().peekable();
    let mut is_first = true;
    while mem::take(&mut is_first) || rows.peek().is_some() {
        let batch: Vec<_> = rows.by_ref().take(BATCH).collect();
        let columns = table.columns.iter().zip(&single);
        let columns = columns.map(|((_, values), single)| column(values, &batch, *single));
        writer.write(&RecordBatch::try_new(Arc::clone(&schema), columns.collect())?)?;
    }
    Ok(writer.finish()?)
}

/// The numbers of a column in these rows.
fn column(values: &Values, rows: &[(usize, usize)], single: bool) -> ArrayRef {
    if let Values::Texts(texts) = values {
        let texts = rows.iter().map(|&(cycle, _)| texts.get(cycle).and_then(Option::as_deref));
        return Arc::new(texts.collect::<StringArray>());
    }
    let numbers = rows.iter().map(|&(cycle, point)| values.at(cycle, point));
    let finite = numbers.map(|number| Some(number).filter(|n| n.is_finite()));
    if single {
        Arc::new(finite.map(|number| number.map(|n| n as f32)).collect::<Float32Array>())
    } else {
        Arc::new(finite.collect::<Float64Array>())
    }
}
