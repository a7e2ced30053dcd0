//! The documents: their length, links, examples, commands, routes, files and numbers, and the pages that the server
//! makes from them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use fretwork::http;
use fretwork_engine::scenario;
use fretwork_job::Submission;
use fretwork_study::Kind;
use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::server::Server;

/// A document: its path in the repository, and its text.
struct Document {
    path: String,
    text: String,
}

/// The part of a document that a test looks at.
enum Part {
    Heading(String),
    Link(String),
    /// Code in a line of text.
    Code(String),
    /// A block of code: its language and its text.
    Block(String, String),
}

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &str) -> Document {
    let text =
        fs::read_to_string(root().join(path)).unwrap_or_else(|error| panic!("{path}: {error}"));
    Document { path: path.to_owned(), text }
}

/// The paths of all files below these directories, relative to the repository.
pub(crate) fn files(directories: &[&str]) -> Vec<String> {
    let mut waiting: Vec<PathBuf> = directories.iter().map(|name| root().join(name)).collect();
    let mut found = Vec::new();
    while let Some(path) = waiting.pop() {
        if path.is_dir() {
            waiting.extend(fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()));
        } else {
            found.push(path.strip_prefix(root()).unwrap().to_str().unwrap().to_owned());
        }
    }
    found.sort();
    found
}

/// What follows the last dot of the name of a file.
pub(crate) fn suffix(path: &str) -> Option<&str> {
    Path::new(path).extension()?.to_str()
}

/// The documents in `docs`, without the list of licences.
fn pages() -> Vec<Document> {
    let names = files(&["docs"]).into_iter();
    let names = names.filter(|name| suffix(name) == Some("md") && !name.contains("third-party"));
    names.map(|name| read(&name)).collect()
}

/// The documents that people read from the beginning to the end.
fn guides() -> Vec<Document> {
    let mut all = pages();
    all.extend(["README.md", "ARCHITECTURE.md", "CONTRIBUTING.md"].map(read));
    all
}

/// All documents with links.
fn linked() -> Vec<Document> {
    let mut all = guides();
    let others = [
        "CHANGELOG.md",
        "SECURITY.md",
        "VERIFICATION.md",
        "benches/scale.md",
        "clients/README.md",
        "clients/command-line.md",
        "clients/javascript/README.md",
        "clients/python/README.md",
        "crates/engine/README.md",
        "docs/third-party-licenses.md",
        "examples/literature/README.md",
        "examples/paper/README.md",
    ];
    all.extend(others.map(read));
    all
}

impl Document {
    fn words(&self) -> usize {
        self.text.split_whitespace().count()
    }

    fn parts(&self) -> Vec<Part> {
        let (mut parts, mut heading, mut block) = (Vec::new(), None::<String>, None);
        for event in Parser::new_ext(&self.text, Options::ENABLE_TABLES) {
            match event {
                Event::Start(Tag::Heading { .. }) => heading = Some(String::new()),
                Event::End(TagEnd::Heading(_)) => parts.extend(heading.take().map(Part::Heading)),
                Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(language))) => {
                    block = Some((language.into_string(), String::new()));
                }
                Event::Start(Tag::CodeBlock(CodeBlockKind::Indented)) => {
                    panic!("{}: a block of code without a language", self.path)
                }
                Event::End(TagEnd::CodeBlock) => {
                    parts.extend(block.take().map(|(language, text)| Part::Block(language, text)));
                }
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    parts.push(Part::Link(dest_url.into_string()));
                }
                Event::Text(text) => {
                    if let Some((_, block)) = &mut block {
                        block.push_str(&text);
                    } else if let Some(heading) = &mut heading {
                        heading.push_str(&text);
                    }
                }
                Event::Code(text) => {
                    if let Some(heading) = &mut heading {
                        heading.push_str(&text);
                    }
                    parts.push(Part::Code(text.into_string()));
                }
                _ => {}
            }
        }
        parts
    }

    fn blocks(&self, language: &str) -> Vec<String> {
        let blocks = self.parts().into_iter().filter_map(|part| match part {
            Part::Block(own, text) if own == language => Some(text),
            _ => None,
        });
        blocks.collect()
    }

    fn codes(&self) -> Vec<String> {
        let codes = self.parts().into_iter().filter_map(|part| match part {
            Part::Code(text) => Some(text),
            _ => None,
        });
        codes.collect()
    }

    /// The anchors of its headings, as GitHub makes them.
    fn anchors(&self) -> BTreeSet<String> {
        let headings = self.parts().into_iter().filter_map(|part| match part {
            Part::Heading(text) => Some(text),
            _ => None,
        });
        let kept = |c: &char| c.is_alphanumeric() || " -_".contains(*c);
        let anchor = |text: String| text.to_lowercase().chars().filter(kept).collect::<String>();
        headings.map(|text| anchor(text).replace(' ', "-")).collect()
    }
}

