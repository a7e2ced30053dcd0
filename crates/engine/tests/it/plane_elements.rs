//! A second solver of the line contact, as an independent check of the engine.
//!
//! Boundary elements with the logarithmic kernel of the half-plane, and one bounded quadratic
//! programme for each load step. No Abel transform and no superposition of contacts is used. All
//! quantities are per unit length, in consistent units.
//!
//! # Equations
//! ```text
//! u(x) = −(2/(πE*)) ∫ q(t) ln|x−t| dt           displacement by the traction, the same for p
//! p ≥ 0,  gap + u − δ ≥ 0,  ∫ p dx = F           normal
//! |q| ≤ μp,  slip = δ − u                        tangential; slip only where |q| = μp, along q
//! U = δ − u(±L) + Q/k                            stroke against the surface points at ±L
//! ```
//! Pressure and traction are constant on each element, and even in x: an element stands for itself
//! and its mirror image. The equations hold in the mean over each element (Galerkin), so the matrix
//! is symmetric and positive definite, and the work of the tractions is exact.
//!
//! # Accuracy
//! Largest relative errors of the tests below. "Worn" is a cylinder half-way to its limiting
//! profile; a worn profile has a kink at the stick edge.
//! ```text
//!                              60 elements   120       240
//! W         cylinder, wedge    2e-4          2e-5      2e-6
//!           punch              2e-3          3e-4      8e-5
//!           worn               1e-3          8e-4      2e-4
//! Q         stroke held        3e-5          2e-5      3e-6
//! path      all                4e-4          1e-4      3e-5
//! p         cylinder           4e-4          9e-5      3e-5
//!           wedge              2e-3          7e-4      3e-4
//!           limiting profile   7e-4          2e-4      3e-5
//! a, c      share of a         4e-3          9e-4      5e-4
//! ```
//! The reference of a stroke must be some elements beyond the edge of the contact: 1.1 a is enough.

use std::f64::consts::PI;

use fretwork_engine::numeric::{dot, integrate, root};

/// What is held in the tangential direction during a cycle.
#[derive(Debug, Clone, Copy)]
pub enum Held {
    /// The tangential force per length is between −Q and Q.
    Force(f64),
    /// The stroke is between −U and U. It is measured against the surface points at the distance
    /// `reference` from the middle. A spring of the given stiffness per length can be in series.
    Stroke { amplitude: f64, reference: f64, rig_stiffness: Option<f64> },
}

/// Two similar half-planes with a symmetric gap between them.
pub struct Contact {
    /// The gap f(x) + w(x) for x ≥ 0. A constant makes no difference.
    pub gap: Box<dyn Fn(f64) -> f64>,
    /// The positions x ≥ 0 at which the slope or the curvature of the gap is discontinuous.
    pub kinks: Vec<f64>,
    /// An upper bound of the half-width of the contact.
    pub bound: f64,
    /// The normal force F per length.
    pub force: f64,
    /// The coefficient of friction μ.
    pub friction: f64,
    /// E*, 1/E* = Σ (1 − ν²)/E.
    pub modulus: f64,
}

/// The contact in steady cycles.
#[derive(Debug)]
pub struct State {
    /// The centres and the widths of the elements, x > 0.
    pub centres: Vec<f64>,
    pub widths: Vec<f64>,
    /// The pressure of each element.
    pub pressure: Vec<f64>,
    /// The length of the path that each element slips during a cycle; 0 outside the contact.
    pub path: Vec<f64>,
    /// The energy W that a cycle dissipates, per length.
    pub energy: f64,
    /// The tangential force Q at the end of a stroke, per length.
    pub tangential_force: f64,
    /// The half-width a of the contact, to the width of an element.
    pub half_width: f64,
    /// The half-width c of the middle that sticks, to the width of an element; 0 in gross slip.
    pub stick_half_width: f64,
    /// The displacement at which the force is zero on the way back from the end of a held stroke.
    pub aperture: f64,
}

