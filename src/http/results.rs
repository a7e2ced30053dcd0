//! Results: whole documents and their parts, which never change, in the forms that tools take.

use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;

use super::App;
use super::caller::Caller;
use super::coding::Coding;
use super::format::Format;
use super::forms::{self, Ask, Look, Part, Quantity};
use super::problem::{self, Problem};
use super::representation::{Representation, find};
use super::wire::{NoQuery, Query, Segment};
use crate::job::Key;

/// The key that an address names.
pub(super) fn read_key(text: &str) -> Result<Key, Problem> {
    text.parse().map_err(|bad: crate::job::BadKey| {
        Problem::new(&problem::UNKNOWN_RESULT, format!("No result has this key: {bad}."))
    })
}

/// Takes the parameters that say how a result or a part is wanted.
fn ask(query: &mut Query, part: Part) -> Ask {
    let mut ask = Ask {
        records: query.value("layout", "\"columns\" or \"records\"", |text| match text {
            "columns" => Some(false),
            "records" => Some(true),
            _ => None,
        }) == Some(true),
        digits: query.value("digits", "a whole number from 1 to 17", |text| {
            text.parse().ok().filter(|digits| (1..=17).contains(digits))
        }),
        engineering: query.value("units", "\"si\" or \"engineering\"", |text| match text {
            "si" => Some(false),
            "engineering" => Some(true),
            _ => None,
        }) == Some(true),
        cycles: query.value("cycles", "numbers separated by commas", |text| {
            let number =
                |text: &str| text.trim().parse().ok().filter(|number: &f64| number.is_finite());
            text.split(',').map(number).collect()
        }),
        ..Ask::default()
    };
    if part != Part::Whole {
        let names = |text: String| text.split(',').map(|name| name.trim().to_owned()).collect();
        ask.fields = query.text("fields").map(names);
    }
    // A loop without some of its points encloses another energy, and a history is short.
    if matches!(part, Part::Whole | Part::Profiles) {
        ask.points = query.value("points", "a number from 2 to 4096", |text| {
            text.parse().ok().filter(|points| (2..=4096).contains(points))
        });
    }
    ask
}

/// Takes the parameters that say how a figure is wanted.
fn ask_figure(query: &mut Query) -> Ask {
    let names: Vec<_> = forms::QUANTITIES.iter().map(|quantity| quantity.name).collect();
    let usual = Look::default();
    let quantity =
        query.value("quantity", &format!("one of {}", names.join(", ")), Quantity::named);
    let quantity = quantity.unwrap_or(usual.quantity);
    let accepted = format!("at most {} numbers separated by commas", forms::MOST);
    let cycles: Option<Vec<f64>> = query.value("cycles", &accepted, |text| {
        let number =
            |text: &str| text.trim().parse().ok().filter(|number: &f64| number.is_finite());
        let cycles: Vec<f64> = text.split(',').map(number).collect::<Option<_>>()?;
        (cycles.len() <= forms::MOST).then_some(cycles)
    });
    if cycles.is_some() && !quantity.has_instants() {
        let detail = format!("{} is drawn over all cycles; none can be chosen", quantity.name);
        query.complain("cycles", detail);
    }
    let engineering = query.value("units", "\"engineering\" or \"si\"", |text| match text {
        "si" => Some(false),
        "engineering" => Some(true),
        _ => None,
    });
    let mut axis = |name| {
        let log = query.value(name, "\"linear\" or \"log\"", |text| match text {
            "linear" => Some(false),
            "log" => Some(true),
            _ => None,
        });
        if log == Some(true) && quantity.has_sign() {
            let detail = format!("must be \"linear\" here: {} go through 0", quantity.name);
            query.complain(name, detail);
        }
        log
    };
    let log = (axis("x"), axis("y"));
    let mut side = |name, least: u16, usual| {
        let accepted = format!("a whole number of px from {least} to {}", forms::LARGEST);
        let found = query.value(name, &accepted, |text| {
            text.parse().ok().filter(|side| (least..=forms::LARGEST).contains(side))
        });
        found.unwrap_or(usual)
    };
    let size =
        (side("width", forms::LEAST.0, usual.size.0), side("height", forms::LEAST.1, usual.size.1));
    let look = Look { quantity, log, size };
    Ask { engineering: engineering.unwrap_or(true), cycles, look, ..Ask::default() }
}

