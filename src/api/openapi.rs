//! The OpenAPI document: the routes describe themselves, the rest is put in here.
//!
//! Requests and results have their schemas in files, because those describe documents that are not
//! Rust types here: the scenario's belongs to the engine, the result's is `documents.schema.json`.

use serde_json::{Map, Value, json};
use utoipa::openapi::schema::{ObjectBuilder, Schema, Type};
use utoipa::openapi::tag::TagBuilder;
use utoipa::openapi::{
    ComponentsBuilder, InfoBuilder, LicenseBuilder, OpenApi, OpenApiBuilder, RefOr,
};
use utoipa::{PartialSchema, ToSchema};

use super::problem::ProblemDocument;
use super::scenarios::{EXAMPLES, parse_job};
use crate::engine::scenario::SCHEMA;
use crate::job;

const DOCUMENT_SCHEMAS: &str = include_str!("documents.schema.json");

const ABOUT: &str = "\
Fretting wear of axisymmetric contacts by the method of dimensionality reduction.

Submit a scenario to `POST /v1/jobs`, read its result at `/v1/results/{key}`. Equal scenarios have \
equal keys, are computed once and shared by everyone who asks.

**Quantities.** In requests a physical quantity is a number in SI units or a string with a unit: \
`0.01`, `\"10 mm\"`, `\"205 GPa\"`, `\"3.03e-5 mm^3/(N m)\"`. Answers are in SI units and say so in \
`units`. `amplitude` is half of the peak-to-peak stroke.

**Errors.** Every answer that is not a success is `application/problem+json` (RFC 9457). All faults \
of a request are reported at once, each with a JSON pointer. Unknown members and parameters are \
refused: a misspelt one must not silently take its default.

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
                .license(Some(LicenseBuilder::new().name(env!("CARGO_PKG_LICENSE")).build())),
        )
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
                .schema_from::<Owner>()
                .schema_from::<JsonOnly>()
                .schema_from::<TableFormat>()
                .schema_from::<KeyText>()
                .build(),
        ))
        .build()
}

/// The complete document as it is served, printed and committed.
pub fn document() -> Vec<u8> {
    let mut document = serde_json::to_value(super::routes().into_openapi()).unwrap_or_default();
    if let Some(Value::Object(schemas)) = document.pointer_mut("/components/schemas") {
        adopt(schemas, SCHEMA, Some("Scenario"));
        adopt(schemas, DOCUMENT_SCHEMAS, None);
        // Spliced in as stored, so no member of the Rust type.
        schemas["Job"]["properties"]["result"] = json!({
            "description": "With `include=result`: the result, null until the job has succeeded.",
            "oneOf": [{"$ref": "#/components/schemas/Result"}, {"type": "null"}],
        });
    }
    if let Some(Value::Object(paths)) = document.pointer_mut("/paths") {
        for operation in
            paths.values_mut().filter_map(Value::as_object_mut).flat_map(Map::values_mut)
        {
            complete(operation);
        }
    }
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
        response["headers"]["x-request-id"] = json!({
            "description": "The id of the request, in the server's log too.",
            "schema": {"type": "string"},
        });
    }
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
    /// What may be inlined into a job.
    Include words(["result"]);
    /// Whose jobs.
    Owner words(["me"]);
    /// The formats of a whole result.
    JsonOnly words(["json"]);
    /// The formats of a table.
    TableFormat words(["json", "csv"]);
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
