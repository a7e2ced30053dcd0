//! The event that a worn contact splits into a core and a ring.

use crate::contact::control::Normal;
use crate::contact::splits::{Falls, NEGLECTED, Scar};
use crate::contact::unworn::Contact;
use crate::solver::events::LOST;

/// Compares the load of the rings that a run neglects with the normal force.
#[derive(Debug)]
pub(super) struct SplitWatch {
    falls: Falls,
    /// ∫₀ᵃ y dx below which the contact counts as lost.
    least: f64,
}

/// The worn contact at one time.
#[derive(Debug)]
pub(super) struct WornCore<'a> {
    /// The depth d.
    pub(super) depth: f64,
    /// ∫₀ᵃ y dx.
    pub(super) normal: f64,
    /// The mesh nodes.
    pub(super) radii: &'a [f64],
    /// Number of cells in contact.
    pub(super) touching: usize,
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
    /// returns the wear at the nodes.
    pub(super) fn signal<W: AsRef<[f64]>>(
        &self,
        core: &WornCore<'_>,
        wear: impl FnOnce() -> W,
    ) -> f64 {
        let most = NEGLECTED * core.normal.max(self.least);
        let touching = core.touching.min(core.radii.len() - 1);
        if self.falls.possible(core.radii[touching]) <= most {
            return most;
        }
        let scar = Scar::new(core.radii, wear().as_ref(), touching);
        most - self.falls.neglected(core.depth, &scar)
    }
}
