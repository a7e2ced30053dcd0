//! Reports: their content, who may read what, and that texts of users stay texts.

use std::array::from_fn;
use std::fs;

use fretwork::http::Limits;
use fretwork_store::Role;
use roxmltree::{Document, Node, ParsingOptions};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::access::{self, ask, get, made};
use crate::program::{fails, run, text};
use crate::server::{Server, steel_ball};
use crate::studies::{computed, example, sweep};

/// A label that would be elements, attributes or the end of a command if it were not escaped.
const HOSTILE: &str =
    "\"><script>alert(1)</script><img src=x onerror='y'>&lt;b> </h1></style>\\END $HOME";

/// Parses a report. Checks that it needs nothing else, and that it has no scripts but those of the program.
fn read(html: &str) -> Document<'_> {
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(html, options).unwrap();
    let root = document.root_element();
    assert_eq!((root.tag_name().name(), root.attribute("lang")), ("html", Some("en")));
    let (mut ids, mut scripts) = (Vec::new(), Vec::new());
    for node in root.descendants().filter(Node::is_element) {
        let name = node.tag_name().name();
        let foreign = ["img", "iframe", "object", "a", "form", "image", "use"];
        assert!(!foreign.contains(&name), "{name}");
        if name == "script" {
            scripts.extend(node.attribute("type"));
        }
        for attribute in node.attributes() {
            let (own, value) = (attribute.name(), attribute.value());
            assert!(!own.starts_with("on") && !["src", "style"].contains(&own), "{own}");
            assert!(own != "href" || value.starts_with("data:image/svg+xml,"), "{value}");
            ids.extend((own == "id").then_some(value));
        }
    }
    assert_eq!(scripts, ["importmap", "module", "application/json"]);
    assert_eq!(ids, ["main", "origin", "status", "data"]);
    assert_eq!((words(&root, "h1").len(), words(&root, "main").len()), (1, 1));
    document
}

/// What the views of a report show.
fn data(document: &Document<'_>) -> Value {
    let scripts = words(&document.root_element(), "script");
    serde_json::from_str(&scripts[2]).unwrap()
}

fn content(node: &Node<'_, '_>) -> String {
    node.descendants()
        .filter(Node::is_text)
        .filter_map(|part| part.text().map(str::to_owned))
        .collect()
}

/// The texts of all elements with this name.
fn words(node: &Node<'_, '_>, name: &str) -> Vec<String> {
    let found = node.descendants().filter(|node| node.tag_name().name() == name);
    found.map(|node| content(&node)).collect()
}

/// The cells of the row with this heading.
fn row(document: &Document<'_>, heading: &str) -> Vec<String> {
    let rows = document.descendants().filter(|node| node.has_tag_name("tr"));
    let found = rows.map(|row| row.children().map(|cell| content(&cell)).collect::<Vec<_>>());
    found.into_iter().find(|row| row[0] == heading).unwrap_or_else(|| panic!("no row {heading}"))
}

/// The numbers in the rows with this heading, one for each run.
fn numbers(document: &Document<'_>, heading: &str) -> Vec<f64> {
    let rows = document.descendants().filter(|node| node.has_tag_name("tr"));
    let found = rows.map(|row| row.children().map(|cell| content(&cell)).collect::<Vec<_>>());
    let cells = found.filter(|row| row[0] == heading).map(|row| row[1].clone());
    let number = |cell: String| {
        let number = cell.split('\u{a0}').next().unwrap().replace('\u{202f}', "");
        number.replace("×10⁻⁵", "e-5").replace("×10⁻⁴", "e-4").parse().unwrap()
    };
    cells.map(number).collect()
}

/// The heading of a number.
const DEPTH: &str = "Largest wear depth after the last cycle";

