//! Messages of a topic that are dropped, with one warning for consecutive ones.

use super::super::{LogWarning, WarningKind};
use super::read_context::{ReadContext, Refusal};
use crate::geometry::seconds_from_ns;

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
