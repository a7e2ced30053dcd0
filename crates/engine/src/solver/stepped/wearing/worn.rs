//! The worn contact at one time, as it is reported: volumes, depths, radii and forces.

use crate::contact::hysteresis::Backbone;
use crate::contact::{Geometry, Normal, Shape};
use crate::numeric::{largest, root, vertex};
use crate::solver::stepped::{Law, Mesh, Springs, Wearing};

/// The worn contact at one time, in units of a₀, d₀, E*d₀/a₀ and a₀²d₀.
#[derive(Debug, Clone, PartialEq)]
pub struct WornContact {
    /// Where the wear is known, as r², or x in a line contact: the nodes of all meshes so far.
    pub places: Vec<f64>,
    /// Wear w at these radii. With the simplified rule w can be negative near the edge of the scar.
    pub wear: Vec<f64>,
    /// Image g of each cell.
    pub images: Vec<f64>,
    /// Compression y of each cell in contact.
    pub compressions: Vec<f64>,
    /// min(Δ, y) of each cell in contact. The mean is smaller in a cell that contains the stick
    /// edge.
    pub loads: Vec<f64>,
    /// Slip ω of each cell.
    pub slips: Vec<f64>,
    /// Indentation depth d.
    pub depth: f64,
    /// Amplitude Δ.
    pub threshold: f64,
    /// The coefficient of friction, relative to that at cycle 0.
    pub friction: f64,
    /// Slip of the middle of a line contact.
    pub middle: f64,
    /// Stroke of a line contact, with that of the rig. NaN without a reference.
    pub stroke: f64,
    /// What is reported as the indentation depth: d, or what all springs of a line contact yield in series, with the
    /// wear in the middle. NaN if it is not known.
    pub approach: f64,
    /// The amplitudes of the contact and of the actuator at which the whole contact slips.
    pub gross_slip: [f64; 2],
    /// Stick radius c.
    pub stick: f64,
    /// ∫₀ᵃ y dx.
    pub normal: f64,
    /// ∫₀ᵃ min(Δ, y) dx.
    pub tangential: f64,
    /// ∫₀ᵃ y ω dx.
    pub loss: f64,
    /// Volume of the positive wear, which is the reported volume.
    pub volume: f64,
    /// Volume of the dose, which the energy determines. It is the wear volume, except for bodies with layers.
    pub dosed: f64,
    /// The volume of each body, if they have layers.
    pub bodies: Option<[f64; 2]>,
    /// The largest wear depth.
    pub deepest: f64,
    /// The largest radius with wear. It is 0 without wear.
    pub scar: f64,
    /// The contact radius a, where g = d.
    pub contact_radius: f64,
}

/// The wear at the nodes of all meshes so far.
struct WornSurface {
    places: Vec<f64>,
    radii: Vec<f64>,
    wear: Vec<f64>,
    /// The volume of the positive wear.
    volume: f64,
}

impl WornContact {
    /// Δ·s at the edge of the scar: the amplitude of the local slip there. It is 0 without wear.
    ///
    /// s(r) = 1 − (2/π) ∫ min(1, y/Δ)/√(r²−x²) dx over the contact, for a cycle of amplitude Δ. For a
    /// record this is its largest loop.
    pub(crate) fn edge_slip(&self, mesh: &Mesh) -> f64 {
        self.slip_at(mesh, self.scar)
    }

    /// The change of [`edge_slip`](Self::edge_slip) per change of the radius.
    pub(crate) fn edge_slope(&self, mesh: &Mesh) -> f64 {
        /// The share of the radius by which it is changed. Smoothing changes the first radii by
        /// about this share.
        const STEP: f64 = -5e-3;
        if self.scar == 0.0 {
            return 0.0;
        }
        let beyond = self.slip_at(mesh, (1.0 + STEP) * self.scar);
        (beyond - self.edge_slip(mesh)) / (STEP * self.scar)
    }

    fn slip_at(&self, mesh: &Mesh, radius: f64) -> f64 {
        if radius == 0.0 {
            return 0.0;
        }
        self.middle + mesh.slip_at(radius, self.threshold, &self.loads)
    }
}

