//! Cost of the skill protocol: exchanges of a command and an observation per second, in lockstep
//! and without images, from Rust and from Python; and a whole simulated run with an idle controller
//! that sends a command at every control tick, compared with one command for all ticks.
//!
//! Goals: 20,000 exchanges per second from Rust and 3,000 from Python, in CPU time of simulator and
//! program, which `taskset` binds to one core. On two idle cores an exchange costs up to four times
//! as much, because each core sleeps while the other works and has to be woken; `-- two-cores`
//! measures that.
//!
//! The time of an exchange is the time of a run with a command for each tick, less that of the same
//! run with one command for all ticks, with the cheapest physics. The Python package is measured if
//! its only dependency, numpy, is installed, and compared with Python using only sockets and JSON.

#[path = "../clients/rust/link.rs"]
mod link;
mod support;

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use actcheck::base::Source;
use actcheck::campaign::{Clock, Env, RunContext, run_line};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use serde_json::json;
use support::thread_secs;

/// Ticks of a run.
const TICKS: u32 = 6_000;
/// Number of runs; the best counts.
const REPEATS: usize = 3;

/// Exit code of `taskset` if it can't bind to that core. This program exits with 0, or 101 after a
/// panic.
const CANNOT_BIND: i32 = 1;

/// Cheap physics: an arm in front of a table with one glass, one step per tick.
const CHEAP: &str = "
[robot]
profile = \"fixed_arm\"
[physics]
steps_per_second = 60
iterations = 1
";

fn main() {
    if std::env::args().nth(1).as_deref() == Some("client") {
        client();
        return;
    }
    let itself = std::env::current_exe().expect("a program has a file");
    let wanted = std::env::args()
        .skip(1)
        .find(|argument| !argument.starts_with('-'));
    if wanted.is_none() {
        match Command::new("taskset")
            .args(["-c", "0"])
            .arg(&itself)
            .arg("bound")
            .status()
        {
            Ok(status) if status.code() != Some(CANNOT_BIND) => {
                std::process::exit(status.code().unwrap_or(1))
            }
            _ => {
                println!("not bound to one core: `taskset` is missing, or core 0 is not available")
            }
        }
    }
    let programs = [
        ("Rust", format!("{} client", itself.display()), 20_000.0),
        (
            "Python, sockets and JSON only",
            format!("python3 {}", file("benches/protocol_plain.py")),
            3_000.0,
        ),
        (
            "Python package",
            format!("python3 {}", file("benches/protocol_package.py")),
            3_000.0,
        ),
    ];
    let mut first = None;
    for (name, launcher, aim) in programs {
        let Some(each) = secs(&launcher, CHEAP, 1) else {
            println!("{name}: not measured");
            continue;
        };
        let at_once = secs(&launcher, CHEAP, TICKS).unwrap_or_default();
        let rate = f64::from(TICKS) / (each - at_once);
        let over = first.get_or_insert(rate);
        println!(
            "{name}: {rate:.0} exchanges per second, {:.1} × the goal of {aim}; {:.2} × the rate of Rust",
            rate / aim,
            rate / *over
        );
        let (whole, ticks) = (secs(&launcher, "", 1), secs(&launcher, "", TICKS));
        if let (Some(whole), Some(ticks)) = (whole, ticks) {
            let simulated = f64::from(TICKS) / 60.0;
            println!(
                "  a command each tick in a typical scene: {:.0} × real time; physics only {:.0} ×; ratio {:.2}",
                simulated / whole,
                simulated / ticks,
                whole / ticks
            );
        }
    }
}

fn file(path: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join(path)
        .display()
        .to_string()
}

/// The best CPU time of a run, simulator and program together; `None` if the program fails.
fn secs(launcher: &str, more: &str, ticks: u32) -> Option<f64> {
    let text = format!(
        "tests = [[\"Pick\"]]\ntest_count = 1\ntest_launcher = {launcher:?}\n\
         [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\nmodel_list = [\"glass\"]\n\
         [budget]\naction_secs = 3600\n[skill]\nenv = {{ TICKS = \"{ticks}\", TOTAL = \"{TICKS}\" }}\n{more}"
    );
    let env = Env::prepare_text(
        Source::new("bench", text),
        Path::new("."),
        &Overrides::default(),
    );
    let env = env.unwrap_or_else(|faults| panic!("{faults}"));
    let clock = Clock {
        now: String::new,
        secs: now,
    };
    let times = (0..REPEATS).map(|_| {
        let context = RunContext {
            clock,
            disturb: None,
        };
        let began = thread_secs();
        let run = run_line(&env, "bench", 0, Choices::recorded(&[]), &context)
            .expect("the nominal scene settles");
        let action = &run.trace.actions[0];
        let simulator = thread_secs() - began;
        action
            .report
            .as_ref()
            .and_then(|report| report.message.parse::<f64>().ok())
            .map(|program| program + simulator)
    });
    times
        .collect::<Option<Vec<f64>>>()?
        .into_iter()
        .min_by(f64::total_cmp)
}

fn now() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}

/// An idle controller that sends commands without targets and reports its CPU time.
fn client() {
    let number = |name: &str| {
        std::env::var(name)
            .ok()
            .and_then(|text| text.parse::<u32>().ok())
            .expect("it is set")
    };
    let (ticks, total) = (number("TICKS"), number("TOTAL"));
    let served = link::serve(&["Pick"], |link, _| {
        let began = thread_secs();
        for _ in 0..total / ticks {
            if link
                .ask(&json!({ "type": "command", "ticks": ticks }))?
                .is_none()
            {
                return Ok(None);
            }
        }
        let message = (thread_secs() - began).to_string();
        Ok(Some(
            json!({ "type": "end", "succeeded": true, "message": message }),
        ))
    });
    served.expect("the simulator is there");
}
