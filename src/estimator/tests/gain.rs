//! Information gain of the newest image, by motion.

use nalgebra::DMatrix;

use super::fixture::{self, TestWindow};
use super::flight::step;
use crate::estimator::Estimator;
use crate::estimator::config::{EstimatorOptions, VisualLoss};
use crate::estimator::factors::projected_rows::NewestRows;
use crate::estimator::problem::information_gain::{CameraInformation, InformationGain, Motion};
use crate::estimator::problem::motion_parts::motion_parts;
use crate::estimator::problem::problem::Problem;
use crate::estimator::state::camera_pose::CameraMaps;
use crate::estimator::state::columns::{ColumnGroup, ColumnId, FrameId};
use crate::estimator::state::estimate::Estimate;
use crate::estimator::window::features::ActiveTracks;
use crate::gimbal::Parameterization;
use crate::gimbal::tests::parameter;
use crate::optimization::RobustLoss;
use crate::simulation::synthetic_tracks;

/// Windows with a prior, away from the ground truth.
fn windows() -> Vec<(&'static str, TestWindow)> {
    let options = EstimatorOptions { loss: VisualLoss::Fixed(RobustLoss::None), ..EstimatorOptions::default() };
    let gimbal = |parameterization| fixture::window(parameterization, true, options);
    let mut windows = vec![
        ("minimal", gimbal(Parameterization::Minimal)),
        ("classical", gimbal(Parameterization::Classical)),
        ("poe", gimbal(Parameterization::Poe)),
        ("rigid", fixture::window(Parameterization::Minimal, false, options)),
        ("cluster", fixture::cluster_window(options, false)),
        ("cluster with clocks", fixture::cluster_window(options, true)),
        ("mounted on cameras", fixture::mounted_window(options, false)),
        ("interleaved", fixture::interleaved_window(options, true)),
    ];
    let mut frozen = gimbal(Parameterization::Classical);
    for name in ["EC.tx", "L1.d"] {
        frozen.freeze(parameter(name));
    }
    windows.push(("frozen", frozen));
    for (_, estimator) in &mut windows {
        fixture::disturb(estimator, 0.2);
        fixture::marginalize_once(estimator);
    }
    windows
}

#[test]
fn the_terms_of_the_motions_sum_to_the_calibration_jacobian() {
    for (name, estimator) in windows() {
        let active = estimator.active_tracks();
        let problem = estimator.problem(&active);
        let estimate = estimator.estimate(&active);
        let linearized = problem.linearization_point(&estimate);
        let frames = &linearized.frames;
        for camera in 0..problem.cameras.len() {
            let sensors = linearized.calibration.sensor_models(camera);
            let columns = sensors[0].columns;
            let maps = CameraMaps::new(frames, &linearized.calibration, camera);
            let parts = motion_parts(frames, &sensors, &maps, problem.layout.joints);
            let sum = parts.iter().fold(DMatrix::zeros(6 * frames.len(), columns), |sum, part| sum + part);
            let mut whole = DMatrix::zeros(6 * frames.len(), columns);
            for (slot, map) in maps.calibration.iter().enumerate() {
                whole.rows_mut(6 * slot, 6).copy_from(map);
            }
            let projected = problem.projected_rows(camera, &estimate, &linearized, NewestRows::Among);
            let by_camera = projected.rows.columns(0, 6 * frames.len());
            let (left, all) = (by_camera * (&whole - sum), by_camera * whole);
            // Motions at a time between two frames are about the axes of the IMU at the frame.
            let tolerance = if name == "interleaved" { 2e-3 } else { 1e-9 };
            assert!(left.norm() < tolerance * all.norm(), "{name}, camera {camera}: {} of {}", left.norm(), all.norm());
        }
    }
}

