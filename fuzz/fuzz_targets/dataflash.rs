//! Fuzz target: see `dcvins_fuzz::dataflash`.

#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| dcvins_fuzz::dataflash(bytes));
