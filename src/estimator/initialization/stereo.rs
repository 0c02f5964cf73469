//! Initialization from a stereo pair, which measures distances without motion: at rest, in a hover or in flight.
//!
//! The features that both cameras observe in the first frame are points at known positions. They give the camera poses of
//! the later frames, in metres; gravity and velocity follow from these and from the IMU samples by least squares. The
//! window that is created from this solution refines everything.

use nalgebra::{Matrix6, UnitQuaternion, Vector3, Vector6};

use super::bearing::{ResectedPose, level, refine_camera_pose};
use super::checks::{Checklist, Shown};
use super::selection::guessed_rotations;
use super::{
    InitializationDiagnostics, InitializationFrame, InitializationInput, InitializationOptions, InitializationOrigin,
    InitializationSolution, InitializedFrame, StationaryEstimate, StereoPair,
};
use crate::estimator::state::navigation::ImuBias;
use crate::estimator::state::preintegration::Preintegration;
use crate::frontend::TrackedFeature;
use crate::geometry::{RigidTransform, median, seconds_from_ns, so3};
use crate::sensors::rotation_steps;

/// Time between the first and the last frame, shorter than half a second: the first frame is at the start of the log.
const SHORTEST_S: f64 = 0.38;
/// Largest age of a frame relative to the newest: over longer times the features of the first one are lost.
const LONGEST_S: f64 = 1.0;
const MIN_FRAMES: usize = 4;
const MIN_POINTS: usize = 15;
/// Largest relative standard deviation of the scale: beyond it, motion gives a better one.
const MAX_SCALE_SIGMA: f64 = 0.15;
/// Smallest inverse distance of a point in standard deviations.
const MIN_DEPTH_SIGMAS: f64 = 3.0;
/// Standard deviations of a bearing within which an observation agrees with a pose.
const INLIER_SIGMAS: f64 = 5.0;
/// Standard deviation of the mean acceleration of a vehicle at the start, in m/s²: the prior that keeps gravity near the
/// mean specific force, because half a second of positions determines it to several degrees.
const ACCELERATION_SIGMA_M_PER_S2: f64 = 0.5;
/// Standard deviation of a position by the points in metres.
const POSITION_SIGMA_M: f64 = 0.01;

/// Tries to initialize from the frames of the last second; the results of the checks go to `checklist`.
pub(super) fn from_stereo(
    input: &InitializationInput<'_>,
    options: &InitializationOptions,
    stationary: Option<&StationaryEstimate>,
    checklist: &mut Checklist,
) -> Option<InitializationSolution> {
    let pair = input.pair?;
    let newest_ns = input.frames.last()?.stamp_ns;
    let is_recent = |frame: &InitializationFrame<'_>| seconds_from_ns(newest_ns - frame.stamp_ns) <= LONGEST_S;
    let frames = &input.frames[input.frames.partition_point(|frame| !is_recent(frame))..];
    let (first, others) = frames.split_first()?;
    let span_s = seconds_from_ns(newest_ns - first.stamp_ns);
    let plain = Shown::Plain;
    let long = checklist.at_least("stereo window", "time of the stereo frames", span_s, SHORTEST_S, plain(" s"));
    let count = frames.len() as f64;
    if !(checklist.at_least("stereo frames", "number of stereo frames", count, MIN_FRAMES as f64, plain("")) && long) {
        return None;
    }
    // Of an inverse distance, by the bearings in both cameras.
    let sigma_per_m =
        std::f64::consts::SQRT_2 * options.bearing_sigma_rad / pair.camera_from_other.translation_m.norm();
    let points = points(first, &pair, sigma_per_m);
    let subject = "points that both cameras of the pair observe";
    if !checklist.at_least("stereo points", subject, points.len() as f64, MIN_POINTS as f64, plain("")) {
        return None;
    }
    let distance_m = median(points.iter().map(|(_, point)| point.norm()))?;
    let scale_sigma = scale_sigma(&pair, distance_m);
    let subject = "σ(scale) by the stereo pair";
    if !checklist.at_most("stereo scale", subject, scale_sigma, MAX_SCALE_SIGMA, Shown::Percent) {
        return None;
    }
    let bias = stationary.map_or_else(Vector3::zeros, |stationary| stationary.gyroscope_bias_rad_per_s);
    let poses = camera_poses(frames, &points, (&bias, sigma_per_m), options, checklist)?;
    let imu_poses: Vec<RigidTransform> = poses
        .iter()
        .zip(frames)
        .map(|(pose, frame)| first.imu_from_camera * *pose * frame.imu_from_camera.inverse())
        .collect();
    let bias = gyroscope_bias(others, &imu_poses, &bias, options);
    let bias = ImuBias { gyroscope_rad_per_s: bias, accelerometer_m_per_s2: Vector3::zeros() };
    let motion = motion(input, others, &imu_poses, bias, stationary)?;
    let world_from_first = RigidTransform::new(level(&motion.gravity), Vector3::zeros());
    let initialized =
        frames.iter().zip(&imu_poses).zip(&motion.velocities).map(|((frame, pose), velocity)| InitializedFrame {
            frame_index: frame.frame_index,
            stamp_ns: frame.stamp_ns,
            world_from_imu: world_from_first * *pose,
            velocity_m_per_s: world_from_first.rotation * velocity,
            imu_from_camera: frame.imu_from_camera,
        });
    Some(InitializationSolution {
        origin: InitializationOrigin::Stereo,
        frames: initialized.collect(),
        bias,
        landmarks: Vec::new(),
        diagnostics: InitializationDiagnostics { scale_sigma, ..InitializationDiagnostics::default() },
        passed: Vec::new(),
    })
}

