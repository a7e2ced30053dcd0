//! Bodies with layers, such as coatings. The run integrates the dose of wear; the depth follows from it.
//!
//! # Equations
//! The dose is τ = ∫ 4 p s dN, in units of d₀/k₀, where k₀ is the wear coefficient of N₀. In a layer with the
//! coefficient k, the depth of a body grows by (k/k₀)·dτ. So the depth is a piecewise linear function of the dose, and no
//! rate jumps.

/// A layer, or the material below all layers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layer {
    /// The thickness in d₀. Infinite for the material below all layers.
    pub thickness: f64,
    /// k/k₀.
    pub coefficient: f64,
}

/// The place between a layer and what lies below it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Interface {
    /// The dose that wears the layer through.
    pub dose: f64,
    /// The index of the body.
    pub body: usize,
    /// The index of the layer, from the surface inwards.
    pub layer: usize,
}

/// The layers of two bodies, from the surface inwards. The last one of each body has an infinite thickness.
#[derive(Debug, Clone, PartialEq)]
pub struct Layers([Vec<Layer>; 2]);

impl Layers {
    /// The layers of two bodies.
    pub fn of(bodies: [Vec<Layer>; 2]) -> Self {
        Self(bodies)
    }

    /// The depth of a body after a dose.
    pub fn depth(&self, body: usize, dose: f64) -> f64 {
        let (mut left, mut depth) = (dose, 0.0);
        for Layer { thickness, coefficient } in &self.0[body] {
            if left * coefficient <= *thickness {
                return depth + left * coefficient;
            }
            left -= thickness / coefficient;
            depth += thickness;
        }
        depth
    }

    /// The depth of both bodies together.
    pub(crate) fn both(&self, dose: f64) -> f64 {
        self.depth(0, dose) + self.depth(1, dose)
    }

    /// The depth of both bodies that a dose wears after the last layer that can be worn through. 0 before.
    pub(crate) fn beyond(&self, dose: f64) -> f64 {
        let last = self.interfaces().last().map_or(0.0, |it| it.dose);
        if dose < last { 0.0 } else { self.both(dose) - self.both(last) }
    }

    /// The depth of both bodies at which the last layer was worn through, if they are `depth` deep now.
    pub(crate) fn passed(&self, depth: f64) -> f64 {
        let depths = self.interfaces().into_iter().map(|it| self.both(it.dose));
        depths.filter(|passed| *passed < depth).fold(0.0, f64::max)
    }

    /// An upper bound of the change of the depth per dose.
    pub(crate) fn steepest(&self) -> f64 {
        let most = |layers: &Vec<Layer>| layers.iter().map(|it| it.coefficient).fold(0.0, f64::max);
        self.0.iter().map(most).sum()
    }

    /// The interfaces that wear can reach, in the order in which it reaches them.
    pub fn interfaces(&self) -> Vec<Interface> {
        let mut found = Vec::new();
        for (body, layers) in self.0.iter().enumerate() {
            let mut dose = 0.0;
            for (layer, Layer { thickness, coefficient }) in layers.iter().enumerate() {
                dose += thickness / coefficient;
                if !dose.is_finite() {
                    break;
                }
                found.push(Interface { dose, body, layer });
            }
        }
        found.sort_by(|a, b| a.dose.total_cmp(&b.dose));
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_depth_is_linear_within_each_layer() {
        let layer = |thickness, coefficient| Layer { thickness, coefficient };
        let below = f64::INFINITY;
        let layers = Layers::of([
            vec![layer(0.5, 0.25), layer(1.0, 2.0), layer(below, 0.5)],
            vec![layer(below, 0.0)],
        ]);
        for (dose, depth) in [(0.0, 0.0), (1.0, 0.25), (2.0, 0.5), (2.25, 1.0), (4.5, 2.5)] {
            assert!((layers.both(dose) - depth).abs() < 1e-15, "{dose}");
            assert!(layers.depth(1, dose).abs() < 1e-300);
        }
        let interfaces: Vec<_> =
            layers.interfaces().iter().map(|it| (it.dose, it.body, it.layer)).collect();
        assert_eq!(interfaces, [(2.0, 0, 0), (2.5, 0, 1)]);
        assert!((layers.steepest() - 2.0).abs() < 1e-15);
    }
}
