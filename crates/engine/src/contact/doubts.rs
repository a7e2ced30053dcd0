//! How much the wear hangs on what a measured table does not tell: the profile between its rows, and the noise.
//!
//! # Equations
//! The energy of a cycle is ∝ ∫ y (Δ − y)₊ dx, and the wear volume grows with it. It is computed with the image of the shape
//! and with that of straight lines between the same points, at the same held quantities.

use super::control::{Control, Normal, Tangential};
use super::geometry::Geometry;
use super::unworn::Contact;
use crate::numeric::root;

/// Number of midpoints inside the ring that slips with half of its width on either side, and in the core.
const IN_RING: usize = 32;
const IN_CORE: usize = 16;
/// The noise is taken this many times, so that a contact close to gross slip counts.
const SEVERAL: f64 = 3.0;
/// With more rows than this in the ring, the interpolants agree.
const MANY_ROWS: usize = 8;

/// What the wear of a measured table is uncertain by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Doubts {
    /// The relative difference of the energies of a cycle: straight lines against the shape.
    pub(crate) interpolation: f64,
    /// The noise in the heights that remains after smoothing, in d₀.
    pub(crate) noise: f64,
    /// The relative change of the width of the ring that slips, if the image changes by the noise that remains after
    /// smoothing.
    pub(crate) widening: f64,
    /// The radii in a₀ between which the interpolants differ: the rows around the ring that slips.
    pub(crate) between: [f64; 2],
}

impl Doubts {
    /// `None` if the profile is not a table.
    pub(crate) fn of(contact: &Contact, control: &Control) -> Option<Self> {
        let Contact { shape, stick, threshold, .. } = contact;
        let table = shape.as_table()?;
        let (rows, between, noise) = table.points_about(*stick, 1.0);
        // A change of the image by the noise moves the stick edge.
        let edge = |level: f64| if level > 0.0 { shape.image_inverse(level) } else { 0.0 };
        let [inside, outside] =
            [-SEVERAL, SEVERAL].map(|times| edge(1.0 - threshold + times * noise));
        let widening = (outside - inside) / (2.0 * SEVERAL * (1.0 - stick));
        if rows > MANY_ROWS {
            return Some(Self { interpolation: 0.0, widening, noise, between });
        }
        let half_ring = 0.5 * (1.0 - stick);
        let (low, high) = ((stick - half_ring).max(0.0), (1.0 + half_ring).min(shape.extent()));
        let inner = midpoints(0.0, low, IN_CORE);
        let springs: Vec<(f64, f64)> = inner
            .chain(midpoints(low, high, IN_RING))
            .filter(|(_, width)| *width > 0.0)
            .map(|(x, width)| (x, shape.geometry().weight(x, width)))
            .collect();
        let image = |of: &dyn Fn(f64) -> f64| springs.iter().map(|(x, _)| of(*x)).collect();
        let smooth: Vec<f64> = image(&|x| shape.image(x));
        let straight: Vec<f64> = image(&|x| table.straight_image(x));
        let sum = |images: &[f64], of: &dyn Fn(f64) -> f64| -> f64 {
            springs.iter().zip(images).map(|((_, weight), g)| weight * of(*g)).sum()
        };
        let force = |images: &[f64], depth: f64| sum(images, &|g| (depth - g).max(0.0));
        let dragged = |images: &[f64], depth: f64, most: f64| {
            sum(images, &|g| (depth - g).max(0.0).min(most))
        };
        let energy = |images: &[f64], depth: f64, most: f64| {
            sum(images, &|g| {
                let y = (depth - g).max(0.0);
                y * (most - y).max(0.0)
            })
        };
        let is_round = shape.geometry() == Geometry::Round;
        let depth = if is_round && control.normal == Normal::Force {
            let held = force(&smooth, 1.0);
            root(0.0, 4.0, |depth| force(&straight, depth) - held)
        } else {
            1.0
        };
        let held = dragged(&smooth, 1.0, *threshold);
        let most = match control.tangential {
            Tangential::Force(_) if is_round && dragged(&straight, depth, depth) > held => {
                root(0.0, depth, |most| dragged(&straight, depth, most) - held)
            }
            _ => *threshold,
        };
        let (known, other) = (energy(&smooth, 1.0, *threshold), energy(&straight, depth, most));
        Some(Self { interpolation: other / known - 1.0, widening, noise, between })
    }
}

/// The middles and the widths of equal parts.
fn midpoints(from: f64, to: f64, count: usize) -> impl Iterator<Item = (f64, f64)> {
    let width = (to - from) / count as f64;
    (0..count).map(move |i| (from + width * (i as f64 + 0.5), width))
}