/// Answers a result or a part of it in the form that the client wants.
async fn answer(
    app: &App,
    caller: &Caller,
    (key, part): (&str, Part),
    headers: &HeaderMap,
    mut query: Query,
) -> Result<Response, Problem> {
    let asked = query.format(part.formats());
    let ask = ask(&mut query, part);
    let format = Format::choose(asked, headers, part.formats());
    if format == Some(Format::Differences) && ask.digits.is_some_and(|n| n > forms::DIGITS) {
        query.complain("digits", format!("must be at most {} by differences", forms::DIGITS));
    }
    if ask.records && part == Part::Whole {
        let parts = "/history, /profiles and /loops";
        query.complain("layout", format!("a whole result has no rows; its parts have: {parts}"));
    } else if ask.records && format.is_some_and(|format| format != Format::Json) {
        query.complain("layout", "is for JSON; other formats have one layout each");
    }
    query.finish()?;
    let format = format.ok_or_else(|| not_acceptable(key, part))?;
    let wanted = Representation::new(caller, read_key(key)?, part, format, ask);
    if let Some(response) = wanted.not_modified(app, headers).await? {
        return Ok(response);
    }
    wanted.answer(app, Coding::choose(headers, format)).await
}

fn not_acceptable(key: &str, part: Part) -> Problem {
    let listed = |formats: &[Format]| {
        let named = formats.iter().map(|format| {
            let kind = format.media_type().split(';').next().unwrap_or_default();
            format!("{kind} (?format={})", format.name())
        });
        named.collect::<Vec<_>>().join(", ")
    };
    let mut detail = format!("This is available as {}.", listed(part.formats()));
    if part == Part::Whole {
        detail += " NDJSON, CSV and Arrow hold one table; its parts are available so: ";
        let address = |part: Part| format!("/v1/results/{key}/{}?format=csv", part.name());
        detail += &Part::TABLES.map(address).join(", ");
        detail += ".";
    }
    Problem::new(&problem::NOT_ACCEPTABLE, detail)
}

/// Returns a result.
///
/// A result is a pure function of its key, byte for byte, and may be cached for ever. All numbers
/// are SI unless `units` says otherwise; the member `units` names the unit of every quantity. Entry 0
/// of each history column and row 0 of each profile is the unworn state. `scenario` is always SI and
/// in full, so that it can be sent again.
///
/// As NPZ each column of its tables is an array, such as `history/wear_volume` and `profiles/wear`
/// (instants × radii), and everything else is JSON in the text array `meta`; `numpy.load` reads it
/// without pickle. An infinite pressure is null in JSON and NaN in NPZ.
#[utoipa::path(get, path = "/v1/results/{key}", operation_id = "get_result", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::WholeFormat>, Query, description = "Wins over `Accept`."),
        ("layout" = Option<super::openapi::WholeLayout>, Query, description = "Its parts can be had in \
            `records`."),
        ("cycles" = Option<super::openapi::ChosenInstants>, Query, style = Form, explode = false,
            description = "Only the profiles and loops of these instants, separated by commas; the history \
            stays whole.",
            example = json!([0])),
        ("points" = Option<u32>, Query, description = "At most so many radii of the profiles, evenly spread.",
            minimum = 2, maximum = 4096, example = 200),
    ),
    responses(
        (status = 200, description = "The result.", content(
            (ref("#/components/schemas/Result") = "application/json"),
            (super::openapi::File = "application/x-npz"),
            (ref("#/components/schemas/ByDifferences") =
                "application/vnd.fretwork.differences+json"),
        )),
        (status = 406, description = "A whole result is available as JSON, NPZ and by differences; its parts are also \
            available as NDJSON, CSV and Arrow."),
    ),
)]
pub async fn whole(
    State(app): State<App>,
    caller: Caller,
    Segment(key): Segment,
    headers: HeaderMap,
    query: Query,
) -> Result<Response, Problem> {
    answer(&app, &caller, (&key, Part::Whole), &headers, query).await
}

/// Returns the history of a result: one entry per instant.
///
/// CSV and NDJSON have one row per instant under names such as `wear_volume[m^3]`: CSV after comment
/// lines (`#`) with the key, the engine and the units, in NDJSON each line with `key` and `engine`. As
/// NPZ it is an array per column, as Arrow (an IPC file) a table, whose metadata have key, engine and
/// units. Equal numbers are equal in every format.
#[utoipa::path(get, path = "/v1/results/{key}/history", operation_id = "get_history", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::TableFormat>, Query, description = "Wins over `Accept`."),
        ("layout" = Option<super::openapi::Layout>, Query, description = "Of JSON: an array per quantity \
            (`columns`, the default), or a list of rows under `records`."),
        ("fields" = Option<super::openapi::HistoryFields>, Query, style = Form, explode = false,
            description = "Only these columns, separated by commas; \
            `cycles` always comes along.",
            example = json!(["wear_volume", "wear_depth"])),
        ("cycles" = Option<super::openapi::ChosenInstants>, Query, style = Form, explode = false,
            description = "Only these instants, separated by commas.",
            example = json!([0])),
    ),
    responses(
        (status = 200, description = "The history.", content(
            (ref("#/components/schemas/HistoryAnswer") = "application/json"),
            (String = "application/x-ndjson"),
            (String = "text/csv"),
            (super::openapi::File = "application/x-npz"),
            (super::openapi::File = "application/vnd.apache.arrow.file"),
        )),
        (status = 406, description = "The history is available as JSON, NDJSON, CSV, NPZ and Arrow."),
    ),
)]
pub async fn history(
    State(app): State<App>,
    caller: Caller,
    Segment(key): Segment,
    headers: HeaderMap,
    query: Query,
) -> Result<Response, Problem> {
    answer(&app, &caller, (&key, Part::History), &headers, query).await
}

