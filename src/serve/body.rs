//! The body of a response, handed to the connection in pieces, so that a client that stops reading
//! is noticed.

use std::convert::Infallible;
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};

use hyper::body::{Body, Bytes, Frame, SizeHint};
use tokio::sync::OwnedSemaphorePermit;

use crate::connections::Doing;

/// Size of a piece. Unit: bytes.
const PIECE: usize = 64 * 1024;

/// Bytes to send.
#[derive(Debug)]
pub(super) struct AnswerBody {
    bytes: Bytes,
    doing: Arc<Doing>,
    /// Memory that is reserved until the answer is sent.
    _memory: Option<OwnedSemaphorePermit>,
}

impl AnswerBody {
    /// A body of a response on a connection.
    pub fn new(
        bytes: impl Into<Bytes>,
        doing: Arc<Doing>,
        memory: Option<OwnedSemaphorePermit>,
    ) -> Self {
        doing.writes();
        Self {
            bytes: bytes.into(),
            doing,
            _memory: memory,
        }
    }
}

impl Body for AnswerBody {
    type Data = Bytes;
    type Error = Infallible;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        _: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, Infallible>>> {
        if self.bytes.is_empty() {
            return Poll::Ready(None);
        }
        self.doing.writes();
        let length = self.bytes.len().min(PIECE);
        Poll::Ready(Some(Ok(Frame::data(self.bytes.split_to(length)))))
    }

    fn is_end_stream(&self) -> bool {
        self.bytes.is_empty()
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(self.bytes.len() as u64)
    }
}

impl Drop for AnswerBody {
    fn drop(&mut self) {
        self.doing.waits();
    }
}
