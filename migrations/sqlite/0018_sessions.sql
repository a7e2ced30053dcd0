-- The sessions of browsers. A cookie has the random token; this table has only its digest, and the digest of the access key that
-- signed in.
CREATE TABLE session (
    digest     BLOB    NOT NULL PRIMARY KEY CHECK (length(digest) = 32),
    key        TEXT    NOT NULL,
    key_digest BLOB    NOT NULL CHECK (length(key_digest) = 32),
    created    INTEGER NOT NULL,
    expires    INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE INDEX session_key ON session (key, created);
CREATE INDEX session_expires ON session (expires);
