//! Complete front end on rendered sequences.

use nalgebra::{UnitQuaternion, Vector3};

use super::homography::{Scene, Texture};
use super::{blank, camera_of, scene, texture};
use crate::frontend::corners::CornerOptions;
use crate::frontend::{FeatureId, FrontEnd, FrontEndError, FrontEndOptions, PredictedRotation, TrackedFrame};
use crate::geometry::{median, so3};
use crate::sensors::{GrayImage, ImageMask};

fn front_end(scene: &Scene) -> FrontEnd {
    let corners = CornerOptions { max_features: 60, min_distance_px: 18.0, ..Default::default() };
    FrontEnd::new(camera_of(scene), FrontEndOptions { corners, ..Default::default() })
}

/// Standard deviation of the predictions.
const PREDICTION_SIGMA_RAD: f64 = 0.01;

/// True `camera_now_from_camera_previous` between two images of a scene.
fn rotation_between(scene: &Scene, previous: usize, now: usize) -> UnitQuaternion<f64> {
    let rotation = scene.camera_from_plane(now) * scene.camera_from_plane(previous).inverse();
    UnitQuaternion::from_rotation_matrix(&rotation)
}

/// Processes images `indices` of a scene; `prediction` gives the rotation between two of them.
fn play(
    scene: &Scene,
    texture: &Texture,
    indices: &[usize],
    prediction: impl Fn(usize, usize) -> Option<UnitQuaternion<f64>>,
) -> Vec<TrackedFrame> {
    let mut front_end = front_end(scene);
    let mut frames = Vec::new();
    for (k, index) in indices.iter().enumerate() {
        let predicted = if k == 0 { None } else { prediction(indices[k - 1], *index) };
        let predicted = predicted.map(|rotation| PredictedRotation::isotropic(rotation, PREDICTION_SIGMA_RAD));
        let image = scene.render(texture, *index);
        frames.push(front_end.process(&image, *index as i64, predicted.as_ref()).unwrap());
    }
    frames
}

/// Errors of the tracked features' motion between two consecutive images.
fn errors(scene: &Scene, previous: &TrackedFrame, now: &TrackedFrame) -> Vec<f64> {
    let tracked = now.features.iter().filter_map(|feature| Some((feature, feature.previous_uv_px?)));
    let error = tracked.map(|(feature, before)| {
        let ground_truth = scene.flow(previous.stamp_ns as usize, now.stamp_ns as usize, &before);
        (feature.uv_px - ground_truth).norm()
    });
    error.collect()
}

fn check_contract(scene: &Scene, frames: &[TrackedFrame]) {
    let camera = camera_of(scene);
    for pair in frames.windows(2) {
        let (previous, now) = (&pair[0], &pair[1]);
        let statistics = &now.statistics;
        assert!(now.features.is_sorted_by(|a, b| a.id < b.id));
        assert_eq!(statistics.tracked + statistics.detected, now.features.len());
        assert_eq!(statistics.tracked + statistics.lost + statistics.rejected, previous.features.len());
        for feature in &now.features {
            let before = previous.features.iter().find(|before| before.id == feature.id);
            assert_eq!(feature.previous_uv_px, before.map(|before| before.uv_px));
            assert_eq!(feature.age, before.map_or(0, |before| before.age + 1));
            assert!((feature.bearing.norm() - 1.0).abs() < 1e-12);
            assert!((camera.project(&feature.bearing).unwrap() - feature.uv_px).norm() < 1e-6);
        }
    }
}

#[test]
fn features_are_followed_through_a_sequence() {
    let (scene, texture) = (scene(0.4), texture());
    let indices: Vec<usize> = (0..12).collect();
    let frames = play(&scene, &texture, &indices, |_, _| None);
    check_contract(&scene, &frames);
    assert_eq!(frames[0].statistics.detected, 60);
    assert_eq!(frames[0].statistics.tracked, 0);
    for pair in frames.windows(2) {
        let errors = errors(&scene, &pair[0], &pair[1]);
        assert!(errors.len() >= 50, "{:?}", pair[1].statistics);
        assert!(errors.iter().filter(|error| **error > 1.0).count() <= 1);
        assert!(median(errors).unwrap() < 0.08);
        assert_eq!(pair[1].features.len(), 60);
    }
}

#[test]
fn equal_images_give_equal_bits_also_in_a_clone() {
    let (scene, texture) = (scene(1.0), texture());
    let images: Vec<GrayImage> = (0..5).map(|index| scene.render(&texture, index)).collect();
    let mut original = front_end(&scene);
    for (index, image) in images[..3].iter().enumerate() {
        original.process(image, index as i64, None).unwrap();
    }
    let mut clone = original.clone();
    for (index, image) in images[3..].iter().enumerate() {
        let (first, second) = (original.process(image, index as i64, None), clone.process(image, index as i64, None));
        assert_eq!(first, second);
    }
}

