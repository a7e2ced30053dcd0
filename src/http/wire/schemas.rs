//! Types that exist only in the OpenAPI document: closed sets of words, lists in queries, files.

use serde::Serialize;
use serde_json::Map;
use utoipa::openapi::schema::{
    ArrayBuilder, KnownFormat, ObjectBuilder, OneOfBuilder, Schema, SchemaFormat, SchemaType, Type,
};
use utoipa::openapi::{Ref, RefOr};
use utoipa::{PartialSchema, ToSchema};

use super::include::Include as Included;
use fretwork_engine::{History, Loops, Profiles};
use fretwork_format::{FigureOptions, Part, QUANTITIES, StudyFigure};
use fretwork_job as job;
use fretwork_measured::{Prepare as Preparation, Up as Upwards};
use fretwork_store::{Act as StoredAct, Role as StoredRole, Search};

/// Declares types that exist only in the document. `openapi` replaces those whose schema is in a file.
macro_rules! documented {
    ($(#[doc = $about:literal] $name:ident $words:expr;)*) => {
        $(
            #[doc = $about]
            pub enum $name {}

            impl PartialSchema for $name {
                fn schema() -> RefOr<Schema> {
                    $words.into()
                }
            }

            impl ToSchema for $name {}
        )*

        /// What these types mean, by their names.
        #[cfg(test)]
        pub const MEANINGS: &[(&str, &str)] = &[$((stringify!($name), $about)),*];

        /// All these types, by their names.
        #[cfg(test)]
        pub fn all() -> Vec<(String, RefOr<Schema>)> {
            vec![$((stringify!($name).to_owned(), $name::schema())),*]
        }
    };
}

fn words<'a>(words: impl IntoIterator<Item = &'a str>) -> Schema {
    ObjectBuilder::new().schema_type(Type::String).enum_values(Some(words)).build().into()
}

/// One of these words, of which the first is meant where there is none.
fn choice<const N: usize>(words: [&str; N]) -> Schema {
    let choice = ObjectBuilder::new().schema_type(Type::String).default(Some(words[0].into()));
    choice.enum_values(Some(words)).build().into()
}

/// A list, separated by commas in a query. Repeated items have no effect.
fn list(items: impl Into<RefOr<Schema>>) -> Schema {
    ArrayBuilder::new().items(items.into()).min_items(Some(1)).build().into()
}

/// Names of the columns of a table.
#[expect(clippy::expect_used, reason = "a type with named members is valid JSON")]
fn columns(table: &impl Serialize) -> Schema {
    let table = serde_json::to_value(table).expect("columns are valid JSON");
    list(words(table.as_object().into_iter().flat_map(Map::keys).map(String::as_str)))
}

/// A value of one of these types.
fn of_types<const N: usize>(types: [Type; N]) -> Schema {
    ObjectBuilder::new().schema_type(SchemaType::from_iter(types)).build().into()
}

fn kept_in_a_file() -> Schema {
    ObjectBuilder::new().build().into()
}

