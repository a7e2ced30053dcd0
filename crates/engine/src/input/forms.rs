//! The forms that the objects of a scenario have, for the JSON Schema. Where an object has several forms, a request has one of them.

use serde_json::Value;

use super::inputs::{Form, INPUTS, Input};

/// A form of an object.
#[derive(Debug, Clone, Copy)]
pub struct ObjectForm {
    /// Its name in the schema.
    pub name: &'static str,
    /// What it is, in sentences.
    pub about: &'static str,
    /// The pointer of the object, with `#` in place of the place in a list.
    pub pointer: &'static str,
    /// The geometry of the contact, `round` or `line`, if it needs one.
    pub geometry: &'static str,
    /// The members that it must have. After `=` is the value.
    pub required: &'static [&'static str],
    /// The members that it can have.
    pub optional: &'static [&'static str],
    /// An example, as JSON; empty if there is none.
    pub example: &'static str,
}

/// Defines the forms: what each is, its name, the pointer of the object, perhaps the geometry, the members that it must have and those
/// that it can have, and perhaps an example.
macro_rules! forms {
    ($($(#[doc = $about:literal])* $name:ident $pointer:literal $($geometry:ident)? [$($required:literal),*] [$($optional:literal),*] $($example:literal)?;)*) => {
        /// All forms.
        pub const FORMS: &[ObjectForm] = &[$(ObjectForm {
            name: stringify!($name),
            about: concat!($($about),*),
            pointer: $pointer,
            geometry: concat!($(stringify!($geometry))?),
            required: &[$($required),*],
            optional: &[$($optional),*],
            example: concat!($($example)?),
        }),*];
    };
}

forms! {
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
    /// One isotropic elastic body.
    Body "/bodies/#" ["youngs_modulus", "poisson_ratio"] ["yield_strength"];
    /// The effective moduli of the pair. Give these or `bodies`.
    Moduli "/moduli" ["normal"] ["tangential"];
    /// The wear coefficient of both bodies together.
    SpecificWearRate "/wear" ["coefficient"] ["share"];
    /// The wear coefficient of both bodies together as a number without a unit.
    Archard "/wear" ["coefficient", "hardness"] ["share"];
    /// The wear volume of both bodies together per dissipated energy.
    EnergyWearCoefficient "/wear" ["energy_coefficient"] ["share"];
    /// The wear coefficients of each body. Bodies without layers are the same as `coefficient` with `share`.
    BodiesAndLayers "/wear" ["bodies"] []
        r#"{"bodies": [{"coefficient": 0}, {"layers": [{"thickness": "3 um", "coefficient": "1e-6 mm^3/(N m)"}], "coefficient": "3e-5 mm^3/(N m)"}]}"#;
    /// How one body wears: its layers, and the material below them.
    WornBody "/wear/bodies/#" ["coefficient"] ["layers"];
    /// A layer on a body.
    Layer "/wear/bodies/#/layers/#" ["thickness", "coefficient"] [];
    /// The force of the unworn contact.
    ByForce "/load" ["normal_force"] ["held"];
    /// The depth of the unworn contact.
    ByDepth "/load" round ["indentation_depth"] ["held"];
    /// A given amplitude.
    ByAmplitude "/motion" ["amplitude"] ["held", "rig_stiffness", "reference_distance", "loop_stiffness"]
        r#"{"amplitude": "2.256 um"}"#;
    /// A given amplitude of the sliding.
    Sliding "/motion" line ["sliding_amplitude"] ["held=amplitude"]
        r#"{"sliding_amplitude": "10 um"}"#;
    /// A given aperture of the friction loop.
    ByAperture "/motion" ["loop_aperture"] ["rig_stiffness", "reference_distance", "loop_stiffness"]
        r#"{"loop_aperture": "10 um"}"#;
    /// A given stick ratio.
    ByStickRatio "/motion" ["stick_ratio"] ["held", "rig_stiffness", "reference_distance", "loop_stiffness"]
        r#"{"stick_ratio": 0.5}"#;
    /// A given tangential force.
    ByTangentialForce "/motion" ["tangential_force"] ["held", "rig_stiffness", "reference_distance", "loop_stiffness"]
        r#"{"tangential_force": "15 N"}"#;
    /// Amplitudes one after the other.
    Blocks "/motion" ["blocks"] ["held", "rig_stiffness", "reference_distance", "loop_stiffness"]
        r#"{"blocks": [{"amplitude": "2 um", "cycles": 50000}, {"amplitude": "1 um", "cycles": 50000}]}"#;
    /// A displacement record.
    Reversals "/motion" round ["reversals"] ["held=amplitude"]
        r#"{"reversals": ["2.2 um", "-1.4 um", "0.6 um", "-2.2 um"]}"#;
    /// A stretch of cycles of one amplitude.
    AmplitudeBlock "/motion/blocks/#" ["amplitude", "cycles"] [];
    /// A stretch of cycles of one amplitude of the tangential force.
    ForceBlock "/motion/blocks/#" ["tangential_force", "cycles"] [];
    /// A stretch of cycles of one aperture of the loop.
    ApertureBlock "/motion/blocks/#" ["loop_aperture", "cycles"] [];
    /// A largest depth.
    UntilDepth "/until" ["wear_depth"] [];
    /// A wear volume.
    UntilVolume "/until" ["wear_volume"] [];
    /// A dissipated energy.
    UntilEnergy "/until" ["dissipated_energy"] [];
    /// How wear is computed.
    Model "/model" [] ["method", "xi", "tolerance", "compare", "points"];
}

impl ObjectForm {
    /// The example.
    ///
    /// # Panics
    /// It is not JSON; a test reads all examples.
    #[expect(clippy::expect_used, reason = "a test reads all examples")]
    pub fn example(&self) -> Option<Value> {
        let example = Some(self.example).filter(|example| !example.is_empty());
        example.map(|example| serde_json::from_str(example).expect("valid JSON"))
    }

    /// The names of all members with the values that they must have.
    pub fn members(&self) -> impl Iterator<Item = (&'static str, Option<&'static str>)> {
        let all = self.required.iter().chain(self.optional);
        all.map(|member| {
            member.split_once('=').map_or((*member, None), |(name, value)| (name, Some(value)))
        })
    }

    /// The input that a member of this object is.
    pub fn input(&self, member: &str) -> Option<&'static Input> {
        let pointer = format!("{}/{member}", self.pointer);
        let has = |sibling: &str| self.members().any(|(name, _)| name == sibling);
        INPUTS.iter().find(|input| {
            let (own, condition) = input.pointer.split_once('?').unwrap_or((input.pointer, ""));
            own == pointer
                && !matches!(input.form, Form::Part)
                && (condition.is_empty() || has(condition))
        })
    }
}
