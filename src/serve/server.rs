//! The HTTP server: accepts connections and routes requests.

use std::convert::Infallible;
use std::net::{IpAddr, SocketAddr, TcpListener};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use hyper::body::{Bytes, Incoming};
use hyper::header;
use hyper::http::request;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper::{Method, Request, Response};
use hyper_util::rt::{TokioIo, TokioTimer};
use tokio::runtime::Runtime;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};

use crate::answer::{Question, too_large};
use crate::body::AnswerBody;
use crate::connections::{Connections, Doing};
use crate::counts::Counts;
use crate::guard::guard;
use crate::lanes::{Evaluated, Lanes, processors};
use crate::page::{self, ExampleQuery};
use crate::question::{Parts, Refusal, question};
use crate::reply::{NO_POLICY, PAGE_POLICY, REPORT_POLICY, Reply, response};
use crate::report::{LiveReport, Rendered};
use crate::request::{PATIENCE, origin, read, text};
use crate::snapshot::Snapshots;
use crate::threads::Threads;
use crate::worker::{Asked, Worker};

/// Maximum size of the head of a request: twice the longest target that the library accepts. Unit:
/// bytes.
const MOST_HEAD: usize = 128 << 10;
/// Stack of a thread that evaluates light queries; only the used part takes memory. Unit: bytes.
const STACK: usize = 64 << 20;
/// Threads for connections for each processor: a query may occupy one for a moment.
const THREADS: usize = 4;
/// Threads that evaluate light queries, besides one for each processor: for stopped queries that
/// have not ended yet.
const SPARE_THREADS: usize = 6;
/// Number of the largest allowed answers that may wait for their clients at a time.
const MOST_ANSWERS: u64 = 4;
/// Unit in which memory for answers is counted. Unit: bytes.
const MEMORY_UNIT: u64 = 64 << 10;
/// Maximum number of processes that make replays: one for each side of a pair.
const MOST_REPLAYS: usize = 2;
/// Interval at which stalled connections are closed.
const TIDY_EVERY: Duration = Duration::from_secs(1);

/// Options of [`serve`].
#[derive(Debug, Clone)]
pub struct ServeOptions {
    /// Folder of the history.
    pub history: PathBuf,
    /// Path of this program, which is started for queries that are not light.
    pub program: PathBuf,
    /// Arguments with which it answers queries ([`crate::answer()`]).
    pub query_arguments: Vec<String>,
    /// Arguments with which it prints the data of the report, the report, and with `--run=ID` a
    /// replay.
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
    /// Maximum number of processes that evaluate queries.
    pub most_queries: usize,
    /// Example queries of the page.
    pub examples: Vec<ExampleQuery>,
}

/// A server that runs until the value is dropped.
#[derive(Debug)]
pub struct Serving {
    /// Address on which it listens.
    pub address: SocketAddr,
    /// Requests so far.
    pub counts: Arc<Counts>,
    runtime: Option<Runtime>,
    lanes: Arc<Lanes>,
}

impl Drop for Serving {
    fn drop(&mut self) {
        self.lanes.close();
        if let Some(runtime) = self.runtime.take() {
            runtime.shutdown_background();
        }
    }
}

/// Starts the server.
///
/// # Errors
/// The address can't be bound.
pub fn serve(options: ServeOptions) -> std::io::Result<Serving> {
    let listener = TcpListener::bind((options.address, options.port))?;
    listener.set_nonblocking(true)?;
    let address = listener.local_addr()?;
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .max_blocking_threads(processors() + SPARE_THREADS)
        .thread_stack_size(STACK)
        .enable_all()
        .build()?;
    let inside = runtime.enter();
    let listener = tokio::net::TcpListener::from_std(listener)?;
    let app = Arc::new(App::new(
        options,
        Threads::start(processors() * THREADS, STACK)?,
    ));
    drop(inside);
    let (counts, lanes) = (Arc::clone(&app.counts), Arc::clone(&app.lanes));
    runtime.spawn(app.run(listener));
    Ok(Serving {
        address,
        counts,
        runtime: Some(runtime),
        lanes,
    })
}

/// State shared by all requests.
struct App {
    options: ServeOptions,
    lanes: Arc<Lanes>,
    report: Arc<LiveReport>,
    page: Bytes,
    counts: Arc<Counts>,
    connections: Arc<Connections>,
    threads: Threads,
    /// Memory for large answers, in [`MEMORY_UNIT`]s.
    memory: Arc<Semaphore>,
    /// Concurrent requests for the report wait for the same page.
    rendering: Arc<tokio::sync::Mutex<()>>,
    /// Processes for replays.
    replays: Arc<Semaphore>,
}

