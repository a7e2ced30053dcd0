//! A second exact solver, built differently, so that it can judge the first.
//!
//! Where the engine's mesh is staggered and its springs carry means, here everything lives in the
//! same points: the wear w, the springs and the pressure. Each of the three transforms is integrated
//! by itself, none is got from another, and the energy is not made to balance. All is in units of
//! a₀, d₀, E*d₀/a₀ and E*a₀d₀; η = d − g, y = max(0, η).
//!
//! # Equations
//! ```text
//! g(x) = g₀(x) + w(0) + x ∫₀ˣ w′(r)/√(x²−r²) dr          w linear in r between the points
//! p(r) = −(1/π) ∫ᵣ y′(x)/√(x²−r²) dx                      η linear in x²
//! s(r) = (2/π) ∫₀ʳ ω(x)/√(r²−x²) dx                       η linear in x
//! dw/dÑ = p·s,   ω = max(0, Δ − y)/Δ(0)
//! F = 2 ∫ y dx,   Q = 2 ∫ min(Δ, y) dx
//! ```
//! The edges of contact (η = 0) and of stick (y = Δ) lie anywhere between two points; such a cell is
//! cut there. Steps in time are Heun's, kept below the limit of stability. A crude run on equal cells
//! comes first; the second one has small cells where the stick edge has spent its time.
//!
//! # Accuracy
//! Of first order in the cell: see the tests below for what is left at each number of cells.

use std::f64::consts::{FRAC_1_PI, FRAC_2_PI, PI};

use fretwork::engine::contact::Contact;
use fretwork::engine::exact::Exact;
use fretwork::engine::limit::Limit;
use fretwork::engine::numeric::{dot, integrate, largest, root, vertex};
use fretwork::engine::profile::Shape;
use serde_json::Value;

/// What presses the indenter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Normal {
    /// d = 1.
    Depth,
    /// F is that of the unworn contact.
    Force,
}

/// What moves it to and fro.
pub enum Tangential {
    /// Δ.
    Amplitude(f64),
    /// Q, which no contact bears that is pressed by less.
    Force(f64),
    /// Δ + κQ: a drive of this amplitude through a spring of compliance κ.
    Rig { amplitude: f64, compliance: f64 },
    /// Δ and until when, one after the other; the last holds for ever.
    Blocks(Vec<(f64, f64)>),
    /// ω of a spring that slips from y on, as a function of y, and the least y at which it is 0.
    Record { omega: Box<dyn Fn(f64) -> f64>, limit: f64 },
}

/// A contact to wear.
pub struct Problem {
    pub shape: Shape,
    pub normal: Normal,
    pub tangential: Tangential,
}

/// The worn contact at one instant.
#[derive(Debug, Clone)]
pub struct State {
    /// Ñ.
    pub time: f64,
    /// V.
    pub volume: f64,
    /// F.
    pub normal_force: f64,
    /// Q.
    pub tangential_force: f64,
    /// d.
    pub indentation_depth: f64,
    /// Δ.
    pub threshold: f64,
    /// The largest w.
    pub wear_depth: f64,
    /// Where g = d.
    pub contact_radius: f64,
    /// Where y = Δ; 0 if everything slips.
    pub stick_radius: f64,
    /// ∫ y ω dx, half of dV/dÑ.
    pub energy: f64,
    /// The points.
    pub radii: Vec<f64>,
    /// w there.
    pub wear: Vec<f64>,
}

/// What came of a problem.
#[derive(Debug)]
pub struct Course {
    /// At the instants asked for, as far as the tangential force could be borne.
    pub states: Vec<State>,
    /// From when on nothing sticks.
    pub gross_slip: Option<f64>,
}

/// Runs a problem on so many cells; `instants` ascend.
pub fn run(problem: &Problem, cells: usize, instants: &[f64]) -> Course {
    let unworn = unworn_threshold(problem);
    let stick = problem.shape.image_inverse((1.0 - unworn).max(0.0));
    let mesh = equal(stick, 1.2, cells / 3);
    let (_, trace, outer) = Run::new(problem, mesh, unworn).to(instants);
    let mesh = graded(stick, &trace, 1.05 * outer, cells);
    Run::new(problem, mesh, unworn).to(instants).0
}

/// A problem on two meshes, which tell the error.
pub struct Pair {
    /// On half of the cells.
    pub coarse: Course,
    /// On all of them.
    pub fine: Course,
}

impl Pair {
    /// Runs a problem on half and on all of so many cells.
    pub fn run(problem: &Problem, cells: usize, instants: &[f64]) -> Self {
        Self { coarse: run(problem, cells / 2, instants), fine: run(problem, cells, instants) }
    }

