//! Faults around a server: shutdown under load, a full, read-only or damaged disk, a full queue, and
//! cancellation of a run that uses a whole processor.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::net::SocketAddr;
use std::os::unix::fs::FileExt as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use fretwork::http::Settings;
use fretwork_job::{Begin, Key, Step, Task, Work};

use fretwork_store::Options;
use serde_json::{Value, json};
use sqlx::{Connection as _, Executor as _};
use tempfile::TempDir;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpSocket;
use tokio::sync::Semaphore;
use tokio::task::JoinSet;

use crate::keeping::eventually;
use crate::kill::{Program, id, long};
use crate::program::{fails, run};
use crate::server::{Gate, JSON, Reply, Server, ball, metric, send, steel_ball};
use crate::store::{accepted, fresh, new_job, open, raw};
use crate::studies::until_idle;

/// A run of at most 1 s with the longest steps: the maximum number of points, the smallest tolerance, and the
/// comparison with the simplified rule.
fn heavy() -> Value {
    let mut body = steel_ball();
    let scenario = &mut body["scenario"];
    scenario["cycles"] = json!({"from": 100, "to": 1e8, "count": 400, "spacing": "log"});
    scenario["profiles_at"] = json!("none");
    scenario["model"] =
        json!({"method": "exact", "points": 4096, "tolerance": 1e-4, "compare": true});
    body
}

pub async fn post(address: SocketAddr, body: &Value) -> io::Result<Reply> {
    send(address, "POST", "/v1/jobs", &[JSON], body.to_string()).await
}

/// The jobs that a server acknowledged, and whether it refused later ones.
#[derive(Default)]
struct Answers {
    acknowledged: Vec<String>,
    refused: bool,
}

/// Submits short runs until the server refuses one or closes its port. Counts those that it accepts.
async fn submitting(address: SocketAddr, first: f64, accepted: Arc<AtomicU32>) -> Answers {
    let mut answers = Answers::default();
    while !answers.refused {
        let body = ball(first + answers.acknowledged.len() as f64 * 1e-5);
        match post(address, &body).await {
            Ok(reply) if reply.status == 202 => {
                answers.acknowledged.push(id(&reply.json()));
                accepted.fetch_add(1, Ordering::SeqCst);
            }
            Ok(reply) => {
                reply.problem(503, "draining");
                assert!(reply.header("retry-after").is_some());
                answers.refused = true;
            }
            Err(_) => break,
        }
    }
    answers
}

#[tokio::test(flavor = "multi_thread")]
async fn a_shutdown_under_load_refuses_new_jobs_and_keeps_accepted_ones() {
    let dir = TempDir::new().unwrap();
    let server = Program::start(dir.path(), "1");
    let address = server.address;
    let first = id(&post(address, &heavy()).await.unwrap().json());
    while server.get(&format!("/v1/jobs/{first}")).await.json()["state"] != "running" {}
    // The clients submit before and during the shutdown. The server answers them until the first run has ended.
    let (accepted, mut clients) = (Arc::<AtomicU32>::default(), JoinSet::new());
    for first in [1.0, 1.5, 2.0] {
        clients.spawn(submitting(address, first, Arc::clone(&accepted)));
    }
    eventually(async || accepted.load(Ordering::SeqCst) >= 10).await;
    server.tell_to_end();
    let all = clients.join_all().await;
    assert!(all.iter().any(|answers| answers.refused), "no submission was refused");
    server.end_of_it();
    let server = Program::start(dir.path(), "2");
    let acknowledged = all.iter().flat_map(|answers| &answers.acknowledged);
    for id in acknowledged.chain([&first]) {
        let job = server.ended(id).await;
        assert_eq!(job["state"], "succeeded", "{job}");
    }
    server.end();
}

/// A command that runs the server in its own mount namespace, after the script `mount` with the directory
/// as `$0`. `None`, with a message on standard error, if the system does not permit it.
pub fn mounting(mount: &str, dir: &Path) -> Option<Command> {
    let script = format!("{mount} && exec \"$@\"");
    let with = |options: &[&str]| {
        let mut command = Command::new("unshare");
        command.arg("--mount").args(options).args(["sh", "-c", &script]).arg(dir);
        command
    };
    for options in [&["--map-root-user"][..], &[]] {
        let tried = with(options).arg("true").stderr(Stdio::null()).status();
        if tried.is_ok_and(|status| status.success()) {
            let mut command = with(options);
            command.arg(env!("CARGO_BIN_EXE_fretwork"));
            return Some(command);
        }
    }
    // The test harness captures `eprintln!`, but not this.
    let _ = writeln!(io::stderr(), "skipped: this system does not permit `{mount}`");
    None
}