/// Load steps from one end of the stroke to the other.
const STEPS: usize = 4;
/// Minimum scale of the element widths next to an edge or a kink, as a share of the half-width.
const CORE: f64 = 0.003;
/// Weight of the small elements at each edge or kink; the other elements have equal widths.
const SHARE: f64 = 0.15;
/// Rounds without progress, after which only one element changes its side at a time.
const PATIENCE: usize = 8;
/// Rounds after which the search for the sides gives up.
const ROUNDS: usize = 4000;
/// A residual that counts as 0, as a share of the largest one. A path likewise.
const TOLERANCE: f64 = 1e-10;

impl Contact {
    /// Loads the contact through two cycles on `count` elements, which cover all kinks. Two coarse
    /// passes find the edges, at which the elements are small.
    pub fn solve(&self, held: Held, count: usize) -> State {
        let mut nodes = graded(&[], self.bound, count / 2);
        for count in [count / 2, count] {
            let State { half_width, stick_half_width, .. } = self.pass(held, nodes);
            let edges = [half_width, stick_half_width].into_iter().filter(|x| *x > 0.0);
            let marks: Vec<f64> = edges.chain(self.kinks.iter().copied()).collect();
            let last = marks.iter().copied().fold(half_width, f64::max);
            nodes = graded(&marks, (1.05 * last).min(self.bound), count);
        }
        self.pass(held, nodes)
    }

    fn pass(&self, held: Held, nodes: Vec<f64>) -> State {
        let elements = Elements::new(nodes, self.modulus);
        let Elements { nodes, widths, .. } = &elements;
        let count = widths.len();
        let total: Vec<f64> = widths.iter().map(|width| 2.0 * width).collect();
        let gap: Vec<f64> = nodes.windows(2).map(|x| integrate(x[0], x[1], &self.gap)).collect();
        let mut held_force = Condition { weights: total.clone(), share: 0.0, target: self.force };
        let bounds = [&vec![0.0; count][..], &vec![f64::INFINITY; count]];
        let mut sides = vec![Side::Free; count];
        let pressure = elements.bounded(&gap, bounds, &held_force, &mut sides).traction;
        assert_eq!(pressure[count - 1], 0.0, "the contact is wider than the elements");
        let half_width = pressure.iter().rposition(|p| *p > 0.0).map_or(0.0, |i| nodes[i + 1]);

        let without_force = Condition { target: 0.0, ..held_force.clone() };
        let mut reach = None;
        let (amplitude, condition) = match held {
            Held::Force(amplitude) => (amplitude, &mut held_force),
            Held::Stroke { amplitude, reference, rig_stiffness } => {
                let yielding = rig_stiffness.map_or(0.0, f64::recip);
                let surface = elements.surface(reference);
                let weights = total.iter().zip(&surface).map(|(width, u)| yielding * width - u);
                held_force = Condition { weights: weights.collect(), share: 1.0, target: 0.0 };
                reach = Some(surface);
                (amplitude, &mut held_force)
            }
        };
        let upper: Vec<f64> = pressure.iter().map(|p| self.friction * p).collect();
        let lower: Vec<f64> = upper.iter().map(|q| -q).collect();
        let (mut slip, mut path, mut energies) = (vec![0.0; count], vec![0.0; count], [0.0; 3]);
        let mut traction = vec![0.0; count];
        // From 0 to the amplitude, and then two cycles.
        for (stroke, ends) in
            [(0.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, 1.0)].into_iter().enumerate()
        {
            if stroke == 3 {
                path.fill(0.0);
            }
            for step in 1..=STEPS {
                let level = ends.0 + (ends.1 - ends.0) * step as f64 / STEPS as f64;
                condition.target = level * amplitude;
                let dragged = elements.bounded(&slip, [&lower, &upper], condition, &mut sides);
                // The residual is the slip backwards.
                energies[stroke.div_ceil(2)] -= 2.0 * dot(&dragged.traction, &dragged.residual);
                for (i, back) in dragged.residual.iter().enumerate() {
                    slip[i] -= back;
                    path[i] += if pressure[i] > 0.0 { back.abs() / widths[i] } else { 0.0 };
                }
                traction = dragged.traction;
            }
        }
        let back = elements.bounded(&slip, [&lower, &upper], &without_force, &mut sides);
        let aperture = reach.map_or(f64::NAN, |surface| back.rigid - dot(&surface, &back.traction));
        let [_, first, energy] = energies;
        assert!((energy - first).abs() <= 1e-6 * first, "{first} and {energy} in two cycles");
        let slips = TOLERANCE * path.iter().copied().fold(0.0, f64::max);
        let sticks = |i: &usize| pressure[*i] > 0.0 && path[*i] <= slips;
        State {
            centres: nodes.windows(2).map(|x| 0.5 * (x[0] + x[1])).collect(),
            tangential_force: dot(&total, &traction),
            half_width,
            stick_half_width: (0..count).rev().find(sticks).map_or(0.0, |i| nodes[i + 1]),
            widths: widths.clone(),
            pressure,
            path,
            energy,
            aperture,
        }
    }
}

