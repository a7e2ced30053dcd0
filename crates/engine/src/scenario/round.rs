//! The motion of a round contact in canonical form.
//!
//! # Equations
//! Those of [`motion`](super::motion).
//!
//! # Units
//! SI.

use super::motion::{CanonicalMotion, Moves, merged, record_of};
use super::pressed::{MIN_RING, ROUNDED, UnwornContact};
use crate::contact::Normal;
use crate::input::{Blocks, Faults, Length, List, Motion, MotionHeld, Reference, Valid};
use crate::numeric::twelve_digits;

/// Minimum U/U_gs. For a smaller ratio the slip ring would be lost in rounding.
const MIN_THRESHOLD: f64 = 1e-6;
/// Maximum relative difference between the given stick ratio and the ratio that follows from the
/// rounded amplitude.
const STICK_DIGITS: f64 = 1e-3;

/// The digits of positions after the first one of the amplitude.
const DIGITS: f64 = 11.0;

/// Converts the motion of a request to canonical form.
pub(super) fn resolve(motion: &Motion, pressed: &UnwornContact) -> Valid<CanonicalMotion> {
    if let Some(Blocks(blocks)) = &motion.blocks.0 {
        let moving = blocks.iter().enumerate().filter(|(_, block)| block.held() > 0.0);
        for (index, block) in moving {
            let pointer = format!("/motion/blocks/{index}/{}", block.member());
            let amplitude = match block.loop_aperture.0 {
                Some(aperture) => pressed.at_aperture(aperture.0, None).1 * pressed.scales.slip(),
                None => block.held(),
            };
            resolved(amplitude, false, pressed, &pointer)?;
        }
        return Ok(CanonicalMotion::new(Moves::Blocks(merged(blocks)), None));
    }
    if let Some(List(reversals)) = &motion.reversals.0 {
        let reversals: Vec<f64> = reversals.iter().map(|position| position.0).collect();
        let record = record_of(&reversals)?;
        resolved(record.amplitude, false, pressed, "/motion/reversals")?;
        return Ok(CanonicalMotion::new(Moves::Reversals(around_zero(reversals)), None));
    }
    if let Some(aperture) = motion.loop_aperture.0 {
        let amplitude = pressed.at_aperture(aperture.0, None).1 * pressed.scales.slip();
        resolved(amplitude, false, pressed, "/motion/loop_aperture")?;
        return Ok(CanonicalMotion::new(Moves::LoopAperture(aperture.0), None));
    }
    let (amplitude, pointer) = contact_amplitude(motion, pressed)?;
    if let Some(stiffness) = motion.rig_stiffness.0 {
        return resolve_rig(motion, stiffness.0, (amplitude, pointer), pressed);
    }
    if motion.tangential() == MotionHeld::Amplitude {
        let stays = pressed.normal == Normal::Depth;
        let amplitude = resolved(twelve_digits(amplitude), stays, pressed, pointer)?;
        return Ok(CanonicalMotion::new(Moves::Amplitude(amplitude), None));
    }
    let tangential_force = if let Some(force) = motion.tangential_force.0 {
        pressed.carried(force.0)?
    } else {
        let force = pressed.tangential_force(pressed.threshold(amplitude));
        pressed.carried(twelve_digits(force)).map_err(|_| {
            let detail = "makes the whole contact slip. The tangential force cannot be held \
                              constant in gross slip. Reduce the motion, or hold the amplitude";
            Faults::one(pointer, detail)
        })?
    };
    resolved(amplitude, false, pressed, pointer)?;
    Ok(CanonicalMotion::new(Moves::TangentialForce(tangential_force), None))
}

/// Converts a motion with a rig. `amplitude` is the amplitude of the contact, and `pointer` its
/// location in the request.
fn resolve_rig(
    motion: &Motion,
    rig_stiffness: f64,
    (amplitude, pointer): (f64, &str),
    pressed: &UnwornContact,
) -> Valid<CanonicalMotion> {
    // An amplitude in the request is the amplitude of the actuator. An amplitude that is computed from a force or a
    // stick ratio is the amplitude of the contact.
    let amplitude = twelve_digits(if let Some(actuator) = motion.amplitude.0 {
        actuator.0
    } else {
        let force = pressed.tangential_force(pressed.threshold(amplitude));
        amplitude + force / rig_stiffness
    });
    let (low, high) = Length::RANGE;
    if !(low..=high).contains(&amplitude) {
        let detail = format!(
            "requires an actuator amplitude of {amplitude:e} m. The limits are {low:e} and \
                 {high:e} m. Enter a larger stiffness (a stiffer rig)"
        );
        return Err(Faults::one("/motion/rig_stiffness", detail));
    }
    let (_, threshold) = pressed.behind_rig(amplitude, rig_stiffness);
    resolved(threshold * pressed.scales.slip(), false, pressed, pointer)?;
    let rig = Some(Reference::Rig { rig_stiffness });
    Ok(CanonicalMotion::new(Moves::Amplitude(amplitude), rig))
}