impl App {
    fn new(options: ServeOptions, threads: Threads) -> Self {
        let worker = |arguments: &[String]| Worker {
            program: options.program.clone(),
            arguments: arguments.to_vec(),
        };
        let report = LiveReport::new(worker(&options.report_arguments), &options.history);
        let page = page::page(&options.history.display().to_string(), &options.examples).into();
        let counts = Arc::new(Counts::default());
        let worker = worker(&options.query_arguments);
        let lanes = Lanes::new(
            Snapshots::new(&options.history),
            Arc::clone(&counts),
            worker,
            options.most_queries,
        );
        let units =
            usize::try_from(memory_units(options.most_bytes) * MOST_ANSWERS).unwrap_or(usize::MAX);
        Self {
            lanes: Arc::new(lanes),
            report: Arc::new(report),
            page,
            counts,
            connections: Connections::new(),
            threads,
            memory: Arc::new(Semaphore::new(units.min(Semaphore::MAX_PERMITS))),
            rendering: Arc::default(),
            replays: Arc::new(Semaphore::new(MOST_REPLAYS)),
            options,
        }
    }

    /// Accepts connections until the runtime ends.
    async fn run(self: Arc<Self>, listener: tokio::net::TcpListener) {
        let app = Arc::clone(&self);
        tokio::spawn(async move {
            loop {
                tokio::time::sleep(TIDY_EVERY).await;
                app.connections.close_stalled();
            }
        });
        let mut next = None;
        loop {
            let stream = match next.take() {
                Some(stream) => stream,
                None => match listener.accept().await {
                    Ok((stream, _)) => stream,
                    Err(_) => {
                        // Too many open files, or a client that has gone away already.
                        tokio::time::sleep(Duration::from_millis(10)).await;
                        continue;
                    }
                },
            };
            // Without it, small answers wait for the acknowledgement of earlier ones; the
            // connection works anyway.
            let _ = stream.set_nodelay(true);
            let Some(thread) = self.threads.next() else {
                continue;
            };
            let (app, mut slot) = (Arc::clone(&self), Some(stream));
            let added = self.connections.add(thread, |doing| {
                let stream = slot.take();
                async move {
                    // It was accepted on another thread.
                    let stream = stream.and_then(|stream| stream.into_std().ok());
                    if let Some(Ok(stream)) = stream.map(tokio::net::TcpStream::from_std) {
                        app.converse(stream, doing).await;
                    }
                }
            });
            if !added {
                next = slot;
                tokio::time::sleep(Duration::from_millis(10)).await;
            }
        }
    }

    /// Answers the requests of one connection.
    async fn converse(self: Arc<Self>, stream: tokio::net::TcpStream, doing: Arc<Doing>) {
        let service = service_fn(move |request| {
            let (app, doing) = (Arc::clone(&self), Arc::clone(&doing));
            async move { Ok::<_, Infallible>(app.respond(request, doing).await) }
        });
        let mut server = http1::Builder::new();
        server.auto_date_header(has_date());
        server
            .timer(TokioTimer::new())
            .header_read_timeout(PATIENCE)
            .max_buf_size(MOST_HEAD);
        // The error is the client's: it sent no HTTP, was too slow, or has gone away.
        let _ = server.serve_connection(TokioIo::new(stream), service).await;
    }

    async fn respond(
        self: Arc<Self>,
        request: Request<Incoming>,
        doing: Arc<Doing>,
    ) -> Response<AnswerBody> {
        doing.answers();
        let began = Instant::now();
        let (parts, mut body) = request.into_parts();
        let reply = self
            .reply(&parts, &mut body)
            .await
            .unwrap_or_else(Reply::from);
        let memory = self.reserve(reply.body.len() as u64).await;
        self.counts.record(reply.status, began.elapsed());
        response(reply, parts.method == Method::HEAD, |bytes| {
            AnswerBody::new(bytes, doing, memory)
        })
    }

    /// Reserves memory for a large answer until it is sent.
    async fn reserve(&self, bytes: u64) -> Option<OwnedSemaphorePermit> {
        let units = u32::try_from(memory_units(bytes))
            .unwrap_or(u32::MAX)
            .min(self.options_units());
        if bytes <= MEMORY_UNIT {
            return None;
        }
        Arc::clone(&self.memory)
            .acquire_many_owned(units)
            .await
            .ok()
    }

    fn options_units(&self) -> u32 {
        u32::try_from(memory_units(self.options.most_bytes))
            .unwrap_or(u32::MAX)
            .max(1)
    }

    async fn reply(&self, request: &request::Parts, body: &mut Incoming) -> Result<Reply, Refusal> {
        guard(&origin(request)?, &self.options.hosts)?;
        let (path, reads) = (
            request.uri.path(),
            matches!(request.method, Method::GET | Method::HEAD),
        );
        match path {
            "/sparql" => self.sparql(request, body).await,
            "/" | "/query" | "/style.css" | "/query.js" | "/report" | "/data" | "/replay"
            | "/health"
                if !reads =>
            {
                Err(Refusal::new(405, "use GET or HEAD"))
            }
            "/" | "/report" => {
                let page = self.live_report(LiveReport::cached).await?.page;
                Ok(Reply::page("text/html; charset=utf-8", REPORT_POLICY, page))
            }
            "/data" => self.data(request.uri.query()).await,
            "/replay" => self.replay(request.uri.query()).await,
            "/query" => Ok(Reply::page(
                "text/html; charset=utf-8",
                PAGE_POLICY,
                self.page.clone(),
            )),
            "/style.css" => Ok(Reply::page(
                "text/css; charset=utf-8",
                NO_POLICY,
                page::STYLE,
            )),
            "/query.js" => Ok(Reply::page(
                "text/javascript; charset=utf-8",
                NO_POLICY,
                page::SCRIPT,
            )),
            "/health" => Ok(Reply::page(
                "application/json",
                NO_POLICY,
                self.counts.json(),
            )),
            _ => Err(Refusal::new(
                404,
                "not found: see /, /query, /sparql and /health",
            )),
        }
    }

