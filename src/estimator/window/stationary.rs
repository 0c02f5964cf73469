//! Detection of a stationary vehicle in the running window.
//!
//! A landed vehicle has no parallax: new features get no depth and old ones are lost. Without zero-velocity
//! updates the IMU-only propagation would drift. Two criteria must hold: a small variance of the IMU samples (a
//! hovering multirotor rotates more), and a constant image after rotation compensation (a gimbal may rotate on
//! the ground).

use std::collections::VecDeque;

use nalgebra::{UnitQuaternion, Vector3};

use crate::estimator::initialization::bearing::fit_rotation;
use crate::estimator::report::{Event, EventKind};
use crate::estimator::state::frame::Stationary;
use crate::estimator::state::navigation::ImuBias;
use crate::estimator::stationary::{ImuAverage, ImuSpread, MAX_PARALLAX_RAD, QUIET_NS};
use crate::estimator::step_input::StepInput;
use crate::frontend::{FeatureId, TrackedFeature};
use crate::geometry::seconds_from_ns;
use crate::sensors::ImuNoise;

/// Largest mean angular velocity after bias correction (worst axis).
const MAX_ANGULAR_RATE_RAD_PER_S: f64 = 0.01;

/// Largest estimated velocity: fast motion over a distant scene has no parallax either.
const MAX_VELOCITY_M_PER_S: f64 = 0.5;

/// Smallest number of common features with the reference image.
const MIN_COMMON: usize = 12;

/// Resolution of the parallax: a tenth of a pixel at usual focal lengths.
const MIN_PARALLAX_RAD: f64 = 2e-4;

/// IMU samples from one image to the next.
#[derive(Clone, Copy, Debug)]
struct Interval {
    end_ns: i64,
    duration_s: f64,
    average: ImuAverage,
}

/// Reference image of the parallax.
#[derive(Clone, Debug)]
struct Reference {
    bearings: Vec<(FeatureId, Vector3<f64>)>,
    imu_from_camera: UnitQuaternion<f64>,
}

/// Detects a stationary vehicle, image by image.
#[derive(Clone, Debug)]
pub(crate) struct StationaryDetector {
    /// Intervals of slightly more than the last second.
    intervals: VecDeque<Interval>,
    reference: Option<Reference>,
    /// Stamp since which the image has been constant.
    unmoved_since_ns: i64,
    /// Start of the stationary phase, `None` until detected.
    stationary_since_ns: Option<i64>,
    /// Required time of a constant image. An image that moves while the IMU samples are quiet indicates slow motion:
    /// the image must then be constant for twice the time of that motion.
    required_ns: i64,
}

impl Default for StationaryDetector {
    fn default() -> Self {
        Self {
            intervals: VecDeque::new(),
            reference: None,
            unmoved_since_ns: 0,
            stationary_since_ns: None,
            required_ns: QUIET_NS,
        }
    }
}

/// New image with the window's previous estimate.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Observed<'a> {
    /// Features of the leading camera.
    pub(crate) features: &'a [TrackedFeature],
    pub(crate) noise: &'a ImuNoise,
    pub(crate) bias: &'a ImuBias,
    pub(crate) velocity_norm_m_per_s: f64,
    pub(crate) imu_from_camera: UnitQuaternion<f64>,
    /// Median distance of the landmarks, in metres.
    pub(crate) distance_m: f64,
}

impl StationaryDetector {
    /// Processes an image; returns a zero-velocity update and an event if the vehicle is stationary.
    pub(crate) fn observe(&mut self, input: &StepInput<'_>, image: &Observed<'_>) -> Option<(Stationary, Event)> {
        self.take_interval(input);
        let before_ns = self.unmoved_since_ns;
        let parallax_rad = self.compare_image(input.stamp_ns, image);
        let spread = self.spread(input.stamp_ns, image.noise);
        let quiet = spread.as_ref().is_some_and(|spread| is_quiet(spread, image.bias))
            && image.velocity_norm_m_per_s <= MAX_VELOCITY_M_PER_S;
        let unmoved_ns = input.stamp_ns - self.unmoved_since_ns;
        if !quiet {
            self.required_ns = QUIET_NS;
        } else if self.unmoved_since_ns > before_ns {
            self.required_ns = self.required_ns.max(2 * (input.stamp_ns - before_ns));
        }
        let stationary = quiet && unmoved_ns >= self.required_ns;
        let (Some(spread), Some(parallax_rad), true) = (spread, parallax_rad, stationary) else {
            self.stationary_since_ns = None;
            return None;
        };
        let quiet_since_ns = self.unmoved_since_ns.max(input.stamp_ns - QUIET_NS);
        let since_ns = *self.stationary_since_ns.get_or_insert(quiet_since_ns);
        let position_sigma_m = parallax_rad.max(MIN_PARALLAX_RAD) * image.distance_m;
        let event = Event {
            kind: EventKind::Stationary,
            message: format!(
                "stationary for {:.1} s: parallax {:.2}° (limit {:.2}°, rotation compensated), σ of the angular velocity \
                 {:.4} (limit {:.4}) rad/s, of the specific force {:.3} (limit {:.3}) m/s²",
                seconds_from_ns(input.stamp_ns - since_ns),
                parallax_rad.to_degrees(),
                MAX_PARALLAX_RAD.to_degrees(),
                spread.angular_rate,
                spread.angular_rate_limit,
                spread.force,
                spread.force_limit
            ),
            value: Some(parallax_rad),
            threshold: Some(MAX_PARALLAX_RAD),
            cause: None,
        };
        let velocity_sigma_m_per_s = position_sigma_m / seconds_from_ns(QUIET_NS);
        Some((Stationary { since_ns, position_sigma_m, velocity_sigma_m_per_s }, event))
    }

