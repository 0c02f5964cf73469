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
        let last_s = times_s.last().copied().unwrap_or(from_s);
        let moved_rad = |joint: usize| (motion.value(joint, time_s, 0) - motion.value(joint, last_s, 0)).abs();
        let by_joints = situation.joints_make_keyframes()
            && time_s - last_s >= KEYFRAME_JOINT_INTERVAL_S - 1e-6
            && (0..motion.joint_count()).any(|joint| moved_rad(joint) >= KEYFRAME_JOINT_RAD);
        let by_points = || {
            let second_from_first = newest.inverse() * last;
            let common = observed(situation, &points, &second_from_first);
            let new_ratio = 1.0 - common.len() as f64 / points.len().max(1) as f64;
            let centre = second_from_first.inverse().translation_m;
            new_ratio > options.keyframe_new_ratio || has_parallax(&common, &centre, options.keyframe_parallax_rad)
        };
        if by_joints || by_points() {
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

/// Points of the first camera that the second one observes, in the frame of the first.
fn observed(situation: &Situation, points: &[Vector3<f64>], second_from_first: &RigidTransform) -> Vec<Vector3<f64>> {
    let is_seen = |point: &&Vector3<f64>| {
        let in_second = second_from_first.transform(point);
        let seen = situation.camera.project(&in_second).filter(|_| in_second.z > 0.0);
        seen.is_some_and(|uv_px| situation.camera.contains(&uv_px, 0.0))
    };
    points.iter().filter(is_seen).copied().collect()
}

/// True if the mean angle between the rays to a point from the origin and from another centre is at least a limit, in radians.
///
/// `sin θ ≤ θ`, and `θ ≤ 1.2092 sin θ` up to 60°: most images need no arc cosine.
fn has_parallax(points: &[Vector3<f64>], centre: &Vector3<f64>, limit_rad: f64) -> bool {
    /// Bounds are used if they decide by more than the rounding of the sums.
    const ROUNDING: f64 = 1e-9;
    let limit = limit_rad * points.len().max(1) as f64;
    let (mut sines, mut all_below_60_deg) = (0.0, true);
    for point in points {
        let other = point - centre;
        let norms2 = point.norm_squared() * other.norm_squared();
        sines += (point.cross(&other).norm_squared() / norms2).sqrt();
        let dot = point.dot(&other);
        all_below_60_deg &= dot > 0.0 && 4.0 * dot * dot > norms2;
    }
    if sines >= limit * (1.0 + ROUNDING) {
        return true;
    }
    if all_below_60_deg && 1.2092 * sines < limit * (1.0 - ROUNDING) {
        return false;
    }
    points.iter().map(|point| point.angle(&(point - centre))).sum::<f64>() / points.len().max(1) as f64 >= limit_rad
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::SplitMix64;

    #[test]
    fn bounds_of_the_mean_angle_decide_like_the_angle() {
        let mut random = SplitMix64::new(4);
        let mut vector = |size: f64| Vector3::from_fn(|_, _| size * (random.next_unit() - 0.5));
        let mut above = 0;
        for number in 0..3000 {
            let points: Vec<Vector3<f64>> = (0..number % 7).map(|_| vector(8.0) + Vector3::z() * 4.5).collect();
            let centre = vector(if number % 2 == 0 { 0.4 } else { 6.0 });
            let angles_rad = points.iter().map(|point| point.angle(&(point - centre)));
            let mean_rad = angles_rad.sum::<f64>() / points.len().max(1) as f64;
            assert_eq!(has_parallax(&points, &centre, 0.05), mean_rad >= 0.05, "{number}: {mean_rad}");
            above += usize::from(mean_rad >= 0.05);
        }
        assert!((600..2400).contains(&above), "{above} means above the limit");
    }
}
