//! The verification page: every number that is known by another way, computed anew and compared.
//!
//! A [`Page`] is made of sections, a [`Section`] of checks, and a [`Check`] is one number: what it is,
//! the reference and where that is from, the value of this program, and how large the error may be.
//! Nothing is written down beforehand but the references and the words, which are in `page.md`; all
//! else is computed by [`page()`], in a fixed order, so that the same engine prints the same bytes.
//!
//! # Units
//! Those of the [reference solutions](fretwork_engine::reference); what goes through a scenario is in SI.

mod known;
mod numerics;
mod page;
mod problem;
mod rule;
mod table;

pub use page::{Check, Page, Section};

/// Computes the page. It takes some seconds.
#[must_use]
pub fn page() -> Page {
    let sections = [table::sections(), known::sections(), numerics::sections(), rule::sections()];
    Page { sections: sections.into_iter().flatten().collect() }
}
