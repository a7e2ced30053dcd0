//! UM-Bridge 1.0, the protocol of tools for uncertainty quantification.
//!
//! The model `wear` maps numbers of a scenario to outputs of its result. Its config is read by
//! [`Model::read`]. Errors have the form of the protocol, `{"error": {"type", "message"}}`. Bodies need no content type: the
//! clients send none. A model changes nothing, so a foreign web page cannot do harm with it.
//!
//! # Sources
//! - L. Seelinger et al., J. Open Source Softw. 8 (2023) 4748; protocol: <https://um-bridge-benchmarks.readthedocs.io>.

use std::borrow::Cow;
use std::fmt::Write as _;
use std::sync::Arc;

use axum::extract::State;
use axum::http::StatusCode;
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};
use axum::routing::{MethodRouter, post};
use serde::{Deserialize, Serialize};
use serde_json::json;
use serde_json::value::RawValue;

use crate::http::access::caller::Caller;
use crate::http::access::needs::Needs;
use crate::http::app::App;
use crate::http::problem::{self, Problem};
use crate::http::transport::body::AnyBody;
use crate::service::{LONGEST_CALL, MAX_CALL, Unable};
use fretwork_engine::request::fault::Faults;
use fretwork_json::{self as json, BadBody};
use fretwork_study::{Jacobian, Model, Output};

/// The name of the model.
const NAME: &str = "wear";
/// The address of the list of models.
pub const INFO: &str = "/Info";
/// Largest scenario that is prepared on the async thread, in bytes of memory.
const SMALL: usize = 1 << 14;
/// Most faults in a message.
const LISTED: usize = 5;

/// A route besides [`INFO`].
#[derive(Debug)]
pub struct Route {
    pub path: &'static str,
    pub needs: Needs,
    pub handler: fn() -> MethodRouter<App>,
}

macro_rules! routes {
    ($($path:literal $needs:ident $handler:ident)+) => {
        &[$(Route { path: $path, needs: Needs::$needs, handler: || post($handler) }),+]
    };
}

/// The other routes. All have the method POST.
pub static ROUTES: &[Route] = routes! {
    "/ModelInfo" READ model_info
    "/InputSizes" READ input_sizes
    "/OutputSizes" READ output_sizes
    "/Evaluate" EVALUATE evaluate
    "/Gradient" EVALUATE gradient
    "/ApplyJacobian" EVALUATE apply_jacobian
    "/ApplyHessian" EVALUATE apply_hessian
};

/// Whether a route belongs to UM-Bridge.
pub fn has_route(route: &str) -> bool {
    route == INFO || ROUTES.iter().any(|known| known.path == route)
}

/// An error of the protocol.
#[derive(Debug, Clone)]
pub struct Error {
    status: StatusCode,
    kind: &'static str,
    message: String,
}

/// Why a request is refused: by an error of the protocol, or by one that all routes of the server have.
#[derive(Debug)]
pub enum Refusal {
    /// An error of the protocol.
    Own(Box<Error>),
    /// An error of the server.
    Shared(Box<Problem>),
}

impl Refusal {
    fn new(status: StatusCode, kind: &'static str, message: impl Into<String>) -> Self {
        Self::Own(Box::new(Error { status, kind, message: message.into() }))
    }

    fn input(message: impl Into<String>) -> Self {
        Self::new(StatusCode::BAD_REQUEST, "InvalidInput", message)
    }

    fn output(message: impl Into<String>) -> Self {
        Self::new(StatusCode::INTERNAL_SERVER_ERROR, "InvalidOutput", message)
    }

    /// The faults of a part of the request.
    fn faults(part: &str, faults: &Faults) -> Self {
        let mut message = String::new();
        for fault in faults.0.iter().take(LISTED) {
            let _ =
                write!(message, "{part}{} {}. ", fault.pointer, fault.detail.trim_end_matches('.'));
        }
        if faults.0.len() > LISTED {
            let _ = write!(message, "There are {} more faults.", faults.0.len() - LISTED);
        }
        Self::input(message.trim_end())
    }
}

