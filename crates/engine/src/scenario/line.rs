//! The motion of a line contact in canonical form.
//!
//! # Equations
//! In units of h₀ = 2F/(πE*) (F per length) and μh₀, with the stroke of the unworn contact at θ:
//! ```text
//! θ = Q/(μF),   N₀ = a₀/(4 k_w μ F)
//! U = Q/k + (2μ/πE*) ∫ (y_c − y)₊ L ds/(s √(L²−s²)) over c…L                       reference_distance L, rig_stiffness k
//! U = Q/S + (2μ/πE*) [∫ (y_c − y)₊ ds/s over c…a − y_c ln(a/a₀)]                     loop_stiffness S
//! s(x) = U + μ [f + w − f(0) − w(0)]                                               sliding_amplitude
//! ```
//!
//! # Units
//! SI. Forces, stiffnesses and energies are totals over the length.

use serde::Serialize;

use super::pressed::{MIN_RING, ROUNDED, UnwornContact};
use crate::contact::control::{Block, Control, Normal, Tangential};
use crate::contact::reference::Series;
use crate::numeric::twelve_digits;
use crate::request::fault::Faults;
use crate::request::fields::{BlockCycles, Rounded};
use crate::request::held::{self, Blocks, Motion, MotionHeld, Reference};

/// A tangential force must be smaller than μF by more than this share of μF.
const LEAST_MARGIN: f64 = 1e-9;
/// Minimum distance of the reference, in half-widths of the unworn contact.
const NEAREST: f64 = 1.1;
/// Minimum amplitude of sliding, in μh₀. What the springs add to it is about μh₀ ln(a/a₀).
const LEAST_SLIDING: f64 = 20.0;
/// A loop that is stiffer than a contact whose displacement is measured at its own edge has no meaning. The number is
/// what yields beside the contact, in μh₀ per μF.
const LEAST_COMPLIANCE: f64 = 0.1;

/// What displacements are measured against, in canonical form.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
pub(super) enum CanonicalReference {
    Distance {
        reference_distance: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        rig_stiffness: Option<f64>,
    },
    Loop {
        loop_stiffness: f64,
    },
}

/// The motion of a line contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub(super) enum LineMotion {
    Force {
        tangential_force: f64,
        #[serde(flatten)]
        reference: Option<CanonicalReference>,
        held: MotionHeld,
    },
    Stroke {
        amplitude: f64,
        #[serde(flatten)]
        reference: CanonicalReference,
        held: MotionHeld,
    },
    Sliding {
        sliding_amplitude: f64,
        held: MotionHeld,
    },
    Forces {
        blocks: Vec<held::ForceBlock>,
        #[serde(flatten)]
        reference: Option<CanonicalReference>,
    },
    Strokes {
        blocks: Vec<held::Block>,
        #[serde(flatten)]
        reference: CanonicalReference,
    },
}

impl CanonicalReference {
    fn of(motion: &Motion, pressed: &UnwornContact) -> Result<Option<Self>, Faults> {
        let Some(reference) = motion.reference() else { return Ok(None) };
        Ok(Some(match reference {
            Reference::Distance { distance, rig_stiffness } => {
                if distance < NEAREST * pressed.contact_radius {
                    let detail = format!(
                        "is {distance:e} m, but the half-width of the contact is {:.4e} m. Enter at least {NEAREST} \
                         times as much: the distance from the middle of the contact to the place of the displacement \
                         sensor",
                        pressed.contact_radius
                    );
                    return Err(Faults::one("/motion/reference_distance", detail));
                }
                Self::Distance { reference_distance: distance, rig_stiffness }
            }
            Reference::Loop { stiffness } => {
                let most = pressed.force / (LEAST_COMPLIANCE * pressed.depth);
                if stiffness > most {
                    let detail = format!(
                        "is {stiffness:.4e} N/m, but a loop of this contact has a slope of at most {most:.4e} N/m. \
                         Enter the slope dQ/dU of the whole contact right after a reversal, in N/m or per length \
                         in N/m/m"
                    );
                    return Err(Faults::one("/motion/loop_stiffness", detail));
                }
                Self::Loop { loop_stiffness: stiffness }
            }
        }))
    }

    /// The reference in units of the unworn contact.
    fn series(&self, pressed: &UnwornContact) -> Series {
        // μF moves a spring of this stiffness by F/(S h₀) in μh₀.
        let compliance = |stiffness: f64| pressed.force / (stiffness * pressed.depth);
        match *self {
            Self::Distance { reference_distance, rig_stiffness } => Series {
                reach: reference_distance / pressed.contact_radius,
                compliance: rig_stiffness.map_or(0.0, compliance),
            },
            Self::Loop { loop_stiffness } => {
                Series { reach: f64::INFINITY, compliance: compliance(loop_stiffness) }
            }
        }
    }

    /// θ of the unworn contact at a stroke in m.
    fn threshold(&self, pressed: &UnwornContact, amplitude: f64) -> f64 {
        self.series(pressed).threshold(&pressed.shape, amplitude / pressed.slip()).0
    }
}

