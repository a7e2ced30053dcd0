-- When SQLite checks a row, it makes a temporary table for each `IN` with three values or more: four for a new job. Comparisons mean
-- the same and need none. No statement changes a constraint, so the texts of the tables are written, and no row:
-- "Making Other Kinds Of Table Schema Changes" in SQLite's documentation of ALTER TABLE.
PRAGMA writable_schema = ON;
UPDATE sqlite_schema SET sql = replace(replace(replace(replace(replace(replace(sql,
    'state IN (''queued'', ''running'', ''canceling'', ''succeeded'', ''failed'', ''canceled'')',
    'state = ''queued'' OR state = ''running'' OR state = ''canceling''
            OR state = ''succeeded'' OR state = ''failed'' OR state = ''canceled'''),
    'state IN (''queued'', ''running'', ''canceling'')',
    'state = ''queued'' OR state = ''running'' OR state = ''canceling'''),
    'state IN (''queued'', ''running'', ''done'')', 'state = ''queued'' OR state = ''running'' OR state = ''done'''),
    'origin IN (''computed'', ''coalesced'', ''cached'')',
    'origin = ''computed'' OR origin = ''coalesced'' OR origin = ''cached'''),
    'recomputed IN (''same'', ''differs'', ''replaced'')',
    'recomputed = ''same'' OR recomputed = ''differs'' OR recomputed = ''replaced'''),
    'private IN (0, 1, 2)', 'private BETWEEN 0 AND 2')
WHERE type = 'table' AND name IN ('job', 'run', 'chunk');
PRAGMA writable_schema = RESET;
-- A table that comes and goes tells other connections to read the schema again.
CREATE TABLE passing (id INTEGER PRIMARY KEY);
DROP TABLE passing;
