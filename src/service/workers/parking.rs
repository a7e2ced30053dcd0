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
#[derive(Default)]
pub(super) struct Parking {
    state: Mutex<State>,
    /// Wakes a thread that waits for a place.
    entering: Condvar,
    /// Wakes the threads with a parked piece.
    resuming: Condvar,
    /// Wakes a thread that has a place and no work, after a piece was parked.
    parked: Notify,
}

#[derive(Default)]
struct State {
    free: usize,
    /// Number of threads with a place and without work.
    idle: usize,
    parked: Vec<Parked>,
    /// Number and bytes of the pieces that are parked, or are about to be.
    reserved: (usize, usize),
    /// Claimed pieces that wait for a thread. Each has a place.
    handed: VecDeque<Vec<Claimed>>,
    /// Whether the result of a study is being made.
    assembling: bool,
    /// When a claim for owners below a usage last found nothing, and this usage.
    futile: Option<(Instant, u64)>,
    /// The number of the last parked piece.
    last: u64,
}

struct Parked {
    number: u64,
    owner: String,
    bytes: usize,
    waits: bool,
}

/// A piece that may be parked.
pub(super) struct Parkable<'a> {
    pub(super) owner: &'a str,
    /// Estimated memory.
    pub(super) bytes: usize,
    /// Whether it waits until no other result of a study is being made.
    pub(super) waits: bool,
}

/// The right to make the result of a study.
pub(super) struct Assembling<'a>(&'a Parking);

impl Drop for Assembling<'_> {
    fn drop(&mut self) {
        self.0.state.lock().assembling = false;
    }
}

impl Parking {
    pub(super) fn new(places: usize) -> Self {
        Self { state: Mutex::new(State { free: places, ..State::default() }), ..Self::default() }
    }

    /// Waits for a place. Returns the pieces that were claimed for it, which may be none; `None` as soon as `is_open` is
    /// false.
    pub(super) fn take_place(
        &self,
        usage: impl Fn(&str) -> u64,
        is_open: impl Fn() -> bool,
    ) -> Option<Vec<Claimed>> {
        let mut state = self.state.lock();
        loop {
            if let Some(claims) = state.handed.pop_front() {
                return Some(claims);
            }
            if !is_open() {
                return None;
            }
            if state.free > 0 {
                state.free -= 1;
                if !state.resume(&usage, u64::MAX, |_| true) {
                    return Some(Vec::new());
                }
                self.resuming.notify_all();
            }
            self.entering.wait(&mut state);
        }
    }

    /// Gives the place to the parked piece with the least usage, or frees it. The thread then takes a place again, so no
    /// other one must be woken for a free place.
    pub(super) fn give_place(&self, usage: impl Fn(&str) -> u64) {
        let mut state = self.state.lock();
        if state.resume(usage, u64::MAX, |_| true) {
            self.resuming.notify_all();
        } else {
            state.free += 1;
        }
    }

    /// Wakes all threads, so that they see a new order.
    pub(super) fn wake(&self) {
        let _state = self.state.lock();
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

    /// Begins to make the result of a study; `None` while another one is being made.
    pub(super) fn assemble(&self) -> Option<Assembling<'_>> {
        let mut state = self.state.lock();
        let may = !std::mem::replace(&mut state.assembling, true);
        may.then(|| Assembling(self))
    }

    /// The owners for whom less was computed than for those of all parked pieces, and less than `below`. They have no
    /// parked piece, and are not `but`.
    pub(super) fn others(
        &self,
        usage: impl Fn(&str) -> u64,
        below: u64,
        but: Option<&str>,
    ) -> Owners {
        let state = self.state.lock();
        let ready = state.parked.iter().filter(|piece| state.rank(piece, &usage) < LAST);
        let owners: Vec<_> = ready.map(|piece| piece.owner.clone()).collect();
        let least = owners.iter().map(|owner| usage(owner)).min();
        let except = owners.into_iter().chain(but.map(str::to_owned)).collect();
        Owners { below: least.map_or(below, |least| below.min(least)), except }
    }

