//! Flight logs: MCAP in and out as typed events in time order, and the rigs that describe their sensors.
//!
//! Time is nanoseconds since the first message of the log (its header stamp drives; the log time is kept beside it).

pub mod rig;
mod samples;

pub use rig::Rig;
pub use samples::{GrayImage, ImuSample, JointSample, LogWarning, PoseSample, SensorFrame};
