//! Answers that are sent while they are written.
//!
//! A table as text can take several times the memory of its result. So a large table is never in memory as a whole: a
//! thread writes it in pieces, and waits while the client reads them. The thread gives up when the client stops
//! reading, because one stream of HTTP/2 can stall while other streams of the same connection go on. The length of an
//! answer is known only after it was written. A short answer is received as a whole.

use std::io::{self, Write};
use std::mem;
use std::time::Duration;

use axum::body::{Body, Bytes};
use futures_util::{StreamExt as _, stream};
use tokio::runtime::{self, Runtime};
use tokio::sync::mpsc;
use tokio::time::timeout;

/// Size of the first piece in bytes. An answer that is not longer is received as a whole.
const FIRST: usize = 256 << 10;
/// Size of each later piece in bytes.
const PIECE: usize = 64 << 10;
/// Memory that an answer takes while it is sent, including a decompressor, in bytes.
pub const MEMORY: usize = 1 << 20;
/// Maximum number of pieces that wait for the client, in addition to those in the buffers of the socket.
const WAITING: usize = 2;
/// Maximum time that a piece waits for the client. The slowest client that the server accepts reads a piece in 16 s.
const PATIENCE: Duration = Duration::from_mins(1);

/// Writes the pieces of an answer. Only a thread that may block can use it.
pub struct PieceWriter<H> {
    sender: mpsc::Sender<Bytes>,
    piece: Vec<u8>,
    /// Size at which the present piece is sent, in bytes.
    size: usize,
    /// The writer drops this value before it sends the first piece.
    held: Option<H>,
    /// Measures how long a piece waits. The writer has a runtime of its own for this, because the runtime of the server
    /// may end first.
    clock: Option<Runtime>,
    patience: Duration,
}

/// Receives the pieces of an answer.
pub struct PieceReceiver(mpsc::Receiver<Bytes>);

/// The beginning of an answer.
pub enum Beginning {
    /// The writer has ended. If it has not failed, this is the whole answer.
    Ended(Bytes),
    /// The first two pieces.
    Pieces([Bytes; 2]),
}

/// Makes a writer, and the receiver of its pieces. The writer drops `held` before it sends the first piece.
pub fn pieces<H>(held: H) -> (PieceWriter<H>, PieceReceiver) {
    let (sender, received) = mpsc::channel(WAITING);
    let (piece, held) = (Vec::new(), Some(held));
    let writer = PieceWriter { sender, piece, size: FIRST, held, clock: None, patience: PATIENCE };
    (writer, PieceReceiver(received))
}

impl<H> PieceWriter<H> {
    fn send(&mut self) -> io::Result<()> {
        self.held = None;
        self.size = PIECE;
        let piece = mem::replace(&mut self.piece, Vec::with_capacity(PIECE));
        let clock = match &mut self.clock {
            Some(clock) => clock,
            none => none.insert(runtime::Builder::new_current_thread().enable_time().build()?),
        };
        let sent =
            clock.block_on(async { timeout(self.patience, self.sender.send(piece.into())).await });
        match sent {
            Ok(Ok(())) => Ok(()),
            // The client has disconnected, or the server has closed the connection.
            Ok(Err(_)) => Err(io::ErrorKind::BrokenPipe.into()),
            Err(_) => Err(io::Error::new(
                io::ErrorKind::TimedOut,
                "the client has stopped reading the answer",
            )),
        }
    }
}

impl<H> Write for PieceWriter<H> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = bytes.len().min(self.size - self.piece.len());
        self.piece.extend_from_slice(&bytes[..taken]);
        if self.piece.len() == self.size {
            self.send()?;
        }
        Ok(taken)
    }

    /// Sends the last piece.
    fn flush(&mut self) -> io::Result<()> {
        if self.piece.is_empty() { Ok(()) } else { self.send() }
    }
}

