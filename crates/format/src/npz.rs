//! Results as NPZ, the archive of arrays that NumPy writes and reads (`numpy.load`), without pickle.
//!
//! An archive is a ZIP file with one NPY file per array: a header with type and shape, then the numbers.
//! Loops can have different numbers of points. NaN fills the shorter rows.

use std::io::Write;
use std::iter;

use zip::write::{SimpleFileOptions, StreamWriter};
use zip::{CompressionMethod, ZipWriter};

use super::document::Member;
use super::{Head, Object, Out, PartTable, Result, Values, View, fits_single};

/// Writes a table: one array per column under its name, and `meta` with key, engine and units as JSON.
pub fn table(out: &mut Out<'_>, head: &Head, table: &PartTable, view: &View) -> Result<()> {
    let mut archive = Archive::new(out, view);
    let meta = serde_json::json!({
        "key": head.key, "engine": head.engine_text, "units": head.units,
    });
    archive.text("meta", &meta.to_string())?;
    archive.table("", table)?;
    archive.finish()
}

/// Writes a whole result: the columns of each table under names such as `history/wear_volume`, and
/// `meta` with everything else as JSON.
pub fn whole(out: &mut Out<'_>, mut object: Object, view: &View) -> Result<()> {
    let mut archive = Archive::new(out, view);
    let tables = object.0.extract_if(.., |(_, member)| matches!(member, Member::Table(_)));
    let tables: Vec<_> = tables.collect();
    archive.text("meta", &serde_json::to_string(&object)?)?;
    for (name, member) in tables {
        if let Member::Table(table) = member {
            archive.table(&format!("{name}/"), &table)?;
        }
    }
    archive.finish()
}

struct Archive<'a, 'out> {
    zip: ZipWriter<StreamWriter<&'a mut Out<'out>>>,
    view: &'a View,
}

impl<'a, 'out> Archive<'a, 'out> {
    fn new(out: &'a mut Out<'out>, view: &'a View) -> Self {
        Self { zip: ZipWriter::new_stream(out), view }
    }

    fn array(&mut self, name: &str, kind: &str, shape: &[usize], data: &[u8]) -> Result<()> {
        // The default timestamp is constant, so equal results give equal bytes.
        let options = SimpleFileOptions::default().compression_method(CompressionMethod::Deflated);
        self.zip.start_file(format!("{name}.npy"), options)?;
        self.zip.write_all(&header(kind, shape))?;
        self.zip.write_all(data)?;
        Ok(())
    }

    fn text(&mut self, name: &str, text: &str) -> Result<()> {
        let letters: Vec<u8> = text.chars().flat_map(|c| u32::from(c).to_le_bytes()).collect();
        self.array(name, &format!("<U{}", letters.len() / 4), &[], &letters)
    }

    /// Texts in an array of equal length; an absent text is empty.
    fn texts(&mut self, name: &str, texts: &[Option<String>]) -> Result<()> {
        let texts = || texts.iter().map(|text| text.as_deref().unwrap_or_default());
        let longest = texts().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
        let letters = texts().flat_map(|text| text.chars().chain(iter::repeat('\0')).take(longest));
        let data: Vec<u8> = letters.flat_map(|c| u32::from(c).to_le_bytes()).collect();
        self.array(name, &format!("<U{longest}"), &[texts().count()], &data)
    }

    fn table(&mut self, prefix: &str, table: &PartTable) -> Result<()> {
        let points = table.points();
        for (name, values) in &table.columns {
            // A file name in an archive has no slash at its start.
            let name = format!("{prefix}{}", name.strip_prefix('/').unwrap_or(name));
            let (shape, numbers) = match values {
                Values::Texts(texts) => {
                    self.texts(&name, texts)?;
                    continue;
                }
                Values::Cycles(row) | Values::Points(row) => (vec![row.len()], row.clone()),
                Values::Matrix(rows) => {
                    let padding = iter::repeat(f64::NAN);
                    let padded = rows
                        .iter()
                        .flat_map(|row| row.iter().copied().chain(padding.clone()).take(points));
                    (vec![rows.len(), points], padded.collect())
                }
                Values::Absent => (vec![points], vec![f64::NAN; points]),
            };
            if fits_single(self.view.digits, numbers.iter().copied()) {
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

    fn finish(self) -> Result<()> {
        Ok(self.zip.finish().map(drop)?)
    }
}

/// The header of an NPY file, version 1.0, padded so that the numbers start at a multiple of 64 bytes.
fn header(kind: &str, shape: &[usize]) -> Vec<u8> {
    const FIXED: usize = 10;
    let sizes: Vec<_> = shape.iter().map(usize::to_string).collect();
    // A Python tuple with one item ends with a comma.
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
    fn an_array_header_equals_the_one_that_numpy_writes() {
        let shape = [2, 3];
        let header = header("<f8", &shape);
        assert_eq!(header.len(), 128);
        let text = std::str::from_utf8(&header[10..]).unwrap();
        let expected = "{'descr': '<f8', 'fortran_order': False, 'shape': (2, 3), }";
        assert_eq!(text.trim_end(), expected);
        assert!(text.ends_with(" \n"));
        assert_eq!(header[..10], *b"\x93NUMPY\x01\x00\x76\x00");
    }
}
