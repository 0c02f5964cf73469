//! Tests of the initialization: geometry, equations, and complete attempts on synthetic flights with ground truth.

#![expect(clippy::print_stdout, reason = "figures of many seeds are worth reading with --nocapture")]

mod equations;
mod flight;
mod flights;
mod geometry;
