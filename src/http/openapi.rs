//! The OpenAPI document: the routes describe themselves, the rest is put in here.
//!
//! Requests and results have their schemas in files, because those describe documents that are not
//! Rust types here: the scenario's belongs to the engine, the result's is `documents.schema.json`.

use axum::http::Method;
use serde::Serialize;
use serde_json::{Map, Value, json};
use utoipa::openapi::schema::{
    ArrayBuilder, KnownFormat, ObjectBuilder, Schema, SchemaFormat, Type,
};
use utoipa::openapi::tag::TagBuilder;
use utoipa::openapi::{
    ComponentsBuilder, ContactBuilder, InfoBuilder, LicenseBuilder, OpenApi, OpenApiBuilder, RefOr,
    ServerBuilder,
};
use utoipa::{PartialSchema, ToSchema};

use super::forms::{self, Part};
use super::jobs::Include as Included;
use super::problem::ProblemDocument;
use super::scenarios::{EXAMPLES, parse_job};
use super::{access, links};
use crate::job;
use crate::store::Role as StoredRole;
use fretwork_engine::outcome::{History, Loops, Profiles};
use fretwork_engine::scenario::SCHEMA;

const DOCUMENT_SCHEMAS: &str = include_str!("documents.schema.json");

const ABOUT: &str = "\
Fretting wear of axisymmetric contacts by the method of dimensionality reduction.

Submit a scenario to `POST /v1/jobs`, read its result at `/v1/results/{key}`. Equal scenarios have \
equal keys, are computed once and shared by everyone who asks.

**Quantities.** In requests a physical quantity is a number in SI units or a string with a unit: \
`0.01`, `\"10 mm\"`, `\"205 GPa\"`, `\"3.03e-5 mm^3/(N m)\"`. Answers are in SI units and say so in \
`units`; `?units=engineering` gives results in um, mm^3, MPa, mJ and N. `amplitude` is half of the peak-to-peak stroke.

**Errors.** Every answer that is not a success is `application/problem+json` (RFC 9457). All faults \
of a request are reported at once, each with a JSON pointer. Unknown members and parameters are \
refused: a misspelt one must not silently take its default.

