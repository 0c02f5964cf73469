//! Fuzz target: see `dcvins_fuzz::ulog`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::ulog(bytes));
