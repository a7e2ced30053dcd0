//! Whether the law of a fit describes its data. This is computed whenever it is read: stored results do not contain it.

use std::collections::BTreeMap;

use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::figure::words::capital;
use super::notation::percent;
use super::{Document, Result, View, digits};
use fretwork_job::earlier;
use fretwork_study::stats::trend::{LEAST, Trend, trend};

/// The verdict mentions a trend if independent residuals would show it with at most this probability in any of the sets of data.
const SIGNIFICANT: f64 = 0.05;
/// Residuals up to this share of the numbers can be numerical errors.
const NUMERICAL: f64 = 1e-3;
/// Outputs that do not depend on wear alone.
const FRICTIONAL: [&str; 4] =
    ["energy_per_cycle", "dissipated_energy", "normal_force", "tangential_force"];

/// Whether the law of a fit describes its data.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
#[schema(as = VerdictAnswer)]
pub struct Verdict {
    /// `holds`, perhaps but for numbers that the verdict names; `fails`: the residuals are too large; `trend`: they follow a
    /// curve; or `untested`.
    pub outcome: &'static str,
    /// A sentence that names the law.
    pub verdict: String,
    /// Why. Names of numbers stand between grave accents, and numbers are in SI.
    pub reason: String,
    /// What to say beside each interval; null if the law may hold and no number disagrees.
    pub intervals: Option<&'static str>,
}

impl Verdict {
    /// The verdict of a stored fit; `None` if the result is not a fit.
    ///
    /// # Errors
    /// The bytes are not a result.
    pub fn read(stored: &[u8]) -> Result<Option<Self>> {
        Self::of(&Document::open(stored, &View::default())?)
    }

    /// The verdict of a fit in SI.
    pub(crate) fn of(document: &Document<'_>) -> Result<Option<Self>> {
        let fit = document.value("fit")?;
        if fit.is_null() {
            return Ok(None);
        }
        let [quality, notes, parameters] =
            ["quality", "notes", "parameters"].map(|name| document.value(name));
        let (quality, notes, parameters) = (quality?, notes?, parameters?);
        let earlier = earlier::doubt(document.head.engine.numerics, &fit);
        let detail = |note: &Value| note["detail"].as_str().unwrap_or_default().to_owned();
        let disagreeing = items(&notes).find(|note| note["kind"] == "outliers").map(detail);
        let told = |outcome, verdict: String, mut reason: String| {
            reason.extend(disagreeing.iter().chain(&earlier).flat_map(|it| [" ", it]));
            let intervals = match outcome {
                _ if quality.is_null() => None,
                "fails" | "trend" => Some("The interval assumes that the law holds."),
                _ => disagreeing.as_ref().map(|_| "The interval counts numbers that disagree."),
            };
            Ok(Some(Self { outcome, verdict, reason, intervals }))
        };
        if quality.is_null() {
            let reason = items(&notes).next().map(detail).unwrap_or_default();
            return told("fails", "The fit found no minimum.".to_owned(), reason);
        }
        let table = document.value("table")?;
        let parameters = parameters.as_array().map_or(&[][..], Vec::as_slice);
        let (law, errors) = (law(&fit["scenario"], parameters, &table), errors(&fit["tests"]));
        let number = |name: &str| quality[name].as_f64().unwrap_or(f64::NAN);
        let freedom = (number("effective_points") - parameters.len() as f64).floor();
        let trend = if freedom < 1.0 { String::new() } else { trends(&table) };
        let against =
            items(&notes).filter(|note| is_in_verdict(note) && note["kind"] != "outliers");
        let against: Vec<String> = against.map(detail).collect();
        if !against.is_empty() {
            let reason = against.join(" ").replace("their stated errors", &errors) + &trend;
            let verdict = format!("{} does not hold for these data.", capital(&law));
            return told("fails", verdict, reason);
        }
        if freedom < 1.0 {
            let reason = "There are not more points than estimated numbers.".to_owned();
            return told("untested", format!("The data cannot test {law}."), reason);
        }
        let ratio = digits((number("sum_of_squares") / freedom).sqrt(), 2);
        let ratio = if ratio == "1" { String::new() } else { format!("{ratio} times ") };
        let is_estimated = !quality["degrees_of_freedom"].is_null();
        let is_repeated = !quality["lack_of_fit"].is_null();
        let name = capital(&law);
        let but = match document.value("outliers")?.as_array().map_or(0, Vec::len) {
            0 => String::new(),
            1 => " except one number".to_owned(),
            count => format!(" except {count} numbers"),
        };
        if !trend.is_empty() {
            let mut reason = trend.trim_start().to_owned();
            let is_scattered = items(&notes).any(|note| note["kind"] == "scatter");
            if !is_estimated && !is_scattered && but.is_empty() {
                reason += " Their size alone gives no reason for doubt: they are ";
                reason += &[&ratio, "as large as ", &errors, "."].concat();
            }
            reason += " Possible reasons: a run-in, a coefficient that changes, or a wrong input.";
            told("trend", format!("{name} does not have the shape of these data."), reason)
        } else if is_repeated {
            let reason = "The scatter of the repeated tests explains how far their means are from the curve.";
            told("holds", format!("{name} describes these data{but}."), reason.to_owned())
        } else if is_estimated {
            let reason = "Their errors were estimated from the scatter around its own curve. Errors of the measurements, or repeated \
                          tests, would test it.";
            told("untested", format!("The data do not test {law}."), reason.to_owned())
        } else {
            let condition = if errors == STATED { "" } else { " if their errors are as assumed" };
            let size = if but.is_empty() {
                format!("The residuals are {ratio}as large as {errors}.")
            } else {
                format!("{} allow the other residuals.", capital(&errors))
            };
            told("holds", format!("{name} describes these data{but}{condition}."), size)
        }
    }
}

