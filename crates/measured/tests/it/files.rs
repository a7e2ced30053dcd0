//! Files as instruments and spreadsheets write them, good and bad.

use fretwork_measured::{MAX_ROWS, Measured, Prepare, Wanted, read};
use fretwork_random::Stream;

const ALL: Wanted<'_> = Wanted::of(Prepare::Points);

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
        points.replace("1000;4629", "1'000;4’629").replace("12000", "12'000"),
    ] {
        let read = good(&text);
        assert_eq!(read.columns, good(points).columns, "{text}");
        assert!(
            read.notes.iter().any(|it| it.starts_with("Spaces and apostrophes separate thousands")),
            "{text}"
        );
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
        ("V (1e-3 mm3)", "V", "1e-3 mm3"),
        ("V / 10^-3 mm^3", "V", "10^-3 mm^3"),
        ("V in 1e-3 mm^3", "V in", "1e-3 mm^3"),
        ("V [10^-3 mm3]", "V", "10^-3 mm3"),
        ("V × 10⁻³ (mm³)", "V", "10⁻³ (mm³)"),
        ("V 1000 mm^3", "V", "1000 mm^3"),
        ("cycles (10^3)", "cycles", "10^3"),
        ("V (worn mm)", "V", "worn mm"),
        ("cycles/1000", "cycles", "1000"),
        ("cycles x1000", "cycles", "x1000"),
    ] {
        let read = good(&format!("{head};b\n1;2\n"));
        assert_eq!((&*read.columns[0].name, read.columns[0].unit.as_deref()), (name, Some(unit)));
        assert!(read.prepared["data"].is_null(), "{head}: {:?}", read.prepared);
        let y = head.starts_with('V').then(|| good(&format!("a;{head}\n1;2\n")));
        assert!(y.is_none_or(|read| read.prepared["data"].is_null()), "{head}");
    }
    for head in [
        "V·10³ [mm³]",
        "V x 1000 [mm^3]",
        "Vx1000 [mm^3]",
        "1000 V [mm^3]",
        "10³·V/mm³",
        "1000*V [mm^3]",
        "V E+3 [mm3]",
        "V, Mio. mm³",
        "depth·100 [um]",
        "cycles x 1000",
        "N in 1000",
        "Zyklen in Tsd.",
    ] {
        let of_x = good(&format!("{head};V [mm^3]\n1;2\n"));
        assert!(of_x.prepared["data"].is_null(), "{head}: {:?}", of_x.prepared);
        assert!(of_x.notes.iter().any(|note| note.contains("has a factor in its name")), "{head}");
        assert_eq!(of_x.columns[0].values, [Some(1.0)], "{head}");
    }
    for head in [
        "Profile 1 x [um]",
        "Depth after 10^5 cycles [um]",
        "Sample 10-2 depth [um]",
        "x10 [um]",
        "dx1000 [um]",
        "1024x1024 [um]",
        "Depth after 200 kilocycles [um]",
        "5 x 5 mean [um]",
        "E-3 [um]",
        "Depth in 100 [um]",
    ] {
        assert_eq!(good(&format!("{head};b\n1;2\n")).columns[0].values, [Some(1e-6)], "{head}");
    }
    for head in ["10^-3 mm^3", "x10^-3 mm^3"] {
        let rows = good(&format!("cycles;V\n-;{head}\n1;2\n"));
        assert_eq!(rows.columns[1].unit.as_deref(), Some(head));
    }
    // The word “in” is no inch.
    for (head, unit) in
        [("Load in N", Some("N")), ("V (in mm^3)", Some("m^3")), ("Area in mm^2", None)]
    {
        assert_eq!(good(&format!("{head};b\n1;2\n")).columns[0].unit.as_deref(), unit, "{head}");
    }
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
    for (name, examples) in [
        ("wear_volume", "as y: wear_volume [mm^3]."),
        ("wear_depth", "as y: wear_depth [um]."),
        ("mass_loss", "as y: mass_loss [mg]."),
        ("normal_force", "as y: normal_force [N]."),
        ("V", "as y: V [mm^3] for volumes, V [um] for depths, or V [mg] for masses."),
    ] {
        let bare = good(&format!("cycles;{name}\n1000;2e-12\n"));
        assert!(bare.prepared["data"].is_null(), "{:?}", bare.prepared);
        let told = bare.notes.join("\n");
        assert!(told.contains("has no unit") && told.contains(examples), "{told}");
    }
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
        (b"a;b\n1;2\n3;x\n4;5\n6;y\n", "Line 3: “x” in “b” is not a number. Write it like 1234.5"),
        (b"a;b\n1;x\n3;2\n4;5\n", "Line 2: “x”"),
        (
            "x\u{202f} [u1m];z [#u1 000m]\n\"\n4z\t5a1;2\n3;4\n#Fx5;)7\n".as_bytes(),
            "Line 2 has 0 cell(s), but the table has 2 columns",
        ),
        (b"a;b\n1;2\n3;inf\n4;5\n", "“inf” in"),
        (
            b"a;b\n1.000.000;2\n3;4\n5;6\n",
            "is not a number. Write it like 1234.5, without separators of thousands and without its unit",
        ),
        (
            b"a;b\n1'234'5;2\n3;4\n5;6\n",
            "is not a number. Write it like 1234.5, without separators of thousands and without its unit",
        ),
        (
            b"a;b\n1.234,5;2\n3;4\n5;6\n",
            "is not a number. Write it like 1234.5, without separators of thousands and without its unit",
        ),
        (b"a;b\n1;4.629,9\n2;9.612,0\n", "Line 2: “4.629,9” in “b” is not a number"),
        (
            b"a,b [mm^3]\n1000,0,12\n2000,0,13\n",
            "The rows have 3 columns, separated by commas, but line 1",
        ),
        (b"a;b\n1,2\n3,4\n", "The rows have 2 columns, separated by commas, but line 1"),
        (b"a;b\n1,5;2.5\n", "have points and commas, such as “2.5” and “1,5”"),
        (
            b"a;b\n1 mm;2\n3;4\n5;6\n",
            "is not a number. Write it like 1234.5, without separators of thousands and without its unit",
        ),
        (
            b"a [mm];b\num;N\n1;2\n",
            "“a [mm] [um]” has two units: [mm] [um]. Write only one of them",
        ),
    ] {
        let said = refused(bytes, &ALL);
        assert!(said.starts_with(": ") && said.contains(told), "{told}: {said}");
    }
    let said = refused(rows(MAX_ROWS + 1).as_bytes(), &ALL);
    assert!(said.contains("more than 1000000 rows. Keep, for example, every tenth row"), "{said}");
    let long = "about\n".repeat(2000) + &rows(MAX_ROWS);
    assert!(refused(long.as_bytes(), &ALL).contains("more than 1000000 rows"));
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
    assert!(said.contains("/x: must be a length. Add its unit, such as x [um]"), "{said}");
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
    let texts = "; \t , \n \r\n \" 1 2,5 -3.25e-7 NaN [um] ( ) mm^3 # x[um] z \0 µm³ [ { /N \u{feff} '' 1. ,5 \n1;2;3 \n4\t5 \n10;20";
    let texts = texts.split(' ').chain([" ", "1 000", "\u{202f}"]).map(str::as_bytes);
    let parts: Vec<&[u8]> = texts.chain([&b"\xff\xfe"[..], b"\xb5m"]).collect();
    let prepares = Prepare::ALL;
    let (mut good, count) = (0, if is_long { 2_000_000 } else { 10_000 });
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

