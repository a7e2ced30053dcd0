//! Tables as Arrow: an [IPC file](https://arrow.apache.org/docs/format/Columnar.html#ipc-file-format), also known as Feather.
//!
//! `arrow_format` has the messages of the format. This module writes them to a file, with the columns between them.

use std::io::{self, ErrorKind, Write as _};
use std::mem;

use arrow_format::ipc::planus::{Builder, WriteAsOffset};
use arrow_format::ipc::{
    Block, Buffer, Endianness, Field, FieldNode, FloatingPoint, Footer, KeyValue, Message,
    MessageHeader, MetadataVersion, Precision, RecordBatch, Schema, Type, Utf8,
};

use super::{Head, Out, PartTable, Result, Values, View, fits_single};

/// Rows of a record batch. A large table has several batches, so that only one of them is in memory.
const BATCH: usize = 1 << 16;
/// The first and the last bytes of a file.
const MAGIC: &[u8; 6] = b"ARROW1";
/// What stands before the length of a message.
const CONTINUATION: [u8; 4] = [0xff; 4];
/// Bodies of messages, and the buffers in them, begin at multiples of this number of bytes.
const ALIGNMENT: usize = 64;

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
    let fields = table.columns.iter().zip(&single).map(|((name, values), single)| {
        let unit = head.units.of(name).unwrap_or("1");
        Field {
            name: Some(name.clone()),
            nullable: true,
            type_: Some(match values {
                Values::Texts(_) => Type::Utf8(Box::new(Utf8 {})),
                _ if *single => floats(Precision::Single),
                _ => floats(Precision::Double),
            }),
            dictionary: None,
            children: Some(Vec::new()),
            custom_metadata: Some(vec![pair("unit", unit)]),
        }
    });
    let schema = Box::new(Schema {
        endianness: Endianness::Little,
        fields: Some(fields.collect()),
        custom_metadata: Some(vec![
            pair("key", &head.key),
            pair("engine", head.engine_text.get()),
            pair("units", &serde_json::to_string(&head.units)?),
            pair("part", table.part.as_str()),
        ]),
        features: None,
    });
    out.write_all(MAGIC)?;
    out.write_all(&[0; 2])?;
    let mut position = MAGIC.len() + 2;
    message(out, &mut position, MessageHeader::Schema(schema.clone()), &[])?;
    let mut batches = Vec::new();
    let mut rows = table.rows().peekable();
    let mut is_first = true;
    while mem::take(&mut is_first) || rows.peek().is_some() {
        let rows: Vec<_> = rows.by_ref().take(BATCH).collect();
        let mut columns = Columns::default();
        for ((_, values), single) in table.columns.iter().zip(&single) {
            columns.add(values, &rows, *single)?;
        }
        let header = MessageHeader::RecordBatch(Box::new(RecordBatch {
            length: signed(rows.len()),
            nodes: Some(columns.nodes),
            buffers: Some(columns.buffers),
            compression: None,
            variadic_buffer_counts: None,
        }));
        batches.push(message(out, &mut position, header, &columns.body)?);
    }
    out.write_all(&CONTINUATION)?;
    out.write_all(&[0; 4])?;
    let footer = serialized(Footer {
        version: MetadataVersion::V5,
        schema: Some(schema),
        dictionaries: Some(Vec::new()),
        record_batches: Some(batches),
        custom_metadata: None,
    });
    out.write_all(&footer)?;
    out.write_all(&(footer.len() as u32).to_le_bytes())?;
    Ok(out.write_all(MAGIC)?)
}

fn floats(precision: Precision) -> Type {
    Type::FloatingPoint(Box::new(FloatingPoint { precision }))
}

fn pair(key: &str, value: &str) -> KeyValue {
    KeyValue { key: Some(key.to_owned()), value: Some(value.to_owned()) }
}

fn signed(number: usize) -> i64 {
    (number as u64).cast_signed()
}

fn serialized<T>(table: impl WriteAsOffset<T>) -> Vec<u8> {
    Builder::new().finish(table, None).to_vec()
}

/// Writes a message at this position of the file, and returns where it is.
fn message(
    out: &mut Out<'_>,
    position: &mut usize,
    header: MessageHeader,
    body: &[u8],
) -> Result<Block> {
    let body_length = signed(body.len());
    let header = serialized(Message {
        version: MetadataVersion::V5,
        header: Some(header),
        body_length,
        custom_metadata: None,
    });
    let start = *position;
    let header_start = start + CONTINUATION.len() + mem::size_of::<u32>();
    let header_end = header_start + header.len();
    let body_start = header_end.next_multiple_of(ALIGNMENT);
    out.write_all(&CONTINUATION)?;
    out.write_all(&((body_start - header_start) as u32).to_le_bytes())?;
    out.write_all(&header)?;
    out.write_all(&[0; ALIGNMENT][..body_start - header_end])?;
    out.write_all(body)?;
    *position = body_start + body.len();
    let meta_data_length = ((body_start - start) as u32).cast_signed();
    Ok(Block { offset: signed(start), meta_data_length, body_length })
}

/// The columns of a record batch.
#[derive(Default)]
struct Columns {
    nodes: Vec<FieldNode>,
    buffers: Vec<Buffer>,
    body: Vec<u8>,
}

impl Columns {
    /// Adds the values of a column in these rows.
    fn add(&mut self, values: &Values, rows: &[(usize, usize)], single: bool) -> Result<()> {
        if let Values::Texts(texts) = values {
            let texts = rows.iter().map(|&(cycle, _)| texts.get(cycle).and_then(Option::as_deref));
            self.add_validity(&texts.clone().map(|text| text.is_some()).collect::<Vec<_>>());
            let texts = texts.map(Option::unwrap_or_default);
            let mut ends = vec![0];
            for text in texts.clone() {
                let end = ends[ends.len() - 1] + text.len();
                ends.push(end);
            }
            i32::try_from(ends[rows.len()])
                .map_err(|_| io::Error::from(ErrorKind::FileTooLarge))?;
            self.add_buffer(ends.into_iter().map(|end| (end as u32).to_le_bytes()));
            self.add_buffer(texts);
            return Ok(());
        }
        let numbers = rows.iter().map(|&(cycle, point)| values.at(cycle, point));
        self.add_validity(&numbers.clone().map(f64::is_finite).collect::<Vec<_>>());
        let finite = numbers.map(|number| if number.is_finite() { number } else { 0.0 });
        if single {
            self.add_buffer(finite.map(|number| (number as f32).to_le_bytes()));
        } else {
            self.add_buffer(finite.map(f64::to_le_bytes));
        }
        Ok(())
    }

    /// Begins a column, with a bit for each row that is not null.
    fn add_validity(&mut self, rows: &[bool]) {
        let nulls = rows.iter().filter(|is_valid| !**is_valid).count();
        self.nodes.push(FieldNode { length: signed(rows.len()), null_count: signed(nulls) });
        let byte = |bits: &[bool]| {
            [bits.iter().rev().fold(0_u8, |byte, is_valid| byte << 1 | u8::from(*is_valid))]
        };
        // Without nulls, the bits can be left out.
        let rows = if nulls == 0 { &[] } else { rows };
        self.add_buffer(rows.chunks(8).map(byte));
    }

    fn add_buffer(&mut self, items: impl Iterator<Item: AsRef<[u8]>>) {
        let start = self.body.len();
        items.for_each(|item| self.body.extend_from_slice(item.as_ref()));
        let length = signed(self.body.len() - start);
        self.buffers.push(Buffer { offset: signed(start), length });
        self.body.resize(self.body.len().next_multiple_of(ALIGNMENT), 0);
    }
}
