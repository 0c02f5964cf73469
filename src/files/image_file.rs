//! Compressed images decoded within limits, and the reasons for which there is no image.

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader as CodecReader, Limits};

use super::limits::{LogLimits, can_hold_image};

/// Larger images are rejected: no camera has them, so the header is damaged.
const LARGEST_SIDE_PX: usize = 65_535;
/// Memory limit of the decoders per pixel: 16 bits of red, green, blue and alpha.
const DECODER_BYTES_PER_PIXEL: u64 = 8;

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
pub(crate) fn unreadable(problem: impl ToString) -> ImageProblem {
    ImageProblem::Unreadable(problem.to_string())
}

pub(crate) fn check_resolution(
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

/// Decodes a compressed image if its number of bytes and the limits allow the resolution in its header.
pub(crate) fn decode_within(
    data: &[u8],
    codec: ImageFormat,
    limits: &LogLimits,
    expected_px: Option<[usize; 2]>,
) -> Result<DynamicImage, ImageProblem> {
    let damaged = |error| unreadable(format!("damaged {codec:?} of {} bytes ({error})", data.len()));
    let mut decoder_limits = Limits::default();
    decoder_limits.max_alloc = Some(limits.image_pixels().saturating_mul(DECODER_BYTES_PER_PIXEL));
    let mut reader = CodecReader::with_format(Cursor::new(data), codec);
    reader.limits(decoder_limits);
    let decoder = reader.into_decoder().map_err(damaged)?;
    let (width, height) = decoder.dimensions();
    let claimed_px = [width as usize, height as usize];
    check_resolution(claimed_px, limits, expected_px)?;
    if !can_hold_image(data.len(), claimed_px) {
        return Err(unreadable(format!("a header of {width}×{height} pixels in {codec:?} of {} bytes", data.len())));
    }
    DynamicImage::from_decoder(decoder).map_err(damaged)
}
