//! Fuzz target: see `dcvins_fuzz::bag`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::bag(bytes));
