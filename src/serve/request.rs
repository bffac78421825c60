//! Requests: their headers and bodies.

use std::future::{Future, poll_fn};
use std::pin::Pin;
use std::time::Duration;

use hyper::HeaderMap;
use hyper::body::{Body, Incoming};
use hyper::header::{self, HeaderName};
use hyper::http::request;
use tokio::time::timeout;

use crate::guard::Origin;
use crate::question::Refusal;

/// Maximum size of a request body. Unit: bytes.
const MOST_BODY: u64 = 1 << 20;
/// Time limit for a client to send the head of a request, and again for its body.
pub(super) const PATIENCE: Duration = Duration::from_secs(10);

/// A header's text, if it is ASCII.
pub(super) fn text<'a>(headers: &'a HeaderMap, name: &HeaderName) -> Option<&'a str> {
    headers.get(name).and_then(|value| value.to_str().ok())
}

/// The headers that say where a request comes from.
pub(super) fn origin(request: &request::Parts) -> Result<Origin<'_>, Refusal> {
    let headers = &request.headers;
    if headers.get_all(header::HOST).iter().count() > 1 {
        return Err(Refusal::new(400, "the header `Host` must occur once"));
    }
    Ok(Origin {
        host: text(headers, &header::HOST),
        target_host: request
            .uri
            .authority()
            .map(hyper::http::uri::Authority::as_str),
        // An unreadable origin is a foreign one.
        origin: headers
            .get(header::ORIGIN)
            .map(|value| value.to_str().unwrap_or("null")),
        site: headers
            .get("sec-fetch-site")
            .map(|value| value.to_str().unwrap_or("cross-site")),
    })
}

/// Reads the body of a request. Fails if it is too long or arrives too slowly.
pub(super) async fn read(
    request: &request::Parts,
    body: &mut Incoming,
) -> Result<Vec<u8>, Refusal> {
    let too_long = || Refusal::new(413, format!("a request may have at most {MOST_BODY} bytes"));
    let length = text(&request.headers, &header::CONTENT_LENGTH)
        .and_then(|length| length.parse::<u64>().ok());
    if length.is_some_and(|length| length > MOST_BODY) {
        return Err(too_long());
    }
    let all = async {
        let mut bytes = Vec::new();
        while let Some(frame) = poll_fn(|context| Pin::new(&mut *body).poll_frame(context)).await {
            let frame = frame
                .map_err(|error| Refusal::new(400, format!("the request can't be read: {error}")))?
                .into_data();
            bytes.extend_from_slice(&frame.unwrap_or_default());
            if bytes.len() as u64 > MOST_BODY {
                return Err(too_long());
            }
        }
        Ok(bytes)
    };
    in_time(all).await
}

async fn in_time<T>(all: impl Future<Output = Result<T, Refusal>>) -> Result<T, Refusal> {
    let late = || {
        Refusal::new(
            408,
            format!(
                "the request took longer than {} s to arrive",
                PATIENCE.as_secs()
            ),
        )
    };
    timeout(PATIENCE, all).await.unwrap_or_else(|_| Err(late()))
}
