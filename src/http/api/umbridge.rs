//! UM-Bridge 1.0, the protocol of tools for uncertainty quantification.
//!
//! The model `wear` maps numbers of a scenario to outputs of its result. Its config is read by [`Model::read`]. The model
//! `log_likelihood` maps the parameters of a stored fit to one number; its config has the key of the fit. Errors have the
//! form of the protocol, `{"error": {"type", "message"}}`. Bodies need no content type, because the clients send none. This
//! is safe: a call changes nothing, so a foreign web page can do no harm with it.
//!
//! # Sources
//! - L. Seelinger et al., J. Open Source Softw. 8 (2023) 4748; protocol: <https://um-bridge-benchmarks.readthedocs.io>.

use std::fmt::Write as _;
use std::sync::Arc;

use axum::RequestExt as _;
use axum::extract::{FromRequest, Request};
use axum::http::{Method, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodRouter, get, post};
use serde::{Deserialize, Serialize};
use serde_json::json;
use serde_json::value::RawValue;

use crate::http::access::needs::Needs;
use crate::http::answer::stored::{document, require};
use crate::http::memory::models::AnyModel;
use crate::http::problem::kinds::Kind;
use crate::http::shares::Turn;
use crate::http::transport::body::{Counted, read_any};
use crate::http::{App, Caller, FRESH_JSON, Problem, Result, blocking, problem};
use crate::service::Unable;
use fretwork_engine::{Faults, Valid};
use fretwork_job::Key;
use fretwork_json::{self as json, BadBody};
use fretwork_study::{Jacobian, Likelihood, LikelihoodCall, Model, Output};

/// The names of the models. Clients that test a server take the first one, which needs no config.
const NAMES: [&str; 2] = ["wear", "log_likelihood"];
/// Largest scenario that is prepared on the async thread, in bytes of memory.
const SMALL: usize = 1 << 14;
/// Maximum number of faults that a message lists.
const LISTED: usize = 5;

/// A route: its path, its method, what it requires, and its handler.
type Route = (&'static str, Method, Needs, fn() -> MethodRouter<App>);

/// All routes.
pub static ROUTES: [Route; 8] = [
    ("/Info", Method::GET, Needs::READ, || get(info)),
    ("/ModelInfo", Method::POST, Needs::READ, || post(model_info)),
    ("/InputSizes", Method::POST, Needs::READ, || post(input_sizes)),
    ("/OutputSizes", Method::POST, Needs::READ, || post(output_sizes)),
    ("/Evaluate", Method::POST, Needs::EVALUATE, || post(evaluate)),
    ("/Gradient", Method::POST, Needs::EVALUATE, || post(gradient)),
    ("/ApplyJacobian", Method::POST, Needs::EVALUATE, || post(apply_jacobian)),
    ("/ApplyHessian", Method::POST, Needs::EVALUATE, || post(apply_hessian)),
];

/// Whether a route belongs to UM-Bridge.
pub fn has_route(route: &str) -> bool {
    ROUTES.iter().any(|(path, ..)| *path == route)
}

/// An error type of the protocol. Unlike a problem type of the API, it has no page.
const fn kind(slug: &'static str, status: StatusCode) -> Kind {
    Kind { slug, status }
}

static INVALID_INPUT: Kind = kind("InvalidInput", StatusCode::BAD_REQUEST);
static INVALID_OUTPUT: Kind = kind("InvalidOutput", StatusCode::INTERNAL_SERVER_ERROR);
static MODEL_NOT_FOUND: Kind = kind("ModelNotFound", StatusCode::BAD_REQUEST);
static UNSUPPORTED_FEATURE: Kind = kind("UnsupportedFeature", StatusCode::BAD_REQUEST);

fn bad_input(message: impl Into<String>) -> Problem {
    Problem::new(&INVALID_INPUT, message)
}

fn missing(name: &str) -> Problem {
    bad_input(format!("`{name}` is missing."))
}

/// The problem for faults of a part of the request.
fn faulty(part: &str, faults: &Faults) -> Problem {
    let mut message = String::new();
    for fault in faults.0.iter().take(LISTED) {
        let _ = write!(message, "{part}{} {}. ", fault.pointer, fault.detail.trim_end_matches('.'));
    }
    if faults.0.len() > LISTED {
        let _ = write!(message, "There are {} more faults.", faults.0.len() - LISTED);
    }
    bad_input(message.trim_end())
}

/// Writes the error of a response in the form of the protocol.
pub fn write(mut response: Response) -> Response {
    let Some(problem) = problem::taken(&mut response) else { return response };
    let (kind, message) = problem.in_words();
    let document = json!({"error": {"type": kind, "message": message}});
    problem::with_error(response, "application/json", &document)
}

/// The members that a request can have. Unknown members are ignored.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Call {
    name: Option<String>,
    config: Option<Box<RawValue>>,
    input: Option<Vec<Vec<f64>>>,
    out_wrt: Option<i64>,
    in_wrt: Option<i64>,
    sens: Option<Vec<f64>>,
    vec: Option<Vec<f64>>,
}

