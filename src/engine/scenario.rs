//! A scenario in its canonical form: effective quantities in SI, nothing left out, 12 digits.
//!
//! Two requests that mean the same contact have the same canonical scenario and so the same key.
//! The engine runs the canonical numbers, never the request's, so that the digits of a result do not
//! depend on who asked first. Reading a canonical scenario again changes nothing.
//!
//! # Equations
//! ```text
//! 1/E* = Σ (1−ν²)/E,   1/G* = Σ (2−ν)/(4G),   G = E/(2(1+ν))           (6)
//! Δ = G*U/(μE*),       N₀ = a₀/(4 U k_w E*)                            (10), (18)
//! ```
//!
//! # Units
//! SI throughout. Here, and only here, units are divided out ([`Scenario::case`]); [`Scales`]
//! multiplies them back.
//!
//! # Sources
//! The paper, (6)–(10), (17), (18).

use deserr::{Deserr, IntoValue, ValuePointerRef};
use serde::Serialize;

use super::contact::{Contact, Regime};
use super::exact::Exact;
use super::fault::{Fault, Faults};
use super::indenter::{CanonicalProfile, canonical_profile, depth_under, indent};
use super::instants::{self, CanonicalProfilesAt};
use super::numeric::twelve_digits;
use super::profile::Shape;
use super::request::{self, Body, Length, Request, Stress};

/// The version of the engine's digits: it rises whenever a result changes in any digit.
pub const NUMERICS: u32 = 1;

/// The JSON Schema (2020-12) of a scenario.
pub const SCHEMA: &str = include_str!("scenario.schema.json");

/// Default of ξ in (14).
pub const DEFAULT_XI: f64 = 0.8;
/// Default relative error of the exact method.
pub const DEFAULT_TOLERANCE: f64 = 3e-3;
/// Default number of radii.
pub const DEFAULT_POINTS: u16 = 256;
/// Largest answer in bytes.
pub const MAX_ANSWER: usize = 64_000_000;
/// Smallest U/U_gs: below, the slip ring is lost in rounding.
const MIN_THRESHOLD: f64 = 1e-6;
/// Rounding U to 12 digits moves Δ by half of this: so close to 1 it is the onset of gross slip.
const ONSET: f64 = 1e-11;
/// A stick ratio must come back from the rounded amplitude as well as this.
const STICK_DIGITS: f64 = 1e-3;

/// Something the user should know; never a refusal.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Warning {
    /// A word for programs.
    pub kind: &'static str,
    /// A sentence for people.
    pub detail: String,
}

/// What a canonical scenario says, in SI.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scenario {
    profile: CanonicalProfile,
    moduli: Moduli,
    friction: f64,
    wear: Wear,
    load: Load,
    motion: Motion,
    cycles: Vec<f64>,
    profiles_at: CanonicalProfilesAt,
    model: Model,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Moduli {
    normal: f64,
    tangential: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Wear {
    coefficient: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Load {
    indentation_depth: f64,
    held: &'static str,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Motion {
    amplitude: f64,
    held: &'static str,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Model {
    method: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    xi: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tolerance: Option<f64>,
    points: u16,
}

/// The scales that make the contact dimensionless, and what multiplies results back into SI.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// a₀ in m.
    pub contact_radius: f64,
    /// d₀ in m.
    pub indentation_depth: f64,
    /// N₀.
    pub cycles: f64,
    /// U in m.
    pub amplitude: f64,
    /// E* in Pa.
    pub normal_modulus: f64,
    /// G* in Pa.
    pub tangential_modulus: f64,
    /// μ.
    pub friction: f64,
    /// k_w in 1/Pa.
    pub wear_coefficient: f64,
}

impl Scales {
    /// E*a₀d₀ in N.
    #[must_use]
    pub fn force(&self) -> f64 {
        self.normal_modulus * self.contact_radius * self.indentation_depth
    }

    /// E*d₀/a₀ in Pa.
    #[must_use]
    pub fn pressure(&self) -> f64 {
        self.normal_modulus * self.indentation_depth / self.contact_radius
    }

    /// a₀²d₀ in m³.
    #[must_use]
    pub fn volume(&self) -> f64 {
        self.contact_radius * self.contact_radius * self.indentation_depth
    }

    /// U at Δ = 1: the amplitude from which the whole contact slips, in m.
    #[must_use]
    pub fn gross_slip_amplitude(&self) -> f64 {
        self.friction * self.normal_modulus / self.tangential_modulus * self.indentation_depth
    }
}

/// How wear is computed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// The rule (14).
    Simplified {
        /// ξ.
        xi: f64,
    },
    /// Local pressure times local slip.
    Exact {
        /// The relative error aimed at.
        tolerance: f64,
    },
}

