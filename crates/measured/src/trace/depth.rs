//! The largest depth: the highest of local means, as wide as the noise requires and the shape permits.
//!
//! The deepest of noisy points is too deep, and the mean of many is too shallow. So depths are averaged in windows of growing
//! width. The widest one counts that is as deep as all narrower ones, less what noise adds to the largest of their means
//! (intersection of confidence intervals, Goldenshluger and Nemirovski 1997).

use super::scar::{Gap, Scar};
use super::sizes::Size;
use crate::curve::smooth;

/// The first window is this share of the scar, but not fewer points. Each one is wider by the factor, up to the last share.
const FIRST: f64 = 1.0 / 80.0;
const FEWEST: f64 = 3.0;
const FACTOR: f64 = 1.6;
const LAST: f64 = 0.7;

/// The largest depth of the scar, and its standard deviation.
pub fn deepest(scar: &Scar) -> Size {
    let Scar { trace, range, gaps, .. } = scar;
    let (depths, surface) = (&trace.depths[range.clone()], &trace.surface);
    let count = depths.len() as f64;
    let means = |half: usize| smooth(depths, 2 * half + 1).into_iter().enumerate();
    let largest = |half| means(half).max_by(|one, other| one.1.total_cmp(&other.1));
    let half = |size: f64| (0.5 * (size - 1.0)).round() as usize;
    let (mut size, mut least) = ((FIRST * count).max(FEWEST), f64::NEG_INFINITY);
    let narrower = (half(size) as f64 / FACTOR) as usize;
    let mut before = largest(narrower).map(|it| it.1);
    let mut found = Size { value: 0.0, errors: [surface.scatter, 0.0, 0.0, 0.0] };
    let mut near = 0..0;
    while size <= (LAST * count).max(FEWEST).min(count) {
        let half = half(size);
        let Some((at, mean)) = largest(half) else { break };
        if mean < least {
            break;
        }
        near =
            range.start + at.saturating_sub(half)..range.start + (at + half + 1).min(depths.len());
        let share = 1.0 / near.len() as f64;
        let [scatter, unworn] = scar.error(&near.clone().map(|at| (trace.points[at].0, share)));
        let scatter = scatter.min(surface.scatter);
        // The largest of several means is too large by about this many standard deviations.
        let chosen = (2.0 * libm::log((count / size).max(1.0))).sqrt();
        least = least.max(mean - chosen * scatter);
        // A wider window is shallower by the square of its width, so half of what it lost was lost in the last step.
        let change = before.map_or(0.0, |before| 2.0 * (mean - before));
        before = Some(mean);
        found = Size { value: mean, errors: [scatter, unworn, change, 0.0] };
        size *= FACTOR;
    }
    // A gap beside the deepest points can only hide deeper ones.
    let beside = |gap: &&Gap| gap.range.start <= near.end && gap.range.end >= near.start;
    found.errors[3] = gaps.iter().filter(beside).map(|gap| 2.0 * gap.error).fold(0.0, libm::hypot);
    found
}
