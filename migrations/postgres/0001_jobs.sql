-- The tables of several servers. They have the names and meanings of those for SQLite. There are no triggers: each verb
-- changes all that belongs together. Times are milliseconds since 1970 by the clock of the database. Keys are SHA-256
-- digests. Numbers that SQLite calls INTEGER are BIGINT.

-- The time at which the transaction began.
CREATE FUNCTION moment() RETURNS BIGINT LANGUAGE sql STABLE
    RETURN (extract(epoch FROM now()) * 1000)::BIGINT;

-- One computation of a key.
CREATE TABLE run (
    -- Never used again, because completion is fenced by it.
    id         BIGINT  GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    key        BYTEA   NOT NULL CHECK (octet_length(key) = 32),
    task       TEXT    NOT NULL,
    owner      TEXT    COLLATE "C" NOT NULL,
    -- The `numerics` version of the key. Workers of another version do not claim the run.
    numerics   BIGINT  NOT NULL,
    state      TEXT    NOT NULL
        CHECK (state IN ('queued', 'running', 'canceling', 'succeeded', 'failed', 'canceled')),
    -- Claims so far. Completion is fenced by it, so it never goes back.
    attempt    BIGINT  NOT NULL DEFAULT 0,
    -- Claims that no worker has ended. It is counted at the claim, because a run that kills its node never reports.
    lost       BIGINT  NOT NULL DEFAULT 0,
    -- The progress at which it failed. That of a running run is in `lease`, that of a study in `study`.
    progress   DOUBLE PRECISION NOT NULL DEFAULT 0 CHECK (progress BETWEEN 0 AND 1),
    created    BIGINT  NOT NULL,
    started    BIGINT,
    finished   BIGINT,
    changed    BIGINT  NOT NULL,
    error_kind TEXT,
    error      TEXT,
    trace      TEXT,
    warnings   TEXT,
    recomputed TEXT    CHECK (recomputed IN ('same', 'differs', 'replaced')),
    CHECK ((finished IS NULL) = (state IN ('queued', 'running', 'canceling'))),
    CHECK ((error_kind IS NOT NULL) = (state = 'failed')),
    CHECK ((error IS NOT NULL) = (state = 'failed'))
) WITH (fillfactor = 90);
-- At most one run of a key can be joined. This index decides between servers that submit the same key.
CREATE UNIQUE INDEX run_live ON run (key) WHERE state IN ('queued', 'running');
CREATE INDEX run_queued ON run (created) WHERE state = 'queued';

-- One submission. Its id is a UUID of version 7, so the primary key orders jobs by time.
CREATE TABLE job (
    id              BYTEA   NOT NULL PRIMARY KEY CHECK (octet_length(id) = 16),
    owner           TEXT    COLLATE "C" NOT NULL,
    key             BYTEA   NOT NULL CHECK (octet_length(key) = 32),
    run             BIGINT  REFERENCES run (id),
    -- These two and the times follow the run until the job has finished.
    state           TEXT    NOT NULL
        CHECK (state IN ('queued', 'running', 'canceling', 'succeeded', 'failed', 'canceled')),
    attempt         BIGINT  NOT NULL,
    origin          TEXT    NOT NULL CHECK (origin IN ('computed', 'coalesced', 'cached')),
    label           TEXT    COLLATE "C",
    tags            TEXT    NOT NULL,
    warnings        TEXT    NOT NULL,
    created         BIGINT  NOT NULL,
    started         BIGINT,
    finished        BIGINT,
    priority        BIGINT  NOT NULL CHECK (priority BETWEEN 0 AND 7),
    idempotency_key TEXT    COLLATE "C",
    fingerprint     BYTEA,
    -- One line per change of state: state, attempt, time.
    changes         TEXT    NOT NULL,
    -- The `numerics` version of the workers that can claim its run or a piece of it; null if there is nothing to claim.
    claimable       BIGINT,
    -- Whether its run is a study.
    study           BOOLEAN NOT NULL,
    submitted       TEXT,
    CHECK ((finished IS NULL) = (state IN ('queued', 'running', 'canceling'))),
    CHECK (run IS NULL OR origin <> 'cached'),
    CHECK (run IS NOT NULL OR state = 'succeeded'),
    CHECK (claimable IS NULL OR state IN ('queued', 'running'))
) WITH (fillfactor = 90, autovacuum_vacuum_scale_factor = 0.05);
CREATE INDEX job_run ON job (run) WHERE run IS NOT NULL;
CREATE INDEX job_key ON job (key, id);
CREATE INDEX job_owner ON job (owner, id);
CREATE INDEX job_label ON job (label, id) WHERE label IS NOT NULL;
CREATE UNIQUE INDEX job_idempotency ON job (owner, idempotency_key) WHERE idempotency_key IS NOT NULL;
CREATE INDEX job_state ON job (state, id) WHERE state <> 'succeeded';
CREATE INDEX job_queued ON job (owner) WHERE state = 'queued';
-- The queue: the owners with work are found by skipping from one to the next.
CREATE INDEX job_claimable ON job (claimable, owner, priority, study, id) WHERE claimable IS NOT NULL;

