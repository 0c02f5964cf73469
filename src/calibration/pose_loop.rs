//! Pose loops: the static camera's pose followed by the chain must give the gimbal camera's measured pose.
//!
//! The measured poses of a segment have an unknown position, rotation and scale with respect to the map,
//! estimated together with the joint angles of every view. All unknowns of one segment are eliminated onto the
//! chain.

use nalgebra::{DMatrix, DVector, Matrix3, Matrix6xX, UnitQuaternion, Vector3, Vector6};

use super::chain_prior::ChainTerm;
use super::segments::Segment;
use crate::geometry::{RigidTransform, median, so3, wrap_angle};
use crate::gimbal::Chain;
use crate::optimization::RobustLoss;
use crate::optimization::damped::{DampedOptions, DampedProblem, minimize};
use crate::sensors::JointAngles;

/// Standard deviation of the rotation of a measured pose, in radians: a pixel over the root of the number of features.
const ROTATION_SIGMA_RAD: f64 = 1e-3;
/// Noise of the first adjustment, in which chain and readings have large errors.
const INITIAL_NOISE: LoopNoise = LoopNoise { rotation_rad: 0.02, position_m: 0.05, loss: RobustLoss::None };
/// Smallest standard deviation of a measured position, in metres.
const MIN_POSITION_SIGMA_M: f64 = 2e-3;
/// Residual at which a pair has half weight, in standard deviations.
const CAUCHY_SIGMAS: f64 = 3.0;
/// Number of estimations of the position noise.
const ROUNDS: usize = 4;
const ITERATIONS: usize = 25;
/// Number of columns of a segment's frame: rotation, translation, logarithm of the scale.
const FRAME: usize = 7;
/// Median length of a three-dimensional normal error, in standard deviations of a coordinate.
const MEDIAN_LENGTH: f64 = 1.538_172_254_455_05;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct PosePair {
    /// Pose of the vehicle at the gimbal camera's image, from the static camera's trajectory.
    pub(super) world_from_imu: RigidTransform,
    /// Measured `segment_from_camera`.
    pub(super) segment_from_camera: RigidTransform,
    pub(super) encoder: JointAngles,
}

impl PosePair {
    /// Reading and standard deviation of each joint.
    fn readings(&self) -> impl Iterator<Item = (&f64, &f64)> {
        self.encoder.angles_rad.iter().zip(&self.encoder.sigmas_rad)
    }
}

pub(super) type PairedSegment = Vec<PosePair>;

/// Pairs the measured poses with the trajectory.
pub(super) fn paired(
    segments: &[Segment],
    world_from_imu: &dyn Fn(usize) -> RigidTransform,
    encoder: &dyn Fn(usize) -> JointAngles,
) -> Vec<PairedSegment> {
    segments
        .iter()
        .map(|segment| {
            let pair = |(&frame_set, pose): (&usize, &RigidTransform)| PosePair {
                world_from_imu: world_from_imu(frame_set),
                segment_from_camera: *pose,
                encoder: encoder(frame_set),
            };
            segment.frame_sets.iter().zip(&segment.poses).map(pair).collect()
        })
        .collect()
}

/// Pose and scale of a segment in the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SegmentFrame {
    pub(super) world_from_segment: RigidTransform,
    pub(super) metres_per_unit: f64,
}

impl SegmentFrame {
    fn world_from_camera(&self, segment_from_camera: &RigidTransform) -> RigidTransform {
        let scaled =
            RigidTransform::new(segment_from_camera.rotation, segment_from_camera.translation_m * self.metres_per_unit);
        self.world_from_segment * scaled
    }

