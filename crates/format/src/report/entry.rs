//! What a report says of one result.

use serde_json::Value;
use serde_json::value::RawValue;

use fretwork_job::TaskKind;

/// Names and values.
pub type Pairs = Vec<(String, String)>;

/// What is known about a result besides its document.
#[derive(Debug, Clone, Default)]
pub struct About {
    /// The label of a job.
    pub label: Option<String>,
    /// The scenario or study as the client wrote it.
    pub submitted: Option<Value>,
    /// When the result was computed.
    pub computed: Option<String>,
    /// The version of the program that computed it.
    pub version: Option<String>,
    /// The warnings about the bodies, as a JSON array.
    pub warnings: Value,
}

/// What a report says of one result.
pub struct ReportedResult {
    pub(super) kind: TaskKind,
    pub(super) key: String,
    pub(super) label: Option<String>,
    pub(super) submitted: Option<Value>,
    pub(super) inputs: Pairs,
    pub(super) numbers: Pairs,
    pub(super) warnings: Vec<String>,
    /// Where the result comes from.
    pub(super) origin: Pairs,
    /// The command that computes it again; `None` if it would be long.
    pub(super) command: Option<String>,
    /// The documents of the views: the ends of their addresses, and their JSON.
    pub(super) documents: Vec<(&'static str, Box<RawValue>)>,
}

impl ReportedResult {
    /// Its label, or its kind.
    pub(super) fn name(&self) -> &str {
        let kind = match self.kind {
            TaskKind::Run => "Fretting wear run",
            TaskKind::Study(kind) => kind.title,
        };
        self.label.as_deref().unwrap_or(kind)
    }
}
