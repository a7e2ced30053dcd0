//! The parts of a result, each of which an answer can have.

use std::collections::BTreeMap;

use utoipa::ToSchema;

use crate::http::wire::schemas::{Cell, EitherCurves, KeyText};
use fretwork_engine::{History as Columns, Loops as LoopCurves};

/// The engine that computed the result.
#[derive(ToSchema)]
pub struct Engine {
    #[schema(example = "fretwork")]
    name: String,
    /// The version of the numbers.
    #[schema(minimum = 1)]
    numerics: u32,
}

/// The unit of every quantity or column of numbers, by its name; "1" where it has none.
#[derive(ToSchema)]
#[schema(example = json!({"wear_volume": "m^3", "contact_radius": "m"}))]
pub struct Units(BTreeMap<String, String>);

/// The columns of a table, by their names. Those of a study are the numbers that vary (JSON pointers), the outputs, and `reason`.
#[derive(ToSchema)]
pub struct TableColumns(BTreeMap<String, Vec<Cell>>);

/// One of the events that follow a job.
#[derive(ToSchema)]
pub struct JobEvent {
    /// The kind of event: the current job, a change of its state, or its progress.
    event: JobEventKind,
    /// The number of a change of state, for `Last-Event-ID`. Other events have none.
    #[schema(value_type = String, required = false, pattern = "^[1-9][0-9]*$")]
    id: Option<String>,
    /// `snapshot`: the job. `state`: `{state, attempt, at}`, the last with the `job`. `progress`: `{progress, attempt}`.
    #[schema(content_media_type = "application/json")]
    data: String,
}

#[derive(ToSchema)]
#[schema(rename_all = "lowercase")]
pub enum JobEventKind {
    Snapshot,
    State,
    Progress,
}

answers! {
    /// The history of a result.
    History {
        history: Columns
    }

    /// The profiles of a result.
    Profiles {
        profiles: EitherCurves
    }

    /// The force–displacement loops of a result.
    Loops {
        loops: LoopCurves
    }

    /// The table of a study.
    StudyTable {
        table: TableColumns
    }

    /// Statistics of a study, in columns with one row per output: `output`, `unit`, `points`, `mean`, `standard_deviation`, percentiles such
    /// as `percentile_2_5`, and the ends of their intervals, such as `percentile_2_5_low`.
    Statistics {
        statistics: TableColumns
    }

    /// Distributions of the outputs of a study, in columns with one row per bin: `output`, `unit`, `from`, `to` and `points`.
    Histogram {
        histogram: TableColumns
    }

    /// A table in rows: one object per output cycle, or per output cycle and point.
    Records {
        /// The rows. Each has all columns; a number that is infinite or not defined is null.
        records: Vec<BTreeMap<String, Cell>>
    }
}
