//! The wear coefficients of a request: one for both bodies together, or those of each body and its layers.

use deserr::{Deserr, IntoValue, Value};
use serde::Serialize;

use super::changing::{Changing, GivenChanging};
use super::fault::{Faults, Pointer, Valid};
use super::fields::{
    Bodies, EnergyWear, Given, Length, List, NumberOrText, Rounded, Share, Stress, WearCoefficient,
    within,
};
use super::quantity::Dimension;
use crate::numeric::twelve_digits;

/// Maximum number of layers of a body.
pub const MAX_LAYERS: usize = 20;

/// How the bodies wear.
#[derive(Debug, Clone, PartialEq)]
pub struct Wear {
    /// The wear coefficients.
    pub law: WearLaw,
    /// The share of the first body in the wear volume, which carries the profile. Layers determine it themselves.
    pub share: Option<f64>,
}

/// The wear coefficients, in SI with 12 digits.
#[derive(Debug, Clone, PartialEq)]
pub enum WearLaw {
    /// The wear coefficient k_w of both bodies together, in 1/Pa.
    PerLoad(Changing),
    /// The energy wear coefficient α of both bodies together, in m³/J. It is not rounded.
    PerEnergy(f64),
    /// The wear coefficients of the two bodies, at least one of which has layers. The first body carries the profile.
    Layered([WornBody; 2]),
}

/// A body that wears.
#[derive(Debug, Clone, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct WornBody {
    /// The layers, from the surface inwards.
    #[deserr(default = List(Vec::new()))]
    #[serde(skip_serializing_if = "List::is_empty")]
    pub layers: List<Layer, 0, MAX_LAYERS>,
    /// The wear coefficient k_w below the layers, in 1/Pa.
    pub coefficient: WearRate,
}

impl WornBody {
    /// The same body with the fewest layers: neighbours of equal coefficients are one.
    fn merged(self) -> Self {
        let coefficient = self.coefficient;
        let is_same = |a: WearRate, b: WearRate| a.0.total_cmp(&b.0).is_eq();
        let mut layers: Vec<Layer> = Vec::new();
        for layer in self.layers.0 {
            match layers.last_mut() {
                Some(last) if is_same(last.coefficient, layer.coefficient) => {
                    last.thickness.0 = twelve_digits(last.thickness.0 + layer.thickness.0);
                }
                _ => layers.push(layer),
            }
        }
        layers.pop_if(|last| is_same(last.coefficient, coefficient));
        Self { layers: List(layers), coefficient }
    }

    /// Whether the body wears for ever: no layer stops the wear, nor does the material below.
    fn wears_on(&self) -> bool {
        self.layers.0.iter().all(|layer| layer.coefficient.0 > 0.0) && self.coefficient.0 > 0.0
    }
}

/// A layer of a body.
#[derive(Debug, Clone, Copy, PartialEq, Deserr, Serialize)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct Layer {
    /// The thickness of the layer.
    pub thickness: Rounded<Length>,
    /// The wear coefficient k_w of the layer, in 1/Pa.
    pub coefficient: WearRate,
}

/// The wear coefficient k_w of one material, in 1/Pa with 12 digits. It is 0 if the material does not wear.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(transparent)]
pub struct WearRate(pub f64);

impl Deserr<Faults> for WearRate {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        if matches!(value, Value::Map(_)) {
            let detail = "cannot be a table or a run-in here. Enter a number, or a text such as \
                          \"2e-5 mm^3/(N m)\"";
            return Err(Faults::at(location, detail));
        }
        let given = NumberOrText::deserialize_from_value(value, location)?;
        let x = given.read(Dimension::WearCoefficient, location)?;
        if x == 0.0 {
            return Ok(Self(0.0));
        }
        within(x, WearCoefficient::RANGE, "1/Pa", location).map(|x| Self(twelve_digits(x)))
    }
}

/// The member `wear` as the client gives it: k_w, or k with the hardness, or α, or the bodies.
#[derive(Debug, Clone, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct GivenWear {
    /// The wear coefficient k_w, or the dimensionless k together with `hardness`.
    #[deserr(default)]
    coefficient: Given<GivenChanging<NumberOrText>>,
    /// Hardness σ₀.
    #[deserr(default)]
    hardness: Given<Stress>,
    /// Energy wear coefficient α.
    #[deserr(default)]
    energy_coefficient: Given<EnergyWear>,
    /// The share of the first body in the wear volume, which carries the profile.
    #[deserr(default)]
    share: Given<Rounded<Share>>,
    /// The two bodies, the one with the profile first.
    #[deserr(default)]
    bodies: Given<Bodies<WornBody>>,
}

impl Deserr<Faults> for Wear {
    fn deserialize_from_value<V: IntoValue>(value: Value<V>, location: Pointer<'_>) -> Valid<Self> {
        let mut given = GivenWear::deserialize_from_value(value, location)?;
        if let Some(Bodies(bodies)) = given.bodies.0.take() {
            return given.with_bodies(bodies, location);
        }
        let share = given.share.0.map(|share| share.0);
        Ok(Self { law: given.law(location)?, share })
    }
}

