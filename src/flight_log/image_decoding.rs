//! Decoding of images to gray values.

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader as CodecReader, Limits};

use super::FlightLog;
use super::limits::{LogLimits, can_hold_image};
use super::messages::{ImageMessage, MessageKind, read_compressed_image, read_image, read_video_packet};
use super::raw_encoding::{RawEncoding, luma};
use super::video::VideoDecoder;
use crate::sensors::GrayImage;

/// Larger images are rejected: no camera has them, so the header is damaged.
const LARGEST_SIDE_PX: usize = 65_535;
/// Memory limit of the decoders per pixel: 16 bits of red, green, blue and alpha.
const DECODER_BYTES_PER_PIXEL: u64 = 8;
/// First bytes of a PNG file.
const PNG: [u8; 4] = [0x89, b'P', b'N', b'G'];

/// Number of bits that a camera uses of a 16-bit gray value: its sensor has 8, 10, 12, 14 or 16.
///
/// A 12-bit sensor leaves the upper four bits at zero, so that the upper eight bits have 16 values only. Therefore the
/// eight bits below the highest used bit are taken. The brightest pixel of the topic's first image determines that bit:
/// the same for all images of a log, wherever reading starts. Brighter pixels of later images saturate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BitDepth(u32);

impl Default for BitDepth {
    fn default() -> Self {
        Self(16)
    }
}

impl BitDepth {
    /// Bit depth of the first image of a topic that can be decoded; 16 without one.
    pub(crate) fn of_topic(log: &FlightLog, topic: &str, kind: MessageKind) -> Self {
        let limits = log.file().limits();
        log.find_message(topic, |message| Self::of(kind, message, limits)).unwrap_or_default()
    }

    /// Bit depth of one image message; `None` if it cannot be decoded or is black. Images of 8 bits have the default.
    pub(crate) fn of(kind: MessageKind, message: &[u8], limits: &LogLimits) -> Option<Self> {
        if kind.is_video() {
            return Some(Self::default());
        }
        let brightest = if kind == MessageKind::Image {
            let raw = read_image(message).ok()?;
            match RawEncoding::from_name(raw.encoding) {
                Some(encoding) if encoding.is_wide() => encoding.brightest(&raw)?,
                _ => return Some(Self::default()),
            }
        } else {
            let (_, data) = read_compressed_image(message).ok()?;
            if !data.starts_with(&PNG) {
                return Some(Self::default());
            }
            match decode_within(data, ImageFormat::Png, limits, None).ok()? {
                DynamicImage::ImageLuma16(gray) => gray.into_raw().into_iter().max()?,
                _ => return Some(Self::default()),
            }
        };
        Self::of_brightest(brightest)
    }

    /// Bit depth for the brightest pixel of an image; `None` if it is black.
    pub(super) fn of_brightest(brightest: u16) -> Option<Self> {
        let used = u16::BITS - brightest.leading_zeros();
        (used > 0).then(|| Self(used.next_multiple_of(2).max(8)))
    }

    /// Number of bits, 8 to 16.
    pub(crate) fn bits(self) -> u32 {
        self.0
    }

    /// Converts a 16-bit gray value to 8 bits.
    pub(super) fn narrowed(self, value: u16) -> u8 {
        u8::try_from(value >> (self.0 - 8)).unwrap_or(u8::MAX)
    }
}

/// Reason why an image message cannot be decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ImageProblem {
    /// The resolution differs from the expected one; the image was not decoded.
    OtherResolution([usize; 2]),
    /// Description of the problem.
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

