//! The skill protocol in Rust: a socket, JSON frames, and the main loop of a program. See
//! `clients/PROTOCOL.md`.

use std::io::{Error, ErrorKind, Read, Result, Write};
use std::os::unix::net::UnixStream;

use serde_json::{Value, json};

/// The connection to the simulator.
pub struct Link {
    stream: UnixStream,
    incoming: Vec<u8>,
    outgoing: Vec<u8>,
    /// The simulator's `hello` message, with the description of the robot.
    pub hello: Value,
    /// Seed for all randomness in this run.
    pub seed: u64,
}

/// Introduces the program and performs actions until the simulator sends `bye`. `perform` returns
/// the action's `end` message, or `None` if the action was aborted.
///
/// # Errors
/// The simulator can't be reached, or violates the protocol.
pub fn serve(
    actions: &[&str],
    mut perform: impl FnMut(&mut Link, &Value) -> Result<Option<Value>>,
) -> Result<()> {
    let address = std::env::var("ACTCHECK_ADDRESS")
        .map_err(|_| odd("ACTCHECK_ADDRESS is not set: start this with actcheck"))?;
    let path = address
        .strip_prefix("unix:")
        .ok_or_else(|| odd("the address is not a Unix socket"))?;
    let stream = UnixStream::connect(path)?;
    let mut link = Link {
        stream,
        incoming: Vec::new(),
        outgoing: Vec::new(),
        hello: Value::Null,
        seed: 0,
    };
    link.hello = link.receive()?;
    link.send(
        &json!({ "type": "hello", "protocol": 1, "name": "a Rust program", "actions": actions }),
    )?;
    loop {
        let message = link.receive()?;
        match message["type"].as_str() {
            Some("reset") => {
                link.seed = message["seed"].as_u64().unwrap_or_default();
                link.send(&json!({ "type": "ready" }))?;
            }
            Some("begin") => {
                let end = perform(&mut link, &message)?;
                link.send(&end.unwrap_or_else(|| json!({ "type": "aborted" })))?;
            }
            Some("bye") => return Ok(()),
            _ => return Err(odd(&format!("unexpected: {message}"))),
        }
    }
}

impl Link {
    /// Sends a message and reads the answer. Returns `None` if the action was aborted instead.
    ///
    /// # Errors
    /// The connection is closed.
    pub fn ask(&mut self, message: &Value) -> Result<Option<Value>> {
        self.send(message)?;
        let answer = self.receive()?;
        Ok(Some(answer).filter(|answer| answer["type"] != "abort"))
    }

    fn send(&mut self, message: &Value) -> Result<()> {
        self.outgoing.clear();
        self.outgoing.extend_from_slice(b"\0\0\0\0J");
        serde_json::to_writer(&mut self.outgoing, message)?;
        let length =
            u32::try_from(self.outgoing.len() - 5).map_err(|_| odd("the message is too long"))?;
        self.outgoing[..4].copy_from_slice(&length.to_le_bytes());
        self.stream.write_all(&self.outgoing)
    }

    fn receive(&mut self) -> Result<Value> {
        let mut header = [0; 5];
        self.stream.read_exact(&mut header)?;
        let [a, b, c, d, kind] = header;
        if kind != b'J' {
            return Err(odd("received a binary frame without a request for one"));
        }
        self.incoming
            .resize(u32::from_le_bytes([a, b, c, d]) as usize, 0);
        self.stream.read_exact(&mut self.incoming)?;
        Ok(serde_json::from_slice(&self.incoming)?)
    }
}

fn odd(what: &str) -> Error {
    Error::new(ErrorKind::InvalidData, what.to_owned())
}
