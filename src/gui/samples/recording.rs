//! An artificial recording for the tests of panels and screenshots: a flight in a walled yard with a three-axis gimbal.
//!
//! Two seconds of hover, then a figure of eight; two runs (`auto` in the minimal parameterization, `classical`) whose
//! calibration starts at the rig's values and converges to the ground truth.
//! The geometry is consistent: features are projections of points on the walls in [`SampleImages`].

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector2, Vector3};

use super::calibration::{calibration_at, rank_at};
use super::images::SampleImages;
use super::yard::{
    FIRST_TRACKED_FRAME, FlightState, INTRINSICS_PX, RandomNumbers, chain_pose, given_chain, point_of, project,
    rig_with, true_chain, yard_points,
};
use crate::estimator::{
    Event, EventKind, FactorKind, FeatureCounts, FeatureReport, FrameStateReport, IterationReport, LandmarkReport,
    ObservationReport, Phase, ResidualSummary, StageTimes, StepReport,
};
use crate::flight_log::LogWarning;
use crate::frontend::{FeatureId, FrontEndStatistics, TrackedFeature, TrackedFrame};
use crate::geometry::RigidTransform;
use crate::gimbal::ClassicalChain;
use crate::session::{Recording, RunRecord, StepRecord};

/// Period of the images in nanoseconds (20 Hz).
pub(crate) const FRAME_PERIOD_NS: i64 = 50_000_000;

/// Twelve seconds with the runs `auto` and `classical`.
pub(crate) fn sample_recording() -> Recording {
    sample_recording_of(240, &["auto", "classical"])
}

/// The images of [`sample_recording`].
pub(crate) fn sample_images() -> SampleImages {
    SampleImages
}

/// A recording of `frame_count` frames with one run per name (`auto`, `classical`, …).
pub(crate) fn sample_recording_of(frame_count: usize, run_names: &[&str]) -> Recording {
    let true_chain = true_chain();
    let given_chain = given_chain();
    let flight: Vec<FlightState> = (0..frame_count).map(|index| FlightState::at(index, &true_chain)).collect();
    let tracks = track_features(&flight);
    let runs = run_names
        .iter()
        .enumerate()
        .map(|(number, name)| sample_run(number, name, &flight, &tracks, &given_chain, &true_chain))
        .collect();
    Recording {
        log_path: PathBuf::from("sample/yard.mcap"),
        rig: Arc::new(rig_with(given_chain, "yard")),
        ground_truth_rig: Some(Arc::new(rig_with(true_chain, "yard"))),
        duration_ns: frame_count as i64 * FRAME_PERIOD_NS,
        start_ns: 0,
        epoch_ns: 1_718_451_937_250_000_000,
        runs,
        warnings: vec![LogWarning {
            stamp_ns: 6_000_000_000,
            message: "no IMU sample for 0.034 s at 6.00 s; bridged by interpolation".to_owned(),
        }],
        memory_budget_bytes: crate::session::DEFAULT_MEMORY_BUDGET_BYTES,
    }
}

fn track_features(flight: &[FlightState]) -> Vec<Arc<TrackedFrame>> {
    const WANTED: usize = 140;
    const MIN_DISTANCE_PX: f64 = 26.0;
    let points = yard_points();
    let mut random_numbers = RandomNumbers::new(23);
    let mut before: BTreeMap<u64, TrackedFeature> = BTreeMap::new();
    let mut frames = Vec::new();
    for (index, flight_state) in flight.iter().enumerate() {
        let mut candidates: Vec<u64> = (1..=points.len() as u64).collect();
        candidates.sort_by_key(|id| std::cmp::Reverse(before.get(id).map_or(0, |feature| feature.age + 1)));
        let mut now: BTreeMap<u64, TrackedFeature> = BTreeMap::new();
        let mut taken: Vec<Vector2<f64>> = Vec::new();
        let mut detected = 0;
        for id in candidates {
            let earlier = before.get(&id);
            if now.len() >= WANTED || (earlier.is_some() && random_numbers.unit() < 0.015) {
                continue;
            }
            let Some((uv, _)) = project(&flight_state.world_from_camera, &points[id as usize - 1]) else { continue };
            if taken.iter().any(|other| (other - uv).norm() < MIN_DISTANCE_PX) {
                continue;
            }
            taken.push(uv);
            let uv_px = uv + Vector2::new(random_numbers.normal(), random_numbers.normal()) * 0.3;
            let [fx, fy, cx, cy] = INTRINSICS_PX;
            let bearing = Vector3::new((uv_px.x - cx) / fx, (uv_px.y - cy) / fy, 1.0).normalize();
            detected += usize::from(earlier.is_none());
            let feature = TrackedFeature {
                id: FeatureId(id),
                age: earlier.map_or(0, |feature| feature.age + 1),
                uv_px,
                previous_uv_px: earlier.map(|feature| feature.uv_px),
                bearing,
            };
            now.insert(id, feature);
        }
        let tracked = now.len() - detected;
        let statistics = FrontEndStatistics {
            tracked,
            detected,
            lost: before.len() - tracked,
            rejected: (before.len() - tracked) / 3,
            mean_parallax_px: 2.4,
            median_flow_px: 5.1,
        };
        let features = now.values().copied().collect();
        frames.push(Arc::new(TrackedFrame { stamp_ns: index as i64 * FRAME_PERIOD_NS, features, statistics }));
        before = now;
    }
    frames
}

