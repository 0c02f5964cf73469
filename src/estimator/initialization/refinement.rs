//! Joint least-squares refinement of images and IMU samples: poses, velocities, biases, gravity, extrinsics. The cost is
//! Eq. 8 with priors on extrinsics and biases in place of the marginalization prior.
//!
//! The IMU frame of the first view is the frame of reference, so there is no gauge freedom; gravity is a direction in
//! it with known magnitude. The extrinsics are the given ones with an error common to all views (a rotation on the
//! IMU's side and a translation) and, on a gimbal, an independent rotation per view: `R = common·given·view`. Every
//! rotation is perturbed on the right.

use nalgebra::{DVector, Dyn, Matrix3, Matrix3x2, SMatrix, SVector, UnitQuaternion, Vector3, Vector6};

use super::alignment::{Alignment, VectorPrior};
use super::visual_problem::{TrackedLandmark, moved, visual_cost, visual_equations};
use crate::estimator::factors::imu::{self, MotionJacobians};
use crate::estimator::state::navigation::{ImuBias, NavigationState};
use crate::estimator::state::preintegration::Preintegration;
use crate::geometry::{RigidTransform, so3, tangent_basis};
use crate::optimization::damped::{DampedEquations as _, DampedOptions, DampedProblem, StopReason, minimize};
use crate::optimization::{
    DensePoseEquations, NormalEquations, ReducedEquations, ReprojectionEquations, damp, square_root_information,
};

/// Smallest standard deviation of a prior on the extrinsics, so that the equations stay solvable.
const MIN_SIGMA: f64 = 1e-5;

type Matrix9 = SMatrix<f64, 9, 9>;
type Vector9 = SVector<f64, 9>;

pub(super) struct RefinementInput<'a> {
    /// Extrinsics from calibration and encoders, one per view.
    pub(super) imu_from_camera: &'a [RigidTransform],
    /// Motion from each view to the next.
    pub(super) increments: &'a [Preintegration],
    pub(super) bearing_sigma_rad: f64,
    pub(super) extrinsics_rotation_sigma_rad: f64,
    pub(super) extrinsics_rotation_noise_rad: f64,
    pub(super) extrinsics_translation_sigma_m: f64,
    pub(super) gyroscope_bias: VectorPrior,
    pub(super) accelerometer_bias: VectorPrior,
}

/// Unknowns of the refinement, in the IMU frame of the first view.
#[derive(Clone, Debug)]
pub(super) struct RefinedState {
    pub(super) poses: Vec<RigidTransform>,
    pub(super) velocities: Vec<Vector3<f64>>,
    /// Gravity, pointing down, in m/s².
    pub(super) gravity: Vector3<f64>,
    pub(super) bias: ImuBias,
    pub(super) landmarks: Vec<TrackedLandmark>,
    pub(super) common_rotation: UnitQuaternion<f64>,
    pub(super) common_shift: Vector3<f64>,
    pub(super) per_view_rotations: Vec<UnitQuaternion<f64>>,
}

/// Standard deviations from the inverse of the last normal matrix.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct RefinementSigmas {
    /// Relative standard deviation of the longest distance from the first view, which equals the relative standard
    /// deviation of the metric scale.
    pub(super) scale: f64,
    pub(super) velocity_m_per_s: f64,
    pub(super) gravity_rad: f64,
    pub(super) gyroscope_bias_rad_per_s: f64,
    pub(super) accelerometer_bias_m_per_s2: f64,
}

pub(super) struct RefinementLayout {
    views: usize,
    per_view_rotations: bool,
}

impl RefinementLayout {
    const COMMON_ROTATION: usize = 0;
    const COMMON_SHIFT: usize = 3;
    const GYROSCOPE: usize = 6;
    const ACCELEROMETER: usize = 9;
    const GRAVITY: usize = 12;
    const GLOBALS: usize = 14;

    fn per_view(&self) -> usize {
        if self.per_view_rotations { 12 } else { 9 }
    }

