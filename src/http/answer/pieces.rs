//! Answers that are sent while they are written.
//!
//! A table as text can take several times the memory of its result. So a large one is never whole in memory: a thread
//! writes it, and waits while the client reads. The thread gives up when the client stops reading, because one stream
//! of HTTP/2 can stall while others of its connection go on. How long an answer is, is known only when it is written: a
//! short one is received whole.

use std::io::{self, Write};
use std::mem;
use std::time::Duration;

use axum::body::{Body, Bytes};
use futures_util::{StreamExt as _, stream};
use tokio::runtime::{self, Runtime};
use tokio::sync::mpsc;
use tokio::time::timeout;

/// Bytes of the first piece. A shorter answer is received whole.
const FIRST: usize = 256 << 10;
/// Bytes of the other pieces.
const PIECE: usize = 64 << 10;
/// Memory of an answer that is being sent, with that of a decompressor, in bytes.
pub const MEMORY: usize = 1 << 20;
/// Pieces that wait for the client, beside those in the socket.
const WAITING: usize = 2;
/// How long the client may leave a piece waiting. The slowest client takes a piece in 16 s.
const PATIENCE: Duration = Duration::from_mins(1);

/// Writes the pieces of an answer. It belongs to a thread that may block.
#[derive(Debug)]
pub struct PieceWriter<H> {
    sender: mpsc::Sender<Bytes>,
    piece: Vec<u8>,
    /// Bytes of the whole piece.
    size: usize,
    /// Dropped before the first piece is sent.
    held: Option<H>,
    /// Measures how long a piece waits. It does not depend on the runtime of the server, which may end first.
    clock: Option<Runtime>,
    patience: Duration,
}

/// Receives the pieces of an answer.
#[derive(Debug)]
pub struct PieceReceiver(mpsc::Receiver<Bytes>);

/// The beginning of an answer.
#[derive(Debug)]
pub enum Beginning {
    /// The writer has ended. If it has not failed, this is the whole answer.
    Ended(Bytes),
    /// The first two pieces.
    Pieces([Bytes; 2]),
}

/// A writer, and the receiver of what it writes. The writer drops what is `held` before it sends its first piece.
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
            Err(_) => Err(io::Error::new(io::ErrorKind::TimedOut, "the client does not read it")),
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
    /// Waits for two pieces, or for the end.
    pub async fn beginning(&mut self) -> Beginning {
        let first = self.0.recv().await.unwrap_or_default();
        match self.0.recv().await {
            Some(second) => Beginning::Pieces([first, second]),
            None => Beginning::Ended(first),
        }
    }

    /// The body of an answer from its beginning on. If `end` is an error, the body ends with it. So a client of HTTP/1.1
    /// or later does not take the pieces for the whole.
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
            panic!("it has two pieces")
        };
        received.body(beginning, async { thread.await.unwrap().map(drop) })
    }

    #[tokio::test]
    async fn the_body_is_what_was_written() {
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
    async fn an_answer_that_fails_is_not_taken_for_whole() {
        let (mut writer, received) = pieces(());
        let thread = task::spawn_blocking(move || {
            writer.write_all(&vec![1; FIRST + PIECE])?;
            Err::<(), _>(io::Error::other("it failed"))
        });
        let body = body(received, thread).await;
        assert!(to_bytes(body, usize::MAX).await.is_err());
    }

    #[tokio::test]
    async fn the_writer_waits_for_its_client_and_ends_without_it() {
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
    async fn the_writer_gives_up_a_client_that_does_not_read() {
        let (mut writer, received) = pieces(());
        writer.patience = Duration::from_millis(20);
        let thread =
            task::spawn_blocking(move || writer.write_all(&vec![1; FIRST + (WAITING + 1) * PIECE]));
        let failed = thread.await.unwrap().unwrap_err();
        assert_eq!(failed.kind(), io::ErrorKind::TimedOut);
        drop(received);
    }
}
