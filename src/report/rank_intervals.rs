//! Intervals of constant rank over time, as sentences.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::geometry::seconds_from_ns;
use crate::gimbal::ParameterId;
use crate::observability::RankReport;
use crate::sensors::Rig;
use crate::session::RunRecord;

/// Minimum length of an interval, summarized by its most frequent ranks: on a real flight the informed rank changes
/// from frame to frame.
const MIN_INTERVAL_NS: i64 = 1_000_000_000;

/// An interval of constant ranks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct RankInterval {
    /// Start, in seconds since the log began.
    pub(super) from_s: f64,
    /// End, in seconds since the log began.
    pub(super) to_s: f64,
    pub(super) columns: usize,
    pub(super) structural: usize,
    pub(super) informed: usize,
    /// Rank deficit by cause: parameterization, joints that did not move, absorbed by free joint angles, motion of the
    /// vehicle.
    pub(super) lost: [usize; 4],
    /// Parameter that is least observable in most of the interval's frames.
    pub(super) least_observable: Option<String>,
}

impl RankInterval {
    /// The interval as a sentence: `3.2 to 8.5 s: structural rank 18 of 18, informed rank 15, least observable yaw.d`.
    pub(super) fn sentence(&self) -> String {
        let causes = ["parameterization", "stationary joints", "free joint angles", "vehicle motion"];
        let lost = self.lost.iter().zip(causes).filter(|(count, _)| **count > 0);
        let lost: Vec<String> = lost.map(|(count, cause)| format!("{count} {cause}")).collect();
        let lost = if lost.is_empty() { String::new() } else { format!(" (deficit: {})", lost.join(", ")) };
        let least_observable =
            self.least_observable.as_ref().map_or_else(String::new, |name| format!(", least observable {name}"));
        format!(
            "{:.1} to {:.1} s: structural rank {} of {}{lost}, informed rank {}{least_observable}",
            self.from_s, self.to_s, self.structural, self.columns, self.informed
        )
    }
}

/// Number of columns, structural and informed rank, rank deficit by cause.
type Finding = (usize, usize, usize, [usize; 4]);

fn finding(rank: &RankReport) -> Finding {
    let lost = [rank.deficit_parameterization, rank.deficit_joints, rank.deficit_absorbed, rank.deficit_motion];
    (rank.parameters.len(), rank.rank_structural, rank.rank_informed, lost)
}

/// The most frequent item; of equally frequent items the smallest.
fn most_frequent<T: Ord + Clone>(items: impl Iterator<Item = T>) -> Option<T> {
    let mut counts: BTreeMap<T, usize> = BTreeMap::new();
    for item in items {
        *counts.entry(item).or_default() += 1;
    }
    let largest = counts.values().copied().max()?;
    counts.into_iter().find(|(_, count)| *count == largest).map(|(item, _)| item)
}

/// Intervals of a run in time order.
pub(super) fn rank_intervals(run: &RunRecord, rig: &Rig) -> Vec<RankInterval> {
    let ranked: Vec<(i64, &RankReport)> =
        run.steps.iter().filter_map(|step| Some((step.report.stamp_ns, step.rank.as_ref()?))).collect();
    let names = rig.parameter_names();
    let mut intervals: Vec<RankInterval> = Vec::new();
    let mut least_observable_of_interval: Vec<ParameterId> = Vec::new();
    let begin_ns = ranked.first().map_or(0, |(stamp_ns, _)| *stamp_ns);
    let stretches =
        ranked.chunk_by(|(a, _), (b, _)| (a - begin_ns) / MIN_INTERVAL_NS == (b - begin_ns) / MIN_INTERVAL_NS);
    for stretch in stretches {
        let Some((columns, structural, informed, lost)) = most_frequent(stretch.iter().map(|(_, rank)| finding(rank)))
        else {
            continue;
        };
        let ends =
            [stretch.first(), stretch.last()].map(|end| end.map_or(0.0, |(stamp_ns, _)| seconds_from_ns(*stamp_ns)));
        let least_observable = stretch.iter().filter_map(|(_, rank)| rank.least_observable());
        let same = |interval: &&mut RankInterval| {
            (interval.columns, interval.structural, interval.informed, interval.lost)
                == (columns, structural, informed, lost)
        };
        if let Some(interval) = intervals.last_mut().filter(same) {
            interval.to_s = ends[1];
            least_observable_of_interval.extend(least_observable);
        } else {
            least_observable_of_interval = least_observable.collect();
            intervals.push(RankInterval {
                from_s: ends[0],
                to_s: ends[1],
                columns,
                structural,
                informed,
                lost,
                least_observable: None,
            });
        }
        if let Some(interval) = intervals.last_mut() {
            interval.least_observable =
                most_frequent(least_observable_of_interval.iter()).map(|parameter| names.name(*parameter));
        }
    }
    intervals
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_read_as_sentences() {
        let interval = RankInterval {
            from_s: 3.2,
            to_s: 8.5,
            columns: 24,
            structural: 15,
            informed: 11,
            lost: [6, 0, 0, 3],
            least_observable: Some("yaw.d".to_owned()),
        };
        assert_eq!(
            interval.sentence(),
            "3.2 to 8.5 s: structural rank 15 of 24 (deficit: 6 parameterization, 3 vehicle motion), informed rank 11, \
             least observable yaw.d"
        );
        let full = RankInterval { structural: 24, lost: [0; 4], least_observable: None, ..interval };
        assert!(!full.sentence().contains("deficit"), "{}", full.sentence());
    }

    #[test]
    fn the_most_frequent_is_returned_and_of_two_the_smaller() {
        assert_eq!(most_frequent([3, 1, 3, 2, 1, 3].into_iter()), Some(3));
        assert_eq!(most_frequent([3, 1, 3, 1].into_iter()), Some(1));
        assert_eq!(most_frequent(std::iter::empty::<u8>()), None);
    }
}