    /// Counts a piece that may be parked, until [`release`](Self::release). Returns whether there is room for one more.
    pub(super) fn reserve(&self, piece: &Parkable<'_>) -> bool {
        let (count, bytes) = &mut self.state.lock().reserved;
        *count += 1;
        *bytes += piece.bytes;
        *count <= PARKED && *bytes <= PARKED_BYTES
    }

    /// Ends the count of a piece.
    pub(super) fn release(&self, piece: &Parkable<'_>) {
        let (count, bytes) = &mut self.state.lock().reserved;
        *count -= 1;
        *bytes -= piece.bytes;
    }

    /// Whether a claim for owners below this usage may find something. After a futile one, no thread tries the same for
    /// a slice.
    pub(super) fn may_claim(&self, below: u64, now: Instant) -> bool {
        let is_new = |(at, tried): (Instant, u64)| below > tried || now - at >= SLICE;
        self.state.lock().futile.is_none_or(is_new)
    }

    /// Notes that a claim for owners below this usage has found nothing.
    pub(super) fn found_nothing(&self, below: u64, now: Instant) {
        self.state.lock().futile = Some((now, below));
    }

    /// Parks a piece that has room, and gives its place to claimed pieces. Returns whether the piece has a place
    /// again; it has none if `goes_on` has become false.
    ///
    /// # Errors
    /// The claimed pieces, if `is_open` is false: then the threads end, and none might take them.
    pub(super) fn park_for(
        &self,
        claims: Vec<Claimed>,
        piece: &Parkable<'_>,
        is_open: impl Fn() -> bool,
        goes_on: impl Fn() -> bool,
    ) -> Result<bool, Vec<Claimed>> {
        let mut state = self.state.lock();
        if !is_open() {
            return Err(claims);
        }
        state.handed.push_back(claims);
        self.entering.notify_one();
        Ok(self.wait(state, piece, goes_on))
    }

    /// Parks a piece, and gives its place to the parked piece of another owner with the least usage. Does nothing if this
    /// is not below `below`, or if the parked pieces would have too many bytes. Returns as [`park_for`](Self::park_for).
    pub(super) fn swap(
        &self,
        piece: &Parkable<'_>,
        usage: impl Fn(&str) -> u64,
        below: u64,
        goes_on: impl Fn() -> bool,
    ) -> bool {
        let mut state = self.state.lock();
        let excess = state.reserved.1.saturating_sub(PARKED_BYTES);
        let may =
            |other: &Parked| other.bytes >= excess && (piece.waits || other.owner != piece.owner);
        if !state.resume(usage, below, may) {
            return true;
        }
        self.resuming.notify_all();
        self.wait(state, piece, goes_on)
    }

    fn wait(
        &self,
        mut state: MutexGuard<'_, State>,
        piece: &Parkable<'_>,
        goes_on: impl Fn() -> bool,
    ) -> bool {
        state.last += 1;
        let (number, owner) = (state.last, piece.owner.to_owned());
        state.parked.push(Parked { number, owner, bytes: piece.bytes, waits: piece.waits });
        self.parked.notify_waiters();
        loop {
            self.resuming.wait_for(&mut state, CHECK);
            let place = state.parked.iter().position(|piece| piece.number == number);
            if place.is_none() || !goes_on() {
                place.map(|place| state.parked.remove(place));
                return place.is_none();
            }
        }
    }
}

impl State {
    /// The usage of the owner of a parked piece; [`LAST`] while the piece waits.
    fn rank(&self, piece: &Parked, usage: impl Fn(&str) -> u64) -> u64 {
        if piece.waits && self.assembling { LAST } else { usage(&piece.owner) }
    }