impl From<Problem> for Refusal {
    fn from(problem: Problem) -> Self {
        Self::Shared(Box::new(problem))
    }
}

impl From<Unable> for Refusal {
    fn from(unable: Unable) -> Self {
        let most = LONGEST_CALL.as_secs();
        let advice = "Use fewer output cycles or a larger `tolerance`.";
        match unable {
            Unable::TooLong(estimate) => Self::input(format!(
                "The computation would take about {:.0} s, but a call may take {most} s. {advice}",
                estimate.as_secs_f64()
            )),
            Unable::Stopped => Self::input(format!(
                "The computation was estimated to take less than {most} s. It was stopped after {} s. {advice}",
                MAX_CALL.as_secs()
            )),
            Unable::Panicked => Problem::bug(unable).into(),
        }
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        match self {
            Self::Own(error) => {
                let mut response = error.status.into_response();
                response.extensions_mut().insert(*error);
                response
            }
            Self::Shared(problem) => problem.into_response(),
        }
    }
}

/// Writes the error of a response in the form of the protocol.
pub fn write(mut response: Response) -> Response {
    let (kind, message) = match response.extensions_mut().remove::<Error>() {
        Some(Error { kind, message, .. }) => (kind, message),
        None => match problem::taken(&mut response) {
            Some(problem) => problem.in_words(),
            None => return response,
        },
    };
    let document = json!({"error": {"type": kind, "message": message}});
    problem::with_error(response, "application/json", &document)
}

/// The members of all requests. Others are ignored.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Call<'a> {
    #[serde(borrow)]
    name: Option<Cow<'a, str>>,
    #[serde(borrow)]
    config: Option<&'a RawValue>,
    input: Option<Vec<Vec<f64>>>,
    out_wrt: Option<i64>,
    in_wrt: Option<i64>,
    sens: Option<Vec<f64>>,
    vec: Option<Vec<f64>>,
}

impl<'a> Call<'a> {
    /// Parses a body, and checks the name of the model.
    fn read(body: &'a [u8]) -> Result<Self, Refusal> {
        let empty = body.iter().all(u8::is_ascii_whitespace);
        let call: Self = serde_json::from_slice(if empty { b"{}" } else { body })
            .map_err(|error| Refusal::input(format!("The body cannot be read: {error}.")))?;
        match call.name.as_deref() {
            Some(NAME) => Ok(call),
            Some(other) => {
                let other: String = other.chars().take(60).collect();
                let message = format!("There is no model \"{other}\". The model is \"{NAME}\".");
                Err(Refusal::new(StatusCode::BAD_REQUEST, "ModelNotFound", message))
            }
            None => Err(missing("name")),
        }
    }

    /// The only input vector.
    fn point(&mut self, model: &Model) -> Result<Vec<f64>, Refusal> {
        let input = self.input.take().ok_or_else(|| missing("input"))?;
        let [point] = <[Vec<f64>; 1]>::try_from(input).map_err(|input| {
            Refusal::input(format!("`input` must have one vector, not {}.", input.len()))
        })?;
        let (expected, given) = (model.members().len(), point.len());
        if given == expected {
            return Ok(point);
        }
        Err(Refusal::input(format!(
            "`input` must have {expected} numbers, not {given}: one for each of the `parameters` of the config."
        )))
    }

    /// Checks that the derivative is that of the only output vector with respect to the only input vector.
    fn check_vectors(&self) -> Result<(), Refusal> {
        for (name, given) in [("outWrt", self.out_wrt), ("inWrt", self.in_wrt)] {
            match given {
                Some(0) => {}
                Some(other) => {
                    let message =
                        format!("`{name}` must be 0, not {other}: the model has one vector.");
                    return Err(Refusal::input(message));
                }
                None => return Err(missing(name)),
            }
        }
        Ok(())
    }
}