    /// First of the 3 velocity columns of a view.
    fn velocity(&self, view: usize) -> usize {
        Self::GLOBALS + view * self.per_view()
    }

    /// First of the 6 pose columns of a view; the pose of the first view is fixed.
    pub(super) fn pose(&self, view: usize) -> usize {
        self.velocity(view) + 3
    }

    /// First of the 3 columns of a view's independent extrinsics rotation, `None` if it is not estimated.
    fn view_rotation(&self, view: usize) -> Option<usize> {
        self.per_view_rotations.then(|| self.velocity(view) + 9)
    }

    pub(super) fn columns(&self) -> usize {
        Self::GLOBALS + self.views * self.per_view()
    }
}

impl RefinedState {
    /// Initial state from an alignment; scales `landmarks`, given in the cameras' unit of length, to metres.
    pub(super) fn new(input: &RefinementInput<'_>, alignment: &Alignment, landmarks: &[TrackedLandmark]) -> Self {
        // Splits the alignment's change of the extrinsics: the mean rotation on the IMU's side, the rest per view.
        let changes: Vec<UnitQuaternion<f64>> = alignment
            .imu_from_camera
            .iter()
            .zip(input.imu_from_camera)
            .map(|(aligned, given)| aligned.rotation * given.rotation.inverse())
            .collect();
        let first = changes.first().copied().unwrap_or_else(UnitQuaternion::identity);
        let from_first = changes.iter().map(|change| so3::log(&(first.inverse() * change))).sum::<Vector3<f64>>();
        let common_rotation = first * so3::exp(&(from_first / changes.len().max(1) as f64));
        let own = |(change, given): (&UnitQuaternion<f64>, &RigidTransform)| {
            given.rotation.inverse() * common_rotation.inverse() * change * given.rotation
        };
        let per_view_rotations = if input.extrinsics_rotation_noise_rad > 0.0 {
            changes.iter().zip(input.imu_from_camera).map(own).collect()
        } else {
            vec![UnitQuaternion::identity(); changes.len()]
        };
        let scaled = |tracked: &TrackedLandmark| {
            let mut tracked = tracked.clone();
            tracked.landmark.inverse_distance /= alignment.scale;
            tracked
        };
        Self {
            poses: alignment.poses.clone(),
            velocities: alignment.velocities.clone(),
            gravity: alignment.gravity,
            bias: alignment.bias,
            landmarks: landmarks.iter().map(scaled).collect(),
            common_rotation,
            common_shift: Vector3::zeros(),
            per_view_rotations,
        }
    }

    /// Refined extrinsics per view.
    pub(super) fn imu_from_camera(&self, given: &[RigidTransform]) -> Vec<RigidTransform> {
        given
            .iter()
            .zip(&self.per_view_rotations)
            .map(|(given, own)| {
                RigidTransform::new(
                    so3::composed(&(self.common_rotation * given.rotation), own),
                    given.translation_m + self.common_shift,
                )
            })
            .collect()
    }

    /// Pose `start_from_camera` of each view.
    pub(super) fn cameras(&self, given: &[RigidTransform]) -> Vec<RigidTransform> {
        self.poses.iter().zip(self.imu_from_camera(given)).map(|(pose, mount)| *pose * mount).collect()
    }

    /// State of a view; the biases are common to all views.
    fn navigation(&self, view: usize) -> NavigationState {
        NavigationState { world_from_imu: self.poses[view], velocity_m_per_s: self.velocities[view], bias: self.bias }
    }

    fn gravity_basis(&self) -> Matrix3x2<f64> {
        let norm = self.gravity.norm();
        tangent_basis(&(self.gravity / norm)) * norm
    }

