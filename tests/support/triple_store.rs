//! A SPARQL 1.1 store in memory, over HTTP: queries, updates and the graph store protocol, with
//! faults if they are wanted.

use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use oxigraph::io::{RdfFormat, RdfParser, RdfSerializer};
use oxigraph::model::{GraphName, NamedNode};
use oxigraph::sparql::results::{QueryResultsFormat, QueryResultsSerializer};
use oxigraph::sparql::{QueryResults, SparqlEvaluator};
use oxigraph::store::Store;

/// The way in which the store misbehaves.
#[derive(Debug, Clone, Default)]
pub struct Faults {
    /// Every tenth request fails, each time in another way; one of them is carried out, but has no
    /// answer.
    pub every_tenth: bool,
    /// Time before each answer.
    pub delay: Duration,
    /// Largest body that is accepted. Unit: bytes.
    pub most_bytes: Option<usize>,
    /// The header that requests must have.
    pub authorization: Option<String>,
}

pub struct TripleStore {
    pub port: u16,
    shared: Arc<Shared>,
}

struct Shared {
    store: Store,
    faults: Mutex<Faults>,
    requests: AtomicU64,
    failed: AtomicU64,
}

/// A request: method, path, parameters, media type, authorization, body.
struct Request {
    path: String,
    parameters: Vec<(String, String)>,
    authorization: Option<String>,
    media_type: String,
    body: Vec<u8>,
}

impl TripleStore {
    pub fn start() -> Self {
        let listener = TcpListener::bind(("127.0.0.1", 0)).unwrap();
        let port = listener.local_addr().unwrap().port();
        let shared = Arc::new(Shared {
            store: Store::new().unwrap(),
            faults: Mutex::default(),
            requests: AtomicU64::new(0),
            failed: AtomicU64::new(0),
        });
        let of_thread = Arc::clone(&shared);
        // The threads end with the process of the tests.
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let shared = Arc::clone(&of_thread);
                std::thread::spawn(move || serve(&stream, &shared));
            }
        });
        Self { port, shared }
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://127.0.0.1:{}/{path}", self.port)
    }

    pub fn set(&self, faults: Faults) {
        *self.shared.faults.lock().unwrap() = faults;
    }

    /// Number of requests, and of those that failed on purpose.
    pub fn requests(&self) -> [u64; 2] {
        [&self.shared.requests, &self.shared.failed].map(|count| count.load(Ordering::Relaxed))
    }

    pub fn clear(&self) {
        self.shared.store.clear().unwrap();
    }

    /// All statements as N-Quads.
    pub fn statements(&self) -> BTreeSet<String> {
        self.shared
            .store
            .iter()
            .map(|quad| format!("{} .", quad.unwrap()))
            .collect()
    }
}

/// Answers the requests of one connection until it is closed.
fn serve(stream: &TcpStream, shared: &Shared) {
    let mut reader = BufReader::new(stream.try_clone().unwrap());
    while let Some(request) = read(&mut reader) {
        let number = shared.requests.fetch_add(1, Ordering::Relaxed) + 1;
        let faults = shared.faults.lock().unwrap().clone();
        std::thread::sleep(faults.delay);
        let fails = faults.every_tenth && number.is_multiple_of(10);
        shared.failed.fetch_add(u64::from(fails), Ordering::Relaxed);
        let reply = match (fails, number / 10 % 4) {
            (true, 0) => reply(
                500,
                "text/html",
                "<html><title>500</title><p>no memory</p></html>",
                "",
            ),
            (true, 1) => reply(429, "text/plain", "too many requests", "Retry-After: 0\r\n"),
            // Carried out, but the answer is lost.
            (true, 2) => {
                answer(&request, &faults, shared);
                return;
            }
            (true, _) => return,
            _ => answer(&request, &faults, shared),
        };
        let mut writer = stream;
        if writer.write_all(&reply).is_err() {
            return;
        }
    }
}

fn read(reader: &mut BufReader<TcpStream>) -> Option<Request> {
    let mut line = String::new();
    reader.read_line(&mut line).ok()?;
    let target = line.split(' ').nth(1)?.to_owned();
    let (path, query) = target.split_once('?').unwrap_or((&target, ""));
    let (mut length, mut authorization, mut media_type) = (0, None, String::new());
    loop {
        let mut header = String::new();
        reader.read_line(&mut header).ok()?;
        let Some((name, value)) = header.trim().split_once(':') else {
            break;
        };
        match name.to_lowercase().as_str() {
            "content-length" => length = value.trim().parse().ok()?,
            "authorization" => authorization = Some(value.trim().to_owned()),
            "content-type" => media_type = value.split(';').next().unwrap().trim().to_owned(),
            _ => {}
        }
    }
    let mut body = vec![0; length];
    reader.read_exact(&mut body).ok()?;
    Some(Request {
        path: path.to_owned(),
        parameters: parameters(query),
        authorization,
        media_type,
        body,
    })
}

fn parameters(encoded: &str) -> Vec<(String, String)> {
    let decoded = |text: &str| {
        let (mut bytes, mut rest) = (Vec::new(), text.as_bytes());
        while let [first, after @ ..] = rest {
            rest = after;
            match (first, after) {
                (b'%', [high, low, after @ ..]) => {
                    let digits = [*high, *low];
                    bytes.push(
                        u8::from_str_radix(std::str::from_utf8(&digits).unwrap(), 16).unwrap(),
                    );
                    rest = after;
                }
                (b'+', _) => bytes.push(b' '),
                (byte, _) => bytes.push(*byte),
            }
        }
        String::from_utf8(bytes).unwrap()
    };
    let pairs = encoded
        .split('&')
        .filter(|pair| !pair.is_empty())
        .map(|pair| pair.split_once('=').unwrap_or((pair, "")));
    pairs
        .map(|(name, value)| (decoded(name), decoded(value)))
        .collect()
}

