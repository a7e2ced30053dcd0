//! The conventional procedure for the exact law: evenly spaced nodes, product integration of each
//! transform, and explicit Euler steps.

use std::f64::consts::{FRAC_1_PI, FRAC_2_PI, PI};

use fretwork_engine::contact::unworn::Contact;

/// The nodes and the matrices of the transforms.
pub struct Procedure {
    threshold: f64,
    radii: Vec<f64>,
    unworn: Vec<f64>,
    /// Row i contains arcsin(r_j/r_i) for j ≤ i.
    angles: Vec<Vec<f64>>,
    /// Row i contains arcosh(r_j/r_i) for j ≥ i.
    stretches: Vec<Vec<f64>>,
}

impl Procedure {
    /// A contact at constant depth and amplitude, with `cells` cells up to the limiting scar
    /// radius.
    #[must_use]
    pub fn new(contact: &Contact, cells: usize) -> Self {
        let reach = 1.01 * contact.limit.radius;
        let radii: Vec<f64> = (0..=cells).map(|i| reach * i as f64 / cells as f64).collect();
        let row = |i: usize, range: std::ops::Range<usize>, f: fn(f64) -> f64| -> Vec<f64> {
            range.map(|j| f(radii[j] / radii[i])).collect()
        };
        Self {
            threshold: contact.threshold,
            unworn: radii.iter().map(|x| contact.shape.image(*x)).collect(),
            angles: (0..=cells).map(|i| row(i, 0..i + 1, libm::asin)).collect(),
            stretches: (0..=cells).map(|i| row(i, i..cells + 1, libm::acosh)).collect(),
            radii,
        }
    }

    /// The wear volume V at a time in N₀.
    #[must_use]
    pub fn run(&self, until: f64) -> f64 {
        let (nodes, step) = (self.radii.len(), self.radii[1]);
        // The Euler step is stable up to 1.5 cells.
        let steps = (until / (0.8 * step)).ceil();
        let mut wear = vec![0.0; nodes];
        for _ in 0..steps as usize {
            let image: Vec<f64> = (0..nodes).map(|i| self.image(&wear, i)).collect();
            let pressed: Vec<f64> = image.iter().map(|g| g.min(1.0)).collect();
            let slips: Vec<f64> =
                pressed.iter().map(|g| (1.0 - (1.0 - g) / self.threshold).max(0.0)).collect();
            for i in 1..nodes {
                if image[i - 1] < 1.0 {
                    let rate = self.pressure(&pressed, i) * self.slip(&slips, i);
                    wear[i] += until / steps * rate.max(0.0);
                }
            }
        }
        let ring = |i: usize| self.radii[i] * wear[i] + self.radii[i - 1] * wear[i - 1];
        PI * step * (1..nodes).map(ring).sum::<f64>()
    }

    /// x ∫ w′/√(x²−r²) dr for w linear between nodes, (3).
    fn image(&self, wear: &[f64], i: usize) -> f64 {
        let slopes =
            (1..=i).map(|j| (wear[j] - wear[j - 1]) * (self.angles[i][j] - self.angles[i][j - 1]));
        self.unworn[i] + self.radii[i] / self.radii[1] * slopes.sum::<f64>()
    }

    /// (1/π) ∫ g′/√(x²−r²) dx for g linear between nodes.
    fn pressure(&self, image: &[f64], i: usize) -> f64 {
        let row = &self.stretches[i];
        let slopes =
            (1..row.len()).map(|k| (image[i + k] - image[i + k - 1]) * (row[k] - row[k - 1]));
        FRAC_1_PI / self.radii[1] * slopes.sum::<f64>()
    }

    /// (2/π) ∫ ω/√(r²−x²) dx for ω constant between the centres of cells.
    fn slip(&self, slips: &[f64], i: usize) -> f64 {
        let parts = (1..=i)
            .map(|j| 0.5 * (slips[j] + slips[j - 1]) * (self.angles[i][j] - self.angles[i][j - 1]));
        FRAC_2_PI * parts.sum::<f64>()
    }
}
