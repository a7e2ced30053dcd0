//! The motion in canonical form.
//!
//! # Equations
//! ```text
//! Δ = G*U/(μE*d₀),   Q = 2μE*a₀d₀ ∫ min(Δ, y₀) dx,   Q < μF                        (10)
//! rig   U_rig = U + Q(U)/k_rig
//! ```
//! A line contact, in units of h₀ = 2F/(πE*) (F per length) and μh₀, with the stroke of the unworn contact at θ:
//! ```text
//! θ = Q/(μF)
//! U = Q/k + (2μ/πE*) ∫ (y_c − y)₊ L ds/(s √(L²−s²)) over c…L                       reference_distance L, rig_stiffness k
//! U = Q/S + (2μ/πE*) [∫ (y_c − y)₊ ds/s over c…a − y_c ln(a/a₀)]                     loop_stiffness S
//! s(x) = U + μ [f + w − f(0) − w(0)]                                               sliding_amplitude
//! ```
//!
//! # Units
//! SI. Forces, stiffnesses and energies of a line contact are totals over the length.

use std::sync::Arc;

use serde::Serialize;

use super::pressed::UnwornContact;
use crate::contact::record::DisplacementRecord;
use crate::contact::{Block, Control, Held, Series};
use crate::input::{Faults, MotionHeld, Reference, Valid, held};
use crate::numeric::twelve_digits;

/// The motion in canonical form.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct CanonicalMotion {
    #[serde(flatten)]
    pub(super) moves: Moves,
    /// What lies between the contact and the place of its amplitude.
    #[serde(flatten)]
    pub(super) reference: Option<Reference>,
    /// Apertures, blocks and records do not say what is held.
    #[serde(skip_serializing_if = "Option::is_none")]
    held: Option<MotionHeld>,
}

/// What moves the contact.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Moves {
    Amplitude(f64),
    SlidingAmplitude(f64),
    LoopAperture(f64),
    TangentialForce(f64),
    Blocks(Vec<held::BlockInput>),
    Reversals(Vec<f64>),
}

impl From<&held::BlockInput> for Moves {
    fn from(block: &held::BlockInput) -> Self {
        let kind = match block.member() {
            "tangential_force" => Self::TangentialForce,
            "loop_aperture" => Self::LoopAperture,
            _ => Self::Amplitude,
        };
        kind(block.held())
    }
}

impl CanonicalMotion {
    pub(super) fn new(moves: Moves, reference: Option<Reference>) -> Self {
        let held = match moves {
            Moves::Amplitude(_) | Moves::SlidingAmplitude(_) => Some(MotionHeld::Amplitude),
            Moves::TangentialForce(_) => Some(MotionHeld::TangentialForce),
            Moves::LoopAperture(_) | Moves::Blocks(_) | Moves::Reversals(_) => None,
        };
        Self { moves, reference, held }
    }

    /// The same motion, as a constant one if it has a single block.
    pub(super) fn constant(self) -> Self {
        match &self.moves {
            Moves::Blocks(blocks) if blocks.len() == 1 => {
                Self::new((&blocks[0]).into(), self.reference)
            }
            _ => self,
        }
    }

    /// The held quantities in units of the unworn contact, the initial amplitude U of the contact in m, and N₀.
    pub(super) fn control(
        &self,
        pressed: &UnwornContact,
        wear_coefficient: f64,
    ) -> Valid<(Control, f64, f64)> {
        let block = |moves: &Moves, end: f64| {
            let (held, threshold) = self.held(moves, pressed)?;
            Ok(Block { held, threshold, end })
        };
        let mut blocks = match &self.moves {
            Moves::Blocks(blocks) if blocks.len() > 1 => {
                let mut end = 0.0;
                let next = |given: &held::BlockInput| {
                    end += given.cycles.0;
                    block(&given.into(), end)
                };
                blocks.iter().map(next).collect::<Valid<Vec<Block>>>()?
            }
            moves => vec![block(moves, f64::INFINITY)?],
        };
        let amplitude = self.amplitude(pressed, blocks[0].threshold);
        let unit = pressed.cycles(amplitude, wear_coefficient);
        for block in &mut blocks {
            block.end /= unit;
        }
        let control = Control { normal: pressed.normal, blocks: blocks.into() };
        Ok((control, amplitude, unit))
    }