/// Nodes of elements that are small near each mark, with a node at the last of marks that are close
/// together.
fn graded(marks: &[f64], to: f64, count: usize) -> Vec<f64> {
    let core = CORE * to;
    let number =
        |x: f64| x / to + SHARE * marks.iter().map(|mark| ((x - mark) / core).asinh()).sum::<f64>();
    let (first, last) = (number(0.0), number(to));
    let node = |i| {
        let share = first + (last - first) * i as f64 / count as f64;
        root(0.0, to, |x| number(x) - share)
    };
    let mut nodes: Vec<f64> = (0..=count).map(node).collect();
    (nodes[0], nodes[count]) = (0.0, to);
    for mark in marks.iter().filter(|mark| **mark < to) {
        let right = nodes.partition_point(|x| x < mark).clamp(1, count - 1);
        let left_is_near = right > 1 && mark - nodes[right - 1] < nodes[right] - mark;
        nodes[right - usize::from(left_is_near)] = if *mark > 0.0 { *mark } else { nodes[right] };
    }
    nodes
}

/// The second primitive of ln|z|.
fn second(z: f64) -> f64 {
    if z == 0.0 { 0.0 } else { z * z * (0.5 * z.abs().ln() - 0.75) }
}

/// The first primitive of ln|z|.
fn first(z: f64) -> f64 {
    if z == 0.0 { 0.0 } else { z * (z.abs().ln() - 1.0) }
}

/// The condition that fixes the rigid displacement δ: weights·traction + share·δ = target.
#[derive(Clone)]
struct Condition {
    weights: Vec<f64>,
    share: f64,
    target: f64,
}

/// Where the traction of an element is.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Side {
    Lower,
    Free,
    Upper,
}

struct Solution {
    traction: Vec<f64>,
    /// offset + u − δ, integrated over each element.
    residual: Vec<f64>,
    /// The rigid displacement δ.
    rigid: f64,
}

struct Elements {
    nodes: Vec<f64>,
    widths: Vec<f64>,
    /// The displacement integrated over element i by a traction of 1 on element j.
    compliance: Vec<Vec<f64>>,
    modulus: f64,
}

impl Elements {
    fn new(nodes: Vec<f64>, modulus: f64) -> Self {
        let widths: Vec<f64> = nodes.windows(2).map(|x| x[1] - x[0]).collect();
        let mut this = Self { nodes, widths, compliance: Vec::new(), modulus };
        let (unit, nodes) = (this.unit(), &this.nodes);
        let scale = -2.0 * unit * unit / (PI * modulus);
        let far = |a: f64, b: f64| second((a + b) / unit) - second((a - b) / unit);
        // The double integrals from 0 to two nodes. Their differences belong to elements.
        let corner: Vec<Vec<f64>> =
            nodes.iter().map(|a| nodes.iter().map(|b| far(*a, *b)).collect()).collect();
        this.compliance = corner
            .windows(2)
            .map(|rows| {
                let columns = rows[0].windows(2).zip(rows[1].windows(2));
                columns.map(|(a, b)| scale * (b[1] - b[0] - a[1] + a[0])).collect()
            })
            .collect();
        this
    }

    /// The unit of length in the logarithm. No distance exceeds it, so the matrix is positive definite.
    fn unit(&self) -> f64 {
        2.0 * self.nodes[self.widths.len()]
    }