/// The tables of tests have other sizes than the rows of text that they need.
fn rows(count: u32, row: impl Fn(u32) -> String) -> String {
    (0..count).map(row).collect()
}

fn values(measured: &Measured, name: &str) -> Vec<Option<f64>> {
    let found = measured.columns.iter().find(|column| column.name == name);
    found.unwrap_or_else(|| panic!("{name}: {:?}", measured.columns)).values.clone()
}

/// The columns as “name in unit: number of rows”.
fn columns(measured: &Measured) -> Vec<String> {
    let word = |it: &fretwork_measured::Column| {
        format!("{} in {}: {}", it.name, it.unit.as_deref().unwrap_or("none"), it.values.len())
    };
    measured.columns.iter().map(word).collect()
}

#[test]
fn tables_of_instruments_have_preambles_units_and_empty_columns() {
    // A stylus instrument: settings as key,value, CR CR LF, units behind the names, and separators at the end.
    let text = "Scan Parameters\nScan Type,Standard Scan\nStylus,Radius: 2.5 um\nLength,800.0 um\nForce,3.00 mg\n\n\
        Analytical Results\nFunction,R.Cur Pos,R.Cur Width,Result\nRa,468.0 um,0.0 um,0.00525 um\n\nScan Data\n\
        Lateral um,Raw Micrometer,\n"
        .to_owned() + &rows(201, |at| format!("{}.0,-0.0{},,\n", 4 * at, 10 + at % 80));
    let stylus = read(text.replace('\n', "\r\r\n").as_bytes(), &ALL).unwrap();
    assert_eq!(columns(&stylus), ["Lateral in m: 201", "Raw in m: 201"], "{:?}", stylus.notes);
    assert_eq!(stylus.tables, [[13, 201]]);
    let fault =
        refused(text.replace("\n40.0,", "\n40.0;").replace('\n', "\r\r\n").as_bytes(), &ALL);
    assert!(
        fault.starts_with(": Line 23: “40.0;-0.020” in “Lateral um” is not a number"),
        "{fault}"
    );

    // A measurement program of a laboratory: the names are after the second header.
    let text = "Measurement\t\nSeparator\tTab\nX_Columns\tOne\n***End_of_Header***\t\n\t\nChannels\t2\t\t\t\n\
        Samples\t120\t120\t\t\nY_Unit_Label\tN\tmicrometer\t\t\nDelta_X\t0.001\t0.001\t\t\n***End_of_Header***\t\t\t\t\n\
        X_Value\tfx_N\tdx_um\tComment\n"
        .to_owned() + &rows(120, |at| format!("{:.4}\t{}\t-{}.5\n", f64::from(at) * 1e-3, at, at));
    let laboratory = good(&text.replace('\n', "\r\n"));
    assert_eq!(columns(&laboratory), ["X_Value in none: 120", "fx in N: 120", "dx in m: 120"]);
    let third = values(&laboratory, "dx")[2];
    assert!(third.is_some_and(|x| (x / -2.5e-6 - 1.0).abs() < 1e-12), "{third:?}");

    // Units alone above the numbers, then how many there are.
    let scan =
        "µm µm\n61\n".to_owned() + &rows(61, |at| format!("   {}.0e+00,   -2.5e-02\n", 5 * at));
    let scan = good(&scan);
    assert_eq!(columns(&scan), ["column 1 in m: 61", "column 2 in m: 61"], "{:?}", scan.notes);

    // Two rows of names, and units above names.
    for (head, expected) in [
        (
            "depth;;force;\nmean;sd;mean;sd\n",
            [
                "depth mean in none: 3",
                "depth sd in none: 3",
                "force mean in none: 3",
                "force sd in none: 3",
            ],
        ),
        (
            "x [um];y [um];F [N];G [N]\nA;B;C;D\n",
            ["x A in m: 3", "y B in m: 3", "F C in N: 3", "G D in N: 3"],
        ),
        ("um;mm;N;kN\nA;B;C;D\n", ["A in m: 3", "B in m: 3", "C in N: 3", "D in N: 3"]),
        ("A;B;C;D\n[um];(mm);N;kN;\n", ["A in m: 3", "B in m: 3", "C in N: 3", "D in N: 3"]),
    ] {
        assert_eq!(
            columns(&good(&(head.to_owned() + &rows(3, |at| format!("{at};1;2;3\n"))))),
            expected,
            "{head}"
        );
    }
}

