//! Arguments of the sub-commands that start from the calibration of earlier flights.

use std::path::PathBuf;
use std::sync::Arc;

use anyhow::Result;
use clap::Args;
use dcvins::export;
use dcvins::session::FlightPrior;

use crate::cli::value_parsers::within;

/// Calibration of earlier flights and the growth of its standard deviations.
#[derive(Args, Clone, Debug, Default)]
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
    within(text, 1.0..=1000.0, "a factor")
}

impl PriorArguments {
    /// Reads the calibration, `None` without one.
    pub(crate) fn read(&self) -> Result<Option<Arc<FlightPrior>>> {
        let read = |folder: &PathBuf| export::read_prior(folder, self.prior_growth);
        Ok(self.prior.as_ref().map(read).transpose()?.map(Arc::new))
    }
}
