//! Decoding of images to grey levels.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat, ImageReader as CodecReader, Limits};

use super::FlightLog;
use super::messages::{ImageMessage, MessageKind, read_compressed_image, read_image};
use crate::sensors::GrayImage;

/// Largest side of an image; a larger one in a header is damage.
const MAX_SIDE_PX: usize = 16_384;
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
        log.find_message(topic, |message| Self::of(kind, message)).unwrap_or_default()
    }

    /// From one image message; `None` when it cannot be decoded or is black. Images of 8 bits have the default.
    pub(crate) fn of(kind: MessageKind, message: &[u8]) -> Option<Self> {
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
            match decoder(data, ImageFormat::Png).decode().ok()? {
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

/// Decodes a raw or compressed image message into 8-bit grey levels; the error names the problem.
pub(crate) fn decode_image(kind: MessageKind, message: &[u8], depth: BitDepth) -> Result<GrayImage, String> {
    if kind == MessageKind::Image {
        return gray_from_raw(&read_image(message).map_err(|error| error.to_string())?, depth);
    }
    let (format, data) = read_compressed_image(message).map_err(|error| error.to_string())?;
    gray_from_compressed(format, data, depth)
}

fn gray_from_raw(raw: &ImageMessage<'_>, depth: BitDepth) -> Result<GrayImage, String> {
    let (width, height) = (raw.width, raw.height);
    if width == 0 || height == 0 || width > MAX_SIDE_PX || height > MAX_SIDE_PX {
        return Err(format!("image of {width}×{height} pixels"));
    }
    let bytes_per_pixel = match raw.encoding {
        "mono8" | "8UC1" => 1,
        "mono16" | "16UC1" => 2,
        "rgb8" | "bgr8" | "8UC3" => 3,
        other => return Err(format!("image encoding '{other}', expected mono8, 8UC1, mono16, rgb8 or bgr8")),
    };
    let row_bytes = width * bytes_per_pixel;
    if raw.step < row_bytes || raw.data.len() < raw.step * (height - 1) + row_bytes {
        return Err(format!(
            "{} bytes with {} per row for {width}×{height} {}, expected at least {}",
            raw.data.len(),
            raw.step,
            raw.encoding,
            row_bytes * height
        ));
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

fn decoder(data: &[u8], codec: ImageFormat) -> CodecReader<Cursor<&[u8]>> {
    let mut reader = CodecReader::with_format(Cursor::new(data), codec);
    let mut limits = Limits::default();
    limits.max_image_width = Some(MAX_SIDE_PX as u32);
    limits.max_image_height = Some(MAX_SIDE_PX as u32);
    reader.limits(limits);
    reader
}

fn gray_from_compressed(format: &str, data: &[u8], depth: BitDepth) -> Result<GrayImage, String> {
    // The format field is free text ("jpeg", "rgb8; jpeg compressed bgr8"), the bytes are not.
    let codec = match data {
        [0xFF, 0xD8, ..] => ImageFormat::Jpeg,
        _ if data.starts_with(&PNG) => ImageFormat::Png,
        _ => return Err(format!("{} bytes of format '{format}' that are neither JPEG nor PNG", data.len())),
    };
    let image = decoder(data, codec)
        .decode()
        .map_err(|error| format!("damaged {codec:?} of {} bytes ({error})", data.len()))?;
    let (width, height) = (image.width() as usize, image.height() as usize);
    let pixels = match image {
        DynamicImage::ImageLuma8(gray) => gray.into_raw(),
        DynamicImage::ImageLuma16(gray) => gray.into_raw().into_iter().map(|value| depth.narrowed(value)).collect(),
        other => other.into_rgb8().into_raw().chunks_exact(3).map(|rgb| luma(rgb[0], rgb[1], rgb[2])).collect(),
    };
    Ok(GrayImage { width, height, pixels })
}
