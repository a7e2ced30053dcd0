//! Which parts a worker may claim again after they were lost. A part is lost if its process dies, and it may be the cause.
//!
//! A part that was lost waits until its process has been up for a while, so a process that is killed again and again does
//! not lose it each time. Then no other such part runs beside it, so it is not blamed for them. Before the third loss, with
//! which it fails, it runs alone.

/// A part that was lost this often runs alone.
const ALONE: u32 = 2;

/// What a claim does with a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    Claims,
    /// It claims another part.
    PassesOver,
    /// It claims nothing, so that one part runs alone.
    Waits,
}

/// What decides about parts that were lost.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Caution {
    is_settled: bool,
    /// How often the running part was lost that was lost most often; `None` if no part is running.
    running: Option<u32>,
}

impl Caution {
    /// For a process that `is_settled`, or may still die soon, and whose running parts were lost this often.
    pub(crate) fn of(is_settled: bool, running: impl Iterator<Item = u32>) -> Self {
        Self { is_settled, running: running.max() }
    }

    /// What a claim does with a part that was lost this often.
    pub(crate) fn on(&self, lost: u32) -> Verdict {
        match (lost, self.running) {
            (_, Some(ALONE..)) => Verdict::Waits,
            (0, _) => Verdict::Claims,
            (_, Some(1..)) => Verdict::PassesOver,
            _ if !self.is_settled => Verdict::PassesOver,
            (ALONE.., Some(_)) => Verdict::Waits,
            _ => Verdict::Claims,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lost_part_waits_then_runs_beside_sound_ones_and_at_last_alone() {
        use Verdict::{Claims, PassesOver, Waits};
        // What happens to a part that was never lost, lost once, and lost twice.
        let verdicts = |is_settled, running: &[u32]| {
            let caution = Caution::of(is_settled, running.iter().copied());
            [0, 1, 2].map(|lost| caution.on(lost))
        };
        assert_eq!(verdicts(false, &[]), [Claims, PassesOver, PassesOver]);
        assert_eq!(verdicts(false, &[0, 0]), [Claims, PassesOver, PassesOver]);
        assert_eq!(verdicts(true, &[]), [Claims, Claims, Claims]);
        assert_eq!(verdicts(true, &[0]), [Claims, Claims, Waits]);
        assert_eq!(verdicts(true, &[0, 1]), [Claims, PassesOver, PassesOver]);
        assert_eq!(verdicts(true, &[2]), [Waits, Waits, Waits]);
    }
}
