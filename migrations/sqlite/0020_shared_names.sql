-- Who sees a job with its label and tags: 0 is everybody who may read; 1 is its owner alone, as the owner chose; 2 is its owner
-- alone, because the job is older than this choice. Administrators see all jobs.
ALTER TABLE job ADD COLUMN private INTEGER NOT NULL DEFAULT 2 CHECK (private IN (0, 1, 2));
-- Whether the names that its holder gives are private.
ALTER TABLE access_key ADD COLUMN private INTEGER NOT NULL DEFAULT 0 CHECK (private IN (0, 1));
-- The notes of holders of such keys. Only their owners see them.
CREATE TABLE private_note (
    key   BLOB    NOT NULL REFERENCES result (key) ON DELETE CASCADE,
    owner TEXT    NOT NULL,
    text  TEXT    NOT NULL,
    at    INTEGER NOT NULL,
    PRIMARY KEY (key, owner)
) STRICT, WITHOUT ROWID;
-- A search for words reads this index alone.
DROP INDEX job_named;
CREATE INDEX job_named ON job (key, id, owner, private, label, tags) WHERE label IS NOT NULL OR tags <> '[]';
