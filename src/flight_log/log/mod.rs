mod followed;
pub(crate) mod following;
pub(crate) mod foreign;
mod pace;
pub(crate) mod topic_info;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use parking_lot::{Mutex, RwLock};

use self::following::Following;
use self::topic_info::{TopicInfo, nothing_read};
use super::container::file::LogFile;
use super::container::{BlockCache, ContainerIndex, DecodedBlock, MessagePosition, MessageSpan, TopicIndex};
use super::error::list;
use super::grey_levels::GreyLevels;
use super::messages::{self, AttitudeLayout, MessageKind};
use super::{LogError, LogWarning, WarningKind};
use crate::files::{FileError, LimitExceeded, LimitKind, LogLimits};
use crate::geometry::seconds_from_ns;
use crate::text::{log_name, without_signed_zeros};

/// First stamps further than this before the IMU's first one belong to another clock and do not define the log's start.
const CLOCK_TOLERANCE_NS: i64 = 60_000_000_000;

/// Number of bytes at the start that identify the kind of a file.
const START_BYTES: usize = 512;

/// Open flight log: an MCAP file with the index of its chunks.
#[derive(Debug)]
pub struct FlightLog {
    path: PathBuf,
    file: LogFile,
    index: RwLock<Arc<ContainerIndex>>,
    /// Growth of a log that is being written.
    following: Option<Following>,
    channel_ids: BTreeMap<String, Vec<u16>>,
    topics: Vec<TopicInfo>,
    epoch_ns: i64,
    duration_ns: AtomicI64,
    warnings: Vec<LogWarning>,
    /// Conversions of 16-bit images by topic, as far as they are known.
    grey_levels: Mutex<BTreeMap<String, Arc<GreyLevels>>>,
}

impl FlightLog {
    /// Opens a log. Of an indexed log only the index, the first and the last messages are read; a log without an index
    /// (or truncated) is scanned once.
    ///
    /// The log starts (time zero) at the smallest header stamp among the first messages of all topics that are read,
    /// except stamps more than a minute before the first IMU message, which are of another clock.
    pub fn open(path: &Path) -> Result<Self, LogError> {
        Self::open_with(path, &LogLimits::default())
    }

    /// Opens a log with other limits than the default ones.
    pub fn open_with(path: &Path, limits: &LogLimits) -> Result<Self, LogError> {
        let file = LogFile::open(path, limits)?;
        check_magic(&file, path)?;
        let index = ContainerIndex::read(&file);
        Self::of(path, file, index, None)
    }