impl LineMotion {
    /// Converts the motion of a request to canonical form.
    #[expect(clippy::expect_used, reason = "the request was validated")]
    pub(super) fn resolve(motion: &Motion, pressed: &UnwornContact) -> Result<Self, Faults> {
        let reference = CanonicalReference::of(motion, pressed)?;
        let found = if let Some(blocks) = &motion.blocks.0 {
            match blocks {
                Blocks::Forces(blocks) => Self::Forces {
                    blocks: merged(
                        blocks,
                        |block| block.tangential_force.0,
                        |block| &mut block.cycles,
                    ),
                    reference,
                },
                Blocks::Strokes(blocks) => Self::Strokes {
                    blocks: merged(blocks, |block| block.amplitude.0, |block| &mut block.cycles),
                    reference: reference.expect("a stroke without a reference is refused"),
                },
            }
        } else if let Some(sliding) = motion.sliding_amplitude.0 {
            let least = LEAST_SLIDING * pressed.most_friction * pressed.depth;
            if sliding.0 < least {
                let detail = format!(
                    "is {:.4e} m. Below {least:.4e} m the elastic displacement of the surface matters, so the stroke \
                     needs a reference. Enter `amplitude` with `reference_distance`, the distance from the contact \
                     to the displacement sensor",
                    sliding.0
                );
                return Err(Faults::one("/motion/sliding_amplitude", detail));
            }
            Self::Sliding { sliding_amplitude: sliding.0, held: MotionHeld::Amplitude }
        } else if let Some(amplitude) = motion.amplitude.0 {
            Self::Stroke {
                amplitude: twelve_digits(amplitude.0),
                reference: reference.expect("a stroke without a reference is refused"),
                held: MotionHeld::Amplitude,
            }
        } else {
            let force = match (motion.tangential_force.0, motion.stick_ratio.0) {
                (Some(force), _) => force.0,
                (None, ratio) => {
                    let ratio = ratio.expect("a motion without any of these is refused");
                    force_at(ratio.0, pressed)?
                }
            };
            let held = MotionHeld::TangentialForce;
            Self::Force { tangential_force: force, reference, held }
        };
        found.check(pressed)?;
        Ok(found)
    }

