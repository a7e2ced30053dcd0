//! SVG elements. Coordinates are px from the upper left corner.

use super::series::{Dash, Mark, Style};
use super::text::{escape, markup, width};

/// A curve may be simplified by this distance in px without a visible change.
const TOLERANCE: f64 = 0.02;
/// Distance between markers on a curve with dense points, in px.
const MARK_DISTANCE: f64 = 64.0;
/// If the distance between points is smaller than this number of px, they are dense: only some of them get markers.
const DENSE: f64 = 9.0;

/// A point in px, from the left and from the top.
pub type Point = (f64, f64);

/// A rectangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Area {
    pub left: f64,
    pub top: f64,
    pub width: f64,
    pub height: f64,
}

impl Area {
    pub fn right(&self) -> f64 {
        self.left + self.width
    }

    pub fn bottom(&self) -> f64 {
        self.top + self.height
    }

    /// The point at fractions of width and height from the lower left corner.
    pub fn at(&self, across: f64, up: f64) -> Point {
        (self.left + across * self.width, self.bottom() - up * self.height)
    }

    /// Whether a line segment intersects the rectangle (Liang–Barsky clipping).
    pub fn meets(&self, (x, y): Point, end: Point) -> bool {
        let (dx, dy) = (end.0 - x, end.1 - y);
        let bounds = [
            (-dx, x - self.left),
            (dx, self.right() - x),
            (-dy, y - self.top),
            (dy, self.bottom() - y),
        ];
        let (mut first, mut last) = (0.0_f64, 1.0_f64);
        for (step, room) in bounds {
            if step == 0.0 && room < 0.0 {
                return false;
            }
            if step < 0.0 {
                first = first.max(room / step);
            } else if step > 0.0 {
                last = last.min(room / step);
            }
        }
        first <= last
    }
}

/// The alignment of a text relative to its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    Start,
    Middle,
    End,
}

impl Anchor {
    fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Middle => "middle",
            Self::End => "end",
        }
    }
}

/// Metadata of a figure.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct About {
    /// A description in words (`desc`).
    pub description: String,
    /// The key of the result (`dc:identifier`).
    pub identifier: String,
    /// The engine (`dc:creator`).
    pub creator: String,
}

/// The elements drawn so far.
#[derive(Debug, Default)]
pub struct Canvas {
    body: String,
}

impl Canvas {
    fn put(&mut self, element: &str) {
        self.body.push_str(element);
        self.body.push('\n');
    }

    /// A label on one line. The point is on its baseline.
    pub fn text(&mut self, place: Point, anchor: Anchor, size: f64, label: &str) {
        self.label(place, anchor, size, label, "");
    }

    /// A bold label. It is smaller if it is wider than `room` px.
    pub fn title(&mut self, place: Point, size: f64, room: f64, label: &str) {
        let size = size.min(room / width(label));
        self.label(place, Anchor::Start, size, label, " font-weight=\"bold\"");
    }

    /// A label rotated by 90°, read from bottom to top.
    pub fn upward_text(&mut self, place: Point, size: f64, label: &str) {
        let turn = format!(" transform=\"rotate(-90 {} {})\"", px(place.0), px(place.1));
        self.label(place, Anchor::Middle, size, label, &turn);
    }

    fn label(&mut self, (x, y): Point, anchor: Anchor, size: f64, label: &str, more: &str) {
        if label.is_empty() {
            return;
        }
        let (x, y, anchor, label) = (px(x), px(y), anchor.name(), markup(label));
        self.put(&format!(
            "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" text-anchor=\"{anchor}\"{more}>{label}</text>"
        ));
    }

    /// A straight line.
    pub fn line(&mut self, from: Point, to: Point, style: &Style) {
        self.put(&format!("<path d=\"{}\"{}/>", path(&[from, to]), stroke(style)));
    }