#[test]
fn dropped_images_are_bridged_by_the_prediction() {
    let (scene, texture) = (scene(1.4), texture());
    let indices = [0, 1, 2, 6, 7];
    let frames = play(&scene, &texture, &indices, |previous, now| Some(rotation_between(&scene, previous, now)));
    check_contract(&scene, &frames);
    let jump = &frames[3];
    assert!(jump.statistics.median_flow_px > 25.0, "{:?}", jump.statistics);
    assert!(jump.statistics.tracked >= 25, "{:?}", jump.statistics);
    assert!(median(errors(&scene, &frames[2], jump)).unwrap() < 0.3);
}

#[test]
fn a_wrong_prediction_loses_few() {
    let (scene, texture) = (scene(0.6), texture());
    let indices: Vec<usize> = (0..6).collect();
    let right = play(&scene, &texture, &indices, |previous, now| Some(rotation_between(&scene, previous, now)));
    for error in [Vector3::new(0.0, 0.08, 0.0), Vector3::new(-0.06, 0.0, 0.06), Vector3::new(0.3, 0.5, 0.0)] {
        let wrong = play(&scene, &texture, &indices, |previous, now| {
            Some(so3::exp(&error) * rotation_between(&scene, previous, now))
        });
        check_contract(&scene, &wrong);
        for (right, wrong) in right[1..].iter().zip(&wrong[1..]) {
            let (right, wrong) = (right.statistics.tracked, wrong.statistics.tracked);
            assert!(wrong * 10 >= right * 9, "{wrong} instead of {right} with an error of {error}");
        }
    }
}

#[test]
fn tracking_survives_a_flash_and_a_blank_image() {
    let (scene, texture) = (scene(0.3), texture());
    let mut front_end = front_end(&scene);
    front_end.process(&scene.render(&texture, 0), 0, None).unwrap();
    let mut bright = scene.render(&texture, 1);
    bright.pixels.iter_mut().for_each(|pixel| *pixel = (f64::from(*pixel) * 1.25 + 12.0).min(255.0) as u8);
    let after_flash = front_end.process(&bright, 1, None).unwrap();
    assert!(after_flash.statistics.tracked >= 52, "{:?}", after_flash.statistics);
    let nothing = front_end.process(&blank(&scene), 2, None).unwrap();
    assert_eq!(nothing.features, []);
    assert_eq!(nothing.statistics.lost, after_flash.features.len());
    let again = front_end.process(&scene.render(&texture, 3), 3, None).unwrap();
    assert_eq!(again.statistics.detected, 60);
    assert!(again.features.iter().all(|feature| feature.id >= FeatureId(60)), "ids are not used twice");
}

#[test]
fn images_of_another_size_are_refused_and_change_nothing() {
    let (scene, texture) = (scene(0.3), texture());
    let mut front_end = front_end(&scene);
    let image = scene.render(&texture, 0);
    front_end.process(&image, 0, None).unwrap();
    let small = GrayImage { width: 160, height: 120, pixels: vec![0; 160 * 120] };
    let error = FrontEndError::ImageSize { width: 160, height: 120, expected_width: 320, expected_height: 240 };
    assert_eq!(front_end.process(&small, 1, None), Err(error));
    let short = GrayImage { width: 320, height: 240, pixels: vec![0; 17] };
    let error = FrontEndError::PixelCount { width: 320, height: 240, pixels: 17 };
    assert_eq!(front_end.process(&short, 1, None), Err(error));
    assert_eq!(front_end.process(&image, 1, None).unwrap().statistics.tracked, 60);
}

#[test]
fn nothing_is_tracked_under_a_mask() {
    let (scene, texture) = (scene(0.4), texture());
    let [width, height] = camera_of(&scene).resolution_px;
    // Right third, and a bar across the middle.
    let masked =
        |index: usize| 3 * (index % width) >= 2 * width || (height / 2..height / 2 + 12).contains(&(index / width));
    let pixels = (0..width * height).map(|index| if masked(index) { 255 } else { 0 }).collect();
    let mask = ImageMask::from_image(&GrayImage { width, height, pixels });
    let play = |mask: Option<ImageMask>| {
        let mut front_end = front_end(&scene).with_mask(mask);
        let frames =
            (0..10).map(|index| front_end.process(&scene.render(&texture, index), index as i64, None).unwrap());
        frames.collect::<Vec<_>>()
    };
    let (free, covered) = (play(None), play(Some(mask.clone())));
    let under = |frames: &[TrackedFrame]| {
        frames.iter().flat_map(|frame| &frame.features).filter(|feature| mask.covers(&feature.uv_px)).count()
    };
    assert!(under(&free) > 100, "{} features lie there without a mask", under(&free));
    assert_eq!(under(&covered), 0);
    // Elsewhere features are tracked as before.
    let tracked: usize = covered[1..].iter().map(|frame| frame.statistics.tracked).sum();
    assert!(tracked > 200, "{tracked} features followed");
    // An empty mask changes nothing.
    let empty = ImageMask::from_image(&blank(&scene));
    assert_eq!(play(Some(empty)), free);
}
