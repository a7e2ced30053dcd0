//! Files of measured numbers: by the API, and by the command `fit`.

use std::fmt::Write as _;
use std::fs;

use fretwork::http::{DOCUMENT, Limits};
use fretwork_job::Submission;
use fretwork_random::Stream;
use fretwork_store::Role;
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::access::{made, server};
use crate::program::run;
use crate::server::{Reply, Server, example, metric};

const PATH: &str = "/v1/measurements";
const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/measured/volumes.csv");
const BALL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/steel-ball.json");
/// Wear coefficient, friction and relative noise of the example.
const TRUTH: (f64, f64, f64) = (4.2e-14, 0.62, 0.05);

async fn sent(server: &Server, query: &str, kind: &str, body: &[u8]) -> Reply {
    server.send("POST", &format!("{PATH}{query}"), &[("Content-Type", kind)], body).await
}

/// A standard normal number, from twelve uniform ones.
fn normal(stream: Stream, place: u64) -> f64 {
    (0..12).map(|at| stream.at(12 * place + at) as f64 / 2f64.powi(64)).sum::<f64>() - 6.0
}

/// The steel ball after these cycles, with the numbers of the example.
fn truth(cycles: &[f64]) -> Value {
    let mut job = example("steel-ball");
    let (coefficient, friction, _) = TRUTH;
    let scenario = &mut job["scenario"];
    scenario["wear"]["coefficient"] = json!(coefficient);
    scenario["friction"] = json!(friction);
    scenario["cycles"] = json!(cycles);
    scenario["model"] = json!({"method": "exact", "tolerance": 1e-4});
    let prepared = Submission::parse(job.to_string().as_bytes()).unwrap().prepared;
    serde_json::from_slice(&prepared.compute(|_| {}).body).unwrap()
}

#[test]
fn the_example_follows_from_its_seed() {
    let cycles = [1e3, 2e3, 5e3, 1e4, 2e4, 5e4];
    let volumes = truth(&cycles);
    let mut text = "Synthetic volumes of examples/steel-ball.json with k_w = 4.2e-5 mm^3/(N m)\n\
        friction 0.62, noise 5 %, seed 38\n\
        cycles;wear_volume [µm³]\n"
        .to_owned();
    for (place, cycles) in cycles.iter().enumerate() {
        let volume = volumes["history"]["wear_volume"][place + 1].as_f64().unwrap();
        let noise = 1.0 + TRUTH.2 * normal(Stream::new(38), place as u64);
        let volume = format!("{:.1}", volume * noise * 1e18).replace('.', ",");
        writeln!(text, "{cycles};{volume}").unwrap();
    }
    text.push_str("100000;\n");
    assert_eq!(fs::read_to_string(FILE).unwrap_or_default(), text, "{text}");
}

