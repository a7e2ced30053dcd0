//! Depths and heights over the distance from the axis: means of the points near each radius, on both sides and together.

use super::scar::Scar;
use super::sizes::Sizes;

/// Number of radii in the scar, and maximum number of radii.
const RADII: f64 = 40.0;
const MOST_RADII: f64 = 1000.0;
/// The sides differ if their difference is this many times what the scatter explains (root mean square), and this share of
/// the largest depth.
const DIFFERENT: (f64, f64) = (2.5, 0.02);

/// The sums of the points near a radius on one side.
#[derive(Debug, Clone, Copy, Default)]
struct Bin {
    count: f64,
    radius: f64,
    depth: f64,
    height: f64,
}

impl Bin {
    fn and(self, other: Self) -> Self {
        Self {
            count: self.count + other.count,
            radius: self.radius + other.radius,
            depth: self.depth + other.depth,
            height: self.height + other.height,
        }
    }
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
    /// The largest depth, of the deeper side if the sides differ, and its standard deviation.
    pub deepest: (f64, f64),
}

/// The largest number.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
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
            let (radius, depth) = ((x - axis).abs(), -outwards * height);
            if let Some(sides) = bins.get_mut((radius / width).round() as usize) {
                let side = &mut sides[usize::from(*x < axis)];
                *side = side.and(Bin { count: 1.0, radius, depth, height: outwards * (level - z) });
            }
        }
        bins.retain(|[right, left]| right.count + left.count > 0.0);
        let mean = |of: &dyn Fn(Bin) -> f64| -> Vec<f64> {
            let all = bins.iter().map(|[right, left]| right.and(*left));
            all.map(|bin| of(bin) / bin.count).collect()
        };
        let (mut reach, mut height) = (mean(&|bin| bin.radius), mean(&|bin| bin.height));
        let mut depth = mean(&|bin| bin.depth);
        reach[0] = 0.0;
        let lowest = height[0];
        height.iter_mut().for_each(|height| *height -= lowest);
        let mut radius = reach.clone();
        radius.retain(|radius| half == 0.0 || *radius <= half);
        bins.truncate(radius.len());
        depth.truncate(radius.len());
        let side = |which: usize| -> Depths {
            let own = |bin: &Bin| (bin.count > 0.0).then(|| bin.depth / bin.count);
            bins.iter().map(|sides| own(&sides[which])).collect()
        };
        let (right, left) = (side(0), side(1));
        // The squared differences of the sides, and the same in units of what the scatter explains.
        let variance = unworn.scatter * unworn.scatter * unworn.together;
        let squares =
            bins.iter().zip(right.iter().zip(&left)).filter_map(|(bin, (right, left))| {
                let square = ((*right)? - (*left)?) * ((*right)? - (*left)?);
                Some([square, square / (variance * (1.0 / bin[0].count + 1.0 / bin[1].count))])
            });
        let squares: Vec<[f64; 2]> = squares.collect();
        let rms = |of: usize| {
            (squares.iter().map(|it| it[of]).sum::<f64>() / squares.len() as f64).sqrt()
        };
        let mut deepest = largest(depth.iter().copied());
        let are_different = half > 0.0 && rms(1) > DIFFERENT.0 && rms(0) > DIFFERENT.1 * deepest;
        if are_different {
            deepest = largest(right.iter().chain(&left).copied().flatten());
        }
        let count = largest(bins.iter().map(|[right, left]| right.count + left.count));
        let error =
            (variance / count.max(1.0)).sqrt().hypot(unworn.error([(axis, 1.0)].into_iter()));
        let (difference, deepest) = (rms(0), (deepest, error));
        Self { radius, depth, left, right, reach, height, difference, are_different, deepest }
    }
}
