//! Draws Figures 2, 3 and 4 of the paper, and the figures of VERIFICATION.md and docs/scale.md. Prints tables of the numbers
//! of the paper's figures: `cargo run --release --example figures [directory]` (`examples` if none is given).

#![cfg_attr(not(test), expect(clippy::expect_used, reason = "an example may stop where it stands"))]

use std::fmt::Write as _;
use std::path::PathBuf;

use fretwork_engine::contact::limit::Limit;
use fretwork_engine::contact::profile::{Shape, kappa};
use fretwork_engine::outcome::Outcome;
use fretwork_engine::{scenario, simulation::Simulation};
use fretwork_plot::{Axis, Dash, Figure, GREY, Mark, PALETTE, Series, Sheet, Style};
use serde_json::{Value, json};

/// A quarter of the cycles in the captions: of Figure 2, and of Figures 3 and 4.
const CYCLES_2: [f64; 5] = [1.0, 2.5, 5.0, 9.0, 17.5];
const CYCLES: [f64; 5] = [0.5, 2.0, 4.5, 8.0, 18.0];

/// The stick ratios of Figures 2, 3 and 4: of 3, that with which (10) comes nearest to the others.
const STICK_2: f64 = 0.55;
const STICK_3: f64 = 0.545;
const STICK_4: f64 = 0.21;

const SIZE: (f64, f64) = (370.0, 290.0);
const LIMIT: Style = Style { color: "#000000", dash: Dash::Dotted, width: 1.6, mark: None };
const UNWORN: Style = Style { color: GREY, dash: Dash::Solid, width: 1.2, mark: None };

#[cfg_attr(test, expect(dead_code, reason = "the tests use what it prints and draws"))]
#[expect(clippy::print_stdout, reason = "a program that is run by hand")]
fn main() {
    let directory = std::env::args().nth(1).unwrap_or_else(|| "examples".to_owned());
    for (name, sheet) in sheets() {
        let path = PathBuf::from(&directory).join(name);
        std::fs::write(&path, sheet.svg()).expect("a directory to write to");
        println!("{}", path.display());
    }
    println!("\n{}", measured());
}