    /// The displacement of the surface at x by a traction of 1 on each element.
    fn surface(&self, x: f64) -> Vec<f64> {
        let unit = self.unit();
        let far = |t: f64| first((x + t) / unit) - first((x - t) / unit);
        let scale = -2.0 * unit / (PI * self.modulus);
        self.nodes.windows(2).map(|t| scale * (far(t[1]) - far(t[0]))).collect()
    }

    /// Minimises the energy with the traction between two bounds: the residual is 0 where the
    /// traction is free, positive only at the lower bound, and negative only at the upper bound.
    ///
    /// All elements on a wrong side change it at once. If their number does not fall, only the last
    /// one changes. That is slow, but cannot run in a circle (block principal pivoting).
    fn bounded(
        &self,
        offset: &[f64],
        [lower, upper]: [&[f64]; 2],
        condition: &Condition,
        sides: &mut [Side],
    ) -> Solution {
        let (mut fewest, mut patience) = (usize::MAX, PATIENCE);
        for _ in 0..ROUNDS {
            for i in (0..sides.len()).filter(|i| lower[*i] == upper[*i]) {
                sides[i] = Side::Lower;
            }
            let solution = self.on_sides(offset, [lower, upper], condition, sides);
            let Solution { traction, residual, .. } = &solution;
            let mean = |i: usize| residual[i] / self.widths[i];
            let slack = TOLERANCE * (0..sides.len()).map(|i| mean(i).abs()).fold(0.0, f64::max);
            let change = |i: usize| match sides[i] {
                _ if lower[i] == upper[i] => None,
                Side::Free if traction[i] < lower[i] => Some((i, Side::Lower)),
                Side::Free if traction[i] > upper[i] => Some((i, Side::Upper)),
                Side::Lower if mean(i) < -slack => Some((i, Side::Free)),
                Side::Upper if mean(i) > slack => Some((i, Side::Free)),
                _ => None,
            };
            let wrong: Vec<(usize, Side)> = (0..sides.len()).filter_map(change).collect();
            if wrong.is_empty() {
                return solution;
            }
            patience = if wrong.len() < fewest { PATIENCE } else { patience.saturating_sub(1) };
            fewest = fewest.min(wrong.len());
            let first = if patience > 0 { 0 } else { wrong.len() - 1 };
            for (i, side) in &wrong[first..] {
                sides[*i] = *side;
            }
        }
        panic!("the sides of the elements do not settle");
    }

    /// The tractions for given sides.
    fn on_sides(
        &self,
        offset: &[f64],
        [lower, upper]: [&[f64]; 2],
        condition: &Condition,
        sides: &mut [Side],
    ) -> Solution {
        // A force needs an element that sticks. The last one to slip is in the middle.
        if condition.share == 0.0 && sides.iter().all(|side| *side != Side::Free) {
            sides[0] = Side::Free;
        }
        let free: Vec<usize> = (0..sides.len()).filter(|i| sides[*i] == Side::Free).collect();
        let on = |all: &[f64]| -> Vec<f64> { free.iter().map(|i| all[*i]).collect() };
        let mut traction: Vec<f64> = (0..sides.len())
            .map(|i| match sides[i] {
                Side::Lower => lower[i],
                Side::Free => 0.0,
                Side::Upper => upper[i],
            })
            .collect();
        let factor = factor(free.iter().map(|i| on(&self.compliance[*i])).collect());
        let push = |i: &usize| -offset[*i] - dot(&self.compliance[*i], &traction);
        let still = substitute(&factor, free.iter().map(push).collect());
        let moved = substitute(&factor, on(&self.widths));
        let weights = on(&condition.weights);
        let known = dot(&condition.weights, &traction) + dot(&weights, &still);
        let rigid = (condition.target - known) / (condition.share + dot(&weights, &moved));
        for (row, i) in free.iter().enumerate() {
            traction[*i] = still[row] + rigid * moved[row];
        }
        let residual = (0..sides.len())
            .map(|i| match sides[i] {
                Side::Free => 0.0,
                _ => offset[i] + dot(&self.compliance[i], &traction) - rigid * self.widths[i],
            })
            .collect();
        Solution { traction, residual, rigid }
    }
}

