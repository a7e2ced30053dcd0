-- Where results come from, what people say of them, and what they are looked for by.

-- A version of the program on a machine: what computed a result.
CREATE TABLE program (
    id           INTEGER PRIMARY KEY,
    version      TEXT    NOT NULL,
    numerics     INTEGER NOT NULL,
    host         TEXT    NOT NULL,
    architecture TEXT    NOT NULL,
    processors   INTEGER NOT NULL,
    UNIQUE (version, numerics, host, architecture, processors)
) STRICT;

-- Of the body that there is: for whom it was computed and by what. Results from before this know
-- nothing of it. `created` stays the moment at which the key was first known here.
ALTER TABLE result ADD COLUMN owner TEXT;
ALTER TABLE result ADD COLUMN computed INTEGER;
-- Seconds of the clock and of the processor.
ALTER TABLE result ADD COLUMN wall REAL;
ALTER TABLE result ADD COLUMN cpu REAL;
ALTER TABLE result ADD COLUMN program INTEGER REFERENCES program (id);
ALTER TABLE result ADD COLUMN job BLOB;
ALTER TABLE result ADD COLUMN trace TEXT;
-- When it came from another server, and in which file.
ALTER TABLE result ADD COLUMN imported INTEGER;
ALTER TABLE result ADD COLUMN imported_from TEXT;
-- Who had the body deleted; otherwise it was dropped to make room.
ALTER TABLE result ADD COLUMN deleted_by TEXT;
CREATE INDEX result_pinned ON result (key) WHERE pinned;

-- What people say of a result. It stays when the body goes.
CREATE TABLE note (
    key   BLOB    NOT NULL PRIMARY KEY REFERENCES result (key) ON DELETE CASCADE,
    text  TEXT    NOT NULL,
    owner TEXT    NOT NULL,
    at    INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

-- Numbered in the order in which results came, so that what is new is found without an index.
CREATE TABLE numbered_task (
    id   INTEGER PRIMARY KEY,
    key  BLOB NOT NULL UNIQUE REFERENCES result (key) ON DELETE CASCADE,
    task TEXT NOT NULL
) STRICT;
INSERT INTO numbered_task (key, task)
SELECT key, task FROM result_task JOIN result USING (key) ORDER BY created;
DROP TABLE result_task;
ALTER TABLE numbered_task RENAME TO result_task;

-- What a result is looked for by, under the number of its task; SI. It is written in quiet moments
-- and before somebody looks, not when a result is stored: all with a larger number are still to come.
CREATE TABLE outline (
    id                   INTEGER PRIMARY KEY,
    created              INTEGER NOT NULL,
    size                 INTEGER NOT NULL,
    -- Whether the body is there, and for whom it was computed: these two follow the result.
    present              INTEGER NOT NULL CHECK (present IN (0, 1)),
    owner                TEXT,
    shape                TEXT,
    method               TEXT,
    regime               TEXT,
    held                 TEXT,
    motion               TEXT,
    friction             REAL,
    normal_modulus       REAL,
    tangential_modulus   REAL,
    wear_coefficient     REAL,
    radius               REAL,
    slope_angle          REAL,
    flat_radius          REAL,
    exponent             REAL,
    normal_force         REAL,
    indentation_depth    REAL,
    contact_radius       REAL,
    stick_radius         REAL,
    amplitude            REAL,
    gross_slip_amplitude REAL,
    tangential_force     REAL,
    rig_stiffness        REAL,
    points               REAL,
    cycles               REAL,
    wear_volume          REAL,
    wear_depth           REAL,
    scar_radius          REAL,
    dissipated_energy    REAL
) STRICT;
CREATE INDEX outline_created ON outline (created) WHERE present;
CREATE INDEX outline_size ON outline (size) WHERE present;
CREATE INDEX outline_owner ON outline (owner, created) WHERE present;
CREATE INDEX outline_absent ON outline (created) WHERE NOT present;
CREATE INDEX outline_friction ON outline (friction) WHERE present;
CREATE INDEX outline_normal_modulus ON outline (normal_modulus) WHERE present;
CREATE INDEX outline_tangential_modulus ON outline (tangential_modulus) WHERE present;
CREATE INDEX outline_wear_coefficient ON outline (wear_coefficient) WHERE present;
CREATE INDEX outline_radius ON outline (radius) WHERE present;
CREATE INDEX outline_slope_angle ON outline (slope_angle) WHERE present;
CREATE INDEX outline_flat_radius ON outline (flat_radius) WHERE present;
CREATE INDEX outline_exponent ON outline (exponent) WHERE present;
CREATE INDEX outline_normal_force ON outline (normal_force) WHERE present;
CREATE INDEX outline_indentation_depth ON outline (indentation_depth) WHERE present;
CREATE INDEX outline_contact_radius ON outline (contact_radius) WHERE present;
CREATE INDEX outline_stick_radius ON outline (stick_radius) WHERE present;
CREATE INDEX outline_amplitude ON outline (amplitude) WHERE present;
CREATE INDEX outline_gross_slip_amplitude ON outline (gross_slip_amplitude) WHERE present;
CREATE INDEX outline_tangential_force ON outline (tangential_force) WHERE present;
CREATE INDEX outline_rig_stiffness ON outline (rig_stiffness) WHERE present;
CREATE INDEX outline_points ON outline (points) WHERE present;
CREATE INDEX outline_cycles ON outline (cycles) WHERE present;
CREATE INDEX outline_wear_volume ON outline (wear_volume) WHERE present;
CREATE INDEX outline_wear_depth ON outline (wear_depth) WHERE present;
CREATE INDEX outline_scar_radius ON outline (scar_radius) WHERE present;
CREATE INDEX outline_dissipated_energy ON outline (dissipated_energy) WHERE present;
CREATE TRIGGER an_outline_follows_its_result AFTER UPDATE OF evicted ON result
WHEN (old.evicted IS NULL) <> (new.evicted IS NULL) BEGIN
    UPDATE outline SET present = new.evicted IS NULL, owner = new.owner
    WHERE id = (SELECT id FROM result_task WHERE key = new.key);
END;
CREATE TRIGGER an_outline_goes_with_its_task AFTER DELETE ON result_task BEGIN
    DELETE FROM outline WHERE id = old.id;
END;