/// A scenario made ready for computing: dimensionless, with the scales that lead back.
#[derive(Debug, Clone, PartialEq)]
pub struct Case {
    /// The contact.
    pub contact: Contact,
    /// The way back to SI.
    pub scales: Scales,
    /// How wear is computed.
    pub method: Method,
    /// Output radii.
    pub points: usize,
    /// The instants in cycles, 0 first.
    pub cycles: Vec<f64>,
    /// Whether each instant carries profiles; all false where the answer has none at all.
    pub profiles: Vec<bool>,
}

impl Case {
    /// Regime of the unworn state.
    #[must_use]
    pub fn regime(&self) -> Regime {
        self.contact.regime
    }

    /// Rows of each profile matrix.
    #[must_use]
    pub fn profile_rows(&self) -> usize {
        self.profiles.iter().filter(|carries| **carries).count()
    }

    /// Multiplications in matrices, about: what a run costs.
    #[must_use]
    pub fn operations(&self) -> f64 {
        let half_square = (self.points * self.points) as f64 / 2.0;
        match self.method {
            Method::Simplified { .. } => {
                half_square * (self.cycles.len() + self.profile_rows()) as f64
            }
            Method::Exact { tolerance } => {
                let duration = self.cycles.last().map_or(0.0, |last| last / self.scales.cycles);
                Exact::operations(tolerance, duration)
                    + (self.points * self.profile_rows() + self.cycles.len()) as f64
            }
        }
    }

    /// About how many bytes the answer takes as JSON.
    #[must_use]
    pub fn answer_bytes(&self) -> usize {
        const NUMBER: usize = 22;
        let curves = if self.profile_rows() == 0 { 0 } else { 3 + 5 * self.profile_rows() };
        4096 + NUMBER * (self.points * curves + 13 * self.cycles.len())
    }
}

/// Reads a scenario; `prefix` goes before every fault's pointer (`/scenario` in a job body).
///
/// # Errors
/// Every fault, each with a JSON pointer and a sentence that says what to change.
pub fn check(value: &serde_json::Value, prefix: &str) -> Result<(Scenario, Vec<Warning>), Faults> {
    let request =
        Request::deserialize_from_value(value.clone().into_value(), ValuePointerRef::Origin)
            .map_err(|faults| faults.below(prefix))?;
    let scenario = Scenario::resolve(&request).map_err(|faults| faults.below(prefix))?;
    let case = scenario.case().map_err(|fault| Faults(vec![fault]).below(prefix))?;
    let mut warnings = body_warnings(&request, &case);
    warnings.extend(scenario.warnings(&case));
    Ok((scenario, warnings))
}

/// What follows from the request must itself be acceptable, or the echo would be refused.
fn derived(
    x: f64,
    (low, high): (f64, f64),
    what: &str,
    unit: &str,
    pointer: &str,
) -> Result<(), Faults> {
    if (low..=high).contains(&x) {
        return Ok(());
    }
    let detail = format!("gives {what} {x:e} {unit}; it must lie between {low:e} and {high:e}");
    Err(Faults::one(pointer, detail))
}

impl Scenario {
    /// Brings a request into canonical form.
    fn resolve(request: &Request) -> Result<Self, Faults> {
        let friction = twelve_digits(request.friction.0);
        let moduli = moduli(request)?;
        let coefficient = twelve_digits(request.wear.coefficient(friction));
        derived(coefficient, request::WEAR_RANGE, "a wear coefficient of", "1/Pa", "/wear")?;
        let profile = canonical_profile(&request.profile);
        let (depth, contact_radius, shape) = press(request, &profile, moduli.normal)?;
        let gross_slip = friction * moduli.normal / moduli.tangential * depth;
        let amplitude = amplitude(request, &shape, gross_slip)?;
        let unit = contact_radius / (4.0 * amplitude * coefficient * moduli.normal);
        let (cycles, profiles_at) =
            instants::canonical(&request.cycles, request.profiles_at.0.as_ref(), unit)?;
        let points = request.model.points.0.map_or(DEFAULT_POINTS, |points| points.0);
        let xi = twelve_digits(request.model.xi.0.map_or(DEFAULT_XI, |xi| xi.0));
        let tolerance = request.model.tolerance.0.map_or(DEFAULT_TOLERANCE, |given| given.0);
        let tolerance = twelve_digits(tolerance);
        // What a method ignores is left out, so that it makes no difference.
        let model = match request.model.method {
            request::Method::Simplified => {
                Model { method: "simplified", xi: Some(xi), tolerance: None, points }
            }
            request::Method::Exact => {
                Model { method: "exact", xi: None, tolerance: Some(tolerance), points }
            }
        };
        Ok(Self {
            profile,
            moduli,
            friction,
            wear: Wear { coefficient },
            load: Load { indentation_depth: depth, held: "depth" },
            motion: Motion { amplitude, held: "amplitude" },
            cycles,
            profiles_at,
            model,
        })
    }

