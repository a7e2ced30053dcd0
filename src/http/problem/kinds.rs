//! The types of problems.

use axum::http::StatusCode;

/// A problem type.
#[derive(Debug)]
pub struct Kind {
    /// The last part of the problem's `type`, and of the address of its page.
    pub slug: &'static str,
    /// The HTTP status of the answer.
    pub status: StatusCode,
    /// The title, the same in every answer of this type.
    pub title: &'static str,
    /// The meaning, for the page of the type.
    pub meaning: &'static str,
    /// What to do, for the page of the type.
    pub remedy: &'static str,
}

macro_rules! kinds {
    ($($name:ident = $status:ident $slug:literal $title:literal $meaning:literal $remedy:literal;)*) => {
        $(
            #[doc = $title]
            pub static $name: Kind = Kind {
                slug: $slug,
                status: StatusCode::$status,
                title: $title,
                meaning: $meaning,
                remedy: $remedy,
            };
        )*
        /// All problem types.
        pub static ALL: &[&Kind] = &[$(&$name),*];
    };
}

kinds! {
    INVALID_JSON = BAD_REQUEST "invalid-json" "The body is not JSON"
        "The body of the request cannot be parsed as JSON. The detail names the line and the column."
        "Send one JSON document in UTF-8. JSON has no NaN, Infinity, comments or trailing commas.";
    BAD_HOST = BAD_REQUEST "bad-host" "The Host header is missing or repeated"
        "A request of HTTP/1.1 must have exactly one Host header (RFC 9112). Otherwise the server and a proxy \
         before it could read different addresses from the same request."
        "Send one Host header. All usual clients do.";
    SLOW_BODY = REQUEST_TIMEOUT "slow-body" "The body arrives too slowly"
        "The body of the request did not arrive in time. After ten seconds, the server waits only for a client \
         that sends at least 4 KiB per second."
        "Send the request again over a faster connection, or send a smaller body.";
    NOT_FOUND = NOT_FOUND "not-found" "Not found"
        "No route, job or document has this address."
        "Compare the address with the list of routes at /docs/api/. GET /v1/jobs lists jobs.";
    UNAUTHORIZED = UNAUTHORIZED "unauthorized" "A key is required"
        "This server requires a key. The request has none, or its key is unknown, expired or revoked."
        "Send your key as `Authorization: Bearer fretwork_…` (curl: `-H \"Authorization: Bearer \
         $FRETWORK_KEY\"`), or as the password of Basic authentication. The operator of the server makes \
         a key with `fretwork keys add NAME --role submit`.";
    FORBIDDEN = FORBIDDEN "forbidden" "The role of the key does not allow this"
        "A key with role `read` reads results and checks scenarios. `submit` also submits, cancels and \
         deletes jobs, pins results and makes links. `admin` also does this with the jobs of all owners."
        "Use a key with the role that the detail names. GET /v1/me returns the role of a key.";
    OTHER_OWNER = FORBIDDEN "other-owner" "The pin or the note belongs to another owner"
        "Only its owner and administrators can remove a pin, or change or remove a note."
        "Ask its owner, which the detail names, or an administrator.";
    BAD_LINK = FORBIDDEN "bad-link" "The link is not valid here"
        "A link opens one result for readers without a key. It ends when it expires, or when the key that \
         made it is revoked. This link is incomplete, belongs to another result, or has ended."
        "Ask its sender for a new link. POST /v1/results/{key}/links makes one.";
    CROSS_SITE = FORBIDDEN "cross-site" "A page of another site sent the request"
        "A browser sent the request for a web page of an origin that this server does not know."
        "The operator of the server can allow the origin of the page with --cors-origin. Behind a proxy \
         that changes the Host header, allow the origin of the server's own pages. Programs other than \
         browsers never get this problem.";
    UNKNOWN_RESULT = NOT_FOUND "unknown-result" "No result has this key"
        "This server has not computed this key. If a run is computing it, the Link header \
         (rel=\"related\") names its job."
        "Submit the scenario to POST /v1/jobs. The same scenario always has the same key. POST \
         /v1/scenarios returns the key of a scenario without a run.";
    NO_SUCH_PART = NOT_FOUND "no-such-part" "The result does not have this part"
        "A run has a history and may have profiles and loops. A study, such as a sweep, has a table and figures."
        "The detail names the parts of the result. GET /v1/results/{key} has all of them.";
    UNKNOWN_HOST = MISDIRECTED_REQUEST "unknown-host" "The server does not accept this host name"
        "A server without keys accepts only localhost or an IP address as `Host`. Otherwise any web page \
         could reach it through a browser on its machine, under a name of its own."
        "Use http://127.0.0.1 or http://localhost. The operator of the server can make keys (`fretwork \
         keys add`), or open it to everyone who can reach it (--no-auth).";
    METHOD_NOT_ALLOWED = METHOD_NOT_ALLOWED "method-not-allowed" "The address does not have this method"
        "The address exists, but not for the method of the request."
        "Use one of the methods in the Allow header of the answer.";
    NOT_ACCEPTABLE = NOT_ACCEPTABLE "not-acceptable" "The format is not available"
        "The request accepts no format in which the document is available."
        "The detail names the available formats. Choose one with the Accept header, or with ?format=, \
         which overrides the header.";
    NOT_FINISHED = CONFLICT "not-finished" "The job is not finished"
        "The request is for the result of a job that is not finished."
        "Try again after the seconds in Retry-After, or wait for the job: GET /v1/jobs/{id}?wait=10.";
    STILL_GOING = CONFLICT "still-going" "The job is not finished"
        "Only a finished job can be deleted."
        "Cancel the job first with POST /v1/jobs/{id}/cancel, or wait until it is finished.";
    PINNED = CONFLICT "pinned" "The result is pinned"
        "A pinned result cannot be deleted."
        "Unpin it with DELETE /v1/results/{key}/pin, then delete it.";
    PIN_QUOTA = CONFLICT "pin-quota" "Too many pinned results"
        "The results that one owner has pinned may take a limited part of the disk, and so may those of all owners, \
         because the server never evicts them."
        "Unpin results with DELETE /v1/results/{key}/pin; GET /v1/results?pinned_by=me lists them. The operator of \
         the server can raise the quota (--pin-quota, --keep-results).";
    JOB_FAILED = CONFLICT "job-failed" "The job failed"
        "The job ended with an error, so it has no result."
        "The `error` of the job gives the reason. Failures are not cached: a new submission computes again.";
    JOB_CANCELED = CONFLICT "job-canceled" "The job was canceled"
        "The job was canceled before it was finished, so it has no result."
        "To get the result, submit the scenario again.";
    EVICTED = GONE "evicted" "The result is no longer stored"
        "The result was computed here. Later it was deleted, or evicted to free disk space as the least \
         recently read one. `scenario` is its scenario, or `sweep`, `sensitivity`, `map` or `fit` its study."
        "POST `{\"scenario\": …}` with the `scenario` (or the study) of this answer to /v1/jobs. The result will have the \
         same key and the same numbers. PUT /v1/results/{key}/pin prevents eviction.";
    BODY_TOO_LARGE = PAYLOAD_TOO_LARGE "body-too-large" "The body is too large"
        "The body of a request may have at most 4 MiB, 10 000 objects and arrays, 50 000 members, 250 000 values \
         and 32 levels. The detail names the limit."
        "Remove rows from long tables (`profile`, `cycles`): 10 000 rows are enough for every shape. Submit a \
         large set of runs as many small jobs.";
    UNSUPPORTED_MEDIA_TYPE = UNSUPPORTED_MEDIA_TYPE "unsupported-media-type" "The Content-Type is not JSON"
        "The body of a request must be JSON, and its Content-Type must say so."
        "Send the header Content-Type: application/json. With curl: -H 'Content-Type: \
         application/json'.";
    UNSUPPORTED_CODING = UNSUPPORTED_MEDIA_TYPE "unsupported-content-encoding" "The body is compressed"
        "The request has a Content-Encoding. The server reads bodies only as they are."
        "Send the body without compression, and without the header Content-Encoding.";
    INVALID_REQUEST = UNPROCESSABLE_ENTITY "invalid-request" "The request has faults"
        "The body is JSON, but not a valid request. A member has a wrong type, an unknown name, a unit of a \
         wrong dimension or a value out of range. `errors` lists all faults, each with a JSON pointer \
         (RFC 6901) into the body."
        "Correct every member that `errors` names. GET /v1/schema/scenario is the schema, and GET \
         /v1/examples has valid bodies.";
    INVALID_PARAMETERS = UNPROCESSABLE_ENTITY "invalid-parameters" "A parameter has faults"
        "A query parameter is unknown or repeated, or a parameter or header has an invalid value. `errors` \
         names each of them."
        "Correct the parameters that `errors` names. It also says which values they accept.";
    TOO_EXPENSIVE = UNPROCESSABLE_ENTITY "too-expensive" "The run would take too long"
        "The estimated time of the run is longer than the limit of this server, or than the 20 ms of an evaluation \
         (POST /v1/evaluate) or the 30 s of derivatives."
        "Submit a job instead of an evaluation. Request fewer `points`, output cycles or profiles, an earlier last cycle, or a larger `tolerance`. POST \
         /v1/scenarios returns the `cost` of a scenario. The operator of the server can raise the limit \
         (--run-limit).";
    KEY_REUSED = UNPROCESSABLE_ENTITY "idempotency-key-reused" "The Idempotency-Key belongs to another submission"
        "An earlier submission with the same Idempotency-Key had another body. A repeated submission must \
         not differ."
        "Use a new Idempotency-Key for each new submission, for example a random UUID.";
    RATE_LIMITED = TOO_MANY_REQUESTS "rate-limited" "Too many requests"
        "The key has sent as many requests in this minute as its limit allows. The limits of other keys \
         are separate, and so is the limit of evaluations (POST /v1/evaluate)."
        "Continue after the seconds in Retry-After. The RateLimit header of each counted answer says how many \
         requests remain (r), and after how many seconds there is one more (t). Waiting for a job \
         (`Prefer: wait=10`) or following its events takes one request, and polling takes many. The \
         operator of the server can raise the limits (--rate-limit, --evaluate-rate, or `fretwork keys add --rate`).";
    TOO_MANY_AT_ONCE = TOO_MANY_REQUESTS "too-many-at-once" "Too many concurrent requests"
        "The key has as many concurrent requests as its limit allows. A request ends when its answer has \
         been read to the end; waits and event streams count until then."
        "Read or close open answers, then continue. The server cannot know when one ends, so there is no \
         Retry-After: try again at increasing intervals. The operator of the server can raise the limit \
         (--concurrency).";
    INTERNAL = INTERNAL_SERVER_ERROR "internal" "The server has a bug"
        "An error occurred that should be impossible. The server logged it with the request id in \
         `instance`."
        "The request may be valid: try once more. If it fails again, report it with the `instance`.";
    DAMAGED = INTERNAL_SERVER_ERROR "database-damaged" "The database is damaged"
        "A part of the database differs from what was stored in it, or cannot be read as a result. The cause is the \
         disk, or another program that wrote to it. The server returns no damaged data."
        "If the detail names a result, submit its scenario with `Cache-Control: no-cache`: the server then computes the \
         result again and repairs it. If the answer says `differs`, an administrator deletes the result first (DELETE \
         /v1/results/{key}). Otherwise the operator should stop the server, copy its data directory, and restore a \
         backup or recover the readable part (`.recover` of sqlite3).";
    QUEUE_FULL = SERVICE_UNAVAILABLE "queue-full" "The queue is full"
        "Too many jobs are queued. The server still accepts submissions whose result is known or is being \
         computed."
        "Submit again after the seconds in Retry-After. The operator of the server can allow a longer \
         queue (--queue-limit).";
    NOT_READY = SERVICE_UNAVAILABLE "not-ready" "The server is not ready"
        "The server answers but cannot accept jobs. The detail gives the reason."
        "Try again in a moment. If the problem continues, the operator should read the log of the server.";
    DRAINING = SERVICE_UNAVAILABLE "draining" "The server is shutting down"
        "The server finishes its running jobs and accepts no new ones."
        "Submit again after the seconds in Retry-After. All accepted jobs are kept.";
    MEMORY_FULL = SERVICE_UNAVAILABLE "memory-full" "The memory for large bodies is in use"
        "The memory for large bodies of requests and answers is limited, in total and for each caller. Answers use it \
         until their clients have read them. Small answers are not limited."
        "Read your other answers to the end, then send the request again after the seconds in Retry-After. The \
         operator of the server can allow more memory (--transfer-memory).";
    EVALUATIONS_FULL = SERVICE_UNAVAILABLE "evaluations-full" "Too many evaluations at the same time"
        "The server evaluates as many scenarios at a time as it has workers. Others wait for a quarter of a second."
        "Evaluate again after the seconds in Retry-After. The operator of the server can allow more workers \
         (--workers).";
    BUSY = SERVICE_UNAVAILABLE "busy" "The database is busy"
        "Another program, for example a backup, has locked the database for some seconds, or the database server \
         restarts."
        "Send the request again after the seconds in Retry-After.";
    NOT_CACHED = GATEWAY_TIMEOUT "not-cached" "The result is not known yet"
        "The request accepts only a known result (Cache-Control: only-if-cached), and this result is not \
         known. The server did not accept a job."
        "To compute the result, submit without that header.";
    DISK_FULL = INSUFFICIENT_STORAGE "disk-full" "The disk is full"
        "The server cannot store more data. It still returns known results."
        "The operator of the server must free disk space in its data directory. Then submit again.";
    WORKER_LOST = INTERNAL_SERVER_ERROR "worker-lost" "The server crashed repeatedly during the run"
        "The server process ended several times while it computed this run, so it does not try again. \
         This is the `error` of a job."
        "Report it with the scenario. A smaller run (fewer points or output cycles) may succeed.";
    TIME_LIMIT = INTERNAL_SERVER_ERROR "time-limit" "The run took too long"
        "The run reached the time limit of this server, which stopped it. This is the `error` of a job."
        "Request fewer `points` or output cycles, or a larger `tolerance`. The operator of the server can \
         raise the limit (--run-limit).";
    NOT_STORED = INTERNAL_SERVER_ERROR "not-stored" "The result could not be stored"
        "The run was computed, but the database repeatedly refused its result: a part of the database is \
         damaged. This is the `error` of a job."
        "The operator of the server should check its log and its database.";
    PANICKED = INTERNAL_SERVER_ERROR "panicked" "The computation stopped at a bug"
        "The engine has a bug that stopped this run. Other runs are not affected. This is the `error` of a \
         job."
        "Report it with the scenario of the job (`include=scenario`).";
    UNREADABLE_TASK = INTERNAL_SERVER_ERROR "unreadable-task" "The stored task cannot be read"
        "Another version of the program stored the task, and this version cannot read it. This is the \
         `error` of a job."
        "Submit the scenario again.";
}
