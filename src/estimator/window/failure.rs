//! Failure criteria of the window.

use super::features::FeatureMap;
use super::window_state::WindowState;
use crate::estimator::config::EstimatorOptions;
use crate::estimator::report::{Event, EventKind, FailureCause};
use crate::estimator::state::frame::Frame;
use crate::estimator::state::navigation::NavigationState;
use crate::geometry::seconds_from_ns;

#[derive(Clone, Debug, Default)]
pub(crate) struct LandmarkWatch {
    /// Stamp of the first image with too few landmarks, `None` while there are enough.
    blind_since_ns: Option<i64>,
}

impl LandmarkWatch {
    /// Checks a solved window; returns an event when the landmarks become too few.
    pub(crate) fn observe(&mut self, window: &WindowState, options: &EstimatorOptions) -> Option<Event> {
        let required = options.min_landmarks;
        let slot = window.frames.newest_slot();
        let observed = window
            .features
            .iter()
            .flat_map(FeatureMap::values)
            .filter(|feature| feature.landmark.is_some() && feature.observation(slot).is_some())
            .count();
        let newest = window.frames.newest();
        // The zero-velocity update constrains a stationary vehicle without landmarks.
        if observed >= required || newest.stationary.is_some() {
            self.blind_since_ns = None;
            return None;
        }
        if self.blind_since_ns.is_some() {
            return None;
        }
        self.blind_since_ns = Some(newest.stamp_ns);
        let message = format!(
            "only {observed} landmarks observed, {required} required: IMU-only propagation until there are more"
        );
        Some(Event::decided(EventKind::MeasurementMissing, message, observed as f64, required as f64))
    }

    /// Time with too few landmarks, in seconds.
    fn blind_s(&self, newest_ns: i64) -> f64 {
        self.blind_since_ns.map_or(0.0, |since_ns| seconds_from_ns(newest_ns - since_ns))
    }
}

/// Failure of the window, `None` without one; `predicted` is the state of the newest frame before the solve.
pub(crate) fn failure(
    newest: &Frame,
    predicted: &NavigationState,
    landmarks: &LandmarkWatch,
    options: &EstimatorOptions,
) -> Option<Event> {
    let state = newest.state.navigation;
    let checks = [
        (
            FailureCause::AccelerometerBias,
            "accelerometer bias out of bounds, m/s²",
            state.bias.accelerometer_m_per_s2.norm(),
            options.max_accelerometer_bias,
        ),
        (
            FailureCause::GyroscopeBias,
            "gyroscope bias out of bounds, rad/s",
            state.bias.gyroscope_rad_per_s.norm(),
            options.max_gyroscope_bias,
        ),
        (
            FailureCause::Velocity,
            "velocity out of bounds, m/s",
            state.velocity_m_per_s.norm(),
            options.max_velocity_m_per_s,
        ),
        (
            FailureCause::Correction,
            "correction of the newest position too large, m",
            (state.world_from_imu.translation_m - predicted.world_from_imu.translation_m).norm(),
            options.max_position_correction_m,
        ),
        (
            FailureCause::Features,
            "time with too few observed landmarks too long, s",
            landmarks.blind_s(newest.stamp_ns),
            options.max_blind_s,
        ),
    ];
    let (cause, reason, value, limit) =
        checks.into_iter().find(|(_, _, value, limit)| !value.is_finite() || value > limit)?;
    Some(Event::failure(cause, format!("{reason}: {value:.3} (limit {limit:.3})"), value, limit))
}

/// Event for saturated IMU samples in the newest interval, `None` without any.
pub(crate) fn saturation(newest: &Frame) -> Option<Event> {
    let (saturated, count) = (newest.motion.saturated_samples(), newest.motion.samples().len());
    (saturated > 0).then(|| {
        let message = format!(
            "IMU saturated in {saturated} of {count} samples (an axis repeats a large value): their noise \
             densities are raised"
        );
        Event::decided(EventKind::MeasurementMissing, message, saturated as f64, 0.0)
    })
}
