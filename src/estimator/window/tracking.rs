//! One step of a running window: predict, observe, solve, reject, decide, marginalize.

use nalgebra::Vector2;

use super::problem::{CameraFactors, Estimate, Problem};
use super::solver::{self, Solution, SolverLimits};
use super::{features, marginalization, standstill};
use crate::estimator::estimator::Estimator;
use crate::estimator::factors::preintegration::Preintegration;
use crate::estimator::factors::reprojection::{CameraPose, Landmark};
use crate::estimator::factors::visual::{self, RelativePoses, Sighting, Track, VisualModel};
use crate::estimator::options::{LandmarkModel, TrackContinuation};
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::camera_pose;
use crate::estimator::window::frames::{self, Frame};
use crate::estimator::{
    Event, EventKind, StepInput,
    state::frame_state::{FrameState, Rates},
    window::features::FeatureMap,
};
use crate::frontend::FeatureId;
use crate::geometry::{median, seconds_from_ns};

/// Distance of a scene of which no landmark is known.
const UNKNOWN_DISTANCE_M: f64 = 10.0;
/// A scene counts as no farther than this.
const FARTHEST_USUAL_M: f64 = 100.0;
/// A vehicle at rest gives a keyframe this often, so that inertial intervals stay short enough to be integrated again.
const KEYFRAME_AT_REST_NS: i64 = 5_000_000_000;

/// A window that is larger than usual shrinks by one frame per keyframe.
const MOST_MARGINALIZED_AT_ONCE: usize = 2;

/// Pixel residuals by track and sighting.
pub(crate) type TrackResiduals = Vec<Vec<Option<Vector2<f64>>>>;

/// The features of one camera that take part, in the order of their identity.
#[derive(Clone, Debug, Default)]
pub(crate) struct ActiveTracks {
    pub(crate) ids: Vec<FeatureId>,
    pub(crate) tracks: Vec<Track>,
    pub(crate) landmarks: Vec<Landmark>,
}

/// What a solve of the window used and found, for the report.
#[derive(Clone, Debug)]
pub(crate) struct SolvedWindow {
    /// By camera, with the landmarks as they were before.
    pub(crate) cameras: Vec<ActiveTracks>,
    pub(crate) solution: Solution,
    /// By camera.
    pub(crate) checks: Vec<TrackChecks>,
}

/// How well the tracks of one camera fit.
#[derive(Clone, Debug)]
pub(crate) struct TrackChecks {
    pub(crate) residuals_before: TrackResiduals,
    pub(crate) residuals_after: TrackResiduals,
    pub(crate) rejected: Vec<bool>,
}