    /// A quantity at the instants on the finer mesh, and the largest relative difference between
    /// both: the error, which halves with the cells. The largest, because it changes its sign.
    pub fn column(&self, of: impl Fn(&State) -> f64) -> (Vec<f64>, f64) {
        let fine: Vec<f64> = self.fine.states.iter().map(&of).collect();
        let coarse: Vec<f64> = self.coarse.states.iter().map(&of).collect();
        assert_eq!(fine.len(), coarse.len(), "one mesh slips where the other sticks");
        let apart = fine.iter().zip(&coarse).map(|(fine, coarse)| (fine / coarse - 1.0).abs());
        let error = apart.fold(0.0, f64::max);
        (fine, error)
    }

    /// When gross slip began on the finer mesh, and the relative difference between both.
    pub fn gross_slip(&self) -> Option<(f64, f64)> {
        let (fine, coarse) = (self.fine.gross_slip?, self.coarse.gross_slip?);
        Some((fine, if fine == coarse { 0.0 } else { (fine / coarse - 1.0).abs() }))
    }
}

/// Δ of the unworn contact.
fn unworn_threshold(problem: &Problem) -> f64 {
    let shape = &problem.shape;
    let force = |c: f64| {
        let threshold = 1.0 - shape.image(c);
        2.0 * (c * threshold + integrate(c, 1.0, |x| 1.0 - shape.image(x)))
    };
    match &problem.tangential {
        Tangential::Amplitude(threshold) | Tangential::Record { limit: threshold, .. } => {
            *threshold
        }
        Tangential::Blocks(blocks) => blocks[0].0,
        Tangential::Force(q) => 1.0 - shape.image(root(0.0, 1.0, |c| force(c) - q)),
        Tangential::Rig { amplitude, compliance } => {
            let excess = |c: f64| 1.0 - shape.image(c) + compliance * force(c) - amplitude;
            let loose = amplitude - compliance * force(0.0);
            if loose >= 1.0 { loose } else { 1.0 - shape.image(root(0.0, 1.0, excess)) }
        }
    }
}

/// Cells of one width up to `to`, one point at `at`.
fn equal(at: f64, to: f64, cells: usize) -> Vec<f64> {
    let width = to / cells as f64;
    let nearest = (at / width).round();
    let mut radii: Vec<f64> = (0..=cells).map(|i| i as f64 * width).collect();
    if nearest > 0.0 {
        radii[nearest as usize] = at;
    }
    radii
}

/// Cells shrink towards the stick edge as far as this, and not beyond.
const CORE: f64 = 0.003;
/// How many cells that takes; the others are of one width.
const SHARE: f64 = 0.1;

/// Cells that are small near the places in `trace`, one point at `at`.
fn graded(at: f64, trace: &[f64], to: f64, cells: usize) -> Vec<f64> {
    let least = trace.iter().copied().fold(at, f64::min);
    let from = if least > 0.1 { 0.9 * least } else { 0.0 };
    // As many points below x as this.
    let count = |x: f64| -> f64 {
        let sticking: Vec<f64> =
            trace.iter().filter(|c| **c > 0.0).map(|c| ((x - c) / CORE).asinh()).collect();
        x / to + SHARE * sticking.iter().sum::<f64>() / sticking.len().max(1) as f64
    };
    let (first, last) = (count(from), count(to));
    let mut radii: Vec<f64> = (0..=cells)
        .map(|i| {
            let share = first + (last - first) * i as f64 / cells as f64;
            root(from, to, |x| count(x) - share)
        })
        .collect();
    (radii[0], radii[cells]) = (from, to);
    if at > 0.0 {
        let right = radii.partition_point(|r| *r < at).min(cells);
        let nearest = if at - radii[right - 1] < radii[right] - at { right - 1 } else { right };
        radii[nearest.max(1)] = at;
    }
    radii
}

/// (2/π) ∫ ω/√(r²−x²) dx between two points, ω linear.
fn slipped(r: f64, (from, to): (f64, f64), (at_from, at_to): (f64, f64)) -> f64 {
    if from == to {
        return 0.0;
    }
    let chord = |x: f64| ((r - x) * (r + x)).sqrt();
    let (near, far) = (chord(from), chord(to));
    let angle = to.atan2(far) - from.atan2(near);
    let slope = (at_to - at_from) / (to - from);
    FRAC_2_PI * ((at_from - slope * from) * angle + slope * (near - far))
}

/// The mesh and what depends on nothing else.
struct Mesh {
    radii: Vec<f64>,
    unworn: Vec<f64>,
    /// Point by point, g − g₀ − w(0) from the differences of w in the cells inside.
    image: Vec<Vec<f64>>,
    /// Point by point, p from the differences of y in the cells outside.
    pressure: Vec<Vec<f64>>,
    /// Point by point, s from ω inside.
    slip: Vec<Vec<f64>>,
}

