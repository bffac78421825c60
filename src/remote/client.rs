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

/// A request, which may be sent several times.
pub(crate) struct Request<'a> {
    pub method: Method,
    pub address: &'a Address,
    /// Parameters that are part of the target but not of the address in messages.
    pub target: String,
    pub headers: Vec<(&'static str, String)>,
    pub content: &'a [u8],
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
        let (mut tries, mut waited) = (0, Duration::ZERO);
        loop {
            if self.is_stopped() {
                return Err(Fault::Stopped);
            }
            let fault = match self.follow(request) {
                Ok(response) => return Ok(response),
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
        self.run(new.body(request.content))
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
                ureq::Error::Timeout(_) => Fault::unreachable("no answer within the time limit"),
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