impl Estimator {
    /// Adds the frame of `input` behind the newest one, its state predicted; says what is wrong when that is impossible.
    pub(crate) fn push_frame(&mut self, input: &StepInput<'_>) -> Result<(), Event> {
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
            state: FrameState { navigation, joints_rad, rates: Rates::at(input.imu, encoder.as_ref()) },
            first_estimate: None,
            encoder,
            rest: None,
            keyframe: false,
            motion,
            motion_information,
        });
        let slot = self.frames.len() - 1;
        for (camera, features) in self.features.iter_mut().enumerate() {
            features::observe(features, slot, input.features(camera));
        }
        self.align_newest_joints();
        Ok(())
    }

    /// Looks whether the vehicle stands still at the newest frame.
    pub(crate) fn watch_for_rest(&mut self, input: &StepInput<'_>) -> Option<Event> {
        let newest = self.frames.last()?;
        let navigation = newest.state.navigation;
        let camera = self.calibration.leading();
        let known = standstill::Known {
            features: input.features(camera),
            noise: &self.noise,
            bias: &navigation.bias,
            speed_m_per_s: navigation.velocity_m_per_s.norm(),
            imu_from_camera: self.calibration.of(camera).imu_from_camera(&newest.state.joints_rad).rotation,
            distance_m: self.usual_distance_m(),
        };
        let (rest, event) = self.rest_watch.observe(input, &known)?;
        self.frames.last_mut()?.rest = Some(rest);
        Some(event)
    }

    /// Median distance of the landmarks from where they are anchored.
    fn usual_distance_m(&self) -> f64 {
        let features = self.features.iter().flat_map(FeatureMap::values);
        median(features.filter_map(|feature| Some(feature.landmark?.inverse_distance)))
            .map_or(UNKNOWN_DISTANCE_M, |inverse_distance| 1.0 / inverse_distance.max(1.0 / FARTHEST_USUAL_M))
    }

    /// Poses of a camera by slot.
    pub(crate) fn camera_poses(&self, camera: usize) -> Vec<CameraPose> {
        let calibration = self.calibration.of(camera);
        self.frames.iter().map(|frame| camera_pose::at(&frame.state, calibration)).collect()
    }

    /// The least-squares problem of the window as it is, with the tracks that each camera has; cameras without any may be
    /// left out at the end.
    pub(crate) fn problem<'a>(&'a self, active: &'a [ActiveTracks]) -> Problem<'a> {
        let options = &self.config.options;
        let layout = frames::layout(&self.frames, self.calibration.dof());
        let start = layout.calibration().start;
        let factors = |camera: usize| {
            let columns = self.calibration.columns(camera);
            CameraFactors {
                visual: VisualModel::new(self.config.model(camera), options),
                tracks: active.get(camera).map_or(&[], |active| &active.tracks),
                columns: start + columns.start..start + columns.end,
            }
        };
        Problem {
            layout,
            cameras: (0..self.calibration.cameras()).map(factors).collect(),
            gravity_in_world: self.gravity_in_world,
            frames: &self.frames,
            prior: self.prior.as_ref(),
            start: self.start.as_ref(),
            first_estimate_reach_rad: options.first_estimate_reach_rad,
            calibration_first_estimates: options.calibration_first_estimates,
        }
    }

    /// Gives depths to features whose rays open far enough.
    pub(crate) fn triangulate_new(&mut self) {
        for camera in 0..self.features.len() {
            let poses = self.camera_poses(camera);
            for feature in self.features[camera].values_mut() {
                if feature.landmark.is_none() {
                    feature.landmark = features::triangulate(feature, &poses, &self.config.options);
                }
            }
        }
    }

    /// The features that take part, by camera.
    pub(crate) fn active_tracks(&self) -> Vec<ActiveTracks> {
        self.features.iter().map(active_tracks).collect()
    }

    /// Solves the window, takes the estimate over and rejects features that do not fit.
    pub(crate) fn solve_window(&mut self, iterations: usize) -> SolvedWindow {
        self.reintegrate();
        self.triangulate_new();
        let cameras = self.active_tracks();
        let landmarks = cameras.iter().map(|active| active.landmarks.clone()).collect();
        let start = Estimate { landmarks, ..self.present_estimate() };
        let limits = SolverLimits { iterations, relative_cost_tolerance: self.config.options.relative_cost_tolerance };
        let problem = self.problem(&cameras);
        let before = track_residuals(&problem, &start);
        let solution = solver::solve(&problem, start, limits);
        let after = track_residuals(&problem, &solution.estimate);

        for (frame, state) in self.frames.iter_mut().zip(&solution.estimate.frames) {
            frame.state = state.clone();
        }
        self.calibration = solution.estimate.calibration.clone();
        for (camera, active) in cameras.iter().enumerate() {
            for (id, landmark) in active.ids.iter().zip(&solution.estimate.landmarks[camera]) {
                if let Some(feature) = self.features[camera].get_mut(id) {
                    feature.landmark = Some(*landmark);
                }
            }
        }
        let checks = before
            .into_iter()
            .zip(after)
            .map(|(residuals_before, residuals_after)| TrackChecks {
                rejected: residuals_after.iter().map(|residuals| self.is_outlier(residuals)).collect(),
                residuals_before,
                residuals_after,
            })
            .collect();
        SolvedWindow { cameras, solution, checks }
    }

    fn is_outlier(&self, residuals: &[Option<Vector2<f64>>]) -> bool {
        let unseen = residuals.iter().any(Option::is_none);
        let counted = residuals.len().max(1) as f64;
        let mean = residuals.iter().flatten().map(|residual| residual.norm()).sum::<f64>() / counted;
        unseen || mean > self.config.options.outlier_px
    }

    /// Forgets rejected features; a track that goes on starts anew with its next sighting.
    pub(crate) fn forget_rejected(&mut self, solved: &SolvedWindow, events: &mut Vec<Event>) {
        let (mut count, mut all) = (0, 0);
        for (features, (active, checks)) in self.features.iter_mut().zip(solved.cameras.iter().zip(&solved.checks)) {
            for (id, _) in active.ids.iter().zip(&checks.rejected).filter(|(_, rejected)| **rejected) {
                features.remove(id);
                count += 1;
            }
            all += active.ids.len();
        }
        if count > 0 {
            let limit = self.config.options.outlier_px;
            events.push(Event {
                kind: EventKind::OutliersRejected,
                message: format!("{count} of {all} features off by more than {limit:.1} px on average"),
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
    pub(crate) fn choose_keyframe(&self) -> (bool, Event) {
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
        // Whichever camera asks for a keyframe gets it; one without an image has nothing to say.
        let seen = |camera: usize| self.features[camera].values().filter(|f| f.observation(newest).is_some()).count();
        let seen: Vec<(usize, usize)> = (0..self.features.len()).map(|camera| (camera, seen(camera))).collect();
        let asked = seen.iter().filter(|(_, seen)| *seen > 0);
        let mut decisions: Vec<(bool, Event)> =
            asked.map(|(camera, seen)| self.keyframe_by_picture(*camera, last, newest, *seen)).collect();
        if decisions.is_empty() {
            decisions.push(self.keyframe_by_picture(MAIN, last, newest, 0));
        }
        let first = decisions.iter().position(|(keyframe, _)| *keyframe).unwrap_or(0);
        decisions.swap_remove(first)
    }

    /// Whether one camera asks for a keyframe, by what it has in common with the last one.
    fn keyframe_by_picture(&self, camera: usize, last: usize, newest: usize, seen: usize) -> (bool, Event) {
        let options = &self.config.options;
        let event = |keyframe: bool, message: String, value: f64, threshold: f64| {
            let decided =
                Event { kind: EventKind::KeyframeChosen, message, value: Some(value), threshold: Some(threshold) };
            (keyframe, decided)
        };
        let poses = self.camera_poses(camera);
        let (parallax, common) = features::compensated_parallax(&self.features[camera], &poses, last, newest);
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
    pub(crate) fn make_room(&mut self, events: &mut Vec<Event>) {
        let newest = self.frames.len() - 1;
        if newest >= 2 && !self.frames[newest - 1].keyframe {
            events.push(Event {
                kind: EventKind::SecondNewestDropped,
                message: format!("image {} dropped: no keyframe", self.frames[newest - 1].index),
                value: None,
                threshold: None,
            });
            self.drop_second_newest();
            return;
        }
        for _ in 0..MOST_MARGINALIZED_AT_ONCE {
            let room = self.room();
            if self.frames.len() <= room {
                break;
            }
            events.push(Event {
                kind: EventKind::OldestMarginalized,
                message: format!("image {} marginalized: the window is full", self.frames[0].index),
                value: Some(self.frames.len() as f64),
                threshold: Some(room as f64),
            });
            self.marginalize_oldest();
        }
    }

    /// How many frames may stay. The first window is larger: what is marginalized is linearized for good, and the chain has
    /// to come near its true values first.
    pub(crate) fn room(&self) -> usize {
        let options = &self.config.options;
        if self.prior.is_none() { options.window * options.first_window_factor } else { options.window }
    }

    /// The unknowns of the frames and of the calibration as they are.
    fn present_estimate(&self) -> Estimate {
        Estimate {
            frames: self.frames.iter().map(|frame| frame.state.clone()).collect(),
            calibration: self.calibration.clone(),
            landmarks: vec![Vec::new(); self.features.len()],
        }
    }

    fn drop_second_newest(&mut self) {
        let gone = self.frames.len() - 2;
        if self.prior.as_ref().is_none_or(|prior| !prior.holds_frame(gone)) {
            self.carry_encoder(gone, gone + 1);
        }
        let prior = marginalization::dropped(&self.problem(&[]), &self.present_estimate(), gone);
        self.prior = prior;
        self.forget_sightings(gone);
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
        let leaving: Vec<ActiveTracks> = self
            .active_tracks()
            .into_iter()
            .map(|active| {
                active.filtered(|track| {
                    let continues = track.sightings.last().is_some_and(|last| last.slot == newest);
                    let anchored = track.sightings.first().is_some_and(|first| first.slot == 0);
                    anchored && !(continues && continuation == TrackContinuation::ForgetAnchor)
                })
            })
            .collect();
        let landmarks = leaving.iter().map(|active| active.landmarks.clone()).collect();
        let estimate = Estimate { landmarks, ..self.present_estimate() };
        let prior = marginalization::oldest(&self.problem(&leaving), &estimate);

        for (features, active) in self.features.iter_mut().zip(&leaving) {
            for (id, track) in active.ids.iter().zip(&active.tracks) {
                let ended = track.sightings.last().is_none_or(|last| last.slot != newest);
                if ended || continuation == TrackContinuation::UseOnce {
                    features.remove(id);
                }
            }
        }
        self.prior = prior;
        self.start = None;
        self.forget_sightings(0);
        if self.config.options.landmark_model == LandmarkModel::InverseDistance {
            self.face_measured_bearings();
        }
        self.frames.remove(0);
        self.renumber_prior(0);
    }

    /// Takes a frame out of what the cameras have seen.
    fn forget_sightings(&mut self, gone: usize) {
        for camera in 0..self.features.len() {
            let poses = self.camera_poses(camera);
            features::forget_frame(&mut self.features[camera], gone, &poses);
        }
    }

    /// Landmarks that moved to another anchor lie on the bearing that it measured.
    fn face_measured_bearings(&mut self) {
        for feature in self.features.iter_mut().flat_map(FeatureMap::values_mut) {
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
        } else {
            self.frames.iter_mut().for_each(|frame| frame.first_estimate = None);
        }
        self.calibration.keep_first_estimates(self.prior.as_ref());
    }
}

impl ActiveTracks {
    /// Those whose tracks are wanted.
    fn filtered(self, wanted: impl Fn(&Track) -> bool) -> Self {
        let mut kept = Self::default();
        for ((id, track), landmark) in self.ids.into_iter().zip(self.tracks).zip(self.landmarks) {
            if wanted(&track) {
                kept.ids.push(id);
                kept.tracks.push(track);
                kept.landmarks.push(landmark);
            }
        }
        kept
    }
}

fn active_tracks(features: &FeatureMap) -> ActiveTracks {
    let mut active = ActiveTracks::default();
    for (id, feature) in features {
        let Some(landmark) = feature.landmark else { continue };
        if feature.observations.len() < 2 {
            continue;
        }
        let sighting =
            |observation: &features::Observation| Sighting { slot: observation.slot, uv_px: observation.uv_px };
        active.ids.push(*id);
        active.tracks.push(Track { sightings: feature.observations.iter().map(sighting).collect() });
        active.landmarks.push(landmark);
    }
    active
}

/// Pixel residuals of all sightings at an estimate, by camera.
fn track_residuals(problem: &Problem<'_>, estimate: &Estimate) -> Vec<TrackResiduals> {
    let of_camera = |(camera, factors): (usize, &CameraFactors<'_>)| {
        let poses = camera_pose::by_slot(&estimate.frames, estimate.calibration.of(camera));
        let relative = RelativePoses::new(&poses);
        factors
            .tracks
            .iter()
            .zip(&estimate.landmarks[camera])
            .map(|(track, landmark)| {
                let anchor = track.sightings[0].slot;
                let residual = |sighting: &Sighting| {
                    visual::sighting_residual_px(&factors.visual, &relative, anchor, landmark, sighting)
                };
                track.sightings.iter().map(residual).collect()
            })
            .collect()
    };
    problem.cameras.iter().enumerate().map(of_camera).collect()
}
