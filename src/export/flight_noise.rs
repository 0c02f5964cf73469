//! Noise densities fitted to a flight, as a report and as lines of a rig.

use std::fmt::{self, Display, Formatter, Write as _};

use serde::Serialize;

use crate::calibration::{FittedDensity, FlightNoise, NoiseDensity};
use crate::geometry::seconds_from_ns;
use crate::table::text::{TextTable, left, right};
use crate::text::{Named as _, printable};

/// One density of [`FlightNoiseReport`].
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DensityReport {
    /// Key in the rig's `imu0`.
    pub key: &'static str,
    pub unit: &'static str,
    pub rig: f64,
    /// Value with which χ² of the residuals equals their degrees of freedom; the rig's value if it is unobservable in
    /// this flight.
    pub found: f64,
    /// Standard deviation; `None` if the density is unobservable in this flight.
    pub sigma: Option<f64>,
    /// Normalized innovation squared (NIS) per degree of freedom with the rig's value.
    pub nis_before: f64,
    /// NIS per degree of freedom with the fitted value.
    pub nis_after: f64,
    pub degrees_of_freedom: f64,
}

/// Noise densities of a rig fitted to a flight.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FlightNoiseReport {
    pub log: String,
    pub rig: String,
    /// Key of the camera whose images were used.
    pub camera: String,
    /// Start and end of the used part of the flight, in seconds since the log began.
    pub span_s: (f64, f64),
    /// Number of intervals between keyframes.
    pub intervals: usize,
    /// Mean length of these intervals in seconds.
    pub mean_interval_s: f64,
    pub runs: usize,
    pub converged: bool,
    /// White noise of gyroscope and accelerometer, then the random walks of their biases.
    pub densities: Vec<DensityReport>,
}

impl FlightNoiseReport {
    /// Report of a fit; the texts are the names of log, rig and camera.
    pub fn new(noise: &FlightNoise, [log, rig, camera]: [String; 3]) -> Self {
        let density = |fitted: &FittedDensity| DensityReport {
            key: fitted.density.name(),
            unit: fitted.density.unit(),
            rig: fitted.given,
            found: fitted.found,
            sigma: fitted.sigma,
            nis_before: fitted.nis_before,
            nis_after: fitted.nis_after,
            degrees_of_freedom: fitted.degrees_of_freedom,
        };
        Self {
            log,
            rig,
            camera,
            span_s: (seconds_from_ns(noise.span_ns.0), seconds_from_ns(noise.span_ns.1)),
            intervals: noise.intervals,
            mean_interval_s: noise.mean_interval_s,
            runs: noise.runs,
            converged: noise.converged,
            densities: noise.densities.iter().map(density).collect(),
        }
    }

    /// Lines of a rig's `imu0`, in Kalibr's names.
    pub fn rig_lines(&self) -> String {
        let mut lines = String::from("imu0:\n");
        let order = [
            NoiseDensity::Accelerometer,
            NoiseDensity::AccelerometerWalk,
            NoiseDensity::Gyroscope,
            NoiseDensity::GyroscopeWalk,
        ];
        for found in order.iter().filter_map(|density| self.densities.iter().find(|it| it.key == density.name())) {
            let note = found
                .sigma
                .map_or_else(|| "unchanged: unobservable in this flight".to_owned(), |sigma| format!("σ {sigma:.1e}"));
            let _infallible = writeln!(lines, "  {}: {:.3e}  # {}, {note}", found.key, found.found, found.unit);
        }
        lines
    }
}

impl Display for FlightNoiseReport {
    fn fmt(&self, out: &mut Formatter<'_>) -> fmt::Result {
        writeln!(
            out,
            "{}: noise densities fitted to the flight from {:.1} to {:.1} s by {} ({} intervals of {:.2} s, {} runs{})",
            printable(&self.log),
            self.span_s.0,
            self.span_s.1,
            printable(&self.camera),
            self.intervals,
            self.mean_interval_s,
            self.runs,
            if self.converged { "" } else { "; not converged" }
        )?;
        let columns = [
            left("", 40),
            right("rig", 10),
            right("found ± σ", 22),
            right("ratio", 8),
            right("NIS/dof, rig", 14),
            right("NIS/dof", 12),
            right("dof", 8),
        ];
        let rows = self.densities.iter().map(|found| {
            let value = found.sigma.map_or_else(
                || "unobservable".to_owned(),
                |sigma| {
                    let scale = 10_f64.powf(found.found.log10().floor());
                    let power = scale.log10().round();
                    format!("({:.2} ± {:.2})e{power:.0}", found.found / scale, sigma / scale)
                },
            );
            [
                format!("{}, {}", found.key, found.unit),
                format!("{:.2e}", found.rig),
                value,
                found.sigma.map_or_else(String::new, |_| format!("{:.2}", found.found / found.rig)),
                format!("{:.2}", found.nis_before),
                format!("{:.2}", found.nis_after),
                format!("{:.0}", found.degrees_of_freedom),
            ]
        });
        write!(out, "{}", TextTable::new(columns, rows))
    }
}