    /// `x ⊞ [φ; δt; δ ln unit]`.
    pub(super) fn plus(&self, delta: &[f64]) -> Self {
        Self {
            world_from_segment: self.world_from_segment.plus(&Vector6::from_column_slice(&delta[..6])),
            metres_per_unit: self.metres_per_unit * delta[6].exp(),
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct PoseLoopSolution {
    pub(super) chain: Chain,
    /// Joint angles by segment and pair, in radians.
    pub(super) joints_rad: Vec<Vec<Vec<f64>>>,
    pub(super) frames: Vec<SegmentFrame>,
    /// Covariance of the chain's columns (dof × dof).
    pub(super) covariance: DMatrix<f64>,
    /// Standard deviation of a measured position per coordinate, estimated from the residuals.
    pub(super) position_sigma_m: f64,
    /// Robust weight of each pair, 0 to 1, by segment.
    pub(super) weights: Vec<Vec<f64>>,
    pub(super) iterations: usize,
}

/// Noise and robust loss of the loops.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoopNoise {
    /// Standard deviation of a rotation per coordinate.
    pub(super) rotation_rad: f64,
    /// Standard deviation of a position per coordinate.
    pub(super) position_m: f64,
    pub(super) loss: RobustLoss,
}

pub(super) struct PoseLoops<'a> {
    pub(super) segments: &'a [PairedSegment],
    pub(super) prior: &'a ChainTerm,
}

#[derive(Clone, Debug)]
pub(super) struct LoopState {
    pub(super) chain: Chain,
    pub(super) joints_rad: Vec<Vec<Vec<f64>>>,
    pub(super) frames: Vec<SegmentFrame>,
}

pub(super) struct PairRows {
    pub(super) residual: Vector6<f64>,
    pub(super) by_frame: Matrix6xX<f64>,
    pub(super) by_joints: Matrix6xX<f64>,
    pub(super) by_chain: Matrix6xX<f64>,
}

/// Normal equations of the loops: block of the chain, and blocks of each segment.
#[derive(Clone)]
struct LoopEquations {
    hessian: DMatrix<f64>,
    gradient: DVector<f64>,
    segments: Vec<SegmentEquations>,
}

/// Blocks of one segment: its frame and the joint angles of its views.
#[derive(Clone)]
struct SegmentEquations {
    own: DMatrix<f64>,
    /// Coupling of the segment's unknowns (rows) with the chain (columns).
    coupling: DMatrix<f64>,
    gradient: DVector<f64>,
}

type SegmentFactor = nalgebra::linalg::Cholesky<f64, nalgebra::Dyn>;

impl PoseLoops<'_> {
    /// Solves from the given chain and the readings; `None` when the equations are singular.
    pub(super) fn solve(&self) -> Option<PoseLoopSolution> {
        let chain = self.prior.given.clone();
        let joints_rad: Vec<Vec<Vec<f64>>> = self
            .segments
            .iter()
            .map(|pairs| pairs.iter().map(|pair| pair.encoder.angles_rad.clone()).collect())
            .collect();
        let frames = self.segments.iter().map(|pairs| first_frame(pairs, &chain)).collect();
        let mut state = LoopState { chain, joints_rad, frames };
        let mut noise = INITIAL_NOISE;
        let mut iterations = 0;
        let mut covariance = None;
        for _ in 0..ROUNDS {
            let (next, used) = self.adjust(state, &noise);
            covariance = self.covariance(&next, &noise);
            state = next;
            iterations += used;
            let lengths = self.each_pair().map(|(segment, pair)| self.position_error(&state, segment, pair).norm());
            let spread_m = median(lengths)? / MEDIAN_LENGTH;
            noise = LoopNoise {
                rotation_rad: ROTATION_SIGMA_RAD,
                position_m: (spread_m * self.lost_freedom()).max(MIN_POSITION_SIGMA_M),
                loss: RobustLoss::Cauchy(CAUCHY_SIGMAS),
            };
        }
        let weights = (0..self.segments.len())
            .map(|segment| {
                let weight = |pair| {
                    noise.loss.cost_and_weight(self.rows(&state, segment, pair, &noise).residual.norm_squared()).1
                };
                (0..self.segments[segment].len()).map(weight).collect()
            })
            .collect();
        Some(PoseLoopSolution {
            chain: state.chain,
            joints_rad: state.joints_rad,
            frames: state.frames,
            covariance: covariance?,
            position_sigma_m: noise.position_m,
            weights,
            iterations,
        })
    }

    /// Ratio of position errors to position residuals, which the estimated frames of the segments reduce.
    fn lost_freedom(&self) -> f64 {
        let coordinates = 3.0 * self.each_pair().count() as f64;
        let free = coordinates - (FRAME * self.segments.len()) as f64;
        if free > 0.0 { (coordinates / free).sqrt() } else { 1.0 }
    }

