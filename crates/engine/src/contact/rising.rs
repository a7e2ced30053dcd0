//! The increasing part of a sampled image.

/// The table is cut off where its image decreases, because the contact is not unique beyond this radius. A decrease
/// counts only if it exceeds this share of the image.
pub(super) const FALL: f64 = 0.02;
/// A decrease counts only if the radius has increased by more than this share since the maximum.
const FAR: f64 = 0.1;
/// A decrease counts only if it also exceeds this share of the greatest height. Near the axis the
/// image itself is small.
const FALL_AT_AXIS: f64 = 1e-3;
/// A decrease counts only if it also exceeds this many times the noise of the points.
const FALL_OF_NOISE: f64 = 3.0;
/// A decrease by more than this share of the image is not noise. The table is cut off there.
const DEEP: f64 = 0.3;

/// The increasing values that are closest to the images at the nodes, up to the first decrease that counts. `images` are
/// values with slopes, and `noise` is that of the points near each node.
pub(super) fn increasing(nodes: &[f64], images: &[(f64, f64)], noise: &[f64]) -> Vec<f64> {
    // Cut off a large decrease first, because averaging would mix it with the increasing part.
    let end = before_the_fall(images, noise);
    let (nodes, images) = (&nodes[..end], &images[..end]);
    let mut values = isotonic(nodes, images);
    values.truncate(rising_part(nodes, images, &values, noise));
    values
}

/// Number of nodes before the image decreases by more than `DEEP` of its maximum so far.
fn before_the_fall(images: &[(f64, f64)], noise: &[f64]) -> usize {
    let mut top = 0;
    for (i, (image, _)) in images.iter().enumerate().skip(1) {
        let least = FALL_AT_AXIS + FALL_OF_NOISE * noise[i];
        if *image > images[top].0 {
            top = i;
        } else if top > 1 && images[top].0 - image > DEEP * images[top].0 + least {
            return (top + 1).max(3);
        }
    }
    images.len()
}

/// Isotonic regression: the non-decreasing values that are closest to those at the nodes.
/// Neighbours with decreasing values are replaced by their mean, weighted by their length on the
/// axis. The first value is 0.
fn isotonic(nodes: &[f64], images: &[(f64, f64)]) -> Vec<f64> {
    // Mean, weight and number of values of each group of equal values.
    let mut runs: Vec<(f64, f64, usize)> = vec![(0.0, f64::INFINITY, 1)];
    for i in 1..nodes.len() {
        let share = nodes[(i + 1).min(nodes.len() - 1)] - nodes[i - 1];
        let mut run = (images[i].0, share, 1);
        while let Some((mean, weight, count)) = runs.pop() {
            if mean < run.0 {
                runs.push((mean, weight, count));
                break;
            }
            let mean = if weight.is_finite() {
                (mean * weight + run.0 * run.1) / (weight + run.1)
            } else {
                mean
            };
            run = (mean, weight + run.1, count + run.2);
        }
        runs.push(run);
    }
    runs.iter().flat_map(|(mean, _, count)| std::iter::repeat_n(*mean, *count)).collect()
}

/// Number of nodes before the first decrease that counts: see [`FALL`], [`FAR`] and [`FALL_AT_AXIS`].
fn rising_part(nodes: &[f64], images: &[(f64, f64)], values: &[f64], noise: &[f64]) -> usize {
    let mut first = 0;
    for i in 1..nodes.len() {
        if values[i] > values[first] {
            first = i;
        }
        let fall = values[i] - images[i].0;
        let far = nodes[i] - nodes[first] > FAR * nodes[i];
        if first > 0 && far && fall > FALL * values[i] + FALL_AT_AXIS + FALL_OF_NOISE * noise[i] {
            // Always keep the first cell, because a shape needs one.
            return first.max(2);
        }
    }
    nodes.len()
}

#[cfg(test)]
mod tests {
    use super::isotonic;

    #[test]
    fn isotonic_replaces_decreasing_values_by_their_means() {
        let nodes = [0.0, 1.0, 2.0, 3.0, 4.0];
        let images = [0.0, 3.0, 1.0, 5.0, 4.0].map(|value| (value, 0.0));
        let values = isotonic(&nodes, &images);
        assert_eq!(values[..3], [0.0, 2.0, 2.0]);
        assert!((values[3] - 14.0 / 3.0).abs() < 1e-15 && values[3] <= values[4]);
        assert_eq!(isotonic(&nodes, &[-1.0; 5].map(|value| (value, 0.0))), [0.0; 5]);
    }
}
