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
    loaded: Vec<MessagePosition>,
}

impl TopicIndex {
    pub(crate) fn new(index: &ContainerIndex, channel_ids: &[u16]) -> Self {
        let mut blocks = index.blocks_with(channel_ids);
        blocks.sort_by_key(|number| (index.blocks[*number].log_time_ns.0, *number));
        let mut groups: Vec<Vec<usize>> = Vec::new();
        let mut group_end_ns = 0;
        for number in blocks {
            let (first_ns, last_ns) = index.blocks[number].log_time_ns;
            match groups.last_mut() {
                Some(group) if first_ns < group_end_ns => group.push(number),
                _ => groups.push(vec![number]),
            }
            group_end_ns = group_end_ns.max(last_ns);
        }
        Self { channel_ids: channel_ids.to_vec(), groups, next_group: 0, loaded: Vec::new() }
    }

    /// Position of a message, counted from the first one (or from the position of [`TopicIndex::skip_to`]).
    pub(crate) fn get(&mut self, index: &ContainerIndex, file: &LogFile, number: usize) -> Option<MessagePosition> {
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
