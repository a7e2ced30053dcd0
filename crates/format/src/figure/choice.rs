//! Chooses the figure of a study from the members and outputs of the study and the request of the client.

use crate::view::StudyOptions;
use crate::{Missing, QUANTITIES, View};
use fretwork_study::{Hints, StudyFigure};

/// Maximum number of curves in a family.
pub const MAX_CURVES: usize = 7;

/// What a study offers for figures.
pub struct Offer {
    /// The figures of its kind.
    pub hints: Hints,
    /// The pointers of the numbers that vary, and how many values each has.
    pub members: Vec<(String, usize)>,
    /// The names of its outputs, the default first.
    pub outputs: Vec<String>,
}

/// A figure of a study. Its output and its members are indices in the lists of the offer. A kind of figure ignores what it
/// does not need.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Choice {
    /// The kind of figure.
    pub kind: StudyFigure,
    /// The output that the figure shows.
    pub output: usize,
    /// The member on the horizontal axis.
    pub over: usize,
    /// The member on the vertical axis of a heat map, or the one with a curve for each of its values.
    pub by: Option<usize>,
}

impl Offer {
    /// The figures that this study can have, the default first. A heat map needs two numbers.
    fn kinds(&self) -> impl Iterator<Item = StudyFigure> {
        let has_two = self.members.len() > 1;
        self.hints.figures.iter().copied().filter(move |kind| has_two || *kind != StudyFigure::Heat)
    }

    /// The requested figure, or all faults of the request.
    pub fn choose(&self, view: &View) -> Result<Choice, Vec<Missing>> {
        let options = &view.figure.study;
        let mut faults = Vec::new();
        let mut wrong = |parameter, detail: String| faults.push(Missing { parameter, detail });
        if view.figure.quantity != &QUANTITIES[0] {
            let outputs = self.outputs.join(", ");
            wrong(
                "quantity",
                format!("is for runs. This is a study: enter output, one of {outputs}"),
            );
        }
        if view.cycles.is_some() {
            wrong("cycles", "is for runs: the rows of a study have no output cycles".to_owned());
        }
        let kind = options.kind.unwrap_or_else(|| self.default_kind(options));
        let is_possible = self.kinds().any(|known| known == kind);
        if !is_possible {
            let names: Vec<_> = self.kinds().map(StudyFigure::as_str).collect();
            wrong("kind", format!("must be one of {} for this study", names.join(", ")));
        }
        let outputs: Vec<&str> = self.outputs.iter().map(String::as_str).collect();
        let members: Vec<&str> = self.members.iter().map(|(pointer, _)| pointer.as_str()).collect();
        let mut named = |parameter, names: &[&str], name: &Option<String>, allowed: bool| {
            let name = name.as_deref()?;
            let place = names.iter().position(|own| *own == name);
            if !allowed {
                wrong(parameter, format!("is not possible for kind={kind}"));
            } else if place.is_none() {
                wrong(parameter, format!("must be one of {}, got {name:?}", names.join(", ")));
            }
            place
        };
        // If the study cannot have curves at all, the fault of `kind` says so.
        let has_families = self.hints.is_grid || !is_possible;
        let has_second = self.members.len() > 1
            && (kind == StudyFigure::Heat || kind == StudyFigure::Curves && has_families);
        let output = named("output", &outputs, &options.output, kind.has_output()).unwrap_or(0);
        let over = named("over", &members, &options.over, kind.has_axes());
        let by = named("by", &members, &options.by, has_second);
        if by.is_some() && by == over {
            wrong("by", "must differ from `over`".to_owned());
        }
        if !faults.is_empty() {
            return Err(faults);
        }
        let (over, by) = self.axes(over, by);
        let by_count = by.map_or(1, |by| self.members[by].1);
        let is_open = options.kind.is_none() && has_second;
        let is_dense = is_open && by_count.min(self.members[over].1) > MAX_CURVES;
        let kind = if is_dense { StudyFigure::Heat } else { kind };
        Ok(Choice { kind, output, over, by: by.filter(|_| has_second) })
    }

    /// The first kind of figure that supports the requested options.
    fn default_kind(&self, options: &StudyOptions) -> StudyFigure {
        let has_axes = options.over.is_some() || options.by.is_some();
        let fits = |kind: &StudyFigure| {
            (options.output.is_none() || kind.has_output()) && (!has_axes || kind.has_axes())
        };
        self.kinds().find(fits).unwrap_or(self.hints.figures[0])
    }

    /// The members on the axes. By default these are the members with the largest numbers of values. A figure with
    /// regions has the first member on the horizontal axis.
    fn axes(&self, over: Option<usize>, by: Option<usize>) -> (usize, Option<usize>) {
        let most = |other: Option<usize>| {
            let free = (0..self.members.len()).rev().filter(|place| Some(*place) != other);
            free.max_by_key(|place| match self.hints.regions {
                Some(_) => 0,
                None => self.members[*place].1,
            })
        };
        let over = over.or_else(|| most(by)).unwrap_or(0);
        (over, by.or_else(|| most(Some(over))))
    }
}

#[cfg(test)]
mod tests {
    use fretwork_study::Kind;
    use serde_json::json;

    use super::*;

