//! Common code of several benchmarks.

pub(crate) mod markdown;
pub(crate) mod process;