#[test]
fn documents_are_short() {
    for name in ["README.md", "ARCHITECTURE.md"] {
        let words = read(name).words();
        assert!(words <= 1000, "{name} has {words} words");
    }
    let words: usize = guides().iter().map(Document::words).sum();
    println!("README, ARCHITECTURE, CONTRIBUTING and docs: {words} words");
    assert!(words <= 14_100, "{words}");
}

#[test]
fn every_link_leads_to_a_file_and_a_heading() {
    let mut links = 0;
    for document in linked() {
        let directory = root().join(&document.path).parent().unwrap().to_owned();
        for part in document.parts() {
            let Part::Link(link) = part else { continue };
            if link.contains("://") || link.contains('@') {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = match file {
                "" => root().join(&document.path),
                file => directory.join(file),
            };
            assert!(target.exists(), "{}: {link}", document.path);
            if !anchor.is_empty() {
                let text = fs::read_to_string(&target).unwrap();
                let anchors = Document { path: link.clone(), text }.anchors();
                assert!(anchors.contains(anchor), "{}: {link}: {anchors:?}", document.path);
            }
            links += 1;
        }
    }
    assert!(links > 150, "{links}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_server_shows_every_document_with_links_that_work() {
    let server = Server::start().await;
    let mut links = BTreeSet::new();
    let others = [
        "ARCHITECTURE",
        "CHANGELOG",
        "CONTRIBUTING",
        "VERIFICATION",
        "third-party-licenses",
        "clients",
        "clients/command-line",
        "clients/javascript",
        "clients/python",
    ];
    let names = pages().into_iter().map(|page| {
        let name = page.path.trim_start_matches("docs/").trim_end_matches("README.md");
        name.trim_end_matches(".md").to_owned()
    });
    for name in names.chain(others.map(str::to_lowercase)) {
        let page = server.get(&format!("/docs/{}", name.trim_end_matches('/'))).await;
        assert_eq!(
            (page.status, page.header("content-type")),
            (200, Some("text/html; charset=utf-8")),
            "{name}"
        );
        let policy = page.header("content-security-policy").unwrap();
        assert!(policy.starts_with("default-src 'none'; style-src 'self';"), "{policy}");
        let text = page.text();
        assert!(!text.contains(" style=") && !text.contains("<script"), "{name}");
        let found = text.split("href=\"").skip(1).map(|rest| rest.split('"').next().unwrap());
        for link in found {
            assert!(link.starts_with(['/', '#']) || link.contains("://"), "{name}: {link}");
            let own =
                if link.starts_with('#') { format!("/docs/{name}{link}") } else { link.to_owned() };
            links.insert(own);
        }
    }
    let mut checked = 0;
    for link in links.iter().filter(|link| link.starts_with("/docs/")) {
        let (address, anchor) = link.split_once('#').unwrap_or((link, ""));
        let page = server.get(address).await;
        assert_eq!(page.status, 200, "{link}");
        assert!(anchor.is_empty() || page.text().contains(&format!("id=\"{anchor}\"")), "{link}");
        checked += 1;
    }
    assert!(checked > 40, "{checked}");
    let page = server.get("/docs/verification").await;
    assert!(page.text().contains("<td class=\"number\">"), "numbers are right-aligned");
    let file = read("deploy/haproxy-single.cfg");
    let page = server.get(&format!("/docs/{}", file.path)).await;
    assert_eq!(page.header("content-type"), Some("text/plain; charset=utf-8"));
    assert_eq!(page.text(), file.text);
    server.get("/docs/no-such-page").await.problem(404, "not-found");
    assert_eq!(server.get("/docs").await.header("location"), Some("/docs/"));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_links_of_the_dashboard_lead_to_documents() {
    let server = Server::start().await;
    let mut links = 0;
    for script in files(&["src/http/dashboard"]).iter().filter(|name| suffix(name) == Some("js")) {
        let text = read(script).text;
        for link in text.split("explained(\"").skip(1).map(|rest| rest.split('"').next().unwrap()) {
            let (name, anchor) = link.split_once('#').unwrap_or((link, "main"));
            let page = server.get(&format!("/docs/{name}")).await;
            assert_eq!(page.status, 200, "{script}: {link}");
            assert!(page.text().contains(&format!("id=\"{anchor}\"")), "{script}: {link}");
            links += 1;
        }
    }
    assert!(links >= 5, "{links}");
}

/// An example as a job body with this member of its scenario replaced.
fn job_with(example: &str, member: &str, value: Value) -> Vec<u8> {
    let path = format!("examples/{example}.json");
    let mut body: Value = serde_json::from_str(&read(&path).text).unwrap();
    body["scenario"]["cycles"] = json!([1000]);
    body["scenario"][member] = value;
    body.to_string().into_bytes()
}

/// Whether a job body of a ball or of a cylinder accepts this JSON as a member of its scenario, or a sweep as one of its
/// members.
fn is_accepted(value: &Value) -> bool {
    if Submission::parse(value.to_string().as_bytes()).is_ok() {
        return true;
    }
    let mut sweep: Value = serde_json::from_str(&read("examples/studies/sweep.json").text).unwrap();
    for (name, member) in value.as_object().into_iter().flatten() {
        sweep["sweep"][name] = member.clone();
    }
    let members = ["profile", "motion", "load", "cycles", "wear", "friction"];
    let jobs = ["steel-ball", "cylinder-on-flat"]
        .into_iter()
        .flat_map(|example| members.map(|member| job_with(example, member, value.clone())));
    jobs.into_iter().any(|job| Submission::parse(&job).is_ok())
        || value.is_object() && Submission::parse(sweep.to_string().as_bytes()).is_ok()
}

#[test]
fn the_json_in_documents_is_accepted() {
    let mut checked = 0;
    for document in guides() {
        for block in document.blocks("json") {
            let value =
                serde_json::from_str(&block).unwrap_or_else(|error| panic!("{block}: {error}"));
            assert!(is_accepted(&value), "{}: {block}", document.path);
            checked += 1;
        }
        // The cells of tables have examples, too. Those with an ellipsis are not complete.
        for code in document
            .codes()
            .iter()
            .filter(|code| code.starts_with(['{', '[']) && !code.contains('…'))
        {
            let Ok(value) = serde_json::from_str(code) else { continue };
            assert!(is_accepted(&value), "{}: {code}", document.path);
            checked += 1;
        }
    }
    assert!(checked >= 15, "{checked}");
    assert!(!is_accepted(&json!({"shape": "paraboloid", "radius": "-10 mm"})));
    assert!(!is_accepted(&json!({"blocks": [{"amplitude": "2 um"}]})));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_commands_about_calibration_print_what_the_page_shows() {
    let server = Server::start().await;
    let (page, dir) = (read("docs/calibration.md"), TempDir::new().unwrap());
    std::os::unix::fs::symlink(root().join("examples"), dir.path().join("examples")).unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_fretwork")).parent().unwrap().display();
    let path = format!("{program}:{}", std::env::var("PATH").unwrap());
    let mut said = Vec::new();
    for block in page.blocks("sh") {
        let block = block.replace("http://127.0.0.1:8080", &format!("http://{}", server.address));
        let mut shell = Command::new("bash");
        shell.args(["-euo", "pipefail", "-c", &block]).env("PATH", &path).current_dir(dir.path());
        let output = shell.output().unwrap();
        assert!(output.status.success(), "{block}: {}", String::from_utf8_lossy(&output.stderr));
        said.push(String::from_utf8(output.stdout).unwrap());
    }
    let [printed, answered] = &said[..] else { panic!("two blocks of commands") };
    for line in page.blocks("text")[0].lines().filter(|line| *line != "…") {
        assert!(printed.lines().any(|own| own == line), "{line}: {printed}");
    }
    assert!(answered.starts_with("{\"columns\":[{\"name\":\"cycles\""), "{answered}");
    assert!(
        answered.contains("\"state\":\"succeeded\"") && answered.contains("\"at_bound\""),
        "{answered}"
    );
}

/// What `fretwork … --help` prints, by command; `fretwork --help` is under "".
fn helps() -> BTreeMap<String, String> {
    let help = |command: &[&str]| {
        let mut program = Command::new(env!("CARGO_BIN_EXE_fretwork"));
        let output = program.args(command).arg("--help").output().unwrap();
        assert!(output.status.success(), "{command:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let main = help(&[]);
    let commands = main.split("Commands:").nth(1).unwrap().split("\n\n").next().unwrap();
    let commands =
        commands.lines().filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names = commands.filter_map(|line| line.split_whitespace().next());
    let mut all: BTreeMap<_, _> =
        names.filter(|name| *name != "help").map(|name| (name.to_owned(), help(&[name]))).collect();
    let keys = ["add", "list", "revoke", "share-names"].map(|name| help(&["keys", name])).concat();
    all.get_mut("keys").unwrap().push_str(&keys);
    all.insert(String::new(), main);
    all
}

/// Whether a help explains an option.
fn explains(help: &str, option: &str) -> bool {
    help.split([' ', '\n', ',', '`', ')', ']']).any(|word| word == option)
}

#[test]
fn the_help_that_the_page_for_administrators_names_explains_its_options() {
    let (codes, helps) = (read("docs/operating.md").codes(), helps());
    let named =
        codes.iter().find_map(|code| code.strip_prefix("fretwork ")?.strip_suffix("--help"));
    let help = &helps[named.unwrap().trim()];
    let options = codes.iter().filter(|code| code.starts_with("--"));
    let options: Vec<_> = options.filter_map(|code| code.split_whitespace().next()).collect();
    let unexplained: Vec<_> = options.iter().filter(|option| !explains(help, option)).collect();
    assert!(options.len() > 20 && unexplained.is_empty(), "{unexplained:?}");
}

#[test]
fn the_commands_options_and_variables_in_documents_exist() {
    let helps = helps();
    let settings: String =
        ["compose.yaml", "clients/command-line.md"].map(|name| read(name).text).concat();
    let everything: String = helps.values().map(String::as_str).collect::<String>() + &settings;
    let mut checked = 0;
    for document in guides().into_iter().chain([read("clients/command-line.md")]) {
        let mut lines = document.codes();
        for language in ["sh", "console"] {
            lines.extend(
                document.blocks(language).iter().flat_map(|block| block.lines()).map(str::to_owned),
            );
        }
        for line in &lines {
            for name in line.split(|c: char| !c.is_ascii_uppercase() && c != '_') {
                // These set up the tests, and a client.
                let own = ["FRETWORK_TEST_POSTGRES", "FRETWORK_KEY"].contains(&name);
                if name.starts_with("FRETWORK_") && !own {
                    assert!(everything.contains(name), "{}: {name}", document.path);
                    checked += 1;
                }
            }
            let line = line.split('#').next().unwrap().trim();
            let mut words = line.split_whitespace().peekable();
            if words.peek().is_some_and(|word| word.starts_with("--")) {
                let option = words.next().unwrap();
                let known = helps.values().any(|help| explains(help, option));
                assert!(known, "{}: {option} is no option", document.path);
                checked += 1;
            } else if words.next() == Some("fretwork") {
                let command =
                    words.peek().filter(|word| !word.starts_with('-')).copied().unwrap_or_default();
                let help =
                    helps.get(command).unwrap_or_else(|| panic!("{}: {line}", document.path));
                for option in words.filter(|word| word.starts_with("--")) {
                    // Without a command, the options are those of the server.
                    let is_known = explains(help, option)
                        || command.is_empty() && explains(&helps["serve"], option);
                    assert!(is_known, "{}: {line}: {option}", document.path);
                }
                checked += 1;
            }
        }
    }
    assert!(checked >= 50, "{checked}");
}

#[test]
fn the_routes_in_documents_exist() {
    let api: Value = serde_json::from_slice(http::DOCUMENT).unwrap();
    let mut checked = 0;
    for document in guides() {
        for code in document.codes() {
            let Some((method, address)) = code.split_once(' ') else { continue };
            if !["GET", "PUT", "POST", "DELETE"].contains(&method) {
                continue;
            }
            let path = address.split('?').next().unwrap();
            let operation = &api["paths"][path][method.to_lowercase()];
            assert!(operation.is_object(), "{}: {code}", document.path);
            checked += 1;
        }
    }
    assert!(checked >= 25, "{checked}");
}

#[test]
fn the_files_that_documents_name_exist() {
    let known = files(&[
        ".github",
        "benches",
        "clients",
        "crates",
        "deploy",
        "docs",
        "examples",
        "migrations",
        "openapi",
        "src",
        "tests",
    ]);
    let is_known = |name: &str| {
        root().join(name).exists()
            || known.iter().any(|file| {
                file.ends_with(name) && file[..file.len() - name.len()].ends_with('/')
                    || file.contains(&format!("/{name}/"))
            })
    };
    let mut checked = 0;
    for document in guides() {
        let is_about_code =
            !document.path.starts_with("docs/") || document.path.contains("decisions");
        for code in document.codes().into_iter().filter(|_| is_about_code) {
            let path = code.trim_end_matches('/');
            let is_file = suffix(path)
                .is_some_and(|suffix| ["html", "js", "json", "md", "rs", "yml"].contains(&suffix));
            let is_path = path.contains('/')
                && ["crates", "src", "tests"].contains(&path.split('/').next().unwrap());
            let is_name = !path.contains([' ', '{', '(', ':']) && !path.contains("NAME");
            if (is_file || is_path) && is_name && !path.starts_with('/') && path != "job.json" {
                assert!(is_known(path), "{}: {code}", document.path);
                checked += 1;
            }
        }
    }
    assert!(checked >= 60, "{checked}");
    assert!(!is_known("no/such/file.rs") && !is_known("olumns.rs"));
}

#[test]
fn the_recipes_name_what_is_in_the_files() {
    let text = read("CONTRIBUTING.md").text;
    for (file, names) in [
        ("crates/engine/src/outcome/columns.rs", &["QUANTITIES", "History"][..]),
        ("crates/engine/src/simulation/recording.rs", &["fn record(", "HistoryEntry"]),
        ("crates/engine/src/scenario/mod.rs", &["NUMERICS"]),
        ("crates/job/src/outline.rs", &["scalars!", "SCALARS"]),
        ("crates/engine/src/contact/control.rs", &["enum Held", "tends_to"]),
        ("crates/engine/src/input/indenter.rs", &["shapes! {", "rows! {", "fn length("]),
        ("crates/engine/src/scenario/indenter.rs", &["enum ProfileForm"]),
        ("crates/engine/src/contact/profile.rs", &["enum ShapeKind"]),
        ("crates/study/src/kinds/mod.rs", &["pub const ALL"]),
        ("crates/store/src/store.rs", &["impl Store"]),
        ("src/http/routes.rs", &["pub fn all()"]),
        ("src/http/metrics/mod.rs", &["const MEASURED"]),
        ("src/http/dashboard/docs.rs", &["const PAGES"]),
        ("src/http/dashboard/run/sketch.js", &["function gap"]),
        ("src/http/dashboard/form/field-list.js", &["WEAR_OPTIONS", "fields:"]),
        ("src/http/dashboard/library/summary.js", &["const titleOfRun"]),
        ("src/http/dashboard/figure/run.js", &["HISTORIES"]),
    ] {
        assert!(text.contains(file), "no recipe names {file}");
        for name in names {
            assert!(read(file).text.contains(name), "{file} has no {name}");
        }
    }
    assert_eq!(Kind::ALL.len(), 4, "docs/studies.md describes each kind");
}

/// The rows of the tables of a text, as cells.
fn rows(text: &str) -> Vec<Vec<&str>> {
    let lines = text.lines().filter(|line| line.starts_with('|'));
    lines.map(|line| line.trim_matches('|').split('|').map(str::trim).collect()).collect()
}

/// A number such as `−4 %`.
fn percent(cell: &str) -> f64 {
    let number = cell.trim_end_matches('%').trim().replace('−', "-").replace('+', "");
    number.parse().unwrap_or_else(|error| panic!("{cell}: {error}"))
}

#[test]
fn the_table_of_the_simplified_rule_is_that_of_the_verification() {
    let (page, verified) = (read("docs/accuracy.md").text, read("VERIFICATION.md").text);
    let section = verified.split("\n## Error of the simplified rule\n").nth(1).unwrap();
    let errors: BTreeMap<_, _> = rows(section.split("\n## ").next().unwrap())
        .into_iter()
        .filter_map(|row| Some((row[0].split_once(": V at")?.0.to_owned(), percent(row[4]))))
        .collect();
    let rows = rows(&page);
    let head = rows.iter().position(|row| row[0].starts_with("held")).unwrap();
    let mut compared = 0;
    for row in &rows[head + 2..head + 6] {
        for (ratio, cell) in rows[head][1..].iter().zip(&row[1..]) {
            let error = errors.get(&format!("{} held, c = {ratio}", row[0]));
            match error {
                Some(error) => assert!((percent(cell) - error).abs() <= 0.5, "{row:?}: {error}"),
                None => assert_eq!(*cell, "slips", "{row:?}"),
            }
            compared += 1;
        }
    }
    assert_eq!((compared, errors.len()), (28, 30), "{errors:?}");
}

#[test]
fn the_errors_of_the_exact_method_are_those_of_the_verification() {
    let (page, verified) = (read("docs/accuracy.md").text, read("VERIFICATION.md").text);
    let of = |table: &str, row: &str| {
        let table = verified.split(&format!("\n| {table} | ")).nth(1).unwrap();
        let rows = rows(table.split("\n\n").next().unwrap());
        let row = rows.into_iter().find(|cells| cells[0] == row).unwrap();
        [percent(row[2]), percent(row[3])]
    };
    let known = [
        ("wear volume", of("wear volume", "all")),
        ("wear depth", of("wear depth", "all")),
        ("contact radius", of("other quantity", "contact radius")),
        ("energy per cycle", of("other quantity", "energy per cycle")),
        ("moment of `contact_lost`", of("other quantity", "contact_lost")),
        ("moment of `shakedown`", of("other quantity", "shakedown")),
    ];
    for (name, [median, most]) in known {
        let rows = rows(&page);
        let row =
            rows.iter().find(|row| row[0].starts_with(name)).unwrap_or_else(|| panic!("{name}"));
        let (told, below) = (percent(row[1]), percent(row[2]));
        assert!((told / median - 1.0).abs() < 0.2, "{name}: {told}, {median}");
        assert!(below >= most && below < 2.0 * most, "{name}: {below}, {most}");
    }
}

/// E* and G* of two equal bodies.
fn moduli(poisson: f64) -> (f64, f64) {
    let body = json!({"youngs_modulus": "205 GPa", "poisson_ratio": poisson});
    let request = json!({
        "profile": {"shape": "paraboloid", "radius": "10 mm"}, "bodies": [body, body], "friction": 0.7,
        "wear": {"coefficient": 1e-14}, "load": {"normal_force": "100 N"}, "motion": {"amplitude": "2 um"},
        "cycles": [1],
    });
    let (scenario, warnings) = scenario::check(&request, "").unwrap();
    assert!(warnings.iter().all(|warning| warning.kind != "elastic_mismatch"), "{warnings:?}");
    let unworn = scenario.preview().unwrap().unworn;
    (unworn.normal_modulus, unworn.tangential_modulus)
}

#[test]
fn the_numbers_about_poissons_ratio_are_right() {
    let (page, verified) = (read("docs/accuracy.md").text, read("VERIFICATION.md").text);
    for poisson in [0.3, 0.42] {
        let (normal, tangential) = moduli(poisson);
        let told = format!("{:.3} for ν = {poisson}", tangential / normal);
        assert!(page.contains(&told), "{told}");
    }
    let shear = |modulus: f64, poisson: f64| modulus / (2.0 * (1.0 + poisson));
    let (steel, alumina) = (shear(205.0, 0.3), shear(370.0, 0.22));
    let dundurs = (0.4 / steel - 0.56 / alumina) / (2.0 * 0.7 / steel + 2.0 * 0.78 / alumina);
    assert!(page.contains(&format!("β = {dundurs:.3}.")), "{dundurs}");

    let contact = rows(&verified);
    let means = contact.iter().filter(|row| row[0].starts_with("mean slip at r = "));
    let beyond = means.filter(|row| !row[0].contains("0.59628"));
    let errors: Vec<f64> = beyond.map(|row| percent(row[4]).abs()).collect();
    assert!(errors.len() == 5 && errors.iter().all(|error| *error < 0.6), "{errors:?}");
    assert!(page.contains("better than 0.6 % from r = 0.67 a₀"));
    assert!(verified.contains("slip of CONTACT is about 1 − 0.20 cos 2φ times this mean"));
}

#[test]
fn a_crate_is_private_or_has_what_a_package_needs() {
    let manifests = files(&["crates"]).into_iter().filter(|name| name.ends_with("Cargo.toml"));
    let public: Vec<_> = manifests
        .map(|name| read(&name))
        .filter(|file| !file.text.contains("\npublish = false\n"))
        .collect();
    let names: Vec<_> = public.iter().map(|file| file.path.as_str()).collect();
    assert_eq!(names, ["crates/engine/Cargo.toml"]);
    for member in
        ["description = ", "license.workspace = true", "readme = ", "keywords = ", "include = "]
    {
        assert!(public[0].text.contains(member), "{member}");
    }
    // A crate with a path of this repository cannot be packaged without all others.
    assert!(!public[0].text.contains("\nfretwork-"));
}

#[test]
fn all_descriptions_name_both_geometries() {
    let files =
        ["CITATION.cff", "Cargo.toml", "Dockerfile", "crates/engine/Cargo.toml", "src/lib.rs"];
    for file in files {
        let text = read(file).text;
        assert!(text.contains("retting wear of round and line contacts"), "{file}");
        assert!(!text.contains("axisymmetric"), "{file}");
    }
}

#[test]
fn all_files_name_this_version() {
    let version = env!("CARGO_PKG_VERSION");
    for (file, text) in [
        ("CITATION.cff", format!("\nversion: {version}\n")),
        ("Dockerfile", format!("version=\"{version}\"")),
        ("CHANGELOG.md", format!("\n## {version}\n")),
        ("clients/python/pyproject.toml", format!("\nversion = \"{version}\"\n")),
        ("clients/javascript/package.json", format!("\"version\": \"{version}\"")),
    ] {
        assert!(read(file).text.contains(&text), "{file} does not have {text}");
    }
    assert_eq!(
        read("CITATION.cff").text.matches("version:").count(),
        2,
        "that of the format, and ours"
    );
}
