//! The output cycles in canonical form, and the output cycles with profiles.

use crate::numeric::twelve_digits;
use crate::request::fault::{Fault, Faults};
use crate::request::fields::LAST_CYCLE;
use crate::request::instants::{Cycles, ProfilesAt, ProfilesWord};

/// If there are at most this many output cycles, all of them have profiles by default. With more,
/// only the last one has profiles.
pub const DEFAULT_PROFILES: usize = 20;

/// Converts the output cycles of a request, and the choice of profiles, to canonical form.
pub(super) fn canonical(
    cycles: &Cycles,
    profiles_at: Option<&ProfilesAt>,
    unit: f64,
) -> Result<(Vec<f64>, ProfilesAt), Faults> {
    let unit = if cycles.normalized { unit } else { 1.0 };
    let convert = |n: f64| {
        if cycles.normalized { twelve_digits(n * unit) } else { n }
    };
    let given = &cycles.instants;
    let mut list: Vec<f64> = given.iter().map(|n| convert(*n)).collect();
    if let Some(too_large) = list.iter().find(|n| **n > LAST_CYCLE) {
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
    let mut faults = Vec::new();
    for (index, n) in wanted.iter().enumerate() {
        if *n != 0.0 && !given.contains(n) {
            faults.push(Fault {
                pointer: format!("/profiles_at/{index}"),
                detail: format!(
                    "is {n}, but `cycles` does not contain this number. Add it to `cycles`, or remove \
                     it from `profiles_at`"
                ),
            });
        }
    }
    if !faults.is_empty() {
        return Err(Faults(faults));
    }
    let mut wanted: Vec<f64> = wanted.iter().map(|n| convert(*n)).collect();
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
pub(super) fn with_profiles(cycles: &[f64], profiles_at: &ProfilesAt) -> Vec<bool> {
    let last = cycles.len() - 1;
    let carries = |(i, n): (usize, &f64)| match profiles_at {
        ProfilesAt::Word(ProfilesWord::None) => false,
        ProfilesAt::Word(ProfilesWord::All) => true,
        ProfilesAt::Word(ProfilesWord::Last) => i == 0 || i == last,
        ProfilesAt::At(list) => *n == 0.0 || list.contains(n),
    };
    cycles.iter().enumerate().map(carries).collect()
}
