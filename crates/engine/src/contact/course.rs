//! Coefficients of friction and wear that change during a run.
//!
//! # Equations
//! m and k are the present coefficients, relative to those at cycle 0. Each held motion is an amplitude in units of μ:
//! ```text
//! Δ, Q/(μF), U/(μh₀)  are divided by m
//! dw/dÑ = k·m·p·s·Δ/Δ₀,    W is multiplied by m²
//! ```
//! So dV = (k_w/μ)·dW holds at each time with the present values.

use std::sync::Arc;

/// What the abscissa of a [`Track`] measures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Over {
    /// The time Ñ.
    Time,
    /// The dissipated energy, as (k_w/μ)·ΣW with the coefficients at cycle 0.
    Energy,
}

/// A coefficient relative to its value at cycle 0: linear between the points, constant outside. An abscissa that stands
/// twice is a step.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    over: Over,
    at: Vec<f64>,
    values: Vec<f64>,
}

impl Track {
    /// The track through points in ascending order, of which there is at least one. The values are relative to that at 0.
    pub fn through(over: Over, at: Vec<f64>, values: Vec<f64>) -> Self {
        Self { over, at, values }
    }

    /// The value at an abscissa of the segment that ends at point `segment`.
    fn value(&self, segment: usize, x: f64) -> f64 {
        let last = self.at.len() - 1;
        if segment == 0 || segment > last {
            return self.values[segment.min(last)];
        }
        let (from, to) = (self.at[segment - 1], self.at[segment]);
        let share = ((x - from) / (to - from)).clamp(0.0, 1.0);
        self.values[segment - 1] + share * (self.values[segment] - self.values[segment - 1])
    }

    /// The number of the segment that begins at `x`.
    fn segment(&self, x: f64) -> usize {
        self.at.partition_point(|at| *at <= x)
    }

    fn extreme(&self, of: fn(f64, f64) -> f64) -> f64 {
        self.values.iter().copied().reduce(of).unwrap_or(1.0)
    }
}

/// How the coefficients of a contact change.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Course {
    /// The coefficient of friction; `None` if it is constant.
    pub friction: Option<Track>,
    /// The wear coefficient; `None` if it is constant.
    pub wear: Option<Track>,
}

impl Course {
    fn tracks(&self) -> [Option<&Track>; 2] {
        [self.friction.as_ref(), self.wear.as_ref()]
    }

    /// The smallest coefficient of friction of the whole course.
    pub(crate) fn least_friction(&self) -> f64 {
        self.friction.as_ref().map_or(1.0, |track| track.extreme(f64::min))
    }

    /// The largest m and the largest k of the whole course.
    pub(crate) fn largest(&self) -> Moment {
        let most = |track: &Option<Track>| track.as_ref().map_or(1.0, |it| it.extreme(f64::max));
        Moment { friction: most(&self.friction), wear: most(&self.wear) }
    }
}

/// Coefficients relative to those at cycle 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Moment {
    /// m.
    pub(crate) friction: f64,
    /// k.
    pub(crate) wear: f64,
}

/// The dissipated energy around a time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
struct EnergyClock {
    time: f64,
    energy: f64,
    power: f64,
    /// The change of the power per time.
    growth: f64,
}

/// Follows a course. During a step each coefficient stays in one segment of its track, so that the rates are smooth.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Follower {
    course: Option<Arc<Course>>,
    /// The present segment of each track.
    segments: [usize; 2],
    clock: EnergyClock,
}

/// A segment over energy has ended if less than this share of its end is missing.
const REACHED: f64 = 1e-10;

impl Follower {
    /// Follows a course from cycle 0.
    pub(crate) fn new(course: Option<Arc<Course>>) -> Self {
        let mut follower = Self { course, ..Self::default() };
        follower.enter(0.0, 0.0);
        follower
    }

    /// The coefficients at a time of the present segments.
    pub(crate) fn at(&self, time: f64) -> Moment {
        let Some(course) = &self.course else { return Moment { friction: 1.0, wear: 1.0 } };
        let value = |track: Option<&Track>, segment: usize| {
            track.map_or(1.0, |track| {
                let x = match track.over {
                    Over::Time => time,
                    Over::Energy => self.energy(time),
                };
                track.value(segment, x)
            })
        };
        let [friction, wear] = course.tracks();
        let [first, second] = self.segments;
        Moment { friction: value(friction, first), wear: value(wear, second) }
    }

