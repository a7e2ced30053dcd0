//! The kinds of studies. [`Kind::ALL`] is the only list of all kinds.

mod fit;
mod map;
mod sensitivity;
mod sweep;

pub use self::fit::{Likelihood, LikelihoodCall};
use super::plan::Kind;

impl Kind {
    /// All kinds.
    pub const ALL: [&'static Self; 4] = [&sweep::KIND, &sensitivity::KIND, &map::KIND, &fit::KIND];

    /// The kind with this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        Self::ALL.into_iter().find(|kind| kind.name == name)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;
    use std::iter;
    use std::sync::Arc;

    use fretwork_engine::input::fault::Valid;
    use serde_json::{Map, Value, json};

    use crate::member::Member;
    use crate::plan::{Hints, Plan, Read, Tried};
    use crate::problem::{Problem, outputs_of};
    use crate::rows::Rows;
    use crate::{Claimed, Kind, Points, Study, StudyFigure};

    /// Computes a study in this number of chunks.
    pub fn rows(study: &Arc<Study>, chunks: usize) -> Rows {
        let mut all = Rows::default();
        for number in 0..chunks {
            let mut points = Points::chunk(Arc::clone(study), number, chunks, all.clone());
            all.append(iter::repeat_with(|| points.step()).find_map(|rows| rows).unwrap());
        }
        all
    }

    /// The document of a study that is computed in this number of chunks.
    pub fn document(study: &Arc<Study>, chunks: usize) -> Value {
        let text = study.document(&"key", &"engine", rows(study, chunks));
        assert!(text.len() <= study.bytes(), "{} {}", text.len(), study.bytes());
        Claimed::read(study, &"key", &"engine", &text).unwrap();
        serde_json::from_str(&text).unwrap()
    }

    #[test]
    fn the_figures_and_offers_of_each_kind_are_consistent() {
        let mut ids = HashSet::new();
        for kind in Kind::ALL {
            assert_eq!(Kind::named(kind.name), Some(kind));
            for (design, Hints { figures, regions, bars, .. }) in kind.designs {
                assert_eq!(figures.contains(&StudyFigure::Regimes), regions.is_some(), "{design}");
                assert_eq!(figures.contains(&StudyFigure::Tornado), bars.is_some(), "{design}");
                assert!(!figures.is_empty());
            }
            assert!(!kind.designs.is_empty());
            for offer in kind.offers {
                assert!(ids.insert(offer.id), "{} is the id of two offers", offer.id);
                serde_json::from_str::<Map<String, Value>>(offer.members).unwrap();
            }
        }
    }

    /// The friction at which gross slip begins, for two amplitudes. Each point finds it by bisection.
    #[derive(Debug)]
    struct Thresholds;

    const AMPLITUDES: [f64; 2] = [1e-6, 2e-6];
    const STEPS: usize = 40;

    impl Plan for Thresholds {
        fn points(&self) -> usize {
            AMPLITUDES.len()
        }

        fn point(&self, number: usize) -> Vec<f64> {
            vec![AMPLITUDES[number], 0.5]
        }

        fn row(
            &self,
            _: &Problem,
            number: usize,
            _: &Rows,
            tried: &[Tried],
        ) -> Result<Tried, Vec<f64>> {
            let (mut low, mut high) = (0.0, 1.0);
            for Tried { values, found } in tried {
                let slips = found.outputs[0] == Some(0.0);
                *(if slips { &mut low } else { &mut high }) = values[1];
            }
            let last = tried.last().filter(|_| tried.len() == STEPS);
            last.cloned().ok_or_else(|| vec![AMPLITUDES[number], 0.5 * (low + high)])
        }
    }

    fn read_thresholds(mut study: Value) -> Valid<Read> {
        let scenario = study["scenario"].take();
        let members = ["/motion/amplitude", "/friction"]
            .map(|pointer| Member::find(&scenario, pointer).unwrap());
        let outputs = outputs_of(json!(["unworn.stick_radius"]), &scenario)?;
        drop(study);
        let problem = Problem::new(scenario, members.to_vec(), outputs);
        Ok(Read::new(Map::new(), problem, Thresholds))
    }

    #[test]
    fn later_runs_of_a_point_can_depend_on_earlier_ones() {
        static KIND: Kind = Kind {
            name: "thresholds",
            title: "Thresholds",
            rows: "table",
            keeps_profiles: false,
            axes: &[],
            design: "",
            designs: &[("", Hints::of(&[StudyFigure::Curves]))],
            offers: &[],
            read: read_thresholds,
        };
        let scenario = json!({
            "profile": {"shape": "paraboloid", "radius": "10 mm"},
            "moduli": {"normal": "113 GPa", "tangential": "93 GPa"}, "friction": 0.7,
            "wear": {"coefficient": "3.03e-5 mm^3/(N m)"}, "load": {"normal_force": "100 N"},
            "motion": {"amplitude": "2 um"}, "cycles": [1000]});
        let study = Arc::new(Study::read(&KIND, json!({"scenario": scenario})).unwrap());
        let mut points = Points::whole(Arc::clone(&study));
        let mut steps = 0;
        let rows = iter::repeat_with(|| points.step()).inspect(|_| steps += 1).find_map(|it| it);
        // Each call of `step` completes one run. The last call returns the rows.
        assert_eq!(steps, AMPLITUDES.len() * STEPS + 1);
        let document: Value =
            serde_json::from_str(&study.document(&"key", &"engine", rows.unwrap())).unwrap();
        // K. L. Johnson, Contact Mechanics (1985), (4.22) and (7.41): U = 3μF/(4G*a).
        let radius = libm::cbrt(3.0 * 100.0 * 0.01 / (4.0 * 113e9));
        for (number, amplitude) in AMPLITUDES.iter().enumerate() {
            let friction = document["table"]["/friction"][number].as_f64().unwrap();
            let known = amplitude * 4.0 * 93e9 * radius / (3.0 * 100.0);
            assert!((friction - known).abs() < 1e-9, "{friction} {known}");
        }
    }
}
