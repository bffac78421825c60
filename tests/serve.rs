//! `actcheck serve` from outside: its answers and refusals.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::process::Command;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::support::server::{Reply, Server};
use crate::support::{actcheck, copy_made_history, foreign, made_history, signal, stderr, stdout};

/// A server with narrow limits.
fn limited() -> Server {
    Server::alone(&["--limits", "time=3s,rows=1000,processes=64"])
}

const RUNS: &str = "SELECT ?run ?index { ?run a act:Run ; act:index ?index } ORDER BY ?index";

#[test]
fn answers_have_the_requested_media_type() {
    let server = limited();
    for (accept, media_type, piece) in [
        (
            "",
            "application/sparql-results+json",
            "\"vars\":[\"run\",\"index\"]",
        ),
        (
            "application/sparql-results+xml",
            "application/sparql-results+xml",
            "<variable name=\"index\"/>",
        ),
        (
            "text/csv",
            "text/csv; charset=utf-8",
            "run,index\r\nhttps://w3id.org/actcheck/run/",
        ),
        (
            "text/tab-separated-values",
            "text/tab-separated-values; charset=utf-8",
            "?run\t?index",
        ),
        (
            "text/html, */*;q=0.1",
            "application/sparql-results+json",
            "bindings",
        ),
    ] {
        let reply = server.ask(RUNS, accept);
        assert_eq!(
            (reply.status, reply.media_type()),
            (200, media_type),
            "{accept}: {}",
            reply.body
        );
        assert!(reply.body.contains(piece), "{accept}: {}", reply.body);
        assert_eq!(reply.headers["x-content-type-options"], "nosniff");
        assert!(reply.headers["content-security-policy"].contains("default-src 'none'"));
        assert!(!reply.headers.contains_key("access-control-allow-origin"));
    }
    let graph = "CONSTRUCT { ?run a prov:Activity } WHERE { ?run a act:Run }";
    for (accept, media_type, piece) in [
        ("*/*", "text/turtle; charset=utf-8", "prov:Activity"),
        (
            "application/n-triples",
            "application/n-triples",
            "<http://www.w3.org/ns/prov#Activity> .",
        ),
        ("application/rdf+xml", "application/rdf+xml", "<rdf:RDF"),
    ] {
        let reply = server.ask(graph, accept);
        assert_eq!(
            (reply.status, reply.media_type()),
            (200, media_type),
            "{accept}: {}",
            reply.body
        );
        assert!(reply.body.contains(piece), "{accept}: {}", reply.body);
    }
    assert_eq!(server.ask(graph, "text/csv").status, 406);
    assert_eq!(server.ask(RUNS, "image/png").status, 406);
    assert!(
        server
            .ask("ASK { ?run a act:Run }", "")
            .body
            .contains("\"boolean\":true")
    );
}

#[test]
fn a_query_can_be_sent_in_three_ways() {
    let server = limited();
    let form = ("Content-Type", "application/x-www-form-urlencoded");
    let encoded = "query=ASK%20%7B%20%3Frun%20a%20act%3ARun%20%7D";
    for reply in [
        server.get(&format!("/sparql?{encoded}")),
        server.request("POST", "/sparql", &[form], encoded.as_bytes()),
        server.ask("ASK { ?run a act:Run }", "*/*"),
    ] {
        assert_eq!(reply.status, 200, "{}", reply.body);
        assert!(reply.body.contains("true"), "{}", reply.body);
    }
    let head = server.request("HEAD", &format!("/sparql?{encoded}"), &[], b"");
    assert_eq!((head.status, head.body.as_str()), (200, ""));
}

#[test]
fn invalid_queries_are_refused_with_their_place() {
    let server = limited();
    let reply = server.ask("SELECT * WHERE { ?a ?b }", "*/*");
    assert_eq!(reply.status, 400);
    assert!(
        reply.body.contains("query:1:") && reply.body.contains("H010"),
        "{}",
        reply.body
    );
    assert_eq!(server.get("/sparql").status, 400);
    assert_eq!(server.get("/sparql?query=a&query=b").status, 400);
    assert_eq!(
        server
            .get("/sparql?query=ASK%7B%7D&default-graph-uri=http://a")
            .status,
        400
    );
}

