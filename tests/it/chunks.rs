//! Studies in the store: their chunks are claimed, finished, lost and deleted one by one.

use std::collections::HashSet;
use std::num::NonZeroU32;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use bytes::Bytes;
use fretwork_job::{Cost, FailureKind, JobState, Origin, Submission};
use fretwork_store::{
    Actor, Claimed, Deleted, Error, Finish, NewJob, Piece, Reach, Recovered, Store,
};
use sqlx::Executor as _;
use tokio::sync::Semaphore;
use tokio::task::JoinSet;
use tokio::time::sleep;

use crate::database::{Database, Engine};
use crate::keeping::eventually;
use crate::server::steel_ball;
use crate::store::{
    accepted, answer, body, cancel, claim, crash, fresh, job, key, new_job, open, raw,
};

/// A job whose work is divided into chunks.
pub fn study(number: u8, chunks: u32) -> NewJob {
    NewJob { chunks: NonZeroU32::new(chunks), ..new_job(number) }
}

/// Claims the next piece, which must be this chunk.
async fn claim_chunk(store: &Store, expected: u32) -> Claimed {
    let claimed = claim(store).await;
    assert!(
        matches!(claimed.piece, Piece::Chunk { number, .. } if number == expected),
        "{:?} instead of chunk {expected}",
        claimed.piece
    );
    claimed
}

async fn finish_chunk(store: &Store, claimed: &Claimed) -> bool {
    store.finish_chunk(claimed, b"1,2", Cost::ZERO).await.unwrap()
}

on_both! {
    a_study_is_computed_chunk_by_chunk_and_then_assembled,
    a_stage_waits_for_all_chunks_before_it,
    each_of_twelve_stages_waits,
    a_cancelled_study_ends_at_once_and_stops_all_its_workers,
    a_piece_that_fails_ends_its_study_and_stops_the_other_workers,
    after_a_crash_only_interrupted_chunks_are_computed_again_before_all_others,
    a_study_fails_after_three_crashes_during_the_same_chunk,
    studies_share_the_workers_and_a_run_waits_for_one_piece_of_each_owner,
    operations_on_chunks_in_random_order_lose_no_chunk,
    chunks_are_deleted_after_their_study_has_ended,
    a_damaged_chunk_is_reported,
}

async fn a_study_is_computed_chunk_by_chunk_and_then_assembled(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    let submitted = accepted(store.submit(study(1, 3)).await);
    let seconds =
        |wall, cpu| Cost { wall: Duration::from_secs(wall), cpu: Some(Duration::from_secs(cpu)) };
    let mut claims = Vec::new();
    for number in 0..3 {
        let claimed = claim_chunk(&store, number).await;
        assert_eq!((claimed.attempt, claimed.spent), (1, Cost::ZERO));
        assert_eq!(store.task(&claimed).await.unwrap().as_deref(), Some("task 1"));
        claims.push(claimed);
    }
    // The chunks may end in any order.
    for (done, number) in [(1, 1_u8), (2, 0), (3, 2)] {
        assert!(store.claim().await.unwrap().is_none(), "the assembly waits for all chunks");
        let claimed = &claims[usize::from(number)];
        assert!(store.finish_chunk(claimed, &[number; 100], seconds(10, 7)).await.unwrap());
        let job = job(&store, submitted.id).await;
        assert_eq!((job.state, job.attempt), (JobState::Running, 1));
        assert!((job.progress - f64::from(done) / 3.0).abs() < 1e-9, "{}", job.progress);
    }
    let assembly = claim(&store).await;
    assert_eq!((&assembly.piece, assembly.spent), (&Piece::Assembly { of: 3 }, seconds(30, 21)));
    for number in 0..3_u8 {
        let chunk = store.chunk(&assembly, number.into()).await.unwrap().unwrap();
        assert_eq!(*chunk, [number; 100]);
    }
    let finish = store.finish(&assembly, &answer("a"), seconds(1, 1)).await.unwrap();
    assert_eq!(finish, Finish::Stored);
    let job = job(&store, submitted.id).await;
    assert_eq!((job.state, job.changes.len()), (JobState::Succeeded, 3));
    assert_eq!(body(&store, 1).await, b"a");
    let costs = "SELECT count(*) FROM result WHERE wall = 31 AND cpu = 22";
    assert_eq!(db.count(costs).await, 1);
}