    /// An offer of a kind of study with a member that says how its points lie.
    fn offer((kind, design): (&str, &str), counts: &[usize]) -> Offer {
        let names = ["/friction", "/motion/amplitude", "/load/normal_force"];
        let members = names.iter().zip(counts).map(|(name, count)| ((*name).to_owned(), *count));
        let outputs = ["wear_volume", "wear_depth"].map(str::to_owned).to_vec();
        let kind = Kind::named(kind).unwrap();
        let hints = kind.hints(&json!({ kind.design: design }));
        Offer { hints, members: members.collect(), outputs }
    }

    const GRID: (&str, &str) = ("sweep", "grid");
    const LISTS: (&str, &str) = ("sweep", "zip");
    const DRAWN: (&str, &str) = ("sweep", "sobol");
    const MAP: (&str, &str) = ("map", "");
    const DRAWN_INDICES: (&str, &str) = ("sensitivity", "sobol");
    const INDICES: (&str, &str) = ("sensitivity", "local");

    fn chosen(
        offer: &Offer,
        change: impl FnOnce(&mut StudyOptions),
    ) -> Result<Choice, Vec<String>> {
        let mut view = View::default();
        change(&mut view.figure.study);
        let named = |fault: Missing| format!("{}: {}", fault.parameter, fault.detail);
        offer.choose(&view).map_err(|faults| faults.into_iter().map(named).collect())
    }

    #[test]
    fn the_default_figure_depends_on_the_design_of_the_study() {
        let default =
            |arrangement, counts: &[usize]| chosen(&offer(arrangement, counts), |_| ()).unwrap();
        let choice = |kind, over, by| Choice { kind, output: 0, over, by };
        assert_eq!(default(GRID, &[4, 16]), choice(StudyFigure::Curves, 1, Some(0)));
        assert_eq!(default(GRID, &[9]), choice(StudyFigure::Curves, 0, None));
        assert_eq!(default(GRID, &[3, 3, 2]), choice(StudyFigure::Curves, 0, Some(1)));
        assert_eq!(default(GRID, &[20, 30]), choice(StudyFigure::Heat, 1, Some(0)));
        assert_eq!(default(LISTS, &[9, 9]), choice(StudyFigure::Curves, 0, None));
        assert_eq!(default(DRAWN, &[99, 99]), choice(StudyFigure::Scatter, 0, None));
        assert_eq!(default(MAP, &[48, 48]), choice(StudyFigure::Regimes, 0, None));
        assert_eq!(default(INDICES, &[1, 1]), choice(StudyFigure::Tornado, 0, None));
    }

    #[test]
    fn parameters_change_the_figure() {
        let choice = |kind, output, over, by| Ok(Choice { kind, output, over, by });
        let grid = offer(GRID, &[4, 16]);
        let over = |options: &mut StudyOptions| options.over = Some("/friction".to_owned());
        assert_eq!(chosen(&grid, over), choice(StudyFigure::Curves, 0, 0, Some(1)));
        let heat = |options: &mut StudyOptions| options.kind = Some(StudyFigure::Heat);
        assert_eq!(chosen(&grid, heat), choice(StudyFigure::Heat, 0, 1, Some(0)));
        let depth = |options: &mut StudyOptions| options.output = Some("wear_depth".to_owned());
        let map = chosen(&offer(MAP, &[48, 64]), depth);
        assert_eq!(map, choice(StudyFigure::Heat, 1, 0, Some(1)));
        let indices = offer(DRAWN_INDICES, &[9, 9]);
        assert_eq!(chosen(&indices, depth), choice(StudyFigure::Tornado, 1, 0, None));
        assert_eq!(chosen(&indices, over), choice(StudyFigure::Scatter, 0, 0, None));
    }

    #[test]
    fn all_faults_are_listed_with_the_accepted_values() {
        let faults = chosen(&offer(GRID, &[4, 16]), |options| {
            options.kind = Some(StudyFigure::Tornado);
            options.output = Some("wear".to_owned());
        });
        let faults = faults.unwrap_err();
        assert_eq!(faults[0], "kind: must be one of curves, heat for this study");
        assert_eq!(faults[1], "output: must be one of wear_volume, wear_depth, got \"wear\"");
        let faults = chosen(&offer(GRID, &[4, 16]), |options| {
            options.over = Some("/friction".to_owned());
            options.by = Some("/friction".to_owned());
        });
        assert_eq!(faults.unwrap_err(), ["by: must differ from `over`"]);
        let faults = chosen(&offer(DRAWN, &[9]), |options| {
            options.by = Some("/friction".to_owned());
        });
        assert_eq!(faults.unwrap_err(), ["by: is not possible for kind=scatter"]);
        let faults = chosen(&offer(DRAWN, &[4, 6]), |options| {
            options.kind = Some(StudyFigure::Curves);
            options.by = Some("/friction".to_owned());
        });
        assert_eq!(faults.unwrap_err(), ["kind: must be one of scatter for this study"]);
        let run = View {
            figure: crate::FigureOptions { quantity: &QUANTITIES[1], ..Default::default() },
            cycles: Some(vec![1.0]),
            ..View::default()
        };
        let faults = offer(DRAWN, &[9]).choose(&run).unwrap_err();
        let named: Vec<_> = faults.iter().map(|fault| fault.parameter).collect();
        assert_eq!(named, ["quantity", "cycles"]);
    }
}
