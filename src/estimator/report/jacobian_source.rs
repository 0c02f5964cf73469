//! What a report keeps of the step's Jacobian, so that any of its blocks can be written out again.

use std::sync::Arc;

use nalgebra::{DMatrix, Quaternion, UnitQuaternion, Vector3};

use crate::estimator::state::frame_state::{FrameState, Rates};
use crate::estimator::state::layout::POSE;
use crate::estimator::{FactorKind, FrameId, ImuBias, NavigationState, allocated_bytes};
use crate::geometry::RigidTransform;
use crate::gimbal::Chain;
use crate::optimization::{LandmarkModel, RobustLoss};

/// Where the step's Jacobian was taken, and the blocks that a report could not write out again.
///
/// The rows of the features are by far the most: they follow from the rest of the report, these states and the bearings.
#[derive(Clone, Debug, PartialEq)]
pub struct JacobianSource {
    /// By slot, where derivatives are taken (first estimates): `world_from_imu` as quaternion x, y, z, w and position, then
    /// the joint angles; in single precision, which is far finer than what is drawn.
    pub(crate) frames: Box<[f32]>,
    /// The chains at which derivatives are taken, by camera.
    pub(crate) chains: Box<[Chain]>,
    /// By camera, the offsets of the clocks that are estimated; empty where none is.
    pub(crate) clocks: Box<[ClockColumns]>,
    /// By slot, where clocks are estimated: rates of the body's rotation and of its position, then those of the joints.
    pub(crate) rates: Box<[f32]>,
    /// Whether the calibration has columns.
    pub(crate) calibrated: bool,
    /// Places among the report's features of the rejected ones, which have no landmark there, and their unit directions in
    /// their anchors' cameras.
    pub(crate) rejected: Box<[(u32, [f32; 3])]>,
    pub(crate) rows: Box<[PackedRow]>,
    /// Of all packed rows, one after the other: numbers of blocks of columns, and the norms there.
    pub(crate) columns: Box<[u16]>,
    pub(crate) norms: Box<[f32]>,
    pub(crate) pixel_sigma_px: f64,
    pub(crate) loss: RobustLoss,
    pub(crate) landmark_model: LandmarkModel,
}

/// Offsets of clocks that are estimated with a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ClockColumns {
    /// How many: the camera's, then the encoders'.
    pub(crate) count: usize,
    /// The camera's where derivatives are taken, and as it is estimated, beyond what the rig says.
    pub(crate) shifts_s: [f64; 2],
}

/// Rows that are neither of features nor of encoders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PackedRow {
    pub(crate) kind: PackedKind,
    pub(crate) height: u16,
    /// How many of the norms are its own.
    pub(crate) count: u16,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum PackedKind {
    /// The IMU samples that end at this slot.
    Imu(u8),
    ZeroVelocity,
    CalibrationPrior,
    MarginalizationPrior,
}

impl PackedKind {
    /// What it stands for, with frames of these numbers.
    pub(crate) fn factor(self, numbers: &[FrameId]) -> Option<JacobianFactor> {
        Some(match self {
            Self::Imu(slot) => {
                let slot = usize::from(slot);
                let from = numbers.get(slot.checked_sub(1)?)?;
                JacobianFactor::Imu { from: *from, to: *numbers.get(slot)? }
            }
            Self::ZeroVelocity => JacobianFactor::ZeroVelocity,
            Self::CalibrationPrior => JacobianFactor::CalibrationPrior,
            Self::MarginalizationPrior => JacobianFactor::MarginalizationPrior,
        })
    }
}

/// The rows of a factor that is not a feature's.
#[derive(Clone, Debug, PartialEq)]
pub struct FactorRows {
    /// Whose they are.
    pub factor: JacobianFactor,
    /// By the columns of the step (calibration, joints, poses, velocities and biases), whitened; the residual last, at
    /// the final estimate.
    pub rows: DMatrix<f64>,
}

/// Where residuals come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum JacobianFactor {
    /// The reprojections of a feature, two rows a observation.
    Feature(crate::frontend::FeatureId),
    /// The IMU samples between two frames, by the frames' numbers.
    Imu {
        /// The earlier one.
        from: FrameId,
        /// The later one.
        to: FrameId,
    },
    /// The encoder readings of a frame.
    Encoder(FrameId),
    /// Zero-velocity updates.
    ZeroVelocity,
    /// The rig's prior on the calibration.
    CalibrationPrior,
    /// The marginalization prior, and what was known at the start.
    MarginalizationPrior,
}

impl JacobianFactor {
    /// Its kind.
    pub const fn kind(self) -> FactorKind {
        match self {
            Self::Feature(_) => FactorKind::Visual,
            Self::Imu { .. } => FactorKind::Imu,
            Self::Encoder(_) => FactorKind::Encoder,
            Self::ZeroVelocity => FactorKind::ZeroVelocity,
            Self::CalibrationPrior => FactorKind::CalibrationPrior,
            Self::MarginalizationPrior => FactorKind::MarginalizationPrior,
        }
    }
}

/// Rows of the Jacobian that belong together.
#[derive(Clone, Debug, PartialEq)]
pub struct JacobianRow {
    /// Where they come from.
    pub factor: JacobianFactor,
    /// How many they are.
    pub height: usize,
    /// Number of a block of columns and the Frobenius norm of the rows there, in standard deviations of the residuals by
    /// the column's scale (see [`crate::estimator::ColumnId::scale`]); blocks that are zero are left out.
    pub norms: Vec<(u16, f32)>,
}

impl JacobianSource {
    /// Bytes on the heap.
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
    }

    /// States by slot, for frames of so many joints; speeds and rates only where clocks are estimated, biases taken off.
    pub(crate) fn frames(&self, joints: usize) -> Vec<FrameState> {
        let mut rates = self.rates.chunks_exact(POSE + joints);
        let states = self.poses(joints).into_iter().map(|(world_from_imu, joints_rad)| {
            let rates: Vec<f64> = rates.next().unwrap_or_default().iter().map(|rate| f64::from(*rate)).collect();
            let three = |from: usize| rates.get(from..from + 3).map_or_else(Vector3::zeros, Vector3::from_column_slice);
            FrameState {
                navigation: NavigationState { world_from_imu, velocity_m_per_s: three(3), bias: ImuBias::default() },
                joints_rad,
                rates: Arc::new(Rates {
                    gyroscope_rad_per_s: three(0),
                    joints_rad_per_s: rates.get(POSE..).unwrap_or_default().to_vec(),
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

    /// The packed rows, for frames of these numbers.
    pub(crate) fn rows<'a>(&'a self, numbers: &'a [FrameId]) -> impl Iterator<Item = JacobianRow> + 'a {
        let mut begin = 0;
        self.rows.iter().filter_map(move |row| {
            let range = begin..begin + usize::from(row.count);
            begin = range.end;
            let factor = row.kind.factor(numbers)?;
            let norms = self.columns[range.clone()].iter().copied().zip(self.norms[range].iter().copied());
            Some(JacobianRow { factor, height: usize::from(row.height), norms: norms.collect() })
        })
    }
}

/// Numbers of a pose among those of a frame.
const POSE_NUMBERS: usize = 7;
