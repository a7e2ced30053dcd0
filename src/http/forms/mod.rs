//! The forms of a result: the stored document, a part of it or a selection, as JSON, NDJSON, CSV,
//! NPZ or Arrow, and figures of it as SVG.
//!
//! Every form is made from the same numbers: those of the stored document, each read as the nearest
//! float64 and written with the fewest digits that give it back. So equal things are equal in every
//! form, digit by digit in texts and bit by bit in arrays. Where fewer digits are asked for, they are
//! rounded first; arrays are then float32 where that holds them (see [`Ask::digits`]).
//!
//! | form | a part | a whole result |
//! |---|---|---|
//! | JSON | columns, or rows (`records`) | the stored document |
//! | NDJSON, CSV | rows: one per instant, or per instant and place | – |
//! | Arrow | one table of the same rows | – |
//! | differences | as JSON in columns, the matrices as [`differences`] | the document so |
//! | NPZ | one array per column, as in the columns of JSON | one array per column of each part |
//!
//! Each names the key, the engine and the units. A number that is infinite (null in the document) is
//! null in JSON, NDJSON and Arrow, empty in CSV and NaN in NPZ.

mod arrow;
mod csv;
mod differences;
mod document;
mod figure;
mod json;
mod npz;
mod table;
mod units;

use std::io::{self, Write};

use super::format::Format;
use super::problem::Complaint;
use document::Document;

pub use differences::DIGITS;
pub use figure::{LARGEST, LEAST, Look, MOST, QUANTITIES, Quantity};

/// The version of all this. Clients keep what they read for ever: it rises when the same request
/// would be answered by other bytes.
pub const VERSION: u8 = 2;

/// What of a result is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// All of it.
    Whole,
    /// The columns over the instants.
    History,
    /// The matrices over instants and radii.
    Profiles,
    /// The force–displacement loops.
    Loops,
    /// A figure of it.
    Plot,
}

impl Part {
    /// The parts that are tables, in the order of the document.
    pub const TABLES: [Self; 3] = [Self::History, Self::Profiles, Self::Loops];

    /// The word in addresses and documents.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Whole => "result",
            Self::History => "history",
            Self::Profiles => "profiles",
            Self::Loops => "loops",
            Self::Plot => "plot",
        }
    }

    /// The formats there are, the default first.
    #[must_use]
    pub fn formats(self) -> &'static [Format] {
        match self {
            Self::Whole => &[Format::Json, Format::Npz, Format::Differences],
            Self::Plot => &[Format::Svg],
            // It has no matrices.
            Self::History => {
                const {
                    let [json, ndjson, csv, npz, arrow, _] = Format::ALL;
                    &[json, ndjson, csv, npz, arrow]
                }
            }
            Self::Profiles | Self::Loops => &Format::ALL,
        }
    }
}

/// How a result or a part is wanted; by default all of it, as it was computed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Ask {
    /// Rows instead of columns; JSON only.
    pub records: bool,
    /// Significant decimal digits to which all numbers are rounded, 1…17. Up to 7 arrays (NPZ, Arrow)
    /// are float32, whose step of 6e-8 is below that rounding; a column with numbers beyond its range
    /// (below 1.2e-38, such as the last energies of a contact that comes to rest) stays float64.
    /// Of [`Format::Differences`] they are those of the largest number of a matrix: 7 unless told, at
    /// most 12.
    pub digits: Option<u8>,
    /// µm, mm³, MPa and mJ instead of SI.
    pub engineering: bool,
    /// Names of the columns wanted; those that say where a number belongs always come along.
    pub fields: Option<Vec<String>>,
    /// The instants wanted, in cycles. Of a whole result it is the profiles and loops that are cut.
    pub cycles: Option<Vec<f64>>,
    /// How many radii at most, evenly spread from the first to the last.
    pub points: Option<usize>,
    /// Of a figure: what is drawn, and how.
    pub look: Look,
}

