use super::super::image_problem::{ImageProblem, unreadable};
use super::super::limits::LogLimits;
use super::super::messages::VideoPacket;
use super::VideoDecoder;
use crate::sensors::GrayImage;

/// The messages of a video topic, decoded in their order.
///
/// A message that is left out, unreadable or of another compression ends what can be decoded up to the next keyframe.
#[derive(Debug, Default)]
pub(crate) struct PictureStream {
    decoder: Option<VideoDecoder>,
    /// Number of the message after the one decoded last.
    next: usize,
}

impl PictureStream {
    /// Number of the message that continues the stream, `None` when only a keyframe can.
    pub(crate) fn next(&self) -> Option<usize> {
        self.decoder.is_some().then_some(self.next)
    }

    /// Says that the next message cannot be read.
    pub(crate) fn lose_message(&mut self) {
        self.decoder = None;
    }

    /// The picture of the message with this number, 8-bit grey levels, when it has the expected resolution, if there is one.
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