    pub(super) fn moved(
        &self,
        step: &DVector<f64>,
        layout: &RefinementLayout,
        landmarks: Vec<TrackedLandmark>,
    ) -> Self {
        let three = |start: usize| -> Vector3<f64> { step.fixed_rows::<3>(start).into_owned() };
        let mut next = self.clone();
        next.landmarks = landmarks;
        next.common_rotation = so3::plus(&self.common_rotation, &three(RefinementLayout::COMMON_ROTATION));
        next.common_shift += three(RefinementLayout::COMMON_SHIFT);
        next.bias.gyroscope_rad_per_s += three(RefinementLayout::GYROSCOPE);
        next.bias.accelerometer_m_per_s2 += three(RefinementLayout::ACCELEROMETER);
        let gravity = self.gravity + self.gravity_basis() * step.fixed_rows::<2>(RefinementLayout::GRAVITY);
        next.gravity = gravity * (self.gravity.norm() / gravity.norm());
        for view in 0..layout.views {
            next.velocities[view] += three(layout.velocity(view));
            if view > 0 {
                next.poses[view] = self.poses[view].plus(&step.fixed_rows::<6>(layout.pose(view)).into_owned());
            }
            if let Some(start) = layout.view_rotation(view) {
                next.per_view_rotations[view] = so3::plus(&self.per_view_rotations[view], &three(start));
            }
        }
        next
    }
}

/// All factors linearized at a state.
pub(super) struct RefinementEquations {
    visual: ReprojectionEquations<DensePoseEquations>,
    /// IMU factors and priors.
    others: NormalEquations<Dyn>,
}

/// The refinement as a least-squares problem: constant data, whitening matrices and column layout.
pub(super) struct Refinement<'a> {
    input: &'a RefinementInput<'a>,
    /// `W` (9 × 9) of each interval's `[φ, p, v]` with `Wᵀ W = covariance⁻¹`.
    whitening: Vec<Matrix9>,
    pub(super) layout: RefinementLayout,
}

#[derive(Clone, Debug)]
pub(super) struct RefinedInitialization {
    pub(super) state: RefinedState,
    /// Mean square of the whitened IMU residuals, without the priors on the biases.
    pub(super) imu_mean_square: f64,
    pub(super) sigmas: Option<RefinementSigmas>,
    pub(super) rounds: usize,
    /// True if the solver stopped before its iteration limit.
    pub(super) converged: bool,
}

impl<'a> Refinement<'a> {
    /// `None` when an interval is empty.
    pub(super) fn new(input: &'a RefinementInput<'a>) -> Option<Self> {
        let whitening = input
            .increments
            .iter()
            .map(|increment| {
                let mut covariance: Matrix9 = increment.covariance().fixed_view::<9, 9>(0, 0).into_owned();
                // Slightly larger diagonal, so that the covariance of a short interval stays positive definite.
                damp(&mut covariance, 1e-9);
                square_root_information(covariance).filter(|w| w.iter().all(|x| x.is_finite()))
            })
            .collect::<Option<Vec<_>>>()?;
        let layout = RefinementLayout {
            views: input.imu_from_camera.len(),
            per_view_rotations: input.extrinsics_rotation_noise_rad > 0.0,
        };
        Some(Self { input, whitening, layout })
    }

    pub(super) fn run(&self, start: RefinedState, rounds: usize) -> RefinedInitialization {
        let options = DampedOptions {
            iterations: rounds,
            relative_cost_tolerance: 1e-4,
            first_damping: 1e-4,
            min_damping: 1e-9,
            max_damping: 1e6,
            growth: 20.0,
        };
        let mut problem = self;
        let solution = minimize(&mut problem, start, &options);
        let imu_mean_square = self.imu_cost(&solution.estimate) / (9 * self.input.increments.len()).max(1) as f64;
        RefinedInitialization {
            imu_mean_square,
            sigmas: None,
            rounds: solution.tried,
            converged: solution.stop != StopReason::IterationLimit,
            state: solution.estimate,
        }
    }

