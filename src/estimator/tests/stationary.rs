//! Stationary vehicle: before the first motion, and in the middle of a flight.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::flight::{run_flight, trajectory_error_m};
use super::{Noise, fixture};
use crate::estimator::Phase;
use crate::estimator::config::EstimatorOptions;
use crate::estimator::report::{EventKind, StepReport};
use crate::frontend::{FeatureId, TrackedFeature, TrackedFrame};
use crate::geometry::seconds_from_ns;
use crate::gimbal::Parameterization;
use crate::sensors::ImuSample;
use crate::simulation::{
    SyntheticFlight, SyntheticFrame, SyntheticMotion, SyntheticMount, SyntheticOptions, synthetic_tracks,
};

const FRAME_NS: i64 = 50_000_000;
const PIXEL_SIGMA_PX: f64 = 0.5;

fn options(mount: SyntheticMount, motion: SyntheticMotion) -> SyntheticOptions {
    SyntheticOptions {
        mount,
        motion,
        seed: 7,
        duration_s: 11.0,
        pixel_sigma_px: PIXEL_SIGMA_PX,
        features: 100,
        ..SyntheticOptions::default()
    }
}

/// Flight that starts stationary, reversed in time: it lands at its take-off point, stays there, and takes off again.
struct Landing<'a> {
    flight: &'a SyntheticFlight,
    frames: Vec<SyntheticFrame>,
    random: Noise,
    next_id: u64,
}

impl<'a> Landing<'a> {
    fn new(flight: &'a SyntheticFlight) -> Self {
        Self { flight, frames: Vec::new(), random: Noise::new(21), next_id: 2_000_000 }
    }

    fn push(&mut self, frame: SyntheticFrame) {
        self.frames.push(SyntheticFrame { index: self.frames.len(), ..frame });
    }

    fn next_stamp_ns(&self) -> i64 {
        self.frames.last().map_or(3_000_000, |last| last.stamp_ns + FRAME_NS)
    }

    /// Appends the flight reversed in time: the specific force stays, velocities and angular rates change their sign,
    /// biases do not.
    fn land(mut self) -> Self {
        let stationary_features: Vec<FeatureId> =
            self.flight.frames[0].tracks.features.iter().map(|feature| feature.id).collect();
        let frames = &self.flight.frames;
        for index in (0..frames.len()).rev() {
            let stamp_ns = self.next_stamp_ns();
            let frame = &frames[index];
            let imu = frames.get(index + 1).map_or_else(Vec::new, |later| {
                let backwards = later.imu.iter().rev().map(|sample| ImuSample {
                    stamp_ns: stamp_ns + frame.stamp_ns - sample.stamp_ns,
                    angular_velocity_rad_per_s: later.true_bias.gyroscope_rad_per_s * 2.0
                        - sample.angular_velocity_rad_per_s,
                    specific_force_m_per_s2: sample.specific_force_m_per_s2,
                    unmeasured_s: 0.0,
                });
                backwards.collect()
            });
            // A track from before the stationary phase has another id than one after it.
            let features = frame.tracks.features.iter().map(|feature| {
                let id = if stationary_features.contains(&feature.id) {
                    feature.id
                } else {
                    FeatureId(feature.id.0 + 1_000_000)
                };
                TrackedFeature { id, ..*feature }
            });
            let tracks = tracked(stamp_ns, features.collect());
            let true_velocity_m_per_s = -frame.true_velocity_m_per_s;
            self.push(SyntheticFrame { stamp_ns, imu, tracks, true_velocity_m_per_s, ..frame.clone() });
        }
        self
    }

