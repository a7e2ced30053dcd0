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

/// The motion of a line contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct LineMotion {
    #[serde(flatten)]
    moves: Moves,
    /// What displacements are measured against.
    #[serde(flatten)]
    reference: Option<Reference>,
    /// Blocks do not say what is held.
    #[serde(skip_serializing_if = "Option::is_none")]
    held: Option<MotionHeld>,
}

/// What moves the contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Moves {
    Amplitude(f64),
    SlidingAmplitude(f64),
    TangentialForce(f64),
    Blocks(Vec<held::Block>),
}

/// Checks that the reference is outside of the contact, and that a loop is not stiffer than the contact.
fn check_reference(reference: Reference, pressed: &UnwornContact) -> Result<(), Faults> {
    let most = pressed.force / (LEAST_COMPLIANCE * pressed.depth);
    match reference {
        Reference::Distance { reference_distance: distance, .. }
            if distance < NEAREST * pressed.contact_radius =>
        {
            let detail = format!(
                "is {distance:e} m, but the half-width of the contact is {:.4e} m. Enter at least {NEAREST} \
                 times as much: the distance from the middle of the contact to the place of the displacement \
                 sensor",
                pressed.contact_radius
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

impl LineMotion {
    fn new(moves: Moves, reference: Option<Reference>) -> Self {
        let held = match moves {
            Moves::Amplitude(_) | Moves::SlidingAmplitude(_) => Some(MotionHeld::Amplitude),
            Moves::TangentialForce(_) => Some(MotionHeld::TangentialForce),
            Moves::Blocks(_) => None,
        };
        Self { moves, reference, held }
    }

    /// Converts the motion of a request to canonical form.
    #[expect(clippy::expect_used, reason = "the request was validated")]
    pub(super) fn resolve(motion: &Motion, pressed: &UnwornContact) -> Result<Self, Faults> {
        let reference = motion.reference();
        reference.map_or(Ok(()), |reference| check_reference(reference, pressed))?;
        let moves = if let Some(Blocks(blocks)) = &motion.blocks.0 {
            Moves::Blocks(merged(blocks))
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
            Moves::SlidingAmplitude(sliding.0)
        } else if let Some(amplitude) = motion.amplitude.0 {
            Moves::Amplitude(twelve_digits(amplitude.0))
        } else if let Some(force) = motion.tangential_force.0 {
            Moves::TangentialForce(force.0)
        } else {
            let ratio = motion.stick_ratio.0.expect("a motion without any of these is refused");
            Moves::TangentialForce(force_at(ratio.0, pressed)?)
        };
        let found = Self::new(moves, reference);
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
    #[expect(clippy::expect_used, reason = "a stroke without a reference is refused")]
    fn thresholds(&self, pressed: &UnwornContact) -> Vec<(String, f64, bool)> {
        let threshold = |held: f64, is_force: bool| {
            if is_force {
                return held / (pressed.friction * pressed.force);
            }
            let series = self.series(pressed).expect("a stroke has a reference");
            series.threshold(&pressed.shape, held / pressed.slip()).0
        };
        match &self.moves {
            Moves::TangentialForce(force) => {
                vec![("/tangential_force".to_owned(), threshold(*force, true), true)]
            }
            Moves::Amplitude(amplitude) => {
                vec![("/amplitude".to_owned(), threshold(*amplitude, false), false)]
            }
            Moves::SlidingAmplitude(_) => Vec::new(),
            Moves::Blocks(blocks) => {
                let of_block = |(i, block): (usize, &held::Block)| {
                    let is_force = block.is_force();
                    let place = format!("/blocks/{i}/{}", block.member());
                    (place, threshold(block.held(), is_force), is_force)
                };
                blocks.iter().enumerate().map(of_block).collect()
            }
        }
    }

    /// What displacements are measured against, in units of the unworn contact.
    pub(super) fn series(&self, pressed: &UnwornContact) -> Option<Series> {
        // μF moves a spring of this stiffness by F/(S h₀) in μh₀.
        let compliance = |stiffness: f64| pressed.force / (stiffness * pressed.depth);
        Some(match self.reference? {
            Reference::Distance { reference_distance, rig_stiffness } => Series {
                reach: reference_distance / pressed.contact_radius,
                compliance: rig_stiffness.map_or(0.0, compliance),
            },
            Reference::Loop { loop_stiffness } => {
                Series { reach: f64::INFINITY, compliance: compliance(loop_stiffness) }
            }
        })
    }

    /// The held quantities in units of the unworn contact, and the initial θ. `unit` is N₀.
    pub(super) fn control(&self, pressed: &UnwornContact, unit: f64) -> (Control, f64) {
        let thresholds = self.thresholds(pressed);
        let first = thresholds.first().map_or(1.0, |(_, threshold, _)| *threshold);
        let stroke = |amplitude: f64| amplitude / pressed.slip();
        // A single block lasts until the end of the run, so it is a constant motion.
        let tangential = match self.clone().constant().moves {
            Moves::TangentialForce(_) => Tangential::Amplitude,
            Moves::Amplitude(amplitude) => Tangential::Stroke(stroke(amplitude)),
            Moves::SlidingAmplitude(amplitude) => Tangential::Sliding(stroke(amplitude)),
            Moves::Blocks(blocks) => {
                let mut end = 0.0;
                let block = |(block, (_, threshold, _)): (held::Block, (_, f64, _))| {
                    end += block.cycles.0;
                    let stroke = (!block.is_force()).then(|| stroke(block.held()));
                    Block { threshold, stroke, end: end / unit }
                };
                Tangential::Blocks(blocks.into_iter().zip(thresholds).map(block).collect())
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
        let stroke = match &self.moves {
            Moves::Amplitude(amplitude) => *amplitude,
            Moves::SlidingAmplitude(amplitude) => return *amplitude,
            Moves::Blocks(blocks) if !blocks[0].is_force() => blocks[0].held(),
            Moves::TangentialForce(_) | Moves::Blocks(_) => series
                .map_or(f64::NAN, |series| series.stroke(&pressed.shape, first) * pressed.slip()),
        };
        stroke - rig * first * pressed.slip()
    }

    /// The cycle at which the last block ends.
    pub(super) fn end(&self) -> Option<f64> {
        let Moves::Blocks(blocks) = &self.moves else { return None };
        Some(end_of(blocks))
    }

    /// The same motion, as a constant one if it has a single block.
    pub(super) fn constant(self) -> Self {
        match &self.moves {
            Moves::Blocks(blocks) if blocks.len() == 1 => {
                let moves =
                    if blocks[0].is_force() { Moves::TangentialForce } else { Moves::Amplitude };
                Self::new(moves(blocks[0].held()), self.reference)
            }
            _ => self,
        }
    }

    /// Whether the motion has blocks.
    pub(super) fn has_blocks(&self) -> bool {
        matches!(self.moves, Moves::Blocks(_))
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
pub(super) fn merged(given: &[held::Block]) -> Vec<held::Block> {
    let mut blocks: Vec<held::Block> = Vec::new();
    for block in given {
        match blocks.last_mut() {
            Some(last) if last.held().total_cmp(&block.held()).is_eq() => {
                last.cycles.0 = twelve_digits(last.cycles.0 + block.cycles.0);
            }
            _ => blocks.push(*block),
        }
    }
    blocks
}

/// The cycle at which the last of these blocks ends.
pub(super) fn end_of(blocks: &[held::Block]) -> f64 {
    twelve_digits(blocks.iter().map(|block| block.cycles.0).sum())
}