#[test]
fn updates_are_refused() {
    let server = limited();
    let count = || {
        server
            .ask("SELECT (COUNT(*) AS ?n) { ?s ?p ?o }", "text/csv")
            .body
    };
    let before = count();
    for text in [
        "DELETE WHERE { ?s ?p ?o }",
        "DROP ALL",
        "INSERT DATA { <a:a> <a:b> <a:c> }",
        "LOAD <file:///etc/passwd>",
        "CLEAR ALL",
    ] {
        assert_eq!(server.ask(text, "*/*").status, 403, "{text}");
    }
    let form = ("Content-Type", "application/x-www-form-urlencoded");
    assert_eq!(
        server
            .request("POST", "/sparql", &[form], b"update=DROP+ALL")
            .status,
        403
    );
    assert_eq!(server.get("/sparql?update=DROP+ALL").status, 403);
    let update = ("Content-Type", "application/sparql-update");
    assert_eq!(
        server
            .request("POST", "/sparql", &[update], b"DROP ALL")
            .status,
        403
    );
    assert_eq!(
        server.request("PUT", "/sparql?graph=a", &[], b"x").status,
        405
    );
    assert_eq!(
        server.request("DELETE", "/sparql?default", &[], b"").status,
        405
    );
    assert_eq!(count(), before);
}

/// No other host is contacted: a listener at the address gets no connection.
#[test]
fn service_clauses_and_remote_graphs_are_refused() {
    let server = limited();
    let other = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    other.set_nonblocking(true).unwrap();
    let there = format!("http://{}/sparql", other.local_addr().unwrap());
    for service in ["SERVICE", "SERVICE SILENT", "service silent"] {
        let reply = server.ask(
            &format!("SELECT * {{ {service} <{there}> {{ ?s ?p ?o }} }}"),
            "*/*",
        );
        assert_eq!(reply.status, 403, "{}", reply.body);
        assert!(reply.body.contains("H017"), "{}", reply.body);
    }
    // Escapes hide the keyword from a reader, and still no host is contacted.
    let hidden = server.ask(
        &format!("SELECT * {{ \\u0053ERVICE SILENT <{there}> {{ ?s ?p ?o }} }}"),
        "text/csv",
    );
    assert!(
        hidden.status != 200 || hidden.body.lines().count() <= 2,
        "{hidden:?}"
    );
    for from in [there.as_str(), "file:///etc/passwd"] {
        let reply = server.ask(
            &format!("SELECT * FROM <{from}> {{ ?s ?p ?o }}"),
            "text/csv",
        );
        assert_eq!(
            (reply.status, reply.body.lines().count()),
            (200, 1),
            "such a graph is empty: {}",
            reply.body
        );
    }
    assert!(other.accept().is_err(), "a connection was made");
}

/// Joins that would take days, in which the evaluator does not check for cancellation, and queries
/// that crash it.
#[test]
fn long_queries_are_stopped_and_do_not_block_others() {
    let server = limited();
    let began = Instant::now();
    let long = [
        "SELECT (COUNT(*) AS ?n) { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l }",
        "SELECT (COUNT(*) AS ?n) { { SELECT * { ?a ?b ?c . ?d ?e ?f } } { SELECT * { ?g ?h ?i . ?j ?k ?l } } }",
        "SELECT * { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i } ORDER BY ?i ?f",
    ];
    std::thread::scope(|scope| {
        let asked: Vec<_> = long
            .iter()
            .map(|query| scope.spawn(|| server.ask(query, "*/*")))
            .collect();
        assert_eq!(server.ask("ASK {}", "*/*").status, 200);
        for reply in asked {
            let reply = reply.join().unwrap();
            // Either limit may be reached first, time or memory.
            assert!([500, 504].contains(&reply.status), "{}", reply.body);
            assert!(reply.body.contains("took"), "{}", reply.body);
        }
    });
    assert!(
        began.elapsed() < Duration::from_secs(60),
        "the limit is 3 s"
    );
    assert_eq!(server.ask("ASK {}", "*/*").status, 200);
}

