//! Log and warnings of a stream, the refusal of a message, and dropped messages with one warning for consecutive ones.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::super::container::{BlockCache, MessagePosition};
use super::super::{FlightLog, LogWarning, WarningKind};
use crate::geometry::seconds_from_ns;

/// Number of cached blocks: one per topic, and one ahead for topics whose messages are already in the next block.
const BLOCKS: usize = 8;
/// Size of cached blocks: the topics of a frame lie in one or two blocks, and large ones contain many frames.
const BLOCK_BYTES: u64 = 10 << 20;

/// Log and warnings, shared by all topics of a stream.
#[derive(Debug)]
pub(super) struct ReadContext {
    pub(super) log: Arc<FlightLog>,
    pub(super) cache: BlockCache,
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

    /// Adds a warning about one event.
    pub(super) fn warn(&mut self, kind: WarningKind, subject: &str, stamp_ns: i64, message: String) {
        self.warnings.push(LogWarning::new(kind, subject, stamp_ns, message));
    }

    /// Reports the damaged block of a message, once.
    pub(super) fn report_block(&mut self, position: MessagePosition, damage: Option<&str>) {
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
        self.warn(WarningKind::DamagedChunk, "", first, message);
    }
}

/// Reason why a message was dropped.
#[derive(Debug)]
pub(super) struct Refusal {
    pub(super) reason: &'static str,
    /// Values of the message, empty if the reason says all.
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

/// Counts the dropped messages of a topic.
#[derive(Debug)]
pub(super) struct Drops {
    topic: String,
    /// Consecutive messages that were dropped for one reason.
    run: Option<DroppedRun>,
}

#[derive(Debug)]
struct DroppedRun {
    refusal: Refusal,
    first_ns: i64,
    last_ns: i64,
    count: usize,
}

impl Drops {
    pub(super) fn new(topic: &str) -> Self {
        Self { topic: topic.to_owned(), run: None }
    }

    pub(super) fn topic(&self) -> &str {
        &self.topic
    }

    /// Adds a message at a time since the start of the log.
    pub(super) fn add(&mut self, context: &mut ReadContext, time_ns: i64, refusal: Refusal) {
        if let Some(run) = self.run.as_mut().filter(|run| run.refusal.reason == refusal.reason) {
            run.count += 1;
            run.last_ns = time_ns;
            return;
        }
        self.end(context);
        self.run = Some(DroppedRun { refusal, first_ns: time_ns, last_ns: time_ns, count: 1 });
    }

    /// Reports consecutive dropped messages, at the next valid one or the log's end.
    pub(super) fn end(&mut self, context: &mut ReadContext) {
        let Some(DroppedRun { refusal: Refusal { reason, detail }, first_ns, last_ns, count }) = self.run.take() else {
            return;
        };
        let (topic, first, last) = (&self.topic, seconds_from_ns(first_ns), seconds_from_ns(last_ns));
        let message = match (count, detail.as_str()) {
            (1, "") => format!("{topic}: message at {first:.3} s dropped: {reason}"),
            (1, _) => format!("{topic}: message at {first:.3} s dropped: {reason} ({detail})"),
            (_, "") => format!("{topic}: {count} messages from {first:.3} s to {last:.3} s dropped: {reason}"),
            _ => format!(
                "{topic}: {count} messages from {first:.3} s to {last:.3} s dropped: {reason} (the first: {detail})"
            ),
        };
        let warning = LogWarning::new(WarningKind::Dropped(reason), topic, first_ns, message);
        context.warnings.push(warning.with_count(count, last_ns));
    }
}
