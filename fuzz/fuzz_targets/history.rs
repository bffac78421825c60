#![no_main]

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use actcheck::campaign::{Clock, Env, RunContext, run_line};
use actcheck::config::Overrides;
use actcheck::data::Choices;
use actcheck::history::RunRecord;
use actcheck_fuzz::histories;

/// Number of runs.
const RUNS: u64 = 4;

static FOLDER: OnceLock<PathBuf> = OnceLock::new();

/// Runs of a shipped configuration.
fn runs() -> Vec<RunRecord> {
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../configs/quick.toml");
    let env = Env::prepare(&config, &Overrides::default()).expect("it is shipped");
    let clock = Clock {
        now: || "2026-01-01T00:00:00Z".to_owned(),
        secs: || 0.0,
    };
    let context = RunContext {
        clock,
        disturb: None,
    };
    let run = |index| run_line(&env, "k", index, Choices::random(7, index), &context);
    (0..RUNS).filter_map(|index| run(index).ok()).collect()
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let folder = FOLDER.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("actcheck-fuzz-{}", std::process::id()));
        histories::made(&folder, &runs());
        folder
    });
    let _ = histories::history(folder, data);
});