/// The figures under their file names.
#[must_use]
pub fn sheets() -> [(&'static str, Sheet); 7] {
    [
        ("paper/figure-2.svg", figure_2()),
        ("paper/figure-3.svg", figure_3()),
        ("paper/figure-4.svg", figure_4()),
        ("literature/fouvry-2007.svg", gross_slip()),
        ("literature/mccoll-2004.svg", worn_flat()),
        ("literature/van-peteghem-2011.svg", titanium()),
        ("../docs/snapshot.svg", snapshot()),
    ]
}

/// The rows of a CSV file with comments and a header.
fn rows(csv: &str) -> Vec<Vec<f64>> {
    let rows = csv.lines().filter(|line| !line.starts_with('#')).skip(1);
    rows.map(|row| row.split(',').map(|text| text.parse().expect("a number")).collect()).collect()
}

/// Marks without a line.
fn marked(mark: Mark) -> Style {
    Style { color: "#000000", dash: Dash::Solid, width: 0.0, mark: Some(mark) }
}

fn scenario_of(body: &str) -> Value {
    serde_json::from_str::<Value>(body).expect("a job")["scenario"].take()
}

/// The wear volume over the dissipated energy in gross slip, measured and computed.
fn gross_slip() -> Sheet {
    let measured = rows(include_str!("literature/fouvry-2007.csv"));
    let (energy, volume) = measured.iter().map(|row| (row[0], 1e-4 * row[1])).unzip();
    let mut series = Vec::new();
    for (stroke, body, color, dash) in [
        (50, include_str!("literature/fouvry-2007-50um.json"), PALETTE[0], Dash::Solid),
        (100, include_str!("literature/fouvry-2007-100um.json"), PALETTE[1], Dash::Dashed),
    ] {
        let Outcome { history, bodies: [_, flat], .. } = outcome(&scenario_of(body));
        let volume = flat.wear_volume.expect("the wear of the flat");
        let volume = volume.iter().map(|v| 1e-4 * (1e18 * v)).collect();
        let style = Style { color, dash, width: 1.6, mark: None };
        let label = format!("exact method, $U$ = {stroke} µm");
        series.push(Series::new(&label, history.dissipated_energy, volume, style));
    }
    series.push(Series::new("measured, TiC coating", energy, volume, marked(Mark::Disc)));
    Sheet {
        title: "Wear volume over dissipated energy in gross slip".to_owned(),
        caption: "Alumina ball of 12.7 mm on a TiC coating under 100 N; the slope is the energy wear coefficient, \
                  415.1 µm³/J. Measured by S. Fouvry, C. Paulin and T. Liskiewicz, Tribol. Int. 40 (2007) 1428."
            .to_owned(),
        columns: 1,
        figures: vec![Figure {
            x: Axis::labelled("Dissipated energy Σ$W$ (J)"),
            y: Axis::labelled("Wear volume $V$ (10⁴ µm³)"),
            series,
            size: (480.0, 340.0),
            ..Figure::default()
        }],
        legend: Vec::new(),
    }
}

/// Short runs of a queue in PostgreSQL, without and with an open transaction, and what the transaction keeps.
fn snapshot() -> Sheet {
    let measured = rows(include_str!("../benches/snapshot.csv"));
    let [closed, open] = [0, 1].map(Style::numbered);
    let curve = |label, style, column: usize, scale: f64| {
        let points = measured.iter().map(|row| (row[0] / 60.0, scale * row[column]));
        let (minutes, values) = points.unzip();
        Series::new(label, minutes, values, style)
    };
    let figure = |y, series: Vec<Series>| {
        let top = series.iter().flat_map(|curve| &curve.y).fold(0.0, |top: f64, y| top.max(*y));
        Figure {
            x: Axis::labelled("Time (min)"),
            y: Axis { range: Some((0.0, 1.1 * top)), ..Axis::labelled(y) },
            series,
            size: SIZE,
            ..Figure::default()
        }
    };
    Sheet {
        title: "Short runs while a transaction stays open in PostgreSQL".to_owned(),
        caption: "A full queue. The server, its two workers and PostgreSQL share two processors."
            .to_owned(),
        columns: 3,
        figures: vec![
            figure("Runs per second", vec![curve("", closed, 1, 1.0), curve("", open, 3, 1.0)]),
            figure(
                "Dead rows (million)",
                vec![curve("", closed, 2, 1e-6), curve("", open, 4, 1e-6)],
            ),
            figure("Oldest snapshot (s)", vec![curve("", closed, 0, 0.0), curve("", open, 5, 1.0)]),
        ],
        legend: vec![
            curve("no open transaction", closed, 1, 1.0),
            curve("open transaction", open, 3, 1.0),
        ],
    }
}

/// The flat below a cylinder in gross slip: its depth over the cycles, and its scar in the end.
fn worn_flat() -> Sheet {
    let nodes = rows(include_str!("literature/mccoll-2004-finite-elements.csv"));
    let measured = rows(include_str!("literature/mccoll-2004-measured.csv"));
    let mut request = scenario_of(include_str!("cylinder-on-flat.json"));
    request["cycles"] = (1..=36).map(|step| 500 * step).collect();
    let Outcome { history, bodies: [contact, flat], profiles, .. } = outcome(&request);
    let (profiles, depth) = (profiles.expect("profiles"), flat.wear_depth.expect("two bodies"));
    let last = |column: &[f64]| *column.last().expect("a row");
    let wider = last(&flat.scar_half_length) / last(&contact.scar_half_length);
    let shallower = last(&depth) / last(&history.wear_depth);
    let half = profiles.radius.iter().zip(profiles.wear.last().expect("a profile"));
    let half: Vec<(f64, f64)> =
        half.map(|(x, wear)| (1e3 * wider * x, -1e6 * shallower * wear)).collect();
    let left = half.iter().rev().map(|(x, height)| (-x, *height));
    let (x, height) = left.chain(half.iter().copied()).unzip();
    let line = Style { color: PALETTE[0], dash: Dash::Solid, width: 1.6, mark: None };
    let elements = Style { color: PALETTE[1], ..marked(Mark::Square) };
    let deepest = |scar: &[Vec<f64>]| scar.iter().map(|point| point[2]).fold(0.0, f64::max);
    let scars = nodes.chunk_by(|a, b| a[0].total_cmp(&b[0]).is_eq());
    let (cycles, depths) = scars.map(|scar| (scar[0][0], deepest(scar))).unzip();
    let points = |name, rows: &[Vec<f64>], style| {
        let rows = rows.iter().filter(|row| row[0] > 17_999.0);
        let (x, height) = rows.map(|row| (row[1], -row[2])).unzip();
        Series::new(name, x, height, style)
    };
    let depth = depth.iter().map(|depth| 1e6 * depth).collect();
    Sheet {
        title: "A flat below a cylinder in gross slip".to_owned(),
        caption: "Steel cylinder of 6 mm under 18.5 N/mm, $U$ = 25 µm. (a) Depth of the flat. (b) Its scar after 18 000 cycles. \
                  The curve is the wear of the contact, scaled to the depth and the half-length that the program gives for the \
                  flat. Measured by I. R. McColl, J. Ding and S. B. Leen, Wear 256 (2004) 1114; finite elements by I. Llavori."
            .to_owned(),
        columns: 2,
        figures: vec![
            Figure {
                title: "(a) depth".to_owned(),
                x: Axis::labelled("Cycles $N$"),
                y: Axis { range: Some((0.0, 3.5)), ..Axis::labelled("Wear depth $w$ (µm)") },
                series: vec![
                    Series::new("exact method", history.cycles, depth, line),
                    Series::new("finite elements", cycles, depths, elements),
                    Series::new(
                        "measured",
                        vec![18_000.0],
                        vec![deepest(&measured)],
                        marked(Mark::Disc),
                    ),
                ],
                size: SIZE,
                ..Figure::default()
            },
            Figure {
                title: "(b) scar after 18 000 cycles".to_owned(),
                x: Axis { range: Some((-0.35, 0.35)), ..Axis::labelled("$x$ (mm)") },
                y: Axis { range: Some((-3.0, 1.0)), ..Axis::labelled("Height of the flat (µm)") },
                series: vec![
                    points("measured", &measured, marked(Mark::Dot)),
                    Series::new("exact method", x, height, line),
                    points("finite elements", &nodes, elements),
                ],
                size: SIZE,
                ..Figure::default()
            },
        ],
        legend: Vec::new(),
    }
}

/// A titanium cylinder in gross slip: the volumes of the tests over their energies, and the depths of two runs.
fn titanium() -> Sheet {
    let tests = rows(include_str!("literature/van-peteghem-2011.csv"));
    let volumes =
        [(5.0, Mark::Disc), (3.0, Mark::Triangle), (1.0, Mark::Diamond), (0.11, Mark::Square)];
    let volumes = volumes.into_iter().map(|(frequency, mark)| {
        let tests = tests.iter().filter(|test| (test[2] - frequency).abs() < 1e-9);
        let (energy, volume) = tests.map(|test| (1e-3 * test[4], 1e-9 * test[5])).unzip();
        Series::new(&format!("measured, {frequency} Hz"), energy, volume, marked(mark))
    });
    let line = |color, dash| Style { color, dash, width: 1.6, mark: None };
    let slope = |alpha: f64, energy: f64, style| {
        let volume = vec![0.0, 1e-6 * alpha * energy];
        Series::new(&format!("{alpha} µm³/J"), vec![0.0, energy], volume, style)
    };
    let mut series = vec![
        slope(97_500.0, 25.0, line(PALETTE[0], Dash::Solid)),
        slope(534_900.0, 7.0, line(PALETTE[1], Dash::Dashed)),
    ];
    series.extend(volumes);
    let mut depths: Vec<Series> = [
        (
            "run of test 3, 5 Hz",
            include_str!("literature/van-peteghem-2011-test-3.json"),
            series[0].style,
        ),
        (
            "run of test 14, 0.11 Hz",
            include_str!("literature/van-peteghem-2011-test-14.json"),
            series[1].style,
        ),
    ]
    .map(|(name, body, style)| {
        let Outcome { history, .. } = outcome(&scenario_of(body));
        let depth = history.wear_depth.iter().map(|depth| 1e6 * depth).collect();
        Series::new(name, history.cycles, depth, style)
    })
    .into();
    for (name, depth, mark) in [
        ("measured, 2 Hz", 65.0, Mark::Disc),
        ("measured, 0.1 Hz", 155.0, Mark::Square),
        ("their model, 0.1 Hz", 107.0, Mark::Diamond),
    ] {
        depths.push(Series::new(name, vec![5000.0], vec![depth], marked(mark)));
    }
    let (volume, depth) = ("Wear volume $V$ (mm³)", "Depth of both bodies (µm)");
    let panel = |title: &str, x, y, top, series| Figure {
        title: title.to_owned(),
        x: Axis::labelled(x),
        y: Axis { range: Some((0.0, top)), ..Axis::labelled(y) },
        series,
        size: SIZE,
        ..Figure::default()
    };
    Sheet {
        title: "A titanium cylinder on a flat in gross slip".to_owned(),
        caption: "Ti-6Al-4V, cylinder of 80 mm under 1065 N/mm. (a) Volumes of the tests, and the energy wear coefficients that \
                  the authors published for 5 Hz and 0.11 Hz: B. van Peteghem, S. Fouvry and J. Petit, Wear 271 (2011) 1535. \
                  (b) Runs with the volumes of two tests, and depths after 5000 cycles by P. Arnaud, S. Baydoun and S. Fouvry, \
                  Tribol. Int. 161 (2021) 107077. fretwork models no debris."
            .to_owned(),
        columns: 2,
        figures: vec![
            panel("(a) volume", "Dissipated energy Σ$W$ (kJ)", volume, 5.0, series),
            panel("(b) depth", "Cycles $N$", depth, 200.0, depths),
        ],
        legend: Vec::new(),
    }
}

fn outcome(request: &Value) -> Outcome {
    let (scenario, _) = scenario::check(request, "").expect("a valid scenario");
    Simulation::of(&scenario).expect("a contact").run()
}

/// One contact, computed by both methods.
struct Pair {
    exponent: f64,
    stick: f64,
    simplified: Outcome,
    exact: Outcome,
}

/// Computes a paraboloid (exponent 2) or a cone (1) with held indentation depth. The dimensionless
/// results do not depend on the material.
fn run(exponent: f64, stick: f64, cycles: &[f64], model: &Value) -> Outcome {
    let request = json!({
        "profile": {"shape": "power", "exponent": exponent, "height": "1 um", "at_radius": "1 mm"},
        "moduli": {"normal": "112.64 GPa", "tangential": "92.76 GPa"},
        "friction": 0.7,
        "wear": {"coefficient": "3.03e-5 mm^3/(N m)"},
        "load": {"indentation_depth": "1 um", "held": "depth"},
        "motion": {"stick_ratio": stick},
        "cycles": {"normalized": cycles},
        "model": model,
    });
    outcome(&request)
}

fn simplified_rule(xi: f64) -> Value {
    json!({"method": "simplified", "xi": xi, "points": 400})
}

fn exact_method() -> Value {
    json!({"method": "exact", "tolerance": 5e-4, "points": 400})
}

fn worn(exponent: f64, stick: f64, cycles: &[f64]) -> Pair {
    let simplified = run(exponent, stick, cycles, &simplified_rule(0.8));
    let exact = run(exponent, stick, cycles, &exact_method());
    Pair { exponent, stick, simplified, exact }
}

/// c at `factor` times the amplitude, by (10): Δ = 1 − cⁿ is proportional to it.
fn stick_at(factor: f64, exponent: f64, stick: f64) -> f64 {
    libm::pow(1.0 - factor * (1.0 - libm::pow(stick, exponent)), 1.0 / exponent)
}

/// Profiles or images, f or g.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Curve {
    Profile,
    Image,
}

