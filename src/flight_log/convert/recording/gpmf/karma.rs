//! Telemetry that a `GoPro` Karma drone adds to the camera's telemetry, about four times a second.

use super::super::mp4::Payload;
use super::super::recorded::{Recorded, finite, from_euler, nanoseconds};
use super::items::{Item, Properties};
use crate::flight_log::trajectory::geodesy::Geodetic;
use crate::sensors::STANDARD_GRAVITY_M_PER_S2;

/// Drone telemetry in drone time, with the samples that relate drone time to video time.
#[derive(Debug)]
pub(super) struct Karma {
    recorded: Recorded,
    /// Lower and upper bound of video time minus drone time such that every sample lies in its payload, in nanoseconds.
    offset_ns: Option<(i64, i64)>,
}

impl Default for Karma {
    fn default() -> Self {
        Self { recorded: Recorded::new("GoPro Karma", ""), offset_ns: None }
    }
}

impl Karma {
    /// Stores the samples of an item; returns `false` unless it is an item of a drone.
    pub(super) fn take(&mut self, item: &Item<'_>, properties: &Properties, payload: &Payload) -> bool {
        let key = match &item.key {
            b"ATTD" => "ATTD",
            b"LNED" => "LNED",
            b"GLPI" => "GLPI",
            b"SIMU" => "SIMU",
            b"SYST" => "SYST",
            _ => return false,
        };
        for row in item.rows(&properties.letters, &properties.scales) {
            if self.take_row(key, &row, payload).is_none() {
                self.recorded.leave(key, "with invalid numbers");
            }
        }
        true
    }

    /// Stores a sample of a stream; the first number is the time in seconds since the drone started.
    fn take_row(&mut self, key: &str, row: &[f64], payload: &Payload) -> Option<()> {
        let time_ns = nanoseconds(*row.first()?, 1e9)?;
        let three = |at: usize| finite([*row.get(at)?, *row.get(at + 1)?, *row.get(at + 2)?]);
        match key {
            "ATTD" => self.recorded.attitudes.push((0, 0), key, time_ns, from_euler(three(1)?.into())?),
            "LNED" => self.recorded.positions.push((0, 0), key, time_ns, three(1)?),
            "GLPI" => {
                let [latitude_deg, longitude_deg, altitude_m] = three(1)?.into();
                let fix = Geodetic::from_deg(latitude_deg, longitude_deg, altitude_m)?;
                self.recorded.fixes.push((0, 0), key, time_ns, fix);
            }
            "SIMU" => {
                let sample = [three(4)?, three(1)? * STANDARD_GRAVITY_M_PER_S2];
                self.recorded.imu(key).combined.push((time_ns, sample));
            }
            // SYST: time since the start, and UTC, both in seconds.
            _ => {
                let utc_ns = nanoseconds(*row.get(1)?, 1e9)?;
                self.recorded.utc.push((time_ns, utc_ns));
            }
        }
        let (latest, earliest) = (payload.start_ns.saturating_sub(time_ns), payload.end_ns.saturating_sub(time_ns));
        let (lower, upper) = self.offset_ns.unwrap_or((latest, earliest));
        self.offset_ns = Some((lower.max(latest), upper.min(earliest)));
        Some(())
    }

    /// Telemetry in video time; `None` without a drone.
    pub(super) fn finish(self) -> Option<Recorded> {
        let Self { mut recorded, offset_ns } = self;
        let (lower, upper) = offset_ns?;
        let offset_ns = i64::midpoint(lower, upper);
        recorded.shift(offset_ns);
        recorded.notes.push(format!(
            "the drone's clock is aligned with the video by the payloads of its samples, within {:.3} s",
            (upper.abs_diff(lower) / 2) as f64 * 1e-9
        ));
        Some(recorded)
    }
}
