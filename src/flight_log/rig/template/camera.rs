//! Camera models before a calibration: from a field of view in degrees, or from the one that a manufacturer publishes.

use std::str::FromStr;

use super::TemplateError;
use crate::camera::{CameraModel, Distortion, Projection};
use crate::text::nearest_name;

/// Horizontal field of view from which a lens is assumed equidistant: no rectilinear lens of a camera is wider.
const WIDEST_RECTILINEAR_DEG: f64 = 110.0;
/// Aspect ratios that differ by less are equal.
const ASPECT_TOLERANCE: f64 = 0.03;

/// Source of a camera model.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraChoice {
    /// Horizontal field of view in degrees.
    FieldOfView(f64),
    /// Camera with a published field of view.
    Published(PublishedCamera),
    /// `CameraInfo` of the log: on this topic, or on the one next to the images.
    CameraInfo(Option<String>),
}

/// Camera with a published field of view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedCamera {
    name: &'static str,
    lens: PublishedLens,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum PublishedLens {
    /// Horizontal fields of view in degrees of `GoPro`'s video modes in 16:9 and 4:3, the latter if it is published.
    Video { wide_deg: f64, tall_deg: Option<f64>, fisheye: bool },
    /// Diagonal field of view in degrees of photos with this aspect ratio, as DJI publishes it.
    PhotoDiagonal { deg: f64, aspect: [f64; 2] },
}

const fn video(name: &'static str, wide_deg: f64, tall_deg: Option<f64>, fisheye: bool) -> PublishedCamera {
    PublishedCamera { name, lens: PublishedLens::Video { wide_deg, tall_deg, fisheye } }
}

const fn photo(name: &'static str, deg: f64, aspect: [f64; 2]) -> PublishedCamera {
    PublishedCamera { name, lens: PublishedLens::PhotoDiagonal { deg, aspect } }
}

impl PublishedCamera {
    /// All cameras. Sources: `GoPro`'s support pages "Field of View (FOV) Information" of each model (stabilization
    /// off), and the specifications of DJI's aircraft.
    pub const ALL: [Self; 29] = [
        video("gopro-hero3-wide", 118.2, Some(122.6), true),
        video("gopro-hero3-medium", 94.4, Some(94.4), true),
        video("gopro-hero3-narrow", 64.4, Some(64.6), true),
        video("gopro-hero4-wide", 118.2, Some(122.6), true),
        video("gopro-hero4-medium", 94.4, Some(94.4), true),
        video("gopro-hero4-narrow", 64.4, Some(64.6), true),
        video("gopro-hero5-wide", 118.2, Some(122.6), true),
        video("gopro-hero5-linear", 86.0, None, false),
        video("gopro-hero6-wide", 118.2, Some(122.6), true),
        video("gopro-hero6-linear", 86.0, None, false),
        video("gopro-hero7-wide", 118.2, Some(122.6), true),
        video("gopro-hero7-linear", 86.0, None, false),
        video("gopro-hero8-wide", 118.0, Some(122.0), true),
        video("gopro-hero9-wide", 118.0, Some(122.0), true),
        video("gopro-hero9-linear", 92.0, None, false),
        video("gopro-hero10-wide", 118.0, Some(122.0), true),
        video("gopro-hero10-linear", 92.0, None, false),
        photo("dji-phantom-4", 94.0, [4.0, 3.0]),
        photo("dji-phantom-4-pro", 84.0, [3.0, 2.0]),
        photo("dji-mavic-pro", 78.8, [4.0, 3.0]),
        photo("dji-mavic-2-pro", 77.0, [3.0, 2.0]),
        photo("dji-mavic-3", 84.0, [4.0, 3.0]),
        photo("dji-mavic-air", 85.0, [4.0, 3.0]),
        photo("dji-mavic-air-2", 84.0, [4.0, 3.0]),
        photo("dji-air-2s", 88.0, [3.0, 2.0]),
        photo("dji-mini-2", 83.0, [4.0, 3.0]),
        photo("dji-mini-3-pro", 82.1, [4.0, 3.0]),
        photo("dji-m30-wide", 84.0, [4.0, 3.0]),
        photo("dji-h20-wide", 82.9, [4.0, 3.0]),
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        self.name
    }