impl Pair {
    /// One panel: the unworn curve, one curve per output cycle and method, the limit.
    fn panel(&self, title: &str, curve: Curve, methods: &[(&Outcome, Dash)]) -> Figure {
        let n = self.exponent;
        let limit = Limit::solve(&Shape::power(n), self.stick).expect("a limit");
        let (abscissa, ordinate, top) = match curve {
            Curve::Profile => ("$r$/$a$₀", "$f$/$d$₀", 1.0),
            Curve::Image => ("$x$/$a$₀", "$g$/$d$₀", 1.5),
        };
        let unworn = |x: f64| match curve {
            Curve::Profile => libm::pow(x, n) / kappa(n),
            Curve::Image => libm::pow(x, n),
        };
        let grid: Vec<f64> = (0..=320).map(|i| f64::from(i) / 200.0).collect();
        let heights = grid.iter().map(|x| unworn(*x)).collect();
        let mut series = vec![Series::new("", grid, heights, UNWORN)];
        // There is no wear inside c or outside ã.
        let reach = if curve == Curve::Profile { limit.radius } else { f64::INFINITY };
        let worn = |outcome: &Outcome, curve: &[f64], style| {
            let (a, d) = (outcome.scales.contact_radius, outcome.scales.indentation_depth);
            let radii = &outcome.profiles.as_ref().expect("profiles").radius;
            let points = radii.iter().map(|r| r / a).zip(curve.iter().map(|f| f / d));
            let (x, y) = points.filter(|(x, _)| (self.stick..=reach).contains(x)).unzip();
            Series::new("", x, y, style)
        };
        for (outcome, dash) in methods {
            let profiles = outcome.profiles.as_ref().expect("profiles");
            let rows = match curve {
                Curve::Profile => &profiles.worn,
                Curve::Image => &profiles.image,
            };
            for (row, color) in rows[1..].iter().zip(PALETTE) {
                let style = Style { color, dash: *dash, width: 1.4, mark: None };
                series.push(worn(outcome, row, style));
            }
        }
        series.push(match curve {
            Curve::Profile => {
                let profiles = self.exact.profiles.as_ref().expect("profiles");
                let limiting = profiles.limiting.as_ref().expect("a limit");
                worn(&self.exact, limiting, LIMIT)
            }
            Curve::Image => {
                let x = vec![self.stick, self.stick, limit.radius];
                Series::new("", x, vec![unworn(self.stick), 1.0, 1.0], LIMIT)
            }
        });
        let marks = vec![(self.stick, "$c$".to_owned()), (limit.radius, "$ã$".to_owned())];
        let x = Axis { range: Some((0.0, 1.6)), marks, ..Axis::labelled(abscissa) };
        let y = Axis { range: Some((0.0, top)), ..Axis::labelled(ordinate) };
        Figure { title: title.to_owned(), x, y, series, size: SIZE, ..Figure::default() }
    }

