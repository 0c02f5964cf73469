//! One step of a running window: predict, observe, solve, reject, decide, marginalize.

use nalgebra::Vector2;

use super::camera_pose;
use super::estimator::Estimator;
use super::features;
use super::marginalization;
use super::options::{LandmarkModel, TrackContinuation};
use super::preintegration::Preintegration;
use super::problem::{Estimate, Problem};
use super::reprojection::{CameraPose, Landmark};
use super::solver::{self, Solution, SolverLimits};
use super::standstill;
use super::visual::{self, RelativePoses, Sighting, Track, VisualModel};
use super::window::{self, Frame, FrameState};
use super::{Event, EventKind, StepInput};
use crate::frontend::FeatureId;
use crate::geometry::seconds_from_ns;

/// Distance of a scene of which no landmark is known.
const UNKNOWN_DISTANCE_M: f64 = 10.0;
/// A scene counts as no farther than this.
const FARTHEST_USUAL_M: f64 = 100.0;
/// A vehicle at rest gives a keyframe this often, so that inertial intervals stay short enough to be integrated again.
const KEYFRAME_AT_REST_NS: i64 = 5_000_000_000;

/// Pixel residuals by track and sighting.
pub(super) type TrackResiduals = Vec<Vec<Option<Vector2<f64>>>>;

/// What a solve of the window used and found, for the report.
#[derive(Clone, Debug)]
pub(super) struct SolvedWindow {
    pub(super) ids: Vec<FeatureId>,
    pub(super) tracks: Vec<Track>,
    pub(super) solution: Solution,
    pub(super) residuals_before: TrackResiduals,
    pub(super) residuals_after: TrackResiduals,
    pub(super) rejected: Vec<bool>,
}

impl Estimator {
    /// Adds the frame of `input` behind the newest one, its state predicted; says what is wrong when that is impossible.
    pub(super) fn push_frame(&mut self, input: &StepInput<'_>) -> Result<(), Event> {
        let last = self.frames.last().expect("a running window has frames");
        let interval_s = seconds_from_ns(input.stamp_ns - last.stamp_ns);
        let motion = Preintegration::from_samples(self.noise, last.state.navigation.bias, input.imu);
        let covered = motion.duration_s();
        if covered < 0.5 * interval_s || interval_s <= 0.0 {
            return Err(Event {
                kind: EventKind::Failure,
                message: format!("inertial samples cover {covered:.3} s of the {interval_s:.3} s since the last image"),
                value: Some(covered),
                threshold: Some(0.5 * interval_s),
            });
        }
        let navigation = motion.predict(&last.state.navigation, &self.gravity_in_world);
        let encoder = self.encoder_reading(input);
        let joints_rad =
            encoder.as_ref().map_or_else(|| last.state.joints_rad.clone(), |encoder| encoder.angles_rad.clone());
        let motion_information = motion.square_root_information();
        self.frames.push(Frame {
            index: input.frame_index,
            stamp_ns: input.stamp_ns,
            state: FrameState { navigation, joints_rad },
            first_estimate: None,
            encoder,
            rest: None,
            keyframe: false,
            motion,
            motion_information,
        });
        let slot = self.frames.len() - 1;
        features::observe(&mut self.features, slot, input.tracks);
        self.align_newest_joints();
        Ok(())
    }

    /// Looks whether the vehicle stands still at the newest frame.
    pub(super) fn watch_for_rest(&mut self, input: &StepInput<'_>) -> Option<Event> {
        let newest = self.frames.last()?;
        let navigation = newest.state.navigation;
        let known = standstill::Known {
            noise: &self.noise,
            bias: &navigation.bias,
            speed_m_per_s: navigation.velocity_m_per_s.norm(),
            imu_from_camera: self.calibration.imu_from_camera(&newest.state.joints_rad).rotation,
            distance_m: self.usual_distance_m(),
        };
        let (rest, event) = self.rest_watch.observe(input, &known)?;
        self.frames.last_mut()?.rest = Some(rest);
        Some(event)
    }