CREATE TABLE job_tag (
    tag TEXT  COLLATE "C" NOT NULL,
    job BYTEA NOT NULL REFERENCES job (id) ON DELETE CASCADE,
    PRIMARY KEY (tag, job)
);
CREATE INDEX job_tag_job ON job_tag (job);

-- When an owner was last served. A larger number is a later turn.
CREATE TABLE turn (
    owner  TEXT   COLLATE "C" NOT NULL PRIMARY KEY,
    served BIGINT NOT NULL
) WITH (fillfactor = 70);

-- What workers compute now. A lease that is not renewed in time is lost. Renewals and progress change no indexed column.
CREATE TABLE lease (
    run      BIGINT NOT NULL,
    -- The piece of a study; -1 for a whole run.
    number   BIGINT NOT NULL,
    attempt  BIGINT NOT NULL,
    node     TEXT   NOT NULL,
    -- The owner in whose turn it was claimed.
    owner    TEXT   COLLATE "C" NOT NULL,
    expires  BIGINT NOT NULL,
    progress DOUBLE PRECISION NOT NULL DEFAULT 0,
    PRIMARY KEY (run, number)
) WITH (fillfactor = 70, autovacuum_vacuum_scale_factor = 0.05);
CREATE INDEX lease_owner ON lease (owner);

-- A run whose work is divided into chunks. Its row is the lock of all changes of its pieces.
CREATE TABLE study (
    run     BIGINT NOT NULL PRIMARY KEY,
    chunks  BIGINT NOT NULL CHECK (chunks > 0),
    -- The first piece that was never claimed; how many pieces wait again, are running and are done.
    next    BIGINT NOT NULL DEFAULT 0,
    queued  BIGINT NOT NULL DEFAULT 0,
    running BIGINT NOT NULL DEFAULT 0,
    done    BIGINT NOT NULL DEFAULT 0,
    -- How often nodes died since the last finished chunk.
    lost    BIGINT NOT NULL DEFAULT 0,
    wall    DOUBLE PRECISION NOT NULL DEFAULT 0,
    cpu     DOUBLE PRECISION DEFAULT 0,
    CHECK (next <= chunks + 1 AND queued >= 0 AND running >= 0)
) WITH (fillfactor = 70);

-- The pieces that were ever claimed. The number `chunks` is the assembly.
CREATE TABLE chunk (
    run      BIGINT NOT NULL REFERENCES study (run),
    number   BIGINT NOT NULL CHECK (number >= 0),
    state    TEXT   NOT NULL CHECK (state IN ('queued', 'running', 'done')),
    attempt  BIGINT NOT NULL CHECK (attempt > 0),
    -- Claims that no worker has ended.
    lost     BIGINT NOT NULL DEFAULT 0,
    body     BYTEA,
    checksum BIGINT,
    PRIMARY KEY (run, number),
    CHECK ((body IS NOT NULL) = (state = 'done')),
    CHECK ((checksum IS NOT NULL) = (state = 'done'))
);
-- Bodies are compressed before they are stored.
ALTER TABLE chunk ALTER COLUMN body SET STORAGE EXTERNAL;
CREATE INDEX chunk_queued ON chunk (run, lost, number) WHERE state = 'queued';

-- A version of the program on a machine.
CREATE TABLE program (
    id           BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    version      TEXT   NOT NULL,
    numerics     BIGINT NOT NULL,
    host         TEXT   NOT NULL,
    architecture TEXT   NOT NULL,
    processors   BIGINT NOT NULL,
    UNIQUE (version, numerics, host, architecture, processors)
);

-- The result of a key. The body may be evicted.
CREATE TABLE result (
    key           BYTEA   NOT NULL PRIMARY KEY CHECK (octet_length(key) = 32),
    summary       TEXT    NOT NULL,
    -- SHA-256 of the JSON.
    digest        BYTEA   NOT NULL CHECK (octet_length(digest) = 32),
    -- Bytes of the JSON, and bytes that are stored.
    size          BIGINT  NOT NULL,
    stored        BIGINT  NOT NULL,
    created       BIGINT  NOT NULL,
    computed      BIGINT,
    last_access   BIGINT  NOT NULL,
    pinned        BOOLEAN NOT NULL DEFAULT FALSE,
    pinned_by     TEXT    COLLATE "C",
    -- XXH3 of the stored bytes.
    checksum      BIGINT  NOT NULL,
    evicted       BIGINT,
    deleted_by    TEXT,
    owner         TEXT    COLLATE "C",
    wall          DOUBLE PRECISION,
    cpu           DOUBLE PRECISION,
    program       BIGINT  REFERENCES program (id),
    job           BYTEA,
    trace         TEXT,
    warnings      TEXT,
    imported      BIGINT,
    imported_from TEXT
) WITH (fillfactor = 90);
CREATE INDEX result_unread ON result (last_access) WHERE NOT pinned AND evicted IS NULL;
CREATE INDEX result_stored ON result (stored) WHERE evicted IS NULL;
CREATE INDEX result_evicted ON result (evicted) WHERE evicted IS NOT NULL;
CREATE INDEX result_pinned_by ON result (pinned_by) INCLUDE (stored) WHERE pinned;

