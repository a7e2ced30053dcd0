//! Checks the dependencies between modules in the sources of all crates. A room is a module with everything below it.
//! The tests fail if a room uses a later room of its crate or a library that is reserved to other rooms, or if files
//! depend on each other in a cycle. Cargo.toml states the dependencies between crates. `scripts` checks the modules of the
//! dashboard.

mod scripts;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::{Display, Write as _};
use std::fs;
use std::path::Path;

use proc_macro2::{Delimiter, TokenStream, TokenTree};

/// The rooms of one crate, in order, and the paths that only some rooms may use.
struct Layout {
    /// The directory of the sources.
    dir: &'static str,
    /// The rooms. Each may use the rooms before it. A crate can be a single room.
    rooms: &'static [&'static str],
    /// Paths, each with the rooms that may use it.
    reserved: &'static [(&'static str, &'static [&'static str])],
}

/// What reads a clock, a file or the environment, or starts a thread. Physics and statistics depend on their input
/// alone.
const IMPURE: &[(&str, &[&str])] = &[
    ("std::env", &[]),
    ("std::fs", &[]),
    ("std::net", &[]),
    ("std::thread", &[]),
    ("std::time", &[]),
];

const PACKAGE: Layout = Layout {
    dir: "src",
    rooms: &[
        "service",
        "http/problem",
        "http/shares",
        "http/wire",
        "http/access",
        "http/transport",
        "http/memory",
        "http/metrics",
        "http/app",
        "http/answer",
        "http/dashboard",
        "http/api",
        "http/openapi",
        "http/layers",
        "http/routes",
        "http",
        "telemetry",
        "config",
        "cli",
    ],
    reserved: &[
        ("axum", &["http"]),
        ("clap", &["telemetry", "config", "cli"]),
        ("sqlx", &[]),
        ("tokio", &["service", "http", "cli"]),
    ],
};

const ENGINE: Layout = Layout {
    dir: "crates/engine/src",
    rooms: &[
        "numeric",
        "input",
        "contact",
        "solver",
        "solver/closed",
        "solver/stepped",
        "case",
        "scenario",
        "outcome",
        "simulation",
        "reference",
    ],
    reserved: IMPURE,
};

const LAYOUTS: [Layout; 11] = [
    PACKAGE,
    ENGINE,
    Layout { dir: "crates/json/src", rooms: &[], reserved: IMPURE },
    Layout { dir: "crates/measured/src", rooms: &[], reserved: IMPURE },
    Layout { dir: "crates/random/src", rooms: &[], reserved: IMPURE },
    Layout { dir: "crates/plot/src", rooms: &[], reserved: IMPURE },
    Layout { dir: "crates/study/src", rooms: &[], reserved: IMPURE },
    Layout { dir: "crates/job/src", rooms: &[], reserved: &[] },
    Layout {
        dir: "crates/store/src",
        rooms: &[
            "database",
            "team",
            "results",
            "jobs",
            "sqlite",
            "postgres",
            "administration",
            "moving",
            "store",
        ],
        reserved: &[],
    },
    Layout { dir: "crates/format/src", rooms: &[], reserved: &[] },
    Layout { dir: "crates/verify/src", rooms: &[], reserved: IMPURE },
];

/// Whether a room is one of these, or inside one of them.
fn is_in(room: &str, rooms: &[&str]) -> bool {
    rooms.iter().any(|outer| {
        room.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    })
}

/// The root module of a crate.
const ROOT: &str = "lib";

impl Layout {
    /// The index of the room that owns a file or module, named like `store/read`. A room inside another room owns its
    /// files alone.
    fn room(&self, name: &str) -> Option<usize> {
        let rooms = self.rooms.iter().enumerate().filter(|(_, room)| is_in(name, &[**room]));
        rooms.max_by_key(|(_, room)| room.len()).map(|(place, _)| place)
    }
}

/// Names from the crate down, such as `["store", "read"]`.
type Names = Vec<String>;

