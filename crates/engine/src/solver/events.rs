//! Events of a run, and the condition that ends it.

use serde::Serialize;
use utoipa::ToSchema;

/// Contact is lost when the normal force is below this share of its initial value. A mesh does not
/// resolve the decay of much smaller forces.
pub const LOST: f64 = 3e-3;
/// The contact is in shakedown if its energy per cycle is below this share of the energy per cycle of the unworn
/// contact at the same amplitude. A mesh does not resolve the decay of much smaller energies.
pub const SHAKEN: f64 = 1e-2;
/// Under a held aperture, a core slips if its stick radius is below this share of its largest value.
pub const CORE: f64 = 0.95;

/// `gross_slip`: the whole contact begins to slip. `contact_lost`: the normal force is below 0.3 % of its first value. `shakedown`:
/// the energy per cycle is below 1 % of its first value; in blocks, of the value of the unworn contact at the amplitude of the
/// block. `until_reached`: the stop condition is met. `rim_reached`: the scar has reached the rim of the indenter.
/// `contact_splits`: a ring outside the contact would carry more than 0.1 % of the normal force. `energy_not_reached`: the run
/// ended before it reached the next energy. `layer_worn_through`: a layer of a body is worn through at one place. `core_slips`:
/// under a held aperture, the core that carries the load begins to slip; what follows depends on the mesh, so the run ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// The whole contact begins to slip.
    GrossSlip,
    /// The normal force is below 0.3 % of its initial value. The run continues.
    ContactLost,
    /// The energy per cycle is below 1 % of the energy per cycle of the unworn contact at the same amplitude.
    Shakedown,
    /// The stop condition is met.
    UntilReached,
    /// The scar has reached the outer edge of the indenter.
    RimReached,
    /// A ring of contact outside the scar would carry more than 0.1 % of the normal force. The run
    /// computes the core alone, so it ends.
    ContactSplits,
    /// A layer of a body is worn through at one place.
    LayerWornThrough,
    /// A requested energy cannot be dissipated: wear has practically stopped, the last block has ended, or the
    /// run has reached the largest number of cycles.
    EnergyNotReached,
    /// Under a held aperture, the slip ring has lost its load, and the core has to slip. It slips by steps whose length is that
    /// of the cells, so the run ends.
    CoreSlips,
}

/// The kinds of events with their names for people.
pub const EVENTS: [(EventKind, &str); 9] = [
    (EventKind::GrossSlip, "Gross slip"),
    (EventKind::ContactLost, "Contact lost"),
    (EventKind::Shakedown, "Wear practically stops"),
    (EventKind::UntilReached, "Stop condition reached"),
    (EventKind::RimReached, "Edge of the profile reached"),
    (EventKind::ContactSplits, "Contact splits into core and ring"),
    (EventKind::EnergyNotReached, "Requested energy not reached"),
    (EventKind::LayerWornThrough, "Layer worn through"),
    (EventKind::CoreSlips, "Core begins to slip"),
];

/// An event and its time in N₀.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// The time of the event, Ñ.
    pub at: f64,
    /// The kind of the event.
    pub kind: EventKind,
    /// Whether the run ends with this event.
    pub ends: bool,
    /// The layer, if the event is about one.
    pub layer: Option<WornThrough>,
}

/// A layer that is worn through.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WornThrough {
    /// The index of the body; 0 is the body with the profile.
    pub body: usize,
    /// The index of the layer, from the surface inwards.
    pub layer: usize,
    /// The radius at which it is worn through: in a₀ in an [`Event`], in m in the outcome.
    pub radius: f64,
}

impl Event {
    /// An event that is not about a layer.
    pub(crate) fn new(at: f64, kind: EventKind, ends: bool) -> Self {
        Self { at, kind, ends, layer: None }
    }
}

/// The wear or the energy at which a run ends, in units of d₀ and a₀²d₀.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StopCondition {
    /// The maximum wear depth.
    pub depth: Option<f64>,
    /// The wear volume V.
    pub volume: Option<f64>,
    /// The dissipated energy, as (k_w/μ)·ΣW.
    pub energy: Option<f64>,
}

impl StopCondition {
    /// The share of the required wear or energy that is still missing. It is 0 or negative after the
    /// condition is met.
    pub(crate) fn missing(&self, depth: f64, volume: f64, energy: f64) -> f64 {
        let missing = |asked: Option<f64>, reached: f64| asked.map_or(1.0, |a| 1.0 - reached / a);
        missing(self.depth, depth)
            .min(missing(self.volume, volume))
            .min(missing(self.energy, energy))
    }
}
