//! Contour lines of a function that is known at the points of a rectangular grid, by marching squares.
//!
//! In each cell of the grid, straight segments separate the corners above the level from the others. The function is
//! linear along the edges of the cells. Segments of neighbouring cells share a point of their common edge, so they
//! join to lines. A cell with two opposite corners above the level has two solutions; the mean of its corners decides.
//!
//! # Sources
//! W. E. Lorensen, H. E. Cline, Computer Graphics 21 (1987) 163: marching cubes, here in two dimensions.

use std::collections::BTreeMap;

use super::canvas::Point;

/// An edge of the grid: column and row of its first point, and whether it leads to the next row.
type Edge = (usize, usize, bool);

/// The lines at which the function has this value. `values[j][i]` belongs to (`x[i]`, `y[j]`). A closed line ends where
/// it begins. There is no line through cells with a value that is not finite.
pub fn contours(x: &[f64], y: &[f64], values: &[Vec<f64>], level: f64) -> Vec<Vec<Point>> {
    let at = |(i, j): (usize, usize)| values[j][i];
    let place = |(i, j, up): Edge| {
        let (p, q) = ((i, j), if up { (i, j + 1) } else { (i + 1, j) });
        let share = (level - at(p)) / (at(q) - at(p));
        (x[p.0] + share * (x[q.0] - x[p.0]), y[p.1] + share * (y[q.1] - y[p.1]))
    };
    let mut segments = Vec::new();
    for j in 0..y.len().saturating_sub(1) {
        for i in 0..x.len().saturating_sub(1) {
            let corners = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)].map(at);
            segments.extend(of_cell((i, j), corners, level));
        }
    }
    joined(&segments).into_iter().map(|line| line.into_iter().map(place).collect()).collect()
}

/// The segments in a cell. The corners follow each other around it.
fn of_cell(
    (i, j): (usize, usize),
    corners: [f64; 4],
    level: f64,
) -> impl Iterator<Item = (Edge, Edge)> {
    // Edge k leads from corner k to the next one.
    let edges: [Edge; 4] = [(i, j, false), (i + 1, j, true), (i, j + 1, false), (i, j, true)];
    let above = corners.map(|corner| corner > level);
    let is_known = corners.iter().all(|corner| corner.is_finite());
    let crossed: Vec<Edge> =
        (0..4).filter(|k| is_known && above[*k] != above[(k + 1) % 4]).map(|k| edges[k]).collect();
    let middle = corners.iter().sum::<f64>() / 4.0 > level;
    let found = match crossed[..] {
        [first, second] => [Some((first, second)), None],
        // The segments cut off the two corners that are not on the same side of the level as the middle.
        [a, b, c, d] if above[0] == middle => [Some((a, b)), Some((c, d))],
        [a, b, c, d] => [Some((d, a)), Some((b, c))],
        _ => [None, None],
    };
    found.into_iter().flatten()
}

/// Joins segments with common ends to lines.
fn joined(segments: &[(Edge, Edge)]) -> Vec<Vec<Edge>> {
    let mut at: BTreeMap<Edge, Vec<usize>> = BTreeMap::new();
    for (number, (from, to)) in segments.iter().enumerate() {
        at.entry(*from).or_default().push(number);
        at.entry(*to).or_default().push(number);
    }
    let mut used = vec![false; segments.len()];
    let mut lines = Vec::new();
    // Lines with ends begin at an end. The other lines are closed.
    let open = at.iter().filter(|(_, own)| own.len() == 1);
    for start in open.chain(&at).map(|(edge, _)| *edge) {
        let mut line = vec![start];
        let mut edge = start;
        while let Some(next) = at[&edge].iter().copied().find(|number| !used[*number]) {
            used[next] = true;
            let (from, to) = segments[next];
            edge = if from == edge { to } else { from };
            line.push(edge);
        }
        if line.len() > 1 {
            lines.push(line);
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid on [−1, 1]² whose steps grow, and a function on it.
    fn grid(count: u32, f: impl Fn(f64, f64) -> f64) -> (Vec<f64>, Vec<Vec<f64>>) {
        let bent = |t: f64| t * (0.75 + 0.25 * t.abs());
        let x: Vec<f64> =
            (0..=count).map(|i| bent(2.0 * f64::from(i) / f64::from(count) - 1.0)).collect();
        let values = x.iter().map(|y| x.iter().map(|x| f(*x, *y)).collect()).collect();
        (x, values)
    }

    #[test]
    fn contours_of_a_paraboloid_are_closed_circles() {
        let (x, values) = grid(80, |x, y| x * x + y * y);
        for radius in [0.2, 0.5, 0.9] {
            let lines = contours(&x, &x, &values, radius * radius);
            assert_eq!(lines.len(), 1, "radius {radius}");
            assert_eq!(lines[0].first(), lines[0].last());
            // Linear interpolation of a parabola is wrong by at most h²/4 in its value.
            for (x, y) in &lines[0] {
                assert!((libm::hypot(*x, *y) - radius).abs() < 1e-3, "{x} {y}");
            }
            let area = |pair: &[Point]| 0.5 * (pair[0].0 * pair[1].1 - pair[1].0 * pair[0].1);
            let area = lines[0].windows(2).map(area).sum::<f64>().abs();
            assert!((area / (std::f64::consts::PI * radius * radius) - 1.0).abs() < 0.01);
        }
        assert!(contours(&x, &x, &values, 2.5).is_empty());
        // A circle that leaves the grid is four arcs.
        assert_eq!(contours(&x, &x, &values, 1.2).len(), 4);
    }

    #[test]
    fn contours_of_a_plane_are_straight_and_end_at_the_edges_of_the_grid() {
        let (x, values) = grid(7, |x, y| x + 2.0 * y);
        let lines = contours(&x, &x, &values, 0.3);
        assert_eq!(lines.len(), 1);
        assert!(lines[0].iter().all(|(x, y)| (x + 2.0 * y - 0.3).abs() < 1e-12));
        let ends = [lines[0][0], lines[0][lines[0].len() - 1]];
        assert!(ends.iter().all(|(x, y)| (x.abs().max(y.abs()) - 1.0).abs() < 1e-12));
    }

    #[test]
    fn the_mean_of_a_saddle_decides_how_its_corners_are_joined() {
        let saddle = |level: f64| {
            contours(&[0.0, 1.0], &[0.0, 1.0], &[vec![1.0, 0.0], vec![0.0, 1.0]], level)
        };
        // Around corner (1, 0) the lines end on the lower and the right edge.
        let cuts_low = |lines: &[Vec<Point>]| {
            lines.iter().any(|line| line.iter().all(|(x, y)| *x > 0.5 - 0.3 && *y < 0.5 + 0.3))
        };
        assert_eq!((saddle(0.4).len(), saddle(0.6).len()), (2, 2));
        assert!(cuts_low(&saddle(0.25)) && !cuts_low(&saddle(0.75)));
    }

    #[test]
    fn a_missing_value_interrupts_a_line() {
        let (x, mut values) = grid(20, |x, _| x);
        values[10][10] = f64::NAN;
        let lines = contours(&x, &x, &values, 0.01);
        assert_eq!(lines.len(), 2);
        assert!(lines.iter().flatten().all(|(_, y)| y.abs() > 0.05));
    }
}
