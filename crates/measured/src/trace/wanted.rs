//! What is wanted from a file.

use fretwork_engine::input::quantity::{Dimension, parse};
use fretwork_json::words;

/// What is wanted from a file.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Wanted<'a> {
    /// The name of the first column, with a unit if the file states none. By default the first column of the file.
    pub x: Option<&'a str>,
    /// The name of the second column. By default the next column of the file.
    pub y: Option<&'a str>,
    /// Which table of the file, from 1 on. By default the first.
    pub table: Option<usize>,
    /// The decimal mark, a point or a comma. By default the one that the numbers show.
    pub decimal: Option<char>,
    /// What becomes of the two columns.
    pub prepare: Prepare,
    /// Whether the tilt of a trace is removed.
    pub level: bool,
    /// Whether the middle of the scar becomes the axis. Otherwise it is where x is 0.
    pub centre: bool,
    /// Where heights of a trace point. By default out of the material, unless a ball's or bore's curvature shows otherwise.
    pub up: Option<Up>,
    /// The ends of the scar in x, in m. By default the scar is found.
    pub scar: Option<[f64; 2]>,
}

impl Wanted<'_> {
    /// The first two columns, with all that is usual.
    pub const fn of(prepare: Prepare) -> Self {
        Self {
            x: None,
            y: None,
            table: None,
            decimal: None,
            prepare,
            level: true,
            centre: true,
            up: None,
            scar: None,
        }
    }
}

words! {
    /// Where the heights of a trace point.
    pub enum Up: "direction of heights" {
        /// Out of the material.
        Out = "out",
        /// Into the material.
        In = "in",
    }
}

/// What [`ends`] reads.
pub const ENDS: &str = "FROM..TO with a unit of length, the smaller one first, such as 0.4..1.6mm";

/// Reads the ends of a scar. The first end may have its own unit.
pub fn ends(text: &str) -> Option<[f64; 2]> {
    let (from, to) = text.split_once("..")?;
    let unit = to.trim_start_matches(|it: char| it.is_ascii_digit() || ".+-eE ".contains(it));
    let length = |text: &str| parse(text, Dimension::Length).ok();
    let [from, to] = [length(&format!("{from} {unit}")).or_else(|| length(from))?, length(to)?];
    (from < to && !unit.is_empty()).then_some([from, to])
}

words! {
    /// What becomes of two columns.
    pub enum Prepare: "preparation" {
        /// Points of an output.
        Points = "points",
        /// A profilometer trace across the whole scar becomes a profile.
        Trace = "trace",
        /// A trace from the axis outwards becomes a profile.
        Half = "half",
        /// Friction force over displacement becomes cycles with their energies.
        Loop = "loop",
    }
}
