//! Common mistakes in a body. The message of each says what to write instead, on the command line and in the API.

use crate::program::run;
use crate::server::{JSON, Server};

const JOB: &str = r#"{"scenario":{"profile":{"shape":"sphere","radius":"10 mm"},
    "moduli":{"normal":"113 GPa","tangential":"93 GPa"},"friction":0.7,
    "wear":{"coefficient":"3e-5 mm^3/(N m)"},"load":{"indentation_depth":"3 um"},
    "motion":{"amplitude":"2 um"},"cycles":{"normalized":[1,4,16]}}}"#;

const SPHERE: &str = r#""shape":"sphere","radius":"10 mm""#;
const TRACE: &str =
    r#""shape":"table","radius":["-1 mm","0 mm","1 mm"],"height":["50 um",0,"50 um"]"#;

/// What is replaced, what the user writes instead, and the fault in the words of the program.
const MISTAKES: [(&str, &str, &str); 24] = [
    ("0.7", "\"0.7\"", "must be a number, not a string. Enter 0.7, without quotation marks"),
    ("0.7", "\"0,7\"", "must be a number, not a string. Enter 0.7, without quotation marks"),
    ("0.7", "NaN", "enter a number instead of NaN or Infinity, at line"),
    ("0.7", "0,7", "enter numbers with a decimal point and without spaces, such as 0.7"),
    ("0.7", ".7", "enter a number that begins with a digit, such as 0.7 at line"),
    ("0.7", "0.7 // dry", "JSON has no comments: remove this one at line"),
    ("{", "cycles;volume", "enter a JSON object, which begins with { at line 1"),
    ("0.7", "True", "enter true, false or null, in lower case at line"),
    ("0.7,", "0.7,}", "remove the comma before this bracket at line"),
    ("\"friction\"", "'friction'", "enter names and texts in straight double quotes"),
    ("\"sphere\"", "“sphere”", "enter names and texts in straight double quotes"),
    ("]}}}", "]", "the text ends too early: close all brackets and quotation marks"),
    ("[1,4,16]", "16", "must be a list or an object, not a number. Enter a list in brackets: […]"),
    ("radius", "diameter", "Enter `radius`. It is half of the diameter."),
    ("0.7", "-0.7", "must be greater than 0, not -0.7"),
    ("friction", "mu", "unknown member `mu`. Enter `friction`."),
    ("friction", "frictoin", "unknown member `frictoin`. Did you mean `friction`?"),
    ("sphere", "ball", "unknown value `ball`. Enter `sphere`."),
    (
        "amplitude",
        "stroke",
        "Enter `amplitude`. It is half of the stroke from one end to the other.",
    ),
    ("10 mm", "10 000 um", "contains a comma or a space in the number. Enter \"10000 um\""),
    ("10 mm", "10,000 um", "contains a comma or a space in the number. Enter \"10000 um\""),
    ("10 mm", "0,01 m", "contains a comma or a space in the number. Enter \"0.01 m\""),
    (
        "10 mm",
        "10 N",
        "\"N\" is the unit of a force, but a length is needed. Accepted units: m, cm, mm",
    ),
    (
        SPHERE,
        TRACE,
        "post the whole trace as CSV (30 rows or more, with a header such as radius [mm],height [um]) to",
    ),
];

#[test]
fn a_message_of_the_command_line_says_what_to_write_instead() {
    for (right, wrong, words) in MISTAKES {
        let output = run(&["run", "-"], JOB.replacen(right, wrong, 1));
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains(words), "{wrong}: {said}");
    }
}

#[tokio::test]
async fn the_detail_of_a_problem_says_what_to_write_instead() {
    let server = Server::start().await;
    let scenario = JOB.strip_prefix("{\"scenario\":").unwrap();
    let bare = (JOB, &scenario[..scenario.len() - 1], "Enter it as {\"scenario\": {…}}");
    for (right, wrong, words) in MISTAKES.into_iter().chain([bare]) {
        let body = JOB.replacen(right, wrong, 1);
        let problem = server.send("POST", "/v1/jobs", &[JSON], body).await.json();
        let detail = problem["detail"].as_str().unwrap();
        assert!(detail.contains(words), "{wrong}: {problem}");
    }
    // The mark of an editor is no mistake.
    let body = format!("\u{feff}{JOB}");
    let reply = server.send("POST", "/v1/jobs", &[JSON], body).await;
    assert!([200, 201, 202].contains(&reply.status), "{}", reply.json());
}
