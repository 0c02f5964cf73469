//! Parameters of a calibrated chain with their standard deviations, in every parameterization.

use nalgebra::{DMatrix, DVector, Vector6};

use super::fit::StillsFit;
use super::outcome::{AxisAngle, ParameterTable, StillsCorrelations, StillsParameter};
use crate::geometry::{RigidTransform, so3};
use crate::gimbal::{
    Chain, ClassicalChain, NearestForm, ParameterId, ParameterPart, Parameterization, Quantity, auto_parameterization,
    transport, transport_covariance,
};
use crate::sensors::Stills;
use crate::text::Named as _;

/// Calibrations without one station each, as differences to the whole calibration.
#[derive(Clone, Debug)]
pub(super) struct Jackknife {
    /// `chain ⊟ whole chain`, one column per station (dof × n).
    pub(super) chain: DMatrix<f64>,
    /// `[φ; δt]` of the further rigid cameras, one column per station.
    pub(super) further: DMatrix<f64>,
}

/// Smallest number of stations of a jackknife.
const MIN_STATIONS: usize = 3;

impl Jackknife {
    /// `None` with fewer than three stations.
    pub(super) fn new(fit: &StillsFit<'_>) -> Option<Self> {
        use rayon::prelude::*;
        let stations = fit.loops.stations.len();
        if stations < MIN_STATIONS {
            return None;
        }
        let without: Vec<_> = (0..stations).into_par_iter().filter_map(|it| fit.without_station(it)).collect();
        let (chain, further) = (&fit.state.chain, &fit.state.further);
        let chains: Vec<DVector<f64>> = without.iter().map(|state| state.chain.minus(chain)).collect();
        let furthers: Vec<DVector<f64>> = without
            .iter()
            .map(|state| {
                let steps: Vec<Vector6<f64>> =
                    state.further.iter().zip(further).map(|(other, whole)| other.minus(whole)).collect();
                DVector::from_iterator(6 * further.len(), steps.iter().flat_map(|step| step.iter().copied()))
            })
            .collect();
        (without.len() >= MIN_STATIONS)
            .then(|| Self { chain: DMatrix::from_columns(&chains), further: DMatrix::from_columns(&furthers) })
    }
}

/// Standard deviation of each row, `√((n − 1)/n Σ (d − d̄)²)` over the columns.
fn jackknife_sigmas(differences: &DMatrix<f64>) -> Vec<f64> {
    let count = differences.ncols() as f64;
    let of_row = |row: usize| {
        let mean = differences.row(row).sum() / count;
        let squares: f64 = differences.row(row).iter().map(|it| (it - mean).powi(2)).sum();
        ((count - 1.0) / count * squares).sqrt()
    };
    (0..differences.nrows()).map(of_row).collect()
}

/// Minimal parameterization in which results are reported.
pub(super) fn reported(chain: &ClassicalChain) -> Parameterization {
    auto_parameterization(chain)
}

/// Tables of all parameterizations, the reported one first.
pub(super) fn tables(fit: &StillsFit<'_>, stills: &Stills, jackknife: Option<&Jackknife>) -> Vec<ParameterTable> {
    let first = reported(&fit.state.chain.to_classical());
    let others = Parameterization::all().filter(|it| *it != first);
    std::iter::once(first).chain(others).map(|it| table(fit, stills, jackknife, it)).collect()
}

fn table(
    fit: &StillsFit<'_>,
    stills: &Stills,
    jackknife: Option<&Jackknife>,
    parameterization: Parameterization,
) -> ParameterTable {
    let (initial, chain) = in_parameterization(fit, &stills.initial.chain, parameterization);
    let covariance = transport_covariance(&fit.state.chain, &chain_covariance(fit), &chain);
    let jackknife = jackknife.map(|it| jackknife_sigmas(&(transport(&fit.state.chain, &chain) * &it.chain)));
    let names = stills.parameter_names();
    let (before, values) = (initial.values(), chain.values_from(&initial));
    let parameters = chain.parameters().into_iter().enumerate().map(|(place, id)| {
        let formal = covariance[(place, place)].max(0.0).sqrt();
        let sigma_jackknife = jackknife.as_ref().map(|sigmas| sigmas[place]);
        let values = [before[place], values[place]].map(|value| id.principal_value(value));
        StillsParameter::new(names.name(id), id.dimension(), values, formal, sigma_jackknife)
    });
    ParameterTable { parameterization: parameterization.name(), parameters: parameters.collect() }
}