impl Mesh {
    fn new(shape: &Shape, radii: Vec<f64>) -> Self {
        let cells: Vec<(f64, f64)> = radii.windows(2).map(|pair| (pair[0], pair[1])).collect();
        let rows = |row: &dyn Fn(usize, f64) -> Vec<f64>| -> Vec<Vec<f64>> {
            radii.iter().enumerate().map(|(i, r)| row(i, *r)).collect()
        };
        let image = rows(&|i, x| {
            // x ∫ dr/√(x²−r²) is what `slipped` of a constant is, but for a factor.
            let one = |cell: &(f64, f64)| slipped(x, *cell, (1.0, 1.0)) / (cell.1 - cell.0);
            cells[..i].iter().map(|cell| x / FRAC_2_PI * one(cell)).collect()
        });
        let pressure = rows(&|i, r| cells[i..].iter().map(|cell| pressed(r, *cell)).collect());
        let slip = rows(&|i, r| {
            let mut weights = vec![0.0; i + 1];
            for (j, cell) in cells[..i].iter().enumerate() {
                weights[j] += slipped(r, *cell, (1.0, 0.0));
                weights[j + 1] += slipped(r, *cell, (0.0, 1.0));
            }
            if r == 0.0 {
                weights[0] = 1.0;
            }
            weights
        });
        let unworn = radii.iter().map(|x| shape.image(*x)).collect();
        Self { radii, unworn, image, pressure, slip }
    }
}

/// p from a fall of y by 1 between two points, y linear in x².
fn pressed(r: f64, (from, to): (f64, f64)) -> f64 {
    let chord = |x: f64| ((x - r) * (x + r)).max(0.0).sqrt();
    2.0 * FRAC_1_PI / (chord(from) + chord(to))
}

/// Where, as shares of a cell in which η runs from one value to the other, η is Δ or 0; and both ends.
fn pieces(ends: (f64, f64), threshold: f64) -> [f64; 4] {
    let share = |level: f64| {
        if ends.0 == ends.1 { 0.0 } else { ((level - ends.0) / (ends.1 - ends.0)).clamp(0.0, 1.0) }
    };
    let (one, other) = (share(threshold), share(0.0));
    [0.0, one.min(other), one.max(other), 1.0]
}

/// The springs under some wear.
struct Springs {
    depth: f64,
    /// The largest y.
    most: f64,
    threshold: f64,
    /// η at the points.
    eta: Vec<f64>,
    normal_force: f64,
    tangential_force: f64,
}

struct Run<'a> {
    problem: &'a Problem,
    mesh: Mesh,
    unworn_threshold: f64,
    time: f64,
    wear: Vec<f64>,
}

/// The step is this share of the time in which s would cross the smallest cell.
const COURANT: f64 = 0.8;
/// And never longer than this.
const LONGEST: f64 = 0.1;
/// Where no step as short as this is possible, the tangential force is borne no more.
const SHORTEST: f64 = 1e-5;
/// How often the stick edge is looked at to see where it stays.
const LOOKS: usize = 16;

impl<'a> Run<'a> {
    fn new(problem: &'a Problem, radii: Vec<f64>, unworn_threshold: f64) -> Self {
        let wear = vec![0.0; radii.len()];
        let mesh = Mesh::new(&problem.shape, radii);
        Self { problem, mesh, unworn_threshold, time: 0.0, wear }
    }

    /// Runs to the instants: the states there, where the stick edge was and how far the contact went.
    fn to(mut self, instants: &[f64]) -> (Course, Vec<f64>, f64) {
        let mut course = Course { states: Vec::new(), gross_slip: None };
        let end = instants.last().copied().unwrap_or(0.0);
        let mut stops: Vec<f64> = instants.to_vec();
        if let Tangential::Blocks(blocks) = &self.problem.tangential {
            stops.extend(blocks.iter().map(|block| block.1).filter(|until| *until < end));
        }
        stops.extend((0..LOOKS).map(|i| end * i as f64 / LOOKS as f64));
        stops.sort_by(f64::total_cmp);
        stops.dedup();
        let (mut trace, mut outer) = (Vec::new(), 1.0_f64);
        for stop in stops {
            if !self.advance(stop, &mut course.gross_slip) {
                break;
            }
            let Some(springs) = self.springs(&self.wear) else { break };
            let state = self.state(&springs);
            trace.push(state.stick_radius);
            outer = outer.max(state.contact_radius);
            if instants.contains(&stop) {
                course.states.push(state);
            }
        }
        (course, trace, outer)
    }