/// Bits by column, from explicit inverses for two windows, one of them without any information of the newest image.
fn bits_by_definition(problem: &Problem<'_>, estimate: &Estimate, active: &[ActiveTracks]) -> Vec<f64> {
    let parameters = estimate.calibration.parameters();
    let numbers: Vec<FrameId> = (0..problem.layout.frames).map(FrameId).collect();
    let newest = problem.layout.frames - 1;
    let cut: Vec<ActiveTracks> = active
        .iter()
        .map(|active| {
            let mut active = active.clone();
            for track in &mut active.tracks {
                track.observations.retain(|observation| observation.slot != newest);
            }
            active
        })
        .collect();
    let mut without = problem.clone();
    for (camera, cut) in without.cameras.iter_mut().zip(&cut) {
        camera.tracks = &cut.tracks;
    }
    let variances = |problem: &Problem<'_>, whole: bool| {
        let linearization = problem.linearization(estimate, &parameters, &numbers, None);
        let blocks = &linearization.columns;
        let of_newest = |id: ColumnId| {
            let frame = FrameId(newest);
            [ColumnId::Pose(frame), ColumnId::Joints(frame), ColumnId::VelocityBias(frame)].contains(&id)
        };
        let gone: Vec<usize> = blocks
            .iter()
            .filter(|block| !whole && of_newest(block.id))
            .flat_map(|block| block.start..block.start + block.len)
            .collect();
        let clean = |row: &usize| gone.iter().all(|column| linearization.jacobian[(*row, *column)] == 0.0);
        let rows: Vec<usize> = (0..linearization.jacobian.nrows()).filter(clean).collect();
        let measured = linearization.jacobian.select_rows(&rows);
        let priors = &linearization.prior_jacobian;
        let mut information = measured.tr_mul(&measured) + priors.tr_mul(priors);
        for index in 0..information.nrows() {
            information[(index, index)] += 1e-6;
        }
        let count = blocks.iter().filter(|block| block.id.group() == ColumnGroup::Calibration).count();
        let covariance = information.cholesky().unwrap().inverse();
        (0..count).map(|column| covariance[(column, column)]).collect::<Vec<f64>>()
    };
    let (with, without) = (variances(problem, true), variances(&without, false));
    with.iter().zip(&without).map(|(with, without)| 0.5 * (without / with).log2()).collect()
}

fn gain_of(problem: &Problem<'_>, estimate: &Estimate) -> InformationGain {
    let parameters = estimate.calibration.parameters();
    let numbers: Vec<FrameId> = (0..problem.layout.frames).map(FrameId).collect();
    let mut cameras: Vec<CameraInformation> = Vec::new();
    problem.linearization(estimate, &parameters, &numbers, Some(&mut cameras));
    problem.information_gain(estimate, &cameras).unwrap()
}

#[test]
fn information_gain_equals_that_of_windows_with_and_without_the_newest_image() {
    let options = EstimatorOptions { loss: VisualLoss::Fixed(RobustLoss::None), ..EstimatorOptions::default() };
    let mut pair = fixture::stereo_window(options);
    fixture::marginalize_once(&mut pair);
    for (name, estimator) in windows().into_iter().chain([("stereo pair", pair)]) {
        let active = estimator.active_tracks();
        let problem = estimator.problem(&active);
        let estimate = estimator.estimate(&active);
        let gain = gain_of(&problem, &estimate);
        let expected = bits_by_definition(&problem, &estimate, &active);
        assert_eq!(gain.columns(), expected.len(), "{name}");
        for (column, bits) in expected.iter().enumerate() {
            let reported = gain.bits_per_s(column) * gain.interval_s;
            assert!((reported - bits).abs() < 1e-4 * (0.01 + bits), "{name}, column {column}: {reported} for {bits}");
            let parts = gain.by_motion_per_s(column).sum::<f64>() + gain.earlier_per_s(column);
            assert!((parts - gain.bits_per_s(column)).abs() < 1e-9 + 1e-6 * parts.abs(), "{name}, column {column}");
        }
        assert!(expected.iter().any(|bits| *bits > 0.01), "{name}: {expected:?}");
    }
}

#[test]
fn information_gain_is_attributed_to_the_moving_joint() {
    for joint in 0..3 {
        let flight = synthetic_tracks(&fixture::joint_swing(joint, 16.5));
        let config = fixture::config(&flight.given_rig, Parameterization::Minimal, EstimatorOptions::default());
        let mut estimator = Estimator::new(config);
        // Total information of the last second by motion: by then no frame of the window is from before the exercise.
        // Hover yields no keyframes, so the gain is evaluated for each image.
        let mut sums = [0.0; 9];
        for frame in &flight.frames {
            step(&mut estimator, frame);
            if frame.stamp_ns <= 15_500_000_000 {
                continue;
            }
            let window = TestWindow::of(&estimator);
            let active = window.active_tracks();
            let gain = gain_of(&window.problem(&active), &window.estimate(&active));
            for column in 0..gain.columns() {
                for (sum, part) in sums.iter_mut().zip(gain.by_motion_per_s(column)) {
                    *sum += part * gain.interval_s;
                }
            }
        }
        let swung = sums[6 + joint];
        let others = (0..3).filter(|other| *other != joint).map(|other| sums[6 + other].abs()).fold(0.0, f64::max);
        assert!(swung > 0.0 && swung > 3.0 * others, "joint {joint}: {sums:?}");
        let leading = Motion::all(3).zip(sums).max_by(|a, b| a.1.total_cmp(&b.1)).unwrap().0;
        assert_eq!(leading, Motion::Joint(joint), "{sums:?}");
    }
}
