//! The instants of the history in canonical form, and which of them carry profiles.

use serde::Serialize;

use crate::numeric::twelve_digits;
use crate::request::fault::{Fault, Faults};
use crate::request::fields::LAST_CYCLE;
use crate::request::instants::{Cycles, ProfilesAt};

/// Up to this many instants all carry profiles by default, above it only the last.
pub const DEFAULT_PROFILES: usize = 20;

/// The word where one fits, so that equal requests have equal keys.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub(super) enum CanonicalProfilesAt {
    Word(&'static str),
    At(Vec<f64>),
}

/// The canonical instants, and which of them carry profiles.
pub(super) fn canonical(
    cycles: &Cycles,
    profiles_at: Option<&ProfilesAt>,
    unit: f64,
) -> Result<(Vec<f64>, CanonicalProfilesAt), Faults> {
    let unit = if cycles.normalized { unit } else { 1.0 };
    let convert = |n: f64| {
        if cycles.normalized { twelve_digits(n * unit) } else { n }
    };
    let given = &cycles.instants;
    let mut list: Vec<f64> = given.iter().map(|n| convert(*n)).collect();
    if let Some(too_large) = list.iter().find(|n| **n > LAST_CYCLE) {
        let detail = format!(
            "comes to {too_large:e} cycles (N₀ = {unit:.3e}); at most {LAST_CYCLE:e} are accepted"
        );
        return Err(Faults::one("/cycles/normalized", detail));
    }
    if list.windows(2).any(|pair| pair[0] >= pair[1]) {
        let detail = "instants agree to 12 digits once they are multiplied by N₀".to_owned();
        return Err(Faults::one("/cycles/normalized", detail));
    }
    // 0 is always added when running, so it says nothing here.
    if list.len() > 1 && list[0] == 0.0 {
        list.remove(0);
    }
    let word = |word| Ok((list.clone(), CanonicalProfilesAt::Word(word)));
    let wanted = match profiles_at {
        None if list.len() <= DEFAULT_PROFILES => return word("all"),
        None | Some(ProfilesAt::Last) if list.len() > 1 => return word("last"),
        None | Some(ProfilesAt::All | ProfilesAt::Last) => return word("all"),
        Some(ProfilesAt::None) => return word("none"),
        Some(ProfilesAt::At(wanted)) => wanted,
    };
    let mut faults = Vec::new();
    for (index, n) in wanted.iter().enumerate() {
        if *n != 0.0 && !given.contains(n) {
            faults.push(Fault {
                pointer: format!("/profiles_at/{index}"),
                detail: format!("{n} is not one of the instants in `cycles`"),
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
        return word("all");
    }
    if wanted[..] == list[list.len() - 1..] {
        return word("last");
    }
    Ok((list, CanonicalProfilesAt::At(wanted)))
}