documented! {
    /// Whether a result is stored.
    Standing words(["held", "dropped", "unknown"]);
    /// The state of a job.
    JobState words(job::JobState::ALL.iter().map(|state| state.as_str()));
    /// How a job got its result.
    Origin words(job::Origin::ALL.iter().map(|origin| origin.as_str()));
    /// How a new computation compares with an earlier result.
    Recomputed words(job::Recomputed::ALL.iter().map(|word| word.as_str()));
    /// What an answer can include in addition to a job.
    Include list(words(Included::WORDS));
    /// What a key allows.
    Role words(StoredRole::ALL.iter().map(|role| role.as_str()));
    /// What the audit log records.
    Act words(StoredAct::ALL.iter().map(|act| act.as_str()));
    /// The formats of a whole result.
    WholeFormat words(Part::Whole.formats().iter().map(|format| format.name()));
    /// The formats of a table.
    TableFormat words(Part::History.formats().iter().map(|format| format.name()));
    /// The formats of lists.
    ListFormat words(["json", "csv"]);
    /// Columns of a history.
    HistoryFields columns(&History::default());
    /// Columns of profiles.
    ProfileFields columns(&Profiles::default());
    /// Columns of loops.
    LoopFields columns(&Loops::default());
    /// Columns of the table of a study.
    TableFields list(ObjectBuilder::new().schema_type(Type::String).min_length(Some(1)).build());
    /// Output cycles of a result.
    ChosenInstants list(ObjectBuilder::new().schema_type(Type::Number).minimum(Some(0)).build());
    /// Quantities of figures.
    PlotQuantity words(QUANTITIES.iter().map(|quantity| quantity.name));
    /// Kinds of figures of a study.
    PlotKind words(StudyFigure::ALL.map(StudyFigure::as_str));
    /// Output cycles in a figure.
    PlotInstants ArrayBuilder::new()
        .items(ObjectBuilder::new().schema_type(Type::Number).minimum(Some(0)).build())
        .min_items(Some(1))
        .max_items(Some(FigureOptions::MAX_CYCLES))
        .build();
    /// How an output is computed.
    DerivativeMethod words(["closed", "numerical"]);
    /// The scale of an axis.
    Spacing words(["linear", "log"]);
    /// A value by which results are sorted.
    Order ObjectBuilder::new()
        .schema_type(Type::String)
        .enum_values(Some(Search::orders().flat_map(|name| [name.to_owned(), format!("-{name}")])))
        .default(Some("-created".into()))
        .build();
    /// The order of a list of jobs.
    JobOrder words(["-created", "created"]);
    /// The layout of a whole result.
    WholeLayout words(["columns"]);
    /// The layouts of a table in JSON.
    Layout words(["columns", "records"]);
    /// The comment lines of a CSV.
    Comments words(["all", "none"]);
    /// The units of an answer.
    UnitSystem words(["si", "engineering"]);
    /// A binary file.
    File Schema::from(ObjectBuilder::new().schema_type(Type::String).format(Some(
        SchemaFormat::KnownFormat(KnownFormat::Binary),
    )).build());
    /// The key of a result: SHA-256 of the engine's name, its numerics and the canonical scenario.
    KeyText ObjectBuilder::new()
        .schema_type(Type::String)
        .pattern(Some("^[0-9a-f]{64}$"))
        .build();
    /// A scenario; the engine has its schema.
    Scenario kept_in_a_file();
    /// A number in SI, or a text with a unit.
    NumberOrText of_types([Type::Number, Type::String]);
    /// A number in SI, a text with a unit, or null.
    MeasuredCell of_types([Type::Number, Type::String, Type::Null]);
    /// The standard deviation of the noise, or one for each number.
    Sigma ArrayBuilder::new()
        .schema_type(SchemaType::from_iter([Type::Number, Type::String, Type::Array]))
        .items(NumberOrText::schema())
        .build();
    /// Numbers: a list, or a range.
    Radii kept_in_a_file();
    /// The name of an output.
    OutputName ObjectBuilder::new()
        .schema_type(Type::String)
        .min_length(Some(1))
        .examples(["wear_volume", "wear_depth@1000"])
        .build();
    /// A word to find a job by.
    Tag ObjectBuilder::new()
        .schema_type(Type::String)
        .min_length(Some(1))
        .max_length(Some(80))
        .build();
    /// A part of a result, or the check of the scenario.
    EvaluatedPart words(["history", "profiles", "loops", "events", "accuracy", "check"]);
    /// Which points: all combinations of the values; the first values, the second values, …; a random Latin hypercube; a scrambled Sobol sequence.
    Design choice(["grid", "zip", "latin_hypercube", "sobol"]);
    /// A curve over the radius.
    SweepCurve words(["wear", "worn", "pressure", "slip"]);
    /// Sobol indices, elementary effects, or elasticities at the values of the scenario.
    SensitivityMethod choice(["sobol", "morris", "local"]);
    /// `huber`: numbers far from the fit have less weight. A residual counts with its square up to 1.345 standard deviations, and linearly beyond.
    Loss choice(["squares", "huber"]);
    /// What `x` is.
    MeasuredOver choice(["cycles", "dissipated_energy"]);
    /// What a profile shows.
    MeasuredProfile words(["wear"]);
    /// Whether numbers scatter around their mean, or by factors.
    NoiseKind choice(["normal", "lognormal"]);
    /// What the points of a line weigh.
    LineWeights words(["equal", "noise"]);
    /// A set of measured numbers.
    MeasuredSet kept_in_a_file();
    /// `estimate`: the noise is estimated from the scatter of the set. `sigma` and `relative` then say only how it changes from number to number. An object takes the place of `sigma` and `relative`: noise that is a share of the true number. Without `relative`, this share is estimated. `lognormal` is for numbers that scatter by factors: `relative` is then the standard deviation of their logarithms.
    Noise Schema::from(OneOfBuilder::new()
        .item(ObjectBuilder::new().schema_type(Type::String).pattern(Some("^estimate$")))
        .item(Ref::from_schema_name("RelativeNoise"))
        .build());
    /// A cell of a table; null where a number is infinite or not defined.
    Cell of_types([Type::Number, Type::String, Type::Null]);
    /// The curves of a run, or of a sweep.
    EitherCurves kept_in_a_file();
    /// What becomes of two columns of a file.
    Prepare words(Preparation::ALL.map(Preparation::as_str));
    /// Where the heights of a trace point.
    Up words(Upwards::ALL.map(Upwards::as_str));
}
