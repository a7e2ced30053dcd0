//! Flipped bits in a database. If a flipped bit changes an answer of the server, `fretwork check` names the damaged
//! row.

use std::env;
use std::error::Error as _;
use std::fs;
use std::io::{BufRead as _, BufReader};
use std::os::unix::fs::FileExt as _;
use std::path::Path;
use std::process::{Output, Stdio};

use fretwork_store::{Moving, Options, Repaired, Store, backup, check, repair};
use serde_json::{Value, json};
use sqlx::{AssertSqlSafe, Connection as _, Executor as _};
use tempfile::TempDir;

use crate::kill::Dice;
use crate::program::{Running, fretwork, run};
use crate::server::{JSON, Server, ball, send, yielding_ball};
use crate::store::raw;

/// A database with results, jobs with labels and tags, a note, a pin, a study, a deleted and an evicted result.
async fn library() -> TempDir {
    let server = Server::start().await;
    let mut keys = Vec::new();
    for number in 0..12 {
        let mut job = ball(1.0 + 0.1 * f64::from(number));
        job["label"] = json!(format!("run {number} of the series"));
        job["tags"] = json!(["series", format!("tag-{}", number % 3)]);
        let job = server.compute(&job).await.json();
        keys.push(job["key"].as_str().unwrap().to_owned());
        // The second job gets the stored result.
        server.compute(&ball(1.0 + 0.1 * f64::from(number))).await;
    }
    server.compute(&yielding_ball()).await;
    let study = include_str!("../../examples/studies/sweep.json");
    server.compute(&serde_json::from_str(study).unwrap()).await;
    for (key, text) in keys.iter().zip(["Agrees with the rig.", "Repeat this one."]) {
        let body = json!({"text": text}).to_string();
        let note = format!("/v1/results/{key}/note");
        assert_eq!(server.send("PUT", &note, &[JSON], body).await.status, 204);
        assert_eq!(
            server.send("PUT", &format!("/v1/results/{key}/pin"), &[], "").await.status,
            204
        );
    }
    for key in &keys[10..] {
        let deleted = server.send("DELETE", &format!("/v1/results/{key}"), &[], "").await;
        assert_eq!(deleted.status, 204);
    }
    let copy = TempDir::new().unwrap();
    let mut db = raw(server.dir.path()).await;
    db.execute("UPDATE result SET deleted_by = NULL WHERE key = (SELECT max(key) FROM result WHERE evicted > 0)")
        .await
        .unwrap();
    let file = copy.path().join("fretwork.db");
    sqlx::query("VACUUM INTO ?1").bind(file.to_str().unwrap()).execute(&mut db).await.unwrap();
    copy
}

fn copy(from: &Path) -> TempDir {
    let copy = TempDir::new().unwrap();
    fs::copy(from.join("fretwork.db"), copy.path().join("fretwork.db")).unwrap();
    copy
}

/// The answers of a server to requests for `targets`; none if the server does not start. If `targets` is empty, it is
/// first filled with the addresses of all lists, jobs and results.
async fn answers(dir: &Path, targets: &mut Vec<String>) -> Vec<String> {
    let mut command = fretwork(&["--listen", "127.0.0.1:0", "--workers", "1", "--data-dir"]);
    command.arg(dir).env("FRETWORK_LOG", "off").stdout(Stdio::piped()).stderr(Stdio::null());
    let mut child = Running(command.spawn().unwrap());
    let mut line = String::new();
    BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
    let Some((_, address)) = line.trim().rsplit_once("http://") else { return Vec::new() };
    let address = address.parse().unwrap();
    let get = async |target: &str| {
        let reply = send(address, "GET", target, &[], "").await.unwrap();
        let mut text = format!("{target} {} {}", reply.status, reply.text());
        if target.ends_with("/provenance") {
            // The time of the last access changes with each answer.
            let mut value: Value = serde_json::from_slice(&reply.body).unwrap_or_default();
            value["last_access"] = Value::Null;
            text = format!("{target} {} {value}", reply.status);
        }
        // `instance` is the id of the request, which differs in each answer.
        text.split("\"instance\"").next().unwrap().to_owned()
    };
    if targets.is_empty() {
        *targets = all_targets(address).await;
    }
    let mut answers = Vec::new();
    for target in targets {
        answers.push(get(target).await);
    }
    answers
}

