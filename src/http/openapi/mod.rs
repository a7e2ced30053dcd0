//! The OpenAPI document: generated from the routes, then completed with what all operations share. Only a test generates it. The
//! program contains the file.
//!
//! The engine has the schema of a scenario.

use axum::http::Method;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};
use utoipa::__dev::{SchemaReferences, Tags};
use utoipa::openapi::schema::Schema;
use utoipa::openapi::{OpenApi as OpenApiDocument, Paths, RefOr};
use utoipa::{OpenApi, Path};

use crate::http::access::needs::{Needs, RouteNeeds};
use crate::http::access::signed_link::OPENED;
use crate::http::api::documents::{Documents, EITHER};
use crate::http::api::scenarios::EXAMPLES;
use crate::http::problem::ProblemDocument;
use crate::http::schemas;
use fretwork_engine::SCHEMA;
use fretwork_engine::outcome::Quantity;
use fretwork_format::{Format, Part};
use fretwork_job::{Submission, TaskKind, WORDS, Word};
use fretwork_store::Role;
use fretwork_study::Kind;

/// The description of the API.
const ABOUT: &str = include_str!("about.md").trim_ascii_end();

/// Parts of the document that are the same for all routes.
const SHARED: &str = include_str!("shared.json");

#[derive(utoipa::OpenApi)]
#[openapi(
    info(
        title = "fretwork",
        description = ABOUT,
        contact(name = "The fretwork developers"),
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0"),
    ),
    servers((url = "/", description = "This server.")),
    tags(
        (name = "jobs", description = "Submit scenarios and follow them."),
        (name = "results", description = "Read results. They never change."),
        (name = "scenarios", description = "Check a scenario, see examples, read the schema."),
        (name = "system", description = "The server itself."),
    ),
    components(schemas(ProblemDocument<'_>, crate::http::problem::Complaint)),
)]
struct Frame;

/// The documentation of routes.
#[derive(Default)]
pub struct Documentation {
    operations: Paths,
    schemas: Vec<(String, RefOr<Schema>)>,
}

impl Documentation {
    /// Adds a route.
    pub fn with<P: Path + SchemaReferences + Tags<'static>>(mut self) -> Self {
        let mut operation = P::operation();
        operation.tags = Some(P::tags().into_iter().map(str::to_owned).collect());
        self.operations.add_path_operation(P::path(), P::methods(), operation);
        P::schemas(&mut self.schemas);
        self
    }
}

impl From<Documentation> for OpenApiDocument {
    fn from(Documentation { operations, schemas }: Documentation) -> Self {
        let mut document = Frame::openapi();
        document.paths = operations;
        let components = document.components.get_or_insert_default();
        components.schemas.extend(schemas);
        // utoipa does not collect the types that appear only in parameters.
        components.schemas.extend(schemas::all());
        components.schemas.extend(Documents::openapi().components.unwrap_or_default().schemas);
        document
    }
}