/// Standard deviation of the scale at a distance, from the uncertainty of the baseline's length and of the relative
/// orientation, which shifts the disparity of every point.
fn scale_sigma(pair: &StereoPair, distance_m: f64) -> f64 {
    let baseline_m = pair.camera_from_other.translation_m.norm();
    let (translation_m, rotation_rad) = pair.sigmas;
    (translation_m / baseline_m).hypot(rotation_rad * distance_m / baseline_m)
}

/// Features of a frame that both cameras observe, each with its point in the camera of the frame.
fn points(frame: &InitializationFrame<'_>, pair: &StereoPair, sigma_per_m: f64) -> Vec<(TrackedFeature, Vector3<f64>)> {
    let point = |feature: &TrackedFeature| {
        let place = frame.matched.binary_search_by_key(&feature.id, |matched| matched.id).ok()?;
        let there = pair.camera_from_other.rotation * frame.matched[place].bearing;
        // s R b' + t = b / λ, multiplied by R b' from the left.
        let (across, here) = (there.cross(&pair.camera_from_other.translation_m), there.cross(&feature.bearing));
        let inverse_distance_per_m = here.dot(&across) / across.norm_squared();
        (inverse_distance_per_m > MIN_DEPTH_SIGMAS * sigma_per_m)
            .then(|| (*feature, feature.bearing / inverse_distance_per_m))
    };
    frame.features.iter().filter_map(point).collect()
}

