//! Information about the calibration that a run has collected over its log.

use nalgebra::DMatrix;

use super::run::RunRecord;
use crate::gimbal::{Chain, ParameterGroup, ParameterId};
use crate::observability::InformationTrack;
use crate::sensors::Rig;

/// Variance added to every column of the prior, so that it stays regular when the rig fixes a column.
const MIN_VARIANCE: f64 = 1e-12;

/// Parameters of a run's calibration, with the information about them by step.
#[derive(Clone, Debug, Default)]
pub struct CollectedInformation {
    pub parameters: Vec<ParameterId>,
    pub track: InformationTrack,
}

impl RunRecord {
    /// Information about the calibration after each step, beyond the rig's prior; the reason if there is none.
    pub fn collected_information(&self, rig: &Rig) -> Result<CollectedInformation, String> {
        let ranked = || {
            self.steps.iter().filter_map(|step| {
                let rank = step.rank.as_ref().filter(|rank| rank.posterior.columns() == rank.parameters.len())?;
                Some((step.report.stamp_ns, rank))
            })
        };
        let name = &self.spec.label;
        let Some((_, last)) = ranked().next_back() else {
            return Err(format!(
                "the run '{name}' has no information about a calibration (it never initialized, or calibrate=off)"
            ));
        };
        if ranked().any(|(_, rank)| rank.parameters != last.parameters) {
            return Err(format!(
                "the run '{name}' changes its parameterization, so that its information does not add up; use a fixed one (--run minimal)"
            ));
        }
        let start_ns = self.steps.first().map_or(0, |step| step.report.stamp_ns);
        let first_ns = ranked().next().map_or(start_ns, |(stamp_ns, _)| stamp_ns);
        let restarts = self.steps.last().map_or(0, |step| step.report.restarts);
        if restarts > 0 {
            return Err(format!("the run '{name}' restarted {restarts} times, which discards what it had measured"));
        }
        let prior = self.scaled_prior(rig, &last.parameters);
        let (stamps_ns, information) =
            ranked().map(|(stamp_ns, rank)| (stamp_ns, rank.posterior.information())).unzip();
        Ok(CollectedInformation {
            parameters: last.parameters.clone(),
            track: InformationTrack { start_ns, stamps_ns, information, prior, lead_ns: first_ns - start_ns },
        })
    }

    /// Information of the rig's prior about these parameters, in units of their scales.
    fn scaled_prior(&self, rig: &Rig, parameters: &[ParameterId]) -> DMatrix<f64> {
        let count = parameters.len();
        let mut covariance = DMatrix::zeros(count, count);
        let estimate =
            self.steps.iter().rev().map(|step| &step.report.calibration).find(|it| !it.prior_sigmas.is_empty());
        if let Some(estimate) = estimate {
            for (place, parameter) in parameters.iter().enumerate() {
                let known = estimate.parameters.iter().position(|known| known == parameter);
                let sigma = known
                    .and_then(|known| estimate.prior_sigmas.get(known))
                    .copied()
                    .unwrap_or_else(|| parameter.scale());
                covariance[(place, place)] = sigma * sigma;
            }
            let camera = rig.cameras.iter().find(|camera| camera.key == self.camera_key);
            if let (Some(camera), Some(classical)) = (camera, rig.chain_of_camera(&self.camera_key)) {
                let whole = Chain::from_classical(&classical, estimate.parameterization);
                let own: Vec<ParameterId> = parameters
                    .iter()
                    .copied()
                    .filter(|parameter| parameter.group() == ParameterGroup::Chain && parameter.part.camera() == 0)
                    .collect();
                let forms = [whole.clone(), whole.without_joint_offsets()];
                let form = forms.iter().find(|form| form.parameters() == own && parameters.starts_with(&own));
                if let Some(form) = form {
                    let (translation_m, rotation_rad) = rig.extrinsics_prior(camera).sigmas();
                    let of_chain = form.prior_covariance(&classical, translation_m, rotation_rad);
                    covariance.view_mut((0, 0), of_chain.shape()).copy_from(&of_chain);
                }
            }
        }
        for place in 0..count {
            covariance[(place, place)] += MIN_VARIANCE;
        }
        let diagonal = DMatrix::from_diagonal(&covariance.diagonal().map(f64::recip));
        let mut information = covariance.cholesky().map_or(diagonal, |factor| factor.inverse());
        for (row, of_row) in parameters.iter().enumerate() {
            for (column, of_column) in parameters.iter().enumerate() {
                information[(row, column)] *= of_row.scale() * of_column.scale();
            }
        }
        information
    }
}