impl PieceReceiver {
    /// Waits for the first two pieces, or for the end of a shorter answer.
    pub async fn beginning(&mut self) -> Beginning {
        let first = self.0.recv().await.unwrap_or_default();
        match self.0.recv().await {
            Some(second) => Beginning::Pieces([first, second]),
            None => Beginning::Ended(first),
        }
    }

    /// The body of an answer: the first two pieces, and then all others. If `end` returns an error, the body ends with
    /// that error. So a client of HTTP/1.1 or later sees that the answer is incomplete.
    pub fn body<E>(self, beginning: [Bytes; 2], end: E) -> Body
    where
        E: Future<Output = io::Result<()>> + Send + 'static,
    {
        let rest = stream::unfold(self.0, async |mut received| {
            let piece = received.recv().await?;
            Some((piece, received))
        });
        let error = stream::once(end).filter_map(async |end| end.err().map(Err));
        Body::from_stream(stream::iter(beginning).chain(rest).map(Ok).chain(error))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use axum::body::to_bytes;
    use tokio::task;

    use super::*;

    async fn body<T: Send + 'static>(
        mut received: PieceReceiver,
        thread: task::JoinHandle<io::Result<T>>,
    ) -> Body {
        let Beginning::Pieces(beginning) = received.beginning().await else {
            panic!("the answer has one piece")
        };
        received.body(beginning, async { thread.await.unwrap().map(drop) })
    }

    #[tokio::test]
    async fn the_body_has_all_bytes_that_were_written() {
        let held = Arc::new(());
        let (mut writer, received) = pieces(Arc::clone(&held));
        let text: Vec<u8> = (0..FIRST + 3 * PIECE + 7).map(|place| (place % 251) as u8).collect();
        let written = text.clone();
        let thread = task::spawn_blocking(move || {
            written.chunks(1000).try_for_each(|chunk| writer.write_all(chunk))?;
            writer.flush()
        });
        let body = body(received, thread).await;
        assert_eq!(Arc::strong_count(&held), 1);
        assert_eq!(to_bytes(body, usize::MAX).await.unwrap(), text);
    }

    #[tokio::test]
    async fn a_short_answer_is_received_whole() {
        for size in [0, 1, FIRST - 1, FIRST] {
            let (mut writer, mut received) = pieces(());
            let thread = task::spawn_blocking(move || {
                writer.write_all(&vec![1; size])?;
                writer.flush()
            });
            let Beginning::Ended(whole) = received.beginning().await else { panic!("{size}") };
            thread.await.unwrap().unwrap();
            assert_eq!(whole.len(), size);
        }
    }

    #[tokio::test]
    async fn the_body_of_an_answer_that_fails_ends_with_an_error() {
        let (mut writer, received) = pieces(());
        let thread = task::spawn_blocking(move || {
            writer.write_all(&vec![1; FIRST + PIECE])?;
            Err::<(), _>(io::Error::other("it failed"))
        });
        let body = body(received, thread).await;
        assert!(to_bytes(body, usize::MAX).await.is_err());
    }

    #[tokio::test]
    async fn the_writer_ends_when_the_receiver_is_dropped() {
        let (mut writer, received) = pieces(());
        let sent = Arc::new(AtomicUsize::new(0));
        let counted = Arc::clone(&sent);
        let thread = task::spawn_blocking(move || {
            while writer.write_all(&vec![1; PIECE]).is_ok() {
                counted.fetch_add(1, Ordering::Relaxed);
            }
        });
        drop(received);
        thread.await.unwrap();
        assert!(sent.load(Ordering::Relaxed) <= WAITING + FIRST / PIECE);
    }

    #[tokio::test]
    async fn the_writer_fails_if_the_client_does_not_read_in_time() {
        let (mut writer, received) = pieces(());
        writer.patience = Duration::from_millis(20);
        let thread =
            task::spawn_blocking(move || writer.write_all(&vec![1; FIRST + (WAITING + 1) * PIECE]));
        let failed = thread.await.unwrap().unwrap_err();
        assert_eq!(failed.kind(), io::ErrorKind::TimedOut);
        drop(received);
    }
}
