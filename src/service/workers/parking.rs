//! Which piece a thread computes next: the pieces that were begun and make way for others.
//!
//! A run, or a piece of a study, can take minutes. After a slice of its work, a thread parks it if an owner waits for
//! whom less was computed lately. Any thread may continue a parked piece.

use std::time::{Duration, Instant};

use parking_lot::Mutex;
use tokio::sync::Notify;

use super::assignment::Assignment;
use fretwork_store::{Claimed, Owners, Piece};

#[cfg(test)]
mod simulation;

/// A piece computes for at least this time before it is parked.
pub(super) const SLICE: Duration = Duration::from_millis(200);
/// While the parked pieces have more estimated memory than this, in bytes, no thread claims a piece. So all begun pieces have at
/// most this and the largest piece for each thread.
const PARKED_BYTES: usize = 64 << 20;
/// The rank of a piece that waits until another result of a study is made. Every usage is below.
const LAST: u64 = u64::MAX - 1;

/// The parked pieces of a pool.
pub(super) struct Parking {
    /// How much was computed for an owner lately.
    usage: Box<dyn Fn(&str) -> u64 + Send + Sync>,
    pieces: Mutex<Vec<Assignment>>,
    /// Wakes a thread without a piece, after a piece was parked.
    pub(super) parked: Notify,
    /// When a claim for owners below a usage last found nothing, and this usage.
    futile: Mutex<Option<(Instant, u64)>>,
    /// Locked while the result of a study is made, because a large one takes much memory.
    pub(super) assembling: Mutex<()>,
}

impl Parking {
    pub(super) fn new(usage: impl Fn(&str) -> u64 + Send + Sync + 'static) -> Self {
        Self {
            usage: Box::new(usage),
            pieces: Mutex::default(),
            parked: Notify::new(),
            futile: Mutex::default(),
            assembling: Mutex::default(),
        }
    }

    /// The pieces with less rank come first. One that must stop comes at once, because it then leaves the list.
    fn rank(&self, piece: &Assignment) -> u64 {
        let is_assembly = matches!(piece.claimed.piece, Piece::Assembly { .. });
        match (self.usage)(&piece.claimed.owner) {
            _ if piece.claimed.stop.is_raised() => 0,
            _ if is_assembly && self.assembling.is_locked() => LAST,
            used => used,
        }
    }

    /// The owners for whom less was computed than for those of all parked pieces, and less than `below`. Assemblies that wait do not
    /// count. None if the parked pieces have too much memory.
    pub(super) fn others(&self, below: u64) -> Owners {
        let pieces = self.pieces.lock();
        let ready = pieces.iter().map(|piece| (self.rank(piece), &piece.claimed.owner));
        let (ranks, owners): (Vec<_>, Vec<_>) = ready.filter(|(rank, _)| *rank < LAST).unzip();
        let has_room = bytes(&pieces) <= PARKED_BYTES;
        let below = if has_room { ranks.into_iter().fold(below, u64::min) } else { 0 };
        Owners { below, except: owners.into_iter().cloned().collect() }
    }

    /// Takes the parked piece with the least rank.
    pub(super) fn take(&self) -> Option<Assignment> {
        let mut pieces = self.pieces.lock();
        let (_, place) = self.least(&pieces)?;
        let piece = pieces.swap_remove(place);
        if !pieces.is_empty() {
            self.parked.notify_one();
        }
        Some(piece)
    }

    fn least(&self, pieces: &[Assignment]) -> Option<(u64, usize)> {
        pieces.iter().enumerate().map(|(place, piece)| (self.rank(piece), place)).min()
    }

    /// Called at the end of a slice of this piece. Returns the piece that comes next: one that is claimed for an owner for whom
    /// less was computed, or a parked one with less rank, or the same one. After a futile claim, no thread tries the same for a
    /// slice.
    pub(super) fn next(
        &self,
        piece: Assignment,
        now: Instant,
        claim: impl FnOnce(Owners) -> Option<Claimed>,
    ) -> Assignment {
        let rank = self.rank(&piece);
        let mut owners = self.others(rank);
        owners.except.extend((rank < LAST).then(|| piece.claimed.owner.clone()));
        let below = owners.below;
        let is_new = |(at, tried): (Instant, u64)| below > tried || now - at >= SLICE;
        let has_room = bytes(&self.pieces.lock()) + piece.bytes() <= PARKED_BYTES;
        if has_room && self.futile.lock().is_none_or(is_new) {
            let began = Instant::now();
            if let Some(claimed) = claim(owners) {
                self.pieces.lock().push(piece);
                self.parked.notify_one();
                return claimed.into();
            }
            *self.futile.lock() = Some((now + began.elapsed(), below));
        }
        let mut pieces = self.pieces.lock();
        match self.least(&pieces) {
            Some((least, place)) if least < rank => std::mem::replace(&mut pieces[place], piece),
            _ => piece,
        }
    }
}