    /// Median distance of the landmarks from where they are anchored.
    fn usual_distance_m(&self) -> f64 {
        let mut inverse: Vec<f64> =
            self.features.values().filter_map(|feature| Some(feature.landmark?.inverse_distance)).collect();
        if inverse.is_empty() {
            return UNKNOWN_DISTANCE_M;
        }
        let middle = inverse.len() / 2;
        1.0 / (*inverse.select_nth_unstable_by(middle, f64::total_cmp).1).max(1.0 / FARTHEST_USUAL_M)
    }

    /// Poses of the camera by slot.
    pub(super) fn camera_poses(&self) -> Vec<CameraPose> {
        self.frames.iter().map(|frame| camera_pose::at(&frame.state, &self.calibration)).collect()
    }

    /// The least-squares problem of the window as it is.
    pub(super) fn problem<'a>(&'a self, tracks: &'a [Track]) -> Problem<'a> {
        let options = &self.config.options;
        Problem {
            layout: window::layout(&self.frames, self.calibration.dof()),
            visual: VisualModel::new(&self.config.camera, options),
            gravity_in_world: self.gravity_in_world,
            frames: &self.frames,
            tracks,
            prior: self.prior.as_ref(),
            start: self.start.as_ref(),
            first_estimates: options.first_estimates,
            calibration_first_estimates: options.calibration_first_estimates,
        }
    }

    /// Gives depths to features whose rays open far enough.
    pub(super) fn triangulate_new(&mut self) {
        let cameras = self.camera_poses();
        for feature in self.features.values_mut() {
            if feature.landmark.is_none() {
                feature.landmark = features::triangulate(feature, &cameras, &self.config.options);
            }
        }
    }

    /// Features that take part, in the order of their identity, with their landmarks.
    pub(super) fn active_tracks(&self) -> (Vec<FeatureId>, Vec<Track>, Vec<Landmark>) {
        let (mut ids, mut tracks, mut landmarks) = (Vec::new(), Vec::new(), Vec::new());
        for (id, feature) in &self.features {
            let Some(landmark) = feature.landmark else { continue };
            if feature.observations.len() < 2 {
                continue;
            }
            let sighting =
                |observation: &window::Observation| Sighting { slot: observation.slot, uv_px: observation.uv_px };
            ids.push(*id);
            tracks.push(Track { sightings: feature.observations.iter().map(sighting).collect() });
            landmarks.push(landmark);
        }
        (ids, tracks, landmarks)
    }

    /// Solves the window, takes the estimate over and rejects features that do not fit.
    pub(super) fn solve_window(&mut self, iterations: usize) -> SolvedWindow {
        self.reintegrate();
        self.triangulate_new();
        let (ids, tracks, landmarks) = self.active_tracks();
        let start = Estimate { landmarks, ..self.present_estimate() };
        let limits = SolverLimits { iterations, relative_cost_tolerance: self.config.options.relative_cost_tolerance };
        let problem = self.problem(&tracks);
        let residuals_before = track_residuals(&problem, &start);
        let solution = solver::solve(&problem, start, limits);
        let residuals_after = track_residuals(&problem, &solution.estimate);

        for (frame, state) in self.frames.iter_mut().zip(&solution.estimate.frames) {
            frame.state = state.clone();
        }
        self.calibration = solution.estimate.calibration.clone();
        for (id, landmark) in ids.iter().zip(&solution.estimate.landmarks) {
            if let Some(feature) = self.features.get_mut(id) {
                feature.landmark = Some(*landmark);
            }
        }
        let rejected = residuals_after.iter().map(|residuals| self.is_outlier(residuals)).collect();
        SolvedWindow { ids, tracks, solution, residuals_before, residuals_after, rejected }
    }

    fn is_outlier(&self, residuals: &[Option<Vector2<f64>>]) -> bool {
        let unseen = residuals.iter().any(Option::is_none);
        let counted = residuals.len().max(1) as f64;
        let mean = residuals.iter().flatten().map(|residual| residual.norm()).sum::<f64>() / counted;
        unseen || mean > self.config.options.outlier_px
    }

    /// Forgets rejected features; a track that goes on starts anew with its next sighting.
    pub(super) fn forget_rejected(&mut self, solved: &SolvedWindow, events: &mut Vec<Event>) {
        let mut count = 0;
        for (id, _) in solved.ids.iter().zip(&solved.rejected).filter(|(_, rejected)| **rejected) {
            self.features.remove(id);
            count += 1;
        }
        if count > 0 {
            let limit = self.config.options.outlier_px;
            events.push(Event {
                kind: EventKind::OutliersRejected,
                message: format!("{count} of {} features off by more than {limit:.1} px on average", solved.ids.len()),
                value: Some(count as f64),
                threshold: Some(limit),
            });
        }
    }

