//! Trajectories of other programs and positions of receivers: files in the formats of TUM and EuRoC, and topics of a log.

mod file;
pub(crate) mod geodesy;
#[cfg(test)]
mod tests;
mod topic;

use nalgebra::{UnitQuaternion, Vector3};

pub use file::{BATCH_REFERENCE, is_batch_reference, read_trajectory_file};

/// Pose of a recorded trajectory, or a position alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RecordedPose {
    /// Stamp in nanoseconds since the Unix epoch, or since the zero time of the file.
    pub stamp_ns: i64,
    /// Position in the world of the trajectory, in metres.
    pub position_m: Vector3<f64>,
    /// `world_from_body`, `None` for a position alone.
    pub rotation: Option<UnitQuaternion<f64>>,
}
