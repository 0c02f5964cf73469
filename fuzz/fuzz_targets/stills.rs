//! Fuzz target: see `dcvins_fuzz::stills`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::stills(bytes));