#[test]
fn each_table_of_a_file_can_be_chosen() {
    let step = |number: u32, count: u32| {
        format!(
            "\nStep No. {number}\n\nStep Type Code: 0\nVelocity     = 240\nData Count   = {count}\n\nFx,Fz,X,T,COF\ng,g,mm,sec,\n\n"
        ) + &rows(count, |at| {
            format!("{}.5,-200.1,0.0{:02},{:.4},0.7\n", number * 100, at, f64::from(at) * 0.02)
        })
    };
    let text = format!(
        "Created by a program\nTotal number of steps = 3\n{}\n{}{}",
        step(1, 40),
        step(2, 50),
        step(3, 60)
    );
    let text = text.replace('\n', "\r\n");
    let table = |table| read(text.as_bytes(), &Wanted { table: Some(table), ..ALL });
    let first = good(&text);
    assert_eq!(first.tables, [[13, 40], [64, 50], [124, 60]]);
    assert_eq!(
        columns(&first),
        ["Fx in kg: 40", "Fz in kg: 40", "X in m: 40", "T in s: 40", "COF in none: 40"]
    );
    assert_eq!(first.columns, table(1).unwrap().columns);
    assert!(
        first.notes.iter().any(|note| note.contains("3 tables, from line 13 (40 rows)")),
        "{:?}",
        first.notes
    );
    assert_eq!(values(&table(3).unwrap(), "Fx")[0], Some(300.5e-3));
    let said = refused(text.as_bytes(), &Wanted { table: Some(4), ..ALL });
    assert!(said.contains("The file has 3 table(s), and no table 4. Write table=1"), "{said}");
    // Gram-forces are forces where forces are needed.
    let force = Wanted { table: Some(2), prepare: Prepare::Loop, ..ALL };
    assert!(refused(text.as_bytes(), &force).starts_with("/prepare: is no loop"));
    let other = "cycles;V [mm^3]\n1;2\n3;4\n5;6\n\nload;depth [um];sd\n10;1;0.1\n20;2;0.1\n30;3;0.1\n40;4;0.2\n";
    let second = read(other.as_bytes(), &Wanted { table: Some(2), ..ALL }).unwrap();
    assert_eq!(columns(&second), ["load in none: 4", "depth in m: 4", "sd in none: 4"]);
}