/// A path as a file writes it, such as `super::read::Page`.
struct Mention {
    /// The module in which the path is written.
    at: Names,
    path: Names,
    /// Whether a `pub use` re-exports the path.
    exported: bool,
    /// Whether the path is written inside `#[cfg(test)]`.
    test: bool,
    /// Whether the path is written in a documentation comment.
    doc: bool,
}

impl Mention {
    /// Whether a module re-exports an item of its own submodule. This does not count as a use.
    fn reexports(&self, module: &Names, target: &Names) -> bool {
        self.exported && target.starts_with(module)
    }
}

/// Collects the paths of one file.
#[derive(Default)]
struct Reader {
    at: Names,
    test: bool,
    mentions: Vec<Mention>,
    /// The names that `use` gives, each with its module and the path that it stands for.
    imports: Vec<(Names, String, Names)>,
}

impl Reader {
    fn read(&mut self, tokens: &[TokenTree]) {
        let mut i = 0;
        let mut visible = false;
        while i < tokens.len() {
            match &tokens[i] {
                // `use<'a>` is not an import.
                TokenTree::Ident(word) if word == "use" && !is_punct(tokens.get(i + 1), '<') => {
                    i = self.read_import(tokens, i + 1, &[], visible);
                }
                TokenTree::Ident(word) if word == "mod" && is_block(tokens.get(i + 2)) => {
                    self.at.push(tokens[i + 1].to_string());
                    self.read_group(&tokens[i + 2]);
                    self.at.pop();
                    i += 3;
                }
                TokenTree::Ident(word) => {
                    visible = word == "pub";
                    let (path, end) = path(tokens, i);
                    if path.len() > 1 || is_item(tokens, i) {
                        self.push(path, false, false);
                    }
                    i = end;
                }
                TokenTree::Group(_) if is_test_attribute(tokens, i) => {
                    let item = &tokens[i + 1..];
                    let end = item
                        .iter()
                        .position(|token| is_punct(Some(token), ';') || is_block(Some(token)));
                    let end = end.map_or(item.len(), |end| end + 1);
                    let outside = std::mem::replace(&mut self.test, true);
                    self.read(&item[..end]);
                    self.test = outside;
                    i += 1 + end;
                }
                token => {
                    self.read_group(token);
                    i += 1;
                }
            }
        }
    }

    fn read_group(&mut self, token: &TokenTree) {
        let TokenTree::Group(group) = token else { return };
        let text = group.stream().to_string();
        if group.delimiter() == Delimiter::Bracket && text.starts_with("doc =") {
            self.read_documentation(&text);
        } else {
            self.read(&group.stream().into_iter().collect::<Vec<_>>());
        }
    }

    /// Reads one branch of a `use`, up to `;` or `,`. Returns the index behind it.
    fn read_import(
        &mut self,
        tokens: &[TokenTree],
        start: usize,
        above: &[String],
        exported: bool,
    ) -> usize {
        let mut path = above.to_vec();
        let mut alias = None;
        let mut i = start;
        while let Some(token) = tokens.get(i) {
            i += 1;
            match token {
                TokenTree::Ident(word) if word == "as" => {
                    alias = tokens.get(i).map(ToString::to_string);
                }
                // `a::{self}` is `a`.
                TokenTree::Ident(word) if word == "self" && !path.is_empty() => {}
                TokenTree::Ident(word) if alias.is_none() => path.push(word.to_string()),
                TokenTree::Group(group) => {
                    let branches: Vec<TokenTree> = group.stream().into_iter().collect();
                    let mut next = 0;
                    while next < branches.len() {
                        next = self.read_import(&branches, next, &path, exported);
                    }
                    return i;
                }
                TokenTree::Punct(punct) if punct.as_char() == '*' => path.push("*".into()),
                TokenTree::Punct(punct) if matches!(punct.as_char(), ';' | ',') => break,
                _ => {}
            }
        }
        if let Some(name) = alias.or_else(|| path.last().cloned()) {
            self.imports.push((self.at.clone(), name, path.clone()));
            self.push(path, exported, false);
        }
        i
    }

