-- Who made, revoked and used which key, and who canceled and deleted whose jobs and results. Equal acts of one day (UTC) share
-- an entry. Texts are empty instead of null, because nulls would not be equal.
CREATE TABLE audit (
    -- Without gaps, because the trigger counts entries by them.
    id      INTEGER PRIMARY KEY,
    -- The first and the last of these acts, and their number.
    first   INTEGER NOT NULL,
    last    INTEGER NOT NULL,
    times   INTEGER NOT NULL,
    act     TEXT    NOT NULL,
    -- Who acted: an owner, or the user of a command. The id of its key.
    actor   TEXT    NOT NULL,
    key     TEXT    NOT NULL,
    -- What it acted on: the id of a key or job, or the key of a result. Empty for an actor's own jobs.
    subject TEXT    NOT NULL,
    owner   TEXT    NOT NULL
) STRICT;
CREATE UNIQUE INDEX audit_day ON audit (act, actor, key, subject, owner, first / 86400000);
-- 60 MB at most.
CREATE TRIGGER an_audit_log_is_bounded AFTER INSERT ON audit BEGIN
    DELETE FROM audit WHERE id <= new.id - 100000;
END;

-- When the last backup ended; 0 if there was none.
ALTER TABLE room ADD COLUMN backed_up INTEGER NOT NULL DEFAULT 0;
