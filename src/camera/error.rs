//! Errors of camera descriptions.

use thiserror::Error;

/// Invalid description of a camera.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CameraError {
    #[error("unknown camera_model '{name}': expected one of pinhole, omni, eucm, ds")]
    UnknownModel { name: String },
    #[error(
        "unknown distortion_model '{name}': expected one of none, radtan, plumb_bob, rational_polynomial, equidistant, fov"
    )]
    UnknownDistortion { name: String },
    #[error("camera_model '{model}' does not support distortion_model '{distortion}': expected {expected}")]
    Combination {
        model: &'static str,
        distortion: &'static str,
        /// Distortions of this projection.
        expected: &'static str,
    },
    #[error("{field} of '{model}' holds {found} numbers, expected {expected}: {meaning}")]
    Count {
        /// Key of the list: `intrinsics` or `distortion_coeffs`.
        field: &'static str,
        model: &'static str,
        found: usize,
        expected: usize,
        /// Names of the numbers, in order.
        meaning: &'static str,
    },
    #[error("{field} is {value}, expected {expected}")]
    Value { field: &'static str, value: f64, expected: &'static str },
}