impl Call {
    /// Parses a body, and checks the name of the model.
    fn read(body: &[u8]) -> Result<Self> {
        let empty = body.iter().all(u8::is_ascii_whitespace);
        let call: Self =
            serde_json::from_slice(if empty { b"{}" } else { body }).map_err(|error| {
                bad_input(format!("The body of the request cannot be read as JSON: {error}."))
            })?;
        match call.name.as_deref() {
            Some(name) if NAMES.contains(&name) => Ok(call),
            Some(other) => {
                let other: String = other.chars().take(60).collect();
                let [one, two] = NAMES;
                let message = format!(
                    "There is no model \"{other}\". Enter \"{one}\" as `name`, or \"{two}\" for that of a stored fit."
                );
                Err(Problem::new(&MODEL_NOT_FOUND, message))
            }
            None => Err(missing("name")),
        }
    }
}

/// A call of a model, and the turn of its caller.
struct Called {
    app: App,
    call: Call,
    model: AnyModel,
    _turn: Turn,
    /// Holds the permit for the memory of the body while the call uses numbers from it.
    _body: Counted,
}

impl FromRequest<App> for Called {
    type Rejection = Problem;

    async fn from_request(mut request: Request, app: &App) -> Result<Self> {
        let Ok(caller) = request.extract_parts::<Caller>().await;
        let body = read_any(request).await?;
        let turn = app.shares.evaluations.turn(&caller.owner).await;
        let mut call = Call::read(&body.bytes)?;
        let config = call.config.take();
        let model = if call.name.as_deref() == Some(NAMES[0]) {
            AnyModel::Wear(model_of(app, config).await?)
        } else {
            AnyModel::Likelihood(likelihood_of(app, &caller, config).await?)
        };
        Ok(Self { app: app.clone(), call, model, _turn: turn, _body: body })
    }
}

impl Called {
    /// The input vector. The model has only one.
    fn point(&mut self) -> Result<Vec<f64>> {
        let input = self.call.input.take().ok_or_else(|| missing("input"))?;
        let [point] = <[Vec<f64>; 1]>::try_from(input).map_err(|input| {
            bad_input(format!("`input` must have one vector, not {}.", input.len()))
        })?;
        let (expected, given) = (self.inputs(), point.len());
        if given == expected {
            return Ok(point);
        }
        Err(bad_input(format!(
            "`input` must have {expected} numbers, not {given}: one for each of the `parameters` in `config` or of the fit."
        )))
    }

    fn inputs(&self) -> usize {
        match &self.model {
            AnyModel::Wear(model) => model.members().len(),
            AnyModel::Likelihood(model) => model.parameters(),
        }
    }

    fn outputs(&self) -> usize {
        match &self.model {
            AnyModel::Wear(model) => model.outputs().len(),
            AnyModel::Likelihood(_) => 1,
        }
    }

    /// The log likelihood of a fit alone, or its gradient.
    async fn of_fit(&self, mut call: LikelihoodCall) -> Result<Vec<f64>> {
        compute(&self.app, call.seconds(), move || call.step()).await
    }

    /// The input vector of a request for derivatives. The request must name the first output vector and the first input
    /// vector, because the model has no others.
    fn point_of_derivative(&mut self) -> Result<Vec<f64>> {
        let point = self.point()?;
        for (name, given) in [("outWrt", self.call.out_wrt), ("inWrt", self.call.in_wrt)] {
            let given = given.ok_or_else(|| missing(name))?;
            if given != 0 {
                let message = format!(
                    "`{name}` must be 0, not {given}: the model has one input vector and one output vector."
                );
                return Err(bad_input(message));
            }
        }
        Ok(point)
    }