    /// Steps to an instant; false if the tangential force is borne no more.
    fn advance(&mut self, until: f64, gross_slip: &mut Option<f64>) -> bool {
        while self.time < until {
            let Some(springs) = self.springs(&self.wear) else {
                *gross_slip = Some(self.time);
                return false;
            };
            if gross_slip.is_none() && springs.most <= springs.threshold {
                *gross_slip = Some(self.time);
            }
            let (rate, speed) = self.rate(&springs);
            let mut step = (COURANT / speed).min(LONGEST);
            self.wear = loop {
                let last = self.time + step >= until;
                if last {
                    step = until - self.time;
                }
                if step < SHORTEST && !last {
                    *gross_slip = Some(self.time);
                    return false;
                }
                let ahead: Vec<f64> =
                    self.wear.iter().zip(&rate).map(|(w, v)| w + step * v).collect();
                if let Some(springs) = self.springs(&ahead) {
                    let (second, _) = self.rate(&springs);
                    break (0..rate.len())
                        .map(|i| self.wear[i] + 0.5 * step * (rate[i] + second[i]))
                        .collect();
                }
                step *= 0.5;
            };
            self.time = if self.time + step >= until { until } else { self.time + step };
            self.make_room();
        }
        true
    }

    /// Appends cells once the contact has come near the last.
    fn make_room(&mut self) {
        let points = self.mesh.radii.len();
        if self.wear[points - 3..].iter().all(|w| *w == 0.0) {
            return;
        }
        let mut radii = self.mesh.radii.clone();
        let width = radii[points - 1] - radii[points - 2];
        let last = radii[points - 1];
        radii.extend((1..=points / 8 + 2).map(|i| last + i as f64 * width));
        self.wear.resize(radii.len(), 0.0);
        self.mesh = Mesh::new(&self.problem.shape, radii);
    }

    /// ω of a spring.
    fn omega(&self, eta: f64, threshold: f64) -> f64 {
        match &self.problem.tangential {
            Tangential::Record { omega, .. } => omega(eta.max(0.0)),
            _ => (threshold - eta.max(0.0)).max(0.0) / self.unworn_threshold,
        }
    }

    /// ∫ f(y) dx from the first point on, f smooth between 0 and Δ and beyond.
    fn sum(&self, eta: &[f64], threshold: f64, f: impl Fn(f64) -> f64) -> f64 {
        let radii = &self.mesh.radii;
        let mut sum = 0.0;
        for (x, eta) in radii.windows(2).zip(eta.windows(2)) {
            let shares = pieces((eta[0], eta[1]), threshold);
            let at = |share: f64| f((eta[0] + share * (eta[1] - eta[0])).max(0.0));
            for pair in shares.windows(2) {
                if pair[1] > pair[0] {
                    // Simpson's rule.
                    let middle = at(0.5 * (pair[0] + pair[1]));
                    let mean = (at(pair[0]) + 4.0 * middle + at(pair[1])) / 6.0;
                    sum += (x[1] - x[0]) * (pair[1] - pair[0]) * mean;
                }
            }
        }
        sum
    }

    fn normal_force(&self, image: &[f64], depth: f64) -> f64 {
        let radii = &self.mesh.radii;
        let core = integrate(0.0, radii[0], |x| depth - self.problem.shape.image(x));
        let mut sum = core;
        for (x, g) in radii.windows(2).zip(image.windows(2)) {
            let (y, z) = (depth - g[0], depth - g[1]);
            sum += (x[1] - x[0])
                * match (y > 0.0, z > 0.0) {
                    (true, true) => 0.5 * (y + z),
                    (true, false) => 0.5 * y * y / (y - z),
                    (false, true) => 0.5 * z * z / (z - y),
                    (false, false) => 0.0,
                };
        }
        2.0 * sum
    }

    fn tangential_force(&self, eta: &[f64], depth: f64, threshold: f64) -> f64 {
        let shape = &self.problem.shape;
        let radius = self.mesh.radii[0];
        let stick = shape.image_inverse((depth - threshold).clamp(0.0, 1.0)).min(radius);
        let core = stick * threshold + integrate(stick, radius, |x| depth - shape.image(x));
        2.0 * (core + self.sum(eta, threshold, |y| y.min(threshold)))
    }