    /// Divides the units out.
    ///
    /// # Errors
    /// A fault where the numbers, each fine alone, have no answer together.
    pub fn case(&self) -> Result<Case, Fault> {
        let fault = |pointer: &str, detail: String| Fault { pointer: pointer.to_owned(), detail };
        let depth = self.load.indentation_depth;
        let (contact_radius, shape) = indent(&self.profile, depth)
            .ok_or_else(|| self.profile.refusal(depth, "/load/indentation_depth"))?;
        let Moduli { normal, tangential } = self.moduli;
        let amplitude = self.motion.amplitude;
        let threshold = tangential * amplitude / (self.friction * normal * depth);
        let threshold = if (threshold - 1.0).abs() < ONSET { 1.0 } else { threshold };
        let contact = Contact::new(shape, threshold)
            .ok_or_else(|| self.profile.outgrown(depth, threshold))?;
        let scales = Scales {
            contact_radius,
            indentation_depth: depth,
            cycles: contact_radius / (4.0 * amplitude * self.wear.coefficient * normal),
            amplitude,
            normal_modulus: normal,
            tangential_modulus: tangential,
            friction: self.friction,
            wear_coefficient: self.wear.coefficient,
        };
        let mut cycles = self.cycles.clone();
        if cycles.first().is_none_or(|first| *first > 0.0) {
            cycles.insert(0, 0.0);
        }
        let profiles = match &self.profiles_at {
            CanonicalProfilesAt::Word("none") => vec![false; cycles.len()],
            // Row 0 of the profiles is always the unworn state.
            CanonicalProfilesAt::Word("all") => vec![true; cycles.len()],
            CanonicalProfilesAt::Word(_) => {
                (0..cycles.len()).map(|i| i == 0 || i + 1 == cycles.len()).collect()
            }
            CanonicalProfilesAt::At(list) => {
                cycles.iter().map(|n| *n == 0.0 || list.contains(n)).collect()
            }
        };
        let points = usize::from(self.model.points);
        let method = match self.model {
            Model { tolerance: Some(tolerance), .. } => Method::Exact { tolerance },
            Model { xi, .. } => Method::Simplified { xi: xi.unwrap_or(DEFAULT_XI) },
        };
        let case = Case { contact, scales, method, points, cycles, profiles };
        if case.answer_bytes() > MAX_ANSWER {
            let detail = format!(
                "the answer would take about {} MB, and {} MB is the most: ask for profiles at \
                 fewer instants (\"profiles_at\"), or for fewer points",
                case.answer_bytes() / 1_000_000,
                MAX_ANSWER / 1_000_000
            );
            return Err(fault("/profiles_at", detail));
        }
        Ok(case)
    }

    /// What the canonical numbers themselves give reason to warn of.
    #[must_use]
    pub fn warnings(&self, case: &Case) -> Vec<Warning> {
        let Scales { contact_radius: a, indentation_depth: d, cycles, amplitude, .. } = case.scales;
        let slope = case.contact.shape.slope(1.0) * d / a;
        let mut warnings = Vec::new();
        let mut warn = |kind, detail| warnings.push(Warning { kind, detail });
        if slope > 0.3 {
            let detail = format!(
                "The indenter's slope at the edge of contact is {slope:.2} (a₀/R for a paraboloid); \
                 half-space theory holds for slopes well below 0.3."
            );
            warn("large_contact", detail);
        }
        if cycles < 50.0 {
            let detail = format!(
                "N₀ = {cycles:.3}: the profile changes within a single cycle, which the averaging \
                 over cycles neglects; results are meaningful for N₀ of 50 and more."
            );
            warn("fast_wear", detail);
        }
        if amplitude > a {
            let detail = format!(
                "The amplitude ({amplitude:.3e} m) exceeds the contact radius ({a:.3e} m): this is \
                 sliding wear, where the counterbody is not always covered."
            );
            warn("large_amplitude", detail);
        }
        let simplified = matches!(case.method, Method::Simplified { .. });
        if simplified && case.regime() == Regime::GrossSlip {
            let detail = "The whole contact slips; the simplified rule was fitted to partial slip.";
            warn("simplified_gross_slip", detail.to_owned());
        }
        warnings
    }
}

