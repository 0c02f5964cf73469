//! Covariance of the newest pose of a window.

use nalgebra::DMatrix;
use serde::Serialize;

use crate::estimator::{ColumnGroup, Linearization};

/// Information that all poses are given about their absolute position and orientation, in 1/m² and 1/rad², so that the
/// matrix can be inverted: σ of a hundred metres and a hundred radians.
const WEAK_INFORMATION: f64 = 1e-4;

/// Standard deviation of the newest pose in the world of the run, which is fixed by the first frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PoseUncertainty {
    /// Root of the summed variances of the three coordinates of the position.
    pub position_m: f64,
    /// Root of the summed variances of the three components of the rotation.
    pub attitude_rad: f64,
}

impl PoseUncertainty {
    /// From the information of the measurements and the priors in a step, all other unknowns marginalized.
    ///
    /// Returns `None` without a pose, and for an information matrix that is not positive definite.
    pub fn of(linearization: &Linearization) -> Option<Self> {
        let poses = || linearization.columns.iter().filter(|block| block.id.group() == ColumnGroup::Pose);
        let newest = poses().next_back()?.start;
        let information = information(linearization);
        let size = information.nrows();
        let mut unit = nalgebra::DMatrix::zeros(size, 6);
        for component in 0..6 {
            unit[(newest + component, component)] = 1.0;
        }
        let covariance = information.cholesky()?.solve(&unit);
        // A pose has its rotation first.
        let sigma = |first: usize| {
            (first..first + 3).map(|component| covariance[(newest + component, component)]).sum::<f64>().sqrt()
        };
        let found = Self { attitude_rad: sigma(0), position_m: sigma(3) };
        (found.attitude_rad.is_finite() && found.position_m.is_finite()).then_some(found)
    }
}

/// Information of all columns of a step, of the measurements and the priors, with [`WEAK_INFORMATION`] on poses.
pub(super) fn information(linearization: &Linearization) -> DMatrix<f64> {
    let (measured, prior) = (&linearization.jacobian, &linearization.prior_jacobian);
    let mut information = measured.tr_mul(measured);
    if prior.nrows() > 0 {
        information += prior.tr_mul(prior);
    }
    let poses = linearization.columns.iter().filter(|block| block.id.group() == ColumnGroup::Pose);
    for column in poses.flat_map(|block| block.start..block.start + block.len) {
        information[(column, column)] += WEAK_INFORMATION;
    }
    information
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;
    use crate::estimator::{ColumnBlock, ColumnId, FrameId};
    use crate::gimbal::{Chain, ClassicalChain, Parameterization};

    #[test]
    fn information_of_measurements_and_priors_adds_up() {
        let block = |frame: usize| ColumnBlock { id: ColumnId::Pose(FrameId(frame)), start: 6 * frame, len: 6 };
        // The old pose is free; the new one is measured three times as well as its prior says.
        let mut jacobian = DMatrix::zeros(6, 12);
        let mut prior_jacobian = DMatrix::zeros(6, 12);
        for row in 0..6 {
            let unit = if row < 3 { 100.0 } else { 10.0 };
            (jacobian[(row, 6 + row)], prior_jacobian[(row, 6 + row)]) = (unit * 3_f64.sqrt(), unit);
        }
        let linearization = Linearization {
            columns: vec![block(0), block(1)],
            fixed_parameters: Vec::new(),
            jacobian,
            prior_jacobian,
            rig_prior_rows: 0,
            calibration_column_norms: DVector::zeros(0),
            chain: Chain::from_classical(&ClassicalChain::default(), Parameterization::Classical),
        };
        let found = PoseUncertainty::of(&linearization).unwrap();
        let near = |value: f64, expected: f64| (value / expected - 1.0).abs() < 1e-4;
        assert!(near(found.attitude_rad, 3_f64.sqrt() / 200.0), "{found:?}");
        assert!(near(found.position_m, 3_f64.sqrt() / 20.0), "{found:?}");
        assert_eq!(PoseUncertainty::of(&Linearization { columns: Vec::new(), ..linearization }), None);
    }
}
