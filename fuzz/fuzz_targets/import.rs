#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    actcheck_fuzz::imports::import(data);
});
