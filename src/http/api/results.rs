//! Results and their parts, in all formats. A result never changes.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;

use axum::extract::Request;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use bytesize::ByteSize;

use crate::http::answer::representation::Representation;
use crate::http::answer::stored::require;
use crate::http::api::parameters::{
    AtCycles, AtPoints, Copied, Numbers, OfFigure, OfTable, ResultKey,
};
use crate::http::wire::negotiation::choose;
use crate::http::{
    App, Caller, NoQuery, Problem, Query, Result, Segment, kinds, read_key, schemas,
};
use fretwork_format::{
    FigureOptions, Format, Part, QUANTITIES, Quantity, StudyFigure, StudyOptions, View,
};
use fretwork_job::{Key, TaskKind};
use fretwork_store::Changed;

/// Largest value of the parameter `rows`. No study has more rows.
const MAX_ROWS: usize = 10_000_000;

/// Reads numbers separated by commas.
fn numbers(text: &str) -> Option<Vec<f64>> {
    let number = |text: &str| text.trim().parse().ok().filter(|number: &f64| number.is_finite());
    text.split(',').map(number).collect()
}

/// Reads a parameter with one of two values. Returns true for the second value.
pub(super) fn either(query: &mut Query, name: &'static str, values: [&str; 2]) -> Option<bool> {
    let [no, yes] = values;
    query.value(name, format_args!("\"{no}\" or \"{yes}\""), |text| match text {
        _ if text == no => Some(false),
        _ if text == yes => Some(true),
        _ => None,
    })
}

/// Reads a parameter that is a whole number in a range.
fn integer<T: FromStr + PartialOrd + Display>(
    query: &mut Query,
    name: &'static str,
    range: RangeInclusive<T>,
) -> Option<T> {
    let accepted = format_args!("a whole number from {} to {}", range.start(), range.end());
    query.value(name, accepted, |text| text.parse().ok().filter(|number| range.contains(number)))
}

/// Reads the parameters of a result or a table.
fn view(query: &mut Query, part: Part) -> View {
    let mut view = View {
        records: either(query, "layout", ["columns", "records"]) == Some(true),
        digits: integer(query, "digits", 1..=17),
        engineering: either(query, "units", ["si", "engineering"]) == Some(true),
        ..View::default()
    };
    // A study has no output cycles.
    if part != Part::Table && !part.is_summary() {
        view.cycles = query.value("cycles", "numbers separated by commas", numbers);
    }
    if part != Part::Whole && !part.is_summary() {
        let names = |text: String| text.split(',').map(|name| name.trim().to_owned()).collect();
        view.fields = query.text("fields").map(names);
        view.without_comments = either(query, "comments", ["all", "none"]) == Some(true);
    }
    if matches!(part, Part::Whole | Part::Table) {
        view.rows = integer(query, "rows", 0..=MAX_ROWS);
    }
    // Loops have no such parameter, because a loop without some of its points encloses another energy. A history has no
    // points.
    if matches!(part, Part::Whole | Part::Profiles) {
        view.points = integer(query, "points", 2..=4096);
    }
    view
}

/// Reads the parameters of a figure.
fn figure_view(query: &mut Query) -> View {
    let default = FigureOptions::default();
    let names: Vec<_> = QUANTITIES.iter().map(|quantity| quantity.name).collect();
    let accepted = format!("one of {}", names.join(", "));
    let quantity = query.value("quantity", &accepted, Quantity::named).unwrap_or(default.quantity);
    let most = FigureOptions::MAX_CYCLES;
    let accepted = format!("at most {most} numbers separated by commas");
    let cycles = query
        .value("cycles", &accepted, |text| numbers(text).filter(|cycles| cycles.len() <= most));
    if cycles.is_some() && !quantity.has_curve_per_cycle() {
        let detail = format!(
            "does not apply to {}, which is drawn over all output cycles. Remove it",
            quantity.name
        );
        query.complain("cycles", detail);
    }
    let engineering = either(query, "units", ["si", "engineering"]).unwrap_or(true);
    let mut axis = |name| {
        let log = either(query, name, ["linear", "log"]);
        if log == Some(true) && quantity.has_sign() {
            let detail = "must be \"linear\": this figure shows positive and negative values";
            query.complain(name, detail);
        }
        log
    };
    let (log_x, log_y) = (axis("x"), axis("y"));
    let (least, most) = (FigureOptions::MIN_SIZE, FigureOptions::MAX_SIZE);
    let width = integer(query, "width", least.0..=most).unwrap_or(default.size.0);
    let height = integer(query, "height", least.1..=most).unwrap_or(default.size.1);
    let study = study_options(query);
    let figure = FigureOptions { quantity, log_x, log_y, size: (width, height), study };
    View { engineering, cycles, figure, ..View::default() }
}

