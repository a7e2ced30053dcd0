//! Labels, tags, notes and jobs that all users see, and private ones that their owner alone sees.

use fretwork::http::Limits;
use fretwork_job::{JobId, Naming};
use fretwork_store::{
    Administration, Annotated, Annotator, Filter, NewJob, NewKey, Note, Place, Repeatable, Role,
    Search, Store, Submitted,
};
use serde_json::{Value, json};
use sqlx::Executor as _;

use crate::access::{MASTER, ask, get, link, made, made_with, operations_on, server};
use crate::database::{Database, Engine};
use crate::listing::{self, annotator, found, reach, rows};
use crate::program::{run, text};
use crate::server::{JSON, Server, ball};
use crate::store::{accepted, answer, claim, key, new_job, raw};

on_both! {
    a_note_of_somebody_else_is_replaced_only_by_whoever_has_read_it,
    a_private_note_stands_beside_the_note_of_all,
    earlier_names_stay_private_until_they_are_shared,
    names_are_given_to_another_owner,
    privacy_changes_with_its_job,
}

/// A job of an owner with a label and a tag, and its result.
async fn named(store: &Store, owner: &str, number: u8, label: &str) -> JobId {
    let new = NewJob {
        owner: owner.into(),
        label: Some(label.into()),
        tags: vec![format!("tag-{label}")],
        ..new_job(number)
    };
    let id = accepted(store.submit(new).await).id;
    let claimed = claim(store).await;
    store.finish(&claimed, &answer("a"), fretwork_job::Cost::default()).await.unwrap();
    id
}

async fn note(store: &Store, number: u8, reader: &str) -> Option<Note> {
    store.provenance(&key(number), reader).await.unwrap().unwrap().note
}

async fn a_note_of_somebody_else_is_replaced_only_by_whoever_has_read_it(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    named(&store, "ada", 1, "one").await;
    let write = async |text: Option<&str>, by: Annotator| {
        store.annotate(key(1), text.map(str::to_owned), by).await.unwrap()
    };
    let having_read = |name: &str, note: &Option<Note>| {
        let read = note.as_ref().map(|note| vec!["\"0\"".to_owned(), note.tag()]);
        Annotator { read, ..annotator(name) }
    };
    assert_eq!(write(Some("first"), annotator("ada")).await, Annotated::Done);
    assert_eq!(write(Some("second"), annotator("ada")).await, Annotated::Done);
    let seen = note(&store, 1, "bob").await;
    assert_eq!(seen.as_ref().map(|note| (&*note.text, &*note.owner)), Some(("second", "ada")));
    // Bob has not read it.
    for text in [Some("bob's"), None] {
        assert_eq!(write(text, annotator("bob")).await, Annotated::Unread(seen.clone()));
    }
    assert_eq!(write(Some("bob's"), having_read("bob", &seen)).await, Annotated::Done);
    // Ada has read an earlier one, or none.
    let present = note(&store, 1, "ada").await;
    assert_eq!(present.as_ref().map(|note| &*note.owner), Some("bob"));
    for by in [having_read("ada", &seen), annotator("ada")] {
        assert_eq!(write(Some("third"), by.clone()).await, Annotated::Unread(present.clone()));
        assert_eq!(write(None, by).await, Annotated::Unread(present.clone()));
    }
    let any = Annotator { read: Some(vec!["*".to_owned()]), ..annotator("ada") };
    assert_eq!(write(None, any.clone()).await, Annotated::Done);
    assert_eq!(write(Some("third"), any).await, Annotated::Unread(None));
    assert_eq!(write(None, annotator("ada")).await, Annotated::Done, "there is none");
    // Without a key, everybody may replace every note.
    write(Some("fourth"), annotator("ada")).await;
    let mut open = annotator("127.0.0.1");
    open.by.key.clear();
    assert_eq!(write(Some("fifth"), open).await, Annotated::Done);
    let unknown = store.annotate(key(9), None, annotator("ada")).await.unwrap();
    assert_eq!(unknown, Annotated::NotFound);
    // Of two users who have read the same note, one replaces it.
    let seen = note(&store, 1, "ada").await;
    let (one, other) = tokio::join!(
        write(Some("ada's"), having_read("ada", &seen)),
        write(Some("bob's"), having_read("bob", &seen))
    );
    assert_eq!([&one, &other].iter().filter(|done| ***done == Annotated::Done).count(), 1);
}

