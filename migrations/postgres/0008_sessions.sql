-- The sessions of browsers. A cookie has the random token; this table has only its digest, and the digest of the access key that
-- signed in.
CREATE TABLE session (
    digest     BYTEA  NOT NULL PRIMARY KEY CHECK (octet_length(digest) = 32),
    key        TEXT   NOT NULL,
    key_digest BYTEA  NOT NULL CHECK (octet_length(key_digest) = 32),
    created    BIGINT NOT NULL,
    expires    BIGINT NOT NULL
);
CREATE INDEX session_key ON session (key, created);
CREATE INDEX session_expires ON session (expires);
