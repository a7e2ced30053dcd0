//! Figures of studies over HTTP: their content, their legibility, and the parameters that are refused.

use roxmltree::{Document, Node};
use serde_json::{Value, json};

use crate::figures::legible;
use crate::plots::{frame, numbers, window};
use crate::server::{Server, steel_ball};
use crate::studies::{computed, example, sweep};

/// The figure of a result with these parameters. Checks that it is legible at three sizes.
async fn figure(server: &Server, key: &str, query: &str) -> String {
    for size in ["width=320&height=240", "width=1200&height=300&units=si", ""] {
        let words = [query, size].into_iter().filter(|words| !words.is_empty());
        let words = words.collect::<Vec<_>>().join("&");
        let reply = server.get(&format!("/v1/results/{key}/plot.svg?{words}")).await;
        assert_eq!(reply.status, 200, "{query}: {}", reply.text());
        let svg = reply.text().to_owned();
        assert!(legible(&svg) > 5 && !svg.contains("NaN") && !svg.contains("inf\""), "{query}");
        assert!(svg.len() < 200_000, "{query} has {} bytes", svg.len());
        let document = Document::parse(&svg).unwrap();
        let description = document.descendants().find(|node| node.has_tag_name("desc")).unwrap();
        assert!(description.text().unwrap().contains("points of a"), "{query}");
        if size.is_empty() {
            return svg;
        }
    }
    unreachable!("the last size is empty")
}

fn texts(document: &Document) -> Vec<String> {
    let texts = document.descendants().filter(|node| node.has_tag_name("text"));
    let parts = |node: Node| -> String {
        node.descendants().filter(Node::is_text).filter_map(|part| part.text()).collect()
    };
    texts.map(parts).collect()
}

/// The cells of a heat map in its window: left, top, right, bottom.
fn cells(document: &Document) -> Vec<[f64; 4]> {
    let is_cell = |node: &Node| node.attribute("shape-rendering").is_some();
    let paths = window(document).children().filter(is_cell);
    let cells = paths.flat_map(|path| path.attribute("d").unwrap().split('Z'));
    let corners = |text: &str| {
        let [left, top, right, bottom, _] = numbers(text)[..] else { panic!("{text}") };
        [left.min(right), top.min(bottom), left.max(right), top.max(bottom)]
    };
    cells.filter(|cell| !cell.is_empty()).map(corners).collect()
}

