//! Least-squares problem of a window: cost, normal equations, whitened rows.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, SMatrix, Vector3, Vector6};

use crate::estimator::factors::imu_factor;
use crate::estimator::factors::prior::{Prior, StartPrior};
use crate::estimator::factors::visual::{self, ReducedVisualEquations, Track, VisualEquations, VisualModel};
use crate::estimator::factors::zero_velocity::ZeroVelocityTerm;
use crate::estimator::state::calibrations::{Calibrations, MAIN};
use crate::estimator::state::camera_pose::{self, CameraMaps};
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::layout::{Layout, POSE, VELOCITY_BIAS};
use crate::estimator::state::navigation::{Matrix15, Vector15};
use crate::estimator::window::frames::Frame;
use crate::geometry::wrap_angle;
use crate::optimization::Landmark;

/// Values of all unknowns.
#[derive(Clone, Debug)]
pub(crate) struct Estimate {
    /// States by slot.
    pub(crate) frames: Vec<FrameState>,
    /// The static calibration.
    pub(crate) calibration: Calibrations,
    /// Landmarks by camera, in the order of its tracks.
    pub(crate) landmarks: Vec<Vec<Landmark>>,
}

/// Visual factors of one camera.
#[derive(Clone, Debug)]
pub(crate) struct CameraFactors<'a> {
    pub(crate) visual: VisualModel<'a>,
    pub(crate) tracks: &'a [Track],
    /// Columns of the camera's calibration.
    pub(crate) columns: Range<usize>,
}

/// All factors of the window.
#[derive(Clone, Debug)]
pub(crate) struct Problem<'a> {
    pub(crate) layout: Layout,
    /// Cameras observe no common features, so that each has its own visual system.
    pub(crate) cameras: Vec<CameraFactors<'a>>,
    pub(crate) gravity_in_world: Vector3<f64>,
    pub(crate) frames: &'a [Frame],
    pub(crate) prior: Option<&'a Prior>,
    pub(crate) start: Option<&'a StartPrior>,
    pub(crate) first_estimate_reach_rad: f64,
    pub(crate) calibration_first_estimates: bool,
}

/// Twice the cost by kind of factor: robust for visual factors, χ² for the others.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Costs {
    pub(crate) visual: f64,
    pub(crate) imu: f64,
    pub(crate) encoder: f64,
    pub(crate) zero_velocity: f64,
    pub(crate) calibration: f64,
    pub(crate) prior: f64,
}

impl Costs {
    /// Objective of the solver.
    pub(crate) fn total(&self) -> f64 {
        0.5 * (self.visual + self.imu + self.encoder + self.zero_velocity + self.calibration + self.prior)
    }
}

/// Reprojection factors of one camera.
#[derive(Clone, Debug)]
struct CameraEquations {
    visual: VisualEquations,
    maps: CameraMaps,
    columns: Range<usize>,
}

/// The problem linearized at an estimate.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations {
    cameras: Vec<CameraEquations>,
    /// All other factors (lower triangle).
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
}

