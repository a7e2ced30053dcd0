//! Several servers share one database of PostgreSQL.

use std::fs::{self, Permissions};
use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::PermissionsExt as _;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use fretwork_job::{Cost, FailureKind, JobState, Origin};
use fretwork_store::{
    Actor, Canceled, Claimed, Error, Finish, NewJob, Options, Piece, Place, Recovered, Repeatable,
    Store, Submitted,
};
use serde_json::{Value, json};
use sqlx::{Connection as _, Executor as _, PgConnection};
use tempfile::{NamedTempFile, TempDir};
use tokio::task::JoinSet;
use tokio::time::{sleep, timeout};

use crate::chunks::study;
use crate::database::{Cluster, Database, Engine, PATIENCE};
use crate::keeping::eventually;
use crate::kill::{Program, equal_undisturbed_results, id, long};
use crate::program::{Running, fretwork, run};
use crate::server::{JSON, metric, send};
use crate::store::{accepted, answer, claim, job, key, new_job};
use crate::studies::{long_sweep, processor_time, until_idle};
use crate::team::{Listener, has, states};

/// An empty database, opened by a number of servers. During a test, these servers read the tables again and stop workers
/// only because of notifications.
async fn servers<const COUNT: usize>() -> (Database, [Store; COUNT]) {
    let hour = Duration::from_hours(1);
    let options = Options { lease: hour, poll: hour, ..Options::default() };
    let db = Database::new(Engine::Postgres);
    let mut stores = Vec::new();
    for _ in 0..COUNT {
        let store = db.open_with(&options).await;
        listens(&db, &store).await;
        stores.push(store);
    }
    (db, stores.try_into().unwrap())
}

/// Waits until a server listens to notifications. It begins in the background, and then reads the tables once.
async fn listens(db: &Database, store: &Store) {
    let mut deletions = store.watch_deletions();
    eventually(async || {
        db.execute(&format!("SELECT pg_notify('fretwork', E'test\\ndeleted {}')", key(0))).await;
        let heard = timeout(Duration::from_millis(100), deletions.next()).await;
        heard.is_ok_and(|deleted| deleted == Some(key(0)))
    })
    .await;
}