    /// Removes the parked piece with the least rank among those that `may` from the list, if it is below `below`. Its
    /// thread has the place then.
    fn resume(
        &mut self,
        usage: impl Fn(&str) -> u64,
        below: u64,
        may: impl Fn(&Parked) -> bool,
    ) -> bool {
        let parked = self.parked.iter().enumerate().filter(|(_, piece)| may(piece));
        let next = parked.map(|(place, piece)| (self.rank(piece, &usage), place)).min();
        let next = next.filter(|(rank, _)| *rank < below);
        next.map(|(_, place)| self.parked.remove(place)).is_some()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread;

    use super::*;

    fn piece(owner: &str) -> Parkable<'_> {
        Parkable { owner, bytes: PARKED_BYTES / 4, waits: false }
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
                let piece = Parkable { owner, bytes: 0, waits };
                let parked = parking.state.lock().parked.len();
                let thread = scope
                    .spawn(move || parking.park_for(Vec::new(), &piece, || true, goes_on).unwrap());
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
        let parking = Parking::new(0);
        let places = parked(&parking, [("long", false), ("a", false), ("bob", false)], |_| {
            parking.give_place(usage);
        });
        assert_eq!(places, [false, true, false]);
        assert_eq!(parking.state.lock().free, 0);
    }

    #[test]
    fn a_piece_that_waits_for_an_assembly_is_last_until_the_assembly_ends() {
        let parking = Parking::new(0);
        let places = parked(&parking, [("a", true), ("bob", false), ("ada", true)], |_| {
            let assembly = parking.assemble().unwrap();
            assert!(parking.assemble().is_none());
            assert_eq!(parking.others(usage, 9, None).below, 3, "of bob");
            parking.give_place(usage);
            drop(assembly);
            let others = parking.others(usage, 9, Some("eve"));
            assert_eq!(
                (others.below, others.except),
                (1, vec!["a".into(), "ada".into(), "eve".into()])
            );
            parking.give_place(usage);
        });
        assert_eq!(places, [true, true, false]);
    }

    #[test]
    fn a_swap_needs_a_piece_of_an_owner_with_less_usage() {
        let parking = Parking::new(0);
        let places = parked(&parking, [("bob", false)], |goes_on| {
            assert!(parking.swap(&piece("ada"), usage, 3, goes_on), "ada goes on");
            assert!(!parking.swap(&piece("long"), usage, 4, || false), "bob goes on");
        });
        assert_eq!(places, [true]);
    }

    #[test]
    fn a_free_place_resumes_a_parked_piece() {
        let parking = Parking::new(0);
        let places = parked(&parking, [("bob", false)], |goes_on| {
            parking.state.lock().free = 1;
            parking.state.lock().handed.clear();
            // The second place is free after the parked piece has the first one.
            thread::scope(|scope| {
                let entered = scope.spawn(|| parking.take_place(usage, goes_on));
                while parking.has_parked() {
                    thread::yield_now();
                }
                parking.give_place(usage);
                parking.wake();
                assert_eq!(entered.join().unwrap().map(|claims| claims.len()), Some(0));
            });
        });
        assert_eq!(places, [true]);
    }

    #[test]
    fn parked_pieces_have_limited_bytes_and_are_limited_in_number() {
        let (parking, ada) = (Parking::new(0), piece("ada"));
        assert_eq!((0..5).filter(|_| parking.reserve(&ada)).count(), 4);
        parking.release(&ada);
        parking.release(&ada);
        assert!(parking.reserve(&ada));
        let (parking, small) = (Parking::new(0), Parkable { bytes: 0, ..piece("ada") });
        assert_eq!((0..99).filter(|_| parking.reserve(&small)).count(), PARKED);
    }

    #[test]
    fn claims_come_back_if_the_threads_end() {
        let parking = Parking::new(0);
        assert!(parking.park_for(Vec::new(), &piece("ada"), || false, || true).is_err());
    }
}