async fn report(server: &Server, key: &str, query: &str) -> String {
    let reply = server.get(&format!("/v1/results/{key}/report{query}")).await;
    assert_eq!(reply.status, 200, "{}", reply.text());
    assert_eq!(reply.header("content-type"), Some("text/html; charset=utf-8"));
    let policy = reply.header("content-security-policy").unwrap();
    assert!(policy.starts_with("default-src 'none'; script-src 'sha256-"), "{policy}");
    assert!(policy.ends_with("; sandbox allow-scripts allow-downloads allow-modals"), "{policy}");
    assert!(!policy.contains("unsafe"), "{policy}");
    // The policy holds for a saved file, too.
    let own = policy.split("; frame-ancestors").next().unwrap();
    assert!(reply.text().contains(&format!("content=\"{own}\"")), "{policy}");
    reply.text().to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_report_has_inputs_numbers_documents_and_the_command_that_computes_it_again() {
    let server = Server::start().await;
    let mut body = steel_ball();
    body["label"] = json!("A ball");
    let (key, job) = computed(&server, &body).await;
    let html = report(&server, &key, "").await;
    let document = read(&html);
    let root = document.root_element();
    assert_eq!(words(&root, "h1"), ["A ball"]);
    let cells = words(&root, "td");
    for typed in [
        "10\u{a0}mm",
        "2.256\u{a0}µm",
        "3.03×10⁻⁵\u{a0}mm³/(N\u{a0}m)",
        &key,
        concat!("fretwork ", env!("CARGO_PKG_VERSION")),
    ] {
        assert!(cells.iter().any(|cell| cell == typed), "{typed} {cells:?}");
    }
    let names = words(&root, "th");
    for name in ["Radius R", "Body 2: Young's modulus E", "Load: kept constant", "Amplitude U"] {
        assert!(names.iter().any(|own| own == name), "{name} {names:?}");
    }
    let inputs = &words(&root, "table")[0];
    assert!(
        ["mm^3", "um", "youngs", "_modulus"].iter().all(|raw| !inputs.contains(raw)),
        "{inputs}"
    );
    let result = server.get(&format!("/v1/results/{key}")).await.json();
    let last =
        |name: &str| result["history"][name].as_array().unwrap().last().unwrap().as_f64().unwrap();
    let depth = row(&document, DEPTH);
    let shown = numbers(&document, DEPTH)[0];
    assert!((shown / (1e6 * last("wear_depth")) - 1.0).abs() < 5e-4, "{depth:?}");
    assert!(depth[1].ends_with("µm"), "{depth:?}");
    // The views get the whole result, its smooth history, and what the client wrote.
    let shown = data(&document);
    assert_eq!(shown["documents"][&key], result);
    let smooth = server.get(&format!("/v1/results/{key}/history/smooth")).await.json();
    assert_eq!(shown["documents"][format!("{key}/history/smooth")], smooth);
    assert_eq!((&shown["key"], &shown["isSi"]), (&json!(key), &json!(false)));
    let typed = body["scenario"].to_string();
    assert_eq!(shown["query"], json!([["link", "report"], ["label", "A ball"], ["typed", typed]]));
    let si = report(&server, &key, "?units=si").await;
    let si = read(&si);
    assert!(row(&si, DEPTH)[1].ends_with("\u{a0}m"));
    assert_eq!(data(&si)["isSi"], true);
    // The report depends on the result and its jobs, not on the request.
    assert_eq!(report(&server, &key, "?units=engineering").await, html);
    let job = job["id"].as_str().unwrap();
    assert_eq!(report(&server, &key, &format!("?job={job}")).await, html);
    let command = &words(&root, "pre")[0];
    let lines: Vec<&str> = command.lines().collect();
    assert_eq!((lines[0], lines[2]), ("fretwork run - <<'END'", "END"));
    let again: Value = serde_json::from_slice(&run(&["run", "-"], lines[1]).stdout).unwrap();
    assert_eq!(again["key"], key);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_report_of_a_line_contact_says_where_its_amplitudes_are_measured() {
    let server = Server::start().await;
    let example = include_str!("../../examples/cylinder-on-flat.json");
    let mut body: Value = serde_json::from_str(example).unwrap();
    let report_of = async |body: &Value| {
        let (key, _) = computed(&server, body).await;
        content(&read(&report(&server, &key, "").await).root_element())
    };
    let html = report_of(&body).await;
    for said in ["Amplitude at the reference U", "25\u{a0}µm", "Amplitude at the reference after"]
    {
        assert!(html.contains(said), "{html}");
    }
    body["scenario"]["motion"] = json!({"blocks": [{"amplitude": "25 um", "cycles": 18000}], "reference_distance": "35.9 mm"});
    let html = report_of(&body).await;
    assert!(html.contains("Block 1: amplitude at the reference"), "{html}");
}

#[tokio::test(flavor = "multi_thread")]
async fn texts_of_users_stay_texts() {
    let server = Server::start().await;
    let mut body = steel_ball();
    body["label"] = json!(HOSTILE);
    let (key, _) = computed(&server, &body).await;
    let html = report(&server, &key, "").await;
    assert_eq!(words(&read(&html).root_element(), "h1"), [HOSTILE]);
    let mut other = body.clone();
    other["scenario"]["friction"] = json!(0.6);
    let (other, _) = computed(&server, &other).await;
    let html = report(&server, &key, &format!("?with={other}")).await;
    assert_eq!(row(&read(&html), "Label")[1], HOSTILE);
    assert_eq!(data(&read(&html))["query"][2], json!(["name", HOSTILE]));
}

#[tokio::test(flavor = "multi_thread")]
async fn each_kind_of_study_has_a_report() {
    let server = Server::start().await;
    let mut drawn = sweep();
    drawn["sweep"]["vary"] = json!([{"pointer": "/friction", "from": 0.5, "to": 0.7}]);
    drawn["sweep"]["design"] = json!("sobol");
    drawn["sweep"]["samples"] = json!(16);
    for (body, heading, number, parts) in [
        (sweep(), "Sweep", "Wear volume after the last cycle", &["statistics", "histogram"][..]),
        (drawn, "Sweep", "Wear volume after the last cycle", &["statistics", "histogram"]),
        (example("map"), "Fretting map", "Unworn stick ratio", &["statistics", "histogram"]),
        (
            example("sensitivity"),
            "Sensitivity study",
            "Wear volume after the last cycle",
            &["statistics", "histogram"],
        ),
        (example("fit"), "Fit", "Wear coefficient k_w", &["verdict"]),
    ] {
        let (key, _) = computed(&server, &body).await;
        let html = report(&server, &key, "").await;
        let document = read(&html);
        let title = body["label"].as_str().unwrap_or(heading);
        assert_eq!(words(&document.root_element(), "h1"), [title]);
        row(&document, "Radius R");
        assert!(
            row(&document, number)[1].contains(" to "),
            "{heading}: {:?}",
            row(&document, number)
        );
        // What a study varies or estimates is no fixed input.
        let is_fixed = ["Sweep", "Fretting map"].contains(&heading);
        let fixed = &words(&document.root_element(), "table")[0];
        assert_eq!(fixed.contains("Wear coefficient"), is_fixed, "{fixed}");
        let shown = data(&document);
        let result = server.get(&format!("/v1/results/{key}")).await.json();
        assert_eq!(shown["documents"][&key], result);
        for part in parts {
            let mut known = server.get(&format!("/v1/results/{key}/{part}")).await.json();
            let known =
                if *part == "verdict" { known } else { json!({*part: known[*part].take()}) };
            assert_eq!(shown["documents"][format!("{key}/{part}")], known, "{heading} {part}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn report_and_verdict_say_whether_the_law_describes_the_data() {
    let server = Server::start().await;
    let cycles = json!([1000, 2000, 5000, 10_000, 20_000, 50_000]);
    let mut scenario = steel_ball()["scenario"].clone();
    scenario["cycles"] = cycles.clone();
    let (key, _) = computed(&server, &json!({"scenario": &scenario})).await;
    let history = server.get(&format!("/v1/results/{key}/history")).await.json();
    let volumes: Vec<f64> =
        serde_json::from_value(history["history"]["wear_volume"].clone()).unwrap();
    server.get(&format!("/v1/results/{key}/verdict")).await.problem(404, "no-such-part");
    let arc = [-0.06, -0.01, 0.03, 0.04, 0.025, -0.02];
    // The same arc for errors that are equal for all points.
    let equal = from_fn(|i| 0.05 * arc[i] * volumes[6] / volumes[i + 1]);
    let random = [0.03, -0.04, 0.05, -0.02, -0.04, 0.02];
    let relative = |error: f64| json!({"relative": error});
    for (changes, noise, outcome, said) in [
        (
            random,
            relative(0.05),
            "holds",
            "describes these data if their errors are as assumed. The residuals are",
        ),
        (
            arc,
            relative(0.05),
            "trend",
            "follow an arc: low at both ends, high between. A law with this shape cannot",
        ),
        (
            arc,
            relative(0.01),
            "fails",
            "does not hold for these data. One set of parameters does not describe these tests within the \
            assumed errors of 1\u{a0}%",
        ),
        (
            random,
            json!({"noise": "estimate"}),
            "untested",
            "The data do not test Archard's law with one wear coefficient.",
        ),
        (
            equal,
            json!({"noise": "estimate"}),
            "trend",
            "does not have the shape of these data. The residuals follow an arc",
        ),
    ] {
        let y: Vec<f64> = volumes[1..]
            .iter()
            .zip(changes)
            .map(|(volume, change)| volume * (1.0 + change))
            .collect();
        let mut data = json!({"output": "wear_volume", "x": &cycles, "y": y});
        data.as_object_mut().unwrap().extend(noise.as_object().unwrap().clone());
        let parameter =
            json!({"pointer": "/wear/coefficient", "from": 3e-15, "to": 3e-13, "spacing": "log"});
        let body = json!({"fit": {"scenario": &scenario, "parameters": [parameter], "tests": [{"name": "lab", "data": [data]}]}});
        let (key, _) = computed(&server, &body).await;
        let verdict = server.get(&format!("/v1/results/{key}/verdict")).await.json();
        let told = format!(
            "{} {}",
            verdict["verdict"].as_str().unwrap(),
            verdict["reason"].as_str().unwrap()
        );
        assert!(verdict["outcome"] == outcome && told.contains(said), "{noise}: {verdict}");
        assert!(told.contains("Archard's law with one wear coefficient"), "{told}");
        assert_eq!(verdict["intervals"].is_string(), ["fails", "trend"].contains(&outcome));
        let html = report(&server, &key, "").await;
        assert!(content(&read(&html).root_element()).contains(&told), "{told}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_comparison_has_the_numbers_and_documents_of_all_runs() {
    let server = Server::start().await;
    let (first, _) = computed(&server, &steel_ball()).await;
    let mut body = steel_ball();
    body["scenario"]["wear"]["coefficient"] = json!("6.06e-5 mm^3/(N m)");
    body["label"] = json!("Twice the wear");
    let (second, _) = computed(&server, &body).await;
    let html = report(&server, &first, &format!("?with={second}")).await;
    let document = read(&html);
    assert_eq!(numbers(&document, "Friction coefficient μ"), [0.7, 0.7]);
    let coefficients = numbers(&document, "Wear coefficient k_w");
    assert!((coefficients[1] / coefficients[0] - 2.0).abs() < 1e-9, "{coefficients:?}");
    let shown = data(&document);
    let keys = ["keys".to_owned(), format!("{first},{second}")];
    let query = json!([
        keys,
        ["links", "report,report"],
        ["name", steel_ball()["label"]],
        ["name", "Twice the wear"]
    ]);
    assert_eq!(shown["query"], query);
    let volumes = [&first, &second].map(|key| format!("/v1/results/{key}"));
    let (mut values, mut pressures) = (Vec::new(), Vec::new());
    for (address, key) in volumes.into_iter().zip([&first, &second]) {
        let result = server.get(&address).await.json();
        let volumes = result["history"]["wear_volume"].as_array().unwrap();
        values.push(1e18 * volumes.last().unwrap().as_f64().unwrap());
        pressures.push(1e-9 * result["unworn"]["peak_pressure"].as_f64().unwrap());
        assert_eq!(shown["documents"][key], result);
    }
    for (heading, expected) in
        [("Wear volume after the last cycle", &values), ("Unworn peak pressure", &pressures)]
    {
        for (shown, expected) in numbers(&document, heading).iter().zip(expected) {
            assert!((shown / expected - 1.0).abs() < 5e-4, "{heading}: {shown} {expected}");
        }
    }

    let (study, _) = computed(&server, &sweep()).await;
    let address = format!("/v1/results/{first}/report");
    let eight = format!("&with={second}").repeat(8);
    for (query, expected) in [
        (format!("with={study}"), "with"),
        (format!("units=si{eight}"), "with"),
        ("with=abc".to_owned(), "with"),
        ("units=imperial".to_owned(), "units"),
        ("format=pdf".to_owned(), "format"),
        ("job=1".to_owned(), "job"),
    ] {
        let refused = server.get(&format!("{address}?{query}")).await;
        let problem = refused.problem(422, "invalid-parameters");
        assert_eq!(problem["errors"][0]["parameter"], expected, "{problem}");
    }
    let nothing = "0".repeat(64);
    for target in [format!("/v1/results/{nothing}/report"), format!("{address}?with={nothing}")] {
        server.get(&target).await.problem(404, "unknown-result");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn only_callers_who_may_read_a_job_see_its_label() {
    let server = access::server(Limits::default()).await;
    let anna = made(server.place(), "anna", Role::Submit).await;
    let berta = made(server.place(), "berta", Role::Read).await;
    let mut body = steel_ball();
    body["label"] = json!("Anna's ball");
    let job = ask(&server, &anna, "POST", "/v1/jobs", &body.to_string()).await.json();
    let (id, result) = (&job["id"], job["links"]["result"].as_str().unwrap());
    let address = format!("{result}/report");
    let own = get(&server, &anna, &address).await;
    let typed = "&quot;2.256 um&quot;";
    assert!(own.text().contains("Anna's ball") && own.text().contains(typed));
    let link = ask(&server, &anna, "POST", &format!("{result}/links"), "").await.json();
    let (_, link) = link["url"].as_str().unwrap().split_once('?').unwrap();
    let linked = server.get(&format!("{address}?{link}")).await;
    let query = format!("{address}?job={}", id.as_str().unwrap());
    let others = get(&server, &berta, &query).await;
    let hide = json!({"private": true}).to_string();
    let hidden =
        ask(&server, &anna, "PATCH", &format!("/v1/jobs/{}", id.as_str().unwrap()), &hide).await;
    assert_eq!(hidden.status, 200);
    let private = [get(&server, &berta, &query).await, get(&server, &berta, &address).await];
    for (reply, is_named) in
        [(&linked, false), (&others, true), (&private[0], false), (&private[1], false)]
    {
        assert_eq!(reply.status, 200, "{}", reply.text());
        // The inputs are those of the result, and not as anna has typed them.
        assert_eq!(reply.text().contains("Anna"), is_named);
        assert!(reply.text().contains("2.256\u{a0}µm") && !reply.text().contains(typed));
    }
    let key = job["key"].as_str().unwrap();
    let both = server.get(&format!("{address}?with={key}&{link}")).await;
    both.problem(403, "bad-link");
    assert_eq!(server.get(&address).await.status, 401);
}

#[test]
fn the_commands_write_the_report_of_a_file() {
    let dir = TempDir::new().unwrap();
    let path = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let [first, second, page, result] = ["a.json", "b.json", "page.html", "result.json"].map(path);
    let mut body = steel_ball();
    body["label"] = json!(HOSTILE);
    fs::write(&first, body.to_string()).unwrap();
    body["scenario"]["friction"] = json!(0.6);
    fs::write(&second, body["scenario"].to_string()).unwrap();
    let done = run(&["run", &first, "-o", &result, "--report", &page], "");
    assert!(done.status.success(), "{}", text(&done.stderr));
    let html = fs::read_to_string(&page).unwrap();
    let document = read(&html);
    assert_eq!(words(&document.root_element(), "h1"), [HOSTILE]);
    let plain = run(&["report", &result], "");
    let plain = text(&plain.stdout);
    // A file of a result has no label, but the same document and numbers.
    let (plain, own) = (read(plain), data(&document));
    let key = own["key"].as_str().unwrap();
    assert_eq!(data(&plain)["documents"][key], own["documents"][key]);
    assert_eq!(
        words(&plain.root_element(), "table")[1],
        words(&document.root_element(), "table")[1]
    );
    let volumes = |cycles: &[usize]| {
        let result: Value = serde_json::from_slice(&fs::read(&result).unwrap()).unwrap();
        let value = |name: &str, row: usize| result["history"][name][row].as_f64().unwrap();
        let line = |row: &usize| {
            format!("{},{:e}", value("cycles", *row), 1.05 * value("wear_volume", *row))
        };
        ["cycles,wear_volume [m^3]".to_owned()]
            .into_iter()
            .chain(cycles.iter().map(line))
            .collect::<Vec<_>>()
            .join("\n")
    };
    let csv = path("measured.csv");
    fs::write(&csv, volumes(&[1, 5])).unwrap();
    let compared = run(&["report", &result, "--measured", &csv], "");
    let compared = text(&compared.stdout);
    let sets = &data(&read(compared))["measured"];
    assert_eq!((&sets[0]["name"], &sets[0]["output"]), (&json!(csv), &json!("wear_volume")));
    assert_eq!((&sets[0]["kind"], &sets[0]["x"]), (&json!("points"), &json!([1000.0, 100_000.0])));
    fs::write(&csv, "time [s],load [N]\n1,2\n").unwrap();
    fails(&run(&["report", &result, "--measured", &csv], ""), "has no output of a run");
    let other = path("other.json");
    assert!(run(&["run", &second, "-o", &other], "").status.success());
    let done = run(&["report", &result, &other, "-o", &page, "--units", "si"], "");
    assert!(done.status.success(), "{}", text(&done.stderr));
    let html = fs::read_to_string(&page).unwrap();
    assert_eq!(numbers(&read(&html), "Friction coefficient μ"), [0.7, 0.6]);
    let shown = data(&read(&html));
    assert_eq!(
        (&shown["query"][2], &shown["query"][3]),
        (&json!(["name", "result"]), &json!(["name", "other"]))
    );
    fails(&run(&["report", &first], ""), "is not a result in JSON");
    fails(&run(&["report", &path("none.json")], ""), "cannot read");
}