/// The complete document.
pub fn complete(documentation: Documentation, needs: &RouteNeeds) -> Vec<u8> {
    let document = OpenApiDocument::from(documentation);
    let mut document = serde_json::to_value(document).expect("an OpenAPI document");
    let mut shared: Value = parsed(SHARED);
    if let Some(Value::Object(schemas)) = document.pointer_mut("/components/schemas") {
        for name in ["Columns", "Scales", "Unworn", "Limit", "Curves", "LoopCurves", "BodyWear"] {
            add_units(&mut schemas[name]);
        }
        // A request can select columns.
        for (name, required) in [
            ("Columns", &["cycles"][..]),
            ("Limit", &[]),
            ("Curves", &["cycles", "radius"]),
            ("LoopCurves", &["cycles"]),
        ] {
            schemas[name]["required"] = json!(required);
        }
        for (name, meaning) in schemas::MEANINGS {
            schemas[*name]["description"] = json!(meaning.trim());
        }
        adopt_scenario(schemas);
        let choices = schemas.values_mut().filter_map(|schema| schema.get_mut("oneOf"));
        for choice in choices.filter_map(Value::as_array_mut).flatten() {
            // Generators take a reference with a description for an object without a name.
            if let Value::Object(members) = choice
                && members.contains_key("$ref")
            {
                members.retain(|name, _| name == "$ref");
            }
        }
        for (name, description, of) in EITHER {
            let of: Vec<_> =
                of.iter().map(|of| json!({"$ref": format!("#/components/schemas/{of}")})).collect();
            schemas.insert(name.to_owned(), json!({"description": description, "oneOf": of}));
        }
        for Word { name, values, .. } in &WORDS {
            let of = if *name == "regime" { "Of the unworn contact. " } else { "" };
            let values = values.iter().map(|it| json!(it)).chain([Value::Null]);
            schemas["ResultEntry"]["allOf"][0]["properties"][name] = json!({"type": ["string", "null"], "enum": values.collect::<Vec<_>>(), "description": format!("{of}Null where it does not apply.")});
        }
        // The server inserts the stored bytes, so the Rust type does not have these members.
        schemas["Job"]["properties"]["scenario"] = shared["job"]["scenario"].take();
        for kind in Kind::ALL {
            schemas["Job"]["properties"][kind.name] = json!({
                "description": "With `include=scenario`, for a study: the study in SI units with all defaults.",
                "$ref": schemas["JobBody"]["properties"][kind.name]["$ref"],
            });
        }
        for kind in TaskKind::all() {
            schemas["Problem"]["properties"][kind.member()] = json!({
                "description": "What an evicted result was computed from.", "type": "object",
            });
        }
        schemas["Job"]["properties"]["result"] = shared["job"]["result"].take();
    }
    for (path, item) in document["paths"].as_object_mut().into_iter().flatten() {
        for (method, operation) in item.as_object_mut().into_iter().flatten() {
            let method = parsed_method(method);
            let needs = needs.of(&method, path);
            add_path_responses(path, needs, operation);
            if let Some((_, part, schema)) = REPRESENTATIONS.iter().find(|(of, ..)| of == path)
                && method == Method::GET
            {
                add_representations(operation, *part, schema, &shared["representation"]);
            }
            let is_json = operation.pointer("/responses/200/content/application~1json").is_some();
            if is_json && method == Method::GET && path.starts_with("/v1/") {
                let only = json!({"description": "The `Accept` header excludes JSON."});
                let responses = operation["responses"].as_object_mut().into_iter();
                responses.for_each(|all| _ = all.entry("406").or_insert(only.clone()));
            }
            add_access_control(path, &method, needs, &shared, operation);
            add_shared_responses(&shared, operation);
            add_access_headers(needs, operation);
            operation["responses"].as_object_mut().into_iter().for_each(Map::sort_keys);
        }
    }
    for part in ["headers", "securitySchemes"] {
        document["components"][part] = shared[part].take();
    }
    // A server without keys needs none.
    document["security"] = json!([{"key": []}, {"password": []}, {}]);
    format!("{document:#}\n").into_bytes()
}

/// Copies the definitions of the schema of scenarios into the components, and the schema itself.
fn adopt_scenario(schemas: &mut Map<String, Value>) {
    // References within the schema become references to the components.
    let schema = SCHEMA.replace("\"#/$defs/", "\"#/components/schemas/");
    let mut root: Map<String, Value> = parsed(&schema);
    root.retain(|name, _| !["$schema", "$id"].contains(&&**name));
    if let Some(Value::Object(definitions)) = root.remove("$defs") {
        schemas.extend(definitions);
    }
    schemas.insert("Scenario".to_owned(), root.into());
}

/// Adds the units of quantities to their descriptions.
fn add_units(schema: &mut Value) {
    for (name, member) in schema["properties"].as_object_mut().into_iter().flatten() {
        let unit = Quantity::named(name).map_or("1", |quantity| quantity.unit);
        let unit = if unit == "1" { String::new() } else { format!(" Unit: {unit}.") };
        let meaning = member["description"].as_str().unwrap_or_default().trim_end_matches('.');
        member["description"] = format!("{meaning}.{unit}").into();
    }
}

/// The operations that return a representation of a result: the path, the part of the result, and the schema of its
/// JSON.
const REPRESENTATIONS: [(&str, Part, &str); 8] = [
    ("/v1/results/{key}", Part::Whole, "Result"),
    ("/v1/results/{key}/history", Part::History, "HistoryAnswer"),
    ("/v1/results/{key}/profiles", Part::Profiles, "ProfilesAnswer"),
    ("/v1/results/{key}/loops", Part::Loops, "LoopsAnswer"),
    ("/v1/results/{key}/table", Part::Table, "TableAnswer"),
    ("/v1/results/{key}/statistics", Part::Statistics, "StatisticsAnswer"),
    ("/v1/results/{key}/histogram", Part::Histogram, "HistogramAnswer"),
    ("/v1/results/{key}/plot.svg", Part::Plot, ""),
];

/// Adds the responses that follow from the path of an operation: an unknown job, an unknown or evicted
/// result, a full disk.
fn add_path_responses(path: &str, needs: Needs, operation: &mut Value) {
    let mut shared = Vec::new();
    if path.starts_with("/v1/jobs/{id}") {
        shared.push(("404", "No job has this id."));
    }
    if path.starts_with("/v1/results/{key}") {
        shared.push(("404", "No result has this key."));
        if !outlives(path) {
            shared
                .push(("410", "The result was evicted or deleted. `scenario` computes it again."));
        }
    }
    // Operations that need a higher role than `read` write to the disk, except an evaluation.
    if needs.role.is_some_and(|role| role != Role::Read) && needs != Needs::EVALUATE {
        shared.push(("507", "The disk is full."));
    }
    if let Some(Value::Object(responses)) = operation.get_mut("responses") {
        for (status, description) in shared {
            responses.entry(status).or_insert_with(|| json!({"description": description}));
        }
    }
}