/// Reads the parameters of a figure of a study. The names of outputs and numbers are checked later, because they depend
/// on the study.
fn study_options(query: &mut Query) -> StudyOptions {
    let names = StudyFigure::ALL.map(StudyFigure::as_str);
    let accepted = format_args!("one of {}", names.join(", "));
    let kind = query.value("kind", accepted, |text| text.parse().ok());
    let [output, over, by] = ["output", "over", "by"].map(|name| query.text(name));
    StudyOptions { kind, output, over, by }
}

/// Answers a result or a part of it in the format that the client requests.
async fn answer(
    app: &App,
    caller: &Caller,
    (key, part): (&str, Part),
    headers: &HeaderMap,
    mut query: Query,
) -> Result<Response> {
    let offered = part.formats();
    let requested = query.format(offered);
    let mut view = view(&mut query, part);
    let format = match requested {
        Some(format) => Some(format).filter(|format| offered.contains(format)),
        None => choose(headers, offered, Format::essence),
    };
    if view.records && part == Part::Whole {
        let parts = "/history, /profiles and /loops";
        let detail = format!("must be \"columns\" for a whole result; only {parts} have records");
        query.complain("layout", detail);
    } else if view.records && format.is_some_and(|format| format != Format::Json) {
        let detail = "applies only to JSON. Remove it: the other formats have one layout";
        query.complain("layout", detail);
    }
    if view.without_comments && format.is_some_and(|format| format != Format::Csv) {
        query.complain("comments", "applies only to CSV. Add format=csv, or remove it");
    }
    query.finish()?;
    let format = format.ok_or_else(|| not_acceptable(key, part))?;
    let key = read_key(key)?;
    if view.rows.is_some() && part == Part::Whole && is_run(app, &key).await? {
        // A run has no rows, so the answer is the stored result, unchanged.
        view.rows = None;
    }
    Representation::new(caller, key, part, format, view).answer(app, headers).await
}

async fn is_run(app: &App, key: &Key) -> Result<bool> {
    let known = app.store.known(key).await?;
    Ok(known.is_some_and(|known| known.asked.kind == TaskKind::Run))
}

fn not_acceptable(key: &str, part: Part) -> Problem {
    let shown = |format: &Format| format!("{} (?format={})", format.essence(), format.name());
    let formats: Vec<_> = part.formats().iter().map(shown).collect();
    let detail = format!("This address offers the formats {}.", formats.join(", "));
    let address = |part: Part| format!("/v1/results/{key}/{}?format=csv", part.as_str());
    let addresses = Part::TABLES.map(address).join(", ");
    let detail = match part {
        Part::Whole => format!(
            "{detail} NDJSON, CSV and Arrow are available for one table at a time: {addresses}."
        ),
        _ => detail,
    };
    Problem::new(&kinds::NOT_ACCEPTABLE, detail)
}