    pub(super) fn sigmas(&self, state: &RefinedState) -> Option<RefinementSigmas> {
        let (reduced, _) = self.reduced(state, &self.linearized(state), 0.0);
        let factor = reduced.hessian.cholesky()?;
        let layout = &self.layout;
        // Covariances of a few quantities only.
        let columns = layout.columns();
        let variance = |direction: &DVector<f64>| direction.dot(&factor.solve(direction)).max(0.0);
        let block = |start: usize, length: usize| {
            (0..length)
                .map(|index| {
                    let mut unit = DVector::zeros(columns);
                    unit[start + index] = 1.0;
                    variance(&unit)
                })
                .fold(0.0, f64::max)
                .sqrt()
        };
        let far = (1..layout.views).max_by(|&a, &b| {
            let length = |view: usize| state.poses[view].translation_m.norm_squared();
            length(a).total_cmp(&length(b))
        })?;
        let reach = state.poses[far].translation_m.norm();
        let mut along = DVector::zeros(columns);
        along.fixed_rows_mut::<3>(layout.pose(far) + 3).copy_from(&(state.poses[far].translation_m / reach));
        Some(RefinementSigmas {
            scale: variance(&along).sqrt() / reach,
            velocity_m_per_s: block(layout.velocity(layout.views - 1), 3),
            gravity_rad: block(RefinementLayout::GRAVITY, 2),
            gyroscope_bias_rad_per_s: block(RefinementLayout::GYROSCOPE, 3),
            accelerometer_bias_m_per_s2: block(RefinementLayout::ACCELEROMETER, 3),
        })
    }

    pub(super) fn cost(&self, state: &RefinedState) -> f64 {
        let cameras = state.cameras(self.input.imu_from_camera);
        visual_cost(&state.landmarks, &cameras, self.input.bearing_sigma_rad)
            + self.imu_cost(state)
            + self.prior_cost(state)
    }

    fn imu_cost(&self, state: &RefinedState) -> f64 {
        self.input
            .increments
            .iter()
            .enumerate()
            .map(|(view, increment)| self.imu_residual(state, view, increment).norm_squared())
            .sum()
    }

    /// Whitened IMU residual `[φ, p, v]` (9 × 1) of the interval after a view.
    fn imu_residual(&self, state: &RefinedState, view: usize, increment: &Preintegration) -> Vector9 {
        let (motion, duration_s) = (increment.corrected(&state.bias), increment.duration_s());
        let (from, to) = (state.navigation(view), state.navigation(view + 1));
        self.whitening[view] * imu::motion_residual(&motion, duration_s, &from, &to, &state.gravity)
    }

    fn prior_cost(&self, state: &RefinedState) -> f64 {
        let input = self.input;
        let square = |vector: Vector3<f64>, sigma: f64| vector.norm_squared() / sigma.max(MIN_SIGMA).powi(2);
        let mut cost = square(so3::log(&state.common_rotation), input.extrinsics_rotation_sigma_rad)
            + square(state.common_shift, input.extrinsics_translation_sigma_m)
            + square(state.bias.gyroscope_rad_per_s - input.gyroscope_bias.mean, input.gyroscope_bias.sigma)
            + square(state.bias.accelerometer_m_per_s2 - input.accelerometer_bias.mean, input.accelerometer_bias.sigma);
        if self.layout.per_view_rotations {
            for own in &state.per_view_rotations {
                cost += square(so3::log(own), input.extrinsics_rotation_noise_rad);
            }
        }
        cost
    }

    pub(super) fn linearized(&self, state: &RefinedState) -> RefinementEquations {
        let cameras = state.cameras(self.input.imu_from_camera);
        let mut others = NormalEquations::zeros(Dyn(self.layout.columns()));
        for (view, increment) in self.input.increments.iter().enumerate() {
            self.add_imu(state, view, increment, &mut others);
        }
        self.add_priors(state, &mut others);
        let visual = visual_equations(&state.landmarks, &cameras, self.input.bearing_sigma_rad);
        RefinementEquations { visual, others }
    }