/// Returns the profiles of a result: worn shape, wear, pressure and slip over the radius.
///
/// Formats with rows have one per instant and radius: `cycles,radius,…`; in NPZ an array has a row per
/// instant and a column per radius. An infinite pressure is null in JSON, NDJSON and Arrow, empty in
/// CSV and NaN in NPZ. A result computed with `profiles_at: "none"` has no profiles: null in JSON, no
/// rows otherwise.
#[utoipa::path(get, path = "/v1/results/{key}/profiles", operation_id = "get_profiles", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::MatrixFormat>, Query, description = "Wins over `Accept`."),
        ("layout" = Option<super::openapi::Layout>, Query, description = "Of JSON: an array per quantity \
            (`columns`, the default), or a list of rows under `records`."),
        ("fields" = Option<super::openapi::ProfileFields>, Query, style = Form, explode = false,
            description = "Only these columns, separated by commas; \
            `cycles` and `radius` always come along.",
            example = json!(["wear", "pressure"])),
        ("cycles" = Option<super::openapi::ChosenInstants>, Query, style = Form, explode = false,
            description = "Only these instants, separated by commas.",
            example = json!([0])),
        ("points" = Option<u32>, Query, description = "At most so many radii, evenly spread.",
            minimum = 2, maximum = 4096, example = 200),
    ),
    responses(
        (status = 200, description = "The profiles.", content(
            (ref("#/components/schemas/ProfilesAnswer") = "application/json"),
            (String = "application/x-ndjson"),
            (String = "text/csv"),
            (super::openapi::File = "application/x-npz"),
            (super::openapi::File = "application/vnd.apache.arrow.file"),
            (ref("#/components/schemas/ByDifferences") =
                "application/vnd.fretwork.differences+json"),
        )),
        (status = 406, description = "The profiles are available as JSON, NDJSON, CSV, NPZ, Arrow and by differences."),
    ),
)]
pub async fn profiles(
    State(app): State<App>,
    caller: Caller,
    Segment(key): Segment,
    headers: HeaderMap,
    query: Query,
) -> Result<Response, Problem> {
    answer(&app, &caller, (&key, Part::Profiles), &headers, query).await
}

/// Returns the force–displacement loops of a result, at the instants of its profiles.
///
/// Each loop is a cycle from one turning point over the other back to the first, with a point wherever
/// another spring of the contact starts to slip: straight lines between the points enclose the energy of
/// the cycle, and loops may differ in their number of points. Loops of a displacement record are its
/// outermost. `energy_ratio`, `slip_ratio` and `free_ratio` are the criteria A, D and B of the sliding
/// transition. Formats with rows have one per instant and point; in NPZ an array has a row per instant,
/// and shorter loops end in NaN. A result computed with `profiles_at: "none"` has no loops.
#[utoipa::path(get, path = "/v1/results/{key}/loops", operation_id = "get_loops", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("format" = Option<super::openapi::MatrixFormat>, Query, description = "Wins over `Accept`."),
        ("layout" = Option<super::openapi::Layout>, Query, description = "Of JSON: an array per quantity \
            (`columns`, the default), or a list of rows under `records`."),
        ("fields" = Option<super::openapi::LoopFields>, Query, style = Form, explode = false,
            description = "Only these columns, separated by commas; \
            `cycles` always comes along.",
            example = json!(["displacement", "tangential_force"])),
        ("cycles" = Option<super::openapi::ChosenInstants>, Query, style = Form, explode = false,
            description = "Only these instants, separated by commas.",
            example = json!([0])),
    ),
    responses(
        (status = 200, description = "The loops.", content(
            (ref("#/components/schemas/LoopsAnswer") = "application/json"),
            (String = "application/x-ndjson"),
            (String = "text/csv"),
            (super::openapi::File = "application/x-npz"),
            (super::openapi::File = "application/vnd.apache.arrow.file"),
            (ref("#/components/schemas/ByDifferences") =
                "application/vnd.fretwork.differences+json"),
        )),
        (status = 406, description = "The loops are available as JSON, NDJSON, CSV, NPZ, Arrow and by differences."),
    ),
)]
pub async fn loops(
    State(app): State<App>,
    caller: Caller,
    Segment(key): Segment,
    headers: HeaderMap,
    query: Query,
) -> Result<Response, Problem> {
    answer(&app, &caller, (&key, Part::Loops), &headers, query).await
}