/// The integer that a statement returns.
async fn count(db: &mut PgConnection, query: &'static str) -> i64 {
    sqlx::query_scalar(query).fetch_one(db).await.unwrap()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn equal_submissions_through_three_servers_share_one_run() {
    let (db, stores) = servers::<3>().await;
    for number in 0..5 {
        let mut submissions = JoinSet::new();
        for place in 0..64 {
            let store = stores[place % 3].clone();
            submissions.spawn(async move { accepted(store.submit(new_job(number)).await) });
        }
        let jobs = submissions.join_all().await;
        let computed = jobs.iter().filter(|job| job.origin == Origin::Computed).count();
        assert_eq!((jobs.len(), computed), (64, 1));
    }
    assert_eq!(db.count("SELECT count(*) FROM run").await, 5);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_submission_that_is_sent_to_all_servers_at_once_is_one_job() {
    let (db, stores) = servers::<3>().await;
    let mut submissions = JoinSet::new();
    for place in 0..30 {
        let store = stores[place % 3].clone();
        let repeatable = Some(Repeatable { key: "once".into(), fingerprint: vec![1] });
        submissions
            .spawn(async move { store.submit(NewJob { repeatable, ..new_job(1) }).await.unwrap() });
    }
    let (mut new, mut ids) = (0, Vec::new());
    for submitted in submissions.join_all().await {
        match submitted {
            Submitted::Accepted(job) => {
                new += 1;
                ids.push(job.id);
            }
            Submitted::Repeated(job) => ids.push(job.id),
            other => panic!("{other:?}"),
        }
    }
    ids.dedup();
    assert_eq!((new, ids.len()), (1, 1));
    assert_eq!(db.count("SELECT count(*) FROM job").await, 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn workers_of_several_servers_share_the_queue_without_claiming_a_run_twice() {
    let (_db, stores) = servers::<3>().await;
    for number in 0..60 {
        accepted(stores[0].submit(new_job(number)).await);
    }
    accepted(stores[1].submit(study(200, 40)).await);
    let mut workers = JoinSet::new();
    for store in stores.clone() {
        for _ in 0..3 {
            let store = store.clone();
            workers.spawn(async move {
                let mut claims: Vec<Claimed> = Vec::new();
                for _ in 0..200 {
                    let Some(claimed) = store.claim().await.unwrap() else {
                        sleep(Duration::from_millis(5)).await;
                        continue;
                    };
                    let stored = if matches!(claimed.piece, Piece::Chunk { .. }) {
                        store.finish_chunk(&claimed, b"1", Cost::ZERO).await.unwrap()
                    } else {
                        let finish = store.finish(&claimed, &answer("a"), Cost::ZERO).await;
                        finish.unwrap() == Finish::Stored
                    };
                    assert!(stored, "{claimed:?}");
                    claims.push(claimed);
                }
                claims.len()
            });
        }
    }
    let counts = workers.join_all().await;
    assert_eq!(counts.iter().sum::<usize>(), 60 + 40 + 1, "{counts:?}");
    let unfinished = stores[2].unfinished("ada").await.unwrap();
    assert_eq!(unfinished, (0, 0));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_wait_at_one_server_ends_when_another_one_ends_the_job() {
    let (_db, [front, worker]) = servers().await;
    let submitted = accepted(front.submit(new_job(1)).await);
    let waiting = timeout(PATIENCE, front.wait(submitted.clone(), std::future::pending()));
    let mut changes = front.watch(&key(1));
    let computing = async {
        let claimed = claim(&worker).await;
        timeout(PATIENCE, changes.changed()).await.expect("the other server hears of the claim");
        worker.finish(&claimed, &answer("a"), Cost::ZERO).await.unwrap();
    };
    let (waited, ()) = tokio::join!(waiting, computing);
    let waited = waited.expect("the other server hears of the end").unwrap();
    assert_eq!(waited.state, JobState::Succeeded);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_is_notified_of_a_run_that_another_server_has_queued() {
    let (_db, [front, worker]) = servers().await;
    assert!(worker.claim().await.unwrap().is_none());
    let mut queue = worker.watch_queue();
    accepted(front.submit(new_job(1)).await);
    timeout(PATIENCE, queue.changed()).await.expect("the worker hears of the run");
    claim(&worker).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_cancellation_at_one_server_stops_the_worker_of_another_one() {
    let (_db, [front, worker]) = servers().await;
    for new in [new_job(1), study(2, 5)] {
        let submitted = accepted(front.submit(new).await);
        let claimed = claim(&worker).await;
        let done = front.cancel(submitted.id, Actor::default()).await.unwrap();
        assert!(matches!(done, Canceled::Done(_)), "{done:?}");
        eventually(async || claimed.stop.is_raised()).await;
        worker.stopped(&claimed).await.unwrap();
        assert_eq!(job(&front, submitted.id).await.state, JobState::Canceled);
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_lease_that_is_not_renewed_is_taken_away_and_its_worker_changes_nothing() {
    let db = Database::new(Engine::Postgres);
    let lease = Options { lease: Duration::from_secs(15), ..Options::default() };
    let (dying, other) = (db.open_with(&lease).await, db.open_with(&lease).await);
    let submitted = accepted(dying.submit(new_job(1)).await);
    let claimed = claim(&dying).await;
    // The background tasks of the store renew its lease, after a third of it: 5 s.
    let end = db.count("SELECT expires FROM lease").await;
    eventually(async || db.count("SELECT expires FROM lease").await > end).await;
    assert_eq!(other.recover().await.unwrap(), Recovered::default());
    assert_eq!(job(&other, submitted.id).await.state, JobState::Running);
    // The store stops as if its machine were switched off. It does not give the lease back. Then the lease ends.
    dying.close().await;
    db.execute("UPDATE lease SET expires = 0").await;
    eventually(async || job(&other, submitted.id).await.state == JobState::Queued).await;
    let second = claim(&other).await;
    assert_eq!(second.attempt, 2);
    let zombie = db.open().await;
    assert!(!zombie.progress(&claimed, 0.5).await.unwrap());
    assert!(!zombie.fail(&claimed, FailureKind::Panicked, "late").await.unwrap());
    assert!(!zombie.release(&claimed).await.unwrap());
    let late = zombie.finish(&claimed, &answer("late"), Cost::ZERO).await.unwrap();
    assert_eq!(late, Finish::Refused);
    assert_eq!(other.finish(&second, &answer("a"), Cost::ZERO).await.unwrap(), Finish::Stored);
}

/// Replaces the SQL function by which the service reads the clock of a database. The new clock is ahead by a number of
/// seconds, which may be negative.
async fn set_clock(db: &mut PgConnection, ahead: i64) {
    let change = format!(
        "CREATE OR REPLACE FUNCTION moment() RETURNS BIGINT LANGUAGE sql STABLE
             RETURN (extract(epoch FROM now()) * 1000)::BIGINT + {}",
        1000 * ahead
    );
    sqlx::raw_sql(sqlx::AssertSqlSafe(change)).execute(db).await.unwrap();
}

fn is_long() -> bool {
    std::env::var_os("FRETWORK_TEST_LONG").is_some()
}

/// Steps of the clock by an hour or a day, in seconds. `tests/long` takes more of them.
fn steps() -> &'static [i64] {
    const STEPS: [i64; 6] = [3600, 3600, 86_400, -3600, -86_400, 86_400];
    if is_long() { &STEPS } else { &STEPS[2..5] }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_living_node_loses_its_lease_when_the_clock_of_the_database_steps() {
    /// After a step, the worker renews its lease within a third of it. The other server waits for half of it. So a slow
    /// machine has the difference of 1.7 s for the renewal. This makes the test take 16 s, almost all of it asleep.
    const LEASE: Duration = Duration::from_secs(10);
    let db = Database::new(Engine::Postgres);
    let lease = Options { lease: LEASE, ..Options::default() };
    let (worker, other) = (db.open_with(&lease).await, db.open_with(&lease).await);
    let submitted = accepted(other.submit(new_job(1)).await);
    let claimed = claim(&worker).await;
    let mut raw = PgConnection::connect(&db.address()).await.unwrap();
    let mut ahead = 0;
    for step in steps() {
        // After this time the other server could take leases away, if they had expired.
        sleep(LEASE / 2 + Duration::from_millis(100)).await;
        ahead += step;
        set_clock(&mut raw, ahead).await;
        let late =
            "SELECT count(*) FROM lease WHERE expires NOT BETWEEN moment() AND moment() + lasts";
        eventually(async || count(&mut raw, late).await == 0).await;
        let now = job(&other, submitted.id).await;
        assert_eq!((now.state, now.attempt), (JobState::Running, 1), "a step of {step} s");
    }
    assert_eq!(worker.finish(&claimed, &answer("a"), Cost::ZERO).await.unwrap(), Finish::Stored);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn the_lease_of_a_dead_node_ends_after_a_step_of_the_clock_in_each_direction() {
    let db = Database::new(Engine::Postgres);
    let lease = Options { lease: Duration::from_secs(1), ..Options::default() };
    let other = db.open_with(&lease).await;
    let mut raw = PgConnection::connect(&db.address()).await.unwrap();
    for (number, ahead) in (1..).zip([-3600, -90_000, 3600, 0]) {
        let dying = db.open_with(&lease).await;
        let submitted = accepted(dying.submit(new_job(number)).await);
        claim(&dying).await;
        dying.close().await;
        set_clock(&mut raw, ahead).await;
        // Each step is longer than this waits.
        eventually(async || job(&other, submitted.id).await.state == JobState::Queued).await;
        let again = claim(&other).await;
        assert_eq!(again.key, key(number));
        other.finish(&again, &answer("a"), Cost::ZERO).await.unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_with_a_short_lease_takes_no_longer_lease_away() {
    let db = Database::new(Engine::Postgres);
    let lease = |seconds| Options { lease: Duration::from_secs(seconds), ..Options::default() };
    let (worker, other) = (db.open_with(&lease(30)).await, db.open_with(&lease(1)).await);
    let submitted = accepted(worker.submit(new_job(1)).await);
    claim(&worker).await;
    assert_eq!(other.recover().await.unwrap(), Recovered::default());
    assert_eq!(job(&other, submitted.id).await.state, JobState::Running);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_server_runs_beside_a_later_one_until_the_tables_require_the_later_one() {
    let (db, [store]) = servers().await;
    let later =
        "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time)
        VALUES (99, 'later', TRUE, '', 0)";
    db.execute(later).await;
    let beside = db.open().await;
    let submitted = accepted(beside.submit(new_job(1)).await);
    let claimed = claim(&store).await;

    db.execute("UPDATE upkeep SET oldest = 99").await;
    let refuses = |error: Error| matches!(error, Error::Newer { found: 99, .. });
    eventually(async || store.probe().await.is_err_and(refuses)).await;
    assert!(store.submit(new_job(2)).await.is_err_and(refuses));
    assert!(store.finish(&claimed, &answer("a"), Cost::ZERO).await.is_err_and(refuses));
    assert_eq!(job(&store, submitted.id).await.state, JobState::Running);
    let started = Store::open(Place::Shared(db.url()), &Options::default()).await;
    let text = started.unwrap_err().to_string();
    assert!(text.contains("was written by a later version"), "{text}");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_setting_of_the_database_that_prevents_everything_is_named() {
    let (db, [_store]) = servers().await;
    let address = db.address();
    let name = address.split('?').next().unwrap().rsplit('/').next().unwrap();
    let says = async |address: &str, advice: &str| {
        let opened =
            Store::open(Place::Shared(address.parse().unwrap()), &Options::default()).await;
        let refused = opened.unwrap_err();
        assert!(matches!(refused, Error::Unfit(..)), "{refused:?}");
        assert!(refused.to_string().contains(advice), "{refused}");
    };
    says(&address.replace(&format!("/{name}?"), "/no_such_database?"), "does not exist; create it")
        .await;
    db.execute(&format!("ALTER DATABASE {name} SET default_transaction_read_only = on")).await;
    says(&address, "name the primary server").await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn nodes_that_die_together_fail_no_study() {
    let (db, [store]) = servers().await;
    let submitted = accepted(store.submit(study(1, 5)).await);
    for _ in 0..4 {
        claim(&store).await;
    }
    let lost = async |number| {
        db.execute(&format!("UPDATE lease SET expires = 0 WHERE number = {number}")).await;
        store.recover().await.unwrap()
    };
    for number in 0..3 {
        let requeued = Recovered { requeued: 1, ..Recovered::default() };
        assert_eq!(lost(number).await, requeued, "chunk {number}");
    }
    assert_eq!(job(&store, submitted.id).await.state, JobState::Running);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn workers_of_another_numerics_version_leave_a_run_in_the_queue() {
    let (db, [store]) = servers().await;
    accepted(store.submit(new_job(1)).await);
    db.execute("UPDATE run SET numerics = numerics + 1; UPDATE job SET claimable = claimable + 1")
        .await;
    accepted(store.submit(new_job(2)).await);
    assert_eq!(claim(&store).await.key, key(2));
    assert!(store.claim().await.unwrap().is_none());
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_store_reconnects_after_its_connections_were_cut() {
    let (db, [store, other]) = servers().await;
    for number in 0..3 {
        accepted(store.submit(new_job(number)).await);
        let cut = "SELECT count(pg_terminate_backend(pid, 10000)) FROM pg_stat_activity
            WHERE datname = current_database() AND pid <> pg_backend_pid()";
        assert!(db.count(cut).await >= 2);
        // Reads and changes work again at once.
        let claimed = claim(&store).await;
        assert_eq!(claimed.key, key(number));
        let finish = store.finish(&claimed, &answer("a"), Cost::ZERO).await.unwrap();
        assert_eq!(finish, Finish::Stored);
    }
    // Notifications work again too.
    listens(&db, &other).await;
    let mut queue = other.watch_queue();
    accepted(store.submit(new_job(3)).await);
    timeout(PATIENCE, queue.changed()).await.expect("the other server hears of the run");
}

/// The usual time of a lease. The leases of dead workers end earlier, because the tests change the table.
const LEASE: &str = "3s";

/// A command that starts a server or a worker on this PostgreSQL server.
fn node(command: Command, cluster: &Cluster, lease: &str) -> Command {
    let mut command = command;
    command.env("FRETWORK_DATABASE", cluster.address()).env("FRETWORK_LEASE", lease);
    command
}

/// A server without workers.
fn front(cluster: &Cluster, dir: &TempDir, lease: &str) -> Program {
    Program::start_by(node(fretwork(&["--workers", "0"]), cluster, lease), dir.path())
}

fn worker(cluster: &Cluster, lease: &str) -> Running {
    let mut command = node(fretwork(&["worker", "--workers", "1"]), cluster, lease);
    Running(command.env("FRETWORK_LOG", "off").spawn().unwrap())
}

/// A worker that answers monitors.
fn monitored_worker(cluster: &Cluster) -> Program {
    let words = ["worker", "--workers", "1", "--listen", "127.0.0.1:0", "--drain-seconds", "3"];
    let mut command = node(fretwork(&words), cluster, LEASE);
    command.env("FRETWORK_LOG", "off").stdout(Stdio::piped());
    let mut child = Running(command.spawn().unwrap());
    let mut line = String::new();
    BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
    let address = line.split(' ').find_map(|word| word.strip_prefix("http://")).expect(&line);
    Program { address: address.parse().unwrap(), child }
}

fn signal(process: &Running, name: &str) {
    let id = process.id().to_string();
    assert!(Command::new("kill").args([name, &id]).status().unwrap().success());
}

fn signal_all(processes: &[Running], name: &str) {
    for process in processes {
        signal(process, name);
    }
}

/// Stops all workers at a moment when at least one of them computes.
async fn stop_while_computing(workers: &[Running], db: &mut PgConnection) {
    eventually(async || {
        signal_all(workers, "-STOP");
        let computes = count(db, "SELECT count(*) FROM lease").await > 0;
        if !computes {
            signal_all(workers, "-CONT");
        }
        computes
    })
    .await;
}

/// Submits bodies to a server. Tries again while the server cannot reach the database. Returns each with the id of its
/// job.
async fn submit_all(server: &Program, bodies: Vec<Value>) -> Vec<(Value, String)> {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    let mut ids = Vec::new();
    for body in bodies {
        let once = format!("body-{}", NEXT.fetch_add(1, Ordering::Relaxed));
        let id = loop {
            let headers = [JSON, ("Idempotency-Key", &*once)];
            let text = body.to_string();
            let reply = send(server.address, "POST", "/v1/jobs", &headers, text).await.unwrap();
            match reply.status {
                202 => break id(&reply.json()),
                503 => assert!(reply.header("retry-after").is_some(), "{}", reply.text()),
                other => panic!("{other}: {}", reply.text()),
            }
            sleep(Duration::from_millis(50)).await;
        };
        ids.push((body, id));
    }
    ids
}

/// The bodies with the results of their jobs, which must have succeeded.
async fn results(server: &Program, ids: Vec<(Value, String)>) -> Vec<(Value, Vec<u8>)> {
    let mut results = Vec::new();
    for (body, id) in ids {
        let mut job = Value::Null;
        eventually(async || {
            let reply = server.get(&format!("/v1/jobs/{id}?wait=5")).await;
            if reply.status == 200 {
                job = reply.json();
            }
            job["times"]["finished"].is_string()
        })
        .await;
        assert_eq!(job["state"], "succeeded", "{job}");
        results.push((body, server.result(&job).await));
    }
    results
}

/// A run of less than a millisecond.
fn short(number: u32) -> Value {
    let mut body = long(0);
    let scenario = &mut body["scenario"];
    scenario["friction"] = json!(0.3 + 1e-6 * f64::from(number));
    scenario["cycles"] = json!([1000]);
    scenario["model"] = json!({"method": "simplified", "points": 16});
    body
}

/// Long and short runs and a study that no other round has. Workers claim short runs in groups.
fn load(round: u32) -> Vec<Value> {
    const RUNS: u32 = 12;
    const SHORT: u32 = 100;
    let mut sweep = long_sweep(6000);
    sweep["sweep"]["vary"][0]["to"] = json!(0.8 + 1e-3 * f64::from(round));
    let runs = (round * RUNS..(round + 1) * RUNS).map(long);
    let short = (round * SHORT..(round + 1) * SHORT).map(short);
    short.chain([sweep]).chain(runs).collect()
}

/// How often workers are killed or stopped. `tests/long` sets the variable.
fn rounds() -> u32 {
    if is_long() { 50 } else { 3 }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn killed_and_frozen_workers_lose_no_run_and_change_no_result() {
    let cluster = Cluster::start(&["--durable"]);
    let dir = TempDir::new().unwrap();
    let front = front(&cluster, &dir, LEASE);
    let mut workers = [(); 3].map(|()| worker(&cluster, LEASE));
    let mut all = Vec::new();
    let mut db = PgConnection::connect(cluster.address()).await.unwrap();
    let (mut round, mut interrupted) = (0, 0);
    // Killing an idle worker proves nothing. So rounds follow until a worker was interrupted while it computed.
    while round < rounds() || interrupted == 0 {
        assert!(round < 80, "no worker was interrupted while it computed");
        let submitting = submit_all(&front, load(round));
        let (ids, ()) = tokio::join!(submitting, stop_while_computing(&workers, &mut db));
        sqlx::query("UPDATE lease SET expires = 0").execute(&mut db).await.unwrap();
        let other = if round % 2 == 0 {
            signal_all(&workers, "-KILL");
            workers = [(); 3].map(|()| worker(&cluster, LEASE));
            None
        } else {
            // Another worker takes over the runs of the frozen workers, which continue afterwards.
            let other = worker(&cluster, LEASE);
            let left = "SELECT (SELECT count(*) FROM lease WHERE expires = 0)
                + (EXISTS (SELECT 1 FROM run WHERE finished IS NULL) AND NOT EXISTS (SELECT 1 FROM lease))::INTEGER";
            eventually(async || count(&mut db, left).await == 0).await;
            signal_all(&workers, "-CONT");
            Some(other)
        };
        all.extend(results(&front, ids).await);
        drop(other);
        let attempts = "SELECT (SELECT count(*) FROM run WHERE attempt > 1)
            + (SELECT count(*) FROM chunk WHERE attempt > 1)";
        interrupted = count(&mut db, attempts).await;
        round += 1;
    }
    equal_undisturbed_results(all).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_ends_by_itself_when_its_time_is_over_and_when_nothing_is_left_to_compute() {
    let (cluster, dir) = (Cluster::start(&[]), TempDir::new().unwrap());
    let front = front(&cluster, &dir, LEASE);
    let ids = submit_all(&front, vec![long_sweep(40_000)]).await;
    let work = |option: &str, time: &str| {
        let words = ["worker", "--workers", "1", option, time];
        let mut command = node(fretwork(&words), &cluster, LEASE);
        assert!(command.env("FRETWORK_LOG", "off").status().unwrap().success());
    };
    let progress = async || {
        let job = front.get(&format!("/v1/jobs/{}", ids[0].1)).await.json();
        job["progress"].as_f64().unwrap()
    };
    // On a slow machine, the first workers may finish no chunk.
    eventually(async || {
        work("--until", "1s");
        progress().await > 0.0
    })
    .await;
    assert!(progress().await < 1.0);
    let mut db = PgConnection::connect(cluster.address()).await.unwrap();
    let begun =
        "SELECT (SELECT count(*) FROM lease) + (SELECT count(*) FROM chunk WHERE attempt > 1)";
    let begun = count(&mut db, begun).await;
    assert_eq!(begun, 0, "chunks that the worker has begun and not finished");
    // On a slow machine, a worker may begin its first chunk later than after 1 s.
    work("--idle-exit", "3s");
    equal_undisturbed_results(results(&front, ids).await).await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_restart_of_the_database_loses_nothing_that_was_acknowledged() {
    let mut cluster = Cluster::start(&["--durable"]);
    let dir = TempDir::new().unwrap();
    let front = front(&cluster, &dir, LEASE);
    let _workers = [(); 2].map(|()| worker(&cluster, LEASE));
    let mut db = PgConnection::connect(cluster.address()).await.unwrap();
    let mut ids = submit_all(&front, load(0)).await;
    eventually(async || count(&mut db, "SELECT count(*) FROM lease").await > 0).await;
    cluster.restart();
    ids.extend(submit_all(&front, load(1)).await);
    equal_undisturbed_results(results(&front, ids).await).await;
}

/// A run that no test computes to its end.
fn very_long() -> Value {
    blocks(200)
}

/// A run of blocks with the smallest tolerance. Each block takes about half a second.
fn blocks(count: u32) -> Value {
    let mut body = long(0);
    let scenario = &mut body["scenario"];
    scenario["model"] = json!({"method": "exact", "tolerance": 1e-4, "points": 1024});
    scenario["load"]["held"] = json!("force");
    let block = |number: u32| json!({"amplitude": 2e-6 + 1e-6 * f64::from(number) / f64::from(count), "cycles": 1e8});
    scenario["motion"] = json!({"blocks": (0..count).map(block).collect::<Vec<_>>()});
    scenario["cycles"] = json!([1e8, 1e8 * f64::from(count)]);
    body
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn no_lease_is_lost_while_the_database_does_not_answer() {
    /// The database stops for longer than a lease and its margin. Then all nodes see at the same time that the lease has
    /// expired. They wait for half of a lease, so a slow machine has 4 s for the renewal. This makes the test take 15 s.
    const LEASE: &str = "8s";
    let cluster = Cluster::start(&[]);
    let dir = TempDir::new().unwrap();
    let front = front(&cluster, &dir, LEASE);
    let _workers = [(); 2].map(|()| worker(&cluster, LEASE));
    let job = submit_all(&front, vec![very_long()]).await.remove(0).1;
    let mut db = PgConnection::connect(cluster.address()).await.unwrap();
    let renewed = "SELECT count(*) FROM lease WHERE expires > moment()";
    eventually(async || count(&mut db, renewed).await == 1).await;
    cluster.signal("-STOP");
    sleep(Duration::from_millis(9600)).await;
    cluster.signal("-CONT");
    eventually(async || count(&mut db, renewed).await == 1).await;
    let job = front.get(&format!("/v1/jobs/{job}")).await.json();
    assert_eq!((&job["state"], &job["attempt"]), (&json!("running"), &json!(1)), "{job}");
}

/// A scenario that takes some seconds and that no other round has.
fn slow(round: u32, number: u32) -> Value {
    let mut body = blocks(6);
    body["scenario"]["friction"] = json!(0.5 + 1e-6 * f64::from(2 * round + number));
    body
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn every_run_ends_in_time_after_a_step_of_the_clock_of_the_database() {
    // After a step, a node renews its lease within a third of it. The others wait for half of it. So a slow machine has the
    // difference of 1.5 s for the renewal. This makes the test take some 20 s.
    const LEASE: &str = "9s";
    let file = NamedTempFile::new().unwrap();
    fs::set_permissions(file.path(), Permissions::from_mode(0o644)).unwrap();
    fs::write(file.path(), "+0").unwrap();
    // A PostgreSQL server that reads its clock from a file needs another package and is slow. So only tests/long uses
    // it.
    let options = ["--clock", file.path().to_str().unwrap()];
    let cluster = Cluster::start(if is_long() { &options } else { &[] });
    let dir = TempDir::new().unwrap();
    let front = front(&cluster, &dir, LEASE);
    let _living = worker(&cluster, LEASE);
    // The server must be in contact with the database for this time before it revokes leases.
    sleep(Duration::from_millis(4500)).await;
    let mut db = PgConnection::connect(cluster.address()).await.unwrap();
    let mut ahead = 0;
    for (round, step) in (1..).zip(steps()) {
        let dying = worker(&cluster, LEASE);
        let ids = submit_all(&front, vec![slow(round, 0), slow(round, 1)]).await;
        let running = "SELECT count(*) FROM run WHERE state = 'running'";
        eventually(async || count(&mut db, running).await == 2).await;
        drop(dying);
        let _third = worker(&cluster, LEASE);
        ahead += step;
        if is_long() {
            fs::write(file.path(), format!("{ahead:+}")).unwrap();
        } else {
            set_clock(&mut db, ahead).await;
        }
        // Each step is longer than this waits.
        results(&front, ids).await;
        let attempts =
            "SELECT sum(attempt)::BIGINT FROM run WHERE id > (SELECT max(id) - 2 FROM run)";
        let attempts = count(&mut db, attempts).await;
        assert_eq!(attempts, 3, "only the run of the dead worker starts again");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn separate_server_and_worker_processes_share_runs_results_and_cancellations() {
    let cluster = Cluster::start(&[]);
    let dirs = [(); 3].map(|()| TempDir::new().unwrap());
    let fronts = dirs.each_ref().map(|dir| front(&cluster, dir, LEASE));
    let worker = worker(&cluster, LEASE);
    let mut db = PgConnection::connect(cluster.address()).await.unwrap();

    // Equal submissions to all servers share one run. A server would compute a shorter run itself, without the queue.
    let mut submissions = JoinSet::new();
    for number in 0..64 {
        let address = fronts[number % 3].address;
        let headers = [JSON, ("Prefer", "wait=60")];
        submissions.spawn(async move {
            let body = blocks(2).to_string();
            send(address, "POST", "/v1/jobs", &headers, body).await.unwrap()
        });
    }
    let replies = submissions.join_all().await;
    let jobs: Vec<_> = replies.iter().map(|reply| (reply.status, reply.json())).collect();
    assert!(jobs.iter().all(|(status, job)| *status == 200 && job["state"] == "succeeded"));
    assert_eq!(count(&mut db, "SELECT count(*) FROM run").await, 1);

    // A server that has a deleted result in memory stops serving it.
    let result = jobs[0].1["links"]["result"].as_str().unwrap();
    assert_eq!(fronts[0].get(result).await.status, 200);
    let deleted = send(fronts[1].address, "DELETE", result, &[], "").await.unwrap();
    assert_eq!(deleted.status, 204);
    eventually(async || fronts[0].get(result).await.status == 410).await;

    // One server sends the events of a job, and another server cancels the job.
    for body in [very_long(), long_sweep(250_000)] {
        let job = submit_all(&fronts[0], vec![body]).await.remove(0).1;
        let mut listener = Listener::connect(fronts[0].address, &job, None).await.unwrap();
        let begun = listener.until(|events| has(events, "progress"));
        let events = timeout(PATIENCE, begun).await.unwrap();
        assert_eq!(states(&events).last().map(|(_, state)| *state), Some("running"), "{events:?}");
        let cancel = format!("/v1/jobs/{job}/cancel");
        let reply = send(fronts[1].address, "POST", &cancel, &[], "").await.unwrap();
        assert!(matches!(reply.status, 200 | 202), "{}", reply.text());
        let job = format!("/v1/jobs/{job}");
        eventually(async || fronts[2].get(&job).await.json()["state"] == "canceled").await;
        let events = timeout(PATIENCE, listener.until(|_| false)).await.unwrap();
        assert_eq!(states(&events).last().map(|(_, state)| *state), Some("canceled"), "{events:?}");
        // The worker stops using the processor. The whole run would take many times as long as until now.
        let begun = processor_time(worker.id());
        until_idle(|| processor_time(worker.id())).await;
        let more = processor_time(worker.id()).saturating_sub(begun);
        assert!(more < begun, "it used {begun:?} before the cancellation, and then {more:?}");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_answers_monitors_and_serves_nothing_else() {
    let cluster = Cluster::start(&[]);
    let worker = monitored_worker(&cluster);
    assert_eq!(worker.get("/healthz").await.json()["status"], "ok");
    assert_eq!(worker.get("/readyz").await.json()["status"], "ready");
    assert!(run(&["health", "--url", &format!("http://{}", worker.address)], "").status.success());
    assert_eq!(metric(worker.address, "fretwork_workers").await, 1.0);
    let connections = metric(worker.address, "fretwork_database_connections").await;
    assert!((1.0..=9.0).contains(&connections), "{connections}");
    // Other programs back PostgreSQL up. The metric must not cause an alert until one of them has written its time.
    let backup = "fretwork_last_backup_timestamp_seconds";
    assert!(metric(worker.address, backup).await.is_nan());
    let examined = || {
        let output = run(&["doctor", "--url", &format!("http://{}", worker.address)], "");
        let said = String::from_utf8(output.stdout).unwrap();
        said.lines().filter(|line| !line.starts_with("ok ")).map(str::to_owned).collect::<Vec<_>>()
    };
    let bad = examined();
    assert!(bad[0].starts_with("warns  disk: unknown. "), "{bad:?}");
    assert!(bad[1].starts_with("warns  backup: none is known. "), "{bad:?}");
    let mut db = PgConnection::connect(cluster.address()).await.unwrap();
    db.execute("UPDATE upkeep SET backed_up = moment()").await.unwrap();
    let noted = metric(worker.address, backup).await;
    assert!((noted - fretwork_job::clock::now() as f64 / 1e3).abs() < 3600.0, "{noted}");
    assert_eq!(examined(), bad[..1]);
    for target in ["/", "/v1/jobs", "/version"] {
        let reply = worker.get(target).await;
        reply.problem(404, "not-found");
        assert!(reply.text().contains("/metrics"), "{}", reply.text());
    }

    let words = ["keys", "add", "monitor", "--role", "read", "--database", cluster.address()];
    let key = String::from_utf8(run(&words, "").stdout).unwrap();
    eventually(async || worker.get("/metrics").await.status == 401).await;
    let key = format!("Bearer {}", key.trim());
    let headers = [("Authorization", &*key)];
    let reply = send(worker.address, "GET", "/metrics", &headers, "").await.unwrap();
    assert_eq!(reply.status, 200);
    assert_eq!(worker.get("/readyz").await.status, 200);

    drop(cluster);
    // A database that stops may accept one more connection after it has ended others.
    eventually(async || {
        let reply = worker.get("/readyz").await;
        let is_refused = reply.status == 503;
        if is_refused {
            reply.problem(503, "not-ready");
        }
        is_refused
    })
    .await;
    assert_eq!(worker.get("/healthz").await.status, 200);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_worker_that_drains_is_not_ready_and_releases_its_run() {
    let cluster = Cluster::start(&[]);
    let dir = TempDir::new().unwrap();
    let front = front(&cluster, &dir, LEASE);
    let worker = monitored_worker(&cluster);
    // The job takes longer than the worker may drain.
    let job = submit_all(&front, vec![very_long()]).await.remove(0).1;
    let job = format!("/v1/jobs/{job}");
    eventually(async || front.get(&job).await.json()["state"] == "running").await;
    worker.tell_to_end();
    eventually(async || worker.get("/readyz").await.status == 503).await;
    let problem = worker.get("/readyz").await.problem(503, "not-ready");
    assert_eq!(problem["detail"], "The server is shutting down.");
    worker.end_of_it();
    assert_eq!(front.get(&job).await.json()["state"], "queued");
}
