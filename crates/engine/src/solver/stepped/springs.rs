//! The springs of a mesh. Depth, tangential force and slip follow from the images of the springs and
//! from the held quantities.
//!
//! # Equations
//! All quantities are means over cells. D is the width of a cell. Nothing wears inside r₀:
//! ```text
//! y_q = max(0, d − g_q),   F̃/2 = d·r₀ − ∫₀^r₀ g₀ + Σ D y                      (7)–(9)
//! Q̃/2 = Δ·r₀ + Σ D min(y, Δ),   ω_q = max(0, 1 − y_q/Δ)                       (10), (15), (16)
//! ```
//! Newton's method finds d from a constant force, and Δ from a constant tangential force. Both sums
//! are piecewise linear; one is convex, the other concave. The method therefore converges to all
//! digits in a few steps.
//!
//! In a line contact the force is the level d = 1 of the springs, and the stroke is that of all springs in series:
//! ```text
//! y_q = max(0, 1 − F_q/F₀),   Q/(μF₀) = θ,   θ·C + Σ K (θ − y)₊ = U/(μh₀),   ω_q = max(0, 1 − y_q/θ)
//! ```
//! If this is less than the stroke at θ = 1, the middle slips by the rest.
//!
//! # Accuracy
//! A stick edge that moves inwards is resolved within its cell: ω is the mean of max(0, 1 − y/Δ), with y linear
//! across the cell.

use super::{Mesh, PriorWear};
use crate::contact::reference::at_aperture;
use crate::contact::{Block, Contact, Control, Geometry, Held, Normal, Series};

/// Images are computed up to this share beyond the present depth, because the depth can increase at
/// constant force.
const MARGIN: f64 = 0.1;

/// The springs of a mesh and the held quantities.
#[derive(Debug, Clone)]
pub struct Springs {
    /// The mesh.
    pub mesh: Mesh,
    /// The held quantities.
    pub(crate) control: Control,
    /// Half of the normal force of the unworn contact, ∫₀ᵃ y dx.
    half_force: f64,
    /// The present block of the motion.
    pub(super) block: Block,
    /// The reference of a line contact.
    reference: Option<Series>,
    /// What a unit of θ moves: K of each spring and C, if a line contact has a reference.
    stroke: Option<(Vec<f64>, f64)>,
    /// What the springs of a line contact inside r₀ yield if the whole contact slips.
    core_yields: f64,
    /// Whether a core never slips in the whole run, so that the spring in the middle does not wear.
    has_core: bool,
    /// Compression of the spring at r₀ at the depth d₀, before any wear on this mesh.
    edge: f64,
    /// Whether the stick edge moves inwards.
    moves_in: bool,
    /// Indentation depth d in units of d₀.
    pub(crate) depth: f64,
    /// Amplitude Δ of the contact.
    pub(crate) threshold: f64,
    /// The slip of the middle of a line contact, σ₀.
    pub(crate) middle: f64,
    /// The present coefficient of friction, relative to that at cycle 0.
    pub(crate) friction: f64,
    /// Whether the held tangential force is larger than friction can carry.
    pub(crate) slides: bool,
    /// Image g of each of the first cells.
    pub(crate) images: Vec<f64>,
    /// Compression y of each cell in contact.
    pub(crate) compressions: Vec<f64>,
    /// Slip ω of each cell with a known image.
    pub(crate) slips: Vec<f64>,
}

/// A saved state of the springs.
#[derive(Debug, Clone, Default)]
pub struct Aside {
    depth: f64,
    threshold: f64,
    middle: f64,
    friction: f64,
    slides: bool,
    lists: [Vec<f64>; 3],
}

impl Springs {
    /// The springs of a contact on a mesh.
    pub(crate) fn new(mesh: Mesh, contact: &Contact, control: &Control, prior: &PriorWear) -> Self {
        let cells = mesh.widths.len();
        let room = || Vec::with_capacity(cells);
        let start = mesh.radii[0];
        let stroke = contact.reference.map(|series| {
            let springs = mesh.radii.windows(2).map(|ends| series.between(ends[0], ends[1]));
            (springs.collect(), series.outside(mesh.radii[cells]))
        });
        let held = matches!(control.held(), Held::Force(_) | Held::Rig { .. });
        Self {
            control: control.clone(),
            half_force: contact.shape.half_force(),
            block: control.blocks[0].clone(),
            reference: contact.reference,
            stroke,
            has_core: control.least_stick(contact) > 0.0,
            core_yields: contact
                .reference
                .map_or(0.0, |series| series.slipping(&contact.shape, 1.0, start)),
            edge: 1.0 - contact.shape.image(start) - prior.image(start),
            moves_in: held && control.normal == Normal::Depth,
            depth: 1.0,
            threshold: contact.threshold,
            middle: 0.0,
            friction: 1.0,
            slides: false,
            images: room(),
            compressions: room(),
            slips: room(),
            mesh,
        }
    }