#[test]
fn footers_and_words_of_errors_are_told() {
    let text = "Zyklen;V [mm³];\n0;0\n10000;0,0021\n20000;#N/A\n30000;Bad\n40000;1.#QNAN\n45000;---\n50000;0,0108\n\
        Mittelwert;0,0086\nEnde der Datei\n";
    let read = good(text);
    assert_eq!(values(&read, "V").iter().flatten().count(), 3);
    assert_eq!(values(&read, "Zyklen").len(), 7);
    for told in [
        "4 cell(s) of “V [mm³]” such as “---”",
        "2 line(s) after the table were not read: “Mittelwert;0,0086”",
    ] {
        assert!(read.notes.iter().any(|note| note.contains(told)), "{told}: {:?}", read.notes);
    }
    assert_eq!(read.prepared["data"]["output"], "wear_volume");
    let text = "sample;cycles;V [mm^3]\nA;1;0.5\nB;2;-9999\nC;3;< 0.01 mm^3\nD;4;9.91E+37\nE;5;0.25\nmean;3;0.15\nStd. dev.;2;0.1\n";
    let read = good(text);
    assert_eq!(values(&read, "V"), [Some(5e-10), None, None, None, Some(2.5e-10)]);
    for told in ["2 row(s) with means or sums were left out", "3 cell(s) of “V [mm^3]”"] {
        assert!(read.notes.iter().any(|note| note.contains(told)), "{:?}", read.notes);
    }
}

