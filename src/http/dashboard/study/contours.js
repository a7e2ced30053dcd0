// Contour lines of values on a rectangular grid.

/** The corners of a cell around it: left bottom, right bottom, right top, left top. */
const CORNERS = [[0, 0], [1, 0], [1, 1], [0, 1]];

/**
 * The contour lines of `values[up][across]`, one path for each level, which may be empty. `xs` and `ys` are the places of the grid lines in px. Inside
 * a cell, a line is straight between two edges.
 */
export function contours([xs, ys], values, levels) {
  return levels.map((level) => {
    let path = "";
    for (let j = 0; j + 1 < ys.length; j++) {
      for (let i = 0; i + 1 < xs.length; i++) {
        const corner = CORNERS.map(([right, up]) => ({ x: xs[i + right], y: ys[j + up], value: values[j + up][i + right] }));
        if (corner.some(({ value }) => !Number.isFinite(value))) continue;
        const crossed = corner.flatMap((one, k) => crossing(one, corner[(k + 1) % 4], level));
        // Four crossings belong to a saddle: neighbours are joined.
        for (let k = 0; k + 1 < crossed.length; k += 2) path += `M${crossed[k]}L${crossed[k + 1]}`;
      }
    }
    return path;
  });
}

/** Where the level crosses an edge of a cell, as text for a path. */
function crossing(one, other, level) {
  if ((one.value >= level) === (other.value >= level)) return [];
  const share = (level - one.value) / (other.value - one.value);
  return [`${(one.x + share * (other.x - one.x)).toFixed(1)} ${(one.y + share * (other.y - one.y)).toFixed(1)}`];
}
