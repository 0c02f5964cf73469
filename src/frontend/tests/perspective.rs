//! Perspective of reference patches on planes.

use nalgebra::{Matrix2, Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};

use super::homography::Dice;
use crate::camera::CameraModel;
use crate::frontend::perspective::Surface;
use crate::geometry::median;

/// Homography of pixels around a feature: position in the second image, affine part and perspective.
struct Local {
    uv_px: Vector2<f64>,
    warp: Matrix2<f64>,
    perspective_per_px: Vector2<f64>,
}

fn local(homography: &Matrix3<f64>, uv_px: &Vector2<f64>) -> Local {
    let moved = homography * uv_px.push(1.0);
    let moved = moved.xy() / moved.z;
    let shift = |by: Vector2<f64>| Matrix3::new(1.0, 0.0, by.x, 0.0, 1.0, by.y, 0.0, 0.0, 1.0);
    let shifted = shift(-moved) * homography * shift(*uv_px);
    let shifted = shifted / shifted.m33;
    Local {
        uv_px: moved,
        warp: shifted.fixed_view::<2, 2>(0, 0).into_owned(),
        perspective_per_px: Vector2::new(shifted.m31, shifted.m32),
    }
}

/// Error of the perspective after some images, relative to the perspective, for planes of random slope before a camera
/// that turns and moves; matched warps have this noise.
fn relative_errors(warp_noise: f64) -> Vec<f64> {
    let camera = CameraModel::pinhole([400.0, 410.0, 320.0, 240.0], [640, 480]).unwrap();
    let matrix = Matrix3::new(400.0, 0.0, 320.0, 0.0, 410.0, 240.0, 0.0, 0.0, 1.0);
    let back = matrix.try_inverse().unwrap();
    let mut dice = Dice(5);
    let mut errors = Vec::new();
    for _ in 0..200 {
        let uv_px = Vector2::new(120.0 + 400.0 * dice.uniform(), 80.0 + 320.0 * dice.uniform());
        let bearing = camera.unproject(&uv_px).unwrap();
        // Inverse depth `normalᵀ·ray` of the plane: 1/4 to 1/2 m⁻¹ at the feature, with a slope of up to 1.5.
        let slope = Vector2::new(dice.uniform() - 0.5, dice.uniform() - 0.5) * 2.0;
        let inverse_depth = 0.25 + 0.25 * dice.uniform();
        let point = bearing.xy() / bearing.z;
        let normal = (slope.push(1.0 - slope.dot(&point))) * inverse_depth;
        let velocity_m = Vector3::new(dice.normal(), dice.normal(), dice.normal()) * 0.03;
        let turn = Rotation3::new(Vector3::new(dice.normal(), dice.normal(), dice.normal()) * 0.01);

        let mut surface = Surface::new(&camera, &uv_px).unwrap();
        let mut camera_from_reference = Rotation3::identity();
        let mut last = None;
        for image in 1..=20 {
            camera_from_reference = turn * camera_from_reference;
            let moved = camera_from_reference.matrix() + velocity_m * f64::from(image) * normal.transpose();
            let seen = local(&(matrix * moved * back), &uv_px);
            let warp = seen.warp + Matrix2::from_fn(|_, _| warp_noise * dice.normal());
            let bearing = camera.unproject(&seen.uv_px).unwrap();
            let rotation = UnitQuaternion::from_rotation_matrix(&turn);
            let found = surface.perspective(&camera, &rotation, &bearing, &warp);
            last = found.map(|found| (found - seen.perspective_per_px).norm() / seen.perspective_per_px.norm());
        }
        errors.extend(last);
    }
    errors
}

#[test]
fn perspective_follows_from_the_warps_and_the_rotation() {
    for (noise, least, limit) in [(0.0, 150, 0.02), (0.01, 150, 0.15)] {
        let errors = relative_errors(noise);
        assert!(errors.len() > least, "{} planes", errors.len());
        let median = median(errors).unwrap();
        assert!(median < limit, "relative error {median} with a noise of the warps of {noise}");
    }
}
