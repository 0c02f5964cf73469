//! Calibration of earlier flights as prior of the runs of a session or of an offline calibration.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::error::SessionError;
use crate::calibration::ChainDistance;
use crate::estimator::{CalibrationPosterior, CalibrationPrior, EstimatorConfig};
use crate::gimbal::{ClassicalChain, generic_joint_angles};

/// Mean distance of the camera over all joint angles beyond which two chains are different mechanisms: 0.3 m and 45°,
/// five times the largest bounds of a chain that was measured with a ruler.
const MAX_CHAIN_DISTANCE: (f64, f64) = (0.3, std::f64::consts::FRAC_PI_4);
/// Number of joint angles at which chains are compared.
const COMPARED_ANGLES: usize = 24;

/// Posterior of earlier flights, read from the folder of a run or of an offline calibration.
#[derive(Clone, Debug, PartialEq)]
pub struct FlightPrior {
    /// Folder of the run or the calibration.
    pub folder: PathBuf,
    /// Keys of the cameras of the posterior, in its order.
    pub cameras: Vec<String>,
    /// Names of the joints, from base to end effector.
    pub joints: Vec<String>,
    pub posterior: CalibrationPosterior,
    /// Factor on all standard deviations, for changes of the mechanism since those flights.
    pub growth: f64,
    pub history: Vec<FlightSigmas>,
}

/// Standard deviations of calibration parameters by name after a flight, or of the rig's prior.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FlightSigmas {
    /// Log with the name of its run, or the rig.
    pub source: String,
    pub sigmas: BTreeMap<String, f64>,
}

impl FlightPrior {
    /// Prior of a run with these cameras, the main one first; `joints` are the names of the rig's joints.
    ///
    /// # Errors
    /// If the run estimates another mechanism or other columns of the chain; the error names the first difference.
    pub(in crate::session) fn of_run(
        &self,
        run: &str,
        cameras: &[&str],
        joints: &[String],
        config: &EstimatorConfig,
    ) -> Result<CalibrationPrior, SessionError> {
        let refused = |problem: String| SessionError::Prior {
            user: format!("the run '{run}'"),
            problem,
            folder: self.folder.clone(),
        };
        if !config.calibrate {
            let remedy = "give its rig.yaml with --rig instead";
            return Err(refused(format!("the run does not estimate the calibration (calibrate=off); {remedy}")));
        }
        let places: Vec<Option<usize>> = cameras.iter().map(|key| self.place(key)).collect();
        self.check_cameras(cameras, &places).map_err(refused)?;
        if let Some(camera) = places.first().copied().flatten() {
            self.check_chain(camera, &config.chain, joints, config.encoder_in_use().is_some()).map_err(refused)?;
        }
        Ok(self.posterior.grown(self.growth).prior(&places))
    }

    /// Index of a camera of the posterior, `None` without it.
    pub(in crate::session) fn place(&self, key: &str) -> Option<usize> {
        self.cameras.iter().position(|known| known == key)
    }

    /// Requires one camera of a run in the posterior; `places` has the place of each of `cameras`.
    pub(in crate::session) fn check_cameras(&self, cameras: &[&str], places: &[Option<usize>]) -> Result<(), String> {
        if places.iter().any(Option::is_some) {
            return Ok(());
        }
        Err(format!("it has the calibration of {}, needed is that of {}", self.cameras.join(", "), cameras.join(", ")))
    }

    /// Compares the mechanism of a camera of the posterior with a chain of the rig; returns the first difference.
    pub(in crate::session) fn check_chain(
        &self,
        camera: usize,
        chain: &ClassicalChain,
        joints: &[String],
        encoders: bool,
    ) -> Result<(), String> {
        let (of_prior, key) = (&self.posterior.cameras[camera], &self.cameras[camera]);
        let names = |joints: &[String]| if joints.is_empty() { "none".to_owned() } else { joints.join(", ") };
        if of_prior.chain.joint_count() != chain.joint_count() {
            let count =
                |joints: usize| if joints == 0 { "on no joint".to_owned() } else { format!("on {joints} joints") };
            let (prior, rig) = (count(of_prior.chain.joint_count()), count(chain.joint_count()));
            return Err(format!("its camera {key} is {prior}, that of the rig {rig}"));
        }
        if chain.joint_count() == 0 {
            return Ok(());
        }
        if self.joints != joints {
            return Err(format!("its joints are {}, those of the rig {}", names(&self.joints), names(joints)));
        }
        if of_prior.has_joint_offsets() != encoders {
            let of = |encoders: bool| if encoders { "with encoders" } else { "without encoders" };
            let (prior, run) = (of(of_prior.has_joint_offsets()), of(encoders));
            return Err(format!("it was estimated {prior}, so that its columns differ from those {run}"));
        }
        let angles = generic_joint_angles(chain.joint_count(), COMPARED_ANGLES);
        let distance = ChainDistance::over(&of_prior.chain, chain, &angles);
        let far = distance.filter(|distance| {
            distance.translation_mean_m > MAX_CHAIN_DISTANCE.0 || distance.rotation_mean_rad > MAX_CHAIN_DISTANCE.1
        });
        far.map_or(Ok(()), |far| {
            let (distance_m, angle_deg) = (far.translation_mean_m, far.rotation_mean_rad.to_degrees());
            Err(format!("its camera {key} is {distance_m:.2} m and {angle_deg:.0}° away from that of the rig"))
        })
    }
}
