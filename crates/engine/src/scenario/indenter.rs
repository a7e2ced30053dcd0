//! The indenter in canonical form, and its contact with the half-space.
//!
//! # Equations
//! ```text
//! g₀(a₀) = d₀,   F₀ = 2E* ∫ (d₀ − g₀) dx over 0…a₀                     (7)–(9)
//! truncated paraboloid   d = (a/R)√(a²−b²),     F = 2E*(2a²+b²)√(a²−b²)/(3R)
//! truncated cone         d = a·arccos(b/a)·tanθ, F = E*(a² arccos(b/a) + b√(a²−b²))·tanθ
//! ```
//! A line contact under the force F per length, with f = A xⁿ, or a flat of half-width b between edges of radius R:
//! ```text
//! power   F = E* A n (√π/2) Γ((n+1)/2)/Γ(n/2+1) aⁿ     cylinder F = πE*a²/(4R), wedge F = E*a·tanθ
//! punch   F = (E*/2R)(a² arccos(b/a) − b√(a²−b²))
//! ```
//!
//! # Units
//! SI; [`Shape`] is normalised by a₀ and d₀.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use serde::Serialize;

use crate::contact::profile::kappa;
use crate::contact::table_shape::{PressedTable, Split, TableShape};
use crate::contact::{Contact, DEEPEST, Flank, Geometry, Shape, WIDEST};
use crate::input::{Faults, Profile, TableProfile, Valid};
use crate::numeric::root;

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
    form: ProfileForm,
}

/// The properties of a profile that determine the unworn contact.
#[derive(Debug, Clone, PartialEq)]
enum ProfileForm {
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
    Table(SmoothTable),
    /// A line contact with f = height·(x/at_half_width)ⁿ.
    LinePower {
        exponent: f64,
        height: f64,
        at_half_width: f64,
    },
    Punch {
        half_width: f64,
        edge_radius: f64,
    },
}

/// The load of a line contact f = xⁿ at half-width 1, in units of E*.
fn line_load(n: f64) -> f64 {
    let ratio = libm::tgamma(0.5 * (n + 1.0)) / libm::tgamma(0.5 * n + 1.0);
    0.5 * n * std::f64::consts::PI.sqrt() * ratio
}

/// A truncated shape with a flat tip of radius b. The steepness is 1/R or tan θ.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Flat {
    flank: Flank,
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
        let width = if self.flank == Flank::Cone { libm::atan2(rim, self.tip) } else { rim };
        self.steepness * radius * width
    }

    /// `rim` = √(a²−b²) at an indentation depth.
    fn rim_at(self, depth: f64) -> f64 {
        let product = depth / self.steepness;
        if self.flank == Flank::Cone {
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
            if self.flank == Flank::Cone {
                (b * b + rim * rim) * libm::atan2(rim, b) + b * rim
            } else {
                2.0 / 3.0 * (3.0 * b * b + 2.0 * rim * rim) * rim
            }
        };
        // The force is at least the force of the sharp shape, and at least the force of the flat alone. Each of the two
        // gives an upper bound of the root.
        let most = if self.flank == Flank::Cone {
            product.sqrt().min(product / b)
        } else {
            libm::cbrt(0.75 * product).min(product / (2.0 * b * b))
        };
        root(0.0, most, |rim| load(rim) - product)
    }
}

/// The smooth shape through the points of a measured table.
#[derive(Debug, Clone, PartialEq)]
struct SmoothTable {
    radius: Vec<f64>,
    shape: Arc<TableShape>,
}

impl ProfileForm {
    /// The form of a profile, or the fault of a measured table.
    fn of(profile: &Profile) -> Valid<Self> {
        Ok(match profile {
            Profile::Paraboloid(ball) => {
                Self::Power { exponent: 2.0, height: ball.radius.0, at_radius: ball.radius.0 }
            }
            Profile::Cone(cone) => Self::Power {
                exponent: 1.0,
                height: FRAC_PI_2 * libm::tan(cone.slope_angle.0),
                at_radius: 1.0,
            },
            Profile::Power(power) if power.geometry == Geometry::Line => Self::LinePower {
                exponent: power.exponent.0,
                height: power.height.0,
                at_half_width: power.at_radius.0,
            },
            Profile::Power(power) => {
                let (exponent, at_radius) = (power.exponent.0, power.at_radius.0);
                Self::Power { exponent, height: kappa(exponent) * power.height.0, at_radius }
            }
            Profile::Sphere(ball) => Self::Sphere { radius: ball.radius.0 },
            Profile::TruncatedParaboloid(ball) => {
                let (steepness, tip) = (1.0 / ball.radius.0, ball.flat_radius.0);
                Self::Flat(Flat { flank: Flank::Paraboloid, steepness, tip })
            }
            Profile::TruncatedCone(cone) => {
                let (steepness, tip) = (libm::tan(cone.slope_angle.0), cone.flat_radius.0);
                Self::Flat(Flat { flank: Flank::Cone, steepness, tip })
            }
            Profile::Table(table) => Self::Table(SmoothTable::through(table)?),
            Profile::CrossedCylinders(cylinders) => {
                let radius = cylinders.radii.mean();
                Self::Power { exponent: 2.0, height: radius, at_radius: radius }
            }
            Profile::Cylinder(cylinder) => Self::LinePower {
                exponent: 2.0,
                height: 0.5 * cylinder.radius.0,
                at_half_width: cylinder.radius.0,
            },
            Profile::Wedge(wedge) => Self::LinePower {
                exponent: 1.0,
                height: libm::tan(wedge.slope_angle.0),
                at_half_width: 1.0,
            },
            Profile::Punch(punch) => Self::Punch {
                half_width: punch.flat_half_width.0,
                edge_radius: punch.edge_radius.0,
            },
        })
    }
}

