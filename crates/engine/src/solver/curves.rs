//! The output radii, and curves over them.

use crate::contact::limit::{chord_and_angle, limiting_wear, step};
use crate::contact::transform::graded;
use crate::contact::{Contact, Geometry};
use crate::solver::pressures::Rings;

/// The largest output radius, in limiting radii ã.
const REACH: f64 = 1.2;
/// A ring is thin if the radius of its inner edge is more than this share of that of the scar.
const THIN: f64 = 0.94;
/// The output radii of a thin ring exceed the limiting radius by this share of its width.
const BEYOND: f64 = 0.01;

/// The last output radius of the ring between c and ã. Numerical errors let a scar end a little beyond ã. The next radius outside
/// is many widths of a thin ring away, so a trapezoid over the profile would be up to 22 % too large.
pub(crate) fn rim(c: f64, scar: f64) -> f64 {
    if c > THIN * scar { scar + BEYOND * (scar - c) } else { scar }
}

/// Curves over the output radii, with one value per radius.
#[derive(Debug, Clone, PartialEq)]
pub struct Curves {
    /// Wear w ≥ 0.
    pub wear: Vec<f64>,
    /// Image g.
    pub image: Vec<f64>,
    /// Mean pressure p between the middles to the neighbouring radii.
    pub pressure: Vec<f64>,
    /// Slip s. The local slip path per cycle is 4U·s.
    pub slip: Vec<f64>,
}

/// The output radii: some in the sticking core, then the ring up to the edge of the scar, then some
/// outside. They are dense next to the stick edge.
#[derive(Debug, Clone)]
pub struct Grid {
    /// The radii, ascending from 0.
    pub radii: Vec<f64>,
    /// The number of radii inside the stick edge.
    pub core: usize,
    /// The number of intervals between the stick edge and the edge of the scar.
    pub cells: usize,
}

/// The radii from c to ã at which (r² − c²)/(ã² − c²) = (i/n)³.
pub(crate) fn ring(c: f64, scar: f64, cells: usize) -> Vec<f64> {
    let theta = (scar - c) * (scar + c);
    let mut radii: Vec<f64> = graded(cells).map(|tau| (c * c + theta * tau).sqrt()).collect();
    // The two ends are known exactly, so this removes their rounding errors.
    (radii[0], radii[cells]) = (c, scar);
    radii
}

impl Grid {
    /// Selects `points` radii for a scar between c and ã. None of them exceeds `last`.
    pub(crate) fn new(c: f64, scar: f64, points: usize, last: f64) -> Self {
        // The core has a fifth of the radii, and more if it is large. Simpson's rule needs an even number of cells.
        let share = if c == 0.0 { 0.0 } else { 0.2 + 0.2 * c / scar };
        let core = (points as f64 * share).ceil() as usize;
        let cells = (points - core - 1 - (points / 128).max(1)) & !1;
        let nodes = cells + 1;
        let outer = points - core - nodes;

        let mut radii = Vec::with_capacity(points);
        // Denser towards the stick edge, where the pressure has its peak.
        radii.extend((0..core).map(|k| {
            let rest = 1.0 - k as f64 / core as f64;
            c * (1.0 - rest * rest)
        }));
        radii.extend(ring(c, scar, cells));
        // The last radius is not used, because the image of a sphere is infinite at its equator.
        let last = scar + (1.0 - 1e-9) * (last - scar);
        let step = ((REACH - 1.0) * scar).min(last - scar) / outer as f64;
        radii.extend((1..=outer).map(|k| (scar + step * k as f64).min(last)));
        Self { radii, core, cells }
    }
}

impl Curves {
    /// The curves of an unworn contact at the given radii, in closed form. `middle` is the slip of the middle of a line
    /// contact.
    pub(crate) fn unworn(contact: &Contact, middle: f64, radii: &[f64]) -> Self {
        let Contact { shape, stick: c, threshold, .. } = contact;
        let (c, threshold) = (*c, *threshold);
        let slip = |r: f64| {
            if r <= c && c > 0.0 {
                return 0.0;
            }
            let geometry = shape.geometry();
            if r == 0.0 {
                return if geometry == Geometry::Line { middle } else { 1.0 - 1.0 / threshold };
            }
            // Springs outside a₀ are free, so they slip over the whole motion. The springs inside
            // slip by ω.
            let ends = chord_and_angle(c, r);
            let rule = if geometry == Geometry::Line && c == 0.0 {
                shape.profile(r) + middle
            } else {
                step(geometry, threshold, c, ends) - limiting_wear(shape, c, 1.0, r, ends)
            };
            let beyond = if r > 1.0 {
                limiting_wear(shape, 1.0, 1.0, r, chord_and_angle(1.0, r))
            } else {
                0.0
            };
            ((rule + beyond) / threshold).max(0.0)
        };
        let rings = Rings::around(shape.geometry(), radii);
        let loads = rings.loads(1.0, shape.kinks(), |r| shape.pressure_inside(r, 1.0));
        let mut pressure = rings.means(&loads);
        pressure.resize(radii.len(), 0.0);
        Self {
            wear: vec![0.0; radii.len()],
            image: radii.iter().map(|x| shape.image(*x)).collect(),
            pressure,
            slip: radii.iter().map(|r| slip(*r)).collect(),
        }
    }
}
