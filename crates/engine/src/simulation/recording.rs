//! Records the rows of the history and of the profiles, in SI units.

use crate::case::{Case, Scales};
use crate::contact::Geometry;
use crate::contact::hysteresis::Loop;
use crate::outcome::{History, Loops, PartsOfWear, Profiles};
use crate::solver::curves::Curves;
use crate::solver::errors::RunErrors;
use crate::solver::pressures::Rings;
use crate::solver::stepped::shares::shares;

/// The rows recorded so far.
#[derive(Debug, Default)]
pub(super) struct Recording {
    pub(super) history: History,
    pub(super) profiles: Profiles,
    pub(super) loops: Loops,
    /// Half of the length of the scar on each body in m, one entry per row of the history.
    pub(super) half_lengths: [Vec<f64>; 2],
    /// How the wear of each row is shared, if that is known.
    pub(super) parts: Vec<PartsOfWear>,
    /// For each row, x + s(x) at the edge of the scar, and the change of s per change of x there.
    edges: Vec<(f64, f64)>,
    /// The energy mismatch (k_w/μ)·ΣW/V − 1 of the last row with wear.
    pub(super) mismatch: Option<f64>,
    /// The largest errors of V and of the depth so far.
    pub(super) errors: Option<RunErrors>,
    /// The unworn profile f₀ at the output radii, in d₀.
    initial: Vec<f64>,
    reported: Reported,
}

/// The largest values reported so far, dimensionless.
#[derive(Debug, Default)]
struct Reported {
    volume: f64,
    deepest: f64,
    /// The wear depths of the bodies: as computed, and as reported.
    depths: [[f64; 2]; 2],
    scar: f64,
    /// Half of the length of the scar on each body, in m.
    half_lengths: [f64; 2],
    wear: Vec<f64>,
}

/// One row of the history, dimensionless. Both methods produce such rows.
#[derive(Default)]
pub(super) struct HistoryEntry {
    /// Number of cycles N, not dimensionless.
    pub(super) cycles: f64,
    pub(super) volume: f64,
    pub(super) deepest: f64,
    pub(super) scar: f64,
    /// Amplitude Δ·s of the local slip at the edge of the scar.
    pub(super) edge_slip: f64,
    /// The change of `edge_slip` per change of the radius.
    pub(super) edge_slope: f64,
    pub(super) contact_radius: f64,
    pub(super) stick: f64,
    /// Indentation depth d.
    pub(super) depth: f64,
    /// Amplitude Δ.
    pub(super) threshold: f64,
    /// The stroke of a line contact in μh₀, with that of the rig. NaN if it is not known.
    pub(super) stroke: f64,
    /// The amplitudes of the contact and of the actuator at which the whole contact slips, Δ or the stroke.
    pub(super) gross_slip: [f64; 2],
    /// Half of the normal force, ∫ y dx over half of the row.
    pub(super) normal: f64,
    /// Half of the tangential force, ∫ min(Δ, y) dx over half of the row.
    pub(super) tangential: f64,
    /// The energy integral ∫ y ω dx over half of the row.
    pub(super) loss: f64,
    /// The volume that follows from the energy, ∫ (k_w/μ) dW.
    pub(super) worn_by_energy: f64,
    /// The volume of the dose: the wear volume, except for bodies with layers.
    pub(super) dosed: f64,
    /// The volume of each body, if they have layers.
    pub(super) bodies: Option<[f64; 2]>,
    /// The wear depth of each body, if that is known. Numerical noise can reduce it.
    pub(super) depths: Option<[f64; 2]>,
    /// The dissipated energy, as (k_w/μ)·ΣW with the coefficients at cycle 0.
    pub(super) dissipated: f64,
    /// The coefficient of friction, relative to that at cycle 0.
    pub(super) friction: f64,
    pub(super) errors: RunErrors,
    /// The curves and the friction loop, if this row has profiles.
    pub(super) curves: Option<(Curves, Loop)>,
}

impl HistoryEntry {
    /// How the wear is shared: by the layers, or by the share of the first body.
    fn parts(&self, share: Option<f64>, height: f64) -> Option<PartsOfWear> {
        let volumes = match (self.bodies, share) {
            (Some([first, second]), _) if first + second > 0.0 => {
                [first, second].map(|volume| volume / (first + second))
            }
            (Some(_), _) => [0.0; 2],
            (None, share) => share.map(|share| [share, 1.0 - share])?,
        };
        Some(PartsOfWear { depths: self.depths?.map(|depth| depth * height), volumes })
    }
}