/// Shifts a record so that the middle of its extreme positions is 0, because only its ranges matter. Such a record stays.
fn around_zero(reversals: Vec<f64>) -> Vec<f64> {
    let low = reversals.iter().copied().fold(f64::INFINITY, f64::min);
    let high = reversals.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (middle, amplitude) = (0.5 * (low + high), twelve_digits(0.5 * (high - low)));
    if middle == 0.0 {
        return reversals;
    }
    // Rounded to twelve digits of the amplitude, so that records with different middles become the same.
    let unit = libm::pow(10.0, libm::log10(amplitude).floor() - DIGITS);
    // The extreme positions are exactly opposite, so that the record stays if it is read again.
    let shifted = |x: f64| match x {
        _ if x <= low => -amplitude,
        _ if x >= high => amplitude,
        _ => twelve_digits(((x - middle) / unit).round() * unit),
    };
    reversals.into_iter().map(shifted).collect()
}

/// The amplitude U of the contact, from the given amplitude, stick ratio or tangential force, and
/// the pointer to this member.
#[expect(clippy::expect_used, reason = "the request was validated")]
fn contact_amplitude(motion: &Motion, pressed: &UnwornContact) -> Valid<(f64, &'static str)> {
    if let Some(ratio) = motion.stick_ratio.0 {
        let slip = pressed.scales.slip();
        let amplitude = slip * (1.0 - pressed.shape.image(ratio.0));
        let threshold = twelve_digits(amplitude) / slip;
        let returned = pressed.shape.image_inverse((1.0 - threshold).max(0.0));
        if (returned - ratio.0).abs() > STICK_DIGITS * ratio.0 && ratio.0 > 0.0 {
            let detail = format!(
                "is {}, but 12 digits of the amplitude cannot distinguish this ratio from gross slip. \
                 The stick edge is too close to the axis, or it lies under the flat. Enter a larger \
                 ratio, or 0 for the gross-slip threshold",
                ratio.0
            );
            return Err(Faults::one("/motion/stick_ratio", detail));
        }
        return Ok((amplitude, "/motion/stick_ratio"));
    }
    if let Some(force) = motion.tangential_force.0 {
        let force = pressed.carried(force.0)?;
        let amplitude = pressed.threshold_under(force) * pressed.scales.slip();
        return Ok((amplitude, "/motion/tangential_force"));
    }
    let amplitude = motion.amplitude.0.expect("a request without any of these is refused");
    Ok((amplitude.0, "/motion/amplitude"))
}

/// Checks that the slip ring is wide enough. `stays` is true if the stick radius is constant.
fn resolved(amplitude: f64, stays: bool, pressed: &UnwornContact, pointer: &str) -> Valid<f64> {
    let (low, high) = Length::RANGE;
    if !(low..=high).contains(&amplitude) {
        let detail = format!(
            "gives an amplitude of {amplitude:e} m. The amplitude must be between {low:e} and \
             {high:e} m"
        );
        return Err(Faults::one(pointer, detail));
    }
    let mut least = MIN_THRESHOLD * pressed.scales.slip();
    if !stays {
        let narrowest = ROUNDED * MIN_RING;
        least = least.max(pressed.scales.slip() * (1.0 - pressed.shape.image(1.0 - narrowest)));
        // The width of the slip ring in a₀.
        let ring = 1.0 - pressed.shape.stick_radius(pressed.threshold(amplitude));
        if amplitude >= least && ring < narrowest {
            let detail = format!(
                "gives an amplitude of {amplitude:.3e} m, just below the gross-slip threshold. Only a ring \
                 of {ring:.1e} contact radii around the flat slips, but the minimum is {MIN_RING:e}. \
                 Enter a larger motion (gross slip), or a larger load"
            );
            return Err(Faults::one(pointer, detail));
        }
    }
    if amplitude < least {
        let detail = format!(
            "gives an amplitude of {amplitude:.3e} m. Below {least:.3e} m the slip ring is too narrow \
             to compute. Enter a larger motion"
        );
        return Err(Faults::one(pointer, detail));
    }
    Ok(amplitude)
}
