-- One submission is a job; jobs with the same key share one run; a finished run leaves one result.
-- Times are milliseconds since 1970. Keys are SHA-256 digests. A row is unfinished while `finished`
-- is null, and the partial indexes below hold only those rows, so they stay small for ever.

-- One computation of a key.
CREATE TABLE run (
    id         INTEGER PRIMARY KEY,
    key        BLOB    NOT NULL CHECK (length(key) = 32),
    task       TEXT    NOT NULL,
    owner      TEXT    NOT NULL,
    state      TEXT    NOT NULL
        CHECK (state IN ('queued', 'running', 'canceling', 'succeeded', 'failed', 'canceled')),
    -- Claims so far. Completion is fenced by it, so it never goes back.
    attempt    INTEGER NOT NULL DEFAULT 0,
    -- How often the process died while this was running.
    lost       INTEGER NOT NULL DEFAULT 0,
    progress   REAL    NOT NULL DEFAULT 0 CHECK (progress BETWEEN 0 AND 1),
    created    INTEGER NOT NULL,
    started    INTEGER,
    finished   INTEGER,
    error_kind TEXT,
    error      TEXT,
    CHECK ((finished IS NULL) = (state IN ('queued', 'running', 'canceling'))),
    CHECK ((error_kind IS NOT NULL) = (state = 'failed')),
    CHECK ((error IS NOT NULL) = (state = 'failed'))
) STRICT;

-- At most one run of a key can be joined; a run being canceled is not among them.
CREATE UNIQUE INDEX run_live ON run (key) WHERE state IN ('queued', 'running');
CREATE INDEX run_unfinished ON run (state, id) WHERE finished IS NULL;

-- One submission. Its id is a UUID of version 7, so the primary key orders jobs by time.
CREATE TABLE job (
    id       BLOB    NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    owner    TEXT    NOT NULL,
    key      BLOB    NOT NULL CHECK (length(key) = 32),
    run      INTEGER REFERENCES run (id),
    -- These two and the times follow the run until the job has finished: lists filter by an index,
    -- and what becomes of the run later does not change a job that left it.
    state    TEXT    NOT NULL
        CHECK (state IN ('queued', 'running', 'canceling', 'succeeded', 'failed', 'canceled')),
    attempt  INTEGER NOT NULL,
    origin   TEXT    NOT NULL CHECK (origin IN ('computed', 'coalesced', 'cached')),
    label    TEXT,
    tags     TEXT    NOT NULL,
    warnings TEXT    NOT NULL,
    created  INTEGER NOT NULL,
    started  INTEGER,
    finished INTEGER,
    CHECK ((finished IS NULL) = (state IN ('queued', 'running', 'canceling'))),
    CHECK ((run IS NULL) = (origin = 'cached'))
) STRICT, WITHOUT ROWID;

CREATE INDEX job_live ON job (run) WHERE finished IS NULL;
-- Part of the statement that changes the run, so that the two cannot disagree. A job that joined a
-- running run began to wait only when it was made.
CREATE TRIGGER jobs_follow_their_run AFTER UPDATE OF state, attempt ON run BEGIN
    UPDATE job SET state = new.state, attempt = new.attempt,
        started = max(new.started, created), finished = new.finished
    WHERE run = new.id AND finished IS NULL;
END;

CREATE INDEX job_state ON job (state, id);
CREATE INDEX job_key ON job (key, id);
CREATE INDEX job_owner ON job (owner, id);
CREATE INDEX job_label ON job (label, id) WHERE label IS NOT NULL;

-- What a key came to. The body lies apart, so that summaries are read without it.
CREATE TABLE result (
    key     BLOB    NOT NULL PRIMARY KEY CHECK (length(key) = 32),
    summary TEXT    NOT NULL,
    -- SHA-256 of the body: a recompute is compared with it.
    digest  BLOB    NOT NULL CHECK (length(digest) = 32),
    size    INTEGER NOT NULL,
    created INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

-- Bodies are far larger than a page is wide, hence a rowid table.
CREATE TABLE result_blob (
    key  BLOB NOT NULL PRIMARY KEY REFERENCES result (key) ON DELETE CASCADE,
    body BLOB NOT NULL
) STRICT;
