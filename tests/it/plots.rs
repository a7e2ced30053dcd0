//! Figures of results: every quantity of every example is well formed and legible, over HTTP and from the command line.

use std::fs;
use std::path::PathBuf;

use fretwork::http;
use fretwork_format::{
    self as format, Error, FigureOptions, Format, Part, QUANTITIES, Quantity, View,
};
use fretwork_job::{Step, Submission};
use roxmltree::{Document, Node};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::figures::legible;
use crate::program;
use crate::server::{Server, steel_ball};

/// The stored document of a job body.
fn computed(body: &str) -> Vec<u8> {
    let mut work = Submission::parse(body.as_bytes()).unwrap().prepared.start();
    loop {
        if let Step::Done(answer) = work.step() {
            return answer.body.to_vec();
        }
    }
}

/// The example jobs, and a cone, whose pressure has poles at cycle 0.
fn bodies() -> Vec<(String, String)> {
    let directory = concat!(env!("CARGO_MANIFEST_DIR"), "/examples");
    let paths = fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path());
    let files = paths.filter(|path: &PathBuf| path.extension().is_some_and(|end| end == "json"));
    let read = |path: PathBuf| {
        let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
        (name, fs::read_to_string(path).unwrap())
    };
    let mut out: Vec<_> = files.map(read).collect();
    assert!(out.len() >= 9);
    out.push(("cone".to_owned(), cone(&json!("all")).to_string()));
    out
}

/// A cone with 13 output cycles.
fn cone(profiles_at: &Value) -> Value {
    json!({"scenario": {
        "profile": {"shape": "cone", "slope_angle": "2 deg"},
        "moduli": {"normal": "112 GPa", "tangential": "92 GPa"},
        "friction": 0.5, "wear": {"coefficient": 3e-14},
        "load": {"indentation_depth": "2 um", "held": "depth"}, "motion": {"stick_ratio": 0.5},
        "cycles": {"from": 100, "to": 100_000, "count": 13, "spacing": "log"},
        "profiles_at": profiles_at,
    }})
}

#[tokio::test(flavor = "multi_thread")]
async fn missing_cycles_of_a_large_result_are_refused() {
    let server = Server::start().await;
    let mut body = cone(&json!("all"));
    body["scenario"]["model"] = json!({"method": "simplified", "points": 4096});
    let job = server.compute(&body).await.json();
    let result = job["links"]["result"].as_str().unwrap();
    for part in ["plot.svg?quantity=pressure&", "profiles?"] {
        let reply = server.get(&format!("{result}/{part}cycles=7,1000")).await;
        let errors = reply.problem(422, "invalid-parameters")["errors"].take();
        let detail = errors[0]["detail"].as_str().unwrap();
        assert!(detail.starts_with("7 is not an output cycle; the output cycles are 0, 100"));
        assert_eq!(errors.as_array().unwrap().len(), 1, "{errors}");
    }
}

fn drawn(stored: &[u8], view: &View) -> Result<String, Error> {
    let mut svg = Vec::new();
    format::write(&mut svg, stored, Part::Plot, Format::Svg, view)?;
    Ok(String::from_utf8(svg).unwrap())
}

fn plotted(stored: &[u8], quantity: &str) -> String {
    drawn(stored, &View::figure(Quantity::named(quantity).unwrap())).unwrap()
}

/// All numbers in a text.
pub fn numbers(text: &str) -> Vec<f64> {
    text.split(|c: char| !c.is_ascii_digit() && c != '.' && c != '-')
        .filter_map(|number| number.parse().ok())
        .collect()
}

/// The clipped part of the drawing.
pub fn window<'a>(document: &'a Document) -> Node<'a, 'a> {
    document.descendants().filter(|node| node.has_tag_name("svg")).nth(1).unwrap()
}

/// The frame: left, top, right, bottom.
pub fn frame(document: &Document) -> [f64; 4] {
    let window = window(document);
    let side = |name: &str| window.attribute(name).unwrap().parse::<f64>().unwrap();
    [side("x"), side("y"), side("x") + side("width"), side("y") + side("height")]
}

