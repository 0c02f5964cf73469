//! A log that another program is writing: its index grows while it is read.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;

use parking_lot::Mutex;

use super::following::{BEGIN_NS, FollowOptions, Following, Growth, LogEnd, POLL, Patience};
use super::pace::Pace;
use super::{FlightLog, check_magic};
use crate::files::LogLimits;
use crate::flight_log::container::ContainerIndex;
use crate::flight_log::container::file::LogFile;
use crate::flight_log::live::{Reception, ReceptionEvent};
use crate::flight_log::{LogError, LogWarning, WarningKind};
use crate::geometry::seconds_from_ns;

impl FlightLog {
    /// Opens a log that another program is writing, as soon as it contains three seconds; its streams then wait for
    /// messages until the log has its footer, nothing is written for half a minute, or it is asked to stop. The end of a
    /// log that is being received is decided by its reception.
    ///
    /// Topics, start and warnings follow from the messages at opening.
    ///
    /// # Errors
    /// As [`FlightLog::open`], and if the file does not appear within half a minute.
    pub fn open_following(path: &Path, limits: &LogLimits, follow: FollowOptions) -> Result<Self, LogError> {
        Self::follow(path, limits, follow, Patience::default())
    }

    fn follow(path: &Path, limits: &LogLimits, follow: FollowOptions, patience: Patience) -> Result<Self, LogError> {
        let mut polls = 0;
        let file = loop {
            polls += 1;
            let waits = match &follow.reception {
                Some(reception) => !reception.is_over(),
                None => polls < patience.idle_polls && !follow.stop.load(Ordering::Relaxed),
            };
            match path.metadata() {
                Ok(metadata) if metadata.len() == 0 && waits => {}
                Err(_) if waits => {}
                _ => break LogFile::open(path, limits)?,
            }
            thread::sleep(POLL);
        };
        check_magic(&file, path)?;
        let (mut index, mut growth) = (ContainerIndex::default(), Growth::new(path, patience));
        while growth.end.is_none() && index.span_ns() < BEGIN_NS {
            if !(growth.has_news(&file, &index, &follow) && growth.grow(&file, &mut index)) {
                growth.polls += 1;
                thread::sleep(POLL);
            }
        }
        let pace = follow.longest_delay_s.map(|delay_s| Pace::new(delay_s, index.span_ns()));
        Self::of(path, file, index, Some(Following { growth: Mutex::new(growth), follow, pace }))
    }

    /// Waits until the log has more blocks than this; false if it has ended.
    pub(crate) fn wait_for_blocks(&self, known: usize) -> bool {
        let Some(following) = &self.following else { return false };
        while self.index().blocks.len() <= known {
            let mut growth = following.growth.lock();
            if growth.end.is_some() {
                return self.index().blocks.len() > known;
            }
            if !self.look(&mut growth, &following.follow) {
                growth.polls += 1;
                // Readers look one after the other, so that their number does not shorten the time without growth.
                thread::sleep(POLL);
            }
        }
        true
    }

    /// Adds to the index what has been written since; true if there are more blocks.
    fn look(&self, growth: &mut Growth, follow: &FollowOptions) -> bool {
        let known = self.index();
        if !growth.has_news(&self.file, &known, follow) {
            return false;
        }
        let mut index = ContainerIndex::clone(&known);
        let has_grown = growth.grow(&self.file, &mut index);
        if has_grown {
            self.duration_ns.fetch_max(self.since_start(index.last_log_time_ns()), Ordering::Relaxed);
            *self.index.write() = Arc::new(index);
        }
        has_grown
    }

    /// Looks at a log that is being written while no stream waits for it, so that its length is the present one.
    pub fn look_for_growth(&self) {
        let Some(following) = &self.following else { return };
        if let Some(mut growth) = following.growth.try_lock().filter(|growth| growth.end.is_none()) {
            self.look(&mut growth, &following.follow);
        }
    }

    /// Log time by which other topics are ahead of a topic that has ended; `None` for a log that is complete.
    pub(crate) fn stopped_ns(&self) -> Option<u64> {
        Some(self.following.as_ref()?.growth.lock().patience.stopped_ns)
    }

    /// True for a log that was opened while another program was writing it.
    pub fn is_followed(&self) -> bool {
        self.following.is_some()
    }

    /// Ends reading a log that is being written; a reception completes its recording.
    pub fn end_following(&self) {
        if let Some(following) = &self.following {
            following.follow.stop.store(true, Ordering::Relaxed);
        }
    }

    /// The reception that writes the log, if it is being received.
    pub fn reception(&self) -> Option<&Arc<Reception>> {
        self.following.as_ref()?.follow.reception.as_ref()
    }

