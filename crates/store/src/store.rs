//! The interface of the store: its operations, which are called verbs. An engine for each kind of database executes
//! them.

use std::pin::pin;
use std::sync::Arc;
use std::time::{Duration, Instant};

use bytes::Bytes;
use futures_util::stream::iter;
use futures_util::{StreamExt as _, TryStreamExt as _};

use crate::database::usage::Owners;
use crate::database::{
    Body, Change, Changes, Command, Deletions, Doing, Error, FileSizes, Options, Place, Purpose,
    Reach, Recovered, Result, Row, SharedVerb, Signals, Statement, Sum, Tables, Tally, Verb, sql,
};
use crate::jobs::cancel::{self, Canceled, Deleted};
use crate::jobs::claimed::{Claimed, Piece};
use crate::jobs::naming;
use crate::jobs::read::{self, Asked, Filter, LARGE, Page, StoredResult, Unfinished};
use crate::jobs::submit::{Admission, NewJob, Submitted};
use crate::results::library::{Known, Provenance};
use crate::results::notes::{self, Annotated, Annotator};
use crate::results::page::{Cursor, SearchPage};
use crate::results::search::{self, Search};
use crate::results::storing::{self, Answered, Changed, Finish, PinQuota, Removed};
use crate::team::audit::{self, Actor, AuditEntry};
use crate::team::keys::{self, AccessKey, NewKey};
use crate::team::sessions::{self, SignedIn};
use crate::{postgres, sqlite};
use fretwork_job::clock::now;
use fretwork_job::{Cost, FailureKind, Job, JobId, Key, Naming, Outline};

/// The open database, as a handle that is cheap to clone.
#[derive(Debug, Clone)]
pub struct Store {
    engine: Backend,
    signals: Arc<Signals>,
    pin_quota: PinQuota,
}

/// The database.
#[derive(Debug, Clone)]
enum Backend {
    Sqlite(sqlite::Database),
    Postgres(postgres::Database),
}

/// Evaluates an expression with the database of the engine that is in use.
macro_rules! each {
    ($store:expr, $db:ident => $call:expr) => {
        match &$store.engine {
            Backend::Sqlite($db) => $call,
            Backend::Postgres($db) => $call,
        }
    };
}

/// Calls a verb of which each engine has its own version, in a transaction.
macro_rules! change {
    ($store:expr, $module:ident::$verb:ident, $input:expr) => {
        match &$store.engine {
            Backend::Sqlite(db) => Box::pin(db.write(sqlite::$module::$verb, $input)),
            Backend::Postgres(db) => Box::pin(db.write(postgres::$module::$verb, $input)),
        }
    };
}

/// Reads the tables of a store with connections for this purpose.
struct Reading<'a>(&'a Store, Purpose);

impl Tables for Reading<'_> {
    fn rows(&mut self, statement: Statement) -> Doing<'_, Vec<Row>> {
        each!(self.0, db => Box::pin(db.read(self.1, statement)))
    }
}

/// Number of jobs that [`Store::cancel_all`] reads at a time, and maximum number of results that SQLite stores at a time.
const AT_ONCE: u32 = 100;

