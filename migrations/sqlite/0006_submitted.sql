-- The scenario as its client wrote it, in JSON; null where it was too long to keep. It is the last column,
-- so that lists of jobs do not read it.
ALTER TABLE job ADD COLUMN submitted TEXT;
