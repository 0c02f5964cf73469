//! Relative motion of the camera poses due to a calibration parameter, split by the motions in the window.
//!
//! Let `D(q)` be the derivative of the extrinsics at joint angles `q` with respect to the parameters, as a
//! twist in the IMU frame, and `M` the motion of the IMU from a frame to the newest one. Up to a rigid motion
//! of the scene with the newest camera, the camera of the frame moves by `D(q) − Ad(M)·D(q')`, where `q'` are
//! the newest joint angles. Without motion this is zero.
//! The difference is a sum. `I − Ad(M)` splits exactly by the axes of the rotation vector and the translation of `M`,
//! because `exp([w]) − I = [w]·Jl(w)`; `D(q) − D(q')` telescopes over the joints, as the mean of both
//! orders.

use std::borrow::Cow;

use nalgebra::{DMatrix, DVector, Matrix3, Matrix3xX, Vector3};

use crate::estimator::state::camera_pose::{self, CameraCalibration, CameraMaps};
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::layout::POSE;
use crate::geometry::{RigidTransform, so3};

/// Twists with respect to the calibration columns (3 × columns each): rotations and translations in the IMU frame.
#[derive(Clone, Debug)]
struct Twists {
    angular: Matrix3xX<f64>,
    shift: Matrix3xX<f64>,
}

