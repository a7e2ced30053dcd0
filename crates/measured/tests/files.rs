//! Files as instruments and spreadsheets write them, good and bad.

#![expect(clippy::expect_used, clippy::panic, reason = "a failed test may panic")]

use fretwork_measured::{MAX_ROWS, Measured, Prepare, Wanted, read};
use fretwork_random::Stream;

const ALL: Wanted<'_> = Wanted {
    x: None,
    y: None,
    prepare: Prepare::Points,
    level: true,
    centre: true,
    up: None,
    scar: None,
};

fn good(text: &str) -> Measured {
    read(text.as_bytes(), &ALL).unwrap_or_else(|faults| panic!("{text}: {faults:?}"))
}

/// The faults of a file as `pointer: detail`.
fn refused(bytes: &[u8], wanted: &Wanted<'_>) -> String {
    let faults = read(bytes, wanted).expect_err("a file with a fault").0;
    let texts = faults.iter().map(|fault| format!("{}: {}", fault.pointer, fault.detail));
    texts.collect::<Vec<_>>().join("\n")
}

fn utf16(text: &str, bytes: fn(u16) -> [u8; 2]) -> Vec<u8> {
    text.encode_utf16().flat_map(bytes).collect()
}

#[test]
fn all_spellings_of_a_table_give_the_same_numbers() {
    let plain = "cycles,wear_volume [mm^3]\n10000,0.12\n20000,\n50000,0.5\n";
    let expected = good(plain);
    let numbers = |measured: &Measured| -> Vec<_> {
        measured.columns.iter().map(|column| column.values.clone()).collect()
    };
    assert_eq!(expected.columns[0].values, [Some(1e4), Some(2e4), Some(5e4)]);
    let volume = expected.columns[1].values[0].unwrap();
    assert!((volume / 0.12e-9 - 1.0).abs() < 1e-12 && expected.columns[1].values[1].is_none());
    for text in [
        "cycles [-];wear_volume / mm³\r\n10000;0,12\r\n20000;NaN\r\n50000;0,5\r\n",
        "cycles [1]\twear_volume (mm^3)\n10000\t0,12\n20000\t-\n50000\t0,5",
        "Rig 3, 12.5.2024\nOperator;Smith;\n\ncycles;wear_volume\n-;mm^3\n1e4;0.12\n2e4;n/a\n5E4;.5\n",
        "cycles [-]  wear_volume [mm^3]\n 10000  0.12\n 20000  nan\n 50000  0.5\n",
        "# cycles (cycles)\twear_volume mm^3\n1e4\t1.2e-1\n2e4\t\n5e4\t5e-1\n",
        "\"cycles [1]\",\"wear_volume [mm^3]\"\n\"10000\",\"0,12\"\n\"20000\",\"\"\n\"50000\",\"0,5\"\n",
        "\u{feff}cycles [1];wear_volume [mm³]\r10000;0,12\r20000;–\r50000;0,5\r",
        "specimen;cycles [-];wear_volume [mm^3];\nA1;10000;0,12;\nA1;20000;;\nB7;50000;0,5;\n;;;\n",
    ] {
        let read = good(text);
        assert_eq!(
            numbers(&read)[..],
            numbers(&good(plain).clone())[..],
            "{text}: {:?}",
            read.notes
        );
    }
    let text = "cycles [1];wear_volume [µm^3]\n1;2,5\n";
    let latin: Vec<u8> = text.chars().map(|c| c as u8).collect();
    let bom = format!("\u{feff}{text}");
    for bytes in [
        latin,
        utf16(&bom, u16::to_le_bytes),
        utf16(&bom, u16::to_be_bytes),
        utf16(text, u16::to_le_bytes),
    ] {
        let read = read(&bytes, &ALL).unwrap();
        assert_eq!(
            (&read.columns, read.notes.len()),
            (&good(text).columns, good(text).notes.len() + 1)
        );
    }
}

#[test]
fn units_are_found_in_headers() {
    for (header, name, unit) in [
        ("Depth [µm]", "Depth", Some("m")),
        ("z (um)", "z", Some("m")),
        ("Force/N", "Force", Some("N")),
        ("Force / kN", "Force", Some("N")),
        ("wear_volume mm^3", "wear_volume", Some("m^3")),
        ("Wear rate, mm^3/(N m)", "Wear rate", Some("1/Pa")),
        ("Wear rate [mm³/Nm]", "Wear rate", Some("1/Pa")),
        ("wear_depth[m]", "wear_depth", Some("m")),
        ("Stiffness N/µm", "Stiffness", Some("N/m")),
        ("time [s]", "time", Some("s")),
        ("Force 1", "Force 1", None),
        ("N", "N", None),
    ] {
        let read = good(&format!("{header};b\n1;2\n"));
        assert_eq!(
            (&*read.columns[0].name, read.columns[0].unit.as_deref()),
            (name, unit),
            "{header}"
        );
    }
}

