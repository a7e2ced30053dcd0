-- The chunks with which the later stages of a study begin, separated by commas. A worker can claim the first chunk of a stage when
-- all chunks before it are done. Most studies have one stage.
ALTER TABLE study ADD COLUMN stages TEXT NOT NULL DEFAULT '';
