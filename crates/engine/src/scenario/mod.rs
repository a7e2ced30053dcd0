//! A scenario in canonical form: effective quantities in SI units with 12 digits, including all
//! defaults.
//!
//! Requests with the same meaning have the same canonical scenario and therefore the same key. The
//! engine computes with the canonical numbers and not with those of the request. So the digits of a
//! result do not depend on the form of the request. The canonical form of a canonical scenario is
//! the same scenario.
//!
//! # Equations
//! ```text
//! 1/E* = Σ (1−ν²)/E,   1/G* = Σ (2−ν)/(4G),   G = E/(2(1+ν))           (6)
//! Δ = G*U/(μE*),       N₀ = a₀/(4 U k_w E*)                            (10), (18)
//! ```
//!
//! # Units
//! SI units. [`Scenario::case`] makes the problem dimensionless, and [`Scales`] converts the
//! results to SI.
//!
//! # Sources
//! The paper, (6)–(10), (17), (18).

mod indenter;
mod instants;
mod line;
mod load;
mod motion;
mod pressed;
mod round;
mod schema;
pub mod work_done;

use std::borrow::Cow;
use std::sync::Arc;

use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use crate::case::{self, Case, Method, Scales};
use crate::contact;
use crate::contact::course::Course;
use crate::contact::doubts::Doubts;
use crate::contact::layers::Layers;
use crate::contact::yielding::Rubbing;
use crate::contact::{Contact, Over, Track};
use crate::input::fields::derived;
use crate::input::{
    ChangeTable, Changing, ElasticBody, Faults, Given, GivenXi, LAST_CYCLE, Measure, MethodName,
    Model, ProfilesAt, Request, Stress, Until, Valid, Wear, WearCoefficient, WearLaw, WornBody, Xi,
    changing,
};
use crate::numeric::twelve_digits;
use crate::solver::events::StopCondition;
use crate::solver::stepped::law::{WearProblem, fitted_xi};
use crate::solver::stepped::march::March;
use indenter::Indenter;
use instants::{CanonicalCycles, with_profiles};
use load::{CanonicalLoad, CanonicalModuli, canonical_load};
use motion::CanonicalMotion;
use pressed::UnwornContact;
pub use schema::SCHEMA;

/// The version of the numerics. It increases when any digit of a result changes.
pub const NUMERICS: u32 = 5;

/// Default target relative error of the exact method.
pub const DEFAULT_TOLERANCE: f64 = 3e-3;
/// Default number of output radii.
pub const DEFAULT_POINTS: u16 = 256;
/// Maximum estimated size of a result, in bytes.
pub const MAX_ANSWER: usize = 64_000_000;
/// Differences of two interpolants of a table, and of the ring that slips by its noise, above which a run has a warning.
const MOST_INTERPOLATED: f64 = 0.1;
const MOST_WIDENED: f64 = 0.012;

/// A warning about a scenario. It does not prevent a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct Warning {
    /// A stable code for programs.
    pub kind: Cow<'static, str>,
    /// A sentence for the user.
    pub detail: String,
}

/// A canonical scenario, in SI.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scenario {
    profile: Indenter,
    moduli: CanonicalModuli,
    friction: Changing,
    wear: CanonicalWear,
    load: CanonicalLoad,
    motion: CanonicalMotion,
    cycles: CanonicalCycles,
    profiles_at: ProfilesAt,
    #[serde(skip_serializing_if = "Given::is_absent")]
    until: Given<Until>,
    model: CanonicalModel,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
enum CanonicalWear {
    Both {
        coefficient: Changing,
        #[serde(skip_serializing_if = "Option::is_none")]
        share: Option<f64>,
    },
    Layered {
        bodies: [WornBody; 2],
    },
}

