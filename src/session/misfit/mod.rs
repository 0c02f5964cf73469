//! Residuals of a run by sensor, and their agreement with their noise.
//!
//! - `pixel_histogram`: reprojection residuals by length.
//! - `step_misfit`: residuals of steps, on one scale for all trials of a diagnosis.
//! - `agreement`: limits within which residuals agree with their noise, and the step at which that ends.

pub(in crate::session) mod agreement;
mod pixel_histogram;
mod step_misfit;

pub use agreement::AgreementValue;
pub(in crate::session) use step_misfit::{Misfit, Scale, StepMisfit};
