//! Reasons for which a message gives no image.

use super::limits::LogLimits;

/// Larger images are rejected: no camera has them, so the header is damaged.
const LARGEST_SIDE_PX: usize = 65_535;

/// Reason why an image message cannot be decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ImageProblem {
    /// The resolution differs from the expected one; the image was not decoded.
    OtherResolution([usize; 2]),
    Unreadable(String),
}

impl std::fmt::Display for ImageProblem {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::OtherResolution([width, height]) => write!(out, "an image of {width}×{height} pixels"),
            Self::Unreadable(problem) => out.write_str(problem),
        }
    }
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
pub(super) fn unreadable(problem: impl ToString) -> ImageProblem {
    ImageProblem::Unreadable(problem.to_string())
}

pub(super) fn check_resolution(
    claimed_px: [usize; 2],
    limits: &LogLimits,
    expected_px: Option<[usize; 2]>,
) -> Result<(), ImageProblem> {
    let [width, height] = claimed_px;
    if width == 0 || height == 0 || width > LARGEST_SIDE_PX || height > LARGEST_SIDE_PX {
        return Err(unreadable(format!("image of {width}×{height} pixels")));
    }
    if expected_px.is_some_and(|expected_px| expected_px != claimed_px) {
        return Err(ImageProblem::OtherResolution(claimed_px));
    }
    limits.check_image(claimed_px).map_err(unreadable)
}