/// Whether the operation at this path works for an evicted result too.
fn outlives(path: &str) -> bool {
    ["/provenance", "/warnings", "/note", "/derivatives"].iter().any(|end| path.ends_with(end))
}

/// Adds the formats and the headers of an operation that returns a part of a result; figures have fewer headers.
fn add_representations(operation: &mut Value, part: Part, schema: &str, shared: &Value) {
    let responses = &mut operation["responses"];
    for status in ["304", "404"] {
        responses[status] = shared[status].clone();
    }
    if Part::TABLES.contains(&part) || part.is_summary() {
        let names: Vec<_> = part.formats().iter().map(|format| format.name()).collect();
        responses["406"] =
            json!({"description": format!("The formats are `{}`.", names.join("`, `"))});
    }
    for format in part.formats() {
        let schema = match format {
            Format::Json => json!({"$ref": format!("#/components/schemas/{schema}")}),
            Format::Npz | Format::Arrow => json!({"$ref": "#/components/schemas/File"}),
            Format::Ndjson | Format::Csv | Format::Svg => json!({"type": "string"}),
        };
        responses["200"]["content"][format.essence()] = json!({"schema": schema});
    }
    responses["200"]["headers"] = shared["headers"].clone();
    if part != Part::Plot {
        responses["200"]["headers"]["Content-Disposition"] = shared["Content-Disposition"].clone();
    }
}

/// Adds what all operations share: problems, request id, examples.
fn add_shared_responses(shared: &Value, operation: &mut Value) {
    let mut named = operation["parameters"].as_array().into_iter().flatten();
    if named.any(|parameter| parameter["name"] == "cursor") {
        operation["responses"]["200"]["headers"]["Link"] = shared["next page"].clone();
    }
    let parameters = operation.get_mut("parameters").and_then(Value::as_array_mut);
    for parameter in parameters.into_iter().flatten() {
        // The key of the first example: after computing it, a reader can try every route.
        if parameter["name"] == "key" && parameter["in"] == "path" {
            parameter["example"] = json!(example_key());
        }
        if parameter["in"] == "header" {
            // A header can be absent, but never null.
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
        for example in EXAMPLES {
            let body: Value = parsed(example.body);
            content["examples"][example.name] = json!({"summary": body["label"], "value": body});
        }
    }
    let Some(responses) = operation["responses"].as_object_mut() else { return };
    let lists = [true, takes_body].into_iter().zip(["responses", "responses to a body"]);
    let lists = lists.filter(|(applies, _)| *applies).map(|(_, name)| &shared[name]);
    for (status, description) in lists.filter_map(Value::as_object).flatten() {
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

/// Adds the responses and parameters of access control.
fn add_access_control(
    path: &str,
    method: &Method,
    needs: Needs,
    shared: &Value,
    operation: &mut Value,
) {
    let Some(role) = needs.role else {
        operation["security"] = json!([]);
        return;
    };
    let mut forbidden = match role {
        Role::Read => String::new(),
        role => format!("The key does not have the required role, `{role}`. "),
    };
    if *method != Method::GET {
        forbidden.push_str("A web page of an unknown origin sent the request. ");
    }
    if OPENED.contains(&path) && *method == Method::GET {
        forbidden.push_str("The `link` does not open this address. ");
        if let Some(Value::Array(parameters)) = operation.get_mut("parameters") {
            parameters.push(shared["link"].clone());
        }
    }
    for status in ["401", "421", "429"] {
        operation["responses"][status] = shared["access"][status].clone();
    }
    if !forbidden.is_empty() {
        operation["responses"]["403"] = json!({"description": forbidden.trim_end()});
    }
}

/// Adds the headers of access control.
fn add_access_headers(needs: Needs, operation: &mut Value) {
    for (status, response) in operation["responses"].as_object_mut().into_iter().flatten() {
        // The quota of requests does not count cancellations. A client without a valid key learns nothing about limits.
        if needs.quota.is_some()
            && (status.starts_with(['2', '3']) || ["403", "404", "429"].contains(&&**status))
        {
            for name in ["RateLimit", "RateLimit-Policy"] {
                response["headers"][name] = json!({"$ref": format!("#/components/headers/{name}")});
            }
        }
    }
}

fn example_key() -> String {
    let submission = Submission::parse(EXAMPLES[0].body.as_bytes()).expect("a valid example");
    submission.prepared.key.to_string()
}

fn parsed_method(name: &str) -> Method {
    name.to_uppercase().parse().expect("an HTTP method")
}

fn parsed<T: DeserializeOwned>(file: &str) -> T {
    serde_json::from_str(file).expect("valid JSON")
}
