//! Source of the times of a topic: header stamps or log times.

use crate::flight_log::log::relative_ns;
use crate::flight_log::messages::MessageKind;
use crate::flight_log::{FlightLog, LogError, messages};
use crate::geometry::seconds_from_ns;

/// Stamps and log times this far outside of the log's stamps belong to another clock.
const TOLERANCE_NS: i64 = 60_000_000_000;

/// Source of the times of a topic's messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StampClock {
    /// Header stamps of the messages.
    Stamps,
    /// Log times, since the clock of the stamps has no known relation to the log's.
    LogTimes {
        /// First stamp since the zero of that clock.
        first_stamp_ns: i64,
    },
    /// Log times, because the rig has `use_log_time` for the sensor.
    LogTimesOfRig,
}

impl StampClock {
    /// Clock of a sensor whose stamps are of the log's time unless the rig has `use_log_time` for it.
    pub(crate) fn of_rig(use_log_time: bool) -> Self {
        if use_log_time { Self::LogTimesOfRig } else { Self::Stamps }
    }

    /// Selects the clock of a topic. Stamps of PX4 count from its start unless its bridge has converted them; they are
    /// used if the first one lies within the times of the log. An error if neither stamps nor log times do.
    pub(crate) fn of(log: &FlightLog, topic: &str, kind: MessageKind) -> Result<Self, LogError> {
        if !kind.counts_since_boot() {
            return Ok(Self::Stamps);
        }
        let Some(first_stamp_ns) = log.find_message(topic, |data| messages::stamp_ns(kind, data).ok()) else {
            return Ok(Self::Stamps);
        };
        let last_ns = log.duration_ns().saturating_add(TOLERANCE_NS);
        let fits = |since_start_ns: i64| (-TOLERANCE_NS..=last_ns).contains(&since_start_ns);
        let first_log_ns = log.topic(topic).map_or(0, |info| info.first_ns);
        if fits(relative_ns(first_stamp_ns, log.epoch_ns())) {
            Ok(Self::Stamps)
        } else if fits(first_log_ns) {
            Ok(Self::LogTimes { first_stamp_ns })
        } else {
            let (stamp, log_s) = (stamp_text(first_stamp_ns), seconds_from_ns(first_log_ns));
            Err(LogError::UnknownClock { topic: topic.to_owned(), stamp, log_s, path: log.path().to_owned() })
        }
    }

    /// Selects the stamp or the log time of a message, both since the epoch.
    pub(crate) fn stamp_ns(self, stamp_ns: i64, log_time_ns: u64) -> i64 {
        match self {
            Self::Stamps => stamp_ns,
            Self::LogTimes { .. } | Self::LogTimesOfRig => i64::try_from(log_time_ns).unwrap_or(i64::MAX),
        }
    }

    /// Warning about unused stamps.
    pub(crate) fn warning(self, topic: &str) -> Option<String> {
        let Self::LogTimes { first_stamp_ns } = self else { return None };
        Some(format!(
            "{topic}: the stamps count from PX4's start (the first is {}), with an unknown offset to \
             the other topics; the log times are used, with their delay and jitter (synchronize the clocks: \
             UXRCE_DDS_SYNCT 1)",
            stamp_text(first_stamp_ns)
        ))
    }
}

/// Stamp in seconds, unless it is the largest number, with which unset stamps are written.
fn stamp_text(stamp_ns: i64) -> String {
    if stamp_ns == i64::MAX { "no time".to_owned() } else { format!("{:.3} s", seconds_from_ns(stamp_ns)) }
}