#[test]
fn numbers_have_errors_and_units() {
    let text = "cycles;V\n10000;0.0011 ± 0.0002 mm^3\n20000;0.0024 +/- 0.0003 mm^3\n30000;(0.0035 ± 0.0004) mm^3\n40000;\n";
    let read = good(text);
    assert_eq!(
        columns(&read),
        ["cycles in none: 4", "V in m^3: 4", "V sigma in m^3: 4"],
        "{:?}",
        read.notes
    );
    let sigma = &read.prepared["data"]["sigma"];
    assert!(
        (sigma[1].as_f64().unwrap() / 0.3e-12 - 1.0).abs() < 1e-12 && sigma[3].is_null(),
        "{sigma}"
    );
    let sigma = |text: &str| good(text).prepared["data"]["sigma"][0].as_f64().unwrap();
    for text in [
        "cycles;V\n1;0.2 mm^3 ± 5 %\n2;0.3 mm^3 ± 5 %\n",
        "cycles;V [mm^3];V sigma\n1;0.2;0.01\n",
        "cycles;V [mm^3];V sigma [%]\n1;0.2;5\n",
        "cycles;V\n1;(0.2 ± 0.01) mm^3\n",
    ] {
        assert!((sigma(text) / 1e-11 - 1.0).abs() < 1e-12, "{text}");
    }
    for cell in ["0.12 ± 0.01 x 10^-3 mm^3", "0.12 mm^3 ± 10 um^3"] {
        refused(format!("cycles;V\n1;{cell}\n2;{cell}\n").as_bytes(), &ALL);
    }
    let powers = good("cycles;depth\n1000;10 x 10^-6 m\n2000;1.2·10⁻⁵ m\n3000;1.5e-5 m\n");
    let depths: Vec<_> = values(&powers, "depth").into_iter().flatten().collect();
    for (depth, truth) in depths.iter().zip([1e-5, 1.2e-5, 1.5e-5]) {
        assert!((depth / truth - 1.0).abs() < 1e-12, "{depths:?}");
    }
    let quoted = good(
        "\"cycles\",\"V, worn\n(mm^3)\",note\n\"1 000\",\"0,5\",\"a \"\"b\"\", c\"\n\"2 000\",\"0,7\",\"two\nlines\"\n3000,\"0,9\",\n",
    );
    assert_eq!(columns(&quoted), ["cycles in none: 3", "V, worn in m^3: 3"], "{:?}", quoted.notes);
    assert_eq!(quoted.tables, [[3, 3]]);
    assert!(
        refused(b"a,b\n1,2\n3,\"4\n5,6\n7,8\n9,1\n", &ALL)
            .contains("The quotation mark that opens in line 3 is not closed")
    );
}

#[test]
fn units_are_found_behind_names_and_as_words() {
    for (header, name, unit, factor) in [
        ("dx_um", "dx", "m", 1e-6),
        ("X_(microns)", "X", "m", 1e-6),
        ("Lateral um", "Lateral", "m", 1e-6),
        ("Raw Micrometer", "Raw", "m", 1e-6),
        ("z [micron]", "z", "m", 1e-6),
        ("z (nanometres)", "z", "m", 1e-9),
        ("z [Å]", "z", "m", 1e-10),
        ("z / inches", "z", "m", 0.0254),
        ("F [gf]", "F", "N", 9.80665e-3),
        ("F (kgf)", "F", "N", 9.80665),
        ("F [Newton]", "F", "N", 1.0),
        ("F [kilonewtons]", "F", "N", 1e3),
        ("tilt [degree]", "tilt", "rad", std::f64::consts::PI / 180.0),
        ("k [mm3/N/m]", "k", "1/Pa", 1e-9),
        ("k [mm^3 N^-1 m^-1]", "k", "1/Pa", 1e-9),
        ("k [mm³·N⁻¹·m⁻¹]", "k", "1/Pa", 1e-9),
        ("alpha [um^3 J^-1]", "alpha", "m^3/J", 1e-18),
        ("S [N um^-1]", "S", "N/m", 1e6),
        ("t [sec]", "t", "s", 1.0),
        ("wear_volume_mm^3", "wear_volume", "m^3", 1e-9),
        ("Total Profile(Å)", "Total Profile", "m", 1e-10),
        ("V (cu mm)", "V", "m^3", 1e-9),
        ("V [cubic micrometers]", "V", "m^3", 1e-18),
        ("wear volume cubic mm", "wear volume", "m^3", 1e-9),
        ("kcycles", "cycles", "1", 1e3),
        ("cycles_k", "cycles", "1", 1e3),
        ("mcycles", "cycles", "1", 1e6),
        ("cycles (thousands)", "cycles", "1", 1e3),
        ("10^3 cycles", "cycles", "1", 1e3),
        ("N [Mcycles]", "N", "1", 1e6),
    ] {
        let read = good(&format!("{header};b\n1;2\n2;3\n"));
        let column = &read.columns[0];
        assert_eq!((&*column.name, column.unit.as_deref()), (name, Some(unit)), "{header}");
        assert!((column.values[0].unwrap() / factor - 1.0).abs() < 1e-12, "{header}: {column:?}");
    }
    for name in ["wear_volume", "run_1", "X_Value", "T_max", "mean_depth"] {
        assert_eq!(good(&format!("{name};b\n1;2\n2;3\n")).columns[0].name, name);
    }
}

