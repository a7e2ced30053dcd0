//! The event that a worn contact splits into a core and a ring.

use crate::contact::splits::{Falls, NEGLECTED, Scar};
use crate::contact::{Contact, Normal};
use crate::solver::events::LOST;

/// Compares the load of the rings that a run neglects with the normal force.
#[derive(Debug)]
pub(super) struct SplitWatch {
    falls: Falls,
    /// Half of the normal force, ∫₀ᵃ y dx, below which the contact counts as lost.
    least: f64,
}

/// The worn contact at one time.
#[derive(Debug)]
pub(super) struct WornCore {
    /// The depth d.
    pub(super) depth: f64,
    /// Half of the normal force, ∫₀ᵃ y dx.
    pub(super) normal: f64,
    /// The outer radius of the cells in contact.
    pub(super) edge: f64,
}

impl SplitWatch {
    /// `None` if the contact cannot split, because its image falls nowhere or by too little.
    pub(super) fn new(contact: &Contact, normal: Normal) -> Option<Self> {
        let falls = contact.shape.falls()?;
        let half_force = contact.shape.half_force();
        let least = LOST * half_force;
        let smallest = match normal {
            Normal::Force => half_force,
            Normal::Depth => least,
        };
        (falls.possible(1.0) > NEGLECTED * smallest).then_some(Self { falls, least })
    }

    /// A number that is positive before the contact splits, and 0 or negative afterwards. `wear`
    /// returns radii and the wear there.
    pub(super) fn signal(
        &self,
        core: &WornCore,
        wear: impl FnOnce() -> (Vec<f64>, Vec<f64>),
    ) -> f64 {
        let most = NEGLECTED * core.normal.max(self.least);
        if self.falls.possible(core.edge) <= most {
            return most;
        }
        let (radii, wear) = wear();
        let scar = Scar::new(radii, &wear, core.edge);
        most - self.falls.neglected(core.depth, &scar)
    }
}