    /// True if the image at a stamp is to be left out, because the run is too far behind the newest message.
    pub(crate) fn leaves_out(&self, stamp_ns: i64, rate_hz: f64) -> bool {
        let pace = self.following.as_ref().and_then(|following| following.pace.as_ref());
        pace.is_some_and(|pace| pace.leaves_out(stamp_ns, self.duration_ns(), rate_hz))
    }

    /// True if images may be left out, because they come faster than they are processed.
    pub fn keeps_up(&self) -> bool {
        self.following.as_ref().is_some_and(|following| following.pace.is_some())
    }

    /// True for a gap of a topic during an interruption of the reception, which is reported once.
    pub(crate) fn is_interruption(&self, gap: &LogWarning) -> bool {
        let absolute = |stamp_ns: i64| u64::try_from(self.epoch_ns.saturating_add(stamp_ns)).unwrap_or(0);
        let is_gap = matches!(gap.kind, WarningKind::ImuGap | WarningKind::ImageGap);
        let of_reception = self.reception().filter(|_| is_gap);
        of_reception.is_some_and(|reception| reception.was_interrupted(absolute(gap.stamp_ns), absolute(gap.last_ns)))
    }

    /// Warnings about the reception since the last call.
    pub(crate) fn take_reception_warnings(&self) -> Vec<LogWarning> {
        let events = self.reception().map(|reception| reception.take_events()).unwrap_or_default();
        let warning = |event: ReceptionEvent| {
            let stamp_ns = if event.log_time_ns == 0 { 0 } else { self.since_start(event.log_time_ns) };
            LogWarning::new(WarningKind::Reception, "", stamp_ns, event.message)
        };
        events.into_iter().map(warning).collect()
    }

    /// Reason why a log that was being written has ended; `None` while it grows, and for any other log.
    pub fn end(&self) -> Option<LogEnd> {
        self.following.as_ref()?.growth.lock().end
    }

    /// The log with all that has been written until now, with its topics, rates and warnings.
    ///
    /// # Errors
    /// As [`FlightLog::open`].
    pub fn reopened(&self) -> Result<Self, LogError> {
        let failed = |source| LogError::Io { action: "open the log again", source, path: self.path.clone() };
        let file = self.file.reopened().map_err(failed)?;
        // The index at the end of a complete file knows more than a scan, such as the number of messages.
        let is_part = self.following.as_ref().is_some_and(|following| following.growth.lock().part() != self.path);
        let index = if is_part { ContainerIndex::clone(&self.index()) } else { ContainerIndex::read(&file) };
        Self::of(&self.path, file, index, None)
    }

    /// Warning about a log whose writer has not completed it; `None` for any other log.
    pub fn end_warning(&self) -> Option<LogWarning> {
        let after_s = seconds_from_ns(self.duration_ns());
        let problem = match self.end()? {
            LogEnd::Complete => return None,
            LogEnd::Idle => "nothing was written for 30 s, and the log has no footer: its writer has stopped",
            LogEnd::Stopped => "reading was ended before the log was complete",
            LogEnd::Limit => "a limit on the content of a log is reached (--limit)",
            LogEnd::Unrecorded => "no more could be recorded",
        };
        let message = format!("the log ends after second {after_s:.3}: {problem}; everything before it is used");
        Some(LogWarning::new(WarningKind::Damage, "", self.duration_ns(), message))
    }
}

#[cfg(test)]
mod tests {
    use std::borrow::Cow;
    use std::fs::{self, File};
    use std::io::Write as _;
    use std::time::Duration;

    use super::*;
    use crate::files::RigFile as _;
    use crate::flight_log::writer::growing::GrowingLog;
    use crate::flight_log::{FrameStream, MessageKind, MessageType, SensorFrame};

    const IMPATIENT: Patience = Patience { idle_polls: 10, next_polls: 50, stopped_ns: 2_000_000_000 };

    fn sample() -> Vec<u8> {
        fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../../sample_logs/garden.mcap")).unwrap()
    }

    /// Log times of the messages of the IMU, waiting for those that are not written yet.
    fn log_times(log: &FlightLog) -> Vec<u64> {
        let topic = log.topics_of(&[MessageKind::Imu]).remove(0);
        let mut messages = log.topic_index(&topic);
        let mut times = Vec::new();
        loop {
            match messages.get(&log.index(), log.file(), times.len()) {
                Some(position) => times.push(position.log_time_ns),
                None if log.wait_for_blocks(messages.known_blocks()) => {}
                None => return times,
            }
        }
    }