    /// Prepares a computation. This parses the scenario of the model; a large scenario is parsed on a blocking thread.
    async fn prepare<T: Send + 'static>(
        &self,
        model: &Arc<Model>,
        prepare: impl Fn(&Arc<Model>) -> Valid<T> + Send + 'static,
    ) -> Result<T> {
        let prepared = if model.bytes() <= SMALL {
            prepare(model)
        } else {
            let model = Arc::clone(model);
            compute(&self.app, 1e-3, move || Some(prepare(&model))).await?
        };
        prepared.map_err(|faults| {
            faulty("The scenario with the values of `input` is not valid: ", &faults)
        })
    }

    /// Answers weighted sums of the entries of the Jacobian: a gradient, or a product with a vector. `place` returns
    /// the index of the sum to which an entry is added.
    async fn weighted(
        &self,
        point: Vec<f64>,
        (by_output, by_member): (Vec<f64>, Vec<f64>),
        mut sums: Vec<f64>,
        place: fn(output: usize, member: usize) -> usize,
    ) -> Result<Response> {
        let model = match &self.model {
            AnyModel::Wear(model) => model,
            AnyModel::Likelihood(model) => {
                let slopes = self.of_fit(model.at(point, true)).await?;
                for (member, slope) in slopes.into_iter().enumerate() {
                    sums[place(0, member)] += by_output[0] * by_member[member] * slope;
                }
                return weighted_answer(&sums);
            }
        };
        let is_wanted = by_output.iter().any(|weight| *weight != 0.0);
        let members = (0..by_member.len()).filter(|place| is_wanted && by_member[*place] != 0.0);
        let members: Vec<usize> = members.collect();
        let start = move |model: &Arc<Model>| Jacobian::new(model, &point, members.clone());
        let mut search = self.prepare(model, start).await?;
        let found = compute(&self.app, search.seconds(), move || search.step()).await?;
        for entry in found.into_iter().filter(|entry| by_output[entry.output] != 0.0) {
            let (sum, weight) = (
                place(entry.output, entry.member),
                by_output[entry.output] * by_member[entry.member],
            );
            let derivative = entry.derivative.map_err(|reason| {
                let output = model.outputs()[entry.output].name();
                let member = &model.members()[entry.member].pointer;
                let message =
                    format!("{output} has no derivative with respect to {member}: {reason}.");
                Problem::new(&INVALID_OUTPUT, message)
            })?;
            sums[sum] += weight * derivative.value;
        }
        weighted_answer(&sums)
    }
}

fn weighted_answer(sums: &[f64]) -> Result<Response> {
    if sums.iter().any(|sum| !sum.is_finite()) {
        let message =
            "A weighted sum of the derivatives is too large for a number. Enter smaller weights.";
        return Err(Problem::new(&INVALID_OUTPUT, message));
    }
    Ok(answer(&json!({"output": sums})))
}

fn sized(name: &str, numbers: Option<Vec<f64>>, expected: usize) -> Result<Vec<f64>> {
    let numbers = numbers.ok_or_else(|| missing(name))?;
    if numbers.len() == expected {
        return Ok(numbers);
    }
    Err(bad_input(format!("`{name}` must have {expected} numbers, not {}.", numbers.len())))
}

/// Calls `step` until it returns the outcome, in turns with other calls. `seconds` is the estimated time.
async fn compute<T: Send + 'static>(
    app: &App,
    seconds: f64,
    step: impl FnMut() -> Option<T> + Send + 'static,
) -> Result<T> {
    let advice = "Use fewer output cycles or a larger `tolerance`.";
    app.service.compute_in_turns(seconds, step).await.map_err(|unable| match unable {
        Unable::Panicked => Problem::bug(unable),
        unable => bad_input(format!("{unable} {advice}")),
    })
}

/// The model of a config.
async fn model_of(app: &App, config: Option<Box<RawValue>>) -> Result<Arc<Model>> {
    let text: Box<str> = config.map_or_else(|| "{}".into(), Into::into);
    if let Some(AnyModel::Wear(model)) = app.models.get(&*text) {
        return Ok(model);
    }
    let config = text.clone().into_string();
    let read = move || Some(json::read_body(text.as_bytes(), Model::read));
    // The time is not known. It is taken as 1 ms, which is too long for the async thread.
    let model = compute(app, 1e-3, read).await?.map_err(|bad| match bad {
        BadBody::Faults(faults) => faulty("config", &Faults(faults)),
        BadBody::Json(error) => bad_input(format!("`config` cannot be read: {error}.")),
        BadBody::Empty => missing("config"),
    })?;
    let model = Arc::new(model);
    app.models.insert(config, AnyModel::Wear(Arc::clone(&model)));
    Ok(model)
}

