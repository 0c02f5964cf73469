//! Fuzz target: see `dcvins_fuzz::urdf`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::urdf(bytes));
