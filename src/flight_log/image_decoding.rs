//! Decoding of images to gray values.

use std::io::Cursor;

use image::{DynamicImage, ImageDecoder as _, ImageFormat, ImageReader as CodecReader, Limits};

use super::FlightLog;
use super::bit_depth::BitDepth;
use super::image_problem::{ImageProblem, check_resolution, unreadable};
use super::limits::{LogLimits, can_hold_image};
use super::messages::{ImageMessage, MessageKind, read_compressed_image, read_image, read_video_packet};
use super::raw_encoding::{RawEncoding, luma};
use super::video::VideoDecoder;
use crate::sensors::GrayImage;

/// Memory limit of the decoders per pixel: 16 bits of red, green, blue and alpha.
const DECODER_BYTES_PER_PIXEL: u64 = 8;
/// First bytes of a PNG file.
const PNG: [u8; 4] = [0x89, b'P', b'N', b'G'];

/// Bits in use by the images of a topic, from its first image that can be decoded; 16 without one.
pub(crate) fn bit_depth_of_topic(log: &FlightLog, topic: &str, kind: MessageKind) -> BitDepth {
    let limits = log.file().limits();
    log.find_message(topic, |message| bit_depth_of_message(kind, message, limits)).unwrap_or_default()
}

/// Bits in use by one image message; `None` when it cannot be decoded or is black. Images of 8 bits have the default.
pub(crate) fn bit_depth_of_message(kind: MessageKind, message: &[u8], limits: &LogLimits) -> Option<BitDepth> {
    if kind.is_video() {
        return Some(BitDepth::default());
    }
    let brightest = if kind == MessageKind::Image {
        let raw = read_image(message).ok()?;
        match RawEncoding::from_name(raw.encoding) {
            Some(encoding) if encoding.is_wide() => encoding.brightest(&raw)?,
            _ => return Some(BitDepth::default()),
        }
    } else {
        let (_, data) = read_compressed_image(message).ok()?;
        if !data.starts_with(&PNG) {
            return Some(BitDepth::default());
        }
        match decode_within(data, ImageFormat::Png, limits, None).ok()? {
            DynamicImage::ImageLuma16(gray) => gray.into_raw().into_iter().max()?,
            _ => return Some(BitDepth::default()),
        }
    };
    BitDepth::of_brightest(brightest)
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
