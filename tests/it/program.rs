//! The commands of the program, their output and their exit codes.

use std::io::{BufRead as _, BufReader, Write as _};
use std::net::TcpListener;
use std::ops::{Deref, DerefMut};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};

use fretwork::http;
use serde_json::Value;
use tempfile::TempDir;

const BALL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/examples/steel-ball.json");

pub fn fretwork(words: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fretwork"));
    command.args(words);
    command
}

pub fn run(words: &[&str], input: impl AsRef<[u8]>) -> Output {
    let mut command = fretwork(words);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    // A command that does not read its input closes the pipe.
    let _ = child.stdin.take().unwrap().write_all(input.as_ref());
    child.wait_with_output().unwrap()
}

pub fn text(bytes: &[u8]) -> &str {
    std::str::from_utf8(bytes).unwrap()
}

/// Starts a server on a free port. Returns the address that it prints.
pub fn serve(dir: &Path, options: &[&str]) -> (Running, String) {
    serve_by(fretwork(options), dir)
}

/// A server process that is killed when the test ends.
pub struct Running(pub Child);

impl Deref for Running {
    type Target = Child;
    fn deref(&self) -> &Child {
        &self.0
    }
}

impl DerefMut for Running {
    fn deref_mut(&mut self) -> &mut Child {
        &mut self.0
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // The process may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts a server by a prepared command.
pub fn serve_by(mut command: Command, dir: &Path) -> (Running, String) {
    command.args(["--listen", "127.0.0.1:0", "--data-dir"]).arg(dir).env("FRETWORK_LOG", "off");
    command.env("FRETWORK_CRASH_PAUSE", "0s");
    let mut child = Running(command.stdout(Stdio::piped()).spawn().unwrap());
    let mut lines = BufReader::new(child.stdout.as_mut().unwrap()).lines();
    let first = lines.next().unwrap().unwrap();
    let address = first.rsplit(' ').next().unwrap().to_owned();
    assert!(address.starts_with("http://127.0.0.1:"), "{first}");
    let curl = lines.map(Result::unwrap).find(|line| line.starts_with("curl ")).unwrap();
    assert!(curl.contains(&format!("'{address}/v1/jobs?include=result'")), "{curl}");
    let body = curl.split_once("-d '").unwrap().1.trim_end_matches('\'');
    let shown: Value = serde_json::from_str(body).unwrap();
    assert_eq!(shown, serde_json::from_str::<Value>(http::EXAMPLES[0].body).unwrap());
    (child, address)
}

/// Asserts one line on standard error and the exit code 1.
pub fn fails(output: &Output, words: &str) {
    let said = text(&output.stderr);
    assert_eq!((output.status.code(), said.lines().count()), (Some(1), 1), "{said}");
    assert!(said.starts_with("fretwork: ") && said.contains(words), "{said}");
}

#[test]
fn the_run_command_computes_a_file_without_a_server() {
    let output = run(&["run", BALL], "");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let result: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(result["regime"], "partial_slip");
    assert!(text(&output.stderr).contains("Wear volume"), "{}", text(&output.stderr));

    let output = run(&["run", "-", "--format", "csv"], http::EXAMPLES[0].body);
    let csv = text(&output.stdout);
    assert!(csv.starts_with("# fretwork history\n"), "{csv}");
    assert!(csv.contains(&format!("# key: {}\n", result["key"].as_str().unwrap())), "{csv}");
    assert_eq!(csv.lines().filter(|line| !line.starts_with('#')).count(), 7);
}

#[test]
fn a_result_is_written_to_a_file_in_every_format() {
    let dir = TempDir::new().unwrap();
    for (format, begins) in [
        ("json", "{\"key\""),
        ("csv", "# fretwork"),
        ("ndjson", "{\"key\""),
        ("npz", "PK"),
        ("arrow", "ARROW1"),
    ] {
        let file = dir.path().join(format);
        let words = ["run", BALL, "--format", format, "--output", file.to_str().unwrap()];
        let output = run(&words, "");
        assert!(output.status.success(), "{}", text(&output.stderr));
        assert!(output.stdout.is_empty());
        let written = std::fs::read(&file).unwrap();
        assert!(written.starts_with(begins.as_bytes()), "{format}");
        assert!(run(&words[..4], "").stdout == written, "{format}");
    }
    let made = dir.path().join("new/one/r.csv");
    assert!(run(&["run", BALL, "-o", made.to_str().unwrap()], "").status.success());
    assert!(made.is_file());
    fails_on(BALL, "r.txt", "End the name with one of .json, .ndjson, .csv, .npz, .arrow");
}

fn fails_on(input: &str, output: &str, words: &str) {
    let output = run(&["run", input, "-o", output], "");
    assert!(text(&output.stderr).contains(words), "{}", text(&output.stderr));
    assert_eq!(output.status.code(), Some(1));
}

#[test]
fn several_files_and_changed_scenarios_are_computed() {
    let (inputs, results) = (TempDir::new().unwrap(), TempDir::new().unwrap());
    let job: Value = serde_json::from_str(http::EXAMPLES[0].body).unwrap();
    std::fs::write(inputs.path().join("a.json"), job.to_string()).unwrap();
    std::fs::write(inputs.path().join("b.json"), job["scenario"].to_string()).unwrap();
    let input = inputs.path().to_str().unwrap();
    let set = ["--set", "/friction=0.6", "--set", "/model/points=64", "--units", "engineering"];
    let mut words = vec!["run", input, "-o", results.path().to_str().unwrap()];
    words.extend(set);
    let output = run(&words, "");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let read = |name| std::fs::read(results.path().join(name)).unwrap();
    let result: Value = serde_json::from_slice(&read("a.json")).unwrap();
    assert_eq!(read("a.json"), read("b.json"));
    assert_eq!(result["scenario"]["friction"], 0.6);
    assert_eq!(result["units"]["wear_volume"], "mm^3");
    fails_on(input, "r.csv", "is not a directory, which several files need");
    fails(&run(&["run", input, "--plot", "p.svg"], ""), "p.svg is not a directory, which several");
    // A file that cannot be read or drawn does not hinder the others.
    let more = results.path().join("more");
    let more = more.to_str().unwrap();
    let sweep = "examples/studies/sweep.json";
    let output = run(&["run", "none.json", sweep, input, "--plot", more, "-o", more], "");
    assert_eq!(output.status.code(), Some(1), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("cannot read none.json"), "{}", text(&output.stderr));
    for name in ["sweep.json", "a.json", "b.svg"] {
        assert!(results.path().join("more").join(name).is_file(), "{name}");
    }
    fails(
        &run(&["run", sweep, "--part", "1/2", "-o", "x.json"], ""),
        "name that file instead of --output",
    );
    fails(&run(&["run", BALL, "--set", "/no/such=1"], ""), "the scenario in");
}

#[test]
fn several_files_are_computed_at_the_same_time_and_printed_in_their_order() {
    let dir = TempDir::new().unwrap();
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let ball: Value = serde_json::from_str(http::EXAMPLES[0].body).unwrap();
    let job = |number: usize| {
        let mut scenario = ball["scenario"].clone();
        scenario["friction"] = (0.5 + number as f64 / 100.0).into();
        scenario["profiles_at"] = "none".into();
        serde_json::json!({"scenario": scenario}).to_string()
    };
    let files: Vec<_> = (0..10).map(|number| at(&format!("{number:02}.json"))).collect();
    for (number, file) in files.iter().enumerate() {
        std::fs::write(file, if number == 7 { "{}".to_owned() } else { job(number) }).unwrap();
    }
    let input = dir.path().to_str().unwrap();
    let output = run(&["run", &at("none.json"), input, "--format", "ndjson"], "");
    let said = text(&output.stderr);
    assert_eq!((output.status.code(), said.lines().count()), (Some(2), 11), "{said}");
    let lines: Vec<_> = said.lines().collect();
    assert!(lines[0].contains("cannot read"), "{said}");
    for (file, line) in files.iter().zip(&lines[1..]) {
        assert!(line.starts_with(&format!("{file}: ")), "{said}");
    }
    assert!(
        lines[1].contains(": Wear volume ") && lines[1].contains(", Largest wear depth "),
        "{said}"
    );
    let alone = |number: usize| run(&["run", "-", "--format", "ndjson"], job(number)).stdout;
    let expected: Vec<_> = (0..10).filter(|number| *number != 7).flat_map(alone).collect();
    assert!(output.stdout == expected);
    // Faults are no summary.
    let output = run(&["run", "--quiet", input, "-o", &at("results/")], "");
    assert_eq!(text(&output.stderr).lines().count(), 1, "{}", text(&output.stderr));
    assert_eq!(std::fs::read_dir(at("results")).unwrap().count(), 9);
    assert_eq!(text(&run(&["run", "-q", &files[0]], "").stderr), "");

    // The first file is complete only after the second one was computed.
    if std::thread::available_parallelism().is_ok_and(|cores| cores.get() > 1) {
        let fifo = at("first");
        assert!(Command::new("mkfifo").arg(&fifo).status().unwrap().success());
        let (pair, second) = (at("pair/"), dir.path().join("pair/01.json"));
        let mut command = fretwork(&["run", &fifo, &files[1], "-o", &pair]);
        let child = Running(command.stderr(Stdio::piped()).spawn().unwrap());
        let begun = std::time::Instant::now();
        while !second.exists() {
            assert!(begun.elapsed() < std::time::Duration::from_mins(5), "one after the other");
            std::thread::sleep(std::time::Duration::from_millis(10));
        }
        std::fs::write(&fifo, job(0)).unwrap();
        let mut child = child;
        assert!(child.wait().unwrap().success());
        let lines = BufReader::new(child.stderr.take().unwrap()).lines();
        let names: Vec<_> =
            lines.map(|line| line.unwrap().split(": ").next().unwrap().to_owned()).collect();
        assert_eq!(names, [fifo, files[1].clone()]);
    }
}

#[test]
fn a_place_that_cannot_be_written_is_refused_before_anything_is_read_or_computed() {
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, "mine").unwrap();
    let inside = |name| file.join(name).to_str().unwrap().to_owned();
    let (json, svg, html) = (inside("x.json"), inside("x.svg"), inside("x.html"));
    std::fs::write(dir.path().join("fretwork.db"), "").unwrap();
    let data = dir.path().to_str().unwrap();
    for words in [
        &["man", &json][..],
        &["export", &json, "--data-dir", data],
        &["backup", &json, "--data-dir", data],
        &["run", "-", "-o", &json],
        &["run", "-", "--plot", &svg],
        &["run", "-", "--report", &html],
        &["run", "--join", "none", "-o", &json],
        &["get", "0", "-o", &json, "--url", "http://127.0.0.1:1"],
        &["report", "none.json", "-o", &html],
    ] {
        fails(&run(words, "no JSON"), "cannot write ");
    }
    fails(&run(&["run", "-", "--plot", "x.png"], "no JSON"), "End the name with .svg");
    fails(&run(&["report", "none.json", "-o", "y.json"], ""), "End the name with .html");
    for words in [
        &["run", BALL, "-o", "-"][..],
        &["run", BALL, "--plot", "-"],
        &["run", BALL, "--report", "-"],
        &["man", "-"],
    ] {
        let refused = run(words, "");
        assert!(text(&refused.stderr).contains("enter the name of a file"), "{refused:?}");
    }
    assert_eq!(std::fs::read_to_string(file).unwrap(), "mine");
    // A command that computes nothing leaves no file.
    let none = dir.path().join("new/x.json");
    assert_eq!(run(&["run", "-", "-o", none.to_str().unwrap()], "no JSON").status.code(), Some(2));
    assert!(none.parent().unwrap().is_dir() && !none.exists());
}

#[test]
fn results_of_several_files_go_to_a_new_directory_and_replace_nothing() {
    let dir = TempDir::new().unwrap();
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    for name in ["one", "two"] {
        std::fs::create_dir(at(name)).unwrap();
        std::fs::write(at(&format!("{name}/a.json")), http::EXAMPLES[0].body).unwrap();
    }
    std::fs::write(at("one/b.json"), "{\"scenario\": 1}").unwrap();
    let (one, new) = (at("one"), at("new"));
    let places = ["-o", &*new, "--plot", &*new, "--report", &*new];
    let output = run(&[&["run", &one], &places[..]].concat(), "");
    // A fault names its file.
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains(&format!("{}: /scenario: ", at("one/b.json"))), "{said}");
    for name in ["new/a.json", "new/a.svg", "new/a.html"] {
        assert!(std::fs::metadata(at(name)).unwrap().len() > 1000, "{name}");
    }
    let alone = run(&["run", &at("one/b.json")], "");
    assert!(text(&alone.stderr).starts_with(&at("one/b.json")), "{}", text(&alone.stderr));
    // Two results of one name, and results in place of their inputs.
    fails(
        &run(&["run", &one, &at("two"), "-o", &new], ""),
        "would replace an input file or another",
    );
    fails(&run(&["run", &one, "-o", &one], ""), "would replace an input file or another");
    fails(&run(&["run", &at("two/a.json"), "-o", &at("two/a.json")], ""), "would replace an input");
    assert_eq!(std::fs::read_to_string(at("two/a.json")).unwrap(), http::EXAMPLES[0].body);
    assert!(run(&["run", &at("two/a.json"), "-o", &at("slash/")], "").status.success());
    assert!(dir.path().join("slash/a.json").is_file());
    assert!(run(&["report", &at("slash/a.json"), "-o", &at("pages/")], "").status.success());
    assert!(dir.path().join("pages/a.html").is_file());
    // A second name of the input.
    std::fs::hard_link(at("two/a.json"), at("two/b.json")).unwrap();
    fails(&run(&["run", &at("two/a.json"), "-o", &at("two/b.json")], ""), "would replace an input");
    fails(
        &run(&["run", &at("pages")], ""),
        &format!("{}: no .json file is directly in it", at("pages")),
    );
    fails(&run(&["run", &one, "--format", "npz"], ""), "needs a file for each result");
    let inside = at("two/a.json") + "/new";
    fails(&run(&["run", &one, "-o", &inside], ""), "cannot make the directory ");
    assert!(!text(&run(&["get", "--help"], "").stdout).contains("input"));
}

