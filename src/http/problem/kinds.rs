//! The types of problems. `kinds.txt` has their texts.

use std::collections::HashMap;
use std::sync::LazyLock;

use axum::http::StatusCode;

/// A problem type.
#[derive(Debug)]
pub struct Kind {
    /// The last part of the problem's `type`, and of the address of its page.
    pub slug: &'static str,
    /// The HTTP status of the answer.
    pub status: StatusCode,
}

/// The texts of each type, by its slug.
static TEXTS: LazyLock<HashMap<&str, [&str; 3]>> = LazyLock::new(|| {
    let entry = |entry: &'static str| {
        let mut lines = entry.lines().filter(|line| !line.is_empty());
        Some((lines.next()?, [lines.next()?, lines.next()?, lines.next()?]))
    };
    include_str!("kinds.txt").split("## ").filter_map(entry).collect()
});

impl Kind {
    /// The title, which is the same in every answer of this type. For the page of the type, its meaning and what to do.
    #[expect(clippy::expect_used, reason = "a test reads the texts of all types")]
    pub fn texts(&self) -> [&'static str; 3] {
        *TEXTS.get(self.slug).expect("the type has texts")
    }
}

macro_rules! kinds {
    ($($name:ident = $status:ident $slug:literal;)*) => {
        $(
            pub static $name: Kind = Kind { slug: $slug, status: StatusCode::$status };
        )*
        /// All problem types.
        pub static ALL: &[&Kind] = &[$(&$name),*];
    };
}

kinds! {
    INVALID_JSON = BAD_REQUEST "invalid-json";
    BAD_HOST = BAD_REQUEST "bad-host";
    SLOW_BODY = REQUEST_TIMEOUT "slow-body";
    NOT_FOUND = NOT_FOUND "not-found";
    UNAUTHORIZED = UNAUTHORIZED "unauthorized";
    SESSION_ENDED = UNAUTHORIZED "session-ended";
    FORBIDDEN = FORBIDDEN "forbidden";
    OTHER_OWNER = FORBIDDEN "other-owner";
    BAD_LINK = FORBIDDEN "bad-link";
    CROSS_SITE = FORBIDDEN "cross-site";
    UNKNOWN_RESULT = NOT_FOUND "unknown-result";
    NO_SUCH_PART = NOT_FOUND "no-such-part";
    UNKNOWN_HOST = MISDIRECTED_REQUEST "unknown-host";
    METHOD_NOT_ALLOWED = METHOD_NOT_ALLOWED "method-not-allowed";
    NOT_ACCEPTABLE = NOT_ACCEPTABLE "not-acceptable";
    NOT_FINISHED = CONFLICT "not-finished";
    STILL_GOING = CONFLICT "still-going";
    PINNED = CONFLICT "pinned";
    PIN_QUOTA = CONFLICT "pin-quota";
    JOB_FAILED = CONFLICT "job-failed";
    JOB_CANCELED = CONFLICT "job-canceled";
    EVICTED = GONE "evicted";
    NOTE_CHANGED = PRECONDITION_FAILED "note-changed";
    BODY_TOO_LARGE = PAYLOAD_TOO_LARGE "body-too-large";
    UNSUPPORTED_MEDIA_TYPE = UNSUPPORTED_MEDIA_TYPE "unsupported-media-type";
    UNSUPPORTED_CODING = UNSUPPORTED_MEDIA_TYPE "unsupported-content-encoding";
    INVALID_REQUEST = UNPROCESSABLE_ENTITY "invalid-request";
    INVALID_PARAMETERS = UNPROCESSABLE_ENTITY "invalid-parameters";
    UNREADABLE_FILE = UNPROCESSABLE_ENTITY "unreadable-file";
    TOO_EXPENSIVE = UNPROCESSABLE_ENTITY "too-expensive";
    KEY_REUSED = UNPROCESSABLE_ENTITY "idempotency-key-reused";
    RATE_LIMITED = TOO_MANY_REQUESTS "rate-limited";
    TOO_MANY_AT_ONCE = TOO_MANY_REQUESTS "too-many-at-once";
    INTERNAL = INTERNAL_SERVER_ERROR "internal";
    DAMAGED = INTERNAL_SERVER_ERROR "database-damaged";
    QUEUE_FULL = SERVICE_UNAVAILABLE "queue-full";
    NOT_READY = SERVICE_UNAVAILABLE "not-ready";
    DRAINING = SERVICE_UNAVAILABLE "draining";
    MEMORY_FULL = SERVICE_UNAVAILABLE "memory-full";
    EVALUATIONS_FULL = SERVICE_UNAVAILABLE "evaluations-full";
    BUSY = SERVICE_UNAVAILABLE "busy";
    NOT_CACHED = GATEWAY_TIMEOUT "not-cached";
    DISK_FULL = INSUFFICIENT_STORAGE "disk-full";
    WORKER_LOST = INTERNAL_SERVER_ERROR "worker-lost";
    TIME_LIMIT = INTERNAL_SERVER_ERROR "time-limit";
    NOT_STORED = INTERNAL_SERVER_ERROR "not-stored";
    PANICKED = INTERNAL_SERVER_ERROR "panicked";
    UNREADABLE_TASK = INTERNAL_SERVER_ERROR "unreadable-task";
}
