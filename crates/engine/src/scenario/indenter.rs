//! The indenter in canonical form, and its contact with the half-space.
//!
//! # Equations
//! ```text
//! g₀(a₀) = d₀,   F₀ = 2E* ∫ (d₀ − g₀) dx over 0…a₀                     (7)–(9)
//! truncated paraboloid   d = (a/R)√(a²−b²),     F = 2E*(2a²+b²)√(a²−b²)/(3R)
//! truncated cone         d = a·arccos(b/a)·tanθ, F = E*(a² arccos(b/a) + b√(a²−b²))·tanθ
//! ```
//!
//! # Units
//! SI; [`Shape`] is normalised by a₀ and d₀.

use std::sync::Arc;

use serde::Serialize;

use crate::contact::limit::{DEEPEST, WIDEST};
use crate::contact::profile::{Shape, kappa};
use crate::contact::table_shape::{PressedTable, Split, TableShape};
use crate::contact::unworn::Contact;
use crate::numeric::root;
use crate::request::fault::Faults;
use crate::request::indenter::Profile;

/// Maximum a₀/R of a sphere. Half-space theory is not valid for larger contacts.
const MAX_SPHERE: f64 = 0.6;
/// Minimum width of the ring of contact around a flat, in contact radii. A narrower ring would be
/// lost in rounding.
const NARROWEST_RING: f64 = 1e-6;

/// The indenter in canonical form.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(transparent)]
pub(super) struct Indenter {
    profile: Profile,
    #[serde(skip)]
    form: Form,
}

/// The properties of a profile that determine the unworn contact.
#[derive(Debug, Clone, PartialEq)]
enum Form {
    /// g = height·(x/at_radius)ⁿ.
    Power {
        exponent: f64,
        height: f64,
        at_radius: f64,
    },
    Sphere {
        radius: f64,
    },
    Flat(Flat),
    Table(Table),
}

/// A truncated shape with a flat tip of radius b. The steepness is 1/R or tan θ.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Flat {
    conical: bool,
    steepness: f64,
    tip: f64,
}

impl Flat {
    /// Contact radius a from `rim` = √(a²−b²).
    fn contact_radius(self, rim: f64) -> f64 {
        (self.tip * self.tip + rim * rim).sqrt()
    }

    /// Indentation depth d from `rim` = √(a²−b²).
    fn depth(self, rim: f64) -> f64 {
        let radius = self.contact_radius(rim);
        let width = if self.conical { libm::atan2(rim, self.tip) } else { rim };
        self.steepness * radius * width
    }

    /// `rim` = √(a²−b²) at an indentation depth.
    fn rim_at(self, depth: f64) -> f64 {
        let product = depth / self.steepness;
        if self.conical {
            // a·arccos(b/a) = d/tan θ is at least √(a²−b²), so it is an upper bound of the root.
            return root(0.0, product, |rim| self.depth(rim) - depth);
        }
        let square = self.tip * self.tip;
        let ratio = 2.0 * product / square;
        product * (2.0 / (square * (1.0 + (1.0 + ratio * ratio).sqrt()))).sqrt()
    }

    /// `rim` = √(a²−b²) under a force F, given as F/E*.
    fn rim_under(self, force: f64) -> f64 {
        let (b, product) = (self.tip, force / self.steepness);
        let load = |rim: f64| {
            if self.conical {
                (b * b + rim * rim) * libm::atan2(rim, b) + b * rim
            } else {
                2.0 / 3.0 * (3.0 * b * b + 2.0 * rim * rim) * rim
            }
        };
        // The force is at least the force of the sharp shape, and at least the force of the flat alone. Each of the two
        // gives an upper bound of the root.
        let most = if self.conical {
            product.sqrt().min(product / b)
        } else {
            libm::cbrt(0.75 * product).min(product / (2.0 * b * b))
        };
        root(0.0, most, |rim| load(rim) - product)
    }
}

/// The smooth shape through the points of a measured table.
#[derive(Debug, Clone, PartialEq)]
struct Table {
    radius: Vec<f64>,
    shape: Arc<TableShape>,
}

