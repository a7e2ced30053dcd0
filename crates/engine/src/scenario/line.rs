//! The motion of a line contact in canonical form.
//!
//! # Equations
//! Those of [`motion`](super::motion).
//!
//! # Units
//! SI. Forces, stiffnesses and energies are totals over the length.

use super::motion::{CanonicalMotion, Moves, merged};
use super::pressed::{MIN_RING, ROUNDED, UnwornContact};
use crate::input::{Blocks, Faults, Motion, Reference, Valid, held};
use crate::numeric::twelve_digits;

/// A tangential force must be smaller than μF by more than this share of μF.
const LEAST_MARGIN: f64 = 1e-9;
/// Minimum distance of the reference, in half-widths of the unworn contact.
const NEAREST: f64 = 1.1;
/// Minimum amplitude of sliding, in μh₀. What the springs add to it is about μh₀ ln(a/a₀).
const LEAST_SLIDING: f64 = 20.0;
/// A loop that is stiffer than a contact whose displacement is measured at its own edge has no meaning. The number is
/// what yields beside the contact, in μh₀ per μF.
const LEAST_COMPLIANCE: f64 = 0.1;

/// Checks that the reference is outside of the contact, and that a loop is not stiffer than the contact.
fn check_reference(reference: Reference, pressed: &UnwornContact) -> Valid<()> {
    let most = pressed.scales.force() / (LEAST_COMPLIANCE * pressed.scales.indentation_depth);
    match reference {
        Reference::Distance { reference_distance: distance, .. }
            if distance < NEAREST * pressed.scales.contact_radius =>
        {
            let detail = format!(
                "is {distance:e} m, but the half-width of the contact is {:.4e} m. Enter at least {NEAREST} \
                 times as much: the distance from the middle of the contact to the place of the displacement \
                 sensor",
                pressed.scales.contact_radius
            );
            Err(Faults::one("/motion/reference_distance", detail))
        }
        Reference::Loop { loop_stiffness: stiffness } if stiffness > most => {
            let detail = format!(
                "is {stiffness:.4e} N/m, but a loop of this contact has a slope of at most {most:.4e} N/m. \
                 Enter the slope dQ/dU of the whole contact right after a reversal, in N/m or per length \
                 in N/m/m"
            );
            Err(Faults::one("/motion/loop_stiffness", detail))
        }
        _ => Ok(()),
    }
}

/// Converts the motion of a request to canonical form.
#[expect(clippy::expect_used, reason = "the request was validated")]
pub(super) fn resolve(motion: &Motion, pressed: &UnwornContact) -> Valid<CanonicalMotion> {
    let reference = motion.reference();
    reference.map_or(Ok(()), |reference| check_reference(reference, pressed))?;
    let moves = if let Some(Blocks(blocks)) = &motion.blocks.0 {
        Moves::Blocks(merged(blocks))
    } else if let Some(sliding) = motion.sliding_amplitude.0 {
        let least = LEAST_SLIDING * pressed.most_friction * pressed.scales.indentation_depth;
        if sliding.0 < least {
            let detail = format!(
                "is {:.4e} m. Below {least:.4e} m the elastic displacement of the surface matters, so the stroke \
                     needs a reference. Enter `amplitude` with `reference_distance`, the distance from the contact \
                     to the displacement sensor",
                sliding.0
            );
            return Err(Faults::one("/motion/sliding_amplitude", detail));
        }
        Moves::SlidingAmplitude(sliding.0)
    } else if let Some(aperture) = motion.loop_aperture.0 {
        Moves::LoopAperture(aperture.0)
    } else if let Some(amplitude) = motion.amplitude.0 {
        Moves::Amplitude(twelve_digits(amplitude.0))
    } else if let Some(force) = motion.tangential_force.0 {
        Moves::TangentialForce(force.0)
    } else {
        let ratio = motion.stick_ratio.0.expect("a motion without any of these is refused");
        Moves::TangentialForce(force_at(ratio.0, pressed)?)
    };
    let found = CanonicalMotion::new(moves, reference);
    check(&found, pressed)?;
    Ok(found)
}

/// Checks that friction can carry the forces, and that the slip ring is wide enough.
fn check(motion: &CanonicalMotion, pressed: &UnwornContact) -> Valid<()> {
    let narrowest = ROUNDED * MIN_RING;
    let least = 1.0 - pressed.shape.image(1.0 - narrowest);
    for (pointer, moves) in parts(motion) {
        let (_, threshold) = motion.held(&moves, pressed)?;
        if matches!(moves, Moves::TangentialForce(_)) && threshold >= 1.0 - LEAST_MARGIN {
            let most = pressed.scales.friction * pressed.scales.force();
            let detail = format!(
                "is {:.6e} N, but friction carries at most μF = {most:.6e} N. Enter a smaller tangential force, or \
                     `sliding_amplitude` for gross slip",
                threshold * most
            );
            return Err(Faults::one(&pointer, detail));
        }
        if threshold > 0.0 && threshold < least {
            let detail = format!(
                "is too small: a ring of less than {MIN_RING:e} half-widths would slip, which is too narrow to \
                     compute. Enter a motion that is at least {:.1} times as large",
                (10.0 * least / threshold).ceil().max(11.0) / 10.0
            );
            return Err(Faults::one(&pointer, detail));
        }
    }
    Ok(())
}

/// What the contact holds one after the other, and the pointers to it.
fn parts(motion: &CanonicalMotion) -> Vec<(String, Moves)> {
    let pointer = |moves: &Moves, place: &str| match moves {
        Moves::TangentialForce(_) => format!("/motion{place}/tangential_force"),
        Moves::LoopAperture(_) => format!("/motion{place}/loop_aperture"),
        _ => format!("/motion{place}/amplitude"),
    };
    match &motion.moves {
        Moves::SlidingAmplitude(_) => Vec::new(),
        Moves::Blocks(blocks) => {
            let of_block = |(i, block): (usize, &held::BlockInput)| {
                let moves = Moves::from(block);
                (pointer(&moves, &format!("/blocks/{i}")), moves)
            };
            blocks.iter().enumerate().map(of_block).collect()
        }
        moves => vec![(pointer(moves, ""), moves.clone())],
    }
}

/// The tangential force at a stick ratio.
fn force_at(ratio: f64, pressed: &UnwornContact) -> Valid<f64> {
    let least = pressed.shape.image_inverse(LEAST_MARGIN);
    if ratio <= least {
        let detail = format!(
            "is {ratio}, but the whole contact slips if the ratio is not above {least:.4e}. Enter a larger ratio, or \
             `sliding_amplitude` for gross slip"
        );
        return Err(Faults::one("/motion/stick_ratio", detail));
    }
    let most = pressed.scales.friction * pressed.scales.force();
    Ok(twelve_digits(most * (1.0 - pressed.shape.image(ratio))))
}
