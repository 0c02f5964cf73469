//! Keyframes of a planned motion, by the rule of the estimator without its shortest interval in the first window of an
//! inaccurate chain.

use nalgebra::{Vector2, Vector3};

use super::super::Situation;
use crate::estimator::{EstimatorOptions, KEYFRAME_JOINT_INTERVAL_S, KEYFRAME_JOINT_RAD};
use crate::geometry::RigidTransform;
use crate::simulation::{MotionSplines, Trajectory};

/// Points of the scene that a keyframe observes: rows and columns over the image, each at all distances.
const GRID: [usize; 2] = [3, 4];
/// Shortest time between the images at which a keyframe is chosen, in seconds.
const MIN_PERIOD_S: f64 = 0.05;

/// Times of the keyframes from the start of an interval on, before its end; the first one is at the start.
///
/// An image becomes a keyframe if the points of the last one have enough parallax, rotation compensated, if too few of
/// them are still in the image, or if a joint has moved and rotations of the chain are inaccurate.
pub(super) fn keyframe_times_s(
    situation: &Situation,
    motion: &MotionSplines,
    trajectory: &Trajectory,
    [from_s, to_s]: [f64; 2],
) -> Vec<f64> {
    let options = EstimatorOptions::default();
    let points = scene_points(situation);
    let pose = |time_s: f64| {
        trajectory.at(time_s).world_from_imu * situation.chain.imu_from_camera(&motion.joints_rad(time_s))
    };
    let period_s = situation.image_period_s.max(MIN_PERIOD_S);
    let images = ((to_s - from_s) / period_s - 1e-6).ceil().max(1.0) as usize;
    let mut times_s = vec![from_s];
    let mut last = pose(from_s);
    for image in 1..images {
        let time_s = from_s + image as f64 * period_s;
        let newest = pose(time_s);
        let (parallax_rad, common) = compare(situation, &points, &(newest.inverse() * last));
        let new_ratio = 1.0 - common as f64 / points.len().max(1) as f64;
        let last_s = times_s.last().copied().unwrap_or(from_s);
        let moved_rad = |joint: usize| (motion.value(joint, time_s, 0) - motion.value(joint, last_s, 0)).abs();
        let by_joints = situation.joints_make_keyframes()
            && time_s - last_s >= KEYFRAME_JOINT_INTERVAL_S - 1e-6
            && (0..motion.joint_count()).any(|joint| moved_rad(joint) >= KEYFRAME_JOINT_RAD);
        if by_joints || new_ratio > options.keyframe_new_ratio || parallax_rad >= options.keyframe_parallax_rad {
            times_s.push(time_s);
            last = newest;
        }
    }
    times_s
}

/// Points in the view of a camera, in its frame, at the distances of the scene.
fn scene_points(situation: &Situation) -> Vec<Vector3<f64>> {
    let [width, height] = situation.camera.resolution_px.map(|size| size as f64);
    let [rows, columns] = GRID;
    let places = (0..rows * columns).map(|index| {
        let (row, column) = (index / columns, index % columns);
        Vector2::new((column as f64 + 0.5) / columns as f64 * width, (row as f64 + 0.5) / rows as f64 * height)
    });
    let rays: Vec<Vector3<f64>> = places.filter_map(|uv_px| situation.camera.unproject(&uv_px)).collect();
    let distances_m = situation.scene_m();
    rays.iter().flat_map(|ray| distances_m.iter().map(|distance_m| ray.normalize() * *distance_m)).collect()
}

/// Mean angle between the rays to a point from two cameras, in radians, over the points of the first camera that the
/// second one observes, and their number.
fn compare(situation: &Situation, points: &[Vector3<f64>], second_from_first: &RigidTransform) -> (f64, usize) {
    let centre = second_from_first.inverse().translation_m;
    let angles_rad = points.iter().filter_map(|point| {
        let in_second = second_from_first.transform(point);
        let seen = situation.camera.project(&in_second).filter(|_| in_second.z > 0.0);
        seen.filter(|uv_px| situation.camera.contains(uv_px, 0.0)).map(|_| point.angle(&(point - centre)))
    });
    let (sum, count) = angles_rad.fold((0.0, 0), |(sum, count), angle_rad| (sum + angle_rad, count + 1));
    (sum / f64::from(count.max(1)), count as usize)
}