impl Store {
    fn reading(&self) -> Reading<'_> {
        Reading(self, Purpose::Any)
    }

    fn scanning(&self) -> Reading<'_> {
        Reading(self, Purpose::Scan)
    }

    /// Executes a verb that has the same statements in both engines.
    async fn change<Input, V, Answer>(&self, verb: V, input: Input) -> Result<Answer>
    where
        Input: Send + Sync + 'static,
        V: for<'a, 'tx> Verb<'a, Input, Change<'tx>, Answer = Answer>,
        Answer: Send + 'static,
    {
        each!(self, db => db.write(SharedVerb(verb), input).await)
    }

    /// Accepts a job. If the result is stored, the job ends at once. Otherwise it waits for the live run of its key. If
    /// there is none, a new run is queued, unless the queue is full.
    pub fn submit(&self, job: NewJob) -> Doing<'_, Submitted> {
        change!(self, submit::submit, job)
    }

    /// Accepts jobs of one key together with their computed answer, and finishes them in the same commit. If the result
    /// has been stored in the meantime, or a run is live, the jobs use that instead.
    pub fn record(&self, jobs: Vec<NewJob>, answer: Answered) -> Doing<'_, Vec<Submitted>> {
        let finished = |job| NewJob { admission: Admission::NoNewRun, ..job };
        let jobs: Vec<_> = jobs.into_iter().map(finished).collect();
        change!(self, submit::record, (jobs, answer))
    }

    /// Claims the next queued run, or a piece of a study. See [`claim_up_to`](Self::claim_up_to).
    pub fn claim(&self) -> Doing<'_, Option<Claimed>> {
        Box::pin(async { Ok(self.claim_up_to(1, Owners::ALL).await?.pop()) })
    }

    /// Claims up to `most` queued runs, or a piece of a study, of these owners. In PostgreSQL, claims that are made together cost little
    /// more than one.
    ///
    /// The caller must end each of them by [`finish`](Self::finish), [`finish_chunk`](Self::finish_chunk),
    /// [`fail`](Self::fail), [`stopped`](Self::stopped) or [`release`](Self::release). Otherwise it stays claimed until
    /// the next start of the server.
    pub fn claim_up_to(&self, most: usize, owners: Owners) -> Doing<'_, Vec<Claimed>> {
        if owners.below == 0 {
            return Box::pin(async { Ok(Vec::new()) });
        }
        each!(self, db => Box::pin(db.claim(most, owners)))
    }

    /// Adds the time that a worker has computed for an owner until now. The workers of this process compute next for
    /// the owner for whom they have computed least lately.
    pub fn computed(&self, owner: &str, time: Duration) {
        self.signals.usage.add(owner, time, Instant::now());
    }

    /// How much the workers of this process have computed for an owner lately, for comparisons.
    pub fn usage(&self, owner: &str) -> u64 {
        self.signals.usage.of(owner, Instant::now())
    }

    /// Stores the progress of a whole run, from 0 to 1. The progress of a study follows from its finished chunks, so
    /// nothing is stored for it. Returns false if the worker has lost its run or piece.
    pub fn progress<'a>(&'a self, claimed: &'a Claimed, share: f64) -> Doing<'a, bool> {
        let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
        change!(self, runs::progress, (claimed.claim(), share))
    }

    /// Stores the result of a whole run or of a study. See [`finish_all`](Self::finish_all).
    ///
    /// # Panics
    /// The worker has claimed a chunk, which has no result.
    pub fn finish<'a>(
        &'a self,
        claimed: &'a Claimed,
        answer: &'a Answered,
        cost: Cost,
    ) -> Doing<'a, Finish> {
        let all = self.finish_all(&[(claimed, answer, cost)]);
        Box::pin(async { Ok(all.await?.remove(0)) })
    }

    /// Stores results of whole runs or of studies. PostgreSQL stores all or none of them. The cost of each is that of
    /// this attempt and of the chunks. Returns what happened to each.
    ///
    /// # Panics
    /// The worker has claimed a chunk, which has no result.
    pub fn finish_all(&self, all: &[(&Claimed, &Answered, Cost)]) -> Doing<'_, Vec<Finish>> {
        let answered = all.iter().map(|(claimed, answer, cost)| {
            assert!(!matches!(claimed.piece, Piece::Chunk { .. }), "a chunk has no result");
            let cost = Some(claimed.spent + *cost);
            ((*claimed).clone(), Answered { cost, ..(*answer).clone() })
        });
        let answered: Vec<_> = answered.collect();
        match &self.engine {
            Backend::Sqlite(db) => Box::pin(async {
                let storing = iter(answered).map(|one| db.write(sqlite::runs::finish, one));
                storing.buffered(AT_ONCE as usize).try_collect().await
            }),
            Backend::Postgres(db) => Box::pin(db.write(postgres::runs::finish, answered)),
        }
    }

    /// Fails a run, and stops the workers that compute other pieces of it. Returns false if the worker has lost its run
    /// or piece.
    pub fn fail<'a>(
        &'a self,
        claimed: &'a Claimed,
        kind: FailureKind,
        message: &'a str,
    ) -> Doing<'a, bool> {
        change!(self, runs::fail, (claimed.claim(), kind, message.to_owned()))
    }

    /// Confirms that the worker has stopped computing a run that is being canceled. Returns false if the run is not
    /// being canceled. A study is canceled at once, so it never waits for its workers.
    pub fn stopped<'a>(&'a self, claimed: &'a Claimed) -> Doing<'a, bool> {
        change!(self, runs::stopped, claimed.claim())
    }

    /// Queues a running run or piece of a study again. This does not count as a crash. Returns false if the worker has
    /// lost the run or piece.
    pub fn release<'a>(&'a self, claimed: &'a Claimed) -> Doing<'a, bool> {
        Box::pin(async move {
            let release: Doing<'_, bool> = change!(self, runs::release, claimed.claim());
            let released = release.await;
            if matches!(released, Ok(true)) {
                self.signals.stop(&[(claimed.part(), claimed.stop.clone())]);
            }
            released
        })
    }

    /// Ends or queues again the runs that the last process left unfinished. Call it before the first claim. In SQLite,
    /// it treats every running run as lost. In PostgreSQL, only a run with an expired lease counts as lost. There, all
    /// servers also do this in the background.
    pub fn recover(&self) -> Doing<'_, Recovered> {
        each!(self, db => Box::pin(db.recover()))
    }

    /// Stores the data that a worker has computed for a chunk, and the cost of this attempt. The caller chooses the
    /// format of the data. Returns false if the worker has lost the chunk.
    ///
    /// # Panics
    /// The worker has not claimed a chunk, or there is no memory for the compressor.
    #[expect(clippy::expect_used, reason = "a chunk must not be lost silently")]
    pub fn finish_chunk<'a>(
        &'a self,
        claimed: &'a Claimed,
        bytes: &'a [u8],
        cost: Cost,
    ) -> Doing<'a, bool> {
        assert!(matches!(claimed.piece, Piece::Chunk { .. }), "{:?} is no chunk", claimed.piece);
        let body = Body::pack(bytes).expect("any bytes can be compressed");
        change!(self, chunks::finish_chunk, (claimed.claim(), body, cost))
    }

    /// The stored data of a finished chunk; `None` if the study has ended.
    pub fn chunk<'a>(&'a self, claimed: &'a Claimed, number: u32) -> Doing<'a, Option<Bytes>> {
        Box::pin(async move {
            let found = read::chunk(claimed, number, self.reading()).await?;
            self.signals.counted(found.transpose())
        })
    }

    /// The stored data of a chunk of a canceled study with this key, of which a claimed chunk is part; `None` if there is none, or it is
    /// damaged.
    pub fn canceled_chunk<'a>(
        &'a self,
        claimed: &'a Claimed,
        number: u32,
        of: u32,
    ) -> Doing<'a, Option<Bytes>> {
        Box::pin(read::canceled_chunk(&claimed.key, number, of, self.reading()))
    }

    /// The study of a job, if it is being computed or was canceled; `None` otherwise.
    pub fn unfinished_study(&self, id: JobId) -> Doing<'_, Option<Unfinished>> {
        Box::pin(read::unfinished_study(id, self.reading()))
    }

    /// The data of the finished chunks of a job's study, with their numbers.
    pub fn chunks_so_far<'a>(
        &'a self,
        id: JobId,
        study: &'a Unfinished,
    ) -> Doing<'a, Vec<(u32, Bytes)>> {
        Box::pin(async move {
            let found = read::chunks(id, study, self.scanning()).await?;
            self.signals.counted(found.into_iter().collect())
        })
    }

    /// The task of a claimed study in its stored form; `None` if the study has ended. A [`Piece`] of a study does not
    /// contain the task, to save memory.
    pub fn task<'a>(&'a self, claimed: &'a Claimed) -> Doing<'a, Option<String>> {
        Box::pin(read::task(claimed.run, self.reading()))
    }

    /// Cancels a job, and its run if no other unfinished job shares it.
    pub fn cancel(&self, id: JobId, by: Actor) -> Doing<'_, Canceled> {
        change!(self, cancel::cancel, (id, by))
    }

    /// Cancels every unfinished job that matches and was submitted before this call. Returns how many.
    pub fn cancel_all<'a>(&'a self, filter: &'a Filter, by: &'a Actor) -> Doing<'a, u64> {
        Box::pin(async move {
            // The writer task of SQLite commits simultaneous changes together. In PostgreSQL, each change would take a
            // connection, and none would be left for other requests.
            let together =
                if matches!(self.engine, Backend::Sqlite(_)) { AT_ONCE as usize } else { 1 };
            let mut canceled = 0;
            let mut before = JobId::generate();
            loop {
                let ids = read::unfinished(filter, before, AT_ONCE, self.scanning()).await?;
                let Some(last) = ids.last() else { return Ok(canceled) };
                before = *last;
                let mut canceling =
                    iter(ids).map(|id| self.cancel(id, by.clone())).buffered(together);
                while let Some(done) = canceling.next().await {
                    canceled += u64::from(matches!(done?, Canceled::Done(_)));
                }
            }
        })
    }

    /// Deletes a job that has ended.
    pub fn delete(&self, id: JobId, by: Actor) -> Doing<'_, Deleted> {
        Box::pin(self.change(cancel::delete, (id, by)))
    }

    /// Changes the label, the tags and the privacy of a job. Returns the job; `None` if there is none.
    pub fn rename(&self, id: JobId, naming: Naming, by: Actor) -> Doing<'_, Option<Job>> {
        Box::pin(self.change(naming::rename, (id, naming, by)))
    }

    /// A job in its current state.
    pub fn job(&self, id: JobId) -> Doing<'_, Option<Job>> {
        Box::pin(read::job(id, self.reading()))
    }

    /// The task of a job, and its original text.
    pub fn asked(&self, id: JobId) -> Doing<'_, Asked> {
        Box::pin(read::asked(id, self.reading()))
    }

    /// Returns up to `limit` jobs that match after `cursor`, in the order of the filter.
    pub fn jobs<'a>(
        &'a self,
        filter: &'a Filter,
        cursor: Option<JobId>,
        limit: u32,
    ) -> Doing<'a, Page> {
        Box::pin(read::jobs(filter, cursor, limit, self.scanning()))
    }

    /// The number of jobs that match.
    pub fn count_jobs<'a>(&'a self, filter: &'a Filter) -> Doing<'a, u64> {
        Box::pin(read::count(filter, self.scanning()))
    }

    /// The result of a key. Its checksum is verified, so damage on the disk is an error and never a wrong number.
    pub fn result<'a>(&'a self, key: &'a Key) -> Doing<'a, Option<StoredResult>> {
        Box::pin(async move {
            match self.small_result(key).await? {
                Some(StoredResult::Large(_)) => {
                    let found = read::result(key, i64::MAX, Reading(self, Purpose::Large)).await?;
                    self.sound(key, found).await
                }
                found => Ok(found),
            }
        })
    }

    /// The result of a key. The body of a result larger than [`LARGE`] is not read.
    pub fn small_result<'a>(&'a self, key: &'a Key) -> Doing<'a, Option<StoredResult>> {
        Box::pin(async move {
            let most = (LARGE as u64).cast_signed();
            self.sound(key, read::result(key, most, self.reading()).await?).await
        })
    }

    /// Compares a result with its checksum.
    async fn sound(
        &self,
        key: &Key,
        found: Option<(StoredResult, Sum)>,
    ) -> Result<Option<StoredResult>> {
        let Some((found, sum)) = found else { return Ok(None) };
        let StoredResult::Whole(body) = &found else { return Ok(Some(found)) };
        let sound = if body.bytes().len() <= LARGE {
            sum.is_of(body)
        } else {
            let body = body.clone();
            // After a panic, the body counts as damaged.
            tokio::task::spawn_blocking(move || sum.is_of(&body)).await.unwrap_or(false)
        };
        if !sound {
            return self.signals.counted(Err(Error::DamagedResult(*key)));
        }
        self.was_read(key);
        Ok(Some(found))
    }

    /// Records that a result was read, because the least recently read result is evicted first.
    pub fn was_read(&self, key: &Key) {
        self.signals.read(*key, now());
    }

    /// Whether the result of a key is stored.
    pub fn has_result<'a>(&'a self, key: &'a Key) -> Doing<'a, bool> {
        Box::pin(read::has_result(key, self.reading()))
    }

    /// The oldest unfinished job within reach of the live run of a key.
    pub fn live_job<'a>(&'a self, key: &'a Key, reach: &'a Reach) -> Doing<'a, Option<JobId>> {
        Box::pin(read::live_job(key, reach, self.reading()))
    }

    /// The time that the oldest queued run has waited.
    pub fn longest_wait(&self) -> Doing<'_, Duration> {
        each!(self, db => Box::pin(db.longest_wait()))
    }

    /// When the last backup ended, in milliseconds since 1970; 0 if there was none. `None` for PostgreSQL, until another program
    /// has written the time of its backup.
    pub fn last_backup(&self) -> Doing<'_, Option<i64>> {
        Box::pin(async move {
            let query = sql!("SELECT backed_up FROM " ["room" | "upkeep"] "");
            Ok(self.reading().one(query).await?.get("backed_up")?)
        })
    }

    /// Checks that the disk has space for a submission: writes data of the same size.
    pub fn probe(&self) -> Doing<'_, ()> {
        change!(self, maintenance::probe, ())
    }

    /// Returns the job once it has finished, or in its current state once `until` has completed.
    pub async fn wait(&self, job: Job, until: impl Future<Output = ()>) -> Result<Job> {
        if job.state.is_finished() {
            return Ok(job);
        }
        let mut changes = self.watch(&job.key);
        let mut until = pin!(until);
        let mut over = false;
        loop {
            match self.job(job.id).await? {
                Some(now) if over || now.state.is_finished() => return Ok(now),
                Some(_) => {}
                None => return Ok(job),
            }
            tokio::select! {
                () = changes.ended() => {}
                () = &mut until => over = true,
            }
        }
    }

    /// The provenance of a result, with the note that this owner sees.
    pub fn provenance<'a>(&'a self, key: &'a Key, who: &'a str) -> Doing<'a, Option<Provenance>> {
        Box::pin(Provenance::of(key, who, self.reading()))
    }

    /// Pins a result, which is then never evicted, or unpins it.
    pub fn pin<'a>(&'a self, key: &'a Key, pinned: bool, editor: Reach) -> Doing<'a, Changed> {
        Box::pin(self.change(storing::pin, (*key, pinned, editor, self.pin_quota)))
    }

    /// Writes the note of a result, or removes it.
    pub fn annotate(&self, key: Key, text: Option<String>, by: Annotator) -> Doing<'_, Annotated> {
        Box::pin(self.change(notes::annotate, (key, text, by)))
    }

    /// Deletes the body of a result, and keeps its scenario.
    pub fn remove<'a>(&'a self, key: &'a Key, by: Actor) -> Doing<'a, Removed> {
        Box::pin(self.change(storing::remove, (*key, by)))
    }

    /// What the database knows about a key.
    pub fn known<'a>(&'a self, key: &'a Key) -> Doing<'a, Option<Known>> {
        Box::pin(Known::of(key, self.reading()))
    }

    /// All keys, also expired and revoked ones, the oldest first.
    pub fn access_keys(&self) -> Doing<'_, Vec<AccessKey>> {
        Box::pin(keys::list(Reading(self, Purpose::Keys)))
    }

    /// Creates an access key. Returns its id and its text, which cannot be read later.
    pub fn add_key(&self, new: NewKey, by: Actor) -> Doing<'_, (String, String)> {
        Box::pin(async move {
            let (id, key) = NewKey::mint()?;
            self.change(keys::add, (id.clone(), key.clone(), new, by)).await?;
            Ok((id, key))
        })
    }

    /// Revokes the valid key with this id. Returns whether there was one.
    pub fn revoke_key<'a>(&'a self, id: &'a str, by: Actor) -> Doing<'a, bool> {
        Box::pin(async move { Ok(self.change(keys::revoke, (id.to_owned(), by)).await? > 0) })
    }

    /// Records that a key was used now.
    pub fn key_was_used(&self, by: Actor) -> Doing<'_, ()> {
        Box::pin(self.change(keys::was_used, by))
    }

    /// Begins a session of the browser that has sent this key. Returns its token, which cannot be read later.
    pub fn begin_session(&self, by: SignedIn) -> Doing<'_, String> {
        Box::pin(async move {
            let token = keys::random::<32>()?;
            self.change(sessions::begin, (token.clone(), by)).await?;
            Ok(token)
        })
    }

    /// The key of the session whose token has this digest; `None` if the session has ended.
    pub fn session<'a>(&'a self, digest: &'a [u8; 32]) -> Doing<'a, Option<SignedIn>> {
        Box::pin(sessions::find(digest, now(), Reading(self, Purpose::Keys)))
    }

    /// Ends the session with this token, if there is one.
    pub fn end_session(&self, token: &str) -> Doing<'_, ()> {
        Box::pin(self.change(sessions::end, keys::digest(token)))
    }

    /// The secret that signs links to results. It is created once for each database.
    pub fn link_secret(&self) -> Doing<'_, [u8; 32]> {
        Box::pin(async move {
            let mut candidate = [0; 32];
            getrandom::fill(&mut candidate).map_err(|_| Error::NoRandomness)?;
            self.change(keys::link_secret, candidate).await
        })
    }

    /// The numbers of queued and of running jobs of an owner.
    pub fn unfinished<'a>(&'a self, owner: &'a str) -> Doing<'a, (u64, u64)> {
        Box::pin(read::counts(owner, self.reading()))
    }

    /// Up to `limit` entries of the audit log, the newest first. With `before`, only entries with smaller ids.
    pub fn audit(&self, before: Option<i64>, limit: u32) -> Doing<'_, Vec<AuditEntry>> {
        Box::pin(audit::list(before, limit, self.reading()))
    }

    /// The sizes of the database and of its log.
    pub fn file_sizes(&self) -> FileSizes {
        match &self.engine {
            Backend::Sqlite(db) => db.file_sizes(),
            Backend::Postgres(_) => FileSizes::default(),
        }
    }

    /// The number of open connections to PostgreSQL; `None` for SQLite.
    pub fn database_connections(&self) -> Option<u64> {
        match &self.engine {
            Backend::Sqlite(_) => None,
            Backend::Postgres(db) => Some(db.connections()),
        }
    }

    /// Opens or creates the database at a place.
    ///
    /// No other process can open a directory until the store is closed. Call [`Store::recover`] before the first
    /// [`Store::claim`].
    pub fn open(place: Place, options: &Options) -> Command<'_, Self> {
        Box::pin(async move {
            let signals = Signals::starting(options.settle);
            let shared = Arc::clone(&signals);
            let engine = match place {
                Place::Directory(dir) => {
                    Backend::Sqlite(sqlite::Database::open(&dir, options, shared).await?)
                }
                Place::Shared(url) => {
                    Backend::Postgres(postgres::Database::open(&url, options, shared).await?)
                }
            };
            let pin_quota = PinQuota::new(options.pin_quota, options.budget);
            Ok(Self { engine, signals, pin_quota })
        })
    }

    /// Returns up to `limit` matching results after `cursor`, among all that were committed before this
    /// call.
    pub fn search<'a>(
        &'a self,
        search: &'a Search,
        cursor: Option<Cursor>,
        limit: u32,
    ) -> Doing<'a, SearchPage> {
        Box::pin(SearchPage::page(search, cursor, limit, self.scanning()))
    }

    /// The number of results that match.
    pub fn count<'a>(&'a self, search: &'a Search) -> Doing<'a, u64> {
        Box::pin(search::count(search, self.scanning()))
    }

    /// The stored result whose inputs are nearest to those of an outline, other than `except`. The distance
    /// is the sum of the relative differences, plus 10 for each word that differs.
    pub fn nearest<'a>(&'a self, to: &'a Outline, except: Option<Key>) -> Doing<'a, Option<Key>> {
        Box::pin(search::nearest(to, except, self.scanning()))
    }

    /// Free bytes on the disk of the database; `None` if the system does not report them.
    pub fn free_bytes(&self) -> Option<u64> {
        each!(self, db => db.free_bytes())
    }

    /// Metrics since the start.
    pub fn tally(&self) -> &Tally {
        &self.signals.tally
    }

    /// Signals changes of the jobs and the run of a key from now on. Read the tables after this call.
    pub fn watch(&self, key: &Key) -> Changes {
        self.signals.watch(*key)
    }

    /// Signals deletions of results from now on, also those by servers that share the database.
    pub fn watch_deletions(&self) -> Deletions {
        self.signals.watch_deletions()
    }

    /// Signals that a run was queued, from now on.
    pub fn watch_queue(&self) -> Changes {
        self.signals.watch_queue()
    }

    /// Completes all earlier changes, closes the database and unlocks the directory.
    pub async fn close(&self) {
        each!(self, db => db.close().await);
    }
}
