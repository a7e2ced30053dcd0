//! The elastic properties of the bodies of a request.

use deserr::Deserr;

use super::fault::Faults;
use super::fields::{Given, PoissonRatio, Stress};

/// One elastic body.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct ElasticBody {
    /// Young's modulus E.
    pub youngs_modulus: Stress,
    /// Poisson's ratio ν.
    pub poisson_ratio: PoissonRatio,
    /// Yield strength. It is used for a warning only.
    #[deserr(default)]
    pub yield_strength: Given<Stress>,
}

/// The effective moduli.
#[derive(Debug, Clone, Copy, PartialEq, Deserr)]
#[deserr(error = Faults, deny_unknown_fields)]
pub struct Moduli {
    /// Normal modulus E*.
    pub normal: Stress,
    /// Tangential modulus G*. It has no meaning for a line contact.
    #[deserr(default)]
    pub tangential: Given<Stress>,
}

super::rows::rows! {
    /// The effective modulus E* of both bodies: 1/E* = Σ (1−ν²)/E.
    "/moduli/normal": Of("Stress"), "Normal modulus", "$E$*", MODULUS;
    /// The effective modulus G* of both bodies: 1/G* = Σ (2−ν)/(4G). Required for a round contact; it has no meaning for a line contact.
    "/moduli/tangential": Of("Stress"), "Tangential modulus", "$G$*", MODULUS;
    /// Young's modulus E.
    "/bodies/#/youngs_modulus": Of("Stress"), "Body #: Young's modulus", "$E$", MODULUS;
    "/bodies/#/poisson_ratio": Of("PoissonRatio"), "Body #: Poisson's ratio", "$ν$", between(0.0, 0.5);
    /// Only for a warning. It is compared with the largest von Mises stress of the unworn contact, with friction, for a paraboloid
    /// and a sphere (Hamilton 1983). For other profiles it is compared with the peak pressure divided by 1.6.
    "/bodies/#/yield_strength": Of("Stress"), "Body #: yield strength", "", STRENGTH;

    forms:
    /// One isotropic elastic body.
    Body "/bodies/#" ["youngs_modulus", "poisson_ratio"] ["yield_strength"];
    /// The effective moduli of the pair. Give these or `bodies`.
    Moduli "/moduli" ["normal"] ["tangential"];
}
