//! The remarks of a fit: what the data cannot tell, and whether one set of parameters describes them.

use serde_json::{Value, json};

use super::interval::Side;
use super::model::{Parameter, Set};
use super::search::{FitRow, Task};
use super::told::{MANY, Repeats, Told};
use crate::stats::fisher;
use crate::stats::measured::Direction;

/// A deviation with a smaller probability than this is told.
const IMPROBABLE: f64 = 0.01;
/// Residuals are told if they are this many times as large as the stated noise, however few the points are.
const LARGE: f64 = 3.0;
/// Estimated noise above this share of the numbers is told.
const WIDE_SCATTER: f64 = 0.3;
/// Exponents of a combination nearer to 1 than this count as 1.
const ABOUT_ONE: f64 = 0.15;
/// Numbers that are this many powers of ten off can have another unit. The units, and their logarithms.
const OTHER_UNIT: f64 = 4.5;
const VOLUMES: [(&str, f64); 4] = [("m^3", 0.0), ("cm^3", -6.0), ("mm^3", -9.0), ("um^3", -18.0)];
const MASSES: [(&str, f64); 3] = [("kg", 0.0), ("mg", -6.0), ("ug", -9.0)];

/// The kind of a remark, and its text.
type Remark = (&'static str, String);

/// A probability in a text.
fn in_words(probability: f64) -> String {
    if probability < 1e-6 { "below 1e-6".to_owned() } else { format!("{probability:.1e}") }
}

/// The parameters that a direction changes, and its parts.
fn parts(direction: &Direction) -> Vec<(usize, f64)> {
    direction.iter().copied().enumerate().filter(|(_, part)| *part != 0.0).collect()
}

/// That the points scatter more around the fit than repeated tests.
fn worse_than_repeats(repeats: Option<Repeats>) -> Option<Remark> {
    let Repeats { statistic, probability, .. } =
        repeats.filter(|it| it.probability < IMPROBABLE)?;
    let probability = in_words(probability);
    let detail = format!(
        "The fit is worse than repeated tests allow (F = {statistic:.1}, probability {probability})."
    );
    Some(("lack_of_fit", detail))
}

impl Told<'_> {
    /// All remarks, the most important one first.
    pub fn notes(&self) -> Value {
        let (repeats, open) = (self.repeats(), &self.information.undetermined);
        let first = [
            self.magnitude(),
            self.misfit(repeats),
            self.disagreement(),
            self.discrepancy(),
            self.other_minimum(),
        ];
        // A parameter at an end of its range is told below.
        let is_at_end =
            |it: &Direction| matches!(parts(it)[..], [(place, _)] if self.is_at_bound(place));
        let undetermined = open.iter().filter(|it| !is_at_end(it));
        let undetermined = undetermined.map(|it| ("undetermined", self.in_words(it)));
        let prior = |it| ("prior", format!("{} The rest follows from priors.", self.in_words(it)));
        let priors = self.alone.undetermined.iter().filter(|_| open.is_empty()).map(prior);
        let ends = (0..self.fit.parameters.len()).filter_map(|place| self.end(place));
        let last = [worse_than_repeats(repeats), self.clusters(), self.lower_minimum()];
        let notes = first.into_iter().flatten().chain(undetermined).chain(priors).chain(ends);
        let notes = notes.chain(last.into_iter().flatten());
        notes.map(|(kind, detail)| json!({"kind": kind, "detail": detail})).collect()
    }

    /// What the data cannot tell.
    fn in_words(&self, direction: &Direction) -> String {
        let (parts, name) = (parts(direction), |place: usize| self.fit.parameters[place].name());
        match parts[..] {
            [(place, _)] if self.has_effect(place) => {
                format!("The errors of these data are too large to determine `{}`.", name(place))
            }
            [(place, _)] => {
                let is_worn = |set: &&Set| set.are_depths().is_some();
                let mut runs =
                    self.fit.sets.iter().filter(is_worn).filter_map(|it| it.runs.as_ref());
                let has_stopped =
                    runs.any(|it| it.rescaled.map(|own| it.parameters[own]) == Some(place));
                let reason = if has_stopped { ": wear has stopped" } else { "" };
                format!("`{}` has almost no effect on these data{reason}.", name(place))
            }
            [(one, first), (other, second)] => {
                // The product of powers that does not change along the direction.
                let power = -first / second;
                let sign = if power < 0.0 { "/" } else { "·" };
                let is_one = (power.abs() - 1.0).abs() < ABOUT_ONE;
                let power = if is_one { String::new() } else { format!("^{:.2}", power.abs()) };
                let (one, other) = (name(one), name(other));
                let kept = format!("`{one}{sign}{other}{power}`");
                if self.alone.undetermined.len() == 1 {
                    return format!("These data determine only {kept}.");
                }
                format!("Changes of `{one}` and `{other}` that keep {kept} have almost no effect.")
            }
            _ => {
                let names: Vec<_> =
                    parts.iter().map(|(it, _)| format!("`{}`", name(*it))).collect();
                let shares: Vec<_> = parts.iter().map(|(_, part)| format!("{part:.2}")).collect();
                let (names, shares) = (names.join(", "), shares.join(" : "));
                format!(
                    "Relative changes of {names} in the proportion {shares} have almost no effect together."
                )
            }
        }
    }

    /// That the best value of a parameter is at an end of its range, or that its interval has no end.
    fn end(&self, place: usize) -> Option<Remark> {
        let parameter @ Parameter { low, high, .. } = &self.fit.parameters[place];
        let name = parameter.name();
        let mut open = self.sides[place].iter().filter(|side| side.end().is_none());
        if self.is_at_bound(place) {
            let is_high = parameter.coordinate(self.best.theta[place]) > 0.5;
            let (end, side) = if is_high { (high, "high") } else { (low, "low") };
            let detail = format!(
                "The best value of `{name}` is at the {side} end {end:e} of its range. Widen the range."
            );
            return Some(("at_bound", detail));
        }
        if self.information.is_open(place) || open.clone().next().is_none() {
            return None;
        }
        let detail = if open.all(Side::reaches_bound) {
            format!(
                "The interval of `{name}` reaches an end of its range from {low:e} to {high:e}."
            )
        } else {
            format!(
                "An end of the interval of `{name}` was not found. Enter a narrower range than {low:e} to {high:e}."
            )
        };
        Some(("open_interval", detail))
    }

    /// How the points of a specimen count.
    fn clusters(&self) -> Option<Remark> {
        let (points, count) = (self.points().count(), self.known.measured.count(None));
        let detail = if !self.known.measured.is_clustered {
            "There are not more specimens than parameters, so each point counts as independent. The intervals do not \
             contain the scatter between specimens."
                .to_owned()
        } else if count < points as f64 - 0.5 {
            format!(
                "The points of one specimen or profile count as one: {points} points count as {count:.0}."
            )
        } else {
            return None;
        };
        Some(("clusters", detail))
    }

    /// That a search for an interval has found a better minimum.
    fn lower_minimum(&self) -> Option<Remark> {
        let is_profile = |task: &Task| matches!(task, Task::Profile { .. });
        let mut own = self.fit.tasks.iter().zip(&self.known.rows).filter(|it| is_profile(&it.0.1));
        let detail =
            "A search for an interval has found a smaller sum of squares. Enter more `starts`.";
        let is_lower = own.any(|(_, row)| row.sum < self.best.sum - 1.0);
        is_lower.then(|| ("other_minimum", detail.to_owned()))
    }

    /// What is said of the outliers.
    fn disagreement(&self) -> Option<Remark> {
        let word = |place: &usize| {
            let (set, size) = (self.fit.set(*place), self.studentized[place].abs());
            let (x, test) = (self.fit.x(*place), &self.fit.tests[set.test]);
            format!("{} of {test} at {x} ({size:.1} standard deviations)", set.output)
        };
        let words = self.outliers.iter().map(word).collect::<Vec<_>>().join("; ");
        let told =
            format!("These numbers disagree with the fit of all others: {words}. Check them.");
        (!words.is_empty()).then_some(("outliers", told))
    }

    /// The units that the volumes or masses seem to have, if they are many powers of ten from those at the first start.
    fn magnitude(&self) -> Option<Remark> {
        let place = self.fit.parameters.iter().position(|it| it.pointer.starts_with("/wear/"))?;
        let is_volume = |it: &usize| self.fit.set(*it).are_depths() == Some(false);
        let unit = self.fit.set(self.points().map(|it| it.0).find(is_volume)?).unit;
        let units = if unit == "kg" { &MASSES[..] } else { &VOLUMES };
        let size = libm::log10(self.known.rows[0].error);
        let question = |(read, power): &(&str, f64)| {
            let others = units.iter().map(|it| (it.0, (it.1 - power + size).abs()));
            let (likely, distance) = others.min_by(|a, b| a.1.total_cmp(&b.1))?;
            let told = format!(" Are they in {likely} instead of {read}?");
            (likely != *read && distance < 3.0).then_some(told)
        };
        let told = format!(
            "The measured numbers are about 1e{size:.0} times those that `{}` = {:e} gives.{} Enter their unit.",
            self.fit.parameters[place].name(),
            self.fit.starts[0][place],
            units.iter().filter_map(question).collect::<String>()
        );
        (size.abs() > OTHER_UNIT).then_some(("magnitude", told))
    }

    /// That a start has led to another minimum that describes the data about as well.
    fn other_minimum(&self) -> Option<Remark> {
        let other = self.sides.iter().flatten().find(|side| side.is_other)?.base;
        let words = |row: &FitRow| {
            let values = self.fit.parameters.iter().zip(&row.theta);
            let values = values.map(|(it, x)| format!("`{}` = {x:.3e}", it.name()));
            values.collect::<Vec<_>>().join(", ")
        };
        let told = format!(
            "Two minima describe the data about as well: {}; and {}. The intervals contain both. Enter a range around \
             those that you expect, or more data.",
            words(self.best),
            words(other)
        );
        Some(("other_minimum", told))
    }

    /// How much larger the residuals are than the stated noise, if they are larger than chance allows, with the probability.
    /// Without degrees of freedom, there is none.
    fn excess(&self) -> Option<(f64, Option<f64>)> {
        let squares: f64 = self.judges.values().map(|residual| residual * residual).sum();
        let size = (squares / self.judges.len() as f64).sqrt();
        let freedom = self.freedom();
        let ratio = (freedom >= 1.0).then(|| self.sum / freedom);
        let probability = ratio.map(|ratio| fisher::above(ratio, (freedom, MANY)));
        let is_told = size >= LARGE || probability.is_some_and(|it| it < IMPROBABLE);
        Some((ratio.map_or(size, |ratio| ratio.sqrt().max(size)), probability))
            .filter(|_| is_told && self.known.measured.freedom().is_none())
    }

    /// Whether the residuals are larger than the noise, and whether the law is the reason. It is not if repeated tests scatter
    /// more than stated, and as much.
    fn misfit(&self, repeats: Option<Repeats>) -> Option<Remark> {
        if let Some((size, probability)) = self.excess() {
            let as_far = repeats.filter(|it| it.probability >= IMPROBABLE);
            if let Some(excess) = as_far.and_then(|it| it.excess) {
                let told = format!(
                    "Repeated tests scatter more than their stated errors allow. State errors that are {excess:.1} times as large."
                );
                return Some(("scatter", told));
            }
            let probability = probability.map(|it| format!(" (probability {})", in_words(it)));
            let told = format!(
                "One set of parameters does not describe these tests within their stated errors: the residuals are \
                 {size:.1} times as large{}.",
                probability.unwrap_or_default()
            );
            return Some(("misfit", told));
        }
        let estimated = (0..self.fit.sets.len()).filter(|set| self.fit.sets[*set].is_estimated);
        let (set, share) =
            estimated.map(|set| (set, self.share(set))).find(|it| it.1 > WIDE_SCATTER)?;
        let told = format!(
            "`{}` scatters by {:.0} % around the fit. Repeated tests would tell whether the law is the reason.",
            self.fit.sets[set].output,
            100.0 * share
        );
        let is_at_bound = (0..self.fit.parameters.len()).any(|place| self.is_at_bound(place));
        Some(("scatter", told)).filter(|_| repeats.is_none() && !is_at_bound)
    }

    /// The coefficient from volumes alone and from depths alone, if their intervals do not overlap.
    fn discrepancy(&self) -> Option<Remark> {
        let place = self.fit.coefficient?;
        let slopes = &self.fit.derivatives(self.known)[place].numbers;
        let interval = |are_depths: bool| {
            let own =
                self.points().filter(|it| self.fit.set(it.0).are_depths() == Some(are_depths));
            let effects =
                own.map(|(it, point)| slopes[it] * point.weight.sqrt() / self.deviation(it));
            let square: f64 = effects.map(|effect| effect * effect).sum();
            let half = self.fit.rise(self.known) / square.sqrt();
            let only = Task::Only { are_depths };
            let row = self.fit.tasks.iter().position(|(_, task)| *task == only)?;
            let x = Some(self.known.rows[row].theta[place]).filter(|x| x.is_finite())?;
            Some([0.0, -half, half].map(|half| x * libm::exp(half)))
        };
        let ([v, v_low, v_high], [d, d_low, d_high]) = (interval(false)?, interval(true)?);
        let told = format!(
            "One coefficient does not describe these tests: `{}` is {v:.2e} ({v_low:.2e} to {v_high:.2e}) from volumes \
             alone, and {d:.2e} ({d_low:.2e} to {d_high:.2e}) from depths alone.",
            self.fit.parameters[place].name()
        );
        (v_low > d_high || d_low > v_high).then_some(("discrepancy", told))
    }
}
