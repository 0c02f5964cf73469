use super::super::messages::VideoPacket;
use super::{BLOCKS, VideoDecoder};
use crate::files::LogLimits;
use crate::files::image_file::{ImageProblem, unreadable};
use crate::flight_log::FlightLog;
use crate::flight_log::container::BlockCache;
use crate::flight_log::messages::{MessageKind, read_video_packet};
use crate::sensors::GrayImage;

/// Messages of a video topic, decoded in order.
///
/// After a missing or unreadable message, or one of another compression, frames are rejected up to the next keyframe.
#[derive(Debug, Default)]
pub(crate) struct VideoStream {
    decoder: Option<VideoDecoder>,
    /// Number of the message after the last decoded one.
    next: usize,
}

impl VideoStream {
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

/// Consecutive messages of a video whose frames cannot be decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct MissingFrames {
    /// Number of the first message.
    pub(crate) first: usize,
    pub(crate) count: usize,
    /// Reason why the first one cannot be decoded.
    pub(crate) problem: String,
}

/// Decodes the first `most` messages of a video topic. Returns the number of messages, and the stretches without
/// frames.
pub(crate) fn missing_frames(
    log: &FlightLog,
    topic: &str,
    kind: MessageKind,
    most: usize,
) -> (usize, Vec<MissingFrames>) {
    let mut cache = BlockCache::new(BLOCKS);
    let mut messages = log.topic_index(topic);
    let mut stream = VideoStream::default();
    let mut missing: Vec<MissingFrames> = Vec::new();
    let mut read = 0;
    while read < most
        && let Some(position) = messages.get(&log.index(), log.file(), read)
    {
        let number = read;
        read += 1;
        let decoded = match log.message(&mut cache, position) {
            None => Err("it is in a damaged chunk".to_owned()),
            Some((block, message)) => read_video_packet(kind, block.bytes(&message.data))
                .map_err(|error| error.to_string())
                .and_then(|packet| {
                    let decoded = stream.decode(number, &packet, log.file().limits(), None);
                    decoded.map(drop).map_err(|problem| problem.to_string())
                }),
        };
        let Err(problem) = decoded else { continue };
        match missing.last_mut().filter(|stretch| stretch.first + stretch.count == number) {
            Some(stretch) => stretch.count += 1,
            None => missing.push(MissingFrames { first: number, count: 1, problem }),
        }
    }
    (read, missing)
}
