//! Rate limits of one key: requests and evaluations per minute, and concurrent requests.

use std::num::NonZeroU32;
use std::sync::Arc;

use axum::body::Body;
use axum::http::{HeaderMap, HeaderName};
use governor::RateLimiter;
use governor::clock::{Clock as _, DefaultClock};
use governor::middleware::StateInformationMiddleware;
use governor::state::{InMemoryState, NotKeyed};
use http_body_util::BodyExt as _;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::needs::Quota;
use crate::http::problem::{Problem, Result, kinds};
use crate::http::wire::ascii;

const POLICY: HeaderName = HeaderName::from_static("ratelimit-policy");
const STATE: HeaderName = HeaderName::from_static("ratelimit");

/// The limits of one key; `None` is no limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Limits {
    /// Requests per minute. All of them may arrive at once; the quota then refills evenly.
    pub per_minute: Option<NonZeroU32>,
    /// Evaluations per minute. They do not count against `per_minute`.
    pub evaluations: Option<NonZeroU32>,
    /// Concurrent requests. A request ends with the last byte of its answer.
    pub at_once: Option<NonZeroU32>,
}

type Bucket = RateLimiter<NotKeyed, InMemoryState, DefaultClock, StateInformationMiddleware>;

/// The current use of the limits of one key.
pub struct Account {
    pub limits: Limits,
    requests: Option<Bucket>,
    evaluations: Option<Bucket>,
    /// One permit for each concurrent request, and the number of all permits.
    concurrent: Option<(Arc<Semaphore>, NonZeroU32)>,
}

/// The state of one quota of a key, for the `RateLimit` headers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Standing {
    /// The name of the quota in the headers.
    policy: &'static str,
    /// Calls per minute.
    per_minute: NonZeroU32,
    /// Number of calls that the key may send now.
    pub left: u32,
    /// Seconds until at least one more call is allowed.
    more_in: u32,
}

/// A request within the limits. It counts as concurrent until this is dropped.
#[derive(Debug, Default)]
pub struct OpenRequest {
    pub standing: Option<Standing>,
    permit: Option<OwnedSemaphorePermit>,
}

impl Account {
    pub fn new(limits: Limits) -> Self {
        let bucket = |per_minute| {
            RateLimiter::direct(governor::Quota::per_minute(per_minute))
                .with_middleware::<StateInformationMiddleware>()
        };
        let permits = |most: NonZeroU32| (Arc::new(Semaphore::new(most.get() as usize)), most);
        Self {
            limits,
            requests: limits.per_minute.map(bucket),
            evaluations: limits.evaluations.map(bucket),
            concurrent: limits.at_once.map(permits),
        }
    }

    /// Counts a request against its quota, or refuses it. A request without a quota always passes.
    pub fn take(&self, quota: Option<Quota>) -> Result<OpenRequest> {
        let Some(quota) = quota else { return Ok(OpenRequest::default()) };
        let acquire = |(permits, most): &(Arc<Semaphore>, NonZeroU32)| {
            Arc::clone(permits).try_acquire_owned().map_err(|_| full(*most))
        };
        let permit = self.concurrent.as_ref().map(acquire).transpose()?;
        let (bucket, policy, calls) = match quota {
            Quota::Requests => (&self.requests, "minute", "requests"),
            Quota::Evaluations => (&self.evaluations, "evaluations", "evaluations"),
        };
        let standing = bucket.as_ref().map(|bucket| count(bucket, policy, calls)).transpose()?;
        Ok(OpenRequest { standing, permit })
    }
}

/// The problem for too many concurrent requests. It has no `Retry-After`, because the server cannot know when another
/// request of the key ends: an event stream lasts as long as its job, and an answer until its client has read it.
fn full(most: NonZeroU32) -> Problem {
    let detail = format!(
        "This access key has reached its limit of {most} concurrent requests. Requests that wait and event streams \
         count. End one of them, or try again later."
    );
    Problem::new(&kinds::TOO_MANY_AT_ONCE, detail)
        .with_header(POLICY, format!("\"at-once\";q={most};qu=\"concurrent-requests\""))
        .with_header(STATE, "\"at-once\";r=0")
}