impl Form {
    /// The form of a profile, or the fault of a measured table.
    fn of(profile: &Profile) -> Result<Self, Faults> {
        Ok(match profile {
            Profile::Paraboloid(ball) => {
                Self::Power { exponent: 2.0, height: ball.radius.0, at_radius: ball.radius.0 }
            }
            Profile::Cone(cone) => Self::Power {
                exponent: 1.0,
                height: std::f64::consts::FRAC_PI_2 * libm::tan(cone.slope_angle.0),
                at_radius: 1.0,
            },
            Profile::Power(power) => {
                let (exponent, at_radius) = (power.exponent.0, power.at_radius.0);
                Self::Power { exponent, height: kappa(exponent) * power.height.0, at_radius }
            }
            Profile::Sphere(ball) => Self::Sphere { radius: ball.radius.0 },
            Profile::TruncatedParaboloid(ball) => {
                let (steepness, tip) = (1.0 / ball.radius.0, ball.flat_radius.0);
                Self::Flat(Flat { conical: false, steepness, tip })
            }
            Profile::TruncatedCone(cone) => {
                let (steepness, tip) = (libm::tan(cone.slope_angle.0), cone.flat_radius.0);
                Self::Flat(Flat { conical: true, steepness, tip })
            }
            Profile::Table(table) => Self::Table(Table::through(&table.radius.0, &table.height.0)?),
            Profile::CrossedCylinders(_)
            | Profile::Cylinder(_)
            | Profile::Wedge(_)
            | Profile::Punch(_) => unreachable!("`supported` refuses this shape"),
        })
    }
}

impl Indenter {
    /// The canonical form of a profile, or the fault of a measured table.
    pub(super) fn new(profile: &Profile) -> Result<Self, Faults> {
        Ok(Self { form: Form::of(profile)?, profile: profile.clone() })
    }

    /// The fault if the profile cannot have the indentation depth `depth`. The depth follows from
    /// the member at `pointer`.
    pub(super) fn refusal(&self, depth: f64, pointer: &str) -> Faults {
        let detail = match &self.form {
            Form::Table(table) => {
                return table.too_short(PressedTable::new(&table.shape, depth, true));
            }
            Form::Flat(flat) => format!(
                "gives an indentation depth of {depth:.3e} m. The ring of contact around the flat is \
                 then too narrow to compute. Increase the load, or enter a `flat_radius` below {} m",
                flat.tip
            ),
            Form::Sphere { .. } | Form::Power { .. } => format!(
                "makes the contact radius larger than {MAX_SPHERE} times the radius of the sphere. \
                 Half-space theory is not valid there. Reduce the load, or enter a larger radius"
            ),
        };
        Faults::one(pointer, detail)
    }

    /// The fault if the contact of `shape`, which is this profile, splits into a core and a ring.
    pub(super) fn split(&self, shape: &Shape) -> Option<Faults> {
        match &self.form {
            Form::Table(table) => shape.split().map(|split| table.splits(split)),
            _ => None,
        }
    }

    /// The fault if the scar at `depth` and amplitude Δ would become larger than the profile.
    pub(super) fn outgrown(&self, depth: f64, threshold: f64) -> Faults {
        match &self.form {
            Form::Table(table) => {
                let endless =
                    PressedTable::new(&table.shape, depth, true).and_then(|(radius, pressed)| {
                        let limit = Contact::new(Shape::table(pressed.clone()), threshold)?.limit;
                        Some((limit.radius * radius, pressed))
                    });
                table.too_short(endless)
            }
            Form::Sphere { .. } => self.refusal(depth, "/load"),
            Form::Flat(_) | Form::Power { .. } => {
                let detail = format!(
                    "would make the scar wider than {WIDEST} contact radii or deeper than {DEEPEST} \
                     indentation depths. In gross slip at constant force the scar grows without \
                     limit. Hold the indentation depth constant"
                );
                Faults::one("/cycles", detail)
            }
        }
    }
}

impl Table {
    fn through(radius: &[f64], height: &[f64]) -> Result<Self, Faults> {
        let shape = TableShape::through(radius, height).map_err(|low| {
            let row = nearest_row(radius, low.radius);
            let others = if low.others { ". It is the lowest of several such heights" } else { "" };
            let detail = format!(
                "is {:.1e} m below the height on the axis ({} m), also after smoothing{others}. Contact \
                 starts on the axis. Enter heights that are not lower than the first one",
                low.below, height[0]
            );
            Faults::one(&format!("/profile/height/{row}"), detail)
        })?;
        Ok(Self { radius: radius.to_vec(), shape: Arc::new(shape) })
    }

