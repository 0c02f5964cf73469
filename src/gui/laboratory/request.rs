//! Requests of the planned motion to the application.

use std::path::PathBuf;

use crate::simulation::MotionSplines;

/// Request of the panel about the file of a motion.
#[derive(Clone, Debug, PartialEq)]
pub enum MotionRequest {
    Write {
        path: PathBuf,
        motion: MotionSplines,
        /// Names of the joints, in the order of the channels.
        joint_names: Vec<String>,
    },
    Read {
        path: PathBuf,
    },
}