    fn both(&self, title: &str, curve: Curve) -> Figure {
        self.panel(title, curve, &[(&self.simplified, Dash::Solid), (&self.exact, Dash::Dashed)])
    }
}

/// Samples for the colours of the cycles and the dashes of the methods.
fn legend(cycles: [f64; 5], methods: &[(&str, Dash)]) -> Vec<Series> {
    let key = |label: &str, style| Series::new(label, Vec::new(), Vec::new(), style);
    let line = |color, dash| Style { color, dash, width: 1.6, mark: None };
    let mut keys = vec![key("unworn", UNWORN)];
    for (n, color) in cycles.iter().zip(PALETTE) {
        keys.push(key(&format!("$Ñ$ = {n} (printed {})", 4.0 * n), line(color, Dash::Solid)));
    }
    keys.extend(methods.iter().map(|(name, dash)| key(name, line("#000000", *dash))));
    keys.push(key("limit (11), (12)", LIMIT));
    keys
}

const METHODS: [(&str, Dash); 2] =
    [("simplified rule", Dash::Solid), ("exact method", Dash::Dashed)];

fn figure_2() -> Sheet {
    let pair = worn(2.0, STICK_2, &CYCLES_2);
    let exact = [(&pair.exact, Dash::Solid)];
    Sheet {
        title: "Figure 2: a paraboloid worn with its indentation depth held".to_owned(),
        caption:
            "Profile (a) and one-dimensional image (b) by the exact method, $c$ = 0.55 $a$₀. Time runs \
                  from the unworn curve to the limit. Cycles count in $N$₀ of (18)."
                .to_owned(),
        columns: 2,
        figures: vec![
            pair.panel("(a) profile", Curve::Profile, &exact),
            pair.panel("(b) image", Curve::Image, &exact),
        ],
        legend: legend(CYCLES_2, &[]),
    }
}

