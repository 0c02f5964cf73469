//! Fuzz target: see `dcvins_fuzz::rig`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::rig(bytes));
