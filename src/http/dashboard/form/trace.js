// A profilometer trace as the profile of an indenter: tilt, axis, left and right.

import { interpolate, mean } from "../figure/curves.js";

/** Maximum number of radii of the profile. */
const MAX_RADII = 200;
/** The share of the height around the lowest point that decides where it is, and the share of a trace that is one end. */
const [NEAR, END] = [0.3, 0.05];
/** Minimum reach to each side of the axis as a share of the trace, number of axes that are tried, and of radii at which both sides of them are compared. */
const [REACH, AXES, RADII] = [0.35, 80, 60];
/** A tilt is believed if it makes the difference of both sides smaller than one in this many, and if it is not below this share of the height. */
const [BETTER, LEAST] = [3, 1e-4];
/** Digits of a measured number. */
const DIGITS = 6;

/** The vertex of the parabola through the points that lie lowest; the lowest point if the parabola has none inside. */
function lowest(points) {
  const heights = points.map(([, z]) => z);
  const [least, most] = [Math.min(...heights), Math.max(...heights)];
  const low = points.filter(([, z]) => z <= least + NEAR * (most - least));
  const x0 = mean(low.map(([x]) => x));
  const span = Math.max(...low.map(([x]) => Math.abs(x - x0))) || 1;
  const u = low.map(([x, z]) => [(x - x0) / span, z]);
  const sum = (power, of = () => 1) => mean(u.map(([x, z]) => x ** power * of(z)));
  // The normal equations of z = a + b·u + c·u², with the mean of u at zero.
  const [s2, s3, s4] = [2, 3, 4].map((power) => sum(power));
  const [t0, t1, t2] = [0, 1, 2].map((power) => sum(power, (z) => z));
  const determinant = s2 * s4 - s3 * s3 - s2 ** 3;
  const b = ((s4 - s2 * s2) * t1 - s3 * (t2 - s2 * t0)) / determinant;
  const c = (s2 * (t2 - s2 * t0) - s3 * t1) / determinant;
  const vertex = x0 - (span * b) / (2 * c);
  return c > 0 && vertex > points[0][0] && vertex < points.at(-1)[0] ? vertex : points[heights.indexOf(least)][0];
}

/** The radius of the ball through a profile: the least squares of z = r²/(2R). */
export const radiusOf = ({ radius, height }) => radius.reduce((sum, r) => sum + r ** 4, 0) / (2 * radius.reduce((sum, r, i) => sum + r * r * height[i], 0));

/** A function that gives the height at a position, linear between the points. */
function heightsOf(points) {
  const [xs, zs] = [0, 1].map((i) => points.map((point) => point[i]));
  return (x) => interpolate(xs, zs, Math.min(Math.max(x, xs[0]), xs.at(-1)));
}

/**
 * How the two sides of an axis differ: the tilt that explains most of it, and the mean square difference with this tilt and without
 * any. Both sides reach equally far.
 */
function sidesOf(points, axis) {
  const reach = Math.min(axis - points[0][0], points.at(-1)[0] - axis);
  const heightAt = heightsOf(points);
  const all = Array.from({ length: RADII }, (_, i) => (reach * (i + 1)) / RADII).map((r) => [r, heightAt(axis + r) - heightAt(axis - r)]);
  const slope = all.reduce((sum, [r, difference]) => sum + r * difference, 0) / all.reduce((sum, [r]) => sum + 2 * r * r, 0);
  const square = (tilt) => mean(all.map(([r, difference]) => (difference - 2 * r * tilt) ** 2));
  return { axis, slope, tilted: square(slope), level: square(0) };
}

/**
 * The axis about which both sides are most alike, unless it is given, and the tilt. Across a ball a shift and a tilt look alike, and
 * give the same profile. So a tilt is believed only if the sides are much less alike without it.
 */
function symmetryOf(points, mayTilt, given) {
  const [first, last] = [points[0][0], points.at(-1)[0]];
  /** The best of the axes between two places, which is then searched more finely. */
  const best = (name, from, to, isFine) => {
    const step = (to - from) / AXES;
    const all = Array.from({ length: AXES + 1 }, (_, i) => sidesOf(points, from + i * step));
    const found = all.reduce((least, own) => (own[name] < least[name] ? own : least));
    return isFine ? found : best(name, found.axis - step, found.axis + step, true);
  };
  const [level, tilted] = ["level", "tilted"].map((name) => (given === undefined
    ? best(name, first + REACH * (last - first), last - REACH * (last - first)) : sidesOf(points, given)));
  const height = Math.max(...points.map(([, z]) => z)) - Math.min(...points.map(([, z]) => z));
  const alike = Math.max(tilted.tilted, (LEAST * height) ** 2);
  if (!mayTilt || level.level <= BETTER * alike) return { axis: level.axis, slope: 0 };
  // A tilt with an axis that nothing shows: the middle is as good as any.
  const middle = sidesOf(points, given ?? (first + last) / 2);
  return middle.tilted <= BETTER * alike ? middle : tilted;
}

/**
 * The profile from the axis outwards, in the units of the trace. `level` removes the tilt. `axis` is `symmetry`, `lowest`, `middle` or
 * `zero`, and `sides` is `both`, `left` or `right`. `slope` is the tilt that was removed. Undefined if the trace has no such side.
 */
export function profileOf(xs, zs, { level, axis, sides }) {
  let points = xs.map((x, i) => [x, zs[i]]).filter(([x, z]) => x != null && z != null).sort((a, b) => a[0] - b[0]);
  if (points.length < 5) return undefined;
  const size = Math.max(1, Math.floor(END * points.length));
  // The axis of an indenter is its lowest point. A trace of its surface from above has it on top.
  const inner = points.slice(Math.floor(points.length / 3), Math.ceil((2 * points.length) / 3));
  const outer = [points.slice(0, size), points.slice(-size)].flat();
  const isHalf = points[0][0] >= 0 || points.at(-1)[0] <= 0;
  const isTurned = !(axis === "zero" && isHalf) && mean(inner.map(([, z]) => z)) > mean(outer.map(([, z]) => z));
  if (isTurned) points = points.map(([x, z]) => [x, -z]);
  const given = { lowest: () => lowest(points), middle: () => (points[0][0] + points.at(-1)[0]) / 2, zero: () => 0 }[axis]?.();
  // One side alone has no tilt: it looks like the slope of the profile.
  const { axis: centre, slope } = axis === "zero" && isHalf ? { axis: 0, slope: 0 } : symmetryOf(points, level, given);
  points = points.map(([x, z]) => [x, z - slope * (x - centre)]);
  const reach = { left: centre - points[0][0], right: points.at(-1)[0] - centre };
  const wanted = sides === "both" ? ["left", "right"].filter((side) => reach[side] > 0) : [sides];
  const end = Math.min(...wanted.map((side) => reach[side]));
  if (!(end > 0)) return undefined;
  const count = Math.min(MAX_RADII, Math.max(8, Math.floor(points.length / 2)));
  const radius = Array.from({ length: count }, (_, i) => (i * end) / (count - 1));
  const heightAt = heightsOf(points);
  const height = radius.map((r) => mean(wanted.map((side) => heightAt(centre + (side === "left" ? -r : r)))));
  const rounded = (values) => values.map((value) => Number(value.toPrecision(DIGITS)));
  return { profile: { radius: rounded(radius), height: rounded(height.map((value) => value - height[0])) }, centre, slope: isTurned ? -slope : slope, isTurned };
}
