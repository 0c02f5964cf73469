//! Fuzz target: see `dcvins_fuzz::gpmf`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::gpmf(bytes));
