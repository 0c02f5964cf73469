//! Prior on the columns common to all frame sets: extrinsics of the static camera, time offsets and chain, from the rig
//! or from earlier flights; the prior on the chain alone, as a least-squares term.

use nalgebra::{DMatrix, DVector, Vector3};

use super::input::{CalibrationInput, CalibrationOptions, EarlierFlights};
use super::state::{BundleEstimate, Columns};
use crate::estimator::factors::factor::{Factor, JacobianBlock, Sink, WhitenedRows};
use crate::estimator::factors::kind::FactorLabel;
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{Chain, ClassicalChain, ParameterId, Parameterization, auto_parameterization};
use crate::optimization::{MIN_PRIOR_VARIANCE, prior_square_root_information};
use crate::sensors::ChainPrior;

/// Expected values of the border with their information.
#[derive(Clone, Debug)]
pub(super) struct BorderTerm {
    /// `imu_from_camera` of the static camera.
    pub(super) extrinsics: RigidTransform,
    /// Corrections of the rig's time offsets of static and gimbal camera, in seconds.
    pub(super) shifts_s: [f64; 2],
    /// Chain with its marginal prior.
    pub(super) chain: ChainTerm,
    /// The rig's chain with the rig's prior, in the parameterization of `chain`.
    pub(super) rig: ChainTerm,
    /// Standard deviations of all columns under the rig's prior.
    pub(super) rig_sigmas: DVector<f64>,
    /// `W` with `WᵀW` the inverse of the prior covariance (borders × borders).
    square_root_information: DMatrix<f64>,
}

impl BorderTerm {
    /// Prior of earlier flights if there are any, and of the rig for all other columns.
    pub(super) fn new(input: &CalibrationInput, options: &CalibrationOptions) -> Self {
        let (rigid, gimbal) = (&input.static_camera, &input.gimbal_camera);
        let flights = input.earlier.as_ref();
        let [of_static, of_gimbal] = flights.map_or([None; 2], |flights| flights.places);
        let calibrated = |place: Option<usize>| Some(&flights?.posterior.cameras[place?]);
        let parameterization = calibrated(of_gimbal)
            .map_or_else(|| auto_parameterization(&gimbal.chain), |camera| camera.parameterization);
        let rig = ChainTerm::new(&gimbal.chain, &gimbal.prior, parameterization);
        let columns = Columns { frame_sets: 0, joints: 0, chain: rig.given.dof() };
        let mut covariance = rig_covariance(input, options, &columns, &rig);
        let rig_sigmas = covariance.diagonal().map(f64::sqrt);
        let mut places = vec![None; columns.borders()];
        let mut shifts_s = [0.0; 2];
        if let Some(flights) = flights {
            places = posterior_columns(flights, &columns);
            for (row, place) in places.iter().enumerate() {
                for (column, other) in places.iter().enumerate() {
                    if let (Some(place), Some(other)) = (place, other) {
                        covariance[(row, column)] = flights.posterior.covariance[(*place, *other)];
                    } else if row != column && (place.is_some() || other.is_some()) {
                        covariance[(row, column)] = 0.0;
                    }
                }
            }
            for (camera, shift_s) in shifts_s.iter_mut().enumerate() {
                let Some(calibrated) = calibrated(flights.places[camera]) else { continue };
                if let Some(column) = shift_column(&calibrated.parameters) {
                    *shift_s = calibrated.values[column] - flights.given_shifts_s[camera];
                }
            }
        }
        let chain = Columns::CHAIN..columns.gimbal_shift();
        let given = calibrated(of_gimbal)
            .map_or_else(|| rig.given.clone(), |camera| Chain::from_classical(&camera.chain, parameterization));
        let of_chain = covariance.view_range(chain.clone(), chain).into_owned();
        Self {
            extrinsics: calibrated(of_static).map_or(rigid.imu_from_camera, |camera| camera.chain.imu_from_camera(&[])),
            shifts_s,
            chain: ChainTerm::with_covariance(given, of_chain),
            rig,
            rig_sigmas,
            square_root_information: prior_square_root_information(covariance),
        }
    }

    /// Covariance of the prior (borders × borders), `None` if its information is not positive definite.
    pub(super) fn covariance(&self) -> Option<DMatrix<f64>> {
        Some(self.square_root_information.tr_mul(&self.square_root_information).cholesky()?.inverse())
    }
}

/// Covariance of the border under the rig's prior (borders × borders).
fn rig_covariance(
    input: &CalibrationInput,
    options: &CalibrationOptions,
    columns: &Columns,
    rig: &ChainTerm,
) -> DMatrix<f64> {
    let count = columns.borders();
    let mut covariance = DMatrix::zeros(count, count);
    let (translation_m, rotation_rad) = input.static_camera.prior.sigmas();
    for axis in 0..Columns::STATIC_SHIFT {
        let sigma = if axis < 3 { rotation_rad } else { translation_m };
        covariance[(axis, axis)] = sigma * sigma;
    }
    for column in [Columns::STATIC_SHIFT, columns.gimbal_shift()] {
        covariance[(column, column)] = options.time_shift_sigma_s.powi(2);
    }
    let gimbal = &input.gimbal_camera;
    let (translation_m, rotation_rad) = gimbal.prior.sigmas();
    let of_chain = rig.given.prior_covariance(&gimbal.chain, translation_m, rotation_rad);
    covariance.view_mut((Columns::CHAIN, Columns::CHAIN), of_chain.shape()).copy_from(&of_chain);
    covariance
}