/// Declares the handlers of results and their parts.
macro_rules! parts {
    ($($(#[$about:meta])* $name:ident = $part:expr;)*) => {
        $(
            $(#[$about])*
            pub async fn $name(
                app: App,
                caller: Caller,
                key: Segment,
                query: Query,
                request: Request,
            ) -> Result<Response> {
                answer(&app, &caller, (&key, $part), request.headers(), query).await
            }
        )*
    };
}

parts! {
/// Returns a result.
///
/// A result is a pure function of its key, byte for byte, and clients may cache it for ever. All
/// numbers are in SI units unless `units` is given; the member `units` names the unit of every quantity.
/// Entry 0 of each history column and row 0 of each profile is the unworn state. `scenario` is complete
/// and always in SI units, so that it can be submitted again.
///
/// In NPZ each column of a table is an array, such as `history/wear_volume` and `profiles/wear`
/// (output cycles × radii). Everything else is JSON in the text array `meta`. `numpy.load` reads the
/// archive without pickle. An infinite pressure is null in JSON and NaN in NPZ.
#[utoipa::path(get, path = "/v1/results/{key}", operation_id = "get_result", tag = "results",
    params(
        ResultKey, Numbers, Copied, AtPoints,
        ("format" = Option<schemas::WholeFormat>, Query, description = "Overrides `Accept`."),
        ("layout" = Option<schemas::WholeLayout>, Query, description = "Only the parts of a \
            result have the layout `records`."),
        ("cycles" = Option<schemas::ChosenInstants>, Query, style = Form, explode = false,
            description = "Only the profiles and loops at these output cycles, separated by commas; the \
            history is complete.",
            example = json!([0])),
        ("rows" = Option<u32>, Query, description = "Studies: only the first rows of `table`, `samples` and \
            `profiles`. A run has none.", minimum = 0, maximum = 10_000_000, example = 200),
    ),
    responses(
        (status = 200, description = "The result."),
        (status = 406, description = "A whole result is available as JSON and NPZ; its parts are also \
            available as NDJSON, CSV and Arrow."),
    ),
)]
whole = Part::Whole;

/// Returns the history of a result: one entry per output cycle.
///
/// CSV and NDJSON have one row per output cycle, with names such as `wear_volume[m^3]`. CSV begins with
/// comment lines (`#`) with the key, the engine and the units; in NDJSON each line contains `key` and
/// `engine`. NPZ has one array per column. Arrow (an IPC file) is a table whose metadata contain key,
/// engine and units. Equal numbers are equal in every format.
#[utoipa::path(get, path = "/v1/results/{key}/history", operation_id = "get_history", tag = "results",
    params(
        ResultKey, OfTable, AtCycles, Numbers, Copied,
        ("fields" = Option<schemas::HistoryFields>, Query, style = Form, explode = false,
            description = "Only these columns, separated by commas; \
            `cycles` is always included.",
            example = json!(["wear_volume", "wear_depth"])),
    ),
    responses((status = 200, description = "The history.")),
)]
history = Part::History;

/// Returns the profiles of a result: worn shape, wear, pressure and slip over the radius.
///
/// Formats with rows have one row per output cycle and radius: `cycles,radius,…`. In NPZ an array has one
/// row per output cycle and one column per radius. An infinite pressure is null in JSON, NDJSON and
/// Arrow, empty in CSV and NaN in NPZ. A result computed with `profiles_at: "none"` has no profiles: null
/// in JSON, no rows otherwise.
///
/// A sweep that was submitted with `profiles` has the curves of each point, with `point` in place of `cycles`.
#[utoipa::path(get, path = "/v1/results/{key}/profiles", operation_id = "get_profiles", tag = "results",
    params(
        ResultKey, OfTable, AtCycles, Numbers, Copied, AtPoints,
        ("fields" = Option<schemas::ProfileFields>, Query, style = Form, explode = false,
            description = "Only these columns, separated by commas; \
            `cycles` (`point` of a sweep) and `radius` are always included.",
            example = json!(["wear", "pressure"])),
    ),
    responses((status = 200, description = "The profiles.")),
)]
profiles = Part::Profiles;

/// Returns the force–displacement loops of a result, at the output cycles of its profiles.
///
/// A loop goes from one turning point to the other and back. It has one point for each spring that starts to
/// slip. Straight lines between the points enclose the energy of the cycle. Loops may differ in their number
/// of points. For a displacement record, the outermost loop is returned. `energy_ratio` (A), `slip_ratio` (D)
/// and `free_ratio` (B) are the criteria of the sliding transition by Fouvry.
/// Formats with rows have one row per output cycle and point. In NPZ an array has one row per output
/// cycle, and NaN fills the shorter loops. A result computed with `profiles_at: "none"` has no loops.
#[utoipa::path(get, path = "/v1/results/{key}/loops", operation_id = "get_loops", tag = "results",
    params(
        ResultKey, OfTable, AtCycles, Numbers, Copied,
        ("fields" = Option<schemas::LoopFields>, Query, style = Form, explode = false,
            description = "Only these columns, separated by commas; \
            `cycles` is always included.",
            example = json!(["displacement", "tangential_force"])),
    ),
    responses((status = 200, description = "The loops.")),
)]
loops = Part::Loops;