impl Problem<'_> {
    /// States at which derivatives are evaluated.
    pub(crate) fn linearization_frames(&self, estimate: &Estimate) -> Vec<FrameState> {
        self.frames
            .iter()
            .zip(&estimate.frames)
            .map(|(frame, current)| frame.linearization_point(current, self.first_estimate_reach_rad).clone())
            .collect()
    }

    /// The cost by kind of factor.
    pub(crate) fn costs(&self, estimate: &Estimate) -> Costs {
        let mut costs = Costs::default();
        for (camera, (factors, landmarks)) in self.cameras.iter().zip(&estimate.landmarks).enumerate() {
            let poses = camera_pose::by_slot(&estimate.frames, estimate.calibration.of(camera));
            costs.visual += 2.0 * visual::cost(&factors.visual, &poses, factors.tracks, landmarks);
        }
        for slot in 1..self.frames.len() {
            if let Some(residual) = self.imu_residual(slot, &estimate.frames) {
                costs.imu += residual.norm_squared();
            }
        }
        for slot in 0..self.frames.len() {
            costs.encoder += self.encoder_residuals(slot, estimate).map(|(_, r, _)| r * r).sum::<f64>();
        }
        costs.zero_velocity =
            self.zero_velocity_terms(&estimate.frames).map(|term| term.residual * term.residual).sum();
        if self.layout.calibration > 0 {
            costs.calibration = estimate.calibration.prior_residual().norm_squared();
        }
        if let Some(prior) = self.prior {
            costs.prior += prior.residual(&self.layout, &self.first_estimate_offset(estimate)).norm_squared();
        }
        if let (Some(start), Some(first)) = (self.start, estimate.frames.first()) {
            costs.prior += start.rows(first).1.norm_squared();
        }
        costs
    }

    /// Returns `x ⊟ x₀` of all unknowns with a first estimate, zero for the others (columns of the layout).
    pub(crate) fn first_estimate_offset(&self, estimate: &Estimate) -> DVector<f64> {
        let mut first_estimate_offset = DVector::zeros(self.layout.total());
        for (slot, (frame, current)) in self.frames.iter().zip(&estimate.frames).enumerate() {
            if let Some(first) = &frame.first_estimate {
                first_estimate_offset.rows_range_mut(self.layout.frame(slot)).copy_from(&current.minus(first));
            }
        }
        if self.layout.calibration > 0
            && let Some(change) = estimate.calibration.first_estimate_offset()
        {
            first_estimate_offset.rows_range_mut(self.layout.calibration()).copy_from(&change);
        }
        first_estimate_offset
    }

    fn imu_residual(&self, slot: usize, frames: &[FrameState]) -> Option<Vector15> {
        let information = self.frames[slot].motion_information.as_ref()?;
        let residual = imu_factor::residual(
            &self.frames[slot].motion,
            &frames[slot - 1].navigation,
            &frames[slot].navigation,
            &self.gravity_in_world,
        );
        Some(information * residual)
    }

    /// Returns joint, whitened residual and its derivative with respect to the angle, for each encoder reading of a
    /// frame.
    pub(crate) fn encoder_residuals<'s>(
        &'s self,
        slot: usize,
        estimate: &'s Estimate,
    ) -> impl Iterator<Item = (usize, f64, f64)> + 's {
        let state = &estimate.frames[slot];
        let shift_s = estimate.calibration.of(MAIN).encoder_shift_s();
        let readings =
            self.frames[slot].encoder.iter().flat_map(|encoder| encoder.angles_rad.iter().zip(&encoder.sigmas_rad));
        state.joints_rad.iter().zip(readings).enumerate().map(move |(joint, (angle, (reading, sigma)))| {
            let read = angle + state.rates.joint_rad_per_s(joint) * shift_s;
            (joint, wrap_angle(read - reading) / sigma, 1.0 / sigma)
        })
    }

    /// Column of the encoders' time offset, if it is estimated; its derivative is that of the angle times the
    /// joint's rate.
    pub(crate) fn encoder_clock_column(&self, estimate: &Estimate) -> Option<usize> {
        let calibration = &estimate.calibration;
        let column = calibration.of(MAIN).encoder_shift_column()?;
        Some(self.layout.calibration().start + calibration.columns(MAIN).start + column)
    }

    /// Zero-velocity updates of all frames, velocity before position in each.
    pub(crate) fn zero_velocity_terms<'s>(
        &'s self,
        states: &'s [FrameState],
    ) -> impl Iterator<Item = ZeroVelocityTerm> + 's {
        self.zero_velocity_terms_of(states, self.frames.len())
    }

    /// Zero-velocity updates of the frames before `slots`.
    fn zero_velocity_terms_of<'s>(
        &'s self,
        states: &'s [FrameState],
        slots: usize,
    ) -> impl Iterator<Item = ZeroVelocityTerm> + 's {
        (0..slots).flat_map(move |slot| {
            let velocity = self.velocity_terms(slot, &states[slot]);
            velocity.into_iter().flatten().chain(self.position_terms(slot, states).into_iter().flatten())
        })
    }

    /// Zero velocity at `slot`, if the vehicle is stationary there.
    pub(crate) fn velocity_terms(&self, slot: usize, state: &FrameState) -> Option<[ZeroVelocityTerm; 3]> {
        Some(self.frames[slot].stationary.as_ref()?.velocity_terms(self.layout, slot, state))
    }

    /// Zero translation since the previous frame, if the vehicle has been stationary since then.
    pub(crate) fn position_terms(&self, slot: usize, states: &[FrameState]) -> Option<[ZeroVelocityTerm; 3]> {
        let before = slot.checked_sub(1)?;
        let stationary = self.frames[slot].stationary.filter(|it| self.frames[before].stamp_ns >= it.since_ns)?;
        Some(stationary.position_terms(self.layout, slot, states))
    }

    /// Calibration at which derivatives are evaluated.
    pub(crate) fn linearization_calibration(&self, current: &Calibrations) -> Calibrations {
        if self.calibration_first_estimates { current.at_first_estimate() } else { current.clone() }
    }

    /// Linearizes all factors.
    pub(crate) fn linearize(&self, estimate: &Estimate) -> NormalEquations {
        let frames = self.linearization_frames(estimate);
        let calibration = self.linearization_calibration(&estimate.calibration);
        let cameras = self
            .cameras
            .iter()
            .zip(&estimate.landmarks)
            .enumerate()
            .map(|(camera, (factors, landmarks))| {
                let current = camera_pose::by_slot(&estimate.frames, estimate.calibration.of(camera));
                let linearized = camera_pose::by_slot(&frames, calibration.of(camera));
                CameraEquations {
                    visual: visual::equations(&factors.visual, &current, &linearized, factors.tracks, landmarks),
                    maps: CameraMaps::new(&frames, calibration.of(camera)),
                    columns: factors.columns.clone(),
                }
            })
            .collect();
        let (hessian, gradient) = self.other_equations(estimate, &frames, self.frames.len());
        NormalEquations { cameras, hessian, gradient }
    }

    /// Normal equations of all factors but the visual ones: of measurements up to the frame before `slots`, and of
    /// priors; derivatives with respect to the frames are evaluated at `linearized`.
    pub(crate) fn other_equations(
        &self,
        estimate: &Estimate,
        linearized: &[FrameState],
        slots: usize,
    ) -> (DMatrix<f64>, DVector<f64>) {
        let total = self.layout.total();
        let mut hessian = DMatrix::zeros(total, total);
        let mut gradient = DVector::zeros(total);
        for slot in 1..slots {
            if let Some((by_from, by_to, residual)) = self.imu_blocks(slot, estimate, linearized) {
                self.add_imu(slot, &by_from, &by_to, &residual, &mut hessian, &mut gradient);
            }
        }
        let clock = self.encoder_clock_column(estimate);
        for slot in 0..slots {
            let start = self.layout.joints(slot).start;
            for (joint, residual, slope) in self.encoder_residuals(slot, estimate) {
                hessian[(start + joint, start + joint)] += slope * slope;
                gradient[start + joint] += slope * residual;
                if let Some(clock) = clock {
                    let by_clock = slope * estimate.frames[slot].rates.joint_rad_per_s(joint);
                    hessian[(clock, start + joint)] += by_clock * slope;
                    hessian[(clock, clock)] += by_clock * by_clock;
                    gradient[clock] += by_clock * residual;
                }
            }
        }
        for term in self.zero_velocity_terms_of(&estimate.frames, slots) {
            let square = term.slope * term.slope;
            hessian[(term.column, term.column)] += square;
            gradient[term.column] += term.slope * term.residual;
            if let Some(against) = term.against {
                hessian[(against, against)] += square;
                hessian[(term.column, against)] -= square;
                hessian[(against, term.column)] -= square;
                gradient[against] -= term.slope * term.residual;
            }
        }
        if self.layout.calibration > 0 {
            let place = self.layout.calibration();
            let rows = estimate.calibration.prior_jacobian();
            let residual = estimate.calibration.prior_residual();
            let mut corner = hessian.view_range_mut(place.clone(), place.clone());
            corner += rows.tr_mul(&rows);
            let mut part = gradient.rows_range_mut(place);
            part += rows.tr_mul(&residual);
        }
        if let Some(prior) = self.prior {
            prior.add_to(&self.layout, &self.first_estimate_offset(estimate), &mut hessian, &mut gradient);
        }
        if let (Some(start), Some(first)) = (self.start, estimate.frames.first()) {
            let (rows, residual) = start.rows(first);
            let place = self.layout.frame(0);
            let mut corner = hessian.view_range_mut(place.clone(), place.clone());
            corner += rows.tr_mul(&rows);
            let mut part = gradient.rows_range_mut(place);
            part += rows.tr_mul(&residual);
        }
        (hessian, gradient)
    }

    /// Whitened Jacobians (15 × 15 with respect to either frame) and residual (15 × 1) of the IMU factor that ends
    /// at `slot`.
    pub(crate) fn imu_blocks(
        &self,
        slot: usize,
        estimate: &Estimate,
        linearized: &[FrameState],
    ) -> Option<(Matrix15, Matrix15, Vector15)> {
        let information = self.frames[slot].motion_information.as_ref()?;
        let residual = self.imu_residual(slot, &estimate.frames)?;
        let (by_from, by_to) = imu_factor::jacobians(
            &self.frames[slot].motion,
            &linearized[slot - 1].navigation,
            &linearized[slot].navigation,
            &self.gravity_in_world,
        );
        Some((information * by_from, information * by_to, residual))
    }

    fn add_imu(
        &self,
        slot: usize,
        by_from: &Matrix15,
        by_to: &Matrix15,
        residual: &Vector15,
        hessian: &mut DMatrix<f64>,
        gradient: &mut DVector<f64>,
    ) {
        let pose_blocks = [
            (self.layout.pose(slot - 1).start, by_from.fixed_columns::<POSE>(0).into_owned()),
            (self.layout.pose(slot).start, by_to.fixed_columns::<POSE>(0).into_owned()),
        ];
        let velocity_bias_blocks = [
            (self.layout.velocity_bias(slot - 1).start, by_from.fixed_columns::<VELOCITY_BIAS>(POSE).into_owned()),
            (self.layout.velocity_bias(slot).start, by_to.fixed_columns::<VELOCITY_BIAS>(POSE).into_owned()),
        ];
        for (row, left) in &pose_blocks {
            add_vector(gradient, *row, &left.tr_mul(residual));
            for (column, right) in &pose_blocks {
                add_block(hessian, *row, *column, &left.tr_mul(right));
            }
            for (column, right) in &velocity_bias_blocks {
                let block: SMatrix<f64, POSE, VELOCITY_BIAS> = left.tr_mul(right);
                add_block(hessian, *row, *column, &block);
                add_block(hessian, *column, *row, &block.transpose());
            }
        }
        for (row, left) in &velocity_bias_blocks {
            add_vector(gradient, *row, &left.tr_mul(residual));
            for (column, right) in &velocity_bias_blocks {
                add_block(hessian, *row, *column, &left.tr_mul(right));
            }
        }
    }

    /// Returns the estimate after a step.
    pub(crate) fn stepped(
        &self,
        estimate: &Estimate,
        step: &DVector<f64>,
        landmarks: &[Vec<Vector3<f64>>],
    ) -> Estimate {
        let moved = |(of_camera, deltas): (&Vec<Landmark>, &Vec<Vector3<f64>>)| {
            of_camera.iter().zip(deltas).map(|(landmark, delta)| landmark.plus(delta)).collect()
        };
        Estimate {
            frames: self
                .frames
                .iter()
                .zip(&estimate.frames)
                .enumerate()
                .map(|(slot, (frame, current))| {
                    current.stepped(frame.first_estimate.as_ref(), &step.as_slice()[self.layout.frame(slot)])
                })
                .collect(),
            calibration: estimate.calibration.stepped(&step.as_slice()[self.layout.calibration()]),
            landmarks: estimate.landmarks.iter().zip(landmarks).map(moved).collect(),
        }
    }
}

