//! Simulates the threads of a pool from a seed. The parked pieces, and what comes next, are those of the product; the queue
//! and the usage of the owners are a model.

#![cfg(test)]

use std::collections::BTreeMap;
use std::time::Instant;

use parking_lot::{Mutex, MutexGuard};

use super::super::assignment::{Assignment, Begun};
use super::tests::claimed;
use super::{LAST, PARKED_BYTES, Parking, SLICE, bytes};
use fretwork_random::Random;
use fretwork_store::{Claimed, Owners, Piece, RunId};

const OWNERS: [&str; 30] = [
    "a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l", "m", "n", "o", "p", "q", "r", "s",
    "t", "u", "v", "w", "x", "y", "z", "ada", "bob", "eve", "kim",
];

struct Pool {
    random: Random,
    parking: &'static Parking,
    /// The right of the piece that makes the result of a study.
    assembling: Option<(RunId, MutexGuard<'static, ()>)>,
    now: Instant,
    queue: Claimable,
    owners: usize,
    places: Vec<Option<Assignment>>,
    submitted: i64,
    done: i64,
    parked: usize,
    full: usize,
}

/// The claimable pieces, the slices that each unfinished piece takes, and the usage of each owner.
struct Claimable {
    pieces: Vec<Claimed>,
    slices: BTreeMap<RunId, u64>,
    used: &'static Mutex<BTreeMap<&'static str, u64>>,
}

impl Claimable {
    fn used(&self, owner: &str) -> u64 {
        self.used.lock()[owner]
    }

    fn may(&self, owners: &Owners, owner: &str) -> bool {
        self.used(owner) < owners.below && !owners.except.iter().any(|other| other == owner)
    }

    fn claim(&mut self, owners: &Owners) -> Option<Claimed> {
        let waiting = self.pieces.iter().enumerate();
        let may = waiting.filter(|(_, of)| self.may(owners, &of.owner));
        let next = may.min_by_key(|(place, of)| (self.used(&of.owner), *place))?.0;
        Some(self.pieces.remove(next))
    }
}

impl Pool {
    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let (count, owners) = (random.one_of(&[1, 2, 4]), random.one_of(&[6, 30]));
        // Both live as long as the process, like those of a server.
        let used = Box::leak(Box::new(Mutex::new(OWNERS.map(|owner| (owner, 0)).into())));
        let used: &'static Mutex<BTreeMap<&'static str, u64>> = used;
        let parking = Parking::new(|owner| used.lock()[owner]);
        Self {
            random,
            parking: Box::leak(Box::new(parking)),
            assembling: None,
            now: Instant::now(),
            queue: Claimable { pieces: Vec::new(), slices: BTreeMap::new(), used },
            owners,
            places: (0..count).map(|_| None).collect(),
            submitted: 0,
            done: 0,
            parked: 0,
            full: 0,
        }
    }

    fn below(&mut self, end: usize) -> usize {
        self.random.between(0.0, end as f64) as usize
    }

    fn submit(&mut self) {
        let owner = self.random.one_of(&OWNERS[..self.owners]);
        let slices = self.random.log_between(1.0, 100.0) as u64;
        let is_assembly = self.below(8) == 0;
        self.submitted += 1;
        self.queue.pieces.push(claimed(self.submitted, owner, is_assembly));
        self.queue.slices.insert(RunId(self.submitted), slices);
        if let Some(place) = self.places.iter().position(Option::is_none) {
            self.places[place] = self.queue.claim(&Owners::ALL).map(Assignment::from);
        }
    }

    /// As `Worker::slice`. Returns whether the piece has ended.
    fn slice(&mut self, piece: &mut Assignment, largest: f64) -> bool {
        let run = piece.claimed.run;
        if matches!(piece.claimed.piece, Piece::Assembly { .. }) {
            if self.assembling.as_ref().is_none_or(|(other, _)| *other != run) {
                let Some(right) = self.parking.assembling.try_lock() else { return false };
                self.assembling = Some((run, right));
            }
        } else if piece.begun.is_none() {
            let bytes = self.random.log_between(1024.0, largest) as usize;
            piece.begun = Some(Begun::endless(bytes));
        }
        let left = self.queue.slices.get_mut(&run).unwrap();
        *left -= 1;
        let ends = *left == 0;
        *self.queue.used.lock().get_mut(&*piece.claimed.owner).unwrap() += 2;
        if ends {
            self.queue.slices.remove(&run);
            self.assembling.take_if(|(other, _)| *other == run);
        }
        ends
    }

