//! Fuzz target: see `dcvins_fuzz::euroc`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::euroc(bytes));