    /// What a part of this motion holds, and the threshold of the springs of the unworn contact.
    pub(super) fn held(&self, moves: &Moves, pressed: &UnwornContact) -> Valid<(Held, f64)> {
        match moves {
            Moves::Blocks(blocks) => self.held(&(&blocks[0]).into(), pressed),
            Moves::Reversals(reversals) => {
                let record = record_of(reversals)?;
                let threshold = pressed.threshold(record.amplitude);
                Ok((Held::Record(Arc::new(record)), threshold))
            }
            Moves::SlidingAmplitude(amplitude) => {
                Ok((Held::Sliding(amplitude / pressed.scales.slip()), 1.0))
            }
            Moves::TangentialForce(force) => pressed.under_force(*force),
            Moves::LoopAperture(aperture) => {
                Ok(pressed.at_aperture(*aperture, self.series(pressed)))
            }
            Moves::Amplitude(amplitude) => Ok(match (self.series(pressed), self.reference) {
                (Some(series), _) => {
                    let stroke = amplitude / pressed.scales.slip();
                    (Held::Stroke(stroke), series.threshold(&pressed.shape, stroke).0)
                }
                (None, Some(Reference::Rig { rig_stiffness })) => {
                    pressed.behind_rig(*amplitude, rig_stiffness)
                }
                (None, _) => (Held::Threshold, pressed.threshold(*amplitude)),
            }),
        }
    }

    /// The initial amplitude of the contact in m. NaN if it is not known.
    fn amplitude(&self, pressed: &UnwornContact, threshold: f64) -> f64 {
        let given = match &self.moves {
            Moves::SlidingAmplitude(amplitude) => return *amplitude,
            Moves::Amplitude(amplitude) => Some(*amplitude),
            Moves::Blocks(blocks) => {
                let first = Self::new((&blocks[0]).into(), self.reference);
                return first.amplitude(pressed, threshold);
            }
            _ => None,
        };
        let slip = pressed.scales.slip();
        if pressed.scales.length.is_none() {
            // An amplitude in the request is taken without rounding.
            let of_contact = given.filter(|_| self.reference.is_none());
            return of_contact.unwrap_or(threshold * slip);
        }
        let series = self.series(pressed);
        let stroke = |series: Series| series.stroke(&pressed.shape, threshold) * slip;
        let mut stroke = given.unwrap_or_else(|| series.map_or(f64::NAN, stroke));
        if let (Moves::LoopAperture(aperture), Some(series)) = (&self.moves, series) {
            stroke += series.at_aperture(&pressed.shape, aperture / slip).1 * slip;
        }
        stroke - series.map_or(0.0, |series| series.rig()) * threshold * slip
    }

    /// What the displacements of a line contact are measured against, in units of the unworn contact.
    pub(super) fn series(&self, pressed: &UnwornContact) -> Option<Series> {
        // μF moves a spring of this stiffness by F/(S h₀) in μh₀.
        let scales = &pressed.scales;
        let compliance = |stiffness: f64| scales.force() / (stiffness * scales.indentation_depth);
        match self.reference? {
            Reference::Distance { reference_distance, rig_stiffness } => Some(Series {
                reach: reference_distance / scales.contact_radius,
                compliance: rig_stiffness.map_or(0.0, compliance),
            }),
            Reference::Loop { loop_stiffness } => {
                Some(Series { reach: f64::INFINITY, compliance: compliance(loop_stiffness) })
            }
            Reference::Rig { .. } => None,
        }
    }

    /// The member of a request whose amplitudes differ from cycle to cycle.
    pub(super) fn varying(&self) -> Option<&'static str> {
        match self.moves {
            Moves::Blocks(_) => Some("blocks"),
            Moves::Reversals(_) => Some("reversals"),
            _ => None,
        }
    }

    /// The cycle at which the last block ends.
    pub(super) fn end(&self) -> Option<f64> {
        let Moves::Blocks(blocks) = &self.moves else { return None };
        Some(twelve_digits(blocks.iter().map(|block| block.cycles.0).sum()))
    }
}

/// The blocks, of which consecutive ones of the same motion are merged.
pub(super) fn merged(given: &[held::BlockInput]) -> Vec<held::BlockInput> {
    let mut blocks: Vec<held::BlockInput> = Vec::new();
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

pub(super) fn record_of(reversals: &[f64]) -> Valid<DisplacementRecord> {
    DisplacementRecord::new(reversals).ok_or_else(|| {
        Faults::one(
            "/motion/reversals",
            "must not all be the same position. Enter at least two different positions",
        )
    })
}
