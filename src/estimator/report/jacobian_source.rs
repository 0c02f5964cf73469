//! Stored data from which any block of the step's Jacobian can be reproduced.

use std::sync::Arc;

use nalgebra::{DMatrix, Quaternion, UnitQuaternion, Vector3};

use crate::estimator::factors::kind::{FactorKind, FactorLabel};
use crate::estimator::state::allocation::allocated_bytes;
use crate::estimator::state::calibrations::Calibrations;
use crate::estimator::state::columns::{ColumnBlock, FrameId};
use crate::estimator::state::frame_state::{FrameState, Rates};
use crate::estimator::state::layout::POSE;
use crate::estimator::state::navigation::{ImuBias, NavigationState};
use crate::geometry::RigidTransform;
use crate::gimbal::{Chain, ParameterId};
use crate::optimization::LandmarkModel;

/// Linearization points of the step's Jacobian, and blocks that cannot be reproduced from the report.
///
/// The rows of features, the largest part, follow from the rest of the report, these states and the bearings.
#[derive(Clone, Debug, PartialEq)]
pub struct JacobianSource {
    /// Linearization points by slot (first estimates): `world_from_imu` as quaternion x, y, z, w and position, then
    /// the joint angles. Single precision, much finer than the display.
    pub(crate) frames: Box<[f32]>,
    /// Linearization points of the chains, by camera.
    pub(crate) chains: Box<[Chain]>,
    /// Estimated time offsets by camera; empty if none is estimated.
    pub(crate) clocks: Box<[ClockColumns]>,
    /// By slot, if time offsets are estimated: angular rate and velocity of the IMU, then joint rates.
    pub(crate) rates: Box<[f32]>,
    /// States and calibrations, stored when rows of an image have separate poses, when a camera is mounted on another one
    /// or when intrinsics of a camera or of the IMU are estimated; the fields above do not cover these cases.
    pub(crate) exact: Option<Box<ExactSource>>,
    /// True if the calibration has columns.
    pub(crate) calibrated: bool,
    /// Rejected features, which have no landmark in the report: their index there, and their unit bearing in
    /// the anchor's camera.
    pub(crate) rejected: Box<[(u32, [f32; 3])]>,
    pub(crate) rows: Box<[PackedRow]>,
    /// Column-block indices of the norms of all packed rows, parallel to `norms`.
    pub(crate) columns: Box<[u16]>,
    pub(crate) norms: Box<[f32]>,
    /// Standard deviation of an observation by camera.
    pub(crate) pixel_sigmas_px: Box<[f64]>,
    pub(crate) landmark_model: LandmarkModel,
}

/// States by slot with the calibrations, in full precision.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ExactSource {
    pub(crate) linearized: (Vec<FrameState>, Calibrations),
    /// Estimate after the last iteration.
    pub(crate) current: (Vec<FrameState>, Calibrations),
}

impl ExactSource {
    /// Bytes of the states; the calibrations share their priors with the estimator.
    fn bytes(&self) -> usize {
        let states = || self.linearized.0.iter().chain(&self.current.0);
        size_of::<Self>() + states().map(|state| size_of::<FrameState>() + 8 * state.joint_block()).sum::<usize>()
    }
}

/// Time offsets estimated with a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ClockColumns {
    /// Number of time offsets: camera first, then encoders.
    pub(crate) count: usize,
    /// Camera time offset relative to the rig, at the linearization point and as estimated.
    pub(crate) shifts_s: [f64; 2],
}

/// Rows of a factor without a feature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PackedRow {
    pub(crate) label: FactorLabel,
    pub(crate) height: u16,
    pub(crate) count: u16,
}

/// Rows of a factor without a feature.
#[derive(Clone, Debug, PartialEq)]
pub struct FactorRows {
    pub factor: JacobianFactor,
    /// Whitened rows by the columns of the step (calibration, joints, poses, velocities and biases); the last column is
    /// the residual at the final estimate.
    pub rows: DMatrix<f64>,
}

/// Factor that residuals belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum JacobianFactor {
    /// Reprojections of a feature, two rows per observation.
    Feature(crate::frontend::FeatureId),
    /// Preintegrated IMU samples between two frames.
    Imu {
        from: FrameId,
        to: FrameId,
    },
    /// Samples of the IMU on the gimbal between two frames.
    GimbalImu {
        from: FrameId,
        to: FrameId,
    },
    /// Encoder readings of a frame.
    Encoder(FrameId),
    ZeroVelocity,
    /// Rig's prior on the calibration.
    CalibrationPrior,
    /// Marginalization prior, or the prior at the start.
    MarginalizationPrior,
}

impl JacobianFactor {
    /// Factor without a feature; `numbers` are the frames by slot.
    pub(crate) fn of(label: FactorLabel, numbers: &[FrameId]) -> Option<Self> {
        let number = |slot: u16| numbers.get(usize::from(slot)).copied();
        Some(match label {
            FactorLabel::Imu(slot) => Self::Imu { from: number(slot.checked_sub(1)?)?, to: number(slot)? },
            FactorLabel::GimbalImu(slot) => Self::GimbalImu { from: number(slot.checked_sub(1)?)?, to: number(slot)? },
            FactorLabel::Encoder(slot) => Self::Encoder(number(slot)?),
            FactorLabel::ZeroVelocity => Self::ZeroVelocity,
            FactorLabel::CalibrationPrior => Self::CalibrationPrior,
            FactorLabel::MarginalizationPrior => Self::MarginalizationPrior,
        })
    }