async fn a_private_note_stands_beside_the_note_of_all(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    named(&store, "ada", 1, "one").await;
    let private = |name: &str| Annotator { private: true, ..annotator(name) };
    let write = async |text: Option<&str>, by: Annotator| {
        store.annotate(key(1), text.map(str::to_owned), by).await.unwrap()
    };
    let texts = async || {
        let mut texts = Vec::new();
        for reader in ["ada", "bob", "carl", ""] {
            texts.push(note(&store, 1, reader).await.map(|note| (note.text, note.private)));
        }
        texts
    };
    let shows = |text: &str, private| Some((text.to_owned(), private));
    write(Some("secret gear"), private("ada")).await;
    write(Some("secret oil"), private("carl")).await;
    assert_eq!(texts().await, [shows("secret gear", true), None, shows("secret oil", true), None]);
    // Bob's note is refused by none that he cannot see.
    assert_eq!(write(Some("open gear"), annotator("bob")).await, Annotated::Done);
    let all = shows("open gear", false);
    assert_eq!(
        texts().await,
        [shows("secret gear", true), all.clone(), shows("secret oil", true), all.clone()]
    );
    for (words, reader, results) in [
        ("secret", Some("ada"), vec![1]),
        ("secret", Some("bob"), vec![]),
        ("secret", None, vec![]),
        ("oil", Some("ada"), vec![]),
        ("open", Some("ada"), vec![1]),
        ("tag-one secret", Some("bob"), vec![]),
        ("tag-one secret", Some("ada"), vec![1]),
    ] {
        assert_eq!(found(&store, words, reader).await.1, results, "{words} {reader:?}");
        let mut search = Search::within(reach(reader));
        search.set("note", words).unwrap();
        let listed = store.search(&search, None, 10).await.unwrap().results;
        assert_eq!(listed.len() as u64, store.count(&search).await.unwrap());
        let has_note = words != "tag-one secret";
        assert_eq!(listed.len(), if has_note { results.len() } else { 0 }, "{words} {reader:?}");
        assert!(listed.iter().all(|entry| entry.note.is_some()), "{words}");
    }
    // With another key, its owner goes on with the private note.
    write(Some("secret gear 2"), annotator("ada")).await;
    assert_eq!(write(None, private("carl")).await, Annotated::Done);
    assert_eq!(
        texts().await,
        [shows("secret gear 2", true), all.clone(), all.clone(), all.clone()]
    );
    // A private key deletes the note that it reads, and that of somebody else only after reading it.
    assert!(matches!(write(None, private("carl")).await, Annotated::Unread(Some(_))));
    let before = note(&store, 1, "carl").await.unwrap().tag();
    let read = Annotator { read: Some(vec![before]), ..private("carl") };
    assert_eq!(write(None, read).await, Annotated::Done);
    assert_eq!(write(None, annotator("ada")).await, Annotated::Done);
    assert_eq!(texts().await, [const { None }; 4]);
    // An own note that becomes private is no longer public.
    write(Some("oil"), annotator("carl")).await;
    write(Some("secret oil"), private("carl")).await;
    assert_eq!(texts().await, [None, None, shows("secret oil", true), None]);
}

/// Shares the earlier names of an owner, or gives its names to another one.
async fn passed_on(db: &Database, from: &str, to: Option<&str>) -> u64 {
    let place = match db {
        Database::Sqlite(dir) => Place::from(dir.path()),
        Database::Postgres(_) => Place::Shared(db.url()),
    };
    let mut administration = Administration::open(place).await.unwrap();
    let count = administration.pass_names_on(from, to).await.unwrap();
    administration.close().await.unwrap();
    count
}

