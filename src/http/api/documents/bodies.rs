//! The bodies of requests.

use std::collections::BTreeSet;

use utoipa::ToSchema;

use super::fits::Fit;
use crate::http::wire::schemas::{
    Design, EvaluatedPart, KeyText, NumberOrText, OutputName, Radii, Scenario, SensitivityMethod,
    Spacing, SweepCurve, Tag,
};

bodies! {
    /// What to compute, exactly one of `scenario`, `sweep`, `sensitivity`, `map` and `fit`, and words to find the job by.
    JobBody {
        scenario: Option<Scenario>,
        sweep: Option<Sweep>,
        sensitivity: Option<Sensitivity>,
        map: Option<FrettingMap>,
        fit: Option<Fit>,
        /// A label on one line, without control characters. It is not part of the key.
        #[schema(min_length = 1, max_length = 200)]
        label: Option<String>,
        /// Words to find the job by. They are not part of the key.
        #[schema(required = false, max_items = 20)]
        tags: BTreeSet<Tag>,
        /// Whether only the owner and administrators see the job, with its label and tags. By default what the key says.
        private: Option<bool>,
    }

    /// A scenario to evaluate, and what to return. At least one of `outputs` and `parts` must have an item.
    EvaluateBody {
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

    /// A result by its key, which may be evicted, or a scenario.
    #[schema(min_properties = 1, max_properties = 1)]
    DiffSide {
        key: Option<KeyText>,
        scenario: Option<Scenario>,
    }

    /// Two keys.
    KeysToCompare {
        /// Two keys, instead of `a` and `b`.
        #[schema(min_items = 2, max_items = 2)]
        keys: Vec<KeyText>,
    }

    /// Two sides.
    SidesToCompare {
        a: DiffSide,
        /// By default the stored result whose scenario is nearest to `a`.
        b: Option<DiffSide>,
    }

    /// A sweep: the outputs of a scenario for many values of some of its numbers.
    Sweep {
        /// The version of the rules of studies, as in the result.
        #[schema(minimum = 1, maximum = 1)]
        version: Option<u32>,
        scenario: Scenario,
        /// The numbers that vary.
        #[schema(min_items = 1, max_items = 100)]
        vary: Vec<Varied>,
        design: Option<Design>,
        /// The number of points of a Latin hypercube or a Sobol sequence. Powers of two fill the space most evenly.
        #[schema(minimum = 1, maximum = 4_194_304)]
        samples: Option<u64>,
        /// The random numbers depend on it alone; 0 by default.
        #[schema(maximum = 9_007_199_254_740_992_u64)]
        seed: Option<u64>,
        /// What to take from each run, by the names of POST /v1/evaluate.
        #[schema(min_items = 1, max_items = 100)]
        outputs: BTreeSet<OutputName>,
        profiles: Option<SweepProfiles>,
    }

    /// Curves of each run after its last output cycle, at radii that all runs share. They are linear between the output radii of the
    /// run, whose number is `points` of `model`.
    SweepProfiles {
        radius: Radii,
        /// The curves; `wear` by default.
        #[schema(required = false, min_items = 1)]
        fields: BTreeSet<SweepCurve>,
    }

    /// A range of numbers.
    NumberRange {
        from: NumberOrText,
        to: NumberOrText,
        #[schema(minimum = 2, maximum = 1000)]
        count: u32,
        spacing: Option<Spacing>,
    }

    /// A number of the scenario, and either its `values`, or a range (`from`, `to`), or a `distribution`. Local elasticities need only the
    /// pointer.
    Varied {
        /// A JSON pointer (RFC 6901) into the scenario.
        #[schema(example = "/friction")]
        pointer: String,
        #[schema(required = false, min_items = 1, max_items = 100_000)]
        values: Vec<NumberOrText>,
        from: Option<NumberOrText>,
        to: Option<NumberOrText>,
        /// The number of values of the range; only for the designs grid and zip.
        #[schema(minimum = 2, maximum = 100_000)]
        count: Option<u32>,
        spacing: Option<Spacing>,
        distribution: Option<Distribution>,
    }

    /// The name of a distribution with its parameters, in the unit of the number.
    #[schema(min_properties = 1, max_properties = 1)]
    Distribution {
        uniform: Option<UniformDistribution>,
        log_uniform: Option<UniformDistribution>,
        normal: Option<NormalDistribution>,
        lognormal: Option<LognormalDistribution>,
        triangular: Option<TriangularDistribution>,
    }

    UniformDistribution {
        low: NumberOrText,
        high: NumberOrText,
    }

    NormalDistribution {
        mean: NumberOrText,
        standard_deviation: NumberOrText,
    }

    /// Of its mean and standard deviation, or of its median and the factor by which one standard deviation of the logarithm multiplies it.
    LognormalDistribution {
        mean: Option<NumberOrText>,
        standard_deviation: Option<NumberOrText>,
        median: Option<NumberOrText>,
        #[schema(exclusive_minimum = 1.0)]
        factor: Option<f64>,
    }

    TriangularDistribution {
        low: NumberOrText,
        mode: NumberOrText,
        high: NumberOrText,
    }

    /// A sensitivity study: which numbers of a scenario matter for its outputs.
    Sensitivity {
        /// The version of the rules of studies, as in the result.
        #[schema(minimum = 1, maximum = 1)]
        version: Option<u32>,
        scenario: Scenario,
        /// The numbers that vary, each with a range or a distribution. For the method local, only their pointers.
        #[schema(min_items = 1, max_items = 100)]
        vary: Vec<Varied>,
        method: Option<SensitivityMethod>,
        /// For d numbers: how many groups of d + 2 points (sobol, best a power of two), or trajectories of d + 1 points (morris).
        #[schema(minimum = 2, maximum = 4_294_967_295_u32)]
        samples: Option<u32>,
        /// The random numbers depend on it alone; 0 by default.
        #[schema(maximum = 9_007_199_254_740_992_u64)]
        seed: Option<u64>,
        /// Share of the resamples that an interval contains; 0.95 by default.
        #[schema(minimum = 0.5, maximum = 0.999)]
        confidence: Option<f64>,
        /// What to take from each run, by the names of POST /v1/evaluate.
        #[schema(min_items = 1, max_items = 100)]
        outputs: BTreeSet<OutputName>,
    }

    /// A map over normal force and amplitude. Its scenario has both.
    FrettingMap {
        /// The version of the rules of studies, as in the result.
        #[schema(minimum = 1, maximum = 1)]
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
    Axis {
        from: Option<NumberOrText>,
        to: Option<NumberOrText>,
        #[schema(minimum = 2, maximum = 4096)]
        count: Option<u32>,
        spacing: Option<Spacing>,
        #[schema(required = false, min_items = 1, max_items = 4096)]
        values: Vec<NumberOrText>,
    }
}

/// A change of the label, the tags and the privacy of a job.
#[derive(ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Naming {
    /// The new label on one line, without control characters. Null removes the label.
    #[schema(min_length = 1, max_length = 200)]
    label: Option<String>,
    /// The new words to find the job by.
    #[schema(required = false, max_items = 20)]
    tags: BTreeSet<Tag>,
    /// Whether only the owner and administrators see the job.
    #[schema(nullable = false)]
    private: Option<bool>,
}

/// Numbers, each in SI or as a text with a unit.
#[derive(ToSchema)]
#[schema(min_items = 1, max_items = 1000)]
pub struct NumberList(Vec<NumberOrText>);
