//! The commands `submit`, `get`, `watch`, `list`, `cancel` and `evaluate`, which talk to a server.

use std::collections::{BTreeMap, HashSet};
use std::io::{self, Write as _};
use std::path::PathBuf;
use std::slice;
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde::Deserialize;
use serde_json::value::RawValue;
use serde_json::{Value, json};

use super::client::{Client, escaped};
use super::places;
use super::printing::{Ended, Error, Progress, harmless, print, say};
use super::run::{listed, read_job, write_result};
use crate::config::{Evaluate, Get, List, OneJob, Remote, Submit};
use fretwork_job::TaskKind;

/// Seconds between two updates of the progress on a terminal.
const TERMINAL_WAIT: u64 = 1;
/// Longest wait of one request, in seconds.
const LOG_WAIT: u64 = 50;
/// Minimum time between two requests about a job. A proxy may ignore the wait.
const INTERVAL: Duration = Duration::from_millis(500);

/// Submits files. With `--wait`, waits for the ends of their jobs.
pub fn submit(settings: &Submit) -> Result<(), Error> {
    let client = connect(&settings.server)?;
    let (mut code, mut jobs): (u8, Vec<Listed>) = (0, Vec::new());
    for file in listed(&settings.files)? {
        let body = match read_job(&file, &settings.change) {
            Ok(body) => body,
            Err(error) => {
                code = code.max(Ended::of(&error).print());
                continue;
            }
        };
        match client.call("POST", "/v1/jobs", Some((&file, &body))) {
            Ok(reply) if settings.wait => jobs.push(reply.json()?),
            Ok(reply) => print(line(&reply.json()?).as_bytes())?,
            Err(error) if error.is::<Ended>() => code = code.max(Ended::of(&error).print()),
            Err(error) => {
                // The server computes what it has accepted.
                print(jobs.iter().map(line).collect::<String>().as_bytes())?;
                return Err(error);
            }
        }
    }
    for job in &jobs {
        code = code.max(match end(&client, &job.id) {
            Err(error) if error.is::<Ended>() => Ended::of(&error).print(),
            end => end?,
        });
    }
    Ended::with(code)
}

/// Writes a result.
pub fn get(settings: &Get) -> Result<(), Error> {
    let name = PathBuf::from(&settings.key_of_result);
    places::check(slice::from_ref(&name), &settings.output, &[], HashSet::new())?;
    let client = connect(&settings.server)?;
    let path = format!("/v1/results/{}", escaped(&settings.key_of_result));
    let reply = client.call("GET", &path, None)?;
    let members: BTreeMap<String, &RawValue> = reply.json()?;
    let kind = TaskKind::all().find(|kind| members.contains_key(kind.member()));
    let kind = kind.ok_or("the answer of the server is no result. Check FRETWORK_URL")?;
    print(&write_result(&reply.body, kind, &settings.output, &name)?)
}

/// Waits for the end of a job.
pub fn watch(settings: &OneJob) -> Result<(), Error> {
    Ended::with(end(&connect(&settings.server)?, &settings.id)?)
}

/// Lists jobs.
pub fn list(settings: &List) -> Result<(), Error> {
    let client = connect(&settings.server)?;
    let path = format!("/v1/jobs?limit={}", settings.limit);
    let Jobs { jobs } = client.call("GET", &path, None)?.json()?;
    print(jobs.iter().map(line).collect::<String>().as_bytes())
}

/// Cancels a job.
pub fn cancel(settings: &OneJob) -> Result<(), Error> {
    let client = connect(&settings.server)?;
    let path = format!("/v1/jobs/{}/cancel", escaped(&settings.id));
    print(line(&client.call("POST", &path, None)?.json()?).as_bytes())
}

/// Evaluates a scenario.
pub fn evaluate(settings: &Evaluate) -> Result<(), Error> {
    let client = connect(&settings.server)?;
    let mut body = read_job(&settings.file, &settings.change)?;
    // The server says what is wrong with a text that is not JSON.
    if let Ok(Value::Object(mut members)) = serde_json::from_slice(&body) {
        // A job can have words for people, which an evaluation does not take.
        members.retain(|name, _| !matches!(&**name, "label" | "tags"));
        if !members.contains_key("outputs") && !members.contains_key("parts") {
            members.insert("outputs".to_owned(), json!(settings.outputs));
        }
        body = serde_json::to_vec(&members)?;
    }
    let sent = Some((&*settings.file, &*body));
    let answer: Value = client.call("POST", "/v1/evaluate", sent)?.json()?;
    if !answer["outputs"].is_object() {
        return Err("the answer of the server is no evaluation. Check FRETWORK_URL".into());
    }
    let lines: String = format!("{answer:#}").lines().map(|it| harmless(it) + "\n").collect();
    print(lines.as_bytes())
}

/// The server of a command. Warns of another version.
fn connect(server: &Remote) -> Result<Client, Error> {
    let client = Client::new(server)?;
    let (own, reply) = (env!("CARGO_PKG_VERSION"), client.get("/version")?);
    let answer: Value = serde_json::from_slice(&reply.body).unwrap_or_default();
    if let Some(version) = answer["version"].as_str().filter(|version| *version != own) {
        let version = harmless(version);
        say(&format!(
            "warning: the server is of version {version}, and this program of version {own}"
        ));
    }
    Ok(client)
}

/// What a list says of a job.
#[derive(Deserialize)]
struct Listed {
    id: String,
    state: String,
    key: String,
    label: Option<String>,
}

/// An answer with jobs.
#[derive(Deserialize)]
struct Jobs {
    jobs: Vec<Listed>,
}

/// A line about a job.
fn line(Listed { id, state, key, label }: &Listed) -> String {
    let label = label.as_ref().map_or(String::new(), |label| format!("  {label}"));
    harmless(&format!("{id}  {state:<9}  {key}{label}")) + "\n"
}

/// Waits for the end of a job and prints its line. Returns the exit code.
fn end(client: &Client, id: &str) -> Result<u8, Error> {
    let mut progress = Progress::new(true);
    let wait = if progress.is_terminal { TERMINAL_WAIT } else { LOG_WAIT };
    let path = format!("/v1/jobs/{}?wait={wait}", escaped(id));
    loop {
        let asked = Instant::now();
        let reply = client.call("GET", &path, None)?;
        let job: Value = reply.json()?;
        let code = match job["state"].as_str() {
            Some("succeeded") => 0,
            Some("failed") => 3,
            Some("canceled") => 4,
            Some("queued" | "running") => {
                progress.show(job["progress"].as_f64().unwrap_or(0.0));
                sleep(INTERVAL.saturating_sub(asked.elapsed()));
                continue;
            }
            _ => return Err("the answer of the server is no job. Check FRETWORK_URL".into()),
        };
        drop(progress);
        print(line(&reply.json()?).as_bytes())?;
        if let Some(detail) = job["error"]["detail"].as_str() {
            writeln!(io::stderr(), "{}", harmless(detail))?;
        }
        return Ok(code);
    }
}
