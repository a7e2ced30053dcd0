//! Depths and heights over the distance from the axis: means of the points near each radius, on both sides and together.

use super::parts::PreparedTrace;
use super::sizes::Sizes;

/// Number of radii in the scar, and maximum number of radii.
const RADII: f64 = 40.0;
const MOST_RADII: f64 = 1000.0;
/// The sides differ if their difference is this many times what the scatter explains (root mean square), and this share of
/// the largest depth.
const DIFFERENT: (f64, f64) = (2.5, 0.02);

/// The number of points near a radius on one side, and the sums of their radii, depths and heights.
type Bin = [f64; 4];

/// Depths of one side. Null where it has no point.
type Depths = Vec<Option<f64>>;

/// A trace over the distance from the axis.
pub struct Radial {
    /// The radii, the first of which are inside of the scar (all if there is no scar).
    pub radius: Vec<f64>,
    pub inside: usize,
    /// The mean depths of both sides, and those of the left side and of the right one.
    pub depth: Vec<f64>,
    pub left: Depths,
    pub right: Depths,
    /// The heights above that of the axis.
    pub height: Vec<f64>,
    /// The difference of the sides (root mean square), and whether it is more than scatter.
    pub difference: f64,
    pub are_different: bool,
}

impl Radial {
    /// Takes the means of a trace up to the end that is nearer to the axis. `half` is half of the scar.
    pub fn of(Sizes { scar, axis }: &Sizes<'_>, half: f64, is_level: bool) -> Self {
        let (PreparedTrace { points, surface, depths, .. }, axis) = (&scar.trace, axis.0);
        let (first, last) = (points[0].0, points[points.len() - 1].0);
        let (reach, tilt) = ((axis - first).min(last - axis), surface.slope(axis));
        let width =
            (half / RADII).max(reach / MOST_RADII).max(2.0 * (last - first) / points.len() as f64);
        let mut bins = vec![[Bin::default(); 2]; (reach / width) as usize + 1];
        for ((x, z), depth) in points.iter().zip(depths) {
            let level = surface.at(axis) + if is_level { tilt * (x - axis) } else { 0.0 };
            let r = (x - axis).abs();
            if let Some(sides) = bins.get_mut((r / width).round() as usize) {
                let own = [1.0, r, *depth, level - z];
                let side = sides[usize::from(*x < axis)].iter_mut();
                side.zip(own).for_each(|(sum, own)| *sum += own);
            }
        }
        bins.retain(|[right, left]| right[0] + left[0] > 0.0);
        let mean = |of: usize| -> Vec<f64> {
            let both =
                bins.iter().map(|[right, left]| (right[of] + left[of]) / (right[0] + left[0]));
            both.collect()
        };
        let [mut radius, depth, height] = [mean(1), mean(2), mean(3)];
        radius[0] = 0.0;
        let height = height.iter().map(|own| own - height[0]).collect();
        let inside = radius.partition_point(|radius| half == 0.0 || *radius <= half);
        let own = |bin: &Bin| (bin[0] > 0.0).then(|| bin[2] / bin[0]);
        let [right, left] =
            [0, 1].map(|side| bins[..inside].iter().map(|it| own(&it[side])).collect());
        // The squared differences of the sides, and the same in units of what the scatter explains.
        let squares = bins[..inside].iter().filter_map(|[right, left]| {
            let square = (own(right)? - own(left)?) * (own(right)? - own(left)?);
            Some([square, square / (surface.variance() * (1.0 / right[0] + 1.0 / left[0]))])
        });
        let squares: Vec<[f64; 2]> = squares.collect();
        let [difference, excess] = [0, 1]
            .map(|of| (squares.iter().map(|it| it[of]).sum::<f64>() / squares.len() as f64).sqrt());
        let least = DIFFERENT.1 * depth[..inside].iter().copied().fold(0.0, f64::max);
        let are_different = half > 0.0 && excess > DIFFERENT.0 && difference > least;
        Self { radius, inside, depth, left, right, height, difference, are_different }
    }
}
