//! Errors of a chain in pixels of the rigid cameras: the residual of a calibration as AC-DCC defines it.
//!
//! The gimbal camera's pose comes from its own pixels, the chain carries it to each rigid camera, and the points of the
//! rigid camera are projected: mean length of projected minus measured pixel over the points.
//! *As read*: at the readings of the joints. *Estimated*: at joint angles estimated from half of the points of the rigid
//! cameras, evaluated on the other half; both halves in turn.

use nalgebra::{DVector, Dyn, Matrix6xX};

use super::observed::{ObservedSet, from_first};
use super::point_residual::{by_pose, residual, residual_lengths};
use crate::camera::CameraModel;
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::Chain;
use crate::optimization::damped::{DampedOptions, LeastSquares, minimize};
use crate::optimization::{NormalEquations, RobustLoss};
use crate::sensors::{MapPoint, StillCamera};

const OPTIONS: DampedOptions = DampedOptions {
    iterations: 40,
    relative_cost_tolerance: 1e-10,
    first_damping: 1e-6,
    min_damping: 1e-12,
    max_damping: 1e12,
    growth: 20.0,
};

/// Errors of one set in one rigid camera, in px.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ViewErrors {
    /// Index of the rigid camera.
    pub(super) camera: usize,
    /// Mean length of the residuals at the readings; `None` if a point lies behind the camera.
    pub(super) as_read_px: Option<f64>,
    /// The same at angles estimated from the other half of the points.
    pub(super) estimated_px: Option<f64>,
}

/// Errors of one set, and its joint angles according to the chain.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SetErrors {
    pub(super) views: Vec<ViewErrors>,
    /// Estimated angle minus reading of each joint, in rad.
    pub(super) corrections_rad: Vec<f64>,
}

/// Evaluates a chain on one set.
pub(super) fn set_errors(
    set: &ObservedSet,
    cameras: &[StillCamera],
    chain: &Chain,
    further: &[RigidTransform],
) -> SetErrors {
    let problem = |parity: Option<usize>| AngleProblem {
        set,
        chain,
        further,
        views: set
            .rigid
            .iter()
            .map(|(camera, view)| {
                let points =
                    view.points.iter().enumerate().filter(|(index, _)| parity.is_none_or(|it| index % 2 == it));
                (*camera, &cameras[*camera].model, points.map(|(_, point)| *point).collect())
            })
            .collect(),
    };
    let readings = DVector::from_column_slice(&set.readings_rad);
    // Far from the right angles the pixels are a poor guide: the poses of the cameras give a start.
    let start = minimize(&mut PoseAngles { set, chain, further }, readings.clone(), &OPTIONS).estimate;
    let solved = |parity| minimize(&mut problem(parity), start.clone(), &OPTIONS).estimate;
    let halves = [solved(Some(0)), solved(Some(1))];
    let all = solved(None);
    let mean = |camera: usize, points: &[MapPoint], angles: &DVector<f64>| {
        let pose = carried(set, chain, further, camera, angles.as_slice());
        let lengths = residual_lengths(&cameras[camera].model, &pose, points)?;
        Some(lengths.iter().sum::<f64>() / lengths.len().max(1) as f64)
    };
    let views = set.rigid.iter().map(|(camera, view)| {
        let half = |parity: usize| -> Option<f64> {
            let points = view.points.iter().enumerate().filter(|(index, _)| index % 2 == parity);
            let points: Vec<MapPoint> = points.map(|(_, point)| *point).collect();
            mean(*camera, &points, &halves[1 - parity])
        };
        ViewErrors {
            camera: *camera,
            as_read_px: mean(*camera, &view.points, &readings),
            estimated_px: half(0).zip(half(1)).map(|(even, odd)| f64::midpoint(even, odd)),
        }
    });
    SetErrors { views: views.collect(), corrections_rad: (all - &readings).iter().copied().collect() }
}

/// `rigid_from_world` of a rigid camera by the chain.
fn carried(
    set: &ObservedSet,
    chain: &Chain,
    further: &[RigidTransform],
    camera: usize,
    joints_rad: &[f64],
) -> RigidTransform {
    from_first(further, camera) * chain.imu_from_camera(joints_rad) * set.gimbal.camera_from_world
}