    fn read_documentation(&mut self, text: &str) {
        for word in text.split(|c: char| !c.is_alphanumeric() && c != '_' && c != ':') {
            let path: Names = word.split("::").map(str::to_owned).collect();
            if path.len() > 1 {
                self.push(path, false, true);
            }
        }
    }

    fn push(&mut self, path: Names, exported: bool, doc: bool) {
        self.mentions.push(Mention { at: self.at.clone(), path, exported, test: self.test, doc });
    }
}

fn is_punct(token: Option<&TokenTree>, c: char) -> bool {
    matches!(token, Some(TokenTree::Punct(punct)) if punct.as_char() == c)
}

fn is_group(token: Option<&TokenTree>, delimiter: Delimiter) -> bool {
    matches!(token, Some(TokenTree::Group(group)) if group.delimiter() == delimiter)
}

fn is_block(token: Option<&TokenTree>) -> bool {
    is_group(token, Delimiter::Brace)
}

fn is_test_attribute(tokens: &[TokenTree], at: usize) -> bool {
    at > 0
        && is_punct(tokens.get(at - 1), '#')
        && tokens[at].to_string().replace(' ', "") == "[cfg(test)]"
}

/// Whether a single word may name an item: a type, a constant or a function, but no field, method or variable.
fn is_item(tokens: &[TokenTree], at: usize) -> bool {
    let called = is_group(tokens.get(at + 1), Delimiter::Parenthesis);
    let member = at > 0 && is_punct(tokens.get(at - 1), '.');
    !member && (called || tokens[at].to_string().starts_with(char::is_uppercase))
}

/// The path that begins at this word, and the index behind it.
fn path(tokens: &[TokenTree], start: usize) -> (Names, usize) {
    let mut out = vec![tokens[start].to_string()];
    let mut i = start + 1;
    while is_punct(tokens.get(i), ':') && is_punct(tokens.get(i + 1), ':') {
        let Some(TokenTree::Ident(word)) = tokens.get(i + 2) else { break };
        out.push(word.to_string());
        i += 3;
    }
    (out, i)
}

/// The files that each file uses, each with a path that the using file contains.
type Uses<File> = BTreeMap<File, BTreeMap<File, String>>;

/// The sources of one crate.
struct Sources {
    layout: &'static Layout,
    /// The modules that have a file, each with the name of the file.
    files: BTreeMap<Names, String>,
    mentions: Vec<Mention>,
    imports: BTreeMap<(Names, String), Names>,
}

impl Sources {
    fn new(layout: &'static Layout, texts: &[(String, String)]) -> Self {
        let mut out =
            Self { layout, files: BTreeMap::new(), mentions: Vec::new(), imports: BTreeMap::new() };
        for (file, text) in texts {
            let name = module_name(file);
            let module: Names = if name == ROOT {
                Vec::new()
            } else {
                name.split('/').map(str::to_owned).collect()
            };
            let mut reader = Reader { at: module.clone(), ..Reader::default() };
            let tokens: TokenStream =
                text.parse().unwrap_or_else(|error| panic!("{file}: {error}"));
            reader.read(&tokens.into_iter().collect::<Vec<_>>());
            out.files.insert(module, file.clone());
            out.mentions.extend(reader.mentions);
            out.imports
                .extend(reader.imports.into_iter().map(|(at, name, path)| ((at, name), path)));
        }
        out
    }

    /// Reads the files of one crate from the disk.
    fn of(layout: &'static Layout) -> Self {
        let mut texts = read_sources(layout.dir, "rs");
        // The program only calls the library.
        texts.retain(|(file, _)| file != "main.rs");
        Self::new(layout, &texts)
    }

    /// The file of a module, or of the file around an inline module.
    fn file(&self, module: &[String]) -> (&Names, &str) {
        let around =
            (0..=module.len()).rev().find_map(|end| self.files.get_key_value(&module[..end]));
        let (module, file) = around.expect("the crate has a root");
        (module, file)
    }

    fn is_module(&self, names: &[String]) -> bool {
        self.files.contains_key(names)
    }