#[test]
fn a_server_computes_what_the_command_line_submits() {
    let dir = TempDir::new().unwrap();
    let (_server, address) = serve(dir.path(), &[]);
    let with = |words: &[&str], input: &str| run(&[words, &["--url", &address]].concat(), input);
    let done = with(&["submit", BALL, "--wait", "--set", "/friction=0.6"], "");
    let line = text(&done.stdout);
    assert_eq!(done.status.code(), Some(0), "{line} {}", text(&done.stderr));
    let [id, state, key] = line.split_whitespace().take(3).collect::<Vec<_>>()[..] else {
        panic!("{line}")
    };
    assert_eq!(state, "succeeded");
    let local = run(&["run", BALL, "--format", "csv", "--set", "/friction=0.6"], "");
    assert_eq!(with(&["get", key, "--format", "csv"], "").stdout, local.stdout);
    assert_eq!(text(&with(&["watch", id], "").stdout), line);
    assert_eq!(text(&with(&["list"], "").stdout), line);

    let refused = with(&["submit", "-"], "{\"scenario\": {\"friction\": \"0.7\"}}");
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("-: /scenario/friction: must be a number"));
    let unknown = with(&["cancel", "019aa0f3-1f4e-7cc0-9d8b-1c5b0c1f9a11"], "");
    assert_eq!(unknown.status.code(), Some(1));
    let evaluated = with(&["evaluate", BALL, "--set", "/model/method=simplified"], "");
    let answer: Value = serde_json::from_slice(&evaluated.stdout).unwrap();
    assert!(answer["outputs"].is_object(), "{}", text(&evaluated.stderr));
}

