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
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::frame::InformedMotion;
use crate::estimator::state::gimbal_imu_mount::GimbalImuMount;
use crate::estimator::state::layout::{POSE, VELOCITY_BIAS};
use crate::estimator::state::navigation::{Matrix15, NavigationState, Vector15};

/// States of the IMU on the gimbal by slot, with their derivatives.
#[derive(Clone, Debug)]
pub(crate) struct GimbalImuStates {
    mount: GimbalImuMount,
    current: Vec<NavigationState>,
    /// Mount and states at the linearization point with the derivatives of their poses, by frame and by calibration;
    /// `None` without derivatives.
    linearized: Option<Linearized>,
}

#[derive(Clone, Debug)]
struct Linearized {
    mount: GimbalImuMount,
    states: Vec<(NavigationState, DMatrix<f64>, DMatrix<f64>)>,
}

impl GimbalImuStates {
    /// States of the frames before `slots`; `None` without such an IMU.
    pub(crate) fn new(point: &Point<'_>, slots: usize, derivatives: bool) -> Option<Self> {
        let given = point.camera_from_gimbal_imu?;
        let calibration = point.at.calibration.of(MAIN);
        let mount = GimbalImuMount::new(given, calibration);
        let current =
            point.at.frames[..slots].iter().map(|frame| mount.state(frame, calibration)).collect::<Option<_>>()?;
        let linearized = derivatives.then(|| {
            let first = point.calibration_first_estimates.then(|| calibration.at_first_estimate());
            let calibration = first.as_ref().unwrap_or(calibration);
            let mount = GimbalImuMount::new(given, calibration);
            let states = point.linearized[..slots].iter().map(|frame| {
                let (by_frame, by_calibration) = mount.maps(frame, calibration);
                Some((mount.state(frame, calibration)?, by_frame, by_calibration))
            });
            Some(Linearized { states: states.collect::<Option<_>>()?, mount })
        });
        Some(Self { mount, current, linearized: linearized.flatten() })
    }
}

/// IMU factor of the gimbal's IMU between two frames: 15 rows `[φ, p, v, b_g, b_a]`.
#[derive(Clone, Debug)]
pub(crate) struct GimbalImuFactor<'a> {
    /// Slot of the later frame.
    slot: usize,
    motion: &'a InformedMotion,
    information: &'a Matrix15,
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
    by_frames: Vec<(DMatrix<f64>, DMatrix<f64>)>,
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
            information: motion.information()?,
            gravity_in_world: point.gravity_in_world,
            states,
            columns: [slot - 1, slot].map(|slot| (layout.pose(slot).start, layout.gimbal_imu(slot).start)),
            calibration: layout.calibration().start + point.at.calibration.columns(MAIN).start,
        })
    }

    /// States at the times of the measurements that bound the interval.
    fn bounds(&self, mount: &GimbalImuMount, [from, to]: [&NavigationState; 2]) -> Option<[NavigationState; 2]> {
        let samples = self.motion.samples();
        let (first, last) = (samples.first()?, samples.last()?);
        Some([mount.shifted(from, first, self.gravity_in_world), mount.shifted(to, last, self.gravity_in_world)])
    }

    /// Derivatives at the linearization point.
    fn derivatives(&self, linearized: &Linearized) -> Option<Derivatives> {
        let ends = [&linearized.states[self.slot - 1], &linearized.states[self.slot]];
        let [from, to] = self.bounds(&linearized.mount, ends.map(|(state, ..)| state))?;
        let [by_from, by_to, _] = jacobians(self.motion, &from, &to, self.gravity_in_world, None);
        let samples = self.motion.samples();
        let mut by_calibration = DMatrix::zeros(15, ends[0].2.ncols());
        let mut by_shift = Vector15::zeros();
        let mut by_frames = Vec::with_capacity(2);
        let ends_of_samples = [samples.first()?, samples.last()?];
        for (((state, by_frame, of_calibration), sample), by_bound) in
            ends.into_iter().zip(ends_of_samples).zip([by_from, by_to])
        {
            let (by_state, by_time) = linearized.mount.shift_maps(state, sample, self.gravity_in_world);
            let by_bound = self.information * by_bound;
            by_shift += by_bound * by_time;
            let by_state = by_bound * by_state;
            let (by_pose, by_own) = by_state.as_slice().split_at(15 * POSE);
            let by_pose = DMatrix::from_column_slice(15, POSE, by_pose);
            by_calibration += &by_pose * of_calibration;
            by_frames.push((by_pose * by_frame, DMatrix::from_column_slice(15, VELOCITY_BIAS, by_own)));
        }
        if let Some(column) = linearized.mount.shift_column {
            by_calibration.set_column(column, &by_shift);
        }
        Some(Derivatives { by_frames, by_calibration })
    }
}

impl Factor for GimbalImuFactor<'_> {
    fn label(&self) -> FactorLabel {
        FactorLabel::GimbalImu(self.slot as u16)
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let current = [&self.states.current[self.slot - 1], &self.states.current[self.slot]];
        let Some([from, to]) = self.bounds(&self.states.mount, current) else { return };
        let residual = self.information * residual(self.motion, &from, &to, self.gravity_in_world, None);
        let mut rows = WhitenedRows { residual: residual.as_slice(), blocks: &[], products: None };
        if !S::DERIVATIVES {
            return sink.add(self.label(), &rows);
        }
        let derivatives = self.states.linearized.as_ref().and_then(|linearized| self.derivatives(linearized));
        let Some(Derivatives { by_frames, by_calibration }) = derivatives else { return };
        let mut blocks = Vec::with_capacity(5);
        for ((pose, own), (by_pose, by_own)) in self.columns.into_iter().zip(&by_frames) {
            blocks.push(JacobianBlock { start: pose, entries: by_pose.as_slice() });
            blocks.push(JacobianBlock { start: own, entries: by_own.as_slice() });
        }
        if by_calibration.ncols() > 0 {
            blocks.push(JacobianBlock { start: self.calibration, entries: by_calibration.as_slice() });
        }
        rows.blocks = &blocks;
        sink.add(self.label(), &rows);
    }
}
