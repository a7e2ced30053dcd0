//! The text of an answer, which may be decompressed while it is sent.

use std::io;
use std::sync::Arc;

use axum::Extension;
use axum::body::{Body, Bytes};
use axum::http::header::CONTENT_LENGTH;
use axum::response::{IntoResponse, Response};
use futures_util::stream::{self, Stream, StreamExt as _};
use tokio::task::consume_budget;

use crate::http::memory::Encoded;
use crate::http::shares::Permit;
use crate::http::wire::coding::{Coding, decoded};

/// The text of an answer.
pub struct Text {
    /// The bytes in memory.
    pub answer: Encoded,
    /// Whether they are decompressed while they are sent, if they are compressed.
    pub is_decoded: bool,
    /// Permission for the memory that sending takes; `None` if it is not counted yet.
    pub permit: Option<Arc<Permit>>,
}

impl Text {
    /// An answer from a small result, which is sent as it is in memory.
    pub fn whole(answer: Encoded) -> Self {
        Self { permit: None, answer, is_decoded: false }
    }

    /// A text without compression.
    pub fn of(body: Bytes) -> Self {
        let size = body.len();
        Self::whole(Encoded::new(body, Coding::Identity, size))
    }

    /// The bytes, if they are sent as they are in memory.
    pub fn bytes(&self) -> Option<&Bytes> {
        (!self.is_decoded || self.answer.coding == Coding::Identity).then_some(&self.answer.body)
    }

    /// The coding in which the text is sent.
    pub fn coding(&self) -> Coding {
        if self.is_decoded { Coding::Identity } else { self.answer.coding }
    }

    /// The number of bytes that are sent.
    pub fn length(&self) -> usize {
        self.bytes().map_or(self.answer.size, Bytes::len)
    }

    /// The bytes that are sent, piece by piece.
    pub fn pieces(self) -> impl Stream<Item = io::Result<Bytes>> + Send + use<> {
        if let Some(bytes) = self.bytes() {
            return stream::iter([Ok(bytes.clone())]).left_stream();
        }
        // The status is already sent. A client notices that the end is missing.
        let told = |piece: &io::Result<Bytes>| {
            if let Err(error) = piece {
                tracing::error!(%error, "an answer ended early");
            }
        };
        let pieces = stream::iter(decoded(self.answer.body).inspect(told));
        // A client that reads as fast as this decompresses would otherwise keep the thread from other requests.
        let slowly = pieces.then(|piece| async {
            consume_budget().await;
            piece
        });
        slowly.right_stream()
    }
}

impl IntoResponse for Text {
    fn into_response(self) -> Response {
        let permit = self.permit.clone().map(Extension);
        if let Some(bytes) = self.bytes() {
            return (permit, bytes.clone()).into_response();
        }
        let length = [(CONTENT_LENGTH, self.length().to_string())];
        (permit, length, Body::from_stream(self.pieces())).into_response()
    }
}
