-- What a server needs that many share for years: priorities, retries of a submission, the changes
-- of state as they happened, and room that is given back.

-- 0 is the most urgent, 7 the least (RFC 9218).
ALTER TABLE job ADD COLUMN priority INTEGER NOT NULL DEFAULT 3 CHECK (priority BETWEEN 0 AND 7);
-- A submission that is repeated under its Idempotency-Key is the job it first made; the digest of
-- what was sent tells a repetition from a mistake.
ALTER TABLE job ADD COLUMN idempotency_key TEXT;
ALTER TABLE job ADD COLUMN fingerprint BLOB;
CREATE UNIQUE INDEX job_idempotency ON job (owner, idempotency_key) WHERE idempotency_key IS NOT NULL;
-- One line per change of state: state, attempt, time. They are the stored events of the job, named
-- by their place, and go with it.
ALTER TABLE job ADD COLUMN changes TEXT NOT NULL DEFAULT '';
UPDATE job SET changes = state || ' ' || attempt || ' ' || coalesce(finished, started, created);

-- When the state last changed: the jobs take it over.
ALTER TABLE run ADD COLUMN changed INTEGER NOT NULL DEFAULT 0;
UPDATE run SET changed = coalesce(finished, started, created);
-- The request that made it, so that its log lines can be found beside those of the request.
ALTER TABLE run ADD COLUMN trace TEXT;

DROP TRIGGER jobs_follow_their_run;
CREATE TRIGGER jobs_follow_their_run AFTER UPDATE OF state, attempt ON run BEGIN
    UPDATE job SET state = new.state, attempt = new.attempt,
        started = max(new.started, created), finished = new.finished,
        changes = changes || char(10) || new.state || ' ' || new.attempt || ' ' || new.changed
    WHERE run = new.id AND finished IS NULL;
END;
-- Whole, not only where unfinished: runs are deleted when their last job is.
DROP INDEX job_live;
CREATE INDEX job_run ON job (run) WHERE run IS NOT NULL;

-- Jobs by tag, newest last. Untagged jobs take no room here.
CREATE TABLE job_tag (
    tag TEXT NOT NULL,
    job BLOB NOT NULL,
    PRIMARY KEY (tag, job)
) STRICT, WITHOUT ROWID;
INSERT INTO job_tag SELECT tag.value, job.id FROM job, json_each(job.tags) AS tag;
CREATE TRIGGER tags_come_with_their_job AFTER INSERT ON job WHEN new.tags <> '[]' BEGIN
    INSERT INTO job_tag SELECT value, new.id FROM json_each(new.tags);
END;
CREATE TRIGGER tags_go_with_their_job AFTER DELETE ON job WHEN old.tags <> '[]' BEGIN
    DELETE FROM job_tag
    WHERE job = old.id AND tag IN (SELECT value FROM json_each(old.tags));
END;

-- Results are dropped when they take too much room, those first that nobody has read for longest.
ALTER TABLE result ADD COLUMN last_access INTEGER NOT NULL DEFAULT 0;
UPDATE result SET last_access = created;
ALTER TABLE result ADD COLUMN pinned INTEGER NOT NULL DEFAULT 0 CHECK (pinned IN (0, 1));
-- XXH3 of the body: what is read is held against it. A digest would take longer than the reading.
ALTER TABLE result ADD COLUMN checksum INTEGER;
-- When the body was dropped.
ALTER TABLE result ADD COLUMN evicted INTEGER;
CREATE INDEX result_unread ON result (last_access) WHERE NOT pinned AND evicted IS NULL;
CREATE INDEX result_evicted ON result (evicted) WHERE evicted IS NOT NULL;
-- What results were computed from: it stays when the body goes.
CREATE TABLE result_task (
    key  BLOB NOT NULL PRIMARY KEY REFERENCES result (key) ON DELETE CASCADE,
    task TEXT NOT NULL
) STRICT;
INSERT INTO result_task
SELECT result.key, run.task FROM result JOIN run ON run.key = result.key GROUP BY result.key;
-- One row: the size of all bodies there are, the last run there was, and when the server last found
-- that it can write.
CREATE TABLE room (
    id    INTEGER PRIMARY KEY CHECK (id = 1),
    used  INTEGER NOT NULL,
    runs  INTEGER NOT NULL,
    tried INTEGER NOT NULL DEFAULT 0
) STRICT;
INSERT INTO room (id, used, runs)
SELECT 1, (SELECT coalesce(sum(size), 0) FROM result), (SELECT coalesce(max(id), 0) FROM run);
-- Runs are deleted with their last job, but no name is given twice: who reports about one by its
-- name and attempt must not be heard about another.
CREATE TRIGGER a_run_is_named_once AFTER INSERT ON run BEGIN
    UPDATE room SET runs = new.id;
END;
CREATE TRIGGER a_body_takes_room AFTER INSERT ON result_blob BEGIN
    UPDATE room SET used = used + length(new.body);
END;
CREATE TRIGGER a_body_gives_room_back AFTER UPDATE OF evicted ON result
WHEN old.evicted IS NULL AND new.evicted IS NOT NULL BEGIN
    UPDATE room SET used = used - old.size;
END;