async fn earlier_names_stay_private_until_they_are_shared(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    let old = named(&store, "ada", 1, "gear").await;
    let chosen = named(&store, "ada", 2, "gear").await;
    let others = named(&store, "bob", 3, "gear").await;
    // As jobs of an earlier version, and one that ada has made private since.
    db.execute("UPDATE job SET private = 2").await;
    let private = Naming { private: Some(true), ..Naming::default() };
    store.rename(chosen, private, annotator("ada").by).await.unwrap();
    assert_eq!(found(&store, "gear", Some("carl")).await, (vec![], vec![]));
    assert_eq!(found(&store, "gear", Some("bob")).await, (vec![others], vec![3]));
    assert_eq!(found(&store, "gear", None).await, (vec![others, chosen, old], vec![3, 2, 1]));
    assert!(store.job(old).await.unwrap().unwrap().private);
    assert_eq!(passed_on(&db, "ada", None).await, 1);
    assert_eq!(found(&store, "gear", Some("carl")).await, (vec![old], vec![1]));
    assert_eq!(passed_on(&db, "ada", None).await, 0);
    assert_eq!(passed_on(&db, "nobody", None).await, 0);
    assert_eq!(found(&store, "gear", Some("ada")).await.0, [chosen, old]);
}

async fn names_are_given_to_another_owner(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    let before = named(&store, "127.0.0.1", 1, "gear").await;
    db.execute("UPDATE job SET private = 2").await;
    store.annotate(key(1), Some("worn".into()), annotator("127.0.0.1")).await.unwrap();
    // Both owners have used the same idempotency key.
    let repeatable = |owner: &str, number| NewJob {
        owner: owner.into(),
        repeatable: Some(Repeatable { key: "a".into(), fingerprint: vec![1] }),
        ..new_job(number)
    };
    let repeated = accepted(store.submit(repeatable("127.0.0.1", 1)).await).id;
    let anna = accepted(store.submit(repeatable("anna", 1)).await).id;
    // A job that waits stays with its owner.
    let waiting = accepted(store.submit(repeatable("10.0.0.1", 7)).await).id;
    assert_eq!(passed_on(&db, "10.0.0.1", Some("anna")).await, 0);
    assert_eq!(passed_on(&db, "127.0.0.1", Some("anna")).await, 3, "two jobs and a note");
    assert_eq!(passed_on(&db, "anna", Some("anna")).await, 0);
    for (id, owner) in [(before, "anna"), (repeated, "anna"), (anna, "anna"), (waiting, "10.0.0.1")]
    {
        assert_eq!(store.job(id).await.unwrap().unwrap().owner, owner);
    }
    assert_eq!(note(&store, 1, "bob").await.unwrap().owner, "anna");
    // Her own repetition is still found, and the name stays private until it is shared.
    let again = store.submit(repeatable("anna", 1)).await.unwrap();
    assert!(matches!(again, Submitted::Repeated(job) if job.id == anna));
    assert_eq!(found(&store, "gear", Some("bob")).await.0, []);
    assert_eq!(found(&store, "gear", Some("anna")).await.0, [before]);
    assert_eq!(passed_on(&db, "anna", None).await, 1);
    assert_eq!(found(&store, "gear", Some("bob")).await.0, [before]);
}

async fn privacy_changes_with_its_job(on: Engine) {
    let (db, store) = Database::fresh(on).await;
    let shared = named(&store, "ada", 1, "gear").await;
    let listed = async |who: &str| {
        let filter = Filter { reach: reach(Some(who)), ..Filter::default() };
        store.count_jobs(&filter).await.unwrap()
    };
    for (private, count) in [(None, 1), (Some(true), 0), (None, 0), (Some(false), 1)] {
        let naming = Naming { private, ..Naming::default() };
        let job = store.rename(shared, naming, annotator("ada").by).await.unwrap().unwrap();
        assert_eq!(job.private, count == 0);
        assert_eq!((listed("ada").await, listed("bob").await), (1, count));
        assert_eq!(found(&store, "gear", Some("bob")).await.0.len() as u64, count);
    }
    assert_eq!(db.count("SELECT private FROM job").await, 0);
}

/// Submits a ball with a label and a tag, and more members; returns the finished job.
async fn submitted(server: &Server, key: &str, amplitude: f64, label: &str, more: Value) -> Value {
    let mut body = ball(amplitude);
    body["label"] = json!(label);
    body["tags"] = json!([format!("tag-{label}")]);
    for (name, value) in more.as_object().unwrap() {
        body[name] = value.clone();
    }
    let job = ask(server, key, "POST", "/v1/jobs", &body.to_string()).await.json();
    assert_eq!(job["state"], "succeeded", "{job}");
    job
}

