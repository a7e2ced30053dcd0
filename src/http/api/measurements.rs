//! Reads files of measured numbers. Nothing is stored.

use axum::extract::Request;
use axum::response::Response;

use super::evaluate::fresh;
use crate::http::api::documents;
use crate::http::transport::body::read_file;
use crate::http::wire::schemas::{self, Prepare as PrepareWord, Up as UpWord};
use crate::http::{App, Caller, Complaint, Problem, Query, Result, blocking, kinds};
use fretwork_engine::Faults;
use fretwork_measured::{ENDS, Prepare, Wanted, ends};

/// Bytes of the answer for each byte of the file.
const ANSWER: usize = 8;

/// The problem for a file that cannot be read, or for parameters that do not fit it.
fn refused(faults: &Faults) -> Problem {
    let of_file = faults.0.iter().find(|fault| fault.pointer.is_empty());
    if let Some(fault) = of_file {
        return Problem::new(&kinds::UNREADABLE_FILE, format!("{}.", fault.detail));
    }
    let complaints = faults.0.iter();
    let complaints = complaints.map(|it| Complaint::parameter(&it.pointer[1..], &*it.detail));
    Problem::parameters(complaints.collect())
}

/// Reads a file of measured numbers.
///
/// The file is text with a table, as instruments and spreadsheets write it: with lines before the table, a row of names,
/// units such as `depth [um]`, separated by semicolons, tabs, commas or spaces, with decimal points or commas. `notes` says
/// all that was done. `prepared.data` goes into `data` of a fit. Nothing is stored.
#[utoipa::path(post, path = "/v1/measurements", operation_id = "read_measurements", tag = "scenarios",
    params(
        ("x" = Option<String>, Query, description = "The name of a column, with a unit if the file states none. \
            Default: the first column.", example = "cycles"),
        ("y" = Option<String>, Query, description = "The name of another column. Default: the next column.",
            example = "wear_volume [mm^3]"),
        ("table" = Option<usize>, Query, description = "Which table of the file, such as a step of a test. Default: 1."),
        ("decimal" = Option<String>, Query, description = "The decimal mark, `.` or `,`. Needed where `1,000` can be 1 or 1000.",
            example = "."),
        ("prepare" = Option<PrepareWord>, Query, description = "What becomes of x and y: `points` of an output (the \
            default); a profilometer `trace` across the scar, or its `half` from the axis outwards, becomes a profile of \
            wear and an indenter; a friction `loop`, the force over the displacement, is cut into cycles. Then the default of \
            x and y is the first column of their dimension."),
        ("level" = Option<bool>, Query, description = "Whether the tilt of a trace is removed. Default: true."),
        ("centre" = Option<bool>, Query, description = "Whether the axis is the middle of the scar (the default). \
            Otherwise it is where x is 0."),
        ("up" = Option<UpWord>, Query, description = "Where the heights of a trace point: `out` of the material (the default) \
            or `in`to it. Without it, only the curvature of a ball turns heights, and `notes` say so."),
        ("scar" = Option<String>, Query, description = "The ends of the scar in x, if a trace has several or lies on a step. \
            Default: the scar is found.", example = "0.4..1.6mm"),
    ),
    request_body(description = "The file, at most 4 MiB with 1 000 000 rows and 64 columns, in UTF-8, UTF-16 or Latin-1.",
        content(
            (String = "text/csv", example = "cycles;wear_volume [mm^3]\n10000;0,12\n50000;0,47\n"),
            (String = "text/plain", example = "cycles;wear_volume [mm^3]\n10000;0,12\n50000;0,47\n"),
            (schemas::File = "application/octet-stream"),
        )),
    responses(
        (status = 200, description = "Columns, prepared table and notes.", body = documents::Measured),
        (status = 422, description = "The file has no readable table, or a parameter does not fit it."),
        (status = 503, description = "The memory for large bodies is in use; see `Retry-After`.",
            headers(("Retry-After" = u32, description = "Seconds."))),
    ),
)]
pub async fn read(
    app: App,
    caller: Caller,
    mut query: Query,
    request: Request,
) -> Result<Response> {
    let body = read_file(request).await?;
    let (x, y) = (query.text("x"), query.text("y"));
    let names = Prepare::ALL.map(Prepare::as_str).join(", ");
    let prepare = query.value("prepare", format!("one of {names}"), |text| text.parse().ok());
    let table = query.value("table", "a number from 1 on", |text| text.parse().ok());
    let decimal = query.value("decimal", ". or ,", |text| {
        text.parse().ok().filter(|mark| ['.', ','].contains(mark))
    });
    let mut is =
        |name| query.value(name, "true or false", |text| text.parse().ok()).unwrap_or(true);
    let (level, centre) = (is("level"), is("centre"));
    let up = query.value("up", "out or in", |text| text.parse().ok());
    let scar = query.value("scar", ENDS, ends);
    query.finish()?;
    let bytes = ANSWER * body.bytes.len();
    let turn = app.shares.heavy.turn(&caller.owner).await;
    let permit = app.shares.answers(bytes).hold(&caller.owner, bytes).await?;
    let prepare = prepare.unwrap_or(Prepare::Points);
    let read = blocking(move || {
        let (x, y) = (x.as_deref(), y.as_deref());
        let wanted = Wanted { x, y, table, decimal, prepare, level, centre, up, scar };
        fretwork_measured::read(&body.bytes, &wanted)
    });
    let read = read.await?;
    drop(turn);
    fresh(permit, bytes, read.map_err(|faults| refused(&faults))?).await
}