fn sample_run(
    number: usize,
    name: &str,
    flight: &[FlightState],
    tracks: &[Arc<TrackedFrame>],
    given: &ClassicalChain,
    ground_truth: &ClassicalChain,
) -> RunRecord {
    let points = yard_points();
    let true_from_estimate =
        RigidTransform::new(UnitQuaternion::from_euler_angles(0.0, 0.0, 0.4), Vector3::new(1.0, -2.0, 0.3));
    let mut random_numbers = RandomNumbers::new(31 + number as u64);
    let steps = (0..flight.len())
        .map(|index| {
            let estimate = Estimate { number, flight, true_from_estimate };
            let calibration = calibration_at(name, index, given, ground_truth);
            let report = if index < FIRST_TRACKED_FRAME {
                waiting_report(index, calibration)
            } else {
                tracking_report(index, &estimate, calibration, tracks, &points, &mut random_numbers)
            };
            let rank = (index >= FIRST_TRACKED_FRAME).then(|| rank_at(&report.calibration.parameters, index));
            Arc::new(StepRecord {
                report,
                rank,
                tracks: Arc::clone(&tracks[index]),
                ground_truth: Some(flight[index].world_from_imu),
                log_time_ns: index as i64 * FRAME_PERIOD_NS + 19_000_000,
                summary_only: false,
            })
        })
        .collect();
    let spec = name.parse().expect("the sample's runs are named after parameterizations");
    let mut run = RunRecord::new(spec, "cam0".to_owned());
    (run.steps, run.finished, run.alignment) = (steps, true, Some(true_from_estimate));
    run
}

/// The errors of an artificial estimate.
struct Estimate<'a> {
    number: usize,
    flight: &'a [FlightState],
    true_from_estimate: RigidTransform,
}

impl Estimate<'_> {
    /// The estimated pose: ground truth with a slow drift that differs by run, in the estimator's own world.
    fn world_from_imu(&self, index: usize) -> RigidTransform {
        let age_s = index.saturating_sub(FIRST_TRACKED_FRAME) as f64 * 0.05;
        let gain = 0.03 + 0.05 * self.number as f64;
        let drift = Vector3::new((0.5 * age_s).sin(), 1.0 - (0.4 * age_s).cos(), 0.3 * (0.7 * age_s).sin()) * gain;
        let mut pose = self.flight[index].world_from_imu;
        pose.translation_m += drift * (1.0 + 0.4 * age_s);
        self.true_from_estimate.inverse() * pose
    }
}

fn waiting_report(index: usize, calibration: crate::estimator::CalibrationEstimate) -> StepReport {
    let motion = 0.004 * index as f64;
    StepReport {
        frame_index: index,
        stamp_ns: index as i64 * FRAME_PERIOD_NS,
        phase: Phase::Initializing,
        restarts: 0,
        pixel_sigma_px: 0.5,
        effective_pixel_sigma_px: 0.5,
        events: vec![Event {
            kind: EventKind::InitializationWaits,
            message: format!("waits for motion: parallax {:.1} px of 10 px", motion * 50.0),
            value: Some(motion * 50.0),
            threshold: Some(10.0),
        }],
        window: Vec::new(),
        calibration,
        features: Vec::new(),
        counts: FeatureCounts::default(),
        landmarks: Vec::new(),
        residuals: Vec::new(),
        reprojection_rms_before_px: f64::NAN,
        reprojection_rms_after_px: f64::NAN,
        reprojection_median_after_px: f64::NAN,
        iterations: Vec::new(),
        linearization: None,
        jacobian_source: None,
        factor_rows: None,
        gain: None,
        keyframe: false,
        times: StageTimes { frontend_ms: 6.0, step_ms: 6.2, ..StageTimes::default() },
        warnings: Vec::new(),
    }
}

