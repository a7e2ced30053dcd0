//! Studies that are computed in parts, without a server.

use std::fs::{self, File};
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

use crate::program::{fails, fretwork, run, text};
use crate::server::steel_ball;
use crate::studies::{example, long_sweep};

/// A study and the files of its parts.
struct Divided {
    dir: TempDir,
    body: String,
    of: usize,
}

impl Divided {
    fn new(body: &Value, of: usize) -> Self {
        Self { dir: TempDir::new().unwrap(), body: body.to_string(), of }
    }

    fn file(&self, name: impl std::fmt::Display) -> PathBuf {
        self.dir.path().join(name.to_string())
    }

    fn words(&self, number: usize) -> [String; 6] {
        let (part, file) = (format!("{number}/{}", self.of), self.file(number));
        ["run", "-", "--part", &part, "--store", file.to_str().unwrap()].map(str::to_owned)
    }

    fn compute(&self, number: usize) -> Output {
        run(&self.words(number).each_ref().map(String::as_str), &self.body)
    }

    fn join(&self, words: &[&str]) -> Output {
        let files: Vec<_> = (1..=self.of).map(|number| self.file(number)).collect();
        let files = files.iter().map(|file| file.to_str().unwrap());
        run(
            &["run"]
                .into_iter()
                .chain(words.iter().copied())
                .chain(["--join"])
                .chain(files)
                .collect::<Vec<_>>(),
            "",
        )
    }
}

fn succeeds(output: &Output) -> &str {
    assert!(output.status.success(), "{}", text(&output.stderr));
    text(&output.stderr)
}

/// Starts a part, and kills it when its file has a few chunks. A fast machine may have computed all of them.
fn kill(study: &Divided, number: usize) {
    let words = study.words(number);
    let mut command = fretwork(&words.each_ref().map(String::as_str));
    let mut child = command.stdin(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(study.body.as_bytes()).unwrap();
    let lines = |file: &Path| fs::read_to_string(file).map_or(0, |text| text.lines().count());
    while lines(&study.file(number)) < 3 && child.try_wait().unwrap().is_none() {}
    child.kill().unwrap();
    child.wait().unwrap();
}

/// This takes more than 5 s, because each part is a process, and the study is computed twice.
#[test]
fn sixteen_parts_of_a_study_give_the_bytes_of_one_run() {
    let study = Divided::new(&long_sweep(24_000), 16);
    kill(&study, 3);
    // What is left of the part: two whole lines and a half.
    let written = fs::read_to_string(study.file(3)).unwrap();
    let lines: Vec<_> = written.split_inclusive('\n').collect();
    let half = &lines[2][..lines[2].len() / 2];
    fs::write(study.file(3), format!("{}{}{half}", lines[0], lines[1])).unwrap();
    for number in (1..=16).filter(|number| *number != 3) {
        assert!(succeeds(&study.compute(number)).ends_with("chunks, 0 of them known already\n"));
    }
    fails(&study.join(&[]), "part 3/16 is missing or not complete; compute it with --part 3/16");
    let said = study.compute(3);
    assert!(!succeeds(&said).contains(", 0 of them"), "{}", text(&said.stderr));
    let joined = study.join(&[]);
    succeeds(&joined);
    let whole = run(&["run", "-"], &study.body);
    succeeds(&whole);
    assert!(joined.stdout == whole.stdout, "the joined result differs");

    let (result, data) = (study.file("result.json"), study.file("data"));
    succeeds(&study.join(&["--output", result.to_str().unwrap()]));
    let import =
        ["import", result.to_str().unwrap(), "--data-dir", data.to_str().unwrap(), "--verify-time"];
    let imported = run(&[&import[..], &["200ms"]].concat(), "");
    succeeds(&imported);
    let said = text(&imported.stdout);
    assert!(
        said.contains("1 result (") && said.contains("0 computed again, 1 in part, 0 unverified"),
        "{said}"
    );
    let again = run(&[&import[..], &["0"]].concat(), "");
    assert!(
        text(&again.stdout).contains("0 results (0 B) imported, 1 known already"),
        "{}",
        text(&again.stdout)
    );
    let found = study.file("found.db");
    let export =
        ["export", found.to_str().unwrap(), "kind=sweep", "--data-dir", data.to_str().unwrap()];
    let exported = run(&export, "");
    succeeds(&exported);
    assert!(text(&exported.stdout).contains("1 result ("), "{}", text(&exported.stdout));
}

#[test]
fn a_joined_result_with_an_altered_digit_is_not_imported() {
    let study = Divided::new(&example("sweep"), 1);
    succeeds(&study.compute(1));
    let result = study.file("result.json");
    succeeds(&study.join(&["--output", result.to_str().unwrap()]));
    let sound = fs::read_to_string(&result).unwrap();
    let (head, rows) = sound.split_once("\"wear_volume\":[").unwrap();
    let other = if rows.starts_with('1') { '2' } else { '1' };
    fs::write(&result, format!("{head}\"wear_volume\":[{other}{}", &rows[1..])).unwrap();
    let data = study.file("data");
    let words = ["import", result.to_str().unwrap(), "--data-dir", data.to_str().unwrap()];
    let refused = run(&words, "");
    assert_eq!(refused.status.code(), Some(2), "{}", text(&refused.stderr));
    assert!(text(&refused.stderr).contains("this server computes"), "{}", text(&refused.stderr));
}

#[test]
fn what_is_no_part_of_the_study_is_refused_and_not_overwritten() {
    let study = Divided::new(&example("sweep"), 2);
    succeeds(&study.compute(1));
    let file = File::open(study.file(1)).unwrap();
    file.lock().unwrap();
    fails(&study.compute(1), "another process computes the part");
    drop(file);
    let other = Divided { body: example("map").to_string(), ..study };
    fails(&other.compute(1), "is not the file of this part of this study; name another file");
    fs::write(other.file(2), "my notes").unwrap();
    fails(&other.compute(2), "is not the file of this part of this study; name another file");
    assert_eq!(fs::read_to_string(other.file(2)).unwrap(), "my notes");
    fails(&other.join(&[]), "is not the file of a part of a study");

    let fit = Divided::new(&example("fit"), 2);
    fails(&fit.compute(1), "a fit cannot be computed in parts");
    let ball = Divided::new(&steel_ball(), 2);
    fails(&ball.compute(1), "--part needs a study; one run has no parts");
    assert!(!fit.file(1).exists() && !ball.file(1).exists());
}

#[test]
fn every_part_of_a_small_study_has_points() {
    let study = Divided::new(&example("sweep"), 16);
    for number in 1..=16 {
        assert!(!succeeds(&study.compute(number)).contains(": 0 chunks"), "part {number} is empty");
    }
    let joined = study.join(&[]);
    succeeds(&joined);
    assert!(joined.stdout == run(&["run", "-"], &study.body).stdout, "the joined result differs");
}

#[test]
fn a_part_says_first_if_the_joined_result_is_too_large_for_an_import() {
    let study = Divided::new(&long_sweep(1_000_000), 1_000_000);
    let output = study.compute(7);
    let said = succeeds(&output).lines().collect::<Vec<_>>();
    assert!(said[0].starts_with("the joined result could have "), "{said:?}");
    assert!(said[1].starts_with("part 7/1000000: 1 chunk, 0 of them"), "{said:?}");
}
