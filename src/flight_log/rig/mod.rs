//! Rig files: this program's schema and Kalibr's, read and written.

pub(crate) mod attitude;
mod camera_facts;
pub(crate) mod camera_info;
mod candidates;
mod document;
mod fields;
mod find;
mod indentation;
mod kalibr;
mod keys;
mod link;
mod mask;
mod read;
mod save;
mod sensor;
pub mod template;
#[cfg(test)]
mod tests;
mod write;

pub use candidates::{MissingSensors, RigCandidate, is_imu_file_of, is_rig_name, missing_sensors, rig_candidates};
