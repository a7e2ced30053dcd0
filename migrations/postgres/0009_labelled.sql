-- A list shows the latest label of each result. A result can have a million jobs without a label.
CREATE INDEX job_labelled ON job (key, id) WHERE label IS NOT NULL;
