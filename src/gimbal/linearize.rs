//! Forward kinematics and its closed-form derivatives, by one pass along the chain for all parameterizations.
//!
//! Every column is an elementary motion: a rotation about an axis `w` through a point `p`, with the column
//! `[Rᵀ·w; w × (t − p)]`, or a translation along `w`, with the column `[0; w]`. `R` and `t` are rotation and position
//! of the camera (docs/mathematics.md, section 6).

use nalgebra::{Matrix6xX, Vector3};

use crate::geometry::{RigidTransform, so3};

use super::form::Form;
use super::frame::{Axis, ChainFrame};
use super::{Chain, DhLink};

/// Forward kinematics and its derivatives at given joint angles.
#[derive(Clone, Debug, PartialEq)]
pub struct ChainLinearization {
    /// Pose of the camera in the IMU frame.
    pub imu_from_camera: RigidTransform,
    /// Derivative of `[φ; δt]` of `imu_from_camera` with respect to the chain's columns (6 × dof).
    pub by_parameters: Matrix6xX<f64>,
    /// Derivative of `[φ; δt]` of `imu_from_camera` with respect to the joint angles (6 × N).
    pub by_joints: Matrix6xX<f64>,
}

impl ChainLinearization {
    /// The same for a camera mounted on this one; its chain has no joints, and its columns follow at `column` in `columns`
    /// columns.
    ///
    /// ```text
    /// T = T₁ T₂    φ = R₂ᵀ φ₁ + φ₂    δt = δt₁ − R₁ [t₂]× φ₁ + R₁ δt₂
    /// ```
    #[must_use]
    pub fn followed_by(&self, mounted: &Self, column: usize, columns: usize) -> Self {
        let (first, second) = (self.imu_from_camera.rotation_matrix(), mounted.imu_from_camera.rotation_matrix());
        let lever = first * so3::hat(&mounted.imu_from_camera.translation_m);
        let carried = |by: &Matrix6xX<f64>| {
            let mut carried = by.clone();
            carried.fixed_rows_mut::<3>(0).copy_from(&second.tr_mul(&by.fixed_rows::<3>(0)));
            carried.fixed_rows_mut::<3>(3).copy_from(&(by.fixed_rows::<3>(3) - lever * by.fixed_rows::<3>(0)));
            carried
        };
        let mut by_parameters = carried(&self.by_parameters).resize_horizontally(columns, 0.0);
        // A fixed calibration has no columns.
        if columns > 0 {
            let mut own = by_parameters.columns_mut(column, mounted.by_parameters.ncols());
            own.fixed_rows_mut::<3>(0).copy_from(&mounted.by_parameters.fixed_rows::<3>(0));
            own.fixed_rows_mut::<3>(3).copy_from(&(first * mounted.by_parameters.fixed_rows::<3>(3)));
        }
        Self {
            imu_from_camera: self.imu_from_camera * mounted.imu_from_camera,
            by_parameters,
            by_joints: carried(&self.by_joints),
        }
    }
}

impl Chain {
    /// Returns `imu_from_camera` at the given encoder angles, one per joint.
    ///
    /// # Panics
    ///
    /// When the number of angles is not the number of joints.
    pub fn imu_from_camera(&self, joint_angles_rad: &[f64]) -> RigidTransform {
        self.traverse(joint_angles_rad, &mut Unrecorded).to_transform()
    }

    /// Returns `imu_from_camera` at the given encoder angles with its derivatives with respect to columns and joint
    /// angles.
    ///
    /// # Panics
    ///
    /// When the number of angles is not the number of joints.
    pub fn linearize(&self, joint_angles_rad: &[f64]) -> ChainLinearization {
        let mut recorder = Recorder {
            parameters: Columns::new(self.dof()),
            joints: Columns::new(self.joint_count()),
            offsets: !self.offsets_hidden,
        };
        let frame = self.traverse(joint_angles_rad, &mut recorder);
        ChainLinearization {
            imu_from_camera: frame.to_transform(),
            by_parameters: recorder.parameters.finish(&frame),
            by_joints: recorder.joints.finish(&frame),
        }
    }

    fn traverse<S: MotionSink>(&self, joint_angles_rad: &[f64], sink: &mut S) -> ChainFrame {
        assert_eq!(joint_angles_rad.len(), self.joint_count(), "one angle per joint");
        let mut frame = ChainFrame::identity();
        match &self.form {
            Form::Classical(chain) => {
                traverse_block(&mut frame, &chain.imu_from_base, sink);
                for (link, angle) in chain.links.iter().zip(joint_angles_rad) {
                    traverse_link(&mut frame, link, *angle, sink);
                    rotate(&mut frame, Axis::X, link.alpha_rad, sink);
                }
                traverse_block(&mut frame, &chain.effector_from_camera, sink);
            }
            Form::Minimal(chain) => {
                let order = if self.parameterization.base_yx() { [Axis::Y, Axis::X] } else { [Axis::X, Axis::Y] };
                for (axis, angle) in order.into_iter().zip(chain.base_angles_rad) {
                    rotate(&mut frame, axis, angle, sink);
                }
                translate(&mut frame, Axis::X, chain.base_shift_m[0], sink);
                translate(&mut frame, Axis::Y, chain.base_shift_m[1], sink);
                let end = chain.links.len() - 1;
                for (index, (link, angle)) in chain.links.iter().zip(joint_angles_rad).enumerate() {
                    traverse_link(&mut frame, link, *angle, sink);
                    if index == end && self.parameterization.end_swapped() {
                        translate(&mut frame, Axis::Y, chain.y_m, sink);
                        rotate(&mut frame, Axis::Y, chain.beta_rad, sink);
                    }
                    rotate(&mut frame, Axis::X, link.alpha_rad, sink);
                }
                if !self.parameterization.end_swapped() {
                    rotate(&mut frame, Axis::Y, chain.beta_rad, sink);
                    translate(&mut frame, Axis::Y, chain.y_m, sink);
                }
            }
            Form::Poe(blocks) => {
                for (block, angle) in blocks.iter().zip(joint_angles_rad) {
                    frame.then(block);
                    for axis in [Axis::X, Axis::Y] {
                        sink.rotate(&frame.axis(axis), &frame.origin);
                    }
                    for axis in [Axis::X, Axis::Y] {
                        sink.translate(&frame.axis(axis));
                    }
                    sink.joint(&frame.axis(Axis::Z), &frame.origin);
                    frame.rotate(Axis::Z, *angle);
                }
                traverse_block(&mut frame, &blocks[blocks.len() - 1], sink);
            }
            Form::Rigid(transform) => traverse_block(&mut frame, transform, sink),
        }
        frame
    }
}

