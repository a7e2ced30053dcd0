//! A result as JSON, NDJSON, CSV, NPZ, Arrow or SVG.
//!
//! All formats are written from the numbers of the stored document. Each number is read as the nearest
//! float64 and written with the fewest digits that give this float64 back. Equal numbers are therefore
//! equal in every format: digit by digit in texts, bit by bit in arrays. If a client requests fewer
//! digits, the numbers are rounded first, and arrays are float32 where possible (see [`View::digits`]).
//!
//! | format | a table | a whole result |
//! |---|---|---|
//! | JSON | columns, or rows (`records`) | the stored document |
//! | NDJSON, CSV | rows: one per output cycle, or per output cycle and point | – |
//! | Arrow | a table of the same rows | – |
//! | NPZ | one array per column, as in the columns of JSON | one array per column of each table |
//!
//! Every format contains the key, the engine and the units. A number that is infinite (null in the
//! document) is null in JSON, NDJSON and Arrow, empty in CSV and NaN in NPZ.

mod arrow;
mod csv;
mod document;
mod error;
mod figure;
mod json;
mod kind;
mod law;
pub mod notation;
mod npz;
mod out;
mod quantity;
pub mod report;
mod statistics;
mod table;
mod units;
mod view;

use std::io::Write;

pub use csv::text_cell;
use document::{Document, Head, Object};
pub use error::{Error, Missing};
use error::{Result, refuse_if_any};
pub use fretwork_plot::text::escape;
pub use fretwork_study::StudyFigure;
pub use kind::{Format, Part};
pub use law::{Verdict, is_in_verdict};
use notation::{Notation, digits, typeset};
use out::Out;
pub use quantity::{QUANTITIES, Quantity};
use table::{PartTable, Values, evenly_spaced};
use units::{Units, fits_single};
pub use units::{in_engineering, round};
pub use view::{FigureOptions, StudyOptions, View};

/// The version of the formats. Clients may cache answers for ever, so increase the version when the same
/// request gives other bytes.
pub const VERSION: u8 = 8;

/// Writes a stored result, or a part of it. Large results take seconds. The stored bytes are dropped before the first
/// byte is written, unless the whole document is written unchanged.
///
/// # Errors
/// [`Error::Missing`] if the result does not have everything that the view selects.
///
/// # Panics
/// If [`Part::formats`] does not list the format.
pub fn write(
    out: &mut dyn Write,
    stored: impl AsRef<[u8]>,
    part: Part,
    format: Format,
    view: &View,
) -> Result<()> {
    if (part, format) == (Part::Whole, Format::Json) && *view == View::default() {
        return Ok(out.write_all(stored.as_ref())?);
    }
    let mut out = Out::new(out);
    convert(&mut out, stored, part, format, view)?;
    Ok(out.flush()?)
}

fn convert(
    out: &mut Out<'_>,
    stored: impl AsRef<[u8]>,
    part: Part,
    format: Format,
    view: &View,
) -> Result<()> {
    assert!(part.formats().contains(&format), "{part:?} cannot be written as {format:?}");
    let document = Document::open(stored.as_ref(), view)?;
    if format == Format::Svg {
        return Ok(out.write_all(&figure::svg(&document, view)?)?);
    }
    if part == Part::Whole {
        let object = document.object()?;
        drop(stored);
        return match format {
            Format::Npz => npz::whole(out, object, view),
            _ => Ok(serde_json::to_writer(out, &object)?),
        };
    }
    let table = match part {
        Part::Statistics | Part::Histogram => statistics::table(&document, part)?,
        _ => document.table(part, view)?,
    };
    let head = document.head;
    drop(stored);
    match format {
        Format::Svg => unreachable!("a figure is not a table"),
        Format::Npz => npz::table(out, &head, &table, view),
        Format::Json if view.records => json::framed(out, &head, "records", &json::Records(&table)),
        Format::Json => json::framed(out, &head, part.as_str(), &table),
        Format::Ndjson => json::lines(out, &head, &table),
        Format::Csv => csv::table(out, &head, &table, view),
        Format::Arrow => arrow::table(out, &head, &table, view),
    }
}

