//! Runs asynchronous work in commands that are no servers.

use tokio::runtime::Builder;

use super::printing::Error;

/// Runs the asynchronous work of a command to its end.
pub fn block_on<T, E>(work: impl Future<Output = Result<T, E>>) -> Result<T, Error>
where
    Error: From<E>,
{
    let runtime = Builder::new_current_thread().enable_all().build()?;
    Ok(runtime.block_on(work)?)
}
