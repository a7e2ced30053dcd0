//! Which pieces compute, and which are parked.
//!
//! A run, or a piece of a study, can take minutes. After a slice of its work, a worker parks it if an owner waits for
//! whom less was computed lately. A parked piece stays on its thread, which sleeps. So there are more threads than
//! places, and only a thread with a place computes.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use parking_lot::{Condvar, Mutex, MutexGuard};
use tokio::sync::Notify;

use fretwork_store::{Claimed, Owners};

#[cfg(test)]
mod simulation;

/// A piece computes for at least this time before it is parked.
pub(super) const SLICE: Duration = Duration::from_millis(200);
/// Maximum number of parked pieces, each on a thread.
pub(super) const PARKED: usize = 32;
/// Maximum estimated memory of all parked pieces, in bytes.
const PARKED_BYTES: usize = 64 << 20;
/// A thread with a parked piece checks at this interval whether it must end.
const CHECK: Duration = Duration::from_millis(100);
/// The rank of a piece that waits for an assembly to end. Every usage is below.
pub(super) const LAST: u64 = u64::MAX - 1;

/// The places of a pool, and the threads that wait for one.
pub(super) struct Parking {
    /// How much was computed for an owner lately.
    usage: Box<dyn Fn(&str) -> u64 + Send + Sync>,
    state: Mutex<State>,
    /// Wakes a thread that waits for a place.
    entering: Condvar,
    /// Wakes the threads with a parked piece.
    resuming: Condvar,
    /// Wakes a thread that has a place and no work, after a piece was parked.
    parked: Notify,
    /// Locked while the result of a study is made, because a large one takes much memory.
    pub(super) assembling: Mutex<()>,
}

#[derive(Default)]
struct State {
    free: usize,
    /// Number of threads with a place and without work.
    idle: usize,
    /// Each has a number.
    parked: Vec<(u64, Parkable)>,
    /// Claimed pieces that wait for a thread. Each has a place.
    handed: VecDeque<Vec<Claimed>>,
    /// When a claim for owners below a usage last found nothing, and this usage.
    futile: Option<(Instant, u64)>,
    /// The number of the last parked piece.
    last: u64,
    /// Whether the threads end.
    is_closed: bool,
}

/// A piece that may be parked.
#[derive(Clone)]
pub(super) struct Parkable {
    pub(super) owner: String,
    /// Estimated memory.
    pub(super) bytes: usize,
    /// Whether it waits until no other result of a study is being made.
    pub(super) waits: bool,
}

impl Parking {
    pub(super) fn new(places: usize, usage: impl Fn(&str) -> u64 + Send + Sync + 'static) -> Self {
        Self {
            usage: Box::new(usage),
            state: Mutex::new(State { free: places, ..State::default() }),
            entering: Condvar::new(),
            resuming: Condvar::new(),
            parked: Notify::new(),
            assembling: Mutex::new(()),
        }
    }

    /// Waits for a place. Returns the pieces that were claimed for it, which may be none; `None` if the threads end.
    pub(super) fn take_place(&self) -> Option<Vec<Claimed>> {
        let mut state = self.state.lock();
        loop {
            if let Some(claims) = state.handed.pop_front() {
                return Some(claims);
            }
            if state.is_closed {
                return None;
            }
            if state.free > 0 {
                state.free -= 1;
                if !self.resume(&mut state, u64::MAX, |_| true) {
                    return Some(Vec::new());
                }
            }
            self.entering.wait(&mut state);
        }
    }

    /// Gives the place to the parked piece with the least usage, or frees it. The thread then takes a place again, so no
    /// other one must be woken for a free place.
    pub(super) fn give_place(&self) {
        let mut state = self.state.lock();
        if !self.resume(&mut state, u64::MAX, |_| true) {
            state.free += 1;
        }
    }

    /// Tells all threads to look at their orders: they claim no more pieces.
    pub(super) fn close(&self) {
        self.state.lock().is_closed = true;
        self.entering.notify_all();
        self.resuming.notify_all();
    }

    /// Says whether a thread with a place has no work.
    pub(super) fn set_idle(&self, is_idle: bool) {
        let mut state = self.state.lock();
        state.idle = if is_idle { state.idle + 1 } else { state.idle - 1 };
    }

    /// Whether a piece is parked.
    pub(super) fn has_parked(&self) -> bool {
        !self.state.lock().parked.is_empty()
    }

    /// Waits until a piece is parked.
    pub(super) async fn parked(&self) {
        let parked = self.parked.notified();
        if !self.has_parked() {
            parked.await;
        }
    }

