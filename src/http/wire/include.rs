//! The query parameter `include`: what an answer contains in addition to a job.

use axum::body::Bytes;

use super::Query;
use fretwork_job::asked_in;
use fretwork_store::Asked;

/// The JSON of an absent value.
pub const NULL: Bytes = Bytes::from_static(b"null");

/// Members that are added to a job: their names and their JSON.
pub type JobMembers = Vec<(&'static str, Bytes)>;

/// The values of `include`.
#[derive(Debug, Clone, Copy, Default)]
pub struct Include {
    pub result: bool,
    pub scenario: bool,
    pub submitted: bool,
}

impl Include {
    /// The names of the values.
    pub const WORDS: [&str; 3] = ["result", "scenario", "submitted"];

    /// Reads `include` from the query: names, separated by commas.
    pub fn take(query: &mut Query) -> Self {
        let accepted =
            "\"result\", \"scenario\", \"submitted\", or several of them separated by commas";
        let read = |text: &str| {
            let words: Vec<&str> = text.split(',').map(str::trim).collect();
            let known = words.iter().all(|word| Self::WORDS.contains(word));
            let [result, scenario, submitted] = Self::WORDS.map(|word| words.contains(&word));
            known.then_some(Self { result, scenario, submitted })
        };
        query.value("include", accepted, read).unwrap_or_default()
    }

    /// The members to add to a job, except the result: their names and their JSON.
    pub fn members(self, asked: &Asked) -> JobMembers {
        let mut members = Vec::new();
        if self.scenario {
            // A study is added under its own name, such as `sweep`.
            let found = asked.task.as_deref().and_then(asked_in);
            members.push(found.map_or(("scenario", NULL), |(kind, text)| {
                (kind.member(), Bytes::copy_from_slice(text.get().as_bytes()))
            }));
        }
        if self.submitted {
            let submitted = asked.submitted.clone().map_or(NULL, Bytes::from);
            members.push(("submitted", submitted));
        }
        members
    }
}
