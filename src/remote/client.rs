//! Requests with credentials, time limits and retries.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use ureq::http::{Method, Request as HttpRequest};
use ureq::{Agent, AsSendBody};

use crate::fault::Fault;
use crate::response::Response;
use crate::retry::{LONGEST_ASKED, is_temporary, wait_after};
use crate::{Address, Credentials};

/// Longest time in which a connection is opened.
const CONNECT: Duration = Duration::from_secs(10);
/// Number of redirects that are followed.
const MOST_REDIRECTS: usize = 5;
/// Number of tries until a server answers for the first time.
const FIRST_TRIES: u32 = 3;
/// While it waits, a client looks at the flag that stops it this often.
const LOOK: Duration = Duration::from_millis(50);

/// The body of a request. A file is opened for each try.
#[derive(Clone, Copy)]
pub(crate) enum Content<'a> {
    Bytes(&'a [u8]),
    #[cfg(feature = "object-storage")]
    File(&'a std::path::Path),
    #[cfg(feature = "object-storage")]
    None,
}

/// A request, which may be sent several times.
pub(crate) struct Request<'a> {
    pub method: Method,
    pub address: &'a Address,
    /// Parameters that are part of the target but not of the address in messages.
    pub target: String,
    pub headers: Vec<(&'static str, String)>,
    pub content: Content<'a>,
}

/// A client of HTTP servers. Reuses connections.
#[derive(Debug)]
pub struct Client {
    agent: Agent,
    credentials: Credentials,
    stop: Arc<AtomicBool>,
    /// Whether a server has answered.
    has_answered: AtomicBool,
}

impl Client {
    /// Creates a client whose requests get an answer within `timeout` each: sending and the time
    /// until the answer begins, and each part of the answer. `stop` ends waits.
    pub fn new(credentials: Credentials, timeout: Duration, stop: Arc<AtomicBool>) -> Self {
        let config = Agent::config_builder()
            .http_status_as_error(false)
            .max_redirects(0)
            .max_redirects_will_error(false)
            .timeout_connect(Some(CONNECT.min(timeout)))
            .timeout_send_body(Some(timeout))
            .timeout_recv_response(Some(timeout))
            .timeout_per_read(Some(timeout))
            .user_agent(format!("actcheck/{}", env!("CARGO_PKG_VERSION")));
        #[cfg(feature = "https")]
        let config = config.tls_config(crate::tls::config());
        Self {
            agent: config.build().into(),
            credentials,
            stop,
            has_answered: AtomicBool::new(false),
        }
    }

    /// Whether the caller stopped it.
    pub fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Sends a request until it has an answer with a status of success. Waits longer after each
    /// failure of a kind that may pass.
    pub(crate) fn send(&self, request: &Request<'_>) -> Result<Response, Fault> {
        self.retried(request, Ok)
    }

    /// Like [`Self::send`], but also sends the request again if the answer's body ends too early.
    /// Returns the body, up to `most` bytes.
    #[cfg(any(test, feature = "object-storage"))]
    pub(crate) fn body(&self, request: &Request<'_>, most: u64) -> Result<Vec<u8>, Fault> {
        self.retried(request, |response| {
            let mut bytes = Vec::new();
            let read = std::io::Read::read_to_end(
                &mut std::io::Read::take(response.into_reader(), most),
                &mut bytes,
            );
            read.map(|_| bytes)
                .map_err(|error| Fault::unreachable(format!("its answer was cut off: {error}")))
        })
    }

    fn retried<T>(
        &self,
        request: &Request<'_>,
        read: impl Fn(Response) -> Result<T, Fault>,
    ) -> Result<T, Fault> {
        let (mut tries, mut waited) = (0, Duration::ZERO);
        loop {
            if self.is_stopped() {
                return Err(Fault::Stopped);
            }
            let fault = match self.follow(request).and_then(&read) {
                Ok(read) => return Ok(read),
                Err(fault) => fault,
            };
            tries += 1;
            let wait = match &fault {
                // A server that never answered is more likely a wrong address than one that
                // restarts.
                Fault::Unreachable {
                    is_temporary: true, ..
                } if tries < FIRST_TRIES || self.has_answered.load(Ordering::Relaxed) => {
                    wait_after(tries, None)
                }
                Fault::Refused {
                    status,
                    retry_after,
                    ..
                } if is_temporary(*status) => wait_after(tries, *retry_after),
                _ => None,
            };
            let wait = wait.filter(|wait| waited + *wait <= LONGEST_ASKED);
            let Some(wait) = wait else {
                return Err(fault.after(tries));
            };
            self.wait(wait)?;
            waited += wait;
        }
    }

    /// Sends a request, also to the places that the same server redirects it to, with the same
    /// method and content.
    fn follow(&self, request: &Request<'_>) -> Result<Response, Fault> {
        let mut target = request.target.clone();
        for _ in 0..=MOST_REDIRECTS {
            let response = self.once(request, &target)?;
            self.has_answered.store(true, Ordering::Relaxed);
            match response.status {
                200..=299 => return Ok(response),
                301 | 302 | 307 | 308 => {
                    let location = response.header("location").unwrap_or_default().to_owned();
                    response.finish();
                    let to = request.address.redirected(&location);
                    match to.filter(|to| request.address.is_trusted(to)) {
                        Some(to) => target = to.to_string(),
                        None => return Err(Fault::Redirected(location)),
                    }
                }
                status => {
                    let retry_after = response.retry_after();
                    return Err(Fault::Refused {
                        status,
                        words: response.words(),
                        retry_after,
                    });
                }
            }
        }
        Err(Fault::Unreachable {
            why: "it redirects in a circle".to_owned(),
            is_temporary: false,
        })
    }

    fn once(&self, request: &Request<'_>, target: &str) -> Result<Response, Fault> {
        let mut new = HttpRequest::builder()
            .method(request.method.clone())
            .uri(target);
        for (name, value) in &request.headers {
            new = new.header(*name, value);
        }
        if let Some(header) = self.credentials.header() {
            new = new.header("authorization", header);
        }
        match request.content {
            Content::Bytes(bytes) => self.run(new.body(bytes)),
            #[cfg(feature = "object-storage")]
            Content::None => self.run(new.body(())),
            #[cfg(feature = "object-storage")]
            Content::File(path) => {
                let cannot = |error: std::io::Error| Fault::Unreachable {
                    why: format!("{} can't be read: {error}", path.display()),
                    is_temporary: false,
                };
                let file = actcheck_base::open_regular(path).map_err(cannot)?;
                let length = file.metadata().map_err(cannot)?.len();
                self.run(new.header("content-length", length).body(&file))
            }
        }
    }

    fn run(
        &self,
        request: Result<HttpRequest<impl AsSendBody>, ureq::http::Error>,
    ) -> Result<Response, Fault> {
        let never = |why: String| Fault::Unreachable {
            why,
            is_temporary: false,
        };
        let request = request.map_err(|error| never(error.to_string()))?;
        self.agent
            .run(request)
            .map(Response::new)
            .map_err(|error| match error {
                ureq::Error::Io(error) => Fault::unreachable(error.to_string()),
                ureq::Error::Timeout(ureq::Timeout::Connect | ureq::Timeout::Resolve) => {
                    Fault::unreachable("no connection within the time limit")
                }
                ureq::Error::Timeout(_) => {
                    Fault::unreachable("no answer within the time limit (`--timeout`)")
                }
                ureq::Error::HostNotFound => Fault::unreachable("there is no server of this name"),
                ureq::Error::ConnectionFailed
                | ureq::Error::Protocol(_)
                | ureq::Error::BodyStalled => Fault::unreachable(error.to_string()),
                other => never(other.to_string()),
            })
    }

    fn wait(&self, wait: Duration) -> Result<(), Fault> {
        let mut left = wait;
        while !left.is_zero() {
            if self.is_stopped() {
                return Err(Fault::Stopped);
            }
            let part = left.min(LOOK);
            std::thread::sleep(part);
            left -= part;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Read as _, Write as _};
    use std::net::TcpListener;

    #[test]
    fn a_request_is_sent_again_if_its_answer_is_cut_off() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("there is a port");
        let address = format!("http://{}/", listener.local_addr().expect("it is bound"));
        let server = std::thread::spawn(move || {
            for body in ["wh", "", "whole"] {
                let (mut stream, _) = listener.accept().expect("a client connects");
                let _ = stream.read(&mut [0; 1024]);
                let head = "HTTP/1.1 200 OK\r\nconnection: close\r\ncontent-length: 5\r\n\r\n";
                stream
                    .write_all(format!("{head}{body}").as_bytes())
                    .expect("the client reads");
            }
        });
        let client = Client::new(
            Credentials::default(),
            Duration::from_secs(5),
            Arc::default(),
        );
        let to = Address::parse(&address).expect("it is valid");
        let content = Content::Bytes(&[]);
        let request = Request {
            method: Method::POST,
            address: &to,
            target: address,
            headers: Vec::new(),
            content,
        };
        assert_eq!(
            client.body(&request, 100).ok().as_deref(),
            Some("whole".as_bytes())
        );
        server.join().expect("it has answered all");
    }
}
