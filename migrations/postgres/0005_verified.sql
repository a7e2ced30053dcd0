-- How much of an imported result was computed again: 'all', 'none', or the number of random rows of a study. Null if an earlier
-- version imported it.
ALTER TABLE result ADD COLUMN verified TEXT;
