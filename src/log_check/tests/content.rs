//! Planted faults in the content of images.

use nalgebra::{UnitQuaternion, Vector3};

use super::{Flight, MS, Noise, expect};
use crate::flight_log::MessageTimes;
use crate::frontend::readout::{RowObservation, RowTrack};
use crate::log_check::{Area, Finding, ImageRotation, Severity};
use crate::sensors::GrayImage;

/// Number of an image by its time.
fn number(millisecond: i64) -> i64 {
    millisecond / 50
}

/// Column of the scene that an image begins with; the speed changes.
fn place(number: f64) -> f64 {
    40.0 * (number / 7.0).sin()
}

/// Textured scene at a column and row, without noise.
fn scene(column: f64, row: f64) -> f64 {
    let waves = [(0.31, 0.17, 34.0), (0.13, -0.41, 26.0), (0.53, 0.29, 20.0), (-0.07, 0.11, 24.0)];
    waves.iter().map(|(across, down, height)| height * (across * column + down * row).sin()).sum::<f64>() + 120.0
}

/// Fills an image by the column, the row and the number of the image.
fn fill(image: &mut GrayImage, millisecond: i64, grey: impl Fn(f64, usize, i64) -> f64) {
    let (width, number) = (image.width, number(millisecond));
    for (index, pixel) in image.pixels.iter_mut().enumerate() {
        *pixel = grey((index % width) as f64, index / width, number) as u8;
    }
}

fn seen(column: f64, row: usize, number: f64) -> f64 {
    scene(column + place(number), row as f64)
}

fn sound(ms: i64, _: &mut MessageTimes, image: &mut GrayImage) -> bool {
    fill(image, ms, |column, row, number| seen(column, row, number as f64));
    true
}

fn mosaic(ms: i64, _: &mut MessageTimes, image: &mut GrayImage) -> bool {
    fill(image, ms, |column, row, number| {
        let gain = match (column as usize % 2, row % 2) {
            (1, 0) => 0.8,
            (0, 1) => 0.9,
            _ => 1.0,
        };
        gain * seen(column, row, number as f64)
    });
    true
}

fn interlaced(ms: i64, _: &mut MessageTimes, image: &mut GrayImage) -> bool {
    fill(image, ms, |column, row, number| seen(column, row, number as f64 + 0.5 * (row % 2) as f64));
    true
}

/// The lower part of every fourth image is the image before.
fn sometimes_torn(ms: i64, _: &mut MessageTimes, image: &mut GrayImage) -> bool {
    fill(image, ms, |column, row, number| {
        let is_before = number % 4 == 1 && row >= 70;
        seen(column, row, (number - i64::from(is_before)) as f64)
    });
    true
}

/// The lower part of each image is of the image before.
fn always_torn(ms: i64, _: &mut MessageTimes, image: &mut GrayImage) -> bool {
    fill(image, ms, |column, row, number| seen(column, row, (number - i64::from(row >= 70)) as f64));
    true
}

fn alternating(ms: i64, _: &mut MessageTimes, image: &mut GrayImage) -> bool {
    fill(image, ms, |column, row, number| {
        let gain = if number % 2 == 1 { 0.8 } else { 1.0 };
        gain * seen(column, row, number as f64)
    });
    true
}

/// Twelve bits in 16, the upper byte first.
fn big_endian(ms: i64, times: &mut MessageTimes, image: &mut GrayImage) -> bool {
    sound(ms, times, image);
    image.pixels = image.pixels.iter().flat_map(|pixel| (16 * u16::from(*pixel) + 5).to_be_bytes()).collect();
    true
}

fn little_endian(ms: i64, times: &mut MessageTimes, image: &mut GrayImage) -> bool {
    sound(ms, times, image);
    image.pixels = image.pixels.iter().flat_map(|pixel| (16 * u16::from(*pixel) + 5).to_le_bytes()).collect();
    true
}

