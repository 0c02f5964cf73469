use std::collections::BTreeMap;
use std::sync::Arc;

use super::super::container::{MessagePosition, TopicIndex};
use super::super::log::relative_ns;
use super::super::messages::MessageKind;
use super::super::video::keyframe_before;
use super::super::{FlightLog, WarningKind};
use super::read_context::{Drops, ReadContext, Refusal};
use crate::geometry::seconds_from_ns;

/// Messages out of order by up to this are sorted; later ones are dropped.
pub(crate) const HORIZON_NS: i64 = 100_000_000;
/// Logs that start later than this, in nanoseconds since the Unix epoch, have stamps of a clock that is set (1973), in
/// which 0 is no time.
const EARLIEST_CLOCK_NS: i64 = 100_000_000_000_000_000;
const UNSET: &str = "the header stamp was never set (use_log_time: true of the sensor in the rig takes the log time)";

/// Decodes a message into its absolute header stamp and a sample.
pub(super) type Decoder<T> = Box<dyn FnMut(MessageSource<'_>) -> Result<(i64, T), Refusal> + Send>;

/// Input of a decoder.
pub(super) struct MessageSource<'a> {
    pub(super) data: &'a [u8],
    /// Number among the messages of its topic.
    pub(super) number: usize,
    pub(super) position: MessagePosition,
}

/// Samples of one topic in the order of their header stamps.
pub(super) struct OrderedSamples<T> {
    messages: TopicIndex,
    /// Index of the next message to read.
    next: usize,
    /// True when all messages have been read.
    exhausted: bool,
    decode: Decoder<T>,
    /// Samples by stamp since the start of the log, and message index.
    pending: BTreeMap<(i64, usize), T>,
    released_ns: Option<i64>,
    /// True if several samples may have one stamp.
    equal_stamps: bool,
    drops: Drops,
}

impl<T> OrderedSamples<T> {
    /// Reads the messages of a topic with log times at or after `from_ns` since the start of the log. If `numbered`,
    /// the numbers passed to the decoder count from the log's start, which requires reading the index of everything
    /// before.
    pub(super) fn new(log: &FlightLog, topic: &str, from_ns: i64, numbered: bool, decode: Decoder<T>) -> Self {
        let mut messages = log.topic_index(topic);
        let log_time_ns = u64::try_from(log.epoch_ns().saturating_add(from_ns)).unwrap_or(0);
        if !numbered {
            messages.skip_to(&log.index(), log_time_ns);
        }
        let next = messages.first_at(&log.index(), log.file(), log_time_ns);
        let (pending, drops) = (BTreeMap::new(), Drops::new(topic));
        Self { messages, next, exhausted: false, decode, pending, released_ns: None, equal_stamps: false, drops }
    }

    /// Starts with the keyframe on which the first message depends, for a video topic.
    pub(super) fn starting_at_keyframe(mut self, log: &FlightLog, kind: MessageKind) -> Self {
        self.next = keyframe_before(log, &mut self.messages, kind, self.next);
        self
    }

    /// Accepts several messages with one stamp, from different senders.
    pub(super) fn with_equal_stamps(self) -> Self {
        Self { equal_stamps: true, ..self }
    }

    /// Number of messages in the log so far.
    pub(super) fn count(&mut self, log: &FlightLog) -> usize {
        self.messages.count(&log.index(), log.file())
    }

    /// Next sample with its stamp since the start of the log.
    pub(super) fn next(&mut self, context: &mut ReadContext) -> Option<(i64, T)> {
        loop {
            let ready = match (self.pending.first_key_value(), self.pending.last_key_value()) {
                (Some(((first, _), _)), Some(((last, _), _))) => last - first > HORIZON_NS || self.exhausted,
                _ => false,
            };
            if ready && let Some(((stamp_ns, _), sample)) = self.pending.pop_first() {
                self.released_ns = Some(stamp_ns);
                return Some((stamp_ns, sample));
            }
            if self.exhausted {
                self.finish(context);
                return None;
            }
            self.read_one(context);
        }
    }

