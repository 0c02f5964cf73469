//! Fuzz target: see `dcvins_fuzz::log`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::log(bytes));