/// Chroma, then luma of each pixel.
fn chroma_first(ms: i64, times: &mut MessageTimes, image: &mut GrayImage) -> bool {
    sound(ms, times, image);
    image.pixels = image.pixels.iter().flat_map(|pixel| [120 + pixel / 16, *pixel]).collect();
    true
}

#[test]
fn sound_images_have_no_fault_of_content() {
    for (image, encoding) in [
        (sound as fn(i64, &mut MessageTimes, &mut GrayImage) -> bool, "mono8"),
        (little_endian, "mono16"),
        (chroma_first, "yuv422"),
    ] {
        let report = Flight { image, encoding, ..Flight::default() }.check(&[]);
        assert_eq!(report.worst(), Severity::Note, "{encoding}: {report}");
    }
}

#[test]
fn broken_images_are_named() {
    let found = |image, encoding, words: &[&str]| {
        expect(&Flight { image, encoding, ..Flight::default() }, Severity::Error, words);
    };
    found(
        mosaic,
        "mono8",
        &["mosaic of a colour sensor", "1.00 0.80 and, in the row below, 0.90 1.00", "bayer_grbg8 or bayer_gbrg8"],
    );
    found(interlaced, "mono8", &["cam0 are interlaced", "odd rows are the later ones", "progressive"]);
    found(sometimes_torn, "mono8", &["images of cam0 are torn", "rows 70 to 119 of 120"]);
    found(always_torn, "mono8", &["images of cam0 are torn", "below row 69"]);
    found(big_endian, "mono16", &["both bytes of the 16-bit values of cam0 are exchanged", "is_bigendian"]);
    found(chroma_first, "yuv422_yuy2", &["luma and chroma are exchanged", "set the encoding to yuv422 "]);
}

#[test]
fn an_exposure_that_alternates_is_named() {
    let flight = Flight { image: alternating, ..Flight::default() };
    expect(&flight, Severity::Warning, &["the exposure of cam0 alternates: every second image is 20 % darker"]);
}

#[test]
fn no_geometry_is_blamed_on_broken_images() {
    let mut noise = Noise(23);
    let mut tracks = |rotation: &UnitQuaternion<f64>| {
        let observation = |bearing: Vector3<f64>| RowObservation { bearing: bearing.normalize(), row: 0.5 };
        let mut track = || {
            let point = 0.3 * noise.vector();
            let bearing = Vector3::new(point.x, point.y, 1.0);
            let now = rotation * bearing + 0.002 * noise.vector();
            RowTrack { previous: observation(bearing), now: observation(now) }
        };
        (0..60).map(|_| track()).collect()
    };
    // Rotations that the gyroscope does not measure.
    let turn = |index: i64| {
        let second_from_first = UnitQuaternion::from_euler_angles(0.03 * (0.3 * index as f64).sin(), 0.02, 0.01);
        let (from_ns, to_ns) = (index * 50 * MS, (index + 1) * 50 * MS);
        let tracks = tracks(&second_from_first);
        ImageRotation { camera_key: "cam0".to_owned(), from_ns, to_ns, second_from_first, tracks }
    };
    let turns: Vec<ImageRotation> = (0..200).map(turn).collect();
    let compared = |image| {
        let report = Flight { image, ..Flight::default() }.check(&turns);
        let is_geometry = |it: &&Finding| matches!(it.area, Area::Extrinsics | Area::Time | Area::Intrinsics);
        let texts = report.findings.iter().filter(is_geometry).map(|it| format!("{} {}", it.title, it.evidence));
        texts.filter(|text| text.contains("rotations")).collect::<Vec<String>>()
    };
    let excluded = "the rotations of cam0 are not compared the fault of its images or stamps is reported above";
    let of_sound = compared(sound);
    assert!(!of_sound.is_empty() && of_sound.iter().all(|text| text != excluded), "{of_sound:?}");
    assert_eq!(compared(mosaic), [excluded]);
    assert_eq!(compared(interlaced), [excluded]);
}
