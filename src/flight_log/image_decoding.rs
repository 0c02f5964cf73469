//! Decoding of images to grey levels.

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader as CodecReader, Limits};

use super::FlightLog;
use super::limits::{LogLimits, can_hold_image};
use super::messages::{ImageMessage, MessageKind, read_compressed_image, read_image};
use crate::sensors::GrayImage;

/// Larger images are refused: no camera has them, so the header is damaged.
const LARGEST_SIDE_PX: usize = 65_535;
/// Bytes that the decoders may take for a pixel: 16 bits of red, green, blue and opacity.
const DECODER_BYTES_PER_PIXEL: u64 = 8;
/// The first bytes of every PNG.
const PNG: [u8; 4] = [0x89, b'P', b'N', b'G'];

/// Number of bits that a camera uses of a 16-bit grey level: its sensor has 8, 10, 12, 14 or 16.
///
/// A 12-bit sensor leaves the upper four at zero, and the upper eight of its 16 bits have 16 grey levels only. So the
/// eight bits below the highest one in use are taken, determined by the brightest pixel of the topic's first image: the
/// same for all images of a log, wherever reading starts. Brighter pixels of later images saturate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BitDepth(u32);

impl Default for BitDepth {
    fn default() -> Self {
        Self(16)
    }
}

impl BitDepth {
    /// From the first image of a topic that can be decoded; 16 without one.
    pub(crate) fn of_topic(log: &FlightLog, topic: &str, kind: MessageKind) -> Self {
        let limits = log.file().limits();
        log.find_message(topic, |message| Self::of(kind, message, limits)).unwrap_or_default()
    }

    /// From one image message; `None` when it cannot be decoded or is black. Images of 8 bits have the default.
    pub(crate) fn of(kind: MessageKind, message: &[u8], limits: &LogLimits) -> Option<Self> {
        let brightest = if kind == MessageKind::Image {
            let raw = read_image(message).ok()?;
            if !matches!(raw.encoding, "mono16" | "16UC1") {
                return Some(Self::default());
            }
            let value = |pair: &[u8]| wide_value([pair[0], pair[1]], raw.big_endian);
            raw.data.chunks_exact(2).map(value).max()?
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
        let used = u16::BITS - brightest.leading_zeros();
        (used > 0).then(|| Self(used.next_multiple_of(2).max(8)))
    }

    /// Number of bits, 8 to 16.
    pub(crate) fn bits(self) -> u32 {
        self.0
    }

    fn narrowed(self, value: u16) -> u8 {
        u8::try_from(value >> (self.0 - 8)).unwrap_or(u8::MAX)
    }
}

fn wide_value(pair: [u8; 2], big_endian: bool) -> u16 {
    if big_endian { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) }
}

/// Why an image message gives no image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum ImageProblem {
    /// It has another resolution than the expected one; it was not decoded.
    OtherResolution([usize; 2]),
    /// What is wrong with it.
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
fn unreadable(problem: impl ToString) -> ImageProblem {
    ImageProblem::Unreadable(problem.to_string())
}

/// Decodes a raw or compressed image message into 8-bit grey levels, when it has the expected resolution, if there is one.
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
    let (format, data) = read_compressed_image(message).map_err(unreadable)?;
    gray_from_compressed(format, data, depth, limits, expected_px)
}

/// Checks the resolution that an image claims.
fn check_resolution(
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

/// What to do about an encoding that is not read.
fn encoding_remedy(encoding: &str) -> &'static str {
    if encoding.starts_with("bayer_") {
        "a color filter mosaic: record the driver's mono8 or rgb8, or the debayered topic of image_proc (image_mono)"
    } else if encoding.starts_with("yuv") || encoding == "uyvy" || encoding == "yuyv" {
        "record the driver's mono8 or rgb8, or convert it with image_proc"
    } else if encoding.starts_with("32F") || encoding.starts_with("64F") {
        "numbers such as depths, no grey levels: name the topic of the camera's images"
    } else {
        "expected mono8, 8UC1, mono16, 16UC1, rgb8, bgr8 or 8UC3"
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
    let bytes_per_pixel = match raw.encoding {
        "mono8" | "8UC1" => 1,
        "mono16" | "16UC1" => 2,
        "rgb8" | "bgr8" | "8UC3" => 3,
        other => return Err(unreadable(format!("image encoding {other:?} is not read: {}", encoding_remedy(other)))),
    };
    let row_bytes = width * bytes_per_pixel;
    if raw.step < row_bytes || raw.data.len() < raw.step.saturating_mul(height - 1).saturating_add(row_bytes) {
        return Err(unreadable(format!(
            "{} bytes with {} per row for {width}×{height} {}, expected at least {}",
            raw.data.len(),
            raw.step,
            raw.encoding,
            row_bytes * height
        )));
    }
    let mut pixels = Vec::with_capacity(width * height);
    for row in raw.data.chunks(raw.step).take(height) {
        let row = &row[..row_bytes];
        match raw.encoding {
            "mono16" | "16UC1" => {
                let value = |pair: &[u8]| depth.narrowed(wide_value([pair[0], pair[1]], raw.big_endian));
                pixels.extend(row.chunks_exact(2).map(value));
            }
            "rgb8" => pixels.extend(row.chunks_exact(3).map(|rgb| luma(rgb[0], rgb[1], rgb[2]))),
            "bgr8" | "8UC3" => pixels.extend(row.chunks_exact(3).map(|bgr| luma(bgr[2], bgr[1], bgr[0]))),
            _ => pixels.extend_from_slice(row),
        }
    }
    Ok(GrayImage { width, height, pixels })
}

/// Grey level of a colour, rounded (ITU-R BT.601, as in JPEG).
fn luma(red: u8, green: u8, blue: u8) -> u8 {
    ((u32::from(red) * 19_595 + u32::from(green) * 38_470 + u32::from(blue) * 7_471 + 32_768) >> 16) as u8
}

/// Decodes a compressed image whose header claims a resolution that its bytes and the limits allow.
fn decode_within(
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

/// The codec of a compressed image, known by its first bytes.
fn codec_of(data: &[u8]) -> Option<ImageFormat> {
    match data {
        [0xFF, 0xD8, ..] => Some(ImageFormat::Jpeg),
        _ if data.starts_with(&PNG) => Some(ImageFormat::Png),
        _ => None,
    }
}

/// Name of the format of a compressed image in a message, `None` when it is of no format that is read.
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
    // The format field is free text ("jpeg", "rgb8; jpeg compressed bgr8"), the bytes are not.
    let codec = codec_of(data).ok_or_else(|| {
        unreadable(format!("{} bytes of format {format:?} that are neither JPEG nor PNG", data.len()))
    })?;
    let image = decode_within(data, codec, limits, expected_px)?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let pixels = match image {
        DynamicImage::ImageLuma8(gray) => gray.into_raw(),
        DynamicImage::ImageLuma16(gray) => gray.into_raw().into_iter().map(|value| depth.narrowed(value)).collect(),
        other => other.into_rgb8().into_raw().chunks_exact(3).map(|rgb| luma(rgb[0], rgb[1], rgb[2])).collect(),
    };
    Ok(GrayImage { width, height, pixels })
}
