//! Decides which refusals the log shows. Anyone can cause many refusals per second, and their log lines must not fill
//! the disk. The metrics count all refusals.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use parking_lot::Mutex;

/// Maximum number of refusals with one status that the log shows in each [`PERIOD`]. Their lines take about 20 kB.
const SHOWN: u64 = 60;
const PERIOD: Duration = Duration::from_mins(1);

/// Counts the refusals of each status.
#[derive(Debug, Default)]
pub struct Refusals(Mutex<BTreeMap<u16, Counted>>);

/// The refusals of one status in the current period.
#[derive(Debug)]
struct Counted {
    began: Instant,
    count: u64,
}

/// Logs a line about answers that the log does not show one by one: with level info for refusals (4xx), with level warn
/// for failures (5xx).
macro_rules! log {
    ($status:expr, $($entry:tt)*) => {
        if $status < 500 { tracing::info!($($entry)*) } else { tracing::warn!($($entry)*) }
    };
}

impl Refusals {
    /// Counts a refusal with this status. Returns whether the log shows it. Logs how many it did not show in the period
    /// before.
    pub fn are_shown(&self, status: u16) -> bool {
        let mut all = self.0.lock();
        let now = Instant::now();
        let counted = all.entry(status).or_insert(Counted { began: now, count: 0 });
        if now - counted.began > PERIOD {
            let not_shown = counted.count.saturating_sub(SHOWN);
            if not_shown > 0 {
                log!(status, status, not_shown, "more answers with this status were not logged");
            }
            *counted = Counted { began: now, count: 0 };
        }
        counted.count += 1;
        if counted.count == SHOWN {
            log!(
                status,
                status,
                "many answers with this status: the metrics count them, and this minute the log shows no more"
            );
        }
        counted.count <= SHOWN
    }
}
