//! Calibration columns added to a running window, and scores of those that would explain its residuals.

use std::sync::Arc;

use nalgebra::DVector;

use super::setup::Setup;
use super::window_state::WindowState;
use crate::estimator::state::frame;
use crate::estimator::state::frame_state::{FrameState, Rates};
use crate::geometry::seconds_from_ns;
use crate::gimbal::ParameterId;
use crate::optimization::{Cholesky, DIAGONAL_FLOOR};
use crate::sensors::ImuSample;

/// Duration of the motion after a stamp that frames of the window take from the IMU samples before the next frame, in
/// seconds.
const MOTION_AFTER_S: f64 = 0.06;

/// Fixed parameter with its estimate to first order if it were free, from one window or several.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SuspectedParameter {
    pub(crate) parameter: ParameterId,
    /// Change from the rig's value.
    pub(crate) change: f64,
    /// Inverse variance of `change`.
    pub(crate) information: f64,
}

impl SuspectedParameter {
    /// Decrease of χ² if the parameter were free.
    pub(crate) fn chi2(&self) -> f64 {
        self.change * self.change * self.information
    }

    /// Combines the estimate with the estimate of another window for the same parameter.
    pub(crate) fn add(&mut self, other: &Self) {
        let information = self.information + other.information;
        self.change = (self.change * self.information + other.change * other.information) / information;
        self.information = information;
    }
}

impl WindowState {
    /// Adds the calibration columns that the setup estimates and the window does not have yet, at the rig's values;
    /// extends frames and prior accordingly.
    pub(crate) fn add_columns(&mut self, setup: &Setup) {
        let before = self.calibration.parameters();
        let old = frame::layout(&self.frames, self.calibration.dof());
        self.calibration = self.calibration.with_columns_of(&setup.given_calibration());
        let profiles: Vec<Vec<ImuSample>> = (0..self.frames.len()).map(|slot| self.samples_after(slot)).collect();
        for (frame, after) in self.frames.iter_mut().zip(&profiles) {
            let bias = frame.state.navigation.bias;
            let profile = setup.motion_profile([frame.motion.samples(), after], &frame.state.rates.image_times_s, bias);
            let motion = setup.initial_joint_motion(frame.encoder.as_ref(), frame.state.joints_rad.len());
            let changed = |state: &mut FrameState| {
                if state.joint_motion.is_empty() {
                    state.joint_motion.clone_from(&motion);
                }
                if state.rates.profile.is_none() {
                    state.rates = Arc::new(Rates { profile: profile.clone(), ..(*state.rates).clone() });
                }
            };
            changed(&mut frame.state);
            frame.first_estimate.iter_mut().for_each(changed);
        }
        let new = frame::layout(&self.frames, self.calibration.dof());
        let after = self.calibration.parameters();
        let places: Vec<usize> =
            before.iter().filter_map(|known| after.iter().position(|parameter| parameter == known)).collect();
        if let Some(prior) = &mut self.prior {
            prior.move_columns(&old, &new, &places);
        }
    }

    /// IMU samples from the stamp of a frame on (the first one at the stamp), as far as the next frame has them.
    fn samples_after(&self, slot: usize) -> Vec<ImuSample> {
        let Some(next) = self.frames.get(slot + 1) else { return Vec::new() };
        let stamp_ns = next.motion.samples().first().map_or(0, |first| first.stamp_ns);
        let near = |sample: &&ImuSample| seconds_from_ns(sample.stamp_ns - stamp_ns) <= MOTION_AFTER_S;
        next.motion.samples().iter().take_while(near).copied().collect()
    }

    /// Scores of the time offsets, readout times and camera intrinsics that are not estimated: the decrease of the
    /// window's χ² when each is freed alone in addition to the estimated unknowns. Empty with a fixed calibration.
    pub(crate) fn sensor_scores(&self, setup: &Setup) -> Vec<SuspectedParameter> {
        if !setup.config.calibrate {
            return Vec::new();
        }
        let mut wider = setup.clone();
        (wider.config.estimate_timeshift, wider.config.estimate_readout) = (true, true);
        (wider.config.estimate_intrinsics, wider.config.estimate_gimbal_imu) = (true, true);
        let mut window = self.clone();
        window.add_columns(&wider);
        let active = window.active_tracks();
        let landmarks = active.iter().map(|active| active.landmarks.clone()).collect();
        let problem = window.problem(&wider, &active);
        let equations = problem.linearize(&window.estimate(landmarks));
        let (hessian, gradient) = equations.reduced(&problem.layout, &equations.eliminate(0.0));
        let first = problem.layout.calibration().start;
        let known = self.calibration.parameters();
        let parameters = window.calibration.parameters();
        let frozen = window.calibration.frozen_columns();
        let estimated = |column: &usize| {
            column.checked_sub(first).is_none_or(|place| known.contains(&parameters[place]) && !frozen.contains(&place))
        };
        let mut order = problem.layout.elimination_order();
        order.retain(estimated);
        let Some(factor) = Cholesky::ordered(&hessian, order.clone(), |diagonal| diagonal + DIAGONAL_FLOOR) else {
            return Vec::new();
        };
        let step = -factor.solve(&gradient);
        let tried = parameters.iter().enumerate().filter(|(_, parameter)| !known.contains(parameter));
        let score = |(place, parameter): (usize, &ParameterId)| {
            let column = first + place;
            let mut coupling = DVector::zeros(problem.layout.total());
            for row in &order {
                // The lower triangle is stored.
                coupling[*row] = hessian[(column.max(*row), column.min(*row))];
            }
            let information = hessian[(column, column)] + DIAGONAL_FLOOR - coupling.dot(&factor.solve(&coupling));
            let change = -(gradient[column] + coupling.dot(&step)) / information;
            (information > 0.0).then_some(SuspectedParameter { parameter: *parameter, change, information })
        };
        tried.filter_map(score).collect()
    }
}
