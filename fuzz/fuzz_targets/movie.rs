//! Fuzz target: see `dcvins_fuzz::movie`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::movie(bytes));
