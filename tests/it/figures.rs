//! The figures in `examples`: up to date, well-formed XML, and legible.

use std::fs;
use std::path::Path;

use fretwork_plot::{Axis, Figure, Series, Style, text};
use roxmltree::{Document, Node};

#[path = "../../examples/figures.rs"]
mod program;

const SIZE: (f64, f64) = (480.0, 340.0);

fn committed(name: &str) -> String {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/examples")).join(name);
    fs::read_to_string(path).expect(name)
}

#[test]
fn the_committed_figures_are_up_to_date() {
    for (name, sheet) in program::sheets() {
        assert!(sheet.svg() == committed(name), "{name}: run `cargo run --example figures`");
    }
}

#[test]
fn the_numbers_in_the_readme_of_the_figures_are_up_to_date() {
    let readme = committed("paper/README.md");
    for table in program::measured().split("\n\n") {
        assert!(readme.contains(table.trim_end()), "the README does not contain: {table}");
    }
}

fn label(node: Node) -> String {
    node.descendants().filter(Node::is_text).filter_map(|part| part.text()).collect()
}

/// Left, top, right and bottom of a text, from the metrics that the layout uses.
fn extent(node: Node) -> [f64; 4] {
    let number = |name: &str| node.attribute(name).expect(name).parse::<f64>().expect(name);
    let label = label(node);
    let (x, y, size) = (number("x"), number("y"), number("font-size"));
    let width = text::width(&label) * size;
    let left = match node.attribute("text-anchor") {
        Some("middle") => -0.5 * width,
        Some("end") => -width,
        _ => 0.0,
    };
    // Capitals reach 0.72 of the size above the baseline, descenders 0.21 below.
    let (above, below) = (0.72 * size, 0.21 * size);
    match node.attribute("transform") {
        Some(_) => [x - above, y - left - width, x + below, y - left],
        None => [x + left, y - above, x + left + width, y + below],
    }
}

/// Reads a figure as XML and checks that no text overlaps another or leaves the page.
pub fn legible(svg: &str) -> usize {
    let document = Document::parse(svg).expect("well-formed XML");
    let root = document.root_element();
    let side = |name: &str| root.attribute(name).expect(name).parse::<f64>().expect(name);
    let (width, height) = (side("width"), side("height"));
    let texts: Vec<_> = root.descendants().filter(|node| node.has_tag_name("text")).collect();
    let extents: Vec<[f64; 4]> = texts.iter().map(|node| extent(*node)).collect();
    for (i, a) in extents.iter().enumerate() {
        let [left, top, right, bottom] = *a;
        let within = left >= 0.0 && top >= 0.0 && right <= width && bottom <= height;
        assert!(within, "{} leaves the page: {a:?}", label(texts[i]));
        for (j, b) in extents.iter().enumerate().skip(i + 1) {
            let apart = a[2] <= b[0] || b[2] <= a[0] || a[3] <= b[1] || b[3] <= a[1];
            assert!(apart, "{} is on {}: {a:?} {b:?}", label(texts[i]), label(texts[j]));
        }
    }
    texts.len()
}

#[test]
fn texts_of_the_figures_do_not_overlap() {
    for (_, sheet) in program::sheets() {
        assert!(legible(&sheet.svg()) > 20);
    }
}

/// Marks that are so close that their names would overlap.
fn marks(values: &[f64]) -> Vec<(f64, String)> {
    values.iter().map(|value| (*value, "limit".to_owned())).collect()
}

/// All kinds of axes, many series, long names and names with XML characters.
#[test]
fn figures_with_unusual_content_are_legible() {
    let grid: Vec<f64> = (-10..=50).map(|i| f64::from(i) * 0.1).collect();
    for (log_x, log_y) in [(false, false), (false, true), (true, false), (true, true)] {
        for scale in [1e-9, 1e-3, 1.0, 7e4, 3e12] {
            for count in [0, 1, 3, 12] {
                let series = (0..count).zip((0..).map(Style::numbered)).map(|(k, style)| {
                    let power = |x: &f64| scale * 10_f64.powf(*x * f64::from(k) / 6.0);
                    let name = if k == 2 { "a <b> & \"c\" \u{7} ]]>" } else { "$w$ of series" };
                    let values = grid.iter().map(power).collect();
                    Series::new(name, grid.clone(), values, style)
                });
                let x = Axis { log: log_x, marks: marks(&[2.0, 2.02]), ..Axis::labelled("x / m") };
                let y =
                    Axis { log: log_y, marks: marks(&[scale, 1.1 * scale]), ..Axis::labelled("y") };
                let series = series.collect();
                let title = "A & B < C".to_owned();
                let figure = Figure { title, x, y, series, size: SIZE, ..Figure::default() };
                let svg = figure.svg();
                assert!(legible(&svg) > 5 && !svg.contains("NaN") && !svg.contains("inf"));
                assert_eq!(svg, figure.svg());
            }
        }
    }
}

/// No curve crosses a sample of a legend.
#[test]
fn no_curve_crosses_the_legend() {
    let x: Vec<f64> = (0..=100).map(|i| f64::from(i) / 100.0).collect();
    for phase in 0..20 {
        let wave = |k: f64| x.iter().map(|x| (k + 7.0 * x + f64::from(phase)).sin()).collect();
        let series = vec![
            Series::new("one", x.clone(), wave(0.0), Style::numbered(0)),
            Series::new("two", x.clone(), wave(0.5), Style::numbered(1)),
        ];
        let svg = Figure { series, size: SIZE, ..Figure::default() }.svg();
        let document = Document::parse(&svg).expect("XML");
        let numbers = |text: &str| -> Vec<f64> {
            text.split(|c: char| !c.is_ascii_digit() && c != '.' && c != '-')
                .filter_map(|number| number.parse().ok())
                .collect()
        };
        let window = document.root_element().descendants().filter(|n| n.has_tag_name("svg")).nth(1);
        let window = window.expect("a window");
        let legend = document.root_element().descendants().rfind(|n| n.has_tag_name("rect"));
        let legend = legend.expect("a legend");
        let side = |name: &str| legend.attribute(name).expect(name).parse::<f64>().expect(name);
        let (left, top) = (side("x"), side("y"));
        let (right, bottom) = (left + side("width"), top + side("height"));
        for path in window.children().filter_map(|path| path.attribute("d")) {
            for point in numbers(path).chunks(2) {
                let inside =
                    (left..=right).contains(&point[0]) && (top..=bottom).contains(&point[1]);
                assert!(!inside, "{point:?} in the legend, phase {phase}");
            }
        }
    }
}
