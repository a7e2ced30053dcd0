-- The number of transactions that the server has committed. It writes the same number beside the database, and so finds
-- out at the start whether the write-ahead log has lost any. `committed` is the time of the last one.
ALTER TABLE room ADD COLUMN commits INTEGER NOT NULL DEFAULT 0;
ALTER TABLE room ADD COLUMN committed INTEGER NOT NULL DEFAULT 0;
-- The time by which ages are measured, in milliseconds since 1970. It follows the clock of the system, but it advances
-- only while the server runs and at most twice as fast, so that a jump of the clock deletes nothing.
ALTER TABLE room ADD COLUMN clock INTEGER;
UPDATE room SET clock = (SELECT created FROM job ORDER BY id DESC LIMIT 1);
-- One row, which the server overwrites to find out whether the disk has room for a submission.
ALTER TABLE room DROP COLUMN tried;
CREATE TABLE probe (
    id    INTEGER PRIMARY KEY CHECK (id = 1),
    bytes BLOB    NOT NULL
) STRICT;