    /// A safety factor of the error estimate. If the stick edge moves inwards, both meshes have a
    /// common error, which their difference does not contain. If an aperture is held, a flat core starts to slip in steps.
    pub(crate) fn error_safety_factor(&self) -> f64 {
        match self.block.held {
            Held::Aperture(_) if self.margin() > 0.0 => 3.0,
            _ if self.moves_in => 1.5,
            _ => 1.0,
        }
    }

    /// Slip ω of a spring without contact.
    pub(crate) fn free_slip(&self) -> f64 {
        match &self.block.held {
            Held::Record(record) => record.slip(0.0),
            _ => 1.0,
        }
    }

    /// Copies depth, Δ and motion from other springs.
    pub(crate) fn resume(&mut self, other: &Self) {
        self.depth = other.depth;
        self.threshold = other.threshold;
        self.block.clone_from(&other.block);
    }

    /// Saves the state.
    pub(crate) fn set_aside(&mut self, aside: &mut Aside) {
        (aside.depth, aside.threshold, aside.slides) = (self.depth, self.threshold, self.slides);
        (aside.middle, aside.friction) = (self.middle, self.friction);
        self.exchange(aside);
    }

    /// Restores the saved state.
    pub(crate) fn put_back(&mut self, aside: &mut Aside) {
        (self.depth, self.threshold, self.slides) = (aside.depth, aside.threshold, aside.slides);
        (self.middle, self.friction) = (aside.middle, aside.friction);
        self.exchange(aside);
    }

    fn exchange(&mut self, aside: &mut Aside) {
        let here = [&mut self.images, &mut self.compressions, &mut self.slips];
        here.into_iter()
            .zip(&mut aside.lists)
            .for_each(|(here, there)| std::mem::swap(here, there));
    }

    /// Computes the state for the given wear at the nodes.
    pub(crate) fn press_wear(&mut self, wear: &[f64]) {
        let worn = wear.iter().rposition(|w| *w > 0.0).unwrap_or(0);
        self.images.clear();
        let cells = self.mesh.widths.len();
        let mut known = self.depth * (1.0 + MARGIN);
        if self.control.normal == Normal::Depth {
            known = 1.0;
        }
        loop {
            while self.images.len() < cells {
                self.mesh.push_images(wear, &mut self.images);
                // Outside the worn region the images increase, so no later cell can be in contact.
                let outside = self.images.len() - 1 > worn;
                if outside && self.images.last().is_some_and(|image| *image >= known) {
                    break;
                }
            }
            self.press();
            if self.depth <= known || self.images.len() == cells {
                break;
            }
            known = self.depth * (1.0 + MARGIN);
        }
    }

    /// Computes the state for the given wear of the image in each cell.
    pub(crate) fn press_images(&mut self, worn: &[f64]) {
        self.images.clear();
        self.images.extend(self.mesh.initial.iter().zip(worn).map(|(g, h)| g + h));
        self.press();
    }

    fn press(&mut self) {
        if self.control.normal == Normal::Force {
            self.depth = self.depth_under_force();
        }
        self.compressions.clear();
        self.compressions.extend(self.images.iter().map(|g| (self.depth - g).max(0.0)));
        while self.compressions.last().is_some_and(|last| *last <= 0.0) {
            self.compressions.pop();
        }
        self.slides = false;
        // Amplitudes and forces are in units of μ.
        let amplitude = self.block.amplitude() / self.friction;
        self.threshold = match self.block.held {
            Held::Force(half) => {
                self.threshold_under(0.0, half / self.friction).unwrap_or_else(|| {
                    self.slides = true;
                    self.compressions.iter().copied().fold(0.0, f64::max)
                })
            }
            Held::Rig { compliance, .. } if compliance > 0.0 => {
                let per_force = 0.5 / compliance;
                self.threshold_under(per_force, amplitude * per_force).unwrap_or(amplitude)
            }
            Held::Stroke(_) => self.threshold_at_stroke(amplitude),
            Held::Sliding(_) => {
                self.middle = amplitude;
                1.0
            }
            Held::Aperture(_) => self.threshold_at_aperture(amplitude),
            Held::Threshold if self.mesh.geometry == Geometry::Line && amplitude >= 1.0 => {
                self.slides = true;
                1.0
            }
            _ => amplitude,
        };
        self.slip();
    }

