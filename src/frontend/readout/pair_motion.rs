use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};

use super::super::epipolar::{
    BearingPair, EpipolarConstraint, MotionHypothesis, add_outer_product, epipolar_distance, gauss_newton_step,
};
use super::super::outliers::fit_rotation;
use crate::geometry::{so3, tangent_basis};

/// Rotation and, with parallax, direction of translation between two images.
#[derive(Clone, Debug)]
pub(super) struct PairMotion {
    /// Rotation `R` = `camera_now_from_camera_previous`.
    pub(super) rotation: UnitQuaternion<f64>,
    direction: Option<Vector3<f64>>,
    /// Squared distances over the variance, truncated, plus the penalty of the unknowns.
    pub(super) cost: f64,
}

/// Largest cost of a track, at four standard deviations.
const LARGEST_COST: f64 = 16.0;
/// Penalty of an unknown (Akaike, 1974): a direction of translation has two of them, and the depth of each track is one.
const UNKNOWN_COST: f64 = 2.0;
/// Residual in standard deviations at which the weight of a track is a quarter.
const WEIGHT_SIGMAS: f64 = 3.0;
/// Gauss–Newton steps from each start.
const STEPS: usize = 4;
/// Damping of the normal matrix relative to its trace.
const DAMPING: f64 = 1e-9;

impl PairMotion {
    /// A rotation without translation, not yet fitted.
    pub(super) fn of_rotation(rotation: UnitQuaternion<f64>) -> Self {
        Self { rotation, direction: None, cost: 0.0 }
    }

    /// Motion fitted to some tracks, starting from this one.
    pub(super) fn fitted(&self, pairs: &[BearingPair], sigma_rad: f64) -> Self {
        let rotation = fit_rotation(pairs, &self.rotation, WEIGHT_SIGMAS * sigma_rad);
        let mut best = Self { rotation, direction: None, cost: 0.0 };
        best.cost = best.cost_of(pairs, sigma_rad);
        let before = self.direction.unwrap_or_else(|| direction_of(pairs, &self.rotation));
        for (rotation, direction) in [(self.rotation, before), (rotation, direction_of(pairs, &rotation))] {
            let mut at = MotionHypothesis { rotation, direction, cost: 0.0 };
            for _ in 0..STEPS {
                let scale = WEIGHT_SIGMAS * sigma_rad;
                let step = gauss_newton_step(pairs, &at, scale, &Matrix3::zeros(), &Vector3::zeros());
                let Some(step) = step else { break };
                (at.rotation, at.direction) = step;
            }
            for direction in [at.direction, -at.direction] {
                let mut found = Self { rotation: at.rotation, direction: Some(direction), cost: 0.0 };
                found.cost = found.cost_of(pairs, sigma_rad);
                if found.cost < best.cost {
                    best = found;
                }
            }
        }
        best
    }

    fn cost_of(&self, pairs: &[BearingPair], sigma_rad: f64) -> f64 {
        let unknowns = if self.direction.is_some() { UNKNOWN_COST } else { 0.0 };
        let squares = self.distances(pairs).into_iter().map(|distance| (distance / sigma_rad).powi(2));
        2.0 * unknowns + squares.map(|square| (square + unknowns).min(LARGEST_COST)).sum::<f64>()
    }

    /// Distance of each track from the motion, in radians.
    pub(super) fn distances(&self, pairs: &[BearingPair]) -> Vec<f64> {
        let distance = |pair: &BearingPair| match &self.direction {
            Some(direction) => epipolar_distance(pair, &self.rotation, direction),
            None => (pair.now - self.rotation * pair.previous).norm(),
        };
        pairs.iter().map(distance).collect()
    }

    /// Gradient and information of a parameter `p` of the bearings after marginalizing the motion `m` by the Schur
    /// complement: `g_p − H_pm H_mm⁻¹ g_m` and `H_pp − H_pm H_mm⁻¹ H_mp`. The derivatives of the bearings are central
    /// differences over `step`, from the bearings `around` at half a `step` before and after. `None` if the tracks do not
    /// constrain the motion.
    pub(super) fn eliminated(
        &self,
        at: &[BearingPair],
        around: [&[BearingPair]; 2],
        step: f64,
        sigma_rad: f64,
    ) -> Option<(f64, f64)> {
        let changes = around[0].iter().zip(around[1]).map(|(before, after)| {
            [after.previous - before.previous, after.now - before.now].map(|change| change / step)
        });
        self.sums(at.iter().zip(changes), sigma_rad).eliminated()
    }

    /// Covariance of the rotation vector in rad², from the noise of the tracks; `None` if they do not constrain it.
    pub(super) fn rotation_covariance(&self, pairs: &[BearingPair], sigma_rad: f64) -> Option<Matrix3<f64>> {
        let mut sums = self.sums(pairs.iter().map(|pair| (pair, Default::default())), sigma_rad);
        sums.damp();
        Some(sums.motion.cholesky()?.inverse().fixed_view::<3, 3>(0, 0).into_owned())
    }

