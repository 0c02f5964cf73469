//! Sliding window: frames, features, their least-squares problem, solver and marginalization.
//!
//! [`SlidingWindow::step`](sliding_window::SlidingWindow::step) processes an image and returns a report or a
//! failure; a window always has at least one frame.

pub(crate) mod active_tracks;
pub(crate) mod calibration_columns;
pub(crate) mod column_groups;
pub(crate) mod consistency;
pub(crate) mod drop_or_marginalize_frame;
pub(crate) mod failure;
pub(crate) mod features;
pub(crate) mod frames;
pub(crate) mod information_gain;
pub(crate) mod jacobian_source;
pub(crate) mod joints;
pub(crate) mod keyframes;
pub(crate) mod linearization;
pub(crate) mod marginalization;
pub(crate) mod motion_parts;
pub(crate) mod packed_features;
pub(crate) mod packed_window;
pub(crate) mod problem;
pub(crate) mod reporting;
pub(crate) mod rows;
pub(crate) mod sliding_window;
pub(crate) mod solve;
pub(crate) mod solver;
pub(crate) mod stationary;
pub(crate) mod window_state;