    /// The module that defines what a path names, and the path from there. Re-exports are followed. Returns `None`
    /// for other crates and for local names.
    fn resolve(&self, at: &[String], path: &[String]) -> Option<(Names, Names)> {
        let mut here = at.to_vec();
        let mut rest = path;
        match path.first()?.as_str() {
            "crate" => here.clear(),
            "self" => {}
            "super" => drop(here.pop()),
            name if self.is_module(&[at, &[name.to_owned()]].concat()) => {
                return self.descend(here, path);
            }
            name => {
                let import = self.imports.get(&(here.clone(), name.to_owned()))?;
                // `use serde;` imports another crate, so there is no path to follow.
                let known = import.first() != path.first();
                return known.then(|| self.resolve(at, &[import, &path[1..]].concat()))?;
            }
        }
        rest = &rest[1..];
        while rest.first().is_some_and(|name| name == "super") {
            here.pop();
            rest = &rest[1..];
        }
        self.descend(here, rest)
    }

    fn descend(&self, mut here: Names, mut rest: &[String]) -> Option<(Names, Names)> {
        while let Some(name) = rest.first() {
            let child = [here.as_slice(), std::slice::from_ref(name)].concat();
            if self.is_module(&child) {
                here = child;
                rest = &rest[1..];
            } else if let Some(import) = self.imports.get(&(here.clone(), name.clone())) {
                return self.resolve(&here, &[import, &rest[1..]].concat());
            } else {
                break;
            }
        }
        Some((here, rest.to_vec()))
    }

    /// Each use of a later room, and each use of a path that is reserved to other rooms.
    fn wrong_arrows(&self) -> BTreeSet<String> {
        let mut out = BTreeSet::new();
        for mention in &self.mentions {
            let (module, file) = self.file(&mention.at);
            let room = self.layout.room(&module.join("/"));
            let path = mention.path.join("::");
            if let Some((target, item)) = self.resolve(&mention.at, &mention.path) {
                let later = self.layout.room(&target.join("/")) > room;
                if room.is_some() && later && !mention.reexports(module, &target) {
                    out.insert(format!("{file} uses {path} of a later room"));
                }
                // A glob import hides the imported names from this check.
                if item == ["*"] && !mention.test {
                    out.insert(format!("{file} uses {path} instead of names"));
                }
            }
            for (reserved, rooms) in self.layout.reserved {
                let rest = path.strip_prefix(reserved).filter(|_| !mention.doc && !mention.test);
                let used = rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(':'));
                if used && !room.is_some_and(|room| is_in(self.layout.rooms[room], rooms)) {
                    out.insert(format!("{file} uses {reserved}, reserved to {rooms:?}"));
                }
            }
        }
        out
    }

    /// The uses between the files.
    fn uses(&self) -> Uses<&str> {
        let mut out = Uses::<&str>::new();
        for mention in self.mentions.iter().filter(|mention| !mention.test && !mention.doc) {
            let (from, file) = self.file(&mention.at);
            let Some((to, item)) = self.resolve(&mention.at, &mention.path) else { continue };
            let (to, target) = self.file(&to);
            // An imported module is not a use. The paths that begin with its name are.
            if !item.is_empty() && !mention.reexports(from, to) && to != from {
                out.entry(file).or_default().entry(target).or_insert(mention.path.join("::"));
            }
        }
        out
    }
}

/// Each use that is part of a cycle: the used file depends, perhaps through others, on the file that uses it.
fn circles<File: Ord + Display>(uses: &Uses<File>) -> BTreeSet<String> {
    let leads_to = |from: &File, to: &File| {
        let (mut seen, mut next) = (BTreeSet::new(), vec![from]);
        while let Some(file) = next.pop() {
            if seen.insert(file) {
                next.extend(uses.get(file).into_iter().flat_map(BTreeMap::keys));
            }
        }
        seen.contains(to)
    };
    let pairs = uses
        .iter()
        .flat_map(|(from, targets)| targets.iter().map(move |(to, path)| (from, to, path)));
    pairs
        .filter(|(from, to, _)| leads_to(to, from))
        .map(|(from, to, path)| format!("{from} → {to} ({path})"))
        .collect()
}