    fn read_one(&mut self, context: &mut ReadContext) {
        let log = Arc::clone(&context.log);
        let number = self.next;
        let Some(position) = self.messages.get(&log.index(), log.file(), number) else {
            // All messages so far have been read.
            self.exhausted = self.has_stopped(context) || !log.wait_for_blocks(self.messages.known_blocks());
            return;
        };
        self.next += 1;
        let log_time_ns = log.since_start(position.log_time_ns);
        let Some((block, message)) = log.message(&mut context.cache, position) else {
            let block = context.cache.get(log.file(), &log.index().blocks, position.block);
            context.report_block(position, block.as_ref().and_then(|block| block.damage.as_deref()));
            return;
        };
        let data = block.bytes(&message.data);
        match (self.decode)(MessageSource { data, number, position }) {
            Ok((absolute_ns, sample)) => {
                let stamp_ns = relative_ns(absolute_ns, log.epoch_ns());
                if absolute_ns == 0 && log.epoch_ns() > EARLIEST_CLOCK_NS {
                    return self.drops.add(context, log_time_ns, Refusal { reason: UNSET, detail: String::new() });
                }
                let repeats = Some(stamp_ns) == self.released_ns && !self.equal_stamps;
                let newest_out = repeats || self.released_ns.is_some_and(|released| stamp_ns < released);
                let duplicate =
                    !self.equal_stamps && self.pending.range((stamp_ns, 0)..=(stamp_ns, usize::MAX)).next().is_some();
                if newest_out || duplicate {
                    let reason = if duplicate || Some(stamp_ns) == self.released_ns {
                        "the header stamp repeats"
                    } else {
                        "the header stamps run backwards"
                    };
                    let detail = format!("stamp {:.6} s", seconds_from_ns(stamp_ns));
                    self.drops.add(context, log_time_ns, Refusal { reason, detail });
                } else {
                    self.drops.end(context);
                    self.pending.insert((stamp_ns, number), sample);
                }
            }
            Err(refusal) if refusal.reason.is_empty() => {}
            Err(refusal) => self.drops.add(context, log_time_ns, refusal),
        }
    }

    /// True, with a warning, if the other topics of a log that is being written are far ahead of this one.
    fn has_stopped(&self, context: &mut ReadContext) -> bool {
        let Some(stopped_ns) = context.log.stopped_ns() else { return false };
        let index = context.log.index();
        // Blocks that the topic has not looked at yet may have messages of it.
        let newest_ns = index.last_log_time_ns_of(self.messages.known_blocks());
        let last_ns = self.messages.last_log_time_ns();
        let stopped = last_ns.is_some_and(|last_ns| newest_ns > last_ns.saturating_add(stopped_ns));
        if stopped && let Some(last_ns) = last_ns {
            let stamp_ns = context.log.since_start(last_ns);
            let topic = self.drops.topic().to_owned();
            let message = format!(
                "{topic}: no message for {:.0} s after second {:.3} while the others go on; the topic is taken as ended",
                stopped_ns as f64 * 1e-9,
                seconds_from_ns(stamp_ns)
            );
            context.warn(WarningKind::ReadingStopped, &topic, stamp_ns, message);
        }
        stopped
    }

    /// Reports the last dropped messages.
    pub(super) fn finish(&mut self, context: &mut ReadContext) {
        self.drops.end(context);
    }
}

/// Samples of a topic around a stamp: those before it, and the first one after it.
pub(super) struct Lookup<T> {
    samples: OrderedSamples<T>,
    before: Option<(i64, T)>,
    after: Option<(i64, T)>,
    ended: bool,
}

impl<T> Lookup<T> {
    pub(super) fn new(samples: OrderedSamples<T>) -> Self {
        Self { samples, before: None, after: None, ended: false }
    }

    /// Next sample of those that no call of [`Self::around`] has read.
    pub(super) fn next(&mut self, context: &mut ReadContext) -> Option<T> {
        self.samples.next(context).map(|(_, sample)| sample)
    }

    /// Last sample at or before a time and the first after it; times must not decrease.
    pub(super) fn around(&mut self, context: &mut ReadContext, stamp_ns: i64) -> [Option<&(i64, T)>; 2] {
        while !self.ended && self.after.as_ref().is_none_or(|(after, _)| *after <= stamp_ns) {
            if let Some(passed) = self.after.take() {
                self.before = Some(passed);
            }
            self.after = self.samples.next(context);
            self.ended = self.after.is_none();
        }
        [self.before.as_ref(), self.after.as_ref()]
    }
}