**Keys.** A server that others can reach asks for a key, `Authorization: Bearer fretwork_…`. Its role says \
what it is good for: `read`, `submit` or `admin`. Jobs belong to the name of the key; results are shared by \
all who have one. Without keys (on one's own machine) everything is open.

**Requests** may carry an `x-request-id`; every answer has one, and the log knows it.";

/// The document before any route is in it.
pub(super) fn frame() -> OpenApi {
    let tag = |name, about| TagBuilder::new().name(name).description(Some(about)).build();
    OpenApiBuilder::new()
        .info(
            InfoBuilder::new()
                .title("fretwork")
                .version(env!("CARGO_PKG_VERSION"))
                .description(Some(ABOUT))
                .contact(Some(ContactBuilder::new().name(Some("The fretwork developers")).build()))
                .license(Some(
                    LicenseBuilder::new()
                        .name(env!("CARGO_PKG_LICENSE"))
                        .identifier(Some(env!("CARGO_PKG_LICENSE")))
                        .build(),
                )),
        )
        .servers(Some([ServerBuilder::new().url("/").description(Some("This server.")).build()]))
        .tags(Some([
            tag("jobs", "Submit scenarios and follow them."),
            tag("results", "What was computed. Results never change."),
            tag("scenarios", "Check a scenario, learn from examples, read the contract."),
            tag("system", "The server itself."),
        ]))
        .components(Some(
            ComponentsBuilder::new()
                .schema_from::<ProblemDocument<'_>>()
                .schema_from::<super::problem::Complaint>()
                // Types that appear in parameters only are not found by themselves.
                .schema_from::<Include>()
                .schema_from::<Role>()
                .schema_from::<WholeFormat>()
                .schema_from::<HistoryFields>()
                .schema_from::<ProfileFields>()
                .schema_from::<LoopFields>()
                .schema_from::<ChosenInstants>()
                .schema_from::<PlotQuantity>()
                .schema_from::<PlotInstants>()
                .schema_from::<Spacing>()
                .schema_from::<WholeLayout>()
                .schema_from::<Layout>()
                .schema_from::<UnitSystem>()
                .schema_from::<TableFormat>()
                .schema_from::<MatrixFormat>()
                .schema_from::<KeyText>()
                .build(),
        ))
        .build()
}

/// The complete document as it is served, printed and committed.
#[must_use]
pub fn document() -> Vec<u8> {
    let mut document = serde_json::to_value(super::routes().into_openapi()).unwrap_or_default();
    if let Some(Value::Object(schemas)) = document.pointer_mut("/components/schemas") {
        adopt(schemas, SCHEMA, Some("Scenario"));
        adopt(schemas, DOCUMENT_SCHEMAS, None);
        // Spliced in as stored, so no members of the Rust type.
        schemas["Job"]["properties"]["scenario"] = json!({
            "description": "With `include=scenario`: what is computed, in SI units with defaults filled \
                in, as the result has it too; submitted again it has the same key. Null only for a job \
                that found its result known, once that has been dropped for a year.",
            "oneOf": [{"$ref": "#/components/schemas/Scenario"}, {"type": "null"}],
        });
        schemas["Job"]["properties"]["result"] = json!({
            "description": "With `include=result`: the result, null until the job has succeeded.",
            "oneOf": [{"$ref": "#/components/schemas/Result"}, {"type": "null"}],
        });
    }
    if let Some(Value::Object(paths)) = document.pointer_mut("/paths") {
        for (path, item) in paths {
            for (method, operation) in item.as_object_mut().into_iter().flatten() {
                let method = method.to_uppercase().parse().unwrap_or_default();
                place(path, &method, operation);
                complete(operation);
                guard(path, &method, operation);
                if let Some(Value::Object(responses)) = operation.get_mut("responses") {
                    responses.sort_keys();
                }
            }
        }
    }
    document["components"]["headers"] = shared_headers();
    document["components"]["securitySchemes"] = security_schemes();
    // Without keys it is open: then none is needed.
    document["security"] = json!([{"key": []}, {"password": []}, {}]);
    let listing = document.pointer_mut("/paths/~1v1~1results/get/parameters");
    if let Some(Value::Array(parameters)) = listing {
        parameters.splice(0..0, super::library::parameters());
    }
    let mut text = serde_json::to_vec_pretty(&document).unwrap_or_default();
    text.push(b'\n');
    text
}

/// Takes the definitions of a JSON Schema file over into the components; the schema itself, if it
/// is to have a name, beside them.
fn adopt(schemas: &mut Map<String, Value>, file: &str, name: Option<&str>) {
    let Ok(Value::Object(mut root)) = serde_json::from_str(file) else {
        return;
    };
    if let Some(Value::Object(definitions)) = root.remove("$defs") {
        for (name, mut definition) in definitions {
            redirect(&mut definition);
            schemas.insert(name, definition);
        }
    }
    if let Some(name) = name {
        root.remove("$schema");
        root.remove("$id");
        let mut root = Value::Object(root);
        redirect(&mut root);
        schemas.insert(name.to_owned(), root);
    }
}

/// Lets references within a schema file point at the components.
fn redirect(schema: &mut Value) {
    match schema {
        Value::Object(members) => {
            if let Some(Value::String(target)) = members.get_mut("$ref")
                && let Some(name) = target.strip_prefix("#/$defs/")
            {
                *target = format!("#/components/schemas/{name}");
            }
            members.values_mut().for_each(redirect);
        }
        Value::Array(items) => items.iter_mut().for_each(redirect),
        _ => {}
    }
}

/// Whether an operation answers a result in one of its forms.
fn reads_result(path: &str, method: &Method) -> bool {
    links::OPENED.contains(&path) && *method == Method::GET
}

/// Adds to an operation what follows from its place: that there may be no such job or result, or no
/// more, or no room for what it writes; and what all forms of a result share.
fn place(path: &str, method: &Method, operation: &mut Value) {
    let mut shared = Vec::new();
    if path.starts_with("/v1/jobs/{id}") {
        shared.push(("404", "No job has this id."));
    }
    if path.starts_with("/v1/results/{key}") {
        shared.push(("404", "No result has this key."));
        if !OUTLIVING.iter().any(|end| path.ends_with(end)) {
            shared.push((
                "410",
                "The result was dropped to make room; `scenario` is what it was computed from.",
            ));
        }
    }
    // More than to read is asked of those who write.
    if access::needed(method, path).is_some_and(|role| role != StoredRole::Read) {
        shared.push(("507", "The disk is full."));
    }
    if let Some(Value::Object(responses)) = operation.get_mut("responses") {
        for (status, description) in shared {
            responses.entry(status).or_insert_with(|| json!({"description": description}));
        }
    }
    if reads_result(path, method) {
        share_forms(operation, !path.ends_with("/plot.svg"));
    }
}

/// What is known of a result after it was dropped.
const OUTLIVING: [&str; 2] = ["/provenance", "/note"];

/// Adds to the reading of a result what all its forms take and answer; those of numbers, a little more.
fn share_forms(operation: &mut Value, of_numbers: bool) {
    if let Some(Value::Array(parameters)) = operation.get_mut("parameters") {
        if of_numbers {
            let about = "Rounds every number to so many significant digits. Up to 7, arrays in NPZ and \
                Arrow are float32, but for columns with numbers below 1.2e-38. In `differences` it is the \
                largest number of a matrix that has them: 7 unless said otherwise, at most 12.";
            let schema = json!({"type": "integer", "format": "int32", "minimum": 1, "maximum": 17});
            let mut digits = parameter("digits", "query", about, &schema);
            digits["example"] = json!(7);
            let about = "`si` (the default), or `engineering`: um, mm^3, MPa (moduli too), mJ, N, \
                mm^3/(N m). The member `units` and the headers say which.";
            let schema = json!({"$ref": "#/components/schemas/UnitSystem"});
            let mut units = parameter("units", "query", about, &schema);
            units["example"] = json!("engineering");
            parameters.extend([digits, units]);
        }
        let text = json!({"type": "string"});
        let codings = if of_numbers {
            "`zstd` or `gzip`; NPZ is compressed in itself."
        } else {
            "`zstd` or `gzip`."
        };
        parameters.extend([
            parameter("If-None-Match", "header", "The `ETag` of a held copy.", &text),
            parameter("Accept-Encoding", "header", codings, &text),
        ]);
    }
    let responses = &mut operation["responses"];
    responses["304"] = json!({"description": "The held copy is still right. It always is."});
    responses["404"] = json!({
        "description": "No result has this key. `Link` leads to its job, if one is under way.",
        "headers": {"Link": header("`rel=\"related\"`.")},
    });
    let headers = &mut responses["200"]["headers"];
    headers["ETag"] = header("The tag of this representation; weak where it is compressed.");
    headers["Cache-Control"] = header("`immutable`: keep it for ever.");
    if of_numbers {
        headers["Content-Disposition"] = header("A name for the file: of CSV, NPZ and Arrow.");
    }
}

/// A parameter that need not be given.
fn parameter(name: &str, place: &str, about: &str, schema: &Value) -> Value {
    json!({"name": name, "in": place, "description": about, "required": false, "schema": schema})
}

/// A header that is a text.
fn header(about: &str) -> Value {
    json!({"description": about, "schema": {"type": "string"}})
}

/// Adds to an operation what all operations share: the problems, the request id, the examples.
fn complete(operation: &mut Value) {
    let parameters = operation.get_mut("parameters").and_then(Value::as_array_mut);
    for parameter in parameters.into_iter().flatten() {
        // The key of the first example: whoever has computed it can try every route on the page.
        if parameter["name"] == "key" && parameter["in"] == "path" {
            parameter["example"] = json!(example_key());
        }
        if parameter["in"] == "header" {
            // A header can be absent, but not null.
            parameter["schema"] = json!({"type": "string"});
        }
    }
    let body = operation.get_mut("requestBody");
    let takes_body = body.is_some();
    if let Some(body) = body {
        body["required"] = json!(true);
    }
    if let Some(content) = operation.pointer_mut("/requestBody/content/application~1json")
        && content["schema"]["$ref"] == "#/components/schemas/JobBody"
    {
        let examples: Map<String, Value> = EXAMPLES
            .iter()
            .filter_map(|example| {
                let body: Value = serde_json::from_str(example.body).ok()?;
                let summary = body["label"].clone();
                Some((example.name.to_owned(), json!({"summary": summary, "value": body})))
            })
            .collect();
        content["examples"] = Value::Object(examples);
    }
    let Some(Value::Object(responses)) = operation.get_mut("responses") else {
        return;
    };
    let mut shared = vec![
        ("422", "A parameter or the body has faults; `errors` lists them all."),
        ("500", "The server made a mistake, or its database is damaged."),
        ("503", "The server is going down, or its database is busy; see `Retry-After`."),
    ];
    if takes_body {
        shared.extend([
            ("400", "The body is not JSON."),
            ("413", "The body has more than 4 MiB."),
            ("415", "The body is not declared as JSON."),
        ]);
    }
    for (status, description) in shared {
        responses.entry(status).or_insert_with(|| json!({"description": description}));
    }
    for (status, response) in responses {
        if status.starts_with(['4', '5']) {
            let problem = json!({"$ref": "#/components/schemas/Problem"});
            response["content"] = json!({"application/problem+json": {"schema": problem}});
        }
        response["headers"]["x-request-id"] = json!({"$ref": "#/components/headers/x-request-id"});
    }
}

/// Adds to an operation what the gate before it asks and answers.
fn guard(path: &str, method: &Method, operation: &mut Value) {
    let Some(role) = access::needed(method, path) else {
        operation["security"] = json!([]);
        return;
    };
    let refusal = |description: String| {
        json!({
            "description": description,
            "content": {"application/problem+json":
                {"schema": {"$ref": "#/components/schemas/Problem"}}},
            "headers": {"x-request-id": {"$ref": "#/components/headers/x-request-id"}},
        })
    };
    let responses = &mut operation["responses"];
    responses["421"] = refusal(
        "A server without keys was asked by a name other than localhost or an address.".into(),
    );
    responses["401"] =
        refusal("The server asks for keys, and the request has none that is good.".into());
    responses["401"]["headers"]["WWW-Authenticate"] = header("How to send a key.");
    let mut forbidden = match role {
        StoredRole::Read => String::new(),
        role => format!("The key has not the role this needs ({role}). "),
    };
    if *method != Method::GET {
        forbidden.push_str("A page of an unknown site sent it through a browser. ");
    }
    if reads_result(path, method) {
        forbidden.push_str("The `link` does not open this. ");
        if let Some(Value::Array(parameters)) = operation.get_mut("parameters") {
            let about = "In place of a key: from `POST /v1/results/{key}/links`.";
            parameters.push(parameter("link", "query", about, &json!({"type": "string"})));
        }
    }
    let responses = &mut operation["responses"];
    if !forbidden.is_empty() {
        responses["403"] = refusal(forbidden.trim_end().to_owned());
    }
    responses["429"] = refusal(
        "The key has sent too many requests this minute (then with `Retry-After`), or has too many at \
         work (then without: when one ends is not known)."
            .to_owned(),
    );
    responses["429"]["headers"]["Retry-After"] =
        json!({"$ref": "#/components/headers/Retry-After"});
    for (status, response) in responses.as_object_mut().into_iter().flatten() {
        // To stop work is not counted; who has no good key is told nothing.
        let counted = !access::is_relief(method, path);
        if counted && (status.starts_with(['2', '3']) || ["403", "404", "429"].contains(&&**status))
        {
            for name in ["RateLimit", "RateLimit-Policy"] {
                response["headers"][name] = json!({"$ref": format!("#/components/headers/{name}")});
            }
        }
    }
}

/// The headers that answers of many operations carry.
fn shared_headers() -> Value {
    json!({
        "x-request-id": header("The id of the request, in the server's log too."),
        "Retry-After": {
            "description": "Come back after so many seconds.", "schema": {"type": "integer", "minimum": 1},
        },
        "RateLimit": header(
            "Where requests are counted: `\"minute\";r=…;t=…`: `r` requests may come at once; in `t` \
             seconds there is at least one more. `\"at-once\";r=0` with a 429: all requests that may \
             be at work at the same time are."),
        "RateLimit-Policy": header(
            "Where requests are counted: `\"minute\";q=…;w=60`: `q` requests in 60 seconds. \
             `\"at-once\";q=…;qu=\"concurrent-requests\"` with a 429: `q` at the same time."),
    })
}

/// The ways of sending a key.
fn security_schemes() -> Value {
    json!({
        "key": {
            "type": "http", "scheme": "bearer", "bearerFormat": "fretwork_…",
            "description": "An access key: `Authorization: Bearer fretwork_…`.",
        },
        "password": {
            "type": "http", "scheme": "basic",
            "description": "An access key as the password, with any name, or as the name: for clients \
                that know only `http://name:key@host`.",
        },
    })
}

fn example_key() -> Option<String> {
    let submission = parse_job(EXAMPLES.first()?.body.as_bytes()).ok()?;
    Some(submission.task.key().to_string())
}

/// Declares types that exist for the document only. What is declared without words has its schema
/// in a file and is replaced by [`adopt`].
macro_rules! documented {
    ($($(#[$about:meta])* $name:ident $words:expr;)*) => {
        $(
            $(#[$about])*
            pub enum $name {}

            impl PartialSchema for $name {
                fn schema() -> RefOr<Schema> {
                    $words.into()
                }
            }

            impl ToSchema for $name {}
        )*
    };
}

fn words<'a>(words: impl IntoIterator<Item = &'a str>) -> Schema {
    ObjectBuilder::new().schema_type(Type::String).enum_values(Some(words)).build().into()
}

/// A list, which a query has with commas between; what is in it twice counts once.
fn list(items: impl Into<RefOr<Schema>>) -> Schema {
    ArrayBuilder::new().items(items.into()).min_items(Some(1)).build().into()
}

/// Names of the columns of a table.
fn columns(table: &impl Serialize) -> Schema {
    let table = serde_json::to_value(table).unwrap_or_default();
    list(words(table.as_object().into_iter().flat_map(Map::keys).map(String::as_str)))
}

fn kept_in_a_file() -> Schema {
    ObjectBuilder::new().build().into()
}

documented! {
    /// Whether a result is there.
    Standing words(["held", "dropped", "unknown"]);
    /// Where a job stands.
    JobState words(job::JobState::ALL.iter().map(|state| state.as_str()));
    /// How a job came to its result.
    Origin words(job::Origin::ALL.iter().map(|origin| origin.as_str()));
    /// What may be put into the answer beside a job.
    Include list(words(Included::WORDS));
    /// What a key is good for.
    Role words(StoredRole::ALL.iter().map(|role| role.as_str()));
    /// The formats of a whole result.
    WholeFormat words(Part::Whole.formats().iter().map(|format| format.name()));
    /// The formats of a table.
    TableFormat words(Part::History.formats().iter().map(|format| format.name()));
    /// The formats of a table with matrices.
    MatrixFormat words(Part::Profiles.formats().iter().map(|format| format.name()));
    /// Columns of a history.
    HistoryFields columns(&History::default());
    /// Columns of profiles.
    ProfileFields columns(&Profiles::default());
    /// Columns of loops.
    LoopFields columns(&Loops::default());
    /// Instants of a result, in cycles.
    ChosenInstants list(ObjectBuilder::new().schema_type(Type::Number).minimum(Some(0)).build());
    /// What can be drawn.
    PlotQuantity words(forms::QUANTITIES.iter().map(|quantity| quantity.name));
    /// Instants that are drawn, in cycles.
    PlotInstants ArrayBuilder::new()
        .items(ObjectBuilder::new().schema_type(Type::Number).minimum(Some(0)).build())
        .min_items(Some(1))
        .max_items(Some(forms::MOST))
        .build();
    /// How values are spread over an axis.
    Spacing words(["linear", "log"]);
    /// The layout of a whole result.
    WholeLayout words(["columns"]);
    /// The layouts of a table in JSON.
    Layout words(["columns", "records"]);
    /// The units of an answer.
    UnitSystem words(["si", "engineering"]);
    /// A file for programs.
    File Schema::from(ObjectBuilder::new().schema_type(Type::String).format(Some(
        SchemaFormat::KnownFormat(KnownFormat::Binary),
    )).build());
    /// The address of a result.
    KeyText ObjectBuilder::new()
        .schema_type(Type::String)
        .pattern(Some("^[0-9a-f]{64}$"))
        .build();
    /// One of the events that follow a job.
    JobEvent kept_in_a_file();
    /// Something the user should know about a scenario.
    Warning kept_in_a_file();
    /// What is known of a scenario beforehand.
    Preview kept_in_a_file();
}
