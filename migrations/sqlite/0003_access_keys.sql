-- Who may use the server, once it is asked to tell callers apart.

-- A key is `fretwork_<id>_<secret>`. Of the secret only the digest of the whole key is kept; it is long
-- and random, so that a plain SHA-256 cannot be turned back.
CREATE TABLE access_key (
    id         TEXT NOT NULL PRIMARY KEY,
    -- Whom jobs belong to: keys of one name are one owner.
    name       TEXT NOT NULL,
    role       TEXT NOT NULL CHECK (role IN ('read', 'submit', 'admin')),
    digest     BLOB NOT NULL CHECK (length(digest) = 32),
    -- Requests per minute; the server's own limit if there is none.
    per_minute INTEGER,
    created    INTEGER NOT NULL,
    expires    INTEGER,
    revoked    INTEGER,
    last_used  INTEGER
) STRICT;

-- What links to results are signed with. It is made when the first link is.
CREATE TABLE link_secret (
    id     INTEGER PRIMARY KEY CHECK (id = 1),
    secret BLOB NOT NULL CHECK (length(secret) = 32)
) STRICT;
