//! What is read from files of measured numbers.

use std::collections::BTreeMap;

use serde_json::Value;
use utoipa::ToSchema;

/// What was read from a file of measured numbers.
#[derive(ToSchema)]
pub struct Measured {
    /// The columns of numbers.
    columns: Vec<MeasuredColumn>,
    /// The tables of the file: the line of the first row of numbers, and the number of rows. `columns` are those of one of them.
    tables: Vec<Vec<u64>>,
    #[schema(required)]
    prepared: Option<Prepared>,
    /// What was done, in words.
    notes: Vec<String>,
}

#[derive(ToSchema)]
pub struct MeasuredColumn {
    /// The name in the header, without the unit.
    #[schema(example = "wear_volume")]
    name: String,
    /// The unit of the values: an SI unit, "1" for plain numbers, or the unit of the file if no quantity of a scenario has it. Null
    /// if the file states none.
    #[schema(required, example = "m^3")]
    unit: Option<String>,
    /// The dimension of the unit. Null if no quantity of a scenario has the unit.
    #[schema(required, example = "volume")]
    dimension: Option<String>,
    /// The numbers. Null where a cell is empty, or has `-`, `NaN` or a word of an error, such as `#N/A`.
    values: Vec<Option<f64>>,
}

/// What was made from x and y. Null if the file has only one column.
#[derive(ToSchema)]
pub struct Prepared {
    /// An entry of `data` of a test in a fit. Add the noise to points, and `at` to a profile. Null if a trace has no scar, or if the
    /// units do not suit a fit.
    #[schema(value_type = Option<Object>)]
    data: Option<Value>,
    /// For a trace of a ball or a cylinder: the worn surface as a `profile` of a scenario. Null if a scenario would refuse it.
    #[schema(value_type = Option<Object>)]
    indenter: Option<Value>,
    /// For a trace, in SI: `radius` of the unworn surface (null for a plane), `tilt` at the axis, `centre` (the axis in x of the
    /// file), `scatter` of the unworn points (root mean square), `scar` (its ends in x), and `difference` of the two sides (root
    /// mean square). `depth` (the largest one), `area_removed` below the unworn surface, `area_added` above it, and
    /// `volume_removed` and `volume_added` about the axis are objects with the `value` and its `error` (a standard deviation). If
    /// left and right differ beyond the scatter, `sides` has the `depth` at each radius and the `volume_removed` of the `left` and
    /// the `right` side; otherwise it is null.
    #[schema(value_type = Object, required = false)]
    trace: Value,
    /// For a loop: the mean energy of its whole cycles, in J.
    #[schema(nullable = false)]
    energy_per_cycle: Option<f64>,
    /// For a loop: the number of its whole cycles.
    #[schema(nullable = false)]
    cycles: Option<u64>,
    #[schema(nullable = false)]
    loops: Option<MeasuredLoops>,
    /// For a loop: the mean of each column of `loops`.
    #[schema(required = false)]
    mean: BTreeMap<String, Option<f64>>,
}

/// For a loop: a table with a row for each whole cycle.
#[derive(ToSchema)]
pub struct MeasuredLoops {
    /// The number of rows.
    points: Vec<Option<f64>>,
    /// The energy, in J.
    energy: Vec<Option<f64>>,
    /// The error of the energy from few points, coarse steps and noise, in J.
    energy_error: Vec<Option<f64>>,
    /// Half of the range of the displacement, in m.
    displacement_amplitude: Vec<Option<f64>>,
    /// Half of the range of the force, in N.
    force_amplitude: Vec<Option<f64>>,
    /// Half of the width of the loop where the force is in the middle of its range, in m.
    aperture: Vec<Option<f64>>,
    /// The slope of the force over the displacement after both reversals, until the force has changed by a third of its range, in
    /// N/m. Null with fewer than 3 rows there, or if the noise hides it.
    slope: Vec<Option<f64>>,
    /// The standard error of the slope from noise, in N/m.
    slope_error: Vec<Option<f64>>,
}
