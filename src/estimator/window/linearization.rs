//! Linearization of a solved window, for the observability analysis and display.

use nalgebra::{DMatrix, DVector};

use super::window_state::WindowState;
use crate::estimator::factors::projection::NewestRows;
use crate::estimator::report::linearization::{column_blocks, column_order};
use crate::estimator::setup::Setup;
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::state::camera_pose::CameraMaps;
use crate::estimator::window::information_gain::CameraInformation;
use crate::estimator::window::problem::{Estimate, Problem};
use crate::estimator::window::rows::stack_columns;
use crate::estimator::window::solve::SolvedWindow;
use crate::estimator::{FrameId, InformationGain, Linearization};
use crate::gimbal::ParameterId;

impl WindowState {
    /// Linearization at the final estimate (rows of the measurements and of the priors), and the
    /// information gain of the newest image.
    pub(crate) fn linearization(
        &self,
        setup: &Setup,
        solved: &SolvedWindow,
    ) -> (Linearization, Option<InformationGain>) {
        let problem = self.problem(setup, &solved.cameras);
        let frames: Vec<FrameId> = self.frames.iter().map(|frame| FrameId(frame.index)).collect();
        let parameters = self.calibration.parameters();
        let estimate = &solved.solution.estimate;
        // An image that does not become a keyframe is dropped: it adds no information.
        if !self.frames.newest().keyframe {
            let linearization = problem.linearization(estimate, &parameters, &frames, None);
            return (linearization, problem.no_information_gain(estimate));
        }
        let mut cameras = Vec::new();
        let linearization = problem.linearization(estimate, &parameters, &frames, Some(&mut cameras));
        (linearization, problem.information_gain(estimate, &cameras))
    }
}

impl Problem<'_> {
    /// Linearizes the complete window at an estimate; `parameters` are those of the calibration columns, free or
    /// fixed. The information of each camera's observations is appended to `seen`, if requested.
    pub(crate) fn linearization(
        &self,
        estimate: &Estimate,
        parameters: &[ParameterId],
        numbers: &[FrameId],
        mut seen: Option<&mut Vec<CameraInformation>>,
    ) -> Linearization {
        let layout = self.layout;
        let frames = self.linearization_frames(estimate);
        let calibration = self.linearization_calibration(&estimate.calibration);
        let mut measured = Vec::new();
        let mut norms = Vec::new();
        for camera in 0..self.cameras.len() {
            let maps = CameraMaps::new(&frames, calibration.of(camera));
            let linearized = self.view(camera, &frames, &calibration);
            let apart = if seen.is_some() { NewestRows::Apart } else { NewestRows::Among };
            let projected = self.projected_rows(camera, estimate, &linearized, apart);
            measured.push(self.carried_rows(camera, &projected, &maps));
            let squared = projected.squared_column_norms(&maps.calibration);
            norms.extend(squared.iter().map(|squared| squared.max(0.0).sqrt()));
            if let Some(seen) = &mut seen {
                seen.push(CameraInformation::new(&projected, maps));
            }
        }
        let imu: Vec<DMatrix<f64>> = (1..layout.frames).map(|slot| self.imu_rows_at(slot, estimate, &frames)).collect();
        norms.extend(
            self.imu_columns(&estimate.calibration)
                .map(|column| imu.iter().map(|rows| rows.column(column).norm_squared()).sum::<f64>().sqrt()),
        );
        measured.extend(imu);
        measured.extend((0..layout.frames).map(|slot| self.encoder_rows(slot, estimate)));
        let stationary: Vec<_> = self.zero_velocity_terms(&estimate.frames).collect();
        measured.push(self.zero_velocity_rows(&stationary));
        let priors = [self.calibration_prior_rows(estimate), self.prior_rows(estimate)];
        let frozen = estimate.calibration.frozen_columns();
        let is_fixed = |column: usize| frozen.contains(&column);
        let first = layout.calibration().start;
        let order: Vec<usize> =
            column_order(&layout).into_iter().filter(|column| *column < first || !is_fixed(column - first)).collect();
        let of = |fixed_parameters: bool| {
            let parameters =
                parameters.iter().enumerate().filter(move |(column, _)| is_fixed(*column) == fixed_parameters);
            parameters.map(|(_, parameter)| *parameter).collect::<Vec<_>>()
        };
        let free = |column: &usize| !is_fixed(*column);
        let norms: Vec<f64> = (0..norms.len()).filter(free).map(|column| norms[column]).collect();
        Linearization {
            columns: column_blocks(&layout, &of(false), numbers),
            fixed_parameters: of(true),
            jacobian: stack_columns(&measured, order.iter().copied()),
            prior_jacobian: stack_columns(&priors, order.iter().copied()),
            rig_prior_rows: priors[0].nrows(),
            calibration_column_norms: DVector::from_vec(norms),
            chain: calibration.of(MAIN).chain().clone(),
        }
    }
}