impl Recording {
    /// Sets the output radii, and the unworn and the limiting profile at these radii, all
    /// dimensionless.
    pub(super) fn lay_out(
        &mut self,
        case: &Case,
        radii: &[f64],
        initial: Vec<f64>,
        limiting: Option<Vec<f64>>,
    ) {
        let (length, height) = (case.scales.contact_radius, case.scales.indentation_depth);
        self.profiles.radius = scaled(radii.to_vec(), length);
        self.profiles.initial = scaled(initial.clone(), height);
        self.profiles.limiting = limiting.map(|limiting| scaled(limiting, height));
        self.initial = initial;
    }

    /// Replaces the contact radii of all rows, given in a₀. With the exact method, the scar ends at
    /// the contact radius.
    pub(super) fn set_contact_radii(&mut self, radii: &[f64], scales: &Scales) {
        let length = scales.contact_radius;
        let [first, second] = &mut self.half_lengths;
        let History { contact_radius, scar_radius, .. } = &mut self.history;
        let mut reached = [0.0_f64; 2];
        for (row, radius) in radii.iter().enumerate() {
            contact_radius[row] = radius * length;
            if scar_radius[row] > 0.0 {
                let shift = contact_radius[row] - scar_radius[row];
                scar_radius[row] = contact_radius[row];
                let (end, slope) = self.edges[row];
                second[row] = if second[row] <= end {
                    end + shift * (1.0 + slope)
                } else {
                    // In an earlier block of larger amplitude, the contact has slid further.
                    scar_radius[row] + second[row] - first[row]
                };
                first[row] = scar_radius[row];
            }
            reached = [reached[0].max(first[row]), reached[1].max(second[row])];
            [first[row], second[row]] = reached;
        }
        // The springs of a line contact are pressed by its force.
        let level = scales.length.map(|_| scales.indentation_depth);
        self.end_profiles_at_contact_radii(level);
    }