    /// Whether each place has work.
    pub(super) fn is_full(&self) -> bool {
        let state = self.state.lock();
        state.free == 0 && state.idle == 0
    }

    /// The owners for whom less was computed than for those of all parked pieces, and less than `below`. They have no
    /// parked piece, and are not `but`.
    pub(super) fn others(&self, below: u64, but: Option<&str>) -> Owners {
        let state = self.state.lock();
        let ready = state.parked.iter().map(|(_, piece)| (self.rank(piece), &piece.owner));
        let (ranks, owners): (Vec<_>, Vec<_>) = ready.filter(|(rank, _)| *rank < LAST).unzip();
        let except = owners.into_iter().cloned().chain(but.map(str::to_owned)).collect();
        Owners { below: ranks.into_iter().fold(below, u64::min), except }
    }

    /// Whether a claim for owners below this usage may find something, and this piece may be parked for it. After a futile
    /// claim, no thread tries the same for a slice.
    pub(super) fn may_claim(&self, piece: &Parkable, below: u64, now: Instant) -> bool {
        let state = self.state.lock();
        let is_new = |(at, tried): (Instant, u64)| below > tried || now - at >= SLICE;
        state.has_room(piece) && state.futile.is_none_or(is_new)
    }

    /// Notes that a claim for owners below this usage has found nothing.
    pub(super) fn found_nothing(&self, below: u64, now: Instant) {
        self.state.lock().futile = Some((now, below));
    }

    /// Parks a piece, and gives its place to claimed pieces. Returns whether the piece has a place again; it has none if
    /// `goes_on` has become false.
    ///
    /// # Errors
    /// The claimed pieces, if there is no room, or if the threads end, because then none might take them.
    pub(super) fn park_for(
        &self,
        claims: Vec<Claimed>,
        piece: &Parkable,
        goes_on: impl Fn() -> bool,
    ) -> Result<bool, Vec<Claimed>> {
        let mut state = self.state.lock();
        if !state.has_room(piece) {
            return Err(claims);
        }
        state.handed.push_back(claims);
        self.entering.notify_one();
        Ok(self.wait(state, piece, goes_on))
    }

    /// Parks a piece, and gives its place to the parked piece of another owner with the least usage. Does nothing if this
    /// is not below `below`, or if the parked pieces would have too many bytes. Returns as [`park_for`](Self::park_for).
    pub(super) fn swap(&self, piece: &Parkable, below: u64, goes_on: impl Fn() -> bool) -> bool {
        let mut state = self.state.lock();
        !self.resume_for(&mut state, piece, below) || self.wait(state, piece, goes_on)
    }

    /// Resumes a parked piece of another owner than this one, if this one has room then.
    fn resume_for(&self, state: &mut State, piece: &Parkable, below: u64) -> bool {
        let excess = state.bytes_with(piece).saturating_sub(PARKED_BYTES);
        self.resume(state, below, |other| {
            other.bytes >= excess && (piece.waits || other.owner != piece.owner)
        })
    }

    fn wait(
        &self,
        mut state: MutexGuard<'_, State>,
        piece: &Parkable,
        goes_on: impl Fn() -> bool,
    ) -> bool {
        let number = state.park(piece);
        self.parked.notify_waiters();
        loop {
            self.resuming.wait_for(&mut state, CHECK);
            let place = state.parked.iter().position(|(other, _)| *other == number);
            if place.is_none() || !goes_on() {
                place.map(|place| state.parked.remove(place));
                return place.is_none();
            }
        }
    }

    /// The usage of the owner of a piece; [`LAST`] while the piece waits.
    fn rank(&self, piece: &Parkable) -> u64 {
        if piece.waits && self.assembling.is_locked() { LAST } else { (self.usage)(&piece.owner) }
    }

    /// Removes the parked piece with the least rank among those that `may` from the list, if it is below `below`. Its
    /// thread has the place then.
    fn resume(&self, state: &mut State, below: u64, may: impl Fn(&Parkable) -> bool) -> bool {
        let parked = state.parked.iter().enumerate().filter(|(_, (_, piece))| may(piece));
        let next = parked.map(|(place, (_, piece))| (self.rank(piece), place)).min();
        let Some((_, place)) = next.filter(|(rank, _)| *rank < below) else { return false };
        state.parked.remove(place);
        self.resuming.notify_all();
        true
    }
}

impl State {
    fn bytes_with(&self, piece: &Parkable) -> usize {
        piece.bytes + self.parked.iter().map(|(_, other)| other.bytes).sum::<usize>()
    }

