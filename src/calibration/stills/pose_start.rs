//! First pose of a camera from known points, without a given one: poses of three points each (Grunert 1841, as written by
//! Haralick et al., "Review and analysis of solutions of the three point perspective pose estimation problem", IJCV 1994),
//! the one with the smallest median residual of all points.

use nalgebra::{DMatrix, Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::point_residual::median_px;
use crate::camera::CameraModel;
use crate::geometry::{RigidTransform, SplitMix64};
use crate::sensors::MapPoint;

/// Number of triples; with half of the points wrong, one of 300 is right with a probability of 1 − 10⁻¹⁷.
const SAMPLES: usize = 300;
const SEED: u64 = 49;
/// Imaginary part of a root, relative to its real part, that counts as zero.
const REAL: f64 = 1e-6;
/// Shortest side of a triangle of points.
const MIN_SIDE_M: f64 = 1e-6;

/// `camera_from_world` of the triple whose pose has the smallest median residual over all points; `None` if no triple has
/// a pose.
pub(super) fn pose_by_samples(model: &CameraModel, points: &[MapPoint]) -> Option<RigidTransform> {
    let seen: Vec<(&MapPoint, Vector3<f64>)> =
        points.iter().filter_map(|point| Some((point, model.unproject(&point.uv_px)?))).collect();
    if seen.len() < 3 {
        return None;
    }
    let mut random = SplitMix64::new(SEED);
    let mut pick = || &seen[((random.next_unit() * seen.len() as f64) as usize).min(seen.len() - 1)];
    let mut best: Option<(f64, RigidTransform)> = None;
    for _ in 0..SAMPLES {
        let sample = [pick(), pick(), pick()];
        let world = sample.map(|(point, _)| point.point_in_world_m);
        for pose in poses_of_three(&world, &sample.map(|(_, bearing)| *bearing)) {
            let score = median_px(model, points, &pose);
            if best.as_ref().is_none_or(|(least, _)| score < *least) {
                best = Some((score, pose));
            }
        }
    }
    best.filter(|(score, _)| score.is_finite()).map(|(_, pose)| pose)
}

/// All `camera_from_world` (at most four) that see three points in the directions of three unit bearings.
fn poses_of_three(world: &[Vector3<f64>; 3], bearings: &[Vector3<f64>; 3]) -> Vec<RigidTransform> {
    let side = |i: usize, j: usize| (world[i] - world[j]).norm_squared();
    let [a2, b2, c2] = [side(1, 2), side(0, 2), side(0, 1)];
    if [a2, b2, c2].iter().any(|it| it.is_nan() || it.sqrt() < MIN_SIDE_M) {
        return Vec::new();
    }
    let cosine = |i: usize, j: usize| bearings[i].dot(&bearings[j]);
    let [alpha, beta, gamma] = [cosine(1, 2), cosine(0, 2), cosine(0, 1)];
    let (ratio, sum) = ((a2 - c2) / b2, (a2 + c2) / b2);
    let coefficients = [
        (1.0 + ratio).powi(2) - 4.0 * a2 / b2 * gamma * gamma,
        4.0 * (-ratio * (1.0 + ratio) * beta + 2.0 * a2 / b2 * gamma * gamma * beta - (1.0 - sum) * alpha * gamma),
        2.0 * (ratio * ratio - 1.0 + 2.0 * ratio * ratio * beta * beta + 2.0 * (b2 - c2) / b2 * alpha * alpha
            - 4.0 * sum * alpha * beta * gamma
            + 2.0 * (b2 - a2) / b2 * gamma * gamma),
        4.0 * (ratio * (1.0 - ratio) * beta - (1.0 - sum) * alpha * gamma + 2.0 * c2 / b2 * alpha * alpha * beta),
        (ratio - 1.0).powi(2) - 4.0 * c2 / b2 * alpha * alpha,
    ];
    real_roots(&coefficients)
        .into_iter()
        .filter_map(|v| {
            let u = ((ratio - 1.0) * v * v - 2.0 * ratio * beta * v + 1.0 + ratio) / (2.0 * (gamma - v * alpha));
            let first = (b2 / (1.0 + v * v - 2.0 * v * beta)).sqrt();
            let lengths = [first, u * first, v * first];
            if lengths.iter().any(|length| !(length.is_finite() && *length > 0.0)) {
                return None;
            }
            aligned(world, &std::array::from_fn(|index| bearings[index] * lengths[index]))
        })
        .collect()
}

/// Real roots of a polynomial of the fourth degree, constant first, as eigenvalues of its companion matrix.
fn real_roots(coefficients: &[f64; 5]) -> Vec<f64> {
    let [constant @ .., leading] = coefficients;
    let largest = coefficients.iter().fold(0.0_f64, |largest, it| largest.max(it.abs()));
    if !largest.is_finite() || leading.abs() <= 1e-12 * largest {
        return Vec::new();
    }
    let mut companion = DMatrix::zeros(4, 4);
    for row in 0..4 {
        companion[(row, 3)] = -constant[row] / leading;
        if row > 0 {
            companion[(row, row - 1)] = 1.0;
        }
    }
    let roots = companion.complex_eigenvalues();
    roots.iter().filter(|root| root.im.abs() <= REAL * (1.0 + root.re.abs())).map(|root| root.re).collect()
}

/// Rigid transform that maps the corners of one triangle to the corners of another one, by least squares.
fn aligned(from: &[Vector3<f64>; 3], to: &[Vector3<f64>; 3]) -> Option<RigidTransform> {
    let centre = |points: &[Vector3<f64>; 3]| (points[0] + points[1] + points[2]) / 3.0;
    let (from_centre, to_centre) = (centre(from), centre(to));
    let covariance: Matrix3<f64> =
        (0..3).map(|index| (to[index] - to_centre) * (from[index] - from_centre).transpose()).sum();
    let svd = covariance.svd(true, true);
    let (u, v_t) = (svd.u?, svd.v_t?);
    let sign = (u * v_t).determinant().signum();
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * v_t;
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    Some(RigidTransform::new(rotation, to_centre - rotation * from_centre))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::so3;

    #[test]
    fn the_pose_of_three_points_is_among_the_solutions() {
        let mut random = SplitMix64::new(7);
        let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * (2.0 * random.next_unit() - 1.0));
        let mut missed = 0;
        for _ in 0..200 {
            let rotation = so3::exp(&vector(3.0));
            let in_camera: [Vector3<f64>; 3] = std::array::from_fn(|_| vector(2.0) + Vector3::z() * 5.0);
            let truth = RigidTransform::new(rotation, vector(4.0));
            let world = in_camera.map(|point| truth.inverse().transform(&point));
            let poses = poses_of_three(&world, &in_camera.map(|point| point.normalize()));
            let nearest = poses.iter().map(|pose| pose.minus(&truth).norm()).fold(f64::INFINITY, f64::min);
            missed += usize::from(nearest > 1e-5);
        }
        // Close to a double root the quartic loses half of its digits or both of its roots.
        assert!(missed <= 2, "{missed} of 200 poses are not among the solutions");
    }
}
