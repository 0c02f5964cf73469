//! IMU samples of a fork whose cameras have another time offset.

use crate::sensors::{ImuSample, sample_at};

/// Time before the end of an interval for which samples are kept, in nanoseconds: longer than any shift.
const KEPT_NS: i64 = 200_000_000;
/// Shortest interval between two images, in nanoseconds.
const SHORTEST_NS: i64 = 1_000_000;

/// Cuts the samples between images at stamps that are shifted.
#[derive(Clone, Debug, Default)]
pub(super) struct ShiftedImu {
    /// Samples before the stamp of the last image.
    recent: Vec<ImuSample>,
    /// Last sample of the previous interval; `None` before the first one, which starts as recorded.
    end: Option<ImuSample>,
}

impl ShiftedImu {
    /// Samples between the shifted stamps of the previous image and this one, and the samples after it; `imu` and
    /// `after` are the same samples for stamps without a shift.
    pub(super) fn cut(
        &mut self,
        imu: &[ImuSample],
        after: &[ImuSample],
        shift_ns: i64,
    ) -> (Vec<ImuSample>, Vec<ImuSample>) {
        let Some(stamp_ns) = imu.last().map(|last| last.stamp_ns) else { return (Vec::new(), Vec::new()) };
        let mut known = std::mem::take(&mut self.recent);
        for sample in imu.iter().chain(after) {
            if known.last().is_none_or(|last| last.stamp_ns < sample.stamp_ns) {
                known.push(*sample);
            }
        }
        let start = self.end.unwrap_or(imu[0]);
        let stop_ns = (stamp_ns + shift_ns).max(start.stamp_ns + SHORTEST_NS);
        let stop = sample_at(&known, stop_ns).unwrap_or(ImuSample { stamp_ns: stop_ns, ..start });
        let inside = known.iter().filter(|it| it.stamp_ns > start.stamp_ns && it.stamp_ns < stop.stamp_ns);
        let cut = std::iter::once(start).chain(inside.copied()).chain([stop]).collect();
        let following = known.iter().filter(|it| it.stamp_ns > stop.stamp_ns);
        let cut_after =
            if after.is_empty() { Vec::new() } else { std::iter::once(stop).chain(following.copied()).collect() };
        self.end = Some(stop);
        known.retain(|it| it.stamp_ns <= stamp_ns && it.stamp_ns > stamp_ns - KEPT_NS);
        self.recent = known;
        (cut, cut_after)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;

    /// Samples at 200 Hz over a range of milliseconds, both ends included; the angular velocity is the stamp in
    /// milliseconds.
    fn samples(from_ms: i64, to_ms: i64) -> Vec<ImuSample> {
        let sample = |stamp_ms: i64| ImuSample {
            stamp_ns: stamp_ms * 1_000_000,
            angular_velocity_rad_per_s: Vector3::repeat(stamp_ms as f64),
            specific_force_m_per_s2: Vector3::zeros(),
            unmeasured_s: 0.0,
        };
        (from_ms..=to_ms).filter(|ms| *ms == from_ms || *ms == to_ms || ms % 5 == 0).map(sample).collect()
    }

    fn check(shift_ms: i64) {
        let mut shifted = ShiftedImu::default();
        let mut end_ns = None;
        for image in 0..8 {
            let (from, to) = (1000 + image * 50, 1050 + image * 50);
            let (cut, after) = shifted.cut(&samples(from, to), &samples(to, to + 60), shift_ms * 1_000_000);
            assert!(cut.windows(2).all(|pair| pair[0].stamp_ns < pair[1].stamp_ns), "{shift_ms} ms: {cut:?}");
            assert!(end_ns.is_none_or(|end_ns| end_ns == cut[0].stamp_ns), "{shift_ms} ms: the intervals join");
            let stop = cut.last().unwrap();
            assert_eq!(stop.stamp_ns, (to + shift_ms) * 1_000_000);
            assert_eq!(after[0], *stop);
            for sample in &cut {
                assert!((sample.angular_velocity_rad_per_s.x - sample.stamp_ns as f64 * 1e-6).abs() < 1e-9);
            }
            end_ns = Some(stop.stamp_ns);
        }
    }

    #[test]
    fn intervals_end_at_the_shifted_stamps_and_join() {
        check(0);
        check(17);
        check(-23);
        check(50);
    }
}
