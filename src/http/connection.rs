//! Idle connections are closed.
//!
//! Otherwise a client that disappears, sends half a request or does not read its answer would occupy a
//! connection, and the memory of its answer, for ever.

use std::io::{self, IoSlice};
use std::net::SocketAddr;
use std::pin::Pin;
use std::task::{Context, Poll, ready};
use std::time::Duration;

use axum::serve::Listener;
use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::net::{TcpListener, TcpStream};
use tokio::time::{Instant, Sleep, sleep};

/// Accepts connections and closes them when no byte was received or sent for some time.
#[derive(Debug)]
pub struct IdleTimeout {
    /// Accepts the connections.
    pub listener: TcpListener,
    /// Maximum idle time. It must be longer than the longest wait for an answer.
    pub timeout: Duration,
}

impl Listener for IdleTimeout {
    type Io = Connection<TcpStream>;
    type Addr = SocketAddr;

    async fn accept(&mut self) -> (Self::Io, Self::Addr) {
        let (io, address) = Listener::accept(&mut self.listener).await;
        // Sends small answers at once. If this fails, they are only delayed.
        let _ = io.set_nodelay(true);
        (Connection::new(io, self.timeout), address)
    }

    fn local_addr(&self) -> io::Result<Self::Addr> {
        Listener::local_addr(&self.listener)
    }
}

/// A connection with a timer that restarts when a byte is received or sent.
#[derive(Debug)]
pub struct Connection<T> {
    io: T,
    timeout: Duration,
    // One timer for both directions: one task drives them.
    timer: Pin<Box<Sleep>>,
}

impl<T: Unpin> Connection<T> {
    fn new(io: T, timeout: Duration) -> Self {
        Self { io, timeout, timer: Box::pin(sleep(timeout)) }
    }

    /// Polls an operation, and fails when the timer expires.
    fn watch<R>(
        &mut self,
        context: &mut Context<'_>,
        go: impl FnOnce(Pin<&mut T>, &mut Context<'_>) -> Poll<io::Result<R>>,
    ) -> Poll<io::Result<R>> {
        let done = go(Pin::new(&mut self.io), context);
        if done.is_ready() {
            self.timer.as_mut().reset(Instant::now() + self.timeout);
            return done;
        }
        ready!(self.timer.as_mut().poll(context));
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

    // An empty flush succeeds without sending a byte, so it must not restart the timer.
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
    async fn an_idle_connection_times_out_and_an_active_one_does_not() {
        let (mut client, server) = duplex(16);
        // Any pause is too long.
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
    async fn a_read_before_the_timeout_succeeds() {
        let (mut client, server) = duplex(16);
        let mut server = Connection::new(server, Duration::from_mins(10));
        let mut byte = [0];
        // The read starts first, so the timer is polled once and has not expired.
        let (read, written) = tokio::join!(server.read_exact(&mut byte), client.write_all(b"x"));
        assert_eq!((read.unwrap(), written.unwrap()), (1, ()));
    }
}
