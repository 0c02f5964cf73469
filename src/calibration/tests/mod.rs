//! Tests of the offline calibration.

mod algebra;
mod derivatives;
pub(super) mod fixture;
mod flights;
mod loops;
pub(super) mod random;