/// Cholesky's factor L of a symmetric matrix, in the lower triangle.
fn factor(mut matrix: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    for row in 0..matrix.len() {
        let (above, below) = matrix.split_at_mut(row);
        let line = &mut below[0];
        for (column, other) in above.iter().enumerate() {
            line[column] -= dot(&line[..column], &other[..column]);
            line[column] /= other[column];
        }
        line[row] = (line[row] - dot(&line[..row], &line[..row])).sqrt();
    }
    matrix
}

/// Solves L·Lᵀ·x = b.
fn substitute(factor: &[Vec<f64>], mut b: Vec<f64>) -> Vec<f64> {
    for i in 0..b.len() {
        b[i] = (b[i] - dot(&factor[i][..i], &b[..i])) / factor[i][i];
    }
    for i in (0..b.len()).rev() {
        b[i] /= factor[i][i];
        let (head, tail) = b.split_at_mut(i);
        head.iter_mut().zip(&factor[i]).for_each(|(b, l)| *b -= l * tail[0]);
    }
    b
}

/// F, μ, E* and R of the tests, in N/mm, N/mm² and mm.
const FORCE: f64 = 18.5;
const FRICTION: f64 = 0.7;
const MODULUS: f64 = 1.1e5;
const RADIUS: f64 = 6.0;

/// Half of the tangential force at which gross slip starts.
const HALF: Held = Held::Force(0.5 * FRICTION * FORCE);

/// A profile whose solution is known.
struct Known {
    contact: Contact,
    /// The half-width a.
    edge: f64,
    /// The load F(s) that the half-width s carries.
    image: Box<dyn Fn(f64) -> f64>,
}

fn known(
    gap: impl Fn(f64) -> f64 + 'static,
    kinks: Vec<f64>,
    edge: f64,
    image: impl Fn(f64) -> f64 + 'static,
) -> Known {
    let contact = Contact {
        gap: Box::new(gap),
        kinks,
        bound: 1.4 * edge,
        force: FORCE,
        friction: FRICTION,
        modulus: MODULUS,
    };
    Known { contact, edge, image: Box::new(image) }
}

fn cylinder() -> Known {
    let edge = (4.0 * FORCE * RADIUS / (PI * MODULUS)).sqrt();
    known(|x| x * x / (2.0 * RADIUS), vec![], edge, move |s| FORCE * (s / edge).powi(2))
}

fn wedge() -> Known {
    let slope: f64 = 0.01;
    let edge = FORCE / (MODULUS * slope);
    known(move |x| slope * x, vec![0.0], edge, move |s| FORCE * s / edge)
}

/// A flat of half-width 0.1 with rounded edges.
fn punch() -> Known {
    let flat = 0.1;
    let image = move |s: f64| {
        let angle = 0.5 * s * s * (flat / s).min(1.0).acos();
        MODULUS / RADIUS * (angle - 0.5 * flat * (s * s - flat * flat).max(0.0).sqrt())
    };
    let edge = root(flat, 10.0 * flat, |a| image(a) - FORCE);
    let gap = move |x: f64| (x - flat).max(0.0).powi(2) / (2.0 * RADIUS);
    known(gap, vec![flat], edge, image)
}

/// A cylinder that wears towards its limiting profile, which sticks to half of its first half-width
/// a₀. `extent` is the share of the limiting wear. The half-width stays a₀ until the limit.
fn worn(extent: f64) -> Known {
    let Known { edge, contact, .. } = cylinder();
    let c = 0.5;
    let wear = move |x: f64| (x / c).acosh() - x * (x * x - c * c).sqrt();
    let end = root(1.0, 2.0, wear);
    let gap = move |x: f64| {
        let x = x / edge;
        let wear = if x > c && x < end { extent * wear(x) } else { 0.0 };
        edge * edge / (2.0 * RADIUS) * (x * x + wear)
    };
    let image = move |s: f64| {
        let unworn = (s / edge).powi(2);
        FORCE * if s > c * edge { (1.0 - extent) * unworn + extent } else { unworn }
    };
    let kinks = vec![c * edge, end * edge];
    Known {
        contact: Contact { gap: Box::new(gap), kinks, ..contact },
        edge,
        image: Box::new(image),
    }
}

