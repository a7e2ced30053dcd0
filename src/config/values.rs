//! Values of options: how they are read, and what is wrong with them.

use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::time::Duration;

/// Parses the name of an output file or directory, which - for standard output is not.
pub fn file_name(text: &str) -> Result<PathBuf, &'static str> {
    let file = (text != "-").then(|| text.into());
    file.ok_or("enter the name of a file or directory, not - for standard output")
}

/// Parses the time of a lease. A busy server could not renew a shorter lease in time.
pub fn lease(text: &str) -> Result<Duration, String> {
    let time = duration(text)?;
    let sound = (Duration::from_secs(1)..=Duration::from_hours(1)).contains(&time);
    if sound { Ok(time) } else { Err("expected a time from 1s to 1h".to_owned()) }
}

/// A time limit. `None`, which means no limit, if `time` is 0.
pub fn nonzero(time: Duration) -> Option<Duration> {
    Some(time).filter(|time| !time.is_zero())
}

/// Parses an address and a port, and resolves the name of a host.
pub fn resolve(text: &str) -> Result<SocketAddr, String> {
    let mut found = text.to_socket_addrs().map_err(|error| {
        format!("{error}; expected an address and a port such as 127.0.0.1:8080")
    })?;
    found.next().ok_or_else(|| "the name of the host has no IP address".to_owned())
}

/// Parses a time with a unit; 0 needs no unit.
pub fn duration(text: &str) -> Result<Duration, String> {
    if text == "0" {
        return Ok(Duration::ZERO);
    }
    humantime::parse_duration(text)
        .map_err(|error| format!("{error}; expected a time such as 90s, 10min, 2h or 90d"))
}

/// Parses a number of seconds.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected a number of seconds".to_owned())?;
    Duration::try_from_secs_f64(seconds).map_err(|_| "expected seconds, 0 or more".to_owned())
}
