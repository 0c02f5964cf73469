//! Motions that make the columns of sensors observable.

use std::fmt;

use nalgebra::DMatrix;
use rayon::prelude::*;
use serde::Serialize;

use super::{LaboratoryForm, LaboratorySetup, linearize_sensors};
use crate::gimbal::{ParameterGroup, ParameterId};
use crate::observability::analysis::measured_block;
use crate::observability::laboratory::LaboratoryMotion;
use crate::table::text::{TextTable, left, right};
use crate::text::Named as _;

/// Motions that are compared, each for the duration of the experiment.
const MOTIONS: [LaboratoryMotion; 8] = [
    LaboratoryMotion::Hover,
    LaboratoryMotion::TranslationOnly,
    LaboratoryMotion::RollOnly,
    LaboratoryMotion::PitchOnly,
    LaboratoryMotion::YawOnly,
    LaboratoryMotion::RotationOnly,
    LaboratoryMotion::Stabilized,
    LaboratoryMotion::Aggressive,
];
/// Ratio of posterior and prior σ below which a parameter counts as known.
const KNOWN: f64 = 0.3;

/// Posterior σ of sensor columns after motions of the same duration.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorExcitation {
    pub motions: Vec<String>,
    pub parameters: Vec<ParameterSigmas>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterSigmas {
    pub name: String,
    /// Posterior σ after each motion in units of the column scale: 1 where the motion does not constrain it.
    pub sigmas: Vec<f64>,
    /// First motion in the order of the table that makes the parameter known.
    pub suggested: Option<String>,
}

/// Posterior σ of an experiment's sensor columns after several motions, from a prior of the column scale; `None` if the
/// experiment has no such column or a value is not finite.
pub fn sensor_excitation(setup: &LaboratorySetup, form: LaboratoryForm) -> Option<SensorExcitation> {
    let results: Vec<(Vec<ParameterId>, Vec<f64>)> =
        MOTIONS.par_iter().map(|motion| sigmas(setup, form, *motion)).collect::<Option<_>>()?;
    let (parameters, _) = results.first()?;
    let sensors = parameters.iter().enumerate().filter(|(_, it)| it.group() != ParameterGroup::Chain);
    let parameters: Vec<ParameterSigmas> = sensors
        .map(|(column, parameter)| {
            let sigmas: Vec<f64> = results.iter().map(|(_, sigmas)| sigmas[column]).collect();
            let first = MOTIONS.iter().zip(&sigmas).find(|(_, sigma)| **sigma < KNOWN);
            ParameterSigmas {
                name: setup.mechanism.names.name(*parameter),
                suggested: first.map(|(motion, _)| motion.name().to_owned()),
                sigmas,
            }
        })
        .collect();
    let motions = MOTIONS.map(|motion| motion.name().to_owned()).into();
    (!parameters.is_empty()).then_some(SensorExcitation { motions, parameters })
}

fn sigmas(
    setup: &LaboratorySetup,
    form: LaboratoryForm,
    motion: LaboratoryMotion,
) -> Option<(Vec<ParameterId>, Vec<f64>)> {
    let setup = LaboratorySetup { motion, ..setup.clone() };
    let linearization = linearize_sensors(&setup, form)?;
    let block = measured_block(&linearization)?.block;
    let count = block.ncols();
    let covariance = (block.tr_mul(&block) + DMatrix::identity(count, count)).cholesky()?.inverse();
    let parameters = linearization.columns.iter().filter_map(|block| block.id.parameter()).collect();
    Some((parameters, covariance.diagonal().iter().map(|variance| variance.sqrt()).collect()))
}

impl fmt::Display for SensorExcitation {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(out, "σ of sensor columns after each motion, in units of the column scale (1: not constrained)")?;
        let motions = self.motions.iter().map(|name| right(name.as_str(), name.len().max(5) + 2));
        let columns = [left("", 24)].into_iter().chain(motions).chain([left("  suggested", 0)]);
        let rows = self.parameters.iter().map(|parameter| {
            let sigmas = parameter.sigmas.iter().map(|sigma| format!("{sigma:.3}"));
            let suggested = format!("  {}", parameter.suggested.as_deref().unwrap_or("-"));
            [parameter.name.clone()].into_iter().chain(sigmas).chain([suggested]).collect::<Vec<_>>()
        });
        write!(out, "{}", TextTable::new(columns, rows))
    }
}
