//! IMU samples of a log: measured ones without what no sensor measured, and those of two topics joined.

pub(crate) mod filter;
pub(crate) mod merge;