async fn private_key(server: &Server, name: &str) -> String {
    let role = Role::Submit;
    let new = NewKey { name: name.into(), role, per_minute: None, expires: None, private: true };
    made_with(server.place(), new).await
}

/// The number of jobs and of results that a search lists. Both have the same total.
async fn counts(server: &Server, key: &str, query: &str) -> [usize; 2] {
    let mut counts = [0; 2];
    for (count, list) in counts.iter_mut().zip(["jobs", "results"]) {
        let target = format!("/v1/{list}?{query}&count=true");
        let answer = get(server, key, &target).await.json();
        *count = answer[list].as_array().unwrap_or_else(|| panic!("{target}: {answer}")).len();
        assert_eq!(answer["total"], *count, "{target}");
        let csv = get(server, key, &format!("/v1/{list}?{query}&format=csv&comments=none")).await;
        assert_eq!(rows(&listing::text(&csv)).len(), *count + 1, "{target}");
    }
    counts
}

#[tokio::test(flavor = "multi_thread")]
async fn a_colleague_finds_and_tags_a_run_by_its_names() {
    let server = server(Limits::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let ben = made(server.place(), "ben", Role::Submit).await;
    let reader = made(server.place(), "rita", Role::Read).await;
    let job = submitted(&server, &anna, 1.0, "gear-box", json!({})).await;
    let hidden = submitted(&server, &anna, 2.0, "gear-rim", json!({"private": true})).await;
    assert_eq!((&job["private"], &hidden["private"]), (&json!(false), &json!(true)));
    let [id, key] = ["id", "key"].map(|name| job[name].as_str().unwrap());
    let (own, result) = (format!("/v1/jobs/{id}"), format!("/v1/results/{key}"));
    let body = json!({"text": "Agrees with the shaft."}).to_string();
    assert_eq!(ask(&server, &anna, "PUT", &format!("{result}/note"), &body).await.status, 204);
    for (query, who, expected) in [
        ("q=gear", &anna, [2, 2]),
        ("q=gear", &ben, [1, 1]),
        ("q=GEAR%20shaft%20tag", &reader, [1, 1]),
        ("q=rim", &ben, [0, 0]),
        ("q=shaft", &ben, [1, 1]),
        ("tag=tag-gear-box", &ben, [1, 1]),
        ("tag=tag-gear-rim", &ben, [0, 0]),
        ("label=gear-box", &reader, [1, 1]),
        ("label=gear-rim", &reader, [0, 0]),
    ] {
        assert_eq!(counts(&server, who, query).await, expected, "{query}");
    }
    assert_eq!(counts(&server, MASTER, "q=gear").await, [2, 2]);
    let jobs = get(&server, &ben, "/v1/jobs?owner=anna").await.json();
    assert_eq!(
        (jobs["jobs"].as_array().unwrap().len(), &jobs["jobs"][0]["owner"]),
        (1, &json!("anna"))
    );
    let entry = get(&server, &ben, "/v1/results?q=box").await.json()["results"][0].clone();
    assert_eq!((&entry["submitted_by"], &entry["label"]), (&json!("anna"), &json!("gear-box")));
    let report = get(&server, &ben, &format!("{result}/report")).await;
    assert!(report.text().contains("gear-box"));

    // Ben adds a tag. Renaming, hiding, canceling and deleting stay with anna, and so does what she typed.
    let patch =
        async |key: &str, body: Value| ask(&server, key, "PATCH", &own, &body.to_string()).await;
    let tagged = patch(&ben, json!({"tags": ["tag-gear-box", "ben-1"]})).await;
    assert_eq!((tagged.status, &tagged.json()["owner"]), (200, &json!("anna")));
    assert_eq!(counts(&server, &anna, "q=ben-1%20box").await, [1, 1]);
    patch(&reader, json!({"tags": []})).await.problem(403, "forbidden");
    for body in [
        json!({"label": "mine"}),
        json!({"label": null}),
        json!({"private": true}),
        json!({"tags": [], "private": false}),
    ] {
        patch(&ben, body).await.problem(403, "other-owner");
    }
    for (method, target) in [("POST", format!("{own}/cancel")), ("DELETE", own.clone())] {
        ask(&server, &ben, method, &target, "").await.problem(403, "other-owner");
    }
    for (key, is_shown) in [(&ben, false), (&reader, false), (&anna, true)] {
        let shown = get(&server, key, &format!("{own}?include=submitted,scenario")).await.json();
        assert_eq!(
            (shown["submitted"].is_object(), shown["scenario"].is_object()),
            (is_shown, true)
        );
    }
    let log = get(&server, MASTER, "/v1/audit").await.json();
    let renamed =
        log["entries"].as_array().unwrap().iter().find(|entry| entry["act"] == "rename_job");
    let renamed = renamed.expect("an entry");
    assert_eq!(
        (&renamed["actor"], &renamed["subject"], &renamed["owner"], &renamed["times"]),
        (&json!("ben"), &Value::Null, &json!("anna"), &json!(1))
    );
    assert_eq!(patch(&anna, json!({"label": "gear-hub", "private": true})).await.status, 200);
    get(&server, &ben, &own).await.problem(404, "not-found");
    patch(&ben, json!({"tags": []})).await.problem(404, "not-found");
    assert_eq!(get(&server, &anna, &own).await.json()["tags"], json!(["tag-gear-box", "ben-1"]));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_note_says_who_changed_it() {
    let server = server(Limits::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let ben = made(server.place(), "ben", Role::Submit).await;
    let job = submitted(&server, &anna, 1.0, "gear", json!({})).await;
    let at = format!("{}/note", job["links"]["result"].as_str().unwrap());
    let write = async |key: &str, text: &str, etag: Option<&Value>| {
        let bearer = format!("Bearer {key}");
        let mut headers = vec![JSON, ("Authorization", &*bearer)];
        headers.extend(etag.map(|etag| ("If-Match", etag.as_str().unwrap())));
        server.send("PUT", &at, &headers, json!({ "text": text }).to_string()).await
    };
    assert_eq!(write(&anna, "First.", None).await.status, 204);
    let read = get(&server, &ben, &at).await;
    let first = read.json();
    assert_eq!(read.header("etag"), first["etag"].as_str());
    assert_eq!((&first["owner"], &first["private"]), (&json!("anna"), &json!(false)));
    let refused = write(&ben, "Mine.", None).await.problem(412, "note-changed");
    assert!(refused["detail"].as_str().unwrap().contains("\"anna\""), "{refused}");
    assert_eq!(write(&ben, "Both.", Some(&first["etag"])).await.status, 204);
    let refused = write(&anna, "Again.", Some(&first["etag"])).await.problem(412, "note-changed");
    assert!(refused["detail"].as_str().unwrap().contains("\"ben\""), "{refused}");
    // An administrator may do more, but not replace a note unread either.
    write(MASTER, "Chief.", None).await.problem(412, "note-changed");
    ask(&server, MASTER, "DELETE", &at, "").await.problem(412, "note-changed");
    let present = get(&server, MASTER, &at).await.json();
    assert_eq!((&present["text"], &present["owner"]), (&json!("Both."), &json!("ben")));
    let entry = get(&server, &anna, "/v1/results").await.json()["results"][0].clone();
    assert_eq!(entry["note"], present);
    assert_eq!(ask(&server, &ben, "DELETE", &at, "").await.status, 204);
    get(&server, &ben, &at).await.problem(404, "not-found");
    write(&anna, "Late.", Some(&first["etag"])).await.problem(412, "note-changed");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_private_key_keeps_the_names_of_its_owner() {
    let server = server(Limits::default()).await;
    let (pia, ben) =
        (private_key(&server, "pia").await, made(server.place(), "ben", Role::Submit).await);
    assert_eq!(get(&server, &pia, "/v1/me").await.json()["private"], true);
    let keys = get(&server, MASTER, "/v1/keys").await.json();
    let private: Vec<_> =
        keys["keys"].as_array().unwrap().iter().map(|key| &key["private"]).collect();
    assert_eq!(private, [&json!(true), &json!(false)]);
    let hidden = submitted(&server, &pia, 1.0, "gear-a", json!({})).await;
    let open = submitted(&server, &pia, 2.0, "gear-b", json!({"private": false})).await;
    assert_eq!((&hidden["private"], &open["private"]), (&json!(true), &json!(false)));
    assert_eq!(counts(&server, &ben, "q=gear").await, [1, 1]);
    let at = format!("{}/note", open["links"]["result"].as_str().unwrap());
    let note = |text: &str| json!({ "text": text }).to_string();
    assert_eq!(ask(&server, &pia, "PUT", &at, &note("Secret.")).await.status, 204);
    get(&server, &ben, &at).await.problem(404, "not-found");
    assert_eq!(ask(&server, &ben, "PUT", &at, &note("Open.")).await.status, 204);
    assert_eq!(get(&server, &ben, &at).await.json()["text"], "Open.");
    let own = get(&server, &pia, &at).await.json();
    assert_eq!((&own["text"], &own["private"]), (&json!("Secret."), &json!(true)));
    // Revoked and made again, the name stays one owner.
    Administration::open(server.place()).await.unwrap().revoke_keys("pia").await.unwrap();
    let again = made(server.place(), "pia", Role::Submit).await;
    assert_eq!(counts(&server, &again, "q=gear").await, [2, 2]);
    assert_eq!(get(&server, &again, &at).await.json()["text"], "Secret.");
}

#[tokio::test(flavor = "multi_thread")]
async fn no_role_and_no_route_shows_private_names_of_others() {
    const SECRETS: [&str; 3] = ["hidden-label", "hidden-tag", "hidden-note"];
    let server = server(Limits::default()).await;
    let pia = private_key(&server, "pia").await;
    let more = json!({"tags": ["hidden-tag"]});
    let job = submitted(&server, &pia, 1.0, "hidden-label", more).await;
    let [id, key] = ["id", "key"].map(|name| job[name].as_str().unwrap().to_owned());
    let result = format!("/v1/results/{key}");
    let note = json!({"text": "hidden-note"}).to_string();
    assert_eq!(ask(&server, &pia, "PUT", &format!("{result}/note"), &note).await.status, 204);
    let own = get(&server, &pia, &format!("{result}/about")).await.text().to_owned();
    assert!(SECRETS.iter().all(|secret| own.contains(secret)), "{own}");
    let token = link(&server, &pia, &result, "").await;
    let reader = made(server.place(), "rita", Role::Read).await;
    let ben = made(server.place(), "ben", Role::Submit).await;
    let mut operations = operations_on(&id, &key);
    let queries = SECRETS.iter().flat_map(|secret| {
        ["q", "label", "tag", "note"].map(|name| format!("/v1/results?{name}={secret}&count=true"))
    });
    let jobs = SECRETS.iter().flat_map(|secret| {
        ["q", "label", "tag"].map(|name| format!("/v1/jobs?{name}={secret}&count=true"))
    });
    let found: Vec<_> = queries.chain(jobs).collect();
    operations.extend(found.iter().map(|target| ("GET".to_owned(), target.clone())));
    for more in ["?include=submitted,scenario,result", "?wait=0.1"] {
        operations.push(("GET".to_owned(), format!("/v1/jobs/{id}{more}")));
    }
    operations.push(("GET".to_owned(), format!("{result}/report?job={id}")));
    operations.push(("POST".to_owned(), "/v1/jobs/cancel?label=hidden-label".to_owned()));
    for bearer in [Some(&reader), Some(&ben), None] {
        for (method, target) in &operations {
            // Without a key: with the link, and logged out.
            let with_link =
                format!("{target}{}{token}", if target.contains('?') { '&' } else { '?' });
            let targets = if bearer.is_some() { vec![target] } else { vec![target, &with_link] };
            for asked in targets {
                let reply = match bearer {
                    Some(key) => ask(&server, key, method, asked, "{}").await,
                    None => server.send(method, asked, &[JSON], "{}").await,
                };
                let shown = String::from_utf8_lossy(&reply.body);
                let echoes = asked.contains("hidden-");
                let secrets = SECRETS.iter().filter(|secret| shown.contains(**secret));
                assert!(echoes || secrets.count() == 0, "{method} {asked}: {shown}");
                if asked.starts_with("/v1/jobs/") && asked.contains(&id) && bearer.is_some() {
                    let is_forbidden = bearer == Some(&reader) && method != "GET";
                    assert_eq!(
                        reply.status,
                        if is_forbidden { 403 } else { 404 },
                        "{method} {asked}"
                    );
                }
                if found.contains(asked) && bearer.is_some() {
                    assert_eq!(reply.json()["total"], 0, "{asked}");
                }
            }
        }
    }
    // A link shows no name of anybody, also not a shared one.
    let shared = submitted(&server, &ben, 1.0, "open-label", json!({})).await;
    assert_eq!(shared["key"], key);
    let note = json!({"text": "open-note"}).to_string();
    assert_eq!(ask(&server, &ben, "PUT", &format!("{result}/note"), &note).await.status, 204);
    for (method, target) in operations_on(shared["id"].as_str().unwrap(), &key) {
        let reply = server.send(&method, &format!("{target}?{token}"), &[JSON], "{}").await;
        let shown = String::from_utf8_lossy(&reply.body);
        // The examples of the documents have names, too.
        let is_document = reply.status == 200 && !target.contains(&key);
        for name in ["open-", "ben", "pia", "anna"] {
            assert!(is_document || !shown.contains(name), "{name} in {method} {target}: {shown}");
        }
    }
    // Nothing has changed.
    let after = get(&server, &pia, &format!("/v1/jobs/{id}")).await.json();
    assert_eq!(after, job);
    assert_eq!(get(&server, &pia, &format!("{result}/note")).await.json()["text"], "hidden-note");
}

#[tokio::test(flavor = "multi_thread")]
async fn commands_share_and_give_names() {
    let server = server(Limits::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let ben = made(server.place(), "ben", Role::Submit).await;
    submitted(&server, &anna, 1.0, "gear", json!({})).await;
    let mut db = raw(server.dir.path()).await;
    db.execute("UPDATE job SET private = 2, owner = '10.0.0.7'").await.unwrap();
    let command = |words: &[&str]| {
        let dir = server.dir.path().to_str().unwrap();
        let output = run(&[&["keys"], words, &["--data-dir", dir]].concat(), "");
        assert!(output.status.success(), "{}", text(&output.stderr));
        text(&output.stdout).to_owned()
    };
    assert_eq!(counts(&server, &anna, "label=gear").await, [0, 0]);
    assert_eq!(
        command(&["share-names", "10.0.0.7", "--give-to", "anna"]),
        "jobs and notes of 10.0.0.7 given to anna: 1\n"
    );
    assert_eq!(counts(&server, &anna, "label=gear").await, [1, 1]);
    assert_eq!(counts(&server, &ben, "label=gear").await, [0, 0]);
    assert_eq!(command(&["share-names", "anna"]), "jobs and notes of anna shared: 1\n");
    assert_eq!(counts(&server, &ben, "label=gear").await, [1, 1]);
    command(&["add", "pia", "--role", "submit", "--private"]);
    assert!(
        command(&["list"])
            .lines()
            .any(|line| line.contains("pia") && line.ends_with("valid, private names"))
    );
    let dir = server.dir.path().to_str().unwrap();
    let log = run(&["audit", "--data-dir", dir], "");
    for line in ["share names anna", "give names 10.0.0.7 to anna"] {
        assert!(text(&log.stdout).lines().any(|own| own.ends_with(line)), "{}", text(&log.stdout));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_without_keys_shows_all_names() {
    let server = Server::start().await;
    let mut body = ball(1.0);
    body["label"] = json!("gear");
    body["private"] = json!(true);
    let job = server.compute(&body).await.json();
    let mut db = raw(server.dir.path()).await;
    db.execute("UPDATE job SET owner = '10.0.0.7'; INSERT INTO note SELECT key, 'worn', '10.0.0.7', 1 FROM result").await.unwrap();
    for target in ["/v1/jobs?q=gear", "/v1/results?q=gear", "/v1/results?q=worn"] {
        let found = server.get(target).await.json();
        assert!(found.to_string().contains("\"gear\""), "{target}: {found}");
    }
    let at = format!("{}/note", job["links"]["result"].as_str().unwrap());
    let text = json!({"text": "Mine."}).to_string();
    assert_eq!(server.send("PUT", &at, &[JSON], text).await.status, 204);
    assert_eq!(server.get(&at).await.json()["owner"], "127.0.0.1");
    let own = format!("/v1/jobs/{}", job["id"].as_str().unwrap());
    let named = server.send("PATCH", &own, &[JSON], json!({"label": "hub"}).to_string()).await;
    assert_eq!(named.json()["label"], "hub");
    assert_eq!(server.send("DELETE", &own, &[], "").await.status, 204);
}
