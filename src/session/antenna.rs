//! Trajectory errors against antenna positions: ground truth without attitude, at a lever arm from the IMU.

use std::fmt;

use nalgebra::{Cholesky, Const, Matrix3, SMatrix, SymmetricEigen, Vector3};
use serde::{Serialize, Serializer};
use thiserror::Error;

use super::accuracy::{AlignmentSums, ErrorStatistics, TrajectoryAlignment, path_length_m};
use crate::geometry::{RigidTransform, consecutive_correlation, so3};
use crate::optimization::NormalEquations;
use crate::sensors::{LeverArm, PoseTrack, PositionSample};

/// Smallest mean excitation of the lever arm by rotations, in degrees; below it, noise dominates the lever arm.
const MIN_EXCITATION_DEG: f64 = 5.0;
/// Limit of Gauss–Newton steps for the estimated lever arm; a few usually suffice.
const MAX_STEPS: usize = 30;
/// Norm of the step at which the iteration stops, in metres and radians.
const STEP_TOLERANCE: f64 = 1e-12;
const MIN_PAIRS: usize = 10;
/// Upper limit on the correlation of consecutive residuals.
const MAX_CORRELATION: f64 = 0.999;

/// Estimated pose of the IMU at the stamp of an antenna position.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AntennaPair {
    /// Time in nanoseconds since the start of the log.
    pub stamp_ns: i64,
    /// `world_from_imu` in the world of the estimate.
    pub pose: RigidTransform,
    /// Position of the antenna in the world of the ground truth, in metres.
    pub antenna_m: Vector3<f64>,
}

/// Alignment of an estimated trajectory with antenna positions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AntennaAlignment {
    /// `true_from_estimate`, a rotation about the vertical and a translation.
    #[serde(skip)]
    pub true_from_estimate: RigidTransform,
    /// Position of the antenna in the IMU frame, in metres.
    #[serde(serialize_with = "coordinates")]
    pub lever_arm_m: Vector3<f64>,
    /// Standard deviation of each coordinate, `None` if the lever arm was given.
    #[serde(serialize_with = "optional_coordinates")]
    pub lever_arm_sigma_m: Option<Vector3<f64>>,
}

fn coordinates<S: Serializer>(vector: &Vector3<f64>, serializer: S) -> Result<S::Ok, S::Error> {
    vector.as_slice().serialize(serializer)
}

#[expect(clippy::ref_option, reason = "signature of serialize_with")]
fn optional_coordinates<S: Serializer>(vector: &Option<Vector3<f64>>, serializer: S) -> Result<S::Ok, S::Error> {
    vector.as_ref().map(Vector3::as_slice).serialize(serializer)
}

/// `the antenna at (0.120, -0.050, 0.310) m`: position in the IMU frame, with σ where it was estimated.
impl fmt::Display for AntennaAlignment {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z]: [f64; 3] = self.lever_arm_m.into();
        match self.lever_arm_sigma_m.map(<[f64; 3]>::from) {
            None => write!(formatter, "the antenna at ({x:.3}, {y:.3}, {z:.3}) m"),
            Some([sx, sy, sz]) => {
                write!(formatter, "the antenna, estimated at ({x:.3} ± {sx:.3}, {y:.3} ± {sy:.3}, {z:.3} ± {sz:.3}) m")
            }
        }
    }
}

/// Reason why a trajectory cannot be aligned with antenna positions.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum AntennaError {
    /// Too few pairs, or positions that do not determine the alignment.
    #[error("{pairs} poses with a position of the antenna do not determine the alignment")]
    NotDetermined { pairs: usize },
    #[error(
        "lever arm not observable: the rotations of the flight excite direction ({:.2}, {:.2}, {:.2}) of the IMU frame by only \
         {excitation_deg:.1}° (at least {MIN_EXCITATION_DEG}° needed); measure it with a ruler and give it as \
         ground_truth.lever_arm or --lever-arm X,Y,Z",
        direction.x, direction.y, direction.z
    )]
    NotExcited {
        /// Direction in the IMU frame along which it is least determined.
        direction: Vector3<f64>,
        /// Mean excitation of this direction by the rotations, in degrees.
        excitation_deg: f64,
    },
}