    pub const fn kind(self) -> FactorKind {
        match self {
            Self::Feature(_) => FactorKind::Visual,
            Self::Imu { .. } => FactorKind::Imu,
            Self::GimbalImu { .. } => FactorKind::GimbalImu,
            Self::Encoder(_) => FactorKind::Encoder,
            Self::ZeroVelocity => FactorKind::ZeroVelocity,
            Self::CalibrationPrior => FactorKind::CalibrationPrior,
            Self::MarginalizationPrior => FactorKind::MarginalizationPrior,
        }
    }
}

/// Rows of the Jacobian that belong to one factor.
#[derive(Clone, Debug, PartialEq)]
pub struct JacobianRow {
    pub factor: JacobianFactor,
    pub height: usize,
    /// Index of a column block and Frobenius norm of its rows, in standard deviations of the residuals per scale of the
    /// column (see [`crate::estimator::ColumnId::scale`]); zero blocks are left out.
    pub norms: Vec<(u16, f32)>,
}

impl JacobianSource {
    pub(crate) fn heap_bytes(&self) -> usize {
        allocated_bytes(size_of_val(&*self.frames))
            + allocated_bytes(size_of_val(&*self.chains))
            + allocated_bytes(size_of_val(&*self.clocks))
            + allocated_bytes(size_of_val(&*self.rates))
            + self.chains.iter().map(|chain| allocated_bytes(chain.dof() * size_of::<f64>())).sum::<usize>()
            + allocated_bytes(size_of_val(&*self.rejected))
            + allocated_bytes(size_of_val(&*self.rows))
            + allocated_bytes(size_of_val(&*self.columns))
            + allocated_bytes(size_of_val(&*self.norms))
            + self.exact.as_ref().map_or(0, |exact| allocated_bytes(exact.bytes()))
    }

    /// True if `parameters` are the parameters of the calibration columns.
    pub(crate) fn describes(&self, parameters: &[ParameterId]) -> bool {
        if let Some(exact) = &self.exact {
            return exact.linearized.1.parameters() == parameters;
        }
        let clocks: usize = self.clocks.iter().map(|clocks| clocks.count).sum();
        self.chains.iter().map(Chain::dof).sum::<usize>() + clocks == parameters.len()
    }

    /// States by slot for this number of joints; bias-corrected velocities and rates only if time offsets are
    /// estimated.
    pub(crate) fn frames(&self, joints: usize) -> Vec<FrameState> {
        if let Some(exact) = &self.exact {
            return exact.linearized.0.clone();
        }
        let mut rates = self.rates.chunks_exact(POSE + joints);
        let states = self.poses(joints).into_iter().map(|(world_from_imu, joints_rad)| {
            let rates: Vec<f64> = rates.next().unwrap_or_default().iter().map(|rate| f64::from(*rate)).collect();
            let three = |from: usize| rates.get(from..from + 3).map_or_else(Vector3::zeros, Vector3::from_column_slice);
            FrameState {
                navigation: NavigationState { world_from_imu, velocity_m_per_s: three(3), bias: ImuBias::default() },
                joints_rad,
                joint_motion: Vec::new(),
                gimbal_imu: None,
                rates: Arc::new(Rates {
                    gyroscope_rad_per_s: three(0),
                    joints_rad_per_s: rates.get(POSE..).unwrap_or_default().to_vec(),
                    profile: None,
                    image_times_s: Vec::new(),
                }),
            }
        });
        states.collect()
    }

    fn poses(&self, joints: usize) -> Vec<(RigidTransform, Vec<f64>)> {
        let unpacked = |numbers: &[f32]| {
            let number = |place: usize| f64::from(numbers[place]);
            let rotation = Quaternion::new(number(3), number(0), number(1), number(2));
            let position_m = Vector3::new(number(4), number(5), number(6));
            let pose = RigidTransform::new(UnitQuaternion::new_normalize(rotation), position_m);
            (pose, numbers[POSE_NUMBERS..].iter().map(|angle| f64::from(*angle)).collect())
        };
        self.frames.chunks_exact(POSE_NUMBERS + joints).map(unpacked).collect()
    }

    /// Rows of the packed Jacobian in their order; `numbers[slot]` is the frame of a slot.
    pub(crate) fn rows<'a>(&'a self, numbers: &'a [FrameId]) -> impl Iterator<Item = JacobianRow> + 'a {
        let mut begin = 0;
        self.rows.iter().filter_map(move |row| {
            let range = begin..begin + usize::from(row.count);
            begin = range.end;
            let factor = JacobianFactor::of(row.label, numbers)?;
            let norms = self.columns[range.clone()].iter().copied().zip(self.norms[range].iter().copied());
            Some(JacobianRow { factor, height: usize::from(row.height), norms: norms.collect() })
        })
    }
}

/// Number of values of a pose in `JacobianSource::frames`: quaternion and position.
const POSE_NUMBERS: usize = 7;

/// Indices and Frobenius norms of the nonzero column blocks of some rows, columns in units of their scales.
pub(crate) fn block_norms(rows: &DMatrix<f64>, columns: &[ColumnBlock], scales: &[f64]) -> Vec<(u16, f32)> {
    let squared = |block: &ColumnBlock| {
        let entries = |column: usize| rows.column(column).iter().map(|it| (it * scales[column]).powi(2)).sum::<f64>();
        (block.start..block.start + block.len).map(entries).sum::<f64>()
    };
    let squared = columns.iter().map(squared).enumerate().filter(|(_, squared)| *squared > 0.0);
    squared.map(|(number, squared)| (number as u16, squared.sqrt() as f32)).collect()
}