impl Ask {
    /// A figure of the usual looks, in engineering units.
    #[must_use]
    pub fn figure(quantity: &'static Quantity) -> Self {
        let look = Look { quantity, ..Look::default() };
        Self { engineering: true, look, ..Self::default() }
    }

    /// The same for everyone who asks for the same.
    #[must_use]
    pub fn in_order(mut self) -> Self {
        if let Some(fields) = &mut self.fields {
            fields.sort_unstable();
            fields.dedup();
        }
        if let Some(cycles) = &mut self.cycles {
            cycles.sort_unstable_by(f64::total_cmp);
            cycles.dedup();
        }
        self
    }
}

/// Why a form cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// What is asked for is not there; one complaint for each field and instant.
    #[error("{}", .0.iter().map(|what| what.detail.as_str()).collect::<Vec<_>>().join("; "))]
    NotThere(Vec<Complaint>),
    /// The stored document does not have the form of a result.
    #[error("the stored document is not a result")]
    Document(#[from] serde_json::Error),
    /// The archive could not be written.
    #[error("the archive cannot be written")]
    Npz(#[from] zip::result::ZipError),
    /// What was written could not be taken.
    #[error("the form cannot be written")]
    Write(#[from] io::Error),
    /// The Arrow file could not be written.
    #[error("the table cannot be written")]
    Arrow(#[from] arrow_schema::ArrowError),
}

/// Where a form is written.
pub trait Sink: Write {
    /// About so many bytes will come, rather fewer.
    fn expect(&mut self, _bytes: usize) {}
}

impl Sink for Vec<u8> {
    /// What is written at once is not moved to ever larger places, and what is not written to takes no
    /// memory.
    fn expect(&mut self, bytes: usize) {
        self.reserve(bytes);
    }
}

/// A stored result, or a part of it, in the form asked for. It takes a while for a large one.
///
/// # Errors
/// [`Error::NotThere`] if a selection names what the result does not have, or a figure needs it. A whole
/// result is no table: [`Part::formats`] says what there is.
pub fn write(stored: &[u8], part: Part, format: Format, ask: &Ask) -> Result<Vec<u8>, Error> {
    let mut out = Vec::new();
    write_to(&mut out, stored, part, format, ask)?;
    out.shrink_to_fit();
    Ok(out)
}

/// Writes it piece by piece, as it is made.
///
/// # Errors
/// As [`write()`].
pub fn write_to(
    out: &mut impl Sink,
    stored: &[u8],
    part: Part,
    format: Format,
    ask: &Ask,
) -> Result<(), Error> {
    if (part, format) == (Part::Whole, Format::Json) && *ask == Ask::default() {
        out.expect(stored.len());
        return Ok(out.write_all(stored)?);
    }
    let usual;
    let ask = match (format, ask.digits) {
        (Format::Differences, None) => {
            usual = Ask { digits: Some(differences::USUAL), ..ask.clone() };
            &usual
        }
        _ => ask,
    };
    let mut document = Document::open(stored, ask)?;
    document.by_differences = format == Format::Differences;
    if part == Part::Plot {
        return Ok(out.write_all(&figure::svg(&document, ask)?)?);
    }
    if part == Part::Whole {
        return match format {
            Format::Npz => Ok(out.write_all(&npz::whole(&document, ask)?)?),
            _ => json::whole(out, &document),
        };
    }
    let table = document.table(part, ask)?;
    match format {
        Format::Json if ask.records => json::records(out, &document, &table),
        Format::Json | Format::Differences => json::columns(out, &document, &table),
        Format::Ndjson => json::lines(out, &document, &table),
        Format::Csv => Ok(csv::table(out, &document, &table, ask)?),
        Format::Npz => Ok(out.write_all(&npz::table(&document, &table, ask)?)?),
        Format::Arrow => arrow::table(out, &document, &table, ask),
        // No table is drawn as it stands.
        Format::Svg => Ok(out.write_all(&figure::svg(&document, ask)?)?),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    const RESULT: &str = r#"{"key":"ab","engine":{"name":"fretwork","numerics":1},
        "scenario":{"friction":0.123456789012},
        "units":{"cycles":"1","wear_volume":"m^3","radius":"m","worn":"m","pressure":"Pa",
                 "displacement":"m","tangential_force":"N","energy_ratio":"1","amplitude":"m"},
        "unworn":{"amplitude":2.25612345e-6},
        "history":{"cycles":[0.0,1000.0],"wear_volume":[0.0,1.2345678e-13]},
        "profiles":{"cycles":[0.0,1000.0],"radius":[0.0,1.0,2.0],"initial":[0.0,1.0,4.0],
                    "limiting":null,"worn":[[0.0,1.0,4.0],[0.1,2.0,5.0]],
                    "pressure":[[null,2.5e9,0.0],[3e8,1.0,0.0]]},
        "loops":{"cycles":[0.0,5.0],"displacement":[[1.0,-1.0],[2.0,-2.0,0.5]],
                 "tangential_force":[[3.0,-3.0],[4.5,-4.0,1.0]],"energy_ratio":[0.1,0.2]},
        "comparison":{"xi":0.8,"history":{"wear_volume":[1e-13]},
                      "errors":{"wear_volume":[0.0625]}},
        "accuracy":{"steps":12345678}}"#;

    fn made(part: Part, format: Format, ask: &Ask) -> String {
        String::from_utf8(write(RESULT.as_bytes(), part, format, ask).unwrap()).unwrap()
    }

    fn value(part: Part, ask: &Ask) -> Value {
        serde_json::from_str(&made(part, Format::Json, ask)).unwrap()
    }

    fn rows(part: Part, ask: &Ask) -> Vec<String> {
        let csv = made(part, Format::Csv, ask);
        csv.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect()
    }

    fn refused(part: Part, ask: &Ask) -> Vec<(String, String)> {
        match write(RESULT.as_bytes(), part, Format::Json, ask) {
            Err(Error::NotThere(complaints)) => {
                let told = |what: Complaint| (what.parameter.unwrap_or_default(), what.detail);
                complaints.into_iter().map(told).collect()
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_history_is_one_row_per_instant() {
        let csv = made(Part::History, Format::Csv, &Ask::default());
        assert!(csv.starts_with("# fretwork history\n# key: ab\n# engine: {\"name\":\"fretwork\""));
        let expected = ["cycles,wear_volume[m^3]", "0.0,0.0", "1000.0,1.2345678e-13"];
        assert_eq!(rows(Part::History, &Ask::default()), expected);
        let lines = made(Part::History, Format::Ndjson, &Ask::default());
        let head = r#"{"key":"ab","engine":"fretwork/1","#;
        let expected = [
            format!("{head}\"cycles\":0.0,\"wear_volume[m^3]\":0.0}}"),
            format!("{head}\"cycles\":1000.0,\"wear_volume[m^3]\":1.2345678e-13}}"),
        ];
        assert_eq!(lines.lines().collect::<Vec<_>>(), expected);
    }

    #[test]
    fn profiles_are_one_row_per_instant_and_radius() {
        let expected = [
            "cycles,radius[m],initial,limiting,worn[m],pressure[Pa]",
            "0.0,0.0,0.0,,0.0,",
            "0.0,1.0,1.0,,1.0,2500000000.0",
            "0.0,2.0,4.0,,4.0,0.0",
            "1000.0,0.0,0.0,,0.1,300000000.0",
            "1000.0,1.0,1.0,,2.0,1.0",
            "1000.0,2.0,4.0,,5.0,0.0",
        ];
        assert_eq!(rows(Part::Profiles, &Ask::default()), expected);
    }

    #[test]
    fn loops_are_one_row_per_instant_and_point() {
        let expected = [
            "cycles,displacement[m],tangential_force[N],energy_ratio",
            "0.0,1.0,3.0,0.1",
            "0.0,-1.0,-3.0,0.1",
            "5.0,2.0,4.5,0.2",
            "5.0,-2.0,-4.0,0.2",
            "5.0,0.5,1.0,0.2",
        ];
        assert_eq!(rows(Part::Loops, &Ask::default()), expected);
        let ratios = Ask { fields: Some(vec!["energy_ratio".into()]), ..Ask::default() };
        assert_eq!(rows(Part::Loops, &ratios), ["cycles,energy_ratio", "0.0,0.1", "5.0,0.2"]);
    }

    #[test]
    fn records_are_the_rows_by_their_names() {
        let ask = Ask { records: true, cycles: Some(vec![0.0]), ..Ask::default() };
        let profiles = value(Part::Profiles, &ask);
        assert_eq!(profiles["records"].as_array().map(Vec::len), Some(3));
        let expected = json!({"cycles": 0.0, "radius": 0.0, "initial": 0.0, "limiting": null,
            "worn": 0.0, "pressure": null});
        assert_eq!(profiles["records"][0], expected);
        assert_eq!(
            (&profiles["key"], &profiles["units"]["pressure"]),
            (&json!("ab"), &json!("Pa"))
        );
    }

    #[test]
    fn differences_are_of_the_matrices_as_they_are_told() {
        let ask = Ask { digits: Some(2), engineering: true, ..Ask::default() };
        let told = |part| -> Value {
            serde_json::from_str(&made(part, Format::Differences, &ask)).unwrap()
        };
        let whole = told(Part::Whole);
        let profiles = &told(Part::Profiles)["profiles"];
        assert_eq!(*profiles, whole["profiles"]);
        // In µm: 0, 1, 4 and 0.1, 2, 5 million.
        let worn = json!({"step": 1e5, "sums": [1, 4], "differences": [[0, 10, 0], [1, 6, -24]]});
        assert_eq!((&profiles["worn"], &profiles["radius"]), (&worn, &json!([0.0, 1e6, 2e6])));
        let pressure = json!({"step": 100.0, "sums": [1, 1],
            "differences": [[0, 25, -25], [3, -28, 25]], "missing": [[0, 0]]});
        assert_eq!(profiles["pressure"], pressure);
        // A row that is longer than those above goes on from 0.
        let force = json!({"step": 0.1, "sums": [1, 1], "differences": [[30, -60], [15, -25, 50]]});
        assert_eq!(told(Part::Loops)["loops"]["tangential_force"], force);
        assert_eq!(whole["history"]["wear_volume"][1], json!(1.2e-4));
    }

    #[test]
    fn a_selection_is_cut_out_of_every_column() {
        let ask = Ask {
            fields: Some(vec!["worn".into(), "radius".into()]),
            cycles: Some(vec![1000.0 * (1.0 + 1e-13)]),
            points: Some(2),
            ..Ask::default()
        };
        let expected = ["cycles,radius[m],worn[m]", "1000.0,0.0,0.1", "1000.0,2.0,5.0"];
        assert_eq!(rows(Part::Profiles, &ask), expected);
        assert_eq!(
            value(Part::Profiles, &ask)["profiles"],
            json!({"cycles": [1e3], "radius": [0.0, 2.0], "worn": [[0.1, 5.0]]})
        );
        let ask = Ask { cycles: Some(vec![1000.0]), ..Ask::default() };
        assert_eq!(value(Part::History, &ask)["history"]["wear_volume"], json!([1.234_567_8e-13]));
    }

    #[test]
    fn what_is_not_there_is_refused_all_at_once_by_naming_what_is() {
        let ask = Ask {
            fields: Some(vec!["warn".into(), "worn".into(), "sleep".into()]),
            cycles: Some(vec![0.0, 7.0]),
            ..Ask::default()
        };
        let told = refused(Part::Profiles, &ask);
        let names: Vec<_> = told.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["fields", "fields", "cycles"]);
        assert!(told[0].1.contains("\"warn\"") && told[0].1.contains("initial, limiting, worn"));
        assert!(told[2].1.contains("at 7 cycles") && told[2].1.ends_with("0, 1000"), "{told:?}");
    }

    #[test]
    fn without_profiles_there_are_the_columns_and_no_rows() {
        let text = r#"{"key":"ab","engine":{"name":"fretwork","numerics":1},
            "units":{"worn":"m"},"history":{},"profiles":null}"#;
        let made = |part, format| {
            let bytes = write(text.as_bytes(), part, format, &Ask::default()).unwrap();
            String::from_utf8(bytes).unwrap()
        };
        let csv = made(Part::Profiles, Format::Csv);
        let names = "cycles,radius,initial,limiting,worn[m],wear,image,pressure,slip";
        assert_eq!(csv.lines().last(), Some(names));
        assert!(made(Part::Profiles, Format::Json).ends_with("\"profiles\":null}"));
        assert!(made(Part::Loops, Format::Json).ends_with("\"loops\":null}"));
        assert_eq!(made(Part::Loops, Format::Ndjson), "");
    }

    #[test]
    fn digits_round_every_number_that_was_found_and_no_other() {
        let ask = Ask { digits: Some(3), ..Ask::default() };
        let whole = value(Part::Whole, &ask);
        assert_eq!(whole["history"]["wear_volume"][1], json!(1.23e-13));
        assert_eq!(whole["unworn"]["amplitude"], json!(2.26e-6));
        assert_eq!(whole["scenario"]["friction"], json!(0.123_456_789_012));
        assert_eq!(whole["accuracy"]["steps"], json!(12_345_678));
        assert_eq!(rows(Part::History, &ask)[2], "1000.0,1.23e-13");
    }

    #[test]
    fn engineering_units_are_named_and_applied_wherever_a_quantity_stands() {
        let ask = Ask { engineering: true, digits: Some(9), ..Ask::default() };
        let whole = value(Part::Whole, &ask);
        assert_eq!(whole["units"]["wear_volume"], "mm^3");
        assert_eq!(whole["history"]["wear_volume"][1], json!(1.234_567_8e-4));
        assert_eq!(whole["unworn"]["amplitude"], json!(2.256_123_45));
        assert_eq!(whole["comparison"]["history"]["wear_volume"][0], json!(1e-4));
        // A relative error has no unit, whatever it is the error of.
        assert_eq!(whole["comparison"]["errors"]["wear_volume"][0], json!(0.0625));
        let head = "cycles,radius[um],initial,limiting,worn[um],pressure[MPa]";
        assert_eq!(rows(Part::Profiles, &ask)[0], head);
        assert_eq!(rows(Part::Profiles, &ask)[2], "0.0,1000000.0,1.0,,1000000.0,2500.0");
    }

    #[test]
    fn a_whole_result_keeps_its_history_where_its_profiles_are_cut() {
        let ask = Ask { cycles: Some(vec![0.0]), points: Some(2), ..Ask::default() };
        let whole = value(Part::Whole, &ask);
        assert_eq!(whole["history"]["cycles"], json!([0.0, 1000.0]));
        assert_eq!(whole["profiles"]["worn"], json!([[0.0, 4.0]]));
        assert_eq!(whole["loops"]["displacement"], json!([[1.0, -1.0]]));
        let names: Vec<_> = whole.as_object().unwrap().keys().cloned().collect();
        let stored: Value = serde_json::from_str(RESULT).unwrap();
        assert_eq!(names, stored.as_object().unwrap().keys().cloned().collect::<Vec<_>>());
        assert_eq!(refused(Part::Whole, &Ask { cycles: Some(vec![9.0]), ..ask }).len(), 1);
    }

    #[test]
    fn the_same_is_written_as_the_same_bytes() {
        for part in Part::TABLES {
            for format in Format::ALL {
                let made = || write(RESULT.as_bytes(), part, format, &Ask::default()).unwrap();
                assert!((0..5).all(|_| made() == made()), "{part:?} {format:?}");
            }
        }
    }
}
