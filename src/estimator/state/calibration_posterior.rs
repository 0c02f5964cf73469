//! Calibration at the end of a flight: values with the covariance of their columns, as prior of another flight.

use std::ops::Range;

use nalgebra::DMatrix;

use super::earlier_pass::FoundCamera;
use crate::gimbal::{Chain, ClassicalChain, ParameterGroup, ParameterId, ParameterPart, Parameterization, Quantity};

/// Calibrations of the cameras of a run or of an offline calibration, with their joint covariance.
#[derive(Clone, Debug, PartialEq)]
pub struct CalibrationPosterior {
    /// The main camera first.
    pub cameras: Vec<CameraPosterior>,
    /// Covariance of the columns of all cameras, in their order; in radians, metres, seconds and pixels.
    pub covariance: DMatrix<f64>,
    /// Mean and covariance of the same columns before any measurement of the flight; `None` if a file does not hold them.
    pub before: Option<ColumnBelief>,
}

/// Mean and covariance of the columns of a calibration, in radians, metres, seconds and pixels.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnBelief {
    pub values: Vec<f64>,
    pub covariance: DMatrix<f64>,
}

/// Calibration of one camera: its chain, then time offsets, shutter and intrinsics.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPosterior {
    pub chain: ClassicalChain,
    pub parameterization: Parameterization,
    /// Parameters of the columns, with the names of the main camera's parameters.
    pub parameters: Vec<ParameterId>,
    pub values: Vec<f64>,
    /// Standard deviations of the columns under the prior of the rig.
    pub rig_sigmas: Vec<f64>,
}

/// Calibrations of earlier flights as prior of a run.
#[derive(Clone, Debug)]
pub struct CalibrationPrior {
    /// By camera of the run, the main one first; `None` keeps the rig's prior.
    pub(crate) cameras: Vec<Option<FoundCamera>>,
}

impl CameraPosterior {
    /// Number of columns of the chain, which are the first.
    pub fn chain_columns(&self) -> usize {
        self.parameters.iter().filter(|parameter| parameter.group() == ParameterGroup::Chain).count()
    }

    /// True if the columns have joint offsets, or the parameterization has none: encoders were used.
    pub fn has_joint_offsets(&self) -> bool {
        self.chain_columns() == Chain::from_classical(&self.chain, self.parameterization).dof()
    }
}

impl CalibrationPosterior {
    /// Columns of a camera in the covariance.
    pub fn columns(&self, camera: usize) -> Range<usize> {
        let start = self.cameras[..camera].iter().map(|camera| camera.parameters.len()).sum();
        start..start + self.cameras[camera].parameters.len()
    }

    /// Standard deviations of all columns.
    pub fn sigmas(&self) -> Vec<f64> {
        self.covariance.diagonal().iter().map(|variance| variance.max(0.0).sqrt()).collect()
    }

    /// This posterior with all standard deviations multiplied by `growth`; correlations stay.
    #[must_use]
    pub fn grown(&self, growth: f64) -> Self {
        Self { covariance: &self.covariance * (growth * growth), ..self.clone() }
    }

    /// Prior of a run whose cameras are these, by index; correlations between cameras are not carried.
    pub fn prior(&self, cameras: &[Option<usize>]) -> CalibrationPrior {
        let found = |camera: &Option<usize>| camera.map(|camera| self.found(camera));
        CalibrationPrior { cameras: cameras.iter().map(found).collect() }
    }

    /// Calibration of one camera with absolute values of the columns after the chain's.
    ///
    /// The pose of an IMU on the gimbal is left out: its columns are relative to the rig of their run.
    fn found(&self, camera: usize) -> FoundCamera {
        let (columns, one) = (self.columns(camera), &self.cameras[camera]);
        let is_relative = |parameter: &ParameterId| {
            parameter.part == ParameterPart::GimbalImu && Quantity::TRANSFORM.contains(&parameter.quantity)
        };
        let kept: Vec<usize> = (0..columns.len()).filter(|place| !is_relative(&one.parameters[*place])).collect();
        let block = self.covariance.view_range(columns.clone(), columns);
        let sensors = kept.iter().filter(|place| **place >= one.chain_columns());
        FoundCamera {
            chain: Chain::from_classical(&one.chain, one.parameterization),
            covariance: block.select_rows(&kept).select_columns(&kept),
            sensors: sensors.map(|place| (one.parameters[*place], one.values[*place])).collect(),
        }
    }
}
