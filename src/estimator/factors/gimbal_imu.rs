//! Samples of the IMU on the gimbal between two frames.
//!
//! The IMU moves with the camera, so its pose is `T_W1 = T_WI · T_IC(θ, chain) · T_C1`, a function of vehicle pose,
//! joint angles and calibration; its velocity and biases are unknowns of each frame. The residual is the IMU term of
//! Eq. 8 for this frame, by the preintegration of Forster et al. (TRO 2017); derivatives by its pose are carried to the
//! unknowns by the chain (Eqs. 13–17). The velocity is not tied to the vehicle's: the relation
//! `v_1 = v + R_WI (ω × l) + R_WI ∂t_IC/∂θ θ̇` would add nothing about the attitude of the camera, and about its
//! position only what two poses a frame apart have already.

use nalgebra::{DMatrix, Vector3};

use super::factor::{Factor, JacobianBlock, Point, Sink, WhitenedRows};
use super::imu::{jacobians, residual};
use super::kind::FactorLabel;
use crate::estimator::state::calibration::Calibration;
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::frame::InformedMotion;
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::gimbal_imu::GimbalImuMount;
use crate::estimator::state::gimbal_imu_noise::AxisSquares;
use crate::estimator::state::layout::{POSE, VELOCITY_BIAS};
use crate::estimator::state::navigation::{Matrix15, NavigationState, Vector15};
use crate::sensors::ImuSample;

/// States of the IMU on the gimbal by slot, with their derivatives.
#[derive(Clone, Debug)]
pub(crate) struct GimbalImuStates {
    current: MountedStates,
    /// At the linearization point; `None` for sinks without derivatives.
    linearized: Option<(MountedStates, Vec<PoseMaps>)>,
}

/// Derivatives of the IMU's pose by the frame's pose and joints (6 × (6 + N)), and by the calibration (6 × columns).
type PoseMaps = (DMatrix<f64>, DMatrix<f64>);

#[derive(Clone, Debug)]
struct MountedStates {
    mount: GimbalImuMount,
    states: Vec<NavigationState>,
}

impl MountedStates {
    fn new(frames: &[FrameState], calibration: &Calibration) -> Option<Self> {
        let mount = GimbalImuMount::new(calibration)?;
        let states = frames.iter().map(|frame| mount.state(frame, calibration)).collect::<Option<_>>()?;
        Some(Self { mount, states })
    }
}

impl GimbalImuStates {
    /// States of the frames before `slots`; `None` without such an IMU.
    pub(crate) fn new(point: &Point<'_>, slots: usize, derivatives: bool) -> Option<Self> {
        let current = MountedStates::new(&point.at.frames[..slots], point.at.calibration.of(MAIN))?;
        let linearized = if derivatives {
            let (frames, calibration) = (&point.linearized.frames[..slots], point.linearized.calibration.of(MAIN));
            let at = MountedStates::new(frames, calibration)?;
            let maps = frames.iter().map(|frame| at.mount.maps(frame, calibration)).collect();
            Some((at, maps))
        } else {
            None
        };
        Some(Self { current, linearized })
    }
}

/// IMU factor of the gimbal's IMU between two frames: 15 rows `[φ, p, v, b_g, b_a]`.
#[derive(Clone, Debug)]
pub(crate) struct GimbalImuFactor<'a> {
    /// Slot of the later frame.
    slot: usize,
    motion: &'a InformedMotion,
    /// First and last sample of the interval.
    ends: [&'a ImuSample; 2],
    /// Square-root information with the measured noise.
    information: Matrix15,
    gravity_in_world: &'a Vector3<f64>,
    states: &'a GimbalImuStates,
    /// First columns of pose and joints, and of velocity and biases, of both frames.
    columns: [(usize, usize); 2],
    /// First column of the camera's calibration.
    calibration: usize,
}

/// Whitened derivatives of the rows.
struct Derivatives {
    /// By pose and joints (15 × (6 + N)) and by velocity and biases (15 × 9) of the earlier and of the later frame.
    by_frames: [(DMatrix<f64>, DMatrix<f64>); 2],
    /// By the camera's calibration (15 × columns).
    by_calibration: DMatrix<f64>,
}

impl<'a> GimbalImuFactor<'a> {
    /// Factor that ends at `slot`, `None` without samples.
    pub(crate) fn of(point: &Point<'a>, states: &'a GimbalImuStates, slot: usize) -> Option<Self> {
        let motion = point.frames[slot].gimbal_motion.as_ref()?;
        let layout = &point.layout;
        Some(Self {
            slot,
            motion,
            ends: [motion.samples().first()?, motion.samples().last()?],
            information: point.gimbal_imu_noise.scaled(motion.information()?),
            gravity_in_world: point.gravity_in_world,
            states,
            columns: [slot - 1, slot].map(|slot| (layout.pose(slot).start, layout.gimbal_imu(slot).start)),
            calibration: layout.calibration().start + point.at.calibration.columns(MAIN).start,
        })
    }

