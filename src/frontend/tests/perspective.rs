//! Perspective of reference patches on planes.

use nalgebra::{Matrix2, Matrix3, Rotation3, UnitQuaternion, Vector2, Vector3};

use super::homography::Dice;
use super::{camera_of, scene, texture};
use crate::camera::CameraModel;
use crate::frontend::perspective::Surface;
use crate::frontend::reference::{ReferenceOptions, ReferencePatch, ReferenceSearch};
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

/// Median over features of a plane of the signed error along their motion, of the matches and of the corrected ones, in
/// pixels.
fn errors_along_motion_px() -> [f64; 2] {
    let (scene, texture) = (scene(0.6), texture());
    let camera = camera_of(&scene);
    let images: Vec<_> = (4..=10).map(|image| scene.render(&texture, image)).collect();
    let mut errors = [Vec::new(), Vec::new()];
    for (x, y) in (40..200).step_by(9).flat_map(|y| (40..280).step_by(9).map(move |x| (x, y))) {
        let uv_px = Vector2::new(f64::from(x), f64::from(y));
        let Some(mut reference) = ReferencePatch::cut(&images[0], &camera, &uv_px, &Vector2::zeros()) else { continue };
        let mut search = ReferenceSearch::new();
        for (number, image) in images.iter().enumerate().skip(1) {
            let to = 4 + number;
            let expected = scene.flow(4, to, &uv_px);
            let Some(found) = reference.find(image, &expected, &ReferenceOptions::default(), &mut search) else {
                break;
            };
            let turn = scene.camera_from_plane(to) * scene.camera_from_plane(to - 1).inverse();
            let bearing = camera.unproject(&found).unwrap();
            let rotation = UnitQuaternion::from_rotation_matrix(&turn);
            let error_px = reference.perspective_error_px(&camera, &rotation, &bearing);
            let along = (expected - uv_px).normalize();
            for (errors, seen) in errors.iter_mut().zip([found, found - error_px]) {
                errors.push(along.dot(&(seen - expected)).abs());
            }
        }
    }
    errors.map(|errors| median(errors).unwrap())
}

#[test]
fn correction_for_perspective_moves_matches_to_the_surface() {
    let [matched_px, corrected_px] = errors_along_motion_px();
    assert!(corrected_px < 0.8 * matched_px, "{matched_px} px before, {corrected_px} px after");
}