/// The module of a file, such as `store/read` of `store/read.rs` and `store` of `store/mod.rs`.
fn module_name(file: &str) -> &str {
    let name = file.strip_suffix(".rs").expect("a Rust file");
    name.strip_suffix("/mod").unwrap_or(name)
}

/// Every file with this extension below a directory of the project, named relative to it, with its text.
fn read_sources(dir: &str, extension: &str) -> Vec<(String, String)> {
    fn walk(dir: &Path, prefix: &str, extension: &str, out: &mut Vec<(String, String)>) {
        for entry in fs::read_dir(dir).unwrap() {
            let entry = entry.unwrap();
            let name = format!("{prefix}{}", entry.file_name().into_string().unwrap());
            if entry.file_type().unwrap().is_dir() {
                walk(&entry.path(), &format!("{name}/"), extension, out);
            } else if Path::new(&name).extension().is_some_and(|end| end == extension) {
                out.push((name, fs::read_to_string(entry.path()).unwrap()));
            }
        }
    }
    let mut out = Vec::new();
    walk(&Path::new(env!("CARGO_MANIFEST_DIR")).join(dir), "", extension, &mut out);
    out
}

/// What a check finds in the crates, one line each.
fn find(check: impl Fn(&Sources) -> BTreeSet<String>) -> String {
    let mut out = String::new();
    for layout in &LAYOUTS {
        for line in check(&Sources::of(layout)) {
            writeln!(out, "{}/{line}", layout.dir).unwrap();
        }
    }
    out
}

#[test]
fn every_file_belongs_to_one_room() {
    let main = fs::read_to_string("src/main.rs").unwrap();
    assert!(main.contains("fretwork::cli::main()") && !main.contains("mod "), "{main}");
    let crates = fs::read_dir("crates").unwrap().map(|entry| entry.unwrap().path().join("src"));
    for dir in crates.chain(["src".into()]) {
        let layout = LAYOUTS.iter().find(|layout| Path::new(layout.dir) == dir);
        let layout = layout.unwrap_or_else(|| panic!("no layout of {}", dir.display()));
        let modules: Vec<_> = Sources::of(layout).files.into_keys().collect();
        for module in modules.iter().map(|names| names.join("/")) {
            let owned = layout.rooms.is_empty() || layout.room(&module).is_some();
            assert!(module.is_empty() || owned, "{}/{module} belongs to no room", layout.dir);
        }
        for room in layout.rooms {
            let below = |module: &Names| module.join("/").starts_with(room);
            assert!(modules.iter().any(below), "the room {room} has no files");
        }
    }
}

#[test]
fn statistics_do_not_use_json() {
    for (file, text) in read_sources("crates/study/src/stats", "rs") {
        for word in ["json", "serde", "deserr"] {
            assert!(!text.contains(word), "stats/{file} uses {word}");
        }
    }
}

#[test]
fn no_room_uses_a_later_room() {
    let found = find(Sources::wrong_arrows);
    assert!(found.is_empty(), "{found}");
}

#[test]
fn files_have_no_cyclic_dependencies() {
    let found = find(|sources| circles(&sources.uses()));
    assert!(found.is_empty(), "{found}");
}

const HOUSE: Layout = Layout {
    dir: "src",
    rooms: &["plot", "job", "store", "http"],
    reserved: &[
        ("axum", &["http"]),
        ("sqlx", &["store"]),
        ("std::thread", &["store", "http"]),
        ("std::time", &["job", "store", "http"]),
        ("tokio", &["store", "http"]),
    ],
};

fn sources(texts: &[(&str, &str)]) -> Sources {
    let mut texts: Vec<_> =
        texts.iter().map(|(file, text)| ((*file).into(), (*text).into())).collect();
    texts.push(("lib.rs".into(), "pub mod plot; pub mod job; pub mod store; pub mod http;".into()));
    Sources::new(&HOUSE, &texts)
}