#[test]
fn everything_that_was_done_is_told() {
    let notes = good("Rig 3\nspecimen;N [cycles];V [mm³];t [s]\nA;10,000;0,12;1\nB;2;0,13;1\n")
        .notes
        .join("\n");
    for told in [
        "separated by semicolons",
        "1 line(s) before the table were not read: “Rig 3”",
        "“specimen” has no numbers",
        "“10,000” was read as 10.",
        "“V” was read in mm³",
        "“t” was read in s",
        "x is “N”, and y is “V”",
        "y was taken as the output wear_volume over cycles",
    ] {
        assert!(notes.contains(told), "{told}: {notes}");
    }
    assert!(good("1;2\n3;4\n").notes.iter().any(|note| note.contains("no row of names")));
}

#[test]
fn spaces_and_points_in_numbers_are_told() {
    let points = "cycles;wear_volume [um^3]\n1000;4629,9\n12000;0,5\n";
    for text in [
        points.replace("1000;4629", "1 000;4 629").replace("12000", "12 000"),
        points.replace("1000;4629", "1\u{a0}000;4\u{2009}629").replace("12000", "12\u{202f}000"),
        points.replace("1000;4629", "1 000;4 629").replace("12000", "12 000").replace(';', "\t"),
    ] {
        let read = good(&text);
        assert_eq!(read.columns, good(points).columns, "{text}");
        assert!(read.notes.iter().any(|it| it.starts_with("Spaces separate thousands")), "{text}");
    }
    let notes = good("cycles;wear_volume [um^3]\n1.000;4.6\n2.000;9.6\n").notes.join("\n");
    assert!(notes.contains("Points are decimal marks: “2.000” was read as 2."), "{notes}");
    let units = good("cycles;wear_volume\n1;mm^3\n1000;0.5\n");
    assert_eq!(units.columns[1].unit.as_deref(), Some("m^3"));
    let date = good("date;cycles;wear_volume\n12.05.2024;1000;0.5\n");
    assert_eq!(date.columns.len(), 2, "a date is no number");
}

#[test]
fn a_factor_makes_a_unit_unknown() {
    for (head, name, unit) in [
        ("V (1e-3 mm3)", "V", "1e-3 mm3)"),
        ("V / 10^-3 mm^3", "V", "10^-3 mm^3"),
        ("V in 1e-3 mm^3", "V in", "1e-3 mm^3"),
        ("V [10^-3 mm3]", "V", "10^-3 mm3"),
        ("V × 10⁻³ (mm³)", "V", "10⁻³ (mm³)"),
        ("V 1000 mm^3", "V", "1000 mm^3"),
        ("cycles (10^3)", "cycles", "10^3)"),
        ("cycles/1000", "cycles", "1000"),
        ("cycles x1000", "cycles", "x1000"),
    ] {
        let read = good(&format!("{head};b\n1;2\n"));
        assert_eq!((&*read.columns[0].name, read.columns[0].unit.as_deref()), (name, Some(unit)));
        assert!(read.prepared["data"].is_null(), "{head}: {:?}", read.prepared);
        let y = head.starts_with('V').then(|| good(&format!("a;{head}\n1;2\n")));
        assert!(y.is_none_or(|read| read.prepared["data"].is_null()), "{head}");
    }
    let rows = good("cycles;V\n-;10^-3 mm^3\n1;2\n");
    assert_eq!(rows.columns[1].unit.as_deref(), Some("10^-3 mm^3"));
    for (label, factor) in [("Sensor 2 (um)", 1e-6), ("Force 1", 1.0), ("x1 (um)", 1e-6)] {
        assert_eq!(good(&format!("{label};b\n1;2\n")).columns[0].values, [Some(factor)], "{label}");
    }
}

