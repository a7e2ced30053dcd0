-- A run whose work is divided into chunks, which several workers compute at the same time. The chunks and, after them,
-- the assembly of the result are its pieces. `run` is no foreign key: maintenance deletes the pieces some at a time, after
-- the run has ended, and perhaps after it is deleted. The id of a run is never used again.
CREATE TABLE study (
    run    INTEGER PRIMARY KEY,
    chunks INTEGER NOT NULL CHECK (chunks > 0),
    -- Seconds of the clock and of the processor that the finished chunks took; null if the system does not report them.
    wall   REAL    NOT NULL DEFAULT 0,
    cpu    REAL    DEFAULT 0
) STRICT;

-- The pieces that were ever claimed. Pieces are claimed for the first time in the order of their numbers, so a row is missing
-- only after the last one. The number `chunks` is the assembly, which is claimed when all chunks are done.
CREATE TABLE chunk (
    run      INTEGER NOT NULL REFERENCES study (run),
    number   INTEGER NOT NULL CHECK (number >= 0),
    state    TEXT    NOT NULL CHECK (state IN ('queued', 'running', 'done')),
    -- Claims so far. Completion is fenced by it, so it never goes back.
    attempt  INTEGER NOT NULL CHECK (attempt > 0),
    -- How often the process died while this was running.
    lost     INTEGER NOT NULL DEFAULT 0,
    -- What was computed, compressed, and its XXH3.
    body     BLOB,
    checksum INTEGER,
    -- Bodies are larger than a page is wide, hence a rowid table.
    UNIQUE (run, number),
    CHECK ((body IS NOT NULL) = (state = 'done')),
    CHECK ((checksum IS NOT NULL) = (state = 'done'))
) STRICT;
CREATE INDEX chunk_open ON chunk (run, state, lost, number) WHERE state <> 'done';