/// The config of a log likelihood.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OfFit {
    fit: String,
}

/// The log likelihood of the fit whose key is in the config. Like all results, every caller of the server may use it.
async fn likelihood_of(
    app: &App,
    caller: &Caller,
    config: Option<Box<RawValue>>,
) -> Result<Arc<Likelihood>> {
    let text: Box<str> = config.map_or_else(|| "{}".into(), Into::into);
    let advice = "Enter {\"fit\": \"KEY\"} with the key of the result of a fit";
    let OfFit { fit } = serde_json::from_str(&text)
        .map_err(|error| bad_input(format!("`config` cannot be read: {error}. {advice}.")))?;
    let key: Key =
        fit.parse().map_err(|bad| bad_input(format!("config/fit is no key: {bad}. {advice}.")))?;
    if let Some(AnyModel::Likelihood(model)) = app.models.get(&key.to_string()) {
        return Ok(model);
    }
    require(app, &caller.reach(), &key).await?;
    let known = app.store.known(&key).await?;
    if known.is_none_or(|known| known.asked.kind.member() != "fit") {
        let message = format!("config/fit is the key of another result. {advice}: POST /v1/jobs.");
        return Err(bad_input(message));
    }
    let fit = document(app, caller, &key).await?;
    // This waits for no worker, because other requests may wait for the document.
    let model = blocking(move || Likelihood::read(&fit)).await?;
    let model =
        Arc::new(model.map_err(|why| bad_input(format!("The fit has no likelihood: {why}.")))?);
    app.models.insert(key.to_string(), AnyModel::Likelihood(Arc::clone(&model)));
    Ok(model)
}

/// An answer. It has only the members of the protocol, because clients check this.
fn answer(document: &impl Serialize) -> Response {
    (FRESH_JSON, json::write(document, 256)).into_response()
}

/// Lists the models.
async fn info() -> Response {
    answer(&json!({"protocolVersion": 1.0, "models": NAMES}))
}

async fn model_info(request: Request) -> Result<Response> {
    Call::read(&read_any(request).await?.bytes)?;
    Ok(answer(&json!({"support": {
        "Evaluate": true, "Gradient": true, "ApplyJacobian": true, "ApplyHessian": false,
    }})))
}

async fn input_sizes(called: Called) -> Response {
    answer(&json!({"inputSizes": [called.inputs()]}))
}

async fn output_sizes(called: Called) -> Response {
    answer(&json!({"outputSizes": [called.outputs()]}))
}

async fn evaluate(mut called: Called) -> Result<Response> {
    let point = called.point()?;
    let model = match called.model.clone() {
        AnyModel::Wear(model) => model,
        AnyModel::Likelihood(model) => {
            let output = called.of_fit(model.at(point, false)).await?;
            return Ok(answer(&json!({"output": [output]})));
        }
    };
    let mut run = called.prepare(&model, move |model| model.run(&point)).await?;
    let (seconds, of) = (run.seconds(), Arc::clone(&model));
    let values = move || run.step().map(|ended| of.values(&ended));
    let found = compute(&called.app, seconds, values).await?;
    let value = |(value, output): (Result<f64, _>, &Output)| {
        let message = |reason| format!("{} has no value: {reason}.", output.name());
        value.map_err(|reason| Problem::new(&INVALID_OUTPUT, message(reason)))
    };
    let output: Result<Vec<f64>, _> =
        found.values.into_iter().zip(model.outputs()).map(value).collect();
    Ok(answer(&json!({"output": [output?]})))
}

async fn gradient(mut called: Called) -> Result<Response> {
    let point = called.point_of_derivative()?;
    let sens = sized("sens", called.call.sens.take(), called.outputs())?;
    let (weights, sums) = ((sens, vec![1.0; point.len()]), vec![0.0; point.len()]);
    called.weighted(point, weights, sums, |_, member| member).await
}

async fn apply_jacobian(mut called: Called) -> Result<Response> {
    let point = called.point_of_derivative()?;
    let vec = sized("vec", called.call.vec.take(), point.len())?;
    let outputs = called.outputs();
    let (weights, sums) = ((vec![1.0; outputs], vec), vec![0.0; outputs]);
    called.weighted(point, weights, sums, |output, _| output).await
}

async fn apply_hessian(request: Request) -> Result<Response> {
    Call::read(&read_any(request).await?.bytes)?;
    let message = "The model has no Hessian. Use differences of its gradient.";
    Err(Problem::new(&UNSUPPORTED_FEATURE, message))
}
