//! Prescribed motions of vehicle and joints: samples over time, and the splines through them.

use std::ops::Range;

use nalgebra::{Vector1, Vector3};

use super::spline::Spline;
use super::trajectory::Trajectory;

/// Vehicle and joints at one time of a prescribed motion.
#[derive(Clone, Debug, PartialEq)]
pub struct MotionSample {
    pub time_s: f64,
    /// One angle per joint.
    pub joints_rad: Vec<f64>,
    /// Position of the IMU: forward, left and up at heading zero.
    pub position_m: Vector3<f64>,
    /// Rotation about the vertical, positive to the left.
    pub heading_rad: f64,
}

/// Samples of a motion in time order, as a file holds them.
#[derive(Clone, Debug, PartialEq)]
pub struct PrescribedMotion {
    pub joint_names: Vec<String>,
    pub samples: Vec<MotionSample>,
}

/// Motion of joints and vehicle as one uniform quintic B-spline per channel: the joints, then forward, left, up in
/// metres, then the heading.
///
/// The vehicle starts and ends at rest where the control values at the ends are equal ([`Self::free_points`]).
#[derive(Clone, Debug)]
pub struct MotionSplines {
    channels: Vec<Spline<1>>,
    duration_s: f64,
}

/// Channels after the joints: three of the position, one of the heading.
const VEHICLE_CHANNELS: usize = 4;
/// Equal control values that make the first four derivatives zero at the start, and at the end.
const REST_POINTS: usize = 5;
/// Index of the control value with the largest weight at the start.
const CENTRE: usize = 2;
/// Weights of five neighbouring control values at a knot, times [`KNOT_SUM`].
const KNOT_WEIGHTS: [f64; 3] = [66.0, 26.0, 1.0];
const KNOT_SUM: f64 = 120.0;
/// Iterations of the interpolation: the error falls by a factor of 0.7 or less with each.
const ROUNDS: usize = 150;
/// Shortest distance of the knots of a spline through samples, in seconds.
const MIN_KNOT_S: f64 = 0.1;
/// Longest motion that is accepted, in seconds.
const MAX_DURATION_S: f64 = 3600.0;
/// Longest time between two samples, in seconds.
const MAX_GAP_S: f64 = 2.0;
/// Largest distance from the start, in metres, and largest angle, in radians.
const MAX_VALUE: f64 = 1000.0;

impl PrescribedMotion {
    /// Time from the first sample to the last.
    pub fn duration_s(&self) -> f64 {
        match (self.samples.first(), self.samples.last()) {
            (Some(first), Some(last)) => last.time_s - first.time_s,
            _ => 0.0,
        }
    }

    /// Checks times and values.
    ///
    /// # Errors
    /// The first problem as a sentence, with its time.
    pub fn check(&self) -> Result<(), String> {
        let duration_s = self.duration_s();
        if !(0.5..=MAX_DURATION_S).contains(&duration_s) {
            return Err(format!("the motion lasts {duration_s:.3} s: expected 0.5 to {MAX_DURATION_S} s"));
        }
        for pair in self.samples.windows(2) {
            let (from_s, to_s) = (pair[0].time_s, pair[1].time_s);
            if to_s <= from_s || to_s - from_s > MAX_GAP_S {
                return Err(format!(
                    "the time after {from_s:.3} s is {to_s:.3} s: expected a later one, at most {MAX_GAP_S} s later"
                ));
            }
        }
        for sample in &self.samples {
            if sample.joints_rad.len() != self.joint_names.len() {
                return Err(format!("the sample at {:.3} s has another number of joints", sample.time_s));
            }
            let values = sample.joints_rad.iter().chain(sample.position_m.iter()).chain([&sample.heading_rad]);
            if let Some(value) = values.copied().find(|value| value.is_nan() || value.abs() > MAX_VALUE) {
                return Err(format!(
                    "a value at {:.3} s is {value}: expected −{MAX_VALUE} to {MAX_VALUE}",
                    sample.time_s
                ));
            }
        }
        Ok(())
    }

    /// Value of a channel at a time since the first sample, by linear interpolation.
    fn value(&self, channel: usize, since_s: f64) -> f64 {
        let time_s = self.samples[0].time_s + since_s;
        let after = self.samples.partition_point(|sample| sample.time_s < time_s).clamp(1, self.samples.len() - 1);
        let (from, to) = (&self.samples[after - 1], &self.samples[after]);
        let ratio = ((time_s - from.time_s) / (to.time_s - from.time_s)).clamp(0.0, 1.0);
        let (first, second) = (from.channel(channel), to.channel(channel));
        first + (second - first) * ratio
    }
}

impl MotionSample {
    fn channel(&self, channel: usize) -> f64 {
        let joints = self.joints_rad.len();
        match channel.checked_sub(joints) {
            None => self.joints_rad[channel],
            Some(axis @ 0..3) => self.position_m[axis],
            Some(_) => self.heading_rad,
        }
    }
}

