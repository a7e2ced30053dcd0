//! The audit log: who made, revoked and used keys, and who canceled, deleted and named whose jobs and results.
//!
//! An entry is written in the transaction of its act. Equal acts of one day share an entry. All own jobs that an actor
//! cancels in one day share an entry, too, and so do those that it deletes, and all names and notes of an owner that it
//! changes. So no client can fill the log with ordinary requests.

use crate::database::{Connected, Result, Row, Tables, cells, read, sql};
use fretwork_job::words;

words! {
    /// What the audit log records.
    pub enum Act: "act" {
        /// An access key was made.
        AddKey = "add_key",
        /// An access key was revoked.
        RevokeKey = "revoke_key",
        /// An access key was used. Uses within one minute count once.
        UseKey = "use_key",
        /// A job was canceled.
        CancelJob = "cancel_job",
        /// A job was deleted.
        DeleteJob = "delete_job",
        /// A result was deleted.
        DeleteResult = "delete_result",
        /// The label, the tags or the privacy of a job was changed.
        RenameJob = "rename_job",
        /// The note of a result was written or deleted.
        ChangeNote = "change_note",
        /// The earlier names of an owner were shared.
        ShareNames = "share_names",
        /// The names of an owner were given to another one.
        GiveNames = "give_names",
    }
}

cells! { &str => str::parse: Act; }

/// The person or program that acts.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Actor {
    /// The name in its access key, which is the owner of its jobs. For a command: the user who runs it.
    pub name: String,
    /// The id of its access key; empty without a key.
    pub key: String,
}

impl Actor {
    /// The user of the operating system who runs this process.
    pub fn of_process() -> Self {
        #[cfg(unix)]
        let name = format!("uid {}", rustix::process::getuid());
        #[cfg(not(unix))]
        let name = "local user".to_owned();
        Self { name, key: String::new() }
    }
}

/// An entry of the audit log: equal acts of one day.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AuditEntry {
    /// Its number. Later entries have larger numbers.
    pub id: i64,
    /// When the first act was, in milliseconds since 1970.
    pub first: i64,
    /// When the last act was.
    pub last: i64,
    /// The number of acts.
    pub times: u64,
    /// What was done.
    pub act: Act,
    /// Who did it.
    pub actor: Actor,
    /// The id of the access key or of the job, or the key of the result; empty for an actor's own jobs, and for names and
    /// notes.
    pub subject: String,
    /// The owner of the subject; empty if unknown.
    pub owner: String,
}

impl AuditEntry {
    fn read(row: &Row) -> sqlx::Result<Self> {
        let actor = Actor { name: row.get("actor")?, key: row.get("key")? };
        Ok(read!(row => Self { id, first, last, times, act, subject, owner; actor }))
    }
}

/// Records an act in the open transaction. `owner` is the owner of the subject.
pub(crate) async fn record(
    tx: &mut impl Connected,
    now: i64,
    (actor, act): (&Actor, Act),
    subject: &str,
    owner: &str,
) -> Result<()> {
    // All own jobs of an actor share an entry, which has no subject.
    let own_job = matches!(act, Act::CancelJob | Act::DeleteJob) && actor.name == owner;
    let subject = if own_job { "" } else { subject };
    let entry = sql!(
        "INSERT INTO audit (first, last, times, act, actor, key, subject, owner)
         VALUES ($1, $1, 1, $2, $3, $4, $5, $6)
         ON CONFLICT (act, actor, key, subject, owner, (first / 86400000))
         DO UPDATE SET last = excluded.last, times = audit.times + 1";
        now, act.as_str(), &actor.name, &actor.key, subject, owner
    );
    tx.execute(entry).await
}

/// Up to `limit` entries, the newest first. With `before`, only entries with smaller ids.
pub(crate) async fn list(
    before: Option<i64>,
    limit: u32,
    mut db: impl Tables,
) -> Result<Vec<AuditEntry>> {
    let entries = sql!(
        "SELECT id, first, last, times, act, actor, key, subject, owner FROM audit
         WHERE id < $1 ORDER BY id DESC LIMIT $2";
        before.unwrap_or(i64::MAX), limit
    );
    let rows = db.rows(entries).await?;
    Ok(rows.iter().map(AuditEntry::read).collect::<Result<_, _>>()?)
}
