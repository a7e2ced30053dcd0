//! The indenter of a request.

use std::marker::PhantomData;

use deserr::{Deserr, IntoValue, Map, Value, ValueKind};
use serde::Serialize;

use super::fault::{Faults, Pointer, Valid, pointer, unknown, wrong_kind};
use super::fields::{Exponent, Given, Height, Length, Position, Rounded, SlopeAngle, list, pair};
use crate::numeric::twelve_digits;

/// Maximum number of rows of a table.
pub const MAX_ROWS: usize = 10_000;

/// Maximum ratio of the radii of crossed cylinders whose contact is taken as round.
pub const MAX_RADII_RATIO: f64 = 1.5;

/// The geometry of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserr, Serialize)]
#[deserr(error = Faults, rename_all = lowercase)]
#[serde(rename_all = "lowercase")]
pub enum Geometry {
    /// The contact is round, and the profile is rotated around its axis.
    #[default]
    Round,
    /// The contact is a strip (plane strain), and the profile is mirrored at its middle.
    Line,
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// The shape of the indenter.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "shape", rename_all = "snake_case")]
pub enum Profile {
    /// f = r²/(2R).
    Paraboloid(BallProfile),
    /// f = R − √(R² − r²).
    Sphere(BallProfile),
    /// f = r·tan θ.
    Cone(ConeProfile),
    /// f = height·(r/at_radius)ⁿ.
    Power(PowerProfile),
    /// f = (r² − b²)/(2R) outside the flat tip of radius b.
    TruncatedParaboloid(FlatBallProfile),
    /// f = (r − b)·tan θ outside the flat tip of radius b.
    TruncatedCone(FlatConeProfile),
    /// A table of measured points.
    Table(TableProfile),
    /// Two cylinders with perpendicular axes, one of them along the motion. The contact is nearly round.
    CrossedCylinders(CrossedProfile),
    /// A line contact with f = x²/(2R).
    Cylinder(CylinderProfile),
    /// A line contact with f = |x|·tan θ.
    Wedge(WedgeProfile),
    /// A line contact with f = (|x| − b)²/(2R) outside the flat |x| < b.
    Punch(PunchProfile),
}

impl Profile {
    /// The geometry of the contact.
    pub fn geometry(&self) -> Geometry {
        if self.length().is_some() { Geometry::Line } else { Geometry::Round }
    }

