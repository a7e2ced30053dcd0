//! Imports results of other servers. Each result is verified before it is stored: it is computed again, on all cores.
//!
//! One thread for each core takes results from a queue. One thread computes a run. The rows of a study are computed by
//! one thread for each core, in random order, and only one study at a time. So if the time limit ends a study, the
//! verified rows are a random sample.

use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock, mpsc};
use std::thread;
use std::time::Duration;

use parking_lot::Mutex;
use tokio::sync::mpsc::{UnboundedReceiver, UnboundedSender, unbounded_channel};
use tokio::time::timeout;

use super::processors;
use super::stopwatch::Stopwatch;
use fretwork_format as format;
use fretwork_job::{Key, Received, Refused, Verified};
use fretwork_random::Stream;
use fretwork_store::{Accepted, Imported, Importer, Moving, Place, UntrustedResult};

/// Maximum number of results per thread that are read in advance.
const AHEAD: usize = 3;
/// The next result is read only while the results in memory have fewer bytes than this.
const AHEAD_BYTES: usize = 32_000_000;
/// Maximum time between two reports of the progress.
const REPORT: Duration = Duration::from_millis(200);
/// A run is not computed again if its estimated time exceeds the limit by more than this factor. The factor is large
/// because estimates are rough.
const HOPELESS: f64 = 10.0;

/// Imports the results of an export that the database does not have, and the notes of results that have no note in the
/// database.
///
/// `limit` is the maximum processor time for each result. A result is refused if it differs from the result that this
/// program computes. If a study takes longer, only random rows of it are verified, and none that takes longer than `limit`
/// divided by the number of threads. If a run takes longer, or an earlier version of the engine computed the result, only its
/// form is checked. The provenance records how much was verified.
///
/// Each result is stored in its own transaction. Results that the database already has are not computed again. So an
/// interrupted import can be repeated. `progress` is called with the number of finished results, plus the finished
/// share of the present study, and with the number of all results.
///
/// # Errors
/// The file is not an export, or a database fails.
pub async fn import(
    place: Place,
    file: &Path,
    limit: Duration,
    mut progress: impl FnMut(f64, usize),
) -> Result<Imported, Moving> {
    let mut import = Importer::open(place, file).await?;
    let (verifier, queue, mut verified) = Verifier::start(limit);
    let (mut busy, mut bytes) = (0, 0);
    while !import.is_over() || busy > 0 {
        if !import.is_over() && busy < AHEAD * processors() && bytes < AHEAD_BYTES {
            if let Some(entry) = import.next_entry().await? {
                busy += 1;
                bytes += entry.body.len();
                // This cannot fail, because `verifier` holds the receiver.
                let _ = queue.send(entry);
            }
        } else if let Ok(Some(Settled { key, size, verdict })) =
            timeout(REPORT, verified.recv()).await
        {
            busy -= 1;
            bytes -= size;
            match verdict {
                Ok(accepted) => import.store(accepted).await?,
                Err(why) => import.refuse(key, why),
            }
        }
        let (read, of) = import.read();
        progress((read - busy) as f64 + verifier.share(), of);
    }
    import.close().await
}

/// A result that a thread has verified or refused.
struct Settled {
    key: Key,
    /// Bytes of its body.
    size: usize,
    verdict: Result<Accepted, String>,
}

/// The state that the threads share.
struct Verifier {
    queued: Mutex<mpsc::Receiver<UntrustedResult>>,
    /// Sends the outcomes. It is closed when the import has failed.
    done: UnboundedSender<Settled>,
    limit: Duration,
    /// Held while a study is computed.
    study: Mutex<()>,
    /// The share of the present study that is verified, as the bits of a float.
    share: AtomicU64,
}

impl Verifier {
    /// Starts the threads.
    fn start(
        limit: Duration,
    ) -> (Arc<Self>, mpsc::Sender<UntrustedResult>, UnboundedReceiver<Settled>) {
        let (queue, entries) = mpsc::channel();
        let (done, verified) = unbounded_channel();
        let queued = Mutex::new(entries);
        let verifier =
            Self { queued, done, limit, study: Mutex::default(), share: AtomicU64::default() };
        let verifier = Arc::new(verifier);
        for _ in 0..processors() {
            let verifier = Arc::clone(&verifier);
            thread::spawn(move || verifier.work());
        }
        (verifier, queue, verified)
    }