async fn a_stage_waits_for_all_chunks_before_it(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    accepted(store.submit(NewJob { stages: "2,3".into(), ..study(1, 4) }).await);
    let first = claim_chunk(&store, 0).await;
    let second = claim_chunk(&store, 1).await;
    assert!(store.claim().await.unwrap().is_none());
    assert!(finish_chunk(&store, &first).await);
    assert!(store.claim().await.unwrap().is_none());
    // A chunk of this stage is queued again, but the next stage is not.
    assert!(store.release(&second).await.unwrap());
    let second = claim_chunk(&store, 1).await;
    assert!(store.claim().await.unwrap().is_none());
    assert!(finish_chunk(&store, &second).await);
    let third = claim_chunk(&store, 2).await;
    assert!(store.claim().await.unwrap().is_none());
    assert!(finish_chunk(&store, &third).await);
    assert!(finish_chunk(&store, &claim_chunk(&store, 3).await).await);
    assert_eq!(claim(&store).await.piece, Piece::Assembly { of: 4 });
}

async fn each_of_twelve_stages_waits(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let stages = (1..12).map(|chunk| chunk.to_string()).collect::<Vec<_>>().join(",");
    accepted(store.submit(NewJob { stages, ..study(1, 12) }).await);
    for chunk in 0..12 {
        let claimed = claim_chunk(&store, chunk).await;
        assert!(store.claim().await.unwrap().is_none(), "stage {} does not wait", chunk + 1);
        assert!(finish_chunk(&store, &claimed).await);
    }
    assert_eq!(claim(&store).await.piece, Piece::Assembly { of: 12 });
}

async fn a_cancelled_study_ends_at_once_and_stops_all_its_workers(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let first = accepted(store.submit(study(1, 5)).await);
    let claims = [claim_chunk(&store, 0).await, claim_chunk(&store, 1).await];
    let joined = accepted(store.submit(study(1, 5)).await);
    assert_eq!((joined.origin, joined.state), (Origin::Coalesced, JobState::Running));
    assert_eq!(cancel(&store, first.id).await, JobState::Canceled);
    assert!(claims.iter().all(|claimed| !claimed.stop.is_raised()), "a job still needs it");
    assert!(finish_chunk(&store, &claims[0]).await);
    let third = claim_chunk(&store, 2).await;

    assert_eq!(cancel(&store, joined.id).await, JobState::Canceled);
    assert!(claims[1].stop.is_raised() && third.stop.is_raised());
    assert!(store.claim().await.unwrap().is_none());
    assert!(!finish_chunk(&store, &third).await);
    assert!(!store.release(&third).await.unwrap());
    assert!(!store.stopped(&third).await.unwrap());
    // Other servers can change the tables of PostgreSQL. So a store counts them from time to time, in `longest_wait`.
    store.longest_wait().await.unwrap();
    assert_eq!(store.tally().running(), 0);
    // A later submission of the same study starts a new run.
    let again = accepted(store.submit(study(1, 5)).await);
    assert_eq!((again.origin, again.state), (Origin::Computed, JobState::Queued));
    let next = claim_chunk(&store, 0).await;
    assert_ne!(next.run, third.run);
    // It continues from the chunks that were finished, if its chunks are the same.
    let known = store.canceled_chunk(&next, 0, 5).await.unwrap();
    assert_eq!(known.as_deref(), Some(&b"1,2"[..]));
    for (number, of) in [(1, 5), (2, 5), (0, 6)] {
        assert_eq!(
            store.canceled_chunk(&next, number, of).await.unwrap(),
            None,
            "{number} of {of}"
        );
    }
}

