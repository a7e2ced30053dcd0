//! Times in milliseconds since 1970, UTC.

use std::time::{Duration, UNIX_EPOCH};

/// The current time, in milliseconds since 1970.
///
/// # Panics
/// If the system clock is before 1970.
#[expect(
    clippy::expect_used,
    reason = "with a clock before 1970, every stored time would be wrong"
)]
pub fn now() -> i64 {
    let since = UNIX_EPOCH.elapsed().expect("the system clock is after 1970");
    i64::try_from(since.as_millis()).expect("the system clock is before the year 292 million")
}

/// Writes a time in milliseconds since 1970 as RFC 3339, UTC.
pub fn rfc3339(milliseconds: i64) -> String {
    let since = Duration::from_millis(milliseconds.unsigned_abs());
    humantime::format_rfc3339_millis(UNIX_EPOCH + since).to_string()
}

/// Reads an RFC 3339 time after 1970; returns milliseconds since 1970.
pub fn parse(text: &str) -> Option<i64> {
    let since = humantime::parse_rfc3339_weak(text).ok()?.duration_since(UNIX_EPOCH).ok()?;
    i64::try_from(since.as_millis()).ok()
}