fn area(cells: &[[f64; 4]]) -> f64 {
    cells.iter().map(|[left, top, right, bottom]| (right - left) * (bottom - top)).sum()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_grid_is_drawn_as_a_family_of_curves_or_a_heat_map() {
    let server = Server::start().await;
    let (key, _) = computed(&server, &sweep()).await;
    let svg = figure(&server, &key, "").await;
    let document = Document::parse(&svg).unwrap();
    let texts = texts(&document);
    for text in ["Wear volume after the last cycle", "Amplitude (µm)", "μ = 0.5", "μ = 0.7"] {
        assert!(texts.iter().any(|own| own == text), "{text}: {texts:?}");
    }
    let rings = window(&document).children().filter(|node| node.has_tag_name("circle"));
    assert_eq!(rings.count(), 3, "one marker for each amplitude");
    let svg = figure(&server, &key, "over=/friction&output=unworn.energy_ratio").await;
    assert!(svg.contains("U = 2 µm") && svg.contains(">Friction coefficient<"));

    let svg = figure(&server, &key, "kind=heat").await;
    let document = Document::parse(&svg).unwrap();
    let [left, top, right, bottom] = frame(&document);
    let whole = (right - left) * (bottom - top);
    assert_eq!(cells(&document).len(), 6);
    assert!((area(&cells(&document)) / whole - 1.0).abs() < 1e-3);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_row_without_the_output_leaves_a_gap_in_the_figure() {
    let server = Server::start().await;
    let mut body = sweep();
    body["sweep"]["vary"][0]["values"] = json!([-0.1, 0.5, 0.7]);
    let (key, _) = computed(&server, &body).await;
    let svg = figure(&server, &key, "kind=heat").await;
    let document = Document::parse(&svg).unwrap();
    // Cells end at -0.4, 0.2, 0.6 and 0.8, and the first column has no values.
    let [left, top, right, bottom] = frame(&document);
    let filled = area(&cells(&document)) / ((right - left) * (bottom - top));
    assert!((filled - 0.5).abs() < 1e-3, "{filled}");
    figure(&server, &key, "").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_sweep_with_random_values_is_drawn_as_a_scatter_plot() {
    let server = Server::start().await;
    let mut body = sweep();
    body["sweep"]["vary"] = json!([
        {"pointer": "/friction", "from": 0.5, "to": 0.7},
        {"pointer": "/motion/amplitude", "from": "1 um", "to": "3 um"},
    ]);
    body["sweep"]["design"] = json!("sobol");
    body["sweep"]["samples"] = json!(512);
    let (key, _) = computed(&server, &body).await;
    let svg = figure(&server, &key, "over=/motion/amplitude").await;
    assert_eq!(svg.matches("h0").count(), 512, "one dot for each point");
    assert!(svg.contains(">median in bins<"));
    // No two points share an amplitude.
    assert!(!svg.contains("95 %") && !svg.contains("percentile"), "{svg}");
    let refused = server.get(&format!("/v1/results/{key}/plot.svg?kind=heat")).await;
    let problem = refused.problem(422, "invalid-parameters");
    assert!(problem["errors"][0]["detail"].as_str().unwrap().contains("scatter"), "{problem}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_figure_of_a_map_shows_the_regimes_and_their_boundary() {
    let server = Server::start().await;
    let mut body = example("map");
    for axis in ["normal_force", "amplitude"] {
        body["map"][axis]["count"] = json!(9);
    }
    let (key, _) = computed(&server, &body).await;
    let result = server.get(&format!("/v1/results/{key}")).await.json();
    let svg = figure(&server, &key, "").await;
    let document = Document::parse(&svg).unwrap();
    let texts = texts(&document);
    for text in ["partial slip", "gross slip", "Normal force (N)", "Amplitude (µm)"] {
        assert!(texts.iter().any(|own| own == text), "{text}: {texts:?}");
    }
    // The axes are logarithmic and end at the ends of the map.
    let [left, top, right, bottom] = frame(&document);
    let [forces, amplitudes] = ["/load/normal_force", "/motion/amplitude"].map(|name| {
        let cells = result["boundary"][name].as_array().unwrap().iter();
        cells.map(|cell| cell.as_f64().unwrap()).collect::<Vec<f64>>()
    });
    let expected = forces.iter().zip(&amplitudes).map(|(force, amplitude)| {
        let across = libm::log10(*force) / 3.0;
        let up = libm::log10(amplitude / 1e-7) / libm::log10(200.0);
        [left + across * (right - left), bottom - up * (bottom - top)]
    });
    let expected: Vec<[f64; 2]> = expected.collect();
    let dashed =
        window(&document).children().find(|node| node.attribute("stroke-dasharray").is_some());
    let boundary = numbers(&dashed.unwrap().attribute("d").unwrap().replace(['M', 'L'], " "));
    assert!(boundary.len() >= 4);
    for point in boundary.chunks(2) {
        let near = |own: &[f64; 2]| (own[0] - point[0]).abs() + (own[1] - point[1]).abs() < 0.05;
        assert!(expected.iter().any(near), "{point:?} is not in {expected:?}");
    }
    let svg = figure(&server, &key, "output=wear_volume").await;
    let document = Document::parse(&svg).unwrap();
    assert!(cells(&document).len() > 40 && svg.contains("Wear volume (mm³)"));
    let lines =
        window(&document).children().filter(|node| node.attribute("stroke-width") == Some("0.8"));
    assert!(lines.count() >= 3, "contour lines");
    figure(&server, &key, "kind=curves&output=unworn.stick_ratio").await;
}

#[tokio::test(flavor = "multi_thread")]
async fn regimes_end_at_the_boundary_also_where_it_leaves_the_figure() {
    let server = Server::start().await;
    let mut body = example("map");
    body["map"]["normal_force"] =
        json!({"from": "1 kN", "to": "1 N", "count": 2, "spacing": "log"});
    body["map"]["amplitude"] = json!({"from": "1 um", "to": "10 um", "count": 3, "spacing": "log"});
    let (key, _) = computed(&server, &body).await;
    let threshold = figure(&server, &key, "kind=heat&output=gross_slip_amplitude").await;
    for text in
        ["Gross-slip threshold at the contact after the last cycle", "within one amplitude step"]
    {
        assert!(threshold.contains(text), "{threshold}");
    }
    let svg = figure(&server, &key, "").await;
    let document = Document::parse(&svg).unwrap();
    let texts = texts(&document);
    assert!(["partial slip", "gross slip"].iter().all(|name| texts.iter().any(|own| own == name)));
    let drawn = |is_it: &dyn Fn(&Node) -> bool| -> Vec<Vec<f64>> {
        let paths = window(&document).children().filter(is_it);
        let ends = |path: Node| path.attribute("d").unwrap().replace(['M', 'L', 'Z'], " ");
        paths.map(|path| numbers(&ends(path))).collect()
    };
    let boundary = drawn(&|node| node.attribute("stroke-dasharray").is_some()).remove(0);
    let bands = drawn(&|node| node.attribute("fill").is_some_and(|fill| fill.starts_with('#')));
    assert_eq!((boundary.len(), bands.len()), (4, 2));
    for band in bands {
        for point in boundary.chunks(2) {
            let is_same = |own: &[f64]| (own[0] - point[0]).hypot(own[1] - point[1]) < 0.05;
            assert!(band.chunks(2).any(is_same), "{point:?} is not in {band:?}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn indices_are_drawn_as_bars_in_order_of_size() {
    let server = Server::start().await;
    let mut body = example("sensitivity");
    body["sensitivity"]["samples"] = json!(64);
    let (key, _) = computed(&server, &body).await;
    let svg = figure(&server, &key, "").await;
    let document = Document::parse(&svg).unwrap();
    let result = server.get(&format!("/v1/results/{key}")).await.json();
    let totals: Vec<f64> =
        (0..4).map(|row| result["table"]["total"][row].as_f64().unwrap()).collect();
    let bars = document.descendants().filter(|node| node.attribute("fill") == Some("#0072b2"));
    let lengths: Vec<f64> = bars
        .map(|bar| numbers(bar.attribute("d").unwrap()))
        .map(|corners| corners[2] - corners[0])
        .collect();
    let mut sorted = totals.clone();
    sorted.sort_by(|a, b| b.total_cmp(a));
    assert_eq!(lengths.len(), 4);
    for (length, total) in lengths.iter().zip(&sorted) {
        assert!((length / lengths[0] - total / sorted[0]).abs() < 1e-3, "{lengths:?} {totals:?}");
    }
    let svg = figure(&server, &key, "over=/friction&output=wear_depth").await;
    assert_eq!(svg.matches("h0").count(), 384);
    for method in ["morris", "local"] {
        body["sensitivity"]["method"] = json!(method);
        if method == "local" {
            let sensitivity = body["sensitivity"].as_object_mut().unwrap();
            sensitivity.remove("samples");
            sensitivity["vary"] = json!([{"pointer": "/friction"}, {"pointer": "/profile/radius"}]);
            sensitivity["outputs"] = json!(["unworn.stick_radius"]);
        }
        let (key, _) = computed(&server, &body).await;
        let svg = figure(&server, &key, "").await;
        assert!(svg.contains("Friction coefficient"), "{method}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn parameters_that_a_study_does_not_have_are_refused() {
    let server = Server::start().await;
    let (study, _) = computed(&server, &sweep()).await;
    let (run, _) = computed(&server, &steel_ball()).await;
    // A grid of one number has no second axis.
    let mut one = sweep();
    one["sweep"]["vary"] =
        json!([{"pointer": "/friction", "from": 0.4, "to": 0.8, "count": 20_000}]);
    one["sweep"]["outputs"] = json!(["unworn.slip_ratio"]);
    let (one, _) = computed(&server, &one).await;
    for (key, query, expected) in [
        (&study, "kind=pie&x=cubic", &["x", "kind"][..]),
        (&study, "kind=tornado&output=wear&over=/frction", &["kind", "output", "over"]),
        (&study, "over=/friction&by=/friction", &["by"]),
        (&one, "by=/friction", &["by"]),
        (&one, "kind=heat&by=/friction", &["kind", "by"]),
        (&study, "quantity=pressure&cycles=1000", &["quantity", "cycles"]),
        (&run, "kind=heat&over=/friction", &["kind", "over"]),
    ] {
        let refused = server.get(&format!("/v1/results/{key}/plot.svg?{query}")).await;
        let problem: Value = refused.problem(422, "invalid-parameters");
        let named = problem["errors"].as_array().unwrap().iter();
        let named: Vec<_> = named.map(|error| error["parameter"].as_str().unwrap()).collect();
        assert_eq!(named, expected, "{problem}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_figures_of_a_fit_show_measurements_and_what_follows() {
    let server = Server::start().await;
    let mut body = example("fit");
    body["fit"]["starts"] = json!(1);
    body["fit"]["tests"][4]["data"][0]["y"][1] = json!("1.1e-2 mm^3");
    let energy = json!({"output": "wear_volume", "over": "dissipated_energy", "x": [1, 2], "y": ["4.2e-5 mm^3", "8.8e-5 mm^3"], "relative": 0.1});
    body["fit"]["tests"][3]["data"].as_array_mut().unwrap().push(energy);
    let (key, _) = computed(&server, &body).await;
    let svg = figure(&server, &key, "output=wear_volume").await;
    assert!(
        svg.contains(">A1<") && svg.contains(">Cycles<") && svg.contains("Wear volume (mm³)"),
        "{svg}"
    );
    let residuals = figure(&server, &key, "kind=residuals").await;
    assert!(residuals.contains("Residual (standard deviations)"));
    let energies = figure(&server, &key, "kind=energy").await;
    assert!(
        energies.contains(">Dissipated energy (mJ)<") && energies.contains("mm³/J"),
        "{energies}"
    );
    let profile = figure(&server, &key, "kind=profile&over=/friction").await;
    assert!(profile.contains(">Friction coefficient<") && profile.contains("end of the interval"));
    // Ten values at most on both sides, and the estimate.
    let document = Document::parse(&profile).unwrap();
    let discs = window(&document).children().filter(|node| node.has_tag_name("circle")).count();
    assert!((5..=11).contains(&discs), "{discs}");
    body["fit"]["tests"][3]["data"].as_array_mut().unwrap().pop();
    let (key, _) = computed(&server, &body).await;
    let refused = server.get(&format!("/v1/results/{key}/plot.svg?kind=energy")).await;
    let problem = refused.problem(422, "invalid-parameters");
    assert!(problem["errors"][0]["detail"].as_str().unwrap().contains("over `dissipated_energy`"));
}
