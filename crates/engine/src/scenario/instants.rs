//! The output cycles in canonical form, and the output cycles with profiles.

use serde::Serialize;

use crate::case::{EnergyOutputs, Outputs, Scales};
use crate::input::{Cycles, Faults, LAST_CYCLE, Measure, ProfilesAt, ProfilesWord, Valid};
use crate::numeric::twelve_digits;

/// If there are at most this many output cycles, all of them have profiles by default. With more,
/// only the last one has profiles.
pub const DEFAULT_PROFILES: usize = 20;

/// The output cycles in canonical form.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub(super) enum CanonicalCycles {
    Cycles(Vec<f64>),
    /// Only the run can find the cycles at which these energies are dissipated.
    Energies {
        dissipated_energy: Vec<f64>,
    },
}

impl CanonicalCycles {
    /// The outputs of a case. A run for energies ends at `horizon` at the latest. `expected` estimates the
    /// time at which it reaches an energy.
    pub(super) fn outputs(
        &self,
        scales: &Scales,
        horizon: f64,
        expected: impl Fn(f64) -> f64,
    ) -> Outputs {
        let from_start = |list: &[f64], convert: &dyn Fn(f64) -> f64| -> Vec<f64> {
            let unworn = (list[0] > 0.0).then_some(0.0);
            unworn.into_iter().chain(list.iter().map(|number| convert(*number))).collect()
        };
        match self {
            Self::Cycles(cycles) => Outputs::Cycles(from_start(cycles, &|n| n)),
            Self::Energies { dissipated_energy } => {
                let energies = from_start(dissipated_energy, &|energy| scales.worn_by(energy));
                let expected = expected(energies[energies.len() - 1]);
                Outputs::Energies(EnergyOutputs { energies, horizon, expected })
            }
        }
    }
}

/// Converts the output cycles of a request, and the choice of profiles, to canonical form.
pub(super) fn canonical(
    cycles: &Cycles,
    profiles_at: Option<&ProfilesAt>,
    unit: f64,
) -> Valid<(CanonicalCycles, ProfilesAt)> {
    if cycles.measure != Measure::DissipatedEnergy {
        let (list, profiles_at) = numbers_and_profiles(cycles, profiles_at, unit)?;
        return Ok((CanonicalCycles::Cycles(list), profiles_at));
    }
    if let Some(ProfilesAt::At(_)) = profiles_at {
        let detail = "cannot list output cycles if `cycles` contains `dissipated_energy`, because only the run \
                      finds the cycles that reach these energies. Enter \"all\", \"last\" or \"none\"";
        return Err(Faults::one("/profiles_at", detail));
    }
    let (list, profiles_at) = numbers_and_profiles(cycles, profiles_at, 1.0)?;
    Ok((CanonicalCycles::Energies { dissipated_energy: list }, profiles_at))
}

/// The numbers that define the output cycles, and which of them have profiles.
fn numbers_and_profiles(
    cycles: &Cycles,
    profiles_at: Option<&ProfilesAt>,
    unit: f64,
) -> Valid<(Vec<f64>, ProfilesAt)> {
    let normalized = cycles.measure == Measure::Normalized;
    let convert = |n: f64| if normalized { twelve_digits(n * unit) } else { n };
    let given = &cycles.instants;
    let mut list: Vec<f64> = given.iter().map(|n| convert(*n)).collect();
    if let Some(too_large) = list.iter().find(|n| normalized && **n > LAST_CYCLE) {
        let detail = format!(
            "contains an output cycle of {too_large:e} cycles (N₀ = {unit:.3e}). The limit is \
             {LAST_CYCLE:e} cycles. Enter smaller numbers"
        );
        return Err(Faults::one("/cycles/normalized", detail));
    }
    if list.windows(2).any(|pair| pair[0] >= pair[1]) {
        let detail =
            "contains two output cycles that are equal to 12 digits after multiplication by N₀. \
                      Remove one of them"
                .to_owned();
        return Err(Faults::one("/cycles/normalized", detail));
    }
    // Every run starts at cycle 0, so the canonical form omits it.
    if list.len() > 1 && list[0] == 0.0 {
        list.remove(0);
    }
    let word = |word| Ok((list.clone(), ProfilesAt::Word(word)));
    let wanted = match profiles_at {
        None if list.len() <= DEFAULT_PROFILES => return word(ProfilesWord::All),
        None | Some(ProfilesAt::Word(ProfilesWord::Last)) if list.len() > 1 => {
            return word(ProfilesWord::Last);
        }
        None | Some(ProfilesAt::Word(ProfilesWord::All | ProfilesWord::Last)) => {
            return word(ProfilesWord::All);
        }
        Some(ProfilesAt::Word(ProfilesWord::None)) => return word(ProfilesWord::None),
        Some(ProfilesAt::At(wanted)) => wanted,
    };
    let known = |n: &f64| {
        if *n == 0.0 || given.contains(n) {
            return Ok(convert(*n));
        }
        Err(format!(
            "is {n}, but `cycles` does not contain this number. Add it to `cycles`, or remove it from `profiles_at`"
        ))
    };
    let wanted = Faults::list(wanted.iter().map(known));
    let mut wanted = wanted.map_err(|faults| faults.below("/profiles_at"))?;
    if wanted.len() > 1 && wanted[0] == 0.0 {
        wanted.remove(0);
    }
    if wanted == list {
        return word(ProfilesWord::All);
    }
    if wanted[..] == list[list.len() - 1..] {
        return word(ProfilesWord::Last);
    }
    Ok((list, ProfilesAt::At(wanted)))
}

/// For each output cycle, whether it has profiles. The unworn state has profiles if any output
/// cycle has them.
pub(super) fn with_profiles(outputs: &Outputs, profiles_at: &ProfilesAt) -> Vec<bool> {
    let numbers = outputs.numbers();
    let last = numbers.len() - 1;
    let carries = |(i, n): (usize, &f64)| match profiles_at {
        ProfilesAt::Word(ProfilesWord::None) => false,
        ProfilesAt::Word(ProfilesWord::All) => true,
        ProfilesAt::Word(ProfilesWord::Last) => i == 0 || i == last,
        ProfilesAt::At(list) => *n == 0.0 || list.contains(n),
    };
    numbers.iter().enumerate().map(carries).collect()
}
