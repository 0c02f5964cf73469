//! Whitened rows of a window with sensor columns.

use nalgebra::{DMatrix, DVector, Vector3};

use super::propagation::{Change, ReadoutChanges};
use super::window::{SensorObservation, SensorState, SensorWindow};
use crate::estimator::factors::encoder::EncoderFactor;
use crate::estimator::factors::factor::{NavigationColumns, Sink};
use crate::estimator::factors::imu::ImuFactor;
use crate::estimator::factors::labelled_rows::{LabelledRows, stack};
use crate::estimator::state::calibrations::MAIN;
use crate::estimator::{FrameId, JointKnowledge, Linearization, PoseKnowledge};
use crate::geometry::dense;
use crate::observability::laboratory::PIXEL_SIGMA_PX;
use crate::sensors::{JointAngles, JointMotionFit};

/// A pivot below this ratio of a landmark's columns marks an unobservable coordinate of the landmark.
const DEPENDENT: f64 = 1e-11;
/// Rows `[φ, p, v]` of the IMU factor, before the rows of the biases.
const MOTION_ROWS: usize = 9;

/// Rows of one landmark or of one other factor.
#[derive(Debug)]
pub(super) struct SensorRows {
    /// `[columns of the layout | residual]`.
    pub(super) rows: DMatrix<f64>,
    /// By the landmark's position (3 columns), or none.
    pub(super) by_landmark: DMatrix<f64>,
}

impl SensorRows {
    /// Projects the landmark out by an orthogonal transformation.
    pub(super) fn without_landmark(&self) -> DMatrix<f64> {
        if self.by_landmark.ncols() == 0 {
            return self.rows.clone();
        }
        let spanning = dense::to_faer(&(&self.by_landmark / self.by_landmark.norm()));
        let mut rest = dense::to_faer(&self.rows);
        let rank = dense::split_by_column_space(spanning.as_ref(), rest.as_mut(), DEPENDENT);
        let rest = dense::from_faer(rest.as_ref());
        rest.rows(rank, rest.nrows() - rank).into_owned()
    }
}

