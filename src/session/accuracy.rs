//! Absolute and relative trajectory error, as evo computes them.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde::{Serialize, Serializer};

use crate::calibration::Statistics;
use crate::geometry::{RigidTransform, so3, vertical_angle, wrap_angle};

/// A stamped pose. Stamps are in seconds, on a clock that both trajectories share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StampedPose {
    pub stamp_s: f64,
    /// Pose `world_from_body` at the stamp.
    pub pose: RigidTransform,
}

/// Alignment of the estimate with the reference before positions are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TrajectoryAlignment {
    /// No alignment: both trajectories are already in one world.
    None,
    /// Rotation about the vertical and a translation: the gauge freedom of visual-inertial odometry.
    YawPosition,
    /// Any rotation and a translation (`evo_ape --align`).
    Rigid,
    /// Any rotation, a translation and a scale (`evo_ape --align --correct_scale`).
    Similarity,
}

impl TrajectoryAlignment {
    /// Name in files and messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::YawPosition => "yaw+position",
            Self::Rigid => "se3",
            Self::Similarity => "sim3",
        }
    }
}

impl Serialize for TrajectoryAlignment {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// Statistics of a series of errors, named as in evo.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ErrorStatistics {
    /// Number of errors in the sums.
    #[serde(skip)]
    pub count: usize,
    pub rmse: f64,
    pub mean: f64,
    /// Middle of the sorted errors; of an even number, the mean of the middle two.
    pub median: f64,
    /// Standard deviation of the population (numpy's default).
    pub std: f64,
    pub min: f64,
    pub max: f64,
}

impl ErrorStatistics {
    /// Statistics of the errors, `None` if there are none.
    pub fn of(errors: &[f64]) -> Option<Self> {
        let Statistics { count, mean, std, rms, .. } = Statistics::of(errors)?;
        let mut sorted = errors.to_vec();
        sorted.sort_by(f64::total_cmp);
        let median = if count % 2 == 1 { sorted[count / 2] } else { 0.5 * (sorted[count / 2 - 1] + sorted[count / 2]) };
        Some(Self { count, rmse: rms, mean, median, std, min: sorted[0], max: sorted[count - 1] })
    }
}

/// Similarity transform from estimate to reference: `reference ≈ scale · rotation · estimate + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AlignmentTransform {
    /// Rigid part of `reference_from_estimate`.
    pub rigid: RigidTransform,
    /// Scale factor of the estimate's lengths, without unit.
    pub scale: f64,
}

impl AlignmentTransform {
    /// Pose of the estimate in the frame of the reference: `reference_from_body`.
    pub fn apply(&self, pose: &RigidTransform) -> RigidTransform {
        let position = self.rigid.rotation * pose.translation_m * self.scale + self.rigid.translation_m;
        RigidTransform::new(self.rigid.rotation * pose.rotation, position)
    }
}

/// Running sums over pairs of positions, from which [`AlignmentSums::solve`] computes the alignment of the pairs so
/// far.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AlignmentSums {
    count: usize,
    estimate: Vector3<f64>,
    reference: Vector3<f64>,
    reference_by_estimate: Matrix3<f64>,
    estimate_square: f64,
}

impl AlignmentSums {
    /// Adds one pair of positions.
    pub fn add(&mut self, estimate_m: &Vector3<f64>, reference_m: &Vector3<f64>) {
        self.count += 1;
        self.estimate += estimate_m;
        self.reference += reference_m;
        self.reference_by_estimate += reference_m * estimate_m.transpose();
        self.estimate_square += estimate_m.norm_squared();
    }

    /// The least-squares alignment (Umeyama 1991; about the vertical only for [`TrajectoryAlignment::YawPosition`]). Returns
    /// `None` with fewer than three pairs, or when the positions do not constrain it.
    pub fn solve(&self, alignment: TrajectoryAlignment) -> Option<AlignmentTransform> {
        if alignment == TrajectoryAlignment::None {
            return Some(AlignmentTransform { rigid: RigidTransform::identity(), scale: 1.0 });
        }
        if self.count < 3 {
            return None;
        }
        let count = self.count as f64;
        let mean_estimate = self.estimate / count;
        let mean_reference = self.reference / count;
        let covariance = self.reference_by_estimate / count - mean_reference * mean_estimate.transpose();
        let estimate_variance = self.estimate_square / count - mean_estimate.norm_squared();
        let mut scale = 1.0;
        let rotation = if alignment == TrajectoryAlignment::YawPosition {
            let sine = covariance[(1, 0)] - covariance[(0, 1)];
            let cosine = covariance[(0, 0)] + covariance[(1, 1)];
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), sine.atan2(cosine))
        } else {
            let svd = covariance.svd(true, true);
            let (u, v_t) = (svd.u?, svd.v_t?);
            if svd.singular_values[1] <= 1e-12 * svd.singular_values[0].max(f64::MIN_POSITIVE) {
                return None;
            }
            let mut sign = Vector3::new(1.0, 1.0, 1.0);
            if u.determinant() * v_t.determinant() < 0.0 {
                sign.z = -1.0;
            }
            if alignment == TrajectoryAlignment::Similarity {
                scale = svd.singular_values.dot(&sign) / estimate_variance;
            }
            let matrix = u * Matrix3::from_diagonal(&sign) * v_t;
            UnitQuaternion::from_rotation_matrix(&nalgebra::Rotation3::from_matrix_unchecked(matrix))
        };
        let translation = mean_reference - rotation * mean_estimate * scale;
        let finite = translation.iter().all(|entry| entry.is_finite()) && scale.is_finite();
        finite.then(|| AlignmentTransform { rigid: RigidTransform::new(rotation, translation), scale })
    }
}