    /// Whether one more piece may be parked.
    fn has_room(&self, piece: &Parkable) -> bool {
        !self.is_closed && self.parked.len() < PARKED && self.bytes_with(piece) <= PARKED_BYTES
    }

    /// Adds a piece to the list. Returns its number.
    fn park(&mut self, piece: &Parkable) -> u64 {
        self.last += 1;
        self.parked.push((self.last, piece.clone()));
        self.last
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread;

    use super::*;

    fn piece(owner: &str) -> Parkable {
        Parkable { owner: owner.to_owned(), bytes: PARKED_BYTES / 4, waits: false }
    }

    /// The usage of an owner is the length of the name.
    fn usage(owner: &str) -> u64 {
        owner.len() as u64
    }

    /// Calls `then` when these owners have a parked piece. Returns whether each piece has a place when all have ended.
    fn parked<const N: usize>(
        parking: &Parking,
        owners: [(&str, bool); N],
        then: impl FnOnce(&(dyn Fn() -> bool + Sync)),
    ) -> [bool; N] {
        let stop = AtomicBool::new(false);
        let goes_on = || !stop.load(Ordering::SeqCst);
        thread::scope(|scope| {
            let threads = owners.map(|(owner, waits)| {
                let piece = Parkable { owner: owner.to_owned(), bytes: 0, waits };
                let parked = parking.state.lock().parked.len();
                let thread =
                    scope.spawn(move || parking.park_for(Vec::new(), &piece, goes_on).unwrap());
                while parking.state.lock().parked.len() == parked {
                    thread::yield_now();
                }
                thread
            });
            then(&goes_on);
            stop.store(true, Ordering::SeqCst);
            threads.map(|thread| thread.join().unwrap())
        })
    }

    #[test]
    fn the_piece_of_the_owner_with_the_least_usage_resumes_first() {
        let parking = Parking::new(0, usage);
        let places = parked(&parking, [("long", false), ("a", false), ("bob", false)], |_| {
            parking.give_place();
        });
        assert_eq!(places, [false, true, false]);
        assert_eq!(parking.state.lock().free, 0);
    }

    #[test]
    fn a_piece_that_waits_for_an_assembly_is_last_until_the_assembly_ends() {
        let parking = Parking::new(0, usage);
        let places = parked(&parking, [("a", true), ("bob", false), ("ada", true)], |_| {
            let assembly = parking.assembling.lock();
            assert_eq!(parking.others(9, None).below, 3, "of bob");
            parking.give_place();
            drop(assembly);
            let others = parking.others(9, Some("eve"));
            assert_eq!(
                (others.below, others.except),
                (1, vec!["a".into(), "ada".into(), "eve".into()])
            );
            parking.give_place();
        });
        assert_eq!(places, [true, true, false]);
    }

    #[test]
    fn a_swap_needs_a_piece_of_an_owner_with_less_usage() {
        let parking = Parking::new(0, usage);
        let places = parked(&parking, [("bob", false)], |goes_on| {
            assert!(parking.swap(&piece("ada"), 3, goes_on), "ada goes on");
            assert!(!parking.swap(&piece("long"), 4, || false), "bob goes on");
        });
        assert_eq!(places, [true]);
    }

    #[test]
    fn a_free_place_resumes_a_parked_piece() {
        let parking = Parking::new(0, usage);
        let places = parked(&parking, [("bob", false)], |_| {
            parking.state.lock().free = 1;
            parking.state.lock().handed.clear();
            // The second place is free after the parked piece has the first one.
            thread::scope(|scope| {
                let entered = scope.spawn(|| parking.take_place());
                while parking.has_parked() {
                    thread::yield_now();
                }
                parking.give_place();
                parking.entering.notify_all();
                assert_eq!(entered.join().unwrap().map(|claims| claims.len()), Some(0));
            });
        });
        assert_eq!(places, [true]);
    }

    #[test]
    fn parked_pieces_have_limited_bytes_and_are_limited_in_number() {
        let fill = |piece: &Parkable| {
            let parking = Parking::new(0, usage);
            let mut state = parking.state.lock();
            while state.has_room(piece) {
                state.park(piece);
            }
            state.parked.len()
        };
        assert_eq!(fill(&piece("ada")), 4);
        assert_eq!(fill(&Parkable { bytes: 0, ..piece("ada") }), PARKED);
    }

    #[test]
    fn claims_come_back_if_the_threads_end() {
        let parking = Parking::new(0, usage);
        parking.close();
        assert!(parking.park_for(Vec::new(), &piece("ada"), || true).is_err());
    }
}
