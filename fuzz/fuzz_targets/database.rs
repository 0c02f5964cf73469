//! Fuzz target: see `dcvins_fuzz::database`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::database(bytes));