/// Returns the table of a study: one row for each point.
///
/// The first columns are the values of the numbers that vary, under their JSON pointers; then come the outputs. A cell is
/// null where a point has no such output, and the column `reason` says why. CSV and NDJSON have names such as
/// `wear_volume[m^3]`. In NPZ each column is an array, without the slash at the start of its name.
#[utoipa::path(get, path = "/v1/results/{key}/table", operation_id = "get_table", tag = "results",
    params(
        ResultKey, OfTable, Numbers, Copied,
        ("fields" = Option<schemas::TableFields>, Query, style = Form, explode = false,
            description = "Only these columns, separated by commas.", example = json!(["wear_volume"])),
        ("rows" = Option<u32>, Query, description = "Only the first rows.", minimum = 0, maximum = 10_000_000,
            example = 200),
    ),
    responses((status = 200, description = "The table.")),
)]
table = Part::Table;

/// Returns statistics of each output of a study over all its points: one row per output.
///
/// `points` counts the points that have the output. The other columns are mean, standard deviation (with n − 1), and
/// percentiles, which are interpolated between neighbours. `unit` names their unit. If the study is a random sample, they
/// estimate the distribution of the output. A fit has no statistics.
#[utoipa::path(get, path = "/v1/results/{key}/statistics", operation_id = "get_statistics", tag = "results",
    params(ResultKey, OfTable, Numbers, Copied),
    responses((status = 200, description = "The statistics.")),
)]
statistics = Part::Statistics;

/// Returns a histogram of each output of a study over all its points: one row per bin.
///
/// The bins of an output have equal widths from its smallest to its largest value. n points have about √n bins, at most
/// 50.
#[utoipa::path(get, path = "/v1/results/{key}/histogram", operation_id = "get_histogram", tag = "results",
    params(ResultKey, OfTable, Numbers, Copied),
    responses((status = 200, description = "The histograms.")),
)]
histogram = Part::Histogram;
}

/// Returns a figure of a result as SVG, for the screen and for print.
///
/// Profiles (`worn`, `wear`, `image`, `pressure`, `slip`) have one curve per output cycle. The worn profile
/// is shown with the initial and the limiting profile. Histories are drawn over the output cycles, with
/// marks at events, the limiting state if it is within reach, and the simplified rule if the result was
/// computed with `compare`. `loops` are force over displacement. An infinite pressure is a gap: next to it the
/// curve leaves the frame.
///
/// A study has other figures. A sweep of a grid is a family of curves, or a heat map with contour lines if two numbers
/// have more than 7 values each. Drawn values are a scatter plot with the median in bins, and with percentiles where several points share each value. A map has its
/// regimes with the boundary of gross slip; with `output` it is a heat map. A study of sensitivity has bars of its
/// indices with their intervals. A fit has the measured numbers with bands, the residuals, wear volumes over energies, or
/// the sum of squares over a parameter. Numbers that are not on an axis have the middle one of their values. Rows without the
/// output are gaps.
///
/// `title` and `desc` describe the figure in words; `metadata`
/// contains the key and the engine. The same request gives the same bytes everywhere.
#[utoipa::path(get, path = "/v1/results/{key}/plot.svg", operation_id = "plot_result", tag = "results",
    params(ResultKey, Copied, OfFigure),
    responses(
        (status = 200, description = "The figure."),
        (status = 422, description = "A parameter has a fault, or requests something that the result does \
            not have, such as profiles; `errors` lists all faults."),
    ),
)]
pub async fn plot(
    app: App,
    caller: Caller,
    key: Segment,
    mut query: Query,
    request: Request,
) -> Result<Response> {
    let view = figure_view(&mut query);
    query.finish()?;
    // The address names the format, so `Accept` has no effect.
    let figure = Representation::new(&caller, read_key(&key)?, Part::Plot, Format::Svg, view);
    figure.answer(&app, request.headers()).await
}

