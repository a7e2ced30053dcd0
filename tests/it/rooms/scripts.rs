//! Checks the imports between the modules of the dashboard: a folder uses only earlier folders, and modules do not depend on
//! each other in a cycle, also not through a module that is loaded later.

use super::{Layout, Uses, circles, read_sources};

/// The folders in order, and the module of the page, which may use all of them.
const DASHBOARD: Layout = Layout {
    dir: "src/http/dashboard",
    rooms: &[
        "page",
        "quantities",
        "access",
        "figure",
        "library",
        "study",
        "measure",
        "fit",
        "run",
        "compare",
        "form",
        "report",
        "main",
    ],
    reserved: &[],
};

/// The module that the program writes, and that of `clients/javascript`.
const OTHERS: [&str; 2] = ["quantities/words.js", "fretwork.js"];

/// The addresses in the imports of a module: `import … from "…"`, `import "…"`, `export … from "…"` and `import("…")`.
fn addresses(text: &str) -> Vec<&str> {
    let ends_with = |before: &str, word: &str| {
        let rest = before.trim_end().strip_suffix(word);
        rest.is_some_and(|rest| !rest.ends_with(|c: char| c.is_alphanumeric() || "_$.".contains(c)))
    };
    let quotes = text.match_indices(['"', '\'', '`']);
    let imports = quotes.filter(|(at, _)| {
        let before = text[..*at].trim_end();
        let called = before.strip_suffix('(').unwrap_or(before);
        ends_with(before, "from") || ends_with(called, "import")
    });
    let addresses = imports.map(|(at, quote)| text[at + 1..].split(quote).next().unwrap());
    addresses.filter(|address| address.starts_with("./") || address.starts_with("../")).collect()
}

/// The name of the module at an address that another module contains.
fn resolve(from: &str, address: &str) -> String {
    let mut parts: Vec<&str> = from.split('/').collect();
    parts.pop();
    for part in address.split('/') {
        match part {
            "." => {}
            ".." => drop(parts.pop().expect("the address stays inside the dashboard")),
            name => parts.push(name),
        }
    }
    parts.join("/")
}

/// The modules that each module imports.
fn uses(texts: &[(String, String)]) -> Uses<String> {
    let imports = |(from, text): &(String, String)| {
        let targets = addresses(text).into_iter().map(|own| (resolve(from, own), own.to_owned()));
        (from.clone(), targets.collect())
    };
    texts.iter().map(imports).collect()
}

/// Each import from a later folder.
fn wrong_arrows(uses: &Uses<String>) -> Vec<String> {
    let room = |name: &str| DASHBOARD.room(name.trim_end_matches(".js"));
    let all = uses.iter().flat_map(|(from, to)| to.keys().map(move |to| (from, to)));
    let wrong = all.filter(|(from, to)| room(from) < room(to));
    wrong.map(|(from, to)| format!("{from} uses {to} of a later folder")).collect()
}

#[test]
fn folders_of_the_dashboard_use_earlier_folders() {
    let uses = uses(&read_sources(DASHBOARD.dir, "js"));
    for (from, targets) in &uses {
        assert!(DASHBOARD.room(from.trim_end_matches(".js")).is_some(), "{from} is in no folder");
        for to in targets.keys() {
            let is_known = uses.contains_key(to) || OTHERS.contains(&&**to);
            assert!(is_known, "{from} imports {to}, which is missing");
        }
    }
    assert_eq!(wrong_arrows(&uses), [""; 0]);
}

#[test]
fn modules_of_the_dashboard_have_no_cyclic_dependencies() {
    let found = circles(&uses(&read_sources(DASHBOARD.dir, "js")));
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn addresses_of_the_dashboard_are_written_out() {
    for (file, text) in read_sources(DASHBOARD.dir, "js") {
        let computed = text.split("import(").skip(1).any(|rest| !rest.starts_with("\"."));
        assert!(!computed, "{file} computes the address of a module");
    }
}

fn example(texts: &[(&str, &str)]) -> Uses<String> {
    uses(&texts.iter().map(|(file, text)| ((*file).into(), (*text).into())).collect::<Vec<_>>())
}

#[test]
fn a_forbidden_import_is_found_in_every_syntax() {
    for text in [
        "import { showRun } from \"../run/run.js\";",
        "import {\n  showRun,\n} from '../run/run.js';",
        "import * as run from\"../run/run.js\"",
        "import \"../run/run.js\";",
        "export * from \"../run/run.js\";",
        "const { showRun } = await import(\"../run/run.js\");",
        "const load = () => import(\n  \"../run/run.js\");",
        "const load = () => import(`./../run/run.js`);",
    ] {
        let uses = example(&[("study/study.js", text), ("run/run.js", "")]);
        let expected = ["study/study.js uses run/run.js of a later folder"];
        assert_eq!(wrong_arrows(&uses), expected, "{text}");
    }
    let uses = example(&[("form/form.js", "import { h } from \"../main.js\";")]);
    assert_eq!(wrong_arrows(&uses).len(), 1);
}

#[test]
fn imports_of_earlier_folders_and_other_texts_are_allowed() {
    let uses = example(&[
        ("main.js", "import(\"./run/run.js\")"),
        ("run/run.js", "import { h } from \"../page/dom.js\"; import \"./result.js\";"),
        ("page/dom.js", "h(\"a\", { href: \"../run/run.js\" }, \"./run.js\"); // `/from` run. */"),
    ]);
    assert_eq!(wrong_arrows(&uses), [""; 0]);
    assert!(circles(&uses).is_empty());
}

#[test]
fn a_cycle_through_a_module_that_is_loaded_later_is_found() {
    let uses = example(&[
        ("run/result.js", "const later = () => import(\"./derived.js\");"),
        ("run/derived.js", "import { load } from \"./load.js\"; import \"../page/dom.js\";"),
        ("run/load.js", "export { load } from \"./result.js\";"),
        ("page/dom.js", ""),
    ]);
    assert_eq!(circles(&uses).len(), 3, "{:?}", circles(&uses));
}
