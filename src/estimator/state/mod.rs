//! Unknowns of the window (Eq. 7): column layout, static calibration, and the camera poses that depend on them.
//!
//! Values, steps and first estimates; no measurements and no solver.

pub(crate) mod allocation;
pub(crate) mod calibration;
pub(crate) mod calibration_posterior;
pub(crate) mod calibrations;
pub(crate) mod camera_pose;
pub(crate) mod camera_view;
pub(crate) mod columns;
pub(crate) mod earlier_pass;
pub(crate) mod estimate;
pub(crate) mod frame;
pub(crate) mod frame_state;
pub(crate) mod gimbal_imu;
pub(crate) mod gimbal_imu_noise;
pub(crate) mod given_chain;
pub(crate) mod imu_calibration;
pub(crate) mod imu_errors;
pub(crate) mod layout;
pub(crate) mod motion_profile;
pub(crate) mod navigation;
pub mod preintegration;
pub(crate) mod sensor_columns;