    /// The thread at a place computes for a slice, and goes on as `Worker::compute_all` and `Worker::run`.
    fn turn(&mut self, place: usize, largest: f64) {
        let Some(mut piece) = self.places[place].take() else { return };
        let run = piece.claimed.run;
        self.places[place] = if self.slice(&mut piece, largest) {
            self.done += 1;
            let claimed = self.queue.claim(&self.parking.others(u64::MAX));
            claimed.map(Assignment::from).or_else(|| self.parking.take())
        } else if self.assembling.as_ref().is_some_and(|(assembled, _)| *assembled == run) {
            // The result of a study is made without a pause.
            Some(piece)
        } else {
            Some(self.make_way(piece))
        };
    }

    fn make_way(&mut self, piece: Assignment) -> Assignment {
        let (run, owner, rank) =
            (piece.claimed.run, piece.claimed.owner.clone(), self.parking.rank(&piece));
        let (has_room, futile) = (
            bytes(&self.parking.pieces.lock()) + piece.bytes() <= PARKED_BYTES,
            *self.parking.futile.lock(),
        );
        let mut below = self.parking.others(rank);
        below.except.push(owner);
        let before = self.parking.pieces.lock().len();
        let next = self.parking.next(piece, self.now, |owners| self.queue.claim(&owners));
        let after = self.parking.pieces.lock().len();
        self.parked += usize::from(next.claimed.run != run);
        self.full += usize::from(!has_room);
        let ranks = self.parking.pieces.lock().iter().map(|of| self.parking.rank(of)).min();
        if next.claimed.run == run || after == before {
            let least = ranks.is_none_or(|least| least >= rank.min(self.parking.rank(&next)));
            assert!(least, "a parked piece has less usage");
            let was_futile = futile.is_some_and(|(at, _)| self.now - at < SLICE);
            let waits = self.queue.pieces.iter().any(|of| self.queue.may(&below, &of.owner));
            let is_last = rank >= LAST;
            assert!(!has_room || was_futile || is_last || !waits, "an owner with less waits");
        } else {
            let used = self.queue.used(&next.claimed.owner);
            assert!(used < rank && ranks.is_none_or(|least| used < least), "not the least usage");
        }
        next
    }

    fn check(&self, largest: f64) {
        let pieces = self.parking.pieces.lock();
        let most = PARKED_BYTES + self.places.len() * (largest as usize).max(1 << 20);
        assert!(bytes(&pieces) <= most, "too much is parked");
        let idle = self.places.iter().filter(|place| place.is_none()).count();
        let waiting = self.queue.pieces.len() + pieces.len();
        assert!(idle == 0 || waiting == 0, "a place is idle, and {waiting} pieces wait");
        assert_eq!(self.parking.assembling.is_locked(), self.assembling.is_some());
        let known = waiting + self.places.iter().flatten().count();
        assert_eq!(known, self.queue.slices.len(), "a piece is lost");
    }
}

/// Prints the seed of a history that fails.
struct Seed(u64);

impl Drop for Seed {
    fn drop(&mut self) {
        if std::thread::panicking() {
            println!("FRETWORK_TEST_SEED={} repeats this history", self.0);
        }
    }
}

/// Returns how often a piece was parked, and how often there was no room for one more.
fn history(seed: u64) -> (usize, usize) {
    let _seed = Seed(seed);
    let mut pool = Pool::new(seed);
    let pause = pool.random.log_between(0.3, 30.0);
    let largest = pool.random.one_of(&[2048.0, 8e6, 60e6]);
    for slice in 0.. {
        if slice < 1000 {
            while pool.random.between(0.0, pause) < 0.2 {
                pool.submit();
            }
        }
        for place in 0..pool.places.len() {
            pool.now += SLICE / pool.places.len() as u32;
            pool.turn(place, largest);
            pool.check(largest);
        }
        if slice >= 1000 && pool.done == pool.submitted {
            break;
        }
        assert!(slice < 1_000_000, "{} of {} pieces are done", pool.done, pool.submitted);
    }
    (pool.parked, pool.full)
}

/// `FRETWORK_TEST_LONG` simulates more histories. `FRETWORK_TEST_SEED` chooses the first one.
#[test]
fn in_any_history_all_pieces_are_computed_and_places_go_to_those_with_less_usage() {
    let seed = std::env::var("FRETWORK_TEST_SEED").map_or(1, |seed| seed.parse().unwrap());
    let is_long = std::env::var_os("FRETWORK_TEST_LONG").is_some();
    let count = if is_long { 500 } else { 3 };
    let all = (seed..seed + count).map(history);
    let (parked, full) = all.fold((0, 0), |all, of| (all.0 + of.0, all.1 + of.1));
    println!("{count} histories: {parked} parked, {full} without room");
    assert!(parked > 0 && (full > 0 || !is_long), "{parked} {full}");
}
