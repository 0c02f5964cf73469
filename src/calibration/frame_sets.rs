//! Synchronized frame sets with estimated states: an image of the static camera and the next image of the
//! gimbal camera.

use nalgebra::Vector3;

use super::input::TrackedView;
use super::{CalibrationInput, CalibrationOptions};
use crate::estimator::preintegration::Matrix15;
use crate::estimator::{ImuBias, NavigationState, Preintegration};
use crate::geometry::{ns_from_seconds, seconds_from_ns, wrap_angle};
use crate::sensors::{ImuNoise, ImuSample, JointAngles, sample_at, samples_between};

/// Largest delay of the gimbal camera's image relative to the static camera's image of the same frame set.
const MAX_IMAGE_DELAY_NS: i64 = 60_000_000;

/// Image of the gimbal camera in a frame set.
#[derive(Clone, Debug)]
pub(super) struct GimbalView {
    /// Index among the gimbal camera's views.
    pub(super) view: usize,
    /// Preintegrated motion from the frame set's stamp to this image; so short that it is treated as exact.
    pub(super) image_delay: Preintegration,
    /// Angular velocity measured at the image's stamp, in rad/s.
    pub(super) gyroscope_rad_per_s: Vector3<f64>,
    /// Encoder readings at the image's stamp.
    pub(super) encoder: JointAngles,
    /// Rates of change of the readings in rad/s, from the previous and the next image; zero without these.
    pub(super) reading_rate_rad_per_s: Vec<f64>,
}

/// Image of the static camera with the gimbal camera's image that follows it.
#[derive(Clone, Debug)]
pub(super) struct FrameSet {
    /// Stamp of the static camera's image since the start of the log.
    pub(super) stamp_ns: i64,
    /// Index of the static camera's image among its views.
    pub(super) static_view: usize,
    /// Angular velocity measured at the stamp, in rad/s.
    pub(super) gyroscope_rad_per_s: Vector3<f64>,
    /// Bias for intervals of milliseconds: delay of the gimbal camera's image and time offsets.
    pub(super) bias: ImuBias,
    /// Preintegrated IMU samples since the previous frame set with their square-root information (15 × 15); `None`
    /// for the first.
    pub(super) motion: Option<(Preintegration, Matrix15)>,
    /// Image of the gimbal camera, `None` if there is none close enough with encoder readings.
    pub(super) gimbal: Option<GimbalView>,
}

impl FrameSet {
    /// Integrates the IMU samples again with the bias at the start of their interval.
    pub(super) fn reintegrate(&mut self, before: Option<&ImuBias>, here: &ImuBias) {
        if let (Some((motion, information)), Some(bias)) = (&mut self.motion, before) {
            motion.reintegrate(*bias);
            if let Some(renewed) = motion.square_root_information() {
                *information = renewed;
            }
        }
        self.bias = *here;
        if let Some(gimbal) = &mut self.gimbal {
            gimbal.image_delay.reintegrate(*here);
        }
    }
}

/// IMU samples in time order.
pub(super) struct ImuBuffer {
    samples: Vec<ImuSample>,
}

impl ImuBuffer {
    /// Collects the samples of all views of a camera.
    pub(super) fn new(views: &[TrackedView]) -> Self {
        let mut samples: Vec<ImuSample> = Vec::new();
        for sample in views.iter().flat_map(|view| &view.imu) {
            let finite = sample.angular_velocity_rad_per_s.iter().chain(&sample.specific_force_m_per_s2);
            let later = samples.last().is_none_or(|last| sample.stamp_ns > last.stamp_ns);
            if later && finite.into_iter().all(|value| value.is_finite()) {
                samples.push(*sample);
            }
        }
        Self { samples }
    }

    /// Sample at a time, by linear interpolation; beyond the ends the nearest sample.
    pub(super) fn at(&self, stamp_ns: i64) -> Option<ImuSample> {
        sample_at(&self.samples, stamp_ns)
    }

    /// Samples of an interval, interpolated at both ends.
    pub(super) fn between(&self, from_ns: i64, to_ns: i64) -> Vec<ImuSample> {
        samples_between(&self.samples, from_ns, to_ns)
    }