/// Decodes a raw or compressed image message, or a keyframe of a video, into 8-bit gray values. If a resolution is
/// expected, other resolutions are an error.
///
/// The resolution is read before anything is allocated.
pub(crate) fn decode_image(
    kind: MessageKind,
    message: &[u8],
    depth: BitDepth,
    limits: &LogLimits,
    expected_px: Option<[usize; 2]>,
) -> Result<GrayImage, ImageProblem> {
    if kind == MessageKind::Image {
        return gray_from_raw(&read_image(message).map_err(unreadable)?, depth, limits, expected_px);
    }
    if kind.is_video() {
        let packet = read_video_packet(kind, message).map_err(unreadable)?;
        return VideoDecoder::new(packet.codec().map_err(unreadable)?, limits).decode(packet.data, expected_px);
    }
    let (format, data) = read_compressed_image(message).map_err(unreadable)?;
    gray_from_compressed(format, data, depth, limits, expected_px)
}

/// Checks the resolution in an image's header.
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

/// Remedy for an unsupported encoding.
fn encoding_remedy(encoding: &str) -> &'static str {
    if encoding.starts_with("32F") || encoding.starts_with("64F") {
        "numbers such as depths, not gray values: give the topic of the camera's images"
    } else {
        "expected mono8, mono16, rgb8, bgr8, rgba8, bgra8, rgb16, bgr16, yuv422, yuyv, nv12, bayer_* or 8UC1 to 16UC4"
    }
}

fn gray_from_raw(
    raw: &ImageMessage<'_>,
    depth: BitDepth,
    limits: &LogLimits,
    expected_px: Option<[usize; 2]>,
) -> Result<GrayImage, ImageProblem> {
    let (width, height) = (raw.width, raw.height);
    check_resolution([width, height], limits, expected_px)?;
    let name = raw.encoding;
    let encoding = RawEncoding::from_name(name)
        .ok_or_else(|| unreadable(format!("image encoding {name:?} is not read: {}", encoding_remedy(name))))?;
    if width.min(height) < encoding.smallest_side_px() {
        return Err(unreadable(format!("{name} image of {width}×{height} pixels")));
    }
    let row_bytes = encoding.row_bytes(width);
    if raw.step < row_bytes || raw.data.len() < raw.step.saturating_mul(height - 1).saturating_add(row_bytes) {
        return Err(unreadable(format!(
            "{} bytes with {} per row for {width}×{height} {}, expected at least {}",
            raw.data.len(),
            raw.step,
            raw.encoding,
            row_bytes * height
        )));
    }
    Ok(GrayImage { width, height, pixels: encoding.gray(raw, depth) })
}

/// Decodes a compressed image if its number of bytes and the limits allow the resolution in its header.
pub(super) fn decode_within(
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

/// Codec of a compressed image, by its first bytes.
fn codec_of(data: &[u8]) -> Option<ImageFormat> {
    match data {
        [0xFF, 0xD8, ..] => Some(ImageFormat::Jpeg),
        _ if data.starts_with(&PNG) => Some(ImageFormat::Png),
        _ => None,
    }
}

/// Format name of a compressed image in a message, `None` for an unsupported format.
pub(crate) fn compressed_format(data: &[u8]) -> Option<&'static str> {
    codec_of(data).map(|codec| if codec == ImageFormat::Png { "png" } else { "jpeg" })
}

fn gray_from_compressed(
    format: &str,
    data: &[u8],
    depth: BitDepth,
    limits: &LogLimits,
    expected_px: Option<[usize; 2]>,
) -> Result<GrayImage, ImageProblem> {
    // The format field is free text ("jpeg", "rgb8; jpeg compressed bgr8"), so the bytes decide.
    let codec = codec_of(data).ok_or_else(|| {
        unreadable(format!("{} bytes of format {format:?} that are neither JPEG nor PNG", data.len()))
    })?;
    let image = decode_within(data, codec, limits, expected_px)?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let pixels = match image {
        DynamicImage::ImageLuma8(gray) => gray.into_raw(),
        DynamicImage::ImageLuma16(gray) => gray.into_raw().into_iter().map(|value| depth.narrowed(value)).collect(),
        other => {
            let color = |rgb: &[u8]| luma([rgb[0], rgb[1], rgb[2]].map(u16::from)) as u8;
            other.into_rgb8().into_raw().chunks_exact(3).map(color).collect()
        }
    };
    Ok(GrayImage { width, height, pixels })
}
