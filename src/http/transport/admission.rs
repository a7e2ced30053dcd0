//! Decides which connections the server accepts.

use std::collections::HashMap;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};
use std::sync::Arc;
use std::time::{Duration, Instant};

use parking_lot::Mutex;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::gauge::Gauge;

use super::connection::Activity;
use crate::http::access::caller::network;

/// Number of connections that are reserved for clients on this machine, so that its operator can always connect.
const RESERVE: usize = 64;
/// The addresses of this machine.
const LOOPBACK: [IpAddr; 2] = [IpAddr::V4(Ipv4Addr::LOCALHOST), IpAddr::V6(Ipv6Addr::LOCALHOST)];
/// Maximum number of displaced connections whose sockets are still open.
const MOST_DISPLACED: usize = 256;
/// Number of idle connections that are compared to find the one that has been idle for the longest time.
const COMPARED: usize = 64;
/// Refused connections are logged at most once in this time.
const LOG_PAUSE: Duration = Duration::from_mins(1);

/// Limits of connections.
#[derive(Debug, Clone)]
pub struct Connections {
    /// Maximum number of connections in total.
    pub total: usize,
    /// Maximum number of connections of one address. This machine and the trusted proxies have no limit of their own.
    pub per_address: usize,
    /// The addresses of reverse proxies. They send the address of a client in `X-Forwarded-For`.
    pub proxies: Vec<IpAddr>,
}

impl Default for Connections {
    fn default() -> Self {
        Self { total: 4096, per_address: 1024, proxies: Vec::new() }
    }
}

/// The open connections of a server.
pub struct Admission {
    limits: Connections,
    table: Mutex<Table>,
    /// The number of open connections.
    pub open: Gauge,
    /// The number of refused connections.
    pub refused: Counter,
}

#[derive(Debug, Default)]
struct Table {
    connections: HashMap<u64, (IpAddr, Arc<Activity>)>,
    addresses: HashMap<IpAddr, usize>,
    /// The number of the next connection.
    next: u64,
    /// Displaced connections whose sockets are still open.
    displaced: usize,
    /// The number of refusals since the last line in the log, and the time of that line.
    unlogged: u64,
    logged: Option<Instant>,
}

/// An open connection. Dropping it frees its place.
pub struct OpenConnection {
    admission: Arc<Admission>,
    number: u64,
    pub activity: Arc<Activity>,
}

impl Admission {
    pub fn new(limits: Connections) -> Self {
        let (table, open, refused) = (Mutex::default(), Gauge::default(), Counter::default());
        Self { limits, table, open, refused }
    }

    /// Whether a reverse proxy has this address.
    pub fn is_proxy(&self, address: IpAddr) -> bool {
        self.limits.proxies.contains(&address)
    }

    /// Admits a connection, or refuses it. If the limit is reached, the server closes a connection that has been idle
    /// for a long time, and admits the new one.
    pub fn admit(self: &Arc<Self>, address: IpAddr) -> Option<OpenConnection> {
        let Connections { total, per_address, .. } = self.limits;
        let is_proxy = self.is_proxy(address);
        let is_own = !is_proxy && LOOPBACK.contains(&address);
        let origin = network(address);
        let mut table = self.table.lock();
        let of_address = table.addresses.get(&origin).copied().unwrap_or(0);
        let is_limited = !is_own && !is_proxy;
        let most = if is_own { total } else { total.saturating_sub(RESERVE).max(1) };
        // Clients of other machines cannot displace connections of this machine while there are at most `RESERVE` of
        // them.
        let own = LOOPBACK.iter().filter(|own| !self.is_proxy(**own)).map(|own| network(*own));
        let own: Vec<IpAddr> = own.collect();
        let of_machine: usize = own.iter().filter_map(|own| table.addresses.get(own)).sum();
        let protects = !is_own && of_machine <= RESERVE;
        let displaceable = |other| !(protects && own.contains(&other));
        let has_room =
            (!is_limited || of_address < per_address || table.displace(|other| other == origin))
                && (table.connections.len() < most || table.displace(displaceable));
        if !has_room {
            self.refused.inc();
            table.log_refusal(address);
            return None;
        }
        let activity = Arc::new(Activity::new());
        let number = table.next;
        table.next += 1;
        table.connections.insert(number, (origin, Arc::clone(&activity)));
        *table.addresses.entry(origin).or_default() += 1;
        self.open.set(table.connections.len().cast_signed() as i64);
        Some(OpenConnection { admission: Arc::clone(self), number, activity })
    }
}

