//! The motion in canonical form.
//!
//! # Equations
//! ```text
//! Δ = G*U/(μE*d₀),   Q = 2μE*a₀d₀ ∫ min(Δ, y₀) dx,   Q < μF                        (10)
//! rig   U_rig = U + Q(U)/k_rig
//! ```
//!
//! # Units
//! SI.

use std::sync::Arc;

use serde::Serialize;

use super::line::{LineMotion, end_of, merged};
use super::pressed::{MIN_RING, ROUNDED, UnwornContact, half_tangential};
use crate::contact::control::{Block, Control, Normal, Tangential};
use crate::contact::record::DisplacementRecord;
use crate::contact::reference::Series;
use crate::numeric::{root, twelve_digits};
use crate::request::fault::Faults;
use crate::request::fields::{Length, List};
use crate::request::held::{self, Blocks, Motion, MotionHeld};

/// Minimum U/U_gs. For a smaller ratio the slip ring would be lost in rounding.
const MIN_THRESHOLD: f64 = 1e-6;
/// Maximum relative difference between the given stick ratio and the ratio that follows from the
/// rounded amplitude.
const STICK_DIGITS: f64 = 1e-3;

/// The digits of positions after the first one of the amplitude.
const DIGITS: f64 = 11.0;

/// The motion in canonical form.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub(super) enum CanonicalMotion {
    Amplitude { amplitude: f64, held: MotionHeld },
    Force { tangential_force: f64, held: MotionHeld },
    Rig { amplitude: f64, rig_stiffness: f64, held: MotionHeld },
    Blocks { blocks: Vec<held::Block> },
    Reversals { reversals: Vec<f64> },
    Line(LineMotion),
}