CREATE TABLE result_blob (
    key  BYTEA NOT NULL PRIMARY KEY REFERENCES result (key) ON DELETE CASCADE,
    body BYTEA NOT NULL
);
ALTER TABLE result_blob ALTER COLUMN body SET STORAGE EXTERNAL;

CREATE TABLE result_task (
    id   BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    key  BYTEA  NOT NULL UNIQUE REFERENCES result (key) ON DELETE CASCADE,
    task TEXT   NOT NULL
);

CREATE TABLE note (
    key   BYTEA  NOT NULL PRIMARY KEY REFERENCES result (key) ON DELETE CASCADE,
    text  TEXT   NOT NULL,
    owner TEXT   COLLATE "C" NOT NULL,
    at    BIGINT NOT NULL
);

-- What results are searched by. Times and sizes are compared with bounds of the same type.
CREATE TABLE outline (
    id                   BIGINT  NOT NULL PRIMARY KEY REFERENCES result_task (id) ON DELETE CASCADE,
    created              DOUBLE PRECISION NOT NULL,
    size                 DOUBLE PRECISION NOT NULL,
    present              BOOLEAN NOT NULL,
    owner                TEXT    COLLATE "C",
    kind                 TEXT,
    shape                TEXT,
    method               TEXT,
    regime               TEXT,
    held                 TEXT,
    motion               TEXT,
    friction             DOUBLE PRECISION,
    normal_modulus       DOUBLE PRECISION,
    tangential_modulus   DOUBLE PRECISION,
    wear_coefficient     DOUBLE PRECISION,
    radius               DOUBLE PRECISION,
    slope_angle          DOUBLE PRECISION,
    flat_radius          DOUBLE PRECISION,
    exponent             DOUBLE PRECISION,
    normal_force         DOUBLE PRECISION,
    indentation_depth    DOUBLE PRECISION,
    contact_radius       DOUBLE PRECISION,
    stick_radius         DOUBLE PRECISION,
    amplitude            DOUBLE PRECISION,
    gross_slip_amplitude DOUBLE PRECISION,
    tangential_force     DOUBLE PRECISION,
    rig_stiffness        DOUBLE PRECISION,
    points               DOUBLE PRECISION,
    cycles               DOUBLE PRECISION,
    wear_volume          DOUBLE PRECISION,
    wear_depth           DOUBLE PRECISION,
    scar_radius          DOUBLE PRECISION,
    dissipated_energy    DOUBLE PRECISION
);
-- In the order of the usual list, the newest first.
CREATE INDEX outline_created ON outline (created DESC NULLS LAST, id DESC) WHERE present;
CREATE INDEX outline_owner ON outline (owner, created DESC NULLS LAST, id DESC) WHERE present;
CREATE INDEX outline_absent ON outline (created DESC NULLS LAST, id DESC) WHERE NOT present;

CREATE TABLE access_key (
    id         TEXT   COLLATE "C" NOT NULL PRIMARY KEY,
    name       TEXT   NOT NULL,
    role       TEXT   NOT NULL CHECK (role IN ('read', 'submit', 'admin')),
    digest     BYTEA  NOT NULL CHECK (octet_length(digest) = 32),
    per_minute BIGINT,
    created    BIGINT NOT NULL,
    expires    BIGINT,
    revoked    BIGINT,
    last_used  BIGINT
);

CREATE TABLE link_secret (
    id     BIGINT PRIMARY KEY CHECK (id = 1),
    secret BYTEA  NOT NULL CHECK (octet_length(secret) = 32)
);

CREATE TABLE audit (
    id      BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY,
    first   BIGINT NOT NULL,
    last    BIGINT NOT NULL,
    times   BIGINT NOT NULL,
    act     TEXT   NOT NULL,
    actor   TEXT   NOT NULL,
    key     TEXT   NOT NULL,
    subject TEXT   NOT NULL,
    owner   TEXT   NOT NULL
);
CREATE UNIQUE INDEX audit_day ON audit (act, actor, key, subject, owner, (first / 86400000));

-- One row: the time by which ages are measured, and what a server overwrites to find out whether it can write.
CREATE TABLE upkeep (
    id    BIGINT PRIMARY KEY CHECK (id = 1),
    clock BIGINT NOT NULL,
    probe BIGINT NOT NULL
) WITH (fillfactor = 50);
INSERT INTO upkeep (id, clock, probe) VALUES (1, moment(), moment());