/// Initial and calibrated chain in one parameterization; the classical one, which is redundant, with the values nearest to
/// the initial ones.
fn in_parameterization(
    fit: &StillsFit<'_>,
    initial: &ClassicalChain,
    parameterization: Parameterization,
) -> (Chain, Chain) {
    if parameterization == Parameterization::Classical {
        let initial = Chain::from_classical(initial, parameterization);
        let scales: Vec<f64> = initial.parameters().into_iter().map(ParameterId::scale).collect();
        let chain = NearestForm::new(initial.clone(), &DVector::from_vec(scales)).of(&fit.state.chain);
        return (initial, chain);
    }
    // The same way of conversion gives both the same one of several equal sets of values.
    let initial = Chain::from_classical(initial, Parameterization::Poe).in_parameterization(parameterization);
    (initial.canonical(), fit.state.chain.in_parameterization(parameterization).canonical())
}

/// Covariance of the chain's columns (dof × dof).
fn chain_covariance(fit: &StillsFit<'_>) -> DMatrix<f64> {
    let dof = fit.state.chain.dof();
    fit.posterior.common.view((0, 0), (dof, dof)).into_owned()
}

/// Correlations in the reported parameterization.
pub(super) fn correlations(fit: &StillsFit<'_>, stills: &Stills) -> StillsCorrelations {
    let parameterization = reported(&fit.state.chain.to_classical());
    let (_, chain) = in_parameterization(fit, &stills.initial.chain, parameterization);
    let covariance = transport_covariance(&fit.state.chain, &chain_covariance(fit), &chain);
    let sigmas = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
    let names = stills.parameter_names();
    StillsCorrelations {
        names: chain.parameters().into_iter().map(|id| names.name(id)).collect(),
        values: (0..covariance.nrows())
            .map(|row| {
                let of = |column: usize| covariance[(row, column)] / (sigmas[row] * sigmas[column]);
                (0..covariance.ncols()).map(of).collect()
            })
            .collect(),
    }
}

/// Transforms from the first to the further rigid cameras as rotation vector and translation.
pub(super) fn rigid_parameters(
    fit: &StillsFit<'_>,
    stills: &Stills,
    jackknife: Option<&Jackknife>,
) -> Vec<StillsParameter> {
    let values = |transform: &RigidTransform| {
        let rotation = so3::log(&transform.rotation);
        let shift = transform.translation_m;
        [rotation.x, rotation.y, rotation.z, shift.x, shift.y, shift.z]
    };
    let dof = fit.state.chain.dof();
    let jackknife = jackknife.map(|it| jackknife_sigmas(&it.further));
    let mut parameters = Vec::new();
    for (index, transform) in fit.state.further.iter().enumerate() {
        let before = stills.initial.further_from_first.get(index).map_or([f64::NAN; 6], values);
        let name = format!("T_{}_{}", stills.rigid_cameras[index + 1].name, stills.rigid_cameras[0].name);
        for (axis, quantity) in Quantity::TRANSFORM.into_iter().enumerate() {
            let column = dof + 6 * index + axis;
            let formal = fit.posterior.common[(column, column)].max(0.0).sqrt();
            let sigma_jackknife = jackknife.as_ref().map(|sigmas| sigmas[6 * index + axis]);
            let name = format!("{name}.{}", quantity.name());
            let values = [before[axis], values(transform)[axis]];
            parameters.push(StillsParameter::new(name, quantity.dimension(), values, formal, sigma_jackknife));
        }
    }
    parameters
}

/// Angles between consecutive axes; σ of an angle is the σ of the twist in the reported parameterization.
pub(super) fn axes(
    chain: &ClassicalChain,
    initial: &ClassicalChain,
    stills: &Stills,
    table: Option<&ParameterTable>,
) -> Vec<AxisAngle> {
    let names = stills.parameter_names();
    let between = |twist_rad: f64| twist_rad.cos().acos().to_degrees();
    let pairs = chain.links.iter().zip(&initial.links).zip(stills.joints.windows(2)).enumerate();
    pairs
        .map(|(link, ((calibrated, before), joints))| {
            let twist = ParameterId { part: ParameterPart::Link(link as u8), quantity: Quantity::Alpha };
            let name = names.name(twist);
            let sigma = table.and_then(|table| table.parameters.iter().find(|it| it.name == name)).map(|it| it.sigma);
            AxisAngle {
                joints: [joints[0].clone(), joints[1].clone()],
                initial_deg: between(before.alpha_rad),
                value_deg: between(calibrated.alpha_rad),
                sigma_deg: sigma.map_or(f64::NAN, f64::to_degrees),
            }
        })
        .collect()
}
