//! How the two bodies share the wear depth.
//!
//! What a body loses is spread over the length that is swept on it. This length is known step by step: the contact does
//! not move on the body that carries the profile, so its half-length ℓ is the radius of the scar. On the counterbody it is
//! longer by the amplitude of the local slip at the edge of the scar. An amplitude that changes later does not change what
//! has been worn before.
//!
//! # Equations
//! ```text
//! dw_i = dw (k_i/ℓ_i) / Σ (k_j/ℓ_j)
//! ```

use super::run::MeshRun;
use super::wearing::Wearing;

/// The share of each body in the wear depth, from the depths that they would lose over equal lengths, and the lengths. The
/// sum is 1, or 0 without wear.
pub(crate) fn shares(plain: [f64; 2], lengths: [f64; 2]) -> [f64; 2] {
    let weights = [0, 1].map(|body| plain[body] / lengths[body]);
    let both = weights[0] + weights[1];
    weights.map(|weight| if both > 0.0 { weight / both } else { 0.0 })
}

/// The wear depths of both bodies up to the last step.
#[derive(Debug)]
pub(crate) struct BodyShares {
    /// The share of the body with the profile, unless the layers tell it.
    share: f64,
    /// The unit of the slip in a₀.
    unit: f64,
    /// The state after the last step, and its block.
    last: Shared,
    block: usize,
    /// The wear depth of each body after the last step.
    depths: [f64; 2],
}

/// One state of the contact.
#[derive(Debug, Clone, Copy)]
struct Shared {
    /// The depth of each body if both were swept over the same length.
    plain: [f64; 2],
    /// The half-length ℓ that is swept on each body, in a₀.
    lengths: [f64; 2],
}

impl BodyShares {
    /// Starts with unworn bodies. `share` is that of the body with the profile, unless the bodies have layers, and `unit`
    /// the unit of the slip in a₀.
    pub(crate) fn new(share: f64, unit: f64, wearing: &Wearing) -> Self {
        let mut new = Self {
            share,
            unit,
            last: Shared { plain: [0.0; 2], lengths: [1.0; 2] },
            block: 0,
            depths: [0.0; 2],
        };
        let unworn = vec![0.0; wearing.springs.mesh.radii.len()];
        new.last = new.shared(wearing, &unworn);
        new
    }

    /// Adds the wear of the last step.
    pub(super) fn follow(&mut self, run: &MeshRun) {
        let now = self.shared(&run.wearing, &run.rkc.values);
        if run.block != self.block {
            // The amplitude has changed before this step.
            (self.block, self.last.lengths) = (run.block, now.lengths);
        }
        (self.depths, self.last) = (self.depths_at(&now), now);
    }

    /// The share of each body in the depth at a time within the last step. The sum is 1, or 0 without wear.
    pub(super) fn at(&self, wearing: &Wearing, values: &[f64]) -> [f64; 2] {
        shares(self.depths_at(&self.shared(wearing, values)), [1.0; 2])
    }

    fn depths_at(&self, now: &Shared) -> [f64; 2] {
        let Shared { plain, lengths } = &self.last;
        let added = [0, 1].map(|body| (now.plain[body] - plain[body]).max(0.0));
        let shares = shares(added, [0, 1].map(|body| lengths[body] + now.lengths[body]));
        [0, 1].map(|body| self.depths[body] + (added[0] + added[1]) * shares[body])
    }

    fn shared(&self, wearing: &Wearing, values: &[f64]) -> Shared {
        let springs = &wearing.springs;
        let radius = wearing.worn_radius(&wearing.wear(values));
        let slip =
            springs.middle + springs.mesh.slip_at(radius, springs.threshold, &springs.loads());
        let plain = if let Some(layers) = &wearing.contact.layers {
            let dose = values.iter().copied().fold(0.0, f64::max);
            [0, 1].map(|body| layers.depth(body, dose))
        } else {
            let (_, depth) = wearing.volume_and_depth(values);
            [self.share * depth, (1.0 - self.share) * depth]
        };
        Shared { plain, lengths: [radius, radius + slip * springs.friction * self.unit] }
    }
}
