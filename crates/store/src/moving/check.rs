//! Searches a database for damage, and names the rows.
//!
//! A check compares each row with other copies of its values. Indexes contain such copies, and some indexes exist only
//! for this (`migrations/sqlite/0014_copies.sql`, `0015_verified.sql`). Other copies are in the body of the result,
//! which has a checksum, and in other rows.

use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use data_encoding::HEXLOWER;
use futures_util::TryStreamExt as _;
use serde_json::Value;
use sha2::{Digest as _, Sha256};
use sqlx::{AssertSqlSafe, Connection as _, SqliteConnection};

use super::damage::{Damage, SCHEMA, UNUSED, in_schema, locate};
use super::{Moving, PartialFile, reading, refused, require, settle};
use crate::administration::PATIENCE;
use crate::database::{
    Body, Command, Connected as _, Error, Result, Row, Statement, Sum, Tables as _, changes,
    checksum, is_other_file, sql, unless_damaged,
};
use crate::results::search::names;
use crate::results::storing::outlined;
use crate::sqlite::open::{self, DATABASE};
use crate::sqlite::schema;
use fretwork_job::{Canonical, ENGINE, Key, Outline, ResultDocument, SCALARS, WORDS, clock};

/// The findings of a check.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Checked {
    /// The numbers of jobs and of results, including evicted results. `None` if damage prevents counting.
    pub counts: Option<(u64, u64)>,
    /// Each damage that was found.
    pub damage: Vec<Damage>,
}

/// Checks the database of a directory. A server may be using it.
///
/// # Errors
/// There is no database, its schema is foreign, or it cannot be read at all.
pub fn check(dir: &Path) -> Command<'_, Checked, Moving> {
    Box::pin(async move {
        let path = dir.join(DATABASE);
        let mut db = match opened(&path).await {
            Ok(db) => db,
            Err(Moving::Store(error)) => return of_schema(error),
            Err(error) => return Err(error),
        };
        let mut damage = of_pages(&mut db).await?;
        damage.extend(of_rows(&mut db).await?);
        let count = "SELECT (SELECT count(*) FROM job), (SELECT count(*) FROM result)";
        let counts = unless_damaged(sqlx::query_as(count).fetch_one(&mut db).await)?.ok();
        db.close().await?;
        damage.dedup();
        Ok(Checked { counts, damage })
    })
}

/// What a repair has changed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Repaired {
    /// A copy of the database as it was; `None` if nothing was to be repaired.
    pub copy: Option<PathBuf>,
    /// Each damage that is repaired.
    pub damage: Vec<Damage>,
}

/// Writes what follows from the body of a result again, if it contradicts a body whose checksum is right. Nothing else is
/// changed or deleted. No server may use the directory. Copies the database before the first change.
///
/// # Errors
/// A server is running, there is no database, its schema is damaged, or the copy cannot be written.
pub fn repair(dir: &Path) -> Command<'_, Repaired, Moving> {
    Box::pin(async move {
        let path = dir.join(DATABASE);
        require(&path)?;
        let _lock = open::lock(dir).await?;
        settle(&path).await?;
        let mut db = opened(&path).await?;
        let (mut damage, keys) = of_results(&mut db).await?;
        let repaired: HashSet<String> = keys.iter().map(|key| HEXLOWER.encode(key)).collect();
        damage.retain(|damage| damage.row.as_ref().is_some_and(|row| repaired.contains(row)));
        if keys.is_empty() {
            return Ok(Repaired { copy: None, damage });
        }
        let copy = dir.join(format!("fretwork.unrepaired-{}.db", clock::now()));
        let part = PartialFile::of(&dir.join("fretwork.unrepaired.db"), ".part")?;
        fs::copy(&path, &part.0).map_err(refused(&copy))?;
        part.name(&copy)?;
        // In a database without a log, a transaction of a reader would block the writer.
        db.execute(sql!("COMMIT")).await?;
        // A connection that has read a damaged page cannot commit. So another one writes, a result at a time.
        let options = open::connecting(&path).busy_timeout(PATIENCE);
        let mut writer = SqliteConnection::connect_with(&options).await?;
        // Otherwise SQLite refuses to change a row that differs from an index. The change makes both equal.
        writer.execute(sql!("PRAGMA writable_schema = ON")).await?;
        for key in keys {
            let row = db.one(sql!("SELECT body FROM result_blob WHERE key = $1"; &key)).await?;
            let body = Body::stored(row.get("body")?).json();
            let Some((body, document)) =
                body.ok().and_then(|body| Some((body.clone(), ResultDocument::read(&body).ok()?)))
            else {
                continue;
            };
            if let Err(error) = derive(&mut writer, &key, &body, &document).await {
                writer.execute(sql!("ROLLBACK")).await?;
                // Another damage prevents the repair.
                let Error::Damaged(_) = error else { return Err(error.into()) };
                let key = HEXLOWER.encode(&key);
                damage.retain(|damage| damage.row.as_ref() != Some(&key));
            }
        }
        db.close().await?;
        writer.close().await?;
        Ok(Repaired { copy: Some(copy), damage })
    })
}

