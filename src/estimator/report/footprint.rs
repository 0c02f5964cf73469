//! Memory use of a report.

use super::step::FrameStateReport;
use super::{CalibrationEstimate, JacobianSource, StepReport};
use crate::estimator::problem::information_gain::InformationGain;
use crate::estimator::state::allocation::allocated_bytes;

/// Memory use of a report, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReportBytes {
    pub window: usize,
    pub calibration: usize,
    /// Features without their observations.
    pub features: usize,
    pub observations: usize,
    pub landmarks: usize,
    /// Bytes of the linearization; zero if it is not stored.
    pub linearization: usize,
    pub jacobian: usize,
    /// Report struct, events, residuals, iterations and warnings.
    pub other: usize,
}

impl ReportBytes {
    pub fn total(&self) -> usize {
        self.window
            + self.calibration
            + self.features
            + self.observations
            + self.landmarks
            + self.linearization
            + self.jacobian
            + self.other
    }
}

fn of_vec<T>(vec: &Vec<T>) -> usize {
    allocated_bytes(vec.capacity() * size_of::<T>())
}

fn of_text(text: &String) -> usize {
    allocated_bytes(text.capacity())
}

impl StepReport {
    /// Memory use of the report.
    pub fn bytes(&self) -> ReportBytes {
        let messages = self.events.iter().map(|event| of_text(&event.message)).sum::<usize>()
            + self.warnings.iter().map(|warning| of_text(&warning.cause)).sum::<usize>();
        let linearization = self.linearization.as_ref().map_or(0, |linearization| {
            let numbers = linearization.jacobian.len()
                + linearization.prior_jacobian.len()
                + linearization.calibration_column_norms.len();
            of_vec(&linearization.columns) + numbers * size_of::<f64>()
        });
        ReportBytes {
            window: of_vec(&self.window) + self.window.iter().map(of_frame).sum::<usize>(),
            calibration: of_calibration(&self.calibration),
            features: of_vec(&self.features),
            observations: self
                .features
                .iter()
                .flat_map(|feature| [&feature.observations, &feature.matched])
                .map(|observations| allocated_bytes(observations.heap_bytes()))
                .sum(),
            landmarks: of_vec(&self.landmarks),
            linearization,
            jacobian: self.jacobian_source.as_ref().map_or(0, JacobianSource::heap_bytes)
                + self.gain.as_ref().map_or(0, InformationGain::heap_bytes),
            other: size_of::<Self>()
                + of_vec(&self.events)
                + of_vec(&self.residuals)
                + of_vec(&self.iterations)
                + of_vec(&self.warnings)
                + messages,
        }
    }
}

fn of_frame(frame: &FrameStateReport) -> usize {
    of_vec(&frame.joint_angles_rad)
        + frame.encoder_angles_rad.as_ref().map_or(0, of_vec)
        + frame.encoder_sigmas_rad.as_ref().map_or(0, of_vec)
}

fn of_calibration(calibration: &CalibrationEstimate) -> usize {
    of_vec(&calibration.parameters)
        + of_vec(&calibration.values)
        + of_vec(&calibration.sigmas)
        + of_vec(&calibration.prior_sigmas)
        + of_vec(&calibration.classical.links)
        + of_vec(&calibration.margins)
        + of_vec(&calibration.further_cameras)
        + calibration
            .further_cameras
            .iter()
            .map(|camera| of_text(&camera.key) + camera.base.as_ref().map_or(0, of_text))
            .sum::<usize>()
}
