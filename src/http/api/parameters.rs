//! The parameters that several operations share, for the OpenAPI document. [`Query`](crate::http::wire::Query) reads them.

use utoipa::IntoParams;
use utoipa::openapi::Required;
use utoipa::openapi::path::{Parameter, ParameterBuilder, ParameterIn};
use utoipa::openapi::schema::{ObjectBuilder, Type};

use crate::http::wire::schemas::{
    ChosenInstants, Comments, JobState, KeyText, Layout, ListFormat, Order, PlotInstants, PlotKind,
    PlotQuantity, Spacing, TableFormat, UnitSystem,
};
use fretwork_job::{SCALARS, WORDS};

/// The key of the result that an operation reads or changes.
#[derive(IntoParams)]
#[into_params(parameter_in = Path)]
#[expect(dead_code, reason = "the document has it, and no request is parsed to it")]
pub struct ResultKey {
    /// The `key` of a job, or of a checked scenario or study.
    key: KeyText,
}

/// Declares structs of optional parameters. Only the OpenAPI document uses them: no code makes a value of them.
macro_rules! parameters {
    ($($(#[$about:meta])* $name:ident { $($(#[$member:meta])* $field:ident: $kind:ty,)* })*) => {
        $(
            #[derive(IntoParams)]
            $(#[$about])*
            #[expect(dead_code, reason = "the document has these, and no request is parsed to them")]
            pub struct $name {
                $(#[param(required = false)] $(#[$member])* $field: $kind,)*
            }
        )*
    };
}

parameters! {
    /// The parameters of each operation that answers a table of a result.
    #[into_params(parameter_in = Query)]
    OfTable {
        /// Overrides `Accept`.
        format: TableFormat,
        /// JSON only: one array per column (`columns`, the default), or a list of rows in the member `records`.
        layout: Layout,
        /// CSV only: `none` leaves out the comment lines, so that spreadsheets and pandas read the answer without options.
        comments: Comments,
    }
    /// The parameter of each operation that answers a table with rows at output cycles.
    #[into_params(parameter_in = Query)]
    AtCycles {
        /// Only these output cycles, separated by commas.
        #[param(style = Form, explode = false, example = json!([0]))]
        cycles: ChosenInstants,
    }
    /// The parameter of each operation that answers profiles.
    #[into_params(parameter_in = Query)]
    AtPoints {
        /// Largest number of radii of the profiles, evenly spaced.
        #[param(minimum = 2, maximum = 4096, example = 200)]
        points: u32,
    }
    /// The parameters of a figure.
    #[into_params(parameter_in = Query)]
    OfFigure {
        /// Runs: the quantity to draw, by default `worn`. A result computed with `profiles_at: "none"` has histories
        /// only.
        #[param(example = "pressure")]
        quantity: PlotQuantity,
        /// Profiles and loops: only these output cycles, separated by commas. By default up to 6, evenly spaced.
        #[param(style = Form, explode = false, example = json!([0]))]
        cycles: PlotInstants,
        /// Studies: the kind of figure. By default it follows from the study.
        #[param(example = "heat")]
        kind: PlotKind,
        /// Studies: a column of the outputs, by default the first one.
        #[param(example = "wear_volume")]
        output: String,
        /// Studies: the JSON pointer of the number on the horizontal axis, by default the one with most values.
        #[param(example = "/motion/amplitude")]
        over: String,
        /// Studies: the JSON pointer of a second number, with one curve for each value, or on the vertical axis of a
        /// heat map.
        #[param(example = "/friction")]
        by: String,
        /// `engineering` (the default here): µm, mm³, MPa, mJ and N; or `si`.
        #[param(example = "si")]
        units: UnitSystem,
        /// The horizontal axis. By default it is `linear`, but `log` for a history whose output cycles span a factor of
        /// 20 or more, and for values of a study that are spaced so. A logarithmic axis omits values that are not
        /// positive.
        #[param(example = "linear")]
        x: Spacing,
        /// The vertical axis, by default `linear`. That of a study is `log` if its values span two decades.
        #[param(example = "linear")]
        y: Spacing,
        /// Width in px (1/96 inch), by default 640.
        #[param(minimum = 320, maximum = 4000, example = 640)]
        width: u16,
        /// Height in px, by default 440.
        #[param(minimum = 240, maximum = 4000, example = 440)]
        height: u16,
    }
    /// The parameters of each operation that answers numbers.
    #[into_params(parameter_in = Query)]
    Numbers {
        /// Rounds every number to this many significant digits. Up to 7 digits, arrays in NPZ and Arrow are float32, except
        /// columns with numbers below 1.2e-38.
        #[param(minimum = 1, maximum = 17, example = 7)]
        digits: u32,
        /// `si` (the default), or `engineering`: um, mm^3, MPa (moduli too), mJ, N, mm^3/(N m). The member `units` and the
        /// headers name them.
        #[param(example = "engineering")]
        units: UnitSystem,
    }
    /// The headers of each request whose answer a client may cache.
    #[into_params(parameter_in = Header)]
    Copied {
        /// The `ETag` of the client's copy.
        #[param(rename = "If-None-Match")]
        if_none_match: String,
        /// `zstd` or `gzip`; NPZ archives are always compressed.
        #[param(rename = "Accept-Encoding")]
        accept_encoding: String,
    }
    /// The parameters of each operation that answers a list.
    #[into_params(parameter_in = Query)]
    OfList {
        /// Overrides `Accept`. JSON is one page. CSV has all entries, or one page if `limit` is set. Spreadsheets execute a
        /// text that begins with `=`, `+`, `-` or `@`, so CSV has `'` before it.
        format: ListFormat,
        /// CSV only: `none` leaves out the comment lines, so that spreadsheets and pandas read the answer without options.
        comments: Comments,
        /// JSON only: `true` adds `total`, the number of all matching entries.
        count: bool,
    }
    /// The filters of jobs.
    #[into_params(parameter_in = Query)]
    OfJobs {
        /// Jobs in this state.
        state: JobState,
        /// Jobs with exactly this label.
        label: String,
        /// Jobs with this tag.
        tag: String,
        /// Jobs with all of these words in the label, the tags, or the note of the result. Upper and lower case are equal.
        #[param(example = "rig 7")]
        q: String,
        /// Jobs for the result with this key.
        key: KeyText,
        /// Jobs of this owner; `me` is the caller. Only administrators see private jobs of others.
        #[param(example = "me")]
        owner: String,
    }
    /// The conditions of a search that do not follow from the tables of words and numbers.
    #[into_params(parameter_in = Query)]
    Conditions {
        /// Results that this server first stored in this range of days or times: `2026-01-31..`. A day is the whole day, UTC.
        created: String,
        /// Results whose size in bytes lies in this range.
        size: String,
        /// Results that a job of this owner computed; `me` is the caller.
        owner: String,
        /// Results that this owner submitted, computed or found in the library; `me` is the caller. Only jobs that the caller
        /// may see count, and results that a job of this owner computed.
        submitted_by: String,
        /// Results that are pinned, or that are not.
        pinned: bool,
        /// Results that this owner has pinned; `me` is the caller.
        pinned_by: String,
        /// `true`: only results that were evicted or deleted. Default: only stored results.
        evicted: bool,
        /// Results whose note contains this text. Upper and lower case are equal.
        note: String,
        /// Results of jobs with this tag. Only jobs that the caller may see count.
        tag: String,
        /// Results of jobs with this label. Only jobs that the caller may see count.
        label: String,
        /// Results with all of these words in labels, tags and notes. Upper and lower case are equal. Only jobs that the caller
        /// may see count.
        #[param(example = "rig 7")]
        q: String,
        /// Results with one of these keys, at most 200, separated by commas.
        keys: String,
        /// The value to sort by. A minus sign puts the largest first. Results without the value come last.
        sort: Order,
    }
}

/// The conditions of a search that follow from the tables of words and numbers.
pub struct SearchTable;

impl IntoParams for SearchTable {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        let parameter = |name: &str, about: String, schema: ObjectBuilder| {
            ParameterBuilder::new()
                .name(name)
                .parameter_in(ParameterIn::Query)
                .required(Required::False)
                .description(Some(about))
                .schema(Some(schema))
                .build()
        };
        let text = || ObjectBuilder::new().schema_type(Type::String);
        let words = WORDS.iter().map(|word| {
            let note = if word.name == "regime" { " That of the unworn contact." } else { "" };
            let about = format!("Results with this `{}`.{note}", word.name);
            parameter(word.name, about, text().enum_values(Some(word.values.iter().copied())))
        });
        let numbers = SCALARS.iter().map(|scalar| {
            let unit = match scalar.unit() {
                "1" => "a plain number".to_owned(),
                unit => format!("in {unit} or with units"),
            };
            let note = match scalar.name {
                "friction" => " A friction that changes counts with its value at cycle 0.",
                "wear_coefficient" => {
                    " A coefficient that changes counts with its value at cycle 0. Bodies with layers have none."
                }
                "amplitude" | "gross_slip_amplitude" => {
                    " That of the unworn contact, at the contact; of a line contact at its reference, if it has one."
                }
                "indentation_depth" => " Of a line contact it is 2F/(πE*·length).",
                _ => "",
            };
            let about = format!(
                "Results whose `{}` lies in this range: `a..b`, `a..`, `..b` or a single value, {unit}. Compared to 9 \
                 digits.{note}",
                scalar.name,
            );
            parameter(scalar.name, about, text())
        });
        words.chain(numbers).collect()
    }
}