/// The lines that a command prints.
fn said(words: &[&str], input: &str) -> (Option<i32>, String, String) {
    let output = run(words, input);
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

/// This takes more than 5 s, because a fit computes hundreds of runs.
#[test]
fn the_command_fits_the_example_and_predicts() {
    let words = ["fit", FILE, BALL, "--x", "cycles", "--relative", "0.05"];
    // Below this friction, the data have a second minimum.
    let range =
        ["--parameter", "/wear/coefficient=1e-16..1e-11", "--parameter", "/friction=0.4..1.5"];
    let (code, out, err) = said(&[&words[..], &range].concat(), "");
    assert_eq!(code, Some(0), "{err}");
    // The numbers of a line, without its words.
    let numbers = |begin: &str| -> Vec<f64> {
        let line = out.lines().find(|line| line.trim_start().starts_with(begin));
        let line = line.unwrap_or_else(|| panic!("no {begin}: {out}")).split_once(':').unwrap().1;
        line.split([' ', '(', ')', ',']).filter_map(|word| word.parse().ok()).collect()
    };
    let (coefficient, friction, _) = TRUTH;
    for (pointer, truth) in [("/wear/coefficient", 1e9 * coefficient), ("/friction", friction)] {
        let [estimate, low, high] = numbers(pointer)[..] else { panic!("{out}") };
        assert!(low < truth && truth < high && low < estimate && estimate < high, "{out}");
        assert!(high / low < 1.7, "{out}");
    }
    let later = truth(&[1e5])["history"]["wear_volume"][1].as_f64().unwrap() * 1e9;
    let [predicted, low, high] = numbers("100000 cycles")[..] else { panic!("{out}") };
    assert!(low < later && later < high && low < predicted && predicted < high, "{later}: {out}");
    for told in [
        "Cells are separated by semicolons.",
        "2 line(s) before the table were not read: “Synthetic volumes",
        "Commas are decimal marks",
        "“wear_volume” was read in µm³.",
        "measured -",
        "one wear coefficient describes these data if their errors are as assumed.",
    ] {
        assert!(out.contains(told), "{told}: {out}");
    }
    let (_, out, _) = said(&words, "");
    assert!(out.contains("Two minima describe the data about as well"), "{out}");
    // The errors are five times as large as this says.
    let (_, out, _) = said(&["fit", FILE, BALL, "--relative", "0.01"], "");
    let told = [
        "does not hold for these data.\n",
        "intervals of 95 %: The interval assumes that the law holds.",
    ];
    assert!(told.iter().all(|told| out.contains(told)), "{out}");
    assert_eq!(out.matches("times as large").count(), 1, "{out}");
}

/// Volumes in um^3, of which the file says that they are in mm^3, or 1e6 times them. Where wear ends, no coefficient gives them.
#[test]
fn the_question_for_a_unit_names_the_unit_that_was_read() {
    let mut scenario = example("steel-ball")["scenario"].clone();
    scenario["load"]["held"] = json!("depth");
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("held.json");
    fs::write(&path, scenario.to_string()).unwrap();
    scenario["cycles"] = json!([1e3, 1e4, 1e5]);
    let run = Submission::parse(json!({"scenario": scenario}).to_string().as_bytes()).unwrap();
    let run: Value = serde_json::from_slice(&run.prepared.compute(|_| {}).body).unwrap();
    for (unit, scale, told) in [
        (
            "mm³",
            1e18,
            "about 1e9 times those that `wear.coefficient` = 3.03e-14 gives. Are they in mm^3 instead of m^3? Are they in um^3 \
             instead of mm^3? Enter their unit.\n",
        ),
        (
            "um^3",
            1e24,
            "about 1e6 times those that `wear.coefficient` = 3.03e-14 gives. Are they in cm^3 instead of m^3?",
        ),
    ] {
        let volume = |at: usize| run["history"]["wear_volume"][at].as_f64().unwrap() * scale;
        let rows = [(1, "1e3"), (2, "1e4"), (3, "1e5")];
        let rows = rows.map(|(at, cycles)| format!("{cycles},{}\n", volume(at)));
        let table = format!("cycles,wear_volume [{unit}]\n{}", rows.concat());
        let words = ["fit", "-", path.to_str().unwrap(), "--relative", "0.05"];
        let (_, out, err) = said(&words, &table);
        assert!(out.contains(told), "{told}: {out} {err}");
    }
}

#[test]
fn the_command_reads_a_scenario_alone_and_prints_the_job() {
    let dir = TempDir::new().unwrap();
    let scenario = dir.path().join("scenario.json");
    fs::write(&scenario, example("steel-ball")["scenario"].to_string()).unwrap();
    let scenario = scenario.to_str().unwrap();
    let words = [
        "fit",
        FILE,
        scenario,
        "--parameter",
        "/friction=0.2..1.1",
        "--sigma",
        "20 um^3",
        "--print",
    ];
    let (code, out, err) = said(&words, "");
    assert_eq!(code, Some(0), "{err}");
    let job: Value = serde_json::from_str(&out).unwrap();
    let parameter = json!({"pointer": "/friction", "from": 0.2, "to": 1.1, "spacing": "linear"});
    assert_eq!(job["fit"]["parameters"], json!([parameter]));
    assert_eq!(job["fit"]["tests"][0]["data"][0]["sigma"], "20 um^3");
    assert!(Submission::parse(out.as_bytes()).is_ok());
    let table = "cycles;wear_volume [mm^3]\n1000;4,6e-6\n2000;9,6e-6\n";
    let (_, out, _) = said(&["fit", "-", scenario, "--print"], table);
    let job: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(job["fit"]["parameters"].as_array().unwrap().len(), 1, "two points give one number");
    assert_eq!(job["fit"]["tests"][0]["data"][0]["noise"], json!({"kind": "normal"}));
    for (words, input, told) in [
        (&["-", BALL][..], "a;b\n1;2\n3;x\n4;5\n", "Line 3: “x” in “b” is not a number"),
        (&["-", BALL, "--y", "volume"], table, "/y: unknown column `volume`"),
        (&["-", BALL, "--at", "1000"], table, "/x: must be a length"),
        (&["-", BALL, "--sigma", "1 N"], table, "--sigma: \"N\" is the unit of a force"),
        (
            &["-", BALL, "--density", "0"],
            "N;mass_loss [mg]\n1000;1\n2000;2\n",
            "--density: belongs",
        ),
        (&["-", BALL], "N;V (1e-3 mm3)\n1000;1\n", "“V” stays in the unknown unit 1e-3 mm3"),
        (
            &["-", BALL],
            "N;wear_volume [um]\n1000;1\n",
            "/y: is the output wear_volume in the unit m",
        ),
        (&["-", BALL], "cycles;V\n1;2\n3;4\n", "V [mm^3] for volumes, V [um] for depths"),
    ] {
        let (code, _, err) = said(&[&["fit"], words].concat(), input);
        assert!(code == Some(2) && err.contains(told), "{told}: {err}");
    }
    assert!(said(&["fit", FILE, FILE], "").2.contains("volumes.csv: expected value"));
}

#[test]
fn the_command_keeps_a_friction_that_the_data_need() {
    // The friction is open, but its value in the scenario contradicts the data.
    let (code, out, err) = said(&["fit", FILE, BALL, "--sigma", "3000 um^3"], "");
    assert_eq!(code, Some(0), "{err}");
    assert!(out.contains("  /friction: ") && out.contains("open"), "{out}");
    assert!(!out.contains("do not tell the friction") && !out.contains("does not hold"), "{out}");
    // Two points cannot contradict it.
    let (_, out, _) = said(
        &["fit", "-", BALL, "--relative", "0.5"],
        "N;wear_volume [mm^3]\n1000;4,6e-6\n2000;9,6e-6\n5000;2,4e-5\n",
    );
    assert!(out.contains("do not tell the friction"), "{out}");
}

#[test]
fn the_command_fits_a_mass_loss_with_its_density() {
    let volumes = fs::read_to_string(FILE).unwrap().replace("wear_volume [µm³]", "mass_loss [µg]");
    let words = ["--relative", "0.05", "--parameter", "/wear/coefficient=1e-16..1e-11"];
    let (_, volume, _) = said(&[&["fit", FILE, BALL], &words[..]].concat(), "");
    // 1 µm³ weighs 1 µg.
    let (_, mass, err) =
        said(&[&["fit", "-", BALL, "--density", "1e9"], &words[..]].concat(), &volumes);
    let line =
        |out: &str| out.lines().find(|line| line.contains("/wear/coefficient:")).map(str::to_owned);
    assert_eq!(line(&mass), line(&volume), "{err}");
    assert!(line(&mass).is_some(), "{err}");
}

/// The worn ball after 20 000 cycles, as a profilometer measures it.
fn trace() -> String {
    let profiles = &truth(&[2e4])["profiles"];
    let list = |name: &str| -> Vec<f64> {
        let all = profiles[name].as_array().unwrap();
        let last = if all[0].is_array() { all.last().unwrap() } else { &profiles[name] };
        serde_json::from_value(last.clone()).unwrap()
    };
    let (radius, wear) = (list("radius"), list("wear"));
    let row = |place: u64| {
        let x = place as f64 * 1e-6 - 350e-6;
        let after = radius.partition_point(|r| *r < x.abs()).min(radius.len() - 1);
        let z = 2e-3 * x - x * x / 0.02 - wear[after] + 10e-9 * normal(Stream::new(7), place);
        format!("{:.1}\t{:.4}\n", x * 1e6, z * 1e6)
    };
    "x [um]\tz [um]\n".to_owned() + &(0..701).map(row).collect::<String>()
}

#[test]
fn the_command_fits_a_trace() {
    let mut job = example("steel-ball");
    job["scenario"]["friction"] = json!(TRUTH.1);
    let dir = TempDir::new().unwrap();
    let (file, scenario) = (dir.path().join("trace.txt"), dir.path().join("job.json"));
    fs::write(&file, trace()).unwrap();
    fs::write(&scenario, job.to_string()).unwrap();
    let words = [
        "fit",
        file.to_str().unwrap(),
        scenario.to_str().unwrap(),
        "--at",
        "20000",
        "--parameter",
        "/wear/coefficient=1e-16..1e-12",
    ];
    let (code, out, err) = said(&words, "");
    assert_eq!(code, Some(0), "{err}");
    println!("{out}");
    let line = out.lines().find(|line| line.contains("/wear/coefficient:")).unwrap();
    let estimate: f64 = line.split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!((estimate / (1e9 * TRUTH.0) - 1.0).abs() < 0.05, "{out}");
    assert!(out.contains("Left and right were averaged."), "{out}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_server_reads_a_file_and_keeps_nothing() {
    let server = Server::start().await;
    let bytes = fs::read(FILE).unwrap();
    let reply = sent(&server, "?x=cycles&y=wear_volume", "text/csv", &bytes).await;
    assert_eq!((reply.status, reply.header("cache-control")), (200, Some("no-store")));
    let read = reply.json();
    assert_eq!(read["columns"][0]["name"], "cycles");
    assert_eq!(read["columns"][1]["unit"], "m^3");
    assert_eq!(read["columns"][1]["dimension"], "volume");
    assert_eq!(read["columns"][1]["values"][6], Value::Null);
    let data = &read["prepared"]["data"];
    assert_eq!(data["y"], read["columns"][1]["values"]);
    // The data go into a fit as they are, but for the noise.
    let mut data = data.clone();
    data["relative"] = json!(0.05);
    let fit = json!({"fit": {
        "scenario": example("steel-ball")["scenario"],
        "parameters": [{"pointer": "/friction", "from": 0.1, "to": 1.5}],
        "tests": [{"data": [data]}],
    }});
    assert!(Submission::parse(fit.to_string().as_bytes()).is_ok());
    for kind in ["text/plain", "application/octet-stream"] {
        assert_eq!(sent(&server, "?x=cycles&y=wear_volume", kind, &bytes).await.json(), read);
    }
    let profile = sent(&server, "?prepare=trace", "text/plain", trace().as_bytes()).await.json();
    assert_eq!(profile["prepared"]["data"]["profile"], "wear");
    let radius = profile["prepared"]["trace"]["radius"].as_f64().unwrap();
    assert!((radius / 0.01 - 1.0).abs() < 0.01, "{radius}");
    let free =
        sent(&server, "?prepare=trace&centre=false&level=false", "text/plain", trace().as_bytes())
            .await;
    assert_eq!(free.json()["prepared"]["trace"]["centre"], 0.0);
    // The ends that were found choose the same scar. An end with another unit is another way to write them.
    let found = &profile["prepared"]["trace"];
    let volume = |trace: &Value| trace["volume_removed"]["value"].as_f64().unwrap();
    for scar in ["-0.28..0.28mm", "-280um..0.28 mm"] {
        let query = format!("?prepare=trace&up=out&scar={}", scar.replace(' ', "%20"));
        let chosen = sent(&server, &query, "text/plain", trace().as_bytes()).await.json();
        let chosen = volume(&chosen["prepared"]["trace"]);
        assert!((chosen / volume(found) - 1.0).abs() < 0.02, "{chosen} {found}");
    }
    let turned = sent(&server, "?prepare=trace&up=in", "text/plain", trace().as_bytes()).await;
    let problem = turned.problem(422, "invalid-parameters");
    assert!(problem["errors"][0]["detail"].as_str().unwrap().contains("write up=out"), "{problem}");
    assert_eq!(server.get("/v1/jobs").await.json()["jobs"], json!([]));
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_files_and_parameters_are_refused_with_a_remedy() {
    let server = Server::start().await;
    let table = b"cycles;volume\n1;2\n3;4\n";
    for (body, told) in [
        (&b"\x89PNG\r\n"[..], "a PNG picture. Save the table as CSV"),
        (b"{\"a\": 1}", "a JSON document"),
        (b"a;b\n1;2\n3\t4\n5;6\n", "Line 3 has 1 cell(s)"),
        (b"", "no table"),
    ] {
        let problem = sent(&server, "", "text/csv", body).await.problem(422, "unreadable-file");
        assert!(problem["detail"].as_str().unwrap().contains(told), "{problem}");
    }
    for (query, parameter, told) in [
        ("?y=volumes", "y", "Did you mean `volume`?"),
        ("?prepare=trace", "x", "must be a length"),
        ("?prepare=all", "prepare", "must be one of points, trace, half, loop"),
        ("?level=2", "level", "true or false"),
        ("?up=down", "up", "must be out or in"),
        ("?scar=0.4..1.6", "scar", "must be FROM..TO with a unit of length"),
        ("?scar=1.6..0.4mm", "scar", "the smaller one first, such as 0.4..1.6mm"),
        ("?z=1", "z", "is unknown"),
    ] {
        let problem =
            sent(&server, query, "text/csv", table).await.problem(422, "invalid-parameters");
        let error = &problem["errors"][0];
        assert_eq!(error["parameter"], parameter, "{problem}");
        assert!(error["detail"].as_str().unwrap().contains(told), "{problem}");
    }
    let one = b"x [um];z [um]\n1;2\n";
    let problem =
        sent(&server, "?prepare=trace", "text/csv", one).await.problem(422, "invalid-parameters");
    assert!(
        problem["errors"][0]["detail"].as_str().unwrap().contains("needs 30 rows"),
        "{problem}"
    );
    let large = vec![b'1'; (4 << 20) + 1];
    sent(&server, "", "text/csv", &large).await.problem(413, "body-too-large");
    let rows = "a;b\n".to_owned() + &"1;2\n".repeat(1_000_001);
    let problem =
        sent(&server, "", "text/csv", rows.as_bytes()).await.problem(422, "unreadable-file");
    assert!(problem["detail"].as_str().unwrap().contains("more than 1000000 rows"), "{problem}");
    let wide = "1;".repeat(63) + "1\n";
    let most = wide.repeat((4 << 20) / wide.len());
    let reply = sent(&server, "", "text/csv", most.as_bytes()).await;
    assert_eq!(reply.status, 200);
    assert!(reply.body.len() < 8 * most.len(), "{}", reply.body.len());
    assert!(metric(server.address, "fretwork_transfers_bytes").await < 1.0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mark_that_can_be_either_is_asked_for() {
    let server = Server::start().await;
    let table = b"cycles;wear_volume [mm^3]\n1,000;1\n2,000;2\n";
    let problem = sent(&server, "", "text/csv", table).await.problem(422, "unreadable-file");
    let detail = problem["detail"].as_str().unwrap();
    assert!(detail.contains("“2,000” can be 2000 or 2.000. Write decimal=\".\""), "{detail}");
    for (mark, values) in [(".", [1e3, 2e3]), ("%2C", [1.0, 2.0])] {
        let read = sent(&server, &format!("?decimal={mark}"), "text/csv", table).await.json();
        assert_eq!(read["columns"][0]["values"], json!(values), "{mark}");
    }
    let problem =
        sent(&server, "?decimal=x", "text/csv", table).await.problem(422, "invalid-parameters");
    assert_eq!(problem["errors"][0]["parameter"], "decimal", "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn reading_needs_the_role_of_evaluations_and_counts_as_one() {
    let server =
        server(Limits { evaluations: std::num::NonZeroU32::new(2), ..Limits::default() }).await;
    let asked = async |key: &str| {
        let headers = [("Authorization", &*format!("Bearer {key}")), ("Content-Type", "text/csv")];
        server.send("POST", PATH, &headers, "a;b\n1;2\n").await
    };
    let reader = made(server.place(), "reader", Role::Read).await;
    asked(&reader).await.problem(403, "forbidden");
    let submitter = made(server.place(), "submitter", Role::Submit).await;
    assert_eq!((asked(&submitter).await.status, asked(&submitter).await.status), (200, 200));
    asked(&submitter).await.problem(429, "rate-limited");
    let path = &serde_json::from_slice::<Value>(DOCUMENT).unwrap()["paths"][PATH]["post"];
    assert_eq!(path["operationId"], "read_measurements");
}

#[test]
fn the_command_reads_a_scenario_with_the_mark_of_an_editor() {
    let dir = TempDir::new().unwrap();
    let text = example("steel-ball").to_string();
    let utf16: Vec<u8> =
        format!("\u{feff}{text}").encode_utf16().flat_map(u16::to_le_bytes).collect();
    let table = "cycles;wear_volume [mm^3]\n1000;4,6e-6\n2000;9,6e-6\n";
    let print = |scenario: &str| said(&["fit", "-", scenario, "--print"], table);
    let plain = print(BALL);
    for (name, bytes) in
        [("utf8.json", format!("\u{feff}{text}").into_bytes()), ("utf16.json", utf16)]
    {
        let file = dir.path().join(name);
        fs::write(&file, &bytes).unwrap();
        let file = file.to_str().unwrap();
        let marked = print(file);
        assert_eq!((marked.0, &marked.1), (Some(0), &plain.1), "{name}: {}", marked.2);
        let (code, _, err) = said(&["run", file, "--set", "/friction=much"], "");
        assert!(code == Some(2) && err.contains("/scenario/friction"), "{name}: {err}");
    }
}

#[test]
fn the_command_chooses_a_table() {
    let tables = "cycles;wear_volume [mm^3]\n1;2\n3;4\n5;6\n\nSecond\ncycles;wear_volume [mm^3]\n1000;4e-6\n2000;9e-6\n3000;14e-6\n";
    let (code, out, err) = said(&["fit", "-", BALL, "--table", "2", "--print"], tables);
    assert_eq!(code, Some(0), "{err}");
    let job: Value = serde_json::from_str(&out).unwrap();
    assert_eq!(job["fit"]["tests"][0]["data"][0]["x"], json!([1000.0, 2000.0, 3000.0]));
    let (code, _, err) = said(&["fit", "-", BALL, "--table", "3"], tables);
    assert!(code == Some(2) && err.contains("The file has 2 table(s), and no table 3"), "{err}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_server_cuts_a_record_of_loops_into_cycles() {
    let server = Server::start().await;
    let row = |row: u32| {
        let (angle, size) =
            (std::f64::consts::TAU * f64::from(row) / 50.0, if row < 100 { 20.0 } else { 10.0 });
        format!("{};{:.6};{:.6}\n", row, size * angle.sin(), 3.0 + size * (angle + 0.5).sin())
    };
    let file = "row;d [um];F [gf]\n".to_owned() + &(0..225).map(row).collect::<String>();
    let reply = sent(&server, "?prepare=loop", "text/csv", file.as_bytes()).await.json();
    let prepared = &reply["prepared"];
    assert_eq!((&prepared["cycles"], &reply["tables"]), (&json!(4), &json!([[2, 225]])), "{reply}");
    let truth = std::f64::consts::PI * 20e-6 * 20.0 * 9.80665e-3 * 0.5f64.sin();
    for (energy, share) in
        prepared["loops"]["energy"].as_array().unwrap().iter().zip([1.0, 1.0, 0.25, 0.25])
    {
        assert!((energy.as_f64().unwrap() / (truth * share) - 1.0).abs() < 0.01, "{prepared}");
    }
    assert!((prepared["energy_per_cycle"].as_f64().unwrap() / (0.625 * truth) - 1.0).abs() < 0.01);
    sent(&server, "?table=2", "text/csv", file.as_bytes()).await.problem(422, "unreadable-file");
}