#[test]
fn faults_of_a_file_are_printed_one_per_line() {
    let body = http::EXAMPLES[0].body.replace("0.3", "0.7").replace("\"friction\"", "\"frictoin\"");
    let output = run(&["run", "-"], &body);
    assert_eq!((output.status.code(), output.stdout.len()), (Some(2), 0));
    let mut pointers: Vec<_> =
        text(&output.stderr).lines().map(|line| line.split_once(": ").unwrap().0).collect();
    pointers.sort_unstable();
    let expected = [
        "/scenario/bodies/0/poisson_ratio",
        "/scenario/bodies/1/poisson_ratio",
        "/scenario/friction",
        "/scenario/frictoin",
    ];
    assert_eq!(pointers, expected);

    let output = run(&["run", "-"], "{\"scenario\": ");
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("line 1"), "{}", text(&output.stderr));
    fails(&run(&["run", "no-such-file.json"], ""), "no-such-file.json");
}

#[test]
fn the_openapi_command_prints_the_served_document() {
    assert_eq!(run(&["openapi"], "").stdout, http::DOCUMENT);
}

#[test]
fn a_server_is_healthy_until_sigterm_and_exits_with_0() {
    let dir = TempDir::new().unwrap();
    for options in [&[][..], &["serve", "--workers", "1"]] {
        let (mut child, address) = serve(dir.path(), options);
        let health = run(&["health", "--url", &address], "");
        assert_eq!((health.status.code(), text(&health.stdout)), (Some(0), "ok\n"));

        let second =
            run(&["--listen", "127.0.0.1:0", "--data-dir", dir.path().to_str().unwrap()], "");
        assert_eq!(second.status.code(), Some(1));
        let said = text(&second.stderr);
        assert!(said.contains("fretwork: another server is using the data directory"), "{said}");
        assert!(said.contains(&format!(" (process {})", child.id())), "{said}");

        let told = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
        assert!(told.success());
        assert_eq!(child.wait().unwrap().code(), Some(0));
        fails(&run(&["health", "--url", &address], ""), "no server answers");
    }
}

