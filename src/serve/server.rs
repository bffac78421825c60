//! Requests to answers.

use std::io::{Error, ErrorKind, Read as _};
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError, RwLock};
use std::time::{Duration, Instant};

use oxhttp::Server;
use oxhttp::model::header::{self, HeaderName, HeaderValue};
use oxhttp::model::{Body, Request, Response, StatusCode};

use crate::serve::answer::{Head, Question};
use crate::serve::guard::guard;
use crate::serve::page::{self, Example};
use crate::serve::question::{Parts, Refusal, question};
use crate::serve::report::LiveReport;
use crate::serve::watch;
use crate::serve::worker::{Ended, Worker};

/// A query is shorter. Unit: bytes.
const MOST_BODY: u64 = 1 << 20;
/// A client that takes longer to say what it wants is not served.
const PATIENCE: Duration = Duration::from_secs(10);
/// Connections at a time; others wait.
const MOST_CONNECTIONS: usize = 64;
/// A process has so much time to start and to open the history beside the time of its query.
const START: Duration = Duration::from_secs(5);
/// Ports are tried so often, where any will do and another program takes the one that was free.
const TRIES: usize = 8;

/// What our own page may do: load its script and its looks, and ask this server.
const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'";
/// The report is one file with scripts and pictures inside, and asks nobody. It names its scripts by their digests in a
/// policy of its own, and both policies hold: this one adds what only a header can forbid, that other pages frame it.
const REPORT_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline' blob:; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// Answers are no pages.
const NO_POLICY: &str = "default-src 'none'; frame-ancestors 'none'; sandbox";

/// How to serve.
#[derive(Debug, Clone)]
pub struct Options {
    /// Folder of the history.
    pub history: PathBuf,
    /// This program, which is started for each query.
    pub program: PathBuf,
    /// Its arguments that make it answer a query ([`crate::serve::answer()`]).
    pub query_arguments: Vec<String>,
    /// Its arguments that make it print the report.
    pub report_arguments: Vec<String>,
    /// Where to listen.
    pub address: IpAddr,
    /// The port; 0 takes a free one.
    pub port: u16,
    /// Names of this server beside addresses and `localhost`.
    pub hosts: Vec<String>,
    /// Time for a query. Unit: seconds.
    pub most_secs: f64,
    /// Rows or triples of an answer.
    pub most_rows: u64,
    /// Size of an answer. Unit: bytes.
    pub most_bytes: u64,
    /// Memory for a query. Unit: bytes.
    pub most_memory: u64,
    /// Queries at a time.
    pub most_queries: usize,
    /// Queries to choose from.
    pub examples: Vec<Example>,
}

/// A server that runs until the process ends.
#[derive(Debug)]
pub struct Serving {
    /// Where it listens.
    pub address: SocketAddr,
}