fn bytes(pieces: &[Assignment]) -> usize {
    pieces.iter().map(Assignment::bytes).sum()
}

#[cfg(test)]
mod tests {
    use super::super::assignment::Begun;
    use super::*;
    use fretwork_job::{Cost, Key};
    use fretwork_store::{RunId, Stop};

    pub(super) fn claimed(run: i64, owner: &str, is_assembly: bool) -> Claimed {
        Claimed {
            run: RunId(run),
            owner: owner.to_owned(),
            attempt: 1,
            lost: 0,
            key: Key::from_bytes([0; 32]),
            piece: if is_assembly {
                Piece::Assembly { of: 1 }
            } else {
                Piece::Whole { task: String::new() }
            },
            spent: Cost::ZERO,
            trace: None,
            stop: Stop::default(),
        }
    }

    /// The usage of an owner is the length of the name.
    fn parking(parked: &[(&str, bool)]) -> Parking {
        let parking = Parking::new(|owner| owner.len() as u64);
        let pieces = parked.iter().map(|(owner, is_assembly)| claimed(0, owner, *is_assembly));
        parking.pieces.lock().extend(pieces.map(Assignment::from));
        parking
    }

    /// The owner of the piece that comes after one of this owner, and the owners for whom it would have been claimed.
    fn next(parking: &Parking, owner: &str) -> (String, Option<Owners>) {
        let mut asked = None;
        let piece = Assignment { begun: None, claimed: claimed(0, owner, false) };
        let next = parking.next(piece, Instant::now(), |owners| {
            asked = Some(owners);
            None
        });
        (next.claimed.owner, asked)
    }

    #[test]
    fn the_piece_of_the_owner_with_the_least_usage_comes_first() {
        let parking = parking(&[("long", false), ("a", false), ("bob", false)]);
        let owners = std::iter::from_fn(|| parking.take()).map(|piece| piece.claimed.owner);
        assert_eq!(owners.collect::<Vec<_>>(), ["a", "bob", "long"]);
    }

    #[test]
    fn a_piece_makes_way_only_for_less_usage() {
        let parking = parking(&[("bob", false)]);
        assert_eq!(next(&parking, "ada").0, "ada");
        let (owner, asked) = next(&parking, "long");
        assert_eq!(owner, "bob", "it is exchanged for a parked one");
        assert!(asked.is_none(), "the claim for ada was for the same owners, and futile");
        let (owner, asked) = next(&parking, "a");
        assert_eq!((owner, parking.pieces.lock().len()), ("a".into(), 1));
        assert!(asked.is_none(), "no owner has less usage than a");
    }

    #[test]
    fn a_claim_is_for_owners_with_less_usage_and_no_piece() {
        let parking = parking(&[("bob", false)]);
        let piece = Assignment { begun: None, claimed: claimed(0, "long", false) };
        let next = parking.next(piece, Instant::now(), |owners| {
            assert_eq!((owners.below, owners.except), (3, vec!["bob".into(), "long".into()]));
            Some(claimed(1, "eve", false))
        });
        assert_eq!((next.claimed.owner, parking.pieces.lock().len()), ("eve".into(), 2));
    }

    #[test]
    fn an_assembly_is_last_until_another_one_ends() {
        let parking = parking(&[("a", true), ("bob", false), ("ada", true)]);
        let assembly = parking.assembling.lock();
        assert_eq!(parking.others(9).below, 3, "of bob");
        assert_eq!(parking.take().unwrap().claimed.owner, "bob");
        drop(assembly);
        let others = parking.others(9);
        assert_eq!((others.below, others.except), (1, vec!["a".into(), "ada".into()]));
        assert_eq!(parking.take().unwrap().claimed.owner, "a");
    }

    #[test]
    fn parked_pieces_have_limited_memory() {
        let parking = parking(&[]);
        let large = || Some(Begun::endless(PARKED_BYTES / 4));
        for count in 0..5 {
            let piece = Assignment { begun: large(), claimed: claimed(0, "long", false) };
            let next = parking.next(piece, Instant::now(), |_| Some(claimed(1, "a", false)));
            assert_eq!(next.claimed.owner, if count < 4 { "a" } else { "long" });
        }
    }
}
