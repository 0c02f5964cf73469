//! Data of a solved window from which the report reproduces the Jacobian of the step.

use super::setup::Setup;
use super::solve::SolvedWindow;
use super::window_state::WindowState;
use crate::estimator::factors::labelled_rows::{LabelledRows, stack};
use crate::estimator::factors::measurements::measurements;
use crate::estimator::report::jacobian_source::{ClockColumns, ExactSource, PackedRow, block_norms};
use crate::estimator::report::{FactorRows, JacobianFactor, JacobianSource};
use crate::estimator::state::calibrations::Calibrations;
use crate::estimator::state::columns::{FrameId, scales_of};
use crate::estimator::state::frame_state::FrameState;

impl WindowState {
    /// Source of the Jacobian at the final estimate, and the rows without a feature if they are
    /// requested.
    pub(crate) fn jacobian_source(&self, setup: &Setup, solved: &SolvedWindow) -> (JacobianSource, Vec<FactorRows>) {
        let problem = self.problem(setup, &solved.cameras);
        let estimate = &solved.solution.estimate;
        let layout = problem.layout;
        let linearized = problem.linearization_point(estimate);
        let (frames, calibration) = (&linearized.frames, &linearized.calibration);
        let numbers: Vec<FrameId> = self.frames.iter().map(|frame| FrameId(frame.index)).collect();
        let columns = layout.blocks(&self.calibration.parameters(), &numbers);
        let scales = scales_of(&columns);
        let order = layout.report_order();
        let mut packed = Vec::new();
        let mut norms: Vec<(u16, f32)> = Vec::new();
        let mut kept = Vec::new();
        let total = layout.total();
        let mut rows = LabelledRows::new(total);
        let point = problem.point(estimate, &linearized);
        measurements(&point, layout.frames, &mut rows);
        problem.priors(&point, &mut rows);
        for (label, rows) in rows.by_factor() {
            let rows = stack([&rows], order.iter().copied().chain([total]));
            let of_factor = block_norms(&rows, &columns, &scales);
            packed.push(PackedRow { label, height: rows.nrows() as u16, count: of_factor.len() as u16 });
            norms.extend(of_factor);
            let factor = JacobianFactor::of(label, &numbers).filter(|_| setup.config.options.keep_factor_rows);
            kept.extend(factor.map(|factor| FactorRows { factor, rows }));
        }
        let packed_frame = |state: &FrameState| {
            let pose = state.navigation.world_from_imu;
            let numbers = pose.rotation.coords.iter().chain(pose.translation_m.iter()).chain(&state.joints_rad);
            numbers.map(|number| *number as f32).collect::<Vec<f32>>()
        };
        let rejected = solved.checks.iter().zip(&estimate.landmarks).flat_map(|(checks, landmarks)| {
            checks.rejected.iter().zip(landmarks).map(|(rejected, landmark)| (*rejected, landmark.bearing))
        });
        let rejected = rejected.enumerate().filter(|(_, (rejected, _))| *rejected);
        let options = &setup.config.options;
        let clocked = |calibrations: &Calibrations, camera: usize| {
            let calibration = calibrations.of(camera);
            (calibration.dof().saturating_sub(calibration.chain().dof()), calibration.camera_shift_s())
        };
        let clocks: Vec<ClockColumns> = (0..calibration.cameras())
            .map(|camera| {
                let ((count, then), (_, now)) = (clocked(calibration, camera), clocked(&estimate.calibration, camera));
                ClockColumns { count, shifts_s: [then, now] }
            })
            .collect();
        let any = clocks.iter().any(|clocks| clocks.count > 0);
        let has_intrinsics = |camera| !calibration.of(camera).intrinsics_columns().is_empty();
        let is_mounted = |camera| calibration.of(camera).base().is_some();
        let needs_exact = |camera| has_intrinsics(camera) || is_mounted(camera);
        let exact = layout.moving_rows || calibration.imu().is_some() || (0..calibration.cameras()).any(needs_exact);
        let exact = exact.then(|| {
            Box::new(ExactSource {
                linearized: (frames.clone(), calibration.clone()),
                current: (estimate.frames.clone(), estimate.calibration.clone()),
            })
        });
        let rates = |state: &FrameState| state.motion().iter().map(|rate| *rate as f32).collect::<Vec<f32>>();
        let source = JacobianSource {
            rates: if any { frames.iter().flat_map(rates).collect() } else { Box::default() },
            clocks: if any { clocks.into() } else { Box::default() },
            frames: frames.iter().flat_map(packed_frame).collect(),
            exact,
            chains: (0..calibration.cameras()).map(|camera| calibration.of(camera).chain().clone()).collect(),
            calibrated: layout.calibration > 0,
            rejected: rejected.map(|(place, (_, bearing))| (place as u32, bearing.cast::<f32>().into())).collect(),
            rows: packed.into(),
            columns: norms.iter().map(|(column, _)| *column).collect(),
            norms: norms.iter().map(|(_, norm)| *norm).collect(),
            pixel_sigmas_px: (0..calibration.cameras())
                .map(|camera| self.visual_model(setup, camera).sigma_px)
                .collect(),
            landmark_model: options.landmark_model,
        };
        (source, kept)
    }
}
