//! The numerical error of the exact method over random scenarios of all kinds.

use std::fmt::{self, Display, Formatter};

use super::deviation::{Deviation, OutputError};
use super::page::digits;
use super::random_scenario::{COEFFICIENTS, HELD, MODES, RandomScenario, SHAPES};
use fretwork_random::Random;

/// Relative error above which a run must have a warning.
const LARGE: f64 = 0.02;
/// The names of the quantities and events that are compared once per run. The wear volume and depth are compared at
/// each output cycle.
const OTHERS: [&str; 4] = ["contact radius", "energy per cycle", "contact_lost", "shakedown"];

/// A quantity whose error the run states at each output cycle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Worn {
    /// The wear volume.
    Volume,
    /// The largest wear depth.
    Depth,
}

/// The errors of random runs. `Display` writes them as Markdown.
pub struct Accuracy {
    runs: Vec<(RandomScenario, Deviation)>,
}

/// The quantile of the values: a share `share` of them does not exceed it.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let index = (share * values.len() as f64).ceil() as usize;
    values[index.clamp(1, values.len()) - 1]
}

/// The median, the 95th percentile and the maximum of the errors, as cells of a table.
fn spread(errors: &[f64]) -> String {
    let at = |share| digits(100.0 * quantile(errors.to_vec(), share), 2);
    format!("{} | {} % | {} % | {} % |", errors.len(), at(0.5), at(0.95), at(1.0))
}

/// Statistics of the errors of one quantity at many output cycles.
pub struct OutputErrors(Vec<OutputError>);

impl OutputErrors {
    /// The quantile of the error: a share `share` of the outputs has no larger error.
    pub fn below(&self, share: f64) -> f64 {
        quantile(self.0.iter().map(|output| output.error).collect(), share)
    }

    /// The share of the outputs whose stated error is at least as large as the true error.
    pub fn covered(&self) -> f64 {
        let covered = self.0.iter().filter(|output| output.error <= output.stated);
        covered.count() as f64 / self.0.len() as f64
    }

    /// The median of the ratio of the stated error to the true error.
    pub fn caution(&self) -> f64 {
        quantile(self.0.iter().map(|output| output.stated / output.error).collect(), 0.5)
    }
}

impl Display for OutputErrors {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let errors: Vec<_> = self.0.iter().map(|output| output.error).collect();
        let (covered, caution) = (digits(100.0 * self.covered(), 3), digits(self.caution(), 2));
        write!(f, "{} {covered} % | {caution} |", spread(&errors))
    }
}

impl Accuracy {
    /// Computes `count` random scenarios.
    pub fn measured(count: usize, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut runs = Vec::new();
        while runs.len() < count {
            // Some random scenarios are refused, for example because the scar would outgrow the sphere.
            let Some(scenario) = RandomScenario::draw(&mut random) else { continue };
            let deviation = Deviation::of(&scenario.request);
            runs.extend(deviation.map(|deviation| (scenario, deviation)));
        }
        Self { runs }
    }

    /// The runs of the wanted scenarios alone.
    pub fn only(mut self, is_wanted: impl Fn(&RandomScenario) -> bool) -> Self {
        self.runs.retain(|(scenario, _)| is_wanted(scenario));
        self
    }

    /// The errors of a quantity at all output cycles.
    pub fn of(&self, worn: Worn) -> OutputErrors {
        self.among(worn, |_| true)
    }

    /// The errors of a quantity at all output cycles of the wanted scenarios.
    fn among(&self, worn: Worn, is_wanted: impl Fn(&RandomScenario) -> bool) -> OutputErrors {
        let some = self.runs.iter().filter(|(scenario, _)| is_wanted(scenario));
        let errors = some.flat_map(|(_, deviation)| match worn {
            Worn::Volume => &deviation.volume,
            Worn::Depth => &deviation.depth,
        });
        OutputErrors(errors.copied().collect())
    }

