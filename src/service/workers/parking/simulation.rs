//! Simulates the threads of a pool from a seed. The places and the parked pieces are those of the product; the queue and
//! the usage of the owners are a model. No thread sleeps: a piece is parked without the wait for its place.

#![cfg(test)]

use std::collections::BTreeMap;
use std::time::Instant;

use parking_lot::{Mutex, MutexGuard};

use super::{LAST, PARKED, PARKED_BYTES, Parkable, Parking, SLICE};
use fretwork_random::Random;
use fretwork_store::Owners;

const OWNERS: [&str; 6] = ["ada", "bob", "eve", "kim", "lea", "max"];

/// A piece on a thread.
struct SimulatedPiece {
    owner: &'static str,
    bytes: usize,
    slices: u64,
    /// Whether it makes the result of a study, and whether it has begun.
    assembles: Option<bool>,
}

impl SimulatedPiece {
    fn parkable(&self) -> Parkable {
        let waits = self.assembles == Some(false);
        let bytes = if waits { 0 } else { self.bytes };
        Parkable { owner: self.owner.to_owned(), bytes, waits }
    }
}

struct Pool {
    random: Random,
    parking: &'static Parking,
    /// The right of the piece that makes the result of a study.
    assembling: Option<MutexGuard<'static, ()>>,
    now: Instant,
    /// The claimable pieces, and since when they wait.
    queue: Vec<(SimulatedPiece, Instant)>,
    places: Vec<Option<SimulatedPiece>>,
    asleep: BTreeMap<u64, SimulatedPiece>,
    used: &'static Mutex<BTreeMap<&'static str, u64>>,
    submitted: usize,
    done: usize,
    parked: usize,
    full: usize,
}

impl Pool {
    fn new(seed: u64) -> Self {
        let mut random = Random::new(seed);
        let count = random.one_of(&[1, 2, 4]);
        // Both live as long as the process, like those of a server.
        let used = Box::leak(Box::new(Mutex::new(OWNERS.map(|owner| (owner, 0)).into())));
        let used: &'static Mutex<BTreeMap<&'static str, u64>> = used;
        let parking = Parking::new(count, |owner| used.lock()[owner]);
        let pool = Self {
            random,
            parking: Box::leak(Box::new(parking)),
            assembling: None,
            now: Instant::now(),
            queue: Vec::new(),
            places: (0..count).map(|_| None).collect(),
            asleep: BTreeMap::new(),
            used,
            submitted: 0,
            done: 0,
            parked: 0,
            full: 0,
        };
        (0..count).for_each(|_| pool.idle());
        pool
    }

    fn below(&mut self, end: usize) -> usize {
        self.random.between(0.0, end as f64) as usize
    }

    fn used(&self, owner: &str) -> u64 {
        self.used.lock()[owner]
    }

    /// A thread takes a free place, and has no work.
    fn idle(&self) {
        let claims = self.parking.take_place();
        assert_eq!(claims.map(|claims| claims.len()), Some(0));
        self.parking.set_idle(true);
    }

    fn submit(&mut self, largest: f64) {
        let owner = self.random.one_of(&OWNERS);
        let bytes = self.random.log_between(1024.0, largest) as usize;
        let slices = self.random.log_between(1.0, 100.0) as u64;
        let assembles = (self.below(8) == 0).then_some(false);
        self.queue.push((SimulatedPiece { owner, bytes, slices, assembles }, self.now));
        self.submitted += 1;
        if let Some(place) = self.places.iter().position(Option::is_none) {
            self.parking.set_idle(false);
            self.places[place] = self.claim(&Owners::ALL);
        }
    }

    fn may(&self, owners: &Owners, owner: &str) -> bool {
        self.used(owner) < owners.below && !owners.except.iter().any(|other| other == owner)
    }

    fn claim(&mut self, owners: &Owners) -> Option<SimulatedPiece> {
        let queue = self.queue.iter().enumerate();
        let may = queue.filter(|(_, (piece, _))| self.may(owners, piece.owner));
        let next = may.min_by_key(|(place, (piece, _))| (self.used(piece.owner), *place))?.0;
        Some(self.queue.remove(next).0)
    }

    /// The piece that has a place again, if there is one.
    fn resumed(&mut self) -> Option<SimulatedPiece> {
        let parked: Vec<_> =
            self.parking.state.lock().parked.iter().map(|(number, _)| *number).collect();
        let number = *self.asleep.keys().find(|number| !parked.contains(number))?;
        self.asleep.remove(&number)
    }