/// The items of a list; none if it is missing.
pub fn items(list: &Value) -> impl Iterator<Item = &Value> {
    list.as_array().into_iter().flatten()
}

/// Whether the verdict contains a note of a fit: that there is no minimum, or that the law does not describe the data.
pub fn is_in_verdict(note: &Value) -> bool {
    let kinds = ["no_minimum", "misfit", "lack_of_fit", "discrepancy", "outliers"];
    kinds.iter().any(|kind| note["kind"] == *kind)
}

const STATED: &str = "the stated errors";

/// The name of the law, as in the middle of a sentence.
fn law(scenario: &Value, parameters: &[Value], table: &Value) -> String {
    if items(&table["output"]).filter_map(Value::as_str).all(|it| FRICTIONAL.contains(&it)) {
        return "the simulation".to_owned();
    }
    let wear = &scenario["wear"];
    let is_own = |parameter: &Value| {
        let pointer = parameter["pointer"].as_str().unwrap_or_default();
        pointer.starts_with("/wear/") && !parameter["for"].is_null()
    };
    let number = if parameters.iter().any(is_own) {
        "a wear coefficient for each test"
    } else if !wear["bodies"].is_null() {
        "the wear coefficients of both bodies"
    } else if wear["coefficient"].is_object() {
        "a changing wear coefficient"
    } else {
        "one wear coefficient"
    };
    let is_energy = !wear["energy_coefficient"].is_null();
    let name = if is_energy { "the law of the dissipated energy" } else { "Archard's law" };
    format!("{name} with {number}")
}

/// What the standard deviations of the data are. A relative error is usually assumed.
fn errors(tests: &Value) -> String {
    let data = items(tests).flat_map(|test| items(&test["data"]));
    let share = |data: &Value| data["relative"].as_f64().or(data["noise"]["relative"].as_f64());
    let shares = data.map(|data| share(data).filter(|_| data.get("sigma").is_none()));
    let shares: Vec<Option<f64>> = shares.collect();
    match shares[..] {
        [Some(share), ..] if shares.iter().all(|other| *other == Some(share)) => {
            format!("the assumed errors of {}", percent(share, 3))
        }
        _ if shares.iter().all(Option::is_none) => STATED.to_owned(),
        _ => "the stated and assumed errors".to_owned(),
    }
}

/// A sentence for each set of data whose residuals follow a curve.
fn trends(table: &Value) -> String {
    let mut sets = BTreeMap::<[&str; 3], Vec<[f64; 4]>>::new();
    for row in 0..table["x"].as_array().map_or(0, Vec::len) {
        let names =
            ["test", "output", "over"].map(|name| table[name][row].as_str().unwrap_or_default());
        let numbers = ["x", "residual", "measured", "predicted"]
            .map(|name| table[name][row].as_f64().unwrap_or(f64::NAN));
        // Neighbours in a profile are not independent.
        if numbers.iter().all(|number| number.is_finite()) && names[2] != "radius" {
            sets.entry(names).or_default().push(numbers);
        }
    }
    let tested: Vec<_> =
        sets.iter().filter_map(|(names, rows)| Some((names, trend(&residuals(rows)?)?))).collect();
    let found =
        tested.iter().filter(|(_, trend)| trend.probability * tested.len() as f64 <= SIGNIFICANT);
    let words = |(names, trend): &(&[&str; 3], _)| {
        let Trend { probability, is_arc, is_up } = *trend;
        let over = if names[2] == "cycles" { "cycles" } else { "dissipated energy" };
        let of = if sets.len() > 1 { format!(" of {}", names[0]) } else { String::new() };
        let shape = match (is_arc, is_up) {
            (true, true) => "follow an arc: low at both ends, high between",
            (true, false) => "follow an arc: high at both ends, low between",
            (false, true) => "rise along the axis: low at the start, high at the end",
            (false, false) => "fall along the axis: high at the start, low at the end",
        };
        let shape = shape.replace("along the axis", &format!("with the {over}"));
        let less = if probability < 1e-4 { "less than " } else { "" };
        let probability = percent(probability.max(1e-4), if less.is_empty() { 2 } else { 1 });
        format!(
            " The residuals{of} {shape}. A law with this shape cannot describe them. Independent errors would do the same with a \
                 probability of {less}{probability}."
        )
    };
    found.map(words).collect()
}

/// The residuals along the axis, with the mean of those at one place; `None` if they are too few or can be numerical errors.
fn residuals(rows: &[[f64; 4]]) -> Option<Vec<f64>> {
    let square =
        |of: &dyn Fn(&[f64; 4]) -> f64| rows.iter().map(|row| of(row) * of(row)).sum::<f64>();
    let is_numerical =
        square(&|row| row[2] - row[3]) < NUMERICAL * NUMERICAL * square(&|row| row[3]);
    let mut rows = rows.to_vec();
    rows.sort_by(|one, other| one[0].total_cmp(&other[0]));
    let mean = |rows: &[[f64; 4]]| rows.iter().map(|row| row[1]).sum::<f64>() / rows.len() as f64;
    let along: Vec<f64> =
        rows.chunk_by(|one, next| one[0].total_cmp(&next[0]).is_eq()).map(mean).collect();
    Some(along).filter(|along| along.len() >= LEAST && !is_numerical)
}