#[test]
fn a_query_that_is_nested_too_deeply_is_refused() {
    let server = limited();
    let nested = format!(
        "SELECT * {{ FILTER({}1{}) }}",
        "(".repeat(100_000),
        ")".repeat(100_000)
    );
    let reply = server.ask(&nested, "*/*");
    assert_eq!(reply.status, 403, "{}", reply.body);
    assert!(reply.body.contains("levels deep"), "{}", reply.body);
    assert_eq!(server.ask("ASK {}", "*/*").status, 200);
}

#[test]
fn huge_answers_are_refused() {
    let server = limited();
    let reply = server.ask("SELECT * { ?a ?b ?c . ?d ?e ?f }", "*/*");
    assert_eq!(reply.status, 403);
    assert!(reply.body.contains("more than 1000 rows"), "{}", reply.body);
    let reply = server.ask(
        "CONSTRUCT { ?a ?b ?f } WHERE { ?a ?b ?c . ?d ?e ?f }",
        "*/*",
    );
    assert_eq!(reply.status, 403, "{}", reply.body);
    // Few rows, each of them large.
    let small = Server::alone(&["--limits", "size=1MB"]);
    let doubled = "SELECT ?t { BIND(\"0123456789abcdef\" AS ?a) BIND(CONCAT(?a,?a,?a,?a,?a,?a,?a,?a,?a,?a,?a,?a,?a,?a,?a,?a) AS ?b) \
                   BIND(CONCAT(?b,?b,?b,?b,?b,?b,?b,?b,?b,?b,?b,?b,?b,?b,?b,?b) AS ?c) BIND(CONCAT(?c,?c,?c,?c,?c,?c,?c,?c) AS ?d) \
                   BIND(CONCAT(?d,?d,?d,?d,?d,?d,?d,?d) AS ?e) BIND(CONCAT(?e,?e,?e,?e,?e,?e,?e,?e) AS ?t) }";
    let reply = small.ask(doubled, "text/csv");
    assert_eq!(reply.status, 500);
    assert!(
        reply.body.contains("larger than 1 MB"),
        "{}",
        &reply.body[..reply.body.len().min(200)]
    );
}

#[test]
fn path_traversal_is_refused() {
    let server = limited();
    for target in [
        "/etc/passwd",
        "/../../../../etc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "/..%2f..%2fetc%2fpasswd",
        "//etc/passwd",
        "/report/../../VERSION",
        "/VERSION",
        "/campaigns",
        "/lock",
        "/sparql/",
        "/sparql%00",
        "/style.css/../VERSION",
        "/Report",
        "/query.js.map",
    ] {
        let reply = server.get(target);
        assert!(
            [400, 404].contains(&reply.status),
            "{target}: {} {}",
            reply.status,
            reply.body
        );
        assert!(
            !reply.body.contains("root:") && !reply.body.contains("actcheck history"),
            "{target}: {}",
            reply.body
        );
    }
    // The absolute form of a request target, and invalid targets.
    assert!(server.get("http://evil.example/sparql").status >= 400);
    for raw in [
        "GET /\r\n\r\n",
        "\r\n\r\n",
        "GET / HTTP/9.9\r\n\r\n",
        "\0\0\0\0\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: a b\r\nX\r\n\r\n",
    ] {
        let reply = server.garbage(raw.as_bytes());
        assert!(
            reply.status == 0 || reply.status >= 400,
            "{raw:?}: {reply:?}"
        );
    }
    assert_eq!(server.get("/").status, 200);
}

#[test]
fn huge_bodies_are_refused_unread() {
    let server = limited();
    let headers = |length: &str| {
        format!(
            "POST /sparql HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/sparql-query\r\n{length}\r\n\r\n"
        )
    };
    // Announced and never sent.
    assert_eq!(
        server
            .raw(headers("Content-Length: 1000000000000").as_bytes())
            .status,
        413
    );
    // Sent piece by piece, without a length.
    let mut stream = server.connect();
    stream
        .write_all(headers("Transfer-Encoding: chunked").as_bytes())
        .unwrap();
    let piece = [
        format!("{:x}\r\n", 1 << 16).into_bytes(),
        vec![b' '; 1 << 16],
        b"\r\n".to_vec(),
    ]
    .concat();
    // The server closes before everything is sent.
    let sent = (0..1000)
        .take_while(|_| stream.write_all(&piece).is_ok())
        .count();
    assert!(sent < 1000, "64 MB were read");
    assert_eq!(server.ask("ASK {}", "*/*").status, 200);
}

