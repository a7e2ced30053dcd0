//! Contacts that split into a core and rings around it.
//!
//! The springs have one contact: it ends at the first radius at which the image g reaches the
//! indentation depth d. The image of a measured profile can fall again further out, for example
//! behind a groove. Springs with g < d out there are a ring of contact, which the springs of the
//! run do not contain. This module computes the load of such rings. It uses the image of the
//! smoothed points as it is, and not the increasing image of the run.
//!
//! # Equations
//! In units of a₀ and d₀, with the image of the wear w and the edge s of the contact or of the
//! scar, whichever is wider:
//! ```text
//! neglected load   2 ∫ (d − g)₊ dx over x > s,   g(x) = g₀(x) + x ∫ w′(r)/√(x²−r²) dr
//! x > s            x ∫ w′(r)/√(x²−r²) dr = −x ∫ w r/(x²−r²)^{3/2} dr  ≥  −V/(2π) · x/(x²−s²)^{3/2}
//! ```
//! The image of the wear is negative outside the scar, and it increases with x. If g₀ increases too, g increases, and
//! there is no ring. Wear therefore splits a contact only where g₀ falls. The load of a ring is at most the load of
//! springs whose compression is the largest value of g₀ further inside minus g₀.

use crate::numeric::positive_area;

/// The load of a ring matters if it is at least this share of the normal force.
pub(crate) const NEGLECTED: f64 = 1e-3;

/// The image of the smoothed points of a table. It is linear between the nodes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TrueImage {
    nodes: Vec<f64>,
    images: Vec<f64>,
}

impl TrueImage {
    pub(super) fn new(nodes: &[f64], images: impl Iterator<Item = f64>) -> Self {
        Self { nodes: nodes.to_vec(), images: images.collect() }
    }

    /// The rings of contact at a depth, in the units of the table: the radius at which the core ends, the radius at which
    /// the first ring begins, and the load of the rings, ∫ (d − g)₊ dx outside the core. `None` if the springs outside the
    /// core carry no load.
    pub(super) fn rings(&self, depth: f64) -> Option<(f64, f64, f64)> {
        let first = self.images.iter().position(|image| *image >= depth)?;
        let at = |i: usize| {
            // The radius between the nodes i − 1 and i at which the image is equal to the depth.
            let (before, after) = (depth - self.images[i - 1], depth - self.images[i]);
            let share = before / (before - after);
            self.nodes[i - 1] + share * (self.nodes[i] - self.nodes[i - 1])
        };
        let next = (first + 1..self.nodes.len()).find(|i| self.images[*i] < depth)?;
        let compressions = |i: usize| [depth - self.images[i - 1], depth - self.images[i]];
        let load = (next..self.nodes.len())
            .map(|i| positive_area([self.nodes[i - 1], self.nodes[i]], compressions(i)))
            .sum();
        Some((at(first), at(next), load))
    }

    /// The falling parts of the image outside the radius `radius`, in units of `radius` and
    /// `depth`.
    pub(super) fn falls(&self, radius: f64, depth: f64) -> Falls {
        let mut most = f64::NEG_INFINITY;
        let highest = self.images.iter().map(|image| {
            most = most.max(*image);
            most
        });
        let drops: Vec<f64> =
            highest.zip(&self.images).map(|(most, image)| (most - image) / depth).collect();
        let first = self.nodes.partition_point(|node| *node <= radius);
        let radii: Vec<f64> = self.nodes[first..].iter().map(|node| node / radius).collect();
        let drops = &drops[first..];
        let mut possible = vec![0.0; radii.len()];
        for i in (1..radii.len()).rev() {
            let ring = 0.5 * (radii[i] - radii[i - 1]) * (drops[i] + drops[i - 1]);
            possible[i - 1] = possible[i] + ring;
        }
        let images = self.images[first..].iter().map(|image| image / depth).collect();
        Falls { radii, images, drops: drops.to_vec(), possible }
    }
}

/// The image outside the unworn contact, in units of a₀ and d₀.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Falls {
    radii: Vec<f64>,
    images: Vec<f64>,
    /// The largest image further inside minus the image: an upper bound of d − g, at any time.
    drops: Vec<f64>,
    /// Upper bound of ∫ (d − g)₊ dx outside each radius, at any time.
    possible: Vec<f64>,
}

/// Wear that is linear in r² between radii.
#[derive(Debug, Clone)]
pub(crate) struct Scar {
    radii: Vec<f64>,
    /// The wear at the radii up to the edge. It is never negative.
    wear: Vec<f64>,
    /// The radius at which the contact and the scar end.
    edge: f64,
    /// The wear volume divided by 2π.
    volume: f64,
}

impl Scar {
    /// The scar of the given wear at ascending radii. The contact ends at the radius `edge`.
    pub(crate) fn new(mut radii: Vec<f64>, wear: &[f64], edge: f64) -> Self {
        let worn = wear.iter().rposition(|w| *w > 0.0).map_or(0, |worn| worn + 1);
        let touching = radii.partition_point(|r| *r < edge);
        let end = worn.max(touching).min(radii.len() - 1);
        radii.truncate(end + 1);
        let wear: Vec<f64> = wear[..=end].iter().map(|w| w.max(0.0)).collect();
        let rings = radii.windows(2).zip(wear.windows(2));
        let volume = rings.map(|(r, w)| 0.25 * (r[1] - r[0]) * (r[1] + r[0]) * (w[0] + w[1])).sum();
        Self { edge: radii[end], radii, wear, volume }
    }