impl SensorWindow<'_> {
    /// Rows of every factor at a state; `None` when a landmark is behind a camera that observed it.
    pub(super) fn rows(&self, state: &SensorState) -> Option<Vec<SensorRows>> {
        let changes = self.readout_changes(state);
        let landmarks = state.landmarks.iter().zip(&self.observations);
        let mut rows = landmarks
            .map(|(position, observations)| self.landmark_rows(state, &changes, position, observations))
            .collect::<Option<Vec<_>>>()?;
        let mut others = LabelledRows::new(self.layout.total());
        if let JointKnowledge::Encoder(sigma_rad) = self.setup.joints {
            (0..state.frames.len()).for_each(|slot| self.encoder_rows(state, slot, sigma_rad, &mut others));
        }
        let encoders = others.parts.len();
        if let PoseKnowledge::Imu { biases_known, .. } = self.setup.poses {
            (1..state.frames.len()).for_each(|slot| self.imu_rows(state, slot, &mut others));
            if biases_known {
                let motion = |part: &mut DMatrix<f64>| *part = part.rows(0, MOTION_ROWS).into_owned();
                others.parts[encoders..].iter_mut().for_each(|part| motion(&mut part.rows));
            }
        }
        let others = others.parts.into_iter().map(|part| part.rows);
        rows.extend(others.map(|rows| SensorRows { by_landmark: DMatrix::zeros(rows.nrows(), 0), rows }));
        Some(rows)
    }

    fn landmark_rows(
        &self,
        state: &SensorState,
        changes: &[ReadoutChanges<'_>],
        position: &Vector3<f64>,
        observations: &[SensorObservation],
    ) -> Option<SensorRows> {
        let (layout, height) = (&self.layout, 2 * observations.len());
        let mut rows = DMatrix::zeros(height, layout.total() + 1);
        let mut by_landmark = DMatrix::zeros(height, 3);
        for (index, seen) in observations.iter().enumerate() {
            let prediction = self.predict(state, changes, position, seen.slot, seen.row_ratio)?;
            let mut own = rows.rows_mut(2 * index, 2);
            own.columns_range_mut(layout.frame(seen.slot)).copy_from(&prediction.by_frame);
            own.columns_range_mut(layout.calibration()).copy_from(&prediction.by_calibration);
            own.set_column(layout.total(), &(prediction.uv_px - seen.uv_px));
            by_landmark.rows_mut(2 * index, 2).copy_from(&prediction.by_landmark);
        }
        Some(SensorRows { rows: rows / PIXEL_SIGMA_PX, by_landmark: by_landmark / PIXEL_SIGMA_PX })
    }

    /// Rows of one encoder reading per joint at the time of the frame, none without joints.
    fn encoder_rows(&self, state: &SensorState, slot: usize, sigma_rad: f64, sink: &mut impl Sink) {
        let calibration = state.calibration.of(MAIN);
        let (angles_rad, rates_rad_per_s) =
            self.flight.joint_motion(self.times_s[slot] - calibration.encoder_shift_s());
        let count = angles_rad.len();
        let reading = JointAngles {
            angles_rad,
            sigmas_rad: vec![sigma_rad; count],
            lasting_sigmas_rad: vec![0.0; count],
            rates_rad_per_s: rates_rad_per_s.clone(),
            motion_fits: vec![JointMotionFit::UNKNOWN; count],
        };
        sink.take((count > 0).then(|| EncoderFactor {
            slot,
            reading: &reading,
            angles_rad: &state.frames[slot].joints_rad,
            rates_rad_per_s,
            // The reading is already that at the shifted time.
            shift_s: 0.0,
            joints: self.layout.joints(slot).start,
            clock: calibration.encoder_shift_column().map(|column| self.layout.calibration().start + column),
        }));
    }

    /// Rows of the preintegrated motion from the previous frame, and of the random walk of the biases.
    fn imu_rows(&self, state: &SensorState, slot: usize, sink: &mut impl Sink) {
        let (start_s, end_s) = (self.times_s[slot - 1], self.times_s[slot]);
        let states = [slot - 1, slot].map(|slot| &state.frames[slot].navigation);
        let motion = Change::preintegration(&self.imu(state, states[0].bias), (start_s, end_s - start_s), None);
        let first = self.layout.calibration().start + state.calibration.imu_columns().start;
        sink.take(Some(ImuFactor {
            slot,
            motion: &motion,
            information: &self.information[slot - 1],
            gravity_in_world: &self.flight.gravity_in_world,
            current: states,
            linearized: states,
            columns: [slot - 1, slot].map(|slot| NavigationColumns::of(&self.layout, slot)),
            intrinsics: state.calibration.imu_errors().map(|errors| (errors, first)),
        }));
    }

    /// Linearization at a state, as input of [`crate::observability::analyse`].
    pub(super) fn linearization(&self, state: &SensorState) -> Option<Linearization> {
        let rows = self.rows(state)?;
        let layout = &self.layout;
        let squared = |column: usize| rows.iter().map(|part| part.rows.column(column).norm_squared()).sum::<f64>();
        let norms: Vec<f64> = layout.calibration().map(|column| squared(column).sqrt()).collect();
        let parameters = state.calibration.parameters();
        let mut prior_jacobian = DMatrix::zeros(parameters.len(), layout.total());
        for (column, parameter) in parameters.iter().enumerate() {
            prior_jacobian[(column, column)] = parameter.scale().recip();
        }
        let frames: Vec<FrameId> = (0..layout.frames).map(FrameId).collect();
        let parts: Vec<DMatrix<f64>> = rows.iter().map(SensorRows::without_landmark).collect();
        let whole = Linearization {
            columns: layout.blocks(&parameters, &frames),
            fixed_parameters: Vec::new(),
            jacobian: stack(&parts, layout.report_order()),
            prior_jacobian,
            rig_prior_rows: parameters.len(),
            calibration_column_norms: DVector::from_vec(norms),
            chain: state.calibration.of(MAIN).chain().clone(),
        };
        Some(whole.without_known(&self.setup.poses, &self.setup.joints))
    }
}