#[test]
fn a_server_runs_with_a_closed_standard_output() {
    let dir = TempDir::new().unwrap();
    let (reader, writer) = std::io::pipe().unwrap();
    drop(reader);
    let mut command = fretwork(&["--listen", "127.0.0.1:0", "--log-format", "json", "--data-dir"]);
    command.arg(dir.path()).env("FRETWORK_LOG", "info").stdout(writer).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut log = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    let address = log
        .find_map(|line| {
            let line: Value = serde_json::from_str(&line).unwrap();
            line["address"].as_str().map(|address| format!("http://{address}"))
        })
        .unwrap();
    assert_eq!(text(&run(&["health", "--url", &address], "").stdout), "ok\n");
    let told = Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap();
    assert!(told.success());
    // Reads the rest of the log, so that the server can write it.
    log.for_each(drop);
    assert_eq!(child.wait().unwrap().code(), Some(0));
}

/// A server or a worker that logs JSON, with the first object that it prints.
fn announcing(mut command: Command) -> (Running, Value) {
    command.args(["--log-format", "json", "--log", "off"]).stdout(Stdio::piped());
    let mut child = Running(command.spawn().unwrap());
    let mut line = String::new();
    BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
    let announced: Value = serde_json::from_str(&line).expect(&line);
    assert!(announced["timestamp"].is_string() && announced["level"] == "INFO", "{announced}");
    (child, announced)
}

