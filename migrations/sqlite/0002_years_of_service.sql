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

-- Results are dropped when the database grows too large, those first that nobody has read for
-- longest; what they were of stays.
ALTER TABLE result ADD COLUMN last_access INTEGER NOT NULL DEFAULT 0;
UPDATE result SET last_access = created;
ALTER TABLE result ADD COLUMN pinned INTEGER NOT NULL DEFAULT 0 CHECK (pinned IN (0, 1));
-- When the body was dropped, and the scenario that it held.
ALTER TABLE result ADD COLUMN evicted INTEGER;
ALTER TABLE result ADD COLUMN scenario TEXT;
CREATE INDEX result_unread ON result (last_access) WHERE NOT pinned AND evicted IS NULL;
