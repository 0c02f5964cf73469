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
    /// Distortion that is not defined for the projection.
    #[error("camera_model '{model}' does not support distortion_model '{distortion}': expected {expected}")]
    Combination {
        model: &'static str,
        distortion: &'static str,
        /// Distortions of this projection.
        expected: &'static str,
    },
    #[error("{field} of '{model}' holds {found} numbers, expected {expected}: {meaning}")]
    Count {
        /// `intrinsics` or `distortion_coeffs`.
        field: &'static str,
        model: &'static str,
        found: usize,
        expected: usize,
        /// Names of the numbers, in order.
        meaning: &'static str,
    },
    /// Number out of its range.
    #[error("{field} is {value}, expected {expected}")]
    Value {
        field: &'static str,
        value: f64,
        /// Valid range.
        expected: &'static str,
    },
}