#[test]
fn a_map_of_heights_is_refused_as_one() {
    let height = |row: u32, column: u32| f64::from((row * 7919 + column * 104_729) % 1000) * 1e-10;
    let map = |lines: u32, columns: u32| {
        "# Channel: Topography\n# Width: 12.00 µm\n# Height: 8.00 µm\n# Value units: m\n".to_owned()
            + &rows(lines, |row| {
                let cells = (0..columns).map(|column| format!("{:.5e}", height(row, column)));
                cells.collect::<Vec<_>>().join("\t") + "\n"
            })
    };
    for (lines, columns) in [(40, 60), (20, 30), (48, 128), (300, 200)] {
        let said = refused(map(lines, columns).as_bytes(), &ALL);
        assert!(said.contains(&format!("is a map of {lines} × {columns} heights")), "{said}");
        assert!(said.contains("two columns with names such as x [mm];z [um]"), "{said}");
    }
}

/// What a reader types wrongly: each message has the words that mend the file, and the mended file is read.
#[test]
fn each_message_leads_to_the_mend() {
    let volumes = "cycles;V [mm^3]\n1000;0.0021\n2000;0.0042\n5000;0.0108\n";
    let trace = "x;z\n".to_owned() + &rows(40, |at| format!("{at};{}\n", at % 3));
    let ring = "d;F\n".to_owned()
        + &rows(101, |at| {
            let angle = std::f64::consts::TAU * f64::from(at) / 100.0;
            format!("{:.5};{:.5}\n", 5.0 * libm::sin(angle), 80.0 * libm::cos(angle))
        });
    let told = |text: &str, prepare| {
        let said = |read: Measured| {
            (prepare == Prepare::Points && read.prepared["data"].is_null())
                .then(|| read.notes.join(" "))
        };
        match read(text.as_bytes(), &Wanted { prepare, ..ALL }) {
            Err(_) => refused(text.as_bytes(), &Wanted { prepare, ..ALL }),
            Ok(read) => said(read).unwrap_or_default(),
        }
    };
    for (from, typed, said) in [
        (" [mm^3]", "", "V [mm^3] for volumes, V [um] for depths"),
        ("V [mm^3]", "wear_volume", "choose the column with its unit as y: wear_volume [mm^3]"),
        ("0.0042", "0,0042", "Write all of them with the same decimal mark"),
        ("0.0042", "0.oo42", "Line 3: “0.oo42” in “V [mm^3]” is not a number"),
        ("1000;", "1000", "Line 2 has 1 cell(s), but the table has 2 columns"),
        (
            "2000;",
            "2000\t",
            "Line 3 has 1 cell(s), but the table has 2 columns. Separate the cells of all lines by semicolons",
        ),
        ("V [mm^3]", "wear_volume [10^-3 mm^3]", "Accepted units: m^3, cm^3, mm^3"),
        ("1000;0.0021", "1,000.0;2.1", "without separators of thousands"),
        ("2000;", "\"2000;", "opens in line 3 is not closed"),
        ("cycles", "t [s]", "x must be cycles or an energy"),
    ] {
        let message = told(&volumes.replace(from, typed), Prepare::Points);
        assert!(message.contains(said), "{said}: {message}");
    }
    let half = ring.replace("d;F", "d [um];F [N]").lines().take(45).collect::<Vec<_>>().join("\n");
    for (text, prepare, said) in [
        (
            volumes.replace(';', ",").replace("0.0", "0,0"),
            Prepare::Points,
            "the same separator in all lines",
        ),
        (trace, Prepare::Trace, "/x: must be a length. Add its unit, such as x [um]"),
        (ring.clone(), Prepare::Loop, "/y: must be a force. Add its unit, such as F [N]"),
        (half, Prepare::Loop, "Keep the rows of one or more whole cycles"),
    ] {
        let message = told(&text, prepare);
        assert!(message.contains(said), "{said}: {message}\n{text}");
    }
    let good = [volumes.to_owned(), volumes.replace('.', ","), volumes.replace('V', "wear_volume")];
    assert!(good.iter().all(|mended| told(mended, Prepare::Points).is_empty()));
    assert_eq!(told(&ring.replace("d;F", "d [um];F [N]"), Prepare::Loop), "");
}

