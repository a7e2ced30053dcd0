//! What requests and answers contain, for the OpenAPI document. The program reads and writes these documents as tables and as
//! stored bytes, so these types have no values. The engine has the types of the sections of a run.

#![expect(
    dead_code,
    clippy::struct_field_names,
    clippy::zero_sized_map_values,
    reason = "the document needs only the types"
)]

/// Bodies of requests, which have no other members. What they can leave out is not null.
macro_rules! bodies {
    ($($(#[$about:meta])* $name:ident { $($(#[$member:meta])* $field:ident: $kind:ty,)* })*) => {
        $(
            #[derive(ToSchema)]
            #[serde(deny_unknown_fields)]
            $(#[$about])*
            pub struct $name {
                $(#[schema(nullable = false)] $(#[$member])* $field: $kind,)*
            }
        )*
    };
}

/// Answers that say to which result they belong.
macro_rules! answers {
    ($($(#[$about:meta])* $name:ident { $(#[$member:meta])* $field:ident: $kind:ty })*) => {
        $(
            #[derive(ToSchema)]
            $(#[$about])*
            pub struct $name {
                key: KeyText,
                engine: Engine,
                units: Units,
                $(#[$member])*
                $field: $kind,
            }
        )*
    };
}

mod bodies;
mod evaluated;
mod fits;
mod measured;
mod parts;
mod runs;
mod studies;

use utoipa::OpenApi;

pub use self::bodies::{EvaluateBody, JobBody, Naming};
pub use self::evaluated::Evaluated;
pub use self::measured::Measured;
pub use self::parts::JobEvent;
use self::parts::{Histogram, History, Loops, Profiles, Records, Statistics, StudyTable};
pub use self::runs::Preview;
pub use fretwork_engine::outcome::History as Columns;
pub use fretwork_engine::scenario::Warning;

/// All types that no route names.
#[derive(OpenApi)]
#[openapi(components(schemas(
    runs::RunResult,
    studies::SweepResult,
    studies::SensitivityResult,
    studies::MapResult,
    studies::FitResult,
    History,
    Profiles,
    Loops,
    StudyTable,
    Statistics,
    Histogram,
    Records,
    bodies::KeysToCompare,
    bodies::NumberList,
    bodies::NumberRange,
    bodies::SidesToCompare,
    fits::MeasuredPoints,
    fits::WearProfile,
    fits::RelativeNoise,
)))]
pub struct Documents;

/// Types of which a document has one, by the name of the choice, and what it means.
pub const EITHER: [(&str, &str, &[&str]); 11] = {
    const BOTH: &str = "In columns, or in rows with `layout=records`.";
    [
        (
            "Result",
            "The result of a run or of a study.",
            &["RunResult", "SweepResult", "SensitivityResult", "MapResult", "FitResult"],
        ),
        ("HistoryAnswer", BOTH, &["History", "Records"]),
        ("ProfilesAnswer", BOTH, &["Profiles", "Records"]),
        ("EitherCurves", "Of a run, or of a sweep.", &["Curves", "CommonCurves"]),
        ("LoopsAnswer", BOTH, &["Loops", "Records"]),
        ("TableAnswer", BOTH, &["StudyTable", "Records"]),
        ("StatisticsAnswer", BOTH, &["Statistics", "Records"]),
        ("HistogramAnswer", BOTH, &["Histogram", "Records"]),
        ("DiffBody", "The results or scenarios to compare.", &["KeysToCompare", "SidesToCompare"]),
        (
            "MeasuredSet",
            "Measured numbers, or the measured profile of a scar.",
            &["MeasuredPoints", "WearProfile"],
        ),
        (
            "Radii",
            "The radii, ascending from 0 or more: a list, or a range.",
            &["NumberList", "NumberRange"],
        ),
    ]
};
