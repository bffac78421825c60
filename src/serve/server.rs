//! The HTTP server: routes requests and runs worker processes.

use std::io::{Error, ErrorKind, Read as _};
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError, RwLock};
use std::time::{Duration, Instant};

use oxhttp::Server;
use oxhttp::model::header::{self, HeaderName, HeaderValue};
use oxhttp::model::{Body, Request, Response, StatusCode};

use crate::answer::{Head, Question};
use crate::guard::guard;
use crate::page::{self, ExampleQuery};
use crate::question::{Parts, Refusal, question};
use crate::report::LiveReport;
use crate::watch;
use crate::worker::{Ended, Worker};

/// Maximum size of a request body. Unit: bytes.
const MOST_BODY: u64 = 1 << 20;
/// Time limit for a client to send its request.
const PATIENCE: Duration = Duration::from_secs(10);
/// Maximum number of concurrent connections; others wait.
const MOST_CONNECTIONS: usize = 64;
/// Additional time for a process to start and open the history.
const START: Duration = Duration::from_secs(5);
/// Maximum number of tries for a free port, because another program may take it in between.
const TRIES: usize = 8;

/// Policy of the query page: load its script and stylesheet, and connect to this server.
const PAGE_POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; form-action 'self'; base-uri 'none'; frame-ancestors 'none'";
/// Policy of the report, a single file with inline scripts and images that connects to no server. The file also has a
/// policy of its own, which names its scripts by digest; both apply. This one adds `frame-ancestors`, which only a
/// header can set.
const REPORT_POLICY: &str = "default-src 'none'; script-src 'unsafe-inline' blob:; style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
/// Policy of answers, which are not pages.
const NO_POLICY: &str = "default-src 'none'; frame-ancestors 'none'; sandbox";

/// Options of [`serve`].
#[derive(Debug, Clone)]
pub struct ServeOptions {
    /// Folder of the history.
    pub history: PathBuf,
    /// Path of this program, which is started for each query.
    pub program: PathBuf,
    /// Arguments with which it answers a query ([`crate::answer()`]).
    pub query_arguments: Vec<String>,
    /// Arguments with which it prints the report.
    pub report_arguments: Vec<String>,
    /// Address to listen on.
    pub address: IpAddr,
    /// Port; 0 selects a free one.
    pub port: u16,
    /// Host names of this server besides IP addresses and `localhost`.
    pub hosts: Vec<String>,
    /// Time limit of a query. Unit: seconds.
    pub most_secs: f64,
    /// Maximum number of rows or triples in an answer.
    pub most_rows: u64,
    /// Maximum size of an answer. Unit: bytes.
    pub most_bytes: u64,
    /// Memory limit of a query. Unit: bytes.
    pub most_memory: u64,
    /// Maximum number of concurrent queries.
    pub most_queries: usize,
    /// Example queries of the page.
    pub examples: Vec<ExampleQuery>,
}

/// A server that runs until the process ends.
#[derive(Debug)]
pub struct Serving {
    /// Address on which it listens.
    pub address: SocketAddr,
}