    pub(super) fn heap_bytes(&self) -> usize {
        let bearings = self.reference.as_ref().map_or(0, |reference| reference.bearings.capacity());
        self.intervals.capacity() * size_of::<Interval>() + bearings * size_of::<(FeatureId, Vector3<f64>)>()
    }

    fn take_interval(&mut self, input: &StepInput<'_>) {
        let finite = |vector: &Vector3<f64>| vector.iter().all(|x| x.is_finite());
        let samples: Vec<_> = input
            .imu
            .iter()
            .filter(|sample| finite(&sample.angular_velocity_rad_per_s) && finite(&sample.specific_force_m_per_s2))
            .collect();
        let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
            self.intervals.clear();
            return;
        };
        self.intervals.push_back(Interval {
            end_ns: last.stamp_ns,
            duration_s: seconds_from_ns(last.stamp_ns - first.stamp_ns),
            average: ImuAverage::of(&samples),
        });
        while self.intervals.get(1).is_some_and(|second| second.end_ns <= input.stamp_ns - QUIET_NS) {
            self.intervals.pop_front();
        }
    }

    /// Rotation-compensated parallax to the reference image, in radians; an image with too much parallax becomes the
    /// reference.
    fn compare_image(&mut self, stamp_ns: i64, image: &Observed<'_>) -> Option<f64> {
        let (features, imu_from_camera) = (image.features, image.imu_from_camera);
        let parallax_rad = self.reference.as_ref().and_then(|reference| {
            let pairs: Vec<(Vector3<f64>, Vector3<f64>)> = reference
                .bearings
                .iter()
                .filter_map(|(id, before)| {
                    let place = features.binary_search_by_key(id, |feature| feature.id).ok()?;
                    Some((*before, features[place].bearing)).filter(|(_, now)| now.iter().all(|x| x.is_finite()))
                })
                .collect();
            if pairs.len() < MIN_COMMON {
                return None;
            }
            // The rotation is not checked here: the gyroscope shows that the vehicle does not rotate.
            let guess = imu_from_camera.inverse() * reference.imu_from_camera;
            Some(fit_rotation(&pairs, &guess)?.median_parallax_rad)
        });
        let moved = parallax_rad.is_none_or(|parallax_rad| parallax_rad > MAX_PARALLAX_RAD);
        // Tracks also end in a constant image: the newest image with enough features then becomes the reference.
        let fading = self.reference.is_some() && parallax_rad.is_none() && self.stationary_since_ns.is_some();
        if moved {
            let bearings = features.iter().map(|feature| (feature.id, feature.bearing)).collect();
            self.reference = Some(Reference { bearings, imu_from_camera });
            if !fading {
                self.unmoved_since_ns = stamp_ns;
            }
        }
        if fading && features.len() >= MIN_COMMON { Some(MAX_PARALLAX_RAD) } else { parallax_rad }
    }

    /// Spread of the samples of the last second, `None` without a full second.
    fn spread(&self, stamp_ns: i64, noise: &ImuNoise) -> Option<ImuSpread> {
        let first = self.intervals.front()?;
        let begin_ns = first.end_ns - (first.duration_s * 1e9) as i64;
        if begin_ns > stamp_ns - QUIET_NS || self.intervals.len() < 4 {
            return None;
        }
        let covered_s: f64 = self.intervals.iter().map(|interval| interval.duration_s).sum();
        let averages: Vec<ImuAverage> = self.intervals.iter().map(|interval| interval.average).collect();
        Some(ImuSpread::of(&averages, covered_s / averages.len() as f64, noise))
    }
}

fn is_quiet(spread: &ImuSpread, bias: &ImuBias) -> bool {
    let rate = spread.mean.angular_velocity_rad_per_s - bias.gyroscope_rad_per_s;
    spread.angular_rate <= spread.angular_rate_limit
        && rate.amax() <= MAX_ANGULAR_RATE_RAD_PER_S
        && spread.force <= spread.force_limit
}
