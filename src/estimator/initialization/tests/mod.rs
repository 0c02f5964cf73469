//! Tests of the initialization: its geometry, its equations, and whole attempts on made-up flights with known truth.

#![expect(clippy::print_stdout, reason = "figures of many seeds are worth reading with --nocapture")]

mod equations;
mod flight;
mod flights;
mod geometry;
