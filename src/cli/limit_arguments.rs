//! Limits on foreign files, shared by the sub-commands that read logs.

use clap::Args;
use dcvins::flight_log::{LimitSetting, LogLimits};

/// Limits on the content of a file.
#[derive(Args, Clone, Debug, Default)]
pub(crate) struct LimitArguments {
    /// Raise or lower a limit on the content of a file: NAME one of record-bytes (a chunk or message in memory),
    /// unpacked-bytes (a compressed file), messages, topics, name-bytes, image-pixels; NUMBER may end in K, M or G.
    #[arg(long = "limit", value_name = "NAME=NUMBER")]
    pub settings: Vec<LimitSetting>,
}

impl LimitArguments {
    /// Default limits, changed by these arguments.
    pub(crate) fn limits(&self) -> LogLimits {
        LogLimits { settings: self.settings.clone() }
    }
}