    /// Appends a stationary phase; returns the new ids of its features. `creep_m` is the translation along x over time,
    /// `ending` the ratio of tracks that end in every image and restart.
    fn stay(mut self, seconds: f64, ending: f64, creep_m: fn(f64) -> f64) -> (Self, BTreeMap<FeatureId, FeatureId>) {
        let first = &self.flight.frames[0];
        let camera = &self.flight.true_rig.cameras[0].model;
        let noise = self.flight.true_rig.imu.noise;
        let mut ids: BTreeMap<FeatureId, FeatureId> =
            first.tracks.features.iter().map(|feature| (feature.id, feature.id)).collect();
        for _ in 0..(seconds * 20.0) as usize {
            let stamp_ns = self.next_stamp_ns();
            let after_s = |at_ns: i64| seconds_from_ns(at_ns - stamp_ns) + 0.05;
            let begin_s = seconds_from_ns(stamp_ns - self.frames[self.flight.frames.len() - 1].stamp_ns) - 0.05;
            let moved = |at_s: f64| Vector3::new(creep_m(begin_s + at_s), 0.0, 0.0);
            let rotation = first.true_world_from_imu.rotation;
            let mut imu: Vec<ImuSample> = Vec::new();
            for number in 0..=10 {
                let at_ns = stamp_ns - FRAME_NS + number * 5_000_000;
                let (t, h) = (after_s(at_ns), 0.01);
                let acceleration = (moved(t + h) + moved(t - h) - moved(t) * 2.0) / (h * h);
                let mut white = |density: f64| self.random.vector() * (density * 200.0_f64.sqrt());
                imu.push(ImuSample {
                    stamp_ns: at_ns,
                    angular_velocity_rad_per_s: first.true_bias.gyroscope_rad_per_s
                        + white(noise.gyroscope_noise_density),
                    specific_force_m_per_s2: rotation.inverse() * (acceleration + Vector3::new(0.0, 0.0, 9.81))
                        + first.true_bias.accelerometer_m_per_s2
                        + white(noise.accelerometer_noise_density),
                    unmeasured_s: 0.0,
                });
            }
            if let Some(last) = self.frames.last().and_then(|frame| frame.imu.last()) {
                imu[0] = *last;
            }
            let shift = moved(0.05);
            let mut features = Vec::new();
            for feature in &first.tracks.features {
                if self.random.uniform() < ending {
                    ids.insert(feature.id, FeatureId(self.next_id));
                    self.next_id += 1;
                }
                let mut world_from_camera = first.true_world_from_camera;
                world_from_camera.translation_m += shift;
                let point = world_from_camera.inverse().transform(&self.flight.landmarks[&feature.id]);
                let Some(uv_px) = camera.project(&point) else { continue };
                let uv_px = uv_px + self.random.vector().fixed_rows::<2>(0) * PIXEL_SIGMA_PX;
                let Some(bearing) = camera.unproject(&uv_px) else { continue };
                features.push(TrackedFeature { id: ids[&feature.id], uv_px, bearing, ..*feature });
            }
            let mut still = SyntheticFrame { stamp_ns, imu, tracks: tracked(stamp_ns, features), ..first.clone() };
            still.true_world_from_imu.translation_m += shift;
            if let (Some(angles), Some(sigma)) = (&mut still.joint_angles_rad, self.flight.given_rig.gimbal.as_ref()) {
                let sigma = sigma.encoder_sigma_rad.unwrap_or(0.0);
                for (angle, ground_truth) in angles.iter_mut().zip(&first.true_joint_angles_rad) {
                    *angle = ground_truth + sigma * self.random.normal();
                }
            }
            self.push(still);
        }
        (self, ids)
    }

    /// Appends the take-off, which is the original flight.
    fn take_off(mut self, ids: &BTreeMap<FeatureId, FeatureId>) -> Vec<SyntheticFrame> {
        for frame in &self.flight.frames[1..] {
            let stamp_ns = self.next_stamp_ns();
            let later = stamp_ns - frame.stamp_ns;
            let mut imu = frame.imu.clone();
            for sample in &mut imu {
                sample.stamp_ns += later;
            }
            let features = frame
                .tracks
                .features
                .iter()
                .map(|feature| TrackedFeature { id: ids.get(&feature.id).copied().unwrap_or(feature.id), ..*feature });
            let tracks = tracked(stamp_ns, features.collect());
            self.push(SyntheticFrame { stamp_ns, imu, tracks, ..frame.clone() });
        }
        self.frames
    }
}

fn tracked(stamp_ns: i64, mut features: Vec<TrackedFeature>) -> TrackedFrame {
    features.sort_by_key(|feature| feature.id);
    TrackedFrame { stamp_ns, features, ..TrackedFrame::default() }
}

fn reports_stationary(report: &StepReport) -> bool {
    report.events.iter().any(|event| event.kind == EventKind::Stationary)
}

