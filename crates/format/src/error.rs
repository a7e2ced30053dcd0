//! Why a format cannot be written.

use std::io;

use super::kind::Part;

/// A requested item that the result does not have.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Missing {
    /// The parameter that requested it.
    pub parameter: &'static str,
    /// What is missing, and what the result has instead.
    pub detail: String,
}

/// The result of writing or reading a document. Without `E`, the error is that of this crate.
pub(crate) type Result<T, E = Error> = std::result::Result<T, E>;

/// Refuses a request if something is missing.
pub(crate) fn refuse_if_any(missing: Vec<Missing>) -> Result<()> {
    if missing.is_empty() { Ok(()) } else { Err(Error::Missing(missing)) }
}

/// Why a format cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The result does not have everything that was requested.
    #[error("{}", .0.iter().map(|item| item.detail.as_str()).collect::<Vec<_>>().join("; "))]
    Missing(Vec<Missing>),
    /// The part belongs to results of another kind: to runs or to studies. The text lists the parts of this result.
    #[error("the result has no {0}. The result has {1}")]
    OtherKind(Part, &'static str),
    /// The stored document does not have the structure of a result.
    #[error("the document is not a result in JSON")]
    Document(#[from] serde_json::Error),
    /// The NPZ archive cannot be written.
    #[error("the NPZ archive cannot be written")]
    Npz(#[from] zip::result::ZipError),
    /// The output cannot be written.
    #[error("the output cannot be written")]
    Write(#[from] io::Error),
}