    /// Equations after elimination of the landmarks, and the data of the landmarks' steps.
    pub(super) fn reduced(
        &self,
        state: &RefinedState,
        equations: &RefinementEquations,
        damping: f64,
    ) -> (NormalEquations<Dyn>, ReducedEquations<DensePoseEquations>) {
        let mut reduced = equations.others.clone();
        let visual = equations.visual.eliminate(damping);
        self.add_visual(state, &visual.poses, &mut reduced);
        // The first view is the frame of reference: its pose is fixed.
        let pose = self.layout.pose(0);
        (pose..pose + 6).for_each(|column| reduced.fix(column));
        (reduced, visual)
    }

    /// Derivative of a camera pose by the columns it depends on: pairs of a first column and a 6 × 3 block.
    fn camera_blocks(&self, state: &RefinedState, view: usize) -> Vec<(usize, SMatrix<f64, 6, 3>)> {
        let pose = &state.poses[view];
        let given = &self.input.imu_from_camera[view];
        let lever = given.translation_m + state.common_shift;
        let after_shared: Matrix3<f64> =
            (given.rotation * state.per_view_rotations[view]).to_rotation_matrix().into_inner();
        let mount =
            (state.common_rotation * given.rotation * state.per_view_rotations[view]).to_rotation_matrix().into_inner();
        let rotation = pose.rotation_matrix();
        let block = |top: Matrix3<f64>, bottom: Matrix3<f64>| {
            let mut block = SMatrix::<f64, 6, 3>::zeros();
            block.fixed_view_mut::<3, 3>(0, 0).copy_from(&top);
            block.fixed_view_mut::<3, 3>(3, 0).copy_from(&bottom);
            block
        };
        let start = self.layout.pose(view);
        let mut blocks = vec![
            (RefinementLayout::COMMON_ROTATION, block(after_shared.transpose(), Matrix3::zeros())),
            (RefinementLayout::COMMON_SHIFT, block(Matrix3::zeros(), rotation)),
            (start, block(mount.transpose(), -rotation * so3::hat(&lever))),
            (start + 3, block(Matrix3::zeros(), Matrix3::identity())),
        ];
        if let Some(start) = self.layout.view_rotation(view) {
            blocks.push((start, block(Matrix3::identity(), Matrix3::zeros())));
        }
        blocks
    }

    fn add_visual(&self, state: &RefinedState, visual: &DensePoseEquations, reduced: &mut NormalEquations<Dyn>) {
        let blocks: Vec<_> = (0..self.layout.views).map(|view| self.camera_blocks(state, view)).collect();
        for (view_a, blocks_a) in blocks.iter().enumerate() {
            let slope = &visual.gradient[view_a];
            for (column, block) in blocks_a {
                let mut target = reduced.gradient.fixed_rows_mut::<3>(*column);
                target += block.tr_mul(slope);
            }
            for (view_b, blocks_b) in blocks.iter().enumerate() {
                let corner = visual.hessian.symmetric_block(view_a, view_b);
                for (column_b, block_b) in blocks_b {
                    let product = corner * block_b;
                    for (column_a, block_a) in blocks_a {
                        let mut target = reduced.hessian.fixed_view_mut::<3, 3>(*column_a, *column_b);
                        target += block_a.tr_mul(&product);
                    }
                }
            }
        }
    }

    /// Steps `[φ; δt]` of the camera poses that correspond to a step of the state.
    fn camera_steps(&self, state: &RefinedState, step: &DVector<f64>) -> Vec<Vector6<f64>> {
        (0..self.layout.views)
            .map(|view| {
                let blocks = self.camera_blocks(state, view);
                blocks.iter().map(|(column, block)| block * step.fixed_rows::<3>(*column)).sum()
            })
            .collect()
    }