    /// Checks that friction can carry the forces, and that the slip ring is wide enough.
    fn check(&self, pressed: &UnwornContact) -> Result<(), Faults> {
        let narrowest = ROUNDED * MIN_RING;
        let least = 1.0 - pressed.shape.image(1.0 - narrowest);
        for (place, threshold, is_force) in self.thresholds(pressed) {
            let pointer = format!("/motion{place}");
            if is_force && threshold >= 1.0 - LEAST_MARGIN {
                let most = pressed.friction * pressed.force;
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

    /// θ of each held motion with its place in the request, and whether it is a force.
    fn thresholds(&self, pressed: &UnwornContact) -> Vec<(String, f64, bool)> {
        let of_force = |force: f64| force / (pressed.friction * pressed.force);
        match self {
            Self::Force { tangential_force, .. } => {
                vec![("/tangential_force".to_owned(), of_force(*tangential_force), true)]
            }
            Self::Stroke { amplitude, reference, .. } => {
                vec![("/amplitude".to_owned(), reference.threshold(pressed, *amplitude), false)]
            }
            Self::Sliding { .. } => Vec::new(),
            Self::Forces { blocks, .. } => {
                let place = |i| format!("/blocks/{i}/tangential_force");
                let blocks = blocks.iter().enumerate();
                blocks.map(|(i, it)| (place(i), of_force(it.tangential_force.0), true)).collect()
            }
            Self::Strokes { blocks, reference } => {
                let threshold =
                    |block: &held::Block| reference.threshold(pressed, block.amplitude.0);
                let place = |i| format!("/blocks/{i}/amplitude");
                let blocks = blocks.iter().enumerate();
                blocks.map(|(i, block)| (place(i), threshold(block), false)).collect()
            }
        }
    }

    /// What displacements are measured against, in units of the unworn contact.
    pub(super) fn series(&self, pressed: &UnwornContact) -> Option<Series> {
        match self {
            Self::Force { reference, .. } | Self::Forces { reference, .. } => *reference,
            Self::Stroke { reference, .. } | Self::Strokes { reference, .. } => Some(*reference),
            Self::Sliding { .. } => None,
        }
        .map(|reference| reference.series(pressed))
    }

    /// The held quantities in units of the unworn contact, and the initial θ. `unit` is N₀.
    pub(super) fn control(&self, pressed: &UnwornContact, unit: f64) -> (Control, f64) {
        let thresholds = self.thresholds(pressed);
        let first = thresholds.first().map_or(1.0, |(_, threshold, _)| *threshold);
        let stroke = |amplitude: f64| amplitude / pressed.slip();
        let blocks = |cycles: Vec<f64>, strokes: Option<Vec<f64>>| {
            let mut end = 0.0;
            let blocks = cycles.into_iter().zip(&thresholds).enumerate();
            let blocks = blocks.map(|(i, (cycles, (_, threshold, _)))| {
                end += cycles;
                let stroke = strokes.as_ref().map(|strokes| strokes[i]);
                Block { threshold: *threshold, stroke, end: end / unit }
            });
            blocks.collect::<Vec<_>>()
        };
        let tangential = match self {
            Self::Force { .. } => Tangential::Amplitude,
            Self::Stroke { amplitude, .. } => Tangential::Stroke(stroke(*amplitude)),
            Self::Sliding { sliding_amplitude, .. } => {
                Tangential::Sliding(stroke(*sliding_amplitude))
            }
            // A single block lasts until the end of the run, so it is a constant motion.
            Self::Forces { blocks, .. } if blocks.len() == 1 => Tangential::Amplitude,
            Self::Strokes { blocks, .. } if blocks.len() == 1 => {
                Tangential::Stroke(stroke(blocks[0].amplitude.0))
            }
            Self::Forces { blocks: given, .. } => {
                let cycles = given.iter().map(|block| block.cycles.0).collect();
                Tangential::Blocks(blocks(cycles, None))
            }
            Self::Strokes { blocks: given, .. } => {
                let cycles = given.iter().map(|block| block.cycles.0).collect();
                let strokes = given.iter().map(|block| stroke(block.amplitude.0)).collect();
                Tangential::Blocks(blocks(cycles, Some(strokes)))
            }
        };
        // The force is the level of the springs.
        (Control { normal: Normal::Depth, tangential }, first)
    }

    /// The initial amplitude of the contact in m. NaN if it is not known.
    pub(super) fn amplitude(&self, pressed: &UnwornContact) -> f64 {
        let series = self.series(pressed);
        let rig = series.map_or(0.0, |series| series.rig());
        let first = self.thresholds(pressed).first().map_or(1.0, |(_, threshold, _)| *threshold);
        let stroke = match self {
            Self::Stroke { amplitude, .. } => *amplitude,
            Self::Strokes { blocks, .. } => blocks[0].amplitude.0,
            Self::Sliding { sliding_amplitude, .. } => return *sliding_amplitude,
            Self::Force { .. } | Self::Forces { .. } => series
                .map_or(f64::NAN, |series| series.stroke(&pressed.shape, first) * pressed.slip()),
        };
        stroke - rig * first * pressed.slip()
    }

    /// The cycle at which the last block ends.
    pub(super) fn end(&self) -> Option<f64> {
        let cycles: f64 = match self {
            Self::Forces { blocks, .. } => blocks.iter().map(|block| block.cycles.0).sum(),
            Self::Strokes { blocks, .. } => blocks.iter().map(|block| block.cycles.0).sum(),
            _ => return None,
        };
        Some(twelve_digits(cycles))
    }

    /// The same motion, as a constant one if it has a single block.
    pub(super) fn constant(self) -> Self {
        match self {
            Self::Forces { blocks, reference } if blocks.len() == 1 => {
                let held = MotionHeld::TangentialForce;
                Self::Force { tangential_force: blocks[0].tangential_force.0, reference, held }
            }
            Self::Strokes { blocks, reference } if blocks.len() == 1 => Self::Stroke {
                amplitude: blocks[0].amplitude.0,
                reference,
                held: MotionHeld::Amplitude,
            },
            other => other,
        }
    }

    /// Whether the motion has blocks.
    pub(super) fn has_blocks(&self) -> bool {
        matches!(self, Self::Forces { .. } | Self::Strokes { .. })
    }
}

/// The tangential force at a stick ratio.
fn force_at(ratio: f64, pressed: &UnwornContact) -> Result<f64, Faults> {
    let least = pressed.shape.image_inverse(LEAST_MARGIN);
    if ratio <= least {
        let detail = format!(
            "is {ratio}, but the whole contact slips if the ratio is not above {least:.4e}. Enter a larger ratio, or \
             `sliding_amplitude` for gross slip"
        );
        return Err(Faults::one("/motion/stick_ratio", detail));
    }
    let most = pressed.friction * pressed.force;
    Ok(twelve_digits(most * (1.0 - pressed.shape.image(ratio))))
}

/// The blocks, of which consecutive ones of the same motion are merged.
pub(super) fn merged<T: Copy>(
    given: &[T],
    motion: impl Fn(&T) -> f64,
    cycles: impl Fn(&mut T) -> &mut Rounded<BlockCycles>,
) -> Vec<T> {
    let mut blocks: Vec<T> = Vec::new();
    for block in given {
        let mut block = *block;
        match blocks.last_mut() {
            Some(last) if motion(last).total_cmp(&motion(&block)).is_eq() => {
                let added = cycles(&mut block).0;
                cycles(last).0 = twelve_digits(cycles(last).0 + added);
            }
            _ => blocks.push(block),
        }
    }
    blocks
}