/// Tables whose names, cells or shape say more than numbers do: they are read by it, or refused.
#[test]
fn names_cells_and_shape_of_a_table_are_obeyed() {
    let table = |head: &str, row: fn(u32) -> String| format!("{head}\n") + &rows(5, row);
    let x = |read: &Measured| read.prepared["data"]["x"].clone();
    let volumes = table("cycles;V [mm^3]", |at| format!("{}000;0.{at}1\n", at + 1));
    let powers = "cycles;V [mm^3]\n1000;0.01\n2e3;0.11\n3·10^3;0.21\n4*10^3;0.31\n5 x 10³;0.41\n";
    for text in [
        table("No.;cycles;V [mm^3]", |at| format!("{at};{}000;0.{at}1\n", at + 1)),
        table(";cycles;V [mm^3]", |at| format!("{at};{}000;0.{at}1\n", at + 1)),
        powers.to_owned(),
        volumes.replace("3000;", "#2500;7\n3000;"),
    ] {
        let read = good(&text);
        assert_eq!(read.prepared, good(&volumes).prepared, "{text}: {:?}", read.notes);
    }
    assert_eq!(x(&good("cycles;V [mm^3]\n10^4;0.1\n10⁵;0.2\n"))[1], 1e5);
    for (text, told) in [
        (
            volumes.replace("3000;", "#2500;7\n3000;"),
            "1 row(s) that begin with # were left out, the first in line 4",
        ),
        (
            table("N;V1 [mm^3];V2 [mm^3];SD [mm^3]", |at| format!("{at};1;2;3\n")),
            "not used: “V2”, “SD”. Name standard deviations of y “V1 sigma”",
        ),
        (table("No.;V [mm^3]", |at| format!("{at};1\n")), "x must be cycles"),
    ] {
        let notes = good(&text).notes.join("\n");
        assert!(notes.contains(told), "{told}: {notes}");
    }
    for (text, told) in [
        ("cycles;1000;2000;5000\nV [mm^3];0.1;0.2;0.3\n".to_owned(), "Transpose the table"),
        (
            "cycles;1000;2000\nV [mm^3];0.1;0.2\nF [N];7;7\nh [um];1;2\n".to_owned(),
            "Transpose the table",
        ),
        (table("cycles;log10(V) [mm^3]", |at| format!("{at};1\n")), "/y: has values of log10"),
        (table("ln N;V [mm^3]", |at| format!("{at};1\n")), "/x: has values of ln, as its name"),
        (table("N;V_log [mm^3]", |at| format!("{at};1\n")), "/y: has values of log, as its name"),
        (table("N;dV [mm^3]", |at| format!("{at};1\n")), "/y: has the increments between readings"),
        (
            table("cycles;ΔV [mm^3]", |at| format!("{at};1\n")),
            "/y: has the increments between readings",
        ),
        (
            volumes.replace("000;0.", ",000;"),
            "“5,000” can be 5000 or 5.000. Write decimal=\".\" (--decimal .) if its mark separates",
        ),
        (
            volumes.replace("000;0.", ".000;"),
            "decimal=\".\" (--decimal .) if it is the decimal mark",
        ),
    ] {
        let said = refused(text.as_bytes(), &ALL);
        assert!(said.contains(told), "{told}: {said}");
    }
    for (mark, decimal, value) in
        [(",", '.', 5e3), (".", ',', 5e3), (",", ',', 5.0), (".", '.', 5.0)]
    {
        let text = volumes.replace("000;0.", &format!("{mark}000;"));
        let read = read(text.as_bytes(), &Wanted { decimal: Some(decimal), ..ALL }).unwrap();
        assert_eq!(x(&read)[4], value, "{mark}{decimal}");
    }
    let said = refused(powers.replace('.', ",").as_bytes(), &Wanted { decimal: Some('.'), ..ALL });
    assert!(said.contains("is no number with decimal=\".\""), "{said}");
}

