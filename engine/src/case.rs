//! A scenario made ready for computing: without units, with the scales that lead back, and what it costs.

use crate::contact::control::{Control, Final, Tangential};
use crate::contact::hysteresis::{Backbone, ROW_POINTS};
use crate::contact::row::UnwornSums;
use crate::contact::unworn::{Contact, Regime};
use crate::solver::events::StopCondition;
use crate::solver::stepped::law::Law;
use crate::solver::stepped::march::March;

/// Relative error at which the simplified rule is marched, where it has no closed form.
const RULE_TOLERANCE: f64 = 1e-3;
/// How many runs of the simplified rule a comparison takes.
pub(crate) const COMPARISON_RUNS: usize = 31;
/// Radii of the simplified rule in a comparison, at most: enough for the volume.
const COMPARISON_POINTS: usize = 256;

/// The scales that make the contact dimensionless, and what multiplies results back into SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// a₀ in m.
    pub contact_radius: f64,
    /// d₀ in m.
    pub indentation_depth: f64,
    /// N₀.
    pub cycles: f64,
    /// U in m.
    pub amplitude: f64,
    /// E* in Pa.
    pub normal_modulus: f64,
    /// G* in Pa.
    pub tangential_modulus: f64,
    /// μ.
    pub friction: f64,
    /// k_w in 1/Pa.
    pub wear_coefficient: f64,
}

impl Scales {
    /// E*a₀d₀ in N.
    #[must_use]
    pub fn force(&self) -> f64 {
        self.normal_modulus * self.contact_radius * self.indentation_depth
    }

    /// E*d₀/a₀ in Pa.
    #[must_use]
    pub fn pressure(&self) -> f64 {
        self.normal_modulus * self.indentation_depth / self.contact_radius
    }

    /// a₀²d₀ in m³.
    #[must_use]
    pub fn volume(&self) -> f64 {
        self.contact_radius * self.contact_radius * self.indentation_depth
    }

    /// U at Δ = 1: the amplitude from which the whole contact slips, in m.
    #[must_use]
    pub fn gross_slip_amplitude(&self) -> f64 {
        self.friction * self.normal_modulus / self.tangential_modulus * self.indentation_depth
    }

    /// Q from ∫ min(Δ, y).
    pub(crate) fn tangential(&self, half: f64) -> f64 {
        2.0 * self.friction * half * self.force()
    }

    /// W from ∫ y(Δ − y)₊: 8μE*·(μE*/G*)·a₀d₀² times it.
    pub(crate) fn energy(&self, integral: f64) -> f64 {
        let lost = self.friction * self.force();
        8.0 * lost * self.gross_slip_amplitude() * integral
    }
}

/// How wear is computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// The rule (14).
    Simplified {
        /// ξ.
        xi: f64,
    },
    /// Local pressure times local slip.
    Exact {
        /// The relative error aimed at.
        tolerance: f64,
        /// ξ of the simplified rule that is run beside it, if it is.
        compare: Option<f64>,
    },
}

impl Method {
    /// The wear law of this method.
    #[must_use]
    pub fn law(&self) -> Law {
        match *self {
            Self::Simplified { xi } => Law::Simplified(xi),
            Self::Exact { .. } => Law::Exact,
        }
    }
}

/// A scenario made ready for computing: dimensionless, with the scales that lead back.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// The unworn contact.
    pub contact: Contact,
    /// What is held.
    pub control: Control,
    /// The state that wear tends to, where it is known.
    pub tends_to: Option<Final>,
    /// Wear at which the run ends early.
    pub until: StopCondition,
    /// The part of the depth that the first body bears, where it is asked for.
    pub share: Option<f64>,
    /// The way back to SI.
    pub scales: Scales,
    /// How wear is computed.
    pub method: Method,
    /// Output radii.
    pub points: usize,
    /// The instants in cycles, 0 first.
    pub cycles: Vec<f64>,
    /// Whether each instant carries profiles; all false where the answer has none at all.
    pub profiles: Vec<bool>,
}

impl Case {
    /// Regime of the unworn state.
    #[must_use]
    pub fn regime(&self) -> Regime {
        self.contact.regime
    }