async fn all_targets(address: std::net::SocketAddr) -> Vec<String> {
    let get = async |target: &str| send(address, "GET", target, &[], "").await.unwrap().json();
    let mut targets: Vec<String> = [
        "/v1/results?limit=100",
        "/v1/results?evicted=true",
        "/v1/results?sort=-wear_volume",
        "/v1/results?shape=sphere&friction=0.5..0.9&sort=amplitude",
        "/v1/results?tag=tag-1",
        "/v1/results?label=run+3+of+the+series",
        "/v1/results?note=rig",
        "/v1/results?pinned=true",
        "/v1/jobs?limit=200",
        "/v1/jobs?tag=series",
        "/v1/jobs?state=succeeded&limit=5",
        "/v1/audit",
    ]
    .map(str::to_owned)
    .into();
    let lists = [get("/v1/results?limit=100").await, get("/v1/results?evicted=true").await];
    for result in lists.iter().flat_map(|list| list["results"].as_array().unwrap()) {
        let key = result["key"].as_str().unwrap();
        targets
            .extend(["", "/provenance", "/warnings"].map(|end| format!("/v1/results/{key}{end}")));
    }
    for job in get("/v1/jobs?limit=200").await["jobs"].as_array().unwrap() {
        let id = job["id"].as_str().unwrap();
        targets.push(format!("/v1/jobs/{id}?include=scenario,submitted"));
        targets.push(format!("/v1/jobs/{id}/events"));
    }
    targets
}

