//! Straight lines through the origin, y = αx.
//!
//! In gross slip the wear volume is proportional to the dissipated energy, V = αΣE, so a table of both is all that α
//! needs.
//!
//! # Equations
//! ```text
//! α = Σ wxy / Σ wx²,   S = Σ w (y − αx)²,   standard error² = S / ((n − 1) Σ wx²)
//! R² = 1 − S / Σ w (y − ȳ)²,   ȳ = Σ wy / Σ w
//! ```
//!
//! # Sources
//! S. Fouvry, C. Paulin, T. Liskiewicz, Tribology International 40 (2007) 1428: wear volume over dissipated energy.

use super::fisher;

/// A straight line through the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// The slope α.
    pub slope: f64,
    /// Its standard error, from the scatter around the line.
    pub standard_error: f64,
    /// The lower and the upper end of its interval.
    pub interval: [f64; 2],
    /// The share of the variance that the line explains.
    pub r_squared: f64,
}

impl Line {
    /// The line through points (x, y, weight). `None` if there are fewer than two points, or if all y are equal.
    pub fn through(points: &[(f64, f64, f64)], confidence: f64) -> Option<Self> {
        let freedom = points.len().checked_sub(1).filter(|freedom| *freedom > 0)?;
        let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
            points.iter().map(|(x, y, weight)| weight * of(*x, *y)).sum()
        };
        let square = sum(&|x, _| x * x);
        let slope = sum(&|x, y| x * y) / square;
        let rest = sum(&|x, y| (y - slope * x) * (y - slope * x));
        let mean = sum(&|_, y| y) / sum(&|_, _| 1.0);
        let standard_error = (rest / (freedom as f64 * square)).sqrt();
        let half = standard_error * fisher::factor(confidence, Some(freedom));
        let line = Self {
            slope,
            standard_error,
            interval: [slope - half, slope + half],
            r_squared: 1.0 - rest / sum(&|_, y| (y - mean) * (y - mean)),
        };
        line.r_squared.is_finite().then_some(line)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// (ΣE in J, V in µm³) at 5 Hz: C. van Peteghem et al., Wear 271 (2011) 1535, from a digest of the paper.
    const VAN_PETEGHEM: [(f64, f64); 5] = [
        (17_200.0, 1.81e9),
        (7_010.0, 0.888e9),
        (10_400.0, 1.14e9),
        (1_130.0, 0.117e9),
        (24_500.0, 2.18e9),
    ];

    /// (ΣE in J, V in µm³) of TiC, digitised from Fouvry et al. (2007).
    const TIC: [(f64, f64); 18] = [
        (32.0, 0.85e4),
        (48.0, 2.4e4),
        (53.0, 2.7e4),
        (62.0, 3.3e4),
        (73.0, 4.4e4),
        (93.0, 4.85e4),
        (103.0, 5.3e4),
        (105.0, 5.75e4),
        (107.0, 5.75e4),
        (132.0, 5.9e4),
        (133.0, 6.15e4),
        (143.0, 6.35e4),
        (152.0, 5.7e4),
        (163.0, 5.8e4),
        (188.0, 7.95e4),
        (215.0, 8.2e4),
        (215.0, 8.4e4),
        (263.0, 9.85e4),
    ];

    fn line(points: &[(f64, f64)], weight: fn(f64) -> f64) -> Line {
        let points: Vec<_> = points.iter().map(|(x, y)| (*x, *y, weight(*y))).collect();
        Line::through(&points, 0.95).unwrap()
    }

    #[test]
    fn published_energy_coefficients_are_found() {
        // Published: 97 500 µm³/J with R² = 0.95, and 415.1 µm³/J. The other numbers were computed with NumPy 2.4.6.
        let found = line(&VAN_PETEGHEM, |_| 1.0);
        assert!((found.slope - 97_428.942).abs() < 1e-3, "{found:?}");
        assert!((found.r_squared - 0.954_272_931).abs() < 1e-9, "{found:?}");
        assert!((found.standard_error - 5_311.412_881).abs() < 1e-5, "{found:?}");
        assert!((found.interval[1] - found.slope - 14_746.846_296).abs() < 1e-5, "{found:?}");
        let found = line(&VAN_PETEGHEM, |y| 1.0 / (y * y));
        assert!((found.slope - 104_113.515).abs() < 1e-3, "{found:?}");
        assert!((found.r_squared - 0.980_409_803).abs() < 1e-9, "{found:?}");
        let found = line(&TIC, |_| 1.0);
        assert!((found.slope - 417.492_484).abs() < 1e-6, "{found:?}");
        assert!((found.r_squared - 0.855_102_31).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn points_without_scatter_or_without_number_give_no_line() {
        assert_eq!(Line::through(&[(1.0, 2.0, 1.0)], 0.95), None);
        assert_eq!(Line::through(&[(1.0, 2.0, 1.0), (3.0, 2.0, 1.0)], 0.95), None);
        let exact = Line::through(&[(1.0, 2.0, 1.0), (3.0, 6.0, 5.0)], 0.95).unwrap();
        assert_eq!((exact.slope, exact.interval, exact.r_squared), (2.0, [2.0; 2], 1.0));
    }
}