    /// Adjusts the curves next to the edge of the contact: g = d (of a line contact, the given
    /// level) at the edge, and no pressure and no wear outside.
    #[expect(
        clippy::expect_used,
        reason = "rows without a match would give wrong profiles, so the run stops"
    )]
    fn end_profiles_at_contact_radii(&mut self, level: Option<f64>) {
        let Self { history, profiles, .. } = self;
        let geometry = if level.is_some() { Geometry::Line } else { Geometry::Round };
        let rings = Rings::around(geometry, &profiles.radius);
        let mut rows = 0..history.cycles.len();
        let curves = profiles.image.iter_mut().zip(&mut profiles.pressure);
        let wear = profiles.wear.iter_mut().zip(&mut profiles.worn);
        let curves = curves.zip(wear);
        for (cycles, ((image, pressure), (wear, worn))) in profiles.cycles.iter().zip(curves) {
            let row = rows.find(|row| history.cycles[*row] >= *cycles);
            let row = row.expect("each row of the profiles is a row of the history too");
            let edge = profiles.radius.partition_point(|r| *r < history.contact_radius[row]);
            let depth = level.unwrap_or(history.indentation_depth[row]);
            image[..edge].iter_mut().for_each(|g| *g = g.min(depth));
            image[edge..].iter_mut().for_each(|g| *g = g.max(depth));
            rings.end_before(edge, pressure);
            wear[edge..].fill(0.0);
            worn[edge..].copy_from_slice(&profiles.initial[edge..]);
        }
    }

    /// Records that the contact has slid with the amplitude Δ·s = `slip` at the scar radius, and returns x + s(x) there.
    /// The slip increases outwards, so x + s(x) is largest at the edge.
    pub(super) fn slide(&mut self, scales: &Scales, (scar, slip): (f64, f64)) -> f64 {
        let x = scar * scales.contact_radius;
        let end = x + slip * scales.slip();
        for (known, reached) in self.reported.half_lengths.iter_mut().zip([x, end]) {
            *known = known.max(reached);
        }
        end
    }

    /// Converts a row to SI units and appends it.
    pub(super) fn record(&mut self, case: &Case, mut entry: HistoryEntry) {
        self.reported.hold(&mut entry);
        let Case { scales, contact, .. } = case;
        let m = entry.friction;
        let end = self.slide(scales, (entry.scar, entry.edge_slip * m));
        let slope = entry.edge_slope * m * scales.slip() / scales.contact_radius;
        self.edges.push((end, slope));
        for (column, half_length) in self.half_lengths.iter_mut().zip(self.reported.half_lengths) {
            column.push(half_length);
        }
        let (length, height) = (scales.contact_radius, scales.indentation_depth);
        self.parts.extend(entry.parts(case.share, height));
        let history = &mut self.history;
        let n = entry.cycles;
        if entry.volume > 0.0 {
            let dosed = if entry.bodies.is_some() { entry.dosed } else { entry.volume };
            self.mismatch = Some(entry.worn_by_energy / dosed - 1.0);
            self.errors = Some(self.errors.map_or(entry.errors, |known| known.or(entry.errors)));
        }
        let (amplitude, slip) = if scales.length.is_some() {
            let rig = contact.reference.map_or(0.0, |reference| reference.rig());
            let amplitude = (entry.stroke - rig * entry.threshold) * m * scales.slip();
            (amplitude, entry.threshold * m * scales.slip())
        } else {
            let amplitude = scales.amplitude * (entry.threshold / contact.threshold) * m;
            (amplitude, amplitude)
        };
        history.cycles.push(n);
        history.normalized_cycles.push(n / scales.cycles);
        history.wear_volume.push(entry.volume * scales.volume());
        history.wear_depth.push(entry.deepest * height);
        history.scar_radius.push(entry.scar * length);
        history.contact_radius.push(entry.contact_radius * length);
        history.stick_radius.push(entry.stick * length);
        history.normal_force.push(2.0 * entry.normal * scales.force());
        history.indentation_depth.push(entry.depth * height);
        history.amplitude.push(amplitude);
        history.tangential_force.push(scales.tangential(entry.tangential * m));
        history.energy_per_cycle.push(scales.energy(entry.loss * entry.threshold * (m * m)));
        let per_wear = scales.friction / scales.wear_coefficient;
        history.dissipated_energy.push(entry.dissipated * scales.volume() * per_wear);
        history.wear_volume_error.push(entry.errors.volume);
        history.wear_depth_error.push(entry.errors.depth);
        let [contact_slips, actuator_slips] = entry.gross_slip.map(|it| it * m * scales.slip());
        history.gross_slip_amplitude.push(contact_slips);
        if case.has_rig() {
            history.actuator_gross_slip_amplitude.push(actuator_slips);
        }
        let Some((curves, found)) = entry.curves else { return };
        let profiles = &mut self.profiles;
        profiles.cycles.push(n);
        let worn = self.initial.iter().zip(&curves.wear);
        profiles.worn.push(worn.map(|(initial, wear)| (initial + wear) * height).collect());
        profiles.wear.push(scaled(curves.wear, height));
        profiles.image.push(scaled(curves.image, height));
        profiles.pressure.push(scaled(curves.pressure, scales.pressure()));
        profiles.slip.push(scaled(curves.slip, slip));
        let loops = &mut self.loops;
        loops.cycles.push(n);
        loops.displacement.push(scaled(found.displacement, scales.slip() * m));
        loops.tangential_force.push(scaled(found.force, scales.tangential(1.0) * m));
        loops.energy_ratio.push(found.energy_ratio);
        loops.slip_ratio.push(found.slip_ratio);
        loops.free_ratio.push(found.free_ratio);
        // The rig is elastic, so W, Q and δ₀ are the same at the actuator.
        if let Some(share) = case.actuator_share(entry.threshold * m) {
            let push = |column: &mut Option<Vec<f64>>, ratio| {
                column.get_or_insert_default().push(share * ratio);
            };
            push(&mut loops.actuator_energy_ratio, found.energy_ratio);
            push(&mut loops.actuator_slip_ratio, found.slip_ratio);
        }
    }
}

impl Reported {
    /// Prevents a decrease of the reported wear. Without this correction the wear could decrease by
    /// numerical noise, or because the radius ã of the simplified rule changes.
    fn hold(&mut self, entry: &mut HistoryEntry) {
        let hold = |known: &mut f64, value: &mut f64| {
            // This comparison is faster than `f64::max`, which also handles NaN.
            *value = if *value < *known { *known } else { *value };
            *known = *value;
        };
        hold(&mut self.volume, &mut entry.volume);
        let before = self.deepest;
        hold(&mut self.deepest, &mut entry.deepest);
        hold(&mut self.scar, &mut entry.scar);
        if let Some(depths) = &mut entry.depths {
            let [known, reported] = &mut self.depths;
            let more = [0, 1].map(|body| (depths[body] - known[body]).max(0.0));
            let more = if more[0] + more[1] > 0.0 { more } else { *depths };
            let shares = shares(more, [1.0; 2]);
            for body in [0, 1] {
                hold(&mut known[body], &mut depths[body]);
                reported[body] += (entry.deepest - before) * shares[body];
            }
            *depths = *reported;
        }
        if let Some((curves, _)) = &mut entry.curves {
            self.wear.resize(curves.wear.len(), 0.0);
            for (known, wear) in self.wear.iter_mut().zip(&mut curves.wear) {
                hold(known, wear);
            }
        }
    }
}

fn scaled(mut values: Vec<f64>, scale: f64) -> Vec<f64> {
    for value in &mut values {
        *value *= scale;
    }
    values
}
