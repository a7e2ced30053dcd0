// A profilometer trace as the profile of an indenter: tilt, axis, left and right.

/** Maximum number of radii of the profile. */
const MAX_RADII = 200;
/** The share of the height around the lowest point that decides where it is, and the share of a trace that is one end. */
const [NEAR, END] = [0.3, 0.05];
/** Digits of a measured number. */
const DIGITS = 6;

const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

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

/** The height at a position, linear between the points. */
function heightAt(points, x) {
  const after = points.findIndex(([own]) => own >= x);
  if (after <= 0) return points[after < 0 ? points.length - 1 : 0][1];
  const [[x0, z0], [x1, z1]] = [points[after - 1], points[after]];
  return z0 + ((x - x0) / (x1 - x0)) * (z1 - z0);
}

/**
 * The profile from the axis outwards, in the units of the trace. `level` removes the tilt between both ends. `axis` is `lowest`,
 * `middle` or `zero`, and `sides` is `both`, `left` or `right`. `slope` is the tilt that was removed. Undefined if the trace has no
 * such side.
 */
export function profileOf(xs, zs, { level, axis, sides }) {
  let points = xs.map((x, i) => [x, zs[i]]).filter(([x, z]) => x != null && z != null).sort((a, b) => a[0] - b[0]);
  if (points.length < 5) return undefined;
  const size = Math.max(1, Math.floor(END * points.length));
  const ends = [points.slice(0, size), points.slice(-size)].map((end) => [0, 1].map((i) => mean(end.map((point) => point[i]))));
  const slope = (ends[1][1] - ends[0][1]) / (ends[1][0] - ends[0][0]);
  if (level) points = points.map(([x, z]) => [x, z - slope * (x - ends[0][0])]);
  // The axis of an indenter is its lowest point. A trace of its surface from above has it on top.
  const inner = points.slice(Math.floor(points.length / 3), Math.ceil((2 * points.length) / 3));
  const outer = [points.slice(0, size), points.slice(-size)].flat();
  const isHalf = axis === "zero" && (points[0][0] >= 0 || points.at(-1)[0] <= 0);
  if (!isHalf && mean(inner.map(([, z]) => z)) > mean(outer.map(([, z]) => z))) points = points.map(([x, z]) => [x, -z]);
  const centre = { lowest, middle: () => (points[0][0] + points.at(-1)[0]) / 2, zero: () => 0 }[axis](points);
  const reach = { left: centre - points[0][0], right: points.at(-1)[0] - centre };
  const wanted = sides === "both" ? ["left", "right"].filter((side) => reach[side] > 0) : [sides];
  const end = Math.min(...wanted.map((side) => reach[side]));
  if (!(end > 0)) return undefined;
  const count = Math.min(MAX_RADII, Math.max(8, Math.floor(points.length / 2)));
  const radius = Array.from({ length: count }, (_, i) => (i * end) / (count - 1));
  const height = radius.map((r) => mean(wanted.map((side) => heightAt(points, centre + (side === "left" ? -r : r)))));
  const rounded = (values) => values.map((value) => Number(value.toPrecision(DIGITS)));
  return { profile: { radius: rounded(radius), height: rounded(height.map((value) => value - height[0])) }, slope: level ? slope : 0 };
}
