//! What several benches need.

pub(crate) mod markdown;
pub(crate) mod process;
