use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

use rust_h264::nal::NalUnitType;

use super::frame_numbers::FrameNumbers;
use crate::files::LogLimits;
use crate::files::image_file::{ImageProblem, check_resolution, unreadable};
use crate::flight_log::messages::VideoCodec;
use crate::sensors::GrayImage;

/// Decodes the messages of one stream in order.
pub(crate) struct VideoDecoder {
    codec: VideoCodec,
    stream: Stream,
    limits: LogLimits,
    /// True if all frames since a keyframe have been decoded.
    synchronized: bool,
    /// True if that keyframe was the first one, so that frames that depend on others before it are missing.
    at_first_keyframe: bool,
}

impl std::fmt::Debug for VideoDecoder {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.debug_struct("VideoDecoder")
            .field("codec", &self.codec)
            .field("synchronized", &self.synchronized)
            .finish_non_exhaustive()
    }
}

enum Stream {
    H264(Box<rust_h264::decoder::Decoder>, FrameNumbers),
    H265(Box<rust_h265::Decoder>),
}

impl Stream {
    fn new(codec: VideoCodec, limits: &LogLimits) -> Self {
        match codec {
            VideoCodec::H264 => Self::H264(Box::default(), FrameNumbers::default()),
            VideoCodec::H265 => {
                let limits =
                    rust_h265::DecodeLimits { max_picture_pixels: limits.image_pixels(), ..Default::default() };
                Self::H265(Box::new(rust_h265::Decoder::with_limits(limits)))
            }
        }
    }
}

impl VideoDecoder {
    /// Creates a decoder that waits for a keyframe.
    pub(crate) fn new(codec: VideoCodec, limits: &LogLimits) -> Self {
        Self {
            codec,
            stream: Stream::new(codec, limits),
            limits: limits.clone(),
            synchronized: false,
            at_first_keyframe: true,
        }
    }

    pub(crate) fn codec(&self) -> VideoCodec {
        self.codec
    }

    /// Marks a message as missing before the next one: frames are rejected up to the next keyframe.
    pub(super) fn lose_message(&mut self) {
        self.stream = Stream::new(self.codec, &self.limits);
        (self.synchronized, self.at_first_keyframe) = (false, true);
    }

    /// Decodes the frame of a message (Annex B) into 8-bit gray values. If a resolution is expected, other resolutions
    /// are an error.
    pub(crate) fn decode(
        &mut self,
        access_unit: &[u8],
        expected_px: Option<[usize; 2]>,
    ) -> Result<GrayImage, ImageProblem> {
        if self.codec.is_keyframe(access_unit) {
            self.at_first_keyframe = !self.synchronized;
        } else if !self.synchronized || (self.at_first_keyframe && self.codec.is_leading(access_unit)) {
            return Err(unreadable("it depends on a damaged or missing frame; reading continues at the next keyframe"));
        }
        let (stream, limits) = (&mut self.stream, &self.limits);
        let decoded = without_panic_message(|| stream.frame(access_unit, limits));
        let frame =
            decoded.unwrap_or_else(|| Err(unreadable("the video decoder failed: please report it with the log")));
        match frame {
            Ok(image) => {
                self.synchronized = true;
                check_resolution([image.width, image.height], &self.limits, expected_px)?;
                Ok(image)
            }
            Err(problem) => {
                self.lose_message();
                Err(problem)
            }
        }
    }
}

impl Stream {
    /// Decodes the only frame of a message.
    fn frame(&mut self, access_unit: &[u8], limits: &LogLimits) -> Result<GrayImage, ImageProblem> {
        match self {
            Self::H264(decoder, numbers) => {
                let mut frames = Vec::new();
                for unit in rust_h264::nal::parse_annex_b(access_unit) {
                    match unit.nal_unit_type {
                        NalUnitType::Sps => {
                            let info = rust_h264::nal::parse_sps_info(&unit).map_err(damaged)?;
                            check_resolution([info.coded_width as usize, info.coded_height as usize], limits, None)?;
                            numbers.take_sequence(&unit.rbsp);
                        }
                        NalUnitType::Slice | NalUnitType::SliceIdr => {
                            let is_idr = unit.nal_unit_type == NalUnitType::SliceIdr;
                            numbers.take_slice(&unit.rbsp, is_idr, unit.nal_ref_idc != 0).map_err(unreadable)?;
                        }
                        _ => {}
                    }
                    frames.extend(decoder.decode_nal(&unit).map_err(damaged)?);
                }
                frames.extend(decoder.flush());
                let [frame] = one(frames)?;
                let (width, height) = (frame.width as usize, frame.height as usize);
                let pixels = if frame.bit_depth > 8 {
                    let sample = |pair: &[u8]| u16::from_le_bytes([pair[0], pair[1]]);
                    frame.y.chunks_exact(2).map(|pair| narrowed(sample(pair), frame.bit_depth)).collect()
                } else {
                    frame.y
                };
                gray_image(width, height, pixels)
            }
            Self::H265(decoder) => {
                let mut frames = Vec::new();
                for unit in rust_h265::parse_annex_b(access_unit) {
                    frames.extend(decoder.decode_nal(&unit).map_err(damaged)?);
                }
                frames.extend(std::iter::from_fn(|| decoder.flush()));
                let [frame] = one(frames)?;
                let (width, height) = (frame.width as usize, frame.height as usize);
                let pixels = match (frame.y.as_u8(), frame.y.as_u16()) {
                    (Some(samples), _) => samples.to_vec(),
                    (None, Some(samples)) => samples.iter().map(|sample| narrowed(*sample, frame.bit_depth)).collect(),
                    (None, None) => Vec::new(),
                };
                gray_image(width, height, pixels)
            }
        }
    }
}

fn damaged(error: impl std::fmt::Debug) -> ImageProblem {
    unreadable(format!("damaged video ({error:?})"))
}

fn one<T>(frames: Vec<T>) -> Result<[T; 1], ImageProblem> {
    <[T; 1]>::try_from(frames)
        .map_err(|frames| unreadable(format!("{} frames in one message, expected 1", frames.len())))
}

fn narrowed(sample: u16, bit_depth: u8) -> u8 {
    u8::try_from(sample >> bit_depth.saturating_sub(8)).unwrap_or(u8::MAX)
}

fn gray_image(width: usize, height: usize, pixels: Vec<u8>) -> Result<GrayImage, ImageProblem> {
    if pixels.len() != width * height {
        return Err(unreadable(format!("{} samples of a frame of {width}×{height} pixels", pixels.len())));
    }
    Ok(GrayImage { width, height, pixels })
}

thread_local! {
    /// True while a panic on this thread is an error of the input and prints nothing.
    static SILENT: Cell<bool> = const { Cell::new(false) };
}

/// Runs a decoder whose panic is an error of its input: `None` if it panics. Its message is not printed.
fn without_panic_message<T>(run: impl FnOnce() -> T) -> Option<T> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let print = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !SILENT.get() {
                print(panic);
            }
        }));
    });
    let before = SILENT.replace(true);
    let result = catch_unwind(AssertUnwindSafe(run));
    SILENT.set(before);
    result.ok()
}