impl Indenter {
    /// The canonical form of a profile, or the fault of a measured table.
    pub(super) fn new(profile: &Profile) -> Valid<Self> {
        Ok(Self { form: ProfileForm::of(profile)?, profile: profile.clone() })
    }

    /// The length of a line contact in m.
    pub(super) fn length(&self) -> Option<f64> {
        self.profile.length()
    }

    /// The radii of crossed cylinders that differ.
    pub(super) fn unequal_radii(&self) -> Option<[f64; 2]> {
        let Profile::CrossedCylinders(cylinders) = &self.profile else { return None };
        let [along, across] = cylinders.radii.0.map(|radius| radius.0);
        (along.total_cmp(&across).is_ne()).then_some([along, across])
    }

    /// The half-width and the shape of a line contact under a force per length, given as F/E* in m.
    pub(super) fn under_line_load(&self, load: f64) -> Option<(f64, Shape)> {
        match self.form {
            ProfileForm::LinePower { exponent: n, height, at_half_width } => {
                let ratio = load / (line_load(n) * height);
                Some((at_half_width * libm::pow(ratio, 1.0 / n), Shape::line_power(n)))
            }
            ProfileForm::Punch { half_width: b, edge_radius } => {
                let carried = |a: f64| {
                    let chord = ((a - b) * (a + b)).sqrt();
                    0.5 * (a * a * libm::atan2(chord, b) - b * chord) / edge_radius
                };
                // Without the flat the contact would be narrower than this half-width beside it.
                let most = b + 2.0 * (load * edge_radius).sqrt();
                let half_width = root(b, most, |a| carried(a) - load);
                let flat = b / half_width;
                (1.0 - flat > NARROWEST_RING).then(|| (half_width, Shape::punch(flat)))
            }
            ProfileForm::Table(ref table) => {
                let (half_width, pressed) = PressedTable::new(&table.shape, load, false)?;
                Some((half_width, Shape::table(pressed)))
            }
            _ => None,
        }
    }

    /// The image of a table at the edge of the contact, from the depth of the unworn contact: the depth itself, or F/E* of
    /// a line contact.
    fn level(&self, depth: f64) -> f64 {
        if self.length().is_some() { FRAC_PI_2 * depth } else { depth }
    }

    /// The fault if the profile cannot have the indentation depth `depth`. The depth follows from
    /// the member at `pointer`.
    pub(super) fn refusal(&self, depth: f64, pointer: &str) -> Faults {
        let detail = match &self.form {
            ProfileForm::Table(table) => {
                return table.too_short(PressedTable::new(&table.shape, self.level(depth), true));
            }
            ProfileForm::Flat(flat) => format!(
                "gives an indentation depth of {depth:.3e} m. The ring of contact around the flat is \
                 then too narrow to compute. Increase the load, or enter a `flat_radius` below {} m",
                flat.tip
            ),
            ProfileForm::Punch { half_width, .. } => format!(
                "is so small that the edges of the punch hardly touch beside the flat. Enter a larger force, or a \
                 `flat_half_width` below {half_width} m"
            ),
            ProfileForm::Sphere { .. }
            | ProfileForm::Power { .. }
            | ProfileForm::LinePower { .. } => format!(
                "makes the contact radius larger than {MAX_SPHERE} times the radius of the sphere. \
                 Half-space theory is not valid there. Reduce the load, or enter a larger radius"
            ),
        };
        Faults::one(pointer, detail)
    }

    /// The fault if the contact of `shape`, which is this profile, splits into a core and a ring.
    pub(super) fn split(&self, shape: &Shape) -> Option<Faults> {
        match &self.form {
            ProfileForm::Table(table) => shape.split().map(|split| table.splits(split)),
            _ => None,
        }
    }

