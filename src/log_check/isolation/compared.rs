//! Measurements of a log that are compared.

use std::collections::BTreeMap;

use crate::geometry::RigidTransform;
use crate::log_check::imu::ImuFacts;
use crate::log_check::report::ImageRotation;
use crate::log_check::rotations::data::MeasuredRotation;
use crate::log_check::survey::Survey;
use crate::sensors::Rig;

/// Stamps in nanoseconds since the log began and `world_from_body`, ordered by stamp.
pub(super) type Poses = [(i64, RigidTransform)];

/// Measurements of a log that are compared.
pub(in crate::log_check) struct Compared<'a> {
    pub(in crate::log_check) survey: &'a Survey,
    pub(in crate::log_check) rig: &'a Rig,
    pub(in crate::log_check) imu_facts: &'a ImuFacts,
    /// Ratio of the variance of each joint's readings as measured to the variance of the fit to them.
    pub(in crate::log_check) joint_noise_ratios: Vec<f64>,
    /// Rotations between the images as measured, with their features.
    pub(in crate::log_check) images: &'a [ImageRotation],
    /// The same between first rows, by camera key.
    pub(in crate::log_check) measured: &'a BTreeMap<String, Vec<MeasuredRotation>>,
    /// Poses of the ground truth; may be empty.
    pub(in crate::log_check) poses: &'a Poses,
}