    /// A curve through points, with markers on all points. If the points are dense, the markers have a
    /// constant distance and the first one is `lead` px from the start.
    pub fn curve(&mut self, points: &[Point], style: &Style, lead: f64) {
        if points.len() > 1 && style.width > 0.0 {
            self.put(&format!("<path d=\"{}\"{}/>", path(&thinned(points)), stroke(style)));
        }
        if let Some(mark) = style.mark {
            // Without a line every point needs a marker.
            let places = if style.width > 0.0 { marked(points, lead) } else { points.to_vec() };
            if mark == Mark::Dot {
                return self.dots(&places, style.color);
            }
            for place in places {
                self.mark(place, mark, style.color);
            }
        }
    }

    /// A marker. All shapes have about the same size and cover the curve.
    fn mark(&mut self, (x, y): Point, mark: Mark, color: &str) {
        let polygon = |corners: &[Point]| {
            let corners: Vec<Point> = corners.iter().map(|(dx, dy)| (x + dx, y + dy)).collect();
            format!("path d=\"{}Z\"", path(&corners))
        };
        let form = match mark {
            Mark::Disc | Mark::Ring | Mark::Dot => {
                format!("circle cx=\"{}\" cy=\"{}\" r=\"2.6\"", px(x), px(y))
            }
            Mark::Square => polygon(&[(-2.4, -2.4), (2.4, -2.4), (2.4, 2.4), (-2.4, 2.4)]),
            Mark::Diamond => polygon(&[(0.0, -3.4), (3.4, 0.0), (0.0, 3.4), (-3.4, 0.0)]),
            Mark::Triangle => polygon(&[(0.0, -3.4), (3.2, 2.4), (-3.2, 2.4)]),
            Mark::Wedge => polygon(&[(0.0, 3.4), (3.2, -2.4), (-3.2, -2.4)]),
        };
        self.put(&match mark {
            Mark::Disc | Mark::Dot => format!("<{form} fill=\"{color}\"/>"),
            _ => format!("<{form} fill=\"#fff\" stroke=\"{color}\" stroke-width=\"1.2\"/>"),
        });
    }

    /// Dots. They are one SVG element, because there can be thousands.
    fn dots(&mut self, points: &[Point], color: &str) {
        let place = |(x, y): &Point| format!("M{} {}h0", px(*x), px(*y));
        let places = points.iter().map(place).collect::<Vec<_>>().concat();
        self.put(&format!(
            "<path d=\"{places}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"3\" \
             stroke-opacity=\"0.45\" stroke-linecap=\"round\"/>"
        ));
    }

    /// Rectangles of one colour. Each is given by two opposite corners. Neighbours touch each other without a seam.
    pub fn cells(&mut self, color: &str, cells: &[[Point; 2]]) {
        if cells.is_empty() {
            return;
        }
        let cell = |[(left, top), (right, bottom)]: &[Point; 2]| {
            let [left, top, right, bottom] = [*left, *top, *right, *bottom].map(px);
            format!("M{left} {top}H{right}V{bottom}H{left}Z")
        };
        let cells: String = cells.iter().map(cell).collect();
        self.put(&format!("<path d=\"{cells}\" fill=\"{color}\" shape-rendering=\"crispEdges\"/>"));
    }

    /// A polygon without a border.
    pub fn area(&mut self, outline: &[Point], color: &str) {
        self.put(&format!("<path d=\"{}Z\" fill=\"{color}\"/>", path(outline)));
    }

    /// A rectangle: filled with white, or with a black border.
    pub fn rectangle(&mut self, area: &Area, filled: bool) {
        let paint = if filled {
            "fill=\"#fff\" fill-opacity=\"0.85\""
        } else {
            "fill=\"none\" stroke=\"#000\" stroke-width=\"0.8\""
        };
        self.put(&format!("<rect {} {paint}/>", bounds(area)));
    }

    /// Clips all following elements to a rectangle.
    pub fn open_window(&mut self, area: &Area) {
        let Area { left, top, width, height } = *area;
        let view = [left, top, width, height].map(px).join(" ");
        self.put(&format!("<svg {} viewBox=\"{view}\">", bounds(area)));
    }