/// Only a friction force makes a loop.
#[test]
fn a_normal_force_is_never_taken_as_friction() {
    let ring = |head: &str| {
        format!("{head}\n")
            + &rows(101, |at| {
                let angle = std::f64::consts::TAU * f64::from(at) / 100.0;
                format!("100;{:.5};{:.5};{at}\n", 80.0 * libm::cos(angle), 5.0 * libm::sin(angle))
            })
    };
    let wanted = Wanted { prepare: Prepare::Loop, ..ALL };
    for head in [
        "Fn [N];Ft [N]",
        "Normal force [N];F [N]",
        "load [N];Q [N]",
        "F [N];friction [N]",
        "F_z [N];F_x [N]",
    ] {
        let read = read(ring(&format!("{head};d [um];n")).as_bytes(), &wanted).unwrap();
        let energy = read.prepared["energy_per_cycle"].as_f64().unwrap();
        assert!((energy / (400e-6 * std::f64::consts::PI) - 1.0).abs() < 1e-3, "{head}: {energy}");
    }
    for head in ["F1 [N];F2 [N]", "Fn [N];P [N]", "Fn [N];t [s]"] {
        let text = ring(&format!("{head};d [um];n"));
        let said = refused(text.as_bytes(), &wanted);
        assert!(
            said.contains("/y: must be the friction force, but its name does not decide"),
            "{said}"
        );
        let name = said.split("y=").nth(1).unwrap();
        assert!(read(text.as_bytes(), &Wanted { y: Some(name), ..wanted }).is_ok(), "{name}");
    }
}

/// The values of y of a file, or its faults.
fn numbers(text: &str, decimal: Option<char>) -> Result<serde_json::Value, String> {
    let wanted = Wanted { decimal, ..Wanted::of(Prepare::Points) };
    let found = read(text.as_bytes(), &wanted).map_err(|faults| faults.0[0].detail.clone())?;
    Ok(found.prepared["data"]["y"].clone())
}

#[test]
fn marks_comments_and_numbers_in_names_are_no_traps() {
    let y = |text: &str, decimal| numbers(text, decimal).unwrap();
    assert_eq!(y("N,h [um]\n1000,1.234\n2000,2.345\n", None).as_array().unwrap().len(), 2);
    assert!(numbers("N;h [um]\n1000;0,500\n2000;0,700\n", Some('.')).is_err());
    assert_eq!(
        y("N;h [m]\n#1000;9\n2000;2\n# 3000;9\n4000;4\n", None),
        serde_json::json!([2.0, 4.0])
    );
    assert!(y("cycles;V 3\n1000;1\n2000;2\n", None).is_null());
}
