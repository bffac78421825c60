//! What does the skill protocol cost? Exchanges of a command and an observation in a second, in lockstep and without
//! images, from Rust and from Python; and a whole simulated run with a controller that does nothing, at every control
//! tick, beside the same ticks asked for at once.
//!
//! Aims: 20,000 exchanges a second from Rust and 3,000 from Python, simulator and program sharing one core, to which
//! `taskset` binds them: what counts is the time of both on the processor. On two cores that have nothing else to do an
//! exchange costs up to four times as much, since each core falls asleep while the other one works, and has to be
//! woken; `-- two-cores` measures that.
//!
//! What an exchange takes is that time of a run in which each tick is a command, less that of the same run in which one
//! command asks for all, in the cheapest physics there is. Python's own package is measured where its one dependency,
//! numpy, is installed; beside it stands what Python does with sockets and JSON alone.

#[path = "../clients/rust/link.rs"]
mod link;
mod support;

use std::path::Path;
use std::process::Command;
use std::time::Instant;

use actcheck::base::{Choices, Source};
use actcheck::campaign::{Clock, Env, Manner, run_line};
use actcheck::config::Overrides;
use serde_json::json;
use support::thread_secs;

/// Ticks of a run.
const TICKS: u32 = 6_000;
/// The best of so many runs counts.
const REPEATS: usize = 3;

/// What `taskset` ends with where it may not bind to that core; ours ends with 0, or 101 after a panic.
const CANNOT_BIND: i32 = 1;

/// Physics that costs little: an arm before a table with one glass, a step for each tick.
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
    let wanted = std::env::args().skip(1).find(|argument| !argument.starts_with('-'));
    if wanted.is_none() {
        match Command::new("taskset").args(["-c", "0"]).arg(&itself).arg("bound").status() {
            Ok(status) if status.code() != Some(CANNOT_BIND) => std::process::exit(status.code().unwrap_or(1)),
            _ => println!("not bound to one core: there is no `taskset`, or no core 0 for it"),
        }
    }
    let programs = [
        ("Rust", format!("{} client", itself.display()), 20_000.0),
        ("Python, sockets and JSON alone", format!("python3 {}", file("benches/protocol_plain.py")), 3_000.0),
        ("Python, the package", format!("python3 {}", file("benches/protocol_package.py")), 3_000.0),
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
            "{name}: {rate:.0} exchanges a second, {:.1} × the aim of {aim}; over Rust {:.2}",
            rate / aim,
            rate / *over
        );
        let (whole, ticks) = (secs(&launcher, "", 1), secs(&launcher, "", TICKS));
        if let (Some(whole), Some(ticks)) = (whole, ticks) {
            let simulated = f64::from(TICKS) / 60.0;
            println!(
                "  a command each tick in a usual scene: {:.0} × real time; physics alone {:.0} ×; ratio {:.2}",
                simulated / whole,
                simulated / ticks,
                whole / ticks
            );
        }
    }
}

fn file(path: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path).display().to_string()
}

/// The time on the processor of a run and of the program's part in it, at best; nothing if the program can't.
fn secs(launcher: &str, more: &str, ticks: u32) -> Option<f64> {
    let text = format!(
        "tests = [[\"Pick\"]]\ntest_count = 1\ntest_launcher = {launcher:?}\n\
         [objectSurface]\nobject_surfaces = [\"coffee_table\"]\n[pickObject]\nmodel_list = [\"glass\"]\n\
         [budget]\naction_secs = 3600\n[skill]\nenv = {{ TICKS = \"{ticks}\", TOTAL = \"{TICKS}\" }}\n{more}"
    );
    let env = Env::prepare_text(Source::new("bench", text), Path::new("."), &Overrides::default());
    let env = env.unwrap_or_else(|faults| panic!("{faults}"));
    let clock = Clock { now: String::new, secs: now };
    let times = (0..REPEATS).map(|_| {
        let manner = Manner { clock, disturb: None };
        let began = thread_secs();
        let run = run_line(&env, "bench", 0, Choices::recorded(&[]), &manner).expect("the nominal scene stands");
        let action = &run.trace.actions[0];
        let simulator = thread_secs() - began;
        action.report.as_ref().and_then(|report| report.message.parse::<f64>().ok()).map(|program| program + simulator)
    });
    times.collect::<Option<Vec<f64>>>()?.into_iter().min_by(f64::total_cmp)
}

fn now() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}

/// Does nothing, tick by tick; tells how long that took on the processor.
fn client() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse::<u32>().ok()).expect("it is set");
    let (ticks, total) = (number("TICKS"), number("TOTAL"));
    let served = link::serve(&["Pick"], |link, _| {
        let began = thread_secs();
        for _ in 0..total / ticks {
            if link.ask(&json!({ "type": "command", "ticks": ticks }))?.is_none() {
                return Ok(None);
            }
        }
        let message = (thread_secs() - began).to_string();
        Ok(Some(json!({ "type": "end", "succeeded": true, "message": message })))
    });
    served.expect("the simulator is there");
}
