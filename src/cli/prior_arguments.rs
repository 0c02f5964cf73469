//! Arguments of the sub-commands that start from the calibration of earlier flights.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use clap::Args;
use dcvins::export;
use dcvins::session::FlightPrior;

/// Calibration of earlier flights and the growth of its standard deviations.
#[derive(Args, Clone, Debug)]
pub(crate) struct PriorArguments {
    /// Start from the calibration of earlier flights, values and covariance: the folder of a run (OUT/NAME of
    /// 'dcvins run') or of 'dcvins calibrate'.
    #[arg(long, value_name = "DIR")]
    pub prior: Option<PathBuf>,
    /// Factor on the standard deviations of an earlier flight when another one starts from them: 1 if nothing was changed
    /// in between, 2 to 5 after work on the mechanism.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = growth)]
    pub prior_growth: f64,
}

fn growth(text: &str) -> Result<f64, String> {
    let factor: f64 = text.parse().map_err(|problem| format!("{problem}: '{text}'"))?;
    if (1.0..=1e3).contains(&factor) { Ok(factor) } else { Err("expected a factor from 1 to 1000".to_owned()) }
}

impl PriorArguments {
    /// Reads the calibration, `None` without one.
    pub(crate) fn read(&self) -> Result<Option<Arc<FlightPrior>>> {
        let read = |folder: &PathBuf| export::read_prior(folder, self.prior_growth);
        Ok(self.prior.as_ref().map(read).transpose()?.map(Arc::new))
    }
}
