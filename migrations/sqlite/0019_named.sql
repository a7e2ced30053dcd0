-- A list shows the latest label of each result, and a result can have a million jobs without a label. A search for words reads this
-- index alone, which is much smaller than the jobs.
CREATE INDEX job_named ON job (key, id, owner, label, tags) WHERE label IS NOT NULL OR tags <> '[]';