    /// Ends the clipping that [`open_window`](Self::open_window) started.
    pub fn close_window(&mut self) {
        self.put("</svg>");
    }

    /// The drawing as an SVG document. Screen readers read its name.
    pub fn document(
        self,
        (width, height): (f64, f64),
        name: &str,
        about: Option<&About>,
    ) -> String {
        let (width, height) = (px(width), px(height));
        let name = escape(&name.replace('$', ""));
        let about = about.map_or_else(String::new, |about| {
            let [text, identifier, creator] =
                [&about.description, &about.identifier, &about.creator].map(|text| escape(text));
            format!(
                "<title>{name}</title>\n<desc>{text}</desc>\n\
                 <metadata>\n\
                 <rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\" \
                 xmlns:dc=\"http://purl.org/dc/elements/1.1/\">\n\
                 <rdf:Description rdf:about=\"\"><dc:identifier>{identifier}</dc:identifier>\
                 <dc:creator>{creator}</dc:creator></rdf:Description>\n\
                 </rdf:RDF>\n</metadata>\n"
            )
        });
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{name}\">\n{about}\
             <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
             <g font-family=\"Helvetica, Arial, 'Liberation Sans', sans-serif\" fill=\"#000\">\n\
             {}</g>\n</svg>\n",
            self.body
        )
    }
}

/// A length with at most two decimals.
fn px(x: f64) -> String {
    let text = format!("{x:.2}");
    match text.trim_end_matches('0').trim_end_matches('.') {
        "-0" => "0".to_owned(),
        short => short.to_owned(),
    }
}

