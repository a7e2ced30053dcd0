-- Warnings about the two bodies belong to a submission, because its key does not contain the bodies. A run has those of the
-- submission that queued it, and a result those of the submission that computed it, as a JSON array; null if they are unknown.
ALTER TABLE run ADD COLUMN warnings TEXT;
ALTER TABLE result ADD COLUMN warnings TEXT;
-- The jobs still have them, among their other warnings.
UPDATE run SET warnings = (
    SELECT json_group_array(json(value)) FROM job, json_each(job.warnings)
    WHERE job.id = (SELECT min(id) FROM job WHERE job.run = run.id)
        AND value ->> 'kind' IN ('elastic_mismatch', 'yield')
) WHERE finished IS NULL;
UPDATE result SET warnings = (
    SELECT json_group_array(json(value)) FROM job, json_each(job.warnings)
    WHERE job.id = result.job AND value ->> 'kind' IN ('elastic_mismatch', 'yield')
) WHERE EXISTS (SELECT 1 FROM job WHERE job.id = result.job);
