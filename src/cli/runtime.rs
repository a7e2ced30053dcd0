//! Runs asynchronous work, and work on all cores, in commands that are no servers.

use std::ops::Range;
use std::pin::Pin;
use std::sync::Arc;

use futures_util::{StreamExt as _, stream};
use tokio::runtime::Builder;
use tokio::task::spawn_blocking;

use super::printing::{Error, Progress};
use crate::service::processors;

/// Maximum number of answers that wait for an earlier one. Those of files have about 150 kB.
const WAITING: usize = 1000;

/// Runs the asynchronous work of a command to its end.
pub fn block_on<T, E>(work: impl Future<Output = Result<T, E>>) -> Result<T, Error>
where
    Error: From<E>,
{
    let runtime = Builder::new_current_thread().enable_all().build()?;
    // Boxed futures with the same result have one type, so this is compiled once for each result.
    Ok(runtime.block_on(Box::pin(work) as Pin<Box<dyn Future<Output = _>>>)?)
}

/// Does some work for each item on all cores, and hands the answers to `take` in the order of the items. In place of the answer, `take`
/// gets an error if the work panicked. `span` is what the progress shows: the number of items that are done already, and of all.
pub fn on_all_cores<T: Send + 'static, A: Send + 'static>(
    items: Vec<T>,
    (progress, mut span): (&mut Progress, Range<usize>),
    work: impl Fn(T) -> A + Send + Sync + 'static,
    mut take: impl FnMut(Result<A, Error>) -> Result<(), Error>,
) -> Result<(), Error> {
    let work = Arc::new(work);
    let start = |item| {
        let work = Arc::clone(&work);
        spawn_blocking(move || work(item))
    };
    let runtime = Builder::new_current_thread().max_blocking_threads(processors()).build()?;
    runtime.block_on(async {
        let mut answers = stream::iter(items).map(start).buffered(WAITING);
        while let Some(answer) = answers.next().await {
            let defect = "a thread of the computation failed; this is a defect of fretwork";
            take(answer.map_err(|_| defect.into()))?;
            span.start += 1;
            progress.show(span.start as f64 / span.end as f64);
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use parking_lot::Mutex;

    use super::*;

    #[test]
    fn answers_come_in_order_and_a_panic_takes_the_place_of_one() {
        let ((send, receive), mut answers) = (channel(), Vec::new());
        let (send, receive) = (Mutex::new(send), Mutex::new(receive));
        let span = (&mut Progress::new(false), 0..2000);
        let work = move |number| match number {
            // The first item waits for the last one that may be computed before it is done, if there is another core.
            0 if processors() > 1 => _ = receive.lock().recv().unwrap(),
            7 => panic!("7"),
            number if number + 1 == WAITING => send.lock().send(number).unwrap(),
            _ => {}
        };
        on_all_cores((0..2000).collect(), span, work, |answer| {
            answers.push(answer.is_ok());
            Ok(())
        })
        .unwrap();
        assert!(answers.len() == 2000 && answers.iter().enumerate().all(|(n, ok)| *ok == (n != 7)));
    }
}