/// Returns a figure of a result as SVG, for the screen and for print.
///
/// Profiles (`worn`, `wear`, `image`, `pressure`, `slip`) have a curve for each instant, and the worn
/// profile stands between the initial and the limiting one. Histories have one entry per instant, with
/// what happened marked, the limiting state where it is within reach, and the simplified rule where the
/// result was computed with `compare`. `loops` are force over displacement. An infinite pressure is a
/// gap, and the curve rises to the frame beside it. `title` and `desc` say in words what is to be seen,
/// `metadata` holds the key and the engine. The same request gives the same bytes everywhere.
#[utoipa::path(get, path = "/v1/results/{key}/plot.svg", operation_id = "plot_result", tag = "results",
    params(
        ("key" = super::openapi::KeyText, Path, description = "The `key` of a job or a checked scenario."),
        ("quantity" = Option<super::openapi::PlotQuantity>, Query, description = "What is drawn; `worn` \
            unless told. A result computed with `profiles_at: \"none\"` has histories only.",
            example = "pressure"),
        ("cycles" = Option<super::openapi::PlotInstants>, Query, style = Form, explode = false,
            description = "Of profiles and loops: only these instants, separated by commas. Unless told up \
            to 6, evenly chosen.",
            example = json!([0])),
        ("units" = Option<super::openapi::UnitSystem>, Query, description = "`engineering` (the default \
            here): µm, mm³, MPa, mJ and N; or `si`.", example = "si"),
        ("x" = Option<super::openapi::Spacing>, Query, description = "The horizontal axis: that of a \
            history is `log` unless told where its instants spread over a factor of 20, every other \
            `linear`. What is not positive has no place on a logarithmic axis.", example = "linear"),
        ("y" = Option<super::openapi::Spacing>, Query, description = "The vertical axis: `linear` unless \
            told.", example = "linear"),
        ("width" = Option<u16>, Query, description = "In px, of which 96 make an inch; 640 unless told.",
            minimum = 320, maximum = 4000, example = 640),
        ("height" = Option<u16>, Query, description = "In px; 440 unless told.",
            minimum = 240, maximum = 4000, example = 440),
    ),
    responses(
        (status = 200, description = "The figure.", content((String = "image/svg+xml"))),
        (status = 422, description = "A parameter has a fault, or asks for what the result does not \
            have, such as profiles of one that was computed without; `errors` lists them all."),
    ),
)]
pub async fn plot(
    State(app): State<App>,
    caller: Caller,
    Segment(key): Segment,
    headers: HeaderMap,
    mut query: Query,
) -> Result<Response, Problem> {
    let ask = ask_figure(&mut query);
    query.finish()?;
    // The address names the format, so `Accept` has nothing to choose.
    let figure = Representation::new(&caller, read_key(&key)?, Part::Plot, Format::Svg, ask);
    if let Some(response) = figure.not_modified(&app, &headers).await? {
        return Ok(response);
    }
    figure.answer(&app, Coding::choose(&headers, Format::Svg)).await
}

/// Pins a result: it is kept however much room it takes.
///
/// Results that nobody reads are dropped when the database grows too large, those first that were
/// read longest ago. A pinned result is not. Pinning it again changes nothing.
#[utoipa::path(put, path = "/v1/results/{key}/pin", operation_id = "pin_result", tag = "results",
    params(("key" = super::openapi::KeyText, Path, description = "The `key` of a result.")),
    responses(
        (status = 204, description = "The result is pinned."),
    ),
)]
pub async fn pin(
    State(app): State<App>,
    caller: Caller,
    Segment(key): Segment,
    _: NoQuery,
) -> Result<StatusCode, Problem> {
    set_pin(&app, &caller, &key, true).await
}

/// Takes the pin off a result.
///
/// It may then be dropped like others when room is needed.
#[utoipa::path(delete, path = "/v1/results/{key}/pin", operation_id = "unpin_result", tag = "results",
    params(("key" = super::openapi::KeyText, Path, description = "The `key` of a result.")),
    responses(
        (status = 204, description = "The result is not pinned."),
    ),
)]
pub async fn unpin(
    State(app): State<App>,
    caller: Caller,
    Segment(key): Segment,
    _: NoQuery,
) -> Result<StatusCode, Problem> {
    set_pin(&app, &caller, &key, false).await
}

async fn set_pin(
    app: &App,
    caller: &Caller,
    key: &str,
    pinned: bool,
) -> Result<StatusCode, Problem> {
    let key = read_key(key)?;
    while !app.store.pin(&key, pinned).await? {
        // It says why there is nothing to pin, unless it has come to be meanwhile.
        find(app, caller.reach(), &key).await?;
    }
    Ok(StatusCode::NO_CONTENT)
}