#[test]
fn slow_clients_are_disconnected_and_do_not_block_others() {
    let server = limited();
    // More connections than processors; none of them ever sends a complete request.
    let mut silent: Vec<TcpStream> = (0..20).map(|_| server.connect()).collect();
    for stream in &mut silent {
        stream
            .write_all(b"POST /sparql HTTP/1.1\r\nHost: localhost\r\nContent-Length: 10\r\n")
            .unwrap();
    }
    let mut half = server.connect();
    half.write_all(b"POST /sparql HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/sparql-query\r\nContent-Length: 10\r\n\r\nASK")
        .unwrap();
    assert_eq!(server.ask("ASK {}", "*/*").status, 200);
    assert_eq!(Reply::read(half).status, 408);
    for stream in silent {
        // Closed, with or without an answer.
        let status = Reply::read(stream).status;
        assert!(status == 0 || status >= 400, "{status}");
    }
}

#[test]
fn requests_from_other_sites_are_refused() {
    let server = limited();
    let target = "/sparql?query=ASK%7B%7D";
    let with =
        |name: &str, value: &str| server.request("GET", target, &[(name, value)], b"").status;
    assert_eq!(with("Host", "evil.example"), 421);
    assert_eq!(with("Host", "127.0.0.1.evil.example:7878"), 421);
    assert_eq!(with("Origin", "http://evil.example"), 403);
    assert_eq!(with("Origin", "null"), 403);
    assert_eq!(
        with("Origin", &format!("http://localhost:{}", server.port)),
        200
    );
    assert_eq!(with("Sec-Fetch-Site", "cross-site"), 403);
    assert_eq!(with("Sec-Fetch-Site", "same-site"), 403);
    assert_eq!(with("Sec-Fetch-Site", "same-origin"), 200);
    assert_eq!(with("Sec-Fetch-Site", "none"), 200);
    assert_eq!(
        server.get(&format!("http://evil.example{target}")).status,
        421
    );
    let hosts = [("Host", "localhost"), ("Host", "evil.example")];
    assert_eq!(server.request("GET", target, &hosts, b"").status, 400);
    assert_eq!(
        server
            .raw(b"GET / HTTP/1.1\r\nConnection: close\r\n\r\n")
            .status,
        400,
        "missing host"
    );
}

#[test]
fn the_page_and_the_report_are_served() {
    let server = limited();
    let page = server.get("/query");
    assert_eq!(
        (page.status, page.media_type()),
        (200, "text/html; charset=utf-8")
    );
    assert!(
        page.body.contains("data-query=") && page.body.contains("worst-failures"),
        "the page lists the shipped queries"
    );
    assert!(page.headers["content-security-policy"].contains("script-src 'self'"));
    for asset in ["/style.css", "/query.js"] {
        let reply = server.get(asset);
        assert!(
            reply.status == 200 && reply.body.len() > 500 && page.body.contains(asset),
            "{asset}"
        );
    }
    let report = server.get("/report");
    assert_eq!(
        (report.status, report.media_type()),
        (200, "text/html; charset=utf-8"),
        "{}",
        report.body
    );
    assert!(report.body.contains("</html>") && report.body.len() > 10_000);
    assert!(report.headers["content-security-policy"].contains("default-src 'none'"));
    assert_eq!(server.request("POST", "/", &[], b"x").status, 405);
}