impl Known {
    /// The stick half-width c for a tangential force.
    fn stick(&self, share: f64) -> f64 {
        root(0.0, self.edge, |s| (self.image)(s) - (1.0 - share) * FORCE)
    }

    /// W = (8μ²/(πE*)) ∫ y (y_c − y) ds/s over c…a, with y = F − F(s) and y_c = Q/μ.
    fn energy(&self, share: f64) -> f64 {
        let c = self.stick(share);
        let density = |s: f64| {
            let y = FORCE - (self.image)(s);
            y * (share * FORCE - y) / s
        };
        8.0 * FRICTION * FRICTION / (PI * MODULUS) * self.pieces(c, self.edge, density)
    }

    /// U = (2μ/(πE*)) ∫ (y_c − y) L ds/(s √(L²−s²)) over c…L, with s = L sin φ beyond the contact.
    fn stroke(&self, share: f64, reference: f64) -> f64 {
        let c = self.stick(share);
        let density = |s: f64| {
            let excess = (self.image)(s) - (1.0 - share) * FORCE;
            excess / (s * (1.0 - (s / reference).powi(2)).sqrt())
        };
        let beyond = share * FORCE * (reference / self.edge).acosh();
        2.0 * FRICTION / (PI * MODULUS) * (self.pieces(c, self.edge, density) + beyond)
    }

    /// Gauss quadrature, divided at the kinks and refined towards both ends.
    fn pieces(&self, from: f64, to: f64, f: impl Fn(f64) -> f64) -> f64 {
        let mut ends = vec![from];
        ends.extend(self.contact.kinks.iter().filter(|x| **x > from && **x < to));
        ends.push(to);
        let smooth = |ends: &[f64]| {
            let width = ends[1] - ends[0];
            // x runs as a smooth step, so that roots at the ends become smooth.
            integrate(0.0, 1.0, |t| {
                6.0 * t * (1.0 - t) * width * f(ends[0] + width * t * t * (3.0 - 2.0 * t))
            })
        };
        ends.windows(2).map(smooth).sum()
    }
}

impl State {
    /// The mean of |value − expected(x)| over the elements in from…to, divided by that of expected.
    fn apart(&self, value: &[f64], (from, to): (f64, f64), expected: impl Fn(f64) -> f64) -> f64 {
        let (mut difference, mut whole) = (0.0, 0.0);
        for (i, x) in self.centres.iter().enumerate().filter(|(_, x)| **x > from && **x < to) {
            difference += self.widths[i] * (value[i] - expected(*x)).abs();
            whole += self.widths[i] * expected(*x);
        }
        difference / whole
    }
}

