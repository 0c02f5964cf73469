//! Least-squares problem of a window: cost, normal equations, whitened rows.

use std::ops::Range;

use nalgebra::{DMatrix, DVector, SMatrix, Vector3, Vector6};

use super::frame::Frame;
use crate::estimator::factors::imu;
use crate::estimator::factors::joint_motion::measured_joint_motion;
use crate::estimator::factors::marginal_prior::Prior;
use crate::estimator::factors::reprojection::{self, ReducedVisualEquations, VisualEquations, VisualModel};
use crate::estimator::factors::start_prior::StartPrior;
use crate::estimator::factors::zero_velocity::ZeroVelocityTerm;
use crate::estimator::state::calibrations::{Calibrations, MAIN};
use crate::estimator::state::camera_pose::CameraMaps;
use crate::estimator::state::camera_view::CameraView;
use crate::estimator::state::estimate::Estimate;
use crate::estimator::state::frame_state::FrameState;
use crate::estimator::state::layout::{Layout, POSE, VELOCITY_BIAS};
use crate::estimator::state::navigation::{Matrix15, Vector15};
use crate::estimator::state::track::Track;
use crate::geometry::wrap_angle;
use crate::optimization::Landmark;

/// Number of columns of a frame's state in an IMU factor, `[φ, p, v, b_g, b_a]`.
const STATE: usize = POSE + VELOCITY_BIAS;

#[derive(Clone, Debug)]
pub(crate) struct CameraFactors<'a> {
    pub(crate) visual: VisualModel<'a>,
    pub(crate) tracks: &'a [Track],
    /// Columns of the camera's calibration.
    pub(crate) columns: Range<usize>,
}

#[derive(Clone, Debug)]
pub(crate) struct Problem<'a> {
    pub(crate) layout: Layout,
    /// Cameras have no common features, so each has a separate visual system.
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
    /// Objective of the solver: half the sum.
    pub(crate) fn total(&self) -> f64 {
        0.5 * (self.visual + self.imu + self.encoder + self.zero_velocity + self.calibration + self.prior)
    }
}

/// Whitened IMU factor between two frames.
#[derive(Clone, Debug)]
pub(crate) struct ImuBlocks {
    /// Derivative by the state of the earlier frame (15 × 15).
    pub(crate) by_from: Matrix15,
    /// Derivative by the state of the later frame (15 × 15).
    pub(crate) by_to: Matrix15,
    /// Derivative by the IMU's intrinsics (15 × 15), `None` if they are not estimated.
    pub(crate) by_intrinsics: Option<Matrix15>,
    /// Whitened residual `[φ, p, v, b_g, b_a]` (15 × 1).
    pub(crate) residual: Vector15,
}

/// Reprojection factors of one camera.
#[derive(Clone, Debug)]
struct CameraEquations {
    visual: VisualEquations,
    maps: CameraMaps,
    columns: Range<usize>,
}

/// Normal equations at an estimate, landmarks not yet eliminated.
#[derive(Clone, Debug)]
pub(crate) struct NormalEquations {
    cameras: Vec<CameraEquations>,
    /// Normal matrix of all other factors (lower triangle).
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

