//! Connections that end: nobody keeps one, and what it holds, by doing nothing.
//!
//! A client that vanished without a word, sends half a request or does not read its answer would
//! occupy a connection and up to an answer's worth of memory for ever.

use std::io::{self, IoSlice};
use std::net::SocketAddr;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{Instant, Sleep, sleep};

/// Accepts connections that are closed once nothing has moved for some time, in either direction.
/// It must be longer than the longest time a request may wait for its answer.
#[derive(Debug)]
pub struct Patient {
    /// Where connections come from.
    pub listener: TcpListener,
    /// How long a connection may stand still.
    pub patience: Duration,
}

impl Listener for Patient {
    type Io = Connection<TcpStream>;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        let (io, address) = Listener::accept(&mut self.listener).await;
        // Small answers must not wait for more to send; without it they only come later.
        let _ = io.set_nodelay(true);
        (Connection::new(io, self.patience), address)
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        Listener::local_addr(&self.listener)
    }
}

/// A connection with a clock that starts anew whenever something moves.
#[derive(Debug)]
pub struct Connection<T> {
    io: T,
    patience: Duration,
    // One clock for both directions: they are driven by one task.
    still: Pin<Box<Sleep>>,
}

impl<T: Unpin> Connection<T> {
    fn new(io: T, patience: Duration) -> Self {
        Self { io, patience, still: Box::pin(sleep(patience)) }
    }

    /// Has something done, and fails if nothing moves for too long.
    fn watch<R>(
        &mut self,
        context: &mut Context<'_>,
        go: impl FnOnce(Pin<&mut T>, &mut Context<'_>) -> Poll<io::Result<R>>,
    ) -> Poll<io::Result<R>> {
        let moved = go(Pin::new(&mut self.io), context);
        if moved.is_ready() {
            self.still.as_mut().reset(Instant::now() + self.patience);
            return moved;
        }
        ready!(self.still.as_mut().poll(context));
        Poll::Ready(Err(io::ErrorKind::TimedOut.into()))
    }
}

impl<T: AsyncRead + Unpin> AsyncRead for Connection<T> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        self.watch(context, |io, context| io.poll_read(context, buffer))
    }
}

impl<T: AsyncWrite + Unpin> AsyncWrite for Connection<T> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        self.watch(context, |io, context| io.poll_write(context, bytes))
    }

    fn poll_write_vectored(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[IoSlice<'_>],
    ) -> Poll<io::Result<usize>> {
        self.watch(context, |io, context| io.poll_write_vectored(context, bytes))
    }

    fn is_write_vectored(&self) -> bool {
        self.io.is_write_vectored()
    }

    // To have nothing to flush is no movement: the clock runs on.
    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.io).poll_shutdown(context)
    }
}

#[cfg(test)]
mod tests {
    use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _, duplex};

    use super::*;

    #[tokio::test]
    async fn what_moves_goes_on_and_what_stands_still_ends() {
        let (mut client, server) = duplex(16);
        // No patience at all: any pause is too long.
        let mut server = Connection::new(server, Duration::ZERO);
        let mut byte = [0];
        for _ in 0..3 {
            client.write_all(b"x").await.unwrap();
            server.read_exact(&mut byte).await.unwrap();
            server.write_all(b"y").await.unwrap();
            client.read_exact(&mut byte).await.unwrap();
        }
        let silent = server.read(&mut byte).await.unwrap_err();
        assert_eq!(silent.kind(), io::ErrorKind::TimedOut);
        let unread = server.write_all(&[0; 64]).await.unwrap_err();
        assert_eq!(unread.kind(), io::ErrorKind::TimedOut);
    }

    #[tokio::test]
    async fn an_end_that_is_far_is_not_reached() {
        let (mut client, server) = duplex(16);
        let mut server = Connection::new(server, Duration::from_mins(10));
        let mut byte = [0];
        // It is read before it is written: the clock is looked at, and does not end it.
        let (read, written) = tokio::join!(server.read_exact(&mut byte), client.write_all(b"x"));
        assert_eq!((read.unwrap(), written.unwrap()), (1, ()));
    }
}