fn figure_3() -> Sheet {
    let (smaller, larger) = (stick_at(0.8, 2.0, STICK_3), stick_at(1.2, 2.0, STICK_3));
    let pair = worn(2.0, STICK_3, &CYCLES);
    Sheet {
        title: "Figure 3: the simplified rule for a paraboloid, ξ = 0.8".to_owned(),
        caption: "Profile (a) and image (b), $c$ = 0.545 $a$₀; profiles at 0.8 (c) and 1.2 times (d) that \
                  amplitude, with the stick radii that follow from (10). Time runs from the unworn curve \
                  to the limit. Cycles count in $N$₀ of (18), each amplitude in its own."
            .to_owned(),
        columns: 2,
        figures: vec![
            pair.both("(a) profile, $c$ = 0.545 $a$₀", Curve::Profile),
            pair.both("(b) image, $c$ = 0.545 $a$₀", Curve::Image),
            worn(2.0, smaller, &CYCLES)
                .both(&format!("(c) profile, 0.8 $U$: $c$ = {smaller:.3} $a$₀"), Curve::Profile),
            worn(2.0, larger, &CYCLES)
                .both(&format!("(d) profile, 1.2 $U$: $c$ = {larger:.3} $a$₀"), Curve::Profile),
        ],
        legend: legend(CYCLES, &METHODS),
    }
}

