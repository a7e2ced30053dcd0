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

-- Most jobs have succeeded, and a list of them needs no index.
DROP INDEX job_state;
CREATE INDEX job_state ON job (state, id) WHERE state <> 'succeeded';

-- The `numerics` version of the keys of all unfinished runs. A later version of the program gives them new keys.
ALTER TABLE room ADD COLUMN numerics INTEGER NOT NULL DEFAULT 1;
