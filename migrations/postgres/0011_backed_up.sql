-- When the last backup ended; null until the program that makes the backups writes it. docs/operating.md says how.
ALTER TABLE upkeep ADD COLUMN backed_up BIGINT;
