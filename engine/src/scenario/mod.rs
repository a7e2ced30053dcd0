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

mod indenter;
mod instants;
mod load;
mod motion;

use deserr::{Deserr, IntoValue, ValuePointerRef};
use serde::Serialize;

use crate::case::{Case, Method, Scales};
use crate::contact::unworn::Contact;
use crate::numeric::twelve_digits;
use crate::request::fault::{Fault, Faults};
use crate::request::fields::{Stress, WEAR_RANGE, derived};
use crate::request::{self, Body, Request};
use crate::solver::events::Until;
use crate::solver::stepped::law::Law;
use crate::solver::stepped::march::March;
use indenter::{CanonicalProfile, canonical_profile};
use instants::CanonicalProfilesAt;
use load::{CanonicalLoad, canonical_load, press};
use motion::{CanonicalMotion, Pressed};

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
    load: CanonicalLoad,
    motion: CanonicalMotion,
    cycles: Vec<f64>,
    profiles_at: CanonicalProfilesAt,
    #[serde(skip_serializing_if = "Option::is_none")]
    until: Option<CanonicalUntil>,
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
    #[serde(skip_serializing_if = "Option::is_none")]
    share: Option<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
enum CanonicalUntil {
    WearDepth(f64),
    WearVolume(f64),
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Model {
    method: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    xi: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    tolerance: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    compare: Option<bool>,
    points: u16,
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

impl Scenario {
    /// Brings a request into canonical form.
    fn resolve(request: &Request) -> Result<Self, Faults> {
        let friction = twelve_digits(request.friction.0);
        let moduli = moduli(request)?;
        let coefficient = twelve_digits(request.wear.coefficient(friction));
        derived(coefficient, WEAR_RANGE, "a wear coefficient of", "1/Pa", "/wear")?;
        let profile = canonical_profile(&request.profile);
        let load = canonical_load(request, &profile, moduli.normal)?;
        let (depth, contact_radius, shape) = press(&profile, &load, moduli.normal)?;
        let gross_slip = friction * moduli.normal / moduli.tangential * depth;
        let pressed = Pressed {
            shape: &shape,
            contact_radius,
            friction,
            force: moduli.normal * contact_radius * depth,
            tangential_modulus: moduli.tangential,
            gross_slip,
            normal: load.normal(),
        };
        let motion = CanonicalMotion::resolve(&request.motion, &pressed)?;
        let (_, threshold) = motion.control(load.normal(), &pressed, 1.0)?;
        let amplitude = motion.amplitude(threshold, gross_slip);
        let unit = contact_radius / (4.0 * amplitude * coefficient * moduli.normal);
        let fixed = match &motion {
            CanonicalMotion::Blocks { .. } => Some("blocks"),
            CanonicalMotion::Reversals { .. } => Some("reversals"),
            _ => None,
        };
        if let Some(fixed) = fixed.filter(|_| request.cycles.normalized) {
            let detail = format!("cannot be combined with `{fixed}`: give the instants in cycles");
            return Err(Faults::one("/cycles/normalized", detail));
        }
        let (cycles, profiles_at) =
            instants::canonical(&request.cycles, request.profiles_at.0.as_ref(), unit)?;
        if let Some(end) = motion.end()
            && let Some(late) = cycles.iter().position(|n| *n > end)
        {
            let detail = format!("is {} cycles, but the last block ends at {end}", cycles[late]);
            return Err(Faults::one(&format!("/cycles/{late}"), detail));
        }
        let points = request.model.points.0.map_or(DEFAULT_POINTS, |points| points.0);
        let xi = twelve_digits(request.model.xi.0.map_or(DEFAULT_XI, |xi| xi.0));
        let tolerance = request.model.tolerance.0.map_or(DEFAULT_TOLERANCE, |given| given.0);
        let tolerance = twelve_digits(tolerance);
        // What a method ignores is left out, so that it makes no difference.
        let model = match request.model.method {
            request::Method::Simplified => {
                Model { method: "simplified", xi: Some(xi), tolerance: None, compare: None, points }
            }
            request::Method::Exact => {
                let compare = request.model.compare.0.filter(|compare| *compare);
                let xi = compare.map(|_| xi);
                Model { method: "exact", xi, tolerance: Some(tolerance), compare, points }
            }
        };
        Ok(Self {
            profile,
            moduli,
            friction,
            wear: Wear {
                coefficient,
                share: request.wear.share.0.map(|share| twelve_digits(share.0)),
            },
            load,
            motion,
            cycles,
            profiles_at,
            until: request.until.0.and_then(|until| {
                let depth =
                    until.wear_depth.0.map(|w| CanonicalUntil::WearDepth(twelve_digits(w.0)));
                let volume =
                    until.wear_volume.0.map(|v| CanonicalUntil::WearVolume(twelve_digits(v.0)));
                depth.or(volume)
            }),
            model,
        })
    }

    /// Divides the units out.
    ///
    /// # Errors
    /// A fault where the numbers, each fine alone, have no answer together.
    pub fn case(&self) -> Result<Case, Fault> {
        let fault = |pointer: &str, detail: String| Fault { pointer: pointer.to_owned(), detail };
        let Moduli { normal, tangential } = self.moduli;
        let (depth, contact_radius, shape) =
            press(&self.profile, &self.load, normal).map_err(first)?;
        let gross_slip = self.friction * normal / tangential * depth;
        let pressed = Pressed {
            shape: &shape,
            contact_radius,
            friction: self.friction,
            force: normal * contact_radius * depth,
            tangential_modulus: tangential,
            gross_slip,
            normal: self.load.normal(),
        };
        let held = |unit| self.motion.control(self.load.normal(), &pressed, unit).map_err(first);
        let (_, threshold) = held(1.0)?;
        let amplitude = self.motion.amplitude(threshold, gross_slip);
        let unit = contact_radius / (4.0 * amplitude * self.wear.coefficient * normal);
        let (control, threshold) = held(unit)?;
        let contact = Contact::new(shape, threshold)
            .ok_or_else(|| self.profile.outgrown(depth, threshold))?;
        let tends_to = control.tends_to(&contact);
        let last = self.cycles.last().map_or(0.0, |last| last / unit);
        let law = match self.model.tolerance {
            Some(_) => Law::Exact,
            None => Law::Simplified(self.model.xi.unwrap_or(DEFAULT_XI)),
        };
        if !March::fits(&contact, &control, law, tends_to.as_ref(), last) {
            let Fault { pointer, detail } = self.profile.outgrown(depth, threshold);
            let detail = format!("{detail}; or ask for fewer cycles");
            return Err(Fault { pointer, detail });
        }
        let scales = Scales {
            contact_radius,
            indentation_depth: depth,
            cycles: unit,
            amplitude,
            normal_modulus: normal,
            tangential_modulus: tangential,
            friction: self.friction,
            wear_coefficient: self.wear.coefficient,
        };
        let until = match self.until {
            None => Until::default(),
            Some(CanonicalUntil::WearDepth(w)) => {
                Until { depth: Some(w / depth), ..Until::default() }
            }
            Some(CanonicalUntil::WearVolume(v)) => {
                Until { volume: Some(v / scales.volume()), ..Until::default() }
            }
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
            Model { tolerance: Some(tolerance), compare, xi, .. } => {
                let compare = compare.and(xi);
                Method::Exact { tolerance, compare }
            }
            Model { xi, .. } => Method::Simplified { xi: xi.unwrap_or(DEFAULT_XI) },
        };
        let share = self.wear.share;
        let case = Case {
            contact,
            control,
            tends_to,
            until,
            share,
            scales,
            method,
            points,
            cycles,
            profiles,
        };
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
        let Scales { contact_radius: a, indentation_depth: d, .. } = case.scales;
        // Of blocks the largest counts; a record may hold many loops.
        let times = case.largest_amplitude();
        let amplitude = times * case.scales.amplitude;
        let cycles = case.scales.cycles / (times * case.loops_per_cycle());
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
        if simplified && case.contact.threshold * times >= 1.0 {
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

/// The first of some faults.
fn first(faults: Faults) -> Fault {
    let unknown = || Fault { pointer: String::new(), detail: "cannot be computed".to_owned() };
    faults.0.into_iter().next().unwrap_or_else(unknown)
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