    /// Intervals whose bias has moved far from where they were integrated are integrated again.
    fn reintegrate(&mut self) {
        let limit = self.config.options.reintegration_change;
        for slot in 1..self.frames.len() {
            let bias = self.frames[slot - 1].state.navigation.bias;
            let frame = &mut self.frames[slot];
            let change = frame.motion.bias_change(&bias);
            let gyroscope = change.fixed_rows::<3>(0).abs() - limit.gyroscope_rad_per_s;
            let accelerometer = change.fixed_rows::<3>(3).abs() - limit.accelerometer_m_per_s2;
            if gyroscope.max() > 0.0 || accelerometer.max() > 0.0 {
                frame.motion.reintegrate(bias);
                frame.motion_information = frame.motion.square_root_information();
            }
        }
    }

    /// Whether the newest frame becomes a keyframe, with the figure that decides.
    pub(super) fn choose_keyframe(&self) -> (bool, Event) {
        let options = &self.config.options;
        let newest = self.frames.len() - 1;
        let event = |keyframe: bool, message: String, value: f64, threshold: f64| {
            let decided =
                Event { kind: EventKind::KeyframeChosen, message, value: Some(value), threshold: Some(threshold) };
            (keyframe, decided)
        };
        let Some(last) = (0..newest).rev().find(|slot| self.frames[*slot].keyframe) else {
            return event(true, "the first keyframe of the window".to_owned(), 0.0, 0.0);
        };
        if let Some(rest) = &self.frames[newest].rest {
            let first = self.frames[last].stamp_ns < rest.since_ns;
            let age_ns = self.frames[newest].stamp_ns - self.frames[last].stamp_ns;
            let chosen = first || age_ns >= KEYFRAME_AT_REST_NS;
            let message = if first { "keyframe: the first at rest" } else { "at rest: only time makes a keyframe, s" };
            return event(
                chosen,
                message.to_owned(),
                seconds_from_ns(age_ns),
                if first { 0.0 } else { seconds_from_ns(KEYFRAME_AT_REST_NS) },
            );
        }
        let cameras = self.camera_poses();
        let (parallax, common) = features::compensated_parallax(&self.features, &cameras, last, newest);
        let seen = self.features.values().filter(|feature| feature.observation(newest).is_some()).count();
        let new_share = 1.0 - common as f64 / seen.max(1) as f64;
        if common < options.keyframe_min_tracked {
            let limit = options.keyframe_min_tracked as f64;
            let message = format!("keyframe: only {common} features in common with the last one");
            return event(true, message, common as f64, limit);
        }
        if new_share > options.keyframe_new_share {
            let message = format!("keyframe: {:.0} % of the features are new since the last one", 100.0 * new_share);
            return event(true, message, new_share, options.keyframe_new_share);
        }
        let limit = options.keyframe_parallax_rad;
        let chosen = parallax >= limit;
        let verdict = if chosen { "keyframe" } else { "no keyframe" };
        let message = format!(
            "{verdict}: parallax against the last one {:.2}° of {:.2}°, rotation taken out",
            parallax.to_degrees(),
            limit.to_degrees()
        );
        event(chosen, message, parallax, limit)
    }

    /// Makes room for the next frame: the second-newest goes when it is no keyframe, else the oldest of a full window.
    pub(super) fn make_room(&mut self, events: &mut Vec<Event>) {
        let newest = self.frames.len() - 1;
        if newest >= 2 && !self.frames[newest - 1].keyframe {
            events.push(Event {
                kind: EventKind::SecondNewestMarginalized,
                message: format!("image {} dropped: no keyframe", self.frames[newest - 1].index),
                value: None,
                threshold: None,
            });
            self.drop_second_newest();
        } else if self.frames.len() > self.config.options.window {
            events.push(Event {
                kind: EventKind::OldestMarginalized,
                message: format!("image {} marginalized: the window is full", self.frames[0].index),
                value: Some(self.frames.len() as f64),
                threshold: Some(self.config.options.window as f64),
            });
            self.marginalize_oldest();
        }
    }

