//! Listening sockets, and their addresses as a user reads them.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use tokio::net::TcpListener;

use super::printing::Error;
use crate::http;

/// Listens on an address. If it cannot, the error names the option that changes the address.
pub fn listen(address: SocketAddr, option: &str) -> Result<TcpListener, Error> {
    http::listen(address).map_err(|error| {
        format!("cannot listen on {address}: {error}; choose another address with {option}").into()
    })
}

/// The first line that a server or a worker prints.
pub fn greeting(address: SocketAddr) -> String {
    format!("fretwork {} listens on http://{}", env!("CARGO_PKG_VERSION"), reachable(address))
}

/// The address under which this machine reaches a listener.
pub fn reachable(mut address: SocketAddr) -> SocketAddr {
    if address.ip().is_unspecified() {
        address.set_ip(IpAddr::V4(Ipv4Addr::LOCALHOST));
    }
    address
}