fn shift_column(parameters: &[ParameterId]) -> Option<usize> {
    parameters.iter().position(|parameter| *parameter == ParameterId::timeshift(0))
}

/// Column of the posterior for each column of the border, `None` where the posterior has none.
fn posterior_columns(flights: &EarlierFlights, columns: &Columns) -> Vec<Option<usize>> {
    let mut places = vec![None; columns.borders()];
    let cameras =
        [(flights.places[0], 0, Columns::STATIC_SHIFT), (flights.places[1], Columns::CHAIN, columns.gimbal_shift())];
    for (place, first, shift) in cameras {
        let Some(place) = place else { continue };
        let (start, camera) = (flights.posterior.columns(place).start, &flights.posterior.cameras[place]);
        for column in 0..camera.chain_columns() {
            places[first + column] = Some(start + column);
        }
        places[shift] = shift_column(&camera.parameters).map(|column| start + column);
    }
    places
}

/// Priors on the border: one row per column.
pub(super) struct BorderPriorFactor<'a> {
    pub(super) term: &'a BorderTerm,
    pub(super) columns: Columns,
    pub(super) estimate: &'a BundleEstimate,
}

impl BorderPriorFactor<'_> {
    /// Derivative by a step of the border (borders × borders), and residual.
    pub(super) fn jacobian_and_residual(&self) -> (DMatrix<f64>, DVector<f64>) {
        let Self { term, columns, estimate } = self;
        let mut difference = DVector::zeros(columns.borders());
        let extrinsics = estimate.extrinsics.minus(&term.extrinsics);
        difference.rows_mut(0, Columns::STATIC_SHIFT).copy_from(&extrinsics);
        difference[Columns::STATIC_SHIFT] = estimate.shifts_s[0] - term.shifts_s[0];
        let chain = Columns::CHAIN..columns.gimbal_shift();
        difference.rows_range_mut(chain).copy_from(&estimate.chain.minus(&term.chain.given));
        difference[columns.gimbal_shift()] = estimate.shifts_s[1] - term.shifts_s[1];
        let mut jacobian = term.square_root_information.clone();
        let rotation_error: Vector3<f64> = extrinsics.fixed_rows::<3>(0).into_owned();
        let by_rotation = jacobian.fixed_columns::<3>(0) * so3::right_jacobian_inverse(&rotation_error);
        jacobian.fixed_columns_mut::<3>(0).copy_from(&by_rotation);
        (jacobian, &term.square_root_information * difference)
    }
}

impl Factor for BorderPriorFactor<'_> {
    fn label(&self) -> FactorLabel {
        FactorLabel::CalibrationPrior
    }

    fn rows<S: Sink>(&self, sink: &mut S) {
        let (jacobian, residual) = self.jacobian_and_residual();
        let blocks = [JacobianBlock { start: self.columns.band(), entries: jacobian.as_slice() }];
        sink.add(self.label(), &WhitenedRows { residual: residual.as_slice(), blocks: &blocks, products: None });
    }
}

/// Given chain with its prior.
#[derive(Clone, Debug)]
pub(super) struct ChainTerm {
    pub(super) given: Chain,
    /// Prior standard deviation of each column.
    pub(super) prior_sigmas: DVector<f64>,
    /// `W` with `WᵀW` the inverse of the prior covariance.
    square_root_information: DMatrix<f64>,
}

impl ChainTerm {
    /// Rig's prior on its chain in a parameterization.
    pub(super) fn new(classical: &ClassicalChain, prior: &ChainPrior, parameterization: Parameterization) -> Self {
        let given = Chain::from_classical(classical, parameterization);
        let (translation_m, rotation_rad) = prior.sigmas();
        let covariance = given.prior_covariance(classical, translation_m, rotation_rad);
        Self::with_covariance(given, covariance)
    }

    /// Prior with this covariance of the chain's columns (dof × dof).
    pub(super) fn with_covariance(given: Chain, covariance: DMatrix<f64>) -> Self {
        let prior_sigmas = covariance.diagonal().map(|variance| (variance + MIN_PRIOR_VARIANCE).sqrt());
        Self { given, prior_sigmas, square_root_information: prior_square_root_information(covariance) }
    }

    /// Whitened difference `W·(chain ⊟ given)` (dof × 1).
    pub(super) fn residual(&self, chain: &Chain) -> DVector<f64> {
        &self.square_root_information * chain.minus(&self.given)
    }

    /// Derivative of the residual with respect to a step (dof × dof).
    pub(super) fn jacobian(&self) -> &DMatrix<f64> {
        &self.square_root_information
    }
}
