//! (14)–(16) taken literally: every spring is dragged through every cycle in small steps.
//!
//! Slow, and written without a thought for the closed form, so that it can judge it.

use fretwork_engine::contact::unworn::Contact;

/// A row of springs under one oscillating indenter.
pub struct Springs {
    /// g of each spring.
    image: Vec<f64>,
    /// u_x of each spring, in units in which the friction limit is its compression.
    deflection: Vec<f64>,
    /// Springs further out than ã do not wear.
    wearing: Vec<bool>,
    amplitude: f64,
    rate: f64,
    steps: u32,
}

impl Springs {
    /// Springs at `positions` (in a₀), at the first reversal: (15) at t = 0.
    ///
    /// Tangential lengths are measured in μE*d₀/G*, so that a spring sticks while its deflection is
    /// below its compression y, and the amplitude is Δ. Then (14) over one full slip path 4Δ must
    /// come to ξ/ã per N₀ cycles.
    pub fn new(
        contact: &Contact,
        positions: &[f64],
        xi: f64,
        cycles_per_unit: u32,
        steps: u32,
    ) -> Self {
        let image: Vec<f64> = positions.iter().map(|x| contact.shape.image(*x)).collect();
        let amplitude = contact.threshold;
        let deflection = image.iter().map(|g| amplitude.min((1.0 - g).max(0.0))).collect();
        let wearing = positions.iter().map(|x| *x < contact.limit.radius).collect();
        let rate = xi / contact.limit.radius / (4.0 * amplitude * f64::from(cycles_per_unit));
        Self { image, deflection, wearing, amplitude, rate, steps }
    }

    /// Runs some cycles of `steps` steps each.
    pub fn run(&mut self, cycles: u32) {
        let path: Vec<f64> = (0..=self.steps)
            .map(|k| {
                let phase = 2.0 * std::f64::consts::PI * f64::from(k) / f64::from(self.steps);
                self.amplitude * phase.cos()
            })
            .collect();
        for _ in 0..cycles {
            for step in path.windows(2) {
                self.step(step[1] - step[0]);
            }
        }
    }

    /// (16), then (14) with the path slipped in this step.
    fn step(&mut self, moved: f64) {
        for ((image, deflection), wearing) in
            self.image.iter_mut().zip(&mut self.deflection).zip(&self.wearing)
        {
            let compression = 1.0 - *image;
            let limit = compression.max(0.0);
            let before = *deflection;
            *deflection = (before + moved).clamp(-limit, limit);
            let slipped = (moved - (*deflection - before)).abs();
            if *wearing {
                *image += self.rate * compression * slipped;
            }
        }
    }

    /// g of each spring.
    pub fn images(&self) -> &[f64] {
        &self.image
    }
}
