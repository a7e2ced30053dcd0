//! Commands that are killed at random moments: nothing that was complete is lost, and a repetition finishes the work.
//!
//! `FRETWORK_TEST_LONG` kills each command a hundred times, and otherwise three times. `FRETWORK_TEST_SEED` chooses the moments.

use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::thread::sleep;
use std::time::{Duration, Instant};

use fretwork_store::{Repaired, check, repair};
use sqlx::Executor as _;
use tempfile::TempDir;

use crate::kill::Dice;
use crate::moving::{Lines, import};
use crate::program::{fretwork, run};
use crate::server::Server;
use crate::store::{crash, raw};
use crate::trust::small;

/// Number of results in the library.
const RESULTS: usize = 60;

/// A directory with results, whose server has stopped.
async fn library() -> TempDir {
    let server = Server::start().await;
    for number in 0..RESULTS {
        server.compute(&small(1.5 + 0.01 * number as f64, "exact")).await;
    }
    let dir = crash(server.dir.path());
    settle(dir.path()).await;
    dir
}

/// Moves the log into the database, so that the file `fretwork.db` has everything.
async fn settle(dir: &Path) {
    raw(dir).await.execute("PRAGMA wal_checkpoint(TRUNCATE)").await.unwrap();
}

/// Kills a command at a random moment of the time that it takes, for some copies of a directory.
struct Killer {
    dice: Dice,
    rounds: u32,
    /// The time of a run that is not killed.
    time: Duration,
}

impl Killer {
    fn new(of: u64, words: &[&str]) -> Self {
        let seed = env::var("FRETWORK_TEST_SEED").map_or(1, |seed| seed.parse().unwrap());
        let rounds = if env::var_os("FRETWORK_TEST_LONG").is_some() { 100 } else { 3 };
        let begun = Instant::now();
        assert!(run(words, "").status.success(), "{words:?}");
        Self { dice: Dice(seed + 1000 * of), rounds, time: begun.elapsed() }
    }

    /// Whether the command was still running.
    fn kill(&mut self, words: &[&str]) -> bool {
        let mut command = fretwork(words);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let most = self.time.as_micros() as u64 + 1;
        sleep(Duration::from_micros(self.dice.below(most)));
        let was_running = child.try_wait().unwrap().is_none();
        child.kill().unwrap();
        child.wait().unwrap();
        was_running
    }
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// The files of a directory.
fn files(dir: &Path) -> Vec<PathBuf> {
    fs::read_dir(dir).unwrap().map(|entry| entry.unwrap().path()).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_export_that_is_killed_leaves_no_part_under_its_name() {
    let (from, dir) = (library().await, TempDir::new().unwrap());
    let [whole, file] = ["whole.zst", "results.zst"].map(|name| dir.path().join(name));
    let words = |file| ["export", text(file), "--data-dir", text(from.path())].map(str::to_owned);
    let mut killer = Killer::new(1, &words(&whole).each_ref().map(String::as_str));
    let expected = Lines::open(&whole).results;
    assert_eq!(expected.len(), RESULTS);
    let words = words(&file);
    let words = words.each_ref().map(String::as_str);
    for _ in 0..killer.rounds {
        killer.kill(&words);
        if !file.exists() {
            assert!(
                run(&words, "").status.success(),
                "the part of the killed export is in the way"
            );
        }
        assert!(Lines::open(&file).results == expected);
        fs::remove_file(&file).unwrap();
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_import_that_is_killed_leaves_a_sound_database() {
    let (from, dir) = (library().await, TempDir::new().unwrap());
    let file = dir.path().join("results.zst");
    assert!(run(&["export", text(&file), "--data-dir", text(from.path())], "").status.success());
    let at = |name: &str| dir.path().join(name);
    let mut killer = Killer::new(2, &["import", text(&file), "--data-dir", text(&at("whole"))]);
    for round in 0..killer.rounds {
        let data = at(&round.to_string());
        killer.kill(&["import", text(&file), "--data-dir", text(&data)]);
        if data.join("fretwork.db").exists() && stored(&data).await > 0 {
            assert_eq!(check(&data).await.unwrap().damage, []);
        }
        let before = stored(&data).await;
        let done = import(&*data, &file).await.unwrap();
        assert_eq!((done.known, done.results), (before, RESULTS as u64 - before), "{done:?}");
        assert_eq!(check(&data).await.unwrap().damage, []);
        fs::remove_dir_all(data).unwrap();
    }
}

/// The number of results in a database; 0 until it has tables.
async fn stored(data: &Path) -> u64 {
    if !data.join("fretwork.db").exists() {
        return 0;
    }
    let count = sqlx::query_scalar::<_, i64>("SELECT count(*) FROM result");
    count.fetch_one(&mut raw(data).await).await.unwrap_or(0).unsigned_abs()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_repair_that_is_killed_loses_nothing() {
    let sound = library().await;
    let damaged = crash(sound.path());
    let change = "UPDATE outline SET wear_volume = 2 * wear_volume; UPDATE result SET summary = '{}', size = 7";
    raw(damaged.path()).await.execute(change).await.unwrap();
    settle(damaged.path()).await;
    let damage = check(damaged.path()).await.unwrap().damage;
    let tried = crash(damaged.path());
    let mut killer = Killer::new(3, &["check", "--repair", "--data-dir", text(tried.path())]);
    let mut interrupted = 0;
    for _ in 0..killer.rounds {
        let dir = crash(damaged.path());
        let words = ["check", "--repair", "--data-dir", text(dir.path())];
        interrupted += u32::from(killer.kill(&words));
        let left = check(dir.path()).await.unwrap().damage;
        assert!(left.iter().all(|it| damage.contains(it)), "{left:?}");
        // A copy is complete, if there is one under its name.
        let is_copy = |file: &PathBuf| {
            text(file).contains("unrepaired") && file.extension().is_some_and(|it| it == "db")
        };
        let copies: Vec<_> = files(dir.path()).into_iter().filter(is_copy).collect();
        assert!(copies.len() == 1 || left.len() == damage.len(), "{copies:?}");
        for file in copies {
            assert!(
                fs::read(file).unwrap() == fs::read(damaged.path().join("fretwork.db")).unwrap()
            );
        }
        let Repaired { damage: repaired, .. } = repair(dir.path()).await.unwrap();
        assert_eq!(repaired.is_empty(), left.is_empty());
        assert!(repaired.iter().all(|it| left.contains(it)), "{repaired:?}");
        assert_eq!(check(dir.path()).await.unwrap().damage, []);
    }
    // Of three, all can have ended on a machine that has become faster.
    assert!(killer.rounds < 100 || interrupted > 0, "each repair ended before it was killed");
}