    /// The fault if the scar at `depth` and amplitude Δ would become larger than the profile.
    pub(super) fn outgrown(&self, depth: f64, threshold: f64) -> Faults {
        match &self.form {
            ProfileForm::Table(table) => {
                let level = self.level(depth);
                let endless =
                    PressedTable::new(&table.shape, level, true).and_then(|(radius, pressed)| {
                        let limit = Contact::new(Shape::table(pressed.clone()), threshold)?.limit;
                        Some((limit.radius * radius, pressed))
                    });
                table.too_short(endless)
            }
            ProfileForm::Sphere { .. } => self.refusal(depth, "/load"),
            ProfileForm::LinePower { .. } | ProfileForm::Punch { .. } => {
                let detail = format!(
                    "would make the scar wider than {WIDEST} half-widths of the unworn contact or deeper than \
                     {DEEPEST} times 2F/(πE*). Request fewer cycles"
                );
                Faults::one("/cycles", detail)
            }
            ProfileForm::Flat(_) | ProfileForm::Power { .. } => {
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

impl SmoothTable {
    fn through(profile: &TableProfile) -> Valid<Self> {
        let (radius, height) = (&profile.radius.0, &profile.height.0);
        let shape = TableShape::through(radius, height, profile.geometry).map_err(|low| {
            let row = nearest_row(radius, low.radius);
            let others = if low.others { ". It is the lowest of several such heights" } else { "" };
            let detail = format!(
                "is {:.1e} m below the height on the axis ({} m), also after smoothing{others}. Contact \
                 starts on the axis. Enter heights that are not lower than the first one",
                low.below, height[0]
            );
            Faults::one(&format!("/profile/height/{row}"), detail)
        })?;
        Ok(Self { radius: radius.clone(), shape: Arc::new(shape) })
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
        // The limit of the wear at the constant amplitude. It says nothing if the scar outgrows it.
        let limit =
            needed.map(|(radius, _)| radius).filter(|limit| *limit > reach && limit.is_finite());
        let until = limit.map_or_else(
            || "further outwards".to_owned(),
            |limit| format!("up to a radius of about {limit:.3e} m (extrapolated)"),
        );
        let ends = if row + 1 == radius.len() {
            "is the end of the table, but it lies inside the contact or inside the future scar"
        } else {
            "is where the image of the profile starts to fall. The edge of the contact or of the \
             future scar would not be unique"
        };
        let detail = format!("{ends}. Enter a profile that rises {until}, or reduce the load");
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
        ProfileForm::Power { exponent: n, height, at_radius } => {
            let ratio = depth / height;
            let radius = at_radius
                * match n {
                    1.0 => ratio,
                    2.0 => ratio.sqrt(),
                    _ => libm::pow(ratio, 1.0 / n),
                };
            Some((radius, Shape::power(n)))
        }
        ProfileForm::Sphere { radius } => {
            let depth_at = |share: f64| share * libm::atanh(share);
            if depth_at(MAX_SPHERE) < depth / radius {
                return None;
            }
            // d/R is (a/R)² in a shallow contact, and larger in a deep contact.
            let guess = (depth / radius).sqrt();
            let share = root(0.5 * guess, guess.min(MAX_SPHERE), |s| depth_at(s) - depth / radius);
            Some((share * radius, Shape::sphere(1.0 / share)))
        }
        ProfileForm::Flat(flat) => {
            let radius = flat.contact_radius(flat.rim_at(depth));
            let share = flat.tip / radius;
            if 1.0 - share < NARROWEST_RING {
                return None;
            }
            Some((radius, Shape::truncated(flat.flank, share)))
        }
        ProfileForm::Table(ref table) => {
            let (radius, pressed) = PressedTable::new(&table.shape, depth, false)?;
            Some((radius, Shape::table(pressed)))
        }
        // The depth of a line contact is not defined.
        ProfileForm::LinePower { .. } | ProfileForm::Punch { .. } => None,
    }
}

/// The indentation depth d under a force F, given as F/E* in m².
pub(super) fn depth_under(indenter: &Indenter, force: f64) -> f64 {
    match indenter.form {
        ProfileForm::Power { exponent: n, height, at_radius } => {
            // F/E* = (2n/(n+1))·a·d with a = b·(d/h)^(1/n).
            let radius_times_depth = force * (n + 1.0) / (2.0 * n);
            let relative = radius_times_depth / (at_radius * height);
            height * libm::pow(relative, n / (n + 1.0))
        }
        ProfileForm::Sphere { radius } => {
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
        ProfileForm::Flat(flat) => flat.depth(flat.rim_under(force)),
        ProfileForm::Table(ref table) => table.shape.depth_under(force),
        ProfileForm::LinePower { .. } | ProfileForm::Punch { .. } => f64::NAN,
    }
}