    /// The springs under some wear; `None` if they cannot bear the tangential force.
    fn springs(&self, wear: &[f64]) -> Option<Springs> {
        let mesh = &self.mesh;
        let rises: Vec<f64> = wear.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let image: Vec<f64> = mesh
            .unworn
            .iter()
            .zip(&mesh.image)
            .map(|(unworn, row)| unworn + wear[0] + dot(row, &rises))
            .collect();
        let depth = match self.problem.normal {
            Normal::Depth => 1.0,
            Normal::Force => {
                let force = 2.0 * self.problem.shape.half_force();
                let mut high = 1.5;
                while self.normal_force(&image, high) < force {
                    high *= 1.5;
                }
                root(0.5, high, |depth| self.normal_force(&image, depth) - force)
            }
        };
        let eta: Vec<f64> = image.iter().map(|g| depth - g).collect();
        let normal_force = self.normal_force(&image, depth);
        // Inside the first point nothing is worn.
        let axis = if mesh.radii[0] > 0.0 { depth } else { eta[0] };
        let most = eta.iter().copied().fold(axis, f64::max);
        let force = |threshold: f64| self.tangential_force(&eta, depth, threshold);
        let threshold = match &self.problem.tangential {
            Tangential::Amplitude(threshold) | Tangential::Record { limit: threshold, .. } => {
                *threshold
            }
            Tangential::Blocks(blocks) => {
                let now = blocks.iter().find(|block| self.time < block.1);
                now.or(blocks.last()).map_or(self.unworn_threshold, |block| block.0)
            }
            Tangential::Force(q) if normal_force <= *q => return None,
            Tangential::Force(q) => root(0.0, most, |threshold| force(threshold) - q),
            Tangential::Rig { amplitude, compliance } => root(0.0, *amplitude, |threshold| {
                threshold + compliance * force(threshold) - amplitude
            }),
        };
        let tangential_force = force(threshold);
        Some(Springs { depth, most, threshold, eta, normal_force, tangential_force })
    }

    /// dw/dÑ, and the largest s over the width of a cell.
    fn rate(&self, springs: &Springs) -> (Vec<f64>, f64) {
        let (mesh, eta) = (&self.mesh, &springs.eta);
        let radii = &mesh.radii;
        assert!(radii[0] == 0.0 || eta[0] > springs.threshold, "slip inside the first point");
        let omega: Vec<f64> = eta.iter().map(|eta| self.omega(*eta, springs.threshold)).collect();
        let falls: Vec<f64> =
            eta.windows(2).map(|pair| pair[0].max(0.0) - pair[1].max(0.0)).collect();
        let mut slip: Vec<f64> = mesh.slip.iter().map(|row| dot(row, &omega)).collect();
        let mut pressure: Vec<f64> =
            mesh.pressure.iter().enumerate().map(|(i, row)| dot(row, &falls[i..])).collect();
        // The cells in which an edge lies are taken out and put in again in pieces.
        for j in 0..falls.len() {
            let cell = (radii[j], radii[j + 1]);
            let ends = (eta[j], eta[j + 1]);
            let shares = pieces(ends, springs.threshold);
            let inside = |share: f64| share > 0.0 && share < 1.0;
            if inside(shares[1]) || inside(shares[2]) {
                let at = |share: f64| {
                    let eta = ends.0 + share * (ends.1 - ends.0);
                    (
                        (cell.0 + share * (cell.1 - cell.0)).min(cell.1),
                        self.omega(eta, springs.threshold),
                    )
                };
                for (r, slip) in radii.iter().zip(&mut slip).skip(j + 1) {
                    *slip -= slipped(*r, cell, (omega[j], omega[j + 1]));
                    for pair in shares.windows(2) {
                        let ((x, left), (z, right)) = (at(pair[0]), at(pair[1]));
                        *slip += slipped(*r, (x, z), (left, right));
                    }
                }
            }
            if (ends.0 > 0.0) != (ends.1 > 0.0) {
                let share = ends.0 / (ends.0 - ends.1);
                let edge = (cell.0 * cell.0 + share * (cell.1 * cell.1 - cell.0 * cell.0)).sqrt();
                let part = if ends.0 > 0.0 { (cell.0, edge) } else { (edge, cell.1) };
                for (r, p) in radii.iter().zip(&mut pressure).take(j + 1) {
                    if part.1 > *r {
                        *p += (pressed(*r, part) - pressed(*r, cell)) * falls[j];
                    } else {
                        *p -= pressed(*r, cell) * falls[j];
                    }
                }
            }
        }
        let mut speed: f64 = 0.0;
        for (slip, r) in slip[1..].iter().zip(radii.windows(2)) {
            speed = speed.max(slip / (r[1] - r[0]));
        }
        let rate = (0..radii.len())
            .map(|i| if eta[i] > 0.0 { pressure[i] * slip[i] } else { 0.0 })
            .collect();
        (rate, speed)
    }

