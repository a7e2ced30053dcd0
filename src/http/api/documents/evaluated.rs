//! The outputs of a scenario.

use std::collections::BTreeMap;

use utoipa::ToSchema;

use super::parts::Units;
use super::runs::Event;
use crate::http::api::scenarios::CheckedRun;
use fretwork_engine::{
    Accuracy, History as Columns, Loops as LoopCurves, Profiles as Curves, Warning,
};

/// The outputs of a scenario, in SI units. The numbers are those of the result that a job of this scenario has.
#[derive(ToSchema)]
pub struct Evaluated {
    /// The values, by the names of the outputs. Null where the result has no value.
    #[schema(example = json!({"wear_volume": 2.5e-13, "events.until_reached": null}))]
    outputs: BTreeMap<String, Option<f64>>,
    /// The units of the outputs, and of the columns of the tables.
    units: Units,
    /// Why outputs are null, by their names. Absent if all outputs have values.
    #[schema(required = false, example = json!({"events.until_reached": "this event did not happen"}))]
    reasons: BTreeMap<String, String>,
    #[schema(nullable = false)]
    history: Option<Columns>,
    profiles: Option<Curves>,
    loops: Option<LoopCurves>,
    #[schema(required = false)]
    events: Vec<Event>,
    #[schema(nullable = false)]
    accuracy: Option<Accuracy>,
    /// The answer of `POST /v1/scenarios` to the same scenario. Its cost is that of a job.
    #[schema(nullable = false)]
    check: Option<CheckedRun>,
    warnings: Vec<Warning>,
}
