//! The rig of a log: found beside it or attached to it, candidates, cameras by `CameraInfo`, and templates.

mod camera_info;
mod candidates;
mod find;
mod robot_description;
pub mod template;

pub use candidates::{MissingSensors, RigCandidate, is_imu_file_of, is_rig_name, missing_sensors, rig_candidates};
pub use find::RigOfLog;
