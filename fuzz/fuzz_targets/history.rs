#![no_main]

use std::path::PathBuf;
use std::sync::OnceLock;

use actcheck_fuzz::histories;

static FOLDER: OnceLock<PathBuf> = OnceLock::new();

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let folder = FOLDER.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("actcheck-fuzz-{}", std::process::id()));
        histories::made(&folder);
        folder
    });
    let _ = histories::history(folder, data);
});