/// Joint angles from the poses of the cameras.
struct PoseAngles<'a> {
    set: &'a ObservedSet,
    chain: &'a Chain,
    further: &'a [RigidTransform],
}

impl LeastSquares for PoseAngles<'_> {
    type Estimate = DVector<f64>;
    type Equations = NormalEquations<Dyn>;

    fn cost(&self, angles_rad: &DVector<f64>) -> f64 {
        self.set.residual(self.chain, self.further, angles_rad.as_slice()).norm_squared()
    }

    fn linearize(&self, angles_rad: &DVector<f64>) -> Self::Equations {
        let rows = self.set.rows(self.chain, self.further, angles_rad.as_slice());
        let mut equations = NormalEquations::zeros(Dyn(angles_rad.len()));
        equations.add(&rows.residual, &rows.by_joints, 1.0);
        equations
    }

    fn plus(&self, angles_rad: &DVector<f64>, step: &DVector<f64>) -> DVector<f64> {
        angles_rad + step
    }
}

/// Joint angles from the pixels of the rigid cameras.
struct AngleProblem<'a> {
    set: &'a ObservedSet,
    chain: &'a Chain,
    further: &'a [RigidTransform],
    /// Index, model and points of each rigid camera.
    views: Vec<(usize, &'a CameraModel, Vec<MapPoint>)>,
}

impl AngleProblem<'_> {
    /// `rigid_from_world` of a rigid camera with its derivative by the joint angles: `[φ; δt]` per angle (6 × N).
    fn pose_with_jacobian(&self, camera: usize, angles_rad: &DVector<f64>) -> (RigidTransform, Matrix6xX<f64>) {
        let at = self.chain.linearize(angles_rad.as_slice());
        let first = from_first(self.further, camera);
        let gimbal = self.set.gimbal.camera_from_world;
        // F·C·T with C ⊞ [φ; δt]: rotation T_Rᵀ φ, translation R_F (δt − R_C [t_T]× φ).
        let rotation = gimbal.rotation.inverse().to_rotation_matrix();
        let outer = first.rotation_matrix();
        let lever = at.imu_from_camera.rotation_matrix() * so3::hat(&gimbal.translation_m);
        let mut by_angles = at.by_joints.clone();
        let turned = rotation * at.by_joints.fixed_rows::<3>(0);
        let shifted = outer * (at.by_joints.fixed_rows::<3>(3) - lever * at.by_joints.fixed_rows::<3>(0));
        by_angles.fixed_rows_mut::<3>(0).copy_from(&turned);
        by_angles.fixed_rows_mut::<3>(3).copy_from(&shifted);
        (first * at.imu_from_camera * gimbal, by_angles)
    }
}

impl LeastSquares for AngleProblem<'_> {
    type Estimate = DVector<f64>;
    type Equations = NormalEquations<Dyn>;

    fn cost(&self, angles_rad: &DVector<f64>) -> f64 {
        let of_view = |(camera, model, points): &(usize, &CameraModel, Vec<MapPoint>)| -> f64 {
            let pose = carried(self.set, self.chain, self.further, *camera, angles_rad.as_slice());
            points.iter().map(|point| RobustLoss::None.cost_of(residual(model, &pose, point), 1.0)).sum()
        };
        self.views.iter().map(of_view).sum()
    }

    fn linearize(&self, angles_rad: &DVector<f64>) -> Self::Equations {
        let mut equations = NormalEquations::zeros(Dyn(angles_rad.len()));
        for (camera, model, points) in &self.views {
            let (pose, by_angles) = self.pose_with_jacobian(*camera, angles_rad);
            let rotation = pose.rotation_matrix();
            for point in points {
                let in_camera = pose.transform(&point.point_in_world_m);
                let Some((uv_px, by_point)) = model.project_with_jacobian(&in_camera) else { continue };
                let rows = by_pose(&by_point, &rotation, point) * &by_angles;
                equations.add(&(uv_px - point.uv_px), &rows, 1.0);
            }
        }
        equations
    }

    fn plus(&self, angles_rad: &DVector<f64>, step: &DVector<f64>) -> DVector<f64> {
        angles_rad + step
    }
}
