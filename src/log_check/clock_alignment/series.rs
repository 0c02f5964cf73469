//! Orientations on one clock and rotations between images.

use nalgebra::{UnitQuaternion, Vector3};

use crate::flight_log::attitude::rotation_at;
use crate::geometry::{seconds_from_ns, so3};

/// Minimum number of image rotations.
pub(super) const MIN_ROTATIONS: usize = 40;

/// Offsets closer than this are one.
pub(super) const DISTINCT_S: f64 = 0.25;

/// The rotation between two images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Measured {
    /// Stamps of both images.
    pub(super) from_ns: i64,
    pub(super) to_ns: i64,
    /// Rotation vector of `second_from_first`, in radians.
    pub(super) rotation: Vector3<f64>,
    /// Its derivative when both times are shifted, in rad/s, from the rotations of images around both; zero for single pairs.
    pub(super) by_shift: Vector3<f64>,
}

impl Measured {
    pub(super) fn interval_s(&self) -> f64 {
        seconds_from_ns(self.to_ns - self.from_ns)
    }

    pub(super) fn middle_s(&self) -> f64 {
        0.5 * (seconds_from_ns(self.from_ns) + seconds_from_ns(self.to_ns))
    }
}

/// Orientations on one clock, up to a constant rotation on either side: `fixed_from_body` at increasing stamps.
///
/// From a gyroscope they are its integral; from a gimbal, its attitudes relative to the earth.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OrientationSeries {
    pub(super) samples: Vec<(i64, UnitQuaternion<f64>)>,
    /// Whether its noise from sample to sample exceeds that of the images, as that of measured joint angles does.
    pub(super) is_noisy: bool,
}

impl OrientationSeries {
    /// Series of orientations with stamps in nanoseconds; samples whose stamp does not increase are omitted.
    pub fn from_orientations(orientations: impl IntoIterator<Item = (i64, UnitQuaternion<f64>)>) -> Self {
        let mut samples: Vec<(i64, UnitQuaternion<f64>)> = Vec::new();
        for (stamp_ns, orientation) in orientations {
            if samples.last().is_none_or(|(last, _)| *last < stamp_ns) {
                samples.push((stamp_ns, orientation));
            }
        }
        Self { samples, is_noisy: false }
    }

    /// Marks the series as noisy: only rotations over longer times are precise.
    #[must_use]
    pub fn with_noise(self) -> Self {
        Self { is_noisy: true, ..self }
    }

    /// Integral of angular velocities in rad/s with stamps in nanoseconds.
    pub fn from_angular_velocities(rates: impl IntoIterator<Item = (i64, Vector3<f64>)>) -> Self {
        let mut orientation = UnitQuaternion::identity();
        let mut previous: Option<(i64, Vector3<f64>)> = None;
        let integrated = rates.into_iter().filter_map(move |(stamp_ns, rate)| {
            if let Some((before_ns, before)) = previous {
                if stamp_ns <= before_ns {
                    return None;
                }
                orientation *= so3::exp(&((before + rate) * (0.5 * seconds_from_ns(stamp_ns - before_ns))));
            }
            previous = Some((stamp_ns, rate));
            Some((stamp_ns, orientation))
        });
        Self { samples: integrated.collect(), is_noisy: false }
    }

    /// First and last stamp, `None` without samples.
    pub(super) fn range_ns(&self) -> Option<(i64, i64)> {
        Some((self.samples.first()?.0, self.samples.last()?.0))
    }

    /// Interpolated orientation, `None` outside of the series.
    pub(super) fn at(&self, stamp_ns: i64) -> Option<UnitQuaternion<f64>> {
        rotation_at(&self.samples, stamp_ns, i64::MAX)
    }

    /// Rotation vector of `second_from_first` between two times, in radians.
    pub(super) fn rotation(&self, from_ns: i64, to_ns: i64) -> Option<Vector3<f64>> {
        Some(so3::log(&(self.at(to_ns)?.inverse() * self.at(from_ns)?)))
    }
}