    /// The length of a line contact in m. `None` if the contact is round.
    pub fn length(&self) -> Option<f64> {
        let length = match self {
            Self::Power(power) => power.length.0?,
            Self::Table(table) => table.length.0?,
            Self::Cylinder(cylinder) => cylinder.length,
            Self::Wedge(wedge) => wedge.length,
            Self::Punch(punch) => punch.length,
            _ => return None,
        };
        Some(length.0)
    }
}

/// The fault of a line contact without a length.
fn without_length(field: &str, location: Pointer<'_>) -> Faults {
    let detail =
        "is missing. Enter the length of the line contact, across the motion, such as \"10 mm\"";
    Faults::at(location.push_key(field), detail)
}

/// The fault of an unknown member of a shape that has only one geometry.
fn unknown_of_shape(key: &str, accepted: &[&str], location: Pointer<'_>) -> Faults {
    let is_line = accepted.contains(&"length");
    let detail = match key {
        "geometry" => format!(
            "cannot be chosen for this shape, whose contact is always {}. Remove `geometry`, or enter another \
             shape: \"cylinder\", \"wedge\" and \"punch\" make line contacts, and \"power\" and \"table\" \
             take \"geometry\": \"line\"",
            if is_line { "a line" } else { "round" }
        ),
        "length" => "belongs to a line contact, but the contact of this shape is round. Remove `length`, or enter a \
                     shape that makes a line contact, such as \"cylinder\""
            .to_owned(),
        _ => unknown("member", key, accepted),
    };
    Faults::at(location.push_key(key), detail)
}

/// Checks that a line contact has a length, and a round contact none.
fn check_length(
    geometry: Geometry,
    length: Given<Rounded<Length>>,
    location: Pointer<'_>,
) -> Valid<()> {
    match (geometry, length.0) {
        (Geometry::Line, None) => Err(without_length("length", location)),
        (Geometry::Round, Some(_)) => {
            let detail = "belongs to a line contact, but this contact is round. Remove `length`, or add \
                          \"geometry\": \"line\"";
            Err(Faults::at(location.push_key("length"), detail))
        }
        _ => Ok(()),
    }
}

/// The radius of a paraboloid or a sphere.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields = unknown_of_shape)]
pub struct BallProfile {
    /// Radius R of the paraboloid or sphere.
    pub radius: Rounded<Length>,
}

/// The slope of a cone.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields = unknown_of_shape)]
pub struct ConeProfile {
    /// Slope angle θ, measured from the plane.
    pub slope_angle: Rounded<SlopeAngle>,
}

/// The parameters of a power law.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields, validate = PowerProfile::validate -> Faults)]
pub struct PowerProfile {
    /// Exponent n.
    pub exponent: Rounded<Exponent>,
    /// Height: f at the radius `at_radius`.
    pub height: Rounded<Length>,
    /// The radius at which f is `height`.
    pub at_radius: Rounded<Length>,
    /// Whether the contact is round or a line.
    #[deserr(default)]
    #[serde(skip_serializing_if = "is_default")]
    pub geometry: Geometry,
    /// The length of a line contact.
    #[deserr(default)]
    #[serde(skip_serializing_if = "Given::is_absent")]
    pub length: Given<Rounded<Length>>,
}

impl PowerProfile {
    fn validate(self, location: Pointer<'_>) -> Valid<Self> {
        check_length(self.geometry, self.length, location).map(|()| self)
    }
}

/// The radius of a cylinder whose axis lies across the motion.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields = unknown_of_shape)]
pub struct CylinderProfile {
    /// Radius R.
    pub radius: Rounded<Length>,
    /// The length of the contact.
    #[deserr(missing_field_error = without_length)]
    pub length: Rounded<Length>,
}

/// The slope of a wedge.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields = unknown_of_shape)]
pub struct WedgeProfile {
    /// Slope angle θ, measured from the plane.
    pub slope_angle: Rounded<SlopeAngle>,
    /// The length of the contact.
    #[deserr(missing_field_error = without_length)]
    pub length: Rounded<Length>,
}

/// A flat punch with rounded edges.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields = unknown_of_shape)]
pub struct PunchProfile {
    /// Half-width b of the flat.
    pub flat_half_width: Rounded<Length>,
    /// Radius R of the edges.
    pub edge_radius: Rounded<Length>,
    /// The length of the contact.
    #[deserr(missing_field_error = without_length)]
    pub length: Rounded<Length>,
}

/// The radii of crossed cylinders.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields = unknown_of_shape)]
pub struct CrossedProfile {
    /// The radii of the cylinder whose axis lies along the motion, and of the other one.
    pub radii: Radii,
}

/// The radii of crossed cylinders, whose ratio is at most [`MAX_RADII_RATIO`].
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Radii(pub [Rounded<Length>; 2]);

impl Radii {
    /// The radius √(R₁R₂) of the paraboloid with the same contact area, to first order in the difference of the radii.
    pub fn mean(self) -> f64 {
        let [along, across] = self.0;
        (along.0 * across.0).sqrt()
    }
}

impl Deserr<Faults> for Radii {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        let radii = Self(pair(value, location, "radii")?);
        let [along, across] = radii.0;
        if along.0.max(across.0) <= MAX_RADII_RATIO * along.0.min(across.0) {
            return Ok(radii);
        }
        let detail = format!(
            "make an elliptical contact, which is computed as round only if the ratio of the radii is at most \
             {MAX_RADII_RATIO}. If an estimate suffices, enter the equivalent paraboloid: {{\"shape\": \
             \"paraboloid\", \"radius\": {}}}",
            twelve_digits(radii.mean())
        );
        Err(Faults::at(location, detail))
    }
}

/// A paraboloid with a flat.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields = unknown_of_shape)]
pub struct FlatBallProfile {
    /// Radius R of the paraboloid.
    pub radius: Rounded<Length>,
    /// Radius b of the flat tip.
    pub flat_radius: Rounded<Length>,
}

/// A cone with a flat.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields = unknown_of_shape)]
pub struct FlatConeProfile {
    /// Slope angle θ, measured from the plane.
    pub slope_angle: Rounded<SlopeAngle>,
    /// Radius b of the flat tip.
    pub flat_radius: Rounded<Length>,
}

/// Minimum number of points from which the noise of a table can be estimated. A table with fewer points is not
/// smoothed.
pub(crate) const FEWEST_SMOOTHED: usize = 12;
/// Maximum distance of a smoothed height below the height on the axis, as a share of the greatest height. A height that
/// is lower by so little changes the image no more than smoothing does.
pub(crate) const LEVEL: f64 = 1e-4;

/// Measured points, from the axis outwards.
#[derive(Debug, Clone, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields, validate = TableProfile::validate -> Faults)]
pub struct TableProfile {
    /// Radius r of each point, strictly ascending from 0, rounded to 12 digits.
    pub radius: MeasuredColumn<Position>,
    /// Height z of each point. The profile is z minus the first height.
    pub height: MeasuredColumn<Height>,
    /// Whether the contact is round or a line.
    #[deserr(default)]
    #[serde(skip_serializing_if = "is_default")]
    pub geometry: Geometry,
    /// The length of a line contact.
    #[deserr(default)]
    #[serde(skip_serializing_if = "Given::is_absent")]
    pub length: Given<Rounded<Length>>,
}

