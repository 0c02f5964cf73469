//! Selection of the window's keyframes.

use super::features;
use super::setup::Setup;
use super::window_state::WindowState;
use crate::estimator::config::{FIRST_KEYFRAME_INTERVAL_S, KEYFRAME_JOINT_INTERVAL_S, KEYFRAME_JOINT_RAD};
use crate::estimator::report::{Event, EventKind};
use crate::estimator::state::calibrations::MAIN;
use crate::geometry::seconds_from_ns;

/// Interval of keyframes while stationary, so that IMU intervals stay short enough to be integrated again.
const STATIONARY_KEYFRAME_S: f64 = 5.0;

/// Keyframe decision on the newest frame, with the deciding value.
struct Decision {
    keyframe: bool,
    event: Event,
}

impl Decision {
    fn new(keyframe: bool, message: impl Into<String>, value: f64, threshold: f64) -> Self {
        Self { keyframe, event: Event::decided(EventKind::KeyframeChosen, message, value, threshold) }
    }
}

impl WindowState {
    pub(crate) fn choose_keyframe(&mut self, setup: &Setup) -> Event {
        let decision = self.keyframe_decision(setup);
        self.frames.newest_mut().keyframe = decision.keyframe;
        decision.event
    }

    fn keyframe_decision(&self, setup: &Setup) -> Decision {
        let newest = self.frames.newest_slot();
        let Some(last) = (0..newest).rev().find(|slot| self.frames[*slot].keyframe) else {
            return Decision::new(true, "the first keyframe of the window", 0.0, 0.0);
        };
        let decision = match &self.frames[newest].stationary {
            Some(stationary) => self.keyframe_while_stationary(stationary.since_ns, last),
            None => self.keyframe_by_images(setup, last),
        };
        if decision.keyframe { decision } else { self.keyframe_by_joints(last).unwrap_or(decision) }
    }

    fn keyframe_while_stationary(&self, since_ns: i64, last: usize) -> Decision {
        let age_s = self.age_s(last);
        if self.frames[last].stamp_ns < since_ns {
            return Decision::new(true, "keyframe: first one while stationary", age_s, 0.0);
        }
        let message = "stationary: keyframes by elapsed time and moving joints only, s";
        Decision::new(age_s >= STATIONARY_KEYFRAME_S, message, age_s, STATIONARY_KEYFRAME_S)
    }

    /// Time from the frame at a slot to the newest one, in seconds.
    fn age_s(&self, slot: usize) -> f64 {
        seconds_from_ns(self.frames.newest().stamp_ns - self.frames[slot].stamp_ns)
    }

    /// Any camera can request a keyframe; cameras without an image are ignored.
    fn keyframe_by_images(&self, setup: &Setup, last: usize) -> Decision {
        let newest = self.frames.newest_slot();
        let observed = |camera: usize| {
            let features = self.features[camera].values();
            (camera, features.filter(|feature| feature.observation(newest).is_some()).count())
        };
        let mut decisions: Vec<Decision> = (0..self.features.len())
            .map(observed)
            .filter(|(_, observed)| *observed > 0)
            .map(|(camera, observed)| self.keyframe_by_image(setup, camera, last, observed))
            .collect();
        if decisions.is_empty() {
            return self.keyframe_by_image(setup, MAIN, last, 0);
        }
        let first = decisions.iter().position(|decision| decision.keyframe).unwrap_or(0);
        decisions.swap_remove(first)
    }

    /// Keyframe for joints that have moved since the last keyframe, with a chain whose rotations are given inaccurately.
    ///
    /// Not without encoder readings: many images of the same landmarks would lower σ by more than the errors of the chain,
    /// because the joint angles compensate them.
    fn keyframe_by_joints(&self, last: usize) -> Option<Decision> {
        let (newest, before) = (self.frames.newest(), &self.frames[last]);
        let is_apart = self.age_s(last) >= KEYFRAME_JOINT_INTERVAL_S;
        if newest.encoder.is_none() || !self.calibration.leads_inaccurately() || !is_apart {
            return None;
        }
        let joints_rad = newest.state.joints_rad.iter().zip(&before.state.joints_rad);
        let moved_rad = joints_rad.map(|(now, then)| (now - then).abs()).fold(0.0, f64::max);
        (moved_rad >= KEYFRAME_JOINT_RAD).then(|| {
            let [moved_deg, limit_deg] = [moved_rad, KEYFRAME_JOINT_RAD].map(f64::to_degrees);
            let message = format!(
                "keyframe: a joint has moved by {moved_deg:.1}° since the last keyframe (threshold {limit_deg:.1}°)"
            );
            Decision::new(true, message, moved_rad, KEYFRAME_JOINT_RAD)
        })
    }

    /// Keyframe decision of one camera from its features in common with the last keyframe; `observed` is the number of
    /// features in its newest image.
    fn keyframe_by_image(&self, setup: &Setup, camera: usize, last: usize, observed: usize) -> Decision {
        let options = &setup.config.options;
        let newest = self.frames.newest_slot();
        let view = self.view(setup, camera);
        let (parallax, common) = features::compensated_parallax(&self.features[camera], &view, last, newest);
        let new_ratio = 1.0 - common as f64 / observed.max(1) as f64;
        if common < options.keyframe_min_tracked {
            let limit = options.keyframe_min_tracked as f64;
            let message = format!("keyframe: only {common} features in common with the last keyframe");
            return Decision::new(true, message, common as f64, limit);
        }
        if new_ratio > options.keyframe_new_ratio {
            let message = format!("keyframe: {:.0} % new features since the last keyframe", 100.0 * new_ratio);
            return Decision::new(true, message, new_ratio, options.keyframe_new_ratio);
        }
        let limit = options.keyframe_parallax_rad;
        let chosen = parallax >= limit;
        let age_s = self.age_s(last);
        let is_spaced = self.prior.is_none() && self.calibration.leads_inaccurately();
        if chosen && is_spaced && age_s < FIRST_KEYFRAME_INTERVAL_S {
            let message = format!(
                "no keyframe: {age_s:.2} s since the last one (at least {FIRST_KEYFRAME_INTERVAL_S} s in the first \
                 window of an inaccurate chain)"
            );
            return Decision::new(false, message, age_s, FIRST_KEYFRAME_INTERVAL_S);
        }
        let verdict = if chosen { "keyframe" } else { "no keyframe" };
        let message = format!(
            "{verdict}: parallax to the last keyframe {:.2}° (threshold {:.2}°), rotation compensated",
            parallax.to_degrees(),
            limit.to_degrees()
        );
        Decision::new(chosen, message, parallax, limit)
    }
}
