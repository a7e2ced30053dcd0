//! The verification page is up to date and has no failures.

use fretwork::verification;

const COMMITTED: &str = include_str!("../../VERIFICATION.md");
const UPDATE: &str = "run `cargo run --release -- verify > VERIFICATION.md`";

#[test]
fn every_check_passes_and_the_committed_page_is_up_to_date() {
    let page = verification::page();
    let failures: Vec<_> = page.failures().map(ToString::to_string).collect();
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(page.to_string() == COMMITTED, "{UPDATE}");
    for section in &page.sections {
        assert!(!section.checks.is_empty(), "nothing is checked in {}", section.title);
    }
}

#[test]
fn the_verify_command_prints_the_committed_page() {
    let mut command = std::process::Command::new(env!("CARGO_BIN_EXE_fretwork"));
    let output = command.arg("verify").output().expect("the program");
    assert!(output.stdout == COMMITTED.as_bytes(), "{UPDATE}");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
