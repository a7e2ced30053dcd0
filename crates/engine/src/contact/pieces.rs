//! Piecewise polynomials, and their exact transforms.
//!
//! A piecewise polynomial is a sum of terms (x − xᵢ)ᵏ that start at the nodes xᵢ, and
//! ```text
//! T_k = ∫ᵇʳ (x−b)ᵏ/√(r²−x²) dx:  kT_k = (k−1)(r²−b²)T_{k−2} − (2k−1)bT_{k−1},  T₀ = arccos(b/r)
//! S_k = ∫ᵇᵉ (x−b)ᵏ/√(x²−r²) dx:  kS_k = (e−b)ᵏ⁻¹√(e²−r²) − (2k−1)bS_{k−1} − (k−1)(b²−r²)S_{k−2}
//! ```
//! A line contact has the image F(s)/E* = ∫ x f′/√(s²−x²) dx instead, and the inverse
//! ```text
//! f = (2/π) r ∫ F/(x √(r²−x²)) dx/E*,   U_k = ∫ᵇʳ (x−b)ᵏ/(x √(r²−x²)) dx = T_{k−1} − b U_{k−1},   U₀ = arcosh(r/b)/r
//! ```

/// Coefficients of a polynomial: of (x − xᵢ)ᵏ for k = 0 … 4.
pub(super) type Powers = [f64; 5];

/// The integrals T₀ … T₄ of the module documentation, for a term that starts at b < r.
pub(super) fn inverse_kernel(b: f64, r: f64) -> Powers {
    let square = (r - b) * (r + b);
    let chord = square.sqrt();
    let angle = libm::atan2(chord, b);
    let mut t = [angle, chord - b * angle, 0.0, 0.0, 0.0];
    for k in 2..5 {
        let k_real = k as f64;
        t[k] = ((k_real - 1.0) * square * t[k - 2] - (2.0 * k_real - 1.0) * b * t[k - 1]) / k_real;
    }
    t
}

/// The integrals U₀ … U₄ of a line contact, for a term that starts at b < r. A term that starts on the axis has no
/// constant.
pub(super) fn line_kernel(b: f64, r: f64) -> Powers {
    let t = inverse_kernel(b, r);
    let mut u = [if b > 0.0 { libm::acosh(r / b) / r } else { 0.0 }, 0.0, 0.0, 0.0, 0.0];
    for k in 1..5 {
        u[k] = t[k - 1] - b * u[k - 1];
    }
    u
}

/// S₀ … S₃ for r ≤ b < e, where `last` is √(e²−r²). On the axis S₀ is infinite; this function
/// returns 0 instead.
pub(super) fn pressure_kernel(b: f64, r: f64, end: f64, last: f64) -> [f64; 4] {
    let square = (b - r) * (b + r);
    let first = square.sqrt();
    let begin = b + first;
    let log = if begin > 0.0 { libm::log((end + last) / begin) } else { 0.0 };
    let mut s = [log, last - first - b * log, 0.0, 0.0];
    let mut power = 1.0;
    for k in 2..4 {
        let k_real = k as f64;
        power *= end - b;
        let before = (2.0 * k_real - 1.0) * b * s[k - 1] + (k_real - 1.0) * square * s[k - 2];
        s[k] = (power * last - before) / k_real;
    }
    s
}

/// The coefficients of the same polynomial in powers of the distance from the point `u`.
pub(super) fn shifted(powers: &Powers, u: f64) -> Powers {
    let mut shifted = *powers;
    for from in 0..4 {
        for k in (from..4).rev() {
            shifted[k] += u * shifted[k + 1];
        }
    }
    shifted
}

pub(super) fn value(powers: &Powers, u: f64) -> f64 {
    powers.iter().rev().fold(0.0, |sum, power| sum * u + power)
}

