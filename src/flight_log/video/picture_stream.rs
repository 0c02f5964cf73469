use super::super::image_problem::{ImageProblem, unreadable};
use super::super::limits::LogLimits;
use super::super::messages::VideoPacket;
use super::VideoDecoder;
use crate::sensors::GrayImage;

/// Messages of a video topic, decoded in order.
///
/// After a missing or unreadable message, or one of another compression, frames are rejected up to the next keyframe.
#[derive(Debug, Default)]
pub(crate) struct PictureStream {
    decoder: Option<VideoDecoder>,
    /// Number of the message after the last decoded one.
    next: usize,
}

impl PictureStream {
    /// Number of the message that continues the stream, `None` if only a keyframe can.
    pub(crate) fn next(&self) -> Option<usize> {
        self.decoder.is_some().then_some(self.next)
    }

    /// Marks the next message as unreadable.
    pub(crate) fn lose_message(&mut self) {
        self.decoder = None;
    }

    /// Decodes the frame of the message with this number into 8-bit gray values. If a resolution is expected, other
    /// resolutions are an error.
    pub(crate) fn decode(
        &mut self,
        number: usize,
        packet: &VideoPacket<'_>,
        limits: &LogLimits,
        expected_px: Option<[usize; 2]>,
    ) -> Result<GrayImage, ImageProblem> {
        let continued = std::mem::replace(&mut self.next, number + 1) == number;
        let before = self.decoder.take().filter(|_| continued);
        let codec = packet.codec().map_err(unreadable)?;
        let decoder = before.filter(|decoder| decoder.codec() == codec);
        self.decoder
            .insert(decoder.unwrap_or_else(|| VideoDecoder::new(codec, limits)))
            .decode(packet.data, expected_px)
    }
}
