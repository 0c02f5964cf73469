//! Tests of the offline calibration.

mod algebra;
mod derivatives;
mod fixture;
mod flights;
mod loops;