    /// Horizontal field of view in degrees for images of an aspect ratio (width by height), true for a fisheye lens,
    /// and the assumptions.
    fn horizontal(self, aspect: f64) -> (f64, bool, String) {
        match self.lens {
            PublishedLens::Video { wide_deg, tall_deg, fisheye } => {
                let (wide, tall) = (16.0 / 9.0, 4.0 / 3.0);
                let known = match tall_deg {
                    Some(deg) if (aspect - tall).abs() < (aspect - wide).abs() => (tall, deg, "4:3"),
                    _ => (wide, wide_deg, "16:9"),
                };
                let other = (aspect / known.0 - 1.0).abs() > ASPECT_TOLERANCE;
                let other = if other { ", another aspect ratio than that of the images" } else { "" };
                let reason = format!(
                    "published field of view of {} ({}° across in {}{other}), stabilization off and no zoom",
                    self.name, known.1, known.2
                );
                (known.1, fisheye, reason)
            }
            PublishedLens::PhotoDiagonal { deg, aspect: [width, height] } => {
                let half_width = (0.5 * deg.to_radians()).tan() * width / width.hypot(height);
                let reason = format!(
                    "published field of view of {} ({deg}° diagonal in {width:.0}:{height:.0} photos), images taken over the \
                     whole width of the sensor",
                    self.name
                );
                (2.0 * half_width.atan().to_degrees(), false, reason)
            }
        }
    }
}

impl FromStr for CameraChoice {
    type Err = TemplateError;

    /// Parses `fov:DEG`, `info`, `info:TOPIC`, or the name of a published camera.
    fn from_str(text: &str) -> Result<Self, TemplateError> {
        let (kind, value) = text.split_once([':', '=', ' ']).unwrap_or((text, ""));
        match kind.to_ascii_lowercase().as_str() {
            "fov" => {
                let deg = value.trim().trim_end_matches('°').parse::<f64>().ok();
                let deg = deg.filter(|deg| (1.0..=220.0).contains(deg));
                deg.map(Self::FieldOfView).ok_or_else(|| TemplateError::FieldOfView { given: text.to_owned() })
            }
            "info" | "camerainfo" => {
                let topic = value.trim();
                Ok(Self::CameraInfo((!topic.is_empty()).then(|| topic.to_owned())))
            }
            name => {
                let found = PublishedCamera::ALL.into_iter().find(|camera| camera.name == name);
                found.map(Self::Published).ok_or_else(|| {
                    let names = PublishedCamera::ALL.iter().map(|camera| camera.name);
                    TemplateError::UnknownCamera {
                        given: text.to_owned(),
                        nearest: nearest_name(name, names).map_or("", |(_, name)| name),
                    }
                })
            }
        }
    }
}

/// Model of a lens with this horizontal field of view, without distortion or equidistant, and its principal point in
/// the middle.
fn lens(horizontal_deg: f64, fisheye: bool, resolution_px: [usize; 2]) -> CameraModel {
    let [width, height] = resolution_px.map(|side| side as f64);
    let half_rad = 0.5 * horizontal_deg.to_radians();
    let focal_px = 0.5 * width / if fisheye { half_rad } else { half_rad.tan() };
    // Pixel centres lie at integers.
    let centre = [0.5 * (width - 1.0), 0.5 * (height - 1.0)];
    let rounded_px = (focal_px * 100.0).round() / 100.0;
    CameraModel {
        projection: Projection::Pinhole,
        distortion: if fisheye { Distortion::Equidistant([0.0; 4]) } else { Distortion::None },
        intrinsics_px: [rounded_px, rounded_px, centre[0], centre[1]],
        resolution_px,
    }
}

/// Model of a camera with this horizontal field of view for images of this size, and the assumptions.
pub(super) fn of_field_of_view(horizontal_deg: f64, resolution_px: [usize; 2]) -> (CameraModel, String) {
    let fisheye = horizontal_deg > WIDEST_RECTILINEAR_DEG;
    let shape = if fisheye { "an equidistant lens" } else { "a lens without distortion" };
    let reason = format!("from a field of view of {horizontal_deg}° across and {shape}, principal point in the middle");
    (lens(horizontal_deg, fisheye, resolution_px), reason)
}

/// Model of a published camera for images of this size, and the assumptions.
pub(super) fn of_published(camera: PublishedCamera, resolution_px: [usize; 2]) -> (CameraModel, String) {
    let [width, height] = resolution_px.map(|side| side as f64);
    let (horizontal_deg, fisheye, reason) = camera.horizontal(width / height);
    (lens(horizontal_deg, fisheye, resolution_px), reason)
}