fn count(bucket: &Bucket, policy: &'static str, calls: &str) -> Result<Standing> {
    match bucket.check() {
        Ok(state) => {
            let per_minute = state.quota().burst_size();
            // The quota refills one request at a time.
            let more_in = 60_u32.div_ceil(per_minute.get());
            Ok(Standing { policy, per_minute, left: state.remaining_burst_capacity(), more_in })
        }
        Err(refused) => {
            let per_minute = refused.quota().burst_size();
            let wait = refused.wait_time_from(DefaultClock::default().now());
            let more_in = wait.as_secs_f64().ceil().max(1.0) as u32;
            let standing = Standing { policy, per_minute, left: 0, more_in };
            let detail = format!(
                "This access key has reached its limit of {per_minute} {calls} per minute. Try again later."
            );
            let problem = Problem::new(&kinds::RATE_LIMITED, detail).retry_after(more_in);
            Err(standing.tell_in(problem))
        }
    }
}

impl Standing {
    /// The headers of the IETF draft on RateLimit header fields (draft-ietf-httpapi-ratelimit-headers):
    /// `r` requests remain for `t` seconds.
    fn headers(self) -> [(HeaderName, String); 2] {
        let Self { policy, per_minute, left, more_in } = self;
        [
            (POLICY, format!("\"{policy}\";q={per_minute};w=60")),
            (STATE, format!("\"{policy}\";r={left};t={more_in}")),
        ]
    }

    /// Adds the `RateLimit` headers to a problem.
    pub fn tell_in(self, problem: Problem) -> Problem {
        let headers = self.headers().into_iter();
        headers.fold(problem, |problem, (name, value)| problem.with_header(name, value))
    }

    /// Adds the `RateLimit` headers to an answer.
    pub fn tell(self, headers: &mut HeaderMap) {
        for (name, value) in self.headers() {
            headers.insert(name, ascii(&value));
        }
    }
}

impl OpenRequest {
    /// The same without the state of the quota. The answer must not show it, because the caller does not own the key.
    pub fn untold(self) -> Self {
        Self { standing: None, ..self }
    }

    /// Wraps the body of the answer. The request counts as concurrent until that body was sent or dropped.
    pub fn hold(self, body: Body) -> Body {
        let Some(permit) = self.permit else { return body };
        Body::new(body.map_err(move |error| {
            // The body owns this closure, and the closure owns the permit.
            let _held = &permit;
            error
        }))
    }
}

#[cfg(test)]
mod tests {
    use axum::body::HttpBody as _;

    use super::*;

    #[test]
    fn a_caller_can_send_exactly_the_reported_remaining_requests() {
        let account = Account::new(Limits { per_minute: NonZeroU32::new(30), ..Limits::default() });
        let left = account.take(Some(Quota::Requests)).unwrap().standing.unwrap().left;
        assert_eq!(left, 29);
        for more in (0..left).rev() {
            assert_eq!(account.take(Some(Quota::Requests)).unwrap().standing.unwrap().left, more);
        }
        assert!(account.take(Some(Quota::Requests)).is_err());
    }

    #[test]
    fn evaluations_and_other_requests_have_separate_limits() {
        let (per_minute, evaluations) = (NonZeroU32::new(1), NonZeroU32::new(2));
        let account = Account::new(Limits { per_minute, evaluations, at_once: None });
        assert!(account.take(Some(Quota::Requests)).is_ok());
        assert!(account.take(Some(Quota::Requests)).is_err());
        for left in [1, 0] {
            let standing = account.take(Some(Quota::Evaluations)).unwrap().standing.unwrap();
            assert_eq!(standing.headers()[1].1, format!("\"evaluations\";r={left};t=30"));
        }
        assert!(account.take(Some(Quota::Evaluations)).is_err());
    }

    #[test]
    fn a_request_counts_as_concurrent_until_its_body_is_dropped() {
        let account = Account::new(Limits { at_once: NonZeroU32::new(1), ..Limits::default() });
        let body = account.take(Some(Quota::Requests)).unwrap().hold(Body::from("text"));
        assert!(account.take(Some(Quota::Requests)).is_err());
        assert_eq!(body.size_hint().exact(), Some(4));
        drop(body);
        assert!(account.take(Some(Quota::Requests)).is_ok());
    }
}
