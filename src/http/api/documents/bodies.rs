//! The bodies of requests.

use std::collections::BTreeSet;

use utoipa::ToSchema;

use super::fits::Fit;
use crate::http::wire::schemas::{
    KeyText, NumberOrText, OutputName, Radii, Scenario, Spacing, Tag,
};

/// What to compute, exactly one of `scenario`, `sweep`, `sensitivity`, `map` and `fit`, and words to find the job by.
#[derive(ToSchema)]
pub struct JobBody {
    #[schema(nullable = false)]
    scenario: Option<Scenario>,
    #[schema(nullable = false)]
    sweep: Option<Sweep>,
    #[schema(nullable = false)]
    sensitivity: Option<Sensitivity>,
    #[schema(nullable = false)]
    map: Option<FrettingMap>,
    #[schema(nullable = false)]
    fit: Option<Fit>,
    /// A label on one line, without control characters. It is not part of the key.
    #[schema(nullable = false, min_length = 1, max_length = 200)]
    label: Option<String>,
    /// Words to find the job by. They are not part of the key.
    #[schema(required = false, max_items = 20)]
    tags: BTreeSet<Tag>,
}

/// A change of the label and the tags of a job.
#[derive(ToSchema)]
pub struct Naming {
    /// The new label on one line, without control characters. Null removes the label.
    #[schema(min_length = 1, max_length = 200)]
    label: Option<String>,
    /// The new words to find the job by.
    #[schema(required = false, max_items = 20)]
    tags: BTreeSet<Tag>,
}

/// A scenario to evaluate, and what to return. At least one of `outputs` and `parts` must have an item.
#[derive(ToSchema)]
pub struct EvaluateBody {
    scenario: Scenario,
    /// Names of scalars. A column of the history, such as `wear_volume`, is taken from its last row; `wear_volume@10000` from an
    /// output cycle, written as in `cycles` of the scenario. `limit.…`, `unworn.…` and `scales.…` are members of these objects of
    /// a result. `events.…` is the number of cycles at which an event happened first.
    #[schema(required = false, max_items = 100)]
    outputs: BTreeSet<OutputName>,
    /// Parts of the result, and the `check` of the scenario, which needs no run. `profiles` and `loops` have the output cycles that
    /// `profiles_at` of the scenario selects. They are absent from the answer if it selects none.
    #[schema(required = false)]
    parts: BTreeSet<EvaluatedPart>,
}

#[derive(ToSchema)]
#[schema(rename_all = "lowercase")]
pub enum EvaluatedPart {
    History,
    Profiles,
    Loops,
    Events,
    Accuracy,
    Check,
}

/// A result by its key, which may be evicted, or a scenario.
#[derive(ToSchema)]
#[schema(min_properties = 1, max_properties = 1)]
pub struct DiffSide {
    #[schema(nullable = false)]
    key: Option<KeyText>,
    #[schema(nullable = false)]
    scenario: Option<Scenario>,
}

/// Two keys.
#[derive(ToSchema)]
pub struct KeysToCompare {
    /// Two keys, instead of `a` and `b`.
    #[schema(min_items = 2, max_items = 2)]
    keys: Vec<KeyText>,
}

/// Two sides.
#[derive(ToSchema)]
pub struct SidesToCompare {
    a: DiffSide,
    /// By default the stored result whose scenario is nearest to `a`.
    #[schema(nullable = false)]
    b: Option<DiffSide>,
}

/// A sweep: the outputs of a scenario for many values of some of its numbers.
#[derive(ToSchema)]
pub struct Sweep {
    /// The version of the rules of studies, as in the result.
    #[schema(nullable = false, minimum = 1, maximum = 1)]
    version: Option<u32>,
    scenario: Scenario,
    /// The numbers that vary.
    #[schema(min_items = 1, max_items = 100)]
    vary: Vec<Varied>,
    #[schema(nullable = false)]
    design: Option<Design>,
    /// The number of points of a Latin hypercube or a Sobol sequence. Powers of two fill the space most evenly.
    #[schema(nullable = false, minimum = 1, maximum = 4_194_304)]
    samples: Option<u64>,
    /// The random numbers depend on it alone; 0 by default.
    #[schema(nullable = false, maximum = 9_007_199_254_740_992_u64)]
    seed: Option<u64>,
    /// What to take from each run, by the names of POST /v1/evaluate.
    #[schema(min_items = 1, max_items = 100)]
    outputs: BTreeSet<OutputName>,
    #[schema(nullable = false)]
    profiles: Option<SweepProfiles>,
}

/// Which points: all combinations of the values; the first values, the second values, …; a random Latin hypercube; a scrambled
/// Sobol sequence.
#[derive(ToSchema)]
#[schema(rename_all = "snake_case", default = "grid")]
pub enum Design {
    Grid,
    Zip,
    LatinHypercube,
    Sobol,
}

/// Curves of each run after its last output cycle, at radii that all runs share. They are linear between the output radii of the
/// run, whose number is `points` of `model`.
#[derive(ToSchema)]
pub struct SweepProfiles {
    radius: Radii,
    /// The curves; `wear` by default.
    #[schema(required = false, min_items = 1)]
    fields: BTreeSet<SweepCurve>,
}

#[derive(ToSchema)]
#[schema(rename_all = "lowercase")]
pub enum SweepCurve {
    Wear,
    Worn,
    Pressure,
    Slip,
}

