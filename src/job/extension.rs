//! Studies that take the rows of their first points from the result of an earlier study.

use serde_json::Value;

use super::{Canonical, ENGINE, Key, Prepared, Task, TaskKind};
use crate::json::escaped;
use crate::study::Study;

impl Prepared {
    /// The same study, whose first points are not computed if the result `key` is still stored: it is the same Sobol sweep
    /// with fewer samples. `earlier` is what that result was computed from.
    ///
    /// # Errors
    /// A sentence for the client: this study does not extend that result.
    pub fn extending(&self, key: &Key, earlier: &Canonical) -> Result<Self, String> {
        let study = match &self.task {
            Task::Study(study) if study.can_extend() => study,
            _ => {
                return Err(
                    "works only beside a `sweep` with the design `sobol`. Remove `extends`"
                        .to_owned(),
                );
            }
        };
        if earlier.kind != self.task.kind() {
            let kind = earlier.kind.word();
            return Err(format!("is the key of a {kind}. Enter the key of a sweep"));
        }
        let without_samples = |mut canonical: Value| {
            let samples = canonical["samples"].take();
            (canonical, samples.as_u64().unwrap_or_default() as usize)
        };
        let (theirs, count) = without_samples(earlier.value.clone());
        let (ours, wanted) = without_samples(study.canonical().clone());
        if let Some(pointer) = first_difference(&theirs, &ours) {
            return Err(format!(
                "is the key of another sweep: in SI and with all defaults, they first differ at `/sweep{pointer}`. Only \
                 `samples` may differ"
            ));
        }
        if count >= wanted {
            return Err(format!(
                "is the key of a sweep with {count} samples, but this one has {wanted}. Enter more samples"
            ));
        }
        if earlier_key(study, count) != *key {
            return Err("is the key of a sweep that another version of the engine computed, whose rows can differ. Remove \
                        `extends`, or submit that sweep again first"
                .to_owned());
        }
        let stored = self.task.kind().stored_extending(study.canonical(), count);
        Self::from_stored(&self.key, &stored)
    }
}

/// The key of the result that has the first points of a study; `None` if it extends no other study.
#[must_use]
pub fn extended_key(study: &Study) -> Option<Key> {
    (study.earlier() > 0).then(|| earlier_key(study, study.earlier()))
}

fn earlier_key(study: &Study, samples: usize) -> Key {
    TaskKind::Study(study.kind()).key(ENGINE.numerics, &study.with_samples(samples))
}

/// The JSON pointer of the first difference of two documents with sorted members.
fn first_difference(one: &Value, other: &Value) -> Option<String> {
    let below = |token: &str, one: &Value, other: &Value| {
        first_difference(one, other).map(|rest| format!("/{}{rest}", escaped(token)))
    };
    match (one, other) {
        (Value::Object(one), Value::Object(other)) => {
            let of_one = one.iter().find_map(|(name, value)| {
                below(name, value, other.get(name).unwrap_or(&Value::Null))
            });
            let more = || other.keys().find(|name| !one.contains_key(*name));
            of_one.or_else(|| more().map(|name| format!("/{}", escaped(name))))
        }
        (Value::Array(one), Value::Array(other)) if one.len() == other.len() => {
            let mut pairs = one.iter().zip(other).enumerate();
            pairs.find_map(|(place, (one, other))| below(&place.to_string(), one, other))
        }
        _ => (one != other).then(String::new),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::job::task::tests::ball;

    /// A Sobol sweep after a change.
    fn sweep(change: impl FnOnce(&mut Value)) -> Prepared {
        let mut sweep = json!({
            "scenario": ball(), "vary": [{"pointer": "/friction", "from": 0.4, "to": 0.8}],
            "design": "sobol", "samples": 64, "outputs": ["wear_volume"]});
        change(&mut sweep);
        let kind = TaskKind::of_member("sweep").unwrap();
        Prepared::read(kind, sweep).unwrap_or_else(|faults| panic!("{faults:?}"))
    }

    fn extending(large: &Prepared, small: &Prepared) -> Result<Prepared, String> {
        large.extending(&small.key, &small.asked())
    }

    #[test]
    fn an_extended_study_has_the_same_key_and_remembers_its_earlier_points() {
        let (small, large) = (sweep(|_| ()), sweep(|sweep| sweep["samples"] = json!(100)));
        let extended = extending(&large, &small).unwrap();
        assert_eq!((extended.key, extended.asked()), (large.key, large.asked()));
        let again = Prepared::from_stored(&extended.key, &extended.stored).unwrap();
        for prepared in [&extended, &again] {
            let Task::Study(study) = &prepared.task else { panic!("it is a study") };
            assert_eq!((study.earlier(), extended_key(study)), (64, Some(small.key)));
            assert!(prepared.chunks().is_some() && prepared.seconds < large.seconds);
        }
        let Task::Study(study) = &large.task else { panic!("it is a study") };
        assert_eq!(extended_key(study), None);
    }

    #[test]
    fn a_refusal_names_the_first_difference() {
        let large = sweep(|sweep| sweep["samples"] = json!(100));
        let refused = |small: &Prepared| extending(&large, small).map(|_| ()).unwrap_err();
        for (pointer, changed) in [
            ("/sweep/scenario/friction", sweep(|sweep| sweep["scenario"]["friction"] = json!(0.6))),
            ("/sweep/vary/0/from", sweep(|sweep| sweep["vary"][0]["from"] = json!(0.5))),
            ("/sweep/design", sweep(|sweep| sweep["design"] = json!("latin_hypercube"))),
            ("/sweep/seed", sweep(|sweep| sweep["seed"] = json!(1))),
            ("/sweep/outputs/0", sweep(|sweep| sweep["outputs"][0] = json!("wear_depth"))),
            (
                "/sweep/outputs",
                sweep(|sweep| sweep["outputs"] = json!(["wear_volume", "wear_depth"])),
            ),
        ] {
            let detail = refused(&changed);
            assert!(detail.contains(&format!("differ at `{pointer}`.")), "{detail}");
        }
        let run = Prepared::from_scenario(ball(), "").unwrap();
        assert!(refused(&run).starts_with("is the key of a run."));
        let more = refused(&sweep(|sweep| sweep["samples"] = json!(100)));
        assert!(more.contains("with 100 samples, but this one has 100"), "{more}");
        let by_another = large.extending(&large.key, &sweep(|_| ()).asked()).map(|_| ());
        assert!(by_another.unwrap_err().contains("another version of the engine"));
        let grid = sweep(|sweep| {
            sweep["design"] = json!("grid");
            sweep["vary"][0]["count"] = json!(8);
            sweep.as_object_mut().unwrap().remove("samples");
        });
        for other in [&grid, &run] {
            let detail = extending(other, &large).map(|_| ()).unwrap_err();
            assert!(detail.starts_with("works only beside"), "{detail}");
        }
    }
}
