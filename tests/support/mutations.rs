//! Deterministic mutations of texts, for tests of everything that reads files or messages from
//! others.
//!
//! Each test makes a few cases by default. `ACTCHECK_FUZZ_MINUTES=10` makes as many as fit into ten
//! minutes, and checks the memory that they took. `ACTCHECK_FUZZ_CASE=7` makes only that case.

use std::ops::Range;
use std::time::{Duration, Instant};

/// Longest mutated text. Unit: bytes.
const LONGEST: usize = 256 << 10;
/// A case that takes longer counts as a hang: most take a millisecond.
const HANG: Duration = Duration::from_secs(10);
/// Most memory of a process that made many cases. Unit: kibibytes.
const MOST_MEMORY: u64 = 2 << 20;
/// Numbers at the limits of their types.
const EXTREME: [&str; 16] = [
    "0",
    "-0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "NaN",
    "inf",
    "18446744073709551615",
    "18446744073709551616",
    "4294967295",
    "-9223372036854775808",
    "2147483648",
    "0.1",
    "1e999",
    "00",
];
/// Marks that break most formats.
const ODD: [&str; 12] = [
    "\"", "'", "<", ">", "&", "[", "]", "{", "\n", "\u{0}", "é🦀", "\u{feff}",
];

/// The CPU time of this thread: a case on a busy machine is not a slow one. The time since `begun`
/// on systems without such a file.
fn thread_time(begun: Instant) -> Duration {
    let ticks = std::fs::read_to_string("/proc/thread-self/stat").ok();
    let ticks = ticks.and_then(|text| {
        // The fields after the name, which may contain anything.
        let fields = text.rsplit_once(')')?.1;
        let mut times = fields.split_whitespace().skip(11).take(2);
        let mut next = || times.next()?.parse::<u64>().ok();
        Some(next()? + next()?)
    });
    ticks.map_or_else(
        || begun.elapsed(),
        |ticks| Duration::from_millis(10 * ticks),
    )
}

/// Runs a test on many numbered cases, and prints how many.
///
/// # Panics
/// If a case takes too long, or all together took too much memory.
pub fn cases(name: &str, default: u64, mut case: impl FnMut(Mutations)) {
    let number_of = |variable: &str| {
        std::env::var(variable)
            .ok()
            .and_then(|text| text.parse::<f64>().ok())
    };
    if let Some(number) = number_of("ACTCHECK_FUZZ_CASE") {
        return case(Mutations::new(number as u64));
    }
    let minutes = number_of("ACTCHECK_FUZZ_MINUTES");
    let begun = Instant::now();
    let goes_on = |number: u64| match minutes {
        Some(minutes) => begun.elapsed().as_secs_f64() < 60.0 * minutes,
        None => number < default,
    };
    let mut slowest = (Duration::ZERO, 0);
    let mut number = 0;
    while goes_on(number) {
        let started = thread_time(begun);
        case(Mutations::new(number));
        slowest = slowest.max((thread_time(begun).saturating_sub(started), number));
        assert!(
            slowest.0 < HANG,
            "{name}: case {number} took {:?}",
            slowest.0
        );
        number += 1;
    }
    let memory = peak_memory();
    println!(
        "{name}: {number} cases; the slowest, {}, took {:?}; at most {} MiB",
        slowest.1,
        slowest.0,
        memory >> 10
    );
    assert!(
        minutes.is_none() || memory < MOST_MEMORY,
        "{name}: {memory} KiB"
    );
}

/// The most memory that this process has used. Unit: kibibytes.
fn peak_memory() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse().ok())
        .unwrap_or_default()
}

/// A random sequence of mutations: the same for the same case.
pub struct Mutations(u64);

impl Mutations {
    fn new(case: u64) -> Self {
        Self(case.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x5851_f42d_4c95_7f2d)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ (bits >> 31)
    }

    /// A number below `n`; 0 if `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % (n.max(1) as u64)) as usize
    }

    /// One of several.
    pub fn pick<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        &all[self.below(all.len())]
    }

    /// A text with some mutations. `tokens` are words of its format, and `others` texts from which
    /// parts are taken.
    pub fn text(&mut self, text: &[u8], tokens: &[&str], others: &[&[u8]]) -> Vec<u8> {
        let mut bytes = text.to_vec();
        for _ in 0..=self.below(4) {
            self.mutate(&mut bytes, tokens, others);
            bytes.truncate(LONGEST);
        }
        bytes
    }

    fn mutate(&mut self, bytes: &mut Vec<u8>, tokens: &[&str], others: &[&[u8]]) {
        let at = self.below(bytes.len() + 1);
        let part = at..(at + self.below(60)).min(bytes.len());
        match self.below(11) {
            0 => drop(bytes.drain(part)),
            1 => bytes.truncate(at),
            2 => {
                let copy = bytes[part].to_vec().repeat(1 + self.below(3));
                drop(bytes.splice(at..at, copy));
            }
            3 => {
                let times = *self.pick(&[10, 300, 3_000]);
                let copy = bytes[part.clone()].to_vec().repeat(times);
                drop(bytes.splice(part, copy));
            }
            4 | 5 => {
                let token = self.pick(tokens).as_bytes().to_vec();
                drop(bytes.splice(at..at, token));
            }
            6 => {
                let token = self
                    .pick(tokens)
                    .as_bytes()
                    .repeat(*self.pick(&[2, 100, 2_000]));
                drop(bytes.splice(at..at, token));
            }
            7 => drop(bytes.splice(at..at, self.pick(&ODD).bytes())),
            8 if !others.is_empty() => {
                let other = *self.pick(others);
                let from = self.below(other.len());
                let copy = other[from..(from + self.below(400)).min(other.len())].to_vec();
                drop(bytes.splice(part, copy));
            }
            9 if !bytes.is_empty() => {
                let at = self.below(bytes.len());
                bytes[at] = self.next().to_le_bytes()[0];
            }
            _ => {
                let number = number_after(bytes, at);
                drop(bytes.splice(number, self.pick(&EXTREME).bytes()));
            }
        }
    }
}

/// The place of the first number at or after a position; empty if there is none.
fn number_after(bytes: &[u8], at: usize) -> Range<usize> {
    let is_part = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
    let Some(first) = bytes[at..]
        .iter()
        .position(u8::is_ascii_digit)
        .map(|offset| at + offset)
    else {
        return at..at;
    };
    let length = bytes[first..]
        .iter()
        .position(|byte| !is_part(byte))
        .unwrap_or(bytes.len() - first);
    first..first + length
}