async fn a_piece_that_fails_ends_its_study_and_stops_the_other_workers(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let submitted = accepted(store.submit(study(1, 5)).await);
    let (first, second) = (claim_chunk(&store, 0).await, claim_chunk(&store, 1).await);
    assert!(store.fail(&first, FailureKind::Panicked, "no such spring").await.unwrap());
    assert!(second.stop.is_raised());
    assert!(!finish_chunk(&store, &second).await);
    assert!(!store.fail(&second, FailureKind::Panicked, "late").await.unwrap());
    let job = job(&store, submitted.id).await;
    assert_eq!(
        (job.state, job.failure.unwrap().message),
        (JobState::Failed, "no such spring".into())
    );
    assert!(store.claim().await.unwrap().is_none());
}

async fn after_a_crash_only_interrupted_chunks_are_computed_again_before_all_others(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    let submitted = accepted(store.submit(study(1, 4)).await);
    let done = claim_chunk(&store, 0).await;
    let (lost, released) = (claim_chunk(&store, 1).await, claim_chunk(&store, 2).await);
    assert!(finish_chunk(&store, &done).await);
    assert!(store.release(&released).await.unwrap());
    let (db, store) = db.after_a_crash().await;
    let recovered = store.recover().await.unwrap();
    assert_eq!(recovered, Recovered { requeued: 1, ..Recovered::default() });
    assert!(!finish_chunk(&store, &lost).await);
    assert_eq!(job(&store, submitted.id).await.progress.to_bits(), 0.25_f64.to_bits());

    let first = claim_chunk(&store, 1).await;
    let (fresh, again) = (claim_chunk(&store, 3).await, claim_chunk(&store, 2).await);
    assert_eq!((first.attempt, fresh.attempt, again.attempt), (2, 1, 2));
    assert!(!finish_chunk(&store, &lost).await && !finish_chunk(&store, &released).await);
    for claimed in [&first, &fresh, &again] {
        assert!(finish_chunk(&store, claimed).await);
    }
    assert_eq!(claim(&store).await.piece, Piece::Assembly { of: 4 });
    // The next crash interrupts the assembly.
    let (_db, store) = db.after_a_crash().await;
    store.recover().await.unwrap();
    let assembly = claim(&store).await;
    assert_eq!((&assembly.piece, assembly.attempt), (&Piece::Assembly { of: 4 }, 2));
    assert_eq!(store.finish(&assembly, &answer("a"), Cost::ZERO).await.unwrap(), Finish::Stored);
    let job = job(&store, submitted.id).await;
    assert_eq!((job.state, job.changes.len()), (JobState::Succeeded, 3), "{:?}", job.changes);
}

async fn a_study_fails_after_three_crashes_during_the_same_chunk(on: Engine) {
    let (mut db, mut store) = Database::fresh(on).await;
    let submitted = accepted(store.submit(study(1, 20)).await);
    // The crashes during different chunks are not added up.
    for (number, crashes) in [(0, 2), (1, 2), (2, 3)] {
        for crash in 1..=crashes {
            claim_chunk(&store, number).await;
            (db, store) = db.after_a_crash().await;
            assert_eq!(store.recover().await.unwrap().failed, u64::from(crash == 3));
        }
        if crashes < 3 {
            let again = claim_chunk(&store, number).await;
            assert_eq!(again.lost, crashes);
            assert!(finish_chunk(&store, &again).await);
        }
    }
    let job = job(&store, submitted.id).await;
    assert_eq!(job.failure.unwrap().kind, FailureKind::WorkerLost);
    assert!(store.claim().await.unwrap().is_none());
    drop(db);
}