fn bounds(area: &Area) -> String {
    let Area { left, top, width, height } = *area;
    let [x, y, width, height] = [left, top, width, height].map(px);
    format!("x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"")
}

fn path(points: &[Point]) -> String {
    let places: Vec<String> =
        points.iter().map(|(x, y)| format!("{} {}", px(*x), px(*y))).collect();
    format!("M{}", places.join("L"))
}

fn stroke(style: &Style) -> String {
    let dashes = match style.dash {
        Dash::Solid => "",
        Dash::Dashed => " stroke-dasharray=\"8 3\"",
        Dash::DashDotted => " stroke-dasharray=\"8 2.5 1.6 2.5\"",
        Dash::ShortDashed => " stroke-dasharray=\"4 2\"",
        Dash::Dotted => " stroke-dasharray=\"1.6 2.2\"",
    };
    let Style { color, width, .. } = style;
    format!(
        " fill=\"none\" stroke=\"{color}\" stroke-width=\"{width}\" stroke-linejoin=\"round\"{dashes}"
    )
}

/// The positions of the markers. Distances are measured along the curve if it turns back. Otherwise they are measured
/// along the horizontal axis, because markers would cover a steep flank.
fn marked(points: &[Point], lead: f64) -> Vec<Point> {
    let length = |pair: &[Point]| libm::hypot(pair[1].0 - pair[0].0, pair[1].1 - pair[0].1);
    if points.windows(2).all(|pair| length(pair) >= DENSE) {
        return points.to_vec();
    }
    let onwards = points.windows(2).all(|pair| pair[1].0 >= pair[0].0);
    let mut out: Vec<Point> = Vec::new();
    let mut left = lead;
    for pair in points.windows(2) {
        left -= if onwards { pair[1].0 - pair[0].0 } else { length(pair) };
        if left <= 0.0 {
            out.push(pair[1]);
            left = MARK_DISTANCE;
        }
    }
    if out.is_empty() {
        // A short curve needs one marker too.
        out.extend(points.get(points.len() / 2));
    }
    out
}

/// A subset of the points that gives a curve without a visible difference from the curve through all points.
fn thinned(points: &[Point]) -> Vec<Point> {
    let mut kept: Vec<Point> = points.first().copied().into_iter().collect();
    let mut start = 0;
    for end in 2..points.len() {
        let skipped = &points[start + 1..end];
        if skipped.iter().any(|point| distance(*point, points[start], points[end]) > TOLERANCE) {
            start = end - 1;
            kept.push(points[start]);
        }
    }
    kept.extend(points.last().filter(|_| points.len() > 1));
    kept
}

/// The distance of a point from a line segment.
fn distance((x, y): Point, from: Point, to: Point) -> f64 {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let square = dx * dx + dy * dy;
    let share = if square > 0.0 { ((x - from.0) * dx + (y - from.1) * dy) / square } else { 0.0 };
    let share = share.clamp(0.0, 1.0);
    libm::hypot(x - from.0 - share * dx, y - from.1 - share * dy)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_intersection_of_a_segment_with_a_rectangle_is_detected() {
        let area = Area { left: 1.0, top: 1.0, width: 2.0, height: 1.0 };
        assert!(area.meets((0.0, 1.5), (4.0, 1.5)) && area.meets((2.0, 1.2), (2.0, 1.2)));
        assert!(area.meets((0.0, 0.0), (4.0, 3.0)));
        assert!(!area.meets((0.0, 1.0), (1.0, 3.0)) && !area.meets((0.0, 0.5), (4.0, 0.5)));
        assert!(!area.meets((4.0, 0.0), (4.0, 3.0)));
    }

    #[test]
    fn points_on_straight_lines_are_removed_and_corners_are_kept() {
        let points: Vec<Point> = (0..=20).map(f64::from).map(|x| (x, (x - 7.0).abs())).collect();
        assert_eq!(thinned(&points), [(0.0, 7.0), (7.0, 0.0), (20.0, 13.0)]);
        assert_eq!(thinned(&[(0.0, 0.0), (9.0, 0.0), (5.0, 0.0)]).len(), 3);
        assert_eq!(thinned(&[(1.0, 2.0)]), [(1.0, 2.0)]);
        assert!(thinned(&[]).is_empty());
    }

    #[test]
    fn markers_keep_a_minimum_distance_and_every_curve_has_one() {
        let sparse = [(0.0, 0.0), (20.0, 5.0), (40.0, 5.0)];
        assert_eq!(marked(&sparse, 30.0), sparse);
        // On a steep flank, distances are measured horizontally.
        let flank = (0..=40).map(|i| (f64::from(i) * 0.125, f64::from(i) * 5.0));
        let plain = (1..=200).map(|i| (5.0 + f64::from(i), 200.0));
        let across: Vec<f64> =
            marked(&flank.chain(plain).collect::<Vec<_>>(), 12.0).iter().map(|p| p.0).collect();
        assert_eq!(across, [12.0, 76.0, 140.0, 204.0]);
        // If the curve turns back, distances are measured along the curve.
        let there = (0..=50).map(|i| (f64::from(i), 0.0));
        let way: Vec<Point> = there.clone().chain(there.rev()).collect();
        assert_eq!(marked(&way, 30.0), [(30.0, 0.0), (6.0, 0.0)]);
        assert_eq!(marked(&[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)], 30.0), [(1.0, 0.0)]);
        assert!(marked(&[], 1.0).is_empty());
    }

    #[test]
    fn a_series_without_a_line_has_a_marker_at_every_point() {
        let points = [(0.0, 0.0), (1.0, 9.0), (2.0, 5.0), (90.0, 7.0)];
        let marks = |width: f64| {
            let mut canvas = Canvas::default();
            canvas.curve(&points, &Style { width, ..Style::marked(0) }, 12.0);
            canvas.body.matches("<circle").count()
        };
        assert_eq!((marks(0.0), marks(1.4)), (4, 1));
    }

    #[test]
    fn svg_lengths_have_at_most_two_decimals_and_no_negative_zero() {
        assert_eq!([12.0, 12.5, 0.126, -0.001].map(px).join(" "), "12 12.5 0.13 0");
    }
}
