//! The largest depth: the highest of local means, as wide as the noise requires and the shape permits.
//!
//! The deepest of noisy points is too deep, and the mean of many is too shallow. So depths are averaged in windows of growing
//! width. The widest one counts that is as deep as all narrower ones, less what noise adds to the largest of their means (intersection of confidence intervals, Goldenshluger
//! and Nemirovski 1997).

use super::scar::Scar;

/// The first window is this share of the scar, but not fewer points. Each one is wider by the factor, up to the last share.
const FIRST: f64 = 1.0 / 80.0;
const FEWEST: f64 = 5.0;
const FACTOR: f64 = 1.4;
const LAST: f64 = 0.7;
/// Windows are moved by this share of their width.
const MOVE: f64 = 0.2;

/// The largest depth of the scar, and its standard deviation.
pub fn deepest(points: &[(f64, f64)], scar: &Scar) -> (f64, f64) {
    let Scar { range, outwards, .. } = scar;
    let surface = &scar.found.surface;
    let depths: Vec<f64> =
        scar.found.heights[range.clone()].iter().map(|height| -outwards * height).collect();
    let count = depths.len() as f64;
    let mut size = (FIRST * count).max(FEWEST);
    let (mut found, mut before, mut least) = ((0.0, surface.scatter, 0), None, f64::NEG_INFINITY);
    while size <= (LAST * count).max(FEWEST).min(count) {
        let window = size as usize;
        let starts = (0..=depths.len() - window).step_by(((MOVE * size) as usize).max(1));
        let means = starts.map(|start| {
            (depths[start..start + window].iter().sum::<f64>() / size.floor(), start + window / 2)
        });
        let Some((mean, at)) = means.max_by(|one, other| one.0.total_cmp(&other.0)) else { break };
        let error = surface.scatter * (surface.together / size).min(1.0).sqrt();
        if mean < least {
            break;
        }
        // The largest of several means is too large by about this many standard deviations.
        let chosen = (2.0 * libm::log((count / size).max(1.0))).sqrt();
        least = least.max(mean - chosen * error);
        // A wider window is shallower by the square of its width, so half of what it lost was lost in the last step.
        let change = before.map_or(0.0, |before| 2.0 * (mean - before));
        before = Some(mean);
        found = (mean, libm::hypot(error, change), range.start + at);
        size *= FACTOR;
    }
    let (value, error, at) = found;
    let gaps = scar.gaps.iter().filter(|gap| gap.range.contains(&at));
    let error = gaps.fold(error, |error, gap| libm::hypot(error, gap.error));
    (value, libm::hypot(error, surface.error([(points[at].0, 1.0)].into_iter())))
}
