//! Growth of a log that another program is writing.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use parking_lot::Mutex;

use super::pace::Pace;
use crate::flight_log::container::file::LogFile;
use crate::flight_log::container::{ContainerIndex, ScanEnd, ScanState};
use crate::flight_log::live::Reception;

/// Time between two looks at a file that has not grown.
pub(super) const POLL: Duration = Duration::from_millis(20);
/// Span of the messages with which a log is opened: enough for the rates of its topics.
pub(super) const BEGIN_NS: u64 = 3_000_000_000;
/// Times for which a reader waits for messages that are not written.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patience {
    /// Number of looks without growth after which a log without a footer is taken as ended.
    pub(super) idle_polls: u32,
    /// Number of looks for the next file of a split recording after the end of one.
    pub(super) next_polls: u32,
    /// Log time by which other topics are ahead of a topic that has ended.
    pub(super) stopped_ns: u64,
}

impl Default for Patience {
    /// Half a minute, a second, and ten seconds.
    fn default() -> Self {
        Self { idle_polls: 1500, next_polls: 50, stopped_ns: 10_000_000_000 }
    }
}

/// Way in which a log is read that another program is writing, or that is being received.
#[derive(Clone, Debug, Default)]
pub struct FollowOptions {
    /// Ends reading early once it is set.
    pub stop: Arc<AtomicBool>,
    /// The reception that writes the log; it decides about the end of the log.
    pub reception: Option<Arc<Reception>>,
    /// Log time by which a run may be behind the newest message before images are left out; `None` leaves out none.
    pub longest_delay_s: Option<f64>,
}

/// All are equal, because none changes what is in a log.
impl PartialEq for FollowOptions {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl FollowOptions {
    /// Following the log of a reception.
    pub fn of_reception(reception: &Arc<Reception>, longest_delay_s: Option<f64>) -> Self {
        Self { stop: reception.stop_flag(), reception: Some(Arc::clone(reception)), longest_delay_s }
    }
}

/// Growth of a log.
#[derive(Debug)]
pub(super) struct Following {
    pub(super) growth: Mutex<Growth>,
    pub(super) follow: FollowOptions,
    /// Choice of images where they come faster than they are processed; `None` for all.
    pub(super) pace: Option<Pace>,
}

/// Place up to which the file has been read.
#[derive(Debug)]
pub(super) struct Growth {
    scan: ScanState,
    /// Length of the file that has been scanned, in bytes.
    scanned: usize,
    /// Number of waits since the file grew.
    pub(super) polls: u32,
    pub(super) patience: Patience,
    pub(super) end: Option<LogEnd>,
    /// Path of the file that is read.
    part: PathBuf,
    /// True if the footer of that file has been read.
    is_complete: bool,
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
    /// The program could not record what it received.
    Unrecorded,
}

impl Growth {
    pub(super) fn new(path: &Path, patience: Patience) -> Self {
        let (scan, part) = (ScanState::default(), path.to_owned());
        Self { scan, scanned: 0, polls: 0, patience, end: None, part, is_complete: false }
    }

    /// Path of the file that is read: the first one, or another one of a split recording.
    pub(super) fn part(&self) -> &Path {
        &self.part
    }

    /// True if the file has parts that are not scanned; otherwise the log may have ended.
    pub(super) fn has_news(&mut self, file: &LogFile, index: &ContainerIndex, follow: &FollowOptions) -> bool {
        if self.is_complete {
            return self.goes_on(file, index, follow);
        }
        // Asked before the length: a reception may write the rest of the log before it is over.
        let is_over = follow.reception.as_ref().map(|reception| reception.is_over());
        file.grow();
        if file.len() > self.scanned {
            return true;
        }
        self.end = match is_over {
            Some(false) => None,
            Some(true) => Some(LogEnd::Unrecorded),
            None if follow.stop.load(Ordering::Relaxed) => Some(LogEnd::Stopped),
            None => (self.polls > self.patience.idle_polls).then_some(LogEnd::Idle),
        };
        false
    }

    /// True if the recording goes on in the next file of a split recording; otherwise the log may have ended.
    fn goes_on(&mut self, file: &LogFile, index: &ContainerIndex, follow: &FollowOptions) -> bool {
        file.grow();
        let next = next_part(&self.part).filter(|_| follow.reception.is_none());
        let patience = match &next {
            None => 0,
            Some(next) if next.exists() => self.patience.idle_polls,
            Some(_) => self.patience.next_polls,
        };
        let opened = next.and_then(|next| Some((LogFile::open(&next, file.limits()).ok()?, next)));
        if let Some((part, next)) = opened.filter(|_| file.len() >= self.scan.complete_bytes()) {
            // A file of another flight begins at another time.
            let begin_ns = ContainerIndex::read(&part).first_log_time_ns();
            match begin_ns.map(|begin_ns| begin_ns.abs_diff(index.last_log_time_ns()) <= self.patience.stopped_ns) {
                Some(true) => {
                    self.scan = ScanState::of_part(file.append(part));
                    (self.part, self.is_complete, self.polls) = (next, false, 0);
                    return true;
                }
                Some(false) => self.polls = patience,
                None => {}
            }
        }
        let is_over = self.polls >= patience || follow.stop.load(Ordering::Relaxed);
        self.end = is_over.then_some(LogEnd::Complete);
        false
    }

    /// Adds what has been written since; true if there are more blocks.
    pub(super) fn grow(&mut self, file: &LogFile, index: &mut ContainerIndex) -> bool {
        (self.scanned, self.polls) = (file.len(), 0);
        let before = index.blocks.len();
        self.end = match index.scan(file, &mut self.scan) {
            ScanEnd::Footer => {
                self.is_complete = true;
                None
            }
            ScanEnd::Limit => Some(LogEnd::Limit),
            ScanEnd::EndOfFile | ScanEnd::Incomplete(_) => None,
        };
        index.blocks.len() > before
    }
}

/// Path of the part that follows a part of a split recording, `flight_1.mcap` after `flight_0.mcap`.
fn next_part(path: &Path) -> Option<PathBuf> {
    let (stem, extension) = (path.file_stem()?.to_str()?, path.extension()?.to_str()?);
    let (name, number) = stem.rsplit_once('_')?;
    let next = number.parse::<u32>().ok()?.checked_add(1)?;
    Some(path.with_file_name(format!("{name}_{next}.{extension}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_files_of_a_split_recording_are_numbered() {
        for (name, expected) in [("a_9.mcap", Some("a_10.mcap")), ("a.mcap", None), ("a_b.mcap", None)] {
            assert_eq!(next_part(Path::new(name)), expected.map(PathBuf::from));
        }
    }
}
