//! Matches of a stereo pair on rendered images.

use nalgebra::{UnitQuaternion, Vector3};

use super::{camera_of, scene, texture};
use crate::frontend::{FrontEnd, FrontEndOptions, StereoCamera, StereoMatcher};
use crate::geometry::{RigidTransform, median, so3};
use crate::sensors::{GrayImage, ImageMask};

/// Pose of the camera of image 0 in the frame of the camera of another image, in distances of the plane.
fn here_from_features(other: usize) -> RigidTransform {
    let scene = scene(1.0);
    let [from, to] = [0, other].map(|index| scene.camera_from_plane(index));
    let rotation = UnitQuaternion::from_rotation_matrix(&(to * from.inverse()));
    RigidTransform::new(rotation, scene.translation(other) - rotation * scene.translation(0))
}

#[test]
fn matches_lie_at_the_true_pixels_and_a_wrong_pose_has_none() {
    let (scene, texture) = (scene(1.0), texture());
    let camera = camera_of(&scene);
    let other = 6;
    let mut front_end = FrontEnd::new(camera.clone(), FrontEndOptions::default());
    let tracks = front_end.process(&scene.render(&texture, 0), 0, None).unwrap();
    let image = scene.render(&texture, other);
    let stereo = |here_from_features, mask| StereoCamera {
        model: camera.clone(),
        mask,
        here_from_features,
        orientation_sigma_rad: 0.001,
    };
    let pose = here_from_features(other);
    let mut matcher = StereoMatcher::new(camera.clone(), stereo(pose, None));
    let found = matcher.match_features(front_end.last_image(), &image, &tracks.features);
    assert!(found.len() * 10 > tracks.features.len() * 7, "{} of {}", found.len(), tracks.features.len());
    assert!(found.is_sorted_by(|one, other| one.id < other.id));
    let errors = found.iter().map(|found| {
        let own = tracks.features.iter().find(|feature| feature.id == found.id).unwrap();
        (found.uv_px - scene.flow(0, other, &own.uv_px)).norm()
    });
    let errors: Vec<f64> = errors.collect();
    let typical_px = median(errors.iter().copied()).unwrap();
    assert!(typical_px < 0.15, "{typical_px}");
    assert!(errors.iter().all(|error| *error < 1.0), "{errors:?}");
    // The second time, matches start at the known distances.
    let again = matcher.match_features(front_end.last_image(), &image, &tracks.features);
    assert!(again.len() + 3 > found.len(), "{} of {}", again.len(), found.len());

    let rolled = RigidTransform::new(so3::exp(&Vector3::new(0.0, 0.0, 0.2)) * pose.rotation, pose.translation_m);
    let mut matcher = StereoMatcher::new(camera.clone(), stereo(rolled, None));
    let wrong = matcher.match_features(front_end.last_image(), &image, &tracks.features);
    assert!(wrong.len() * 5 < found.len(), "{} of {} with a wrong pose", wrong.len(), found.len());

    let white = ImageMask::from_image(&GrayImage { pixels: vec![255; image.pixels.len()], ..image.clone() });
    let mut matcher = StereoMatcher::new(camera.clone(), stereo(pose, Some(white)));
    assert!(matcher.match_features(front_end.last_image(), &image, &tracks.features).is_empty(), "masked");
    let small = GrayImage { width: 8, height: 8, pixels: vec![0; 64] };
    assert!(matcher.match_features(front_end.last_image(), &small, &tracks.features).is_empty(), "another size");
}
