//! The command `health`.

use std::io::{BufRead as _, BufReader, ErrorKind, Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;

use hyper::Uri;

use super::listening::reachable;
use super::printing::{Error, print};
use crate::config::{Health, resolve};

/// Maximum time to connect, and to wait for the answer.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Sends `GET /healthz` and expects the status 200.
pub fn health(settings: &Health) -> Result<(), Error> {
    let listen = format!("http://{}", reachable(settings.listen));
    let url = settings.url.as_deref().unwrap_or(&listen);
    let uri: Uri = url.parse().map_err(|error| format!("{url} is not a URL: {error}"))?;
    let Some(host) = uri.authority().filter(|_| uri.scheme_str() == Some("http")) else {
        return Err(format!("{url} must begin with http://").into());
    };
    let address = resolve(&format!("{}:{}", host.host(), host.port_u16().unwrap_or(80)))
        .map_err(|error| format!("cannot find the IP address of {host}: {error}"))?;
    let mut connection = TcpStream::connect_timeout(&address, TIMEOUT)
        .map_err(|error| format!("no server answers at {host}: {error}"))?;
    connection.set_read_timeout(Some(TIMEOUT))?;
    let path = if uri.path() == "/" { "/healthz" } else { uri.path() };
    write!(connection, "GET {path} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n")?;
    let mut status = String::new();
    BufReader::new(connection.take(1024)).read_line(&mut status).map_err(|error| {
        match error.kind() {
            // The system accepts connections for a process that is stopped.
            ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                format!("the server at {host} does not answer within {TIMEOUT:?}")
            }
            _ => format!("the server at {host} does not answer: {error}"),
        }
    })?;
    match status.split(' ').nth(1) {
        Some("200") => print(b"ok\n"),
        _ => Err(format!("the server at {host} answers \"{}\", not 200", status.trim_end()).into()),
    }
}