/// Receives the elementary motions of a chain in column order.
trait MotionSink {
    fn rotate(&mut self, axis: &Vector3<f64>, point: &Vector3<f64>);
    fn translate(&mut self, axis: &Vector3<f64>);
    fn joint(&mut self, axis: &Vector3<f64>, point: &Vector3<f64>);
    fn offset(&mut self, axis: &Vector3<f64>, point: &Vector3<f64>);
}

/// Ignores all motions: forward kinematics without derivatives.
struct Unrecorded;

impl MotionSink for Unrecorded {
    fn rotate(&mut self, _axis: &Vector3<f64>, _point: &Vector3<f64>) {}
    fn translate(&mut self, _axis: &Vector3<f64>) {}
    fn joint(&mut self, _axis: &Vector3<f64>, _point: &Vector3<f64>) {}
    fn offset(&mut self, _axis: &Vector3<f64>, _point: &Vector3<f64>) {}
}

struct Recorder {
    parameters: Columns,
    joints: Columns,
    offsets: bool,
}

impl MotionSink for Recorder {
    fn rotate(&mut self, axis: &Vector3<f64>, point: &Vector3<f64>) {
        self.parameters.push(axis, point);
    }

    fn translate(&mut self, axis: &Vector3<f64>) {
        self.parameters.push(&Vector3::zeros(), axis);
    }

    fn joint(&mut self, axis: &Vector3<f64>, point: &Vector3<f64>) {
        self.joints.push(axis, point);
    }

    fn offset(&mut self, axis: &Vector3<f64>, point: &Vector3<f64>) {
        if self.offsets {
            self.parameters.push(axis, point);
        }
    }
}

/// Columns before the camera pose is computed: axis and point of a rotation, or zero and axis of a translation.
struct Columns {
    matrix: Matrix6xX<f64>,
    filled: usize,
}

impl Columns {
    fn new(count: usize) -> Self {
        Self { matrix: Matrix6xX::zeros(count), filled: 0 }
    }

    fn push(&mut self, axis: &Vector3<f64>, point: &Vector3<f64>) {
        let mut column = self.matrix.column_mut(self.filled);
        column.fixed_rows_mut::<3>(0).copy_from(axis);
        column.fixed_rows_mut::<3>(3).copy_from(point);
        self.filled += 1;
    }

    fn finish(mut self, camera: &ChainFrame) -> Matrix6xX<f64> {
        debug_assert_eq!(self.filled, self.matrix.ncols(), "the walk met every column");
        for mut column in self.matrix.column_iter_mut() {
            let axis: Vector3<f64> = column.fixed_rows::<3>(0).into_owned();
            // The axis of a rotation has unit length; the axis of a translation is stored in place of the point.
            if axis != Vector3::zeros() {
                let arm = camera.origin - column.fixed_rows::<3>(3);
                column.fixed_rows_mut::<3>(0).copy_from(&camera.rotation.tr_mul(&axis));
                column.fixed_rows_mut::<3>(3).copy_from(&axis.cross(&arm));
            }
        }
        self.matrix
    }
}

fn rotate<S: MotionSink>(frame: &mut ChainFrame, axis: Axis, angle_rad: f64, sink: &mut S) {
    sink.rotate(&frame.axis(axis), &frame.origin);
    frame.rotate(axis, angle_rad);
}

fn translate<S: MotionSink>(frame: &mut ChainFrame, axis: Axis, distance_m: f64, sink: &mut S) {
    sink.translate(&frame.axis(axis));
    frame.translate(axis, distance_m);
}

/// Adds a link up to its twist `Rx(α)`, which callers add: the swapped end block has `Ty(y)·Ry(β)` before it.
fn traverse_link<S: MotionSink>(frame: &mut ChainFrame, link: &DhLink, joint_angle_rad: f64, sink: &mut S) {
    let axis = frame.axis(Axis::Z);
    sink.joint(&axis, &frame.origin);
    sink.offset(&axis, &frame.origin);
    frame.rotate(Axis::Z, joint_angle_rad + link.theta_offset_rad);
    translate(frame, Axis::Z, link.d_m, sink);
    translate(frame, Axis::X, link.a_m, sink);
}

/// Adds a rigid transform with its six columns: rotations about its inner axes, translations along its outer axes.
fn traverse_block<S: MotionSink>(frame: &mut ChainFrame, transform: &RigidTransform, sink: &mut S) {
    let outer = *frame;
    frame.then(transform);
    for axis in [Axis::X, Axis::Y, Axis::Z] {
        sink.rotate(&frame.axis(axis), &frame.origin);
    }
    for axis in [Axis::X, Axis::Y, Axis::Z] {
        sink.translate(&outer.axis(axis));
    }
}