async fn studies_share_the_workers_and_a_run_waits_for_one_piece_of_each_owner(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    accepted(store.submit(study(1, 100)).await);
    let mut working = vec![claim(&store).await, claim(&store).await];
    accepted(store.submit(NewJob { owner: "bob".into(), ..study(2, 100) }).await);
    for turn in 0..10 {
        assert!(finish_chunk(&store, &working.remove(0)).await);
        working.push(claim(&store).await);
        let keys: HashSet<_> = working.iter().map(|claimed| claimed.key).collect();
        assert_eq!(keys.len(), 2, "each owner has a worker in turn {turn}");
    }
    accepted(store.submit(NewJob { owner: "eve".into(), ..new_job(3) }).await);
    store.longest_wait().await.unwrap();
    assert_eq!(store.tally().queued(), 1, "studies that are running are not queued");
    // A run of the owner of a study does not wait for the end of the study.
    accepted(store.submit(new_job(4)).await);
    let mut next = HashSet::new();
    for _ in 0..3 {
        if let Some(claimed) = working.pop() {
            assert!(finish_chunk(&store, &claimed).await);
        }
        next.insert(claim(&store).await.key);
    }
    assert!(next.contains(&key(3)) && next.contains(&key(4)), "{next:?}");
}

/// Claims, finishes, releases and loses chunks in random order. Up to three chunks are claimed at the same time.
async fn operations_on_chunks_in_random_order_lose_no_chunk(on: Engine) {
    for seed in 0..20_u64 {
        let stream = fretwork_random::Stream::new(seed);
        let mut draws = 0;
        let mut draw = |below| {
            draws += 1;
            stream.below(draws, below)
        };
        let (mut db, mut store) = Database::fresh(on).await;
        let chunks = 2 + draw(12) as u32;
        let submitted = accepted(store.submit(study(1, chunks)).await);
        let mut working: Vec<Claimed> = Vec::new();
        let assembly = loop {
            if working.len() < 3 && draw(2) == 0 {
                match store.claim().await.unwrap() {
                    Some(claimed) if matches!(claimed.piece, Piece::Assembly { .. }) => {
                        break claimed;
                    }
                    Some(claimed) => working.push(claimed),
                    None => {}
                }
                continue;
            }
            if draw(25) == 0 {
                (db, store) = db.after_a_crash().await;
                store.recover().await.unwrap();
                // A study that is lost three times fails.
                let reset = match on {
                    Engine::Sqlite => "UPDATE run SET lost = 0; UPDATE chunk SET lost = 0",
                    Engine::Postgres => "UPDATE study SET lost = 0; UPDATE chunk SET lost = 0",
                };
                db.execute(reset).await;
                working.clear();
            }
            if working.is_empty() {
                continue;
            }
            let claimed = working.swap_remove(draw(working.len() as u64) as usize);
            let Piece::Chunk { number, .. } = claimed.piece else { panic!("{claimed:?}") };
            let accepted = match draw(3) {
                0 => store.release(&claimed).await.unwrap(),
                _ => store.finish_chunk(&claimed, &[number as u8; 100], Cost::ZERO).await.unwrap(),
            };
            assert!(accepted, "seed {seed}, chunk {number}");
        };
        assert!(working.is_empty(), "the assembly waits for all chunks");
        for number in 0..chunks {
            let chunk = store.chunk(&assembly, number).await.unwrap().unwrap();
            assert_eq!(*chunk, [number as u8; 100], "seed {seed}");
        }
        assert!((job(&store, submitted.id).await.progress - 1.0).abs() < 1e-12, "seed {seed}");
        store.finish(&assembly, &answer("a"), Cost::ZERO).await.unwrap();
        assert!(store.claim().await.unwrap().is_none());
        store.longest_wait().await.unwrap();
        assert_eq!((store.tally().queued(), store.tally().running()), (0, 0));
    }
}

