//! The command `doctor`: what is wrong with a running server, or soon will be.

use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

use bytesize::ByteSize;

use super::client::{Client, is_private, refused};
use super::printing::{Ended, Error, harmless, print};
use crate::config::Remote;
use fretwork_job::clock;

/// For each bad finding: how bad it is, its name, and what to do. The worst one is the exit code, as monitors expect.
const ADVICE: &str = include_str!("doctor.txt");

/// The alert `FretworkDiskFillsUp` has the same limit, in bytes.
const LEAST_FREE: f64 = 1e9;
/// The alert `FretworkBackupOld` has the same limit, in seconds.
const OLDEST_BACKUP: f64 = 2.0 * 86400.0;
/// Largest difference of two clocks. The date of an answer has no fraction of a second.
const LARGEST_DIFFERENCE: Duration = Duration::from_secs(2);

/// Prints all findings.
pub fn doctor(settings: &Remote) -> Result<(), Error> {
    let (client, mut worst) = (Client::new(settings)?, 0);
    let mut find = |name: &str, is_good: bool, value: &str| {
        let mut bad = ADVICE.lines().filter(|_| !is_good).filter_map(|line| line.split_once(": "));
        let good = (&*format!("ok     {name}"), "");
        let (head, advice) = bad.find(|(head, _)| head.ends_with(name)).unwrap_or(good);
        worst = worst.max(u8::from(!is_good) + u8::from(head.starts_with("fails")));
        let line = format!("{head}: {}. {advice}", value.trim_end_matches('.'));
        print(format!("{}\n", harmless(line.trim_end())).as_bytes())
    };
    let ready = match client.get("/readyz") {
        Ok(ready) => ready,
        Err(error) => {
            find("server", false, &error.to_string())?;
            return Ended::with(worst);
        }
    };
    let (is_ready, reason) = (ready.status == 200, refused(&ready, None).to_string());
    find("readiness", is_ready, if is_ready { "the server accepts jobs" } else { &reason })?;
    let has_tls = client.base.starts_with("https://");
    find("encryption", is_private(&client.base), if has_tls { "TLS" } else { "none" })?;

    if has_tls {
        // A lie, which the proxy must replace. The cookie of a session shows what the server believes.
        let lie = ("x-forwarded-proto", "http");
        let session = client.once("POST", "/v1/session", &[lie])?;
        if let Some((cookie, rules)) = session.header("set-cookie").split_once(';') {
            client.once("DELETE", "/v1/session", &[lie, ("cookie", cookie)])?;
            let is_right = rules.contains("Secure");
            let words = if is_right { "uses" } else { "does not use" };
            find("proxy", is_right, &format!("the server believes that this client {words} TLS"))?;
        }
    }

    let asked = Instant::now();
    let reply = client.get("/metrics")?;
    if reply.status != 200 {
        find("server", false, &refused(&reply, None).to_string())?;
        return Ended::with(worst);
    }
    // The server writes the date while this program waits.
    let written = SystemTime::now() - asked.elapsed() / 2 - Duration::from_millis(500);
    let date = httpdate::parse_http_date(reply.header("date")).unwrap_or(UNIX_EPOCH);
    let apart = written.duration_since(date).unwrap_or_else(|early| early.duration());
    let words = format!("differs from that of the server by {:.0} s", apart.as_secs_f64());
    find("clock", apart < LARGEST_DIFFERENCE, &words)?;
    let text = String::from_utf8_lossy(&reply.body);
    let rest = |name: &str| text.lines().find_map(|line| line.strip_prefix(name));
    // Unknown values are NaN, for which no comparison holds.
    let metric = |name: &str| rest(name).and_then(|it| it.trim().parse().ok()).unwrap_or(f64::NAN);
    let version = rest("fretwork_build_info{version=\"").and_then(|it| it.split('"').next());
    let version = version.unwrap_or("unknown");
    find("version", version == env!("CARGO_PKG_VERSION"), version)?;
    let free = metric("fretwork_disk_free_bytes");
    let words = if free.is_nan() { "unknown" } else { &format!("{} free", ByteSize(free as u64)) };
    find("disk", free >= LEAST_FREE, words)?;
    let last = metric("fretwork_last_backup_timestamp_seconds");
    let age = clock::now() as f64 / 1e3 - last;
    let words = if last > 0.0 { &format!("{:.0} h old", age / 3600.0) } else { "none is known" };
    find("backup", age <= OLDEST_BACKUP, words)?;
    let lost = metric("fretwork_lost_commits");
    let damaged = metric("fretwork_store_errors_total{kind=\"damaged\"}");
    let words = format!("{lost} acknowledged changes are missing, {damaged} times damage was met");
    find("damage", lost + damaged == 0.0, &words)?;
    Ended::with(worst)
}