fn missing(name: &str) -> Refusal {
    Refusal::input(format!("`{name}` is missing."))
}

fn sized(name: &str, numbers: Option<Vec<f64>>, expected: usize) -> Result<Vec<f64>, Refusal> {
    let numbers = numbers.ok_or_else(|| missing(name))?;
    if numbers.len() == expected {
        return Ok(numbers);
    }
    Err(Refusal::input(format!("`{name}` must have {expected} numbers, not {}.", numbers.len())))
}

/// The model of a call.
async fn model_of(app: &App, call: &Call<'_>) -> Result<Arc<Model>, Refusal> {
    let config = call.config.map_or("{}", RawValue::get);
    if let Some(model) = app.models.get(config) {
        return Ok(model);
    }
    let text = config.to_owned();
    let read = move || {
        let read = json::read_body(text.as_bytes(), Model::read);
        Some(read.map(|model| (text.clone(), Arc::new(model))))
    };
    // Its time is not known, but longer than those of runs on the async thread.
    let (text, model) =
        app.service.compute_in_turns(1e-3, read).await?.map_err(|bad| match bad {
            BadBody::Faults(faults) => Refusal::faults("config", &Faults(faults)),
            BadBody::Json(error) => Refusal::input(format!("`config` cannot be read: {error}.")),
            BadBody::Empty => missing("config"),
        })?;
    app.models.keep(text, Arc::clone(&model));
    Ok(model)
}

/// Prepares a computation, which parses a scenario.
async fn prepare<T: Send + 'static>(
    app: &App,
    model: &Arc<Model>,
    prepare: impl Fn(&Arc<Model>) -> Result<T, Faults> + Send + 'static,
) -> Result<T, Refusal> {
    let prepared = if model.bytes() <= SMALL {
        prepare(model)
    } else {
        let model = Arc::clone(model);
        app.service.compute_in_turns(1e-3, move || Some(prepare(&model))).await?
    };
    prepared.map_err(|faults| Refusal::faults("The scenario of this input is not valid: ", &faults))
}

/// An answer. Clients check that it has no other members.
fn answer(document: &impl Serialize) -> Response {
    let headers = [(CONTENT_TYPE, "application/json"), (CACHE_CONTROL, "no-store")];
    (headers, json::write(document, 256)).into_response()
}

/// Lists the models.
pub async fn info() -> Response {
    answer(&json!({"protocolVersion": 1.0, "models": [NAME]}))
}

async fn model_info(AnyBody(body): AnyBody) -> Result<Response, Refusal> {
    Call::read(&body)?;
    Ok(answer(&json!({"support": {
        "Evaluate": true, "Gradient": true, "ApplyJacobian": true, "ApplyHessian": false,
    }})))
}

async fn input_sizes(
    State(app): State<App>,
    caller: Caller,
    AnyBody(body): AnyBody,
) -> Result<Response, Refusal> {
    let _turn = app.shares.evaluation(&caller.owner).await;
    let model = model_of(&app, &Call::read(&body)?).await?;
    Ok(answer(&json!({"inputSizes": [model.members().len()]})))
}

async fn output_sizes(
    State(app): State<App>,
    caller: Caller,
    AnyBody(body): AnyBody,
) -> Result<Response, Refusal> {
    let _turn = app.shares.evaluation(&caller.owner).await;
    let model = model_of(&app, &Call::read(&body)?).await?;
    Ok(answer(&json!({"outputSizes": [model.outputs().len()]})))
}