impl NormalEquations {
    /// Eliminates the landmarks of every camera.
    pub(crate) fn eliminate(&self, damping: f64) -> Vec<ReducedVisualEquations> {
        self.cameras.iter().map(|camera| camera.visual.eliminate(damping)).collect()
    }

    /// Reduced normal equations over poses, joints, velocities, biases and calibration (lower triangle).
    pub(crate) fn reduced(&self, layout: &Layout, visual: &[ReducedVisualEquations]) -> (DMatrix<f64>, DVector<f64>) {
        let mut hessian = self.hessian.clone();
        let mut gradient = self.gradient.clone();
        for (camera, visual) in self.cameras.iter().zip(visual) {
            camera.add_to(layout, visual, &mut hessian, &mut gradient);
        }
        (hessian, gradient)
    }

    /// Steps of the landmarks by camera, for a step of the other unknowns.
    pub(crate) fn landmark_steps(
        &self,
        layout: &Layout,
        reduced: &[ReducedVisualEquations],
        step: &DVector<f64>,
    ) -> Vec<Vec<Vector3<f64>>> {
        self.cameras
            .iter()
            .zip(reduced)
            .map(|(camera, reduced)| {
                let steps = camera.pose_steps(layout, step);
                camera.visual.substitute(reduced, |slot| steps[slot])
            })
            .collect()
    }
}