    fn state(&self, springs: &Springs) -> State {
        let (radii, wear, eta) = (&self.mesh.radii, &self.wear, &springs.eta);
        let threshold = springs.threshold;
        let volume: f64 = (1..radii.len())
            .map(|i| {
                let (r, z, v, w) = (radii[i - 1], radii[i], wear[i - 1], wear[i]);
                PI / 3.0 * (z - r) * (v * (2.0 * r + z) + w * (r + 2.0 * z))
            })
            .sum();
        let crossing = |level: f64, j: usize| {
            let (left, right) = (eta[j] - level, eta[j + 1] - level);
            (left > 0.0 && right <= 0.0)
                .then(|| radii[j] + left / (left - right) * (radii[j + 1] - radii[j]))
        };
        let cells = || (0..eta.len() - 1).rev();
        State {
            time: self.time,
            volume,
            normal_force: springs.normal_force,
            tangential_force: springs.tangential_force,
            indentation_depth: springs.depth,
            threshold,
            wear_depth: vertex(radii, wear, largest(wear)),
            contact_radius: cells().find_map(|j| crossing(0.0, j)).unwrap_or(0.0),
            stick_radius: cells().find_map(|j| crossing(threshold, j)).unwrap_or(0.0),
            energy: self.sum(eta, threshold, |y| y * self.omega(y, threshold)),
            radii: radii.clone(),
            wear: wear.clone(),
        }
    }
}

/// Cells of the finer mesh in the tests below.
const CELLS: usize = 400;

fn held(shape: Shape, normal: Normal, tangential: Tangential) -> Problem {
    Problem { shape, normal, tangential }
}

/// The rows of a part of the table, which two other discretisations have been extrapolated to.
fn rows(part: &str) -> Vec<Value> {
    let table: Value =
        serde_json::from_str(include_str!("../data/verification.json")).expect("a JSON table");
    table[part].as_array().expect("rows").clone()
}

fn number(row: &Value, name: &str) -> f64 {
    row[name].as_f64().expect(name)
}

fn numbers(row: &Value, name: &str) -> Vec<f64> {
    row[name].as_array().expect(name).iter().map(|x| x.as_f64().expect(name)).collect()
}