    /// Normal equations of pairs with the derivatives of their bearings by the parameter.
    fn sums<'a>(&self, pairs: impl Iterator<Item = (&'a BearingPair, [Vector3<f64>; 2])>, sigma_rad: f64) -> Sums {
        let mut sums = Sums { unknowns: if self.direction.is_some() { 5 } else { 3 }, ..Sums::default() };
        for (pair, change) in pairs {
            match &self.direction {
                Some(direction) => sums.add_epipolar(pair, change, &self.rotation, direction, sigma_rad),
                None => sums.add_rotation(pair, change, &self.rotation, sigma_rad),
            }
        }
        sums
    }
}

/// Direction of translation closest to all epipolar planes of a rotation: the unit `t` of least `Σ (nᵢᵀ t)²` with the
/// normals `nᵢ = R fᵢ × f'ᵢ`.
fn direction_of(pairs: &[BearingPair], rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    let normals = pairs.iter().map(|pair| (rotation * pair.previous).cross(&pair.now));
    let sum: Matrix3<f64> = normals.map(|normal| normal * normal.transpose()).sum();
    let eigen = sum.symmetric_eigen();
    eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned()
}

/// Normal equations of a motion (rotation and direction) and one parameter.
#[derive(Default)]
struct Sums {
    /// Information of the motion's unknowns, its lower triangle.
    motion: SMatrix<f64, 5, 5>,
    motion_right: SVector<f64, 5>,
    mixed: SVector<f64, 5>,
    parameter: f64,
    parameter_right: f64,
    /// Number of the motion's unknowns: 3 without a direction, otherwise 5.
    unknowns: usize,
}

impl Sums {
    fn add(&mut self, by_motion: &SVector<f64, 5>, by_parameter: f64, residual: f64, weight: f64) {
        add_outer_product(&mut self.motion, by_motion, weight);
        self.motion_right += by_motion * (residual * weight);
        self.mixed += by_motion * (by_parameter * weight);
        self.parameter += by_parameter * by_parameter * weight;
        self.parameter_right += by_parameter * residual * weight;
    }

    /// Adds both components of `f' − R f` on the tangent plane of `f'`.
    fn add_rotation(
        &mut self,
        pair: &BearingPair,
        [previous, now]: [Vector3<f64>; 2],
        rotation: &UnitQuaternion<f64>,
        sigma_rad: f64,
    ) {
        let basis = tangent_basis(&pair.now);
        let residual = basis.tr_mul(&(pair.now - rotation * pair.previous));
        let by_rotation = basis.tr_mul(&(rotation.to_rotation_matrix().into_inner() * so3::hat(&pair.previous)));
        let by_parameter = basis.tr_mul(&(now - rotation * previous));
        let weight = weight_of(residual.norm(), sigma_rad);
        for axis in 0..2 {
            let mut by_motion = SVector::<f64, 5>::zeros();
            by_motion.fixed_rows_mut::<3>(0).copy_from(&by_rotation.row(axis).transpose());
            self.add(&by_motion, by_parameter[axis], residual[axis], weight);
        }
    }

    /// Adds Sampson's distance `e/√v` with the derivatives of `e` (see `frontend/epipolar.rs`).
    fn add_epipolar(
        &mut self,
        pair: &BearingPair,
        [previous, now]: [Vector3<f64>; 2],
        rotation: &UnitQuaternion<f64>,
        direction: &Vector3<f64>,
        sigma_rad: f64,
    ) {
        let constraint = EpipolarConstraint::new(&pair.rotated(rotation), direction);
        if !constraint.is_regular() {
            return;
        }
        let scale = constraint.variance.sqrt().recip();
        let by_rotation = rotation.inverse() * constraint.by_rotation();
        let by_direction = tangent_basis(direction).tr_mul(&constraint.by_direction());
        let by_motion =
            SVector::<f64, 5>::new(by_rotation.x, by_rotation.y, by_rotation.z, by_direction.x, by_direction.y);
        let by_parameter = now.dot(&constraint.normal) + constraint.other_normal.dot(&(rotation * previous));
        let distance = constraint.residual * scale;
        self.add(&(by_motion * scale), by_parameter * scale, distance, weight_of(distance, sigma_rad));
    }

    fn damp(&mut self) {
        let damping = DAMPING * self.motion.trace() + f64::MIN_POSITIVE;
        for k in 0..5 {
            self.motion[(k, k)] += if k < self.unknowns { damping } else { 1.0 };
        }
    }

    fn eliminated(mut self) -> Option<(f64, f64)> {
        self.damp();
        let factor = self.motion.cholesky()?;
        let information = self.parameter - self.mixed.dot(&factor.solve(&self.mixed));
        let gradient = self.parameter_right - self.mixed.dot(&factor.solve(&self.motion_right));
        (information > 0.0 && gradient.is_finite()).then_some((gradient, information))
    }
}

/// Geman–McClure weight of a residual, divided by its variance.
fn weight_of(residual_rad: f64, sigma_rad: f64) -> f64 {
    let ratio = (residual_rad / (WEIGHT_SIGMAS * sigma_rad)).powi(2);
    1.0 / (sigma_rad * sigma_rad * (1.0 + ratio) * (1.0 + ratio))
}
