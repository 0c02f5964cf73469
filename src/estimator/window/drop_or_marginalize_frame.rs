//! Removal of frames from the window.

use super::features::{self, ActiveTracks, FeatureMap};
use super::setup::Setup;
use super::window_state::WindowState;
use crate::estimator::config::{EstimatorOptions, TrackContinuation};
use crate::estimator::problem::marginalization;
use crate::estimator::report::{Event, EventKind};
use crate::estimator::state::calibrations::Calibrations;
use crate::optimization::LandmarkModel;

/// Limit of marginalized frames per image: a window above its size shrinks by one frame per keyframe.
const MAX_MARGINALIZED_AT_ONCE: usize = 2;

/// Number of frames in the first window, before marginalization. It is larger than later windows: marginalization fixes
/// linearization points, so the chain of the leading camera must be close to its true values first.
pub(crate) fn first_window_frames(calibration: &Calibrations, options: &EstimatorOptions) -> usize {
    let inaccurate = calibration.leads_inaccurately();
    let factor = if inaccurate { options.inaccurate_first_window_factor } else { options.first_window_factor };
    options.window * usize::from(factor)
}

impl WindowState {
    /// Removes a frame after the step: drops the second-newest one if it is no keyframe, else marginalizes the oldest
    /// ones of a full window.
    pub(crate) fn drop_or_marginalize_frame(&mut self, setup: &Setup, events: &mut Vec<Event>) {
        let newest = self.frames.newest_slot();
        if newest >= 2 && !self.frames[newest - 1].keyframe {
            let message = format!("frame {} dropped: no keyframe", self.frames[newest - 1].index);
            events.push(Event::new(EventKind::SecondNewestDropped, message));
            self.drop_frame(setup, newest - 1);
            return;
        }
        for _ in 0..MAX_MARGINALIZED_AT_ONCE {
            let frame_limit = self.frame_limit(&setup.config.options);
            if self.frames.len() <= frame_limit {
                break;
            }
            let message = format!("frame {} marginalized: the window is full", self.frames.oldest().index);
            let count = self.frames.len() as f64;
            events.push(Event::decided(EventKind::OldestMarginalized, message, count, frame_limit as f64));
            self.marginalize_oldest(setup);
        }
    }

    /// Number of frames above which the window is full.
    fn frame_limit(&self, options: &EstimatorOptions) -> usize {
        if self.prior.is_none() { first_window_frames(&self.calibration, options) } else { options.window }
    }

    /// Drops the frame at slot `gone`, before the newest one; its encoder readings and IMU samples go to the next
    /// frame.
    fn drop_frame(&mut self, setup: &Setup, gone: usize) {
        if self.prior.as_ref().is_none_or(|prior| !prior.holds_frame(gone)) {
            self.carry_encoder(setup, gone, gone + 1);
        }
        let estimate = self.estimate(vec![Vec::new(); self.features.len()]);
        self.prior = marginalization::dropped(&self.problem(setup, &[]), &estimate, gone);
        self.drop_observations(setup, gone);
        self.frames.drop_before_newest(gone);
        self.renumber_prior(gone);
    }

    fn marginalize_oldest(&mut self, setup: &Setup) {
        let newest = self.frames.newest_slot();
        let continuation = setup.config.options.track_continuation;
        let removed: Vec<ActiveTracks> = self
            .active_tracks()
            .into_iter()
            .map(|active| {
                active.filtered(|track| {
                    let continues = track.observations.last().is_some_and(|last| last.slot == newest);
                    let anchored = track.observations.first().is_some_and(|first| first.slot == 0);
                    anchored && !(continues && continuation == TrackContinuation::DropAnchor)
                })
            })
            .collect();
        let estimate = self.estimate(removed.iter().map(|active| active.landmarks.clone()).collect());
        let prior = marginalization::oldest(&self.problem(setup, &removed), &estimate);

        for (features, active) in self.features.iter_mut().zip(&removed) {
            for (id, track) in active.ids.iter().zip(&active.tracks) {
                let ended = track.observations.last().is_none_or(|last| last.slot != newest);
                if ended || continuation == TrackContinuation::UseOnce {
                    features.remove(id);
                }
            }
        }
        self.prior = prior;
        self.start = None;
        self.drop_observations(setup, 0);
        if setup.config.options.landmark_model == LandmarkModel::InverseDistance {
            self.face_measured_bearings();
        }
        self.frames.remove_oldest();
        self.renumber_prior(0);
    }

    /// Removes the observations of a frame from all features.
    fn drop_observations(&mut self, setup: &Setup, gone: usize) {
        for camera in 0..self.features.len() {
            let mut features = std::mem::take(&mut self.features[camera]);
            features::drop_frame(&mut features, gone, &self.view(setup, camera));
            self.features[camera] = features;
        }
    }

    /// Sets the bearing of each landmark to the one measured in its anchor.
    fn face_measured_bearings(&mut self) {
        for feature in self.features.iter_mut().flat_map(FeatureMap::values_mut) {
            if let (Some(first), Some(landmark)) = (feature.observations.first(), feature.landmark.as_mut()) {
                landmark.bearing = first.bearing;
            }
        }
    }

    /// Renumbers the slots of the prior after the removal of a frame; removes the first estimates of frames outside the
    /// prior.
    fn renumber_prior(&mut self, gone: usize) {
        if let Some(prior) = &mut self.prior {
            prior.renumber(gone);
            marginalization::keep_first_estimates(prior, &mut self.frames);
        } else {
            self.frames.iter_mut().for_each(|frame| frame.first_estimate = None);
        }
        let prior = self.prior.as_ref();
        self.calibration.keep_first_estimates(|columns| prior.is_some_and(|prior| prior.holds_calibration(columns)));
    }
}