impl GivenWear {
    /// The law of a request without `bodies`.
    fn law(self, location: Pointer<'_>) -> Valid<WearLaw> {
        let here = location.push_key("coefficient");
        let dimension = match self.hardness.0 {
            Some(_) => Dimension::Number,
            None => Dimension::WearCoefficient,
        };
        match (self.coefficient.0, self.hardness.0, self.energy_coefficient.0) {
            (None, None, Some(alpha)) => Ok(WearLaw::PerEnergy(alpha.0)),
            (Some(_), _, Some(_)) => {
                let detail = "give either `coefficient` or `energy_coefficient`, not both";
                Err(Faults::at(here, detail))
            }
            (None, _, _) => {
                let detail = "is missing. Enter `coefficient` or `energy_coefficient`. With `hardness`, \
                              `coefficient` is the dimensionless wear coefficient k. Without `hardness`, it is the \
                              wear coefficient k_w, such as \"2e-5 mm^3/(N m)\"";
                Err(Faults::at(here, detail))
            }
            (Some(given), hardness, None) => {
                let hardness = hardness.map_or(1.0, |hardness| hardness.0);
                let per_load = given.resolve(here, |given, here| {
                    within(
                        given.read(dimension, here)? / hardness,
                        WearCoefficient::RANGE,
                        "1/Pa",
                        here,
                    )
                })?;
                Ok(WearLaw::PerLoad(per_load))
            }
        }
    }

    /// The wear of a request with `bodies`. Bodies without layers are the same as `coefficient` with `share`.
    fn with_bodies(&self, bodies: [WornBody; 2], location: Pointer<'_>) -> Valid<Wear> {
        let mut faults = Faults::default();
        let given = [
            self.coefficient.named("coefficient"),
            self.hardness.named("hardness"),
            self.energy_coefficient.named("energy_coefficient"),
            self.share.named("share"),
        ];
        for member in given.into_iter().flatten() {
            let detail = format!(
                "cannot be combined with `bodies`, where each body has its own wear coefficient k_w. Remove \
                 `{member}`, or remove `bodies`"
            );
            faults.0.extend(Faults::at(location.push_key(member), detail).0);
        }
        let here = location.push_key("bodies");
        if !bodies.iter().any(WornBody::wears_on) {
            let detail = "stop the wear: each body has a `coefficient` of 0, in a layer or below its layers. Enter \
                          coefficients above 0 for all materials of at least one body";
            faults.0.extend(Faults::at(here, detail).0);
        }
        faults.or(())?;
        let bodies = bodies.map(WornBody::merged);
        if bodies.iter().any(|body| !body.layers.is_empty()) {
            return Ok(Wear { law: WearLaw::Layered(bodies), share: None });
        }
        let [first, second] = bodies.map(|body| body.coefficient.0);
        let both = within(twelve_digits(first + second), WearCoefficient::RANGE, "1/Pa", here)?;
        let share = Some(twelve_digits(first / (first + second)));
        Ok(Wear { law: WearLaw::PerLoad(Changing::Constant(both)), share })
    }
}

super::rows::rows! {
    /// The dimensionless k; k_w = k/hardness must lie between 1e-30 and 1 1/Pa.
    "/wear/coefficient?hardness": Either(&["ArchardCoefficient", "ChangeTable", "RunIn"]), "Archard coefficient", "$k$", PLAIN;
    /// The worn volume per normal force and slip path, k_w: a number, a table, or a run-in.
    "/wear/coefficient": Either(&["WearCoefficient", "ChangeTable", "RunIn"]), "Wear coefficient", "$k_w$", WEAR;
    "/wear/coefficient/run_in/cycles": Part, "Run-in cycles of k_w", "", PLAIN;
    "/wear/coefficient/run_in/from?/wear/hardness": Part, "k at the start", "", PLAIN;
    "/wear/coefficient/run_in/to?/wear/hardness": Part, "k after the run-in", "", PLAIN;
    "/wear/coefficient/values?/wear/hardness": Part, "Values of k", "", PLAIN;
    "/wear/coefficient/run_in/from": Part, "k_w at the start", "", WEAR;
    "/wear/coefficient/run_in/to": Part, "k_w after the run-in", "", WEAR;
    "/wear/coefficient/over": Part, "k_w changes over", "", PLAIN;
    "/wear/coefficient/at?over=dissipated_energy": Part, "Points of the table of k_w", "", ENERGY;
    "/wear/coefficient/at": Part, "Points of the table of k_w", "", PLAIN;
    "/wear/coefficient/values": Part, "Values of k_w", "", WEAR;
    /// Hardness σ₀ of the softer body.
    "/wear/hardness": Of("Stress"), "Hardness", "", HARDNESS;
    /// α; k_w = μα. It is constant, also if the friction changes.
    "/wear/energy_coefficient": Of("EnergyWear"), "Energy coefficient", "$α$", ENERGY_WEAR;
    /// The share of the wear volume that the first body, which carries the profile, loses; `bodies` of the result then says what each
    /// wears.
    "/wear/share": Of("Share"), "Wear share of body 1", "", RATIO;
    /// The two bodies, first the one that carries the profile. At least one body must never stop wearing: all its coefficients are
    /// above 0.
    "/wear/bodies": List("WornBody", 2, 2), "Wear of each body", "", PLAIN;
    /// The layers, from the surface inwards.
    "/wear/bodies/#/layers": List("Layer", 0, MAX_LAYERS), "Body #: layers", "", PLAIN;
    /// k_w of the material below the layers.
    "/wear/bodies/#/coefficient?layers": Of("WearRate"), "Body #, below the layers:", "$k_w$", WEAR;
    "/wear/bodies/#/coefficient": Part, "Body #:", "$k_w$", WEAR;
    /// Thickness of the layer.
    "/wear/bodies/#/layers/#/thickness": Of("Length"), "Body #, layer #: thickness", "", MICRO;
    /// k_w of the layer.
    "/wear/bodies/#/layers/#/coefficient": Of("WearRate"), "Body #, layer #:", "$k_w$", WEAR;

    forms:
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
}