    /// The stroke of a line contact at θ without a slip of the middle, and its change per change of θ. NaN without a
    /// reference.
    fn moved(&self, threshold: f64) -> (f64, f64) {
        let Some((springs, outside)) = &self.stroke else { return (f64::NAN, f64::NAN) };
        let (mut sum, mut slope) = (outside * threshold, *outside);
        for (q, yields) in springs.iter().enumerate() {
            let y = self.compressions.get(q).copied().unwrap_or(0.0);
            if y < threshold {
                sum += yields * (threshold - y);
                slope += yields;
            }
        }
        (sum, slope)
    }

    /// The stroke of a line contact in μh₀. NaN without a reference.
    pub(crate) fn stroke(&self) -> f64 {
        let held = self.block.stroke().map(|stroke| stroke / self.friction);
        held.unwrap_or_else(|| self.moved(self.threshold).0 + self.middle)
    }

    /// The approach of a line contact in h₀: what all springs in series yield under the load. NaN if the distance of the
    /// reference is not known.
    pub(crate) fn approach(&self) -> f64 {
        match self.reference {
            Some(reference) if reference.reach.is_finite() => {
                self.moved(self.depth).0 - reference.rig() * self.depth
            }
            _ => f64::NAN,
        }
    }

    /// K of each spring in contact, and C with the springs outside the contact and without the rig, of a line contact.
    /// Without a reference, K is ln of the ratio of the ends, and C is `None`.
    pub(crate) fn in_series(
        &self,
        compressions: &[f64],
    ) -> (impl Iterator<Item = f64>, Option<f64>) {
        let live = compressions.len();
        let (springs, outside) = match &self.stroke {
            Some((springs, outside)) => {
                let rig = self.reference.map_or(0.0, |reference| reference.rig());
                (springs, Some(outside - rig + springs[live..].iter().sum::<f64>()))
            }
            None => (&self.mesh.weights, None),
        };
        (springs[..live].iter().copied(), outside)
    }

    /// θ at the stroke of a line contact. If θ = 1 is not enough for the stroke, the middle slips by the rest.
    fn threshold_at_stroke(&mut self, stroke: f64) -> f64 {
        if stroke <= 0.0 {
            self.middle = 0.0;
            return 0.0;
        }
        let rest = stroke - self.moved(1.0).0;
        if rest >= 0.0 {
            self.middle = rest;
            return 1.0;
        }
        self.middle = 0.0;
        // The sum is convex, so Newton's method approaches the root from the right.
        let mut threshold = 1.0;
        for _ in 0..100 {
            let (sum, slope) = self.moved(threshold);
            if slope <= 0.0 {
                // Nothing yields at a smaller θ.
                return threshold.max(0.0);
            }
            let next = threshold + (stroke - sum) / slope;
            if (next - threshold).abs() <= 2.0 * f64::EPSILON * next {
                return next;
            }
            threshold = next;
        }
        threshold
    }

    /// Δ or θ at the aperture of a loop. If the whole contact slips, the middle slips by the rest.
    fn threshold_at_aperture(&mut self, aperture: f64) -> f64 {
        if self.mesh.geometry == Geometry::Line {
            let weights = self.stroke.as_ref().map_or(&self.mesh.weights, |(springs, _)| springs);
            let slipping = |force: f64| {
                let springs = self.compressions.iter().zip(weights);
                springs.map(|(y, weight)| weight * (force - y).max(0.0)).sum()
            };
            let (force, middle) = at_aperture(aperture, 1.0, slipping);
            self.middle = middle;
            return force;
        }
        let most = self.normal();
        let backbone = |half: f64| {
            let below = (half < most).then(|| self.threshold_under(0.0, half));
            below.flatten().unwrap_or_else(|| self.most())
        };
        let (half, slip) = at_aperture(aperture, most, backbone);
        backbone(half) + slip
    }

    /// The depth d at which r₀·d + Σ D (d − g)₊ gives the constant force.
    fn depth_under_force(&self) -> f64 {
        let (start, widths) = (self.mesh.radii[0], &self.mesh.widths);
        let inside = start - self.mesh.core;
        let mut depth = self.depth;
        for _ in 0..100 {
            let (mut load, mut stiffness) = (start * depth - inside, start);
            for (g, width) in self.images.iter().zip(widths) {
                if *g < depth {
                    load += width * (depth - g);
                    stiffness += width;
                }
            }
            if stiffness == 0.0 {
                depth = self.images.iter().copied().fold(f64::INFINITY, f64::min) + self.half_force;
                continue;
            }
            let next = depth + (self.half_force - load) / stiffness;
            if (next - depth).abs() <= 2.0 * f64::EPSILON * next.abs() {
                return next;
            }
            depth = next;
        }
        depth
    }