    /// The unknowns of the frames and of the calibration as they are.
    fn present_estimate(&self) -> Estimate {
        Estimate {
            frames: self.frames.iter().map(|frame| frame.state.clone()).collect(),
            calibration: self.calibration.clone(),
            landmarks: Vec::new(),
        }
    }

    fn drop_second_newest(&mut self) {
        let gone = self.frames.len() - 2;
        if self.prior.as_ref().is_none_or(|prior| !prior.holds_frame(gone)) {
            self.carry_encoder(gone, gone + 1);
        }
        let prior = marginalization::dropped(&self.problem(&[]), &self.present_estimate(), gone);
        self.prior = prior;
        let cameras = self.camera_poses();
        features::forget_frame(&mut self.features, gone, &cameras);
        let dropped = self.frames.remove(gone);
        let newest = &mut self.frames[gone];
        let mut motion = dropped.motion;
        motion.extend(newest.motion.samples());
        newest.motion_information = motion.square_root_information();
        newest.motion = motion;
        self.renumber_prior(gone);
    }

    fn marginalize_oldest(&mut self) {
        let newest = self.frames.len() - 1;
        let continuation = self.config.options.track_continuation;
        let (ids, tracks, landmarks) = self.active_tracks();
        let leaving: Vec<usize> = (0..ids.len())
            .filter(|index| {
                let sightings = &tracks[*index].sightings;
                let continues = sightings.last().is_some_and(|last| last.slot == newest);
                let anchored = sightings.first().is_some_and(|first| first.slot == 0);
                anchored && !(continues && continuation == TrackContinuation::ForgetAnchor)
            })
            .collect();
        let used_tracks: Vec<Track> = leaving.iter().map(|index| tracks[*index].clone()).collect();
        let used_landmarks: Vec<Landmark> = leaving.iter().map(|index| landmarks[*index]).collect();
        let estimate = self.present_estimate();
        let prior = marginalization::oldest(&self.problem(&used_tracks), &estimate, &used_tracks, &used_landmarks);

        for (index, track) in leaving.iter().zip(&used_tracks) {
            let ended = track.sightings.last().is_none_or(|last| last.slot != newest);
            if ended || continuation == TrackContinuation::UseOnce {
                self.features.remove(&ids[*index]);
            }
        }
        self.prior = prior;
        self.start = None;
        let cameras = self.camera_poses();
        features::forget_frame(&mut self.features, 0, &cameras);
        if self.config.options.landmark_model == LandmarkModel::InverseDistance {
            self.face_measured_bearings();
        }
        self.frames.remove(0);
        self.renumber_prior(0);
    }

    /// Landmarks that moved to another anchor lie on the bearing that it measured.
    fn face_measured_bearings(&mut self) {
        for feature in self.features.values_mut() {
            if let (Some(first), Some(landmark)) = (feature.observations.first(), feature.landmark.as_mut()) {
                landmark.bearing = first.bearing;
            }
        }
    }

    /// The prior follows the slots after a frame has left; first estimates follow the prior.
    fn renumber_prior(&mut self, gone: usize) {
        if let Some(prior) = &mut self.prior {
            prior.renumber(gone);
            marginalization::keep_first_estimates(prior, &mut self.frames);
            self.calibration.keep_first_estimate(prior.holds_calibration());
        } else {
            self.frames.iter_mut().for_each(|frame| frame.first_estimate = None);
            self.calibration.keep_first_estimate(false);
        }
    }
}

/// Pixel residuals of all sightings at an estimate.
fn track_residuals(problem: &Problem<'_>, estimate: &Estimate) -> TrackResiduals {
    let relative = RelativePoses::new(&camera_pose::by_slot(&estimate.frames, &estimate.calibration));
    problem
        .tracks
        .iter()
        .zip(&estimate.landmarks)
        .map(|(track, landmark)| {
            let anchor = track.sightings[0].slot;
            let residual = |sighting: &Sighting| {
                visual::sighting_residual_px(&problem.visual, &relative, anchor, landmark, sighting)
            };
            track.sightings.iter().map(residual).collect()
        })
        .collect()
}
