//! The result of a run.

use serde_json::Value;
use utoipa::ToSchema;

use super::parts::{Engine, Units};
use crate::http::wire::schemas::KeyText;
use fretwork_engine::contact::Regime;
use fretwork_engine::{
    Accuracy, BodyWear, Comparison, ContactScales, EventKind, History as Columns, LimitState,
    Loops as LoopCurves, Profiles as Curves, Unworn, Warning,
};

/// The result of a scenario, in SI units.
#[derive(ToSchema)]
pub struct RunResult {
    key: KeyText,
    engine: Engine,
    /// The canonical scenario: SI units, with all defaults.
    #[schema(value_type = Object)]
    scenario: Value,
    units: Units,
    scales: ContactScales,
    unworn: Unworn,
    regime: Regime,
    #[schema(required)]
    limit: Option<LimitState>,
    history: Columns,
    /// The wear of each body. The first one carries the profile, the other one is the counterbody.
    #[schema(required = false, min_items = 2, max_items = 2)]
    bodies: Vec<BodyWear>,
    #[schema(required)]
    profiles: Option<Curves>,
    #[schema(required)]
    loops: Option<LoopCurves>,
    events: Vec<Event>,
    accuracy: Accuracy,
    #[schema(nullable = false)]
    comparison: Option<Comparison>,
    warnings: Vec<Warning>,
}

/// An event during the run.
#[derive(ToSchema)]
pub struct Event {
    /// The cycle of the event.
    cycles: f64,
    kind: EventKind,
    /// Of `layer_worn_through`: the index of the body; 0 is the body with the profile.
    #[schema(nullable = false, maximum = 1)]
    body: Option<u8>,
    /// Of `layer_worn_through`: the index of the layer, from the surface inwards.
    #[schema(nullable = false)]
    layer: Option<usize>,
    /// Of `layer_worn_through`: the distance from the axis, or from the middle of a line contact, at which the layer is worn
    /// through, m.
    #[schema(nullable = false, minimum = 0)]
    radius: Option<f64>,
}

/// An estimate for a scenario.
#[derive(ToSchema)]
pub struct Preview {
    scales: ContactScales,
    unworn: Unworn,
    regime: Regime,
    #[schema(required)]
    limit: Option<LimitState>,
    units: Units,
    cost: RunCost,
}

/// An estimate of the cost of a run.
#[derive(ToSchema)]
pub struct RunCost {
    /// Number of multiplications. A core computes about 10⁹ per second.
    operations: f64,
    /// Size of the result as JSON, in bytes.
    answer_bytes: u64,
}
