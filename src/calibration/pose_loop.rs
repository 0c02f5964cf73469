//! Pose loops: the static camera's pose followed by the chain must give the gimbal camera's measured pose.
//!
//! The measured poses of a segment have an unknown position, rotation and scale with respect to the map,
//! estimated together with the joint angles of every view. All unknowns of one segment are eliminated onto the
//! chain. Cost: `Σ ρ(|r|²) + Σ (q − reading)²/σ_q² + |W (chain ⊟ given)|²`, over pairs and joints.

use nalgebra::{DMatrix, Matrix3, Matrix6xX, UnitQuaternion, Vector3, Vector6};

use super::border_prior::ChainTerm;
use super::segments::Segment;
use crate::estimator::factors::encoder::EncoderResidual;
use crate::geometry::{RigidTransform, median, so3};
use crate::gimbal::Chain;
use crate::optimization::damped::{DampedOptions, LeastSquares, minimize};
use crate::optimization::{RobustLoss, TwoLevelEquations, TwoLevelStep};
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
const OPTIONS: DampedOptions = DampedOptions {
    iterations: 25,
    relative_cost_tolerance: 1e-8,
    first_damping: 1e-4,
    min_damping: 1e-10,
    max_damping: 1e10,
    growth: 20.0,
};
/// Number of columns of a segment's frame: rotation, translation, logarithm of the scale.
const FRAME: usize = 7;
/// Median length of a three-dimensional normal error, in standard deviations of a coordinate.
const MEDIAN_LENGTH: f64 = 1.538_172_254_455_05;

#[derive(Clone, Debug, PartialEq)]
pub(super) struct PosePair {
    /// Pose of the vehicle at the gimbal camera's image, from the static camera's trajectory.
    pub(super) world_from_imu: RigidTransform,
    /// Measured pose of the camera, `segment_from_camera`.
    pub(super) segment_from_camera: RigidTransform,
    pub(super) encoder: JointAngles,
}

impl PosePair {
    /// Residual of each joint's reading at its angle.
    fn encoder_residuals(&self, angles_rad: &[f64]) -> impl Iterator<Item = EncoderResidual> {
        let readings = self.encoder.angles_rad.iter().zip(&self.encoder.sigmas_rad);
        angles_rad
            .iter()
            .zip(readings)
            .map(|(angle, (reading, sigma))| EncoderResidual::new(*angle, 0.0, 0.0, *reading, *sigma))
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
    pub(super) state: LoopState,
    /// Covariance of the chain's columns (dof × dof).
    pub(super) covariance: DMatrix<f64>,
    /// Standard deviation of a measured position per coordinate, estimated from the residuals.
    pub(super) position_sigma_m: f64,
    /// Position gap of each loop.
    pub(super) gaps_m: Vec<f64>,
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
    pub(super) noise: LoopNoise,
}

#[derive(Clone, Debug)]
pub(super) struct LoopState {
    pub(super) chain: Chain,
    /// Joint angles by segment and pair, in radians.
    pub(super) joints_rad: Vec<Vec<Vec<f64>>>,
    pub(super) frames: Vec<SegmentFrame>,
}

pub(super) struct PairRows {
    pub(super) residual: Vector6<f64>,
    pub(super) by_frame: Matrix6xX<f64>,
    pub(super) by_joints: Matrix6xX<f64>,
    pub(super) by_chain: Matrix6xX<f64>,
}

impl<'a> PoseLoops<'a> {
    pub(super) fn new(segments: &'a [PairedSegment], prior: &'a ChainTerm) -> Self {
        Self { segments, prior, noise: INITIAL_NOISE }
    }

