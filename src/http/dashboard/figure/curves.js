// Arithmetic with curves: values between points, differences, and the branches of loops.

/** Interpolates a curve linearly. Returns null outside the curve and next to a gap. */
export function interpolate(x, y, at) {
  let low = 0, high = x.length - 1;
  if (!(at >= x[low] && at <= x[high])) return null;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (x[middle] <= at) low = middle;
    else high = middle;
  }
  if (at === x[low]) return y[low];
  if (at === x[high]) return y[high];
  if (y[low] == null || y[high] == null) return null;
  return y[low] + ((at - x[low]) / (x[high] - x[low])) * (y[high] - y[low]);
}

/** The largest difference of two curves at the points of the first, and where it is. */
export function maxDifference(first, second) {
  let found = null;
  first.x.forEach((x, i) => {
    const [y, other] = [first.y[i], interpolate(second.x, second.y, x)];
    if (y == null || other == null) return;
    const value = Math.abs(other - y);
    if (!found || value > found.value) found = { value, at: x };
  });
  return found;
}

/** Upper limit of an axis. A narrow peak may lie outside, so that the other values stay readable. */
export function axisLimit(values) {
  const positive = values.filter((value) => value > 0).sort((a, b) => a - b);
  const typical = positive[Math.floor(0.9 * (positive.length - 1))];
  return positive.at(-1) > 3 * typical ? 1.5 * typical : (positive.at(-1) ?? 0);
}

/**
 * Splits a loop at its turning points, so that each branch is a function of the displacement. `direction` is 1 where
 * the displacement grows.
 */
export function branches(x, y) {
  const cuts = [0];
  let direction = 0;
  for (let i = 1; i < x.length; i++) {
    const step = Math.sign(x[i] - x[i - 1]);
    if (step * direction < 0) cuts.push(i - 1);
    direction = step || direction;
  }
  cuts.push(x.length - 1);
  return cuts.slice(1).map((to, i) => {
    const [own, of] = [x.slice(cuts[i], to + 1), y.slice(cuts[i], to + 1)];
    return own[0] > own.at(-1) ? { x: own.reverse(), y: of.reverse(), direction: -1 } : { x: own, y: of, direction: 1 };
  });
}

/** The least and the largest finite value, of which those that `isMeant` refuses are left out; null without any. */
export function extent(rows, isMeant = () => true) {
  let low = Infinity, high = -Infinity;
  for (const row of rows) {
    for (const value of row) {
      if (value == null || !Number.isFinite(value) || !isMeant(value)) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return low <= high ? [low, high] : null;
}

/** The index of the value nearest to `x`. */
export const nearestTo = (values, x) => values.reduce((best, value, i) => (Math.abs(value - x) < Math.abs(values[best] - x) ? i : best), 0);

/** The value below which a share of ascending values lies. */
export const percentile = (values, share, at = share * (values.length - 1)) => values[Math.floor(at)] + (at % 1) * (values[Math.ceil(at)] - values[Math.floor(at)]);

export const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

export const median = (values) => percentile(values.toSorted((a, b) => a - b), 0.5);

/** At most `count` rows that are evenly spaced. */
export const spread = (rows, count) => (rows.length <= count ? rows
  : Array.from({ length: count }, (_, i) => rows[Math.round((i * (rows.length - 1)) / (count - 1))]));
