#![no_main]

libfuzzer_sys::fuzz_target!(|text: &str| actcheck_fuzz::parse(text));