/// Checks the properties that all figures must have.
fn sound(svg: &str, size: (u16, u16), name: &str) {
    assert!(legible(svg) > 5, "{name}");
    let document = Document::parse(svg).unwrap();
    let root = document.root_element();
    let [left, top, right, bottom] = frame(&document);
    assert_eq!(root.attribute("width"), Some(&*size.0.to_string()));
    assert_eq!(root.attribute("height"), Some(&*size.1.to_string()));
    assert!(right - left > 0.3 * f64::from(size.0), "{name}");
    assert!(bottom - top > 0.5 * f64::from(size.1), "{name}");
    assert!(window(&document).children().any(|node| node.is_element()), "{name} shows nothing");
    for path in document.descendants().filter_map(|node| node.attribute("d")) {
        let plain = path.bytes().all(|byte| b"MLZ -.0123456789".contains(&byte));
        assert!(plain, "{name}: {path}");
    }
    // Ticks are at the left and the bottom of the frame.
    let group = root.children().find(|node| node.has_tag_name("g")).unwrap();
    let ticks = group.children().filter(|node| node.attribute("stroke") == Some("#000"));
    let mut count = 0;
    for tick in ticks.filter_map(|node| node.attribute("d")) {
        let at = numbers(&tick.replace(['M', 'L'], " "));
        let below = (left - 0.1..=right + 0.1).contains(&at[0]) && (at[1] - bottom).abs() < 0.1;
        let beside = (top - 0.1..=bottom + 0.1).contains(&at[1]) && (at[0] - left).abs() < 0.1;
        assert!(below || beside, "{name}: {tick}");
        count += 1;
    }
    assert!(count >= 4, "{name} has {count} ticks");
}

/// This takes more than 5 s, because it computes all examples.
#[test]
fn every_quantity_of_every_example_gives_a_legible_figure() {
    for (name, body) in bodies() {
        let stored = computed(&body);
        let document: Value = serde_json::from_slice(&stored).unwrap();
        for quantity in QUANTITIES.iter() {
            let column = match quantity.name {
                "loops" => &document["loops"]["displacement"][0],
                _ => &document["history"][quantity.name],
            };
            let column = column.as_array();
            let has = |is: fn(&Value) -> bool| column.is_none_or(|column| column.iter().any(is));
            // Displacements of a line contact without a reference are null. Only a rig has an actuator.
            if !has(Value::is_number) || column.is_none() && quantity.name.starts_with("actuator") {
                continue;
            }
            let name = format!("{name}, {}", quantity.name);
            let view = View::figure(quantity);
            let svg = drawn(&stored, &view).unwrap_or_else(|error| panic!("{name}: {error}"));
            sound(&svg, (640, 440), &name);
            assert!(svg == drawn(&stored, &view).unwrap(), "{name} changes");
            assert!(svg.len() < 120_000, "{name} has {} bytes", svg.len());
            // The smallest size, with logarithmic axes.
            let has_positive = has(|value| value.as_f64() > Some(0.0));
            let log = Some(true).filter(|_| !quantity.has_sign() && has_positive);
            let size = (320, 240);
            let figure =
                FigureOptions { quantity, log_x: log, log_y: log, size, ..Default::default() };
            let svg = drawn(&stored, &View { engineering: false, figure, ..view });
            sound(&svg.unwrap_or_else(|error| panic!("{name}: {error}")), size, &name);
        }
    }
}

