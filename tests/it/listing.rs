//! Labels, tags and words: how users name their jobs and find them again. Lists as CSV.

use std::collections::HashMap;

use fretwork_job::{Cost, JobId, Naming};
use fretwork_store::{Actor, Annotator, Filter, NewJob, Reach, Search, Seen, Store};
use serde_json::{Value, json};

use crate::database::{Database, Engine};
use crate::forms::unpacked;
use crate::server::{JSON, Reply, Server, ball};
use crate::store::{accepted, answer, claim, job, key, new_job};

on_both! {
    every_word_must_occur_in_labels_tags_or_notes,
    a_new_name_replaces_the_label_and_the_tags,
    a_result_is_listed_with_its_latest_label,
    a_submitter_finds_the_results_that_others_computed,
}

/// Submits a private job of ada with this label and these tags, and computes its result.
async fn computed(store: &Store, number: u8, label: &str, tags: &[&str]) -> JobId {
    let tags = tags.iter().map(|tag| String::from(*tag)).collect();
    let named = NewJob { label: Some(label.to_owned()), tags, private: true, ..new_job(number) };
    let id = accepted(store.submit(named).await).id;
    if !job(store, id).await.state.is_finished() {
        let claimed = claim(store).await;
        store.finish(&claimed, &answer("a"), Cost::default()).await.unwrap();
    }
    id
}

/// What an owner sees; for `None`, what an administrator sees.
pub fn reach(owner: Option<&str>) -> Reach {
    let jobs = if owner.is_some() { Seen::Shared } else { Seen::All };
    Reach { owner: owner.unwrap_or("chief").to_owned(), jobs }
}

/// A user who changes notes.
pub fn annotator(name: &str) -> Annotator {
    let by = Actor { name: name.to_owned(), key: format!("key of {name}") };
    Annotator { by, private: false, read: None }
}

/// The ids of the jobs and the keys of the results that have these words. Both lists have the total that is counted.
pub async fn found(store: &Store, words: &str, owner: Option<&str>) -> (Vec<JobId>, Vec<u8>) {
    let filter = Filter { words: words.parse().unwrap(), reach: reach(owner), ..Filter::default() };
    let jobs = store.jobs(&filter, None, 10).await.unwrap().jobs;
    assert_eq!(store.count_jobs(&filter).await.unwrap(), jobs.len() as u64, "{words}");
    let mut search = Search::within(reach(owner));
    search.set("q", words).unwrap();
    let results = store.search(&search, None, 10).await.unwrap().results;
    assert_eq!(store.count(&search).await.unwrap(), results.len() as u64, "{words}");
    let numbers = results.iter().map(|result| result.key.bytes()[0]).collect();
    (jobs.iter().map(|job| job.id).collect(), numbers)
}

async fn every_word_must_occur_in_labels_tags_or_notes(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let first = computed(&store, 1, "Straße ÄRMEL 3.5 µm", &["rig-7"]).await;
    let second = computed(&store, 2, "100% [dry] a*b ^up c\\d", &["Rig-8", "oil"]).await;
    let note = "Agrees with the rig.\nRead twice.".to_owned();
    store.annotate(key(2), Some(note), annotator("ada")).await.unwrap();
    for (words, jobs, results) in [
        ("", vec![second, first], vec![2, 1]),
        ("rig", vec![second, first], vec![2, 1]),
        ("RIG ärmel", vec![first], vec![1]),
        ("rig-8 DRY twice", vec![second], vec![2]),
        ("rig-7 dry", vec![], vec![]),
        ("stra", vec![first], vec![1]),
        ("Μm", vec![first], vec![1]),
        ("3.5", vec![first], vec![1]),
        ("3x5", vec![], vec![]),
        ("100%", vec![second], vec![2]),
        ("%", vec![second], vec![2]),
        ("_", vec![], vec![]),
        ("a*b", vec![second], vec![2]),
        ("a?b", vec![], vec![]),
        ("[dry]", vec![second], vec![2]),
        ("c\\d", vec![second], vec![2]),
        ("^up", vec![second], vec![2]),
        ("^agrees", vec![], vec![]),
        ("\",\"", vec![], vec![]),
        ("8\"", vec![], vec![]),
        (",", vec![], vec![]),
        ("oil twice", vec![second], vec![2]),
    ] {
        assert_eq!(found(&store, words, None).await, (jobs, results), "{words}");
    }
    // Other owners find the result by its note only, and not together with a private tag.
    assert_eq!(found(&store, "twice", Some("bob")).await, (vec![], vec![2]));
    assert_eq!(found(&store, "oil twice", Some("bob")).await, (vec![], vec![]));
    assert_eq!(found(&store, "oil", Some("bob")).await, (vec![], vec![]));
    assert_eq!(found(&store, "oil", Some("ada")).await, (vec![second], vec![2]));
}