#[test]
fn an_output_needs_its_unit() {
    let mass = good("cycles;mass_loss [mg]\n1000;2\n");
    assert_eq!(
        (mass.columns[1].unit.as_deref(), mass.columns[1].values[0]),
        (Some("kg"), Some(2e-6))
    );
    assert_eq!(mass.prepared["data"]["output"], "mass_loss");
    assert_eq!(good("cycles;mass [µg]\n1000;2\n").prepared["data"]["output"], "mass_loss");
    for (head, accepted) in [
        ("wear_volume [10^-3 mm3]", "Accepted units: m^3, cm^3, mm^3, um^3"),
        ("wear_volume [um]", "Accepted units: m^3"),
        ("wear_volume [mg]", "Accepted units: m^3"),
        ("wear_depth [%]", "Accepted units: m, cm, mm"),
        ("cycles [10^3]", "Accepted units: 1."),
        ("mass_loss [mm^3]", "Accepted units: kg, g, mg, ug"),
    ] {
        let said = refused(format!("N;{head}\n1000;2\n").as_bytes(), &ALL);
        assert!(said.starts_with("/y: is the output") && said.contains(accepted), "{said}");
    }
    let bare = good("cycles;wear_volume\n1000;2e-12\n").notes.join("\n");
    assert!(bare.contains("the output wear_volume over cycles, in m^3."), "{bare}");
    let time = good("t [s];wear_volume [mm^3]\n1000;2\n");
    assert_eq!((time.columns.len(), &time.prepared["data"]), (2, &serde_json::Value::Null));
    let energy = good("dissipated_energy;wear_volume [mm^3]\n1000;2\n");
    assert_eq!(energy.prepared["data"]["over"], "dissipated_energy");
}

#[test]
fn a_long_name_is_cut() {
    let text = "n".repeat(100_000) + ";b\n1;2\n";
    let read = good(&text);
    assert_eq!(read.columns[0].name.len(), 200);
    assert!(read.notes.iter().all(|note| note.len() < 1000));
    assert!(refused(text.replace('1', &"1x".repeat(50_000)).as_bytes(), &ALL).len() < 1000);
}

#[test]
fn a_bad_file_is_refused_with_a_remedy() {
    let rows = |count: usize| "a;b\n".to_owned() + &"1;2\n".repeat(count);
    assert_eq!(good(&rows(MAX_ROWS)).columns[1].values.len(), MAX_ROWS);
    for (bytes, told) in [
        (&b"\x89PNG\r\n\x1a\n"[..], "is a PNG picture. Save the table as CSV"),
        (b"PK\x03\x04abc", "a workbook (.xlsx, .ods). Save the table as CSV"),
        (b" {\"a\": 1}", "is a JSON document"),
        (b"[[1, 2]]", "is a JSON document"),
        (b"\x1f\x8b\x08", "compressed by gzip"),
        (b"a;b\n1;\x07", "is no text"),
        (b"", "no table of numbers"),
        (b"a;b\n", "no table of numbers"),
        (b"a\n1\n2\n", "no table of numbers"),
        (
            b"a;b\n1;2\n3\t4\n5;6\n",
            "Line 3 has 1 cell(s), but the table has 2 columns. Separate the cells of all lines by semicolons",
        ),
        (
            b"a;b\n1;2\n3;x\n4;5\n6;y\n",
            "Line 3: \u{201c}x\u{201d} in \u{201c}b\u{201d} is not a number. Write it like 1234.5",
        ),
        (b"a;b\n1;x\n3;2\n4;5\n", "Line 2: \u{201c}x\u{201d}"),
        (b"a;b\n1;2\n3;inf\n4;5\n", "\u{201c}inf\u{201d} in"),
        (
            b"a;b\n1.000.000;2\n3;4\n5;6\n",
            "is not a number. Write it like 1234.5, without separators of thousands and without its unit",
        ),
        (
            b"a;b\n1'234.5;2\n3;4\n5;6\n",
            "is not a number. Write it like 1234.5, without separators of thousands and without its unit",
        ),
        (
            b"a;b\n1.234,5;2\n3;4\n5;6\n",
            "is not a number. Write it like 1234.5, without separators of thousands and without its unit",
        ),
        (
            b"a;b\n1;4.629,9\n2;9.612,0\n",
            "Line 2: \u{201c}4.629,9\u{201d} in \u{201c}b\u{201d} is not a number",
        ),
        (
            b"a,b [mm^3]\n1000,0,12\n2000,0,13\n",
            "The rows have 3 columns, separated by commas, but line 1",
        ),
        (b"a;b\n1,2\n3,4\n", "The rows have 2 columns, separated by commas, but line 1"),
        (
            b"a;b\n1,5;2.5\n",
            "have points and commas, such as \u{201c}2.5\u{201d} and \u{201c}1,5\u{201d}",
        ),
        (
            b"a;b\n1 mm;2\n3;4\n5;6\n",
            "is not a number. Write it like 1234.5, without separators of thousands and without its unit",
        ),
        (
            b"a [mm];b\num;N\n1;2\n",
            "\u{201c}a [mm] [um]\u{201d} has two units: [mm] [um]. Write only one of them",
        ),
    ] {
        let said = refused(bytes, &ALL);
        assert!(said.starts_with(": ") && said.contains(told), "{told}: {said}");
    }
    let said = refused(rows(MAX_ROWS + 1).as_bytes(), &ALL);
    assert!(said.contains("more than 100000 rows. Keep, for example, every tenth row"), "{said}");
    let long = "about\n".repeat(2000) + &rows(MAX_ROWS);
    assert!(refused(long.as_bytes(), &ALL).contains("more than 100000 rows"));
    let wide = "1;".repeat(70) + "1\n";
    assert!(refused(wide.as_bytes(), &ALL).contains("Write 2 to 64 columns"));
}

