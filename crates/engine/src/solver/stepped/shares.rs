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

use super::{MeshRun, Wearing};

/// The share of each body in the wear depth, from the depths that they would lose over equal lengths, and the lengths. The
/// sum is 1, or 0 without wear.
pub(crate) fn shares(plain: [f64; 2], lengths: [f64; 2]) -> [f64; 2] {
    let weights = [0, 1].map(|body| plain[body] / lengths[body]);
    let both = weights[0] + weights[1];
    weights.map(|weight| if both > 0.0 { weight / both } else { 0.0 })
}

/// The wear depths of both bodies in the last step.
#[derive(Debug)]
pub(crate) struct BodyShares {
    /// The share of the body with the profile, unless the layers tell it.
    share: f64,
    /// The unit of the slip in a₀.
    unit: f64,
    /// The states at the start and at the end of the last step, and its block.
    began: SweptLengths,
    ended: SweptLengths,
    block: usize,
}

/// One state of the contact.
#[derive(Debug, Clone, Copy)]
struct SweptLengths {
    /// The depth of each body if both were swept over the same length.
    plain: [f64; 2],
    /// The half-length ℓ that is swept on each body, in a₀.
    lengths: [f64; 2],
    /// The wear depth of each body.
    depths: [f64; 2],
}

impl BodyShares {
    /// Starts with unworn bodies. `share` is that of the body with the profile, unless the bodies have layers, and `unit`
    /// the unit of the slip in a₀.
    pub(crate) fn new(share: f64, unit: f64, wearing: &Wearing) -> Self {
        let unworn = SweptLengths { plain: [0.0; 2], lengths: [1.0; 2], depths: [0.0; 2] };
        let mut new = Self { share, unit, began: unworn, ended: unworn, block: 0 };
        new.ended.lengths = new.lengths(wearing, &vec![0.0; wearing.springs.mesh.radii.len()]);
        new
    }

    /// Adds the wear of the last step.
    pub(super) fn follow(&mut self, run: &MeshRun) {
        self.began = self.ended;
        if run.block != self.block {
            // The amplitude has changed before this step.
            self.block = run.block;
            self.began.lengths = self.lengths(&run.wearing, &run.rkc.values);
        }
        self.ended = self.shared(&run.wearing, &run.rkc.values);
    }

    /// The wear depth of each body at a time within the last step.
    pub(super) fn at(&self, wearing: &Wearing, values: &[f64]) -> [f64; 2] {
        self.shared(wearing, values).depths
    }

    /// A state within the last step.
    fn shared(&self, wearing: &Wearing, values: &[f64]) -> SweptLengths {
        let (plain, lengths) = (self.plain(wearing, values), self.lengths(wearing, values));
        let SweptLengths { plain: before, lengths: first, mut depths } = self.began;
        // Numerical noise removes nothing.
        let plain = [0, 1].map(|body| plain[body].max(before[body]));
        let added = [0, 1].map(|body| plain[body] - before[body]);
        let shares = shares(added, [0, 1].map(|body| first[body] + lengths[body]));
        for body in [0, 1] {
            depths[body] += (added[0] + added[1]) * shares[body];
        }
        SweptLengths { plain, lengths, depths }
    }

    fn plain(&self, wearing: &Wearing, values: &[f64]) -> [f64; 2] {
        if let Some(layers) = &wearing.contact.layers {
            let dose = values.iter().copied().fold(0.0, f64::max);
            return [0, 1].map(|body| layers.depth(body, dose));
        }
        let (_, depth) = wearing.volume_and_depth(values);
        [self.share * depth, (1.0 - self.share) * depth]
    }

    fn lengths(&self, wearing: &Wearing, values: &[f64]) -> [f64; 2] {
        let springs = &wearing.springs;
        let radius = wearing.worn_radius(&wearing.wear(values));
        let slip =
            springs.middle + springs.mesh.slip_at(radius, springs.threshold, &springs.loads());
        [radius, radius + slip * springs.friction * self.unit]
    }
}
