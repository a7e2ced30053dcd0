//! How much the wear hangs on what a measured table does not tell: the profile between its rows, and its noise.

use super::row::{integrals_of, unworn_integrals};
use super::unworn::Contact;

/// The noise is taken this many times, so that a contact close to gross slip counts.
const SEVERAL: f64 = 3.0;
/// With more rows than this in the ring that slips, interpolants agree.
const MANY_ROWS: usize = 8;

/// What the wear of a measured table is uncertain by.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Doubts {
    /// The relative change of the energy of a cycle with straight lines between the rows, at the same depth and amplitude.
    pub(crate) interpolation: f64,
    /// The noise in the heights that remains after smoothing, in d₀.
    pub(crate) noise: f64,
    /// The relative change of the width of the ring that slips, if the image changes by this noise.
    pub(crate) widening: f64,
    /// The radii in a₀ of the rows around the ring that slips.
    pub(crate) between: [f64; 2],
}

impl Doubts {
    /// `None` if the profile is not a table.
    pub(crate) fn of(contact: &Contact) -> Option<Self> {
        let Contact { shape, stick, threshold, .. } = contact;
        let table = shape.as_table()?;
        let (rows, between, noise) = table.points_about(*stick, 1.0);
        let edge = |level: f64| if level > 0.0 { shape.image_inverse(level) } else { 0.0 };
        let [inside, outside] =
            [-SEVERAL, SEVERAL].map(|times| edge(1.0 - threshold + times * noise));
        let widening = (outside - inside) / (2.0 * SEVERAL * (1.0 - stick));
        let mut interpolation = 0.0;
        if rows <= MANY_ROWS {
            let straight = integrals_of(shape, |x| table.straight_image(x), *stick, *threshold);
            interpolation = straight.1 / unworn_integrals(shape, *stick, *threshold).1 - 1.0;
        }
        Some(Self { interpolation, noise, widening, between })
    }
}
