//! Motion tracker against known motion.

use nalgebra::Vector2;

use super::homography::Scene;
use super::{blank, rim, scene, texture};
use crate::frontend::Pyramid;
use crate::frontend::lucas_kanade::{LucasKanadeOptions, track};
use crate::geometry::median;
use crate::sensors::GrayImage;

fn pyramid(image: &GrayImage) -> Pyramid {
    let mut pyramid = Pyramid::default();
    pyramid.build(image, LucasKanadeOptions::default().levels);
    pyramid
}

/// Lattice of points of image `from` that are visible in image `to`.
fn common_points(scene: &Scene, from: usize, to: usize) -> Vec<Vector2<f64>> {
    let lattice = (0..scene.height).step_by(17).flat_map(|y| (0..scene.width).step_by(17).map(move |x| (x, y)));
    lattice
        .map(|(x, y)| Vector2::new(x as f64 + 0.3, y as f64 + 0.6))
        .filter(|uv| scene.sees(uv) && scene.sees(&scene.flow(from, to, uv)))
        .collect()
}

/// Tracks the lattice from image 4 to image 5 and checks the ratio of tracked points and the median error.
fn check(scene: &Scene, min_ratio: f64, largest_median_px: f64) {
    let texture = texture();
    let (previous, now) = (pyramid(&scene.render(&texture, 4)), pyramid(&scene.render(&texture, 5)));
    let points = common_points(scene, 4, 5);
    let options = LucasKanadeOptions::default();
    let found: Vec<_> = points.iter().map(|uv| (uv, track(&previous, &now, uv, uv, &options))).collect();
    let errors: Vec<f64> =
        found.iter().filter_map(|(uv, found)| Some((found.as_ref()? - scene.flow(4, 5, uv)).norm())).collect();
    let ratio = errors.len() as f64 / points.len() as f64;
    assert!(points.len() > 150, "{} points", points.len());
    assert!(ratio >= min_ratio, "only {ratio} of {} points are tracked", points.len());
    let wrong = errors.iter().filter(|error| **error > 1.0).count();
    assert!(wrong * 200 <= errors.len(), "{wrong} of {} are wrong", errors.len());
    let median_px = median(errors).unwrap();
    assert!(median_px <= largest_median_px, "median error {median_px} px");
}

#[test]
fn slow_motion_is_followed_to_a_twentieth_of_a_pixel() {
    check(&scene(0.3), 0.99, 0.06);
}

#[test]
fn fast_motion_is_followed_without_a_prediction() {
    check(&scene(2.0), 0.96, 0.16);
}

#[test]
fn changing_gain_and_offset_do_not_matter() {
    check(&Scene { flicker: 0.3, ..scene(0.3) }, 0.98, 0.08);
}

#[test]
fn without_noise_the_error_is_negligible() {
    check(&Scene { noise: 0.0, ..scene(0.1) }, 0.99, 0.03);
}

#[test]
fn points_at_the_border_are_tracked() {
    let scene = scene(0.3);
    let texture = texture();
    let (previous, now) = (pyramid(&scene.render(&texture, 4)), pyramid(&scene.render(&texture, 5)));
    let rim: Vec<_> = rim(&scene, 2.0).filter(|uv| scene.sees(&scene.flow(4, 5, uv))).collect();
    let options = LucasKanadeOptions::default();
    let errors: Vec<f64> = rim
        .iter()
        .filter_map(|uv| Some((track(&previous, &now, uv, uv, &options)? - scene.flow(4, 5, uv)).norm()))
        .collect();
    assert!(rim.len() > 60 && errors.len() * 10 >= rim.len() * 9, "{} of {}", errors.len(), rim.len());
    assert!(median(errors).unwrap() < 0.15);
}

#[test]
fn nothing_is_followed_without_texture_or_out_of_the_image() {
    let scene = scene(0.3);
    let (empty, full) = (pyramid(&blank(&scene)), pyramid(&scene.render(&texture(), 4)));
    let options = LucasKanadeOptions::default();
    let centre = Vector2::new(160.0, 120.0);
    for (previous, now) in [(&empty, &empty), (&empty, &full), (&full, &empty)] {
        assert_eq!(track(previous, now, &centre, &centre, &options), None);
    }
    for lost in [Vector2::new(-500.0, 20.0), Vector2::new(1e9, 1e9), Vector2::new(f64::NAN, 3.0)] {
        assert_eq!(track(&full, &full, &centre, &lost, &options), None, "{lost}");
        assert_eq!(track(&full, &full, &lost, &centre, &options), None, "{lost}");
    }
    assert_eq!(track(&Pyramid::default(), &full, &centre, &centre, &options), None);
}

#[test]
fn tiny_images_have_fewer_levels() {
    for (width, height) in [(1, 1), (3, 2), (17, 40), (64, 64)] {
        let image = GrayImage { width, height, pixels: (0..width * height).map(|k| (k * 37 % 251) as u8).collect() };
        let pyramid = pyramid(&image);
        assert_eq!(pyramid.levels()[0], image);
        let (mut width, mut height) = (width, height);
        for level in &pyramid.levels()[1..] {
            (width, height) = (width.div_ceil(2), height.div_ceil(2));
            assert_eq!((level.width, level.height, level.pixels.len()), (width, height, width * height));
        }
        let uv = Vector2::new(0.4 * width as f64, 0.5 * height as f64);
        let found = track(&pyramid, &pyramid, &uv, &uv, &LucasKanadeOptions::default());
        assert!(found.is_none_or(|found| (found - uv).norm() < 1e-3));
    }
}

#[test]
fn halving_keeps_a_ramp() {
    let image =
        GrayImage { width: 41, height: 33, pixels: (0..41 * 33).map(|k| (4 * (k % 41) + k / 41) as u8).collect() };
    let pyramid = pyramid(&image);
    let half = &pyramid.levels()[1];
    assert_eq!((half.width, half.height), (21, 17));
    for y in 1..half.height - 1 {
        for x in 1..half.width - 1 {
            assert_eq!(usize::from(half.pixels[y * half.width + x]), 8 * x + 2 * y);
        }
    }
}
