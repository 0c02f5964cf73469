//! Merges messages with some of the joints to samples of all joints: several drivers can publish on one topic, one
//! joint each.

pub mod attitude;

use std::collections::VecDeque;

use crate::geometry::wrap_angle;
use crate::sensors::JointSample;

/// Larger gaps between readings of a joint are not interpolated.
const MAX_GAP_NS: i64 = 200_000_000;

/// Message with an angle in radians for each of the rig's joints that it contains.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct JointReading {
    pub(crate) stamp_ns: i64,
    pub(crate) angles_rad: Vec<Option<f64>>,
}

/// Merges readings by joint name at the stamps of the first joint; readings of the other joints are interpolated.
///
/// Messages with all joints pass unchanged.
#[derive(Clone, Debug)]
pub(crate) struct JointMerge {
    /// Readings by joint, starting with the last one at or before the next sample.
    readings: Vec<VecDeque<(i64, f64)>>,
    /// Stamp of the last reading.
    newest_ns: i64,
    ended: bool,
}

impl JointMerge {
    pub(crate) fn new(joints: usize) -> Self {
        Self { readings: vec![VecDeque::new(); joints], newest_ns: i64::MIN, ended: false }
    }

    /// Adds the next reading; stamps must not decrease. Returns `false` for a joint's second reading of one stamp,
    /// which is ignored.
    pub(crate) fn push(&mut self, reading: &JointReading) -> bool {
        self.newest_ns = reading.stamp_ns;
        let mut taken = true;
        for (queue, angle) in self.readings.iter_mut().zip(&reading.angles_rad) {
            let Some(angle) = angle else { continue };
            let repeats = queue.back().is_some_and(|(last_ns, _)| *last_ns >= reading.stamp_ns);
            taken &= !repeats;
            if !repeats {
                queue.push_back((reading.stamp_ns, *angle));
            }
        }
        taken
    }

    /// Marks the end of the readings.
    pub(crate) fn finish(&mut self) {
        self.ended = true;
    }

    /// Next sample with an angle for every joint, `None` while later readings are needed.
    pub(crate) fn pop(&mut self) -> Option<JointSample> {
        loop {
            let (stamp_ns, _) = *self.readings.first()?.front()?;
            for queue in &mut self.readings {
                while queue.get(1).is_some_and(|(second_ns, _)| *second_ns <= stamp_ns) {
                    queue.pop_front();
                }
            }
            let late = self.ended || self.newest_ns - stamp_ns > MAX_GAP_NS;
            let known = |queue: &VecDeque<(i64, f64)>| queue.back().is_some_and(|(last_ns, _)| *last_ns >= stamp_ns);
            if !late && !self.readings.iter().all(known) {
                return None;
            }
            let angles_rad: Option<Vec<f64>> = self.readings.iter().map(|queue| angle_at(queue, stamp_ns)).collect();
            self.readings[0].pop_front();
            if let Some(angles_rad) = angles_rad {
                return Some(JointSample { stamp_ns, angles_rad });
            }
        }
    }
}

/// Angle at a stamp, from the reading at the stamp or interpolated between the readings around it.
fn angle_at(readings: &VecDeque<(i64, f64)>, stamp_ns: i64) -> Option<f64> {
    let (before_ns, before) = *readings.front().filter(|(first_ns, _)| *first_ns <= stamp_ns)?;
    if before_ns == stamp_ns {
        return Some(before);
    }
    let (after_ns, after) = *readings.get(1)?;
    let gap_ns = after_ns - before_ns;
    let fraction = (stamp_ns - before_ns) as f64 / gap_ns as f64;
    (gap_ns <= MAX_GAP_NS).then(|| before + fraction * wrap_angle(after - before))
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    fn merged(readings: &[(i64, [Option<f64>; 2])]) -> Vec<(i64, Vec<f64>)> {
        let mut merge = JointMerge::new(2);
        let mut samples = Vec::new();
        for (milliseconds, angles_rad) in readings {
            merge.push(&JointReading { stamp_ns: milliseconds * MS, angles_rad: angles_rad.to_vec() });
            samples.extend(std::iter::from_fn(|| merge.pop()));
        }
        merge.finish();
        samples.extend(std::iter::from_fn(|| merge.pop()));
        samples.into_iter().map(|sample| (sample.stamp_ns / MS, sample.angles_rad)).collect()
    }

    #[test]
    fn messages_of_all_joints_pass_unchanged() {
        let readings = [(0, [Some(0.1), Some(-0.3)]), (5, [Some(0.2), Some(3.0)]), (10, [Some(0.7), Some(-3.1)])];
        let expected: Vec<_> = readings.iter().map(|(at, angles)| (*at, angles.map(Option::unwrap).to_vec())).collect();
        assert_eq!(merged(&readings), expected);
    }

    #[test]
    fn joints_of_separate_messages_meet_at_the_stamps_of_the_first() {
        let mut readings = Vec::new();
        for step in 0..20 {
            let at = |milliseconds: i64| milliseconds as f64 * 1e-3;
            readings.push((10 * step, [Some(at(10 * step)), None]));
            readings.push((10 * step + 4, [None, Some(-2.0 * at(10 * step + 4))]));
        }
        let samples = merged(&readings);
        // The first sample has no reading of the second joint before it.
        assert_eq!(samples.iter().map(|(at, _)| *at).collect::<Vec<_>>(), (1..20).map(|k| 10 * k).collect::<Vec<_>>());
        for (at, angles) in samples {
            let time_s = at as f64 * 1e-3;
            assert!((angles[0] - time_s).abs() < 1e-12 && (angles[1] + 2.0 * time_s).abs() < 1e-12, "{at} {angles:?}");
        }
    }

    #[test]
    fn equal_stamps_are_merged_and_gaps_are_not_interpolated() {
        let at_once =
            [(0, [Some(1.0), None]), (0, [None, Some(2.0)]), (10, [None, Some(4.0)]), (10, [Some(3.0), None])];
        assert_eq!(merged(&at_once), [(0, vec![1.0, 2.0]), (10, vec![3.0, 4.0])]);
        let gap = [
            (0, [Some(0.0), Some(0.0)]),
            (100, [Some(0.1), None]),
            (300, [Some(0.3), None]),
            (400, [Some(0.4), Some(4.0)]),
        ];
        assert_eq!(merged(&gap), [(0, vec![0.0, 0.0]), (400, vec![0.4, 4.0])]);
        let wrapped = [(0, [Some(0.0), Some(3.1)]), (5, [Some(0.5), None]), (10, [Some(1.0), Some(-3.1)])];
        let between = merged(&wrapped)[1].1[1];
        assert!((between - std::f64::consts::PI).abs() < 1e-12, "{between}");
    }

    #[test]
    fn a_repeated_reading_is_refused() {
        let mut merge = JointMerge::new(2);
        let reading = JointReading { stamp_ns: 7, angles_rad: vec![None, Some(0.5)] };
        assert!(merge.push(&reading));
        assert!(!merge.push(&reading));
    }
}
