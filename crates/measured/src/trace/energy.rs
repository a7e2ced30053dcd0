//! The energy of a friction loop.

use serde_json::{Value, json};

use super::points::{known, range};

/// The energy of a friction loop: the area inside the points.
///
/// # Errors
/// The points are no loop.
pub fn energy(
    x: &[Option<f64>],
    force: &[Option<f64>],
    notes: &mut Vec<String>,
) -> Result<Value, String> {
    let points = known(x, force)?;
    let (all, forces): (Vec<f64>, Vec<f64>) = points.iter().copied().unzip();
    let ([low, high], [least, most]) = (range(&all), range(&forces));
    let near = |x: f64, share: f64| {
        let reach = share * (high - low);
        if x < low + reach { Some(false) } else { (x > high - reach).then_some(true) }
    };
    // Each cycle comes near both ends.
    let mut ends: Vec<bool> = all.iter().filter_map(|x| near(*x, 0.25)).collect();
    ends.dedup();
    let (cycles, (x, q), (x1, q1)) = (ends.len() / 2, points[0], points[points.len() - 1]);
    let is_closed = (x1 - x).abs() <= 0.25 * (high - low);
    // At a reversal, the force can change at once.
    if cycles == 0 || !is_closed || (q1 - q).abs() > 0.5 * (most - least) && near(x, 0.06).is_none()
    {
        return Err("is no loop: it does not end where it begins. Keep the rows of one or more whole cycles. For a \
                    profile, write prepare=trace".into());
    }
    let next = points.iter().cycle().skip(1);
    let area = points.iter().zip(next).map(|((x, q), (x1, q1))| 0.5 * (q + q1) * (x1 - x));
    notes.push(format!("The rows are {cycles} cycle(s), which a line from the last row closes. The energy is their mean."));
    Ok(json!({"energy_per_cycle": area.sum::<f64>().abs() / cycles as f64}))
}
