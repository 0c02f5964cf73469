use super::file::LogFile;
use super::index::{ContainerIndex, MessagePosition};

/// Messages of one topic in the order of their log times. They are read in groups on demand, because the message
/// indexes of a log of gigabytes are far apart.
#[derive(Clone, Debug)]
pub(crate) struct TopicIndex {
    channel_ids: Vec<u16>,
    /// Groups of blocks with overlapping log times, in time order.
    groups: Vec<Vec<usize>>,
    /// Index of the first group that is not in `loaded`.
    next_group: usize,
    /// Number of blocks of the log that have been looked at.
    known_blocks: usize,
    loaded: Vec<MessagePosition>,
}

impl TopicIndex {
    pub(crate) fn new(index: &ContainerIndex, channel_ids: &[u16]) -> Self {
        let mut topic = Self {
            channel_ids: channel_ids.to_vec(),
            groups: Vec::new(),
            next_group: 0,
            known_blocks: 0,
            loaded: Vec::new(),
        };
        topic.extend(index);
        topic
    }

    /// Adds the blocks that the log has got since the last call; they follow the messages before them.
    fn extend(&mut self, index: &ContainerIndex) {
        let mut blocks = index.blocks_with(&self.channel_ids, self.known_blocks);
        self.known_blocks = index.blocks.len();
        blocks.sort_by_key(|number| (index.blocks[*number].log_time_ns.0, *number));
        let earlier = self.groups.len();
        let mut group_end_ns = 0;
        for number in blocks {
            let (first_ns, last_ns) = index.blocks[number].log_time_ns;
            match self.groups[earlier..].last_mut() {
                Some(group) if first_ns < group_end_ns => group.push(number),
                _ => self.groups.push(vec![number]),
            }
            group_end_ns = group_end_ns.max(last_ns);
        }
    }

    /// Number of blocks of the log that have been looked at.
    pub(crate) fn known_blocks(&self) -> usize {
        self.known_blocks
    }

    /// Log time of the last message so far.
    pub(crate) fn last_log_time_ns(&self) -> Option<u64> {
        self.loaded.last().map(|position| position.log_time_ns)
    }

    /// Position of a message, counted from the first one (or from the position of [`TopicIndex::skip_to`]).
    pub(crate) fn get(&mut self, index: &ContainerIndex, file: &LogFile, number: usize) -> Option<MessagePosition> {
        if self.known_blocks < index.blocks.len() {
            self.extend(index);
        }
        while self.loaded.len() <= number && self.load_group(index, file) {}
        self.loaded.get(number).copied()
    }

    /// Number of the first message at or after a log time.
    pub(crate) fn first_at(&mut self, index: &ContainerIndex, file: &LogFile, log_time_ns: u64) -> usize {
        while self.loaded.last().is_none_or(|last| last.log_time_ns < log_time_ns) && self.load_group(index, file) {}
        self.loaded.partition_point(|position| position.log_time_ns < log_time_ns)
    }

    /// Skips the groups that end before a log time: messages are then counted from the first remaining group.
    pub(crate) fn skip_to(&mut self, index: &ContainerIndex, log_time_ns: u64) {
        let ends_before =
            |group: &&Vec<usize>| group.iter().all(|block| index.blocks[*block].log_time_ns.1 < log_time_ns);
        let count = self.groups.iter().take_while(ends_before).count();
        self.groups.drain(..count);
    }

    /// Positions in the first and in the last group.
    pub(crate) fn ends(&self, index: &ContainerIndex, file: &LogFile) -> [Vec<MessagePosition>; 2] {
        [self.groups.first(), self.groups.last()]
            .map(|group| group.map(|group| index.positions(file, group, &self.channel_ids)).unwrap_or_default())
    }

    pub(crate) fn count(&mut self, index: &ContainerIndex, file: &LogFile) -> usize {
        while self.load_group(index, file) {}
        self.loaded.len()
    }

    fn load_group(&mut self, index: &ContainerIndex, file: &LogFile) -> bool {
        let Some(group) = self.groups.get(self.next_group) else { return false };
        // Every message has an entry in the file; a larger number is caused by overlapping indexes.
        if self.loaded.len() as u64 > file.limits().messages(file.len() as u64) {
            return false;
        }
        self.loaded.extend(index.positions(file, group, &self.channel_ids));
        self.next_group += 1;
        true
    }
}