fn figure_4() -> Sheet {
    let (small, smaller) = (stick_at(0.8, 1.0, STICK_4), stick_at(0.6, 1.0, STICK_4));
    let pair = worn(1.0, STICK_4, &CYCLES);
    Sheet {
        title: "Figure 4: the simplified rule for a cone, ξ = 0.8".to_owned(),
        caption: "Profile (a) and image (b), $c$ = 0.21 $a$₀; profiles at 0.8 (c) and 0.6 times (d) that \
                  amplitude, with the stick radii that follow from (10). Time runs from the unworn curve \
                  to the limit. Cycles count in $N$₀ of (18), each amplitude in its own."
            .to_owned(),
        columns: 2,
        figures: vec![
            pair.both("(a) profile, $c$ = 0.21 $a$₀", Curve::Profile),
            pair.both("(b) image, $c$ = 0.21 $a$₀", Curve::Image),
            worn(1.0, small, &CYCLES)
                .both(&format!("(c) profile, 0.8 $U$: $c$ = {small:.3} $a$₀"), Curve::Profile),
            worn(1.0, smaller, &CYCLES)
                .both(&format!("(d) profile, 0.6 $U$: $c$ = {smaller:.3} $a$₀"), Curve::Profile),
        ],
        legend: legend(CYCLES, &METHODS),
    }
}

/// The tables of `examples/paper/README.md`.
#[must_use]
pub fn measured() -> String {
    let ratios = stick_ratios();
    let shares = shares_of_the_limit();
    let distances = distances_of_the_rule();
    let fits = best_fits();
    let radius = error_of_19();
    format!("{ratios}\n{shares}\n{distances}\n{fits}\n{radius}")
}