/// A range of numbers.
#[derive(ToSchema)]
pub struct NumberRange {
    from: NumberOrText,
    to: NumberOrText,
    #[schema(minimum = 2, maximum = 1000)]
    count: u32,
    #[schema(nullable = false)]
    spacing: Option<Spacing>,
}

/// Numbers, each in SI or as a text with a unit.
#[derive(ToSchema)]
#[schema(min_items = 1, max_items = 1000)]
pub struct NumberList(Vec<NumberOrText>);

/// A number of the scenario, and either its `values`, or a range (`from`, `to`), or a `distribution`. Local elasticities need only the
/// pointer.
#[derive(ToSchema)]
pub struct Varied {
    /// A JSON pointer (RFC 6901) into the scenario.
    #[schema(example = "/friction")]
    pointer: String,
    #[schema(required = false, min_items = 1, max_items = 100_000)]
    values: Vec<NumberOrText>,
    #[schema(nullable = false)]
    from: Option<NumberOrText>,
    #[schema(nullable = false)]
    to: Option<NumberOrText>,
    /// The number of values of the range; only for the designs grid and zip.
    #[schema(nullable = false, minimum = 2, maximum = 100_000)]
    count: Option<u32>,
    #[schema(nullable = false)]
    spacing: Option<Spacing>,
    #[schema(nullable = false)]
    distribution: Option<Distribution>,
}

/// The name of a distribution with its parameters, in the unit of the number.
#[derive(ToSchema)]
#[schema(min_properties = 1, max_properties = 1)]
pub struct Distribution {
    #[schema(nullable = false)]
    uniform: Option<UniformDistribution>,
    #[schema(nullable = false)]
    log_uniform: Option<UniformDistribution>,
    #[schema(nullable = false)]
    normal: Option<NormalDistribution>,
    #[schema(nullable = false)]
    lognormal: Option<LognormalDistribution>,
    #[schema(nullable = false)]
    triangular: Option<TriangularDistribution>,
}

#[derive(ToSchema)]
pub struct UniformDistribution {
    low: NumberOrText,
    high: NumberOrText,
}

#[derive(ToSchema)]
pub struct NormalDistribution {
    mean: NumberOrText,
    standard_deviation: NumberOrText,
}

/// Of its mean and standard deviation, or of its median and the factor by which one standard deviation of the logarithm multiplies it.
#[derive(ToSchema)]
pub struct LognormalDistribution {
    #[schema(nullable = false)]
    mean: Option<NumberOrText>,
    #[schema(nullable = false)]
    standard_deviation: Option<NumberOrText>,
    #[schema(nullable = false)]
    median: Option<NumberOrText>,
    #[schema(nullable = false, exclusive_minimum = 1.0)]
    factor: Option<f64>,
}

#[derive(ToSchema)]
pub struct TriangularDistribution {
    low: NumberOrText,
    mode: NumberOrText,
    high: NumberOrText,
}

/// A sensitivity study: which numbers of a scenario matter for its outputs.
#[derive(ToSchema)]
pub struct Sensitivity {
    /// The version of the rules of studies, as in the result.
    #[schema(nullable = false, minimum = 1, maximum = 1)]
    version: Option<u32>,
    scenario: Scenario,
    /// The numbers that vary, each with a range or a distribution. For the method local, only their pointers.
    #[schema(min_items = 1, max_items = 100)]
    vary: Vec<Varied>,
    #[schema(nullable = false)]
    method: Option<SensitivityMethod>,
    /// For d numbers: how many groups of d + 2 points (sobol, best a power of two), or trajectories of d + 1 points (morris).
    #[schema(nullable = false, minimum = 2, maximum = 4_294_967_295_u32)]
    samples: Option<u32>,
    /// The random numbers depend on it alone; 0 by default.
    #[schema(nullable = false, maximum = 9_007_199_254_740_992_u64)]
    seed: Option<u64>,
    /// Share of the resamples that an interval contains; 0.95 by default.
    #[schema(nullable = false, minimum = 0.5, maximum = 0.999)]
    confidence: Option<f64>,
    /// What to take from each run, by the names of POST /v1/evaluate.
    #[schema(min_items = 1, max_items = 100)]
    outputs: BTreeSet<OutputName>,
}

/// Sobol indices, elementary effects, or elasticities at the values of the scenario.
#[derive(ToSchema)]
#[schema(rename_all = "lowercase", default = "sobol")]
pub enum SensitivityMethod {
    Sobol,
    Morris,
    Local,
}

/// A map over normal force and amplitude. Its scenario has both.
#[derive(ToSchema)]
pub struct FrettingMap {
    /// The version of the rules of studies, as in the result.
    #[schema(nullable = false, minimum = 1, maximum = 1)]
    version: Option<u32>,
    scenario: Scenario,
    normal_force: Axis,
    /// The amplitudes at the contact; with `rig_stiffness` at the actuator, and of a line contact at its reference.
    amplitude: Axis,
    /// More outputs. Those that need a run, such as wear_volume, are computed by one at each point.
    #[schema(required = false, max_items = 100)]
    outputs: BTreeSet<OutputName>,
}

/// The values of an axis: a range with `from`, `to` and `count`, or `values`.
#[derive(ToSchema)]
pub struct Axis {
    #[schema(nullable = false)]
    from: Option<NumberOrText>,
    #[schema(nullable = false)]
    to: Option<NumberOrText>,
    #[schema(nullable = false, minimum = 2, maximum = 4096)]
    count: Option<u32>,
    #[schema(nullable = false)]
    spacing: Option<Spacing>,
    #[schema(required = false, min_items = 1, max_items = 4096)]
    values: Vec<NumberOrText>,
}
