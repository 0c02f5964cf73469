//! Decoding of images to gray values.

use image::{DynamicImage, ImageFormat};

use super::raw_encoding::{RawEncoding, luma};
use crate::files::LogLimits;
use crate::files::image_file::{ImageProblem, check_resolution, decode_within, unreadable};
use crate::flight_log::grey_levels::Narrowing;
use crate::flight_log::messages::{ImageMessage, MessageKind, read_compressed_image, read_image, read_video_packet};
use crate::flight_log::video::VideoDecoder;
use crate::sensors::GrayImage;

/// First bytes of a PNG file.
const PNG: [u8; 4] = [0x89, b'P', b'N', b'G'];

/// Gray values of an image message with more than 8 bits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum WideValues {
    /// 16 bits per value.
    Of(Vec<u16>),
    /// The image has 8 bits, or is a frame of a video, which states its bits.
    Narrow,
}

/// Gray values of an image message before they are converted to 8 bits; `None` when it cannot be decoded.
pub(crate) fn wide_values(kind: MessageKind, message: &[u8], limits: &LogLimits) -> Option<WideValues> {
    if kind.is_video() {
        return Some(WideValues::Narrow);
    }
    if kind == MessageKind::Image {
        let raw = read_image(message).ok()?;
        let encoding = checked_encoding(&raw, limits, None).ok()?;
        return Some(if encoding.is_wide() { WideValues::Of(encoding.values(&raw)) } else { WideValues::Narrow });
    }
    let (_, data) = read_compressed_image(message).ok()?;
    if !data.starts_with(&PNG) {
        return Some(WideValues::Narrow);
    }
    let image = decode_within(data, ImageFormat::Png, limits, None).ok()?;
    Some(wide_gray(image).map_or(WideValues::Narrow, WideValues::Of))
}

/// Gray values of an image as its encoding states them, and with the bytes in the other order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct ByteOrders {
    pub(crate) stored: Vec<u16>,
    /// With both bytes of each value exchanged; of packed YUV, the chroma in place of the luma.
    pub(crate) exchanged: Vec<u16>,
}

/// Gray values of an image message in both orders of its bytes; `None` for values of one byte that are not packed YUV.
pub(crate) fn byte_orders(kind: MessageKind, message: &[u8], limits: &LogLimits) -> Option<ByteOrders> {
    if kind == MessageKind::Image {
        let raw = read_image(message).ok()?;
        let encoding = checked_encoding(&raw, limits, None).ok()?;
        return Some(ByteOrders { exchanged: encoding.exchanged(&raw)?, stored: encoding.values(&raw) });
    }
    match wide_values(kind, message, limits)? {
        WideValues::Of(stored) => {
            Some(ByteOrders { exchanged: stored.iter().map(|value| value.swap_bytes()).collect(), stored })
        }
        WideValues::Narrow => None,
    }
}

/// Gray values of a decoded image with 16 bits per sample, or the image itself.
fn wide_gray(image: DynamicImage) -> Result<Vec<u16>, DynamicImage> {
    match image {
        DynamicImage::ImageLuma16(gray) => Ok(gray.into_raw()),
        DynamicImage::ImageLumaA16(_) | DynamicImage::ImageRgb16(_) | DynamicImage::ImageRgba16(_) => {
            let color = |rgb: &[u16]| luma([rgb[0], rgb[1], rgb[2]]);
            Ok(image.into_rgb16().into_raw().chunks_exact(3).map(color).collect())
        }
        other => Err(other),
    }
}

/// Decodes a raw or compressed image message, or a keyframe of a video, into 8-bit gray values. If a resolution is
/// expected, other resolutions are an error.
///
/// The resolution is read before anything is allocated.
pub(crate) fn decode_image(
    kind: MessageKind,
    message: &[u8],
    narrowing: Narrowing,
    limits: &LogLimits,
    expected_px: Option<[usize; 2]>,
) -> Result<GrayImage, ImageProblem> {
    if kind == MessageKind::Image {
        return gray_from_raw(&read_image(message).map_err(unreadable)?, narrowing, limits, expected_px);
    }
    if kind.is_video() {
        let packet = read_video_packet(kind, message).map_err(unreadable)?;
        return VideoDecoder::new(packet.codec().map_err(unreadable)?, limits).decode(packet.data, expected_px);
    }
    let (format, data) = read_compressed_image(message).map_err(unreadable)?;
    gray_from_compressed(format, data, narrowing, limits, expected_px)
}

/// Width and height of an image message in pixels, by its header if it has one; `None` when it cannot be read.
pub(crate) fn image_size(kind: MessageKind, message: &[u8], limits: &LogLimits) -> Option<[usize; 2]> {
    if kind == MessageKind::Image {
        let raw = read_image(message).ok()?;
        return checked_encoding(&raw, limits, None).ok().map(|_| [raw.width, raw.height]);
    }
    let image = decode_image(kind, message, Narrowing::default(), limits, None).ok()?;
    Some([image.width, image.height])
}

fn encoding_remedy(encoding: &str) -> &'static str {
    if encoding.starts_with("32F") || encoding.starts_with("64F") {
        "numbers such as depths, not gray values: give the topic of the camera's images"
    } else {
        "expected mono8, mono16, rgb8, bgr8, rgba8, bgra8, rgb16, bgr16, yuv422, yuyv, nv12, bayer_* or 8UC1 to 16UC4"
    }
}

fn gray_from_raw(
    raw: &ImageMessage<'_>,
    narrowing: Narrowing,
    limits: &LogLimits,
    expected_px: Option<[usize; 2]>,
) -> Result<GrayImage, ImageProblem> {
    let encoding = checked_encoding(raw, limits, expected_px)?;
    Ok(GrayImage { width: raw.width, height: raw.height, pixels: encoding.gray(raw, narrowing) })
}

/// Encoding of a raw image that has all of its pixels.
fn checked_encoding(
    raw: &ImageMessage<'_>,
    limits: &LogLimits,
    expected_px: Option<[usize; 2]>,
) -> Result<RawEncoding, ImageProblem> {
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
    Ok(encoding)
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
    narrowing: Narrowing,
    limits: &LogLimits,
    expected_px: Option<[usize; 2]>,
) -> Result<GrayImage, ImageProblem> {
    // The format field is free text ("jpeg", "rgb8; jpeg compressed bgr8"), so the bytes decide.
    let codec = codec_of(data).ok_or_else(|| {
        unreadable(format!("{} bytes of format {format:?} that are neither JPEG nor PNG", data.len()))
    })?;
    let image = decode_within(data, codec, limits, expected_px)?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let pixels = match wide_gray(image) {
        Ok(values) => values.into_iter().map(|value| narrowing.narrowed(value)).collect(),
        Err(DynamicImage::ImageLuma8(gray)) => gray.into_raw(),
        Err(other) => {
            let color = |rgb: &[u8]| luma([rgb[0], rgb[1], rgb[2]].map(u16::from)) as u8;
            other.into_rgb8().into_raw().chunks_exact(3).map(color).collect()
        }
    };
    Ok(GrayImage { width, height, pixels })
}
