-- Who sees a job with its label and tags: 0 is everybody who may read; 1 is its owner alone, as the owner chose; 2 is its owner
-- alone, because the job is older than this choice, or a program of an earlier version has submitted it. Administrators see all jobs.
ALTER TABLE job ADD COLUMN private BIGINT NOT NULL DEFAULT 2;
-- Whether the names that its holder gives are private.
ALTER TABLE access_key ADD COLUMN private BOOLEAN NOT NULL DEFAULT FALSE;
-- The notes of holders of such keys. Only their owners see them. Programs of earlier versions do not know this table, so they show none.
CREATE TABLE private_note (
    key   BYTEA  NOT NULL REFERENCES result (key) ON DELETE CASCADE,
    owner TEXT   COLLATE "C" NOT NULL,
    text  TEXT   NOT NULL,
    at    BIGINT NOT NULL,
    PRIMARY KEY (key, owner)
);