fn reply(status: u16, media_type: &str, body: impl AsRef<[u8]>, headers: &str) -> Vec<u8> {
    let body = body.as_ref();
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status} X\r\nContent-Type: {media_type}\r\nContent-Length: {length}\r\n{headers}\r\n"
    );
    [head.as_bytes(), body].concat()
}

fn answer(request: &Request, faults: &Faults, shared: &Shared) -> Vec<u8> {
    if faults.authorization.is_some() && request.authorization != faults.authorization {
        return reply(
            401,
            "text/plain",
            "who are you?",
            "WWW-Authenticate: Basic\r\n",
        );
    }
    if faults
        .most_bytes
        .is_some_and(|most| request.body.len() > most)
    {
        return reply(413, "text/plain", "too large", "");
    }
    if let Some(path) = request.path.strip_prefix("/moved") {
        return reply(308, "text/plain", "", &format!("Location: {path}\r\n"));
    }
    let text = String::from_utf8_lossy(&request.body).into_owned();
    let done = match (request.path.as_str(), request.media_type.as_str()) {
        ("/update", "application/sparql-update") => SparqlEvaluator::new()
            .parse_update(&text)
            .map_err(|error| error.to_string())
            .and_then(|update| {
                update
                    .on_store(&shared.store)
                    .execute()
                    .map_err(|error| error.to_string())
            }),
        ("/graphs", "application/n-triples") => add_to_graph(request, &shared.store),
        ("/quads", "application/n-quads") => add(
            RdfParser::from_format(RdfFormat::NQuads),
            request,
            &shared.store,
        ),
        ("/query" | "/query-tsv", "application/x-www-form-urlencoded") => {
            let Some((_, query)) = parameters(&text)
                .into_iter()
                .find(|(name, _)| name == "query")
            else {
                return reply(400, "text/plain", "no query", "");
            };
            let format = if request.path == "/query" {
                QueryResultsFormat::Json
            } else {
                QueryResultsFormat::Tsv
            };
            return match queried(&query, format, &shared.store) {
                Ok((media_type, body)) => reply(200, media_type, body, ""),
                Err(error) => reply(400, "text/plain", format!("Parse error\n{error}"), ""),
            };
        }
        ("/elsewhere", _) => {
            return reply(
                302,
                "text/plain",
                "",
                "Location: http://localhost:1/login\r\n",
            );
        }
        ("/circle", _) => return reply(307, "text/plain", "", "Location: /circle\r\n"),
        ("/page", _) => return reply(200, "text/html", "<html>Welcome</html>", ""),
        ("/cut", _) => {
            return reply(
                200,
                "application/sparql-results+json",
                "{\"head\":{\"vars\":[\"a\"]},\"results\":{\"bi",
                "",
            );
        }
        _ => {
            return reply(
                404,
                "text/html",
                "<html><h1>Not found</h1><p>no such service</p></html>",
                "",
            );
        }
    };
    match done {
        Ok(()) => reply(204, "text/plain", "", ""),
        Err(error) => reply(400, "text/plain", error, ""),
    }
}

fn add_to_graph(request: &Request, store: &Store) -> Result<(), String> {
    let graph = match &request.parameters[..] {
        [(name, _)] if name == "default" => GraphName::DefaultGraph,
        [(name, value)] if name == "graph" => NamedNode::new(value)
            .map_err(|error| error.to_string())?
            .into(),
        other => return Err(format!("{other:?} names no graph")),
    };
    add(
        RdfParser::from_format(RdfFormat::NTriples).with_default_graph(graph),
        request,
        store,
    )
}

fn add(parser: RdfParser, request: &Request, store: &Store) -> Result<(), String> {
    store
        .load_from_slice(parser, &request.body)
        .map_err(|error| error.to_string())
}

fn queried(
    query: &str,
    format: QueryResultsFormat,
    store: &Store,
) -> Result<(&'static str, Vec<u8>), String> {
    let prepared = SparqlEvaluator::new()
        .parse_query(query)
        .map_err(|error| error.to_string())?;
    let serializer = QueryResultsSerializer::from_format(format);
    let body = match prepared
        .on_store(store)
        .execute()
        .map_err(|error| error.to_string())?
    {
        QueryResults::Boolean(value) => serializer
            .serialize_boolean_to_writer(Vec::new(), value)
            .unwrap(),
        QueryResults::Solutions(solutions) => {
            let variables = solutions.variables().to_vec();
            let mut writer = serializer
                .serialize_solutions_to_writer(Vec::new(), variables)
                .unwrap();
            for solution in solutions {
                writer
                    .serialize(&solution.map_err(|error| error.to_string())?)
                    .unwrap();
            }
            writer.finish().unwrap()
        }
        QueryResults::Graph(triples) => {
            let mut writer = RdfSerializer::from_format(RdfFormat::NTriples).for_writer(Vec::new());
            for triple in triples {
                writer
                    .serialize_triple(&triple.map_err(|error| error.to_string())?)
                    .unwrap();
            }
            return Ok(("application/n-triples", writer.finish().unwrap()));
        }
    };
    let media_type = if format == QueryResultsFormat::Tsv {
        "text/tab-separated-values"
    } else {
        "application/sparql-results+json"
    };
    Ok((media_type, body))
}