/// The estimate at the stamps of the positions, interpolated between its poses.
pub fn antenna_pairs(estimate: &PoseTrack, positions: &[PositionSample]) -> Vec<AntennaPair> {
    let pair = |sample: &PositionSample| {
        let pose = estimate.at(sample.stamp_ns)?;
        Some(AntennaPair { stamp_ns: sample.stamp_ns, pose, antenna_m: sample.position_m })
    };
    positions.iter().filter_map(pair).collect()
}

/// Aligns an estimate with antenna positions by yaw and translation, and estimates the lever arm unless it is given
/// (least squares).
///
/// # Errors
/// If the pairs do not determine the alignment, or the rotations do not determine the lever arm.
pub fn align_antenna(pairs: &[AntennaPair], lever_arm: LeverArm) -> Result<AntennaAlignment, AntennaError> {
    match lever_arm {
        LeverArm::Known(lever_arm_m) => {
            let true_from_estimate = aligned(pairs, &lever_arm_m)?;
            Ok(AntennaAlignment { true_from_estimate, lever_arm_m, lever_arm_sigma_m: None })
        }
        LeverArm::Estimated => with_lever_arm(pairs),
    }
}

/// Distances between the estimated and the ground-truth positions of the antenna, in metres.
pub fn antenna_errors_m(pairs: &[AntennaPair], alignment: &AntennaAlignment) -> Vec<f64> {
    pairs.iter().map(|pair| residual(pair, &alignment.true_from_estimate, &alignment.lever_arm_m).norm()).collect()
}

/// Statistics of [`antenna_errors_m`] in metres, and the length of the true path of the antenna in metres; `None` without
/// pairs.
pub fn antenna_statistics(pairs: &[AntennaPair], alignment: &AntennaAlignment) -> Option<(ErrorStatistics, f64)> {
    let statistics = ErrorStatistics::of(&antenna_errors_m(pairs, alignment))?;
    Some((statistics, path_length_m(pairs.iter().map(|pair| &pair.antenna_m))))
}

fn aligned(pairs: &[AntennaPair], lever_arm_m: &Vector3<f64>) -> Result<RigidTransform, AntennaError> {
    let mut sums = AlignmentSums::default();
    for pair in pairs {
        sums.add(&pair.pose.transform(lever_arm_m), &pair.antenna_m);
    }
    let solved = sums.solve(TrajectoryAlignment::YawPosition).filter(|_| pairs.len() >= MIN_PAIRS);
    solved.map(|transform| transform.rigid).ok_or(AntennaError::NotDetermined { pairs: pairs.len() })
}

/// Estimated minus ground-truth position of the antenna, in metres.
fn residual(pair: &AntennaPair, true_from_estimate: &RigidTransform, lever_arm_m: &Vector3<f64>) -> Vector3<f64> {
    true_from_estimate.transform(&pair.pose.transform(lever_arm_m)) - pair.antenna_m
}

/// Columns of the least-squares problem: yaw, translation, lever arm.
const GAUGE: usize = 4;
const COLUMNS: usize = GAUGE + 3;

fn with_lever_arm(pairs: &[AntennaPair]) -> Result<AntennaAlignment, AntennaError> {
    let not_determined = AntennaError::NotDetermined { pairs: pairs.len() };
    let mut lever_arm_m = Vector3::zeros();
    let mut true_from_estimate = aligned(pairs, &lever_arm_m)?;
    let mut lever_information = Matrix3::zeros();
    for _ in 0..MAX_STEPS {
        let equations = normal_equations(pairs, &true_from_estimate, &lever_arm_m);
        let normal = &equations.hessian;
        let gauge = Cholesky::new(normal.fixed_view::<GAUGE, GAUGE>(0, 0).into_owned()).ok_or(not_determined)?;
        let mixed = normal.fixed_view::<GAUGE, 3>(0, GAUGE).into_owned();
        lever_information = normal.fixed_view::<3, 3>(GAUGE, GAUGE) - mixed.transpose() * gauge.solve(&mixed);
        check_excitation(&lever_information, pairs.len())?;
        let step = equations.step().ok_or(not_determined)?;
        let yaw = so3::exp(&Vector3::new(0.0, 0.0, step[0]));
        true_from_estimate = RigidTransform::new(yaw, step.fixed_rows::<3>(1).into_owned()) * true_from_estimate;
        lever_arm_m += step.fixed_rows::<3>(GAUGE);
        if step.amax() < STEP_TOLERANCE {
            break;
        }
    }
    let residuals: Vec<Vector3<f64>> =
        pairs.iter().map(|pair| residual(pair, &true_from_estimate, &lever_arm_m)).collect();
    let sigmas = lever_information.try_inverse().map(|covariance| (covariance * variance_of(&residuals)).diagonal());
    let lever_arm_sigma_m = sigmas.map(|variances| variances.map(f64::sqrt));
    Ok(AntennaAlignment { true_from_estimate, lever_arm_m, lever_arm_sigma_m })
}

