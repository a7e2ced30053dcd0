//! Figures of a result.
//!
//! | result | figures |
//! |---|---|
//! | run | profiles, histories, loops ([`run`]) |
//! | sweep of a grid or of lists | families of curves, heat maps ([`grid`]) |
//! | sweep with drawn values | scatter plots ([`scatter`]) |
//! | map | regimes, heat maps, families of curves ([`grid`]) |
//! | fit | measured numbers with bands, residuals, profiles of the sum of squares ([`fit`]) |
//! | sensitivity | bars of the indices ([`tornado`]), scatter plots |
//!
//! All figures can be read in greyscale and by colour-blind readers.

mod axes;
mod choice;
mod fit;
mod grid;
mod run;
mod scatter;
mod study;
mod tornado;
pub mod words;

use super::{Document, Result, View};
use fretwork_job::TaskKind;

/// Draws the requested figure as an SVG document.
pub fn svg(document: &Document<'_>, view: &View) -> Result<Vec<u8>> {
    let svg = match document.kind() {
        TaskKind::Run => run::svg(document, view)?,
        TaskKind::Study(kind) => study::svg(document, kind, view)?,
    };
    Ok(svg.into_bytes())
}