    fn of(path: &Path, file: LogFile, index: ContainerIndex, following: Option<Following>) -> Result<Self, LogError> {
        let mut channel_ids: BTreeMap<String, Vec<u16>> = BTreeMap::new();
        for (id, channel) in &index.channels {
            channel_ids.entry(channel.topic.clone()).or_default().push(*id);
        }
        let warnings: Vec<LogWarning> = refuse_topics(&mut channel_ids, file.limits()).into_iter().collect();
        let mut log = Self {
            path: path.to_owned(),
            file,
            index: RwLock::new(Arc::new(index)),
            following,
            channel_ids,
            topics: Vec::new(),
            epoch_ns: 0,
            duration_ns: AtomicI64::new(0),
            warnings,
            grey_levels: Mutex::default(),
        };
        log.find_topics_and_times()?;
        log.report_damage();
        Ok(log)
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn size_bytes(&self) -> u64 {
        self.file.len() as u64
    }

    /// Checksum (CRC-32) of the first and the last mebibyte, which identifies the log without reading all of it.
    pub fn checksum(&self) -> u32 {
        const PART_BYTES: usize = 1 << 20;
        let length = self.file.len();
        let mut hasher = crc32fast::Hasher::new();
        for part in [0..length.min(PART_BYTES), length.saturating_sub(PART_BYTES)..length] {
            // An unreadable part changes the checksum.
            hasher.update(&self.file.read(part).unwrap_or_default());
        }
        hasher.finalize()
    }

    /// Topics in the order of their names.
    pub fn topics(&self) -> &[TopicInfo] {
        &self.topics
    }

    /// Topic with this name, if the log has messages on it.
    pub fn topic(&self, name: &str) -> Option<&TopicInfo> {
        self.topics.iter().find(|info| info.topic == name)
    }

    /// Absolute header stamp of the log's start (time zero), in nanoseconds since the epoch.
    pub fn epoch_ns(&self) -> i64 {
        self.epoch_ns
    }

    /// Time from the log's start to the latest header stamp among the last messages of its topics, in nanoseconds.
    pub fn duration_ns(&self) -> i64 {
        self.duration_ns.load(Ordering::Relaxed)
    }

    /// Problems found when opening the log. Every [`FrameStream`](super::FrameStream) reports them again at their time.
    pub fn warnings(&self) -> &[LogWarning] {
        &self.warnings
    }

    fn warn(&mut self, kind: WarningKind, subject: &str, stamp_ns: i64, message: String) {
        self.warnings.push(LogWarning::new(kind, subject, stamp_ns, without_signed_zeros(message)));
    }

    /// Name and content of the first attachment whose name ends with `name_ends_with`.
    pub fn attachment(&self, name_ends_with: &str) -> Option<(String, Vec<u8>)> {
        let index = self.index();
        let place = index.attachments.iter().find(|place| place.name.ends_with(name_ends_with))?;
        Some((place.name.clone(), ContainerIndex::attachment(&self.file, place)?))
    }

    /// Names of the topics with messages of one of these kinds.
    pub fn topics_of(&self, kinds: &[MessageKind]) -> Vec<String> {
        let of_kind = self.topics.iter().filter(|info| info.kind.is_some_and(|kind| kinds.contains(&kind)));
        of_kind.map(|info| info.topic.clone()).collect()
    }

    /// Returns the topic of a rig field, if the log has it with one of these types.
    pub fn require_topic(&self, field: &str, topic: &str, kinds: &[MessageKind]) -> Result<&TopicInfo, LogError> {
        let (field, path) = (field.to_owned(), self.path.clone());
        let expected = || kinds.iter().map(|kind| kind.schema_name()).collect::<Vec<_>>().join(" or ");
        match self.topic(topic) {
            Some(info) if info.kind.is_some_and(|kind| kinds.contains(&kind)) => Ok(info),
            Some(info) if info.has_unread_encoding(kinds) => Err(LogError::UnreadEncoding {
                field,
                topic: topic.to_owned(),
                found: info.type_in_encoding(),
                remedy: info.encoding_remedy(),
                path,
            }),
            Some(info) => Err(LogError::OtherType {
                field,
                topic: topic.to_owned(),
                found: format!(
                    "{}; the log's topics of type {} are {}",
                    info.type_in_encoding(),
                    expected(),
                    list(&self.topics_of(kinds))
                ),
                path,
            }),
            None => Err(LogError::MissingTopic {
                field,
                topic: topic.to_owned(),
                expected: expected(),
                available: self.topics_of(kinds),
                path,
            }),
        }
    }

    /// Layout of the attitudes of a topic, which a field of the rig names.
    ///
    /// # Errors
    /// If messages of PX4 lack a field by their definition in the log.
    pub(crate) fn attitude_layout(&self, field: &str, info: &TopicInfo) -> Result<AttitudeLayout, LogError> {
        let index = self.index();
        let channel = self.channel_ids.get(&info.topic).and_then(|ids| index.channels.get(ids.first()?));
        let definition = channel.and_then(|channel| channel.definition.as_deref()).unwrap_or_default();
        let kind = info.kind.unwrap_or(MessageKind::QuaternionStamped);
        AttitudeLayout::of(kind, definition).map_err(|problem| {
            let problem = format!("messages of '{}' ({}) are not read: {problem}", info.topic, kind.schema_name());
            FileError::Rig { field: field.to_owned(), problem, path: self.path.clone() }.into()
        })
    }

    /// Topic of one of these kinds whose messages are not read in their encoding.
    pub(crate) fn unread_topic_of(&self, kinds: &[MessageKind]) -> Option<&TopicInfo> {
        self.topics.iter().find(|info| info.has_unread_encoding(kinds))
    }

    /// Positions of the messages of a topic.
    pub(super) fn topic_index(&self, topic: &str) -> TopicIndex {
        TopicIndex::new(&self.index(), self.channel_ids.get(topic).map_or(&[], |ids| ids))
    }

    /// Returns an error if another process has shortened the file since it was opened, so that data read from it are
    /// incomplete.
    pub fn require_unshortened(&self) -> Result<(), LogError> {
        self.file.require_unshortened(&self.path)
    }

    pub fn file(&self) -> &LogFile {
        &self.file
    }

    /// Blocks, channels and messages so far.
    pub(crate) fn index(&self) -> Arc<ContainerIndex> {
        Arc::clone(&self.index.read())
    }

    /// Converts a log time to nanoseconds since the start of the log.
    pub(crate) fn since_start(&self, log_time_ns: u64) -> i64 {
        relative_ns(i64::try_from(log_time_ns).unwrap_or(i64::MAX), self.epoch_ns)
    }

    /// Calls `visit` for every readable message of a topic in the order of log times, with its log time since the start
    /// of the log, until it returns `false`.
    pub(super) fn for_each_message(&self, topic: &str, mut visit: impl FnMut(i64, &[u8]) -> bool) {
        let mut cache = BlockCache::new(2);
        let mut topic = self.topic_index(topic);
        let mut number = 0;
        while let Some(position) = topic.get(&self.index(), &self.file, number) {
            number += 1;
            if let Some((block, message)) = self.message(&mut cache, position) {
                let data = block.bytes(&message.data);
                if !visit(self.since_start(position.log_time_ns), data) {
                    return;
                }
            }
        }
    }

    /// Block of the message at a position, and the message's range in the block; `None` if it cannot be read.
    pub(super) fn message(
        &self,
        cache: &mut BlockCache,
        position: MessagePosition,
    ) -> Option<(Arc<DecodedBlock>, MessageSpan)> {
        let block = cache.get(&self.file, &self.index().blocks, position.block)?;
        let message = block.message_at(position.offset)?.clone();
        Some((block, message))
    }

    /// Returns the value of `test` for the first message of a topic with `Some`.
    pub(crate) fn find_message<T>(&self, topic: &str, mut test: impl FnMut(&[u8]) -> Option<T>) -> Option<T> {
        let mut found = None;
        self.for_each_message(topic, |_, data| {
            found = test(data);
            found.is_none()
        });
        found
    }

    /// Conversion of a topic's 16-bit images, computed at the first call for the topic.
    pub(super) fn grey_levels(&self, topic: &str, compute: impl FnOnce() -> GreyLevels) -> Arc<GreyLevels> {
        let mut known = self.grey_levels.lock();
        Arc::clone(known.entry(topic.to_owned()).or_insert_with(|| Arc::new(compute())))
    }

    fn find_topics_and_times(&mut self) -> Result<(), LogError> {
        let mut cache = BlockCache::new(4);
        let index = self.index();
        // Per topic that is read: name, and stamps of the first and last message.
        let mut stamps: Vec<(MessageKind, String, i64, i64)> = Vec::new();
        let mut infos = Vec::new();
        for (topic, ids) in &self.channel_ids {
            let mut positions = TopicIndex::new(&index, ids);
            let [first_ones, last_ones] = positions.ends(&index, &self.file);
            let (Some(first), Some(last)) = (first_ones.first(), last_ones.last()) else { continue };
            let channel = ids.first().and_then(|id| index.channels.get(id));
            let Some(channel) = channel else { continue };
            let kind = MessageKind::of_channel(&channel.schema_name, &channel.encoding);
            if let Some(kind) = kind.filter(|kind| !kind.is_attitude()) {
                let mut stamp = |position: &MessagePosition| {
                    let (block, message) = self.message(&mut cache, *position)?;
                    messages::stamp_ns(kind, block.bytes(&message.data)).ok()
                };
                let first_stamp = first_ones.iter().take(8).find_map(&mut stamp);
                let last_stamp = last_ones.iter().rev().take(8).find_map(&mut stamp);
                if let (Some(first_stamp), Some(last_stamp)) = (first_stamp, last_stamp) {
                    stamps.push((kind, topic.clone(), first_stamp, last_stamp));
                }
            }
            // The statistics may be wrong, too.
            let most = self.file.limits().messages(self.file.len() as u64);
            let counted = index.statistics.as_ref().map(|counts| {
                let counts = ids.iter().filter_map(|id| counts.get(id));
                counts.fold(0_u64, |sum, count| sum.saturating_add(*count)).min(most)
            });
            let count = counted.unwrap_or_else(|| positions.count(&index, &self.file) as u64);
            let names = [topic, &channel.schema_name, &channel.encoding].map(Clone::clone);
            infos.push((names, kind, count, *first, *last));
        }
        if infos.is_empty() {
            let problem = match index.damages.first() {
                Some(damage) => format!("at byte {}: {}", damage.byte, damage.problem),
                None => "it has no messages; record again, or try `mcap doctor`".into(),
            };
            return Err(LogError::NothingReadable { problem, path: self.path.clone() });
        }
        self.set_start(&stamps, infos.iter().map(|info| info.3.log_time_ns).min().unwrap_or(0));
        self.topics = infos
            .into_iter()
            .map(|([topic, schema, encoding], kind, count, first, last)| {
                let (first_ns, last_ns) = (self.since_start(first.log_time_ns), self.since_start(last.log_time_ns));
                let span_s = seconds_from_ns(last_ns.saturating_sub(first_ns));
                let rate_hz = if span_s > 0.0 { count.saturating_sub(1) as f64 / span_s } else { 0.0 };
                TopicInfo { topic, schema, encoding, kind, count, first_ns, last_ns, rate_hz }
            })
            .collect();
        Ok(())
    }

    fn set_start(&mut self, stamps: &[(MessageKind, String, i64, i64)], first_log_time_ns: u64) {
        let imu_first = stamps.iter().filter(|entry| entry.0 == MessageKind::Imu).map(|entry| entry.2).min();
        let earliest_ns = imu_first.map_or(i64::MIN, |first| first.saturating_sub(CLOCK_TOLERANCE_NS));
        let counted = || stamps.iter().filter(|entry| entry.2 >= earliest_ns && entry.2 > 0);
        let log_start_ns = i64::try_from(first_log_time_ns).unwrap_or(0);
        self.epoch_ns = counted().map(|entry| entry.2).min().unwrap_or(log_start_ns);
        let duration_ns = counted().map(|entry| relative_ns(entry.3, self.epoch_ns)).max().unwrap_or(0).max(0);
        self.duration_ns = AtomicI64::new(duration_ns);
        // Intrinsics are the same at any time.
        for (_, topic, first_ns, _) in stamps.iter().filter(|entry| entry.0 != MessageKind::CameraInfo) {
            if *first_ns == 0 {
                let message =
                    format!("{topic}: first header stamp 0 (never set); the topic does not define the log's start");
                self.warn(WarningKind::Stamps, topic, 0, message);
            } else if *first_ns < earliest_ns || *first_ns < 0 {
                let message = format!(
                    "{topic}: first header stamp {:.3} s before the log's start (another clock, or a stamp that was never \
                     set); the topic does not define the log's start",
                    seconds_from_ns(self.epoch_ns.saturating_sub(*first_ns))
                );
                self.warn(WarningKind::Stamps, topic, 0, message);
            }
        }
    }

    fn report_damage(&mut self) {
        for damage in &self.index().damages {
            let stamp_ns =
                if damage.after_log_time_ns == 0 { 0 } else { self.since_start(damage.after_log_time_ns).max(0) };
            let message = format!(
                "the log is damaged after second {:.3}, at byte {} of {}: {}; everything before it is used",
                seconds_from_ns(stamp_ns),
                damage.byte,
                self.file.len(),
                damage.problem
            );
            self.warn(WarningKind::Damage, "", stamp_ns, message);
        }
        if !self.topics.iter().any(|info| info.kind.is_some()) {
            let (problem, remedy) = nothing_read(&self.topics);
            self.warn(WarningKind::NothingRead, "", 0, format!("{problem}; {remedy}"));
        }
    }
}

/// Times further from the log's start are damaged; they are clamped to this, so that differences of two cannot
/// overflow.
const FARTHEST_NS: i64 = i64::MAX / 4;

/// Converts an absolute time to nanoseconds since the start of the log.
pub(crate) fn relative_ns(absolute_ns: i64, epoch_ns: i64) -> i64 {
    absolute_ns.saturating_sub(epoch_ns).clamp(-FARTHEST_NS, FARTHEST_NS)
}

/// Removes the topics beyond the limit, with a warning.
fn refuse_topics(channel_ids: &mut BTreeMap<String, Vec<u16>>, limits: &LogLimits) -> Option<LogWarning> {
    let (found, allowed) = (channel_ids.len() as u64, limits.topics());
    if found <= allowed {
        return None;
    }
    let last = channel_ids.keys().nth(allowed as usize).cloned();
    if let Some(last) = last {
        channel_ids.split_off(&last);
    }
    let exceeded = LimitExceeded { kind: LimitKind::Topics, subject: "a log", found, allowed };
    let message = format!("{exceeded}; the others, in the order of their names, are read");
    Some(LogWarning::new(WarningKind::Topics, "", 0, message))
}

fn check_magic(file: &LogFile, path: &Path) -> Result<(), LogError> {
    let failed = |problem| LogError::NothingReadable { problem, path: path.to_owned() };
    let file = file.read(0..file.len().min(START_BYTES)).map_err(failed)?;
    if file.starts_with(mcap::MAGIC) {
        return Ok(());
    }
    let (found, remedy) = if let Some((found, remedy)) = foreign::described(&file, &log_name(path)) {
        (found.to_owned(), remedy)
    } else if let Some(bytes) = lfs_pointer(&file) {
        let found = format!("a Git LFS pointer in place of the file ({bytes} bytes)");
        (found, "fetch the log with `git lfs pull`")
    } else if file.iter().all(|byte| byte.is_ascii_graphic() || byte.is_ascii_whitespace()) {
        let start: String = file.iter().take(24).map(|byte| char::from(*byte)).collect();
        (format!("a text file that begins with {start:?}"), "give the .mcap file itself")
    } else {
        let start: Vec<String> = file.iter().take(8).map(|byte| format!("{byte:02x}")).collect();
        (format!("the file begins with {} instead of the MCAP magic", start.join(" ")), "give an MCAP log")
    };
    Err(LogError::NotALog { found, remedy, path: path.to_owned() })
}

/// Size of the file behind a Git LFS pointer, `None` if these first bytes are not a pointer.
pub(super) fn lfs_pointer(start: &[u8]) -> Option<&str> {
    let text = std::str::from_utf8(start.get(..start.len().min(START_BYTES))?).ok()?;
    let mut lines = text.lines();
    lines.next().filter(|line| line.starts_with("version https://git-lfs.github.com/spec/"))?;
    let size = lines.find_map(|line| line.strip_prefix("size ")).map(str::trim);
    size.filter(|size| size.bytes().all(|byte| byte.is_ascii_digit())).or(Some("unknown"))
}
