//! Factors of the window (Eqs. 8–10): whitened residuals with their Jacobians, one file per factor.
//!
//! A factor takes states and measurements and passes its rows to a sink: costs, normal equations, or labelled rows.
//! It does not depend on the window. A further sensor is a file here and a line in
//! `measurements.rs`; a further kind of factor is also a variant of [`FactorKind`] and `FactorLabel`.

pub(crate) mod calibration_prior;
pub(crate) mod costs;
pub(crate) mod dense_equations;
pub(crate) mod encoder;
pub(crate) mod factor;
pub(crate) mod gimbal_imu;
pub mod imu;
pub(crate) mod joint_motion;
pub(crate) mod kind;
pub(crate) mod labelled_rows;
pub(crate) mod marginal_prior;
pub(crate) mod measurements;
pub(crate) mod projected_rows;
pub(crate) mod reprojection;
pub(crate) mod start_prior;
pub(crate) mod zero_velocity;

pub use kind::FactorKind;
