//! Runs asynchronous work in commands that are no servers.

use std::pin::Pin;

use tokio::runtime::Builder;

use super::printing::Error;

/// Runs the asynchronous work of a command to its end.
pub fn block_on<T, E>(work: impl Future<Output = Result<T, E>>) -> Result<T, Error>
where
    Error: From<E>,
{
    let runtime = Builder::new_current_thread().enable_all().build()?;
    // Boxed futures with the same result have one type, so this is compiled once for each result.
    Ok(runtime.block_on(Box::pin(work) as Pin<Box<dyn Future<Output = _>>>)?)
}