    /// The amplitude Δ with a·Δ + r₀·Δ + Σ D min(y, Δ) = `target`.
    fn threshold_under(&self, a: f64, target: f64) -> Option<f64> {
        let (start, widths) = (self.mesh.radii[0], &self.mesh.widths);
        let most = self.compressions.iter().copied().fold(0.0, f64::max);
        // Newton's method approaches the root of a concave sum from the left.
        let mut threshold = if a + start > 0.0 { self.threshold } else { 0.0 };
        for _ in 0..100 {
            let (mut sum, mut slope) = ((a + start) * threshold, a + start);
            for (q, width) in widths[..self.compressions.len()].iter().enumerate() {
                let (carried, stuck) = self.carried(q, threshold);
                sum += width * carried;
                slope += width * stuck;
            }
            if slope == 0.0 {
                return (sum >= target).then_some(most);
            }
            let next = (threshold + (target - sum) / slope).max(0.0);
            if a + start == 0.0 && next >= most && threshold < most {
                // The step has passed the last corner of the sum. Continue from there.
                threshold = most;
                continue;
            }
            if (next - threshold).abs() <= 2.0 * f64::EPSILON * next {
                return Some(next);
            }
            threshold = next;
        }
        Some(threshold)
    }

    /// Computes the slip ω of every cell.
    fn slip(&mut self) {
        self.slips.clear();
        let loaded = self.compressions.len();
        if self.threshold == 0.0 {
            // The contact is at rest.
            self.slips.resize(self.images.len(), 0.0);
            return;
        }
        let per_threshold = 1.0 / self.threshold;
        if let Held::Record(record) = &self.block.held {
            self.slips.extend(self.compressions.iter().map(|y| record.slip(y * per_threshold)));
            self.slips.resize(self.images.len(), record.slip(0.0));
            return;
        }
        if !self.moves_in {
            let carried = self.compressions.iter().map(|y| y.min(self.threshold));
            self.slips.extend(carried.map(|carried| (1.0 - carried * per_threshold).max(0.0)));
        }
        for q in self.slips.len()..loaded {
            let (carried, _) = self.carried(q, self.threshold);
            self.slips.push((1.0 - carried * per_threshold).max(0.0));
        }
        self.slips.resize(self.images.len(), 1.0);
    }

    /// The tangential load min(Δ, y) of each cell in contact.
    pub(crate) fn loads(&self) -> Vec<f64> {
        (0..self.compressions.len()).map(|q| self.carried(q, self.threshold).0).collect()
    }

    /// The mean of min(Δ, y) over a cell, and the share of the cell that sticks.
    fn carried(&self, q: usize, threshold: f64) -> (f64, f64) {
        let here = self.compressions[q];
        let (least, half_rise) = if self.moves_in { self.across(q) } else { (here, 0.0) };
        if least >= threshold {
            (threshold, 1.0)
        } else if least + 2.0 * half_rise <= threshold {
            (here, 0.0)
        } else {
            let below = threshold - least;
            (threshold - below * below / (4.0 * half_rise), 1.0 - below / (2.0 * half_rise))
        }
    }

    /// The smallest y of a cell, and half of the difference between its largest and smallest y. y is assumed to be
    /// linear across the cell, with the smaller of the slopes to the two neighbouring cells.
    fn across(&self, q: usize) -> (f64, f64) {
        let (widths, y) = (&self.mesh.widths, &self.compressions);
        let here = y[q];
        let before = match q {
            0 if !self.mesh.is_whole => (self.edge() - here) / (0.5 * widths[0]),
            0 => f64::INFINITY,
            _ => (y[q - 1] - here) / (0.5 * (widths[q - 1] + widths[q])),
        };
        let after = match y.get(q + 1) {
            Some(next) => (here - next) / (0.5 * (widths[q] + widths[q + 1])),
            None => 0.0,
        };
        let half_rise = 0.5 * widths[q] * before.min(after).max(0.0);
        (here - half_rise, half_rise)
    }

    /// Half of the normal force, ∫₀ᵃ y dx.
    pub(crate) fn normal(&self) -> f64 {
        if self.mesh.geometry == Geometry::Line {
            return 0.5 * self.depth;
        }
        let core = self.mesh.core + self.mesh.radii[0] * (self.depth - 1.0);
        core + self.compressions.iter().zip(&self.mesh.widths).map(|(y, d)| y * d).sum::<f64>()
    }

