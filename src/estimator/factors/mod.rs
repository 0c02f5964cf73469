//! Factors of the window (Eqs. 8–10): whitened residuals with their Jacobians.
//!
//! A factor takes states and measurements and returns whitened residuals and derivatives; it does not depend on
//! the window.

pub mod imu;
pub(crate) mod joint_motion;
mod kind;
pub(crate) mod marginal_prior;
pub(crate) mod packed_prior;
pub(crate) mod projected_rows;
pub(crate) mod reprojection;
pub(crate) mod start_prior;
pub(crate) mod zero_velocity;

pub use kind::FactorKind;