impl CanonicalWear {
    fn of(wear: &Wear, friction: &Changing) -> Valid<Self> {
        let given = match &wear.law {
            WearLaw::Layered(bodies) => return Ok(Self::Layered { bodies: bodies.clone() }),
            WearLaw::PerLoad(coefficient) => coefficient.clone(),
            WearLaw::PerEnergy(alpha) => friction.times(*alpha),
        };
        for coefficient in given.values() {
            derived(
                *coefficient,
                WearCoefficient::RANGE,
                "a wear coefficient of",
                "1/Pa",
                "/wear",
            )?;
        }
        Ok(Self::Both { coefficient: given, share: wear.share })
    }

    /// The coefficient of both bodies together at cycle 0. If the surface does not wear, it is that of the materials
    /// below which wear most.
    fn first(&self) -> f64 {
        match self {
            Self::Both { coefficient, .. } => coefficient.values()[0],
            Self::Layered { bodies } => {
                let surface: f64 = bodies
                    .iter()
                    .map(|body| {
                        body.layers.0.first().map_or(body.coefficient, |it| it.coefficient).0
                    })
                    .sum();
                let most = |body: &WornBody| {
                    let layers = body.layers.0.iter().map(|layer| layer.coefficient.0);
                    layers.fold(body.coefficient.0, f64::max)
                };
                if surface > 0.0 { surface } else { bodies.iter().map(most).sum() }
            }
        }
    }

    fn share(&self) -> Option<f64> {
        match self {
            Self::Both { share, .. } => *share,
            Self::Layered { .. } => None,
        }
    }

    /// The layers in units of the unworn contact.
    fn layers(&self, scales: &Scales) -> Option<Layers> {
        let Self::Layered { bodies } = self else { return None };
        Some(Layers::of(bodies.each_ref().map(|body| {
            let layer = |thickness: f64, coefficient: f64| contact::layers::Layer {
                thickness: thickness / scales.indentation_depth,
                coefficient: coefficient / scales.wear_coefficient,
            };
            let layers = body.layers.0.iter().map(|it| layer(it.thickness.0, it.coefficient.0));
            layers.chain([layer(f64::INFINITY, body.coefficient.0)]).collect()
        })))
    }
}

/// How the coefficients change, in units of the unworn contact. `None` if they are constant.
fn course(friction: &Changing, wear: &CanonicalWear, scales: &Scales) -> Option<Course> {
    let track = |changing: &Changing| {
        let Changing::Table(ChangeTable { over, at, values }) = changing else { return None };
        let (over, unit): (_, &dyn Fn(f64) -> f64) = match over {
            changing::Over::Cycles => (Over::Time, &|cycles| cycles / scales.cycles),
            changing::Over::DissipatedEnergy => (Over::Energy, &|energy| scales.worn_by(energy)),
        };
        let at = at.iter().map(|x| unit(*x)).collect();
        Some(Track::through(over, at, values.iter().map(|value| value / values[0]).collect()))
    };
    let wear = match wear {
        CanonicalWear::Both { coefficient, .. } => track(coefficient),
        CanonicalWear::Layered { .. } => None,
    };
    let friction = track(friction);
    (friction.is_some() || wear.is_some()).then_some(Course { friction, wear })
}

/// The settings that the method uses. Other settings are omitted, so that they do not change the
/// key.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "method", rename_all = "lowercase")]
enum CanonicalModel {
    Simplified {
        xi: f64,
        points: u16,
    },
    Exact {
        #[serde(skip_serializing_if = "Option::is_none")]
        xi: Option<f64>,
        tolerance: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        compare: Option<bool>,
        points: u16,
    },
}

/// The condition that ends a run, in dimensionless form.
fn stop_condition(until: &Until, scales: &Scales) -> StopCondition {
    StopCondition {
        depth: until.wear_depth.0.map(|depth| depth.0 / scales.indentation_depth),
        volume: until.wear_volume.0.map(|volume| volume.0 / scales.volume()),
        energy: until.dissipated_energy.0.map(|energy| scales.worn_by(energy.0)),
    }
}

