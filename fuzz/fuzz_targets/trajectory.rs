//! Fuzz target: see `dcvins_fuzz::trajectory`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::trajectory(bytes));
