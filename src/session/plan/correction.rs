//! Corrections of measurements: what a fork assumes to be wrong in the recording or its rig.

use std::fmt;
use std::str::FromStr;

use nalgebra::Vector2;

use crate::geometry::SignedAxes;
use crate::text::Named;

/// Assumed error of the measurements, undone before the estimator uses them.
#[derive(Clone, Debug, PartialEq)]
pub enum MeasurementCorrection {
    /// Factor on the focal lengths of the rig's main camera.
    Focal(f64),
    /// Factor by which the focal lengths of the main camera change over a number of seconds from the fork's first step on.
    Zoom(f64, f64),
    /// Images of the main camera are mirrored or upside down.
    Image(ImageFlip),
    /// A part of the main camera's images is not used.
    Ignored(ImageHalf),
    /// Addition to `timeshift_cam_imu` of all cameras, in seconds.
    CameraShift(f64),
    /// Addition to `timeshift_gimbal_imu`, in seconds.
    JointShift(f64),
    /// The named joint counts in the other direction.
    Reversed(String),
    /// Two joints have each other's readings.
    Swapped(String, String),
    /// Addition to the readings of the named joint, in radians.
    Offset(String, f64),
    /// Factor on the readings of all joints.
    JointScale(f64),
    /// Axes of gyroscope and accelerometer.
    ImuAxes(SignedAxes),
    GyroscopeAxes(SignedAxes),
    AccelerometerAxes(SignedAxes),
    /// Factor on the angular velocities.
    GyroscopeScale(f64),
    /// Factor on the specific forces.
    AccelerometerScale(f64),
}

/// Image operation that undoes a camera mounted or recorded the other way around.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFlip {
    /// Left and right exchanged.
    Mirrored,
    /// Top and bottom exchanged.
    Flipped,
    /// Rotated by 180°.
    UpsideDown,
}

impl Named for ImageFlip {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Mirrored, "mirrored"), (Self::Flipped, "flipped"), (Self::UpsideDown, "upside-down")];
}

/// Half of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageHalf {
    Left,
    Right,
    Top,
    Bottom,
}

impl Named for ImageHalf {
    const NAMES: &'static [(Self, &'static str)] =
        &[(Self::Left, "left"), (Self::Right, "right"), (Self::Top, "top"), (Self::Bottom, "bottom")];
}

impl ImageHalf {
    /// True for a pixel in this half of an image of this resolution.
    pub fn contains(self, uv_px: &Vector2<f64>, resolution_px: [usize; 2]) -> bool {
        let [width, height] = resolution_px.map(|size| size as f64);
        match self {
            Self::Left => uv_px.x < 0.5 * width,
            Self::Right => uv_px.x >= 0.5 * width,
            Self::Top => uv_px.y < 0.5 * height,
            Self::Bottom => uv_px.y >= 0.5 * height,
        }
    }
}

impl fmt::Display for MeasurementCorrection {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Focal(factor) => write!(out, "focal:{factor}"),
            Self::Zoom(factor, over_s) => write!(out, "zoom:{factor}:{over_s}s"),
            Self::Image(flip) => write!(out, "image:{}", flip.name()),
            Self::Ignored(half) => write!(out, "ignored:{}", half.name()),
            Self::CameraShift(shift_s) => write!(out, "camera-shift:{shift_s}s"),
            Self::JointShift(shift_s) => write!(out, "joint-shift:{shift_s}s"),
            Self::Reversed(joint) => write!(out, "reversed:{joint}"),
            Self::Swapped(first, second) => write!(out, "swapped:{first}:{second}"),
            Self::Offset(joint, offset_rad) => write!(out, "offset:{joint}:{offset_rad}rad"),
            Self::JointScale(factor) => write!(out, "joint-scale:{factor}"),
            Self::ImuAxes(axes) => write!(out, "imu-axes:{axes}"),
            Self::GyroscopeAxes(axes) => write!(out, "gyroscope-axes:{axes}"),
            Self::AccelerometerAxes(axes) => write!(out, "accelerometer-axes:{axes}"),
            Self::GyroscopeScale(factor) => write!(out, "gyroscope-scale:{factor}"),
            Self::AccelerometerScale(factor) => write!(out, "accelerometer-scale:{factor}"),
        }
    }
}

/// Names of the corrections with their values, for messages.
const FORMS: &str = "focal:FACTOR, zoom:FACTOR:1s, image:mirrored|flipped|upside-down, ignored:left|right|top|bottom, camera-shift:15ms, \
                     joint-shift:15ms, reversed:JOINT, swapped:JOINT:JOINT, offset:JOINT:20deg, joint-scale:FACTOR, \
                     imu-axes:y/x/-z, gyroscope-axes:…, accelerometer-axes:…, gyroscope-scale:FACTOR, \
                     accelerometer-scale:FACTOR";

