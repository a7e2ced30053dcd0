-- Contacts are round or lines. The runs of earlier versions are round; a study has no geometry.
ALTER TABLE outline ADD COLUMN geometry TEXT DEFAULT 'round';
UPDATE outline SET geometry = NULL WHERE kind IS NOT 'run';
DROP INDEX outline_absent_copy;
CREATE INDEX outline_absent_copy ON outline (id, kind, shape, geometry, method, regime, held, motion, friction, normal_modulus,
    tangential_modulus, wear_coefficient, radius, slope_angle, flat_radius, exponent, normal_force, indentation_depth,
    contact_radius, stick_radius, amplitude, gross_slip_amplitude, tangential_force, rig_stiffness, points, cycles,
    wear_volume, wear_depth, scar_radius, dissipated_energy) WHERE NOT present;
