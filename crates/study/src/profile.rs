//! Profiles of a sweep: curves of each run after its last output cycle, at radii that all runs share.

use deserr::Deserr;
use fretwork_engine::{Dimension, Faults, Given, Outcome, Profiles, Valid};
use serde_json::Value;

use super::vary::{self, MAX_RADII};
use fretwork_json::{Distinct, typed, words};

words! {
    /// A curve over the radius.
    #[derive(Deserr)]
    #[deserr(error = Faults, rename_all = lowercase)]
    pub enum Field: "curve" {
        /// Wear w ≥ 0.
        Wear = "wear",
        /// Worn profile f = f₀ + w.
        Worn = "worn",
        /// Pressure p.
        Pressure = "pressure",
        /// Amplitude of the local slip.
        Slip = "slip",
    }
}

/// The member `profiles` of a sweep.
#[derive(Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
struct ProfileBody {
    radius: Value,
    #[deserr(default)]
    fields: Given<Distinct<Field, 4>>,
}

/// Which curves a sweep keeps of each run.
#[derive(Debug, Clone, PartialEq)]
pub struct CommonProfiles {
    /// The radii in SI, ascending.
    pub radii: Vec<f64>,
    /// The curves.
    pub fields: Vec<Field>,
    /// If the wear is that of one body: the index of this body.
    pub body: Option<usize>,
}

impl Field {
    /// The SI unit.
    pub fn unit(self) -> &'static str {
        if self == Self::Pressure { "Pa" } else { "m" }
    }

    /// The last curve of this field over the output radii of a run, and the value beyond the last radius.
    fn of(self, profiles: &Profiles) -> Option<(&[f64], Option<f64>)> {
        // The last output radius lies outside of the contact, where wear and pressure are 0.
        let (rows, outside) = match self {
            Self::Wear => (&profiles.wear, Some(0.0)),
            Self::Pressure => (&profiles.pressure, Some(0.0)),
            Self::Worn => (&profiles.worn, None),
            Self::Slip => (&profiles.slip, None),
        };
        Some((rows.last()?, outside))
    }
}

impl CommonProfiles {
    /// Reads the member `profiles` of a sweep.
    ///
    /// # Errors
    /// All faults, with pointers relative to `profiles`.
    pub fn read(profiles: Value) -> Valid<Self> {
        let ProfileBody { radius, fields } = typed(profiles)?;
        let radii = vary::list_or_range(radius, Dimension::Length)
            .map_err(|faults| faults.below("/radius"))?;
        let wrong = |detail: String| Err(Faults::one("/radius", detail));
        if radii.len() as u64 > MAX_RADII {
            return wrong(format!("gives {} radii. At most {MAX_RADII} are accepted", radii.len()));
        }
        let is_ascending = radii.is_sorted_by(|one, next| one < next);
        if !is_ascending || radii.iter().any(|radius| !radius.is_finite() || *radius < 0.0) {
            return wrong("must be radii from 0 on, each larger than the one before".to_owned());
        }
        let fields = fields.0.map_or_else(|| vec![Field::Wear], |Distinct(fields)| fields);
        if fields.is_empty() {
            return Err(Faults::one("/fields", "must list at least one curve, such as \"wear\""));
        }
        Ok(Self { radii, fields, body: None })
    }

    /// The curves of a run after its last output cycle at the radii of the study, interpolated linearly between the
    /// output radii of the run. Beyond them, a value is missing unless it is 0 there. An infinite value is also
    /// missing.
    ///
    /// `None` if the run has no profiles after its last output cycle.
    pub fn of(&self, outcome: &Outcome) -> Option<Vec<Vec<Option<f64>>>> {
        let is_last = |of: &&Profiles| of.cycles.last() == outcome.history.cycles.last();
        let profiles = outcome.profiles.as_ref().filter(is_last)?;
        let share = |body: usize| {
            let depth = outcome.bodies[body].wear_depth.as_ref()?.last()?;
            Some(depth / outcome.history.wear_depth.last()?)
        };
        let share = self.body.map_or(Some(1.0), share)?;
        let curves = self.fields.iter().map(|field| {
            let (curve, outside) = field.of(profiles)?;
            let finite = |value: f64| Some(share * value).filter(|value| value.is_finite());
            let at = |radius: &f64| at(&profiles.radius, curve, *radius).map_or(outside, finite);
            Some(self.radii.iter().map(at).collect())
        });
        curves.collect()
    }

    /// The curves of a point without a run: all values are missing.
    pub fn missing(&self) -> Vec<Vec<Option<f64>>> {
        vec![vec![None; self.radii.len()]; self.fields.len()]
    }
}

/// The value of a curve at a radius, interpolated linearly. `None` beyond the last radius of the curve. The value is
/// not finite next to an infinite value.
fn at(radii: &[f64], curve: &[f64], radius: f64) -> Option<f64> {
    let next = radii.partition_point(|known| *known < radius);
    let (known, value) = (*radii.get(next)?, *curve.get(next)?);
    let Some(before) = next.checked_sub(1) else { return Some(value) };
    let rest = (known - radius) / (known - radii[before]);
    Some(value - rest * (value - curve[before]))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn radii_are_a_list_or_a_range() {
        let radii =
            |radius: Value| CommonProfiles::read(json!({"radius": radius})).map(|it| it.radii);
        assert_eq!(radii(json!([0, "32 um", 1e-4])).unwrap(), [0.0, 32e-6, 1e-4]);
        let range = json!({"from": 0, "to": "64 um", "count": 5});
        assert_eq!(radii(range).unwrap(), [0.0, 16e-6, 32e-6, 48e-6, 64e-6]);
        for (bad, pointer, words) in [
            (json!([1e-6, 0]), "/radius", "larger than the one before"),
            (json!([-1e-6]), "/radius", "from 0 on"),
            (json!(["1 N"]), "/radius/0", "a length is needed"),
            (json!({"from": 0, "to": 1e-4}), "/radius/count", "missing"),
            (
                json!({"from": 0, "to": 1e-4, "count": 2, "values": [1]}),
                "/radius/values",
                "unknown",
            ),
            (json!({"from": 0, "to": 1, "count": 1001}), "/radius/count", "from 2 to 1000"),
            (json!(vec![1; 1001]), "/radius", "At most 1000"),
        ] {
            let Faults(faults) = radii(bad.clone()).unwrap_err();
            assert_eq!(faults[0].pointer, pointer, "{bad}");
            assert!(faults[0].detail.contains(words), "{bad}: {}", faults[0].detail);
        }
        let Faults(faults) =
            CommonProfiles::read(json!({"radius": [0], "fields": ["depth"]})).unwrap_err();
        assert_eq!(faults[0].pointer, "/fields/0");
    }

    #[test]
    fn a_curve_is_linear_between_its_radii_and_ends_with_them() {
        let (radii, curve) = ([1.0, 2.0, 4.0, 5.0], [10.0, 20.0, 0.0, f64::INFINITY]);
        let values = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0].map(|radius| at(&radii, &curve, radius));
        let expected = [Some(10.0), Some(15.0), Some(20.0), Some(10.0), Some(0.0), None];
        assert_eq!(values, expected);
        assert!(!at(&radii, &curve, 4.5).unwrap().is_finite());
    }
}