    /// The quantile of the error of one of `OTHERS`: a share `share` of the runs has no larger error. `None` if no
    /// run has this quantity or event.
    pub fn below(&self, other: &str, share: f64) -> Option<f64> {
        let errors = self.others(OTHERS.iter().position(|name| *name == other)?);
        (!errors.is_empty()).then(|| quantile(errors, share))
    }

    fn others(&self, index: usize) -> Vec<f64> {
        self.runs.iter().filter_map(|(_, deviation)| deviation.others[index]).collect()
    }

    /// The number of errors above 2 % in runs without a warning.
    pub fn unwarned(&self) -> usize {
        let runs = self.runs.iter().filter(|(_, deviation)| !deviation.is_warned);
        let errors = runs.flat_map(|(_, deviation)| deviation.outputs());
        errors.filter(|output| output.error > LARGE).count()
    }

    /// The number of runs in which no error exceeds 2 %, and the number of these runs that have a warning.
    pub fn sound(&self) -> (usize, usize) {
        let is_sound =
            |deviation: &Deviation| deviation.outputs().all(|output| output.error <= LARGE);
        let sound = || self.runs.iter().filter(|(_, deviation)| is_sound(deviation));
        (sound().count(), sound().filter(|(_, deviation)| deviation.is_warned).count())
    }

    /// A table of the errors of one quantity: all scenarios, then each kind of motion, then each shape.
    fn table(&self, f: &mut Formatter<'_>, title: &str, worn: Worn) -> fmt::Result {
        writeln!(f, "| {title} | outputs | median | 95 of 100 | largest | covered | caution |")?;
        writeln!(f, "|---|---:|---:|---:|---:|---:|---:|")?;
        let mut line = |what: &str, errors: OutputErrors| match errors.0.len() {
            0 => Ok(()),
            _ => writeln!(f, "| {what} | {errors}"),
        };
        line("all", self.of(worn))?;
        line("without blocks", self.among(worn, |scenario| !scenario.has_blocks()))?;
        for held in HELD {
            line(&format!("{held} held"), self.among(worn, |scenario| scenario.held == held))?;
            for mode in MODES {
                let some =
                    self.among(worn, |scenario| (scenario.held, scenario.mode) == (held, mode));
                line(&format!("{held}, {mode}"), some)?;
            }
        }
        for coefficients in COEFFICIENTS {
            let some = self.among(worn, |scenario| scenario.coefficients == coefficients);
            line(&format!("{coefficients} coefficients"), some)?;
        }
        line("thin rings", self.among(worn, |scenario| scenario.is_thin))?;
        SHAPES.iter().try_for_each(|shape| {
            line(shape, self.among(worn, |scenario| scenario.shape == *shape))
        })
    }
}

impl Display for Accuracy {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        self.table(f, "wear volume", Worn::Volume)?;
        writeln!(f)?;
        self.table(f, "wear depth", Worn::Depth)?;
        writeln!(f, "\n| other quantity | runs | median | 95 of 100 | largest |")?;
        writeln!(f, "|---|---:|---:|---:|---:|")?;
        for (index, name) in OTHERS.iter().enumerate() {
            let errors = self.others(index);
            if !errors.is_empty() {
                writeln!(f, "| {name} | {}", spread(&errors))?;
            }
        }
        let count = |is_wanted: &dyn Fn(&RandomScenario) -> bool| {
            self.runs.iter().filter(|(scenario, _)| is_wanted(scenario)).count()
        };
        let [layers, changing] =
            ["layers", "changing"].map(|kind| count(&|scenario| scenario.coefficients == kind));
        let (sound, warned) = self.sound();
        writeln!(
            f,
            "\nThese are {} runs, {} of them with blocks, {} of line contacts, {layers} with layers and {changing} with \
             coefficients that change. {} errors above 2 % have no warning. {warned} of {sound} runs without an error \
             above 2 % have a warning.",
            self.runs.len(),
            count(&RandomScenario::has_blocks),
            count(&|scenario| scenario.held == "line"),
            self.unwarned()
        )
    }
}