impl CanonicalModel {
    /// The settings of a request. `stick_ratio` determines ξ if the request gives no number.
    fn of(model: &Model, stick_ratio: impl FnOnce() -> f64) -> Self {
        let points = model.points.0.map_or(DEFAULT_POINTS, |points| points.0);
        let xi = || {
            twelve_digits(match model.xi {
                GivenXi::Auto => fitted_xi(stick_ratio()),
                GivenXi::Number(Xi(xi)) => xi,
            })
        };
        let tolerance = model.tolerance.0.map_or(DEFAULT_TOLERANCE, |given| given.0);
        match model.method {
            MethodName::Simplified => Self::Simplified { xi: xi(), points },
            MethodName::Exact => {
                let compare = model.compare.0.filter(|compare| *compare);
                let xi = compare.map(|_| xi());
                Self::Exact { xi, tolerance: twelve_digits(tolerance), compare, points }
            }
        }
    }
}

/// Parses and checks a scenario. `prefix`, for example `/scenario`, is added before the pointer of
/// every fault.
///
/// # Errors
/// All faults. Each has a JSON pointer and says what to change.
pub fn check(value: &Value, prefix: &str) -> Valid<(Scenario, Vec<Warning>)> {
    let (scenario, case, mut warnings) = prepare(value.clone(), prefix)?;
    warnings.extend(scenario.warnings(&case));
    Ok((scenario, warnings))
}

/// Parses a scenario like [`check`], and also returns the case that the check has built. The
/// warnings are only those about the two bodies, which the canonical scenario does not contain.
///
/// # Errors
/// The same faults as for [`check`].
pub fn prepare(value: Value, prefix: &str) -> Valid<(Scenario, Case, Vec<Warning>)> {
    work_done::note(&work_done::PARSES);
    let request = Request::read(value).map_err(|faults| faults.below(prefix))?;
    let resolved = Scenario::resolve(&request);
    let (scenario, contact) = resolved.map_err(|faults| faults.below(prefix))?;
    let case = scenario.case_of(contact).map_err(|faults| faults.below(prefix))?;
    let warnings = body_warnings(&request, &case);
    Ok((scenario, case, warnings))
}

impl Scenario {
    /// Converts a request to canonical form, and presses the contact.
    fn resolve(request: &Request) -> Valid<(Self, UnwornContact)> {
        let friction = request.friction.0.clone();
        let moduli = moduli(request)?;
        let wear = CanonicalWear::of(&request.wear, &friction)?;
        let profile = Indenter::new(&request.profile)?;
        let load = canonical_load(request, &profile, moduli.normal)?;
        let contact = UnwornContact::new(&profile, &load, moduli, &friction)?;
        let resolve = if contact.scales.length.is_some() { line::resolve } else { round::resolve };
        let motion = resolve(&request.motion, &contact)?;
        let (control, _, unit) = motion.control(&contact, wear.first())?;
        let (cycles, profiles_at) = canonical_cycles(request, &motion, unit)?;
        // All output cycles are within the blocks, so the run does not see the end of a single one.
        let is_known = matches!(cycles, CanonicalCycles::Cycles(_));
        let motion = if is_known { motion.constant() } else { motion };
        // In gross slip, the ratio is 0.
        let stick_ratio = || contact.shape.stick_radius(control.largest_threshold());
        let model = CanonicalModel::of(&request.model, stick_ratio);
        let scenario = Self {
            profile,
            moduli,
            friction,
            wear,
            load,
            motion,
            cycles,
            profiles_at,
            until: request.until,
            model,
        };
        Ok((scenario, contact))
    }

    /// Builds the dimensionless problem.
    ///
    /// # Errors
    /// A fault if each number is valid but the combination has no solution.
    pub fn case(&self) -> Valid<Case> {
        self.case_of(UnwornContact::new(&self.profile, &self.load, self.moduli, &self.friction)?)
    }

