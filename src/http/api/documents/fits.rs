//! The fit of numbers of a scenario to measurements.

use std::collections::BTreeMap;

use serde_json::Value;
use utoipa::ToSchema;

use crate::http::wire::schemas::{
    Loss, MeasuredCell, MeasuredOver, MeasuredProfile, MeasuredSet, Noise, NoiseKind, NumberOrText,
    Scenario, Sigma, Spacing,
};

bodies! {
    /// A fit of numbers of a scenario to measurements.
    Fit {
        /// The version of the rules of studies, as in the result.
        #[schema(minimum = 1, maximum = 1)]
        version: Option<u32>,
        scenario: Scenario,
        #[schema(min_items = 1, max_items = 20)]
        parameters: Vec<FitParameter>,
        #[schema(min_items = 1, max_items = 200)]
        tests: Vec<FitTest>,
        /// The probability of all intervals; 0.95 by default.
        #[schema(minimum = 0.5, maximum = 0.9999)]
        confidence: Option<f64>,
        /// The number of searches from different values; 8 by default.
        #[schema(minimum = 1, maximum = 64)]
        starts: Option<u32>,
        loss: Option<Loss>,
        /// Pointers of measured numbers that are left out, such as `/tests/0/data/0/y/2`.
        #[schema(required = false)]
        without: Vec<String>,
    }

    /// A number of the scenario that is estimated.
    FitParameter {
        /// The JSON pointer of the number in the scenario.
        #[schema(example = "/wear/coefficient")]
        pointer: String,
        /// The smallest value.
        from: NumberOrText,
        /// The largest value.
        to: NumberOrText,
        /// `log` for numbers whose order of magnitude is not known.
        spacing: Option<Spacing>,
        /// Where the first search begins. The default is the value in the scenario.
        start: Option<NumberOrText>,
        /// The tests to which it belongs. The default is all.
        #[schema(rename = "for", required = false, min_items = 1)]
        tests: Vec<String>,
        /// What is known beforehand.
        #[schema(value_type = Object, required = false, example = json!({"normal": {"mean": 0.7, "standard_deviation": 0.1}}))]
        prior: Value,
    }

    /// A test: how its scenario differs, and what was measured.
    FitTest {
        /// Its name. The default is its number.
        name: Option<String>,
        /// The name of its specimen. All points of a specimen count as one.
        specimen: Option<String>,
        /// New values of members of the scenario, by their JSON pointers.
        #[schema(value_type = Object, required = false, example = json!({"/motion/amplitude": "50 um"}))]
        changes: BTreeMap<String, Value>,
        #[schema(min_items = 1)]
        data: Vec<MeasuredSet>,
    }

    /// Measured numbers over cycles or dissipated energies.
    MeasuredPoints {
        /// A column of the history, or `mass_loss`.
        #[schema(example = "wear_volume")]
        output: String,
        over: Option<MeasuredOver>,
        /// Numbers of cycles, or dissipated energies.
        #[schema(min_items = 1, max_items = 2000)]
        x: Vec<NumberOrText>,
        /// The measured numbers. Null asks only for a prediction.
        #[schema(min_items = 1, max_items = 2000)]
        y: Vec<MeasuredCell>,
        /// The density in kg/m³, for `mass_loss` in kg.
        #[schema(exclusive_minimum = 0.0)]
        density: Option<f64>,
        sigma: Option<Sigma>,
        /// The standard deviation of the noise as a share of the true number, for which the prediction stands.
        #[schema(exclusive_minimum = 0.0, maximum = 1.0)]
        relative: Option<f64>,
        noise: Option<Noise>,
    }

    /// The measured depth of a scar.
    WearProfile {
        profile: MeasuredProfile,
        /// The number of cycles of the profile.
        #[schema(exclusive_minimum = 0.0)]
        at: f64,
        /// The body whose wear it is, if the scenario shares the wear: 1 carries the profile. Without it, the wear is that of both.
        #[schema(minimum = 1, maximum = 2)]
        body: Option<u8>,
        /// Distances from the centre.
        #[schema(min_items = 1, max_items = 2000)]
        radius: Vec<NumberOrText>,
        /// The measured depths.
        #[schema(min_items = 1, max_items = 2000)]
        depth: Vec<MeasuredCell>,
        sigma: Option<Sigma>,
        /// The standard deviation of the noise as a share of the true number, for which the prediction stands.
        #[schema(exclusive_minimum = 0.0, maximum = 1.0)]
        relative: Option<f64>,
        noise: Option<Noise>,
    }

    /// Noise that is a share of the true number.
    RelativeNoise {
        #[schema(exclusive_minimum = 0.0, maximum = 1.0)]
        relative: Option<f64>,
        kind: Option<NoiseKind>,
    }
}
