//! What happens to a contact while it wears, and where a run ends.

use serde::Serialize;

/// Contact is lost once the springs carry less than this share of the unworn force.
pub const LOST: f64 = 1e-6;
/// A contact has shaken down once a cycle dissipates less than this share of what the first one did.
pub const SHAKEN: f64 = 1e-3;

/// What happens to a contact while it wears.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum EventKind {
    /// From here on all slips.
    GrossSlip,
    /// The springs carry nothing any more.
    ContactLost,
    /// Hardly anything is dissipated any more.
    Shakedown,
    /// The wear that was asked for is reached.
    UntilReached,
    /// The scar has come to the rim of the indenter, beyond which nothing is known.
    RimReached,
}

/// When something happens, in N₀.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// Ñ.
    pub at: f64,
    /// What.
    pub kind: EventKind,
    /// Whether the run ends there.
    pub ends: bool,
}

/// Wear at which a run ends, in units of d₀ and a₀²d₀.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StopCondition {
    /// The largest wear.
    pub depth: Option<f64>,
    /// V.
    pub volume: Option<f64>,
}

impl StopCondition {
    /// What is missing, in parts of what is asked for: 0 or less once it is reached.
    #[must_use]
    pub fn missing(&self, depth: f64, volume: f64) -> f64 {
        let missing = |asked: Option<f64>, reached: f64| asked.map_or(1.0, |a| 1.0 - reached / a);
        missing(self.depth, depth).min(missing(self.volume, volume))
    }
}
