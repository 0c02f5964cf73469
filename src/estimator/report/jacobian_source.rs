//! Stored data of a report from which any block of the step's Jacobian can be reproduced.

use std::sync::Arc;

use nalgebra::{DMatrix, Quaternion, UnitQuaternion, Vector3};

use crate::estimator::factors::FactorKind;
use crate::estimator::state::allocation::allocated_bytes;
use crate::estimator::state::calibrations::Calibrations;
use crate::estimator::state::columns::FrameId;
use crate::estimator::state::frame_state::{FrameState, Rates};
use crate::estimator::state::layout::POSE;
use crate::estimator::state::navigation::{ImuBias, NavigationState};
use crate::geometry::RigidTransform;
use crate::gimbal::{Chain, ParameterId};
use crate::optimization::{LandmarkModel, RobustLoss};

/// Linearization points of the step's Jacobian, and blocks that cannot be reproduced from the report.
///
/// The rows of features are the largest part: they follow from the rest of the report, these states and the bearings.
#[derive(Clone, Debug, PartialEq)]
pub struct JacobianSource {
    /// Linearization points by slot (first estimates): `world_from_imu` as quaternion x, y, z, w and position, then
    /// the joint angles; in single precision, much finer than the display.
    pub(crate) frames: Box<[f32]>,
    /// Linearization points of the chains, by camera.
    pub(crate) chains: Box<[Chain]>,
    /// Estimated time offsets by camera; empty without any.
    pub(crate) clocks: Box<[ClockColumns]>,
    /// By slot, with estimated time offsets: rates of the body's rotation and position, then of the joints.
    pub(crate) rates: Box<[f32]>,
    /// States and calibrations where rows of the images have poses of their own or intrinsics of a camera or of the IMU are
    /// estimated, which the fields above do not describe.
    pub(crate) exact: Option<Box<ExactSource>>,
    /// Whether the calibration has columns.
    pub(crate) calibrated: bool,
    /// Indices of the rejected features in the report, which have no landmark there, and their unit bearings in
    /// their anchors' cameras.
    pub(crate) rejected: Box<[(u32, [f32; 3])]>,
    pub(crate) rows: Box<[PackedRow]>,
    /// Norms of all packed rows: indices of column blocks, and the norms there.
    pub(crate) columns: Box<[u16]>,
    pub(crate) norms: Box<[f32]>,
    pub(crate) pixel_sigma_px: f64,
    pub(crate) loss: RobustLoss,
    pub(crate) landmark_model: LandmarkModel,
}

/// States by slot with the calibrations, in full precision.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ExactSource {
    /// Linearization point.
    pub(crate) linearized: (Vec<FrameState>, Calibrations),
    /// Final estimate.
    pub(crate) current: (Vec<FrameState>, Calibrations),
}

impl ExactSource {
    /// Bytes of the states; the calibrations share their priors with the estimator.
    fn bytes(&self) -> usize {
        let states = || self.linearized.0.iter().chain(&self.current.0);
        size_of::<Self>() + states().map(|state| size_of::<FrameState>() + 8 * state.joint_block()).sum::<usize>()
    }
}

/// Time offsets that are estimated with a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ClockColumns {
    /// Number of time offsets: the camera's, then the encoders'.
    pub(crate) count: usize,
    /// Camera time offset at the linearization point, and as estimated, relative to the rig.
    pub(crate) shifts_s: [f64; 2],
}

/// Rows of neither features nor encoders.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PackedRow {
    pub(crate) kind: PackedKind,
    pub(crate) height: u16,
    /// Number of its norms.
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
    /// Factor of the rows, with these frame numbers.
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

/// Rows of a factor without a feature.
#[derive(Clone, Debug, PartialEq)]
pub struct FactorRows {
    /// Factor of the rows.
    pub factor: JacobianFactor,
    /// By the columns of the step (calibration, joints, poses, velocities and biases), whitened; the residual last, at
    /// the final estimate.
    pub rows: DMatrix<f64>,
}

/// Where residuals come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum JacobianFactor {
    /// The reprojections of a feature, two rows per observation.
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
            + self.exact.as_ref().map_or(0, |exact| allocated_bytes(exact.bytes()))
    }

    /// Whether these are the parameters of its calibration columns.
    pub(crate) fn describes(&self, parameters: &[ParameterId]) -> bool {
        if let Some(exact) = &self.exact {
            return exact.linearized.1.parameters() == parameters;
        }
        let clocks: usize = self.clocks.iter().map(|clocks| clocks.count).sum();
        self.chains.iter().map(Chain::dof).sum::<usize>() + clocks == parameters.len()
    }

    /// States by slot, for frames with this number of joints; velocities and rates only with estimated time
    /// offsets, bias-corrected.
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
                rates: Arc::new(Rates {
                    gyroscope_rad_per_s: three(0),
                    joints_rad_per_s: rates.get(POSE..).unwrap_or_default().to_vec(),
                    profile: None,
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
