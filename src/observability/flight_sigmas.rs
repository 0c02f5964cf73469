//! Standard deviations by the measurements of a flight alone: the prior is taken out of the information.

use nalgebra::DMatrix;

use crate::geometry::dense;

/// A direction with a smaller part of information other than the prior's is known by the prior alone: rounding is far
/// below it, and a flight that reaches 5 mm along it would need a prior of 0.2 µm.
const MEASURED: f64 = 1e-9;
/// A direction that is known by the prior alone counts if at least this part of a variance with the prior lies along it.
const MIN_PART: f64 = 1e-4;

/// Standard deviations (k) of linear combinations (k × n) of n columns, by the information `RᵀR` (n × n) without the part
/// `PᵀP` of a prior (m × n); infinite where the prior alone determines a combination.
///
/// With `P R⁻¹ = U S Vᵀ` the covariance without the prior is `R⁻¹ V (1 − S²)⁻¹ Vᵀ R⁻ᵀ` (docs/mathematics.md, section 8).
pub(super) fn sigmas_without_prior(
    factor: &DMatrix<f64>,
    prior: &DMatrix<f64>,
    combinations: &DMatrix<f64>,
) -> Vec<f64> {
    let (rows, columns) = (combinations.nrows(), factor.ncols());
    let inverse = factor.solve_upper_triangular(&DMatrix::identity(columns, columns));
    let whitened = inverse.as_ref().map(|inverse| prior * inverse);
    let parts = whitened.and_then(|whitened| dense::thin_svd(&whitened.tr_mul(&whitened)));
    let Some((inverse, parts)) = inverse.zip(parts) else { return vec![f64::INFINITY; rows] };
    let along = combinations * inverse * parts.v;
    let sigma = |row: usize| {
        let all: f64 = along.row(row).norm_squared();
        let mut variance = 0.0;
        for (entry, of_prior) in along.row(row).iter().zip(parts.singular_values.iter()) {
            let measured = 1.0 - of_prior;
            if measured >= MEASURED {
                variance += entry * entry / measured;
            } else if entry * entry > MIN_PART * all {
                return f64::INFINITY;
            }
        }
        variance.sqrt()
    };
    (0..rows).map(sigma).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Information about three columns: the first two are measured, only the sum of the last two is.
    fn of_flight() -> DMatrix<f64> {
        DMatrix::from_row_slice(3, 3, &[4.0, 0.0, 0.0, 0.0, 9.0, 9.0, 0.0, 9.0, 9.0])
    }

    fn sigmas(prior_sigma: f64) -> Vec<f64> {
        let prior = DMatrix::<f64>::identity(3, 3) / prior_sigma;
        let factor = (of_flight() + prior.tr_mul(&prior)).cholesky().unwrap().l().transpose();
        let combinations = DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 1.0]);
        [combinations, DMatrix::identity(3, 3)]
            .iter()
            .flat_map(|it| sigmas_without_prior(&factor, &prior, it))
            .collect()
    }

    #[test]
    fn the_prior_has_no_effect() {
        for prior_sigma in [0.01, 0.1, 1.0, 10.0] {
            let found = sigmas(prior_sigma);
            for (found, expected) in found.iter().zip([0.5, 1.0 / 3.0, 0.5]) {
                assert!((found - expected).abs() < 1e-6, "prior {prior_sigma}: {found}, expected {expected}");
            }
            assert_eq!(found[3..], [f64::INFINITY; 2], "prior {prior_sigma}");
        }
    }

    #[test]
    fn without_a_prior_the_covariance_is_the_inverse_of_the_information() {
        let factor = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 0.0, 4.0]);
        let found = sigmas_without_prior(&factor, &DMatrix::zeros(0, 2), &DMatrix::identity(2, 2));
        let covariance = factor.tr_mul(&factor).try_inverse().unwrap();
        assert!((found[0] - covariance[(0, 0)].sqrt()).abs() < 1e-12);
        assert!((found[1] - covariance[(1, 1)].sqrt()).abs() < 1e-12);
        let singular = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 0.0, 0.0]);
        assert_eq!(sigmas_without_prior(&singular, &factor, &DMatrix::identity(2, 2)), [f64::INFINITY; 2]);
    }
}
