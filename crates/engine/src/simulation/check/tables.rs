//! Judges the tables of a result by themselves: the lengths of their columns, and what holds for every version of the
//! engine.

use super::flaw::{Flaw, require, same};
use crate::outcome::{History, Loops, Profiles};

/// Judges the tables of a result without its scenario.
///
/// # Errors
/// The first flaw.
pub fn check_tables(
    history: &History,
    profiles: Option<&Profiles>,
    loops: Option<&Loops>,
) -> Result<(), Flaw> {
    check_history(history)?;
    let (Some(profiles), Some(loops)) = (profiles, loops) else {
        return require(profiles.is_none() && loops.is_none(), || {
            "it has profiles without loops, or loops without profiles".to_owned()
        });
    };
    check_profiles(profiles)?;
    check_loops(loops)?;
    require(profiles.cycles == loops.cycles, || {
        "profiles and loops have different output cycles".to_owned()
    })?;
    let mut outputs = history.cycles.iter();
    require(profiles.cycles.iter().all(|n| outputs.any(|output| same(*output, *n))), || {
        "an output cycle of the profiles is not in the history".to_owned()
    })
}

/// Judges the columns of a history.
pub(super) fn check_history(history: &History) -> Result<(), Flaw> {
    let count = history.cycles.len();
    require(count > 0, || "the history is empty".to_owned())?;
    // Results of earlier versions have no errors.
    let later = |name: &str| name.ends_with("_error");
    let columns = history.columns().into_iter();
    for (name, column) in columns.filter(|(name, column)| !(later(name) && column.is_empty())) {
        require(column.len() == count, || {
            format!("history: `{name}` has {} entries, but `cycles` has {count}", column.len())
        })?;
        require(column.iter().all(|value| value.is_finite() && *value >= 0.0), || {
            format!("history: `{name}` has a negative or infinite entry")
        })?;
    }
    require(history.cycles[0] == 0.0 && history.cycles.is_sorted_by(|a, b| a < b), || {
        "history: `cycles` does not increase from 0".to_owned()
    })
}

fn check_profiles(profiles: &Profiles) -> Result<(), Flaw> {
    let Profiles { cycles, radius, initial, limiting, worn, wear, image, pressure, slip } =
        profiles;
    let width = radius.len();
    let rows = [("initial", Some(initial)), ("limiting", limiting.as_ref())];
    for (name, row) in rows {
        require(row.is_none_or(|row| row.len() == width), || {
            format!("profiles: `{name}` has not as many entries as `radius`")
        })?;
    }
    let matrices =
        [("worn", worn), ("wear", wear), ("image", image), ("pressure", pressure), ("slip", slip)];
    for (name, matrix) in matrices {
        require(matrix.len() == cycles.len(), || {
            format!("profiles: `{name}` has not as many rows as `cycles`")
        })?;
        require(matrix.iter().all(|row| row.len() == width), || {
            format!("profiles: a row of `{name}` has not as many entries as `radius`")
        })?;
    }
    let begins = radius.first().is_some_and(|first| *first >= 0.0);
    require(begins && radius.is_sorted_by(|a, b| a < b), || {
        "profiles: `radius` does not increase".to_owned()
    })?;
    for (name, matrix) in [("wear", wear), ("pressure", pressure), ("slip", slip)] {
        require(matrix.iter().flatten().all(|value| *value >= 0.0), || {
            format!("profiles: `{name}` is negative")
        })?;
    }
    Ok(())
}

fn check_loops(loops: &Loops) -> Result<(), Flaw> {
    let Loops { cycles, displacement, tangential_force, .. } = loops;
    let ratios = [
        ("energy_ratio", Some(&loops.energy_ratio)),
        ("slip_ratio", Some(&loops.slip_ratio)),
        ("free_ratio", Some(&loops.free_ratio)),
        ("actuator_energy_ratio", loops.actuator_energy_ratio.as_ref()),
        ("actuator_slip_ratio", loops.actuator_slip_ratio.as_ref()),
    ];
    for (name, column) in ratios {
        require(column.is_none_or(|column| column.len() == cycles.len()), || {
            format!("loops: `{name}` has not as many entries as `cycles`")
        })?;
        require(column.is_none_or(|column| column.iter().all(|x| (0.0..2.0).contains(x))), || {
            format!("loops: `{name}` is not between 0 and 2")
        })?;
    }
    let rows = displacement.iter().zip(tangential_force);
    let is_whole = displacement.len() == cycles.len()
        && tangential_force.len() == cycles.len()
        && rows.into_iter().all(|(u, q)| u.len() == q.len());
    require(is_whole, || {
        "loops: `displacement` and `tangential_force` have different lengths".to_owned()
    })
}