/// Opens a database of this version for reading, in a transaction, so that all statements see the same snapshot while a
/// server writes.
async fn opened(path: &Path) -> Result<SqliteConnection, Moving> {
    require(path)?;
    open::inspect(path).await?;
    let mut db = reading(path).await?;
    db.execute(sql!("BEGIN")).await?;
    schema::compare(&mut db, path).await?;
    schema::require_latest(&mut db, path).await?;
    Ok(db)
}

/// Reports a damaged schema as damage. It ends the check before any row is read. Any other error is returned.
fn of_schema(error: Error) -> Result<Checked, Moving> {
    let damage = match error {
        Error::Altered { what, .. } => Damage::of(SCHEMA, what),
        Error::Damaged(source) => in_schema(&source),
        Error::NotADatabase { source, .. } if !is_other_file(&source) => in_schema(&source),
        error => return Err(error.into()),
    };
    Ok(Checked { counts: None, damage: vec![damage] })
}

/// Compares all indexes with their tables, and checks the structure of all pages.
pub(super) async fn of_pages(db: &mut SqliteConnection) -> Result<Vec<Damage>> {
    let of_all = said(db, "PRAGMA integrity_check".to_owned()).await?;
    if of_all == ["ok"] {
        return Ok(Vec::new());
    }
    let tables: Vec<String> = sqlx::query_scalar(
        "SELECT name FROM sqlite_schema WHERE type = 'table' UNION ALL SELECT 'sqlite_schema'",
    )
    .fetch_all(&mut *db)
    .await?;
    let mut damage = Vec::new();
    // SQLite ends an integrity check at some kinds of damage. So each table is checked separately.
    for table in tables {
        for line in said(db, format!("PRAGMA integrity_check(\"{table}\")")).await? {
            if line != "ok" {
                damage.push(locate(db, &table, &line).await);
            }
        }
    }
    if damage.is_empty() {
        damage.extend(of_all.iter().map(|line| Damage::of(UNUSED, line)));
    }
    Ok(damage)
}

/// The lines of an integrity check.
async fn said(db: &mut SqliteConnection, check: String) -> Result<Vec<String>> {
    let said = unless_damaged(sqlx::query_scalar(AssertSqlSafe(check)).fetch_all(db).await)?;
    let said: Vec<String> = said.unwrap_or_else(|error| vec![error]);
    let lines = said.iter().flat_map(|said| said.lines());
    Ok(lines.filter(|line| !line.starts_with("***")).map(str::to_owned).collect())
}

/// Compares rows with each other and with the bodies of results.
pub(super) async fn of_rows(db: &mut SqliteConnection) -> Result<Vec<Damage>> {
    let mut damage = Vec::new();
    for (table, column, statement) in COMPARISONS {
        match unless_damaged(sqlx::query_scalar(statement).fetch_all(&mut *db).await)? {
            Ok(keys) => {
                let what = format!("{column} contradicts other rows");
                damage.extend(keys.iter().map(|key: &String| Damage::at(table, key, &*what)));
            }
            Err(error) => damage.push(Damage::of(table, error)),
        }
    }
    match unless_damaged(schema::wrong_records(db).await)? {
        Ok(versions) => damage.extend(versions.iter().map(|version| {
            Damage::at("_sqlx_migrations", &version.to_string(), "the record is changed or missing")
        })),
        Err(error) => damage.push(Damage::of("_sqlx_migrations", error)),
    }
    damage.extend(of_jobs(db).await?);
    damage.extend(of_results(db).await?.0);
    Ok(damage)
}

