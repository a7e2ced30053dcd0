-- Results are runs or studies. The results of earlier versions are runs.
ALTER TABLE outline ADD COLUMN kind TEXT DEFAULT 'run';