/// Poses of the camera relative to the one of the first frame, which is the first of the result; the standard deviation
/// belongs to the points' inverse distances.
fn camera_poses(
    frames: &[InitializationFrame<'_>],
    points: &[(TrackedFeature, Vector3<f64>)],
    (gyroscope_bias, inverse_distance_sigma_per_m): (&Vector3<f64>, f64),
    options: &InitializationOptions,
    checklist: &mut Checklist,
) -> Option<Vec<RigidTransform>> {
    let rotations = guessed_rotations(frames, gyroscope_bias);
    let first_from_imu = rotations.first()?.inverse();
    let mut poses = vec![RigidTransform::identity()];
    let (mut fewest, mut lowest) = (f64::INFINITY, 1.0_f64);
    for (frame, rotation) in frames.iter().zip(&rotations).skip(1) {
        let seen: Vec<(Vector3<f64>, Vector3<f64>)> = points
            .iter()
            .filter_map(|(feature, point)| {
                let place = frame.features.binary_search_by_key(&feature.id, |seen| seen.id).ok()?;
                Some((*point, frame.features[place].bearing))
            })
            .collect();
        let translation_m = poses.last().map_or_else(Vector3::zeros, |last| last.translation_m);
        let guess = RigidTransform::new(first_from_imu * rotation, translation_m);
        let refine =
            |guess: &RigidTransform, sigma_rad: f64| refine_camera_pose(&seen, guess, sigma_rad, INLIER_SIGMAS);
        let resected = refine(&guess, options.bearing_sigma_rad).and_then(|first| {
            // The error of a distance shifts a bearing in proportion to the motion.
            let shift_rad = first.world_from_camera.translation_m.norm() * inverse_distance_sigma_per_m;
            refine(&first.world_from_camera, options.bearing_sigma_rad.hypot(shift_rad))
        });
        let count = |pose: &ResectedPose| pose.inliers.iter().filter(|inlier| **inlier).count() as f64;
        let inliers = resected.as_ref().map_or(0.0, count);
        fewest = fewest.min(inliers);
        lowest = lowest.min(inliers / seen.len().max(1) as f64);
        poses.extend(resected.map(|resected| resected.world_from_camera));
    }
    let subject = "points that agree with the pose of a frame";
    let enough = checklist.at_least("stereo inliers", subject, fewest, MIN_POINTS as f64, Shown::Plain(""));
    let subject = "ratio of points that agree with the pose of a frame";
    let ratio = checklist.at_least("stereo inlier ratio", subject, lowest, options.min_inlier_ratio, Shown::Percent);
    (enough && ratio && poses.len() == frames.len()).then_some(poses)
}

/// Gyroscope bias by the rotation over all frames, combined with the known one.
fn gyroscope_bias(
    others: &[InitializationFrame<'_>],
    imu_poses: &[RigidTransform],
    known: &Vector3<f64>,
    options: &InitializationOptions,
) -> Vector3<f64> {
    /// Standard deviation of the rotation of an image by many points, in radians.
    const ROTATION_SIGMA_RAD: f64 = 0.001;
    let zero = Vector3::zeros();
    let samples = others.iter().flat_map(|frame| rotation_steps(frame.imu, &zero));
    let steps: Vec<Vector3<f64>> = samples.filter(|step| step.iter().all(|value| value.is_finite())).collect();
    let duration_s: f64 = others.iter().map(|frame| interval_s(frame)).sum();
    let measured = steps.iter().fold(UnitQuaternion::identity(), |rotation, step| rotation * so3::exp(step));
    let Some(last) = imu_poses.last().filter(|_| duration_s > 0.0) else { return *known };
    let found = so3::log(&(last.rotation.inverse() * measured)) / duration_s;
    let (of_images, of_prior) =
        ((ROTATION_SIGMA_RAD / duration_s).powi(-2), options.gyroscope_bias_sigma_rad_per_s.powi(-2));
    (found * of_images + known * of_prior) / (of_images + of_prior)
}

fn interval_s(frame: &InitializationFrame<'_>) -> f64 {
    match (frame.imu.first(), frame.imu.last()) {
        (Some(first), Some(last)) => seconds_from_ns(last.stamp_ns - first.stamp_ns),
        _ => 0.0,
    }
}

/// Velocities of the frames and gravity (pointing down), in the IMU frame of the first one.
struct Motion {
    velocities: Vec<Vector3<f64>>,
    gravity: Vector3<f64>,
}

/// Least-squares velocity of the first frame and gravity:
///
/// ```text
/// p_k = v t_k + g t_k² / 2 + α_k    v_k = v + g t_k + β_k
/// ```
///
/// with the preintegrated position α and velocity β, and the mean specific force as prior of −g. A stationary vehicle has no
/// velocity.
fn motion(
    input: &InitializationInput<'_>,
    others: &[InitializationFrame<'_>],
    imu_poses: &[RigidTransform],
    bias: ImuBias,
    stationary: Option<&StationaryEstimate>,
) -> Option<Motion> {
    let mut whole = Preintegration::new(input.imu_noise, bias);
    let mut increments = Vec::new();
    for frame in others {
        whole.extend(frame.imu);
        increments.push((whole.duration_s(), *whole.increment()));
    }
    let duration_s = whole.duration_s();
    let mean_force = whole.increment().velocity_m_per_s / duration_s;
    if !(duration_s > 0.0 && mean_force.norm() > 0.0) {
        return None;
    }
    if stationary.is_some() {
        let gravity = -mean_force.normalize() * input.gravity_m_per_s2;
        return Some(Motion { velocities: vec![Vector3::zeros(); imu_poses.len()], gravity });
    }
    let (mut hessian, mut right) = (Matrix6::zeros(), Vector6::zeros());
    let (by_position, by_force) = (POSITION_SIGMA_M.powi(-2), ACCELERATION_SIGMA_M_PER_S2.powi(-2));
    for axis in 0..3 {
        for ((time_s, increment), pose) in increments.iter().zip(&imu_poses[1..]) {
            let row = [*time_s, 0.5 * time_s * time_s];
            let measured = pose.translation_m[axis] - increment.position_m[axis];
            for (place, factor) in [axis, 3 + axis].into_iter().zip(row) {
                right[place] += by_position * factor * measured;
                for (other, by_other) in [axis, 3 + axis].into_iter().zip(row) {
                    hessian[(place, other)] += by_position * factor * by_other;
                }
            }
        }
        hessian[(3 + axis, 3 + axis)] += by_force;
        right[3 + axis] -= by_force * mean_force[axis];
    }
    let gravity = hessian.cholesky()?.solve(&right).fixed_rows::<3>(3).normalize() * input.gravity_m_per_s2;
    // With this gravity, the velocity of least squares.
    let (mut sum, mut weight) = (Vector3::zeros(), 0.0);
    for ((time_s, increment), pose) in increments.iter().zip(&imu_poses[1..]) {
        sum += (pose.translation_m - increment.position_m - gravity * (0.5 * time_s * time_s)) * *time_s;
        weight += time_s * time_s;
    }
    let velocity = sum / weight;
    let later = increments.iter().map(|(time_s, increment)| velocity + gravity * *time_s + increment.velocity_m_per_s);
    Some(Motion { velocities: std::iter::once(velocity).chain(later).collect(), gravity })
}
