//! The file of a report: the style and the modules of the page, and the documents of a result, in one HTML page.
//!
//! The modules of the page import each other by relative addresses, which a module at a `data:` address cannot have. In the
//! file they have bare names, and an import map gives each name the text of its module. The file has only the modules that
//! `report.js` reaches. `offline.js` replaces those that need a server.

use std::collections::btree_map::{BTreeMap, Entry};
use std::fmt::Write as _;
use std::sync::LazyLock;

use data_encoding::BASE64;
use sha2::{Digest as _, Sha256};

use super::scripts;
use fretwork_format::report::Content;

const STYLE: &str = include_str!("style.css");
const ICON: &str = include_str!("icon.svg");
/// The script that begins.
const ENTRY: &str = "import \"report/report.js\";";
/// What `offline.js` replaces.
const REPLACED: [&str; 10] = [
    "access/allowed.js",
    "access/api.js",
    "fit/form.js",
    "library/actions.js",
    "library/derived.js",
    "library/owners.js",
    "measure/dialog.js",
    "measure/measure.js",
    "study/vary.js",
    "quantities/system.js",
];

/// What all files have in common.
struct Shell {
    /// The content security policy, which also holds for a saved file.
    policy: String,
    /// The import map.
    modules: String,
    /// The address of the icon: without one, a browser asks the server for it.
    icon: String,
}

/// The hashes allow only the scripts and the style of the program. Modules need `data:`, which is no hole: the file is
/// well-formed whatever it contains, so that no text of a user becomes an element, and a script could send nothing, because
/// only pictures at `data:` addresses are loaded.
static SHELL: LazyLock<Shell> = LazyLock::new(|| {
    let modules = modules();
    let hash = |text: &str| format!("'sha256-{}'", BASE64.encode(&Sha256::digest(text)));
    let policy = format!(
        "default-src 'none'; script-src {} {} data:; style-src {}; img-src data:; base-uri 'none'; form-action 'none'",
        hash(&modules),
        hash(ENTRY),
        hash(STYLE),
    );
    Shell { policy, modules, icon: encoded("image/svg+xml", ICON) }
});

/// The policy of a served report. In its sandbox, it has an origin of its own: it can use neither the session of the browser
/// nor what the page keeps. The dialog that prints is a modal.
pub fn policy() -> String {
    let own = &SHELL.policy;
    format!("{own}; frame-ancestors 'none'; sandbox allow-scripts allow-downloads allow-modals")
}

/// The file.
pub fn page(Content { title, body, data }: &Content) -> String {
    let Shell { policy, modules, icon } = &*SHELL;
    let title = fretwork_format::escape(title);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"/>\
         <meta http-equiv=\"Content-Security-Policy\" content=\"{policy}\"/>\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/><meta name=\"color-scheme\" content=\"light dark\"/>\
         <title>{title} · fretwork</title><link rel=\"icon\" href=\"{icon}\"/><style>{STYLE}</style>\n\
         <script type=\"importmap\">{modules}</script>\n\
         <script type=\"module\">{ENTRY}</script></head>\n\
         <body class=\"report\"><header class=\"top\"><span class=\"brand\">fretwork</span><div class=\"tools\"></div></header>\n\
         <main id=\"main\">{body}</main>\n<p id=\"status\" class=\"toast\" role=\"status\" aria-live=\"polite\"></p>\n\
         <script id=\"data\" type=\"application/json\">{data}</script></body></html>\n"
    )
}

/// The import map of the modules that `report.js` reaches.
fn modules() -> String {
    #[expect(clippy::expect_used, reason = "a test makes the map")]
    let text = |name: &str| {
        if REPLACED.contains(&name) {
            return "export * from \"../report/offline.js\";";
        }
        let own = scripts().find(|(own, ..)| *own == name);
        own.expect("the page has each module that it imports").2
    };
    let mut found = BTreeMap::new();
    let mut wanted = vec!["report/report.js".to_owned()];
    while let Some(name) = wanted.pop() {
        let Entry::Vacant(place) = found.entry(name) else { continue };
        let mut pieces = Vec::new();
        for piece in text(place.key()).split('"') {
            let module = imported(place.key(), piece);
            wanted.extend(module.clone());
            pieces.push(module.unwrap_or_else(|| piece.to_owned()));
        }
        place.insert(encoded("text/javascript", &pieces.join("\"")));
    }
    let entries = found.iter().map(|(name, address)| format!("\"{name}\":\"{address}\""));
    format!("{{\"imports\":{{{}}}}}", entries.collect::<Vec<_>>().join(",\n"))
}

/// The bare name of a module, if a text between quotes is an address relative to the module `from`.
fn imported(from: &str, piece: &str) -> Option<String> {
    let (folder, _) = from.split_once('/')?;
    let near = piece.strip_prefix("./").map(|name| format!("{folder}/{name}"));
    near.or_else(|| piece.strip_prefix("../").map(str::to_owned))
}

/// The `data:` address of a text. It has no sign that means something to HTML, JSON or the end of an address.
fn encoded(media_type: &str, text: &str) -> String {
    let mut address = format!("data:{media_type},");
    for sign in text.chars() {
        match sign {
            '%' | '#' | '"' | '\\' | '<' | '&' | '\n' => {
                let _ = write!(address, "%{:02X}", sign as u32);
            }
            sign => address.push(sign),
        }
    }
    address
}
