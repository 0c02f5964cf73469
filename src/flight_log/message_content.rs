//! Content of messages without their headers, to find equal ones and their senders.

use super::cdr::CdrReader;
use super::messages::{self, MessageKind};

/// Frame in the header of a message and a checksum of what follows the header; of images, of their data alone. `None`
/// for a message that cannot be decoded, and for transforms, which have several headers.
pub(crate) fn frame_and_checksum(kind: MessageKind, message: &[u8]) -> Option<(&str, u32)> {
    let (frame_id, content) = match kind {
        MessageKind::Transforms => return None,
        MessageKind::CompressedVideo | MessageKind::CompressedVideoProtobuf | MessageKind::FfmpegPacket => {
            let packet = messages::read_video_packet(kind, message).ok()?;
            (packet.frame_id, packet.data)
        }
        kind if kind.counts_since_boot() => {
            let mut reader = CdrReader::new(message).ok()?;
            reader.read_u64().ok()?;
            ("", reader.rest())
        }
        _ => {
            let mut reader = CdrReader::new(message).ok()?;
            let frame_id = messages::read_header(&mut reader).ok()?.frame_id;
            let content = match kind {
                MessageKind::Image => messages::read_image(message).ok()?.data,
                MessageKind::CompressedImage => messages::read_compressed_image(message).ok()?.1,
                _ => reader.rest(),
            };
            (frame_id, content)
        }
    };
    Some((frame_id, crc32fast::hash(content)))
}
