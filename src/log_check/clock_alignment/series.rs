//! Rotations between images, and the rotations on another clock that they are compared with.

use nalgebra::{UnitQuaternion, Vector3};

use crate::flight_log::joints::attitude::rotation_at;
use crate::geometry::{ns_from_seconds, seconds_from_ns, so3};
use crate::sensors::AngularRates;

/// Minimum number of image rotations.
pub(super) const MIN_ROTATIONS: usize = 40;

/// Offsets closer than this count as one, in seconds.
pub(super) const DISTINCT_S: f64 = 0.25;

/// Rotation between two images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PairRotation {
    /// Stamps of both images.
    pub(super) from_ns: i64,
    pub(super) to_ns: i64,
    /// Rotation vector of `second_from_first`, in radians.
    pub(super) rotation: Vector3<f64>,
    /// Derivative of the rotation by a shift of both times, in rad/s, from the rotations of images around both; zero for
    /// single pairs.
    pub(super) by_shift: Vector3<f64>,
}

impl PairRotation {
    pub(super) fn interval_s(&self) -> f64 {
        seconds_from_ns(self.to_ns - self.from_ns)
    }

    pub(super) fn middle_s(&self) -> f64 {
        0.5 * (seconds_from_ns(self.from_ns) + seconds_from_ns(self.to_ns))
    }
}

/// Rotations on the clock with which the camera's is compared.
#[derive(Clone, Debug, PartialEq)]
pub enum RotationReference {
    Gyroscope(AngularRates),
    /// Orientations `fixed_from_body` at increasing stamps, up to a constant rotation on either side, as from a
    /// gimbal's joints. They are noisier than rotations of images: only rotations over longer times are precise.
    Orientations(Vec<(i64, UnitQuaternion<f64>)>),
}

impl RotationReference {
    /// Orientations with stamps in nanoseconds; those whose stamp does not increase are omitted.
    pub fn from_orientations(orientations: impl IntoIterator<Item = (i64, UnitQuaternion<f64>)>) -> Self {
        let mut samples: Vec<(i64, UnitQuaternion<f64>)> = Vec::new();
        for (stamp_ns, orientation) in orientations {
            if samples.last().is_none_or(|(last, _)| *last < stamp_ns) {
                samples.push((stamp_ns, orientation));
            }
        }
        Self::Orientations(samples)
    }

    pub(super) fn is_noisy(&self) -> bool {
        matches!(self, Self::Orientations(_))
    }

    /// First and last stamp; `None` without samples.
    pub(super) fn range_ns(&self) -> Option<(i64, i64)> {
        match self {
            Self::Gyroscope(rates) => {
                rates.range_s().map(|(from_s, to_s)| (ns_from_seconds(from_s), ns_from_seconds(to_s)))
            }
            Self::Orientations(samples) => Some((samples.first()?.0, samples.last()?.0)),
        }
    }

    /// Rotation vector of `second_from_first` between two times, in radians; `None` outside the samples.
    pub(super) fn rotation(&self, from_ns: i64, to_ns: i64) -> Option<Vector3<f64>> {
        let rotation = match self {
            Self::Gyroscope(rates) => rates.rotation_between(seconds_from_ns(from_ns), seconds_from_ns(to_ns))?,
            Self::Orientations(samples) => {
                let at = |stamp_ns| rotation_at(samples, stamp_ns, i64::MAX);
                at(to_ns)?.inverse() * at(from_ns)?
            }
        };
        Some(so3::log(&rotation))
    }
}
