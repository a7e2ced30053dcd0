//! The rooms of the house stand in a row, and each knows only those to its left: the sources are
//! read, and every path from one room to another is judged.

use std::fs;
use std::path::Path;

/// From left to right; the files that make the program are one room.
const ROW: [&str; 8] =
    ["plot", "verification", "job", "format", "store", "service", "http", "main"];

/// What only some rooms may use: a path, and the rooms.
const RESERVED: [(&str, &[&str]); 5] = [
    ("sqlx", &["store"]),
    ("axum", &["http", "main"]),
    ("tokio", &["store", "service", "http", "main"]),
    ("std::time", &["job", "store", "service", "http", "main"]),
    ("std::thread", &["job", "store", "service", "http", "main"]),
];

/// The room that a name directly below the crate belongs to.
fn room(name: &str) -> Option<&'static str> {
    let name = if matches!(name, "cli" | "config" | "telemetry") { "main" } else { name };
    ROW.into_iter().find(|room| *room == name)
}

/// What follows `root::` wherever it stands in a source, one name for each branch of braces.
/// Comments count: what the documentation of a room points at, the room knows.
fn heads<'a>(source: &'a str, root: &str) -> Vec<&'a str> {
    let mut out = Vec::new();
    let root = format!("{root}::");
    for (start, _) in source.match_indices(&root) {
        let before = source[..start].chars().next_back();
        // A longer name, or a longer path: `tokio::sync` is no `sync`.
        if before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':') {
            continue;
        }
        branches(&source[start + root.len()..], &mut out);
    }
    out
}

/// The first names of what stands here: of one path, or of all within braces.
fn branches<'a>(text: &'a str, out: &mut Vec<&'a str>) {
    let Some(group) = text.strip_prefix('{') else {
        let end = text.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(text.len());
        // A star takes everything; that it is refused is as it should be.
        out.push(if end == 0 { &text[..text.len().min(1)] } else { &text[..end] });
        return;
    };
    let mut depth = 0;
    let mut begins = true;
    for (place, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 0 => return,
            '}' => depth -= 1,
            ',' if depth == 0 => begins = true,
            c if begins && !c.is_whitespace() => {
                branches(&group[place..], out);
                begins = false;
            }
            _ => {}
        }
    }
}

/// Whether a source uses a path such as `sqlx` or `std::time`.
fn mentions(source: &str, path: &str) -> bool {
    match path.split_once("::") {
        Some((root, name)) => heads(source, root).contains(&name),
        None => !heads(source, path).is_empty() || source.contains(&format!("use {path};")),
    }
}

/// Everything that one file of a room should not know.
fn faults(file: &str, source: &str) -> Vec<String> {
    let name = file.split(['/', '.']).next().unwrap_or_default();
    let Some(own) = room(name) else {
        return vec![format!("{file} belongs to no room")];
    };
    let mut out = Vec::new();
    let place = |room: &str| ROW.iter().position(|other| *other == room);
    for root in ["crate", "fretwork", "super"] {
        for head in heads(source, root) {
            match room(head) {
                Some(other) if place(other) > place(own) => {
                    out.push(format!("{file} uses {other}, which is to the right of {own}"));
                }
                // Within a room names are its own business.
                None if root == "super" => {}
                None => out.push(format!("{file} uses {root}::{head}, which is no room")),
                Some(_) => {}
            }
        }
    }
    // Steps out of a room are written from the crate down, where they are seen.
    if source.contains("super::super::") {
        out.push(format!("{file} has a path with super::super"));
    }
    for (path, rooms) in RESERVED {
        if mentions(source, path) && !rooms.contains(&own) {
            out.push(format!("{file} uses {path}, which is for {}", rooms.join(", ")));
        }
    }
    out
}

/// Every Rust file below a directory, named relative to it.
fn sources(dir: &Path, prefix: &str, out: &mut Vec<(String, String)>) {
    for entry in fs::read_dir(dir).unwrap() {
        let entry = entry.unwrap();
        let name = format!("{prefix}{}", entry.file_name().into_string().unwrap());
        if entry.file_type().unwrap().is_dir() {
            sources(&entry.path(), &format!("{name}/"), out);
        } else if Path::new(&name).extension().is_some_and(|end| end == "rs") {
            out.push((name, fs::read_to_string(entry.path()).unwrap()));
        }
    }
}

#[test]
fn no_room_knows_a_room_to_its_right() {
    let mut files = Vec::new();
    sources(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/src")), "", &mut files);
    // It only says which rooms there are.
    files.retain(|(name, _)| name != "lib.rs");
    for room in ROW {
        let begins = |(name, _): &&(String, String)| name.split(['/', '.']).next() == Some(room);
        assert!(files.iter().any(|file| begins(&file)), "no file of {room} was read");
    }
    let faults: Vec<String> =
        files.iter().flat_map(|(name, source)| faults(name, source)).collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn a_path_is_found_however_it_is_written() {
    assert_eq!(
        heads("use crate::{plot::{a, b}, job, store::c};", "crate"),
        ["plot", "job", "store"]
    );
    assert_eq!(heads("let x = crate::http::f(mycrate::store::g());", "crate"), ["http"]);
    assert_eq!(heads("use crate::*;", "crate"), ["*"]);
    assert!(mentions("use std::{fmt, time::Duration};", "std::time"));
    assert!(!mentions("use tokio::time; use std::fmt;", "std::time"));
    assert!(mentions("use sqlx;", "sqlx") && mentions("sqlx::query()", "sqlx"));
}

#[test]
fn a_look_to_the_right_is_a_fault() {
    for (file, source) in [
        ("plot/scale.rs", "use crate::job::Key;"),
        ("job.rs", "use crate::{plot::scale, store::Store};"),
        ("job.rs", "fn f() -> super::store::Store {}"),
        ("store/read.rs", "//! As [`api`](crate::http) shows it."),
        ("service/mod.rs", "use fretwork::http;"),
        ("store/read.rs", "use super::super::service;"),
        ("http/mod.rs", "use crate::config::Serve;"),
        ("http/jobs.rs", "sqlx::query(\"\");"),
        ("service/mod.rs", "use axum::Router;"),
        ("job.rs", "use tokio::sync::watch;"),
        ("plot/scale.rs", "use std::time::Instant;"),
        ("plot/scale.rs", "use std::{fmt, thread};"),
        ("attic.rs", ""),
        ("job.rs", "use crate::attic;"),
    ] {
        assert_eq!(faults(file, source).len(), 1, "{source} in {file}: {:?}", faults(file, source));
    }
    assert!(faults("service/mod.rs", "use crate::store::Store;").is_empty());
    assert!(faults("main.rs", "use fretwork::http; use crate::config::Cli;").is_empty());
}
