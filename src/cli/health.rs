//! The command `health`.

use super::client::Client;
use super::printing::{Error, print};
use crate::config::Remote;

/// Sends `GET /healthz` and expects the status 200.
pub fn health(settings: &Remote) -> Result<(), Error> {
    let client = Client::new(settings)?;
    let answer = client.get("/healthz")?;
    match answer.status {
        200 => print(b"ok\n"),
        status => Err(format!("the server at {} answers {status}, not 200", client.base).into()),
    }
}