impl TableProfile {
    fn validate(self, location: Pointer<'_>) -> Valid<Self> {
        let mut faults = Faults::default();
        let mut fault = |column: &str, row: usize, detail: &str| {
            let column = location.push_key(column);
            faults.add(pointer(column.push_index(row)), detail);
        };
        let (radius, height) = (&self.radius.0, &self.height.0);
        if radius[0] < 0.0 {
            let detail = "must be 0: a table lists one side of the profile, from the axis outwards. Remove the rows \
                          with negative radii, or post the whole trace as CSV (30 rows or more, with a header such as \
                          radius [mm],height [um]) to /v1/measurements?prepare=trace, which makes the table";
            fault("radius", 0, detail);
            // The first height is not that on the axis, so more faults would mislead.
            return faults.or(self).map_err(Faults::capped);
        }
        if radius[0] > 0.0 {
            let detail =
                "must be 0, because the first point lies on the axis. Add a point at radius 0";
            fault("radius", 0, detail);
        }
        for (row, pair) in radius.windows(2).enumerate() {
            if pair[0] >= pair[1] {
                let detail = format!(
                    "must be greater than the radius before it. Here {} follows {} (compared with \
                     12 digits). Sort the rows, or remove repeated radii",
                    pair[1], pair[0]
                );
                fault("radius", row + 1, &detail);
            }
        }
        // A table with enough points is smoothed, so a height below that on the axis can be noise. It is no noise if it
        // is further below than the greatest height is above.
        let most = height.iter().copied().fold(height[0], f64::max) - height[0];
        let noise = if height.len() < FEWEST_SMOOTHED { LEVEL * most } else { most };
        let lower: Vec<usize> =
            (1..height.len()).filter(|row| height[0] - height[*row] > noise).collect();
        if let Some(first) = lower.first() {
            let more = match lower.len() - 1 {
                0 => String::new(),
                more => format!(", and so are {more} other heights"),
            };
            let detail = format!(
                "is below the height on the axis ({} m){more}. Contact starts on the axis. Enter \
                 heights that are not lower than the first one",
                height[0]
            );
            fault("height", *first, &detail);
        } else if most <= 0.0 {
            let detail = "must be above the height on the axis. A flat table has no contact radius";
            fault("height", height.len() - 1, detail);
        }
        if radius.len() != height.len() {
            let detail = format!(
                "must have as many entries as `radius`: {}, not {}",
                radius.len(),
                height.len()
            );
            faults.add(pointer(location.push_key("height")), detail);
        }
        faults.keep("", check_length(self.geometry, self.length, location));
        faults.or(self).map_err(Faults::capped)
    }
}

/// 2 to [`MAX_ROWS`] quantities in SI, rounded to 12 digits.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub struct MeasuredColumn<T>(pub Vec<f64>, PhantomData<T>);

impl<T: Deserr<Faults> + Into<f64>> Deserr<Faults> for MeasuredColumn<T> {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        let rows: Vec<Rounded<T>> = list(value, location, 2..=MAX_ROWS, "points")?;
        Ok(Self(rows.into_iter().map(|row| row.0).collect(), PhantomData))
    }
}

/// Reads a profile by the name of its shape. Not derived, because the error of `deserr` does not list the accepted tags of
/// an enum.
macro_rules! shapes {
    ($($shape:ident $name:literal,)*) => {
        /// The names of all shapes.
        pub const SHAPES: &[&str] = &[$($name),*];

        #[derive(Debug, Clone, Copy, PartialEq, Eq, Deserr)]
        #[deserr(error = Faults)]
        enum ShapeName {
            $(#[deserr(rename = $name)] $shape,)*
        }

        impl Deserr<Faults> for Profile {
            fn deserialize_from_value<V: IntoValue>(
                value: Value<V>,
                location: Pointer<'_>,
            ) -> Valid<Self> {
                let Value::Map(mut map) = value else {
                    return Err(wrong_kind(value, &[ValueKind::Map], location));
                };
                let here = location.push_key("shape");
                let Some(shape) = map.remove("shape") else {
                    let detail = "is missing. Enter the shape of the indenter, such as \"paraboloid\"";
                    return Err(Faults::at(here, detail));
                };
                let shape = ShapeName::deserialize_from_value(shape.into_value(), here)?;
                let rest = Value::<V>::Map(map);
                match shape {
                    $(ShapeName::$shape => Deserr::deserialize_from_value(rest, location).map(Self::$shape),)*
                }
            }
        }
    };
}

shapes! {
    Paraboloid "paraboloid",
    Sphere "sphere",
    Cone "cone",
    Power "power",
    TruncatedParaboloid "truncated_paraboloid",
    TruncatedCone "truncated_cone",
    Table "table",
    CrossedCylinders "crossed_cylinders",
    Cylinder "cylinder",
    Wedge "wedge",
    Punch "punch",
}