/// Normal equations of all residuals; the yaw perturbation rotates about the origin of the ground truth's world.
fn normal_equations(
    pairs: &[AntennaPair],
    true_from_estimate: &RigidTransform,
    lever_arm_m: &Vector3<f64>,
) -> NormalEquations<Const<COLUMNS>> {
    let mut equations = NormalEquations::zeros(Const);
    for pair in pairs {
        let residual = residual(pair, true_from_estimate, lever_arm_m);
        let mut jacobian = SMatrix::<f64, 3, COLUMNS>::zeros();
        jacobian.set_column(0, &Vector3::z().cross(&(residual + pair.antenna_m)));
        jacobian.fixed_view_mut::<3, 3>(0, 1).copy_from(&Matrix3::identity());
        let rotation = true_from_estimate.rotation * pair.pose.rotation;
        jacobian.fixed_view_mut::<3, 3>(0, GAUGE).copy_from(&rotation.to_rotation_matrix().into_inner());
        equations.add(&residual, &jacobian, 1.0);
    }
    equations
}

/// Returns an error if the rotations do not determine the lever arm. The information per pair, after marginalizing the
/// alignment, is the mean square of the sine of the rotations that excite a direction.
fn check_excitation(lever_information: &Matrix3<f64>, pairs: usize) -> Result<(), AntennaError> {
    let eigen = SymmetricEigen::new(lever_information / pairs.max(1) as f64);
    let weakest = eigen.eigenvalues.imin();
    let excitation_deg = eigen.eigenvalues[weakest].clamp(0.0, 1.0).sqrt().asin().to_degrees();
    if excitation_deg >= MIN_EXCITATION_DEG {
        return Ok(());
    }
    let direction: Vector3<f64> = eigen.eigenvectors.column(weakest).into_owned();
    // The sign of an eigenvector is arbitrary: its largest coordinate is positive.
    let direction = if direction[direction.iamax()] < 0.0 { -direction } else { direction };
    Err(AntennaError::NotExcited { direction, excitation_deg })
}

/// Variance of one coordinate of the residuals in m², scaled up for their correlation in time: trajectory errors drift,
/// so consecutive residuals are almost one measurement.
fn variance_of(residuals: &[Vector3<f64>]) -> f64 {
    let freedom = (3 * residuals.len()).saturating_sub(COLUMNS).max(1) as f64;
    let squares: f64 = residuals.iter().map(Vector3::norm_squared).sum();
    let correlation = consecutive_correlation(residuals, MAX_CORRELATION);
    squares / freedom * (1.0 + correlation) / (1.0 - correlation)
}

#[cfg(test)]
mod tests {
    use nalgebra::UnitQuaternion;

    use super::*;
    use crate::geometry::SplitMix64;
    use crate::sensors::PoseSample;

    /// 60 s at 20 Hz with yaw motion, and roll and pitch of `tilt_rad`, in its own world frame.
    fn estimate(tilt_rad: f64) -> PoseTrack {
        let sample = |frame: i64| {
            let time_s = frame as f64 * 0.05;
            let roll = tilt_rad * (0.9 * time_s).sin();
            let pitch = tilt_rad * (0.7 * time_s).cos();
            let rotation = UnitQuaternion::from_euler_angles(roll, pitch, 0.3 * time_s);
            let position_m = Vector3::new(8.0 * (0.25 * time_s).cos(), 6.0 * (0.3 * time_s).sin(), 0.1 * time_s);
            PoseSample { stamp_ns: frame * 50_000_000, world_from_imu: RigidTransform::new(rotation, position_m) }
        };
        PoseTrack::new((0..1200).map(sample).collect())
    }