    /// The image of the wear at a radius outside the scar.
    fn image(&self, x: f64) -> f64 {
        let chord = |r: f64| ((x - r) * (x + r)).sqrt();
        let mut inner = chord(self.radii[0]);
        let mut sum = 0.0;
        for (r, w) in self.radii.windows(2).zip(self.wear.windows(2)) {
            let outer = chord(r[1]);
            // ∫ x dt/√(x²−t) over the cell is 2x times the difference of the chords.
            sum += (w[1] - w[0]) / ((r[1] - r[0]) * (r[1] + r[0])) * (inner - outer);
            inner = outer;
        }
        let axis = if self.radii[0] == 0.0 { self.wear[0] } else { 0.0 };
        axis + 2.0 * x * sum
    }

    /// A lower bound of the image of the wear outside the scar.
    fn least_image(&self, x: f64) -> f64 {
        let square = (x - self.edge) * (x + self.edge);
        -self.volume * x / (square * square.sqrt())
    }
}

impl Falls {
    /// Upper bound of ∫ (d − g)₊ dx outside the edge of the contact, at any time from now on.
    pub(crate) fn possible(&self, edge: f64) -> f64 {
        let next = self.radii.partition_point(|r| *r <= edge);
        self.possible.get(next.saturating_sub(1)).copied().unwrap_or(0.0)
    }

    /// The load that the run neglects: ∫ (d − g)₊ dx outside the contact and the scar.
    pub(crate) fn neglected(&self, depth: f64, scar: &Scar) -> f64 {
        let first = self.radii.partition_point(|r| *r <= scar.edge);
        // At the edge of the scar the compression is 0.
        let (mut before, mut load) = ((scar.edge, 0.0), 0.0);
        let images = self.images[first..].iter().zip(&self.drops[first..]);
        for (x, (image, drop)) in self.radii[first..].iter().zip(images) {
            let (unworn, least) = (depth - image, scar.least_image(*x));
            let compression = if unworn <= least || *drop <= 0.0 {
                unworn - least
            } else {
                unworn - scar.image(*x)
            };
            // The bound matters for the simplified rule, because its wear ends abruptly at the edge of the scar.
            let compression = compression.min(*drop);
            load += positive_area([before.0, *x], [before.1, compression]);
            before = (*x, compression);
        }
        load
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The wear t_s − t of a scar of radius 0.8.
    fn cap(cells: usize) -> (Vec<f64>, Vec<f64>) {
        let radii: Vec<f64> = (0..=cells).map(|i| i as f64 / cells as f64).collect();
        let wear = radii.iter().map(|r| 0.64 - r * r).collect();
        (radii, wear)
    }

    #[test]
    fn the_image_of_a_scar_agrees_with_its_closed_form_and_exceeds_its_bound() {
        let (radii, wear) = cap(10);
        let scar = Scar::new(radii.clone(), &wear, 0.0);
        // The exact volume is V = π s⁴/2.
        assert!((scar.volume - 0.25 * 0.4096).abs() < 1e-15, "{}", scar.volume);
        assert!((scar.edge - 0.8).abs() < 1e-15);
        for x in [0.81, 0.9, 1.2, 5.0] {
            let exact: f64 = 0.64 - 2.0 * x * (x - (x * x - 0.64_f64).sqrt());
            assert!((scar.image(x) - exact).abs() < 1e-13, "{x}: {} {exact}", scar.image(x));
            assert!(scar.least_image(x) < exact && exact < 0.0);
        }
        // If the contact is wider than the scar, `edge` is the edge of the contact.
        assert!((Scar::new(radii, &wear, 0.9).edge - 0.9).abs() < 1e-15);
    }

    /// An image that rises to 2, falls to 0.5 and rises again.
    fn hump() -> TrueImage {
        let points = [(0.0, 0.0), (1.0, 2.0), (2.0, 0.5), (3.0, 2.5)];
        let (nodes, images): (Vec<f64>, Vec<f64>) = points.into_iter().unzip();
        TrueImage::new(&nodes, images.into_iter())
    }

    #[test]
    fn the_ring_behind_a_hump_begins_where_the_image_falls_below_the_depth() {
        let (core, begin, load) = hump().rings(1.25).expect("a ring");
        assert!((core - 0.625).abs() < 1e-15 && (begin - 1.5).abs() < 1e-15);
        // Two triangles of the height 0.75 and the lengths 0.5 and 0.375.
        assert!((load - 0.375 * 0.875).abs() < 1e-15);
        assert_eq!(hump().rings(0.4), None);
        assert_eq!(hump().rings(3.0), None);
    }

    #[test]
    fn wear_makes_no_ring_where_the_image_rises() {
        let nodes: Vec<f64> = (0..=200).map(|i| f64::from(i) / 100.0).collect();
        let rising = TrueImage::new(&nodes, nodes.iter().map(|x| x * x));
        let (radii, wear) = cap(10);
        let scar = Scar::new(radii, &wear, 0.8);
        let falls = rising.falls(0.8, 0.64);
        assert!(falls.possible(1.0) == 0.0);
        assert!(falls.neglected(1.0, &scar) == 0.0);
    }
}