/// The server blocks no other process: it reads snapshots of the history.
#[test]
fn a_second_process_can_use_the_history_beside_the_server() {
    let folder = tempfile::tempdir().unwrap();
    let history = folder.path().join("history");
    copy_made_history(&history);
    let server = Server::start(&history, &[]);
    let runs = |server: &Server| server.ask(RUNS, "text/csv").body.lines().count() - 1;
    let before = runs(&server);
    let again = Server::start(&history, &[]);
    assert_eq!(runs(&again), before);
    // Reading is possible in parallel, also while a query is being answered.
    let reader = actcheck::history::History::open_to_read(&history).unwrap();
    assert_eq!(runs(&server), before);
    drop(reader);
    let name = history.display().to_string();
    let output = actcheck(
        crate::support::root(),
        &["list", "--history", &name, "--format", "csv"],
    );
    assert!(
        output.status.success() && stdout(&output).lines().count() == before + 1,
        "{}",
        stderr(&output)
    );
    let ran = actcheck(
        crate::support::root(),
        &[
            "run",
            "configs/quick.toml",
            "--runs",
            "1",
            "--jobs",
            "1",
            "--history",
            &name,
        ],
    );
    assert!(
        ran.status.code().is_some_and(|code| code < 2),
        "{}",
        stderr(&ran)
    );
    // On a busy machine, the server looks for changes less often.
    let is_visible = (0..200).any(|_| {
        std::thread::sleep(std::time::Duration::from_millis(50));
        runs(&server) == before + 1
    });
    assert!(is_visible, "the new run is visible soon");

    // While another process writes, the answers come from a snapshot.
    let _owner = actcheck::history::History::open_existing(&history).unwrap();
    let reply = server.ask(RUNS, "text/csv");
    assert_eq!(
        (reply.status, reply.body.lines().count()),
        (200, before + 2),
        "{}",
        reply.body
    );
}

#[test]
fn ctrl_c_stops_the_server_cleanly() {
    let mut server = Server::alone(&[]);
    assert_eq!(server.get("/nowhere").status, 404);
    signal(server.process.id(), "INT");
    assert_eq!(server.process.wait().unwrap().code(), Some(0));
    let mut said = String::new();
    server.output.read_to_string(&mut said).unwrap();
    assert!(
        said.starts_with("0 requests served, 1 refused, 0 failed; 99 % of them within "),
        "{said}"
    );
    assert!(TcpStream::connect(("127.0.0.1", server.port)).is_err());
}

#[test]
fn servers_that_cannot_start_report_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let server = limited();
    let own = made_history();
    let history = own.path().display().to_string();
    for (arguments, fault) in [
        (vec!["serve", "--history", "nowhere"], "H003"),
        (
            vec![
                "serve",
                "--history",
                &history,
                "--port",
                &server.port.to_string(),
            ],
            "X053",
        ),
        (
            vec!["serve", "--history", &history, "--port", "192.0.2.1:0"],
            "X053",
        ),
        (
            vec!["serve", "--history", &history, "--limits", "time=0"],
            "above zero",
        ),
        (
            vec!["serve", "--history", &history, "--limits", "time=25h"],
            "at most a day",
        ),
        (
            vec!["serve", "--history", &history, "--limits", "time=soon"],
            "not a duration",
        ),
        (
            vec!["serve", "--history", &history, "--port", "localhost"],
            "invalid",
        ),
    ] {
        let output = actcheck(folder.path(), &arguments);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}");
        assert!(
            stderr(&output).contains(fault),
            "{arguments:?}: {}",
            stderr(&output)
        );
    }
}

/// External clients: curl, and SPARQLWrapper for Python.
#[test]
fn external_clients_work() {
    let server = limited();
    let endpoint = format!("http://localhost:{}/sparql", server.port);
    if foreign::has("curl") {
        let output = Command::new("curl")
            .args([
                "--silent",
                "--fail",
                "-H",
                "Accept: text/csv",
                "--data-urlencode",
                &format!("query={RUNS}"),
                &endpoint,
            ])
            .output()
            .unwrap();
        assert!(
            output.status.success() && stdout(&output).starts_with("run,index\r\n"),
            "{output:?}"
        );
        let get = Command::new("curl")
            .args([
                "--silent",
                "--get",
                "-H",
                "Accept: application/n-triples",
                "--data-urlencode",
            ])
            .args([
                "query=CONSTRUCT { ?s a act:Run } { ?s a act:Run }",
                &endpoint,
            ])
            .output()
            .unwrap();
        assert!(stdout(&get).contains("<http://actions#Run> ."), "{get:?}");
    } else {
        foreign::left_out("curl against the endpoint", "curl is not installed");
    }
    let Some(python) = foreign::python() else {
        return;
    };
    let output = Command::new(python)
        .arg(crate::support::root().join("tests/foreign/ask.py"))
        .args([&endpoint, RUNS])
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    let printed: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(printed["GET"], printed["POST"]);
    assert!(printed["GET"].as_u64().is_some_and(|rows| rows > 0));
    assert!(
        printed["triples"]
            .as_u64()
            .is_some_and(|triples| triples > 0)
    );
}