    /// Parks the piece at a place, as `Parking::wait`, and gives the place to another one.
    fn park(&mut self, place: usize, next: SimulatedPiece) {
        let piece = self.places[place].replace(next).unwrap();
        let number = self.parking.state.lock().park(&piece.parkable());
        self.asleep.insert(number, piece);
        self.parked += 1;
    }

    /// As `Worker::make_way`.
    fn make_way(&mut self, place: usize, below: u64) {
        let piece = self.places[place].as_ref().unwrap().parkable();
        let has_room = self.parking.state.lock().has_room(&piece);
        let but = (!piece.waits).then_some(piece.owner.clone());
        let owners = self.parking.others(below, but.as_deref());
        let was_futile = has_room && !self.parking.may_claim(&piece, owners.below, self.now);
        if has_room && !was_futile {
            if let Some(next) = self.claim(&owners) {
                return self.park(place, next);
            }
            self.parking.found_nothing(owners.below, self.now);
        }
        let mut state = self.parking.state.lock();
        let is_resumed = self.parking.resume_for(&mut state, &piece, below);
        let excess = state.bytes_with(&piece).saturating_sub(PARKED_BYTES);
        let may =
            |other: &Parkable| other.bytes >= excess && (piece.waits || other.owner != piece.owner);
        let left = state.parked.iter().filter(|(_, other)| may(other));
        let left = left.map(|(_, other)| self.parking.rank(other)).min();
        drop(state);
        if is_resumed {
            let next = self.resumed().expect("a parked piece has the place");
            return self.park(place, next);
        }
        assert!(left.is_none_or(|rank| rank >= below), "a parked piece has less usage");
        self.full += usize::from(!has_room);
        let claimable = self.queue.iter().filter(|(other, since)| {
            let is_new = self.now.duration_since(*since) < SLICE;
            but.as_deref() != Some(other.owner)
                && self.used(other.owner) < below
                && !(was_futile && is_new)
        });
        assert!(!has_room || claimable.count() == 0, "an owner with less usage waits");
    }

    /// The thread at a place computes for a slice.
    fn turn(&mut self, place: usize) {
        let Some(piece) = &mut self.places[place] else { return };
        let owner = piece.owner;
        if piece.assembles == Some(false) {
            let Some(right) = self.parking.assembling.try_lock() else {
                return self.make_way(place, LAST);
            };
            self.assembling = Some(right);
            piece.assembles = Some(true);
        }
        piece.slices -= 1;
        *self.used.lock().get_mut(owner).unwrap() += 2;
        if piece.slices > 0 {
            // The result of a study is made without a pause.
            if piece.assembles.is_none() && self.parking.is_full() {
                self.make_way(place, self.used(owner));
            }
            return;
        }
        if piece.assembles.is_some() {
            self.assembling = None;
        }
        self.done += 1;
        let owners = self.parking.others(u64::MAX, None);
        self.places[place] = self.claim(&owners);
        if self.places[place].is_none() {
            self.parking.give_place();
            self.places[place] = self.resumed();
            if self.places[place].is_none() {
                self.idle();
            }
        }
    }

    fn check(&self) {
        let state = self.parking.state.lock();
        let bytes: usize = self.asleep.values().map(|piece| piece.parkable().bytes).sum();
        assert!(self.asleep.len() <= PARKED && bytes <= PARKED_BYTES, "too much is parked");
        let idle = self.places.iter().filter(|place| place.is_none()).count();
        assert_eq!((state.free, state.idle, state.parked.len()), (0, idle, self.asleep.len()));
        let waiting = self.queue.len() + self.asleep.len();
        assert!(idle == 0 || waiting == 0, "a place is idle, and {waiting} pieces wait");
        let begun = self.places.iter().flatten().filter(|piece| piece.assembles == Some(true));
        assert_eq!(
            usize::from(self.parking.assembling.is_locked()),
            begun.count(),
            "one result at a time is made"
        );
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
                pool.submit(largest);
            }
        }
        for place in 0..pool.places.len() {
            pool.now += SLICE / pool.places.len() as u32;
            pool.turn(place);
            pool.check();
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
    let count = if std::env::var_os("FRETWORK_TEST_LONG").is_some() { 500 } else { 8 };
    let all = (seed..seed + count).map(history);
    let (parked, full) = all.fold((0, 0), |all, of| (all.0 + of.0, all.1 + of.1));
    println!("{count} histories: {parked} parked, {full} without room");
    assert!(parked > 0 && full > 0, "{parked} {full}");
}
