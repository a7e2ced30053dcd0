-- How the result of a run compares with the one that its key had before: `same`, `differs` (the stored result stays) or `replaced`
-- (the earlier one was evicted or deleted); null if the key had none.
ALTER TABLE run ADD COLUMN recomputed TEXT CHECK (recomputed IN ('same', 'differs', 'replaced'));
-- Who pinned a result. An earlier pin belongs to the owner whose job computed the result.
ALTER TABLE result ADD COLUMN pinned_by TEXT;
UPDATE result SET pinned_by = owner WHERE pinned;
CREATE INDEX result_pinned_by ON result (pinned_by, stored) WHERE pinned;
