//! What is wrong with results of earlier versions of the engine. docs/changed-answers.md lists it for users.

use fretwork_engine::scenario;
use serde_json::Value;

/// The version from which on nothing is known to be wrong.
const SOUND: u32 = 5;
/// Share of the contact radius above which a stick radius leaves a thin ring of slip.
const THIN: f64 = 0.95;

/// What is wrong with a result that this version of the numerics has computed for this canonical scenario or study.
pub fn doubt(numerics: u32, asked: &Value) -> Option<String> {
    let told =
        |reason| format!("An earlier version computed this result. {reason} Compute it again.");
    (numerics < SOUND).then(|| doubt_of_fit(asked).or_else(|| doubt_of_run(asked)))?.map(told)
}

fn doubt_of_fit(asked: &Value) -> Option<String> {
    let tests = asked["tests"].as_array()?;
    let mut data = tests.iter().filter_map(|test| test["data"].as_array()).flatten();
    let told = if data.any(|data| data["relative"].is_number()) {
        "It took relative errors from the measured numbers, so the estimates may be too small, by about twice the square of these \
         errors."
    } else {
        "It may have said that the law holds for two specimens that differ, or that there is no effect where a best value is at the \
         end of its range."
    };
    Some(told.to_owned())
}

/// What is wrong with a run, or with the runs of a study.
fn doubt_of_run(asked: &Value) -> Option<String> {
    let asked = asked.get("scenario").unwrap_or(asked);
    let (scenario, _) = scenario::check(asked, "").ok()?;
    let case = scenario.case().ok()?;
    let warnings = scenario.warnings(&case);
    let of_table =
        warnings.iter().find(|it| ["sparse_profile", "noisy_profile"].contains(&&*it.kind));
    if case.contact.stick > THIN {
        Some("In a thin ring of slip, its depths are up to 8 % too small, with a stated error of a third of that.".to_owned())
    } else if asked["profile"]["shape"] == "wedge" && asked["wear"]["bodies"].is_array() {
        Some("Where a layer is worn through at a tip, its depths are up to 3 % too small, without a warning.".to_owned())
    } else {
        of_table.map(|it| format!("It does not warn of its table. {}", it.detail))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// A wedge, of whose contact this share sticks.
    fn wedge(stick_ratio: f64, wear: &Value) -> Value {
        json!({
            "profile": {"shape": "wedge", "slope_angle": 0.05, "length": 0.01}, "moduli": {"normal": 1e11}, "friction": 0.6,
            "wear": wear, "load": {"normal_force": 1000}, "motion": {"stick_ratio": stick_ratio, "reference_distance": 0.1},
            "cycles": [1000],
        })
    }

    #[test]
    fn earlier_results_of_affected_kinds_are_doubted() {
        let plain = json!({"coefficient": 1e-14});
        let layers = json!({"bodies": [
            {"coefficient": 1e-14, "layers": [{"thickness": 1e-6, "coefficient": 1e-13}]}, {"coefficient": 1e-14},
        ]});
        let told = |asked: &Value| doubt(4, asked).unwrap_or_default();
        assert!(told(&wedge(0.98, &plain)).contains("thin ring of slip"));
        assert!(told(&json!({"scenario": wedge(0.5, &layers)})).contains("worn through"));
        assert_eq!(doubt(4, &wedge(0.5, &plain)), None);
        assert_eq!(doubt(5, &wedge(0.98, &plain)), None);
        let fit = |noise: &str| json!({"scenario": wedge(0.5, &plain), "tests": [{"data": [{noise: 0.1}]}]});
        assert!(told(&fit("relative")).contains("measured numbers"));
        assert!(told(&fit("sigma")).contains("two specimens"));
    }
}