    /// Position gaps of the loops, in metres.
    pub(super) fn gaps_m(&self, solution: &PoseLoopSolution) -> Vec<f64> {
        let state = LoopState {
            chain: solution.chain.clone(),
            joints_rad: solution.joints_rad.clone(),
            frames: solution.frames.clone(),
        };
        self.each_pair().map(|(segment, pair)| self.position_error(&state, segment, pair).norm()).collect()
    }

    fn each_pair(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.segments.iter().enumerate().flat_map(|(segment, pairs)| (0..pairs.len()).map(move |pair| (segment, pair)))
    }

    fn position_error(&self, state: &LoopState, segment: usize, pair: usize) -> Vector3<f64> {
        let measured = &self.segments[segment][pair];
        let predicted = measured.world_from_imu * state.chain.imu_from_camera(&state.joints_rad[segment][pair]);
        predicted.translation_m - state.frames[segment].world_from_camera(&measured.segment_from_camera).translation_m
    }

    /// Whitened residual and Jacobian rows of one pair.
    pub(super) fn rows(&self, state: &LoopState, segment: usize, pair: usize, noise: &LoopNoise) -> PairRows {
        let measured = &self.segments[segment][pair];
        let frame = &state.frames[segment];
        let chain = state.chain.linearize(&state.joints_rad[segment][pair]);
        let predicted = measured.world_from_imu * chain.imu_from_camera;
        let on_map = frame.world_from_camera(&measured.segment_from_camera);
        let rotation_error = so3::log(&(on_map.rotation.inverse() * predicted.rotation));
        let shift = predicted.translation_m - on_map.translation_m;
        let (rotation, position) = (1.0 / noise.rotation_rad, 1.0 / noise.position_m);
        let mut residual = Vector6::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&(rotation_error * rotation));
        residual.fixed_rows_mut::<3>(3).copy_from(&(shift * position));