impl Wearing {
    /// The wear volume V and the largest wear depth of the given values.
    pub(crate) fn volume_and_depth(&self, values: &[f64]) -> (f64, f64) {
        let mesh = &self.springs.mesh;
        let mut wear = self.wear(values).into_owned();
        let deepest = |radii: &[f64], wear: &[f64]| vertex(radii, wear, largest(wear));
        let (volume, depth) = if self.law == Law::Exact && self.prior.is_empty() {
            let volume = mesh.volume(&wear);
            self.correct_on_axis(&mesh.places, &mut wear);
            (volume, deepest(&mesh.radii, &wear))
        } else {
            let worn = self.surface_of(&wear);
            (worn.volume, deepest(&worn.radii, &worn.wear))
        };
        (volume, depth.min(self.most_wear()))
    }

    /// The largest possible wear: in contact no image exceeds d, so the worn profile cannot exceed d either. Uniform
    /// wear of a line contact changes nothing, so there is no limit.
    fn most_wear(&self) -> f64 {
        match self.springs.mesh.geometry {
            Geometry::Round => self.springs.depth,
            Geometry::Line => f64::INFINITY,
        }
    }

    /// The wear at the nodes of all meshes so far, from the wear at the nodes of this one.
    fn surface_of(&self, wear: &[f64]) -> WornSurface {
        let geometry = self.springs.mesh.geometry;
        let (places, mut wear) = self.total(wear, self.prior.radius).into_lists();
        let volume = geometry.positive_volume(&places, &wear);
        self.correct_on_axis(&places, &mut wear);
        let radii = places.iter().map(|t| geometry.radius(*t)).collect();
        WornSurface { places, radii, wear, volume }
    }

    /// In gross slip, extrapolates the wear on the axis from the nodes beside it.
    fn correct_on_axis(&self, places: &[f64], wear: &mut [f64]) {
        let Mesh { geometry, is_whole, .. } = self.springs.mesh;
        // The first node of a line contact has the mean of a small core.
        let has_axis = places[0] == 0.0 || geometry == Geometry::Line && is_whole;
        if self.law == Law::Exact && has_axis && self.stick() == 0.0 {
            wear[0] = on_axis(&self.contact.shape, places, wear);
        }
    }

    /// The worn contact for the given values.
    pub(crate) fn at(&mut self, values: &[f64]) -> WornContact {
        self.press(values);
        let springs = &self.springs;
        let mesh = &springs.mesh;
        let wear = self.wear(values);
        let mut images = springs.images.clone();
        let mut slips = springs.slips.clone();
        while images.len() < mesh.widths.len() {
            mesh.push_images(&wear, &mut images);
        }
        slips.resize(images.len(), slips.last().copied().unwrap_or(1.0));
        let (contact_radius, scar) = self.radii(&wear, &images);
        let bodies = self.contact.layers.as_ref().map(|layers| {
            [0, 1].map(|body| {
                let depths: Vec<f64> =
                    values.iter().map(|dose| layers.depth(body, *dose)).collect();
                mesh.geometry.positive_volume(&mesh.places, &depths)
            })
        });
        let dosed = bodies.map(|_| mesh.geometry.positive_volume(&mesh.places, values));
        let WornSurface { places, radii, mut wear, volume } = self.surface_of(&wear);
        let most = self.most_wear();
        if self.law == Law::Exact {
            for (wear, r) in wear.iter_mut().zip(&radii) {
                let room = (most - self.contact.shape.profile(*r)).max(0.0);
                *wear = wear.min(room);
            }
        }
        WornContact {
            volume,
            dosed: dosed.unwrap_or(volume),
            bodies,
            deepest: vertex(&radii, &wear, largest(&wear)).min(most),
            contact_radius,
            scar,
            depth: springs.depth,
            threshold: springs.threshold,
            friction: springs.friction,
            middle: springs.middle,
            stroke: springs.stroke(),
            approach: match mesh.geometry {
                Geometry::Round => springs.depth,
                Geometry::Line => springs.approach() + wear[0],
            },
            gross_slip: springs.gross_slip(),
            stick: self.stick(),
            normal: springs.normal(),
            tangential: springs.tangential(),
            loss: springs.loss(),
            compressions: springs.compressions.clone(),
            loads: springs.loads(),
            places,
            wear,
            images,
            slips,
        }
    }

