use super::super::FlightLog;
use super::super::container::BlockCache;
use super::super::messages::{MessageKind, read_video_packet};
use super::{BLOCKS, PictureStream};

/// Consecutive messages of a video whose frames cannot be decoded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct MissingPictures {
    /// Number of the first message.
    pub(crate) first: usize,
    pub(crate) count: usize,
    /// Reason why the first one cannot be decoded.
    pub(crate) problem: String,
}

/// Decodes the first `most` messages of a video topic. Returns the number of messages, and the stretches without
/// frames.
pub(crate) fn missing_pictures(
    log: &FlightLog,
    topic: &str,
    kind: MessageKind,
    most: usize,
) -> (usize, Vec<MissingPictures>) {
    let mut cache = BlockCache::new(BLOCKS);
    let mut messages = log.topic_index(topic);
    let mut stream = PictureStream::default();
    let mut missing: Vec<MissingPictures> = Vec::new();
    let mut read = 0;
    while read < most
        && let Some(position) = messages.get(log.index(), log.file(), read)
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
            None => missing.push(MissingPictures { first: number, count: 1, problem }),
        }
    }
    (read, missing)
}
