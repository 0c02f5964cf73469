//! Small streams of x264 and x265, compared with the output of `FFmpeg`.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::VideoDecoder;
use crate::files::{LimitSetting, LogLimits};
use crate::flight_log::messages::VideoCodec;
use crate::geometry::SplitMix64;

/// Messages of a stream, and the CRC-32 of each decoded frame's gray values.
pub(in super::super) struct Stream {
    pub(in super::super) messages: Vec<&'static [u8]>,
    pub(in super::super) luma_crc32: Vec<u32>,
    /// Indices of the frames in time order.
    pub(in super::super) order: Vec<usize>,
}

#[derive(Deserialize)]
struct Listing {
    bytes: Vec<usize>,
    order: Vec<usize>,
    luma_crc32: Vec<u32>,
}

/// Stream of `tests/data/video/`.
pub(in super::super) fn stream(name: &str) -> Stream {
    let data: &'static [u8] = match name {
        "h264" => include_bytes!("../../../tests/data/video/h264.bin"),
        "h264_10_bit" => include_bytes!("../../../tests/data/video/h264_10_bit.bin"),
        "h264_b_frames" => include_bytes!("../../../tests/data/video/h264_b_frames.bin"),
        "h265" => include_bytes!("../../../tests/data/video/h265.bin"),
        other => panic!("no stream {other}"),
    };
    let listings = include_str!("../../../tests/data/video/streams.json");
    let mut listings: BTreeMap<String, Listing> = serde_json::from_str(listings).unwrap();
    let listing = listings.remove(name).unwrap();
    let mut rest = data;
    let mut messages = Vec::new();
    for bytes in listing.bytes {
        let (message, behind) = rest.split_at(bytes);
        messages.push(message);
        rest = behind;
    }
    assert!(rest.is_empty());
    Stream { messages, luma_crc32: listing.luma_crc32, order: listing.order }
}

fn codec_of(name: &str) -> VideoCodec {
    VideoCodec::from_name(name).unwrap()
}

#[test]
fn frames_equal_the_ones_of_ffmpeg() {
    for name in ["h264", "h264_10_bit", "h264_b_frames", "h265"] {
        let stream = stream(name);
        let mut decoder = VideoDecoder::new(codec_of(name), &LogLimits::default());
        for (number, (message, crc32)) in stream.messages.iter().zip(&stream.luma_crc32).enumerate() {
            let image =
                decoder.decode(message, Some([96, 64])).unwrap_or_else(|problem| panic!("{name} {number}: {problem}"));
            assert_eq!(crc32fast::hash(&image.pixels), *crc32, "{name}, message {number}");
        }
    }
}

#[test]
fn decoding_starts_at_keyframes() {
    for (name, period) in [("h264", 8), ("h264_b_frames", 12), ("h265", 8)] {
        let stream = stream(name);
        let keyframes: Vec<usize> =
            (0..stream.messages.len()).filter(|number| codec_of(name).is_keyframe(stream.messages[*number])).collect();
        assert_eq!(keyframes, (0..24).step_by(period).collect::<Vec<_>>(), "{name}");
        let mut decoder = VideoDecoder::new(codec_of(name), &LogLimits::default());
        for number in 3..24 {
            let decoded = decoder.decode(stream.messages[number], None);
            if number < period {
                let problem = decoded.unwrap_err().to_string();
                assert!(
                    problem.contains("damaged or missing frame; reading continues at the next keyframe"),
                    "{problem}"
                );
            } else {
                assert_eq!(crc32fast::hash(&decoded.unwrap().pixels), stream.luma_crc32[number], "{name} {number}");
            }
        }
    }
}

#[test]
fn a_lost_message_ends_a_group_of_pictures() {
    for (name, told) in [("h264", true), ("h265", true), ("h264", false)] {
        let stream = stream(name);
        let mut decoder = VideoDecoder::new(codec_of(name), &LogLimits::default());
        let mut decoded = Vec::new();
        for (number, message) in stream.messages.iter().enumerate() {
            if number == 11 {
                if told {
                    decoder.lose_message();
                }
                continue;
            }
            if let Ok(image) = decoder.decode(message, None) {
                assert_eq!(crc32fast::hash(&image.pixels), stream.luma_crc32[number], "{name} {number}");
                decoded.push(number);
            }
        }
        assert_eq!(decoded, (0..11).chain(16..24).collect::<Vec<_>>(), "{name}");
    }
}

#[test]
fn sizes_are_checked_before_a_frame_is_decoded() {
    let setting: LimitSetting = "image-pixels=6000".parse().unwrap();
    let limits = LogLimits { settings: vec![setting] };
    for name in ["h264", "h265"] {
        let problem = VideoDecoder::new(codec_of(name), &limits).decode(stream(name).messages[0], None).unwrap_err();
        assert!(
            problem.to_string().contains("6144") || problem.to_string().contains("ResourceLimit"),
            "{name}: {problem}"
        );
        let other = VideoDecoder::new(codec_of(name), &LogLimits::default());
        let problem = { other }.decode(stream(name).messages[0], Some([640, 480])).unwrap_err();
        assert_eq!(problem.to_string(), "an image of 96×64 pixels");
    }
}

#[test]
fn damaged_messages_never_panic_and_never_change_a_later_group() {
    let mut random = SplitMix64::new(11);
    for name in ["h264", "h264_b_frames", "h265"] {
        let stream = stream(name);
        for _ in 0..60 {
            let mut decoder = VideoDecoder::new(codec_of(name), &LogLimits::default());
            let damaged = (random.next_unit() * 8.0) as usize;
            for (number, message) in stream.messages.iter().enumerate() {
                let mut message = message.to_vec();
                if number == damaged {
                    let at = (random.next_unit() * message.len() as f64) as usize;
                    message[at] ^= 1 << (random.next_unit() * 8.0) as u32;
                }
                let decoded = decoder.decode(&message, None);
                if number < damaged || number >= 12 {
                    let crc32 = decoded.map(|image| crc32fast::hash(&image.pixels));
                    assert_eq!(crc32, Ok(stream.luma_crc32[number]), "{name} {number}, damaged {damaged}");
                }
            }
        }
    }
}

#[test]
fn names_of_encoders_are_understood() {
    for (name, codec) in [
        ("h264", Some(VideoCodec::H264)),
        ("libx264", Some(VideoCodec::H264)),
        ("avc1", Some(VideoCodec::H264)),
        ("H265", Some(VideoCodec::H265)),
        ("hevc_nvenc;yuv420p;h264", Some(VideoCodec::H265)),
        ("vp9", None),
        ("", None),
    ] {
        assert_eq!(VideoCodec::from_name(name), codec, "{name}");
    }
}
