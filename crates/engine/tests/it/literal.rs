//! Direct simulation of (14)–(16): every spring moves through every cycle in small steps.
//!
//! The simulation is slow. It does not use the closed form, so it is an independent check.

use fretwork_engine::contact::unworn::Contact;

/// A row of springs under one oscillating indenter.
pub struct Springs {
    /// Image g of each spring.
    image: Vec<f64>,
    /// Deflection u_x of each spring, in units in which the friction limit equals the compression.
    deflection: Vec<f64>,
    /// Whether each spring wears. Springs outside ã do not wear.
    wearing: Vec<bool>,
    amplitude: f64,
    rate: f64,
    steps: u32,
}

impl Springs {
    /// Springs at `positions` (in a₀), at the first reversal: (15) at t = 0.
    ///
    /// The unit of tangential lengths is μE*d₀/G*. In this unit a spring sticks while its
    /// deflection is below its compression y, and the amplitude is Δ. Over one full slip path 4Δ,
    /// (14) must then give ξ/ã per N₀ cycles.
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

    /// Runs `cycles` cycles of `steps` steps each.
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

    /// Applies (16), and then (14) with the slip path of this step.
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

    /// Image g of each spring.
    pub fn images(&self) -> &[f64] {
        &self.image
    }
}