fn tracking_report(
    index: usize,
    estimate: &Estimate<'_>,
    calibration: crate::estimator::CalibrationEstimate,
    tracks: &[Arc<TrackedFrame>],
    points: &[Vector3<f64>],
    random_numbers: &mut RandomNumbers,
) -> StepReport {
    let keyframe = index.is_multiple_of(4);
    let mut indices: Vec<usize> =
        (0..=index).rev().filter(|&frame| frame == index || frame.is_multiple_of(4)).collect();
    indices.retain(|&frame| frame + 60 > index);
    indices.truncate(11);
    indices.reverse();
    let window: Vec<FrameStateReport> = indices
        .iter()
        .map(|&frame| {
            let angles = &estimate.flight[frame].joint_angles_rad;
            FrameStateReport {
                frame_index: frame,
                stamp_ns: frame as i64 * FRAME_PERIOD_NS,
                world_from_imu: estimate.world_from_imu(frame),
                velocity_m_per_s: estimate.flight[frame].velocity_m_per_s,
                accelerometer_bias_m_per_s2: Vector3::new(-0.49, -0.14, 0.39),
                gyroscope_bias_rad_per_s: Vector3::new(-0.0006, -0.0002, -0.0075),
                joint_angles_rad: angles.to_vec(),
                encoder_angles_rad: Some(angles.iter().map(|angle| angle + 0.0087 * random_numbers.normal()).collect()),
                encoder_sigmas_rad: Some(vec![0.0087; 3]),
                imu_from_camera: chain_pose(&calibration.classical, angles),
                keyframe: frame.is_multiple_of(4),
            }
        })
        .collect();
    let features = feature_reports(index, &indices, estimate, tracks, points, random_numbers);
    let landmarks = features
        .iter()
        .map(|feature| LandmarkReport {
            id: feature.id,
            position_m: estimate.true_from_estimate.inverse().transform(&point_of(feature.id, points))
                + Vector3::new(random_numbers.normal(), random_numbers.normal(), random_numbers.normal()) * 0.06,
        })
        .collect();
    let rms = |residual: fn(ObservationReport) -> Option<Vector2<f64>>| {
        let squares: Vec<f64> = features
            .iter()
            .flat_map(|feature| feature.observations.iter().filter_map(residual).map(|vector| vector.norm_squared()))
            .collect();
        (squares.iter().sum::<f64>() / (2.0 * squares.len().max(1) as f64)).sqrt()
    };
    let observations = features.iter().flat_map(|feature| feature.observations.iter());
    let mut lengths: Vec<f64> = observations.filter_map(|seen| Some(seen.residual_after_px?.norm())).collect();
    lengths.sort_by(f64::total_cmp);
    let visual_count: usize = features.iter().map(|feature| 2 * (feature.observations.len() - 1)).sum();
    let rejected = features.iter().filter(|feature| feature.rejected).count();
    StepReport {
        frame_index: index,
        stamp_ns: index as i64 * FRAME_PERIOD_NS,
        phase: Phase::Tracking,
        restarts: 0,
        pixel_sigma_px: 0.5,
        effective_pixel_sigma_px: 0.5,
        events: sample_events(index, keyframe, rejected),
        reprojection_rms_before_px: rms(|observation| observation.residual_before_px),
        reprojection_rms_after_px: rms(|observation| observation.residual_after_px),
        reprojection_median_after_px: lengths[lengths.len() / 2],
        window,
        calibration,
        counts: FeatureCounts::of(&features),
        features,
        landmarks,
        residuals: [
            (FactorKind::Visual, visual_count, 1.02),
            (FactorKind::Imu, 150, 0.95),
            (FactorKind::Encoder, 33, 1.1),
            (FactorKind::CalibrationPrior, 18, 0.6),
        ]
        .map(|(factor, count, ratio)| ResidualSummary {
            factor,
            count,
            chi2_before: count as f64 * ratio * (3.0 + random_numbers.unit()),
            chi2_after: count as f64 * ratio * (0.9 + 0.2 * random_numbers.unit()),
        })
        .to_vec(),
        iterations: (0..4)
            .map(|iteration| IterationReport {
                cost_before: 900.0 / 3_f64.powi(iteration) + 300.0,
                cost_after: 900.0 / 3_f64.powi(iteration + 1) + 300.0,
                damping: 1e-4,
                step_norm: 0.1 / 5_f64.powi(iteration),
                accepted: true,
            })
            .collect(),
        linearization: None,
        jacobian_source: None,
        factor_rows: None,
        gain: None,
        keyframe,
        times: StageTimes {
            frontend_ms: 7.0 + random_numbers.unit(),
            optimize_ms: 14.0 + 4.0 * random_numbers.unit(),
            linearize_ms: 1.0,
            report_ms: 0.3,
            marginalize_ms: 2.0,
            observability_ms: 1.2,
            step_ms: 26.0 + 4.0 * random_numbers.unit(),
        },
        warnings: Vec::new(),
    }
}