/// Fills a file system to the last block by appending to a file.
pub fn fill(path: &Path) {
    let mut file = File::options().create(true).append(true).open(path).unwrap();
    for size in [1 << 16, 1 << 12] {
        let block = vec![0xa5; size];
        while file.write_all(&block).is_ok() {}
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn submissions_fail_and_reads_work_while_the_disk_is_full() {
    let dir = TempDir::new().unwrap();
    let mount = "mount -t tmpfs -o size=3m tmpfs \"$0\"";
    let Some(mut command) = mounting(mount, dir.path()) else { return };
    // Without the memory cache, results are read from the database.
    command.args(["--workers", "1", "--memory-cache", "0"]);
    let server = Program::start_by(command, dir.path());
    let address = server.address;
    let known = server.ended(&id(&post(address, &steel_ball()).await.unwrap().json())).await;
    let result = server.result(&known).await;
    let full = "fretwork_store_errors_total{kind=\"full\"}";

    let inside = dir.path().strip_prefix("/").unwrap();
    let root = format!("/proc/{}/root", server.child.id());
    let filler = Path::new(&root).join(inside).join("filler");
    fill(&filler);
    let mut acknowledged = Vec::new();
    let mut refused = 0;
    // First, commits still fit into the existing log file.
    for number in 0..2000 {
        let reply = post(address, &long(number % 100)).await.unwrap();
        if matches!(reply.status, 200 | 202) {
            acknowledged.push(id(&reply.json()));
            continue;
        }
        let problem = reply.problem(507, "disk-full");
        assert!(problem["detail"].as_str().unwrap().contains("full"), "{problem}");
        refused += 1;
        if refused == 3 {
            break;
        }
    }
    assert_eq!(refused, 3, "{} were acknowledged", acknowledged.len());
    assert!(metric(address, full).await >= 3.0);
    assert!(metric(address, "fretwork_disk_free_bytes").await < 100_000.0);
    assert!(server.result(&known).await == result);
    let body = json!({"scenario": ball(3.0)["scenario"], "outputs": ["wear_volume"]}).to_string();
    let evaluated = send(address, "POST", "/v1/evaluate", &[JSON], body).await.unwrap();
    assert_eq!(evaluated.status, 200, "{}", evaluated.text());
    for id in &acknowledged {
        assert_eq!(server.get(&format!("/v1/jobs/{id}")).await.status, 200);
    }

    fs::remove_file(&filler).unwrap();
    let reply = post(address, &ball(2.0)).await.unwrap();
    assert_eq!(reply.status, 202, "{}", reply.text());
    acknowledged.push(id(&reply.json()));
    for id in &acknowledged {
        let job = server.ended(id).await;
        assert_eq!(job["state"], "succeeded", "{job}");
    }
    server.end();
}

#[test]
fn the_program_reports_a_read_only_data_directory() {
    let dir = TempDir::new().unwrap();
    let mount = "mount --bind \"$0\" \"$0\" && mount -o remount,bind,ro \"$0\"";
    let Some(mut command) = mounting(mount, dir.path()) else { return };
    let output = command.args(["--listen", "127.0.0.1:0", "--data-dir"]).arg(dir.path()).output();
    fails(&output.unwrap(), "Read-only file system");
}

#[tokio::test]
async fn the_program_ends_with_an_error_for_an_unusable_database() {
    let dir = TempDir::new().unwrap();
    let path = dir.path().join("fretwork.db");
    let refused = |words: &str| {
        let data = dir.path().to_str().unwrap();
        let output = run(&["--listen", "127.0.0.1:0", "--data-dir", data], "");
        fails(&output, words);
        fails(&output, path.to_str().unwrap());
    };
    Program::start(dir.path(), "1").end();
    let mut db = raw(dir.path()).await;
    db.execute("UPDATE _sqlx_migrations SET version = 9999 WHERE version = 1").await.unwrap();
    db.close().await.unwrap();
    refused("later version");

    fs::remove_file(&path).unwrap();
    let mut db = raw(dir.path()).await;
    db.execute("CREATE TABLE photo (name TEXT)").await.unwrap();
    db.close().await.unwrap();
    refused("another program");

    fs::write(&path, "a text that is not a database\n".repeat(100)).unwrap();
    refused("not a database");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_database_page_affects_only_requests_that_use_it() {
    let dir = TempDir::new().unwrap();
    let server = Program::start(dir.path(), "1");
    let known = server.ended(&id(&post(server.address, &ball(2.0)).await.unwrap().json())).await;
    server.end();
    let mut db = raw(dir.path()).await;
    let root = "SELECT rootpage FROM sqlite_schema WHERE name = 'job_label'";
    let page: i64 = sqlx::query_scalar(root).fetch_one(&mut db).await.unwrap();
    db.close().await.unwrap();

    let server = Program::start(dir.path(), "1");
    let file = File::options().write(true).open(dir.path().join("fretwork.db")).unwrap();
    file.write_all_at(&[0xa5; 4096], (page as u64 - 1) * 4096).unwrap();
    server.get("/v1/jobs?label=x").await.problem(500, "database-damaged");
    assert!(!server.result(&known).await.is_empty());
    let mut body = ball(3.0);
    post(server.address, &body).await.unwrap().problem(500, "database-damaged");
    body.as_object_mut().unwrap().remove("label");
    let job = server.ended(&id(&post(server.address, &body).await.unwrap().json())).await;
    assert_eq!(job["state"], "succeeded", "{job}");
    let damaged = "fretwork_store_errors_total{kind=\"damaged\"}";
    assert!(metric(server.address, damaged).await >= 2.0);
    server.end();
}

#[tokio::test]
async fn a_damaged_search_index_does_not_prevent_the_start() {
    let (dir, store) = fresh().await;
    let root = "SELECT rootpage FROM sqlite_schema WHERE name = 'outline'";
    let mut db = raw(dir.path()).await;
    let page: i64 = sqlx::query_scalar(root).fetch_one(&mut db).await.unwrap();
    db.close().await.unwrap();
    store.close().await;
    let file = File::options().write(true).open(dir.path().join("fretwork.db")).unwrap();
    file.write_all_at(&[0xff; 4096], (page as u64 - 1) * 4096).unwrap();
    let store = open(dir.path()).await;
    accepted(store.submit(new_job(1)).await);
    store.close().await;
}

/// Real work that starts again when it is done, so it takes as long as the test wants.
struct EndlessWork {
    work: Box<dyn Work>,
    again: Box<dyn Fn() -> Box<dyn Work> + Send>,
    control: Arc<Control>,
}

/// The state that a test shares with its [`EndlessWork`].
struct Control {
    /// The directories in /proc of the threads that have computed.
    threads: Mutex<HashSet<String>>,
    begun: AtomicU32,
    /// If this is set, the work ends when it is next done, instead of starting again.
    enough: AtomicBool,
    /// A test that holds the only permit stops the work before its next step.
    go: Semaphore,
}

impl Work for EndlessWork {
    fn step(&mut self) -> Step {
        // The permit is returned at once.
        while self.control.go.try_acquire().is_err() {
            std::thread::yield_now();
        }
        match self.work.step() {
            Step::Done(answer) if self.control.enough.load(Ordering::SeqCst) => Step::Done(answer),
            Step::Done(_) => {
                self.work = (self.again)();
                Step::Working { progress: 0.5 }
            }
            working @ Step::Working { .. } => working,
        }
    }
}

impl Control {
    fn new() -> Arc<Self> {
        Arc::new(Self {
            threads: Mutex::default(),
            begun: AtomicU32::new(0),
            enough: AtomicBool::new(false),
            go: Semaphore::new(1),
        })
    }

    fn compute(self: &Arc<Self>) -> Begin {
        let control = Arc::clone(self);
        Arc::new(move |key: &Key, task: &str, prepared| {
            control.begun.fetch_add(1, Ordering::SeqCst);
            // Other tests of this process have threads of the same name, so names cannot be used.
            let thread = fs::read_link("/proc/thread-self").unwrap();
            control.threads.lock().unwrap().insert(format!("/proc/{}", thread.display()));
            let (key, task) = (*key, task.to_owned());
            let again = Box::new(move || Task::start(&key, &task, prepared.clone()).unwrap());
            Ok(Box::new(EndlessWork { work: again(), again, control: Arc::clone(&control) })
                as Box<dyn Work>)
        })
    }

    /// Processor time of the threads in ms.
    fn processor_time(&self) -> u64 {
        let ticks = |thread: &String| {
            let stat = fs::read_to_string(format!("{thread}/stat")).unwrap();
            // The fields after the name in parentheses: state, …, utime, stime.
            let (head, numbers) = stat.rsplit_once(") ").unwrap();
            assert!(head.contains("(worker-"), "{head}");
            let times = numbers.split(' ').skip(11).take(2);
            times.map(|number| number.parse::<u64>().unwrap()).sum::<u64>()
        };
        // A tick is 10 ms on all common Linux systems.
        10 * self.threads.lock().unwrap().iter().map(ticks).sum::<u64>()
    }
}

async fn server(compute: Begin) -> Server {
    Server::with(compute, &Settings::default(), &Options::default()).await
}

async fn until_state(server: &Server, id: &str, state: &str) {
    while server.get(&format!("/v1/jobs/{id}")).await.json()["state"] != state {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
}

async fn cancel(server: &Server, id: &str) -> Value {
    let reply = server.send("POST", &format!("/v1/jobs/{id}/cancel"), &[], "").await;
    assert_eq!(reply.status, 200);
    reply.json()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cancelled_long_run_stops_using_the_processor() {
    let control = Control::new();
    let server = server(control.compute()).await;
    let job = id(&server.post("/v1/jobs", &heavy()).await.json());
    until_state(&server, &job, "running").await;
    while control.processor_time() < 100 {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    cancel(&server, &job).await;
    until_idle(|| Duration::from_millis(control.processor_time())).await;
    until_state(&server, &job, "canceled").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_submission_during_cancellation_starts_a_new_run() {
    let control = Control::new();
    let server = server(control.compute()).await;
    let dying = id(&server.post("/v1/jobs", &heavy()).await.json());
    until_state(&server, &dying, "running").await;
    // While the test holds the permit, the run waits before its next step, so it does not notice the cancellation.
    let held = control.go.acquire().await.unwrap();
    assert_eq!(cancel(&server, &dying).await["state"], "canceling");
    let new = server.post("/v1/jobs", &heavy()).await.json();
    assert_eq!(new["origin"], "computed");
    control.enough.store(true, Ordering::SeqCst);
    drop(held);
    let new = server.get(&format!("/v1/jobs/{}?wait=60", id(&new))).await.json();
    assert_eq!(new["state"], "succeeded", "{new}");
    until_state(&server, &dying, "canceled").await;
    assert_eq!(control.begun.load(Ordering::SeqCst), 2);
}

/// Submits from another address of this machine, which is another owner.
async fn post_as_another(address: SocketAddr, body: &Value) -> Value {
    let socket = TcpSocket::new_v4().unwrap();
    socket.bind("127.0.0.2:0".parse().unwrap()).unwrap();
    let mut connection = socket.connect(address).await.unwrap();
    let body = body.to_string();
    let request = format!(
        "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\nContent-Type: \
         application/json\r\nContent-Length: {}\r\n\r\n{body}",
        body.len()
    );
    connection.write_all(request.as_bytes()).await.unwrap();
    let mut answer = String::new();
    connection.read_to_string(&mut answer).await.unwrap();
    assert!(answer.starts_with("HTTP/1.1 202 "), "{answer}");
    serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_can_be_read_and_cancelled_while_the_queue_is_full() {
    let gate = Gate::default();
    let options = Options { queue_limit: 20, ..Options::default() };
    let server = Server::with(gate.compute(), &Settings::default(), &options).await;
    let address = server.address;
    let over = Arc::new(AtomicBool::new(false));
    // This client submits without pause, so the queue is full most of the time.
    let filling = tokio::spawn({
        let over = Arc::clone(&over);
        async move {
            let mut accepted = Vec::new();
            let mut refused = 0;
            while !over.load(Ordering::SeqCst) {
                let number = accepted.len() + refused;
                let reply = post(address, &ball(1.0 + number as f64 * 1e-5)).await.unwrap();
                if reply.status == 202 {
                    accepted.push(id(&reply.json()));
                } else {
                    reply.problem(503, "queue-full");
                    refused += 1;
                }
            }
            (accepted, refused)
        }
    });
    while metric(address, "fretwork_queued_runs").await < 18.0 {}
    let jobs = server.get("/v1/jobs?state=queued&limit=5").await.json();
    for job in jobs["jobs"].as_array().unwrap() {
        let job = id(job);
        assert_eq!(server.get(&format!("/v1/jobs/{job}")).await.json()["state"], "queued");
        assert_eq!(cancel(&server, &job).await["state"], "canceled");
        let gone = server.send("DELETE", &format!("/v1/jobs/{job}"), &[], "").await;
        assert_eq!(gone.status, 204);
    }
    // The last tenth of the queue is reserved for other owners.
    let other = id(&post_as_another(address, &ball(3.0)).await);
    while metric(address, "fretwork_queued_runs").await < 18.0 {}
    over.store(true, Ordering::SeqCst);
    let (accepted, refused) = filling.await.unwrap();
    assert!(accepted.len() >= 20 && refused > 0, "{} and {refused}", accepted.len());
    gate.open();
    let other = server.get(&format!("/v1/jobs/{other}?wait=60")).await.json();
    assert_eq!(other["state"], "succeeded", "{other}");
}