        let by_rotation_error = so3::right_jacobian_inverse(&rotation_error);
        let world_from_imu = measured.world_from_imu.rotation_matrix();
        let carried = |part: &Matrix6xX<f64>| {
            let mut rows = part.clone();
            let rotation_rows = by_rotation_error * part.fixed_rows::<3>(0) * rotation;
            rows.fixed_rows_mut::<3>(0).copy_from(&rotation_rows);
            let shifted = world_from_imu * part.fixed_rows::<3>(3) * position;
            rows.fixed_rows_mut::<3>(3).copy_from(&shifted);
            rows
        };
        let segment_rotation: Matrix3<f64> = frame.world_from_segment.rotation_matrix();
        let camera_from_segment: Matrix3<f64> = measured.segment_from_camera.rotation_matrix().transpose();
        let place = measured.segment_from_camera.translation_m * frame.metres_per_unit;
        let mut by_frame = Matrix6xX::zeros(FRAME);
        by_frame
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(by_rotation_error.transpose() * camera_from_segment * -rotation));
        by_frame.fixed_view_mut::<3, 3>(3, 0).copy_from(&(segment_rotation * so3::hat(&place) * position));
        by_frame.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(-position);
        by_frame.fixed_view_mut::<3, 1>(3, 6).copy_from(&(segment_rotation * place * -position));
        PairRows { residual, by_frame, by_joints: carried(&chain.by_joints), by_chain: carried(&chain.by_parameters) }
    }

    fn cost(&self, state: &LoopState, noise: &LoopNoise) -> f64 {
        let mut cost = self.prior.residual(&state.chain).norm_squared();
        for (segment, pair) in self.each_pair() {
            let measured = &self.segments[segment][pair];
            let predicted = measured.world_from_imu * state.chain.imu_from_camera(&state.joints_rad[segment][pair]);
            let on_map = state.frames[segment].world_from_camera(&measured.segment_from_camera);
            let rotation_error = so3::log(&(on_map.rotation.inverse() * predicted.rotation)) / noise.rotation_rad;
            let shift = (predicted.translation_m - on_map.translation_m) / noise.position_m;
            cost += noise.loss.cost_and_weight(rotation_error.norm_squared() + shift.norm_squared()).0;
            for (angle, (reading, sigma)) in state.joints_rad[segment][pair].iter().zip(measured.readings()) {
                cost += (wrap_angle(angle - reading) / sigma).powi(2);
            }
        }
        cost
    }

    /// Adjusts the loops from a state; returns the state and the number of tried steps.
    fn adjust(&self, start: LoopState, noise: &LoopNoise) -> (LoopState, usize) {
        let options = DampedOptions {
            iterations: ITERATIONS,
            relative_cost_tolerance: 1e-8,
            first_damping: 1e-4,
            min_damping: 1e-10,
            max_damping: 1e10,
            growth: 20.0,
        };
        let solution = minimize(&mut DampedLoops { loops: self, noise }, start, &options);
        (solution.estimate, solution.tried)
    }

    /// Covariance of the chain's columns at a state (dof × dof), all other unknowns marginalized; `None` when the
    /// equations are singular.
    fn covariance(&self, state: &LoopState, noise: &LoopNoise) -> Option<DMatrix<f64>> {
        let mut equations = self.linearize(state, noise);
        equations.eliminate(0.0)?;
        Some(equations.hessian.cholesky()?.inverse())
    }

    fn linearize(&self, state: &LoopState, noise: &LoopNoise) -> LoopEquations {
        let mut hessian = self.prior.information();
        let mut gradient = self.prior.jacobian().tr_mul(&self.prior.residual(&state.chain));
        let segments = (0..self.segments.len())
            .map(|segment| self.segment_equations(state, segment, noise, &mut hessian, &mut gradient))
            .collect();
        LoopEquations { hessian, gradient, segments }
    }

    /// Normal equations of one segment; blocks of the chain only are added to `hessian` and `gradient`.
    fn segment_equations(
        &self,
        state: &LoopState,
        segment: usize,
        noise: &LoopNoise,
        hessian: &mut DMatrix<f64>,
        gradient: &mut DVector<f64>,
    ) -> SegmentEquations {
        let joints = state.chain.joint_count();
        let pairs = &self.segments[segment];
        let size = FRAME + joints * pairs.len();
        let mut own = DMatrix::zeros(size, size);
        let mut coupling = DMatrix::zeros(size, state.chain.dof());
        let mut own_gradient = DVector::zeros(size);
        for (pair, measured) in pairs.iter().enumerate() {
            let rows = self.rows(state, segment, pair, noise);
            let weight = noise.loss.cost_and_weight(rows.residual.norm_squared()).1;
            let at = FRAME + joints * pair;
            let parts = [(0, &rows.by_frame), (at, &rows.by_joints)];
            for (row, left) in parts {
                for (column, right) in parts {
                    let mut place = own.view_mut((row, column), (left.ncols(), right.ncols()));
                    place += left.tr_mul(right) * weight;
                }
                let mut place = coupling.rows_mut(row, left.ncols());
                place += left.tr_mul(&rows.by_chain) * weight;
                let mut place = own_gradient.rows_mut(row, left.ncols());
                place += left.tr_mul(&rows.residual) * weight;
            }
            *hessian += rows.by_chain.tr_mul(&rows.by_chain) * weight;
            *gradient += rows.by_chain.tr_mul(&rows.residual) * weight;
            for (joint, (angle, (reading, sigma))) in
                state.joints_rad[segment][pair].iter().zip(measured.readings()).enumerate()
            {
                let information = 1.0 / (sigma * sigma);
                own[(at + joint, at + joint)] += information;
                own_gradient[at + joint] += information * wrap_angle(angle - reading);
            }
        }
        SegmentEquations { own, coupling, gradient: own_gradient }
    }
}

impl LoopEquations {
    /// Eliminates every segment onto the chain, after multiplication of the segments' diagonals by `1 + damping`, and
    /// returns their damped factors; `None` when one is singular.
    fn eliminate(&mut self, damping: f64) -> Option<Vec<SegmentFactor>> {
        let mut factors = Vec::with_capacity(self.segments.len());
        for segment in &self.segments {
            let mut damped = segment.own.clone();
            for k in 0..damped.nrows() {
                damped[(k, k)] *= 1.0 + damping;
            }
            let factor = damped.cholesky()?;
            self.hessian -= segment.coupling.tr_mul(&factor.solve(&segment.coupling));
            self.gradient -= segment.coupling.tr_mul(&factor.solve(&segment.gradient));
            factors.push(factor);
        }
        Some(factors)
    }
}

