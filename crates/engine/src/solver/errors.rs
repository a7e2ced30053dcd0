//! Estimated numerical errors of a run.

/// Estimated relative errors of the wear volume and of the largest wear depth.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RunErrors {
    /// The relative error of V.
    pub volume: f64,
    /// The relative error of the largest wear depth.
    pub depth: f64,
}

impl RunErrors {
    /// The relative differences of two volumes and of two depths. In each pair, the second value is the known one. The
    /// difference is 0 without wear.
    pub(crate) fn between(volume: [f64; 2], depth: [f64; 2]) -> Self {
        let apart = |[other, known]: [f64; 2]| {
            if known > 0.0 { (other / known - 1.0).abs() } else { 0.0 }
        };
        Self { volume: apart(volume), depth: apart(depth) }
    }

    /// The larger of the two volume errors, and the larger of the two depth errors.
    pub(crate) fn or(self, other: Self) -> Self {
        Self { volume: self.volume.max(other.volume), depth: self.depth.max(other.depth) }
    }

    /// Both errors multiplied by a factor.
    pub(crate) fn times(self, factor: f64) -> Self {
        Self { volume: factor * self.volume, depth: factor * self.depth }
    }
}