#[test]
fn columns_are_chosen_by_name_and_unit() {
    let text = b"cycles;Wear volume;depth [um];depth [mm]\n1;2;3;4\n5;6;7;8\n";
    let of = |x, y| Wanted { x: Some(x), y: Some(y), ..ALL };
    let read = read(text, &of("cycles", "Wear volume [mm^3]")).unwrap();
    let data = &read.prepared["data"];
    assert_eq!((&data["output"], &data["over"]), (&"wear_volume".into(), &"cycles".into()));
    assert!((data["y"][1].as_f64().unwrap() / 6e-9 - 1.0).abs() < 1e-12, "{data}");
    for (x, y, told) in [
        ("cycle", "depths", "/x: unknown column `cycle`. Did you mean `cycles`?"),
        ("cycle", "depths", "/y: unknown column `depths`. Did you mean `depth`?"),
        ("cycles", "dep", "Accepted here: cycles, Wear volume, depth, depth'"),
    ] {
        let said = refused(text, &of(x, y));
        assert!(said.contains(told), "{told}: {said}");
    }
    let said = refused(b"x;z [um]\n1;2\n3;4\n", &of("x", "z [mm]"));
    assert!(said.contains("/y: has two units: [um] [mm]"), "{said}");
    let said = refused(b"x;z [um]\n1;2\n3;4\n", &Wanted { prepare: Prepare::Trace, ..ALL });
    assert!(said.contains("/x: must be a length. Add its unit, such as x [m]"), "{said}");
    let said = refused(b"x [um];z [um]\n1;2\n", &Wanted { prepare: Prepare::Trace, ..ALL });
    assert!(
        said.contains("/prepare: needs 30 rows with both numbers, but the file has 1"),
        "{said}"
    );
}

/// The parser neither panics nor takes long, whatever it reads. `FRETWORK_TEST_LONG` reads more.
#[test]
fn random_bytes_and_changed_files_are_read_or_refused() {
    let is_long = std::env::var_os("FRETWORK_TEST_LONG").is_some();
    let seed = std::env::var("FRETWORK_TEST_SEED").ok().and_then(|seed| seed.parse().ok());
    let stream = Stream::new(seed.unwrap_or(38));
    let parts: Vec<&[u8]> = vec![
        b";",
        b"\t",
        b",",
        b" ",
        b"\n",
        b"\r\n",
        b"\"",
        b"1",
        b"2,5",
        b"-3.25e-7",
        b"NaN",
        b"[um]",
        b"(",
        b")",
        b"mm^3",
        b"#",
        b"x [um]",
        b"z",
        b"\xff\xfe",
        b"\0",
        b"\xb5m",
        "µm³".as_bytes(),
        b"[",
        b"{",
        b"1 000",
        b"/N",
        b"\xef\xbb\xbf",
        "\u{202f}".as_bytes(),
        b"''",
        b"1.",
        b",5",
        b"\n1;2;3",
        b"\n4\t5",
        b"\n10;20",
    ];
    let prepares = Prepare::NAMES.map(|(_, prepare)| prepare);
    let (mut good, count) = (0, if is_long { 2_000_000 } else { 20_000 });
    for case in 0..count {
        let own = stream.child(case);
        let mut bytes: Vec<u8> = if own.at(0).is_multiple_of(2) {
            b"x [um];z [um]\n1;2\n3;4\n5;7\n".to_vec()
        } else {
            Vec::new()
        };
        for place in 1..own.below(1, 40) {
            let part = parts[own.below(2 * place, parts.len() as u64) as usize];
            let at = own.below(2 * place + 1, bytes.len() as u64 + 1) as usize;
            bytes.splice(at..at, part.iter().copied());
        }
        let prepare = prepares[own.below(99, 4) as usize];
        good += u64::from(read(&bytes, &Wanted { prepare, ..ALL }).is_ok());
    }
    assert!(good > count / 100, "{good} of {count} files were read");
}