    /// Writes the bytes in parts that end anywhere, and returns the times that a reader gets meanwhile.
    fn followed(path: &Path, bytes: &[u8]) -> (FlightLog, Vec<u64>) {
        thread::scope(|scope| {
            scope.spawn(|| {
                let mut file = File::create(path).unwrap();
                for part in bytes.chunks(70_001) {
                    file.write_all(part).unwrap();
                    thread::sleep(Duration::from_millis(2));
                }
            });
            let log = FlightLog::follow(path, &LogLimits::default(), FollowOptions::default(), IMPATIENT).unwrap();
            let times = log_times(&log);
            (log, times)
        })
    }

    #[test]
    fn a_log_that_is_being_written_gives_the_messages_of_the_complete_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("live.mcap");
        let (log, times) = followed(&path, &sample());
        assert_eq!((log.end(), log.end_warning()), (Some(LogEnd::Complete), None));
        let complete = FlightLog::open(&path).unwrap();
        assert_eq!(times, log_times(&complete));
        assert_eq!(log.epoch_ns(), complete.epoch_ns());
        assert!((log.duration_ns() - complete.duration_ns()).abs() < 50_000_000, "{}", log.duration_ns());
        assert_eq!(complete.end(), None);
    }

    /// Writes the messages of the sample log between two log times; channels are numbered after the other topics.
    fn write_part(path: &Path, other_topics: &[&str], is_part: impl Fn(u64) -> bool) {
        let bytes = sample();
        let mut part = GrowingLog::create(path).unwrap();
        for topic in other_topics {
            part.channel(topic, &MessageType::ros2("std_msgs/msg/String", "string data")).unwrap();
        }
        for message in mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap) {
            let schema = message.channel.schema.as_ref().unwrap();
            let message_type = MessageType {
                name: &schema.name,
                definition_encoding: &schema.encoding,
                definition: Cow::Borrowed(&schema.data),
                message_encoding: &message.channel.message_encoding,
            };
            let channel = part.channel(&message.channel.topic, &message_type).unwrap();
            if is_part(message.log_time) {
                part.write(channel, message.log_time, &message.data).unwrap();
            }
        }
        part.finish().unwrap();
    }

    #[test]
    fn a_recording_goes_on_in_the_next_file_with_other_channels() {
        let folder = tempfile::tempdir().unwrap();
        let part = |number: usize| folder.path().join(format!("flight_{number}.mcap"));
        let complete_path = folder.path().join("complete.mcap");
        fs::write(&complete_path, sample()).unwrap();
        let complete = Arc::new(FlightLog::open(&complete_path).unwrap());
        let (begin_ns, end_ns) = (complete.epoch_ns() as u64, complete.index().last_log_time_ns());
        // A log that is being written is opened after three seconds.
        let [first_ns, second_ns] = [0.5, 0.75].map(|ratio| begin_ns + ((end_ns - begin_ns) as f64 * ratio) as u64);
        write_part(&part(0), &[], |time_ns| time_ns < first_ns);
        let patience = Patience { idle_polls: 200, next_polls: 200, ..IMPATIENT };
        let follow = || FlightLog::follow(&part(0), &LogLimits::default(), FollowOptions::default(), patience);
        let yaml = include_str!("../../../sample_logs/garden.rig.yaml");
        let rig = crate::sensors::Rig::from_yaml(yaml, Path::new("garden.rig.yaml")).unwrap();
        let content = |log: &Arc<FlightLog>| {
            let mut stream = FrameStream::with_motion_after(Arc::clone(log), &rig, "cam0", 0.0, None, 0.06).unwrap();
            let frames = std::iter::from_fn(|| stream.next_frame());
            frames.map(|frame| (frame.stamp_ns, frame.imu, frame.image)).collect::<Vec<_>>()
        };
        let log = Arc::new(follow().unwrap());
        let followed = thread::scope(|scope| {
            let reader = scope.spawn(|| content(&log));
            thread::sleep(POLL);
            write_part(&part(1), &["/a", "/b"], |time_ns| (first_ns..second_ns).contains(&time_ns));
            write_part(&part(2), &["/c"], |time_ns| time_ns >= second_ns);
            reader.join().unwrap()
        });
        assert!(followed == content(&complete));
        assert_eq!((log.end(), log.end_warning()), (Some(LogEnd::Complete), None));
        let reopened = log.reopened().unwrap();
        assert_eq!((reopened.is_followed(), reopened.duration_ns()), (false, complete.duration_ns()));
        let counts = |log: &FlightLog| log.topics().iter().map(|it| (it.topic.clone(), it.count)).collect::<Vec<_>>();
        assert_eq!(counts(&reopened), counts(&complete));
    }

    #[test]
    fn the_next_file_of_another_flight_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let part = |number: usize| folder.path().join(format!("flight_{number}.mcap"));
        fs::write(part(1), sample()).unwrap();
        let (log, times) = followed(&part(0), &sample());
        assert_eq!(times, log_times(&FlightLog::open(&part(0)).unwrap()));
        assert_eq!((log.end(), log.end_warning()), (Some(LogEnd::Complete), None));
    }

    #[test]
    fn a_writer_that_stops_ends_the_log_with_a_warning() {
        let folder = tempfile::tempdir().unwrap();
        let mut cut = sample();
        cut.truncate(cut.len() * 2 / 3);
        let (log, times) = followed(&folder.path().join("live.mcap"), &cut);
        assert_eq!(log.end(), Some(LogEnd::Idle));
        assert!(log.end_warning().unwrap().message.contains("its writer has stopped"));
        assert!(times.len() > 500, "{} messages", times.len());
    }

    #[test]
    fn a_reader_that_is_far_behind_loses_no_topic() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("live.mcap");
        let bytes = sample();
        // The first half has more than three seconds; five seconds follow at once, which is longer than the patience.
        let (first, rest) = bytes.split_at(bytes.len() / 2);
        fs::write(&path, first).unwrap();
        let follow = || FlightLog::follow(&path, &LogLimits::default(), FollowOptions::default(), IMPATIENT);
        let log = Arc::new(follow().unwrap());
        let yaml = include_str!("../../../sample_logs/garden.rig.yaml");
        let rig = crate::sensors::Rig::from_yaml(yaml, Path::new("garden.rig.yaml")).unwrap();
        let count = |log: &Arc<FlightLog>| crate::flight_log::imu_samples(log, &rig).unwrap().count();
        let followed = thread::scope(|scope| {
            let reader = scope.spawn(|| count(&log));
            thread::sleep(POLL);
            fs::OpenOptions::new().append(true).open(&path).unwrap().write_all(rest).unwrap();
            reader.join().unwrap()
        });
        assert_eq!(followed, count(&Arc::new(FlightLog::open(&path).unwrap())));
        assert_eq!(log.end(), Some(LogEnd::Complete));
    }

    #[test]
    fn images_are_left_out_where_a_run_is_too_far_behind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("live.mcap");
        let bytes = sample();
        let (first, rest) = bytes.split_at(bytes.len() / 2);
        fs::write(&path, first).unwrap();
        let yaml = include_str!("../../../sample_logs/garden.rig.yaml");
        let rig = crate::sensors::Rig::from_yaml(yaml, Path::new("garden.rig.yaml")).unwrap();
        let frames = |log: &Arc<FlightLog>| {
            let mut stream = FrameStream::with_motion_after(Arc::clone(log), &rig, "cam0", 0.0, None, 0.06).unwrap();
            let frames: Vec<_> = std::iter::from_fn(|| stream.next_frame()).collect();
            (frames, stream.remaining_warnings().to_vec())
        };
        let options = FollowOptions { longest_delay_s: Some(0.5), ..FollowOptions::default() };
        let log = Arc::new(FlightLog::follow(&path, &LogLimits::default(), options, IMPATIENT).unwrap());
        // Five seconds more than at opening are written before the first image is read.
        fs::OpenOptions::new().append(true).open(&path).unwrap().write_all(rest).unwrap();
        log.look_for_growth();
        let (kept, warnings) = frames(&log);
        let (all, _) = frames(&Arc::new(FlightLog::open(&path).unwrap()));
        let of_images = kept.iter().flat_map(|frame| &frame.warnings).chain(&warnings);
        let left_out: usize =
            of_images.filter(|warning| warning.kind == WarningKind::LeftOut).map(|warning| warning.count).sum();
        assert_eq!(kept.len() + left_out, all.len());
        assert!(kept.len() > 20 && left_out > 20, "{} of {}", kept.len(), all.len());
        for pair in kept.windows(2) {
            assert_eq!(pair[0].imu.last(), pair[1].imu.first(), "at {}", pair[1].stamp_ns);
        }
        let samples = |frames: &[SensorFrame]| frames.iter().map(|frame| frame.imu.len()).sum::<usize>();
        assert!(samples(&kept) + 2 * left_out + 500 > samples(&all), "{} of {}", samples(&kept), samples(&all));
    }

    #[test]
    fn reading_ends_when_it_is_asked_to() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("live.mcap");
        let bytes = sample();
        fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
        let log =
            FlightLog::follow(&path, &LogLimits::default(), FollowOptions::default(), Patience::default()).unwrap();
        thread::scope(|scope| {
            scope.spawn(|| {
                thread::sleep(Duration::from_millis(100));
                log.end_following();
            });
            assert!(!log_times(&log).is_empty());
        });
        assert_eq!(log.end(), Some(LogEnd::Stopped));
        let missing = folder.path().join("none.mcap");
        let error =
            FlightLog::follow(&missing, &LogLimits::default(), FollowOptions::default(), IMPATIENT).unwrap_err();
        assert!(error.to_string().contains("none.mcap"), "{error}");
    }
}