impl CameraEquations {
    /// Adds the normal equations of the camera poses to those of the unknowns.
    fn add_to(
        &self,
        layout: &Layout,
        visual: &ReducedVisualEquations,
        hessian: &mut DMatrix<f64>,
        gradient: &mut DVector<f64>,
    ) {
        let calibration = self.columns.clone();
        for row in 0..layout.frames {
            let mut by_cameras: DMatrix<f64> = DMatrix::zeros(6, calibration.len());
            for column in 0..layout.frames {
                let block = visual.poses.hessian.symmetric_block(row, column);
                by_cameras += block * &self.maps.calibration[column];
                if column <= row {
                    // Lower triangle: the frame `row` below the frame `column`.
                    let carried = self.maps.own[row].tr_mul(&(block * &self.maps.own[column]));
                    let mut place = hessian.view_range_mut(layout.camera(row), layout.camera(column));
                    place += &carried;
                }
            }
            let mut coupling = hessian.view_range_mut(calibration.clone(), layout.camera(row));
            coupling += by_cameras.tr_mul(&self.maps.own[row]);
            let mut corner = hessian.view_range_mut(calibration.clone(), calibration.clone());
            corner += self.maps.calibration[row].tr_mul(&by_cameras);
            let camera_gradient = &visual.poses.gradient[row];
            let mut part = gradient.rows_range_mut(layout.camera(row));
            part += self.maps.own[row].tr_mul(camera_gradient);
            let mut part = gradient.rows_range_mut(calibration.clone());
            part += self.maps.calibration[row].tr_mul(camera_gradient);
        }
    }

    /// Steps `[φ; δt]` of the camera poses, for a step of the unknowns.
    fn pose_steps(&self, layout: &Layout, step: &DVector<f64>) -> Vec<Vector6<f64>> {
        (0..layout.frames)
            .map(|slot| {
                let moved = &self.maps.own[slot] * step.rows_range(layout.camera(slot))
                    + &self.maps.calibration[slot] * step.rows_range(self.columns.clone());
                Vector6::from_column_slice(moved.as_slice())
            })
            .collect()
    }
}

fn add_block<const R: usize, const C: usize>(
    matrix: &mut DMatrix<f64>,
    row: usize,
    column: usize,
    block: &SMatrix<f64, R, C>,
) {
    let mut place = matrix.fixed_view_mut::<R, C>(row, column);
    place += block;
}

fn add_vector<const R: usize>(vector: &mut DVector<f64>, row: usize, part: &SMatrix<f64, R, 1>) {
    let mut place = vector.fixed_rows_mut::<R>(row);
    place += part;
}