/// The stick ratios that the captions print, and those that follow from (10).
fn stick_ratios() -> String {
    let mut out = "| panel | amplitude | printed c/a₀ | from the printed c of (a) | from 0.545 |\n\
                   |---|---|---|---|---|\n"
        .to_owned();
    for (panel, exponent, factor, printed, start, other) in [
        ("3 (a), (b)", 2.0, 1.0, "0.455", 0.455, Some(STICK_3)),
        ("3 (c)", 2.0, 0.8, "0.652", 0.455, Some(STICK_3)),
        ("3 (d)", 2.0, 1.2, "0.41", 0.455, Some(STICK_3)),
        ("4 (a), (b)", 1.0, 1.0, "0.21", STICK_4, None),
        ("4 (c)", 1.0, 0.8, "0.368", STICK_4, None),
        ("4 (d)", 1.0, 0.6, "0.522", STICK_4, None),
    ] {
        let from = |start: f64| format!("{:.3}", stick_at(factor, exponent, start));
        let (first, other) = (from(start), other.map_or_else(String::new, from));
        let _ = writeln!(out, "| {panel} | {factor:.1} | {printed} | {first} | {other} |");
    }
    out
}

/// The fraction of the limiting volume that is worn at the printed cycles and earlier, by both methods.
fn shares_of_the_limit() -> String {
    const ALL: [f64; 7] = [0.5, 2.0, 4.5, 8.0, 18.0, 32.0, 72.0];
    let mut out = "| V/V∞ in % at Ñ = | 0.5 | 2 | 4.5 | 8 | 18 | 32 | 72 |\n\
                   |---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for (name, exponent, stick) in [("paraboloid", 2.0, STICK_3), ("cone", 1.0, STICK_4)] {
        let pair = worn(exponent, stick, &ALL);
        for (method, outcome) in [("exact", &pair.exact), ("simplified", &pair.simplified)] {
            let limit = outcome.limit.as_ref().expect("a limit").wear_volume;
            let shares = outcome.history.wear_volume[1..].iter().map(|v| 100.0 * v / limit);
            let shares: Vec<String> = shares.map(|share| format!("{share:.1}")).collect();
            let _ = writeln!(out, "| {name}, {method} | {} |", shares.join(" | "));
        }
    }
    out
}

