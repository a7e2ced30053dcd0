//! The results of studies.

use serde_json::Value;
use utoipa::ToSchema;

use super::bodies::{FrettingMap, Sensitivity, Sweep};
use super::fits::Fit;
use super::parts::{Engine, TableColumns, Units};
use crate::http::wire::schemas::{KeyText, LineWeights};

/// How many points a study has, and how many of them lack outputs.
#[derive(ToSchema)]
pub struct Counts {
    /// Its points, each with a row.
    #[schema(minimum = 1)]
    points: u64,
    /// Points whose scenario is not valid. They have no outputs.
    refused: u64,
    /// Points that lack an output.
    incomplete: u64,
}

/// The result of a sweep.
#[derive(ToSchema)]
pub struct SweepResult {
    key: KeyText,
    engine: Engine,
    sweep: Sweep,
    units: Units,
    counts: Counts,
    table: TableColumns,
    #[schema(nullable = false)]
    profiles: Option<CommonCurves>,
}

/// The curves of each point of a sweep after its last output cycle, at radii that all points share. A value is null where the
/// point has no run, and next to an infinite value. Beyond the radii of the run, `worn` and `slip` are null, `wear` and
/// `pressure` 0.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CommonCurves {
    /// The row of the table that each curve belongs to.
    point: Vec<u64>,
    /// Distance from the axis, m.
    radius: Vec<f64>,
    /// Wear, m: one row per point, one column per radius.
    #[schema(required = false)]
    wear: Vec<Vec<Option<f64>>>,
    /// The profile, m.
    #[schema(required = false)]
    worn: Vec<Vec<Option<f64>>>,
    /// Pressure, Pa.
    #[schema(required = false)]
    pressure: Vec<Vec<Option<f64>>>,
    /// Amplitude of the local slip, m.
    #[schema(required = false)]
    slip: Vec<Vec<Option<f64>>>,
}

/// The result of a sensitivity study.
#[derive(ToSchema)]
pub struct SensitivityResult {
    key: KeyText,
    engine: Engine,
    sensitivity: Sensitivity,
    units: Units,
    counts: Counts,
    /// What to keep in mind when reading the table.
    notes: Vec<SensitivityNote>,
    /// A row for each output and each number that varies, with low and high ends of intervals.
    table: TableColumns,
    /// The rows of all points.
    samples: TableColumns,
}

#[derive(ToSchema)]
pub struct SensitivityNote {
    output: String,
    detail: String,
    /// The pointer of a number that varies, if the note is about one.
    #[schema(nullable = false)]
    member: Option<String>,
}

/// The result of a map.
#[derive(ToSchema)]
pub struct MapResult {
    key: KeyText,
    engine: Engine,
    map: FrettingMap,
    units: Units,
    counts: Counts,
    boundary: MapBoundary,
    /// A row for each point: of its unworn contact, regime (`partial_slip` or `gross_slip`), Q/μF, c/a and energy per cycle; and the
    /// outputs, after the last cycle if they name no other.
    table: TableColumns,
}

/// The amplitude at which gross slip begins, for each normal force. Behind a rig it is that of the actuator.
#[derive(ToSchema)]
pub struct MapBoundary {
    #[schema(rename = "/load/normal_force")]
    normal_force: Vec<f64>,
    #[schema(rename = "/motion/amplitude")]
    amplitude: Vec<Option<f64>>,
    /// The same at the contact. Only with a rig. Unit: m.
    #[schema(rename = "unworn.gross_slip_amplitude", required = false)]
    at_contact: Vec<Option<f64>>,
    /// The amplitude above which the whole contact still slips at the last cycle, estimated from the thresholds of the two
    /// amplitudes of the map around it, so that its error can reach their distance; null if it is not among them. Only with
    /// outputs. Unit: m.
    #[schema(required = false)]
    after_run: Vec<Option<f64>>,
}

