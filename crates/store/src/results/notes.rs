//! Notes on results. A result has one note that all see, and a private note of each owner who keeps names private.

use crate::database::{Change, Connected, Result, Row, Statement, Tables, checksum, read, sql};
use crate::team::audit::{Act, Actor, record};
use fretwork_job::Key;

/// What a user wrote about a result.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// The text.
    pub text: String,
    /// Who wrote it.
    pub owner: String,
    /// When it was written, in milliseconds since 1970.
    pub at: i64,
    /// Whether only its owner sees it.
    pub private: bool,
}

/// Maximum length of a note, in characters.
const LONGEST_NOTE: usize = 4000;

impl Note {
    /// Why a text is not allowed as a note; `None` if it is allowed. The caller adds the subject of the sentence.
    pub fn fault(text: &str) -> Option<String> {
        let length = text.chars().count();
        let is_control = |c: char| c.is_control() && c != '\n' && c != '\t';
        if length == 0 || length > LONGEST_NOTE {
            return Some(format!("must have 1 to {LONGEST_NOTE} characters, not {length}"));
        }
        text.contains(is_control).then(|| {
            "must not contain control characters other than line breaks and tabs".to_owned()
        })
    }

    /// A text that changes with the note: its entity tag.
    pub fn tag(&self) -> String {
        let Self { text, owner, at, private } = self;
        format!("\"{:016x}\"", checksum(&format!("{owner}\n{at}\n{private}\n{text}")))
    }

    /// Reads the columns [`COLUMNS`].
    pub(crate) fn read(row: &Row) -> sqlx::Result<Option<Self>> {
        let Some(text) = row.get("note")? else { return Ok(None) };
        let (owner, at) = (row.get("noted_by")?, row.get("noted")?);
        Ok(Some(read!(row => Self { private; text, owner, at })))
    }
}

/// The columns of the note that a caller sees: its private note, or else the note that all see.
pub(crate) const COLUMNS: &str =
    "coalesce(own.text, note.text) AS note, coalesce(own.owner, note.owner) AS noted_by,
    coalesce(own.at, note.at) AS noted, own.key IS NOT NULL AS private";

impl Statement {
    /// Joins the tables of [`COLUMNS`] to `result`.
    pub(crate) fn join_note(&mut self, reader: &str) -> &mut Self {
        self.push(" LEFT JOIN note ON note.key = result.key");
        self.push(" LEFT JOIN private_note AS own ON own.key = result.key AND own.owner = ");
        self.push_bind(reader)
    }
}

/// Who changes a note.
#[derive(Debug, Clone)]
pub struct Annotator {
    /// The user. Without a key, it may replace every note.
    pub by: Actor,
    /// Whether a new note is private.
    pub private: bool,
    /// The entity tags of the note that the user has read; `None` if it does not say.
    pub read: Option<Vec<String>>,
}

/// What a change of a note did.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Annotated {
    /// The note is as requested.
    Done,
    /// There is no such result.
    NotFound,
    /// The user has not read this present note; `None` if there is none.
    Unread(Option<Note>),
}

/// Writes the note of a result, or removes it. The result may be evicted.
pub(crate) async fn annotate(
    (key, text, annotator): &(Key, Option<String>, Annotator),
    mut tx: Change<'_>,
) -> Result<Annotated> {
    let Annotator { by, private, read } = annotator;
    // Changes of one note wait here for each other. A statement that waits would read the note as it was before.
    let lock = sql!("SELECT key FROM result WHERE key = $1" ["" | " FOR NO KEY UPDATE"] ""; key);
    if tx.row(lock).await?.is_none() {
        return Ok(Annotated::NotFound);
    }
    let mut query = Statement::of(format!("SELECT {COLUMNS} FROM result"));
    query.join_note(&by.name).push(" WHERE result.key = ").push_bind(key);
    let note = Note::read(&tx.one(query).await?)?;
    // Who deletes a note deletes what it reads.
    let is_private = *private && text.is_some() || note.as_ref().is_some_and(|note| note.private);
    // The owner of the note that changes.
    let owner = note.as_ref().filter(|_| !is_private).map_or(&by.name, |note| &note.owner);
    let is_read = match (read, &note) {
        (Some(tags), Some(note)) => tags.iter().any(|tag| tag == "*" || *tag == note.tag()),
        (Some(_), None) => false,
        (None, _) => *owner == by.name || by.key.is_empty(),
    };
    if !is_read {
        return Ok(Annotated::Unread(note));
    }
    let now = tx.now().await?;
    let table = if is_private { "private_note" } else { "note" };
    // An own note that becomes private is no longer public. Who has a private note changes no note of somebody else.
    for (table, owner) in [("note", owner), ("private_note", &by.name)] {
        let delete = Statement::of(format!("DELETE FROM {table} WHERE key = $1 AND owner = $2"));
        tx.execute(delete.with(key).with(owner)).await?;
    }
    if let Some(text) = text {
        let insert = format!("INSERT INTO {table} (key, owner, text, at) VALUES ($1, $2, $3, $4)");
        let insert = Statement::of(insert).with(key).with(&by.name).with(text).with(now);
        tx.execute(insert).await?;
    }
    record(&mut tx, now, (by, Act::ChangeNote), "", owner).await?;
    Ok(Annotated::Done)
}