/// The panels that compare profiles: name, exponent and stick ratio.
fn panels() -> [(&'static str, f64, f64); 6] {
    [
        ("3 (a)", 2.0, STICK_3),
        ("3 (c)", 2.0, stick_at(0.8, 2.0, STICK_3)),
        ("3 (d)", 2.0, stick_at(1.2, 2.0, STICK_3)),
        ("4 (a)", 1.0, STICK_4),
        ("4 (c)", 1.0, stick_at(0.8, 1.0, STICK_4)),
        ("4 (d)", 1.0, stick_at(0.6, 1.0, STICK_4)),
    ]
}

/// The error of the rule relative to the exact method: volume, depth and profile.
fn distances_of_the_rule() -> String {
    let mut out = "| simplified less exact at Ñ = | 0.5 | 2 | 4.5 | 8 | 18 |\n\
                   |---|---|---|---|---|---|\n"
        .to_owned();
    for (panel, exponent, stick) in panels() {
        let Pair { simplified, exact, .. } = worn(exponent, stick, &CYCLES);
        let percent = |of: fn(&Outcome) -> &[f64]| -> Vec<String> {
            let pairs = of(&simplified)[1..].iter().zip(&of(&exact)[1..]);
            pairs.map(|(rule, exact)| percents(rule / exact - 1.0, 1)).collect()
        };
        let volume = percent(|outcome| &outcome.history.wear_volume).join(" | ");
        let depth = percent(|outcome| &outcome.history.wear_depth).join(" | ");
        let _ = writeln!(out, "| {panel} volume, % | {volume} |");
        let _ = writeln!(out, "| {panel} depth, % | {depth} |");
        let wear = |outcome: &Outcome| outcome.profiles.as_ref().expect("profiles").wear.clone();
        let depth = exact.scales.indentation_depth;
        let farthest =
            wear(&simplified).into_iter().zip(wear(&exact)).skip(1).map(|(rule, exact)| {
                let distances = rule.iter().zip(exact).map(|(rule, exact)| (rule - exact).abs());
                format!("{:.3}", distances.fold(0.0, f64::max) / depth)
            });
        let farthest = farthest.collect::<Vec<_>>().join(" | ");
        let _ = writeln!(out, "| {panel} profile, at most, d₀ | {farthest} |");
    }
    out
}

/// The ξ with which the rule is closest to the exact method over the output cycles of the figures: by the
/// mean square of the profiles, and by the largest error of the volumes.
fn best_fits() -> String {
    let mut out =
        "| panel | ξ for profiles | the same in a₀/ã | ξ for volumes |\n|---|---|---|---|\n"
            .to_owned();
    for (panel, exponent, stick) in panels() {
        let exact = run(exponent, stick, &CYCLES, &exact_method());
        let distances: Vec<(f64, f64, f64)> = (50..=150)
            .map(|hundredths| {
                let xi = f64::from(hundredths) / 100.0;
                let rule = run(exponent, stick, &CYCLES, &simplified_rule(xi));
                (xi, mean_square(&rule, &exact), worst_volume(&rule, &exact))
            })
            .collect();
        let best = |of: fn(&(f64, f64, f64)) -> f64| {
            distances.iter().min_by(|a, b| of(a).total_cmp(&of(b))).expect("some").0
        };
        let (profiles, volumes) = (best(|fit| fit.1), best(|fit| fit.2));
        let reach = Limit::solve(&Shape::power(exponent), stick).expect("a limit").radius;
        let _ =
            writeln!(out, "| {panel} | {profiles:.2} | {:.2} | {volumes:.2} |", profiles / reach);
    }
    out
}

/// ∫ (w − w′)² dr, summed over the output cycles.
fn mean_square(rule: &Outcome, exact: &Outcome) -> f64 {
    let rule = rule.profiles.as_ref().expect("profiles");
    let exact = exact.profiles.as_ref().expect("profiles");
    let widths: Vec<f64> = exact.radius.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let rows = rule.wear.iter().zip(&exact.wear);
    let points = rows.flat_map(|(rule, exact)| rule[1..].iter().zip(&exact[1..]).zip(&widths));
    points.map(|((rule, exact), width)| (rule - exact) * (rule - exact) * width).sum()
}

/// The largest relative difference of volumes.
fn worst_volume(rule: &Outcome, exact: &Outcome) -> f64 {
    let volumes = rule.history.wear_volume[1..].iter().zip(&exact.history.wear_volume[1..]);
    volumes.map(|(rule, exact)| (rule / exact - 1.0).abs()).fold(0.0, f64::max)
}

/// A small fraction in percent, with a sign unless it is 0.
fn percents(share: f64, decimals: usize) -> String {
    let text = format!("{:+.decimals$}", 100.0 * share).replace('-', "−");
    if text.contains(|digit| matches!(digit, '1'..='9')) {
        text
    } else {
        text[text.len() - decimals - 2..].to_owned()
    }
}

/// By how much (19) falls below the root of (13), which it approximates.
fn error_of_19() -> String {
    let error = |c: f64| {
        let root = Limit::solve(&Shape::power(2.0), c).expect("a limit").radius;
        ((0.25 * c * c + 2.0).sqrt() - 0.5 * c) / root - 1.0
    };
    let ratios = || (1..1000).map(|i| f64::from(i) / 1000.0);
    let worst = ratios().min_by(|a, b| error(*a).total_cmp(&error(*b))).expect("some");
    let mut out =
        "| c/a₀ | 0.1 | 0.3 | 0.545 | 0.8 | worst |\n|---|---|---|---|---|---|\n".to_owned();
    let errors = [0.1, 0.3, STICK_3, 0.8].map(|c| percents(error(c), 2)).join(" | ");
    let _ = writeln!(
        out,
        "| (19) against (13), % | {errors} | {} at {worst:.2} |",
        percents(error(worst), 2)
    );
    out
}
