//! Errors of camera descriptions.

use thiserror::Error;

/// Why a description of a camera was refused.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum CameraError {
    /// No such projection.
    #[error("unknown camera_model '{name}': expected one of pinhole, omni, eucm, ds")]
    UnknownModel {
        /// What was written.
        name: String,
    },
    /// No such distortion.
    #[error(
        "unknown distortion_model '{name}': expected one of none, radtan, plumb_bob, rational_polynomial, equidistant, fov"
    )]
    UnknownDistortion {
        /// What was written.
        name: String,
    },
    /// A distortion that the projection does not go with.
    #[error("camera_model '{model}' does not go with distortion_model '{distortion}': it takes {expected}")]
    Combination {
        /// The projection.
        model: &'static str,
        /// The distortion.
        distortion: &'static str,
        /// What would go.
        expected: &'static str,
    },
    /// Too few or too many numbers.
    #[error("{field} of '{model}' holds {found} numbers, expected {expected}: {meaning}")]
    Count {
        /// `intrinsics` or `distortion_coeffs`.
        field: &'static str,
        /// The model they belong to.
        model: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        expected: usize,
        /// Their order.
        meaning: &'static str,
    },
    /// A number out of its range.
    #[error("{field} is {value}, expected {expected}")]
    Value {
        /// Which number.
        field: &'static str,
        /// What it is.
        value: f64,
        /// Its range.
        expected: &'static str,
    },
}
