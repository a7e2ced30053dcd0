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

/// Defines the shapes: what each is, its parameters and its name. The parser is not derived, because the error of `deserr`
/// does not list the accepted tags of an enum.
macro_rules! shapes {
    ($($(#[doc = $about:literal])* $shape:ident($parameters:ident) $name:literal;)*) => {
        /// The shape of the indenter.
        #[derive(Debug, Clone, PartialEq, Serialize)]
        #[serde(tag = "shape")]
        pub enum Profile {
            $($(#[doc = $about])* #[serde(rename = $name)] $shape($parameters),)*
        }

        /// The names of all shapes.
        pub const SHAPES: &[&str] = &[$($name),*];

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
                let shape = <String as Deserr<Faults>>::deserialize_from_value(shape.into_value(), here)?;
                let rest = Value::<V>::Map(map);
                match shape.as_str() {
                    $($name => Deserr::deserialize_from_value(rest, location).map(Self::$shape),)*
                    other => Err(Faults::at(here, unknown("value", other, SHAPES))),
                }
            }
        }
    };
}

shapes! {
    /// f = r²/(2R).
    Paraboloid(BallProfile) "paraboloid";
    /// f = R − √(R² − r²).
    Sphere(BallProfile) "sphere";
    /// f = r·tan θ.
    Cone(ConeProfile) "cone";
    /// f = height·(r/at_radius)ⁿ.
    Power(PowerProfile) "power";
    /// f = (r² − b²)/(2R) outside the flat tip of radius b.
    TruncatedParaboloid(FlatBallProfile) "truncated_paraboloid";
    /// f = (r − b)·tan θ outside the flat tip of radius b.
    TruncatedCone(FlatConeProfile) "truncated_cone";
    /// A table of measured points.
    Table(TableProfile) "table";
    /// Two cylinders with perpendicular axes, one of them along the motion. The contact is nearly round.
    CrossedCylinders(CrossedProfile) "crossed_cylinders";
    /// A line contact with f = x²/(2R).
    Cylinder(CylinderProfile) "cylinder";
    /// A line contact with f = |x|·tan θ.
    Wedge(WedgeProfile) "wedge";
    /// A line contact with f = (|x| − b)²/(2R) outside the flat |x| < b.
    Punch(PunchProfile) "punch";
}

super::rows::rows! {
    "/profile/shape": Part, "Shape", "", PLAIN;
    "/profile/geometry": Of("Geometry"), "Geometry", "", PLAIN;
    /// Radii, strictly increasing (at 12 digits) from 0 on the axis.
    "/profile/radius?height": List("Radius", 2, MAX_ROWS), "Radius", "$R$", RADIUS;
    /// Radius R of the ball or cylinder, or of curvature at its tip.
    "/profile/radius": Of("Length"), "Radius", "$R$", RADIUS;
    "/profile/radius/#": Part, "Radius of point #", "", MICRO;
    /// The radius of the cylinder whose axis lies along the motion, then the radius of the other one.
    "/profile/radii": List("Length", 2, 2), "Radii", "", RADIUS;
    "/profile/radii/0": Part, "Radius, axis along the motion", "", RADIUS;
    "/profile/radii/1": Part, "Radius, axis across the motion", "", RADIUS;
    "/profile/slope_angle": Of("SlopeAngle"), "Slope angle", "$θ$", ANGLE;
    "/profile/exponent": Of("Exponent"), "Exponent", "$n$", between(1.0, 10.0);
    /// Where f is `height`.
    "/profile/at_radius": Of("Length"), "Reference radius", "", RADIUS;
    /// f at `at_radius`.
    "/profile/height?at_radius": Of("Length"), "Height at reference radius", "", MICRO;
    /// As many heights, none below the first.
    "/profile/height": List("Height", 2, MAX_ROWS), "Height", "", MICRO;
    "/profile/height/#": Part, "Height of point #", "", MICRO;
    /// Radius b of the flat.
    "/profile/flat_radius": Of("Length"), "Flat radius", "$b$", MICRO;
    /// Half of the width of the flat, b.
    "/profile/flat_half_width": Of("Length"), "Half-width of the flat", "$b$", RADIUS;
    /// Radius R of the edges.
    "/profile/edge_radius": Of("Length"), "Edge radius", "$R$", RADIUS;
    /// Length of a line contact, across the motion; not for a round contact.
    "/profile/length": Of("Length"), "Length of the contact", "", RADIUS;

    forms:
    /// f = r²/(2R): the usual stand-in for a ball.
    Paraboloid "/profile" round ["shape=paraboloid", "radius"] [] r#"{"shape": "paraboloid", "radius": "10 mm"}"#;
    /// f = R − √(R²−r²), for contacts that are not small beside the radius; up to a₀/R = 0.6.
    Sphere "/profile" round ["shape=sphere", "radius"] [] r#"{"shape": "sphere", "radius": "10 mm"}"#;
    /// f = r·tan θ.
    Cone "/profile" round ["shape=cone", "slope_angle"] [] r#"{"shape": "cone", "slope_angle": "0.5 deg"}"#;
    /// f = height·(r/at_radius)^exponent. For a line contact, r is the distance from the middle, and `length` is required.
    PowerLaw "/profile" ["shape=power", "exponent", "height", "at_radius"] ["geometry", "length"]
        r#"{"shape": "power", "exponent": 4, "height": "5 um", "at_radius": "0.2 mm"}"#;
    /// f = (r²−b²)/(2R) for r > b, flat inside: a ball worn or cut at its tip. The springs under the flat slip all together, so that a
    /// stick ratio is either 0, which means that just the flat sticks, or at least b/a₀.
    TruncatedParaboloid "/profile" round ["shape=truncated_paraboloid", "radius", "flat_radius"] []
        r#"{"shape": "truncated_paraboloid", "radius": "10 mm", "flat_radius": "60 um"}"#;
    /// f = (r−b)·tan θ for r > b, flat inside. Stick ratios as for the truncated paraboloid.
    TruncatedCone "/profile" round ["shape=truncated_cone", "slope_angle", "flat_radius"] []
        r#"{"shape": "truncated_cone", "slope_angle": "0.5 deg", "flat_radius": "60 um"}"#;
    /// Two cylinders with perpendicular axes, one of them along the motion. If the ratio of their radii is at most 1.5, the contact is
    /// computed as round.
    CrossedCylinders "/profile" round ["shape=crossed_cylinders", "radii"] []
        r#"{"shape": "crossed_cylinders", "radii": ["10 mm", "10 mm"]}"#;
    /// A line contact: f = x²/(2R), a cylinder whose axis lies across the motion.
    Cylinder "/profile" line ["shape=cylinder", "radius", "length"] []
        r#"{"shape": "cylinder", "radius": "10 mm", "length": "10 mm"}"#;
    /// A line contact: f = |x|·tan θ.
    Wedge "/profile" line ["shape=wedge", "slope_angle", "length"] []
        r#"{"shape": "wedge", "slope_angle": "0.5 deg", "length": "10 mm"}"#;
    /// A line contact: f = (|x|−b)²/(2R) for |x| > b, flat inside. A flat punch with rounded edges, as in tests of fretting fatigue.
    Punch "/profile" line ["shape=punch", "flat_half_width", "edge_radius", "length"] []
        r#"{"shape": "punch", "flat_half_width": "1 mm", "edge_radius": "3 mm", "length": "10 mm"}"#;
    /// A measured profile: heights over radii, evenly spaced or not. The gap is the height less that on the axis. Noise is taken off by
    /// local parabolas whose reach the points themselves decide (exact points are left as they are), and the points are joined by a
    /// monotone cubic; more than 500 points are first averaged in groups of neighbours. The table must go on beyond the scar to come,
    /// and the profile's image must rise as far. For a line contact, the radii are distances from the middle, and `length` is required.
    Table "/profile" ["shape=table", "radius", "height"] ["geometry", "length"]
        r#"{"shape": "table", "radius": [0, 0.0001, 0.0002, 0.0003], "height": ["0 um", "0.5 um", "2 um", "4.5 um"]}"#;
}