impl MotionSplines {
    /// Vehicle at rest at the origin with heading zero and these joint angles, in `intervals` knot intervals.
    pub fn at_rest(joints_rad: &[f64], duration_s: f64, intervals: usize) -> Self {
        let knot_s = duration_s / intervals as f64;
        let values = joints_rad.iter().copied().chain([0.0; VEHICLE_CHANNELS]);
        let channel =
            |value: f64| Spline { knot_s, points: vec![Vector1::new(value); intervals + REST_POINTS + CENTRE] };
        Self { channels: values.map(channel).collect(), duration_s }
    }

    /// Interpolates samples that pass [`PrescribedMotion::check`]: at its knots, 0.1 s or the samples' median distance
    /// apart, the motion equals the samples, interpolated linearly between them.
    pub fn through(motion: &PrescribedMotion) -> Self {
        let duration_s = motion.duration_s();
        let mut gaps_s: Vec<f64> = motion.samples.windows(2).map(|pair| pair[1].time_s - pair[0].time_s).collect();
        gaps_s.sort_by(f64::total_cmp);
        let knot_s = gaps_s.get(gaps_s.len() / 2).map_or(MIN_KNOT_S, |gap_s| gap_s.max(MIN_KNOT_S));
        let intervals = (duration_s / knot_s).round().max(1.0) as usize;
        let mut splines = Self::at_rest(&motion.samples[0].joints_rad, duration_s, intervals);
        for channel in 0..splines.channels.len() {
            let spline = &mut splines.channels[channel];
            let values: Vec<f64> =
                (0..=intervals).map(|knot| motion.value(channel, knot as f64 * spline.knot_s)).collect();
            interpolate(&values, &mut spline.points);
        }
        splines
    }

    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    pub fn joint_count(&self) -> usize {
        self.channels.len() - VEHICLE_CHANNELS
    }

    pub fn channel_count(&self) -> usize {
        self.channels.len()
    }

    /// Control values that may change without moving the ends, which stay at rest.
    pub fn free_points(&self) -> Range<usize> {
        let count = self.channels[0].points.len();
        REST_POINTS..(count - REST_POINTS - CENTRE).max(REST_POINTS)
    }

    pub fn point(&self, channel: usize, index: usize) -> f64 {
        self.channels[channel].points[index].x
    }

    pub fn set_point(&mut self, channel: usize, index: usize, value: f64) {
        self.channels[channel].points[index].x = value;
    }

    /// Time in seconds at which a control value has its largest weight.
    pub fn time_of_point(&self, index: usize) -> f64 {
        self.channels[0].time_of_point(index)
    }

    /// Time between two knots, in seconds.
    pub fn knot_s(&self) -> f64 {
        self.channels[0].knot_s
    }

    /// Value or derivative (order 0 to 4) of a channel at a time.
    pub fn value(&self, channel: usize, time_s: f64, order: usize) -> f64 {
        self.channels[channel].derivative(time_s, order).x
    }

    pub fn joints_rad(&self, time_s: f64) -> Vec<f64> {
        (0..self.joint_count()).map(|joint| self.value(joint, time_s, 0)).collect()
    }

    /// Value or derivative of the position.
    pub fn position_m(&self, time_s: f64, order: usize) -> Vector3<f64> {
        Vector3::from_fn(|axis, _| self.value(self.joint_count() + axis, time_s, order))
    }

    /// Value or derivative of the heading.
    pub fn heading_rad(&self, time_s: f64, order: usize) -> f64 {
        self.value(self.joint_count() + VEHICLE_CHANNELS - 1, time_s, order)
    }

    pub fn sample(&self, time_s: f64) -> MotionSample {
        MotionSample {
            time_s,
            joints_rad: self.joints_rad(time_s),
            position_m: self.position_m(time_s, 0),
            heading_rad: self.heading_rad(time_s, 0),
        }
    }

    /// Flight of the vehicle that begins at a position with a heading; it tilts as a multirotor to accelerate.
    pub fn trajectory(&self, start_m: Vector3<f64>, start_heading_rad: f64, gravity_m_per_s2: f64) -> Trajectory {
        let (joints, knot_s) = (self.joint_count(), self.knot_s());
        let (sine, cosine) = start_heading_rad.sin_cos();
        let point = |index: usize| {
            let [x, y, z] = [0, 1, 2].map(|axis| self.point(joints + axis, index));
            start_m + Vector3::new(cosine * x - sine * y, sine * x + cosine * y, z)
        };
        let heading = &self.channels[joints + VEHICLE_CHANNELS - 1].points;
        let position = Spline { knot_s, points: (0..heading.len()).map(point).collect() };
        let turned = heading.iter().map(|point| point.add_scalar(start_heading_rad));
        let heading = Spline { knot_s, points: turned.collect() };
        Trajectory::of_splines(position, heading, gravity_m_per_s2, self.duration_s)
    }
}

