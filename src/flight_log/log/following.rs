//! Growth of a log that another program is writing.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use parking_lot::Mutex;

use crate::flight_log::container::file::LogFile;
use crate::flight_log::container::{ContainerIndex, ScanEnd, ScanState};

/// Time between two looks at a file that has not grown.
pub(super) const POLL: Duration = Duration::from_millis(20);
/// Number of looks without growth after which a log without a footer is taken as ended: half a minute.
pub(super) const IDLE_POLLS: u32 = 1500;
/// Span of the messages with which a log is opened: enough for the rates of its topics.
pub(super) const BEGIN_NS: u64 = 3_000_000_000;
/// Log time by which other topics are ahead of a topic that has ended.
pub(crate) const STOPPED_NS: u64 = 10_000_000_000;

/// Growth of a log.
#[derive(Debug)]
pub(super) struct Following {
    pub(super) growth: Mutex<Growth>,
    /// Set from outside to end the log early.
    pub(super) stop: Arc<AtomicBool>,
}

/// Place up to which the file has been read.
#[derive(Debug)]
pub(super) struct Growth {
    scan: ScanState,
    /// Number of looks since the file grew.
    polls: u32,
    /// Number of looks without growth after which the log is taken as ended.
    idle_polls: u32,
    pub(super) end: Option<LogEnd>,
}

/// Reason why a log that was being written has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogEnd {
    /// Its writer has written the footer.
    Complete,
    /// Nothing was written for half a minute, and there is no footer.
    Idle,
    /// The reader has been asked to stop.
    Stopped,
    /// A limit on the content of a log was reached.
    Limit,
}

impl Growth {
    pub(super) fn new(idle_polls: u32) -> Self {
        Self { scan: ScanState::default(), polls: 0, idle_polls, end: None }
    }

    /// Adds what has been written since; true if there are more blocks.
    pub(super) fn grow(&mut self, file: &LogFile, index: &mut ContainerIndex, stop: &AtomicBool) -> bool {
        self.polls = if file.grow() { 0 } else { self.polls + 1 };
        let before = index.blocks.len();
        self.end = match index.scan(file, &mut self.scan) {
            ScanEnd::Footer => Some(LogEnd::Complete),
            ScanEnd::Limit => Some(LogEnd::Limit),
            ScanEnd::EndOfFile | ScanEnd::Incomplete(_) if stop.load(Ordering::Relaxed) => Some(LogEnd::Stopped),
            ScanEnd::EndOfFile | ScanEnd::Incomplete(_) => (self.polls > self.idle_polls).then_some(LogEnd::Idle),
        };
        index.blocks.len() > before
    }
}
