//! Frames on a stream: four bytes of length, one byte of kind, the payload. Waiting ends by a
//! timeout or by the caller's watch function.

use std::io::{ErrorKind, Read, Write};
use std::ops::Range;
use std::os::unix::net::UnixStream;
use std::time::Duration;

use actcheck_actions::ExternalFault;

/// Longest payload sent to a program. Unit: bytes.
pub const TO_PROGRAM_LIMIT: usize = 64 << 20;
/// Longest payload accepted from a program. Unit: bytes.
pub const FROM_PROGRAM_LIMIT: usize = 1 << 20;

/// Kinds of payloads: UTF-8 JSON, and raw bytes.
const JSON: u8 = b'J';
const BYTES: u8 = b'B';
const HEADER: usize = 5;
/// Polling interval while waiting.
const POLL: Duration = Duration::from_millis(20);

/// Frames over a stream, one at a time in each direction.
#[derive(Debug)]
pub struct Wire {
    stream: UnixStream,
    clock_secs: fn() -> f64,
    /// Received bytes, then unused space: [`Wire::receive`] returns the range of the payload.
    incoming: Vec<u8>,
    outgoing: Vec<u8>,
}

/// Time limit of one wait.
struct Patience {
    until_secs: f64,
    clock_secs: fn() -> f64,
    /// Accumulated idle time, in case the clock does not advance. Unit: seconds.
    idle_secs: f64,
    limit_secs: f64,
}

impl Wire {
    /// Frames over a connected stream.
    ///
    /// # Errors
    /// The stream can't be configured.
    pub fn new(stream: UnixStream, clock_secs: fn() -> f64) -> std::io::Result<Self> {
        stream.set_nonblocking(false)?;
        stream.set_read_timeout(Some(POLL))?;
        stream.set_write_timeout(Some(POLL))?;
        Ok(Self {
            stream,
            clock_secs,
            incoming: vec![0; 64 << 10],
            outgoing: Vec::with_capacity(64 << 10),
        })
    }

    /// Sends one message followed by the binary frames it announces.
    ///
    /// # Errors
    /// The message is not read within `limit_secs`, or the connection is closed.
    pub fn send(
        &mut self,
        message: &impl serde::Serialize,
        binaries: &[&[u8]],
        limit_secs: f64,
    ) -> Result<(), ExternalFault> {
        self.outgoing.clear();
        self.outgoing.extend_from_slice(&[0; HEADER]);
        serde_json::to_writer(&mut self.outgoing, message)
            .map_err(|error| broke(format!("the message can't be serialised: {error}")))?;
        let length = self.outgoing.len() - HEADER;
        self.outgoing[..HEADER].copy_from_slice(&header(JSON, length)?);
        for binary in binaries {
            self.outgoing
                .extend_from_slice(&header(BYTES, binary.len())?);
            self.outgoing.extend_from_slice(binary);
        }
        let mut patience = self.patience(limit_secs);
        let mut sent = 0;
        while sent < self.outgoing.len() {
            match self.stream.write(&self.outgoing[sent..]) {
                Ok(0) => return Err(gone()),
                Ok(n_bytes) => sent += n_bytes,
                Err(error) => patience.bear(&error, "read a message")?,
            }
        }
        Ok(())
    }

    /// Receives the next message, a single JSON object, and returns the range of its bytes for
    /// [`Self::payload`]. `watch` is called while nothing arrives.
    ///
    /// # Errors
    /// Nothing arrives within `limit_secs`, the connection is closed, or the received data is not a
    /// valid frame, is too long, or contains more than one frame.
    pub fn receive(
        &mut self,
        limit_secs: f64,
        watch: &mut dyn FnMut() -> Result<(), ExternalFault>,
    ) -> Result<Range<usize>, ExternalFault> {
        let mut patience = self.patience(limit_secs);
        let (mut filled, mut needed) = (0, HEADER);
        while filled < needed {
            match self.stream.read(&mut self.incoming[filled..]) {
                Ok(0) => {
                    watch()?;
                    return Err(gone());
                }
                Ok(n_bytes) => {
                    filled += n_bytes;
                    patience.check("send a whole message")?;
                }
                Err(error) => {
                    watch()?;
                    patience.bear(&error, "answer")?;
                }
            }
            if filled >= HEADER {
                needed = HEADER + payload_length(&self.incoming)?;
                let room = needed.max(self.incoming.len());
                self.incoming.resize(room, 0);
            }
        }
        if filled > needed {
            return Err(out_of_turn());
        }
        Ok(HEADER..needed)
    }

    /// The bytes of the last message.
    pub fn payload(&self, range: Range<usize>) -> &[u8] {
        &self.incoming[range]
    }

    fn patience(&self, limit_secs: f64) -> Patience {
        Patience {
            until_secs: (self.clock_secs)() + limit_secs,
            clock_secs: self.clock_secs,
            idle_secs: 0.0,
            limit_secs,
        }
    }
}

impl Patience {
    /// Continues after a read or write that would block or was interrupted.
    fn bear(&mut self, error: &std::io::Error, what: &str) -> Result<(), ExternalFault> {
        match error.kind() {
            ErrorKind::Interrupted => Ok(()),
            ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                self.idle_secs += POLL.as_secs_f64();
                self.check(what)
            }
            ErrorKind::BrokenPipe | ErrorKind::ConnectionReset => Err(gone()),
            _ => Err(broke(format!("the connection failed: {error}"))),
        }
    }

    fn check(&self, what: &str) -> Result<(), ExternalFault> {
        if self.idle_secs < self.limit_secs && (self.clock_secs)() < self.until_secs {
            return Ok(());
        }
        Err(ExternalFault {
            late: true,
            reason: format!("it did not {what} within {} s", self.limit_secs),
        })
    }
}

fn header(kind: u8, length: usize) -> Result<[u8; HEADER], ExternalFault> {
    let bytes = u32::try_from(length)
        .ok()
        .filter(|_| length <= TO_PROGRAM_LIMIT);
    let [a, b, c, d] = bytes
        .ok_or_else(|| broke(format!("a message of {length} bytes is too long")))
        .map(u32::to_le_bytes)?;
    Ok([a, b, c, d, kind])
}

/// The payload length announced by a header.
fn payload_length(incoming: &[u8]) -> Result<usize, ExternalFault> {
    let [a, b, c, d, kind, ..] = *incoming else {
        return Ok(0);
    };
    if kind != JSON {
        let begun = String::from_utf8_lossy(&incoming[..HEADER])
            .escape_debug()
            .to_string();
        return Err(broke(format!(
            "it sent `{begun}`, which is not a JSON frame: its fifth byte must be `J`"
        )));
    }
    let length = u32::from_le_bytes([a, b, c, d]) as usize;
    if length > FROM_PROGRAM_LIMIT {
        return Err(broke(format!(
            "it sent a message of {length} bytes; the limit is {FROM_PROGRAM_LIMIT}"
        )));
    }
    Ok(length)
}

/// The fault of a message out of turn.
pub fn out_of_turn() -> ExternalFault {
    broke("it sent more than one message at a time: it has to wait for each answer".to_owned())
}

fn broke(reason: String) -> ExternalFault {
    ExternalFault {
        late: false,
        reason,
    }
}

fn gone() -> ExternalFault {
    broke("it closed the connection".to_owned())
}
