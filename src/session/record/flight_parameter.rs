//! Rows of the calibration table: one parameter after a flight.

use serde::{Serialize, Serializer};

use crate::geometry::{Dimension, seconds_from_ns};
use crate::gimbal::ParameterId;
use crate::observability::{Determination, LossCause};
use crate::text::Named as _;

/// A calibration parameter at the end of a run, with the verdict of the whole flight on it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FlightParameter {
    #[serde(skip)]
    pub parameter: ParameterId,
    pub name: String,
    /// `chain`, `camera`, `IMU` or `clocks`.
    pub group: &'static str,
    /// Serialized as its unit.
    #[serde(rename = "unit")]
    pub dimension: Dimension,
    /// Estimate; angles of links and of the base block in (−π, π].
    pub value: f64,
    /// Posterior standard deviation in the unit of the value; `None` before the first solve.
    pub sigma: Option<f64>,
    pub prior_sigma: Option<f64>,
    /// Posterior divided by prior standard deviation.
    pub ratio: Option<f64>,
    /// Standard deviation by the measurements of the flight alone; `None` where the prior alone determines the value.
    pub flight_sigma: Option<f64>,
    /// Factor on the standard deviations of the measurements; see [`CalibrationEstimate`](crate::estimator::CalibrationEstimate).
    #[serde(skip)]
    pub sigma_scale: f64,
    /// Value minus ground-truth value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
    /// Required accuracy in the unit of the value.
    pub required: f64,
    pub verdict: Determination,
    /// Stamp from which the verdict holds without interruption, in nanoseconds since the log began (in files seconds).
    #[serde(rename = "since_s", serialize_with = "optional_seconds")]
    pub since_ns: Option<i64>,
    /// Cause of any other verdict than determined.
    pub cause: Option<LossCause>,
    /// Cause with its evidence; empty without a cause.
    pub reason: String,
    /// Motion, record or run that would improve the verdict; empty if none is known.
    pub remedy: String,
}

/// One calibration parameter, initial and final.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterSummary {
    /// Name, with the names of joints.
    pub name: String,
    /// Serialized as its unit.
    #[serde(rename = "unit")]
    pub dimension: Dimension,
    /// Value in the rig.
    pub initial: f64,
    /// Final value of the run.
    #[serde(rename = "final")]
    pub last: f64,
    pub sigma: Option<f64>,
    #[serde(rename = "truth", skip_serializing_if = "Option::is_none")]
    pub ground_truth: Option<f64>,
    /// Final minus ground-truth value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<f64>,
}

/// Writes a stamp in nanoseconds as seconds.
#[expect(clippy::ref_option, reason = "the signature that serde calls")]
pub(in crate::session) fn optional_seconds<S: Serializer>(
    stamp_ns: &Option<i64>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    stamp_ns.map(seconds_from_ns).serialize(serializer)
}

impl FlightParameter {
    /// Stamp from which the verdict holds, in seconds since the log began.
    pub fn since_s(&self) -> Option<f64> {
        self.since_ns.map(seconds_from_ns)
    }

    /// Error against the ground truth in standard deviations.
    pub fn error_in_sigmas(&self) -> Option<f64> {
        let sigma = self.sigma.filter(|sigma| *sigma > 0.0)?;
        Some(self.error? / sigma)
    }

    /// Posterior standard deviation divided by the required accuracy.
    pub fn of_required(&self) -> Option<f64> {
        self.sigma.map(|sigma| sigma / self.required)
    }

    /// Verdict, σ and start: `not determined (σ 7.4 mm, required 5 mm) since 3.55 s`.
    pub fn verdict_text(&self) -> String {
        let shown = self.parameter.shown();
        let sigma = self.sigma.map_or_else(String::new, |sigma| {
            format!(" (σ {}, required {})", shown.sigma(sigma), shown.sigma(self.required))
        });
        let since = self.since_s().map_or_else(String::new, |since_s| format!(" since {since_s:.2} s"));
        format!("{}{sigma}{since}", self.verdict.name())
    }

    /// The row as one text, for a screen reader and the clipboard.
    pub fn sentence(&self) -> String {
        let mut text = format!("{} {}", self.name, self.verdict_text());
        for part in [&self.reason, &self.remedy].into_iter().filter(|part| !part.is_empty()) {
            text.push_str("; ");
            text.push_str(part);
        }
        text
    }
}