async fn chunks_are_deleted_after_their_study_has_ended(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    for (number, chunks) in [(1, 40), (2, 3), (4, 3), (3, 2)] {
        accepted(store.submit(study(number, chunks)).await);
    }
    let mut canceled = Vec::new();
    for _ in 0..46 {
        let claimed = claim(&store).await;
        assert!(finish_chunk(&store, &claimed).await);
        if claimed.key == key(1) && matches!(claimed.piece, Piece::Chunk { number: 39, .. }) {
            let assembly = claim(&store).await;
            store.finish(&assembly, &answer("a"), Cost::ZERO).await.unwrap();
        }
        if matches!(claimed.piece, Piece::Chunk { number: 2, of: 3 }) {
            let job = store.live_job(&claimed.key, &Reach::default()).await.unwrap().unwrap();
            cancel(&store, job).await;
            canceled.push(job);
        }
    }
    // The run of a study is deleted with its job.
    assert_eq!(store.delete(canceled[1], Actor::default()).await.unwrap(), Deleted::Done);
    assert!(store.unfinished_study(canceled[1]).await.unwrap().is_none());
    let first = claim_chunk(&store, 0).await;
    assert!(finish_chunk(&store, &first).await);
    eventually(async || db.count("SELECT count(*) FROM study").await == 2).await;
    assert_eq!(db.count("SELECT count(*) FROM chunk").await, 3 + 1);
    // The canceled study keeps its chunks while it has a job.
    let study = store.unfinished_study(canceled[0]).await.unwrap().unwrap();
    assert_eq!((study.key, study.chunks, study.done), (key(2), 3, 3));
    let chunks = store.chunks_so_far(canceled[0], &study).await.unwrap();
    let expected = |number| (number, Bytes::from_static(b"1,2"));
    assert_eq!(chunks, [0, 1, 2].map(expected));
    // The unfinished study keeps its chunks and continues.
    assert_eq!(store.chunk(&first, 0).await.unwrap().as_deref(), Some(&b"1,2"[..]));
    claim_chunk(&store, 1).await;
}

async fn a_damaged_chunk_is_reported(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    accepted(store.submit(study(1, 1)).await);
    let chunk = claim_chunk(&store, 0).await;
    assert!(finish_chunk(&store, &chunk).await);
    db.execute(match on {
        Engine::Sqlite => "UPDATE chunk SET body = CAST(substr(body, 1, 8) || x'07' AS BLOB)",
        Engine::Postgres => "UPDATE chunk SET body = substr(body, 1, 8) || '\\x07'::BYTEA",
    })
    .await;
    let assembly = claim(&store).await;
    let found = store.chunk(&assembly, 0).await;
    assert!(
        matches!(found, Err(Error::DamagedChunk { key: damaged, number: 0 }) if damaged == key(1)),
        "{found:?}"
    );
}

#[tokio::test]
async fn another_numerics_version_computes_all_chunks_again() {
    let (dir, store) = fresh().await;
    let text = steel_ball().to_string();
    let prepared = Submission::parse(text.as_bytes()).unwrap().prepared;
    let task = prepared.stored.to_string();
    let submitted = accepted(store.submit(NewJob { task, ..study(1, 2) }).await);
    let cost = Cost { wall: Duration::from_secs(1), cpu: None };
    for number in 0..2 {
        let claimed = claim_chunk(&store, number).await;
        assert!(store.finish_chunk(&claimed, b"1,2", cost).await.unwrap());
    }
    store.close().await;
    let earlier = "UPDATE room SET numerics = numerics - 1";
    raw(dir.path()).await.execute(earlier).await.unwrap();
    let store = open(dir.path()).await;
    store.recover().await.unwrap();
    let job = job(&store, submitted.id).await;
    assert_eq!((job.key, job.progress.to_bits()), (prepared.key, 0));
    for number in 0..2 {
        let claimed = claim_chunk(&store, number).await;
        assert_eq!((claimed.key, claimed.spent), (prepared.key, Cost::ZERO));
    }
}

/// Chunks that the workers of the next test have finished.
const CHUNKS: u32 = 1000;

/// The rows of a chunk of the next test.
fn rows(number: u32) -> Vec<u8> {
    format!("{number},").repeat(200).into_bytes()
}

