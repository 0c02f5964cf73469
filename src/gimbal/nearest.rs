//! Conversion to the classical parameterization with the values nearest to given ones.

use nalgebra::{DMatrix, DVector};

use crate::geometry::dense;

use super::{Chain, ParameterId, Parameterization, generic_joint_angles, stacked_jacobian};

/// Number of joint angles per joint at which two chains are compared.
const ANGLES_PER_JOINT: usize = 4;
/// Largest number of iterations; each reduces the remaining error by a factor about as large as the distance of
/// the mechanism from the given one, in radians.
const ROUNDS: usize = 60;
/// Chains that differ by less than this, in radians and metres, are the same mechanism.
const GAP: f64 = 1e-11;
/// Singular values below this fraction of the largest one belong to redundant directions.
const REDUNDANT: f64 = 1e-9;

/// Converts mechanisms to one parameterization, for the classical one to the values nearest to given ones.
///
/// The classical parameterization has six redundant directions: many values describe the same mechanism, and a plain
/// conversion picks one of them without regard to the rig. The other parameterizations are unique.
#[derive(Clone, Debug)]
pub struct NearestForm {
    near: Chain,
    angles: Vec<Vec<f64>>,
    /// Pseudo-inverse of the stacked Jacobian (dof × 6·count): the shortest step of the scaled columns for a pose
    /// error; empty for parameterizations other than the classical one.
    inverse: DMatrix<f64>,
}

impl NearestForm {
    /// Prepares conversions of mechanisms near `near`; `scales` (dof) are the units of the columns, such as prior
    /// standard deviations.
    pub fn new(near: Chain, scales: &DVector<f64>) -> Self {
        let joints = near.joint_count();
        let angles = generic_joint_angles(joints, ANGLES_PER_JOINT * (joints + 1));
        let classical = near.parameterization() == Parameterization::Classical && scales.len() == near.dof();
        let inverse = if classical { shortest(&near, &angles, scales) } else { DMatrix::zeros(0, 0) };
        Self { near, angles, inverse }
    }

    /// Parameters with the values of a mechanism, in `poe` relative to the given ones.
    pub fn values_of(&self, mechanism: &Chain) -> Vec<(ParameterId, f64)> {
        let chain = self.of(mechanism);
        chain.parameters().into_iter().zip(chain.values_from(&self.near).iter().copied()).collect()
    }

    /// Converts a mechanism; without convergence near the given values, returns the plain conversion.
    pub fn of(&self, mechanism: &Chain) -> Chain {
        let exact = mechanism.in_parameterization(self.near.parameterization());
        if self.inverse.is_empty() {
            return exact;
        }
        let wanted: Vec<_> = self.angles.iter().map(|angles| mechanism.imu_from_camera(angles)).collect();
        let mut chain = self.near.clone();
        for _ in 0..ROUNDS {
            let mut gap = DVector::zeros(6 * self.angles.len());
            for (index, (angles, wanted)) in self.angles.iter().zip(&wanted).enumerate() {
                gap.rows_mut(6 * index, 6).copy_from(&wanted.minus(&chain.imu_from_camera(angles)));
            }
            let largest = gap.amax();
            if largest < GAP {
                return chain;
            }
            if !largest.is_finite() {
                break;
            }
            chain = chain.plus(&(&self.inverse * gap));
        }
        exact
    }
}

/// Pseudo-inverse of the stacked Jacobian with scaled columns, in the units of the columns.
fn shortest(chain: &Chain, angles: &[Vec<f64>], scales: &DVector<f64>) -> DMatrix<f64> {
    let mut jacobian = stacked_jacobian(chain, angles);
    for (mut column, scale) in jacobian.column_iter_mut().zip(scales) {
        column *= *scale;
    }
    let Some(svd) = dense::thin_svd(&jacobian) else { return DMatrix::zeros(0, 0) };
    let least = REDUNDANT * svd.singular_values.max();
    let mut v = svd.v;
    for (mut column, value) in v.column_iter_mut().zip(&svd.singular_values) {
        column *= if *value > least { value.recip() } else { 0.0 };
    }
    let mut inverse = v * svd.u.transpose();
    for (mut row, scale) in inverse.row_iter_mut().zip(scales) {
        row *= *scale;
    }
    inverse
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gimbal::redundant_directions;
    use crate::gimbal::tests::random::Random;

    #[test]
    fn nearest_classical_values_keep_the_mechanism_and_avoid_redundant_directions() {
        let mut random = Random::new(5);
        for joints in 0..4 {
            let near = Chain::from_classical(&random.chain(joints), Parameterization::Classical);
            let scales =
                DVector::from_iterator(near.dof(), near.parameters().into_iter().map(|parameter| parameter.scale()));
            let form = NearestForm::new(near.clone(), &scales);
            assert_eq!(form.of(&near), near);
            let step = DVector::from_fn(near.dof(), |_, _| random.within(0.1)).component_mul(&scales);
            let mechanism = near.plus(&step);
            let nearest = form.of(&mechanism.in_parameterization(Parameterization::Minimal));
            for angles in generic_joint_angles(joints, 5) {
                let gap = nearest.imu_from_camera(&angles).minus(&mechanism.imu_from_camera(&angles));
                assert!(gap.amax() < 1e-9, "{joints} joints: {gap}");
            }
            // The step has no component along a redundant direction, in units of the scales.
            let way = nearest.minus(&near).component_div(&scales);
            assert!(
                way.norm() <= step.component_div(&scales).norm() * 1.02,
                "{joints} joints: no longer than another way"
            );
            for direction in redundant_directions(&near.to_classical()).column_iter() {
                let direction = direction.component_div(&scales).normalize();
                assert!(direction.dot(&way).abs() < 0.05 * way.norm(), "{joints} joints: {}", direction.dot(&way));
            }
        }
    }
}
