//! The JSON body of a submission. It is parsed once, and all its faults are listed.

use deserr::{Deserr, IntoValue, Value as Typed};
use fretwork_engine::{Faults, Given, Pointer, Valid};
use serde_json::Value;

use super::{Prepared, TaskKind};
use fretwork_json::{BadBody, Distinct, both, read_body, typed};

/// Longest label in characters.
pub const MAX_LABEL: usize = 200;
/// Maximum number of tags of a job.
pub const MAX_TAGS: usize = 20;
/// Longest tag in characters: the page names the run that a run was edited from as `from:` and its key.
pub const MAX_TAG: usize = 80;
/// Longest submitted scenario that is stored, in bytes of compact JSON.
pub const MAX_SUBMITTED: usize = 64 << 10;

/// A valid job body: `{"scenario": {…}, "label"?, "tags"?, "private"?}`, or a study in place of the scenario.
#[derive(Debug, Clone)]
pub struct Submission {
    /// What to compute.
    pub prepared: Prepared,
    /// The scenario or study with the members and units of the client, as compact JSON; `None` if it is longer than
    /// [`MAX_SUBMITTED`].
    pub submitted: Option<String>,
    /// A title for people.
    pub label: Option<String>,
    /// Words to find the job by.
    pub tags: Vec<String>,
    /// Whether only the owner and administrators see the job; `None` if the client does not say.
    pub private: Option<bool>,
}

impl Submission {
    /// Parses a job body. The faults of its form and of its physics are in one list.
    ///
    /// # Errors
    /// The text is not JSON, or it has faults.
    pub fn parse(text: &[u8]) -> Result<Self, BadBody> {
        read_body(text, Self::read)
    }

    fn read(mut body: Value) -> Valid<Self> {
        let (kind, asked) = take_asked(&mut body)?;
        let envelope = typed::<Envelope>(body);
        let submitted = Some(asked.to_string()).filter(|text| text.len() <= MAX_SUBMITTED);
        let (Envelope { label, tags, private }, prepared) =
            both(envelope, Prepared::read(kind, asked))?;
        Ok(Self {
            prepared,
            submitted,
            label: label.0.map(|label| label.0),
            tags: tags.0.map_or_else(Vec::new, texts),
            private: private.0,
        })
    }
}

/// A change of the label, the tags and the privacy of a job: `{"label"?, "tags"?, "private"?}`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Naming {
    /// The new label, or `None` in place of a label; `None` if it does not change.
    pub label: Option<Option<String>>,
    /// The new tags; `None` if they do not change.
    pub tags: Option<Vec<String>>,
    /// Whether only the owner and administrators see the job; `None` if that does not change.
    pub private: Option<bool>,
}

impl Naming {
    /// Parses a change. A label of null removes the label.
    ///
    /// # Errors
    /// The text is not JSON, or it has faults.
    pub fn parse(text: &[u8]) -> Result<Self, BadBody> {
        read_body(text, |mut body: Value| {
            let members = body.as_object_mut();
            let removed = members.and_then(|members| {
                members.get("label").is_some_and(Value::is_null).then(|| members.remove("label"))
            });
            let Envelope { label, tags, private } = typed(body)?;
            let label = label.0.map(|label| label.0);
            Ok(Self {
                label: if removed.is_some() { Some(None) } else { label.map(Some) },
                tags: tags.0.map(texts),
                private: private.0,
            })
        })
    }
}

fn texts<const N: usize, const MOST: usize>(given: Distinct<Text<N>, MOST>) -> Vec<String> {
    given.0.into_iter().map(|text| text.0).collect()
}

/// Takes the scenario or the study out of a job body.
fn take_asked(body: &mut Value) -> Valid<(TaskKind, Value)> {
    let names = || TaskKind::all().map(TaskKind::member).collect::<Vec<_>>().join("` or `");
    let Some(members) = body.as_object_mut() else {
        return Err(Faults::one("", format!("must be a JSON object that contains `{}`", names())));
    };
    let mut found =
        TaskKind::all().filter_map(|kind| Some((kind, members.shift_remove(kind.member())?)));
    let Some(asked) = found.next() else {
        let detail = if members.contains_key("profile") {
            "is missing, because the body is the scenario itself. Enter it as {\"scenario\": {…}}"
                .to_owned()
        } else {
            format!("is missing. Enter what the job computes: `{}`", names())
        };
        return Err(Faults::one("/scenario", detail));
    };
    match found.next() {
        None => Ok(asked),
        Some((other, _)) => {
            let detail = format!(
                "cannot be combined with `{}`: a job computes only one of them. Submit two jobs",
                asked.0.member()
            );
            Err(Faults::one(&format!("/{}", other.member()), detail))
        }
    }
}