    fn share(&self) -> f64 {
        f64::from_bits(self.share.load(Ordering::Relaxed))
    }

    fn work(&self) {
        while let Some(entry) = self.next() {
            let (key, size) = (entry.key, entry.body.len());
            // A defect of the engine must not end the import.
            let verdict = catch_unwind(AssertUnwindSafe(|| self.verify(entry)));
            let defect = || {
                Err("the new computation of the result failed: this is a defect of fretwork"
                    .to_owned())
            };
            let settled = Settled { key, size, verdict: verdict.unwrap_or_else(|_| defect()) };
            // This fails if the import has failed. Then the outcome is not needed.
            let _ = self.done.send(settled);
        }
    }

    fn next(&self) -> Option<UntrustedResult> {
        self.queued.lock().recv().ok().filter(|_| !self.done.is_closed())
    }

    fn verify(&self, entry: UntrustedResult) -> Result<Accepted, String> {
        let received = Received::read(&entry.key, &entry.body).map_err(|why| why.to_string())?;
        let verified = self.compute(&received, &entry.body).map_err(|why| why.to_string())?;
        if verified != Verified::All {
            format::check(&entry.body)
                .map_err(|why| format!("the tables of the result are not complete: {why}"))?;
        }
        Ok(entry.accept(&received.document, verified))
    }

    /// Computes a result again, as far as its time limit allows.
    fn compute(&self, received: &Received, body: &[u8]) -> Result<Verified, Refused> {
        if received.row_seconds().is_some_and(|it| it > HOPELESS * self.limit.as_secs_f64()) {
            return Ok(Verified::No);
        }
        let rows = Rows { order: shuffled(received.rows()), ..Rows::default() };
        if rows.order.len() > 1 {
            let _turn = self.study.lock();
            thread::scope(|scope| {
                for _ in 0..processors().min(rows.order.len()) {
                    scope.spawn(|| self.compute_rows(received, body, &rows));
                }
            });
            self.share.store(0, Ordering::Relaxed);
        } else {
            self.compute_rows(received, body, &rows);
        }
        match rows.refused.into_inner() {
            Some(why) => Err(why),
            None => received.verified(rows.verified.into_inner()),
        }
    }

    /// Computes rows until no row is left, a row differs, or the time limit is reached.
    fn compute_rows(&self, received: &Received, body: &[u8], rows: &Rows) {
        let (watch, mut before) = (Stopwatch::start(), Duration::ZERO);
        let mut goes_on = || {
            let cost = watch.cost();
            let now = cost.cpu.unwrap_or(cost.wall);
            let step = now.saturating_sub(before).as_nanos() as u64;
            before = now;
            let spent = rows.nanoseconds.fetch_add(step, Ordering::Relaxed) + step;
            let has_time = u128::from(spent) < self.limit.as_nanos();
            has_time && rows.refused.get().is_none() && !self.done.is_closed()
        };
        while goes_on() {
            let next = rows.next.fetch_add(1, Ordering::Relaxed);
            let Some(row) = rows.order.get(next) else { return };
            match received.verify_row(body, *row as usize, &mut goes_on) {
                None => return,
                Some(Ok(())) => rows.verified.fetch_add(1, Ordering::Relaxed),
                Some(Err(why)) => return drop(rows.refused.set(why)),
            };
            if rows.order.len() > 1 {
                let share = next as f64 / rows.order.len() as f64;
                self.share.store(share.to_bits(), Ordering::Relaxed);
            }
        }
    }
}

/// The rows of a result that is computed again. All threads that compute the rows share this.
#[derive(Default)]
struct Rows {
    order: Vec<u32>,
    /// The position in `order` of the next row to compute.
    next: AtomicUsize,
    /// The number of rows that agree.
    verified: AtomicUsize,
    /// Processor time of all threads together.
    nanoseconds: AtomicU64,
    /// Set by the first row that differs.
    refused: OnceLock<Refused>,
}

/// The numbers below `count` in a random order, which the author of a file cannot predict.
fn shuffled(count: usize) -> Vec<u32> {
    let random = Stream::new(RandomState::new().build_hasher().finish());
    let mut order: Vec<u32> = (0..count as u32).collect();
    for place in (1..count).rev() {
        order.swap(place, random.below(place as u64, place as u64 + 1) as usize);
    }
    order
}