/// A quantity of the states and the name of its column.
type Column = (&'static str, fn(&State) -> f64);

const VOLUME: Column = ("wear_volume", |state| state.volume);
const FORCE: Column = ("normal_force", |state| state.normal_force);
const DEPTH: Column = ("indentation_depth", |state| state.indentation_depth);
const WEAR: Column = ("wear_depth", |state| state.wear_depth);
const CONTACT: Column = ("contact_radius", |state| state.contact_radius);
const STICK: Column = ("stick_radius", |state| state.stick_radius);

/// Both meshes against the columns of a row: off by no more than `tolerance`, and by no more than
/// what the two tell of their error and the row of its own.
fn compare(pair: &Pair, row: &Value, own: f64, columns: &[(Column, f64)]) {
    for ((name, of), tolerance) in columns {
        let (values, error) = pair.column(of);
        let expected = numbers(row, name);
        let off = values.iter().zip(&expected).map(|(value, x)| (value / x - 1.0).abs());
        let off = off.fold(0.0, f64::max);
        println!("{name}: {off:.1e}, own error {error:.1e}");
        assert!(off < *tolerance, "{name} is {off} off in {row}");
        assert!(off < error + own, "{name} is {off} off, not {error}, in {row}");
    }
}

/// The parts, each against what is known in closed form.
#[test]
fn the_three_transforms_are_of_first_order_at_least() {
    for exponent in [1.0, 2.0, 3.0] {
        let shape = Shape::power(exponent);
        let off = |cells: usize| -> [f64; 3] {
            let problem = held(shape.clone(), Normal::Depth, Tangential::Amplitude(2.0));
            let run = Run::new(&problem, equal(0.0, 1.2, cells), 2.0);
            let radii = &run.mesh.radii;
            let most = |f: &dyn Fn(usize) -> f64| {
                (1..radii.len()).filter(|i| radii[*i] > 0.1).map(f).fold(0.0, f64::max)
            };
            // Worn by its own profile, the image is twice the image.
            let wear: Vec<f64> = radii.iter().map(|r| shape.profile(*r)).collect();
            let worn = run.springs(&wear).expect("springs");
            let image = most(&|i| (1.0 - worn.eta[i] - 2.0 * shape.image(radii[i])).abs());
            // s of ω = (2 − y)/2 is (1 + f₀)/2 in contact; p is that of the unworn contact.
            let unworn = run.springs(&vec![0.0; radii.len()]).expect("springs");
            let rate = run.rate(&unworn).0;
            let slip = |r: f64| 0.5 * (1.0 + shape.profile(r));
            let expected = |i: usize| shape.pressure_inside(radii[i], 1.0) * slip(radii[i]);
            let force = 2.0 * shape.half_force();
            [
                image,
                most(&|i| (rate[i] - expected(i)).abs()),
                (unworn.normal_force / force - 1.0).abs(),
            ]
        };
        let (coarse, fine) = (off(60), off(240));
        println!("{exponent}: {coarse:?} {fine:?}");
    }
}

#[test]
fn with_depth_and_amplitude_held_the_table_is_met() {
    for row in rows("exact_depth_and_amplitude_held") {
        let shape = Shape::power(number(&row, "exponent"));
        let threshold = 1.0 - shape.image(number(&row, "stick_radius"));
        let problem = held(shape, Normal::Depth, Tangential::Amplitude(threshold));
        let pair = Pair::run(&problem, CELLS, &numbers(&row, "normalized_cycles"));
        compare(
            &pair,
            &row,
            1e-3,
            &[(VOLUME, 1.5e-3), (FORCE, 1.5e-3), (WEAR, 1e-3), (CONTACT, 1e-2)],
        );
    }
}

#[test]
fn with_force_and_amplitude_held_the_table_is_met() {
    for row in rows("exact_force_and_amplitude_held") {
        let shape = Shape::power(number(&row, "exponent"));
        let threshold = 1.0 - shape.image(number(&row, "stick_radius_initial"));
        let problem = held(shape, Normal::Force, Tangential::Amplitude(threshold));
        let pair = Pair::run(&problem, CELLS, &numbers(&row, "normalized_cycles"));
        compare(
            &pair,
            &row,
            2e-3,
            &[(VOLUME, 5e-3), (DEPTH, 1e-3), (WEAR, 3e-3), (CONTACT, 1e-2), (STICK, 1.5e-3)],
        );
    }
}

#[test]
fn with_depth_and_tangential_force_held_the_table_is_met() {
    for row in rows("exact_depth_and_tangential_force_held") {
        let shape = Shape::power(number(&row, "exponent"));
        let force = 2.0 * shape.half_force() * number(&row, "q");
        let problem = held(shape, Normal::Depth, Tangential::Force(force));
        let mut instants = numbers(&row, "normalized_cycles");
        if row["gross_slip_at"].is_string() {
            instants.push(30.0);
        }
        let pair = Pair::run(&problem, CELLS, &instants);
        compare(&pair, &row, 2e-3, &[(VOLUME, 5e-3)]);
        println!("{:?} {}", pair.gross_slip(), row["gross_slip_at"]);
    }
}

#[test]
fn with_both_forces_held_the_table_is_met() {
    for row in rows("exact_force_and_tangential_force_held") {
        let shape = Shape::power(number(&row, "exponent"));
        let force = 2.0 * shape.half_force() * number(&row, "q");
        let problem = held(shape, Normal::Force, Tangential::Force(force));
        let pair = Pair::run(&problem, CELLS, &numbers(&row, "normalized_cycles"));
        compare(&pair, &row, 2e-3, &[(VOLUME, 5e-3)]);
    }
}

#[test]
fn every_limit_in_the_table_is_reached() {
    for (part, normal) in [
        ("limit_force_and_tangential_force_held", Normal::Force),
        ("limit_depth_and_tangential_force_held", Normal::Depth),
    ] {
        for row in rows(part) {
            let shape = Shape::power(number(&row, "exponent"));
            let force = 2.0 * shape.half_force();
            let problem = held(shape, normal, Tangential::Force(force * number(&row, "q")));
            let course = run(&problem, CELLS / 2, &[100.0]);
            let state = &course.states[0];
            for (name, value) in [
                ("wear_volume", state.volume),
                ("wear_depth", state.wear_depth),
                ("stick_radius", state.stick_radius),
                ("normal_force_ratio", state.normal_force / force),
                ("limiting_radius", state.contact_radius),
            ] {
                let off = (value / number(&row, name) - 1.0).abs();
                println!("{name} {off:.1e} {row}");
            }
        }
    }
}

/// Energy, in every mode.
#[test]
fn wear_is_what_the_energy_says() {
    let wave = |y: f64| 0.5 * ((0.75 - y).max(0.0) + (0.6 - y).max(0.0)) / 0.75;
    for (name, normal, tangential) in [
        ("amplitude", Normal::Depth, Tangential::Amplitude(0.75)),
        ("amplitude", Normal::Force, Tangential::Amplitude(0.75)),
        ("force", Normal::Depth, Tangential::Force(0.6)),
        ("force", Normal::Force, Tangential::Force(0.6)),
        ("rig", Normal::Force, Tangential::Rig { amplitude: 1.0, compliance: 0.3 }),
        ("gross", Normal::Force, Tangential::Amplitude(1.5)),
        ("gross", Normal::Depth, Tangential::Amplitude(1.5)),
        ("blocks", Normal::Depth, Tangential::Blocks(vec![(0.6, 0.5), (0.75, 9.0)])),
        ("record", Normal::Depth, Tangential::Record { omega: Box::new(wave), limit: 0.75 }),
    ] {
        let problem = held(Shape::power(2.0), normal, tangential);
        let course = run(&problem, CELLS, &[0.9, 1.0, 1.1]);
        let states = &course.states;
        let rate = (states[2].volume - states[0].volume) / (states[2].time - states[0].time);
        println!("{name} {normal:?}: {}", rate / (2.0 * states[1].energy) - 1.0);
    }
}

#[test]
fn a_rig_lies_between_amplitude_and_force_held() {
    let instants = [0.5, 2.0, 8.0];
    let shape = Shape::power(2.0);
    let volumes = |tangential: Tangential| -> Vec<f64> {
        let problem = held(shape.clone(), Normal::Force, tangential);
        run(&problem, CELLS / 4, &instants).states.iter().map(|state| state.volume).collect()
    };
    let amplitude = volumes(Tangential::Amplitude(0.64));
    let q = 2.0 * (0.6 * 0.64 + integrate(0.6, 1.0, |x| 1.0 - x * x));
    let force = volumes(Tangential::Force(q));
    for compliance in [0.0, 0.3, 1e6] {
        let rig = volumes(Tangential::Rig { amplitude: 0.64 + compliance * q, compliance });
        println!("{compliance}: {rig:?} {amplitude:?} {force:?}");
    }
}

#[test]
fn blocks_and_records_of_one_amplitude_are_that_amplitude() {
    let instants = [0.5, 2.0, 8.0];
    let volumes = |tangential: Tangential| -> Vec<f64> {
        let problem = held(Shape::power(2.0), Normal::Depth, tangential);
        run(&problem, CELLS / 4, &instants).states.iter().map(|state| state.volume).collect()
    };
    let amplitude = volumes(Tangential::Amplitude(0.75));
    let blocks = volumes(Tangential::Blocks(vec![(0.75, 1.0), (0.75, 3.0)]));
    let omega = Box::new(|y: f64| (0.75 - y).max(0.0) / 0.75);
    let record = volumes(Tangential::Record { omega, limit: 0.75 });
    println!("{amplitude:?}\n{blocks:?}\n{record:?}");
    let falling = volumes(Tangential::Blocks(vec![(0.75, 1.0), (0.5, 30.0)]));
    let rising = volumes(Tangential::Blocks(vec![(0.5, 1.0), (0.75, 30.0)]));
    println!("{falling:?}\n{rising:?}");
}

#[test]
fn gross_slip_under_force_wears_by_force_and_path() {
    let problem = held(Shape::power(2.0), Normal::Force, Tangential::Amplitude(100.0));
    let pair = Pair::run(&problem, CELLS, &[1.0, 8.0, 32.0]);
    let (volumes, error) = pair.column(VOLUME.1);
    println!("{volumes:?} {error} {:?}", pair.gross_slip());
}

#[test]
fn the_engine_agrees_in_partial_and_in_gross_slip() {
    for (shape, threshold) in [
        (Shape::power(2.0), 0.75),
        (Shape::power(2.0), 0.2),
        (Shape::power(1.0), 0.79),
        (Shape::power(4.0), 0.76),
        (Shape::sphere(2.0), 0.5),
        (Shape::power(2.0), 1.02),
        (Shape::power(2.0), 3.0),
        (Shape::power(1.0), 1.5),
        (Shape::power(4.0), 1.2),
    ] {
        let contact = Contact::new(shape.clone(), threshold).expect("a limit");
        let mut engine = Exact::new(&contact, 3e-4);
        let problem = held(shape, Normal::Depth, Tangential::Amplitude(threshold));
        let instants = [0.25, 1.0, 4.0];
        let pair = Pair::run(&problem, CELLS, &instants);
        let engine: Vec<_> = instants
            .iter()
            .map(|instant| {
                while engine.advance(*instant) {}
                engine.at(*instant)
            })
            .collect();
        let check = |name: &str, of: fn(&State) -> f64, engine: Vec<f64>| {
            let (values, error) = pair.column(of);
            let off = values.iter().zip(&engine).map(|(value, x)| (value / x - 1.0).abs());
            let off = off.fold(0.0, f64::max);
            println!("{threshold} {name}: {off:.1e}, own error {error:.1e}");
        };
        check("volume", VOLUME.1, engine.iter().map(|state| state.volume).collect());
        check("force", FORCE.1, engine.iter().map(|state| 2.0 * state.normal).collect());
        check("depth", WEAR.1, engine.iter().map(|state| state.depth).collect());
        check("contact", CONTACT.1, engine.iter().map(|state| state.contact_radius).collect());
        check(
            "Q",
            |s| s.tangential_force,
            engine.iter().map(|state| 2.0 * state.tangential).collect(),
        );
        check(
            "energy",
            |s| s.energy,
            engine.iter().map(|state| state.energy / threshold).collect(),
        );
    }
}