    /// Squared residuals by axis of the frames before `slots`, in variances of the rig: their mean, or the square of their
    /// sum per interval if that is larger, as with errors that last longer than an interval. `None` without samples.
    pub(crate) fn axis_squares(point: &Point<'_>, slots: usize) -> Option<AxisSquares> {
        let states = GimbalImuStates::new(point, slots, false)?;
        let (mut sums, mut squares) = (Vector15::zeros(), Vector15::zeros());
        let mut count = 0;
        for factor in (1..slots).filter_map(|slot| GimbalImuFactor::of(point, &states, slot)) {
            let whitened = factor.motion.information()? * factor.residual();
            sums += whitened;
            squares += whitened.component_mul(&whitened);
            count += 1;
        }
        let variances = squares.zip_map(&sums, |square, sum: f64| square.max(sum * sum)) / f64::from(count);
        let axes = |row: usize| variances.fixed_rows::<3>(row).into_owned();
        (count > 0).then(|| [axes(0), axes(3).sup(&axes(6))])
    }

    /// States at the times of the measurements that bound the interval.
    fn bounds(&self, at: &MountedStates) -> [NavigationState; 2] {
        [0, 1].map(|end| at.mount.shifted(&at.states[self.slot - 1 + end], self.ends[end], self.gravity_in_world))
    }

    /// Residual at the current values, not whitened.
    fn residual(&self) -> Vector15 {
        let [from, to] = self.bounds(&self.states.current);
        residual(self.motion, &from, &to, self.gravity_in_world, None)
    }

    /// Derivatives at the linearization point: those by the pose of the IMU, carried on by the chain.
    fn derivatives(&self, at: &MountedStates, maps: &[PoseMaps]) -> Derivatives {
        let [from, to] = self.bounds(at);
        let [by_from, by_to, _] = jacobians(self.motion, &from, &to, self.gravity_in_world, None);
        let by_bounds = [by_from, by_to];
        let mut by_calibration = DMatrix::zeros(15, maps[self.slot].1.ncols());
        let mut by_shift = Vector15::zeros();
        let by_frames = [0, 1].map(|end| {
            let slot = self.slot - 1 + end;
            let (by_frame, of_calibration) = &maps[slot];
            let (by_state, by_time) = at.mount.shift_maps(&at.states[slot], self.ends[end], self.gravity_in_world);
            let by_bound = self.information * by_bounds[end];
            by_shift += by_bound * by_time;
            let by_state = by_bound * by_state;
            let (by_pose, by_own) = by_state.as_slice().split_at(15 * POSE);
            let by_pose = DMatrix::from_column_slice(15, POSE, by_pose);
            by_calibration += &by_pose * of_calibration;
            (by_pose * by_frame, DMatrix::from_column_slice(15, VELOCITY_BIAS, by_own))
        });
        if let Some(column) = at.mount.shift_column {
            by_calibration.set_column(column, &by_shift);
        }
        Derivatives { by_frames, by_calibration }
    }

    /// Blocks of the derivatives in the columns of the layout.
    fn blocks<'d>(&self, derivatives: &'d Derivatives) -> Vec<JacobianBlock<'d>> {
        let by_frames = self.columns.iter().zip(&derivatives.by_frames);
        let by_frames = by_frames.flat_map(|(columns, by)| [(columns.0, &by.0), (columns.1, &by.1)]);
        let by_calibration = Some((self.calibration, &derivatives.by_calibration)).filter(|(_, it)| it.ncols() > 0);
        let block = |(start, by): (usize, &'d DMatrix<f64>)| JacobianBlock { start, entries: by.as_slice() };
        by_frames.chain(by_calibration).map(block).collect()
    }
}

impl Factor for GimbalImuFactor<'_> {
    fn label(&self) -> FactorLabel {
        FactorLabel::GimbalImu(self.slot as u16)
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let residual = self.information * self.residual();
        let derivatives = self.states.linearized.as_ref().map(|(at, maps)| self.derivatives(at, maps));
        let blocks = derivatives.as_ref().map_or_else(Vec::new, |derivatives| self.blocks(derivatives));
        sink.add(self.label(), &WhitenedRows { residual: residual.as_slice(), blocks: &blocks, products: None });
    }
}
