//! `actcheck serve` under load: many clients, long connections, and queries that need much memory.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;

use serde_json::Value;

use crate::support::server::Server;

const RUNS: &str = "SELECT ?run ?index { ?run a act:Run ; act:index ?index } ORDER BY ?index";

/// Reads one response of a connection that stays open.
fn next_response(stream: &mut BufReader<TcpStream>) -> (u16, String) {
    let (mut status, mut length) = (0, 0);
    loop {
        let mut line = String::new();
        assert!(
            stream.read_line(&mut line).unwrap() > 0,
            "the connection was closed"
        );
        if let Some(code) = line.strip_prefix("HTTP/1.1 ") {
            status = code[..3].parse().unwrap();
        }
        if let Some(number) = line.to_lowercase().strip_prefix("content-length:") {
            length = number.trim().parse().unwrap();
        }
        if line == "\r\n" {
            break;
        }
    }
    let mut body = vec![0; length];
    stream.read_exact(&mut body).unwrap();
    (status, String::from_utf8(body).unwrap())
}

#[test]
fn connections_stay_open_and_memory_stays_flat() {
    let server = Server::alone(&[]);
    let mut stream = BufReader::new(server.connect());
    let ask = |stream: &mut BufReader<TcpStream>, requests: u32| {
        for _ in 0..requests {
            let get = "GET /sparql?query=ASK%20%7B%3Frun%20a%20act%3ARun%7D HTTP/1.1\r\nHost: localhost\r\n\r\n";
            stream.get_mut().write_all(get.as_bytes()).unwrap();
            let (status, body) = next_response(stream);
            assert!(status == 200 && body.contains("true"), "{status}: {body}");
        }
    };
    ask(&mut stream, 500);
    let before = server.memory_mb();
    ask(&mut stream, 2000);
    let after = server.memory_mb();
    assert!(after <= before + 20, "{before} MB, then {after} MB");
    let health: Value = serde_json::from_str(&server.get("/health").body).unwrap();
    assert_eq!(
        (health["served"].as_u64(), health["refused"].as_u64()),
        (Some(2500), Some(0)),
        "{health}"
    );
    assert!(
        health["p99_ms"].as_f64().is_some_and(|ms| ms > 0.0),
        "{health}"
    );
}

#[test]
fn queries_that_need_much_memory_end_without_harm_to_the_server() {
    let server = Server::alone(&["--limits", "memory=200MB,processes=2"]);
    // Doubles a string 36 times: 64 GB.
    let doubled: String = (0..36)
        .map(|n| format!("BIND(CONCAT(?x{n}, ?x{n}) AS ?x{}) ", n + 1))
        .collect();
    let text = format!("SELECT (STRLEN(?x36) AS ?n) {{ BIND('0123456789' AS ?x0) {doubled} }}");
    let rows = "SELECT * { ?a ?b ?c . ?d ?e ?f . ?g ?h ?i } ORDER BY ?i ?f";
    assert_eq!(server.ask(RUNS, "").status, 200);
    let before = server.memory_mb();
    std::thread::scope(|scope| {
        let bombs: Vec<_> = (0..2)
            .map(|_| scope.spawn(|| server.ask(&text, "*/*")))
            .collect();
        let large: Vec<_> = (0..2)
            .map(|_| scope.spawn(|| server.ask(rows, "*/*")))
            .collect();
        // Light queries are answered meanwhile.
        assert_eq!(server.ask(RUNS, "").status, 200);
        for reply in bombs.into_iter().map(|bomb| bomb.join().unwrap()) {
            assert!(
                reply.status == 403 && reply.body.contains("texts that are too long"),
                "{}",
                reply.body
            );
        }
        for reply in large.into_iter().map(|large| large.join().unwrap()) {
            // On a slow machine, the time limit is reached first.
            assert!(
                [500, 504].contains(&reply.status) && reply.body.contains("took"),
                "{}",
                reply.body
            );
        }
    });
    let after = server.memory_mb();
    assert!(after <= before + 50, "{before} MB, then {after} MB");
    assert_eq!(server.ask(RUNS, "").status, 200);
}

#[test]
fn none_of_many_clients_is_refused() {
    let server = Server::alone(&["--limits", "processes=2"]);
    // Not light: it is answered by a process.
    let heavy = "SELECT (CONCAT('a', STR(?run)) AS ?name) { ?run a act:Run } LIMIT 1";
    std::thread::scope(|scope| {
        let clients: Vec<_> = (0..64)
            .map(|number| {
                let server = &server;
                scope.spawn(move || {
                    server.ask(if number % 2 == 0 { RUNS } else { heavy }, "text/csv")
                })
            })
            .collect();
        for client in clients {
            let reply = client.join().unwrap();
            assert!(
                reply.status == 200 && reply.body.contains("/run/"),
                "{reply:?}"
            );
        }
    });
}

#[test]
fn clients_that_never_finish_a_request_do_not_delay_others() {
    let server = Server::alone(&[]);
    let slow = [
        "GET /sparql?query=ASK%7B%7D HTTP/1.1\r\nHost: localhost\r\nX-",
        "POST /sparql HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/sparql-query\r\nContent-Length: 99\r\n\r\nA",
        "",
    ];
    let open: Vec<TcpStream> = (0..300)
        .map(|number| {
            let mut stream = server.connect();
            stream.write_all(slow[number % 3].as_bytes()).unwrap();
            stream
        })
        .collect();
    for _ in 0..20 {
        assert_eq!(server.ask(RUNS, "").status, 200);
    }
    let health: Value = serde_json::from_str(&server.get("/health").body).unwrap();
    // Had a query waited for one of these clients, it would have taken until the client is
    // disconnected.
    assert!(
        health["p99_ms"].as_f64().is_some_and(|ms| ms < 9_000.0),
        "{health}"
    );
    drop(open);
}

#[test]
fn long_queries_can_be_sent_by_get() {
    let server = Server::alone(&[]);
    let padded = |length: usize| format!("/sparql?query=ASK%7B%7D%23{}", "x".repeat(length));
    // A request line of 64 KiB.
    assert_eq!(
        server
            .get(&padded(
                65_536 - "GET /sparql?query=ASK%7B%7D%23 HTTP/1.1\r\n".len()
            ))
            .status,
        200
    );
    assert_eq!(server.get(&padded(100_000)).status, 414);
}