async fn evaluate(
    State(app): State<App>,
    caller: Caller,
    AnyBody(body): AnyBody,
) -> Result<Response, Refusal> {
    let mut call = Call::read(&body)?;
    let _turn = app.shares.evaluation(&caller.owner).await;
    let model = model_of(&app, &call).await?;
    let point = call.point(&model)?;
    let mut run = prepare(&app, &model, move |model| model.run(&point)).await?;
    let (seconds, of) = (run.seconds(), Arc::clone(&model));
    let values = move || run.step().map(|ended| of.values(&ended));
    let found = app.service.compute_in_turns(seconds, values).await?;
    let value = |(value, output): (Result<f64, _>, &Output)| {
        value
            .map_err(|reason| Refusal::output(format!("{} has no value: {reason}.", output.name())))
    };
    let output: Result<Vec<f64>, _> =
        found.values.into_iter().zip(model.outputs()).map(value).collect();
    Ok(answer(&json!({"output": [output?]})))
}

/// A row or a column of the Jacobian, weighted.
async fn weighted(
    app: &App,
    model: &Arc<Model>,
    point: Vec<f64>,
    (by_output, by_member): (Vec<f64>, Vec<f64>),
    add: impl Fn(&mut [f64], usize, usize, f64),
    size: usize,
) -> Result<Response, Refusal> {
    let is_wanted = by_output.iter().any(|weight| *weight != 0.0);
    let members = (0..by_member.len()).filter(|place| is_wanted && by_member[*place] != 0.0);
    let members: Vec<usize> = members.collect();
    let start = move |model: &Arc<Model>| Jacobian::new(model, &point, members.clone());
    let mut search = prepare(app, model, start).await?;
    let found = app.service.compute_in_turns(search.seconds(), move || search.step()).await?;
    let mut sums = vec![0.0; size];
    for entry in found.into_iter().filter(|entry| by_output[entry.output] != 0.0) {
        let derivative = entry.derivative.map_err(|reason| {
            let output = model.outputs()[entry.output].name();
            let member = &model.members()[entry.member].pointer;
            Refusal::output(format!(
                "{output} has no derivative with respect to {member}: {reason}."
            ))
        })?;
        let weight = by_output[entry.output] * by_member[entry.member];
        add(&mut sums, entry.output, entry.member, weight * derivative.value);
    }
    if sums.iter().any(|sum| !sum.is_finite()) {
        return Err(Refusal::output("A weighted sum of the derivatives is infinite.".to_owned()));
    }
    Ok(answer(&json!({"output": sums})))
}

async fn gradient(
    State(app): State<App>,
    caller: Caller,
    AnyBody(body): AnyBody,
) -> Result<Response, Refusal> {
    let mut call = Call::read(&body)?;
    let _turn = app.shares.evaluation(&caller.owner).await;
    let model = model_of(&app, &call).await?;
    let point = call.point(&model)?;
    call.check_vectors()?;
    let sens = sized("sens", call.sens.take(), model.outputs().len())?;
    let inputs = point.len();
    let weights = (sens, vec![1.0; inputs]);
    let add = |sums: &mut [f64], _, member: usize, part| sums[member] += part;
    weighted(&app, &model, point, weights, add, inputs).await
}

async fn apply_jacobian(
    State(app): State<App>,
    caller: Caller,
    AnyBody(body): AnyBody,
) -> Result<Response, Refusal> {
    let mut call = Call::read(&body)?;
    let _turn = app.shares.evaluation(&caller.owner).await;
    let model = model_of(&app, &call).await?;
    let point = call.point(&model)?;
    call.check_vectors()?;
    let vec = sized("vec", call.vec.take(), point.len())?;
    let outputs = model.outputs().len();
    let add = |sums: &mut [f64], output: usize, _, part| sums[output] += part;
    weighted(&app, &model, point, (vec![1.0; outputs], vec), add, outputs).await
}

async fn apply_hessian(AnyBody(body): AnyBody) -> Result<Response, Refusal> {
    Call::read(&body)?;
    let message = "The model has no Hessian. Use differences of its gradient.";
    Err(Refusal::new(StatusCode::BAD_REQUEST, "UnsupportedFeature", message))
}
