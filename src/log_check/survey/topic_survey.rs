//! Times, senders and problems of the messages of one topic.

use std::collections::BTreeSet;

use crate::geometry::seconds_from_ns;
use crate::log_check::statistics::median;

/// Maximum number of listed frames of a topic.
const FRAMES: usize = 16;

/// Log time and header stamp of a message, relative to the log's start, and what identifies its content and sender.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Times {
    pub(crate) log_time_ns: i64,
    pub(crate) stamp_ns: i64,
    /// Checksum of the content without the header, `None` if the message has none or cannot be read.
    pub(crate) checksum: Option<u32>,
    /// Number of the header's frame among the frames of the topic.
    pub(crate) frame: usize,
}

/// Times of one topic, ordered by log time.
#[derive(Clone, Debug, Default)]
pub(crate) struct TopicSurvey {
    pub(crate) topic: String,
    pub(crate) times: Vec<Times>,
    /// Frames of the headers, at most [`FRAMES`].
    pub(crate) frames: Vec<String>,
    /// Number of messages that cannot be decoded.
    pub(crate) unreadable: usize,
    pub(crate) first_problem: String,
    /// Number of joint messages without any position, and the content of the first.
    pub(crate) without_positions: Option<(usize, &'static str)>,
}

impl TopicSurvey {
    pub(crate) fn stamp_range(&self) -> (i64, i64) {
        let stamps = || self.times.iter().map(|times| times.stamp_ns);
        (stamps().min().unwrap_or(0), stamps().max().unwrap_or(0))
    }

    /// True if there are several messages and all have the same stamp, as if it was never set.
    pub(crate) fn has_one_stamp(&self) -> bool {
        let (first, last) = self.stamp_range();
        self.times.len() > 2 && first == last
    }

    /// Stamps in the order of log times, without messages that have stamp and content of an earlier one.
    pub(crate) fn stamps_without_duplicates(&self) -> Vec<i64> {
        let mut known = BTreeSet::new();
        let is_new = |times: &&Times| times.checksum.is_none() || known.insert((times.stamp_ns, times.checksum));
        self.times.iter().filter(is_new).map(|times| times.stamp_ns).collect()
    }

    /// Stamps with the checksums of the messages, ordered by stamp.
    pub(crate) fn contents(&self) -> Vec<(i64, u32)> {
        let content = |times: &Times| Some((times.stamp_ns, times.checksum?));
        let mut contents: Vec<(i64, u32)> = self.times.iter().filter_map(content).collect();
        contents.sort_by_key(|(stamp_ns, _)| *stamp_ns);
        contents
    }

    /// Number of a frame among the frames of the topic; frames beyond the limit share one.
    pub(crate) fn frame(&mut self, name: &str) -> usize {
        let known = self.frames.iter().position(|known| known == name);
        known.unwrap_or_else(|| {
            if self.frames.len() < FRAMES {
                self.frames.push(name.to_owned());
            }
            self.frames.len() - 1
        })
    }

    pub(crate) fn median_latency_s(&self) -> f64 {
        let latencies: Vec<f64> =
            self.times.iter().map(|times| seconds_from_ns(times.log_time_ns - times.stamp_ns)).collect();
        median(&latencies)
    }

    pub(crate) fn refuse(&mut self, problem: String) {
        self.unreadable += 1;
        if self.first_problem.is_empty() {
            self.first_problem = problem;
        }
    }
}
