-- How long the lease was when it was begun or renewed, in milliseconds; null if a server of an earlier version began it. An end
-- that is further away shows that the clock of the database was set back.
ALTER TABLE lease ADD COLUMN lasts BIGINT;