    /// Half of the amplitude of the tangential force, ∫₀ᵃ min(Δ, y) dx.
    pub(crate) fn tangential(&self) -> f64 {
        if self.mesh.geometry == Geometry::Line {
            return 0.5 * self.threshold;
        }
        let widths = self.mesh.widths[..self.compressions.len()].iter().enumerate();
        let sum: f64 = widths.map(|(q, d)| d * self.carried(q, self.threshold).0).sum();
        self.threshold * self.mesh.radii[0] + sum
    }

    /// The energy integral ∫₀ᵃ y ω dx, which is proportional to the energy per cycle. In a line contact it is that over
    /// dx/x, with what the slip of the middle adds.
    pub(crate) fn loss(&self) -> f64 {
        let springs = self.compressions.iter().zip(&self.slips).zip(&self.mesh.weights);
        let loss: f64 = springs.map(|((y, slip), d)| d * y * slip).sum();
        if self.middle > 0.0 { loss + self.depth * self.middle / self.threshold } else { loss }
    }

    /// The distance from gross slip. It is 0 when gross slip starts.
    pub(crate) fn margin(&self) -> f64 {
        match self.block.held {
            _ if self.slides => -1.0,
            _ if !self.mesh.is_whole => 1.0,
            _ if self.middle > 0.0 => -self.middle,
            Held::Force(half) => self.normal() - half,
            _ => self.most() - self.threshold,
        }
    }

    /// The amplitudes of the contact and of the actuator at which the whole contact slips: Δ, or the stroke of a line
    /// contact. NaN without a reference.
    pub(crate) fn gross_slip(&self) -> [f64; 2] {
        if self.mesh.geometry == Geometry::Line {
            let stroke = self.moved(1.0).0 + self.core_yields;
            return [stroke - self.reference.map_or(0.0, |reference| reference.rig()), stroke];
        }
        let most = self.most();
        match self.block.held {
            Held::Rig { compliance, .. } => [most, most + 2.0 * compliance * self.normal()],
            _ => [most; 2],
        }
    }

    /// The largest compression, that of the spring in the middle. The cells have means, so it is extrapolated from them.
    fn most(&self) -> f64 {
        if self.mesh.geometry == Geometry::Line || self.has_core || !self.mesh.is_whole {
            return self.depth;
        }
        let most = self.compressions.iter().copied().fold(0.0, f64::max);
        let [y0, y1, ..] = self.compressions[..] else { return most };
        let [d0, d1, ..] = self.mesh.widths[..] else { return most };
        most.max(y0 + (y0 - y1) * d0 / (d0 + d1))
    }

    /// The normal force as a share of its initial value, F/F₀.
    pub(crate) fn share(&self) -> f64 {
        self.normal() / self.half_force
    }

    /// The stick radius c, interpolated between the centres of two cells. It is 0 in gross slip.
    pub(crate) fn stick(&self) -> f64 {
        let radii = &self.mesh.radii;
        if self.middle > 0.0 {
            return 0.0;
        }
        let middle = |q: usize| 0.5 * (radii[q] + radii[q + 1]);
        let y = &self.compressions;
        let sticks = |y: f64| y >= self.threshold * (1.0 - 1e-12);
        let Some(last) = y.iter().rposition(|y| sticks(*y)) else {
            let first = y.first().copied().unwrap_or(0.0);
            if self.mesh.is_whole {
                let most = self.most();
                let rest = (most - self.threshold) / (most - first);
                return if most > self.threshold { rest.min(1.0) * middle(0) } else { 0.0 };
            }
            let edge = self.edge();
            if edge <= self.threshold || edge <= first {
                return radii[0];
            }
            let share = (edge - self.threshold) / (edge - first);
            return radii[0] + share * (middle(0) - radii[0]);
        };
        let Some(next) = y.get(last + 1) else {
            return radii[last + 1];
        };
        // The springs outside can lose contact abruptly, so the springs inside determine the radius
        // with y = Δ.
        let inner =
            if last > 0 { (middle(last - 1), y[last - 1]) } else { (radii[0], self.edge()) };
        let slope = (inner.1 - y[last]) / (middle(last) - inner.0);
        let from_inside = middle(last) + (y[last] - self.threshold) / slope.max(1e-300);
        // Under a blunt tip, y and Δ differ by rounding only.
        let share = ((y[last] - self.threshold) / (y[last] - next)).max(0.0);
        let between = middle(last) + share * (middle(last + 1) - middle(last));
        from_inside.clamp(between, middle(last + 1).max(between))
    }

    /// The compression y at r₀, inside which nothing wears.
    fn edge(&self) -> f64 {
        self.edge + self.depth - 1.0
    }
}
