-- SQLite has no checksums. An index holds its columns a second time, and `PRAGMA integrity_check` compares both. So each of these
-- indexes finds a changed bit in columns that nothing else repeats. They contain no columns that change often.
CREATE INDEX job_copy ON job (id, origin, priority, warnings, created, fingerprint);
CREATE INDEX result_copy ON result (created, key, computed, wall, cpu, program, job, trace, warnings, imported, imported_from);
CREATE INDEX note_copy ON note (key, text, owner, at);
CREATE INDEX audit_copy ON audit (id, first, last, times);
CREATE INDEX access_key_copy ON access_key (id, name, role, digest, per_minute, created, expires, revoked);
CREATE INDEX link_secret_copy ON link_secret (id, secret);
CREATE INDEX run_failed ON run (id, error_kind, error, progress) WHERE state = 'failed';
-- Of a result whose body is stored, these are compared with the body.
CREATE INDEX result_evicted_copy ON result (key, summary, digest, size, deleted_by) WHERE evicted IS NOT NULL;
CREATE INDEX outline_absent_copy ON outline (id, kind, shape, method, regime, held, motion, friction, normal_modulus,
    tangential_modulus, wear_coefficient, radius, slope_angle, flat_radius, exponent, normal_force, indentation_depth,
    contact_radius, stick_radius, amplitude, gross_slip_amplitude, tangential_force, rig_stiffness, points, cycles,
    wear_volume, wear_depth, scar_radius, dissipated_energy) WHERE NOT present;
-- XXH3 of `submitted`, which is too long for an index; null if an earlier version stored it.
ALTER TABLE job ADD COLUMN submitted_sum INTEGER;