    /// The backbone of the friction loop of a state.
    pub(crate) fn backbone(&self, worn: &WornContact) -> Backbone {
        let Springs { mesh, control, .. } = &self.springs;
        let threshold = worn.threshold;
        if mesh.geometry == Geometry::Line {
            let (yields, outside) = self.springs.in_series(&worn.compressions);
            let springs = yields.zip(worn.compressions.iter().copied());
            return Backbone::in_series(springs, outside, (threshold, worn.middle), worn.loss);
        }
        let loss = (!control.has_record()).then_some(worn.loss);
        Backbone::of_cells(mesh.radii[0], threshold, &worn.loads, &mesh.widths, loss)
    }

    /// The contact radius and the scar radius.
    pub(super) fn radii(&self, wear: &[f64], images: &[f64]) -> (f64, f64) {
        let radii = &self.springs.mesh.radii;
        let most = wear.iter().copied().fold(0.0, f64::max);
        let held = self.springs.control.normal == Normal::Depth;
        let before = self.prior.radius;
        if most == 0.0 {
            return (before.max(1.0), before);
        }
        if let Law::Simplified(_) = self.law {
            let last = wear.iter().rposition(|w| *w > 1e-9 * most).unwrap_or(0);
            let scar = match wear.get(last + 1) {
                Some(next) if *next < 0.0 => {
                    let share = wear[last] / (wear[last] - next);
                    radii[last] + share * (radii[last + 1] - radii[last])
                }
                _ => radii[last],
            };
            // With the rule, a free spring wears towards d and not beyond it.
            return (if held { 1.0 } else { self.touching(images) }, scar.max(before));
        }
        let radius = self.worn_radius(wear);
        (radius, radius)
    }

    /// The radius at which the wear of the exact law ends, extrapolated from the outermost nodes of this
    /// mesh. It is not smaller than on the meshes before.
    pub(in crate::solver::stepped) fn worn_radius(&self, wear: &[f64]) -> f64 {
        let radii = &self.springs.mesh.radii;
        let most = wear.iter().copied().fold(0.0, f64::max);
        let last = wear.iter().rposition(|w| *w > 1e-9 * most).unwrap_or(0);
        let unworn = match self.springs.control.normal {
            Normal::Depth => 1.0,
            Normal::Force => self.unworn_radius(),
        };
        let floor = self.prior.radius.max(unworn);
        if most == 0.0 && !self.prior.is_empty() {
            return floor;
        }
        let end = radii[(last + 1).min(radii.len() - 1)].max(floor);
        if last == 0 || wear[last - 1] <= wear[last] {
            return end;
        }
        let (here, before) = (wear[last], wear[last - 1]);
        let reached = radii[last] + here * (radii[last] - radii[last - 1]) / (before - here);
        reached.clamp(floor, end.max(floor))
    }

    /// The radius at which the unworn image equals the present depth.
    fn unworn_radius(&self) -> f64 {
        let depth = self.springs.depth;
        let radii = &self.springs.mesh.radii;
        let end = radii[radii.len() - 1];
        let shape = &self.contact.shape;
        if depth <= 1.0 {
            return 1.0;
        }
        if shape.image(end) <= depth {
            return end;
        }
        root(1.0, end, |x| shape.image(x) - depth)
    }

    /// The radius at which the worn image equals the depth, interpolated between the centres of
    /// cells.
    fn touching(&self, images: &[f64]) -> f64 {
        let (radii, depth) = (&self.springs.mesh.radii, self.springs.depth);
        let loaded = self.springs.compressions.len();
        let middle = |q: usize| 0.5 * (radii[q] + radii[q + 1]);
        if loaded == 0 || loaded == images.len() {
            return radii[loaded];
        }
        let (inside, outside) = (depth - images[loaded - 1], images[loaded] - depth);
        let share = inside / (inside + outside);
        middle(loaded - 1) + share * (middle(loaded) - middle(loaded - 1))
    }
}

/// The wear on an axis that slips. Near the axis the wear is a − ρ·f₀, with ρ = 1 after the worn profile has become
/// flat, even for a cone.
fn on_axis(shape: &Shape, places: &[f64], wear: &[f64]) -> f64 {
    let height = |node: usize| shape.profile(shape.geometry().radius(places[node]));
    let (near, far) = (height(1), height(2));
    let share = if far > near { (wear[1] - wear[2]) / (far - near) } else { 0.0 };
    wear[1] + share.clamp(0.0, 1.0) * near
}