/// E* and G*, (6).
fn moduli(request: &Request) -> Result<Moduli, Faults> {
    let (normal, tangential) = match (&request.moduli.0, &request.bodies.0) {
        (Some(moduli), _) => (moduli.normal.0, moduli.tangential.0),
        (None, bodies) => {
            let bodies = bodies.as_ref().map_or(&[][..], |bodies| &bodies.0);
            let normal: f64 = bodies
                .iter()
                .map(|body| {
                    (1.0 - body.poisson_ratio.0 * body.poisson_ratio.0) / body.youngs_modulus.0
                })
                .sum();
            let tangential: f64 = bodies
                .iter()
                .map(|body| (2.0 - body.poisson_ratio.0) / (4.0 * shear_modulus(body)))
                .sum();
            (1.0 / normal, 1.0 / tangential)
        }
    };
    let (normal, tangential) = (twelve_digits(normal), twelve_digits(tangential));
    derived(normal, Stress::RANGE, "a normal modulus E* of", "Pa", "/bodies")?;
    derived(tangential, Stress::RANGE, "a tangential modulus G* of", "Pa", "/bodies")?;
    Ok(Moduli { normal, tangential })
}

/// d, a₀ and the normalised shape of the unworn contact.
fn press(
    request: &Request,
    profile: &CanonicalProfile,
    normal_modulus: f64,
) -> Result<(f64, f64, Shape), Faults> {
    let (depth, pointer) = match (request.load.indentation_depth.0, request.load.normal_force.0) {
        (None, Some(force)) => {
            (depth_under(profile, force.0 / normal_modulus), "/load/normal_force")
        }
        (depth, _) => (depth.map_or(0.0, |depth| depth.0), "/load/indentation_depth"),
    };
    let depth = twelve_digits(depth);
    let (contact_radius, shape) =
        indent(profile, depth).ok_or_else(|| Faults(vec![profile.refusal(depth, pointer)]))?;
    derived(depth, Length::RANGE, "an indentation depth of", "m", pointer)?;
    Ok((depth, contact_radius, shape))
}

/// U, given or from the stick ratio; `gross_slip` is the amplitude at which all slips.
fn amplitude(request: &Request, shape: &Shape, gross_slip: f64) -> Result<f64, Faults> {
    let (amplitude, pointer) = match (request.motion.stick_ratio.0, request.motion.amplitude.0) {
        (Some(ratio), _) => (gross_slip * (1.0 - shape.image(ratio.0)), "/motion/stick_ratio"),
        (None, amplitude) => (amplitude.map_or(0.0, |u| u.0), "/motion/amplitude"),
    };
    let amplitude = twelve_digits(amplitude);
    derived(amplitude, Length::RANGE, "an amplitude of", "m", pointer)?;
    let least = MIN_THRESHOLD * gross_slip;
    if amplitude < least {
        let detail = format!(
            "gives an amplitude of {amplitude:.3e} m, but the slip ring can be resolved only from \
             {least:.3e} m on (1e-6 of the gross-slip amplitude)"
        );
        return Err(Faults::one(pointer, detail));
    }
    if let Some(ratio) = request.motion.stick_ratio.0 {
        let returned = shape.image_inverse((1.0 - amplitude / gross_slip).max(0.0));
        if (returned - ratio.0).abs() > STICK_DIGITS * ratio.0 && ratio.0 > 0.0 {
            let detail = format!(
                "{} is so close to gross slip under this profile, or under its flat, that 12 digits \
                 of the amplitude cannot tell; take 0 for the onset of gross slip, or a larger ratio",
                ratio.0
            );
            return Err(Faults::one(pointer, detail));
        }
    }
    Ok(amplitude)
}

fn shear_modulus(body: &Body) -> f64 {
    body.youngs_modulus.0 / (2.0 * (1.0 + body.poisson_ratio.0))
}

/// Warnings of what the canonical form no longer knows.
fn body_warnings(request: &Request, case: &Case) -> Vec<Warning> {
    let Some(bodies) = &request.bodies.0 else {
        return Vec::new();
    };
    let mut warnings = Vec::new();
    let [first, second] =
        bodies.0.map(|body| (1.0 - 2.0 * body.poisson_ratio.0) / shear_modulus(&body));
    if (first - second).abs() > 1e-6 * first.abs().max(second.abs()) {
        let detail = format!(
            "The bodies are not elastically similar: (1−2ν)/G is {first:.3e} and {second:.3e} 1/Pa. \
             Normal and tangential contact are then coupled, which is neglected here."
        );
        warnings.push(Warning { kind: "elastic_mismatch", detail });
    }
    let peak = case.contact.shape.peak_pressure() * case.scales.pressure();
    for (index, body) in bodies.0.iter().enumerate() {
        if let Some(strength) = body.yield_strength.0
            && peak > 1.6 * strength.0
        {
            let peak = if peak.is_finite() {
                format!("{:.0} MPa", peak / 1e6)
            } else {
                "infinite at an apex or an edge".to_owned()
            };
            let detail = format!(
                "The unworn peak pressure ({peak}) exceeds 1.6 times the yield strength of body \
                 {index} ({:.0} MPa): it yields, which is not modelled.",
                strength.0 / 1e6
            );
            warnings.push(Warning { kind: "yield", detail });
        }
    }
    warnings
}
