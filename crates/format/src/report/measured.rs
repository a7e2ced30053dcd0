//! Measured numbers in the report of a run: points in its figures, and a table of the differences.

use fretwork_engine::numeric::linear;
use fretwork_engine::outcome::Quantity;
use fretwork_plot::{Series, Style};
use serde::Deserialize;

use super::html;
use crate::notation::{Notation, cycles, digits, percent, with_unit};
use crate::table::Table;

/// Maximum number of points in the table.
const ROWS: usize = 30;
/// Significant digits of a number, and of a difference.
const DIGITS: u8 = 4;
const DIFFERENCE: u8 = 3;

/// Measured numbers in SI, with the members of the data of a fit.
#[derive(Debug, Clone, Deserialize)]
pub struct Measured {
    /// What the report calls them.
    #[serde(skip)]
    pub name: String,
    /// The column of the history that was measured.
    pub output: String,
    /// `cycles` or `dissipated_energy`.
    over: String,
    x: Vec<f64>,
    y: Vec<Option<f64>>,
}

impl Measured {
    /// The points at which something was measured: x and y.
    fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.x.iter().zip(&self.y).filter_map(|(x, y)| Some((*x, (*y)?)))
    }

    /// The points over the cycles of the run. `convert` converts y to the unit of the figure.
    pub(super) fn series(&self, history: &Table, convert: impl Fn(f64) -> f64) -> Series {
        let at =
            |x| linear(history.axis(&self.over), history.axis("cycles"), x).unwrap_or(f64::NAN);
        let (x, y) = self.points().map(|(x, y)| (at(x), convert(y))).unzip();
        let label = format!("Measured: {}", self.name);
        Series::new(&label, x, y).styled(Style { width: 0.0, ..Style::marked(2) })
    }

    /// The table of the differences to the run.
    pub(super) fn section(&self, history: &Table, notation: Notation) -> String {
        let quantity = Quantity::named(&self.output);
        let (words, unit) = quantity.map_or(("", "1"), |quantity| (quantity.words, quantity.unit));
        let (over, own) = (history.axis(&self.over), history.axis(&self.output));
        let at = |x| linear(over, own, x).unwrap_or(f64::NAN);
        let points: Vec<_> = self.points().map(|(x, y)| (x, y, at(x))).collect();
        let most = points.iter().map(|(_, y, _)| y.abs()).fold(0.0, f64::max);
        let (unit, factor) = notation.scale(unit, most);
        let text = |value: f64, count| with_unit(&digits(value * factor, count), &unit);
        let place = |x| match &*self.over {
            "cycles" => cycles(x),
            _ => notation.quantity(x, "J", DIGITS),
        };
        let rows = points.iter().take(ROWS).map(|(x, y, own)| {
            let share = percent((y - own) / own, DIFFERENCE);
            vec![place(*x), text(*y, DIGITS), text(*own, DIGITS), text(y - own, DIFFERENCE), share]
        });
        let shares = points.iter().map(|(_, y, own)| (y - own) / own);
        let shares: Vec<f64> = shares.filter(|share| share.is_finite()).collect();
        let mean = |values: &dyn Fn(&f64) -> f64| {
            shares.iter().map(values).sum::<f64>() / shares.len() as f64
        };
        let note = format!(
            "<p>{} points; the mean relative difference is {}, and the root mean square {}.</p>",
            points.len(),
            percent(mean(&|share| *share), DIFFERENCE),
            percent(mean(&|share| share * share).sqrt(), DIFFERENCE)
        );
        let over = if self.over == "cycles" { "Cycles N" } else { "Dissipated energy ΣW" };
        let head = [over, "Measured", "Computed", "Difference", "Relative"];
        let title = format!("Measured: {}, {}", self.name, words.to_lowercase());
        html::section(&title, &(html::table(&head, rows) + &note))
    }
}