    /// Sums over the unworn springs.
    #[must_use]
    pub fn unworn(&self) -> UnwornSums {
        let mut sums = match &self.control.tangential {
            Tangential::Record(record) => {
                UnwornSums::of(&self.contact, Some(&|ratio| record.slip(ratio)))
            }
            _ => UnwornSums::of(&self.contact, None),
        };
        if let Tangential::Force(half) = self.control.tangential {
            sums.tangential = half;
        }
        sums
    }

    /// Whether an instant at which the run ends carries profiles, since it is the last.
    pub(crate) fn shows_end(&self, n: f64, end: f64) -> bool {
        n >= end && self.profile_rows() > 0
    }

    /// The relative error aimed at in time steps.
    #[must_use]
    pub fn tolerance(&self) -> f64 {
        match self.method {
            Method::Simplified { .. } => RULE_TOLERANCE,
            Method::Exact { tolerance, .. } => tolerance,
        }
    }

    /// How many springs slip, at most: each makes a corner of the loops.
    fn springs(&self) -> usize {
        if self.law() != Law::Exact && self.control.is_closed() {
            return ROW_POINTS;
        }
        let cells = March::cells_for(&self.contact, &self.control, self.law(), self.tolerance());
        cells.max(ROW_POINTS)
    }

    /// How the contact wears in time steps.
    #[must_use]
    pub fn law(&self) -> Law {
        self.method.law()
    }

    /// The largest amplitude over that at N = 0.
    pub(crate) fn largest_amplitude(&self) -> f64 {
        let Tangential::Blocks(blocks) = &self.control.tangential else { return 1.0 };
        let most = blocks.iter().map(|block| block.threshold).fold(0.0, f64::max);
        (most / self.contact.threshold).max(1.0)
    }

    /// How many times a free spring slips the path of one harmonic cycle.
    pub(crate) fn loops_per_cycle(&self) -> f64 {
        match &self.control.tangential {
            Tangential::Record(record) => record.slip(0.0),
            _ => 1.0,
        }
    }

    /// The run of the simplified rule that an exact run is compared with: the same instants under the
    /// same control.
    pub(crate) fn rule(&self, xi: f64) -> Self {
        Self {
            method: Method::Simplified { xi },
            points: self.points.min(COMPARISON_POINTS),
            profiles: vec![false; self.profiles.len()],
            until: StopCondition::default(),
            share: None,
            ..self.clone()
        }
    }

    /// Rows of each profile matrix.
    #[must_use]
    pub fn profile_rows(&self) -> usize {
        self.profiles.iter().filter(|carries| **carries).count()
    }

    /// Multiplications in matrices, about: what a run costs.
    #[must_use]
    pub fn operations(&self) -> f64 {
        let half_square = (self.points * self.points) as f64 / 2.0;
        let rows = self.profile_rows();
        let output = (self.points * rows + self.cycles.len()) as f64;
        let march = |law, tolerance| {
            let last = self.normalized_end();
            March::operations(&self.contact, &self.control, law, tolerance, last) + output
        };
        match self.method {
            Method::Simplified { .. } if self.control.is_closed() => {
                half_square * (self.cycles.len() + rows) as f64
            }
            Method::Simplified { xi } => march(Law::Simplified(xi), RULE_TOLERANCE),
            Method::Exact { tolerance, compare } => {
                let beside =
                    compare.map_or(0.0, |xi| self.rule(xi).operations() * COMPARISON_RUNS as f64);
                march(Law::Exact, tolerance) + beside
            }
        }
    }

    /// Ñ of the last instant.
    #[must_use]
    pub fn normalized_end(&self) -> f64 {
        self.cycles[self.cycles.len() - 1] / self.scales.cycles
    }

    /// About how many bytes the answer takes as JSON.
    #[must_use]
    pub fn answer_bytes(&self) -> usize {
        const NUMBER: usize = 22;
        let rows = self.profile_rows();
        let curves = if rows == 0 { 0 } else { 3 + 5 * rows };
        let loops = rows * (2 * Backbone::points(self.springs()) + 3);
        4096 + NUMBER * (self.points * curves + loops + 13 * self.cycles.len())
    }
}
