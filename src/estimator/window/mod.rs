//! The sliding window: frames, features and the policy of what enters and leaves.
//!
//! [`SlidingWindow::step`](sliding_window::SlidingWindow::step) processes an image and returns a report or a
//! failure; a window always has at least one frame.

pub(crate) mod column_groups;
pub(crate) mod consistency;
pub(crate) mod drop_or_marginalize_frame;
pub(crate) mod failure;
pub(crate) mod features;
pub(crate) mod frames;
mod gimbal_imu;
pub(crate) mod jacobian_source;
pub(crate) mod joints;
pub(crate) mod keyframes;
pub(crate) mod loss_scale;
pub(crate) mod packed_window;
pub(crate) mod reporting;
pub(crate) mod setup;
pub(crate) mod sliding_window;
pub(crate) mod solve;
pub(crate) mod stationary;
pub(crate) mod window_state;
