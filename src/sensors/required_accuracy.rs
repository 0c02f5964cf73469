//! Accuracy that the calibration must reach.

use crate::geometry::Dimension;

/// Largest standard deviation with which a calibration parameter is known well enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RequiredAccuracy {
    /// Of lengths, in metres.
    pub translation_m: f64,
    /// Of angles, in radians.
    pub rotation_rad: f64,
}

impl Default for RequiredAccuracy {
    /// 5 mm and 0.1°.
    fn default() -> Self {
        Self { translation_m: 0.005, rotation_rad: 0.1_f64.to_radians() }
    }
}

/// Required accuracy of the other parameters, each with about the effect of 0.1° on the rays of a camera: a millisecond at
/// 1.7 rad/s, a pixel at a focal length of 570 px, two thousandths of a rotation of 50°.
const TIME_S: f64 = 1e-3;
const PIXELS: f64 = 1.0;
const RATIO: f64 = 2e-3;

impl RequiredAccuracy {
    /// Largest standard deviation of a parameter, in the unit of its dimension.
    pub fn of(&self, dimension: Dimension) -> f64 {
        match dimension {
            Dimension::Length => self.translation_m,
            Dimension::Angle => self.rotation_rad,
            Dimension::Time => TIME_S,
            Dimension::Pixel => PIXELS,
            Dimension::Ratio => RATIO,
        }
    }
}