/// Computes until there is nothing to claim, or until the permits for chunks are used up.
async fn work(
    store: Store,
    finished: Arc<Vec<AtomicU32>>,
    permits: Arc<Semaphore>,
) -> Result<(), Error> {
    while let Some(claimed) = store.claim().await? {
        sleep(Duration::from_millis(1)).await;
        permits.acquire().await.unwrap().forget();
        if let Piece::Chunk { number, .. } = claimed.piece {
            if store.finish_chunk(&claimed, &rows(number), Cost::ZERO).await? {
                finished[number as usize].fetch_add(1, Ordering::SeqCst);
            }
        } else {
            let mut all = Vec::new();
            for number in 0..CHUNKS {
                all.extend(store.chunk(&claimed, number).await?.unwrap());
            }
            let all = String::from_utf8(all).unwrap();
            store.finish(&claimed, &answer(&all), Cost::ZERO).await?;
        }
    }
    Ok(())
}

/// Opens the store as a new process does, and starts four workers, which finish at most this many pieces. The counters
/// say how often each chunk was finished.
async fn start(dir: &Path, most: u32) -> (Store, JoinSet<Result<(), Error>>, Arc<Vec<AtomicU32>>) {
    let store = open(dir).await;
    store.recover().await.unwrap();
    let finished: Arc<Vec<_>> = Arc::new((0..CHUNKS).map(|_| AtomicU32::new(0)).collect());
    let permits = Arc::new(Semaphore::new(most as usize));
    let work = |_| work(store.clone(), Arc::clone(&finished), Arc::clone(&permits));
    let workers = (0..4).map(work).collect();
    (store, workers, finished)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_store_that_is_killed_at_random_moments_loses_no_chunk_and_computes_none_twice() {
    let (mut dir, store) = fresh().await;
    let submitted = accepted(store.submit(study(1, CHUNKS)).await);
    store.close().await;
    let mut acknowledged = vec![0; CHUNKS as usize];
    let mut count = |finished: &[AtomicU32]| {
        for (all, new) in acknowledged.iter_mut().zip(finished) {
            *all += new.load(Ordering::SeqCst);
        }
        acknowledged.clone()
    };
    for kill in 0..10 {
        // On a slow machine, the workers could otherwise finish all chunks before the last kill.
        let (store, mut workers, finished) = start(dir.path(), CHUNKS / 11).await;
        // A study fails if three processes in a row finish no chunk. So this process must finish one.
        while finished.iter().all(|count| count.load(Ordering::SeqCst) == 0) {
            sleep(Duration::from_millis(1)).await;
        }
        sleep(Duration::from_micros(4_321 * kill % 17_000)).await;
        // The next process opens a copy of the files at this moment, perhaps in the middle of a transaction. The copy
        // must contain all chunks that were acknowledged before.
        let before = count(&finished);
        let files = crash(dir.path());
        workers.shutdown().await;
        let done: Vec<u32> = sqlx::query_scalar("SELECT number FROM chunk WHERE state = 'done'")
            .fetch_all(&mut raw(crash(files.path()).path()).await)
            .await
            .unwrap();
        assert!(done.len() < CHUNKS as usize, "the kill came before the end");
        let lost =
            (0..CHUNKS).find(|number| before[*number as usize] > 0 && !done.contains(number));
        assert_eq!(lost, None, "a chunk was acknowledged and lost");
        store.close().await;
        dir = files;
    }
    let (store, workers, finished) = start(dir.path(), CHUNKS + 1).await;
    for worker in workers.join_all().await {
        worker.unwrap();
    }
    let job = job(&store, submitted.id).await;
    assert_eq!((job.state, job.changes.len()), (JobState::Succeeded, 3));
    let expected: Vec<u8> = (0..CHUNKS).flat_map(rows).collect();
    assert!(body(&store, 1).await == expected);
    store.close().await;
    assert_eq!(count(&finished).iter().max(), Some(&1), "a chunk was accepted twice");
}
