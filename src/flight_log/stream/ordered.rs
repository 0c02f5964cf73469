use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::super::container::{BlockCache, MessagePosition, TopicIndex};
use super::super::log::relative_ns;
use super::super::messages::MessageKind;
use super::super::video::keyframe_before;
use super::super::{FlightLog, LogWarning};
use crate::geometry::seconds_from_ns;

/// Messages out of order by up to this are sorted; later ones are dropped.
const HORIZON_NS: i64 = 100_000_000;
/// Number of cached blocks: one per topic, and one ahead for topics whose messages are already in the next block.
const BLOCKS: usize = 8;
/// Size of cached blocks: the topics of a frame lie in one or two blocks, and large ones contain many frames.
const BLOCK_BYTES: u64 = 10 << 20;

/// Log and warnings, shared by all topics of a stream.
#[derive(Debug)]
pub(super) struct ReadContext {
    pub(super) log: Arc<FlightLog>,
    cache: BlockCache,
    /// Damaged blocks that have been reported.
    reported: BTreeSet<usize>,
    /// Warnings since they were last collected.
    pub(super) warnings: Vec<LogWarning>,
}

impl ReadContext {
    pub(super) fn new(log: Arc<FlightLog>) -> Self {
        Self {
            log,
            cache: BlockCache::new(BLOCKS).with_capacity_bytes(BLOCK_BYTES),
            reported: BTreeSet::new(),
            warnings: Vec::new(),
        }
    }

    pub(super) fn warn(&mut self, stamp_ns: i64, message: String) {
        self.warnings.push(LogWarning { stamp_ns, message });
    }

    fn report_block(&mut self, position: MessagePosition, damage: Option<&str>) {
        let block = &self.log.index().blocks[position.block];
        // A block beyond the file's end was reported when the log was opened.
        if !self.reported.insert(position.block) || block.bytes.end > self.log.file().len() {
            return;
        }
        let (first, last) = (self.log.since_start(block.log_time_ns.0), self.log.since_start(block.log_time_ns.1));
        let message = format!(
            "damaged chunk at byte {}, from second {:.3} to {:.3}: {}; reading continues after it",
            block.bytes.start,
            seconds_from_ns(first),
            seconds_from_ns(last),
            damage.unwrap_or("the index points to no message")
        );
        self.warn(first, message);
    }
}

/// Reason why a message was dropped, with its stamp if that could be read.
pub(super) struct Refusal {
    pub(super) reason: &'static str,
    pub(super) detail: String,
}

impl Refusal {
    /// Skips the message without a warning (not needed, not faulty).
    pub(super) fn unneeded() -> Self {
        Self { reason: "", detail: String::new() }
    }

    /// Drops a message whose bytes do not match its schema.
    pub(super) fn not_decodable(error: &impl ToString) -> Self {
        Self { reason: "it cannot be decoded", detail: error.to_string() }
    }
}

/// Decodes a message into its absolute header stamp and a sample.
pub(super) type Decoder<T> = Box<dyn FnMut(MessageSource<'_>) -> Result<(i64, T), Refusal> + Send>;

/// Input of a decoder.
pub(super) struct MessageSource<'a> {
    pub(super) data: &'a [u8],
    /// Number among the messages of its topic.
    pub(super) number: usize,
    pub(super) position: MessagePosition,
}

/// Consecutive messages that were dropped for one reason.
#[derive(Debug)]
struct DroppedRun {
    reason: &'static str,
    detail: String,
    first_ns: i64,
    last_ns: i64,
    count: usize,
}

/// Samples of one topic in the order of their header stamps.
pub(super) struct OrderedSamples<T> {
    topic: String,
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
    dropped: Option<DroppedRun>,
}

impl<T> OrderedSamples<T> {
    /// Reads the messages of a topic with log times at or after `from_ns` since the start of the log. If `numbered`,
    /// the numbers passed to the decoder count from the log's start, which requires reading the index of everything
    /// before.
    pub(super) fn new(log: &FlightLog, topic: &str, from_ns: i64, numbered: bool, decode: Decoder<T>) -> Self {
        let mut messages = log.topic_index(topic);
        let log_time_ns = u64::try_from(log.epoch_ns().saturating_add(from_ns)).unwrap_or(0);
        if !numbered {
            messages.skip_to(log.index(), log_time_ns);
        }
        let next = messages.first_at(log.index(), log.file(), log_time_ns);
        let (topic, pending) = (topic.to_owned(), BTreeMap::new());
        let (released_ns, equal_stamps, dropped) = (None, false, None);
        Self { topic, messages, next, exhausted: false, decode, pending, released_ns, equal_stamps, dropped }
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
        let Some(position) = self.messages.get(log.index(), log.file(), number) else {
            self.exhausted = true;
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
                    self.refuse(context, log_time_ns, Refusal { reason, detail });
                } else {
                    self.end_run(context);
                    self.pending.insert((stamp_ns, number), sample);
                }
            }
            Err(refusal) if refusal.reason.is_empty() => {}
            Err(refusal) => self.refuse(context, log_time_ns, refusal),
        }
    }

    fn refuse(&mut self, context: &mut ReadContext, log_time_ns: i64, refusal: Refusal) {
        if let Some(run) = self.dropped.as_mut().filter(|run| run.reason == refusal.reason) {
            run.count += 1;
            run.last_ns = log_time_ns;
            return;
        }
        self.end_run(context);
        let Refusal { reason, detail } = refusal;
        self.dropped = Some(DroppedRun { reason, detail, first_ns: log_time_ns, last_ns: log_time_ns, count: 1 });
    }

    /// Reports consecutive dropped messages, at the next valid one or the log's end.
    fn end_run(&mut self, context: &mut ReadContext) {
        let Some(run) = self.dropped.take() else { return };
        let (first, last) = (seconds_from_ns(run.first_ns), seconds_from_ns(run.last_ns));
        let message = if run.count == 1 {
            format!("{}: message at {first:.3} s dropped: {} ({})", self.topic, run.reason, run.detail)
        } else {
            format!(
                "{}: {} messages from {first:.3} s to {last:.3} s dropped: {} (the first: {})",
                self.topic, run.count, run.reason, run.detail
            )
        };
        context.warn(run.first_ns, message);
    }

    pub(super) fn finish(&mut self, context: &mut ReadContext) {
        self.end_run(context);
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