async fn a_new_name_replaces_the_label_and_the_tags(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let id = computed(&store, 1, "draft", &["a", "b"]).await;
    let tags = |tags: &[&str]| Some(tags.iter().map(|tag| String::from(*tag)).collect());
    let tagged = async |tag: &str| {
        let filter = Filter { tag: Some(tag.to_owned()), ..Filter::default() };
        store.count_jobs(&filter).await.unwrap()
    };
    let by = || annotator("ada").by;
    let named = |label: Option<Option<&str>>, tags| {
        let label = label.map(|label| label.map(str::to_owned));
        Naming { label, tags, private: None }
    };
    for (naming, label, left) in [
        (named(Some(Some("final")), None), Some("final"), [1, 1, 0]),
        (named(None, tags(&["b", "c", "b"])), Some("final"), [0, 1, 1]),
        (named(Some(None), tags(&[])), None, [0, 0, 0]),
        (Naming::default(), None, [0, 0, 0]),
    ] {
        let renamed = store.rename(id, naming.clone(), by()).await.unwrap().unwrap();
        assert_eq!(renamed, job(&store, id).await);
        assert_eq!(renamed.label.as_deref(), label, "{naming:?}");
        assert_eq!([tagged("a").await, tagged("b").await, tagged("c").await], left, "{naming:?}");
    }
    assert_eq!(store.rename(JobId::generate(), Naming::default(), by()).await.unwrap(), None);
}

async fn a_result_is_listed_with_its_latest_label(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    let first = computed(&store, 1, "first", &["x"]).await;
    let found = async |owner: Option<&str>, name: &str, value: &str| {
        let mut search = Search::within(reach(owner));
        search.set(name, value).unwrap();
        let mut results = store.search(&search, None, 10).await.unwrap().results;
        results.pop().unwrap().named.map(|named| (named.job, named.label, named.tags))
    };
    let named = async |owner| found(owner, "q", "").await;
    let is = |id, label: &str, tag: &str| Some((id, Some(label.into()), vec![tag.into()]));
    assert_eq!(named(None).await, is(first, "first", "x"));
    // A later job without a label does not hide the label.
    let plain = accepted(store.submit(NewJob { private: true, ..new_job(1) }).await).id;
    assert_eq!(named(None).await, is(first, "first", "x"));
    let second = computed(&store, 1, "second", &["y"]).await;
    assert_eq!(named(None).await, is(second, "second", "y"));
    assert_eq!(named(Some("bob")).await, None);
    // Who sees the names of others sees an own name first.
    let (owner, label, tags) = ("bob".to_owned(), Some("bob's".to_owned()), vec!["z".to_owned()]);
    let shared = NewJob { owner, label, tags, ..new_job(1) };
    let shared = accepted(store.submit(shared).await).id;
    assert_eq!(named(Some("carl")).await, is(shared, "bob's", "z"));
    assert_eq!(named(None).await, is(shared, "bob's", "z"));
    assert_eq!(named(Some("ada")).await, is(second, "second", "y"));
    // A search for a name shows the name that it finds, an own one first.
    for (name, value) in [("q", "FIR"), ("q", "x"), ("tag", "x"), ("label", "first")] {
        assert_eq!(found(Some("ada"), name, value).await, is(first, "first", "x"), "{value}");
    }
    for (name, value) in [("q", "z bob"), ("tag", "z"), ("label", "bob's")] {
        assert_eq!(found(Some("ada"), name, value).await, is(shared, "bob's", "z"), "{value}");
    }
    store
        .rename(
            shared,
            Naming { label: Some(Some("second".into())), ..Naming::default() },
            annotator("bob").by,
        )
        .await
        .unwrap();
    assert_eq!(found(Some("ada"), "q", "second").await, is(second, "second", "y"));
    assert_eq!(found(Some("bob"), "q", "second").await, is(shared, "second", "z"));
    store.delete(shared, annotator("bob").by).await.unwrap();
    let unnamed = Naming { label: Some(None), ..Naming::default() };
    for id in [first, second] {
        store.rename(id, unnamed.clone(), annotator("ada").by).await.unwrap();
    }
    assert_eq!(named(Some("ada")).await, Some((second, None, vec!["y".into()])));
    assert_ne!(plain, second);
}

