//! Fuzz target: see `dcvins_fuzz::tlog`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::tlog(bytes));