#[test]
fn a_figure_contains_a_title_and_a_text_description() {
    // With the depth held, the limiting state is known.
    let stored =
        computed(&http::EXAMPLES[0].body.replace(r#""held": "force""#, r#""held": "depth""#));
    let key = serde_json::from_slice::<Value>(&stored).unwrap()["key"].as_str().unwrap().to_owned();
    let svg = plotted(&stored, "worn");
    let document = Document::parse(&svg).unwrap();
    let text = |name: &str| {
        let node = document.descendants().find(|node| node.tag_name().name() == name).unwrap();
        node.text().unwrap().to_owned()
    };
    assert_eq!((text("title"), text("identifier")), ("Worn profile".to_owned(), key));
    assert_eq!(text("creator"), "fretwork/5");
    let told = text("desc");
    for part in ["Height f (µm)", "paraboloid", "partial slip", "friction 0.7", "exact"] {
        assert!(told.contains(part), "{told}");
    }
    assert!(told.contains("Curves: Unworn, N = 1000, N = 3000") && told.ends_with("Limit."));
}

#[test]
fn an_infinite_pressure_is_drawn_above_the_frame() {
    // Results of earlier versions have such a pressure at the apex of a cone.
    let stored = computed(&cone(&json!([100])).to_string());
    let mut document: Value = serde_json::from_slice(&stored).unwrap();
    document["profiles"]["pressure"][0][0] = Value::Null;
    let stored = document.to_string().into_bytes();
    let view =
        View { cycles: Some(vec![0.0]), ..View::figure(Quantity::named("pressure").unwrap()) };
    let svg = drawn(&stored, &view).unwrap();
    let document = Document::parse(&svg).unwrap();
    let [left, top, _, bottom] = frame(&document);
    let curve = window(&document).children().find(|node| node.has_tag_name("path")).unwrap();
    let points = numbers(&curve.attribute("d").unwrap().replace(['M', 'L'], " "));
    // At the apex the curve starts above the frame, and the axis shows the finite pressures.
    assert!((points[0] - left).abs() < 0.01 && points[1] < top, "{points:?}");
    assert!(points[3] > top && points[3] < bottom);
    let highest = points.chunks(2).filter(|point| point[1] < top).count();
    assert_eq!(highest, 1);
}

#[test]
fn a_figure_shows_the_selected_or_evenly_spaced_output_cycles() {
    let stored = computed(&cone(&json!("all")).to_string());
    let legend = |quantity, cycles: Option<&[f64]>| {
        let view = View {
            cycles: cycles.map(<[f64]>::to_vec),
            ..View::figure(Quantity::named(quantity).unwrap())
        };
        let svg = drawn(&stored, &view).unwrap();
        let told = svg.split_once("Curves: ").unwrap().1;
        told.split_once(".</desc>").unwrap().0.to_owned()
    };
    assert!(legend("pressure", None).starts_with("Unworn, N = 316"));
    assert_eq!(legend("pressure", None).split(", ").count(), 6);
    let chosen = legend("wear", Some(&[100_000.0, 1000.0]));
    assert_eq!(chosen, "N = 1000, N = 100\u{202f}000");
    assert!(!legend("wear", None).contains("Unworn"));
}

#[test]
fn a_result_without_profiles_has_only_history_figures() {
    let stored = computed(&cone(&json!("none")).to_string());
    for quantity in QUANTITIES.iter() {
        let drawn = drawn(&stored, &View::figure(quantity));
        if quantity.has_curve_per_cycle() {
            let told = drawn.unwrap_err().to_string();
            assert!(told.contains("profiles_at") && told.contains("wear_volume"), "{told}");
        } else if quantity.name.starts_with("actuator") {
            assert!(drawn.unwrap_err().to_string().contains("`rig_stiffness`"));
        } else {
            sound(&drawn.unwrap(), (640, 440), quantity.name);
        }
    }
    // Earlier versions of the engine wrote no errors.
    let mut earlier: Value = serde_json::from_slice(&stored).unwrap();
    earlier["history"].as_object_mut().unwrap().remove("wear_volume_error").unwrap();
    let error = View::figure(Quantity::named("wear_volume_error").unwrap());
    let told = drawn(earlier.to_string().as_bytes(), &error).unwrap_err().to_string();
    let (because, offered) = told.split_once("Request one of").unwrap();
    assert!(because.contains("wear_volume_error is not available"), "{told}");
    assert!(offered.contains("wear_depth_error") && !offered.contains("wear_volume_error"));
    let stored = computed(http::EXAMPLES[0].body);
    let figure = FigureOptions {
        quantity: Quantity::named("wear").unwrap(),
        log_y: Some(true),
        ..FigureOptions::default()
    };
    let view = View { cycles: Some(vec![0.0]), figure, ..View::default() };
    let told = drawn(&stored, &view).unwrap_err().to_string();
    assert!(told.contains("no value is positive"), "{told}");
}

#[tokio::test(flavor = "multi_thread")]
async fn figures_have_etags_and_report_invalid_parameters() {
    let server = Server::start().await;
    let job = server.compute(&steel_ball()).await.json();
    let address = format!("{}/plot.svg", job["links"]["result"].as_str().unwrap());
    let figure = server.get(&address).await;
    assert_eq!((figure.status, figure.header("content-type")), (200, Some("image/svg+xml")));
    assert!(figure.header("cache-control").unwrap().contains("immutable"));
    assert!(figure.header("content-disposition").is_none());
    assert_eq!(figure.text(), plotted(&computed(&steel_ball().to_string()), "worn"));
    // An equivalent request has the same tag.
    let tag = figure.header("etag").unwrap();
    let other = server.get(&format!("{address}?width=640&units=engineering&quantity=worn")).await;
    assert_eq!((other.header("etag"), &other.body), (Some(tag), &figure.body));
    let held = server.send("GET", &address, &[("If-None-Match", tag)], "").await;
    assert_eq!((held.status, held.body.len(), held.header("etag")), (304, 0, Some(tag)));
    let si = format!("{address}?units=si");
    let si = server.send("GET", &si, &[("If-None-Match", tag), ("Accept", "text/html")], "").await;
    assert!(si.status == 200 && si.text().contains("(m)"));
    let packed = server.send("GET", &address, &[("Accept-Encoding", "gzip")], "").await;
    assert_eq!(packed.header("content-encoding"), Some("gzip"));
    assert_eq!(packed.header("etag"), Some(&*format!("W/{tag}")));

    for (query, expected) in [
        (
            "quantity=warn&units=imperial&x=cubic&y=0&width=319&height=4001&colour=red",
            &["quantity", "units", "x", "y", "width", "height", "colour"][..],
        ),
        ("quantity=loops&x=log&y=log", &["x", "y"]),
        ("quantity=wear_volume&cycles=1000", &["cycles"]),
        ("cycles=1,2,3,4,5,6,7,8,9,10,11,12,13", &["cycles"]),
        ("cycles=1000,7,8", &["cycles", "cycles"]),
        ("quantity=pressure&cycles=inf", &["cycles"]),
        ("format=png", &["format"]),
    ] {
        let refused = server.get(&format!("{address}?{query}")).await;
        let problem = refused.problem(422, "invalid-parameters");
        let named = problem["errors"].as_array().unwrap().iter();
        let named: Vec<_> = named.map(|error| error["parameter"].as_str().unwrap()).collect();
        assert_eq!(named, expected, "{problem}");
    }
    let nothing = format!("/v1/results/{}/plot.svg", "0".repeat(64));
    server.get(&nothing).await.problem(404, "unknown-result");
    let job = server.compute(&cone(&json!("none"))).await.json();
    let bare = format!("{}/plot.svg", job["links"]["result"].as_str().unwrap());
    let problem = server.get(&bare).await.problem(422, "invalid-parameters");
    assert!(problem["errors"][0]["detail"].as_str().unwrap().contains("profiles_at"), "{problem}");
    assert_eq!(server.get(&format!("{bare}?quantity=normal_force")).await.status, 200);
}

#[test]
fn the_run_command_writes_a_figure_in_addition_to_the_result() {
    let dir = TempDir::new().unwrap();
    let file = dir.path().join("figure.svg");
    let (file, body) = (file.to_str().unwrap(), http::EXAMPLES[0].body);
    let stored = computed(body);
    let output = program::run(&["run", "-", "--plot", file], body);
    assert!(output.status.success());
    assert!(output.stdout.starts_with(&stored));
    assert_eq!(fs::read_to_string(file).unwrap(), plotted(&stored, "worn"));
    program::run(&["run", "-", "--plot", file, "--quantity", "loops"], body);
    assert_eq!(fs::read_to_string(file).unwrap(), plotted(&stored, "loops"));
    let wrong = program::run(&["run", "-", "--plot", file, "--quantity", "warn"], body);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&wrong.stderr).contains("wear_volume"));
    let bare = cone(&json!("none")).to_string();
    let refused = program::run(&["run", "-", "--plot", file], &bare);
    assert_eq!(refused.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("profiles_at"));
    let nowhere = program::run(&["run", "-", "--plot", &format!("{file}/figure.svg")], body);
    program::fails(&nowhere, "cannot write");
}

#[test]
fn a_figure_of_displacements_without_a_reference_says_why_it_is_empty() {
    let body = json!({"scenario": {
        "profile": {"shape": "cylinder", "radius": "6 mm", "length": "10 mm"},
        "moduli": {"normal": "112 GPa"}, "friction": 0.5, "wear": {"coefficient": 3e-14},
        "load": {"normal_force": "18.5 N/mm"}, "motion": {"stick_ratio": 0.5},
        "cycles": [1000], "profiles_at": "all",
    }});
    let stored = computed(&body.to_string());
    for (quantity, is_empty) in
        [("amplitude", true), ("loops", true), ("indentation_depth", true), ("slip", false)]
    {
        let figure = plotted(&stored, quantity);
        assert_eq!(figure.contains("known only against a reference"), is_empty, "{quantity}");
    }
}