#[test]
fn the_announcements_of_a_server_follow_the_format_of_its_log() {
    let dir = TempDir::new().unwrap();
    let data = ["--data-dir", dir.path().to_str().unwrap()];
    let (_child, announced) =
        announcing(fretwork(&[&["--listen", "127.0.0.1:0"], &data[..]].concat()));
    let address = announced["message"].as_str().unwrap().rsplit(' ').next().unwrap();
    assert_eq!(announced["dashboard"], format!("{address}/"));
    assert_eq!(announced["documentation"], format!("{address}/docs/"));
    assert_eq!(announced["data"], data[1]);
    assert_eq!(text(&run(&["health", "--url", address], "").stdout), "ok\n");

    // A server that other machines can reach also announces its first key.
    let dir = TempDir::new().unwrap();
    let data = ["--listen", "0.0.0.0:0", "--data-dir", dir.path().to_str().unwrap()];
    let (_child, announced) = announcing(fretwork(&data));
    assert!(announced["key"].as_str().unwrap().starts_with("fretwork_"), "{announced}");
}

/// This takes more than 5 s, because the command waits so long for an answer.
#[test]
fn health_says_that_a_stopped_process_does_not_answer() {
    let dir = TempDir::new().unwrap();
    let (child, address) = serve(dir.path(), &[]);
    let stop = Command::new("kill").args(["-STOP", &child.id().to_string()]).status().unwrap();
    assert!(stop.success());
    let health = run(&["health", "--url", &address], "");
    fails(&health, "does not answer within 5s");
}

#[test]
fn a_misspelt_option_of_a_database_is_an_error_that_shows_no_value() {
    let url = "postgres://ada:secret@localhost/wear?pasword=secret";
    for words in
        [&["--database", url][..], &["worker", "--database", url], &["audit", "--database", url]]
    {
        let output = run(words, "");
        fails(&output, "--database: option 1 of the address is misspelt");
        assert!(!text(&output.stderr).contains("secret"), "{}", text(&output.stderr));
    }
}

#[test]
fn a_server_that_cannot_start_prints_the_reason_on_one_line() {
    let dir = TempDir::new().unwrap();
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let data = dir.path().to_str().unwrap();
    fails(
        &run(&["--listen", &address, "--data-dir", data], ""),
        "choose another address with --listen",
    );
    let file = dir.path().join("file");
    std::fs::write(&file, "").unwrap();
    let below = file.join("data");
    let options = ["--listen", "127.0.0.1:0", "--data-dir", below.to_str().unwrap()];
    fails(&run(&options, ""), "data directory");
}