/// Starts the server.
///
/// # Errors
/// The address can't be bound.
pub fn serve(options: ServeOptions) -> std::io::Result<Serving> {
    let (ip, wanted) = (options.address, options.port);
    let state = std::sync::Arc::new(AppState::new(options));
    let mut last = Error::from(ErrorKind::AddrInUse);
    for _ in 0..if wanted == 0 { TRIES } else { 1 } {
        let address = match wanted {
            // The library does not report its port, so bind a free one first and reuse it.
            0 => TcpListener::bind((ip, 0))?.local_addr()?,
            port => SocketAddr::new(ip, port),
        };
        let shared = std::sync::Arc::clone(&state);
        let server = Server::new(move |request| shared.respond(request))
            .bind(address)
            .with_global_timeout(PATIENCE)
            .with_max_concurrent_connections(MOST_CONNECTIONS);
        match server.spawn() {
            // Its threads continue without the handle.
            Ok(_) => return Ok(Serving { address }),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// State shared by all requests.
struct AppState {
    options: ServeOptions,
    query: Worker,
    report: LiveReport,
    page: String,
    running: AtomicUsize,
    /// Queries take the read lock, the report the write lock, because it needs exclusive access.
    history: RwLock<()>,
}

/// A response before conversion to the library's type.
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

impl AppState {
    fn new(options: ServeOptions) -> Self {
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
        // The rest of the request is not read, so the connection can't be reused.
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
            "/" | "/style.css" | "/query.js" | "/report" if !reads => Err(Refusal::new(405, "use GET or HEAD")),
            "/" => Ok(Reply::page("text/html; charset=utf-8", PAGE_POLICY, self.page.as_str())),
            "/style.css" => Ok(Reply::page("text/css; charset=utf-8", NO_POLICY, page::STYLE)),
            "/query.js" => Ok(Reply::page("text/javascript; charset=utf-8", NO_POLICY, page::SCRIPT)),
            "/report" => {
                let page = self.report.page(&self.history)?;
                Ok(Reply::page("text/html; charset=utf-8", REPORT_POLICY, page))
            }
            _ => Err(Refusal::new(404, "not found: see /, /report and /sparql")),
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
        let _place =
            self.reserve_slot().ok_or_else(|| Refusal::new(503, "too many queries are running: try again soon"))?;
        self.ask(query, accept)
    }

    fn ask(&self, query: String, accept: String) -> Result<Reply, Refusal> {
        let ServeOptions { most_rows, most_secs, most_memory, most_bytes, .. } = self.options;
        let question = Question { query, accept, most_rows, most_secs, most_memory };
        let Ok(input) = serde_json::to_vec(&question) else { return Err(Refusal::new(400, "the query can't be read")) };
        let time = START + Duration::try_from_secs_f64(most_secs).unwrap_or(Duration::MAX / 2);
        let ended = {
            let _reading = self.history.read().unwrap_or_else(PoisonError::into_inner);
            self.query.run(&input, time, most_bytes)
        };
        let late = || Refusal::new(504, format!("the query took longer than {most_secs} s"));
        match ended {
            Ended::Itself { code: Some(0), output, .. } => parse_output(output),
            Ended::Itself { code: Some(watch::TIME_SPENT), .. } | Ended::Late => Err(late()),
            Ended::Itself { code: Some(watch::MEMORY_SPENT), .. } => {
                Err(Refusal::new(500, format!("the query took more than {} MB of memory", most_memory / 1_000_000)))
            }
            Ended::Itself { .. } => Err(Refusal::new(500, "the query crashed the evaluator")),
            Ended::TooMuch => {
                Err(Refusal::new(500, format!("the answer is larger than {} MB: use `LIMIT`", most_bytes / 1_000_000)))
            }
            Ended::NotStarted(why) => Err(Refusal::new(500, format!("the query process could not be started: {why}"))),
        }
    }

    /// Reserves a slot for a query. Returns `None` if all slots are in use.
    fn reserve_slot(&self) -> Option<QuerySlot<'_>> {
        let taken = self.running.fetch_add(1, Ordering::AcqRel);
        let slot = QuerySlot(&self.running);
        (taken < self.options.most_queries).then_some(slot)
    }
}

/// A slot for a running query; dropping it frees the slot.
struct QuerySlot<'a>(&'a AtomicUsize);

impl Drop for QuerySlot<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::AcqRel);
    }
}

/// Splits the output of the process into head and body.
fn parse_output(output: Vec<u8>) -> Result<Reply, Refusal> {
    let crashed = || Refusal::new(500, "the query crashed the evaluator");
    let end = output.iter().position(|byte| *byte == b'\n').ok_or_else(crashed)?;
    let head: Head = serde_json::from_slice(&output[..end]).map_err(|_| crashed())?;
    let text = head.media_type.starts_with("text/");
    let media_type = if text { format!("{}; charset=utf-8", head.media_type) } else { head.media_type };
    Ok(Reply { status: head.status, media_type, policy: NO_POLICY, body: output[end + 1..].to_vec() })
}

/// Reads the body of a request. Fails if it is too long or arrives too slowly.
fn body(request: &mut Request<Body>) -> Result<Vec<u8>, Refusal> {
    let too_long = || Refusal::new(413, format!("a request may have at most {MOST_BODY} bytes"));
    let slow = || Refusal::new(408, format!("the request took longer than {} s to arrive", PATIENCE.as_secs()));
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
        // Media types and policies come from this program and contain no line breaks.
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
