//! Images of a log as grey values.

use std::io::Cursor;

use image::{DynamicImage, ImageFormat, ImageReader as CodecReader, Limits};

use super::GrayImage;
use super::messages::{ImageMessage, MessageKind, read_compressed_image, read_image};

/// Images wider or higher than this are refused: no such camera flies, so it is a damaged header.
const LARGEST_SIDE_PX: usize = 16_384;

/// Decodes an image message of either kind; the error says what is wrong with it.
pub(super) fn decode_picture(kind: MessageKind, message: &[u8]) -> Result<GrayImage, String> {
    if kind == MessageKind::Image {
        return gray_from_raw(&read_image(message).map_err(|error| error.to_string())?);
    }
    let (format, data) = read_compressed_image(message).map_err(|error| error.to_string())?;
    gray_from_compressed(format, data)
}

fn gray_from_raw(raw: &ImageMessage<'_>) -> Result<GrayImage, String> {
    let (width, height) = (raw.width, raw.height);
    if width == 0 || height == 0 || width > LARGEST_SIDE_PX || height > LARGEST_SIDE_PX {
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
                let most_significant = usize::from(!raw.big_endian);
                pixels.extend(row.chunks_exact(2).map(|pair| pair[most_significant]));
            }
            "rgb8" => pixels.extend(row.chunks_exact(3).map(|rgb| luma(rgb[0], rgb[1], rgb[2]))),
            "bgr8" | "8UC3" => pixels.extend(row.chunks_exact(3).map(|bgr| luma(bgr[2], bgr[1], bgr[0]))),
            _ => pixels.extend_from_slice(row),
        }
    }
    Ok(GrayImage { width, height, pixels })
}

/// Grey value of a colour (ITU-R BT.601, as JPEG has it), rounded.
fn luma(red: u8, green: u8, blue: u8) -> u8 {
    ((u32::from(red) * 19_595 + u32::from(green) * 38_470 + u32::from(blue) * 7_471 + 32_768) >> 16) as u8
}

fn gray_from_compressed(format: &str, data: &[u8]) -> Result<GrayImage, String> {
    // The format field is free text ("jpeg", "rgb8; jpeg compressed bgr8"), the bytes are not.
    let codec = match data {
        [0xFF, 0xD8, ..] => ImageFormat::Jpeg,
        [0x89, b'P', b'N', b'G', ..] => ImageFormat::Png,
        _ => return Err(format!("{} bytes of format '{format}' that are neither JPEG nor PNG", data.len())),
    };
    let mut reader = CodecReader::with_format(Cursor::new(data), codec);
    let mut limits = Limits::default();
    limits.max_image_width = Some(LARGEST_SIDE_PX as u32);
    limits.max_image_height = Some(LARGEST_SIDE_PX as u32);
    reader.limits(limits);
    let picture = reader.decode().map_err(|error| format!("damaged {codec:?} of {} bytes ({error})", data.len()))?;
    let (width, height) = (picture.width() as usize, picture.height() as usize);
    let pixels = match picture {
        DynamicImage::ImageLuma8(gray) => gray.into_raw(),
        DynamicImage::ImageLuma16(gray) => gray.into_raw().into_iter().map(|value| (value >> 8) as u8).collect(),
        other => other.into_rgb8().into_raw().chunks_exact(3).map(|rgb| luma(rgb[0], rgb[1], rgb[2])).collect(),
    };
    Ok(GrayImage { width, height, pixels })
}
