//! Residuals of the window (Eqs. 8–10) with their Jacobians: reprojection, IMU preintegration, zero velocity, priors.
//!
//! A factor takes states and measurements and returns whitened residuals and derivatives; it does not depend on
//! the window.

pub mod imu_factor;
pub(crate) mod packed_prior;
pub mod preintegration;
pub(crate) mod prior;
pub(crate) mod projection;
pub(crate) mod visual;
pub(crate) mod zero_velocity;