    /// Camera at the given frames and calibrations.
    pub(crate) fn view<'v>(
        &'v self,
        camera: usize,
        frames: &'v [FrameState],
        calibrations: &'v Calibrations,
    ) -> CameraView<'v> {
        CameraView::new(frames, calibrations.of(camera), self.cameras[camera].visual.camera)
    }

    /// Costs by kind of factor.
    pub(crate) fn costs(&self, estimate: &Estimate) -> Costs {
        let mut costs = Costs::default();
        for (camera, (factors, landmarks)) in self.cameras.iter().zip(&estimate.landmarks).enumerate() {
            let view = self.view(camera, &estimate.frames, &estimate.calibration);
            costs.visual += 2.0 * reprojection::cost(&factors.visual, &view, factors.tracks, landmarks);
        }
        for slot in 1..self.frames.len() {
            if let Some(residual) = self.imu_residual(slot, &estimate.frames, &estimate.calibration) {
                costs.imu += residual.norm_squared();
            }
        }
        for slot in 0..self.frames.len() {
            costs.encoder += self.encoder_residuals(slot, estimate).map(|(_, r, _)| r * r).sum::<f64>();
            costs.encoder += self.joint_motion_residuals(slot, estimate).map(|(_, r, _)| r * r).sum::<f64>();
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

    /// `x ⊟ x₀` of all unknowns with a first estimate, zero for the others (columns of the layout).
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

    fn imu_residual(&self, slot: usize, frames: &[FrameState], calibration: &Calibrations) -> Option<Vector15> {
        let information = self.frames[slot].motion_information.as_ref()?;
        let residual = imu::residual_with(
            &self.frames[slot].motion,
            &frames[slot - 1].navigation,
            &frames[slot].navigation,
            &self.gravity_in_world,
            calibration.imu_errors(),
        );
        Some(information * residual)
    }

    /// Joint, whitened residual and its derivative by the joint angle, for each encoder reading of a frame.
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
            let read = angle + state.joint_rate_rad_per_s(joint) * shift_s;
            (joint, wrap_angle(read - reading) / sigma, 1.0 / sigma)
        })
    }

    /// Place, whitened residual and its derivative, for each joint rate and joint acceleration of a frame. The
    /// reference is the encoder's measurement, or zero with the typical motion of a gimbal as standard deviation.
    pub(crate) fn joint_motion_residuals<'s>(
        &'s self,
        slot: usize,
        estimate: &'s Estimate,
    ) -> impl Iterator<Item = (usize, f64, f64)> + 's {
        let encoder = self.frames[slot].encoder.as_ref();
        let motion = &estimate.frames[slot].joint_motion;
        motion.iter().enumerate().map(move |(place, value)| {
            let (measured, sigma) = measured_joint_motion(encoder, place, motion.len() / 2);
            (place, (value - measured) / sigma, 1.0 / sigma)
        })
    }

    /// Column of the encoders' time offset, `None` if it is not estimated. A reading's derivative by it is that by the
    /// angle times the joint rate.
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

    /// Zero-velocity terms at `slot`, `None` unless the vehicle is stationary there.
    pub(crate) fn velocity_terms(&self, slot: usize, state: &FrameState) -> Option<[ZeroVelocityTerm; 3]> {
        Some(self.frames[slot].stationary.as_ref()?.velocity_terms(self.layout, slot, state))
    }

    /// Zero-translation terms since the previous frame, `None` unless the vehicle has been stationary since then.
    pub(crate) fn position_terms(&self, slot: usize, states: &[FrameState]) -> Option<[ZeroVelocityTerm; 3]> {
        let before = slot.checked_sub(1)?;
        let stationary = self.frames[slot].stationary.filter(|it| self.frames[before].stamp_ns >= it.since_ns)?;
        Some(stationary.position_terms(self.layout, slot, states))
    }

    /// Calibration at which derivatives are evaluated.
    pub(crate) fn linearization_calibration(&self, current: &Calibrations) -> Calibrations {
        if self.calibration_first_estimates { current.at_first_estimate() } else { current.clone() }
    }

    pub(crate) fn linearize(&self, estimate: &Estimate) -> NormalEquations {
        let frames = self.linearization_frames(estimate);
        let calibration = self.linearization_calibration(&estimate.calibration);
        let cameras = self
            .cameras
            .iter()
            .zip(&estimate.landmarks)
            .enumerate()
            .map(|(camera, (factors, landmarks))| {
                let current = self.view(camera, &estimate.frames, &estimate.calibration);
                let linearized = self.view(camera, &frames, &calibration);
                CameraEquations {
                    visual: reprojection::equations(&factors.visual, &current, &linearized, factors.tracks, landmarks),
                    maps: CameraMaps::new(&frames, calibration.of(camera)),
                    columns: factors.columns.clone(),
                }
            })
            .collect();
        let (hessian, gradient) = self.other_equations(estimate, &frames, self.frames.len());
        NormalEquations { cameras, hessian, gradient }
    }

    /// Normal equations (lower triangle) of all factors but the visual ones: measurements of the frames before `slots`,
    /// and priors. Derivatives by the frames are evaluated at `linearized`.
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
            if let Some(blocks) = self.imu_blocks(slot, estimate, linearized) {
                self.add_imu(slot, &blocks, &self.imu_columns(&estimate.calibration), &mut hessian, &mut gradient);
            }
        }
        let clock = self.encoder_clock_column(estimate);
        for slot in 0..slots {
            let start = self.layout.joints(slot).start;
            for (joint, residual, slope) in self.encoder_residuals(slot, estimate) {
                hessian[(start + joint, start + joint)] += slope * slope;
                gradient[start + joint] += slope * residual;
                if let Some(clock) = clock {
                    let by_clock = slope * estimate.frames[slot].joint_rate_rad_per_s(joint);
                    hessian[(clock, start + joint)] += by_clock * slope;
                    hessian[(clock, clock)] += by_clock * by_clock;
                    gradient[clock] += by_clock * residual;
                }
            }
            let motion = self.layout.joint_motion(slot).start;
            for (place, residual, slope) in self.joint_motion_residuals(slot, estimate) {
                hessian[(motion + place, motion + place)] += slope * slope;
                gradient[motion + place] += slope * residual;
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

    /// Whitened Jacobians and residual of the IMU factor that ends at `slot`; `None` without IMU samples.
    pub(crate) fn imu_blocks(&self, slot: usize, estimate: &Estimate, linearized: &[FrameState]) -> Option<ImuBlocks> {
        let information = self.frames[slot].motion_information.as_ref()?;
        let residual = self.imu_residual(slot, &estimate.frames, &estimate.calibration)?;
        let (by_from, by_to, by_intrinsics) = imu::jacobians_with(
            &self.frames[slot].motion,
            &linearized[slot - 1].navigation,
            &linearized[slot].navigation,
            &self.gravity_in_world,
            estimate.calibration.imu_errors(),
        );
        Some(ImuBlocks {
            by_from: sparse_product(information, &by_from),
            by_to: sparse_product(information, &by_to),
            by_intrinsics: estimate.calibration.imu().map(|_| sparse_product(information, &by_intrinsics)),
            residual,
        })
    }

    /// Columns of the IMU's intrinsics in the layout; empty if they are not estimated.
    pub(crate) fn imu_columns(&self, calibration: &Calibrations) -> Range<usize> {
        let (start, columns) = (self.layout.calibration().start, calibration.imu_columns());
        start + columns.start..start + columns.end
    }

    fn add_imu(
        &self,
        slot: usize,
        ImuBlocks { by_from, by_to, by_intrinsics, residual }: &ImuBlocks,
        intrinsics: &Range<usize>,
        hessian: &mut DMatrix<f64>,
        gradient: &mut DVector<f64>,
    ) {
        // Transposed Jacobians, so that the sums run along contiguous memory.
        let mut rows = SMatrix::<f64, { 2 * STATE }, STATE>::zeros();
        rows.fixed_rows_mut::<STATE>(0).copy_from(&by_from.transpose());
        rows.fixed_rows_mut::<STATE>(STATE).copy_from(&by_to.transpose());
        let mut sums = SMatrix::<f64, { 2 * STATE }, { 2 * STATE }>::zeros();
        for row in &rows.data.0 {
            for (column, sum) in sums.data.0.iter_mut().enumerate() {
                for index in column..2 * STATE {
                    sum[index] += row[index] * row[column];
                }
            }
        }
        let places = [
            (0, self.layout.pose(slot - 1)),
            (POSE, self.layout.velocity_bias(slot - 1)),
            (STATE, self.layout.pose(slot)),
            (STATE + POSE, self.layout.velocity_bias(slot)),
        ];
        let by_columns = rows * residual;
        for (index, (begin, place)) in places.iter().enumerate() {
            let mut part = gradient.rows_range_mut(place.clone());
            part += by_columns.rows(*begin, place.len());
            for (column, target) in place.clone().enumerate() {
                for (later, rows) in &places[index..] {
                    let skipped = if later == begin { column } else { 0 };
                    for (row, of_row) in rows.clone().enumerate().skip(skipped) {
                        hessian[(of_row, target)] += sums[(later + row, begin + column)];
                    }
                }
            }
        }
        let Some(by_intrinsics) = by_intrinsics else { return };
        let row = intrinsics.start;
        add_vector(gradient, row, &by_intrinsics.tr_mul(residual));
        add_block(hessian, row, row, &by_intrinsics.tr_mul(by_intrinsics));
        for (begin, place) in &places {
            let by_place = if *begin < STATE { by_from } else { by_to };
            let block = by_intrinsics.tr_mul(&by_place.columns(begin % STATE, place.len()));
            let mut target = hessian.view_range_mut(intrinsics.clone(), place.clone());
            target += block;
        }
    }

    /// Estimate after a step.
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
                let steps = camera.block_steps(layout, step);
                camera.visual.substitute(reduced, |block| steps[block])
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
        let block = |row: usize, column: usize| visual.poses.hessian.symmetric_block(row, column);
        self.maps.add_information(layout, &self.columns, block, hessian);
        for (row, camera_gradient) in visual.poses.gradient.iter().enumerate() {
            let mut part = gradient.rows_range_mut(self.maps.columns(layout, row));
            part += self.maps.own[row].tr_mul(camera_gradient);
            let mut part = gradient.rows_range_mut(self.columns.clone());
            part += self.maps.calibration[row].tr_mul(camera_gradient);
        }
    }

    /// Steps of the camera's blocks for a step of the unknowns.
    fn block_steps(&self, layout: &Layout, step: &DVector<f64>) -> Vec<Vector6<f64>> {
        (0..self.maps.blocks())
            .map(|block| {
                let moved = &self.maps.own[block] * step.rows_range(self.maps.columns(layout, block))
                    + &self.maps.calibration[block] * step.rows_range(self.columns.clone());
                Vector6::from_column_slice(moved.as_slice())
            })
            .collect()
    }
}

/// `left · right` for a mostly zero right matrix.
fn sparse_product(left: &Matrix15, right: &Matrix15) -> Matrix15 {
    let mut product = Matrix15::zeros();
    for (target, factors) in product.data.0.iter_mut().zip(&right.data.0) {
        for (column, factor) in left.data.0.iter().zip(factors) {
            if *factor != 0.0 {
                for (entry, source) in target.iter_mut().zip(column) {
                    *entry += source * factor;
                }
            }
        }
    }
    product
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