    /// The report: the kept one if `kept` returns it, else a new one.
    async fn live_report(
        &self,
        kept: impl FnOnce(&LiveReport) -> Option<Rendered>,
    ) -> Result<Rendered, Refusal> {
        if let Some(rendered) = kept(&self.report) {
            return Ok(rendered);
        }
        let alone = Arc::clone(&self.rendering).lock_owned().await;
        let report = Arc::clone(&self.report);
        beside(move || {
            let rendered = report.render();
            drop(alone);
            rendered
        })
        .await
    }

    /// The data of the report, or nothing if the client has them.
    async fn data(&self, query: Option<&str>) -> Result<Reply, Refusal> {
        let rendered = self.live_report(LiveReport::recent).await?;
        Ok(if parameter(query, "state") == rendered.state {
            Reply::empty()
        } else {
            Reply::page("application/json", NO_POLICY, rendered.data)
        })
    }

    /// The replay of a run.
    async fn replay(&self, query: Option<&str>) -> Result<Reply, Refusal> {
        let run = parameter(query, "run");
        let permit = Arc::clone(&self.replays).acquire_owned().await;
        let report = Arc::clone(&self.report);
        let replay = beside(move || {
            let replay = report.replay(&run);
            drop(permit);
            replay
        });
        Ok(Reply::page("application/json", NO_POLICY, replay.await?))
    }

    async fn sparql(
        &self,
        request: &request::Parts,
        body: &mut Incoming,
    ) -> Result<Reply, Refusal> {
        let body = read(request, body).await?;
        let parts = Parts {
            method: request.method.as_str(),
            query: request.uri.query(),
            content_type: text(&request.headers, &header::CONTENT_TYPE),
            body: &body,
        };
        let query = question(&parts)?;
        let accepts = request
            .headers
            .get_all(header::ACCEPT)
            .iter()
            .filter_map(|value| value.to_str().ok());
        let accept = accepts.collect::<Vec<&str>>().join(",");
        let ServeOptions {
            most_rows,
            most_bytes,
            most_secs,
            most_memory,
            ..
        } = self.options;
        let question = Arc::new(Question {
            query,
            accept,
            most_rows,
            most_bytes,
            most_secs,
            most_memory,
        });
        match self.lanes.evaluate(&question).await? {
            Evaluated::Here(answered) => Ok(answered.into()),
            Evaluated::There(asked) => self.asked(asked),
        }
    }

    /// The reply with the result of a process.
    fn asked(&self, asked: Asked) -> Result<Reply, Refusal> {
        let ServeOptions {
            most_secs,
            most_memory,
            most_bytes,
            ..
        } = self.options;
        let why = match asked {
            Asked::Answer(head, body) => {
                return Ok(Reply::answer(head.status, &head.media_type, body));
            }
            Asked::TooMuch => return Ok(too_large(most_bytes).into()),
            Asked::Late => {
                return Err(Refusal::new(
                    504,
                    format!("the query took longer than {most_secs} s"),
                ));
            }
            Asked::MemorySpent => format!(
                "the query took more than {} MB of memory",
                most_memory / 1_000_000
            ),
            Asked::NotStarted(why) => format!("the query process could not be started: {why}"),
            Asked::Crashed | Asked::NotTaken | Asked::Gone => {
                "the query crashed the evaluator".to_owned()
            }
        };
        Err(Refusal::new(500, why))
    }
}

/// The value of a parameter of a request; empty if it is missing.
fn parameter(query: Option<&str>, name: &str) -> String {
    let pairs = form_urlencoded::parse(query.unwrap_or_default().as_bytes());
    let mut found = pairs.filter(|(known, _)| known == name);
    found
        .next()
        .map(|(_, value)| value.into_owned())
        .unwrap_or_default()
}

/// Does a task in a thread of its own.
async fn beside<T: Send + 'static>(
    task: impl FnOnce() -> Result<T, Refusal> + Send + 'static,
) -> Result<T, Refusal> {
    let (sender, receiver) = oneshot::channel();
    std::thread::spawn(move || {
        // The receiver is gone if the client is.
        let _ = sender.send(task());
    });
    receiver
        .await
        .map_err(|_| Refusal::new(500, "the report crashed"))?
}

fn memory_units(bytes: u64) -> u64 {
    bytes.div_ceil(MEMORY_UNIT)
}

/// Whether the clock shows a time that the header `Date` can have: the library panics before 1970
/// and after 9999.
fn has_date() -> bool {
    const YEAR_10000_SECS: u64 = 253_402_300_800;
    let since = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    since.is_ok_and(|since| since.as_secs() < YEAR_10000_SECS - 86_400)
}
