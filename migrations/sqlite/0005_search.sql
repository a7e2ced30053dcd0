-- Search is one plain query. It needs three indexes: for the newest results, for those of an owner,
-- and for evicted ones (`outline_created`, `outline_owner`, `outline_absent`).
-- Since this version, the row in `outline` is written together with its result.
DROP INDEX outline_size;
DROP INDEX outline_friction;
DROP INDEX outline_normal_modulus;
DROP INDEX outline_tangential_modulus;
DROP INDEX outline_wear_coefficient;
DROP INDEX outline_radius;
DROP INDEX outline_slope_angle;
DROP INDEX outline_flat_radius;
DROP INDEX outline_exponent;
DROP INDEX outline_normal_force;
DROP INDEX outline_indentation_depth;
DROP INDEX outline_contact_radius;
DROP INDEX outline_stick_radius;
DROP INDEX outline_amplitude;
DROP INDEX outline_gross_slip_amplitude;
DROP INDEX outline_tangential_force;
DROP INDEX outline_rig_stiffness;
DROP INDEX outline_points;
DROP INDEX outline_cycles;
DROP INDEX outline_wear_volume;
DROP INDEX outline_wear_depth;
DROP INDEX outline_scar_radius;
DROP INDEX outline_dissipated_energy;
