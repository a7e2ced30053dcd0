//! Curves of a worn contact at the output radii: wear, image, pressure and slip.
//!
//! Between the mesh nodes, the curves are monotone cubics in t = r². Inside the sticking core and
//! outside the mesh, they are integrals over the springs.
//!
//! # Equations
//! ```text
//! p(r) = (1/π) ∫ g′/√(x²−r²) dx over r…a
//! s(r) = (2/π) ∫ ω/√(r²−x²) dx over 0…r,  1 − (2/π) ∫ (1 − ω)/√(r²−x²) dx outside the contact
//! ```
//!
//! # Accuracy
//! The accuracy is that of the mesh. If the springs just outside the stick edge carry much less
//! load than those inside, the reported pressure at the edge is infinite.

use std::f64::consts::{FRAC_1_PI, FRAC_2_PI};
use std::iter;

use super::mesh::Mesh;
use super::prior::PriorWear;
use super::wearing::WornContact;
use crate::contact::geometry::Geometry;
use crate::contact::profile::Shape;
use crate::numeric::{Monotone, abel};
use crate::solver::curves::Curves;

/// The reported pressure at the stick edge is infinite if the compression of the first cell is
/// below this share of the compression at the edge.
const STEP: f64 = 0.5;

impl Curves {
    /// The curves of a worn shape at the given radii, in ascending order. `prior` is the wear before the
    /// first wear on the mesh.
    #[must_use]
    pub fn of(
        shape: &Shape,
        (mesh, prior): (&Mesh, &PriorWear),
        worn: &WornContact,
        radii: &[f64],
    ) -> Self {
        let (inner, outer) = (mesh.radii[0], mesh.radii[mesh.radii.len() - 1]);
        let Mesh { geometry, places, .. } = mesh;
        let place = |r: f64| geometry.place(r);
        let (start, end) = (places[0], places[places.len() - 1]);
        let WornContact { wear, images, compressions, depth, scar, .. } = worn;
        let contact_radius = worn.contact_radius;
        let middles: Vec<f64> =
            mesh.radii.windows(2).map(|ends| 0.5 * (ends[0] + ends[1])).collect();
        // In gross slip, the spring on the axis has the same compression as the first cell.
        let edge = if mesh.is_whole {
            depth - images[0]
        } else {
            depth - shape.image(inner) - prior.image(inner)
        };
        let live = compressions.len();
        let rim = place(contact_radius);
        // The loaded springs outside the stick radius as a curve y(t), linear between the middles of cells.
        let square = contact_radius * contact_radius;
        let loaded = middles.iter().take(live).map(|x| x * x);
        let loaded: Vec<f64> = loaded.take_while(|t| *t < square).collect();
        let loads = [&[edge], &compressions[..loaded.len()], &[0.0]].concat();
        let knots = [&[inner * inner], &loaded[..], &[square]].concat();
        // (1/π) ∫ −y′/√(x²−r²) dx for radii r up to the first knot.
        let pressure_of_springs = |r: f64| -FRAC_1_PI * abel(&knots, &loads, r * r);

        let mut pressure = vec![0.0; places.len()];
        mesh.pressure(compressions, &mut pressure);
        if mesh.starts_on_axis() {
            pressure[0] = pressure[1];
        } else if !mesh.is_whole {
            pressure[0] = pressure_of_springs(inner);
        }
        // A large drop of y within the first cell makes the pressure at the stick edge infinite.
        let step = !mesh.is_whole && compressions.first().is_some_and(|y| *y < STEP * edge);
        let inside = places.iter().take(live + 1).take_while(|t| **t < rim).count().max(1);
        let pressure = Monotone::through(
            [&places[..inside], &[rim]].concat(),
            [&pressure[..inside], &[0.0]].concat(),
        );
        let slip = Monotone::through(places.clone(), mesh.solve(&worn.slips));
        let total = PriorWear::of(*geometry, worn.places.clone(), wear.clone(), *scar);
        let profile = Monotone::through(worn.places.clone(), wear.clone());
        let middle_places = middles.iter().map(|x| place(*x));
        let knots = iter::once(start).chain(middle_places).chain([end]).collect();
        let at_end = shape.image(outer) + total.image(outer);
        let values = [&[depth - edge], &images[..], &[at_end]].concat();
        let image = Monotone::through(knots, values);

        let (mut pressure, mut slip) = (pressure.along(), slip.along());
        let (mut profile, mut image) = (profile.along(), image.along());
        Self {
            wear: curve(radii, |r| if r > *scar { 0.0 } else { profile(place(r)).max(0.0) }),
            image: curve(radii, |x| {
                if x < inner {
                    shape.image(x) + prior.image(x)
                } else if place(x) < end {
                    let value = image(place(x));
                    // The mesh spreads the kink at the contact radius over one cell. Inside the
                    // contact g is at most d.
                    if x < contact_radius { value.min(*depth) } else { value.max(*depth) }
                } else {
                    shape.image(x) + total.image(x)
                }
            }),
            pressure: curve(radii, |r| {
                if r < inner && !mesh.is_whole {
                    let pressure = shape.pressure_inside(r, inner)
                        + prior.pressure(r, inner)
                        + pressure_of_springs(r);
                    // Where an earlier block has worn a step, the terms differ by the error of the mesh.
                    pressure.max(0.0)
                } else if step && place(r) <= start {
                    f64::INFINITY
                } else if r < contact_radius {
                    pressure(place(r)).max(0.0)
                } else {
                    0.0
                }
            }),
            slip: curve(radii, |r| {
                if r <= inner && !mesh.is_whole {
                    0.0
                } else if place(r) < end {
                    (slip(place(r)) + worn.middle / worn.threshold).max(0.0)
                } else {
                    slip_beyond(mesh, worn, &middles, r)
                }
            }),
        }
    }
}

/// The slip at a radius outside the mesh.
fn slip_beyond(mesh: &Mesh, worn: &WornContact, middles: &[f64], r: f64) -> f64 {
    let WornContact { slips, middle, threshold, loads, .. } = worn;
    if mesh.geometry == Geometry::Line {
        return (middle + mesh.slip_at(r, *threshold, loads)) / threshold;
    }
    let free = slips.last().copied().unwrap_or(1.0);
    free * (1.0 - FRAC_2_PI * libm::asin(mesh.radii[0] / r))
        - displacement(middles, &mesh.widths, slips, r, free)
}

/// The values at the given radii.
fn curve(radii: &[f64], value: impl FnMut(f64) -> f64) -> Vec<f64> {
    radii.iter().copied().map(value).collect()
}

/// (2/π) ∫ (ω_free − ω)/√(r²−x²) dx over the cells.
fn displacement(middles: &[f64], widths: &[f64], slips: &[f64], r: f64, free: f64) -> f64 {
    let cells = slips.iter().zip(middles).zip(widths);
    FRAC_2_PI
        * cells
            .map(|((slip, x), width)| (free - slip) * width / ((r - x) * (r + x)).max(1e-12).sqrt())
            .sum::<f64>()
}
