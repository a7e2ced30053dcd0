-- Bodies of results are compressed since this version. `size` stays the number of bytes of the JSON; `stored` is the
-- number of bytes that are kept. Older bodies stay as they are.
ALTER TABLE result ADD COLUMN stored INTEGER NOT NULL DEFAULT 0;
UPDATE result SET stored = size;
DROP TRIGGER a_body_takes_room;
DROP TRIGGER a_body_gives_room_back;
CREATE TRIGGER a_result_takes_room AFTER INSERT ON result WHEN new.evicted IS NULL BEGIN
    UPDATE room SET used = used + new.stored;
END;
CREATE TRIGGER a_result_changes_its_room AFTER UPDATE OF stored, evicted ON result BEGIN
    UPDATE room SET used = used + iif(new.evicted IS NULL, new.stored, 0)
        - iif(old.evicted IS NULL, old.stored, 0);
END;

-- The `numerics` version of the keys of all unfinished runs. A later version of the program gives them new keys.
ALTER TABLE room ADD COLUMN numerics INTEGER NOT NULL DEFAULT 1;

-- A job whose result was computed before it was stored has no run. SQLite cannot change a check, so the table is made
-- anew.
CREATE TABLE new_job (
    id              BLOB    NOT NULL PRIMARY KEY CHECK (length(id) = 16),
    owner           TEXT    NOT NULL,
    key             BLOB    NOT NULL CHECK (length(key) = 32),
    run             INTEGER REFERENCES run (id),
    -- These two and the times follow the run until the job has finished. What becomes of the run later does not
    -- change a job that left it.
    state           TEXT    NOT NULL
        CHECK (state IN ('queued', 'running', 'canceling', 'succeeded', 'failed', 'canceled')),
    attempt         INTEGER NOT NULL,
    origin          TEXT    NOT NULL CHECK (origin IN ('computed', 'coalesced', 'cached')),
    label           TEXT,
    tags            TEXT    NOT NULL,
    warnings        TEXT    NOT NULL,
    created         INTEGER NOT NULL,
    started         INTEGER,
    finished        INTEGER,
    priority        INTEGER NOT NULL DEFAULT 3 CHECK (priority BETWEEN 0 AND 7),
    idempotency_key TEXT,
    fingerprint     BLOB,
    changes         TEXT    NOT NULL DEFAULT '',
    submitted       TEXT,
    CHECK ((finished IS NULL) = (state IN ('queued', 'running', 'canceling'))),
    CHECK (run IS NULL OR origin <> 'cached'),
    CHECK (run IS NOT NULL OR state = 'succeeded')
) STRICT, WITHOUT ROWID;
INSERT INTO new_job
SELECT id, owner, key, run, state, attempt, origin, label, tags, warnings, created, started, finished, priority,
    idempotency_key, fingerprint, changes, submitted
FROM job;
-- Its own triggers and indexes go with it.
DROP TRIGGER jobs_follow_their_run;
DROP TABLE job;
ALTER TABLE new_job RENAME TO job;
CREATE INDEX job_run ON job (run) WHERE run IS NOT NULL;
CREATE INDEX job_key ON job (key, id);
CREATE INDEX job_owner ON job (owner, id);
CREATE INDEX job_label ON job (label, id) WHERE label IS NOT NULL;
CREATE UNIQUE INDEX job_idempotency ON job (owner, idempotency_key) WHERE idempotency_key IS NOT NULL;
-- Most jobs have succeeded, and a list of them needs no index.
CREATE INDEX job_state ON job (state, id) WHERE state <> 'succeeded';
CREATE TRIGGER jobs_follow_their_run AFTER UPDATE OF state, attempt ON run BEGIN
    UPDATE job SET state = new.state, attempt = new.attempt,
        started = max(new.started, created), finished = new.finished,
        changes = changes || char(10) || new.state || ' ' || new.attempt || ' ' || new.changed
    WHERE run = new.id AND finished IS NULL;
END;
CREATE TRIGGER tags_come_with_their_job AFTER INSERT ON job WHEN new.tags <> '[]' BEGIN
    INSERT INTO job_tag SELECT value, new.id FROM json_each(new.tags);
END;
CREATE TRIGGER tags_go_with_their_job AFTER DELETE ON job WHEN old.tags <> '[]' BEGIN
    DELETE FROM job_tag
    WHERE job = old.id AND tag IN (SELECT value FROM json_each(old.tags));
END;
