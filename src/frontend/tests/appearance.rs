//! Windows read from an image and compared.

use nalgebra::{Matrix2, Vector2, Vector6};

use super::{scene, texture};
use crate::frontend::appearance::{Appearance, Rows, SIDE};
use crate::frontend::filters::{CENTRE, LANES, WINDOW};
use crate::frontend::pyramid::cut_out;
use crate::frontend::resample::Patch;
use crate::sensors::GrayImage;

fn read(image: &GrayImage, warp: &Matrix2<f64>, middle: &Vector2<f64>) -> Option<Rows> {
    let mut window = [[0.0; LANES]; WINDOW];
    Patch::new().read(image, warp, middle, 0.0, &mut window).then_some(window)
}

/// Window around a whole pixel, prepared for comparison; `None` without texture.
fn appearance_at(image: &GrayImage, [x, y]: [i32; 2]) -> Option<Appearance> {
    let mut pixels = [[0.0; SIDE]; SIDE];
    cut_out(image, [x - SIDE as i32 / 2, y - SIDE as i32 / 2], &mut pixels, f32::from);
    Appearance::new(&pixels)
}

/// Correlation and step of the window around `middle` with grey levels times `gain` plus `offset`.
fn compare(
    appearance: &Appearance,
    image: &GrayImage,
    middle: &Vector2<f64>,
    [gain, offset]: [f32; 2],
) -> (f64, Vector6<f64>) {
    let mut window = read(image, &Matrix2::identity(), middle).unwrap();
    for value in window.iter_mut().flat_map(|line| &mut line[..WINDOW]) {
        *value = gain * *value + offset - appearance.level();
    }
    appearance.compare(&window).unwrap()
}

#[test]
fn a_window_of_a_plane_is_the_plane() {
    let grey = |x: f64, y: f64| 20.0 + 1.5 * x + 0.5 * y;
    let pixels = (0..80 * 120).map(|index| grey(f64::from(index % 120), f64::from(index / 120)).round() as u8);
    let image = GrayImage { width: 120, height: 80, pixels: pixels.collect() };
    let middle = Vector2::new(58.37, 41.68);
    for warp in [Matrix2::identity(), Matrix2::new(1.3, -0.2, 0.1, 0.9), Matrix2::new(0.2, -1.1, 1.2, 0.1)] {
        let window = read(&image, &warp, &middle).unwrap();
        for (row, line) in window.iter().enumerate() {
            for (column, value) in line[..WINDOW].iter().enumerate() {
                let step = Vector2::new(column as f64 - CENTRE as f64, row as f64 - CENTRE as f64);
                let at = middle + warp * step;
                // Pixels are rounded; positions are rounded to a 128th of a pixel.
                assert!((f64::from(*value) - grey(at.x, at.y)).abs() < 0.7, "{value} at {at}");
            }
            assert!(line[WINDOW..].iter().all(|surplus| *surplus == 0.0));
        }
    }
}

#[test]
fn a_window_beyond_the_image_or_too_large_is_none() {
    let image = GrayImage { width: 400, height: 400, pixels: vec![9; 400 * 400] };
    let still = Matrix2::identity();
    assert!(read(&image, &still, &Vector2::new(200.0, 200.0)).is_some());
    assert!(read(&image, &still, &Vector2::new(11.0, 386.99)).is_some());
    for middle in [(10.9, 200.0), (200.0, 387.0), (-1e9, 3.0), (f64::NAN, 200.0), (f64::INFINITY, 200.0)] {
        assert!(read(&image, &still, &Vector2::new(middle.0, middle.1)).is_none(), "{middle:?}");
    }
    assert!(read(&image, &Matrix2::new(4.0, 0.0, 0.0, 0.25), &Vector2::new(200.0, 200.0)).is_none());
}

#[test]
fn window_comparison_ignores_brightness_and_detects_shifts() {
    let image = scene(0.3).render(&texture(), 4);
    let middle = Vector2::new(150.0, 120.0);
    let appearance = appearance_at(&image, [150, 120]).unwrap();
    for brightness in [[1.0, 0.0], [0.6, 70.0], [1.4, -30.0]] {
        let (correlation, step) = compare(&appearance, &image, &middle, brightness);
        assert!((correlation - 1.0).abs() < 1e-4 && step.norm() < 1e-3, "{correlation} {step}");
        let shift = Vector2::new(0.25, -0.125);
        let (correlation, step) = compare(&appearance, &image, &(middle + shift), brightness);
        let error = (step.fixed_rows::<2>(0) - shift).norm();
        assert!(correlation > 0.8 && error < 0.1, "{correlation} {step}");
    }
    assert!(Appearance::new(&[[80.0; SIDE]; SIDE]).is_none(), "no texture");
}

/// Waves of 4 to 5 px, shifted by `shift` pixels to the left and up.
fn fine_texture(shift: Vector2<f64>) -> GrayImage {
    const SIZE: usize = 64;
    let waves = [(1.3, 0.2), (-0.4, 1.2), (0.9, 0.9), (1.0, -1.0)];
    let grey = |index: usize| {
        let at = Vector2::new((index % SIZE) as f64, (index / SIZE) as f64) + shift;
        let sum: f64 = waves.iter().map(|(along, down)| (along * at.x + down * at.y).sin()).sum();
        (128.0 + 30.0 * sum).round() as u8
    };
    GrayImage { width: SIZE, height: SIZE, pixels: (0..SIZE * SIZE).map(grey).collect() }
}

#[test]
fn a_step_on_fine_texture_is_as_long_as_the_shift() {
    let appearance = appearance_at(&fine_texture(Vector2::zeros()), [32, 32]).unwrap();
    for shift in [(0.3, 0.0), (0.0, -0.3), (0.25, 0.25), (-0.45, 0.1)].map(|(x, y)| Vector2::new(x, y)) {
        let (_, step) = compare(&appearance, &fine_texture(shift), &Vector2::new(32.0, 32.0), [1.0, 0.0]);
        let ratio = step.fixed_rows::<2>(0).dot(&shift) / shift.norm_squared();
        assert!((ratio - 1.0).abs() < 0.15, "{ratio} of {shift}");
    }
}
