//! Prescribed motions of vehicle and joints as splines.

use std::ops::Range;

use nalgebra::{Vector1, Vector3};

use super::motion_samples::{MotionSample, PrescribedMotion};
use super::spline::Spline;
use super::trajectory::Trajectory;
use crate::geometry::median;

/// Motion of joints and vehicle as one uniform quintic B-spline per channel: the joints, then forward, left, up in
/// metres, then the heading.
///
/// The vehicle starts and ends at rest where the control values at the ends are equal ([`Self::free_points`]).
#[derive(Clone, Debug, PartialEq)]
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
/// Knots on either side of its time on which a control value has an effect.
const POINT_REACH: f64 = 3.0;
/// Weights of five neighbouring control values at a knot, times [`KNOT_SUM`].
const KNOT_WEIGHTS: [f64; 3] = [66.0, 26.0, 1.0];
const KNOT_SUM: f64 = 120.0;
/// Iterations of the interpolation: the error falls by a factor of 0.7 or less with each.
const ROUNDS: usize = 150;
/// Shortest distance of the knots of a spline through samples, in seconds.
const MIN_KNOT_S: f64 = 0.1;

/// Time between two samples of a motion, in seconds.
const SAMPLE_S: f64 = 0.02;

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
        let gaps_s = motion.samples.windows(2).map(|pair| pair[1].time_s - pair[0].time_s);
        let knot_s = median(gaps_s).map_or(MIN_KNOT_S, |gap_s| gap_s.max(MIN_KNOT_S));
        Self::with_knots(motion, knot_s)
    }

    /// Interpolates samples that pass [`PrescribedMotion::check`] at knots about `knot_s` seconds apart; between them the
    /// motion is smoother than the samples.
    pub fn with_knots(motion: &PrescribedMotion, knot_s: f64) -> Self {
        let duration_s = motion.duration_s();
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

    /// Number of control values of a channel.
    pub fn point_count(&self) -> usize {
        self.channels[0].points.len()
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

    /// Times in seconds between which a control value has an effect.
    pub fn reach_of_point_s(&self, index: usize) -> [f64; 2] {
        let half_s = POINT_REACH * self.knot_s();
        [self.time_of_point(index) - half_s, self.time_of_point(index) + half_s]
    }

    /// Change of a channel per change of a control value, `distance` knots from the control value's time.
    pub fn weight_at_knot(distance: usize) -> f64 {
        KNOT_WEIGHTS.get(distance).map_or(0.0, |weight| weight / KNOT_SUM)
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

    /// Samples of the motion every 0.02 s, for joints with these names.
    pub fn prescribed(&self, joint_names: Vec<String>) -> PrescribedMotion {
        let intervals = (self.duration_s() / SAMPLE_S).round().max(1.0);
        let times_s = (0..=intervals as usize).map(|index| index as f64 / intervals * self.duration_s());
        PrescribedMotion { joint_names, samples: times_s.map(|time_s| self.sample(time_s)).collect() }
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