    fn add_imu(
        &self,
        state: &RefinedState,
        view: usize,
        increment: &Preintegration,
        equations: &mut NormalEquations<Dyn>,
    ) {
        let residual = self.imu_residual(state, view, increment);
        let whitening = &self.whitening[view];
        let shift = increment.shift(&state.bias, None);
        let (from, to) = (state.navigation(view), state.navigation(view + 1));
        let (motion, duration_s) = (increment.shifted(&shift), increment.duration_s());
        let mut jacobians = MotionJacobians::new(&motion, duration_s, &from, &to, &state.gravity);
        jacobians.rotation_by_motion *= so3::right_jacobian(&shift.fixed_rows::<3>(0).into_owned());
        let by_bias = whitening * jacobians.by_parameters(increment.bias_jacobian());
        let [by_from, by_to] = [jacobians.by_from, jacobians.by_to].map(|by_state| whitening * by_state);
        let by_gravity = whitening * jacobians.by_gravity * state.gravity_basis();
        let blocks = [
            (self.layout.pose(view), &by_from.columns(0, 6).into_owned()),
            (self.layout.velocity(view), &by_from.columns(6, 3).into_owned()),
            (self.layout.pose(view + 1), &by_to.columns(0, 6).into_owned()),
            (self.layout.velocity(view + 1), &by_to.columns(6, 3).into_owned()),
            (RefinementLayout::GYROSCOPE, &by_bias.columns(0, 6).into_owned()),
            (RefinementLayout::GRAVITY, &by_gravity.columns(0, 2).into_owned()),
        ];
        equations.add_blocks(&residual, &blocks, 1.0);
    }

    fn add_priors(&self, state: &RefinedState, equations: &mut NormalEquations<Dyn>) {
        let input = self.input;
        let mut add = |start: usize, residual: &Vector3<f64>, jacobian: &Matrix3<f64>, sigma: f64| {
            let block = jacobian.columns(0, 3).into_owned();
            equations.add_blocks(residual, &[(start, &block)], 1.0 / sigma.max(MIN_SIGMA).powi(2));
        };
        let shared = so3::log(&state.common_rotation);
        add(
            RefinementLayout::COMMON_ROTATION,
            &shared,
            &so3::right_jacobian_inverse(&shared),
            input.extrinsics_rotation_sigma_rad,
        );
        let identity = Matrix3::identity();
        add(RefinementLayout::COMMON_SHIFT, &state.common_shift, &identity, input.extrinsics_translation_sigma_m);
        let gyroscope = state.bias.gyroscope_rad_per_s - input.gyroscope_bias.mean;
        add(RefinementLayout::GYROSCOPE, &gyroscope, &identity, input.gyroscope_bias.sigma);
        let accelerometer = state.bias.accelerometer_m_per_s2 - input.accelerometer_bias.mean;
        add(RefinementLayout::ACCELEROMETER, &accelerometer, &identity, input.accelerometer_bias.sigma);
        for (view, own) in state.per_view_rotations.iter().enumerate() {
            if let Some(start) = self.layout.view_rotation(view) {
                let own = so3::log(own);
                add(start, &own, &so3::right_jacobian_inverse(&own), input.extrinsics_rotation_noise_rad);
            }
        }
    }
}

impl DampedProblem for &Refinement<'_> {
    type Estimate = RefinedState;
    type Equations = RefinementEquations;

    fn cost(&self, state: &RefinedState) -> f64 {
        Refinement::cost(self, state)
    }

    fn linearize(&self, state: &RefinedState) -> RefinementEquations {
        self.linearized(state)
    }

    fn step(&mut self, state: &RefinedState, equations: &RefinementEquations, damping: f64) -> Option<RefinedState> {
        let (reduced, visual) = self.reduced(state, equations, damping);
        let step = reduced.solve(damping)?;
        let camera_steps = self.camera_steps(state, &step);
        let landmark_steps = equations.visual.substitute(&visual, |view| camera_steps[view]);
        Some(state.moved(&step, &self.layout, moved(&state.landmarks, &landmark_steps)))
    }
}
