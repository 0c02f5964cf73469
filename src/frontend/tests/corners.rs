use nalgebra::Vector2;

use super::{blank, scene, texture};
use crate::frontend::corners::{CornerDetector, CornerOptions};
use crate::sensors::GrayImage;

fn detect(image: &GrayImage, existing: &[Vector2<f64>], options: &CornerOptions) -> Vec<Vector2<f64>> {
    let mut found = Vec::new();
    CornerDetector::default().detect(image, existing.iter().copied(), options, None, &mut found);
    found
}

/// Dark image with bright squares, and the squares' corners.
fn chessboard_of_one(squares: &[(usize, usize, u8)]) -> (GrayImage, Vec<Vector2<f64>>) {
    let (width, height, side) = (200, 160, 24);
    let mut image = GrayImage { width, height, pixels: vec![40; width * height] };
    let mut corners = Vec::new();
    for (left, top, grey) in squares {
        for y in *top..top + side {
            image.pixels[y * width + left..][..side].fill(*grey);
        }
        for (x, y) in [(0, 0), (side, 0), (0, side), (side, side)] {
            corners.push(Vector2::new((left + x) as f64 - 0.5, (top + y) as f64 - 0.5));
        }
    }
    (image, corners)
}

#[test]
fn weak_corners_are_found_beside_strong_ones() {
    let (image, corners) = chessboard_of_one(&[(30, 30, 250), (120, 90, 56)]);
    let options = CornerOptions { min_distance_px: 10.0, ..Default::default() };
    let found = detect(&image, &[], &options);
    assert_eq!(found.len(), corners.len(), "{found:?}");
    for corner in corners {
        let nearest = found.iter().map(|uv| (uv - corner).norm()).fold(f64::INFINITY, f64::min);
        assert!(nearest < 2.5, "{corner:?} is {nearest} px from the nearest");
    }
}

#[test]
fn new_corners_keep_their_distance_from_all_features() {
    let image = scene(1.0).render(&texture(), 0);
    let options = CornerOptions { max_features: 60, min_distance_px: 20.0, ..Default::default() };
    let existing = [Vector2::new(50.0, 60.0), Vector2::new(200.0, 100.0), Vector2::new(319.0, 239.0)];
    let found = detect(&image, &existing, &options);
    assert_eq!(found.len() + existing.len(), options.max_features);
    for (index, uv) in found.iter().enumerate() {
        for other in existing.iter().chain(&found[..index]) {
            assert!((uv - other).norm() >= 20.0);
        }
        assert!(uv.x >= 7.5 && uv.y >= 7.5 && uv.x <= 311.5 && uv.y <= 231.5, "{uv}");
    }
    assert!(detect(&image, &found, &CornerOptions { max_features: found.len(), ..options }).is_empty());
}

#[test]
fn features_are_spread_although_one_half_has_more_contrast() {
    let mut image = scene(1.0).render(&texture(), 0);
    for line in image.pixels.chunks_mut(320) {
        for pixel in &mut line[160..] {
            *pixel = 128 + (*pixel / 3) - 42;
        }
    }
    let found = detect(&image, &[], &CornerOptions { max_features: 60, min_distance_px: 15.0, ..Default::default() });
    let right = found.iter().filter(|uv| uv.x > 165.0).count();
    assert_eq!(found.len(), 60);
    assert!((18..=36).contains(&right), "{right} in the right half");
}

#[test]
fn an_image_of_noise_or_nothing_has_no_corners() {
    let scene = super::Scene { noise: 1.5, ..scene(1.0) };
    let noise = scene.render(&texture().flattened(), 0);
    for image in [blank(&scene), noise, GrayImage { width: 5, height: 4, pixels: vec![7; 20] }] {
        assert!(detect(&image, &[], &CornerOptions::default()).is_empty());
    }
}