/// Checks the form of a result: each table must be readable, and its columns must have the lengths of their axes.
///
/// # Errors
/// The document is not JSON of this form.
pub fn check(stored: &[u8]) -> Result<()> {
    Document::open(stored, &View::default())?.object().map(drop)
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

    fn written(stored: &str, part: Part, format: Format, view: &View) -> Result<Vec<u8>, Error> {
        let mut out = Vec::new();
        write(&mut out, stored.as_bytes(), part, format, view).map(|()| out)
    }

    fn made(part: Part, format: Format, view: &View) -> String {
        String::from_utf8(written(RESULT, part, format, view).unwrap()).unwrap()
    }

    fn value(part: Part, view: &View) -> Value {
        serde_json::from_str(&made(part, Format::Json, view)).unwrap()
    }

    fn rows(part: Part, view: &View) -> Vec<String> {
        let csv = made(part, Format::Csv, view);
        csv.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect()
    }

    fn refused(part: Part, view: &View) -> Vec<(String, String)> {
        match written(RESULT, part, Format::Json, view) {
            Err(Error::Missing(items)) => {
                items.into_iter().map(|item| (item.parameter.to_owned(), item.detail)).collect()
            }
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_history_has_one_row_per_output_cycle() {
        let csv = made(Part::History, Format::Csv, &View::default());
        assert!(csv.starts_with("# fretwork history\n# key: ab\n# engine: {\"name\":\"fretwork\""));
        let expected = ["cycles,wear_volume[m^3]", "0.0,0.0", "1000.0,1.2345678e-13"];
        assert_eq!(rows(Part::History, &View::default()), expected);
        let lines = made(Part::History, Format::Ndjson, &View::default());
        let head = r#"{"key":"ab","engine":"fretwork/1","#;
        let expected = [
            format!("{head}\"cycles\":0.0,\"wear_volume[m^3]\":0.0}}"),
            format!("{head}\"cycles\":1000.0,\"wear_volume[m^3]\":1.2345678e-13}}"),
        ];
        assert_eq!(lines.lines().collect::<Vec<_>>(), expected);
    }

    #[test]
    fn csv_without_comments_begins_with_the_header_row() {
        let view = View { without_comments: true, digits: Some(3), ..View::default() };
        let csv = made(Part::History, Format::Csv, &view);
        assert_eq!(csv, "cycles,wear_volume[m^3]\n0.0,0.0\n1000.0,1.23e-13\n");
    }

    #[test]
    fn profiles_have_one_row_per_output_cycle_and_radius() {
        let expected = [
            "cycles,radius[m],initial,limiting,worn[m],pressure[Pa]",
            "0.0,0.0,0.0,,0.0,",
            "0.0,1.0,1.0,,1.0,2500000000.0",
            "0.0,2.0,4.0,,4.0,0.0",
            "1000.0,0.0,0.0,,0.1,300000000.0",
            "1000.0,1.0,1.0,,2.0,1.0",
            "1000.0,2.0,4.0,,5.0,0.0",
        ];
        assert_eq!(rows(Part::Profiles, &View::default()), expected);
    }

    #[test]
    fn loops_have_one_row_per_output_cycle_and_point() {
        let expected = [
            "cycles,displacement[m],tangential_force[N],energy_ratio",
            "0.0,1.0,3.0,0.1",
            "0.0,-1.0,-3.0,0.1",
            "5.0,2.0,4.5,0.2",
            "5.0,-2.0,-4.0,0.2",
            "5.0,0.5,1.0,0.2",
        ];
        assert_eq!(rows(Part::Loops, &View::default()), expected);
        let ratios = View { fields: Some(vec!["energy_ratio".into()]), ..View::default() };
        assert_eq!(rows(Part::Loops, &ratios), ["cycles,energy_ratio", "0.0,0.1", "5.0,0.2"]);
    }

    #[test]
    fn the_records_layout_has_one_object_per_row() {
        let view = View { records: true, cycles: Some(vec![0.0]), ..View::default() };
        let profiles = value(Part::Profiles, &view);
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
    fn fields_cycles_and_points_select_parts_of_a_table() {
        let view = View {
            fields: Some(vec!["worn".into(), "radius".into()]),
            cycles: Some(vec![1000.0 * (1.0 + 1e-13)]),
            points: Some(2),
            ..View::default()
        };
        let expected = ["cycles,radius[m],worn[m]", "1000.0,0.0,0.1", "1000.0,2.0,5.0"];
        assert_eq!(rows(Part::Profiles, &view), expected);
        assert_eq!(
            value(Part::Profiles, &view)["profiles"],
            json!({"cycles": [1e3], "radius": [0.0, 2.0], "worn": [[0.1, 5.0]]})
        );
        let view = View { cycles: Some(vec![1000.0]), ..View::default() };
        assert_eq!(value(Part::History, &view)["history"]["wear_volume"], json!([1.234_567_8e-13]));
    }

    #[test]
    fn an_error_lists_all_unknown_fields_and_cycles_and_the_valid_ones() {
        let view = View {
            fields: Some(vec!["warn".into(), "worn".into(), "sleep".into()]),
            cycles: Some(vec![0.0, 7.0]),
            ..View::default()
        };
        let missing = refused(Part::Profiles, &view);
        let names: Vec<_> = missing.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["fields", "fields", "cycles"]);
        assert!(
            missing[0].1.contains("\"warn\"") && missing[0].1.contains("initial, limiting, worn")
        );
        assert!(
            missing[2].1.contains("7 is not") && missing[2].1.ends_with("0, 1000"),
            "{missing:?}"
        );
    }

    #[test]
    fn tables_of_a_result_without_profiles_have_no_rows() {
        let text = r#"{"key":"ab","engine":{"name":"fretwork","numerics":1},
            "units":{"worn":"m"},"history":{},"profiles":null}"#;
        let made = |part, format| {
            let bytes = written(text, part, format, &View::default()).unwrap();
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
    fn the_digits_parameter_rounds_results_but_not_the_scenario() {
        let view = View { digits: Some(3), ..View::default() };
        let whole = value(Part::Whole, &view);
        assert_eq!(whole["history"]["wear_volume"][1], json!(1.23e-13));
        assert_eq!(whole["unworn"]["amplitude"], json!(2.26e-6));
        assert_eq!(whole["scenario"]["friction"], json!(0.123_456_789_012));
        assert_eq!(whole["accuracy"]["steps"], json!(12_345_678));
        assert_eq!(rows(Part::History, &view)[2], "1000.0,1.23e-13");
    }

    #[test]
    fn engineering_units_convert_every_quantity_and_its_unit_name() {
        let view = View { engineering: true, digits: Some(9), ..View::default() };
        let whole = value(Part::Whole, &view);
        assert_eq!(whole["units"]["wear_volume"], "mm^3");
        assert_eq!(whole["history"]["wear_volume"][1], json!(1.234_567_8e-4));
        assert_eq!(whole["unworn"]["amplitude"], json!(2.256_123_45));
        assert_eq!(whole["comparison"]["history"]["wear_volume"][0], json!(1e-4));
        // A relative error has no unit, although it has the name of a quantity.
        assert_eq!(whole["comparison"]["errors"]["wear_volume"][0], json!(0.0625));
        let head = "cycles,radius[um],initial,limiting,worn[um],pressure[MPa]";
        assert_eq!(rows(Part::Profiles, &view)[0], head);
        assert_eq!(rows(Part::Profiles, &view)[2], "0.0,1000000.0,1.0,,1000000.0,2500.0");
    }

    #[test]
    fn selected_cycles_limit_profiles_and_loops_but_not_the_history() {
        let view = View { cycles: Some(vec![0.0]), points: Some(2), ..View::default() };
        let whole = value(Part::Whole, &view);
        assert_eq!(whole["history"]["cycles"], json!([0.0, 1000.0]));
        assert_eq!(whole["profiles"]["worn"], json!([[0.0, 4.0]]));
        assert_eq!(whole["loops"]["displacement"], json!([[1.0, -1.0]]));
        let names: Vec<_> = whole.as_object().unwrap().keys().cloned().collect();
        let stored: Value = serde_json::from_str(RESULT).unwrap();
        assert_eq!(names, stored.as_object().unwrap().keys().cloned().collect::<Vec<_>>());
        assert_eq!(refused(Part::Whole, &View { cycles: Some(vec![9.0]), ..view }).len(), 1);
    }

    const STUDY: &str = r#"{"key":"ab","engine":{"name":"fretwork","numerics":1},
        "sweep":{"scenario":{"friction":0.5}},
        "units":{"/friction":"1","/motion/amplitude":"m","wear_volume":"m^3"},
        "counts":{"points":2,"refused":1,"incomplete":0},
        "table":{"/friction":[0.5,-1.0],"/motion/amplitude":[1e-6,2e-6],"wear_volume":[1.25e-13,null],
                 "reason":[null,"/friction: \"-1\" is bad"]}}"#;

    #[test]
    fn the_table_of_a_study_has_a_row_for_each_point() {
        let made = |format, view: &View| {
            String::from_utf8(written(STUDY, Part::Table, format, view).unwrap()).unwrap()
        };
        let view = View { engineering: true, ..View::default() };
        let csv = made(Format::Csv, &view);
        let rows: Vec<_> = csv.lines().filter(|line| !line.starts_with('#')).collect();
        let expected = [
            "/friction,/motion/amplitude[um],wear_volume[mm^3],reason",
            "0.5,1.0,0.000125,",
            "-1.0,2.0,,\"/friction: \"\"-1\"\" is bad\"",
        ];
        assert_eq!(rows, expected);
        let lines = made(Format::Ndjson, &View::default());
        let expected = "\"wear_volume[m^3]\":null,\"reason\":\"/friction: \\\"-1\\\" is bad\"}";
        assert!(lines.lines().nth(1).unwrap().ends_with(expected), "{lines}");
        let view = View { fields: Some(vec!["reason".into()]), ..View::default() };
        let columns: Value = serde_json::from_str(&made(Format::Json, &view)).unwrap();
        assert_eq!(columns["table"], json!({"reason": [null, "/friction: \"-1\" is bad"]}));
        let view = View { rows: Some(1), ..View::default() };
        let columns: Value = serde_json::from_str(&made(Format::Json, &view)).unwrap();
        let first = json!({"/friction": [0.5], "/motion/amplitude": [1e-6], "wear_volume": [1.25e-13],
            "reason": [null]});
        assert_eq!(columns["table"], first);
        assert_eq!(made(Format::Ndjson, &view).lines().count(), 1);
        let whole =
            written(STUDY, Part::Whole, Format::Json, &View { digits: Some(2), ..View::default() });
        let whole: Value = serde_json::from_slice(&whole.unwrap()).unwrap();
        assert_eq!(whole["table"]["wear_volume"], json!([1.2e-13, null]));
        assert_eq!(whole["counts"]["refused"], json!(1));
    }

    #[test]
    fn a_text_of_a_table_is_no_formula() {
        for begin in ["=HYPERLINK(", "+1", "-1", "@SUM(", "＝1"] {
            let named = STUDY.replace("null,\"/friction", &format!("{},\"/friction", json!(begin)));
            let csv = written(&named, Part::Table, Format::Csv, &View::default()).unwrap();
            let cell = format!(",\"'{begin}\"\n");
            assert!(String::from_utf8(csv).unwrap().contains(&cell), "{begin:?}");
        }
        for (text, cell) in [
            ("a=\"b\"", "a=\"\"b\"\""),
            ("steel, -5 °C", "steel, -5 °C"),
            ("\t=1", "'\t'=1"),
            (" \u{200b}=1", " \u{200b}'=1"),
            ("\"=1", "\"\"'=1"),
            ("a;=1;\" +1|@A\n-1", "a;'=1;\"\" '+1|'@A\n'-1"),
        ] {
            assert_eq!(text_cell(text), format!("\"{cell}\""));
        }
    }

    #[test]
    fn statistics_have_a_row_for_each_output_and_a_histogram_one_for_each_bin() {
        let view = View { engineering: true, digits: Some(3), ..View::default() };
        let made = |part| {
            let csv = written(STUDY, part, Format::Csv, &view).unwrap();
            let csv = String::from_utf8(csv).unwrap();
            csv.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect::<Vec<_>>()
        };
        let names = "output,unit,points,mean,standard_deviation,minimum,percentile_2_5,\
            percentile_5,percentile_10,percentile_25,median,percentile_75,percentile_90,percentile_95,\
            percentile_97_5,maximum,\
            percentile_2_5_low,percentile_2_5_high,percentile_5_low,percentile_5_high,\
            percentile_95_low,percentile_95_high,percentile_97_5_low,percentile_97_5_high";
        // One value has no standard deviation, and does not show how far a percentile is known.
        let row = format!(
            "\"wear_volume\",\"mm^3\",1.0,0.000125,{}{}",
            ",0.000125".repeat(11),
            ",".repeat(8)
        );
        assert_eq!(made(Part::Statistics), [names.to_owned(), row]);
        let bin = "\"wear_volume\",\"mm^3\",0.000125,0.000125,1.0";
        assert_eq!(made(Part::Histogram), ["output,unit,from,to,points", bin]);
    }

    #[test]
    fn a_study_has_no_history_and_a_run_has_no_table() {
        for (stored, part) in [
            (STUDY, Part::History),
            (STUDY, Part::Profiles),
            (RESULT, Part::Table),
            (RESULT, Part::Statistics),
        ] {
            let made = written(stored, part, part.formats()[0], &View::default());
            assert!(
                matches!(made, Err(Error::OtherKind(refused, _)) if refused == part),
                "{part:?}"
            );
        }
    }

    #[test]
    fn equal_requests_give_equal_bytes() {
        for part in Part::TABLES {
            for format in Format::ALL {
                let stored = if part == Part::Table { STUDY } else { RESULT };
                let made = || written(stored, part, format, &View::default()).unwrap();
                assert!((0..5).all(|_| made() == made()), "{part:?} {format:?}");
            }
        }
    }
}
