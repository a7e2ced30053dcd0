//! Depths and heights over the distance from the axis: means of the points near each radius, on both sides and together.

use super::scar::Scar;
use super::sizes::Sizes;

/// Number of radii in the scar, and maximum number of radii.
const RADII: f64 = 40.0;
const MOST_RADII: f64 = 1000.0;
/// The sides differ if their difference is this many times what the scatter explains (root mean square), and this share of
/// the largest depth.
const DIFFERENT: (f64, f64) = (2.5, 0.02);

/// The number of points near a radius on one side, and the sums of their radii, depths and heights.
type Bin = [f64; 4];

fn plus(one: Bin, other: Bin) -> Bin {
    std::array::from_fn(|at| one[at] + other[at])
}

/// Depths of one side, or of both. Null where the side has no point.
pub type Depths = Vec<Option<f64>>;

/// A trace over the distance from the axis.
#[derive(Debug)]
pub struct Radial {
    /// The radii inside of the scar, or all if there is no scar, and the mean depths of both sides.
    pub radius: Vec<f64>,
    pub depth: Vec<f64>,
    /// The depths of the left side and of the right one.
    pub left: Depths,
    pub right: Depths,
    /// All radii, and the heights above that of the axis.
    pub reach: Vec<f64>,
    pub height: Vec<f64>,
    /// The difference of the sides (root mean square), and whether it is more than scatter.
    pub difference: f64,
    pub are_different: bool,
}

impl Radial {
    /// Takes the means of a trace up to the end that is nearer to the axis. `half` is half of the scar.
    pub fn of(
        points: &[(f64, f64)],
        scar: &Scar,
        sizes: &Sizes<'_>,
        half: f64,
        is_level: bool,
    ) -> Self {
        let (unworn, outwards, axis) = (&scar.found.surface, scar.outwards, sizes.axis.0);
        let (first, last) = (points[0].0, points[points.len() - 1].0);
        let (reach, tilt) = ((axis - first).min(last - axis), unworn.slope(axis));
        let width =
            (half / RADII).max(reach / MOST_RADII).max(2.0 * (last - first) / points.len() as f64);
        let mut bins = vec![[Bin::default(); 2]; (reach / width) as usize + 1];
        for ((x, z), height) in points.iter().zip(&scar.found.heights) {
            let level = unworn.at(axis) + if is_level { tilt * (x - axis) } else { 0.0 };
            let own = [1.0, (x - axis).abs(), -outwards * height, outwards * (level - z)];
            if let Some(sides) = bins.get_mut((own[1] / width).round() as usize) {
                let side = &mut sides[usize::from(*x < axis)];
                *side = plus(*side, own);
            }
        }
        let both: Vec<Bin> = bins.iter().map(|[right, left]| plus(*right, *left)).collect();
        let mean = |of: usize| -> Vec<f64> {
            both.iter().filter(|bin| bin[0] > 0.0).map(|bin| bin[of] / bin[0]).collect()
        };
        let [mut reach, mut depth, mut height] = [mean(1), mean(2), mean(3)];
        bins.retain(|[right, left]| right[0] + left[0] > 0.0);
        reach[0] = 0.0;
        let lowest = height[0];
        for height in &mut height {
            *height -= lowest;
        }
        let mut radius = reach.clone();
        radius.retain(|radius| half == 0.0 || *radius <= half);
        bins.truncate(radius.len());
        depth.truncate(radius.len());
        let own = |bin: &Bin| (bin[0] > 0.0).then(|| bin[2] / bin[0]);
        let [right, left] =
            [0, 1].map(|side: usize| bins.iter().map(|it| own(&it[side])).collect::<Depths>());
        // The squared differences of the sides, and the same in units of what the scatter explains.
        let variance = unworn.scatter * unworn.scatter * unworn.together;
        let squares = bins.iter().filter_map(|[right, left]| {
            let square = (own(right)? - own(left)?) * (own(right)? - own(left)?);
            Some([square, square / (variance * (1.0 / right[0] + 1.0 / left[0]))])
        });
        let squares: Vec<[f64; 2]> = squares.collect();
        let mean = |of: usize| squares.iter().map(|it| it[of]).sum::<f64>() / squares.len() as f64;
        let [difference, excess] = [mean(0).sqrt(), mean(1).sqrt()];
        let deepest = depth.iter().copied().fold(0.0, f64::max);
        let are_different =
            half > 0.0 && excess > DIFFERENT.0 && difference > DIFFERENT.1 * deepest;
        Self { radius, depth, left, right, reach, height, difference, are_different }
    }
}
