//! Axes of the IMU that agree with the rotations in the images: a selection before trials, which are slow for all 47.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::trial::DiagnosedRun;
use crate::geometry::{SignedAxes, so3};
use crate::sensors::rotation_steps;
use crate::session::engine::rotation_between;

/// Number of axes that are tried of each kind.
const TRIED: usize = 3;
/// Ratio of the rotations that recorded axes explain above which the gyroscope is not suspected.
const EXPLAINED: f64 = 0.8;
/// Fewest rotations of images.
const FEWEST: usize = 20;

/// Axes for trials, the most plausible first.
#[derive(Clone, Debug, Default)]
pub(super) struct PlausibleAxes {
    pub(super) gyroscope: Vec<SignedAxes>,
    pub(super) accelerometer: Vec<SignedAxes>,
}

/// Rotation of the IMU from one image to the next, by images and by gyroscope (rotation vectors, rad), and the mean
/// specific force between them (m/s²).
struct Interval {
    image: Vector3<f64>,
    gyroscope: Vector3<f64>,
    force: Vector3<f64>,
}

/// Axes with which gyroscope and accelerometer agree with the rotations in the images of the steps.
pub(super) fn plausible_axes(run: &DiagnosedRun<'_>, steps: std::ops::Range<usize>) -> PlausibleAxes {
    let intervals = intervals(run, steps);
    if intervals.len() < FEWEST {
        return PlausibleAxes::default();
    }
    let count = intervals.len() as f64;
    let mean = |of: fn(&Interval) -> Vector3<f64>| intervals.iter().map(of).sum::<Vector3<f64>>() / count;
    let (mean_image, mean_gyroscope) = (mean(|it| it.image), mean(|it| it.gyroscope));
    let moment: Matrix3<f64> =
        intervals.iter().map(|it| (it.image - mean_image) * (it.gyroscope - mean_gyroscope).transpose()).sum();
    let power: f64 = intervals.iter().map(|it| (it.gyroscope - mean_gyroscope).norm_squared()).sum();
    // Ratio of the rotation that axes explain: 1 if images and gyroscope agree.
    let of_gyroscope = |matrix: &Matrix3<f64>| moment.dot(matrix) / power.max(1e-12);
    let gyroscope = if of_gyroscope(&Matrix3::identity()) > EXPLAINED {
        Vec::new()
    } else {
        best(|axes| of_gyroscope(&axes.matrix()))
    };
    let accelerometer = best(|axes| steadiness(&intervals, &axes.matrix()));
    PlausibleAxes { gyroscope, accelerometer }
}

fn best(score: impl Fn(&SignedAxes) -> f64) -> Vec<SignedAxes> {
    let mut scored: Vec<(f64, SignedAxes)> = SignedAxes::all().skip(1).map(|axes| (score(&axes), axes)).collect();
    scored.sort_by(|one, other| other.0.total_cmp(&one.0));
    scored.into_iter().take(TRIED).map(|(_, axes)| axes).collect()
}

/// Length of the mean specific force in a frame that does not rotate, over the mean length: 1 for gravity alone with
/// correct axes.
fn steadiness(intervals: &[Interval], matrix: &Matrix3<f64>) -> f64 {
    let mut first_from_now = UnitQuaternion::identity();
    let (mut sum, mut length) = (Vector3::zeros(), 0.0);
    for interval in intervals {
        sum += first_from_now * (matrix * interval.force);
        length += interval.force.norm();
        first_from_now *= so3::exp(&interval.image);
    }
    sum.norm() / length.max(1e-12)
}

fn intervals(run: &DiagnosedRun<'_>, steps: std::ops::Range<usize>) -> Vec<Interval> {
    let Some(chain) = run.rig.chain_of_camera(run.camera_key) else { return Vec::new() };
    let Ok(camera) = run.rig.camera(run.camera_key) else { return Vec::new() };
    let joints = chain.links.len();
    let imu_from_camera = |number: usize| {
        let angles = match (&run.inputs.get(number)?.joint_angles, joints) {
            (_, 0) => Vec::new(),
            (Some(angles), _) if angles.angles_rad.len() == joints => angles.angles_rad.clone(),
            _ => return None,
        };
        Some(chain.imu_from_camera(&angles).rotation)
    };
    let interval = |number: usize| {
        let (before, now) = (run.inputs.get(number.checked_sub(1)?)?, run.inputs.get(number)?);
        let now_from_before = rotation_between(&camera.model, before.main_tracks(), now.main_tracks())?;
        let (from, to) = (imu_from_camera(number - 1)?, imu_from_camera(number)?);
        let before_from_now = from * now_from_before.inverse() * to.inverse();
        let none = Vector3::zeros();
        let count = now.imu.len().max(1) as f64;
        Some(Interval {
            image: so3::log(&before_from_now),
            gyroscope: rotation_steps(&now.imu, &none).sum(),
            force: now.imu.iter().map(|sample| sample.specific_force_m_per_s2).sum::<Vector3<f64>>() / count,
        })
    };
    steps.filter_map(interval).collect()
}