    /// Solves from the given chain and the readings; `None` when the equations are singular.
    pub(super) fn solve(&mut self) -> Option<PoseLoopSolution> {
        let chain = self.prior.given.clone();
        let of_pairs = |pairs: &PairedSegment| pairs.iter().map(|pair| pair.encoder.angles_rad.clone()).collect();
        let joints_rad = self.segments.iter().map(of_pairs).collect();
        let frames = self.segments.iter().map(|pairs| first_frame(pairs, &chain)).collect();
        let mut state = LoopState { chain, joints_rad, frames };
        let mut iterations = 0;
        let mut covariance = None;
        let mut gaps_m = Vec::new();
        for _ in 0..ROUNDS {
            let solution = minimize(self, state, &OPTIONS);
            state = solution.estimate;
            iterations += solution.tried;
            covariance = self.linearize(&state).common_covariance();
            let gap_m = |(segment, pair)| {
                self.residual(&state, segment, pair).fixed_rows::<3>(3).norm() * self.noise.position_m
            };
            gaps_m = self.each_pair().map(gap_m).collect();
            let spread_m = median(gaps_m.iter().copied())? / MEDIAN_LENGTH;
            self.noise = LoopNoise {
                rotation_rad: ROTATION_SIGMA_RAD,
                position_m: (spread_m * self.lost_freedom()).max(MIN_POSITION_SIGMA_M),
                loss: RobustLoss::Cauchy(CAUCHY_SIGMAS),
            };
        }
        let weights = (0..self.segments.len()).map(|segment| {
            let square = |pair| self.residual(&state, segment, pair).norm_squared();
            (0..self.segments[segment].len()).map(|pair| self.noise.loss.cost_and_weight(square(pair)).1).collect()
        });
        Some(PoseLoopSolution {
            weights: weights.collect(),
            covariance: covariance?,
            position_sigma_m: self.noise.position_m,
            state,
            gaps_m,
            iterations,
        })
    }

    /// Ratio of position errors to position residuals, which the estimated frames of the segments reduce.
    fn lost_freedom(&self) -> f64 {
        let coordinates = 3.0 * self.each_pair().count() as f64;
        let free = coordinates - (FRAME * self.segments.len()) as f64;
        if free > 0.0 { (coordinates / free).sqrt() } else { 1.0 }
    }

    fn each_pair(&self) -> impl Iterator<Item = (usize, usize)> + '_ {
        self.segments.iter().enumerate().flat_map(|(segment, pairs)| (0..pairs.len()).map(move |pair| (segment, pair)))
    }

    /// Whitened residual of one pair,
    /// `r = [Log(R_Bᵀ R_A) / σ_R; (t_A − t_B) / σ_t]` with `A = T_WI·T_IC(q)` and `B = T_WS·[R_SC, s·t_SC]`:
    /// vehicle and chain against the measured pose in its segment of scale `s`.
    fn residual(&self, state: &LoopState, segment: usize, pair: usize) -> Vector6<f64> {
        let measured = &self.segments[segment][pair];
        let a = measured.world_from_imu * state.chain.imu_from_camera(&state.joints_rad[segment][pair]);
        let b = state.frames[segment].world_from_camera(&measured.segment_from_camera);
        let rotation = so3::log(&(b.rotation.inverse() * a.rotation)) / self.noise.rotation_rad;
        let position = (a.translation_m - b.translation_m) / self.noise.position_m;
        Vector6::from_iterator(rotation.iter().chain(&position).copied())
    }