/// A job body without the member that says what to compute.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct Envelope {
    #[deserr(default)]
    label: Given<Text<MAX_LABEL>>,
    #[deserr(default)]
    tags: Given<Distinct<Text<MAX_TAG>, MAX_TAGS>>,
    #[deserr(default)]
    private: Given<bool>,
}

/// A text of 1 to `N` characters, none of them a control character.
#[derive(PartialEq)]
struct Text<const N: usize>(String);

impl<const N: usize> Deserr<Faults> for Text<N> {
    fn deserialize_from_value<V: IntoValue>(value: Typed<V>, location: Pointer<'_>) -> Valid<Self> {
        let text: String = Deserr::<Faults>::deserialize_from_value(value, location)?;
        let length = text.chars().count();
        if length == 0 || length > N {
            let detail = format!("must have 1 to {N} characters, not {length}");
            return Err(Faults::at(location, detail));
        }
        if text.chars().any(char::is_control) {
            let detail = "must not contain control characters, such as line breaks";
            return Err(Faults::at(location, detail));
        }
        Ok(Self(text))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::task::tests::ball;

    #[test]
    fn every_fault_is_listed_with_its_pointer() {
        let mut scenario = ball();
        scenario["bodies"][0]["poisson_ratio"] = json!(0.7);
        scenario["profile"]["radius"] = json!("-10 mm");
        scenario["frction"] = json!(0.7);
        scenario["wear"]["coefficient"] = json!("3 mm^3/(N parsec)");
        let mut body = json!({"scenario": scenario});
        body["label"] = json!("");
        let faults = match Submission::parse(body.to_string().as_bytes()) {
            Err(BadBody::Faults(faults)) => faults,
            other => panic!("{other:?}"),
        };
        let mut pointers: Vec<_> = faults.iter().map(|fault| fault.pointer.as_str()).collect();
        pointers.sort_unstable();
        assert_eq!(
            pointers,
            [
                "/label",
                "/scenario/bodies/0/poisson_ratio",
                "/scenario/frction",
                "/scenario/profile/radius",
                "/scenario/wear/coefficient",
            ]
        );
        let of = |pointer: &str| {
            &faults.iter().find(|fault| fault.pointer == pointer).expect(pointer).detail
        };
        assert!(of("/scenario/frction").contains("Did you mean `friction`?"));
        assert!(of("/scenario/wear/coefficient").contains("mm^3/(N m)"));
    }

    #[test]
    fn a_tag_can_contain_a_key() {
        let parse = |tag: &str| {
            Submission::parse(json!({"scenario": ball(), "tags": [tag]}).to_string().as_bytes())
        };
        let tag = format!("from:{}", "a".repeat(64));
        assert_eq!(parse(&tag).unwrap().tags, [tag]);
        assert!(parse(&"a".repeat(MAX_TAG + 1)).is_err());
    }

    #[test]
    fn a_change_keeps_what_it_does_not_name() {
        let parse = |body: Value| Naming::parse(body.to_string().as_bytes());
        let change = |body| parse(body).unwrap();
        assert_eq!(change(json!({})), Naming::default());
        assert_eq!(change(json!({"label": null})).label, Some(None));
        assert_eq!(change(json!({"label": "a"})).label, Some(Some("a".to_owned())));
        assert_eq!(change(json!({"tags": []})).tags, Some(vec![]));
        for bad in [
            json!([]),
            json!({"label": ""}),
            json!({"tags": null}),
            json!({"tags": ["a", "a"]}),
            json!({"note": "a"}),
        ] {
            assert!(parse(bad.clone()).is_err(), "{bad}");
        }
    }

    #[test]
    fn the_submitted_scenario_is_stored_up_to_64_kb() {
        let parse = |body: &Value| Submission::parse(body.to_string().as_bytes()).unwrap();
        let mut scenario = ball();
        let submitted = parse(&json!({"scenario": scenario})).submitted;
        assert_eq!(submitted, Some(scenario.to_string()));
        let reversal = |i| if i % 2 == 0 { "1.2345 um" } else { "-1.2345 um" };
        scenario["motion"] = json!({"reversals": (0..10_000).map(reversal).collect::<Vec<_>>()});
        scenario["profiles_at"] = json!("none");
        assert_eq!(parse(&json!({"scenario": scenario})).submitted, None);
    }
}