impl CanonicalMotion {
    /// Converts the motion of a request to canonical form.
    pub(super) fn resolve(motion: &Motion, pressed: &UnwornContact) -> Result<Self, Faults> {
        if pressed.length.is_some() {
            return LineMotion::resolve(motion, pressed).map(Self::Line);
        }
        if let Some(Blocks(blocks)) = &motion.blocks.0 {
            let moving = blocks.iter().enumerate().filter(|(_, block)| block.held() > 0.0);
            for (index, block) in moving {
                let pointer = format!("/motion/blocks/{index}/amplitude");
                resolved(block.held(), false, pressed, &pointer)?;
            }
            return Ok(Self::Blocks { blocks: merged(blocks) });
        }
        if let Some(List(reversals)) = &motion.reversals.0 {
            let reversals: Vec<f64> = reversals.iter().map(|position| position.0).collect();
            let record = record_of(&reversals)?;
            resolved(record.amplitude, false, pressed, "/motion/reversals")?;
            return Ok(Self::Reversals { reversals: around_zero(reversals) });
        }
        let (amplitude, pointer) = contact_amplitude(motion, pressed)?;
        if let Some(stiffness) = motion.rig_stiffness.0 {
            return Self::resolve_rig(motion, stiffness.0, (amplitude, pointer), pressed);
        }
        if motion.tangential() == MotionHeld::Amplitude {
            let stays = pressed.normal == Normal::Depth;
            let amplitude = resolved(twelve_digits(amplitude), stays, pressed, pointer)?;
            return Ok(Self::Amplitude { amplitude, held: MotionHeld::Amplitude });
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
        Ok(Self::Force { tangential_force, held: MotionHeld::TangentialForce })
    }

    /// The same motion, as a constant one if it has a single block.
    pub(super) fn constant(self) -> Self {
        match self {
            Self::Blocks { blocks } if blocks.len() == 1 => {
                Self::Amplitude { amplitude: blocks[0].held(), held: MotionHeld::Amplitude }
            }
            Self::Line(motion) => Self::Line(motion.constant()),
            other => other,
        }
    }

    /// Converts a motion with a rig. `amplitude` is the amplitude of the contact, and `pointer` its
    /// location in the request.
    fn resolve_rig(
        motion: &Motion,
        rig_stiffness: f64,
        (amplitude, pointer): (f64, &str),
        pressed: &UnwornContact,
    ) -> Result<Self, Faults> {
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
        let canonical = Self::Rig { amplitude, rig_stiffness, held: MotionHeld::Amplitude };
        let (_, threshold) = canonical.control(pressed, 1.0)?;
        resolved(threshold * pressed.gross_slip, false, pressed, pointer)?;
        Ok(canonical)
    }

    /// The held quantities in units of the unworn contact, and the initial Δ. `unit` is N₀, for the
    /// end times of the blocks.
    pub(super) fn control(
        &self,
        pressed: &UnwornContact,
        unit: f64,
    ) -> Result<(Control, f64), Faults> {
        let (tangential, threshold) = match self {
            Self::Line(motion) => return Ok(motion.control(pressed, unit)),
            Self::Amplitude { amplitude, .. } => {
                (Tangential::Amplitude, pressed.threshold(*amplitude))
            }
            Self::Force { tangential_force, .. } => {
                let force = pressed.carried(*tangential_force)?;
                let half = force / (2.0 * pressed.friction * pressed.force);
                (Tangential::Force(half), pressed.threshold_under(force))
            }
            Self::Rig { amplitude, rig_stiffness, .. } => {
                let compliance =
                    pressed.tangential_modulus * pressed.contact_radius / rig_stiffness;
                let amplitude = amplitude / pressed.gross_slip;
                let missing = |threshold: f64| {
                    threshold + 2.0 * compliance * half_tangential(&pressed.shape, threshold)
                        - amplitude
                };
                let threshold =
                    pressed.threshold(pressed.gross_slip * root(0.0, amplitude, missing));
                (Tangential::Rig { amplitude, compliance }, threshold)
            }
            Self::Blocks { blocks } => {
                let mut end = 0.0;
                let block = |block: &held::Block| {
                    end += block.cycles.0;
                    Block::new(pressed.threshold(block.held()), end / unit)
                };
                let blocks: Vec<Block> = blocks.iter().map(block).collect();
                let first = blocks[0].threshold;
                // A single block lasts until the end of the run, so it is a constant amplitude.
                let one = blocks.len() == 1;
                (if one { Tangential::Amplitude } else { Tangential::Blocks(blocks) }, first)
            }
            Self::Reversals { reversals } => {
                let record = record_of(reversals)?;
                let threshold = pressed.threshold(record.amplitude);
                (Tangential::Record(Arc::new(record)), threshold)
            }
        };
        Ok((Control { normal: pressed.normal, tangential }, threshold))
    }

    /// The initial amplitude U of the contact, and N₀ = a₀/(4 U k_w E*), (18).
    pub(super) fn amplitude_and_cycles(
        &self,
        pressed: &UnwornContact,
        wear_coefficient: f64,
    ) -> Result<(f64, f64), Faults> {
        let (_, threshold) = self.control(pressed, 1.0)?;
        let UnwornContact { contact_radius, normal_modulus, .. } = pressed;
        // An amplitude in the request is taken without rounding.
        let amplitude = match self {
            Self::Line(motion) => {
                let carried = pressed.friction * pressed.force / pressed.length.unwrap_or(1.0);
                let unit = contact_radius / (4.0 * wear_coefficient * carried);
                return Ok((motion.amplitude(pressed), unit));
            }
            Self::Amplitude { amplitude, .. } => *amplitude,
            Self::Blocks { blocks } => blocks[0].held(),
            _ => threshold * pressed.gross_slip,
        };
        Ok((amplitude, contact_radius / (4.0 * amplitude * wear_coefficient * normal_modulus)))
    }

    /// What the displacements of a line contact are measured against.
    pub(super) fn reference(&self, pressed: &UnwornContact) -> Option<Series> {
        match self {
            Self::Line(motion) => motion.series(pressed),
            _ => None,
        }
    }

    /// The stick ratio c/a₀ of the unworn contact at the largest amplitude. It is 0 in gross slip.
    pub(super) fn stick_ratio(&self, pressed: &UnwornContact) -> Result<f64, Faults> {
        let (control, threshold) = self.control(pressed, 1.0)?;
        let largest = match control.tangential {
            Tangential::Blocks(blocks) => {
                blocks.iter().map(|block| block.threshold).fold(threshold, f64::max)
            }
            _ => threshold,
        };
        Ok(pressed.shape.stick_radius(largest))
    }

    /// The cycle at which the last block ends.
    pub(super) fn end(&self) -> Option<f64> {
        match self {
            Self::Line(motion) => motion.end(),
            Self::Blocks { blocks } => Some(end_of(blocks)),
            _ => None,
        }
    }
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
    let shifted = |x: f64| {
        let rounded = twelve_digits(((x - middle) / unit).round() * unit);
        if x <= low {
            -amplitude
        } else if x >= high {
            amplitude
        } else {
            rounded
        }
    };
    reversals.into_iter().map(shifted).collect()
}

fn record_of(reversals: &[f64]) -> Result<DisplacementRecord, Faults> {
    DisplacementRecord::new(reversals).ok_or_else(|| {
        Faults::one(
            "/motion/reversals",
            "must not all be the same position. Enter at least two different positions",
        )
    })
}

/// The amplitude U of the contact, from the given amplitude, stick ratio or tangential force, and
/// the pointer to this member.
#[expect(clippy::expect_used, reason = "the request was validated")]
fn contact_amplitude(
    motion: &Motion,
    pressed: &UnwornContact,
) -> Result<(f64, &'static str), Faults> {
    if let Some(ratio) = motion.stick_ratio.0 {
        let amplitude = pressed.gross_slip * (1.0 - pressed.shape.image(ratio.0));
        let returned = pressed
            .shape
            .image_inverse((1.0 - twelve_digits(amplitude) / pressed.gross_slip).max(0.0));
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
        let amplitude = pressed.threshold_under(force) * pressed.gross_slip;
        return Ok((amplitude, "/motion/tangential_force"));
    }
    let amplitude = motion.amplitude.0.expect("a request without any of these is refused");
    Ok((amplitude.0, "/motion/amplitude"))
}

/// Checks that the slip ring is wide enough. `stays` is true if the stick radius is constant.
fn resolved(
    amplitude: f64,
    stays: bool,
    pressed: &UnwornContact,
    pointer: &str,
) -> Result<f64, Faults> {
    let (low, high) = Length::RANGE;
    if !(low..=high).contains(&amplitude) {
        let detail = format!(
            "gives an amplitude of {amplitude:e} m. The amplitude must be between {low:e} and \
             {high:e} m"
        );
        return Err(Faults::one(pointer, detail));
    }
    let mut least = MIN_THRESHOLD * pressed.gross_slip;
    if !stays {
        let narrowest = ROUNDED * MIN_RING;
        least = least.max(pressed.gross_slip * (1.0 - pressed.shape.image(1.0 - narrowest)));
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