/// The result of a fit. Without a minimum it has only notes, the measured numbers and the searches.
#[derive(ToSchema)]
pub struct FitResult {
    key: KeyText,
    engine: Engine,
    fit: Fit,
    units: Units,
    counts: Counts,
    /// Remarks, the most important one first.
    notes: Vec<FitNote>,
    /// The estimates. They are null if the data do not determine them.
    #[schema(required = false)]
    parameters: Vec<EstimatedParameter>,
    /// The correlations of the estimates.
    #[schema(required = false)]
    correlation: Vec<Vec<Option<f64>>>,
    #[schema(nullable = false)]
    quality: Option<FitQuality>,
    /// The numbers that disagree with the fit of all others: in 5 of 100 sets without such numbers, this names one. They are
    /// sought together. Numbers of profiles are not examined. The verdict judges the other numbers if there are at least 8 in
    /// all, without profiles and priors, and at most one in six disagrees.
    #[schema(required = false)]
    outliers: Vec<FitOutlier>,
    /// Regressions V = αΣE through the origin for wear volumes over measured energies, whatever the parameters of the fit are.
    /// `r_squared` compares with the scatter around the mean.
    #[schema(required = false)]
    lines: Vec<EnergyLine>,
    /// The scenario with the estimates, ready to run.
    #[schema(value_type = Object, required = false)]
    estimated_scenario: Value,
    /// The measured and the predicted numbers, with bands. A prior has a row, too.
    table: TableColumns,
    /// Predictions with bands on a grid over the range of each set. `confidence_low` and `confidence_high` are the band of the
    /// mean, and `prediction_low` and `prediction_high` the band of another measurement.
    #[schema(nullable = false)]
    bands: Option<TableColumns>,
    /// The rows of all points. `task` says what a row is: a search from a start, the minimum, a derivative, the minimum without
    /// a test, or a value in the profile of a parameter. In the row of a start, `derivative_error` says how many times as large as
    /// at its beginning the measured volumes are.
    searches: TableColumns,
}

#[derive(ToSchema)]
pub struct FitNote {
    kind: String,
    detail: String,
}

#[derive(ToSchema)]
pub struct EstimatedParameter {
    pointer: String,
    #[schema(rename = "for", required = false)]
    tests: Vec<String>,
    unit: String,
    #[schema(required)]
    estimate: Option<f64>,
    #[schema(required)]
    standard_error: Option<f64>,
    /// The low and the high end; null where the data give none.
    #[schema(min_items = 2, max_items = 2)]
    interval: Vec<Option<f64>>,
    /// Whether the estimate is at an end of its range.
    at_bound: bool,
}

/// How well the parameters describe the measurements.
#[derive(ToSchema)]
pub struct FitQuality {
    #[schema(required)]
    sum_of_squares: Option<f64>,
    /// An interval reaches from the estimate to the first values whose sum of squares is this much larger. If starts have
    /// found another minimum with a smaller rise, the interval contains both minima, and a note names them.
    allowed_rise: Option<f64>,
    /// The number of points, where those of a specimen or of a profile count as one. A point weighs 1/s²; s contains its noise
    /// and the numerical error of the run.
    #[schema(required)]
    effective_points: Option<f64>,
    /// Those of the estimated noise; null if all noise is stated.
    degrees_of_freedom: Option<u64>,
    /// The corrected information criterion of Akaike. Of two models of the same numbers, the one with the smaller criterion is
    /// better. It lacks the constant n ln 2π, and is null unless there are more than p + 2 points. A prior counts as a point.
    aicc: Option<f64>,
    /// The test of lack of fit, if points were repeated, for the numbers that the verdict judges.
    #[schema(value_type = Option<Object>)]
    lack_of_fit: Option<Value>,
    /// The estimated noise of each set, in units of its stated noise, or of a tenth of its largest number if none is stated.
    #[schema(value_type = Vec<Object>, required = false)]
    noise: Vec<Value>,
    /// The number of runs.
    runs: f64,
}

#[derive(ToSchema)]
pub struct FitOutlier {
    /// The row of `table`.
    row: u64,
    /// The pointer of the number in the fit, for `without`.
    pointer: String,
    /// The distance from the fit to the others, in standard deviations of this distance.
    studentized: f64,
}

#[derive(ToSchema)]
pub struct EnergyLine {
    weights: LineWeights,
    #[schema(required)]
    energy_coefficient: Option<f64>,
    #[schema(required)]
    standard_error: Option<f64>,
    /// The low and the high end; null where the data give none.
    #[schema(min_items = 2, max_items = 2)]
    interval: Vec<Option<f64>>,
    #[schema(required)]
    r_squared: Option<f64>,
}
