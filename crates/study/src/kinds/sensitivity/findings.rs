//! The table and the notes of a sensitivity study. The table shows each estimate as it was computed. A note says what
//! limits an estimate.

use serde_json::{Value, json};

use crate::plan::{Findings, number_cells};
use crate::stats::derivative::Derivative;
use crate::stats::indices::{Index, indices};
use crate::stats::morris::Effect;
use crate::stats::{Bootstrap, Estimate};

/// An output as the table names it.
#[derive(Debug, Clone, Copy)]
pub struct Named<'a> {
    /// Its name.
    pub name: &'a str,
    /// The SI unit.
    pub unit: &'a str,
    /// The relative error that its values can have.
    pub accuracy: f64,
}

/// A row: its output, its member, and its numbers. They are missing if there is no estimate.
type EstimateRow<'a> = (Named<'a>, &'a str, Vec<f64>);

/// The table and the notes, built row by row.
pub struct EstimateTable<'a> {
    columns: &'static [&'static str],
    rows: Vec<EstimateRow<'a>>,
    notes: Vec<Value>,
}

impl<'a> EstimateTable<'a> {
    /// An empty table. These columns of numbers come after the columns `output`, `unit` and `member`.
    pub fn new(columns: &'static [&'static str]) -> Self {
        Self { columns, rows: Vec::new(), notes: Vec::new() }
    }

    /// The members `table` and `notes` of the document.
    pub fn finished(self) -> Findings {
        let texts =
            |of: fn(&EstimateRow<'a>) -> &'a str| self.rows.iter().map(of).collect::<Value>();
        let numbers = |(place, name): (usize, &&'static str)| {
            let cells = self.rows.iter().map(|(.., numbers)| numbers.get(place).copied());
            (*name, number_cells(cells))
        };
        let texts = [
            ("output", texts(|(output, ..)| output.name)),
            ("unit", texts(|(output, ..)| output.unit)),
            ("member", texts(|(_, member, _)| member)),
        ];
        let numbers = self.columns.iter().enumerate().map(numbers);
        let table = texts.into_iter().chain(numbers).collect();
        let members = vec![("notes", self.notes.into()), ("table", table)];
        Findings { members, ..Findings::default() }
    }

    fn row(&mut self, output: Named<'a>, member: &'a str, numbers: &[f64]) {
        self.rows.push((output, member, numbers.to_vec()));
    }

    fn note(&mut self, output: Named<'_>, member: Option<&str>, detail: &str) {
        let mut note = json!({"output": output.name, "detail": detail});
        if let Some(member) = member {
            note["member"] = json!(member);
        }
        self.notes.push(note);
    }

    /// Adds the rows of an output: its Sobol indices.
    pub fn shares(
        &mut self,
        output: Named<'a>,
        members: &[&'a str],
        values: &[Option<f64>],
        bootstrap: &Bootstrap,
    ) {
        let found = match indices(values, members.len(), bootstrap) {
            Ok(found) => found,
            Err(why) => {
                for member in members {
                    self.row(output, member, &[]);
                }
                return self.note(output, None, &why);
            }
        };
        for (member, Index { first, total }) in members.iter().zip(&found.members) {
            let numbers = [first, total].map(|Estimate { value, low, high }| [*value, *low, *high]);
            self.row(output, member, numbers.as_flattened());
        }
        for (member, caution) in found.cautions() {
            self.note(output, member.map(|member| members[member]), &caution);
        }
    }

    /// Adds the rows of an output: the elementary effects on it.
    pub fn effects(
        &mut self,
        output: Named<'a>,
        members: &[&'a str],
        found: &[Result<Effect, String>],
        planned: usize,
    ) {
        for (member, effect) in members.iter().zip(found) {
            match effect {
                Ok(Effect { mean, strength: Estimate { value, low, high }, deviation, count }) => {
                    self.row(output, member, &[*mean, *value, *low, *high, *deviation]);
                    if *count < planned {
                        let detail = format!(
                            "{} of {planned} elementary effects are left out, because a point of them has no value. \
                             The numbers hold for the other points only.",
                            planned - count
                        );
                        self.note(output, Some(member), &detail);
                    }
                }
                Err(why) => {
                    self.row(output, member, &[]);
                    self.note(output, Some(member), why);
                }
            }
        }
        let constant = |effect: &Effect| effect.strength.value == 0.0;
        if found.iter().all(|effect| effect.as_ref().is_ok_and(constant)) {
            let detail = "The output has the same value at all points. Choose another output, or vary other members or \
                          wider ranges.";
            self.note(output, None, detail);
        }
    }

    /// Adds a row: the elasticity of an output, x/y·dy/dx.
    pub fn elasticity(
        &mut self,
        output: Named<'a>,
        member: &'a str,
        (x, y): (f64, f64),
        derivative: Option<Derivative>,
    ) {
        match derivative {
            Some(Derivative { value, error }) if y != 0.0 => {
                let share = x / y;
                let (value, error) = (value * share, (error * share).abs());
                self.row(output, member, &[value, value - error, value + error]);
            }
            found => {
                self.row(output, member, &[]);
                let detail = if found.is_some() {
                    "The output is 0 at the values of the scenario, so it has no elasticity."
                } else {
                    "The output has no value at the values of the scenario, or at too many points around them. Choose \
                     another output or other values."
                };
                self.note(output, Some(member), detail);
            }
        }
    }
}
