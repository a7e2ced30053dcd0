//! The command `doctor`: what is wrong with a running server, or soon will be.

use std::time::{Instant, SystemTime, UNIX_EPOCH};

use bytesize::ByteSize;
use serde_json::Value;

use super::client::{Client, is_private};
use super::printing::{Ended, Error, harmless, print};
use crate::config::Remote;

/// What to do about each finding that is bad.
const ADVICE: &str = include_str!("doctor.txt");
/// How bad a finding is. The worst one is the exit code, as monitors expect.
const LEVELS: [&str; 3] = ["ok", "warns", "fails"];
const WARNS: u8 = 1;
const FAILS: u8 = 2;

/// The alert `FretworkDiskFillsUp` has the same limit, in bytes.
const LEAST_FREE: f64 = 1e9;
/// The alert `FretworkBackupOld` has the same limit, in seconds.
const OLDEST_BACKUP: f64 = 2.0 * 86400.0;
/// Largest difference of two clocks, in seconds. The date of an answer has no fraction of a second.
const LARGEST_DIFFERENCE: f64 = 2.0;

/// Prints all findings.
pub fn doctor(settings: &Remote) -> Result<(), Error> {
    let (client, mut worst) = (Client::new(settings)?, 0);
    let mut find = |name: &str, is_good: bool, bad: u8, value: &str| {
        let level = if is_good { 0 } else { bad };
        worst = worst.max(level);
        let advice = |line: &'static str| line.strip_prefix(name)?.strip_prefix(": ");
        let advice = ADVICE.lines().find_map(advice).filter(|_| !is_good).unwrap_or_default();
        let line = format!("{:<5}  {name}: {value}. {advice}", LEVELS[usize::from(level)]);
        print(format!("{}\n", harmless(line.trim_end())).as_bytes())
    };
    let ready = match client.get("/readyz") {
        Ok(ready) => ready,
        Err(error) => {
            find("server", false, FAILS, &error.to_string())?;
            return Ended::with(FAILS);
        }
    };
    let document: Value = serde_json::from_slice(&ready.body).unwrap_or_default();
    let detail = match ready.status {
        200 => "the server accepts jobs",
        _ => document["detail"].as_str().unwrap_or("the answer is not that of a fretwork server"),
    };
    find("readiness", ready.status == 200, FAILS, detail.trim_end_matches('.'))?;
    let has_tls = client.base.starts_with("https://");
    let is_hidden = has_tls || is_private(&client.base);
    find("encryption", is_hidden, WARNS, if has_tls { "TLS" } else { "none" })?;

    // A lie, which a proxy must replace. The cookie of a session shows what the server believes.
    let lie = ("x-forwarded-proto", if has_tls { "http" } else { "https" });
    let session = client.once("POST", "/v1/session", &[lie])?;
    if let Some((cookie, rules)) = session.header("set-cookie").split_once(';') {
        client.once("DELETE", "/v1/session", &[lie, ("cookie", cookie)])?;
        let is_secure = rules.contains("Secure");
        let words = if is_secure { "uses TLS" } else { "does not use TLS" };
        let words = format!("the server believes that this client {words}");
        find("proxy", is_secure == has_tls, FAILS, &words)?;
    }

    let asked = Instant::now();
    let reply = client.get("/metrics")?;
    let seconds = |at: SystemTime| at.duration_since(UNIX_EPOCH).unwrap_or_default().as_secs_f64();
    let now = seconds(SystemTime::now());
    let date = httpdate::parse_http_date(reply.header("date")).map_or(f64::NAN, seconds);
    // The server writes the date while this program waits.
    let apart = (now - 0.5 * asked.elapsed().as_secs_f64() - 0.5 - date).abs();
    let words = format!("differs from that of the server by {apart:.0} s");
    find("clock", apart < LARGEST_DIFFERENCE, WARNS, &words)?;
    if reply.status != 200 {
        let words = format!("the server answers {} instead of its metrics", reply.status);
        find("key", false, FAILS, &words)?;
        return Ended::with(FAILS);
    }
    let text = String::from_utf8_lossy(&reply.body);
    let rest = |name: &str| text.lines().find_map(|line| line.strip_prefix(name));
    // Unknown values are NaN, for which no comparison holds.
    let metric = |name: &str| rest(name).and_then(|it| it.trim().parse().ok()).unwrap_or(f64::NAN);
    let version = rest("fretwork_build_info{version=\"").and_then(|it| it.split('"').next());
    let version = version.unwrap_or("unknown");
    find("version", version == env!("CARGO_PKG_VERSION"), WARNS, version)?;
    let free = metric("fretwork_disk_free_bytes");
    let words = if free.is_nan() { "unknown" } else { &format!("{} free", ByteSize(free as u64)) };
    find("disk", free >= LEAST_FREE, WARNS, words)?;
    let last = metric("fretwork_last_backup_timestamp_seconds");
    let age = now - last;
    let words = if last > 0.0 { &format!("{:.0} h old", age / 3600.0) } else { "none is known" };
    find("backup", age <= OLDEST_BACKUP, WARNS, words)?;
    let lost = metric("fretwork_lost_commits");
    let damaged = metric("fretwork_store_errors_total{kind=\"damaged\"}");
    let words = format!("{lost} acknowledged changes are missing, {damaged} times damage was met");
    find("damage", lost + damaged == 0.0, FAILS, &words)?;
    Ended::with(worst)
}