/// Sets control values so that the spline has these values at its knots; it is flat beyond its ends.
fn interpolate(values: &[f64], points: &mut [Vector1<f64>]) {
    let last = values.len() - 1;
    let at = |index: isize| index.clamp(0, last as isize) as usize;
    let mut centres = values.to_vec();
    let [own, near, far] = KNOT_WEIGHTS;
    for _ in 0..ROUNDS {
        for knot in 0..centres.len() {
            let k = knot as isize;
            let beside = centres[at(k - 1)] + centres[at(k + 1)];
            let beyond = centres[at(k - 2)] + centres[at(k + 2)];
            centres[knot] = (KNOT_SUM * values[knot] - near * beside - far * beyond) / own;
        }
    }
    for (index, point) in points.iter_mut().enumerate() {
        point.x = centres[at(index as isize - CENTRE as isize)];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wave(joints: usize, duration_s: f64, intervals: usize) -> MotionSplines {
        let mut splines = MotionSplines::at_rest(&vec![0.1; joints], duration_s, intervals);
        for channel in 0..splines.channel_count() {
            for index in splines.free_points() {
                let value = 0.3 * (0.7 * index as f64 + channel as f64).sin();
                splines.set_point(channel, index, value);
            }
        }
        splines
    }

    #[test]
    fn a_motion_rests_at_its_ends_and_survives_its_samples() {
        let splines = wave(2, 12.0, 24);
        for time_s in [0.0, 12.0] {
            for channel in 0..splines.channel_count() {
                for order in 1..=3 {
                    assert!(splines.value(channel, time_s, order).abs() < 1e-9, "{channel} at {time_s}");
                }
            }
        }
        let names = vec!["pan".to_owned(), "tilt".to_owned()];
        let samples = (0..=240).map(|step| splines.sample(0.05 * f64::from(step))).collect();
        let motion = PrescribedMotion { joint_names: names, samples };
        motion.check().unwrap();
        let again = MotionSplines::through(&motion);
        for step in 0..=1200 {
            let time_s = 0.01 * f64::from(step);
            for channel in 0..splines.channel_count() {
                for (order, bound) in [(0, 1e-9), (1, 1e-7), (2, 1e-6)] {
                    let error = again.value(channel, time_s, order) - splines.value(channel, time_s, order);
                    assert!(error.abs() < bound, "{error} of order {order} in {channel} at {time_s}");
                }
            }
        }
    }

    #[test]
    fn motions_that_cannot_be_flown_are_rejected_with_their_place() {
        let splines = wave(1, 4.0, 10);
        let samples: Vec<MotionSample> = (0..=40).map(|step| splines.sample(0.1 * f64::from(step))).collect();
        let motion = PrescribedMotion { joint_names: vec!["pan".to_owned()], samples };
        let check = |change: fn(&mut PrescribedMotion), words: &str| {
            let mut changed = motion.clone();
            change(&mut changed);
            let problem = changed.check().unwrap_err();
            assert!(problem.contains(words), "{problem}");
        };
        check(|motion| motion.samples.truncate(2), "lasts 0.100 s");
        check(|motion| motion.samples[7].time_s = 0.2, "after 0.600 s is 0.200 s");
        check(|motion| motion.samples[3].heading_rad = f64::NAN, "at 0.300 s is NaN");
        check(|motion| motion.samples[3].position_m.y = 1e9, "at 0.300 s");
        check(|motion| motion.samples[5].joints_rad.clear(), "number of joints");
        check(|motion| motion.samples.clear(), "lasts 0.000 s");
    }

    #[test]
    fn the_trajectory_starts_at_its_place_and_heading() {
        let splines = wave(0, 8.0, 16);
        let start = Vector3::new(3.0, -2.0, 1.0);
        let turned = splines.trajectory(start, 0.5, 9.81);
        let plain = splines.trajectory(Vector3::zeros(), 0.0, 9.81);
        for step in 0..=16 {
            let time_s = 0.5 * f64::from(step);
            let (a, b) = (turned.at(time_s), plain.at(time_s));
            let rotation = nalgebra::UnitQuaternion::from_euler_angles(0.0, 0.0, 0.5);
            let expected = start + rotation * b.world_from_imu.translation_m;
            assert!((a.world_from_imu.translation_m - expected).norm() < 1e-12);
            assert!((a.specific_force_m_per_s2 - b.specific_force_m_per_s2).norm() < 1e-9);
            assert!((a.heading_rad - b.heading_rad - 0.5).abs() < 1e-12);
        }
        assert!((plain.at(0.0).world_from_imu.translation_m).norm() < 1e-12);
    }
}
