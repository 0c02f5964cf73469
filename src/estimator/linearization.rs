//! The linearization of a solved window, for the analysis of its observability and for looking at.

use nalgebra::DVector;

use super::camera_pose::{self, CameraMaps};
use super::estimator::Estimator;
use super::layout::Layout;
use super::rows::stack_columns;
use super::tracking::SolvedWindow;
use super::{ColumnBlock, ColumnGroup, Linearization};

impl Estimator {
    /// The linearization at the final estimate: the measurements' rows, and those of the priors.
    pub(super) fn linearization(&self, solved: &SolvedWindow) -> Linearization {
        let problem = self.problem(&solved.cameras);
        let estimate = &solved.solution.estimate;
        let layout = problem.layout;
        let frames = problem.linearization_frames(estimate);
        let calibration = problem.linearization_calibration(&estimate.calibration);
        let mut measured = Vec::new();
        let mut norms = Vec::new();
        for camera in 0..problem.cameras.len() {
            let maps = CameraMaps::new(&frames, calibration.of(camera));
            let poses = camera_pose::by_slot(&frames, calibration.of(camera));
            let projected = problem.projected_rows(camera, estimate, &poses);
            measured.push(problem.carried_rows(camera, &projected, &maps));
            let squared = projected.squared_column_norms(&maps.calibration);
            norms.extend(squared.iter().map(|squared| squared.max(0.0).sqrt()));
        }
        measured.extend((1..layout.frames).map(|slot| problem.inertial_rows_at(slot, estimate, &frames)));
        measured.extend((0..layout.frames).map(|slot| problem.encoder_rows(slot, estimate)));
        let rest: Vec<_> = problem.rest_terms(&estimate.frames).collect();
        measured.push(problem.rest_rows(&rest));
        let priors = [problem.calibration_prior_rows(estimate), problem.prior_rows(estimate)];
        let order = column_order(&layout);
        Linearization {
            columns: self.column_blocks(&layout),
            jacobian: stack_columns(&measured, order.iter().copied()),
            prior_jacobian: stack_columns(&priors, order.iter().copied()),
            calibration_column_norms: DVector::from_vec(norms),
        }
    }

    fn column_blocks(&self, layout: &Layout) -> Vec<ColumnBlock> {
        let mut blocks = Vec::new();
        let mut start = 0;
        let mut push = |group: ColumnGroup, name: String, len: usize| {
            if len > 0 {
                blocks.push(ColumnBlock { group, name, start, len });
                start += len;
            }
        };
        if layout.calibration > 0 {
            for name in self.calibration_names() {
                push(ColumnGroup::Calibration, name, 1);
            }
        }
        for (group, kind, len) in [
            (ColumnGroup::Joints, "joints", layout.joints),
            (ColumnGroup::Pose, "pose", super::layout::POSE),
            (ColumnGroup::SpeedBias, "speed-bias", super::layout::SPEED_BIAS),
        ] {
            for frame in &self.frames {
                push(group, format!("{kind} {}", frame.index), len);
            }
        }
        blocks
    }
}

/// Columns of the layout in the order of the report: calibration, joints, poses, speeds and biases.
fn column_order(layout: &Layout) -> Vec<usize> {
    let mut order: Vec<usize> = layout.calibration().collect();
    order.extend((0..layout.frames).flat_map(|slot| layout.joints(slot)));
    order.extend((0..layout.frames).flat_map(|slot| layout.pose(slot)));
    order.extend((0..layout.frames).flat_map(|slot| layout.speed_bias(slot)));
    order
}