    /// The fault of a profile whose contact splits.
    fn splits(&self, split: Split) -> Faults {
        let Split { core, begin, share } = split;
        let row = nearest_row(&self.radius, begin);
        let percent = 100.0 * share;
        let detail = format!(
            "is where the image of the profile falls below the indentation depth again: the contact \
             splits into a core up to {core:.3e} m and a ring from {begin:.3e} m on. Only the core can \
             be computed, but the ring would carry {percent:.2} % of the force on the core. Smooth the \
             table, cut it off before this row, or reduce the load"
        );
        Faults::one(&format!("/profile/radius/{row}"), detail)
    }

    /// The fault if the table ends, or its image decreases, inside the radius that the scar needs.
    fn too_short(&self, needed: Option<(f64, PressedTable)>) -> Faults {
        let radius = &self.radius;
        let reach = self.shape.reach();
        let row = radius.partition_point(|r| *r < reach * (1.0 - 1e-9)).min(radius.len() - 1);
        let needed = needed.map_or(f64::INFINITY, |(radius, _)| radius);
        let ends = if row + 1 == radius.len() {
            "is the end of the table, but it lies inside the contact or inside the future scar"
        } else {
            "is where the image of the profile starts to fall. The edge of the contact or of the \
             future scar would not be unique"
        };
        let detail = format!(
            "{ends}. Enter a profile that rises up to a radius of about {needed:.3e} m (extrapolated), \
             or reduce the load"
        );
        Faults::one(&format!("/profile/radius/{row}"), detail)
    }
}

/// The row of a table whose radius is closest to `radius`.
fn nearest_row(rows: &[f64], radius: f64) -> usize {
    let right = rows.partition_point(|r| *r < radius).clamp(1, rows.len() - 1);
    if radius - rows[right - 1] < rows[right] - radius { right - 1 } else { right }
}

/// The contact radius a₀ and the normalised shape at indentation depth d. `None` if
/// [`Indenter::refusal`] applies.
pub(super) fn indent(indenter: &Indenter, depth: f64) -> Option<(f64, Shape)> {
    match indenter.form {
        Form::Power { exponent: n, height, at_radius } => {
            let ratio = depth / height;
            let radius = at_radius
                * match n {
                    1.0 => ratio,
                    2.0 => ratio.sqrt(),
                    _ => libm::pow(ratio, 1.0 / n),
                };
            Some((radius, Shape::power(n)))
        }
        Form::Sphere { radius } => {
            let depth_at = |share: f64| share * libm::atanh(share);
            if depth_at(MAX_SPHERE) < depth / radius {
                return None;
            }
            // d/R is (a/R)² in a shallow contact, and larger in a deep contact.
            let guess = (depth / radius).sqrt();
            let share = root(0.5 * guess, guess.min(MAX_SPHERE), |s| depth_at(s) - depth / radius);
            Some((share * radius, Shape::sphere(1.0 / share)))
        }
        Form::Flat(flat) => {
            let radius = flat.contact_radius(flat.rim_at(depth));
            let share = flat.tip / radius;
            if 1.0 - share < NARROWEST_RING {
                return None;
            }
            let shape = if flat.conical {
                Shape::truncated_cone(share)
            } else {
                Shape::truncated_paraboloid(share)
            };
            Some((radius, shape))
        }
        Form::Table(ref table) => {
            let (radius, pressed) = PressedTable::new(&table.shape, depth, false)?;
            Some((radius, Shape::table(pressed)))
        }
    }
}

/// The indentation depth d under a force F, given as F/E* in m².
pub(super) fn depth_under(indenter: &Indenter, force: f64) -> f64 {
    match indenter.form {
        Form::Power { exponent: n, height, at_radius } => {
            // F/E* = (2n/(n+1))·a·d with a = b·(d/h)^(1/n).
            let radius_times_depth = force * (n + 1.0) / (2.0 * n);
            let relative = radius_times_depth / (at_radius * height);
            height * libm::pow(relative, n / (n + 1.0))
        }
        Form::Sphere { radius } => {
            let depth_at = |share: f64| radius * share * libm::atanh(share);
            let force_at = |share: f64| {
                2.0 * share * radius * depth_at(share) * Shape::sphere(1.0 / share).half_force()
            };
            if force_at(MAX_SPHERE) < force {
                return f64::INFINITY;
            }
            let guess = libm::cbrt(0.75 * force / (radius * radius));
            let share = root(0.5 * guess, guess.min(MAX_SPHERE), |s| force_at(s) - force);
            depth_at(share)
        }
        Form::Flat(flat) => flat.depth(flat.rim_under(force)),
        Form::Table(ref table) => table.shape.depth_under(force),
    }
}