impl FromStr for MeasurementCorrection {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let unknown = || format!("'{text}' is no correction; expected one of {FORMS}");
        let (name, value) = text.split_once(':').ok_or_else(unknown)?;
        let two = || value.rsplit_once(':').ok_or_else(unknown);
        Ok(match name {
            "focal" => Self::Focal(factor(value)?),
            "zoom" => {
                let (by, over) = two()?;
                let over_s = quantity(over, &[("ms", 1e-3), ("s", 1.0)], 60.0, "a time of at most 60 s, as in 1s")?;
                Self::Zoom(factor(by)?, over_s.max(0.0))
            }
            "image" => Self::Image(ImageFlip::from_name(value).ok_or_else(unknown)?),
            "ignored" => Self::Ignored(ImageHalf::from_name(value).ok_or_else(unknown)?),
            "camera-shift" => Self::CameraShift(shift_s(value)?),
            "joint-shift" => Self::JointShift(shift_s(value)?),
            "reversed" => Self::Reversed(value.to_owned()),
            "swapped" => two().map(|(first, second)| Self::Swapped(first.to_owned(), second.to_owned()))?,
            "offset" => {
                let (joint, angle) = two()?;
                let units = [("deg", std::f64::consts::PI / 180.0), ("mrad", 1e-3), ("rad", 1.0)];
                Self::Offset(
                    joint.to_owned(),
                    quantity(angle, &units, 10.0, "an angle of at most 10 rad, as in 20deg")?,
                )
            }
            "joint-scale" => Self::JointScale(factor(value)?),
            "imu-axes" => Self::ImuAxes(value.parse()?),
            "gyroscope-axes" => Self::GyroscopeAxes(value.parse()?),
            "accelerometer-axes" => Self::AccelerometerAxes(value.parse()?),
            "gyroscope-scale" => Self::GyroscopeScale(factor(value)?),
            "accelerometer-scale" => Self::AccelerometerScale(factor(value)?),
            _ => return Err(unknown()),
        })
    }
}

fn factor(text: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().filter(|factor| (1e-3..=1e3).contains(factor));
    value.ok_or_else(|| format!("'{text}' is no factor from 0.001 to 1000"))
}

fn shift_s(text: &str) -> Result<f64, String> {
    quantity(text, &[("ms", 1e-3), ("s", 1.0)], LONGEST_SHIFT_S, "a time of at most 50 ms, as in 15ms")
}

/// Longest shift of a clock, in seconds: samples of that time around an image are at hand.
pub(in crate::session) const LONGEST_SHIFT_S: f64 = 0.05;

/// Number with a unit, of at most `largest` in the unit of size 1.
fn quantity(text: &str, units: &[(&str, f64)], largest: f64, expected: &str) -> Result<f64, String> {
    let found = units.iter().find_map(|(unit, size)| Some((text.strip_suffix(unit)?, *size)));
    let value = found.and_then(|(digits, size)| digits.trim().parse::<f64>().ok().map(|value| value * size));
    value.filter(|value| value.abs() <= largest).ok_or_else(|| format!("'{text}' is not {expected}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corrections_are_read_as_they_are_written() {
        for text in [
            "focal:0.77",
            "zoom:1.5:1.25s",
            "image:upside-down",
            "ignored:top",
            "camera-shift:0.015s",
            "joint-shift:-0.03s",
            "reversed:yaw",
            "swapped:yaw:pitch",
            "offset:yaw:0.35rad",
            "joint-scale:57.3",
            "imu-axes:y/x/-z",
            "gyroscope-axes:-x/y/z",
            "accelerometer-axes:z/x/y",
            "gyroscope-scale:0.5",
            "accelerometer-scale:9.81",
        ] {
            assert_eq!(text.parse::<MeasurementCorrection>().unwrap().to_string(), text);
        }
        assert_eq!("camera-shift:15ms".parse(), Ok(MeasurementCorrection::CameraShift(0.015)));
        for (text, word) in [
            ("focus:2", "'focus:2' is no correction"),
            ("focal:0", "'0' is no factor"),
            ("focal:NaN", "no factor"),
            ("camera-shift:2s", "at most 50 ms"),
            ("imu-axes:x/x/z", "no axes"),
            ("offset:yaw", "no correction"),
        ] {
            let problem = text.parse::<MeasurementCorrection>().unwrap_err();
            assert!(problem.contains(word), "{text}: {problem}");
        }
    }
}
