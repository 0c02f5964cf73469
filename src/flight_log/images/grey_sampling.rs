//! Samples of a topic's images, from which their conversion to 8 bits follows.

use std::sync::Arc;

use super::decoding::{WideValues, wide_values};
use crate::flight_log::FlightLog;
use crate::flight_log::container::BlockCache;
use crate::flight_log::grey_levels::{GreyLevels, ValueRange};
use crate::flight_log::messages::MessageKind;

/// Shortest stretch of a recording with a range of its own: the range follows this slowly.
const STRETCH_NS: i64 = 2_000_000_000;
/// Largest number of stretches, which bounds the time for a long recording.
const MAX_STRETCHES: usize = 32;
/// Number of images of a stretch: one image with a closed shutter does not change the median of their ranges.
const IMAGES_PER_STRETCH: usize = 3;

/// Conversion of a topic's images from 16 bits to 8. It is computed once per log, from at most 96 images.
pub(crate) fn grey_levels_of_topic(log: &FlightLog, topic: &str, kind: MessageKind) -> Arc<GreyLevels> {
    log.grey_levels(topic, || {
        let limits = log.file().limits();
        let first = log.find_message(topic, |message| wide_values(kind, message, limits));
        match first {
            Some(WideValues::Of(_)) => GreyLevels::of_stretches(&sampled(log, topic, kind)),
            Some(WideValues::Narrow) | None => GreyLevels::default(),
        }
    })
}

/// Ranges of images of each stretch of the recording, with the log time of its middle image in nanoseconds since the
/// start of the log. Unreadable and black images are left out.
fn sampled(log: &FlightLog, topic: &str, kind: MessageKind) -> Vec<(i64, Vec<ValueRange>)> {
    let mut positions = log.topic_index(topic);
    let count = positions.count(&log.index(), log.file());
    let mut time_ns = |number: usize| {
        positions.get(&log.index(), log.file(), number).map(|position| log.since_start(position.log_time_ns))
    };
    let ends = (time_ns(0), time_ns(count.saturating_sub(1)));
    let (Some(first_ns), Some(last_ns)) = ends else { return Vec::new() };
    let duration_ns = last_ns.saturating_sub(first_ns);
    let stretches = usize::try_from(duration_ns / STRETCH_NS).unwrap_or(1).clamp(1, MAX_STRETCHES).min(count);
    let mut cache = BlockCache::new(1);
    let limits = log.file().limits();
    let mut of_stretch = |stretch: usize| {
        let (from, to) = (stretch * count / stretches, (stretch + 1) * count / stretches);
        let mut numbers: Vec<usize> =
            (0..IMAGES_PER_STRETCH).map(|at| from + (to - from) * (2 * at + 1) / (2 * IMAGES_PER_STRETCH)).collect();
        numbers.dedup();
        let mut ranges = Vec::new();
        for number in numbers {
            let Some(position) = positions.get(&log.index(), log.file(), number) else { continue };
            let Some((block, message)) = log.message(&mut cache, position) else { continue };
            if let Some(WideValues::Of(values)) = wide_values(kind, block.bytes(&message.data), limits) {
                ranges.extend(ValueRange::of(&values));
            }
        }
        let middle = positions.get(&log.index(), log.file(), usize::midpoint(from, to))?;
        Some((log.since_start(middle.log_time_ns), ranges))
    };
    (0..stretches).filter_map(&mut of_stretch).collect()
}
