//! Fuzz target: see `dcvins_fuzz::condition`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::condition(bytes));
