//! Responses: status, headers and body.

use hyper::body::Bytes;
use hyper::header::{self, HeaderName, HeaderValue};
use hyper::{Response, StatusCode};

use crate::answer::Answered;
use crate::body::AnswerBody;
use crate::question::Refusal;

/// Policy of the query page: load its script and stylesheet, and connect to this server.
pub(super) const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'";
/// Policy of the report, a single file with inline scripts and images that connects to this server.
/// The file also has a policy of its own, which names its scripts by digest; both apply. This one
/// adds `frame-ancestors`, which only a header can set.
pub(super) const REPORT_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline' blob:; style-src 'unsafe-inline'; img-src data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// Policy of answers, which are not pages.
pub(super) const NO_POLICY: &str = "default-src 'none'; frame-ancestors 'none'; sandbox";

/// A response before conversion to the library's type.
pub(super) struct Reply {
    pub status: u16,
    pub media_type: String,
    pub policy: &'static str,
    pub body: Bytes,
}

impl Reply {
    /// A page or a file of one.
    pub fn page(media_type: &str, policy: &'static str, body: impl Into<Bytes>) -> Self {
        Self {
            status: 200,
            media_type: media_type.to_owned(),
            policy,
            body: body.into(),
        }
    }

    /// A reply that the client has the present state.
    pub fn empty() -> Self {
        Self {
            status: 204,
            media_type: "text/plain".to_owned(),
            policy: NO_POLICY,
            body: Bytes::new(),
        }
    }

    /// An answer to a query.
    pub fn answer(status: u16, media_type: &str, body: Vec<u8>) -> Self {
        let charset = if media_type.starts_with("text/") {
            "; charset=utf-8"
        } else {
            ""
        };
        Self {
            status,
            media_type: format!("{media_type}{charset}"),
            policy: NO_POLICY,
            body: body.into(),
        }
    }
}

impl From<Refusal> for Reply {
    fn from(Refusal { status, why }: Refusal) -> Self {
        Self::answer(
            status,
            "text/plain",
            format!("{}\n", why.trim_end()).into_bytes(),
        )
    }
}

impl From<Answered> for Reply {
    fn from(
        Answered {
            status,
            media_type,
            body,
        }: Answered,
    ) -> Self {
        Self::answer(status, media_type, body)
    }
}

/// Turns a reply into a response, without its body if only the head was requested.
pub(super) fn response(
    reply: Reply,
    head: bool,
    body: impl FnOnce(Bytes) -> AnswerBody,
) -> Response<AnswerBody> {
    let status = StatusCode::from_u16(reply.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
    let length = reply.body.len();
    let mut response = Response::new(body(if head { Bytes::new() } else { reply.body }));
    *response.status_mut() = status;
    let headers = response.headers_mut();
    let mut set = |name: HeaderName, value: &str| {
        // Media types and policies come from this program and contain no line breaks.
        if let Ok(value) = HeaderValue::from_str(value) {
            headers.insert(name, value);
        }
    };
    set(header::CONTENT_TYPE, &reply.media_type);
    if reply.status != 204 {
        set(header::CONTENT_LENGTH, &length.to_string());
    }
    set(header::CONTENT_SECURITY_POLICY, reply.policy);
    set(header::X_CONTENT_TYPE_OPTIONS, "nosniff");
    set(header::X_FRAME_OPTIONS, "DENY");
    set(header::REFERRER_POLICY, "no-referrer");
    set(header::CACHE_CONTROL, "no-store");
    set(
        HeaderName::from_static("cross-origin-resource-policy"),
        "same-origin",
    );
    set(header::VARY, "Accept");
    match reply.status {
        405 => set(header::ALLOW, "GET, HEAD, POST"),
        503 => set(header::RETRY_AFTER, "1"),
        // The rest of the request is not read, so the connection can't be used again.
        408 | 413 => set(header::CONNECTION, "close"),
        _ => {}
    }
    response
}