/// The pose loops as a problem of the damped solver.
struct DampedLoops<'a> {
    loops: &'a PoseLoops<'a>,
    noise: &'a LoopNoise,
}

impl DampedProblem for DampedLoops<'_> {
    type Estimate = LoopState;
    type Equations = LoopEquations;

    fn cost(&self, state: &LoopState) -> f64 {
        self.loops.cost(state, self.noise)
    }

    fn linearize(&self, state: &LoopState) -> LoopEquations {
        self.loops.linearize(state, self.noise)
    }

    fn step(&mut self, state: &LoopState, equations: &LoopEquations, damping: f64) -> Option<LoopState> {
        let mut reduced = equations.clone();
        let factors = reduced.eliminate(damping)?;
        for k in 0..reduced.hessian.nrows() {
            reduced.hessian[(k, k)] *= 1.0 + damping;
        }
        let delta = -reduced.hessian.cholesky()?.solve(&reduced.gradient);
        let mut next = state.clone();
        next.chain = state.chain.plus(&delta);
        for (segment, (part, factor)) in equations.segments.iter().zip(&factors).enumerate() {
            let own = -factor.solve(&(&part.gradient + &part.coupling * &delta));
            next.frames[segment] = state.frames[segment].plus(&own.as_slice()[..FRAME]);
            for (angle, step) in next.joints_rad[segment].iter_mut().flatten().zip(own.iter().skip(FRAME)) {
                *angle += step;
            }
        }
        Some(next)
    }
}

/// Initial frame of a segment for the given chain and readings: mean rotation, then scale and position by least
/// squares.
fn first_frame(pairs: &[PosePair], chain: &Chain) -> SegmentFrame {
    let predicted: Vec<RigidTransform> =
        pairs.iter().map(|pair| pair.world_from_imu * chain.imu_from_camera(&pair.encoder.angles_rad)).collect();
    let rotations: Vec<UnitQuaternion<f64>> = pairs
        .iter()
        .zip(&predicted)
        .map(|(pair, predicted)| predicted.rotation * pair.segment_from_camera.rotation.inverse())
        .collect();
    let mut rotation = rotations.first().copied().unwrap_or_else(UnitQuaternion::identity);
    for _ in 0..5 {
        let sum: Vector3<f64> =
            rotations.iter().map(|rotation_error| so3::log(&(rotation.inverse() * rotation_error))).sum();
        rotation =
            UnitQuaternion::new_normalize((rotation * so3::exp(&(sum / rotations.len().max(1) as f64))).into_inner());
    }
    let count = pairs.len().max(1) as f64;
    let rotation_rows: Vec<Vector3<f64>> =
        pairs.iter().map(|pair| rotation * pair.segment_from_camera.translation_m).collect();
    let middle = rotation_rows.iter().sum::<Vector3<f64>>() / count;
    let middle_m = predicted.iter().map(|pose| pose.translation_m).sum::<Vector3<f64>>() / count;
    let (mut along, mut square, mut square_m) = (0.0, 0.0, 0.0);
    for (place, pose) in rotation_rows.iter().zip(&predicted) {
        along += (place - middle).dot(&(pose.translation_m - middle_m));
        square += (place - middle).norm_squared();
        square_m += (pose.translation_m - middle_m).norm_squared();
    }
    let square = square.max(1e-12);
    // A large rotation error may even change the sign; then the ratio of the extents is the better initial value.
    let metres_per_unit =
        if along > 0.3 * (square * square_m).sqrt() { along / square } else { (square_m / square).sqrt() };
    let metres_per_unit = metres_per_unit.max(1e-6);
    SegmentFrame {
        world_from_segment: RigidTransform::new(rotation, middle_m - middle * metres_per_unit),
        metres_per_unit,
    }
}