    /// The dissipated energy at a time after the last step, extrapolated.
    pub(crate) fn energy(&self, time: f64) -> f64 {
        let EnergyClock { time: known, energy, power, growth } = self.clock;
        let since = time - known;
        energy + since * (power + 0.5 * since * growth)
    }

    /// Takes note of the dissipated energy at the end of a step: its power at the start and at the end.
    pub(crate) fn record(&mut self, (began, time): (f64, f64), energy: f64, power: [f64; 2]) {
        let growth = if time > began { (power[1] - power[0]) / (time - began) } else { 0.0 };
        self.clock = EnergyClock { time, energy, power: power[1], growth };
    }

    /// Whether a segment ends at this time and energy. If so, the next one begins.
    pub(crate) fn enter(&mut self, time: f64, energy: f64) -> bool {
        let Some(course) = &self.course else { return false };
        let mut changed = false;
        for (track, segment) in course.tracks().into_iter().zip(&mut self.segments) {
            let Some(track) = track else { continue };
            let next = match track.over {
                Over::Time => track.segment(time),
                Over::Energy => {
                    // The rest can be less than the last bit of the time.
                    let end = track.at.get(*segment).copied().unwrap_or(f64::INFINITY);
                    let is_now = time + (end - energy) / self.clock.power <= time;
                    track.segment(energy * (1.0 + REACHED)).max(*segment + usize::from(is_now))
                }
            };
            changed |= next > *segment;
            *segment = next.max(*segment);
        }
        if changed {
            // The power jumps with the coefficients, so its change is not known.
            self.clock.growth = 0.0;
        }
        changed
    }

    /// Whether a coefficient can still change.
    pub(crate) fn is_changing(&self) -> bool {
        [Over::Time, Over::Energy].into_iter().any(|over| self.changes_over(over))
    }

    /// Whether a coefficient over the time or over the energy can still change.
    pub(crate) fn changes_over(&self, over: Over) -> bool {
        let Some(course) = &self.course else { return false };
        let mut tracks = course.tracks().into_iter().zip(self.segments);
        tracks.any(|(track, segment)| {
            track.is_some_and(|track| track.over == over && segment < track.at.len())
        })
    }

    /// The time at which the first of the present segments ends, as far as it is known.
    pub(crate) fn step_end(&self) -> f64 {
        let Some(course) = &self.course else { return f64::INFINITY };
        let tracks = course.tracks().into_iter().zip(self.segments);
        let ends = tracks.filter_map(|(track, segment)| {
            let track = track?;
            let end = *track.at.get(segment)?;
            Some(match track.over {
                Over::Time => end,
                Over::Energy if self.clock.power > 0.0 => {
                    self.clock.time + (end - self.clock.energy).max(0.0) / self.clock.power
                }
                Over::Energy => f64::INFINITY,
            })
        });
        ends.fold(f64::INFINITY, f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_belongs_to_the_segment_before_it_until_the_next_one_begins() {
        let track = Track::through(Over::Time, vec![1.0, 2.0, 2.0, 3.0], vec![1.0, 2.0, 4.0, 5.0]);
        let course = Course { friction: Some(track), wear: None };
        let mut follower = Follower::new(Some(Arc::new(course)));
        let friction = |follower: &Follower, time: f64| follower.at(time).friction;
        assert_eq!((friction(&follower, 0.5), follower.step_end()), (1.0, 1.0));
        assert!(follower.enter(1.0, 0.0));
        assert_eq!((friction(&follower, 1.5), friction(&follower, 2.0)), (1.5, 2.0));
        assert!(follower.enter(2.0, 0.0));
        assert_eq!((friction(&follower, 2.0), friction(&follower, 3.0)), (4.0, 5.0));
        assert!(follower.is_changing());
        assert!(follower.enter(3.0, 0.0) && !follower.enter(3.5, 0.0));
        assert!(!follower.is_changing());
        assert_eq!((friction(&follower, 9.0), follower.step_end()), (5.0, f64::INFINITY));
    }

    #[test]
    fn the_energy_between_steps_is_extrapolated() {
        let track = Track::through(Over::Energy, vec![0.0, 10.0], vec![1.0, 3.0]);
        let course = Course { friction: None, wear: Some(track) };
        let mut follower = Follower::new(Some(Arc::new(course)));
        follower.record((0.0, 2.0), 4.0, [1.0, 2.0]);
        // The energy is 4 + 2·1 + 0.25·1² at the time 3.
        assert!((follower.at(3.0).wear - 2.25).abs() < 1e-15, "{:?}", follower.at(3.0));
        assert!((follower.step_end() - 5.0).abs() < 1e-15);
    }
}
