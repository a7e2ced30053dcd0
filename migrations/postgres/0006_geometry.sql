-- Contacts are round or lines. The runs of earlier versions are round; a study has no geometry. The default is for programs of an
-- earlier version that still write the table.
ALTER TABLE outline ADD COLUMN geometry TEXT DEFAULT 'round';
UPDATE outline SET geometry = NULL WHERE kind IS DISTINCT FROM 'run';
