//! A window of known poses as a linearization, its depths projected out.

use nalgebra::{DMatrix, DVector, Vector3};

use crate::camera::CameraModel;
use crate::estimator::{ColumnBlock, ColumnGroup, Linearization};
use crate::geometry::RigidTransform;
use crate::gimbal::Chain;
use crate::gimbal::tests::golden::Reprojection;

pub(super) struct Landmark {
    pub(super) anchor: usize,
    /// `(x/z, y/z, 1)` in the anchor's camera.
    pub(super) bearing: Vector3<f64>,
    pub(super) inverse_depth_per_m: f64,
}

pub(super) struct Window {
    pub(super) camera: CameraModel,
    pub(super) world_from_imu: Vec<RigidTransform>,
    pub(super) joint_angles_rad: Vec<Vec<f64>>,
    pub(super) landmarks: Vec<Landmark>,
    /// Landmark, anchor frame, observing frame.
    pub(super) observations: Vec<[usize; 3]>,
}

impl Window {
    /// The whitened linearization (1 px) with the joint angles known, or free in every frame.
    pub(super) fn linearize(&self, chain: &Chain, joints_free: bool) -> Linearization {
        let (columns, joints) = (chain.dof(), if joints_free { chain.joint_count() } else { 0 });
        let frames = self.world_from_imu.len();
        let width = columns + joints * frames;
        let mut jacobian = DMatrix::zeros(0, width);
        let mut squared_norms = DVector::zeros(columns);
        for (index, landmark) in self.landmarks.iter().enumerate() {
            let seen: Vec<_> = self.observations.iter().filter(|observation| observation[0] == index).collect();
            if seen.is_empty() {
                continue;
            }
            let mut rows = DMatrix::zeros(2 * seen.len(), width + 1);
            for (place, [_, anchor, observer]) in seen.iter().enumerate() {
                let frame = |slot: usize| (&self.world_from_imu[slot], self.joint_angles_rad[slot].as_slice());
                let found = Reprojection::new(
                    chain,
                    &self.camera,
                    frame(*anchor),
                    frame(*observer),
                    &landmark.bearing,
                    landmark.inverse_depth_per_m,
                );
                let mut rows = rows.rows_mut(2 * place, 2);
                rows.columns_mut(0, columns).copy_from(&found.by_parameters);
                if joints_free {
                    rows.columns_mut(columns + joints * anchor, joints).copy_from(&found.by_joints_i);
                    rows.columns_mut(columns + joints * observer, joints).copy_from(&found.by_joints_j);
                }
                rows.column_mut(width).copy_from(&found.by_inverse_depth);
            }
            for column in 0..columns {
                squared_norms[column] += rows.column(column).norm_squared();
            }
            let kept = without_last_column(rows);
            let before = jacobian.nrows();
            jacobian = jacobian.resize_vertically(before + kept.nrows(), 0.0);
            jacobian.rows_mut(before, kept.nrows()).copy_from(&kept);
        }
        let mut blocks: Vec<_> = chain
            .parameter_names()
            .into_iter()
            .enumerate()
            .map(|(start, name)| ColumnBlock { group: ColumnGroup::Calibration, name, start, len: 1 })
            .collect();
        if joints > 0 {
            blocks.extend((0..frames).map(|slot| ColumnBlock {
                group: ColumnGroup::Joints,
                name: format!("joints {slot}"),
                start: columns + joints * slot,
                len: joints,
            }));
        }
        Linearization {
            columns: blocks,
            prior_jacobian: DMatrix::zeros(0, width),
            jacobian,
            calibration_column_norms: squared_norms.map(f64::sqrt),
        }
    }
}

/// Mirrors the rows so that only the first one has an entry in the last column, and drops both.
fn without_last_column(mut rows: DMatrix<f64>) -> DMatrix<f64> {
    let last = rows.ncols() - 1;
    let mut mirror = rows.column(last).into_owned();
    let norm = mirror.norm();
    mirror[0] += if mirror[0] < 0.0 { -norm } else { norm };
    let along = rows.tr_mul(&mirror) * (2.0 / mirror.norm_squared());
    rows -= &mirror * along.transpose();
    rows.remove_row(0).remove_column(last)
}
