//! Integration tests, a module per feature.

mod check;
mod command_line;
mod degeneracy;
mod evaluate;
#[cfg(feature = "gui")]
mod renderers;
mod sample_log;
mod time_travel;