/// Statements that return the keys of rows that contradict other rows: table, column, statement.
const COMPARISONS: [(&str, &str, &str); 13] = [
    ("outline", "created", "SELECT lower(hex(key)) FROM outline JOIN result_task USING (id) JOIN result USING (key)
        WHERE outline.created <> result.created"),
    ("outline", "size", "SELECT lower(hex(key)) FROM outline JOIN result_task USING (id) JOIN result USING (key)
        WHERE outline.size <> result.size"),
    ("outline", "owner", "SELECT lower(hex(key)) FROM outline JOIN result_task USING (id) JOIN result USING (key)
        WHERE outline.owner IS NOT result.owner"),
    ("outline", "present", "SELECT lower(hex(key)) FROM outline JOIN result_task USING (id) JOIN result USING (key)
        WHERE outline.present <> (result.evicted IS NULL)"),
    // An outline may be missing after the last one that exists: the server writes it at the next start.
    ("outline", "id", "SELECT lower(hex(key)) FROM result_task WHERE id NOT IN (SELECT id FROM outline)
        AND id < (SELECT max(id) FROM outline)"),
    ("outline", "id", "SELECT 'row ' || id FROM outline WHERE id NOT IN (SELECT id FROM result_task)"),
    ("result_task", "key", "SELECT lower(hex(key)) FROM result_task WHERE key NOT IN (SELECT key FROM result)"),
    ("result", "stored", "SELECT lower(hex(key)) FROM result JOIN result_blob USING (key)
        WHERE stored <> length(body)"),
    ("result_blob", "key", "SELECT lower(hex(key)) FROM result_blob WHERE key NOT IN (SELECT key FROM result
        WHERE evicted IS NULL)"),
    ("job", "tags", "SELECT lower(hex(id)) FROM job WHERE iif(json_valid(tags), EXISTS (
        SELECT 1 FROM json_each(iif(json_valid(tags), tags, '[]')) AS tag WHERE NOT EXISTS (
            SELECT 1 FROM job_tag WHERE job_tag.tag = tag.value AND job_tag.job = job.id)), TRUE)"),
    ("job_tag", "tag", "SELECT lower(hex(job)) FROM job_tag WHERE NOT EXISTS (SELECT 1 FROM job WHERE id = job_tag.job
        AND tag IN (SELECT value FROM json_each(iif(json_valid(tags), tags, '[]'))))"),
    ("run", "progress", "SELECT 'row ' || id FROM run WHERE state = 'succeeded' AND progress <> 1"),
    ("room", "used", "SELECT 'row 1' FROM room WHERE used <> (SELECT coalesce(sum(stored), 0) FROM result
        WHERE evicted IS NULL) OR runs < (SELECT coalesce(max(id), 0) FROM run)"),
];

/// Compares the state and the times of each job with its recorded changes of state, and the submitted text with its
/// checksum.
async fn of_jobs(db: &mut SqliteConnection) -> Result<Vec<Damage>> {
    let mut damage = Vec::new();
    let mut rows = sqlx::query(
        "SELECT lower(hex(id)) AS id, state, attempt, created, started, finished, changes, submitted,
             submitted_sum FROM job",
    )
    .fetch(db);
    loop {
        match unless_damaged(rows.try_next().await)? {
            Ok(Some(row)) => {
                let row = Row::Sqlite(row);
                let wrong = contradiction(&row).unwrap_or_else(|error| Some(error.to_string()));
                let id = row.get::<&str>("id").unwrap_or_default();
                damage.extend(wrong.map(|what| Damage::at("job", id, what)));
            }
            Ok(None) => return Ok(damage),
            Err(error) => {
                damage.push(Damage::of("job", error));
                return Ok(damage);
            }
        }
    }
}

/// A description of the first contradiction in the row of a job, if there is one.
fn contradiction(row: &Row) -> sqlx::Result<Option<String>> {
    let Ok(changes) = changes(row.get("changes")?) else {
        return Ok(Some("changes has an entry that is not a change of state".to_owned()));
    };
    let Some(last) = changes.last() else { return Ok(Some("changes is empty".to_owned())) };
    let state: &str = row.get("state")?;
    let finished: Option<i64> = row.get("finished")?;
    let started: Option<i64> = row.get("started")?;
    let running = changes.iter().rfind(|change| change.state.as_str() == "running");
    let sum: Option<i64> = row.get("submitted_sum")?;
    if sum.is_some() && sum != row.get::<Option<&str>>("submitted")?.map(checksum) {
        return Ok(Some("submitted or submitted_sum is changed".to_owned()));
    }
    let of_changes = [
        ("state", last.state.as_str() == state),
        ("attempt", last.attempt == row.get::<u32>("attempt")?),
        ("finished", finished == last.state.is_finished().then_some(last.at)),
        // The clock may have been set back since the submission.
        (
            "started",
            running.zip(started).is_none_or(|(run, at)| {
                at == run.at
                    || row.get::<i64>("created").is_ok_and(|created| at == created && at > run.at)
            }),
        ),
    ];
    let wrong = of_changes.iter().find(|(_, agrees)| !agrees);
    Ok(wrong.map(|(column, _)| format!("{column} contradicts changes")))
}

/// Compares each result with its body, its task and its outline. Also returns the keys of the damaged results whose bodies
/// are sound.
async fn of_results(db: &mut SqliteConnection) -> Result<(Vec<Damage>, Vec<Vec<u8>>)> {
    let columns: Vec<String> = names().map(|name| format!("outline.{name}")).collect();
    let statement = format!(
        "SELECT result.key AS key, summary, digest, result.size AS size, checksum, evicted, task, body, {}
         FROM result LEFT JOIN result_blob USING (key) LEFT JOIN result_task USING (key)
         LEFT JOIN outline USING (id) WHERE result.key > ?1 ORDER BY result.key LIMIT 1",
        columns.join(", ")
    );
    let statement: Arc<str> = statement.into();
    let (mut damage, mut sound, mut last) = (Vec::new(), Vec::new(), Vec::new());
    // Reads one body at a time, to save memory.
    loop {
        let query = sqlx::query(AssertSqlSafe(Arc::clone(&statement))).bind(&last);
        match unless_damaged(query.fetch_optional(&mut *db).await)? {
            Ok(None) => return Ok((damage, sound)),
            Ok(Some(row)) => {
                let row = Row::Sqlite(row);
                last = row.get("key")?;
                let (wrong, is_sound) = of_result(&row)
                    .unwrap_or_else(|error| (vec![(table_of(&error), error.to_string())], false));
                if is_sound && !wrong.is_empty() {
                    sound.push(last.clone());
                }
                let key = HEXLOWER.encode(&last);
                damage.extend(wrong.into_iter().map(|(table, what)| Damage::at(table, &key, what)));
            }
            Err(error) => {
                let next = "SELECT key FROM result WHERE key > ?1 ORDER BY key LIMIT 1";
                let next = sqlx::query_scalar(next).bind(&last).fetch_optional(&mut *db).await;
                let Ok(Some(next)) = next else {
                    damage.push(Damage::of("result", error));
                    return Ok((damage, sound));
                };
                last = next;
                let what = format!("body, task or outline cannot be read: {error}");
                damage.push(Damage::at("result_blob", &HEXLOWER.encode(&last), what));
            }
        }
    }
}

/// The table of the column that cannot be read.
fn table_of(error: &sqlx::Error) -> &'static str {
    match error {
        sqlx::Error::ColumnDecode { index, .. } => match index.trim_matches('"') {
            "task" => "result_task",
            "body" => "result_blob",
            name if names().any(|column| column == name) => "outline",
            _ => "result",
        },
        _ => "result",
    }
}

/// Each fault of a result: the table, and a description; and whether its body is sound.
fn of_result(row: &Row) -> sqlx::Result<(Vec<(&'static str, String)>, bool)> {
    let (key, task) = (row.get("key")?, row.get::<Option<&str>>("task")?);
    let is_real = row.get::<Option<&str>>("kind")?.is_some();
    let of_task = |task| Canonical::in_stored(task).is_some_and(|asked| is_key_of(&key, &asked));
    let mut wrong = Vec::new();
    if is_real && !task.is_some_and(of_task) {
        wrong.push(("result_task", "task does not give the key".to_owned()));
    }
    if row.get::<Option<i64>>("evicted")?.is_some() {
        return Ok((wrong, false));
    }
    let Some(body) = row.get::<Option<Vec<u8>>>("body")?.map(Body::stored) else {
        wrong.push(("result_blob", "body is missing".to_owned()));
        return Ok((wrong, false));
    };
    if !Sum::read(row)?.is_of(&body) {
        wrong.push(("result_blob", "body or checksum is changed".to_owned()));
        return Ok((wrong, false));
    }
    let Ok(body) = body.json() else {
        wrong.push(("result_blob", "body cannot be decompressed".to_owned()));
        return Ok((wrong, false));
    };
    if row.get::<u64>("size")? != body.len() as u64 {
        wrong.push(("result", "size contradicts the body".to_owned()));
    }
    if Sha256::digest(&body)[..] != *row.get::<&[u8]>("digest")? {
        wrong.push(("result", "digest contradicts the body".to_owned()));
    }
    let document = ResultDocument::read(&body).ok();
    // The server writes a missing outline at its next start.
    let compared = document.iter().filter(|_| is_real);
    wrong.extend(compared.flat_map(|document| of_document(row, document)));
    Ok((wrong, document.is_some_and(|document| is_key_of(&key, &document.asked))))
}

/// Writes the columns of a result that follow from its body.
async fn derive(
    db: &mut SqliteConnection,
    key: &[u8],
    body: &[u8],
    document: &ResultDocument,
) -> Result<()> {
    let [columns, values, _] = outlined(6);
    let derive = format!(
        "BEGIN IMMEDIATE;
         UPDATE result SET size = $2, summary = $3, digest = $4 WHERE key = $1;
         UPDATE result_task SET task = $5 WHERE key = $1;
         UPDATE outline SET size = $2, ({columns}) = ({values})
         WHERE id = (SELECT id FROM result_task WHERE key = $1);
         COMMIT"
    );
    let derive = Statement::of(derive)
        .with(key)
        .with((body.len() as u64).cast_signed())
        .with(document.summary.to_string())
        .with(&Sha256::digest(body)[..])
        .with(document.asked.kind.stored(&document.asked.value));
    db.execute(derive.with_outline(&document.outline)).await
}

/// Compares the summary and the outline, which lists and searches show, with the body of the result.
fn of_document(row: &Row, document: &ResultDocument) -> Vec<(&'static str, String)> {
    let mut wrong = Vec::new();
    if !row.get("summary").is_ok_and(|found: Value| equal(&found, &document.summary)) {
        wrong.push(("result", "summary contradicts the body".to_owned()));
    }
    let Outline { words, scalars } = &document.outline;
    for (word, expected) in WORDS.iter().zip(words) {
        if row.get::<Option<&str>>(word.name).ok() != Some(expected.as_deref()) {
            wrong.push(("outline", format!("{} contradicts the body", word.name)));
        }
    }
    for (scalar, expected) in SCALARS.iter().zip(scalars) {
        if row.get::<Option<f64>>(scalar.name).ok() != Some(*expected) {
            wrong.push(("outline", format!("{} contradicts the body", scalar.name)));
        }
    }
    wrong
}

/// Whether this is the key of the task under any `numerics` version of the engine.
fn is_key_of(key: &Key, asked: &Canonical) -> bool {
    (1..=ENGINE.numerics).any(|numerics| asked.key(numerics) == *key)
}

/// Whether two JSON values are equal. Numbers are compared by value, so 5 equals 5.0.
fn equal(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => one.as_f64() == other.as_f64(),
        (Value::Object(one), Value::Object(other)) => {
            let agrees = |(name, value): (&String, &Value)| {
                other.get(name).is_some_and(|other| equal(value, other))
            };
            one.len() == other.len() && one.iter().all(agrees)
        }
        (Value::Array(one), Value::Array(other)) => {
            one.len() == other.len() && one.iter().zip(other).all(|(one, other)| equal(one, other))
        }
        _ => one == other,
    }
}