/// For each motion (translations along and rotations about the IMU's axes, then the joints), its
/// contribution to the derivative of the camera's blocks with respect to the calibration (6·blocks × columns).
///
/// The sum over motions is that derivative up to a rigid motion of all poses of a camera. Intrinsics, and the pose of one
/// camera of a pair relative to the other, change the images without any motion and are not attributed.
pub(crate) fn motion_parts(
    stamped: &[FrameState],
    sensors: &[CameraCalibration<'_>],
    maps: &CameraMaps,
    joints: usize,
) -> Vec<DMatrix<f64>> {
    let columns = sensors.first().map_or(0, |sensor| sensor.columns);
    let mut parts = vec![DMatrix::zeros(6 * maps.blocks(), columns); 6 + joints];
    let per_frame = sensors.iter().map(|sensor| sensor.block_rows().len()).sum();
    let mut first = 0;
    for sensor in sensors {
        of_sensor(stamped, sensor, maps, (first, per_frame), &mut parts);
        first += sensor.block_rows().len();
    }
    parts
}

/// Adds the blocks of one camera; `first` is its first one in each frame.
fn of_sensor(
    stamped: &[FrameState],
    sensor: &CameraCalibration<'_>,
    maps: &CameraMaps,
    (first, per_frame): (usize, usize),
    parts: &mut [DMatrix<f64>],
) {
    let rows = sensor.block_rows();
    let exposures = stamped.iter().flat_map(|state| rows.iter().map(move |row| (state, *row)));
    let exposures: Vec<_> = exposures.map(|(state, row)| (state, sensor.exposure(state, row))).collect();
    let blocks: Vec<usize> =
        (0..exposures.len()).map(|index| per_frame * (index / rows.len()) + first + index % rows.len()).collect();
    let frames: Vec<Cow<'_, FrameState>> =
        exposures.iter().map(|(state, exposure)| camera_pose::state_at(state, exposure)).collect();
    let Some(newest) = frames.last() else { return };
    let there = twists(sensor, &newest.joints_rad);
    for (block, frame) in blocks.iter().zip(&frames) {
        let pose = &frame.navigation.world_from_imu;
        let extrinsics = sensor.imu_from_camera(&frame.joints_rad);
        let to_newest = pose.inverse() * newest.navigation.world_from_imu;
        let mut put = |motion: usize, twists: &Twists| {
            let moved = camera_moves(twists, &extrinsics, &pose.rotation_matrix());
            let mut place = parts[motion].view_mut((6 * block, 0), (6, sensor.columns));
            place += moved;
        };
        body_parts(&to_newest, &there, &mut put);
        joint_parts(sensor, &newest.joints_rad, &frame.joints_rad, &mut put);
    }
    let attitude = |frame: &Cow<'_, FrameState>| frame.navigation.world_from_imu.rotation_matrix();
    let motions = exposures.iter().map(|(state, exposure)| state.motion_at(exposure));
    let moving = blocks.into_iter().zip(frames.iter().map(attitude).zip(motions));
    let moving: Vec<MovingBlock> = moving.map(|(block, (attitude, motion))| (block, attitude, motion)).collect();
    if let Some(column) = sensor.shift_column {
        clock_parts(&moving, maps, column, &[1.0], parts);
    }
    if let Some(column) = sensor.readout_column {
        clock_parts(&moving, maps, column, rows, parts);
    }
}

/// Block of a camera, with the attitude of the IMU and the motion at its exposure.
type MovingBlock = (usize, Matrix3<f64>, DVector<f64>);

/// Twists of the extrinsics with respect to the parameters; zero for columns after the chain's.
fn twists(sensor: &CameraCalibration<'_>, joints_rad: &[f64]) -> Twists {
    let linearization = sensor.linearize(joints_rad);
    let extrinsics = linearization.imu_from_camera;
    let by_parameters = linearization.by_parameters;
    let angular = extrinsics.rotation_matrix() * by_parameters.fixed_rows::<3>(0);
    let shift = by_parameters.fixed_rows::<3>(3) + so3::hat(&extrinsics.translation_m) * &angular;
    Twists { angular, shift }
}

/// `(I − Ad(M))·D` by the axes of the translation and of the rotation.
fn body_parts(to_newest: &RigidTransform, there: &Twists, put: &mut impl FnMut(usize, &Twists)) {
    let angle = so3::log(&to_newest.rotation);
    // The left Jacobian is the right Jacobian of the negative angle.
    let mean = so3::right_jacobian(&-angle);
    let rotation = to_newest.rotation_matrix();
    for axis in 0..3 {
        let unit: Vector3<f64> = Vector3::ith(axis, 1.0);
        let along: Matrix3<f64> = so3::hat(&(unit * -to_newest.translation_m[axis])) * rotation;
        put(axis, &Twists { angular: &there.angular * 0.0, shift: along * &there.angular });
        let about: Matrix3<f64> = so3::hat(&(unit * -angle[axis])) * mean;
        put(3 + axis, &Twists { angular: about * &there.angular, shift: about * &there.shift });
    }
}

/// `D(q) − D(q')` joint by joint, as mean of both orders.
fn joint_parts(sensor: &CameraCalibration<'_>, from_rad: &[f64], to_rad: &[f64], put: &mut impl FnMut(usize, &Twists)) {
    let joints = sensor.joint_count().min(to_rad.len());
    if from_rad[..joints] == to_rad[..joints] {
        return;
    }
    let orders: [Vec<usize>; 2] = [(0..joints).collect(), (0..joints).rev().collect()];
    for order in orders {
        let mut angles = from_rad.to_vec();
        let mut before = twists(sensor, &angles);
        for joint in order {
            angles[joint] = to_rad[joint];
            let after = twists(sensor, &angles);
            let half = |after: &Matrix3xX<f64>, before: &Matrix3xX<f64>| (after - before) * 0.5;
            let change =
                Twists { angular: half(&after.angular, &before.angular), shift: half(&after.shift, &before.shift) };
            put(6 + joint, &change);
            before = after;
        }
    }
}

/// Contributions to a time offset or readout time, which moves the camera of a row by its velocity times the row's
/// factor.
fn clock_parts(moving: &[MovingBlock], maps: &CameraMaps, clock: usize, factors: &[f64], parts: &mut [DMatrix<f64>]) {
    for ((block, world_from_imu, rates), factor) in moving.iter().zip(factors.iter().cycle()) {
        let (own, body_from_world) = (&maps.own[*block], world_from_imu.transpose());
        let velocity = body_from_world * rates.fixed_rows::<3>(3);
        for (motion, part) in parts.iter_mut().enumerate() {
            let moved = match motion {
                0..3 => own.columns(3, 3) * body_from_world.row(motion).transpose() * velocity[motion],
                3..6 => own.column(motion - 3) * rates[motion - 3],
                joint => own.column(POSE + joint - 6) * rates[joint],
            };
            part.view_mut((6 * block, clock), (6, 1)).copy_from(&(moved * *factor));
        }
    }
}

/// Converts twists in the IMU frame to `[φ; δt]` of `world_from_camera` (6 × columns).
fn camera_moves(twists: &Twists, extrinsics: &RigidTransform, world_from_imu: &Matrix3<f64>) -> DMatrix<f64> {
    let mut moves = DMatrix::zeros(6, twists.angular.ncols());
    moves.rows_mut(0, 3).copy_from(&(extrinsics.rotation_matrix().transpose() * &twists.angular));
    let shift = &twists.shift - so3::hat(&extrinsics.translation_m) * &twists.angular;
    moves.rows_mut(3, 3).copy_from(&(world_from_imu * shift));
    moves
}