/// Begins to serve.
///
/// # Errors
/// The address can't be listened at.
pub fn serve(options: Options) -> std::io::Result<Serving> {
    let (ip, wanted) = (options.address, options.port);
    let desk = std::sync::Arc::new(Desk::new(options));
    let mut last = Error::from(ErrorKind::AddrInUse);
    for _ in 0..if wanted == 0 { TRIES } else { 1 } {
        let address = match wanted {
            // The library does not say which port it was given: take one that was free a moment ago.
            0 => TcpListener::bind((ip, 0))?.local_addr()?,
            port => SocketAddr::new(ip, port),
        };
        let at_the_desk = std::sync::Arc::clone(&desk);
        let server = Server::new(move |request| at_the_desk.respond(request))
            .bind(address)
            .with_global_timeout(PATIENCE)
            .with_max_concurrent_connections(MOST_CONNECTIONS);
        match server.spawn() {
            // Its threads go on without the handle.
            Ok(_) => return Ok(Serving { address }),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// What all requests share.
struct Desk {
    options: Options,
    query: Worker,
    report: LiveReport,
    page: String,
    running: AtomicUsize,
    /// Queries hold it to read, the report to write: it needs the history for itself.
    history: RwLock<()>,
}

/// An answer before it is one of the library's.
struct Reply {
    status: u16,
    media_type: String,
    policy: &'static str,
    body: Vec<u8>,
}

impl Reply {
    fn page(media_type: &str, policy: &'static str, body: impl Into<Vec<u8>>) -> Self {
        Self { status: 200, media_type: media_type.to_owned(), policy, body: body.into() }
    }
}

impl From<Refusal> for Reply {
    fn from(Refusal { status, why }: Refusal) -> Self {
        let body = format!("{}\n", why.trim_end()).into_bytes();
        Self { status, media_type: "text/plain; charset=utf-8".to_owned(), policy: NO_POLICY, body }
    }
}

impl Desk {
    fn new(options: Options) -> Self {
        let worker = |arguments: &[String]| Worker { program: options.program.clone(), arguments: arguments.to_vec() };
        let report = LiveReport {
            worker: worker(&options.report_arguments),
            history: options.history.clone(),
            kept: Mutex::new(None),
        };
        let page = page::page(&options.history.display().to_string(), &options.examples);
        let (query, running) = (worker(&options.query_arguments), AtomicUsize::new(0));
        Self { query, report, page, running, history: RwLock::new(()), options }
    }

    fn respond(&self, request: &mut Request<Body>) -> Response<Body> {
        let reply = self.reply(request).unwrap_or_else(Reply::from);
        let head = request.method().as_str() == "HEAD";
        // Whatever of the request was not read stays unread: nothing else comes over this connection.
        *request.body_mut() = Body::empty();
        request.headers_mut().insert(header::CONNECTION, HeaderValue::from_static("close"));
        response(reply, head)
    }

    fn reply(&self, request: &mut Request<Body>) -> Result<Reply, Refusal> {
        let header = |name: HeaderName| request.headers().get(name).and_then(|value| value.to_str().ok());
        guard(header(header::HOST), header(header::ORIGIN), &self.options.hosts)?;
        let (path, method) = (request.uri().path(), request.method().as_str());
        let reads = matches!(method, "GET" | "HEAD");
        match path {
            "/sparql" => self.sparql(request),
            "/" | "/style.css" | "/query.js" | "/report" if !reads => Err(Refusal::new(405, "this can only be read")),
            "/" => Ok(Reply::page("text/html; charset=utf-8", PAGE_POLICY, self.page.as_str())),
            "/style.css" => Ok(Reply::page("text/css; charset=utf-8", NO_POLICY, page::STYLE)),
            "/query.js" => Ok(Reply::page("text/javascript; charset=utf-8", NO_POLICY, page::SCRIPT)),
            "/report" => {
                let page = self.report.page(&self.history)?;
                Ok(Reply::page("text/html; charset=utf-8", REPORT_POLICY, page))
            }
            _ => Err(Refusal::new(404, "there is nothing here: see /, /report and /sparql")),
        }
    }

    fn sparql(&self, request: &mut Request<Body>) -> Result<Reply, Refusal> {
        let body = body(request)?;
        let header = |name: HeaderName| request.headers().get(name).and_then(|value| value.to_str().ok());
        let parts = Parts {
            method: request.method().as_str(),
            query: request.uri().query(),
            content_type: header(header::CONTENT_TYPE),
            body: &body,
        };
        let query = question(&parts)?;
        let accepts = request.headers().get_all(header::ACCEPT).iter().filter_map(|value| value.to_str().ok());
        let accept = accepts.collect::<Vec<&str>>().join(",");
        let _place = self.place().ok_or_else(|| Refusal::new(503, "too many queries are running: ask again soon"))?;
        self.ask(query, accept)
    }

    fn ask(&self, query: String, accept: String) -> Result<Reply, Refusal> {
        let Options { most_rows, most_secs, most_memory, most_bytes, .. } = self.options;
        let question = Question { query, accept, most_rows, most_secs, most_memory };
        let Ok(input) = serde_json::to_vec(&question) else { return Err(Refusal::new(400, "the query can't be read")) };
        let time = START + Duration::try_from_secs_f64(most_secs).unwrap_or(Duration::MAX / 2);
        let ended = {
            let _reading = self.history.read().unwrap_or_else(PoisonError::into_inner);
            self.query.run(&input, time, most_bytes)
        };
        let late = || Refusal::new(504, format!("the query took longer than {most_secs} s"));
        match ended {
            Ended::Itself { code: Some(0), output, .. } => answered(output),
            Ended::Itself { code: Some(watch::TIME_SPENT), .. } | Ended::Late => Err(late()),
            Ended::Itself { code: Some(watch::MEMORY_SPENT), .. } => {
                Err(Refusal::new(500, format!("the query took more memory than {} MB", most_memory / 1_000_000)))
            }
            Ended::Itself { .. } => Err(Refusal::new(500, "the query made the evaluator crash")),
            Ended::TooMuch => {
                Err(Refusal::new(500, format!("the answer is larger than {} MB: ask for less", most_bytes / 1_000_000)))
            }
            Ended::NotStarted(why) => Err(Refusal::new(500, format!("the query could not be asked: {why}"))),
        }
    }

    /// A place among the queries that run; none where all are taken.
    fn place(&self) -> Option<Place<'_>> {
        let taken = self.running.fetch_add(1, Ordering::AcqRel);
        let place = Place(&self.running);
        (taken < self.options.most_queries).then_some(place)
    }
}

/// Given back when it is dropped.
struct Place<'a>(&'a AtomicUsize);

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

/// The head and the body that the process wrote.
fn answered(output: Vec<u8>) -> Result<Reply, Refusal> {
    let crashed = || Refusal::new(500, "the query made the evaluator crash");
    let end = output.iter().position(|byte| *byte == b'\n').ok_or_else(crashed)?;
    let head: Head = serde_json::from_slice(&output[..end]).map_err(|_| crashed())?;
    let text = head.media_type.starts_with("text/");
    let media_type = if text { format!("{}; charset=utf-8", head.media_type) } else { head.media_type };
    Ok(Reply { status: head.status, media_type, policy: NO_POLICY, body: output[end + 1..].to_vec() })
}

/// The body of a request, as far as it is not too long and does not come too slowly.
fn body(request: &mut Request<Body>) -> Result<Vec<u8>, Refusal> {
    let too_long = || Refusal::new(413, format!("a request holds at most {MOST_BODY} bytes"));
    let slow = || Refusal::new(408, format!("the request took longer than {} s to come", PATIENCE.as_secs()));
    if request.body().len().is_some_and(|length| length > MOST_BODY) {
        return Err(too_long());
    }
    let until = Instant::now() + PATIENCE;
    let (mut body, mut piece) = (Vec::new(), [0; 8192]);
    loop {
        match request.body_mut().read(&mut piece) {
            Ok(0) => return Ok(body),
            Ok(length) => body.extend_from_slice(&piece[..length]),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => return Err(slow()),
            Err(error) => return Err(Refusal::new(400, format!("the request can't be read: {error}"))),
        }
        if body.len() as u64 > MOST_BODY {
            return Err(too_long());
        }
        if Instant::now() > until {
            return Err(slow());
        }
    }
}

fn response(reply: Reply, head: bool) -> Response<Body> {
    let status = StatusCode::from_u16(reply.status).unwrap_or(StatusCode::INTERNAL_SERVER_ERROR);
    let mut response = Response::new(if head { Body::empty() } else { Body::from(reply.body) });
    *response.status_mut() = status;
    let headers = response.headers_mut();
    let mut set = |name: HeaderName, value: &str| {
        // Media types and policies are ours, and have no line ends.
        if let Ok(value) = HeaderValue::from_str(value) {
            headers.insert(name, value);
        }
    };
    set(header::CONTENT_TYPE, &reply.media_type);
    set(header::CONTENT_SECURITY_POLICY, reply.policy);
    set(header::X_CONTENT_TYPE_OPTIONS, "nosniff");
    set(header::X_FRAME_OPTIONS, "DENY");
    set(header::REFERRER_POLICY, "no-referrer");
    set(header::CACHE_CONTROL, "no-store");
    set(HeaderName::from_static("cross-origin-resource-policy"), "same-origin");
    set(header::VARY, "Accept");
    set(header::CONNECTION, "close");
    match reply.status {
        405 => set(header::ALLOW, "GET, HEAD, POST"),
        503 => set(header::RETRY_AFTER, "1"),
        _ => {}
    }
    response
}