    /// Preintegrated samples of an interval.
    pub(super) fn integrated(&self, noise: ImuNoise, bias: ImuBias, from_ns: i64, to_ns: i64) -> Preintegration {
        Preintegration::from_samples(noise, bias, &self.between(from_ns, to_ns))
    }
}

/// Frame sets of the longest interval in which the static camera has states, with these states.
pub(super) fn frame_sets(
    input: &CalibrationInput,
    options: &CalibrationOptions,
    states: &[Option<NavigationState>],
) -> (Vec<FrameSet>, Vec<NavigationState>) {
    let static_views = &input.static_camera.views;
    let tape = ImuBuffer::new(static_views);
    let spacing_ns = ns_from_seconds(options.spacing_s);
    let mut chosen: Vec<(usize, NavigationState)> = Vec::new();
    for index in longest_stretch(states) {
        let Some(state) = &states[index] else { continue };
        // Half an image period of tolerance selects the image nearest to the spacing.
        let due = chosen.last().is_none_or(|(last, _)| {
            let period_ns = static_views[index].stamp_ns - static_views[index - 1].stamp_ns;
            static_views[index].stamp_ns - static_views[*last].stamp_ns >= spacing_ns - period_ns / 2
        });
        if due {
            chosen.push((index, *state));
        }
    }
    let mut frame_sets: Vec<FrameSet> = Vec::with_capacity(chosen.len());
    for (index, state) in &chosen {
        let stamp_ns = static_views[*index].stamp_ns;
        let motion = frame_sets.last().zip(frame_sets.len().checked_sub(1)).and_then(|(before, place)| {
            let bias = chosen[place].1.bias;
            let motion = tape.integrated(input.imu_noise, bias, before.stamp_ns, stamp_ns);
            let information = motion.square_root_information()?;
            Some((motion, information))
        });
        frame_sets.push(FrameSet {
            stamp_ns,
            static_view: *index,
            gyroscope_rad_per_s: tape.at(stamp_ns).map_or_else(Vector3::zeros, |s| s.angular_velocity_rad_per_s),
            bias: state.bias,
            motion,
            gimbal: gimbal_view(input, &tape, stamp_ns, &state.bias),
        });
    }
    (frame_sets, chosen.into_iter().map(|(_, state)| state).collect())
}

/// First image of the gimbal camera at or after a stamp, `None` if its delay is too large or it has no encoder
/// readings.
fn gimbal_view(input: &CalibrationInput, tape: &ImuBuffer, stamp_ns: i64, bias: &ImuBias) -> Option<GimbalView> {
    let views = &input.gimbal_camera.views;
    let index = views.partition_point(|view| view.stamp_ns < stamp_ns);
    let view = views.get(index)?;
    if view.stamp_ns - stamp_ns > MAX_IMAGE_DELAY_NS {
        return None;
    }
    let encoder = view.joint_angles.clone()?;
    Some(GimbalView {
        view: index,
        image_delay: tape.integrated(input.imu_noise, *bias, stamp_ns, view.stamp_ns),
        gyroscope_rad_per_s: tape.at(view.stamp_ns)?.angular_velocity_rad_per_s,
        reading_rate_rad_per_s: reading_rates(views, index).unwrap_or_else(|| vec![0.0; encoder.angles_rad.len()]),
        encoder,
    })
}

fn reading_rates(views: &[TrackedView], index: usize) -> Option<Vec<f64>> {
    let (before, after) = (views.get(index.checked_sub(1)?)?, views.get(index + 1)?);
    let duration_s = seconds_from_ns(after.stamp_ns - before.stamp_ns);
    let pairs = before.joint_angles.as_ref()?.angles_rad.iter().zip(&after.joint_angles.as_ref()?.angles_rad);
    (duration_s > 0.0).then(|| pairs.map(|(from, to)| wrap_angle(to - from) / duration_s).collect())
}

/// Longest range of consecutive images with a state.
fn longest_stretch(states: &[Option<NavigationState>]) -> std::ops::Range<usize> {
    let (mut longest, mut begin) = (0..0, 0);
    for index in 0..=states.len() {
        if index == states.len() || states[index].is_none() {
            if index - begin > longest.len() {
                longest = begin..index;
            }
            begin = index + 1;
        }
    }
    longest
}
