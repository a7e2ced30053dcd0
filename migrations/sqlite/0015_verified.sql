-- How much of an imported result was computed again: 'all', 'none', or the number of random rows of a study. Null if an earlier
-- version imported it.
ALTER TABLE result ADD COLUMN verified TEXT;
DROP INDEX result_copy;
CREATE INDEX result_copy ON result (created, key, computed, wall, cpu, program, job, trace, warnings, imported, imported_from,
    verified);
