//! Fuzz target: see `dcvins_fuzz::video`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::video(bytes));