/// Pins a result, so that it is never evicted.
///
/// When the database grows too large, the server evicts the least recently read results, except pinned
/// ones. Pinning a result again has no effect. The results that one owner has pinned may take up to `--pin-quota`,
/// and those of all owners half of `--keep-results`.
#[utoipa::path(put, path = "/v1/results/{key}/pin", operation_id = "pin_result", tag = "results",
    params(ResultKey),
    responses(
        (status = 204, description = "The result is pinned."),
        (status = 409, description = "The pinned results of this owner take too much room. Unpin some first."),
    ),
)]
pub async fn pin(app: App, caller: Caller, key: Segment, _: NoQuery) -> Result<StatusCode> {
    set_pin(&app, &caller, &key, true).await
}

/// Unpins a result.
///
/// The server may then evict it. Only the owner of the pin and administrators may do this.
#[utoipa::path(delete, path = "/v1/results/{key}/pin", operation_id = "unpin_result", tag = "results",
    params(ResultKey),
    responses(
        (status = 204, description = "The result is not pinned."),
    ),
)]
pub async fn unpin(app: App, caller: Caller, key: Segment, _: NoQuery) -> Result<StatusCode> {
    set_pin(&app, &caller, &key, false).await
}

async fn set_pin(app: &App, caller: &Caller, key: &str, pinned: bool) -> Result<StatusCode> {
    let key = read_key(key)?;
    loop {
        match app.store.pin(&key, pinned, caller.reach()).await? {
            Changed::Done => return Ok(StatusCode::NO_CONTENT),
            // Returns the problem for a missing result, or tries again if the result has just been stored.
            Changed::NotFound => require(app, &caller.reach(), &key).await?,
            Changed::OtherOwner(owner) => return Err(Problem::other_owner("pin", owner)),
            Changed::QuotaExceeded { used, quota, of_all } => {
                let (used, quota) = (ByteSize(used), ByteSize(quota));
                let detail = if of_all {
                    format!(
                        "The pinned results of all owners would take {used}, and the limit is {quota}. Unpin some of \
                         yours: GET /v1/results?pinned_by=me lists them. Or ask the administrator to raise the limit \
                         (--keep-results)."
                    )
                } else {
                    format!(
                        "Your pinned results would take {used}, and the limit of an owner is {quota}. Unpin some of \
                         them: GET /v1/results?pinned_by=me lists them."
                    )
                };
                return Err(Problem::new(&kinds::PIN_QUOTA, detail));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use axum::extract::FromRequestParts as _;
    use futures_util::FutureExt as _;
    use proptest::prelude::*;

    use super::*;

    /// The query of an address; `None` if the text is not part of an address.
    fn query(text: &str) -> Option<Query> {
        let (mut parts, ()) = Request::get(format!("/?{text}")).body(()).ok()?.into_parts();
        Query::from_request_parts(&mut parts, &()).now_or_never()?.ok()
    }

    fn any_query() -> impl Strategy<Value = String> {
        const NAMES: [&str; 19] = [
            "comments", "layout", "digits", "units", "cycles", "fields", "points", "format",
            "quantity", "x", "y", "width", "height", "kind", "output", "over", "by", "rows",
            "other",
        ];
        const WORDS: [&str; 16] = [
            "records",
            "7",
            "engineering",
            "0,1e3",
            "wear,slip",
            "worn",
            "loops",
            "log",
            "640",
            "1e999",
            "-1",
            "NaN",
            "%00",
            "%ff",
            "%",
            "",
        ];
        let value = prop_oneof![
            3 => prop::sample::select(&WORDS[..]).prop_map(str::to_owned),
            1 => "[!-~]{0,12}",
        ];
        let pair = (prop::sample::select(&NAMES[..]), value);
        prop::collection::vec(pair.prop_map(|(name, value)| format!("{name}={value}")), 0..5)
            .prop_map(|pairs| pairs.join("&"))
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 10_000, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn a_random_query_gives_valid_parameters_or_faults(text in any_query()) {
            for part in [Part::Whole, Part::History, Part::Profiles, Part::Loops, Part::Table, Part::Statistics, Part::Histogram, Part::Plot] {
                let Some(mut query) = query(&text) else { return Ok(()) };
                query.format(part.formats());
                let view = if part == Part::Plot { figure_view(&mut query) } else { view(&mut query, part) };
                if query.finish().is_ok() {
                    prop_assert!(view.digits.is_none_or(|digits| (1..=17).contains(&digits)));
                    prop_assert!(view.cycles.iter().flatten().all(|cycles| cycles.is_finite()));
                }
            }
        }
    }
}
