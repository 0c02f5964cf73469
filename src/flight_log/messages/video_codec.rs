//! Video compressions that are read.

use std::ops::RangeInclusive;

/// Compression of a stream.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum VideoCodec {
    H264,
    H265,
}

impl VideoCodec {
    /// Parses a message field: `h264`, `libx264`, `hevc_nvenc`, `h265;yuv420p;…`; `None` for an unsupported
    /// compression.
    pub(crate) fn from_name(name: &str) -> Option<Self> {
        let name = name.split(';').next().unwrap_or(name).to_ascii_lowercase();
        let has = |parts: &[&str]| parts.iter().any(|part| name.contains(part));
        if has(&["264", "avc"]) {
            Some(Self::H264)
        } else if has(&["265", "hevc"]) {
            Some(Self::H265)
        } else {
            None
        }
    }

    /// Name that is written into messages.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::H264 => "h264",
            Self::H265 => "h265",
        }
    }

    /// True for a message (Annex B) with a frame at which decoding can start, and its sequence parameter set.
    pub(crate) fn is_keyframe(self, access_unit: &[u8]) -> bool {
        let has = |types: RangeInclusive<u8>| self.unit_types(access_unit).any(|unit| types.contains(&unit));
        match self {
            Self::H264 => has(5..=5) && has(7..=7),
            Self::H265 => has(16..=21) && has(33..=33),
        }
    }

    /// True for a message with a frame that follows a keyframe and depends on frames before it (H.265: RASL).
    pub(crate) fn is_leading(self, access_unit: &[u8]) -> bool {
        self == Self::H265 && self.unit_types(access_unit).any(|unit| unit == 8 || unit == 9)
    }

    /// Types of the units of a message (`nal_unit_type`).
    fn unit_types(self, access_unit: &[u8]) -> impl Iterator<Item = u8> {
        let headers = access_unit.windows(4).filter(|window| window[..3] == [0, 0, 1]).map(|window| window[3]);
        headers.map(move |header| match self {
            Self::H264 => header & 0x1F,
            Self::H265 => header >> 1 & 0x3F,
        })
    }
}