fn sample_events(index: usize, keyframe: bool, rejected: usize) -> Vec<Event> {
    let event = |kind, message: String, value, threshold| Event { kind, message, value, threshold };
    let mut events = Vec::new();
    if index == FIRST_TRACKED_FRAME {
        events.push(event(
            EventKind::InitializedFromMotion,
            "initialized: parallax 14.2 px".into(),
            Some(14.2),
            Some(10.0),
        ));
    }
    if keyframe {
        events.push(event(EventKind::KeyframeChosen, "keyframe: parallax 11.0 px".into(), Some(11.0), Some(10.0)));
        events.push(event(EventKind::OldestMarginalized, "oldest frame marginalized".into(), None, None));
    } else {
        events.push(event(EventKind::SecondNewestDropped, "second-newest frame dropped".into(), None, None));
    }
    if rejected > 0 {
        let message = format!("{rejected} features rejected: χ² over 9.21");
        events.push(event(EventKind::OutliersRejected, message, Some(rejected as f64), Some(9.21)));
    }
    events
}

fn feature_reports(
    index: usize,
    window: &[usize],
    estimate: &Estimate<'_>,
    tracks: &[Arc<TrackedFrame>],
    points: &[Vector3<f64>],
    random_numbers: &mut RandomNumbers,
) -> Vec<FeatureReport> {
    const SIGMA_PX: f64 = 0.4;
    let find = |frame: usize, id: FeatureId| {
        let features = &tracks[frame].features;
        features.binary_search_by_key(&id, |feature| feature.id).ok().map(|at| features[at])
    };
    let mut reports = Vec::new();
    for feature in &tracks[index].features {
        let seen: Vec<usize> = window
            .iter()
            .copied()
            .filter(|&frame| index - frame <= feature.age as usize && find(frame, feature.id).is_some())
            .collect();
        let (Some(&anchor), true) = (seen.first(), seen.len() >= 3) else { continue };
        let rejected = random_numbers.unit() < 0.03;
        let point = point_of(feature.id, points);
        let depth = project(&estimate.flight[anchor].world_from_camera, &point).map_or(10.0, |(_, depth)| depth);
        let observations = seen
            .iter()
            .filter_map(|&frame| {
                let measured_px = find(frame, feature.id)?.uv_px;
                let scale = if rejected { 8.0 } else { 1.0 };
                let after = Vector2::new(random_numbers.normal(), random_numbers.normal()) * SIGMA_PX * scale;
                let push = Vector2::new(0.9, -0.5) * (0.6 + 0.3 * (measured_px.x * 0.01).sin());
                let newest = if frame == index { 1.0 } else { 0.15 };
                let chi2 = after.norm_squared() / (SIGMA_PX * SIGMA_PX);
                let residual = |vector: Vector2<f64>| (frame != anchor).then_some(vector);
                Some(ObservationReport {
                    frame_index: frame,
                    measured_px,
                    residual_before_px: residual(after + push * newest),
                    residual_after_px: residual(after),
                    chi2: if frame == anchor { 0.0 } else { chi2 },
                    robust_weight: 1.0 / (1.0 + chi2 / 9.0),
                })
            })
            .collect();
        reports.push(FeatureReport {
            id: feature.id,
            anchor_frame_index: anchor,
            inverse_depth_per_m: 1.0 / depth,
            observations,
            rejected,
        });
    }
    reports
}