impl Table {
    /// Closes an idle connection from the addresses that `among` accepts: of the first [`COMPARED`], the one that has
    /// been idle for the longest time. Returns false if none is idle.
    fn displace(&mut self, among: impl Fn(IpAddr) -> bool) -> bool {
        if self.displaced >= MOST_DISPLACED {
            return false;
        }
        let idle = self.connections.iter().filter(|(_, (address, _))| among(*address));
        let idle = idle.filter_map(|(number, (_, activity))| Some((activity.idle()?, *number)));
        let Some((_, number)) = idle.take(COMPARED).max() else { return false };
        if let Some(activity) = self.remove(number) {
            activity.displace();
            self.displaced += 1;
        }
        true
    }

    fn remove(&mut self, number: u64) -> Option<Arc<Activity>> {
        let (address, activity) = self.connections.remove(&number)?;
        if let Some(count) = self.addresses.get_mut(&address) {
            *count -= 1;
            if *count == 0 {
                self.addresses.remove(&address);
            }
        }
        Some(activity)
    }

    fn log_refusal(&mut self, address: IpAddr) {
        self.unlogged += 1;
        if self.logged.is_none_or(|logged| logged.elapsed() >= LOG_PAUSE) {
            let (refused, open) = (self.unlogged, self.connections.len());
            tracing::warn!(refused, open, last = %address, "refused connections");
            (self.unlogged, self.logged) = (0, Some(Instant::now()));
        }
    }
}

impl Drop for OpenConnection {
    fn drop(&mut self) {
        let mut table = self.admission.table.lock();
        if table.remove(self.number).is_none() {
            table.displaced -= 1;
        }
        self.admission.open.set(table.connections.len().cast_signed() as i64);
    }
}

#[cfg(test)]
mod tests {
    use axum::http::Version;

    use super::*;

    fn admission(total: usize, per_address: usize) -> Arc<Admission> {
        let proxies = vec!["10.0.0.9".parse().unwrap()];
        Arc::new(Admission::new(Connections { total, per_address, proxies }))
    }

    #[test]
    fn one_address_cannot_take_all_places() {
        let admission = admission(1000, 3);
        let admit = |address: &str| {
            let open = admission.admit(address.parse().unwrap())?;
            Some((open.activity.begin(Version::HTTP_11), open))
        };
        let busy: Vec<_> = (0..3).map(|_| admit("10.0.0.1").unwrap()).collect();
        assert!(admit("10.0.0.1").is_none());
        assert!(admit("10.0.0.2").is_some());
        let networks: Vec<_> = (0..3).map(|n| admit(&format!("fd00::{n}")).unwrap()).collect();
        assert!(admit("fd00::99").is_none() && admit("fd00:0:0:1::1").is_some());
        // This machine and a proxy have no limit, because many clients share their address.
        for address in ["127.0.0.1", "10.0.0.9"] {
            let many: Vec<_> = (0..10).map(|_| admit(address)).collect();
            assert!(many.iter().all(Option::is_some));
        }
        assert_eq!(admission.refused.get(), 2);
        drop((busy, networks));
        assert!(admit("10.0.0.1").is_some());
        assert_eq!(admission.open.get(), 0);
    }

    #[test]
    fn a_new_connection_displaces_the_one_that_was_idle_for_the_longest_time() {
        let admission = admission(RESERVE + 2, 100);
        let address = |n: u8| IpAddr::from([10, 0, 0, n]);
        let first = admission.admit(address(1)).unwrap();
        std::thread::sleep(Duration::from_millis(5));
        let second = admission.admit(address(2)).unwrap();
        let third = admission.admit(address(3)).unwrap();
        assert!(!admission.table.lock().connections.contains_key(&first.number));
        let requests = [&second, &third].map(|open| open.activity.begin(Version::HTTP_11));
        assert!(admission.admit(address(4)).is_none(), "all are busy");
        assert!(admission.admit(IpAddr::V4(Ipv4Addr::LOCALHOST)).is_some());
        drop(requests);
        assert!(admission.admit(address(4)).is_some());
    }

    #[test]
    fn clients_of_other_machines_do_not_displace_those_of_this_machine() {
        for own in LOOPBACK {
            let admission = admission(RESERVE + 2, 100);
            let other = |n: u8| admission.admit(IpAddr::from([10, 0, 0, n])).unwrap();
            let first = admission.admit(own).unwrap();
            let others: Vec<_> = (1..=200).map(other).collect();
            assert!(admission.table.lock().connections.contains_key(&first.number), "{own}");
            drop(others);
            // Beyond the reserve, connections of this machine are displaced like all others.
            let many: Vec<_> = (0..RESERVE).map(|_| admission.admit(own).unwrap()).collect();
            let held = || admission.table.lock().addresses.get(&network(own)).copied();
            assert_eq!(held(), Some(RESERVE + 1));
            let new = other(1);
            assert_eq!(held(), Some(RESERVE), "{own}");
            drop((first, many, new));
        }
    }
}
