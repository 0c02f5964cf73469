mod appearance;
mod corners;
mod following;
mod front_end;
mod homography;
mod motion;
mod perspective;
mod products;
mod readout;
mod reference;
mod stereo;

use nalgebra::Vector2;

use crate::camera::CameraModel;
use crate::sensors::GrayImage;
use homography::{Scene, Texture};

/// Plane with rich texture in front of a small camera.
fn scene(motion_scale: f64) -> Scene {
    Scene { width: 320, height: 240, focal_px: 200.0, motion_scale, noise: 2.0, flicker: 0.0 }
}

fn texture() -> Texture {
    Texture::new(1024, 3)
}

fn camera_of(scene: &Scene) -> CameraModel {
    let matrix = scene.camera_matrix();
    let intrinsics_px = [matrix[(0, 0)], matrix[(1, 1)], matrix[(0, 2)], matrix[(1, 2)]];
    CameraModel::pinhole(intrinsics_px, [scene.width, scene.height]).unwrap()
}

/// Points along the four borders, at distance `inset_px` from them.
fn rim(scene: &Scene, inset_px: f64) -> impl Iterator<Item = Vector2<f64>> {
    let (right, bottom) = ((scene.width - 1) as f64, (scene.height - 1) as f64);
    (0..40).flat_map(move |k| {
        let (x, y) = (right * f64::from(k) / 39.0, bottom * f64::from(k) / 39.0);
        [
            Vector2::new(x, inset_px),
            Vector2::new(x, bottom - inset_px),
            Vector2::new(inset_px, y),
            Vector2::new(right - inset_px, y),
        ]
    })
}

fn blank(scene: &Scene) -> GrayImage {
    GrayImage { width: scene.width, height: scene.height, pixels: vec![90; scene.width * scene.height] }
}