    const LEVER_ARM_M: [f64; 3] = [0.12, -0.05, 0.31];

    /// Antenna positions at 5 Hz in another world frame, between the frames, with white noise.
    fn positions(estimate: &PoseTrack, sigma_m: f64) -> Vec<PositionSample> {
        let yaw = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 2.1);
        let true_from_estimate = RigidTransform::new(yaw, Vector3::new(100.0, -40.0, 7.0));
        let mut random = SplitMix64::new(3);
        // Nearly normal: the sum of twelve uniform numbers has a variance of 1.
        let mut normal = move || (0..12).map(|_| random.next_unit()).sum::<f64>() - 6.0;
        (1..290_i64)
            .map(|number| {
                let stamp_ns = number * 200_000_000 + 25_000_000;
                let pose = true_from_estimate * estimate.at(stamp_ns).unwrap();
                let error = Vector3::from_fn(|_, _| sigma_m * normal());
                PositionSample { stamp_ns, position_m: pose.transform(&LEVER_ARM_M.into()) + error }
            })
            .collect()
    }

    #[test]
    fn the_lever_arm_is_estimated_with_its_sigma() {
        let estimate = estimate(0.3);
        for sigma_m in [0.0, 0.02] {
            let pairs = antenna_pairs(&estimate, &positions(&estimate, sigma_m));
            assert_eq!(pairs.len(), 289);
            let found = align_antenna(&pairs, LeverArm::Estimated).unwrap();
            let error = found.lever_arm_m - Vector3::from(LEVER_ARM_M);
            let sigma = found.lever_arm_sigma_m.unwrap();
            if sigma_m == 0.0 {
                assert!(error.amax() < 1e-9, "{error}");
            } else {
                assert!(sigma.iter().all(|sigma| (0.001..0.02).contains(sigma)), "{sigma}");
                assert!(error.component_div(&sigma).amax() < 3.0, "{error} {sigma}");
            }
            let (statistics, length_m) = antenna_statistics(&pairs, &found).unwrap();
            assert!((statistics.rmse - sigma_m * 3.0_f64.sqrt()).abs() < 0.1 * sigma_m + 1e-9, "{statistics:?}");
            assert!(length_m > 80.0);
        }
    }

    #[test]
    fn a_known_lever_arm_counts_and_a_missing_one_is_an_error() {
        let estimate = estimate(0.3);
        let pairs = antenna_pairs(&estimate, &positions(&estimate, 0.0));
        let rmse = |lever_arm_m: Vector3<f64>| {
            let alignment = align_antenna(&pairs, LeverArm::Known(lever_arm_m)).unwrap();
            antenna_statistics(&pairs, &alignment).unwrap().0.rmse
        };
        assert!(rmse(LEVER_ARM_M.into()) < 1e-9);
        assert!(rmse(Vector3::zeros()) > 0.05);
    }

    #[test]
    fn rotations_that_do_not_excite_the_lever_arm_are_refused() {
        // In level flight, the vertical lever arm is indistinguishable from a height offset.
        let estimate = estimate(0.01);
        let pairs = antenna_pairs(&estimate, &positions(&estimate, 0.0));
        let refused = align_antenna(&pairs, LeverArm::Estimated).unwrap_err();
        let AntennaError::NotExcited { direction, excitation_deg } = refused else { panic!("{refused}") };
        assert!(direction.z > 0.99 && excitation_deg < 1.0, "{direction} {excitation_deg}");
        assert!(refused.to_string().contains("measure it with a ruler"), "{refused}");
        let few = align_antenna(&pairs[..5], LeverArm::Known(Vector3::zeros())).unwrap_err();
        assert_eq!(few, AntennaError::NotDetermined { pairs: 5 });
    }
}
