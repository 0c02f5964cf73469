//! Covariances between parameterizations, computed from the camera motions of their columns at many joint angles.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};

use crate::geometry::Dimension;
use crate::geometry::dense::thin_svd;

use super::{Chain, ClassicalChain, Parameterization};

/// Singular values of the scaled, stacked chain Jacobian below this fraction of the largest are zero; regular
/// mechanisms stay above 2e-4, redundant columns below 1e-15.
const RANK_TOLERANCE: f64 = 1e-10;
/// Gains of the scaled transport below this count as zero; regular mechanisms have gains of at least 0.1.
const REACH_TOLERANCE: f64 = 1e-6;

/// Generic joint angles for numerical tests: a low-discrepancy sequence over whole revolutions, equal in every call.
pub fn generic_joint_angles(joints: usize, count: usize) -> Vec<Vec<f64>> {
    if joints == 0 {
        return vec![vec![]];
    }
    // Additive recurrence with the generalized golden ratio, the positive root of x^(joints + 1) = x + 1.
    let mut ratio = 2.0_f64;
    for _ in 0..60 {
        ratio = (1.0 + ratio).powf(1.0 / (joints as f64 + 1.0));
    }
    (0..count)
        .map(|index| {
            (1..=joints)
                .map(|joint| {
                    let fraction = (0.5 + (index + 1) as f64 / ratio.powi(joint as i32)).fract();
                    2.0 * PI * fraction - PI
                })
                .collect()
        })
        .collect()
}

/// Stacks the chain's Jacobians at several joint angles (6·count × dof), in radians and metres.
pub fn stacked_jacobian(chain: &Chain, joint_angles_rad: &[Vec<f64>]) -> DMatrix<f64> {
    let mut stacked = DMatrix::zeros(6 * joint_angles_rad.len(), chain.dof());
    for (index, angles) in joint_angles_rad.iter().enumerate() {
        stacked.rows_mut(6 * index, 6).copy_from(&chain.linearize(angles).by_parameters);
    }
    stacked
}

/// Jacobian of the columns of `to` by the columns of `from` (`to.dof()` × `from.dof()`), for two parameterizations of
/// one mechanism.
///
/// Least squares over generic joint angles: exact where `to` is regular, of least norm where it is singular.
/// All entries are NaN when a value of the chains is not finite.
///
/// # Panics
///
/// When the numbers of joints differ.
pub fn transport(from: &Chain, to: &Chain) -> DMatrix<f64> {
    assert_eq!(from.joint_count(), to.joint_count(), "two forms of one mechanism");
    let whole = |chain: &Chain| Chain { offsets_hidden: false, ..chain.clone() };
    let angles = generic_joint_angles(to.joint_count(), 12 * (to.joint_count() + 1));
    let (whole_from, whole_to) = (whole(from), whole(to));
    let scale = by_column(&whole_to, Dimension::scale);
    let mut target = stacked_jacobian(&whole_to, &angles);
    scale_columns(&mut target, &scale);
    let source = stacked_jacobian(&whole_from, &angles);
    let Some(svd) = thin_svd(&target) else {
        return DMatrix::from_element(to.dof(), from.dof(), f64::NAN);
    };
    let largest = svd.singular_values.max();
    let solve = |right: &DMatrix<f64>| {
        let mut projected = svd.u.tr_mul(right);
        for (mut row, singular_value) in projected.row_iter_mut().zip(&svd.singular_values) {
            row.scale_mut(if *singular_value > RANK_TOLERANCE * largest { 1.0 / singular_value } else { 0.0 });
        }
        &svd.v * &projected
    };
    // One refinement step removes the rounding error of the decomposition.
    let first = solve(&source);
    let mut motion = &first + solve(&(&source - &target * &first));
    for (mut row, scale) in motion.row_iter_mut().zip(&scale) {
        row.scale_mut(*scale);
    }
    motion.select_rows(&to.kept_columns()).select_columns(&from.kept_columns())
}

/// Transforms a covariance of the columns of `from` (`from.dof()` square) to one of the columns of `to` (`to.dof()`
/// square), for a switch of parameterization.
///
/// Directions of `to` that no motion of `from` reaches, at a singularity or where a parameterization is
/// redundant, get standard deviations of 10° and 3 cm, so that they stay estimable instead of becoming certain.
///
/// # Panics
///
/// When the numbers of joints differ, or the covariance does not belong to `from`.
pub fn transport_covariance(from: &Chain, covariance: &DMatrix<f64>, to: &Chain) -> DMatrix<f64> {
    transported(from, covariance, to, Dimension::scale)
}

fn transported(from: &Chain, covariance: &DMatrix<f64>, to: &Chain, sigma: impl Fn(Dimension) -> f64) -> DMatrix<f64> {
    let motion = transport(from, to);
    let (from_scale, to_scale) = (by_column(from, Dimension::scale), by_column(to, Dimension::scale));
    let scaled = DMatrix::from_fn(motion.nrows(), motion.ncols(), |row, column| {
        motion[(row, column)] * from_scale[column] / to_scale[row]
    });
    let Some(svd) = thin_svd(&scaled) else {
        return DMatrix::from_element(to.dof(), to.dof(), f64::NAN);
    };
    let mut reached = svd.u;
    for (mut column, singular_value) in reached.column_iter_mut().zip(&svd.singular_values) {
        if *singular_value < REACH_TOLERANCE {
            column.fill(0.0);
        }
    }
    let sigma = by_column(to, sigma);
    let free = DMatrix::identity(to.dof(), to.dof()) - &reached * reached.transpose();
    let free = DMatrix::from_fn(to.dof(), to.dof(), |row, column| free[(row, column)] * sigma[row] * sigma[column]);
    let result = &motion * covariance * motion.transpose() + free;
    (&result + result.transpose()) * 0.5
}

/// Returns one value per column, computed from the column's dimension.
fn by_column(chain: &Chain, value: impl Fn(Dimension) -> f64) -> DVector<f64> {
    let parameters = chain.parameters();
    DVector::from_iterator(parameters.len(), parameters.iter().map(|parameter| value(parameter.dimension())))
}

fn scale_columns(matrix: &mut DMatrix<f64>, scale: &DVector<f64>) {
    for (mut column, scale) in matrix.column_iter_mut().zip(scale) {
        column.scale_mut(*scale);
    }
}

impl Chain {
    /// Returns the prior covariance of the columns (dof × dof, in rad and m) for independent errors with these standard
    /// deviations of the rig's classical values; diagonal for the classical parameterization.
    ///
    /// `classical` is the mechanism from which this chain was converted.
    ///
    /// # Panics
    ///
    /// When the numbers of joints differ.
    pub fn prior_covariance(
        &self,
        classical: &ClassicalChain,
        translation_sigma_m: f64,
        rotation_sigma_rad: f64,
    ) -> DMatrix<f64> {
        let given = Self::from_classical(classical, Parameterization::Classical);
        let sigma = |dimension| match dimension {
            Dimension::Angle => rotation_sigma_rad,
            _ => translation_sigma_m,
        };
        let variances = |chain: &Self| {
            let sigma = by_column(chain, sigma);
            DMatrix::from_diagonal(&sigma.component_mul(&sigma))
        };
        if self.parameterization == Parameterization::Classical {
            return variances(self);
        }
        transported(&given, &variances(&given), self, sigma)
    }
}
