//! The commands `keys` and `audit`. They work on the data directory, with or without a running server.

use std::collections::BTreeMap;
use std::io::{self, Write as _};

use super::printing::{Error, counted, print, say};
use super::runtime::block_on;
use crate::config::{AddKey, Data, Keys};
use crate::telemetry::Logging;
use fretwork_job::clock::{self, now};
use fretwork_store::{self as store, AccessKey, Administration, AuditEntry, NewKey, Place, Role};

/// Adds, lists or revokes access keys, or passes on the names of an owner.
pub fn keys(command: Keys) -> Result<(), Error> {
    match command {
        Keys::Add(new) => block_on(add(new)),
        Keys::List(data) => block_on(list(&data)),
        Keys::ShareNames { owner, give_to, data } => block_on(pass_on(&owner, give_to, &data)),
        Keys::Revoke { name, data } => block_on(revoke(&name, &data)),
    }
}

/// Prints the audit log, the oldest entries first.
pub fn audit(data: &Data) -> Result<(), Error> {
    let mut entries = block_on(of(data, async |tables| tables.audit(None, u32::MAX).await))?;
    entries.reverse();
    let heading = format!("{:<24}  {:<24}  {:>5}  act\n", "first", "last", "times");
    let line = |entry| {
        let AuditEntry { first, last, times, act, actor, subject, owner, .. } = entry;
        let [first, last] = [first, last].map(clock::rfc3339);
        let key = if actor.key.is_empty() { String::new() } else { format!(" ({})", actor.key) };
        let act = act.as_str().replace('_', " ");
        let what = match (&*subject, &*owner) {
            ("", owner) if owner == actor.name => "(own)".to_owned(),
            ("", owner) => format!("of {owner}"),
            (_, "") => subject,
            _ => format!("{subject} of {owner}"),
        };
        format!("{first}  {last}  {times:>5}  {}{key}: {act} {what}\n", actor.name)
    };
    let lines: String = entries.into_iter().map(line).collect();
    print((heading + &lines).as_bytes())
}

/// The place of a database that exists.
pub fn existing(data: &Data) -> Result<Place, Error> {
    let place = data.place()?;
    if !Administration::is_at(&place) {
        return Err(format!("{place} contains no database; name it with --data-dir").into());
    }
    Ok(place)
}

/// What a command reads or changes in an existing database.
pub async fn of<T>(
    data: &Data,
    command: impl AsyncFnOnce(&mut Administration) -> store::Result<T>,
) -> Result<T, Error> {
    let mut tables = Administration::open(existing(data)?).await?;
    let done = command(&mut tables).await?;
    tables.close().await?;
    Ok(done)
}

async fn add(new: AddKey) -> Result<(), Error> {
    let AddKey { name, role, expires, rate, private, data } = new;
    let place = data.place()?;
    let new_database = !Administration::is_at(&place);
    let mut tables = Administration::open(place.clone()).await?;
    let expires = expires.map(|time| now() + time.as_millis() as i64);
    let first = tables.keys().await?.is_empty();
    let new = NewKey { name: name.clone(), role, per_minute: rate, expires, private };
    let key = tables.add_key(&new).await?;
    tables.close().await?;
    // Only the key goes to standard output, so that scripts can read it.
    let mut out = io::stdout().lock();
    writeln!(out, "{key}")?;
    out.flush()?;
    let mut err = io::stderr().lock();
    writeln!(err, "This is the key of {name} ({role}). It is not shown again. Send it as")?;
    writeln!(err, "  Authorization: Bearer {}…", &key[..key.len().min(18)])?;
    if new_database {
        writeln!(
            err,
            "{place} contained no database, so this made one. If yours is elsewhere, use --data-dir."
        )?;
    }
    if first {
        writeln!(err, "This is the first key. From now on the server on {place} requires a key.")?;
    }
    Ok(())
}

/// Makes the first key, for an administrator, and prints it.
pub async fn add_first_key(place: &Place, logging: &Logging) -> Result<(), Error> {
    const NAME: &str = "first";
    let mut tables = Administration::open(place.clone()).await?;
    let (name, role) = (NAME.to_owned(), Role::Admin);
    let new = NewKey { name, role, per_minute: None, expires: None, private: false };
    let key = tables.add_key(&new).await?;
    let message = "Other machines can reach this server, so it requires an access key. This is the key of an administrator. \
        It is not shown again";
    let text = format!(
        "{message}:\n\n  {key}\n\nAdd keys for users with `fretwork keys add`. Then revoke this one: `fretwork keys \
         revoke {NAME}`.\n\n"
    );
    let details = BTreeMap::from([("key", key)]);
    let printed = logging.announce(&text, message, &details);
    if printed.is_err() {
        // The key was not printed, so no one could use it.
        tables.revoke_keys(NAME).await?;
    }
    tables.close().await?;
    printed.map_err(|error| format!(
            "cannot print the first access key: {error}; the key is revoked; add another with `fretwork keys add \
             NAME --role admin`"
        )
        .into())
}

async fn list(data: &Data) -> Result<(), Error> {
    let keys = of(data, Administration::keys).await?;
    let mut out = io::stdout().lock();
    if keys.is_empty() {
        say("There are no keys. Add one with `fretwork keys add NAME --role ROLE`.");
        return Ok(());
    }
    writeln!(out, "id        name             role    created     used        rate        state")?;
    for key in keys {
        let AccessKey { id, name, role, per_minute, created, last_used, .. } = &key;
        let rate = per_minute.map_or("-".to_owned(), |rate| format!("{rate}/min"));
        let used = last_used.map_or("never".to_owned(), day);
        let (created, state) = (day(*created), state(&key));
        write!(out, "{id:<8}  {name:<16} {role:<6}  {created:<10}  {used:<10}  {rate:<10}  ")?;
        writeln!(out, "{state}")?;
    }
    Ok(())
}

/// Shares the earlier names of an owner, or gives its names to another one.
async fn pass_on(from: &str, to: Option<String>, data: &Data) -> Result<(), Error> {
    let count = of(data, async |tables| tables.pass_names_on(from, to.as_deref()).await).await?;
    let with = to.map_or_else(|| "shared".to_owned(), |to| format!("given to {to}"));
    Ok(writeln!(io::stdout(), "jobs and notes of {from} {with}: {count}")?)
}

async fn revoke(name: &str, data: &Data) -> Result<(), Error> {
    match of(data, async |tables| tables.revoke_keys(name).await).await? {
        0 => Err(format!(
            "no valid access key has the id or the name {name}; `fretwork keys list` shows all keys"
        )
        .into()),
        count => Ok(writeln!(io::stdout(), "{} revoked", counted(count as u64, "key"))?),
    }
}

/// Whether a key is valid, and until when.
fn state(key: &AccessKey) -> String {
    let now = now();
    let private = if key.private { ", private names" } else { "" };
    let state = match (key.revoked, key.expires) {
        (Some(at), _) => format!("revoked {}", day(at)),
        (None, Some(at)) if at <= now => format!("expired {}", day(at)),
        (None, Some(at)) => format!("until {}", day(at)),
        (None, None) => "valid".to_owned(),
    };
    state + private
}

/// The UTC date of a time in milliseconds since 1970.
fn day(at: i64) -> String {
    clock::rfc3339(at)[..10].to_owned()
}