/// The profiles of the tests.
fn profiles() -> [(&'static str, Known); 4] {
    [("cylinder", cylinder()), ("wedge", wedge()), ("punch", punch()), ("worn", worn(0.5))]
}

/// Solves a contact on 60, 120 and 240 elements. Each error must be below its tolerance on 240
/// elements, below twice that on 120, and below eight times that on 60.
fn converges<const N: usize>(
    name: &str,
    known: &Known,
    held: Held,
    tolerances: [f64; N],
    errors: impl Fn(&State) -> [f64; N],
) {
    for (count, factor) in [(60, 8.0), (120, 2.0), (240, 1.0)] {
        let found = errors(&known.contact.solve(held, count));
        for (error, tolerance) in found.into_iter().zip(tolerances) {
            let right = error.abs() < factor * tolerance;
            assert!(right, "{name}, {held:?}, {count} elements: {found:?}");
        }
    }
}

#[test]
fn the_pressure_of_elements_agrees_with_closed_forms() {
    let hertz = |x: f64| 2.0 / PI * (1.0 - x * x).sqrt();
    let peaked = |x: f64| (1.0 / x).acosh() / PI;
    let pressures: [&dyn Fn(f64) -> f64; 2] = [&hertz, &peaked];
    for ((name, known), pressure) in profiles().into_iter().zip(pressures) {
        let a = known.edge;
        converges(name, &known, HALF, [5e-4], |state| {
            let expected = |x: f64| FORCE / a * pressure(x / a);
            [state.apart(&state.pressure, (0.0, 0.999 * a), expected)]
        });
    }
    // The limiting profile carries the load inside its stick edge c, with a singularity at c.
    let (known, a) = (worn(1.0), cylinder().edge);
    let c = 0.5 * a;
    converges("limit", &known, HALF, [1e-4, 1e-4], |state| {
        let ring = (0..state.widths.len()).filter(|i| state.centres[*i] > 1.02 * c);
        let load: f64 = ring.map(|i| 2.0 * state.widths[i] * state.pressure[i]).sum();
        let expected = |x: f64| {
            let chord = (c * c - x * x).sqrt();
            FORCE / PI * (2.0 * chord / (a * a) + 0.75 / chord)
        };
        [load / FORCE, state.apart(&state.pressure, (0.0, 0.98 * c), expected)]
    });
}

#[test]
fn the_energy_of_elements_agrees_with_closed_forms() {
    for (name, known) in profiles() {
        for share in [0.25, 0.75, 0.95] {
            let (c, energy) = (known.stick(share), known.energy(share));
            let held = Held::Force(share * FRICTION * FORCE);
            converges(name, &known, held, [5e-4, 5e-4, 5e-4], |state| {
                let edge = state.half_width / known.edge - 1.0;
                [edge, (state.stick_half_width - c) / known.edge, state.energy / energy - 1.0]
            });
        }
    }
    // The quadrature itself, and the path 4 s(x) of the cylinder.
    let (known, share) = (cylinder(), 0.75_f64);
    let closed = share * (2.0 - share) + 2.0 * (1.0 - share) * (1.0 - share).ln();
    let closed = 2.0 * (FRICTION * FORCE).powi(2) / (PI * MODULUS) * closed;
    assert!((known.energy(share) / closed - 1.0).abs() < 1e-9);
    let (a, c) = (known.edge, known.stick(share));
    converges("path", &known, Held::Force(share * FRICTION * FORCE), [1e-4], |state| {
        let path = |x: f64| {
            let slip = x * (x * x - c * c).sqrt() - c * c * (x / c).acosh();
            2.0 * FRICTION / RADIUS * slip
        };
        [state.apart(&state.path, (c, 0.999 * a), path)]
    });
}

#[test]
fn a_stroke_against_surface_points_agrees_with_its_formula() {
    for (name, known) in profiles() {
        for (share, reach) in [(0.75, 1.1), (0.75, 2.0), (0.4, 10.0), (0.75, 1e3)] {
            let (force, reference) = (share * FRICTION * FORCE, reach * known.edge);
            let rig_stiffness = (reach == 10.0).then_some(0.3 * MODULUS);
            let yielding = rig_stiffness.map_or(0.0, |stiffness| force / stiffness);
            let amplitude = known.stroke(share, reference) + yielding;
            let held = Held::Stroke { amplitude, reference, rig_stiffness };
            converges(name, &known, held, [8e-6, 5e-4], |state| {
                let energy = state.energy / known.energy(share) - 1.0;
                [state.tangential_force / force - 1.0, energy]
            });
        }
    }
}

#[test]
fn gross_slip_adds_the_same_path_everywhere() {
    for (name, known) in profiles() {
        let reference = 5.0 * known.edge;
        let onset = known.stroke(1.0, reference);
        for beyond in [0.1 * onset, 5.0 * onset] {
            let held = Held::Stroke { amplitude: onset + beyond, reference, rig_stiffness: None };
            let energy = 4.0 * FRICTION * FORCE * beyond + known.energy(1.0);
            converges(name, &known, held, [1e-12, 5e-5, 5e-5], |state| {
                let gap = &known.contact.gap;
                let path = |x: f64| 4.0 * (beyond + FRICTION * (gap(x) - gap(0.0)));
                let path = state.apart(&state.path, (0.0, 0.999 * known.edge), path);
                let force = state.tangential_force / (FRICTION * FORCE) - 1.0;
                assert_eq!(state.stick_half_width, 0.0);
                [force, state.energy / energy - 1.0, path]
            });
        }
    }
}