    /// [`Self::residual`] with its derivatives (6 × n each), `J = J_r⁻¹(Log(R_Bᵀ R_A))`:
    ///
    /// ```text
    /// by [φ; δt] of T_IC:                [J / σ_R, 0; 0, R_WI / σ_t]
    /// by [φ; δt; δ ln s] of the segment: [−Jᵀ R_SCᵀ / σ_R, 0, 0; R_WS [s·t_SC]× / σ_t, −I / σ_t, −R_WS·s·t_SC / σ_t]
    /// ```
    pub(super) fn rows(&self, state: &LoopState, segment: usize, pair: usize) -> PairRows {
        let (measured, frame, noise) = (&self.segments[segment][pair], &state.frames[segment], &self.noise);
        let chain = state.chain.linearize(&state.joints_rad[segment][pair]);
        let residual = self.residual(state, segment, pair);
        let j = so3::right_jacobian_inverse(&(residual.fixed_rows::<3>(0) * noise.rotation_rad)) / noise.rotation_rad;
        let r_wi: Matrix3<f64> = measured.world_from_imu.rotation_matrix() / noise.position_m;
        let of_chain = |by_pose: &Matrix6xX<f64>| {
            let mut rows = by_pose.clone();
            rows.fixed_rows_mut::<3>(0).copy_from(&(j * by_pose.fixed_rows::<3>(0)));
            rows.fixed_rows_mut::<3>(3).copy_from(&(r_wi * by_pose.fixed_rows::<3>(3)));
            rows
        };
        let r_sc: Matrix3<f64> = measured.segment_from_camera.rotation_matrix();
        let r_ws: Matrix3<f64> = frame.world_from_segment.rotation_matrix() / noise.position_m;
        let t_sc = measured.segment_from_camera.translation_m * frame.metres_per_unit;
        let mut by_frame = Matrix6xX::zeros(FRAME);
        by_frame.fixed_view_mut::<3, 3>(0, 0).copy_from(&-(j.transpose() * r_sc.transpose()));
        by_frame.fixed_view_mut::<3, 3>(3, 0).copy_from(&(r_ws * so3::hat(&t_sc)));
        by_frame.fixed_view_mut::<3, 3>(3, 3).fill_diagonal(-1.0 / noise.position_m);
        by_frame.fixed_view_mut::<3, 1>(3, 6).copy_from(&-(r_ws * t_sc));
        PairRows { residual, by_frame, by_joints: of_chain(&chain.by_joints), by_chain: of_chain(&chain.by_parameters) }
    }
}

impl LeastSquares for PoseLoops<'_> {
    type Estimate = LoopState;
    /// The chain's columns are common; frame and joint angles of a segment are a group.
    type Equations = TwoLevelEquations;

    fn cost(&self, state: &LoopState) -> f64 {
        let mut cost = self.prior.residual(&state.chain).norm_squared();
        for (segment, pair) in self.each_pair() {
            cost += self.noise.loss.cost_and_weight(self.residual(state, segment, pair).norm_squared()).0;
            for encoder in self.segments[segment][pair].encoder_residuals(&state.joints_rad[segment][pair]) {
                cost += encoder.residual.powi(2);
            }
        }
        cost
    }

    fn linearize(&self, state: &LoopState) -> TwoLevelEquations {
        let joints = state.chain.joint_count();
        let sizes: Vec<usize> = self.segments.iter().map(|pairs| FRAME + joints * pairs.len()).collect();
        let mut equations = TwoLevelEquations::zeros(&sizes, state.chain.dof());
        equations.common.add(&self.prior.residual(&state.chain), self.prior.jacobian(), 1.0);
        for (segment, pair) in self.each_pair() {
            let rows = self.rows(state, segment, pair);
            let weight = self.noise.loss.cost_and_weight(rows.residual.norm_squared()).1;
            let at = FRAME + joints * pair;
            let own = [(0, &rows.by_frame), (at, &rows.by_joints)];
            equations.add(segment, &rows.residual, &own, &[(0, &rows.by_chain)], weight);
            let own = &mut equations.groups[segment].own;
            let encoders = self.segments[segment][pair].encoder_residuals(&state.joints_rad[segment][pair]);
            for (column, encoder) in (at..).zip(encoders) {
                own.hessian[(column, column)] += encoder.by_angle * encoder.by_angle;
                own.gradient[column] += encoder.by_angle * encoder.residual;
            }
        }
        equations
    }

    fn plus(&self, state: &LoopState, step: &TwoLevelStep) -> LoopState {
        let mut next = state.clone();
        next.chain = state.chain.plus(&step.common);
        for (segment, own) in step.groups.iter().enumerate() {
            next.frames[segment] = state.frames[segment].plus(&own.as_slice()[..FRAME]);
            for (angle, step) in next.joints_rad[segment].iter_mut().flatten().zip(own.iter().skip(FRAME)) {
                *angle += step;
            }
        }
        next
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
        rotation = so3::plus(&rotation, &(sum / rotations.len().max(1) as f64));
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