    /// Builds the dimensionless problem from the contact that its indenter makes.
    fn case_of(&self, contact: UnwornContact) -> Valid<Case> {
        work_done::note(&work_done::CASES);
        let wear_coefficient = self.wear.first();
        let (control, amplitude, unit) = self.motion.control(&contact, wear_coefficient)?;
        let threshold = control.blocks[0].threshold;
        let reference = self.motion.series(&contact);
        let scales = Scales { cycles: unit, amplitude, wear_coefficient, ..contact.scales };
        let outgrown = || self.profile.outgrown(scales.indentation_depth, threshold);
        let contact = Contact {
            reference,
            course: course(&self.friction, &self.wear, &scales).map(Arc::new),
            layers: self.wear.layers(&scales).map(Arc::new),
            ..Contact::new(contact.shape, threshold).ok_or_else(outgrown)?
        };
        let tends_to = control.tends_to(&contact);
        let (method, points) = match self.model {
            CanonicalModel::Simplified { xi, points } => (Method::Simplified { xi }, points),
            CanonicalModel::Exact { xi, tolerance, points, .. } => {
                (Method::Exact { tolerance, compare: xi }, points)
            }
        };
        let horizon = self.motion.end().unwrap_or(LAST_CYCLE) / unit;
        let problem = WearProblem { contact: &contact, control: &control, law: method.law() };
        let expected = |energy| case::time_of(problem, energy, horizon);
        let outputs = self.cycles.outputs(&scales, horizon, expected);
        let last = outputs.last_time(unit);
        if !March::fits(problem, tends_to.as_ref(), last) {
            let mut faults = outgrown();
            for fault in faults.0.iter_mut().filter(|it| !it.detail.ends_with("fewer cycles")) {
                fault.detail.push_str(", or request fewer cycles");
            }
            return Err(faults);
        }
        let case = Case {
            contact,
            control,
            tends_to,
            until: stop_condition(&self.until.0.unwrap_or_default(), &scales),
            share: self.wear.share(),
            scales,
            method,
            points: usize::from(points),
            profiles: with_profiles(&outputs, &self.profiles_at),
            outputs,
        };
        if case.answer_bytes() > MAX_ANSWER {
            let detail = format!(
                "makes the result about {} MB large, but the limit is {} MB. Request profiles at \
                 fewer output cycles, or fewer `points`",
                case.answer_bytes() / 1_000_000,
                MAX_ANSWER / 1_000_000
            );
            return Err(Faults::one("/profiles_at", detail));
        }
        Ok(case)
    }

    /// Warnings that follow from the canonical numbers.
    pub fn warnings(&self, case: &Case) -> Vec<Warning> {
        let Scales { contact_radius: a, indentation_depth: d, .. } = case.scales;
        // The block with the largest amplitude determines the warnings. A record can contain many loops per cycle.
        let times = case.largest_amplitude();
        let amplitude = times * case.scales.amplitude;
        let pace = times * case.loops_per_cycle() * case.line_pace();
        let cycles = case.scales.cycles / (pace * case.contact.largest_coefficients().wear);
        let slope = case.contact.shape.slope(1.0) * d / a;
        let mut warnings = Vec::new();
        let mut warn =
            |kind: &'static str, detail| warnings.push(Warning { kind: kind.into(), detail });
        if slope > 0.3 {
            let detail = format!(
                "The indenter's slope at the edge of contact is {slope:.2} (a₀/R for a paraboloid); \
                 half-space theory holds for slopes well below 0.3."
            );
            warn("large_contact", detail);
        }
        if cycles < 50.0 {
            let detail = format!(
                "In about {cycles:.3} cycles, the contact wears by the depth of the unworn contact. The averaging over \
                 cycles neglects that the profile changes within a cycle. Results are meaningful for 50 cycles and \
                 more. Enter a smaller wear coefficient or amplitude."
            );
            warn("fast_wear", detail);
        }
        if amplitude > a {
            let detail = format!(
                "The amplitude at the contact ({amplitude:.3e} m) exceeds the contact radius ({a:.3e} m): \
                 this is sliding wear, where the counterbody is not always covered."
            );
            warn("large_amplitude", detail);
        }
        if let Some(length) = case.scales.length
            && 2.0 * a > 0.5 * length
        {
            let detail = format!(
                "The width of the contact ({:.3e} m) exceeds half of its length ({length:.3e} m). Plane strain holds \
                 for contacts that are much longer than wide.",
                2.0 * a
            );
            warn("short_line", detail);
        }
        if let Some([along, across]) = self.profile.unequal_radii() {
            let detail = format!(
                "The radii of the crossed cylinders are {along:e} m and {across:e} m, so the contact is an ellipse. It \
                 is computed as a round contact of the radius √(R₁R₂). At a ratio of 1.5, area and peak pressure are \
                 0.5 % wrong, and the half-axes are 14 % longer and 13 % shorter than the radius."
            );
            warn("elliptical_contact", detail);
        }
        for (kind, detail) in doubts_about_table(case) {
            warn(kind, detail);
        }
        let simplified = matches!(case.method, Method::Simplified { .. });
        if simplified && case.contact.threshold * times >= 1.0 {
            let detail = "The whole contact slips; the simplified rule was fitted to partial slip.";
            warn("simplified_gross_slip", detail.to_owned());
        }
        warnings
    }
}

