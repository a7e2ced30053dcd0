//! The verification page compares numbers of this program with the same numbers from other sources.
//!
//! A [`VerificationPage`] consists of sections, and a [`Section`] of checks. A [`Check`] contains a reference value
//! with its source, the computed value, and the accepted error. The text of the page is in `page.md`. [`page()`]
//! computes the values in a fixed order, so that the same engine always prints the same bytes.
//!
//! # Units
//! The units are those of the [reference solutions](fretwork_engine::reference). Scenarios and their results are in SI
//! units.

mod accuracy;
mod deviation;
mod known;
mod literature;
mod numerics;
mod page;
mod problem;
mod random_scenario;
mod rule;
mod table;

pub use accuracy::{Accuracy, OutputErrors, Worn};
pub use page::{Check, Section, VerificationPage};
pub use random_scenario::RandomScenario;

/// Computes the page, which takes some seconds.
pub fn page() -> VerificationPage {
    let others = [known::SECTIONS, literature::SECTIONS, numerics::SECTIONS, rule::SECTIONS];
    let others = others.into_iter().flatten().map(|(title, fill)| Section::of(title, fill));
    VerificationPage { sections: table::sections().into_iter().chain(others).collect() }
}
