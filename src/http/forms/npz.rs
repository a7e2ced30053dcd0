//! Results as NPZ, the archive of arrays that NumPy writes and reads (`numpy.load`), without pickle.
//!
//! An archive is a ZIP file with one NPY file per array: a line of Python that tells type and shape,
//! and the numbers. Loops differ in their number of points; the shorter ones end in NaN.

use std::io::{Cursor, Write};
use std::iter;

use serde::Serializer as _;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use super::document::{Document, Told};
use super::table::{Table, Values};
use super::units::fits_single;
use super::{Ask, Error};

/// A table: one array per column under its name, and `meta`: key, engine and units as JSON.
pub fn table(document: &Document<'_>, table: &Table, ask: &Ask) -> Result<Vec<u8>, Error> {
    let mut archive = Archive::new(ask);
    let meta = serde_json::json!({
        "key": document.key, "engine": document.engine, "units": document.telling.units,
    });
    archive.text("meta", &meta.to_string())?;
    archive.table("", table)?;
    archive.finish()
}

/// A whole result: the columns of each table under names such as `history/wear_volume`, and `meta`:
/// everything else as JSON.
pub fn whole(document: &Document<'_>, ask: &Ask) -> Result<Vec<u8>, Error> {
    let mut archive = Archive::new(ask);
    let (tables, others): (Vec<_>, Vec<_>) =
        document.members()?.into_iter().partition(|(_, told)| matches!(told, Told::Table(_)));
    let mut meta = Vec::new();
    serde_json::Serializer::new(&mut meta).collect_map(others)?;
    archive.text("meta", &String::from_utf8_lossy(&meta))?;
    for (name, told) in tables {
        if let Told::Table(table) = told {
            archive.table(&format!("{name}/"), &table)?;
        }
    }
    archive.finish()
}

struct Archive<'a> {
    zip: ZipWriter<Cursor<Vec<u8>>>,
    ask: &'a Ask,
}

impl<'a> Archive<'a> {
    fn new(ask: &'a Ask) -> Self {
        Self { zip: ZipWriter::new(Cursor::new(Vec::new())), ask }
    }

    fn array(&mut self, name: &str, kind: &str, shape: &[usize], data: &[u8]) -> Result<(), Error> {
        // The time in it is always the same: the same result makes the same bytes.
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
        self.zip.start_file(format!("{name}.npy"), options)?;
        self.zip.write_all(&head(kind, shape))?;
        self.zip.write_all(data)?;
        Ok(())
    }

    fn text(&mut self, name: &str, text: &str) -> Result<(), Error> {
        let letters: Vec<u8> = text.chars().flat_map(|c| u32::from(c).to_le_bytes()).collect();
        self.array(name, &format!("<U{}", letters.len() / 4), &[], &letters)
    }

    fn table(&mut self, prefix: &str, table: &Table) -> Result<(), Error> {
        let places = table.places();
        for (name, values) in &table.columns {
            let (shape, numbers) = match values {
                Values::Instants(row) | Values::Places(row) => (vec![row.len()], row.clone()),
                Values::Both(rows) => {
                    let padding = iter::repeat(f64::NAN);
                    let padded = rows
                        .iter()
                        .flat_map(|row| row.iter().copied().chain(padding.clone()).take(places));
                    (vec![rows.len(), places], padded.collect())
                }
                Values::Absent => (vec![places], vec![f64::NAN; places]),
            };
            let name = format!("{prefix}{name}");
            if fits_single(self.ask.digits, &numbers) {
                let data: Vec<u8> =
                    numbers.iter().flat_map(|number| (*number as f32).to_le_bytes()).collect();
                self.array(&name, "<f4", &shape, &data)?;
            } else {
                let data: Vec<u8> =
                    numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
                self.array(&name, "<f8", &shape, &data)?;
            }
        }
        Ok(())
    }

    fn finish(self) -> Result<Vec<u8>, Error> {
        Ok(self.zip.finish()?.into_inner())
    }
}

/// What an NPY file of version 1.0 begins with; the numbers after it are aligned to 64 bytes.
fn head(kind: &str, shape: &[usize]) -> Vec<u8> {
    const FIXED: usize = 10;
    let sizes: Vec<_> = shape.iter().map(usize::to_string).collect();
    // In Python a tuple of one ends in a comma.
    let sizes = sizes.join(", ") + if shape.len() == 1 { "," } else { "" };
    let mut text = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({sizes}), }}");
    let full = (FIXED + text.len() + 1).next_multiple_of(64);
    text.push_str(&" ".repeat(full - FIXED - text.len() - 1));
    text.push('\n');
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((text.len() as u16).to_le_bytes());
    out.extend(text.as_bytes());
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_head_of_an_array_is_as_numpy_writes_it() {
        let shape = [2, 3];
        let head = head("<f8", &shape);
        assert_eq!(head.len(), 128);
        let text = std::str::from_utf8(&head[10..]).unwrap();
        let said = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }";
        assert_eq!(text.trim_end(), said);
        assert!(text.ends_with(" \n"));
        assert_eq!(head[..10], *b"\x93NUMPY\x01\x00\x76\x00");
    }
}
