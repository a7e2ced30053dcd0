//! Curves of a worn contact at the output radii: wear, image, pressure and slip.
//!
//! Between the mesh nodes, the curves are monotone cubics in t = r². Inside the sticking core and
//! outside the mesh, they are integrals over the springs.
//!
//! # Equations
//! ```text
//! s(r) = (2/π) ∫ ω/√(r²−x²) dx over 0…r,  1 − (2/π) ∫ (1 − ω)/√(r²−x²) dx outside the contact
//! ```
//!
//! # Accuracy
//! The accuracy is that of the mesh. The [pressures](crate::solver::pressures) integrate to the load of the springs.

use std::f64::consts::FRAC_2_PI;
use std::iter;

use super::{Mesh, PriorWear, WornContact};
use crate::contact::{Geometry, Shape};
use crate::numeric::Monotone;
use crate::solver::curves::Curves;
use crate::solver::pressures::{Rings, kernel};

impl Curves {
    /// The curves of a worn shape at the given radii, in ascending order. `prior` is the wear before the
    /// first wear on the mesh.
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
        let WornContact { wear, images, depth, scar, .. } = worn;
        let contact_radius = worn.contact_radius;
        let middles: Vec<f64> =
            mesh.radii.windows(2).map(|ends| 0.5 * (ends[0] + ends[1])).collect();
        // In gross slip, the spring on the axis has the same compression as the first cell.
        let edge = if mesh.is_whole {
            depth - images[0]
        } else {
            depth - shape.image(inner) - prior.image(inner)
        };
        let slip = Monotone::through(places.clone(), mesh.solve(&worn.slips));
        let total = PriorWear::of(*geometry, worn.places.clone(), wear.clone(), *scar);
        let profile = Monotone::through(worn.places.clone(), wear.clone());
        let middle_places = middles.iter().map(|x| place(*x));
        let knots = iter::once(start).chain(middle_places).chain([end]).collect();
        let at_end = shape.image(outer) + total.image(outer);
        let values = [&[depth - edge], &images[..], &[at_end]].concat();
        let image = Monotone::through(knots, values);

        let (mut slip, mut profile, mut image) = (slip.along(), profile.along(), image.along());
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
            pressure: pressures(shape, (mesh, prior), worn, edge, radii),
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

/// The mean pressures around the radii. `edge` is the compression of the spring at the first node.
fn pressures(
    shape: &Shape,
    (mesh, prior): (&Mesh, &PriorWear),
    worn: &WornContact,
    edge: f64,
    radii: &[f64],
) -> Vec<f64> {
    let (geometry, inner) = (mesh.geometry, mesh.radii[0]);
    let rings = Rings::around(geometry, radii);
    // What the springs of the mesh carry outside r, for r up to the first node.
    let springs = |r: f64| {
        let (mut low, mut load) = (kernel(geometry, r, inner), 0.0);
        for (y, x) in worn.compressions.iter().zip(&mesh.radii[1..]) {
            let high = kernel(geometry, r, *x);
            load += y * (high - low);
            low = high;
        }
        load
    };
    let (total, on_mesh) = on_mesh(mesh, worn, springs(inner));
    let outside = |r: &f64| {
        if *r < inner && !mesh.is_whole {
            edge * kernel(geometry, *r, inner) + springs(*r) + prior.load_outside(*r, inner)
        } else {
            total - on_mesh.at(geometry.place(*r))
        }
    };
    let mut loads = Rings::between(&rings.ends.iter().map(outside).collect::<Vec<_>>());
    if !mesh.is_whole {
        let pressure = |r| shape.pressure_inside(r, inner);
        let core = mesh.core_loads(&rings, || rings.loads(inner, shape.kinks(), pressure));
        loads.iter_mut().zip(core).for_each(|(load, core)| *load += core);
    }
    rings.means(&loads)
}

/// What the springs carry on the mesh, in total and inside each place. `springs` is the total if there is a core.
fn on_mesh(mesh: &Mesh, worn: &WornContact, springs: f64) -> (f64, Monotone) {
    let places = &mesh.places;
    let mut pressure = vec![0.0; places.len()];
    mesh.pressure(&worn.compressions, &mut pressure);
    let others = mesh.load(&pressure);
    let total = if mesh.is_whole { others } else { springs };
    if mesh.starts_on_axis() {
        pressure[0] = pressure[1];
    } else if !mesh.is_whole {
        // The pressures at the nodes are means over neighbouring cells. The first one gets what the others leave.
        pressure[0] = (2.0 * (total - others) / (places[1] - places[0])).max(0.0);
    }
    let rim = mesh.geometry.place(worn.contact_radius);
    // Everything wears inside a small core of a line contact, too.
    let is_line = mesh.is_whole && mesh.geometry == Geometry::Line;
    let mut loads = vec![(places[0], if is_line { places[0] * pressure[0] } else { 0.0 })];
    let cells = places.windows(2).zip(pressure.windows(2)).take_while(|(ends, _)| ends[1] < rim);
    for (ends, pressure) in cells {
        let load = 0.5 * (ends[1] - ends[0]) * (pressure[0] + pressure[1]);
        loads.push((ends[1], loads[loads.len() - 1].1 + load));
    }
    // Next to the edge of the contact, the pressure decreases like a power that gives the rest of the load. The last node
    // in contact does not count, because its pressure is a mean that extends beyond the edge.
    let last = loads.len().saturating_sub(2);
    loads.truncate(last + 1);
    let (from, inside) = loads[last];
    let (width, rest) = ((rim - from).max(1e-9 * from), (total - inside).max(0.0));
    // A pressure of 0 must not give 0/0.
    let share = (rest / (pressure[last] * width).max(1e-300)).clamp(0.2, 1.0);
    for left in [0.75, 0.5, 0.25, 0.1, 0.0_f64] {
        loads.push((from + (1.0 - left) * width, total - rest * libm::pow(left, 1.0 / share)));
    }
    if is_line {
        loads.insert(0, (0.0, 0.0));
    }
    let (knots, loads) = loads.into_iter().unzip();
    (total, Monotone::through(knots, loads))
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
