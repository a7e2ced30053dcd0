//! Checks that one name stands for one thing, or for two at most: readers of one file must not think of another.

use std::collections::BTreeMap;
use std::fs;

use crate::documents::{files, suffix};

/// Names that each crate may use for its own, as the standard library does.
const OWN: [&str; 2] = ["Error", "Result"];

/// The type that a line declares. Declarations inside functions, macros and tests are indented.
fn declared(line: &str) -> Option<&str> {
    let item = line.strip_prefix("pub").map_or(line, |rest| match rest.strip_prefix('(') {
        Some(scoped) => scoped.split_once(") ").map_or("", |(_, item)| item),
        None => rest.trim_start(),
    });
    let (keyword, rest) = item.split_once(' ')?;
    let name = rest.split(|c: char| !c.is_alphanumeric()).next();
    name.filter(|_| ["struct", "enum", "trait", "type"].contains(&keyword))
}

#[test]
fn no_type_name_stands_for_more_than_two_things() {
    let is_source = |file: &String| file.contains("src/") && suffix(file) == Some("rs");
    let mut places = BTreeMap::<String, Vec<String>>::new();
    for file in files(&["crates", "src"]).into_iter().filter(is_source) {
        for name in fs::read_to_string(&file).unwrap().lines().filter_map(declared) {
            places.entry(name.to_owned()).or_default().push(file.clone());
        }
    }
    assert!(places.contains_key("Scenario") && places.contains_key("Store"), "{places:?}");
    places.retain(|name, files| files.len() > 2 && !OWN.contains(&name.as_str()));
    assert!(places.is_empty(), "rename some of these types: {places:#?}");
}