#[test]
fn a_landed_vehicle_does_not_drift_and_takes_off_again() {
    for mount in [SyntheticMount::Gimbal, SyntheticMount::Static] {
        let flight = synthetic_tracks(&options(mount, SyntheticMotion::StationaryThenAggressive));
        // One track in fifty ends in every image: hardly any survives ten seconds.
        let (landing, ids) = Landing::new(&flight).land().stay(12.0, 0.02, |_| 0.0);
        let frames = landing.take_off(&ids);
        let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
        let (estimator, reports) = run_flight(&frames, config);
        assert_eq!(estimator.restarts, 0, "{mount:?}");
        let landed = flight.frames.len();
        // Detection takes about two seconds: one of quiet samples, and the landing itself.
        let stationary_reports = &reports[landed + 20..landed + 235];
        let reported = stationary_reports.iter().filter(|report| reports_stationary(report)).count();
        assert!(reported > 200, "{mount:?}: reported stationary {reported} times of {}", stationary_reports.len());
        let event = stationary_reports[100].events.iter().find(|event| event.kind == EventKind::Stationary).unwrap();
        assert!(event.value.unwrap() < event.threshold.unwrap());
        let place = |report: &StepReport| report.newest().unwrap().world_from_imu.translation_m;
        let start = place(&stationary_reports[0]);
        let drift = stationary_reports.iter().map(|report| (place(report) - start).norm()).fold(0.0, f64::max);
        assert!(drift < 0.03, "{mount:?}: drifted {drift} m");
        let velocity = stationary_reports
            .iter()
            .map(|report| report.newest().unwrap().velocity_m_per_s.norm())
            .fold(0.0, f64::max);
        assert!(velocity < 0.02, "{mount:?}: {velocity} m/s");
        let (error, length) = trajectory_error_m(&frames, &reports);
        assert!(error < 0.004 * length, "{mount:?}: {error} m over {length} m");
        let moving = reports[landed + 320..].iter().filter(|report| reports_stationary(report)).count();
        assert_eq!(moving, 0, "{mount:?}: no rest in flight");
    }
}

/// A constant 1 cm/s: invisible in the IMU samples, visible in the image.
#[test]
fn a_slowly_moving_vehicle_gets_no_zero_velocity_update() {
    let creep = |after_s: f64| 0.01 * (after_s * after_s / (after_s.max(0.0) + 2.0));
    let flight = synthetic_tracks(&options(SyntheticMount::Static, SyntheticMotion::StationaryThenAggressive));
    let frames = Landing::new(&flight).land().stay(12.0, 0.004, creep).0.frames;
    let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
    let (estimator, reports) = run_flight(&frames, config);
    assert_eq!(estimator.restarts, 0);
    let landed = flight.frames.len();
    let moved = |from: usize, to: usize| {
        let place = |index: usize| reports[index].newest().unwrap().world_from_imu.translation_m;
        (place(to) - place(from)).norm()
    };
    let ground_truth = creep(11.9) - creep(0.95);
    let found = moved(landed + 20, landed + 239);
    assert!((found - ground_truth).abs() < 0.25 * ground_truth, "{found} m of {ground_truth} m");
}

#[test]
fn a_hovering_vehicle_is_not_stationary() {
    for seed in [3, 4, 5] {
        let hover = SyntheticOptions {
            seed,
            duration_s: 8.0,
            ..options(SyntheticMount::Gimbal, SyntheticMotion::HoverThenAggressive)
        };
        let flight = synthetic_tracks(&hover);
        let frames = Landing::new(&flight).land().frames;
        let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
        let (_, reports) = run_flight(&frames, config);
        for (report, frame) in reports.iter().zip(&frames) {
            let Some(newest) = report.newest() else { continue };
            assert!(!reports_stationary(report), "seed {seed}, image {}: {:?}", report.frame_index, report.events);
            if frame.index > frames.len() - 30 {
                let error = newest.velocity_m_per_s.norm() - frame.true_velocity_m_per_s.norm();
                assert!(error.abs() < 0.05, "seed {seed}: speed off by {error} m/s");
            }
        }
    }
}

#[test]
fn a_stationary_start_waits_for_motion_and_reports_it() {
    for mount in [SyntheticMount::Gimbal, SyntheticMount::Static] {
        let flight = synthetic_tracks(&options(mount, SyntheticMotion::StationaryThenAggressive));
        let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
        let (estimator, reports) = run_flight(&flight.frames, config);
        assert_eq!(estimator.restarts, 0);
        let moves = flight.frames.iter().position(|frame| frame.true_velocity_m_per_s.norm() > 0.3).unwrap();
        let starts = reports.iter().position(|report| report.phase == Phase::Tracking).unwrap();
        assert!(starts > 40, "{mount:?}: not before it moves");
        assert!(starts < moves + 60, "{mount:?}: moving from image {moves} on, initialized at {starts}");
        let reported = reports[25..40].iter().filter(|report| reports_stationary(report)).count();
        assert_eq!(reported, 15, "{mount:?}");
        for report in &reports[..starts] {
            let waits: Vec<_> =
                report.events.iter().filter(|event| event.kind == EventKind::InitializationWaits).collect();
            assert!(!waits.is_empty() && waits.iter().all(|event| event.value.is_some() && event.threshold.is_some()));
        }
        let (error, length) = trajectory_error_m(&flight.frames, &reports);
        assert!(error < 0.005 * length, "{mount:?}: {error} m over {length} m");
    }
}
