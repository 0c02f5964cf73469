//! Integration tests, a module per feature.

mod command_line;
mod evaluate;
mod sample_log;