#[test]
fn a_forbidden_dependency_is_found_in_every_syntax() {
    for (file, text) in [
        ("plot/scale.rs", "use crate::job::Key;"),
        ("job.rs", "use crate::{plot::scale, store::Store};"),
        ("job.rs", "use crate::{plot::scale, store::Store as S};"),
        ("job.rs", "fn f() -> super::store::Store {}"),
        ("job.rs", "fn f() { vec![crate::store::new()] }"),
        ("job.rs", "use crate::{plot, store}; fn f() { plot::new() }"),
        ("job.rs", "use crate::*; fn f() { store::new() }"),
        ("job.rs", "#[cfg(test)] mod tests { use crate::store::Store; }"),
        ("job.rs", "#[derive(crate::store::Row)] struct A;"),
        ("store/read.rs", "//! As [`http`](crate::http) shows it."),
        ("store/read.rs", "use super::super::http;"),
        ("http/jobs.rs", "fn f() { sqlx::query(\"\"); }"),
        ("http/jobs.rs", "use sqlx;"),
        ("store/read.rs", "use axum::Router;"),
        ("job.rs", "use tokio::sync::watch;"),
        ("plot/scale.rs", "use std::time::Instant;"),
        ("plot/scale.rs", "use std::{fmt, thread};"),
    ] {
        let mut texts =
            vec![("plot/mod.rs", ""), ("store/mod.rs", ""), ("http/mod.rs", ""), (file, text)];
        if file != "job.rs" {
            texts.push(("job.rs", ""));
        }
        let found = sources(&texts).wrong_arrows();
        assert_eq!(found.len(), 1, "{text} in {file}: {found:?}");
    }
}

#[test]
fn a_use_of_an_earlier_room_is_allowed() {
    let found = sources(&[
        ("plot/mod.rs", "/// Not `std::time`, but std::times. use sqlx;\npub struct Figure;"),
        ("job.rs", "use crate::plot::Figure; use std::time::Duration; // use crate::store;"),
        ("store/mod.rs", "use tokio::time; use sqlx::Row; const S: &str = \"crate::http::f\";"),
        ("http/mod.rs", "use axum::Router; use mycrate::store; fn f() { crate::store::f() }"),
    ]);
    assert!(found.wrong_arrows().is_empty(), "{:?}", found.wrong_arrows());
}

#[test]
fn a_dependency_cycle_through_reexports_and_imports_is_found() {
    let found = sources(&[
        ("job.rs", ""),
        (
            "store/mod.rs",
            "mod read; mod write; mod open; pub use read::{Page, Row as Line}; pub struct Store;",
        ),
        ("store/read.rs", "use super::write; fn f() { write::all() }"),
        ("store/write.rs", "use super::Line;"),
        ("store/open.rs", "use super::{Page, Store}; use crate::job::Job;"),
    ]);
    let expected = [
        "store/read.rs → store/write.rs (write::all)",
        "store/write.rs → store/read.rs (super::Line)",
    ];
    assert_eq!(circles(&found.uses()), BTreeSet::from(expected.map(String::from)));
}

#[test]
fn a_reexport_that_is_also_used_creates_a_dependency_cycle() {
    let found = sources(&[
        ("store/mod.rs", "mod read; pub use read::Page; pub struct Store(Page);"),
        ("store/read.rs", "use super::Store; pub struct Page;"),
    ]);
    assert_eq!(circles(&found.uses()).len(), 2, "{:?}", circles(&found.uses()));
}

#[test]
fn tests_documentation_and_reexports_create_no_dependency_cycle() {
    let found = sources(&[
        ("store/mod.rs", "mod read; pub(crate) use read::Page; pub struct Store;"),
        ("store/read.rs", "use super::Store; pub struct Page;"),
        (
            "job.rs",
            "/// See [`Figure`](crate::plot::Figure).\n#[cfg(test)]\nmod tests { use super::*; use crate::plot::Figure; }",
        ),
        ("plot.rs", "use crate::job::Key;"),
    ]);
    assert!(circles(&found.uses()).is_empty(), "{:?}", circles(&found.uses()));
}