/// The offsets of the pages that contain bodies of results, and of all other pages in use.
async fn pages(dir: &Path) -> [Vec<u64>; 2] {
    let mut db = raw(dir).await;
    let pages =
        "SELECT (pageno - 1) * 4096 FROM dbstat WHERE (name = 'result_blob') = ?1 ORDER BY 1";
    let mut found = [Vec::new(), Vec::new()];
    for (place, of_bodies) in [true, false].into_iter().enumerate() {
        let offsets: Vec<i64> =
            sqlx::query_scalar(pages).bind(of_bodies).fetch_all(&mut db).await.unwrap();
        found[place] = offsets.into_iter().map(i64::unsigned_abs).collect();
    }
    db.close().await.unwrap();
    found
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The first line that names a row, or else one that names a table, or the schema.
fn naming_line(said: &str) -> Option<&str> {
    // The last one if the header of the file is changed.
    let names =
        |line: &&str| line.starts_with("damaged: ") || line.ends_with("file is not a database");
    let of_row = |line: &&str| {
        let place = line.strip_prefix("damaged: ").and_then(|damage| damage.split_once(": "));
        place.is_some_and(|(place, _)| place.contains(' '))
    };
    said.lines().find(of_row).or_else(|| said.lines().find(names))
}

/// This takes more than 5 s, because it checks a database after each flipped bit.
#[tokio::test(flavor = "multi_thread")]
async fn every_flipped_bit_that_changes_an_answer_is_found() {
    let library = library().await;
    let words = |dir: &Path| ["check", "--data-dir", dir.to_str().unwrap()].map(str::to_owned);
    let check = |dir: &Path| run(&words(dir).each_ref().map(String::as_str), "");
    let sound = copy(library.path());
    let output = check(sound.path());
    assert!(output.status.success(), "{}", said(&output));
    let mut targets = Vec::new();
    let expected = answers(sound.path(), &mut targets).await;
    assert!(expected.len() > 100 && answers(sound.path(), &mut targets).await == expected);
    let flips = if env::var_os("FRETWORK_TEST_LONG").is_some() { 100 } else { 10 };
    let mut dice = Dice(env::var("FRETWORK_TEST_SEED").map_or(1, |seed| seed.parse().unwrap()));
    for (kind, pages) in ["bodies", "metadata"].iter().zip(pages(library.path()).await) {
        let (mut changed, mut named, mut found) = (0, 0, 0);
        for _ in 0..flips {
            let dir = copy(library.path());
            let page = pages[dice.below(pages.len() as u64) as usize];
            let (place, bit) = (page + dice.below(4096), dice.below(8));
            let file =
                fs::File::options().read(true).write(true).open(dir.path().join("fretwork.db"));
            let (file, mut byte) = (file.unwrap(), [0]);
            file.read_exact_at(&mut byte, place).unwrap();
            file.write_all_at(&[byte[0] ^ 1 << bit], place).unwrap();
            let output = check(dir.path());
            let differs = answers(dir.path(), &mut targets).await != expected;
            let is_found = !output.status.success();
            changed += u32::from(differs);
            found += u32::from(is_found);
            named += u32::from(differs && is_found);
            let said = said(&output);
            if differs {
                let named = naming_line(&said).unwrap_or("not named");
                println!("{kind}, byte {place}, bit {bit}: {named}");
                let what = format!("{kind}, byte {place}, bit {bit} changed an answer: {said}");
                assert!(is_found && naming_line(&said).is_some(), "{what}");
                assert!(output.status.code() == Some(2) || said.contains("is not a database"));
            }
        }
        println!(
            "{kind}: {flips} flipped bits, {found} found; {changed} changed answers, {named} of them found"
        );
    }
}

#[tokio::test]
async fn the_report_of_a_changed_bit_in_the_schema_names_the_index() {
    let dir = copy(library().await.path());
    let file = dir.path().join("fretwork.db");
    let mut bytes = fs::read(&file).unwrap();
    let statement = b"CREATE INDEX job_key ON";
    // A migration that has changed the schema may have left another copy in an unused place.
    let places = bytes.windows(statement.len()).enumerate();
    let places: Vec<_> = places.filter(|(_, found)| found == statement).map(|(at, _)| at).collect();
    assert!(!places.is_empty());
    for at in places {
        bytes[at + statement.len() - 1] ^= 1;
    }
    fs::write(&file, bytes).unwrap();
    let output = run(&["check", "--data-dir", dir.path().to_str().unwrap()], "");
    assert_eq!(output.status.code(), Some(2));
    let said = said(&output);
    assert!(said.starts_with("damaged: sqlite_schema job_key: "), "{said}");
    assert!(output.stdout.ends_with(b"cannot be counted; damage in 1 place\n"));
    // The server names the index too.
    let refused = Store::open(dir.path().into(), &Options::default()).await.unwrap_err();
    assert!(refused.source().unwrap().to_string().contains("job_key"), "{refused:?}");
}

#[tokio::test]
async fn the_report_of_a_damaged_page_names_the_table() {
    let library = library().await;
    let mut db = raw(library.path()).await;
    let query = "SELECT pgoffset FROM dbstat WHERE name = 'result' AND pagetype = 'leaf' LIMIT 1";
    let page: i64 = sqlx::query_scalar(query).fetch_one(&mut db).await.unwrap();
    db.close().await.unwrap();
    let file = fs::File::options().write(true).open(library.path().join("fretwork.db")).unwrap();
    // The first byte of a page is its kind. No kind is 0.
    file.write_all_at(&[0], page.unsigned_abs()).unwrap();
    let damage = check(library.path()).await.unwrap().damage;
    assert!(damage.iter().any(|damage| damage.table == "result"), "{damage:?}");
}

#[tokio::test]
async fn the_report_of_a_changed_key_names_a_row() {
    let dir = library().await;
    let mut db = raw(dir.path()).await;
    let query = "SELECT key FROM result ORDER BY key LIMIT 4 OFFSET 3";
    let keys: Vec<Vec<u8>> = sqlx::query_scalar(query).fetch_all(&mut db).await.unwrap();
    let query = "SELECT pgoffset FROM dbstat WHERE name = 'result' AND pagetype = 'leaf'";
    let pages: Vec<i64> = sqlx::query_scalar(query).fetch_all(&mut db).await.unwrap();
    db.close().await.unwrap();
    let file = dir.path().join("fretwork.db");
    let mut bytes = fs::read(&file).unwrap();
    // A key can be in another page, above the leaves.
    let at = pages.iter().find_map(|page| {
        let page = page.unsigned_abs() as usize;
        let is_key = |found: &[u8]| keys.iter().any(|key| found == key);
        let found = bytes[page..page + 4096].windows(32).position(is_key);
        found.map(|place| page + place)
    });
    bytes[at.expect("a key in a page")] ^= 0x80;
    fs::write(&file, bytes).unwrap();
    let damage = check(dir.path()).await.unwrap().damage;
    assert!(
        damage.iter().any(|damage| damage.table == "result" && damage.row.is_some()),
        "{damage:?}"
    );
}

#[tokio::test]
async fn a_changed_column_is_reported_and_prevents_a_backup() {
    let library = library().await;
    for (statement, expected) in [
        (
            "UPDATE outline SET wear_volume = wear_volume * 1.0000001 WHERE id = 3",
            "wear_volume contradicts the body",
        ),
        ("UPDATE outline SET owner = 'eve' WHERE id = 3", "owner contradicts other rows"),
        ("UPDATE outline SET regime = 'full_stick' WHERE id = 3", "regime contradicts the body"),
        ("UPDATE result SET size = size + 1 WHERE evicted IS NULL", "size contradicts the body"),
        (
            "UPDATE result SET summary = replace(summary, '3', '2') WHERE evicted IS NULL",
            "summary contradicts",
        ),
        ("UPDATE job SET started = started + 1", "started contradicts changes"),
        ("UPDATE job SET attempt = attempt + 1", "attempt contradicts changes"),
        ("UPDATE job SET tags = '[\"other\"]'", "tags contradicts other rows"),
        ("DELETE FROM job_tag WHERE tag = 'tag-1'", "tags contradicts other rows"),
        ("UPDATE result_task SET task = replace(task, '0.7', '0.6')", "task does not give the key"),
        ("UPDATE job SET finished = finished + 1", "finished contradicts changes"),
        (
            "UPDATE _sqlx_migrations SET checksum = x'00' WHERE version = 7",
            "the record is changed or missing",
        ),
        (
            "UPDATE job SET submitted = replace(submitted, 'e', 'f')",
            "submitted or submitted_sum is changed",
        ),
        ("UPDATE room SET used = used + 1", "used contradicts other rows"),
    ] {
        let dir = copy(library.path());
        let mut db = raw(dir.path()).await;
        db.execute("PRAGMA foreign_keys = OFF").await.unwrap();
        db.execute(statement).await.unwrap();
        db.close().await.unwrap();
        let damage = check(dir.path()).await.unwrap().damage;
        assert!(
            damage.iter().any(|damage| damage.what.contains(expected)),
            "{statement}: {damage:?}"
        );
        let target = dir.path().join("backup.db");
        let refused = backup(dir.path(), &target).await;
        assert!(matches!(refused, Err(Moving::Damaged { .. })), "{statement}: {refused:?}");
        assert!(refused.unwrap_err().to_string().contains(expected) && !target.exists());
    }
}

/// Rows that contradict a body, with and without their indexes. What follows from no body stays as it is.
#[tokio::test(flavor = "multi_thread")]
async fn a_repair_writes_what_follows_from_a_sound_body_and_nothing_else() {
    let library = library().await;
    let mut targets = Vec::new();
    let expected = answers(copy(library.path()).path(), &mut targets).await;
    let held = "key IN (SELECT key FROM result_blob)";
    let derived = [
        format!("UPDATE result SET size = size + 1, summary = '{{}}' WHERE {held}"),
        format!("UPDATE result SET digest = x'{}' WHERE {held}", "00".repeat(32)),
        format!("UPDATE result_task SET task = replace(task, '0.7', '0.6') WHERE {held}"),
        "UPDATE outline SET wear_volume = wear_volume * 1.0000001, regime = 'full_stick', size = 7 WHERE present".to_owned(),
    ];
    let unchanged = "UPDATE note SET owner = 'eve'; UPDATE job SET attempt = attempt + 1";
    let changed = async |statement: &str| {
        let dir = copy(library.path());
        let mut db = raw(dir.path()).await;
        db.execute("PRAGMA foreign_keys = OFF").await.unwrap();
        db.execute(AssertSqlSafe(statement.to_owned())).await.unwrap();
        db.close().await.unwrap();
        dir
    };
    for statement in &derived {
        let dir = changed(statement).await;
        let before = fs::read(dir.path().join("fretwork.db")).unwrap();
        assert!(!check(dir.path()).await.unwrap().damage.is_empty(), "{statement}");
        let Repaired { copy, damage } = repair(dir.path()).await.unwrap();
        assert!(damage.len() >= 10, "{statement}: {damage:?}");
        assert!(fs::read(copy.unwrap()).unwrap() == before, "the copy is the database as it was");
        assert_eq!(check(dir.path()).await.unwrap().damage, [], "{statement}");
        assert!(answers(dir.path(), &mut targets).await == expected, "{statement}");
    }
    let whole = repair(copy(library.path()).path()).await.unwrap();
    assert_eq!(whole, Repaired { copy: None, damage: Vec::new() });
    let dir = changed(unchanged).await;
    let damage = check(dir.path()).await.unwrap().damage;
    assert_eq!(repair(dir.path()).await.unwrap().damage, []);
    assert_eq!(check(dir.path()).await.unwrap().damage, damage);
    assert_eq!(repair(dir.path()).await.unwrap().copy, None, "nothing was written");
    // A missing row is not written.
    let dir = changed("DELETE FROM outline WHERE id = (SELECT min(id) FROM outline)").await;
    assert_eq!(check(dir.path()).await.unwrap().damage.len(), 1);
    assert_eq!(repair(dir.path()).await.unwrap(), Repaired { copy: None, damage: Vec::new() });
    // A body whose checksum is wrong proves nothing.
    let dir = changed("UPDATE result SET checksum = checksum + 1, size = size + 1").await;
    assert_eq!(repair(dir.path()).await.unwrap().damage, []);

    let dir = changed(&derived[3]).await;
    let words = ["check", "--repair", "--data-dir", dir.path().to_str().unwrap()];
    let store = Store::open(dir.path().into(), &Options::default()).await.unwrap();
    let refused = run(&words, "");
    assert_eq!(refused.status.code(), Some(1));
    assert!(said(&refused).contains("another server"), "{}", said(&refused));
    store.close().await;
    let output = run(&words, "");
    let told = said(&output);
    assert!(output.status.success() && told.contains("repaired: outline "), "{told}");
    assert!(told.contains("the database as it was: ") && !told.contains("damaged: "), "{told}");
}

/// A row whose index has the right value, as after a flipped bit.
#[tokio::test]
async fn a_repair_makes_a_row_equal_to_its_index() {
    let dir = library().await;
    let file = dir.path().join("fretwork.db");
    let mut db = raw(dir.path()).await;
    let (id, volume): (i64, f64) = sqlx::query_as(
        "SELECT id, wear_volume FROM outline WHERE present AND wear_volume > 0 LIMIT 1",
    )
    .fetch_one(&mut db)
    .await
    .unwrap();
    let pages: Vec<i64> = sqlx::query_scalar(
        "SELECT pgoffset FROM dbstat WHERE name = 'outline' AND pagetype = 'leaf'",
    )
    .fetch_all(&mut db)
    .await
    .unwrap();
    db.close().await.unwrap();
    let mut bytes = fs::read(&file).unwrap();
    let value = volume.to_be_bytes();
    let mut changed = 0;
    for page in pages {
        let page = &mut bytes[page.unsigned_abs() as usize..][..4096];
        while let Some(at) = page.windows(8).position(|found| found == value) {
            page[at + 2] ^= 1;
            changed += 1;
        }
    }
    assert!(changed > 0, "outline {id} has a volume");
    fs::write(&file, bytes).unwrap();
    assert!(!check(dir.path()).await.unwrap().damage.is_empty());
    assert_eq!(repair(dir.path()).await.unwrap().damage.len(), changed);
    assert_eq!(check(dir.path()).await.unwrap().damage, []);
}

#[tokio::test]
async fn the_report_of_a_changed_index_names_the_row_and_the_index() {
    let library = library().await;
    for (table, index, column, change) in [
        ("job", "job_copy", "priority", "5"),
        ("result", "result_copy", "wall", "7.5"),
        ("result", "result_evicted_copy", "summary", "'{}'"),
        ("note", "note_copy", "text", "'Agrees with nothing.'"),
        ("outline", "outline_absent_copy", "regime", "'full_stick'"),
        ("job", "job_owner", "owner", "'eve'"),
    ] {
        let dir = copy(library.path());
        let mut db = raw(dir.path()).await;
        // While the statement of the index is not in the schema, SQLite does not update the index with the table.
        let hide = format!(
            "PRAGMA writable_schema = ON; CREATE TEMP TABLE held AS SELECT * FROM sqlite_schema WHERE name = '{index}';
             DELETE FROM sqlite_schema WHERE name = '{index}'; PRAGMA writable_schema = RESET"
        );
        db.execute(AssertSqlSafe(hide)).await.unwrap();
        let filter = if index.contains("absent") { "NOT present" } else { "TRUE" };
        let change = format!(
            "UPDATE {table} SET {column} = {change} WHERE {filter} AND {column} IS NOT {change};
             PRAGMA writable_schema = ON; INSERT INTO sqlite_schema SELECT * FROM temp.held;
             PRAGMA writable_schema = RESET"
        );
        db.execute(AssertSqlSafe(change)).await.unwrap();
        db.close().await.unwrap();
        let damage = check(dir.path()).await.unwrap().damage;
        let what = format!("missing from index {index}");
        let named =
            damage.iter().find(|damage| damage.table == table && damage.what.ends_with(&what));
        assert!(named.is_some_and(|it| it.row.is_some()), "{what}: {damage:?}");
    }
}