async fn a_submitter_finds_the_results_that_others_computed(on: Engine) {
    let (_db, store) = Database::fresh(on).await;
    for number in [1, 2] {
        computed(&store, number, "first", &[]).await;
    }
    let cached = NewJob { owner: "bob".into(), private: true, ..new_job(1) };
    assert!(accepted(store.submit(cached).await).state.is_finished());
    let submitted = async |by: &str, who: Option<&str>| {
        let mut search = Search::within(reach(who));
        search.set("submitted_by", by).unwrap();
        let results = store.search(&search, None, 10).await.unwrap().results;
        assert_eq!(store.count(&search).await.unwrap(), results.len() as u64);
        results.iter().map(|result| result.key.bytes()[0]).collect::<Vec<_>>()
    };
    assert_eq!(submitted("bob", Some("bob")).await, [1]);
    assert_eq!(submitted("bob", None).await, [1], "an administrator sees all jobs");
    assert_eq!(submitted("ada", Some("bob")).await, [2, 1], "who computed a result is no secret");
    assert!(submitted("bob", Some("ada")).await.is_empty());
}

/// The text of an answer, which may be chunked.
pub fn text(reply: &Reply) -> String {
    String::from_utf8(unpacked(reply)).unwrap()
}

/// The rows of CSV, without its comments. The texts of the tests contain no line breaks.
pub fn rows(text: &str) -> Vec<String> {
    text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn lists_are_available_as_csv() {
    let server = Server::start().await;
    let mut body = ball(1.0);
    body["label"] = json!("=HYPERLINK(\"x\"), 1");
    body["tags"] = json!(["a", "b"]);
    let key = server.compute(&body).await.json()["key"].clone();
    for amplitude in [2.0, 3.0] {
        server.compute(&ball(amplitude)).await;
    }
    let mut lists: Vec<HashMap<String, String>> = Vec::new();
    for (list, name) in [("/v1/results", "results"), ("/v1/jobs", "jobs")] {
        let whole = server.get(&format!("{list}?format=csv")).await;
        assert_eq!(whole.header("content-type"), Some("text/csv; charset=utf-8"));
        assert_eq!(whole.header("link"), None);
        let whole = text(&whole);
        assert!(whole.starts_with(&format!("# fretwork {name}\n# units: SI\n")), "{whole}");
        let plain = text(&server.get(&format!("{list}?format=csv&comments=none")).await);
        let shown: Vec<_> = plain.lines().collect();
        assert_eq!(rows(&whole), shown);
        assert_eq!(shown.len(), 4, "{shown:?}");
        assert!(shown[0].split(',').any(|column| column == "wear_depth[m]"), "{}", shown[0]);
        // A spreadsheet must not execute a label.
        let label = "\"'=HYPERLINK(\"\"x\"\"), 1\"";
        for cell in [label, "\"a, b\"", key.as_str().unwrap()] {
            assert!(shown[3].contains(cell), "{}", shown[3]);
        }
        // The numbers are at the end, behind texts with commas.
        let cells = shown[0].rsplit(',').zip(shown[1].rsplit(','));
        lists.push(cells.map(|(name, cell)| (name.to_owned(), cell.to_owned())).collect());
        let accepts = [("Accept", "text/csv")];
        let negotiated = server.send("GET", &format!("{list}?comments=none"), &accepts, "").await;
        assert_eq!(text(&negotiated), plain);
        // A limit makes pages.
        let mut paged = Vec::new();
        let mut next = Some(format!("{list}?format=csv&comments=none&limit=1"));
        while let Some(target) = next {
            let page = server.get(&target).await;
            let lines = rows(&text(&page));
            assert_eq!((lines.len(), &*lines[0]), (2, shown[0]));
            paged.push(lines[1].clone());
            let link = page.header("link").and_then(|link| link.strip_prefix('<'));
            next = link.and_then(|link| link.split_once('>')).map(|(target, _)| target.to_owned());
        }
        assert_eq!(paged, shown[1..]);
        let json = server.get(&format!("{list}?limit=1&count=true")).await.json();
        assert_eq!((&json["total"], json[name].as_array().unwrap().len()), (&json!(3), 1));
        assert_eq!(server.get(list).await.json().get("total"), None);
    }
    // A number with one name is one number: of the unworn contact, or after the last cycle.
    let [results, jobs] = &lists[..] else { panic!("{lists:?}") };
    for name in ["regime", "cycles", "wear_volume[m^3]", "wear_depth[m]", "dissipated_energy[J]"] {
        assert_eq!(jobs[name], results[name], "{name}");
    }
    let others = ["created", "key", "label", "owner", "tags"];
    let both = jobs.keys().filter(|name| results.contains_key(*name));
    assert_eq!(both.filter(|name| !others.contains(&&***name)).count(), 5, "{jobs:?}");
    let listed = server.get("/v1/results?sort=-wear_depth&limit=1").await.json();
    let sorted = server.get("/v1/results?format=csv&comments=none&sort=-wear_depth").await;
    let first = rows(&text(&sorted)).swap_remove(1);
    let energy = listed["results"][0]["values"]["dissipated_energy"].to_string();
    assert_eq!(first.rsplit(',').next(), Some(&*energy));
    // More entries than the server reads at a time.
    for amplitude in 0..210 {
        server.compute(&ball(1.0 + f64::from(amplitude % 3))).await;
    }
    let all = server.get("/v1/jobs?format=csv&comments=none").await;
    assert_eq!(rows(&text(&all)).len(), 214);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn faults_of_the_parameters_of_lists_are_reported() {
    let server = Server::start().await;
    for (query, parameter) in [
        ("format=npz", "format"),
        ("comments=none", "comments"),
        ("format=csv&comments=some", "comments"),
        ("count=1", "count"),
        ("format=csv&count=true", "count"),
        ("q=a%20a%20a%20a%20a%20a%20a%20a%20a%20a%20a", "q"),
    ] {
        for list in ["/v1/results", "/v1/jobs"] {
            let problem = server.get(&format!("{list}?{query}")).await;
            let problem = problem.problem(422, "invalid-parameters");
            assert_eq!(problem["errors"][0]["parameter"], parameter, "{problem}");
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_job_is_renamed_and_its_result_is_found_by_its_new_name() {
    let server = Server::start().await;
    let done = server.compute(&ball(1.0)).await.json();
    let other = server.compute(&ball(2.0)).await.json();
    let target = format!("/v1/jobs/{}", done["id"].as_str().unwrap());
    let patch = async |body: Value| server.send("PATCH", &target, &[JSON], body.to_string()).await;
    let found = async |query: &str| {
        let found = server.get(&format!("/v1/results?{query}")).await.json();
        let entries = found["results"].as_array().unwrap().clone();
        entries.into_iter().map(|entry| entry["key"].clone()).collect::<Vec<_>>()
    };
    let renamed = patch(json!({"label": "Third sample", "tags": ["rig 7"]})).await;
    assert_eq!(renamed.status, 200, "{}", renamed.text());
    assert_eq!(renamed.json()["label"], "Third sample");
    assert_eq!(found("q=RIG%20sample").await, [done["key"].clone()]);
    let entry = server.get("/v1/results?q=third").await.json()["results"][0].clone();
    assert_eq!(
        (&entry["label"], &entry["tags"], &entry["job"]),
        (&json!("Third sample"), &json!(["rig 7"]), &done["id"])
    );
    assert_eq!(patch(json!({"label": null})).await.json()["tags"], json!(["rig 7"]));
    assert!(found("q=third").await.is_empty());
    let faulty = patch(json!({"label": "", "tags": "a", "note": 1})).await;
    let problem = faulty.problem(422, "invalid-request");
    assert_eq!(problem["errors"].as_array().unwrap().len(), 3, "{problem}");
    let keys = [&other, &done].map(|job| job["key"].as_str().unwrap());
    assert_eq!(found(&format!("keys={},{}", keys[0], keys[1])).await, keys);
    assert_eq!(found(&format!("keys={}", keys[1])).await, keys[1..]);
    let problem = server.get("/v1/results?keys=abc").await.problem(422, "invalid-parameters");
    assert_eq!(problem["errors"][0]["parameter"], "keys");
}
