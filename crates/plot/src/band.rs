//! Bands: named regions of a figure between two curves.

use super::canvas::{Anchor, Area, Canvas, Point};
use super::text::{GAP, LABEL, SINK, width};

/// The weight of the position of a name: a name moves 1 px towards the middle of its band if it loses less than this
/// height, in px.
const ASIDE: f64 = 0.8;
/// Largest distance, in px, between two positions that are tried for a name.
const STEP: f64 = 8.0;

/// A coloured region.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// The name of the band, written inside it if there is enough space.
    pub label: String,
    /// An SVG colour.
    pub color: &'static str,
    /// Abscissae.
    pub x: Vec<f64>,
    /// Lower and upper ordinates. The band has a gap where one of them is not finite.
    pub between: Vec<(f64, f64)>,
}

impl Band {
    /// Draws the pieces of the band between its gaps. Each piece is a list of points of the lower and of the upper
    /// curve, in px. The points may lie outside `area`, but the name must not.
    pub(super) fn draw(&self, canvas: &mut Canvas, area: &Area, pieces: &[Vec<(Point, Point)>]) {
        for piece in pieces {
            let low = piece.iter().map(|(low, _)| *low);
            let outline: Vec<Point> =
                low.chain(piece.iter().rev().map(|(_, high)| *high)).collect();
            canvas.area(&outline, self.color);
        }
        let half = 0.5 * width(&self.label) * LABEL + GAP;
        let inside = |(x, y): Point| (x, y.clamp(area.top, area.bottom()));
        let visible = pieces.iter().map(|piece| -> Vec<(Point, Point)> {
            dense(piece).map(|(low, high)| (inside(low), inside(high))).collect()
        });
        let places = visible.filter_map(|piece| widest(&piece, half));
        let best =
            places.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, room)| *room > 1.5 * LABEL);
        if let Some(((x, y), _)) = best {
            canvas.text((x, y + SINK), Anchor::Middle, LABEL, &self.label);
        }
    }
}

/// The points of a piece, with additional points between them.
fn dense(piece: &[(Point, Point)]) -> impl Iterator<Item = (Point, Point)> {
    let between =
        |a: Point, b: Point, share: f64| (a.0 + share * (b.0 - a.0), a.1 + share * (b.1 - a.1));
    let added = piece.windows(2).flat_map(move |pair| {
        let [(low, high), (next_low, next_high)] = [pair[0], pair[1]];
        let steps = ((next_low.0 - low.0).abs() / STEP).ceil().max(1.0);
        (0..steps as usize).map(move |step| {
            let share = step as f64 / steps;
            (between(low, next_low, share), between(high, next_high, share))
        })
    });
    added.chain(piece.last().copied())
}

/// Finds a place for a name in a piece: a box with the half width `half`. Returns the middle of the box and its height.
/// A box near the middle of the piece is preferred to a slightly higher box at its end.
fn widest(piece: &[(Point, Point)], half: f64) -> Option<(Point, f64)> {
    let (first, last) = (piece.first()?.0.0, piece.last()?.0.0);
    let room = |at: &f64| {
        let inside = |((x, _), _): &&(Point, Point)| (x - at).abs() <= half;
        let near = piece
            .iter()
            .filter(inside)
            .chain(beside(piece, at - half))
            .chain(beside(piece, at + half));
        // The vertical axis of the page points down.
        let (floor, roof) = near.fold((f64::INFINITY, 0.0_f64), |(floor, roof), (low, high)| {
            (floor.min(low.1), roof.max(high.1))
        });
        ((*at, 0.5 * (floor + roof)), floor - roof)
    };
    let places = piece.iter().map(|((x, _), _)| *x);
    let fitting = places.filter(|x| x - half >= first && x + half <= last);
    let rank =
        |(place, height): &(Point, f64)| height - ASIDE * (place.0 - 0.5 * (first + last)).abs();
    fitting.map(|x| room(&x)).max_by(|a, b| rank(a).total_cmp(&rank(b)))
}

/// The two points of a piece next to an abscissa, one on each side.
fn beside(piece: &[(Point, Point)], x: f64) -> &[(Point, Point)] {
    let next = piece.partition_point(|((own, _), _)| *own < x);
    &piece[next.saturating_sub(1)..(next + 1).min(piece.len())]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_is_where_the_band_is_highest() {
        // A wedge that opens to the right, from x = 0 to 100.
        let wedge = (0..=10).map(|i| f64::from(i) * 10.0).map(|x| ((x, 200.0), (x, 200.0 - x)));
        let wedge: Vec<_> = wedge.collect();
        let ((x, y), room) = widest(&wedge, 20.0).unwrap();
        // The band is 60 px high at the left end of the box; the point before it counts too.
        assert_eq!((x, y, room), (80.0, 175.0, 50.0));
        assert_eq!(widest(&wedge, 60.0), None);
        assert_eq!(widest(&[], 1.0), None);
    }
}
