//! How much one caller may ask for: so many requests a minute, so many at work at a time.

use std::num::NonZeroU32;
use std::sync::Arc;

use axum::body::Body;
use axum::http::{HeaderMap, HeaderName, HeaderValue};
use governor::clock::{Clock as _, DefaultClock};
use governor::middleware::StateInformationMiddleware;
use governor::state::{InMemoryState, NotKeyed};
use governor::{Quota, RateLimiter};
use http_body_util::BodyExt as _;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::problem::{self, Problem};

const POLICY: HeaderName = HeaderName::from_static("ratelimit-policy");
const STATE: HeaderName = HeaderName::from_static("ratelimit");

/// What callers may ask for; none is no limit.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Limits {
    /// Requests a minute. As many may come at once; then they are given back evenly.
    pub per_minute: Option<NonZeroU32>,
    /// Requests at work at the same time, up to the last byte of their answers.
    pub at_once: Option<NonZeroU32>,
}

type Bucket = RateLimiter<NotKeyed, InMemoryState, DefaultClock, StateInformationMiddleware>;

/// What one caller has taken of its limits.
#[derive(Debug)]
pub struct Account {
    pub limits: Limits,
    bucket: Option<Bucket>,
    places: Option<Arc<Semaphore>>,
}

/// What is left of a caller's requests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Standing {
    /// Of so many a minute.
    quota: NonZeroU32,
    /// So many may come at once.
    pub left: u32,
    /// In so many seconds there is at least one more.
    more_in: u32,
}

/// A request that is within the limits, as long as it is kept.
#[derive(Debug, Default)]
pub struct Place {
    pub standing: Option<Standing>,
    permit: Option<OwnedSemaphorePermit>,
}

impl Account {
    pub fn new(limits: Limits) -> Self {
        let bucket = |quota| {
            RateLimiter::direct(Quota::per_minute(quota))
                .with_middleware::<StateInformationMiddleware>()
        };
        let places = limits.at_once.map(|most| Arc::new(Semaphore::new(most.get() as usize)));
        Self { limits, bucket: limits.per_minute.map(bucket), places }
    }

    /// Takes one request from what there is.
    pub fn take(&self) -> Result<Place, Problem> {
        let permit = match &self.places {
            None => None,
            Some(places) => {
                let permit = Arc::clone(places).try_acquire_owned();
                Some(permit.map_err(|_| full(self.limits.at_once))?)
            }
        };
        let standing = match (&self.bucket, self.limits.per_minute) {
            (Some(bucket), Some(quota)) => Some(count(bucket, quota)?),
            _ => None,
        };
        Ok(Place { standing, permit })
    }
}

/// All places are taken. When one is free again nobody knows, so nobody is told: event streams have no
/// end of their own, and answers end when their readers do.
fn full(at_once: Option<NonZeroU32>) -> Problem {
    let most = at_once.map_or(0, NonZeroU32::get);
    let detail = format!(
        "All {most} requests that this key may have at work at the same time are at work, waits and \
         event streams among them. End some, or try again when some have ended; when that will be is not \
         known."
    );
    Problem::new(&problem::TOO_MANY_AT_ONCE, detail)
        .with_header(POLICY, format!("\"at-once\";q={most};qu=\"concurrent-requests\""))
        .with_header(STATE, "\"at-once\";r=0")
}

fn count(bucket: &Bucket, quota: NonZeroU32) -> Result<Standing, Problem> {
    match bucket.check() {
        Ok(state) => {
            // They are given back one by one.
            let more_in = 60_u32.div_ceil(quota.get());
            Ok(Standing { quota, left: state.remaining_burst_capacity(), more_in })
        }
        Err(refused) => {
            let wait = refused.wait_time_from(DefaultClock::default().now());
            let more_in = wait.as_secs_f64().ceil().max(1.0) as u32;
            let standing = Standing { quota, left: 0, more_in };
            let detail = format!("This key may send {quota} requests a minute, and has.");
            let problem = Problem::new(&problem::RATE_LIMITED, detail).retry_after(more_in);
            Err(standing.tell_in(problem))
        }
    }
}

impl Standing {
    /// As the IETF draft on RateLimit header fields writes it (draft-ietf-httpapi-ratelimit-headers): `t`
    /// is how long no more than `r` can be had.
    fn headers(self) -> [(HeaderName, String); 2] {
        let Self { quota, left, more_in } = self;
        [
            (POLICY, format!("\"minute\";q={quota};w=60")),
            (STATE, format!("\"minute\";r={left};t={more_in}")),
        ]
    }

    /// Says in a problem what is left.
    pub fn tell_in(self, problem: Problem) -> Problem {
        let headers = self.headers().into_iter();
        headers.fold(problem, |problem, (name, value)| problem.with_header(name, value))
    }

    /// Says in an answer what is left.
    pub fn tell(self, headers: &mut HeaderMap) {
        for (name, value) in self.headers() {
            // Numbers are always legal in a header.
            if let Ok(value) = HeaderValue::try_from(value) {
                headers.insert(name, value);
            }
        }
    }
}

impl Place {
    /// The same, without a word of it to the client: what is left is another's business.
    pub fn untold(self) -> Self {
        Self { standing: None, ..self }
    }

    /// A body that keeps the place until it has been sent or given up.
    pub fn hold(self, body: Body) -> Body {
        match self.permit {
            Some(permit) => Body::new(body.map_err(move |error| {
                // The closure goes when the body does, and the permit with it.
                let _held = &permit;
                error
            })),
            None => body,
        }
    }
}

#[cfg(test)]
mod tests {
    use axum::body::HttpBody as _;

    use super::*;

    #[test]
    fn as_many_as_are_said_to_be_left_are_let_in_and_then_none() {
        let account = Account::new(Limits { per_minute: NonZeroU32::new(30), at_once: None });
        let left = account.take().unwrap().standing.unwrap().left;
        assert_eq!(left, 29);
        for more in (0..left).rev() {
            assert_eq!(account.take().unwrap().standing.unwrap().left, more);
        }
        assert!(account.take().is_err());
    }

    #[test]
    fn a_place_is_free_again_when_its_body_is_gone() {
        let account = Account::new(Limits { per_minute: None, at_once: NonZeroU32::new(1) });
        let body = account.take().unwrap().hold(Body::from("text"));
        assert!(account.take().is_err());
        assert_eq!(body.size_hint().exact(), Some(4));
        drop(body);
        assert!(account.take().is_ok());
    }
}