/// The warnings about a table whose wear hangs on the interpolation between its rows, or on its noise.
fn doubts_about_table(case: &Case) -> Vec<(&'static str, String)> {
    let Some(doubts) = Doubts::of(&case.contact) else { return Vec::new() };
    let [from, to] = doubts.between.map(|radius| radius * case.scales.contact_radius);
    let (change, noise) =
        (100.0 * doubts.interpolation, doubts.noise * case.scales.indentation_depth);
    let sparse = format!(
        "The wear hangs on the profile between the radii {from:.4e} m and {to:.4e} m, where the table has few rows. Straight \
         lines between the rows would change the energy per cycle by {change:+.0} %. Enter more rows between these radii."
    );
    let noisy = format!(
        "After smoothing, a noise of about {noise:.1e} m remains in the heights between the radii {from:.4e} m and {to:.4e} m. It \
         may change wear volume and wear depth by more than 10 %. Enter heights with less noise, or more rows."
    );
    let sparse =
        (doubts.interpolation.abs() > MOST_INTERPOLATED).then_some(("sparse_profile", sparse));
    let noisy = (doubts.widening > MOST_WIDENED).then_some(("noisy_profile", noisy));
    sparse.into_iter().chain(noisy).collect()
}

/// The effective moduli E* and G*, by (6).
fn moduli(request: &Request) -> Valid<CanonicalModuli> {
    let (normal, tangential) = match (&request.moduli.0, &request.bodies.0) {
        (Some(moduli), _) => (moduli.normal.0, moduli.tangential.0.map_or(f64::NAN, |it| it.0)),
        (None, bodies) => {
            let bodies = bodies.as_ref().map_or(&[][..], |bodies| &bodies.0);
            let sum = |of: fn(&ElasticBody) -> f64| bodies.iter().map(of).sum::<f64>();
            let normal = sum(|body| {
                (1.0 - body.poisson_ratio.0 * body.poisson_ratio.0) / body.youngs_modulus.0
            });
            let tangential = sum(|body| (2.0 - body.poisson_ratio.0) / (4.0 * shear_modulus(body)));
            (1.0 / normal, 1.0 / tangential)
        }
    };
    let (normal, tangential) = (twelve_digits(normal), twelve_digits(tangential));
    derived(normal, Stress::RANGE, "a normal modulus E* of", "Pa", "/bodies")?;
    if request.profile.length().is_some() {
        return Ok(CanonicalModuli { normal, tangential: None });
    }
    derived(tangential, Stress::RANGE, "a tangential modulus G* of", "Pa", "/bodies")?;
    Ok(CanonicalModuli { normal, tangential: Some(tangential) })
}

