//! Notifications between servers. A notification contains hints: what has changed, so that other servers read it again.
//!
//! A transaction with a notification takes a lock of the whole database when it commits. So verbs send no
//! notifications. One task of each server collects the hints of its verbs and sends them together. A hint can be lost,
//! so each server also reads the tables periodically. Only the rare deletion of a result sends a notification in its
//! own transaction.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::mem;

use parking_lot::Mutex;
use sqlx::postgres::PgConnection;
use tokio::sync::Notify;

use crate::database::{Connected, Effect, Result, RunId, sql};
use fretwork_job::Key;

/// The channel of the notifications.
pub(super) const CHANNEL: &str = "fretwork";

/// Maximum number of hints in one notification. PostgreSQL limits the text to 8000 bytes.
const AT_ONCE: usize = 100;

/// Something that may have changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Hint {
    Queued,
    Unwanted(i64),
    Ended(Key),
    Changed(Key),
}

/// The hints that are not sent yet.
#[derive(Debug, Default)]
pub(super) struct Hints {
    waiting: Mutex<BTreeSet<Hint>>,
    added: Notify,
}

impl Hints {
    /// Adds hints for those signals that concern other servers.
    pub(super) fn add(&self, effects: &[Effect]) {
        let hints = effects.iter().filter_map(|effect| match effect {
            Effect::Queued => Some(Hint::Queued),
            Effect::Unwanted(run) => Some(Hint::Unwanted(run.0)),
            Effect::Ended(key) => Some(Hint::Ended(*key)),
            Effect::Changed(key) => Some(Hint::Changed(*key)),
            _ => None,
        });
        let mut waiting = self.waiting.lock();
        let before = waiting.len();
        waiting.extend(hints);
        if waiting.len() > before {
            self.added.notify_one();
        }
    }

    /// Waits for hints. Removes up to [`AT_ONCE`] of them, and returns them as the text of one notification.
    pub(super) async fn next(&self, node: &str) -> String {
        loop {
            if let Some(text) = self.take(node) {
                return text;
            }
            self.added.notified().await;
        }
    }

    fn take(&self, node: &str) -> Option<String> {
        let mut waiting = self.waiting.lock();
        let rest = waiting.iter().nth(AT_ONCE).copied().map(|hint| waiting.split_off(&hint));
        let some = mem::replace(&mut *waiting, rest.unwrap_or_default());
        (!some.is_empty()).then(|| {
            let mut text = node.to_owned();
            for hint in some {
                // Writing to a `String` cannot fail.
                let _ = match hint {
                    Hint::Queued => write!(text, "\nqueued"),
                    Hint::Unwanted(run) => write!(text, "\nunwanted {run}"),
                    Hint::Ended(key) => write!(text, "\nended {key}"),
                    Hint::Changed(key) => write!(text, "\nchanged {key}"),
                };
            }
            text
        })
    }
}

/// Sends a notification.
pub(super) async fn send(db: &mut PgConnection, text: &str) -> Result<()> {
    db.execute(sql!("SELECT pg_notify($1, $2)"; CHANNEL, text)).await
}

/// The signals in a notification of another server. A notification of this server gives none. Unknown hints, from a
/// later version, are ignored.
pub(super) fn read(text: &str, node: &str) -> Vec<Effect> {
    let mut lines = text.lines();
    if lines.next() == Some(node) {
        return Vec::new();
    }
    let effect = |line: &str| {
        let (word, of) = line.split_once(' ').unwrap_or((line, ""));
        match word {
            "queued" => Some(Effect::Queued),
            "unwanted" => Some(Effect::Unwanted(RunId(of.parse().ok()?))),
            "ended" => Some(Effect::Ended(of.parse().ok()?)),
            "changed" => Some(Effect::Changed(of.parse().ok()?)),
            "deleted" => Some(Effect::Deleted(of.parse().ok()?)),
            _ => None,
        }
    };
    lines.filter_map(effect).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn hints_reach_other_servers_in_short_notifications() {
        let hints = Hints::default();
        let key = |number| Key::from_bytes([number; 32]);
        for number in 0..120 {
            let effects = [Effect::Queued, Effect::Unwanted(RunId(7)), Effect::Ended(key(number))];
            hints.add(&effects);
        }
        hints.add(&[Effect::Changed(key(1)), Effect::LetGo((RunId(7), None))]);
        let mut received = Vec::new();
        for _ in 0..2 {
            let text = hints.next("this").await;
            assert!(text.len() < 8000, "{} bytes", text.len());
            assert!(read(&text, "this").is_empty(), "a server ignores its own hints");
            received.extend(read(&text, "other"));
        }
        assert!(hints.take("this").is_none());
        assert_eq!(received.len(), 123);
        let count = |is: fn(&Effect) -> bool| received.iter().filter(|effect| is(effect)).count();
        assert_eq!(count(|effect| matches!(effect, Effect::Ended(_))), 120);
        assert_eq!(count(|effect| matches!(effect, Effect::Unwanted(RunId(7)))), 1);
    }
}