/// Pairs of poses with the same stamp, estimate first.
///
/// As in evo, each stamp of the shorter trajectory is paired with the nearest stamp of the longer one, if the two
/// differ by at most `max_difference_s`.
pub fn associate(
    estimate: &[StampedPose],
    reference: &[StampedPose],
    max_difference_s: f64,
) -> Vec<(StampedPose, StampedPose)> {
    let swap = estimate.len() > reference.len();
    let (short, long) = if swap { (reference, estimate) } else { (estimate, reference) };
    short
        .iter()
        .filter_map(|from_short| {
            let after = long.partition_point(|pose| pose.stamp_s < from_short.stamp_s);
            let candidates = [after.checked_sub(1), Some(after)];
            let nearest = candidates.into_iter().flatten().filter_map(|index| long.get(index)).min_by(|a, b| {
                (a.stamp_s - from_short.stamp_s).abs().total_cmp(&(b.stamp_s - from_short.stamp_s).abs())
            })?;
            if (nearest.stamp_s - from_short.stamp_s).abs() > max_difference_s {
                return None;
            }
            Some(if swap { (*nearest, *from_short) } else { (*from_short, *nearest) })
        })
        .collect()
}

/// The alignment of associated poses; see [`AlignmentSums::solve`].
pub fn align(pairs: &[(StampedPose, StampedPose)], alignment: TrajectoryAlignment) -> Option<AlignmentTransform> {
    let mut sums = AlignmentSums::default();
    for (estimate, reference) in pairs {
        sums.add(&estimate.pose.translation_m, &reference.pose.translation_m);
    }
    sums.solve(alignment)
}

/// Position error of each aligned pose, in metres (evo's absolute pose error, translation part).
pub fn absolute_errors_m(pairs: &[(StampedPose, StampedPose)], transform: &AlignmentTransform) -> Vec<f64> {
    pairs
        .iter()
        .map(|(estimate, reference)| {
            (transform.apply(&estimate.pose).translation_m - reference.pose.translation_m).norm()
        })
        .collect()
}

/// Smallest net rotation over which a drift of the heading is stated, in radians.
const MIN_TURN_RAD: f64 = std::f64::consts::PI;

/// Heading error gained per revolution of the vehicle, in radians: positive if the estimate rotates too far, negative if
/// it lags behind. `None` if the net rotation is less than half a revolution.
pub fn heading_drift_rad(pairs: &[(StampedPose, StampedPose)]) -> Option<f64> {
    let mut turned_rad = 0.0;
    let mut error_rad = 0.0;
    for ends in pairs.windows(2) {
        let [(estimate, reference), (next_estimate, next_reference)] = ends else { continue };
        let heading_error = |estimate: &StampedPose, reference: &StampedPose| {
            vertical_angle(&(estimate.pose.rotation * reference.pose.rotation.inverse()))
        };
        let turn = next_reference.pose.rotation * reference.pose.rotation.inverse();
        turned_rad += wrap_angle(vertical_angle(&turn));
        error_rad += wrap_angle(heading_error(next_estimate, next_reference) - heading_error(estimate, reference));
    }
    let turns = turned_rad / std::f64::consts::TAU;
    (turned_rad.abs() >= MIN_TURN_RAD).then(|| error_rad / turns)
}

/// Distance between the two poses of a relative error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RelativeDelta {
    Frames(usize),
    /// This path length along the aligned estimate, in metres.
    Metres(f64),
}

/// Translation errors (m) and rotation errors (rad) over consecutive sub-trajectories of length `delta` (evo's relative
/// pose error).
pub fn relative_errors(
    pairs: &[(StampedPose, StampedPose)],
    transform: &AlignmentTransform,
    delta: RelativeDelta,
) -> (Vec<f64>, Vec<f64>) {
    let mut translations = Vec::new();
    let mut rotations = Vec::new();
    for (begin, end) in sub_trajectories(pairs, transform, delta) {
        let estimate_step = transform.apply(&pairs[begin].0.pose).inverse() * transform.apply(&pairs[end].0.pose);
        let reference_step = pairs[begin].1.pose.inverse() * pairs[end].1.pose;
        let error = reference_step.inverse() * estimate_step;
        translations.push(error.translation_m.norm());
        rotations.push(so3::log(&error.rotation).norm());
    }
    (translations, rotations)
}

/// Index pairs of consecutive sub-trajectories of length `delta`.
fn sub_trajectories(
    pairs: &[(StampedPose, StampedPose)],
    transform: &AlignmentTransform,
    delta: RelativeDelta,
) -> Vec<(usize, usize)> {
    match delta {
        RelativeDelta::Frames(frames) => {
            let step = frames.max(1);
            (0..pairs.len())
                .step_by(step)
                .map(|index| (index, index + step))
                .filter(|(_, end)| *end < pairs.len())
                .collect()
        }
        RelativeDelta::Metres(length_m) => {
            let mut marks = Vec::new();
            let mut path_m = 0.0;
            for index in 0..pairs.len() {
                if index > 0 {
                    let step = pairs[index].0.pose.translation_m - pairs[index - 1].0.pose.translation_m;
                    path_m += transform.scale * step.norm();
                }
                if index == 0 || path_m >= length_m {
                    marks.push(index);
                    path_m = 0.0;
                }
            }
            marks.windows(2).map(|ends| (ends[0], ends[1])).collect()
        }
    }
}

/// Length of a path in metres.
pub fn path_length_m<'a>(positions: impl IntoIterator<Item = &'a Vector3<f64>>) -> f64 {
    let mut length_m = 0.0;
    let mut last: Option<&Vector3<f64>> = None;
    for position in positions {
        length_m += last.map_or(0.0, |before| (position - before).norm());
        last = Some(position);
    }
    length_m
}