/// The output cycles, and the output cycles with profiles. Normalized cycles are refused for blocks
/// and records, because N₀ does not apply to them. Output cycles after the last block are refused
/// too.
fn canonical_cycles(
    request: &Request,
    motion: &CanonicalMotion,
    unit: f64,
) -> Valid<(CanonicalCycles, ProfilesAt)> {
    let normalized = request.cycles.measure == Measure::Normalized;
    if let Some(varying) = motion.varying().filter(|_| normalized) {
        let detail = format!(
            "cannot be combined with `{varying}` of the motion. Remove `normalized`, and enter numbers of cycles, \
             such as \"cycles\": [100, 1000]"
        );
        return Err(Faults::one("/cycles/normalized", detail));
    }
    let (cycles, profiles_at) =
        instants::canonical(&request.cycles, request.profiles_at.0.as_ref(), unit)?;
    if let (CanonicalCycles::Cycles(cycles), Some(end)) = (&cycles, motion.end())
        && let Some(late) = cycles.iter().position(|n| *n > end)
    {
        let detail = format!(
            "is {} cycles, but the last block ends at {end} cycles. Remove this output cycle, or \
             increase the `cycles` of the last block",
            cycles[late]
        );
        return Err(Faults::one(&format!("/cycles/{late}"), detail));
    }
    Ok((cycles, profiles_at))
}

fn shear_modulus(body: &ElasticBody) -> f64 {
    body.youngs_modulus.0 / (2.0 * (1.0 + body.poisson_ratio.0))
}

/// Warnings that need the properties of the two bodies, which are not part of the canonical form.
fn body_warnings(request: &Request, case: &Case) -> Vec<Warning> {
    let Some(bodies) = &request.bodies.0 else {
        return Vec::new();
    };
    let mut warnings = Vec::new();
    let [first, second] =
        bodies.0.map(|body| (1.0 - 2.0 * body.poisson_ratio.0) / shear_modulus(&body));
    if (first - second).abs() > 1e-6 * first.abs().max(second.abs()) {
        let both = bodies.0.map(|body| 2.0 * (1.0 - body.poisson_ratio.0) / shear_modulus(&body));
        let beta = (first - second).abs() / (both[0] + both[1]);
        let detail = format!(
            "The bodies are not elastically similar: Dundurs' constant β is {beta:.2}. Normal and tangential contact are \
             then coupled, which is neglected here. Compare β with the coefficient of friction: a much smaller β hardly matters."
        );
        warnings.push(Warning { kind: "elastic_mismatch".into(), detail });
    }
    let bodies = bodies.0.iter().enumerate();
    warnings.extend(bodies.filter_map(|(index, body)| yield_warning(case, index, body)));
    warnings
}

/// A warning if a body yields. Under a ball the von Mises stress decides. Under another shape only
/// the pressure is known, and friction is ignored.
fn yield_warning(case: &Case, index: usize, body: &ElasticBody) -> Option<Warning> {
    let strength = body.yield_strength.0?.0;
    let shape = &case.contact.shape;
    let peak = shape.peak_pressure() * case.scales.pressure();
    let megapascals = |stress: f64| format!("{:.0} MPa", stress / 1e6);
    let excess = if shape.is_ball() {
        let largest = case.contact.largest_coefficients().friction;
        let threshold = case.contact.threshold * case.largest_amplitude() / largest;
        let stick = if threshold < 1.0 { shape.image_inverse(1.0 - threshold) } else { 0.0 };
        let rubbing = Rubbing { friction: case.scales.friction * largest, stick };
        let stress = peak * rubbing.largest_von_mises(body.poisson_ratio.0);
        let told = megapascals(stress);
        (stress > strength)
            .then(|| format!("The largest von Mises stress of the unworn contact ({told}) exceeds"))
    } else {
        let told = if peak.is_finite() {
            megapascals(peak)
        } else {
            "infinite at an apex or an edge".to_owned()
        };
        (peak > 1.6 * strength)
            .then(|| format!("The unworn peak pressure ({told}) exceeds 1.6 times"))
    };
    let detail = format!(
        "{} the yield strength of the {} body ({}): it yields, which is not modelled. Reduce the load, or expect a \
         larger contact.",
        excess?,
        if index == 0 { "first" } else { "second" },
        megapascals(strength)
    );
    Some(Warning { kind: "yield".into(), detail })
}
