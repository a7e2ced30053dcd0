//! The warning about a large numerical error.

use crate::case::{Case, Method};
use crate::scenario::Warning;
use crate::solver::errors::RunErrors;

/// Estimated relative error above which a run has a warning: 2 % less half a percent of itself, because few estimates are a little
/// too small.
const LARGE: f64 = 0.0199;

/// A warning about the largest errors of a run, if one of them exceeds the limit.
pub(super) fn warning(case: &Case, errors: Option<RunErrors>) -> Option<Warning> {
    let RunErrors { volume, depth } = errors?;
    if volume.max(depth) <= LARGE {
        return None;
    }
    let percent = |error: f64| (100.0 * error).ceil();
    let what = match (volume > LARGE, depth > LARGE) {
        (true, true) => {
            let (volume, depth) = (percent(volume), percent(depth));
            format!("volume by up to {volume} %, the largest wear depth by up to {depth} %")
        }
        (true, false) => format!("volume by up to {} %", percent(volume)),
        (false, _) => format!("depth by up to {} %", percent(depth)),
    };
    let advice = match case.method {
        Method::Exact { .. } => "Enter a smaller `model.tolerance`",
        Method::Simplified { .. } if case.is_closed() => "Enter more `model.points`",
        Method::Simplified { .. } => "Use the exact method",
    };
    let detail = format!(
        "At some output cycles, numerical errors may change the wear {what}: see `wear_volume_error` and \
         `wear_depth_error` of the history. {advice}."
    );
    Some(Warning { kind: "numerical_error".into(), detail })
}