pub(super) fn slope(powers: &Powers, u: f64) -> f64 {
    let derivative = [powers[1], 2.0 * powers[2], 3.0 * powers[3], 4.0 * powers[4], 0.0];
    value(&derivative, u)
}

/// The integral of the polynomial over 0…u.
pub(super) fn area(powers: &Powers, u: f64) -> f64 {
    let [a, b, c, d, e] = *powers;
    u * value(&[a, b / 2.0, c / 3.0, d / 4.0, e / 5.0], u)
}

/// The cubic polynomial over `width` with the given values and slopes at its ends.
pub(super) fn cubic(width: f64, values: [f64; 2], slopes: [f64; 2]) -> Powers {
    let secant = (values[1] - values[0]) / width;
    let second = (3.0 * secant - 2.0 * slopes[0] - slopes[1]) / width;
    let third = (slopes[0] + slopes[1] - 2.0 * secant) / (width * width);
    [values[0], slopes[0], second, third, 0.0]
}

/// Slopes of a curve through points; the curve is monotone where the points are monotone. The
/// slopes are those of parabolas through three neighbours. The limit of three times the smaller
/// secant is from F. N. Fritsch and R. E. Carlson, *SIAM J. Numer. Anal.* 17 (1980) 238.
pub(super) fn monotone_slopes(x: &[f64], z: &[f64]) -> Vec<f64> {
    let secants: Vec<f64> =
        x.windows(2).zip(z.windows(2)).map(|(x, z)| (z[1] - z[0]) / (x[1] - x[0])).collect();
    let limited = |slope: f64, left: f64, right: f64| {
        if left * right <= 0.0 || slope * left <= 0.0 {
            return 0.0;
        }
        let most = 3.0 * left.abs().min(right.abs());
        slope.clamp(-most, most)
    };
    let last = x.len() - 1;
    (0..=last)
        .map(|i| {
            // At an end, use the parabola of the neighbouring point.
            let middle = i.clamp(1, last.max(2) - 1);
            let (Some(left), Some(right)) = (secants.get(middle - 1), secants.get(middle)) else {
                return secants[0];
            };
            let curvature = (right - left) / (x[middle + 1] - x[middle - 1]);
            let slope = left + curvature * (2.0 * x[i] - x[middle - 1] - x[middle]);
            match i {
                0 => limited(slope, *left, *left),
                _ if i == last => limited(slope, *right, *right),
                _ => limited(slope, *left, *right),
            }
        })
        .collect()
}

/// The image and its slope at x. `changes` are the changes of the piecewise polynomial f′ at
/// `knots`: g = x ∫ f′/√(x²−r²) dr and g′ = g/x + ∫ r f″/√(x²−r²) dr.
pub(super) fn image_of(knots: &[f64], changes: &[[f64; 3]], x: f64) -> (f64, f64) {
    let (mut first, mut second) = (0.0, 0.0);
    for (r, change) in knots.iter().zip(changes).take_while(|(r, _)| **r < x) {
        let t = inverse_kernel(*r, x);
        first += change[0] * t[0] + change[1] * t[1] + change[2] * t[2];
        second += change[1] * (t[1] + r * t[0]) + 2.0 * change[2] * (t[2] + r * t[1]);
    }
    (x * first, first + second)
}

/// The image of a line contact and its slope at s: F = ∫ x f′/√(s²−x²) dx and F′ = f′(0) + s ∫ f″/√(s²−x²) dx.
pub(super) fn line_image_of(knots: &[f64], changes: &[[f64; 3]], s: f64) -> (f64, f64) {
    let (mut image, mut slope) = (0.0, 0.0);
    for (x, change) in knots.iter().zip(changes).take_while(|(x, _)| **x < s) {
        let t = inverse_kernel(*x, s);
        image += (0..3).map(|k| change[k] * (t[k + 1] + x * t[k])).sum::<f64>();
        slope += change[0] + s * (change[1] * t[0] + 2.0 * change[2] * t[1]);
    }
    (image, slope)
}
