-- The oldest schema version whose programs may write these tables. A migration after which an earlier program would do harm
-- raises it. Programs from this version on stop within a second then. Others run on beside the later ones.
ALTER TABLE upkeep ADD COLUMN oldest BIGINT NOT NULL DEFAULT 1;
