//! Reference patches matched in later images.

use nalgebra::Vector2;

use super::homography::Scene;
use super::{blank, camera_of, rim, scene, texture};
use crate::frontend::reference::{ReferenceOptions, ReferencePatch, ReferenceSearch};
use crate::frontend::{FeatureId, FrontEnd, FrontEndOptions};
use crate::geometry::median;
use crate::sensors::GrayImage;

/// Fractional positions inside the image, `spacing` pixels apart.
fn places(spacing: usize) -> Vec<Vector2<f64>> {
    let lattice = (40..200).step_by(spacing).flat_map(|y| (40..280).step_by(spacing).map(move |x| (x, y)));
    lattice.map(|(x, y)| Vector2::new(f64::from(x) + 0.37, f64::from(y) - 0.21)).collect()
}

fn cut(image: &GrayImage, uv_px: &Vector2<f64>) -> Option<ReferencePatch> {
    cut_moving(image, uv_px, &Vector2::zeros())
}

fn cut_moving(image: &GrayImage, uv_px: &Vector2<f64>, motion_px: &Vector2<f64>) -> Option<ReferencePatch> {
    ReferencePatch::cut(image, &camera_of(&scene(0.3)), uv_px, motion_px)
}

fn find(reference: &mut ReferencePatch, image: &GrayImage, rough_px: &Vector2<f64>) -> Option<Vector2<f64>> {
    reference.find(image, rough_px, &ReferenceOptions::default(), &mut ReferenceSearch::new())
}

/// Matches references of image 4 in image `to`, starting half a pixel away; returns errors and the number of
/// references.
fn find_all(scene: &Scene, to: usize) -> (Vec<f64>, usize) {
    let texture = texture();
    let (first, later) = (scene.render(&texture, 4), scene.render(&texture, to));
    let observed: Vec<_> = places(11).into_iter().filter(|uv| scene.sees(&scene.flow(4, to, uv))).collect();
    let mut errors = Vec::new();
    for uv in &observed {
        let ground_truth = scene.flow(4, to, uv);
        let mut reference = cut(&first, uv).unwrap();
        if let Some(found) = find(&mut reference, &later, &(ground_truth + Vector2::new(0.4, -0.3))) {
            errors.push((found - ground_truth).norm());
        }
    }
    (errors, observed.len())
}

#[test]
fn a_reference_is_matched_rotated_and_scaled() {
    for (to, motion_scale, flicker, limit_px) in [(5, 0.3, 0.0, 0.06), (7, 0.8, 0.0, 0.06), (7, 0.8, 0.3, 0.07)] {
        let (errors, count) = find_all(&Scene { flicker, ..scene(motion_scale) }, to);
        assert!(count > 200 && errors.len() * 20 >= count * 19, "{} of {count} in image {to}", errors.len());
        let median_px = median(errors).unwrap();
        assert!(median_px < limit_px, "median error {median_px} px in image {to}");
    }
}

#[test]
fn a_changed_window_does_not_match() {
    let scene = scene(0.3);
    let texture = texture();
    let image = scene.render(&texture, 4);
    let mut upside_down = image.clone();
    upside_down.pixels.reverse();
    for uv in places(23) {
        let mut reference = cut(&image, &uv).unwrap();
        let before = reference.clone();
        for other in [&blank(&scene), &upside_down] {
            assert_eq!(find(&mut reference, other, &uv), None, "{uv}");
        }
        assert_eq!(reference, before, "a failure leaves the warp");
        let lost = Vector2::new(f64::NAN, 3.0);
        assert_eq!(find(&mut reference, &image, &lost), None);
    }
}

#[test]
fn near_the_border_a_window_is_moved_inside() {
    let (scene, texture) = (scene(0.3), texture());
    let (first, later) = (scene.render(&texture, 4), scene.render(&texture, 5));
    let mut errors = Vec::new();
    for uv in rim(&scene, 6.3) {
        let flow = scene.flow(4, 5, &uv) - uv;
        let Some(mut reference) = cut_moving(&first, &uv, &flow) else { continue };
        if let Some(found) = find(&mut reference, &later, &(uv + flow + Vector2::new(0.4, -0.3))) {
            errors.push((found - uv - flow).norm());
        }
    }
    assert!(errors.len() > 80, "{}", errors.len());
    let median_px = median(errors).unwrap();
    assert!(median_px < 0.1, "{median_px} px");
}

#[test]
fn beyond_the_border_there_is_no_window_and_no_match() {
    let image = scene(0.3).render(&texture(), 4);
    for uv in [Vector2::new(1.0, 100.0), Vector2::new(100.0, 238.0), Vector2::new(f64::NAN, 1.0)] {
        assert_eq!(cut(&image, &uv), None);
    }
    let towards_the_border = Vector2::new(-9.0, 0.0);
    assert_eq!(cut_moving(&image, &Vector2::new(10.0, 100.0), &towards_the_border), None);
    let mut reference = cut(&image, &Vector2::new(100.0, 100.0)).unwrap();
    assert_eq!(find(&mut reference, &image, &Vector2::new(5.0, 100.0)), None);
}

/// Median error of features after 12 images or more, in pixels.
fn drift_px(options: FrontEndOptions) -> f64 {
    let (scene, texture) = (scene(0.6), texture());
    let mut front_end = FrontEnd::new(camera_of(&scene), options);
    let mut births: Vec<(FeatureId, usize, Vector2<f64>)> = Vec::new();
    let mut errors = Vec::new();
    for index in 0..22 {
        let frame = front_end.process(&scene.render(&texture, index), index as i64, None).unwrap();
        for feature in &frame.features {
            if feature.age == 0 {
                births.push((feature.id, index, feature.uv_px));
            } else if feature.age >= 12 {
                let (_, birth, uv) = births.iter().find(|(id, ..)| *id == feature.id).unwrap();
                errors.push((feature.uv_px - scene.flow(*birth, index, uv)).norm());
            }
        }
    }
    assert!(errors.len() > 200, "{}", errors.len());
    median(errors).unwrap()
}

#[test]
fn long_tracks_do_not_drift() {
    let median_px = drift_px(FrontEndOptions::default());
    assert!(median_px < 0.07, "{median_px} px");
}

#[test]
fn new_references_add_little_drift() {
    let mut options = FrontEndOptions::default();
    options.reference.max_area_change = 1.05;
    let median_px = drift_px(options);
    assert!(median_px < 0.1, "{median_px} px");
}
