//! Video topics: the frames of H.264 and H.265 streams, one in each message.
//!
//! A frame depends on those before it, back to a keyframe. Messages are decoded in the order of the log; after a
//! damaged or missing message, frames are rejected up to the next keyframe, because they would be wrong.

mod decoder;
mod frame_numbers;
#[cfg(test)]
pub(super) mod tests;
mod video_stream;

pub(crate) use decoder::VideoDecoder;
pub(crate) use video_stream::{MissingFrames, VideoStream, missing_frames};

use super::FlightLog;
use super::container::{BlockCache, TopicIndex};
use super::messages::{MessageKind, VideoPacket, read_video_packet};

/// Number of cached blocks during the search for a keyframe.
const BLOCKS: usize = 2;

/// Number of the message from which a frame has to be decoded: the last keyframe at or before it, or the one before
/// that for a frame that depends on frames before its keyframe; 0 without one.
pub(super) fn keyframe_before(log: &FlightLog, messages: &mut TopicIndex, kind: MessageKind, number: usize) -> usize {
    let mut cache = BlockCache::new(BLOCKS);
    let mut holds = |number: usize, property: fn(&VideoPacket<'_>) -> bool| {
        let Some(position) = messages.get(&log.index(), log.file(), number) else { return false };
        let Some((block, message)) = log.message(&mut cache, position) else { return false };
        read_video_packet(kind, block.bytes(&message.data)).is_ok_and(|packet| property(&packet))
    };
    let mut keyframes_needed = if holds(number, |packet| packet.is_leading()) { 2 } else { 1 };
    for candidate in (0..=number).rev() {
        if holds(candidate, |packet| packet.is_keyframe()) {
            keyframes_needed -= 1;
            if keyframes_needed == 0 {
                return candidate;
            }
        }
    }
    0
}
