//! Telemetry of `ArduPilot`'s `AP_CameraGimbal` in the frames of its videos: SEI messages with JSON of the schema
//! `apcg.telemetry.v1` (its `camera_app/README.md`, Video telemetry metadata).

use serde::Deserialize;

use super::mp4::Video;
use super::recorded::{GimbalAttitude, GimbalFrame, Recorded, from_euler};
use crate::flight_log::trajectory::geodesy::Geodetic;
use crate::geometry::median;

/// Identifier of the messages.
const UUID: [u8; 16] = [0x8d, 0x64, 0x6b, 0x4e, 0x55, 0x6f, 0x4a, 0x90, 0x8b, 0x7c, 0x35, 0xe6, 0x29, 0x51, 0x03, 0x21];
const SCHEMA: &str = "apcg.telemetry.v1";
/// Name of the format in the report.
const FORMAT: &str = "AP_CameraGimbal SEI";
/// Sources expire after this age.
const MAX_AGE_MS: f64 = 10_000.0;
/// Frames repeat a measurement with a larger age, in whole milliseconds, until there is a newer one.
const REPEATED_NS: i64 = 20_000_000;

/// Content of a message, as far as it is used; what is unknown is `null`.
#[derive(Debug, Deserialize)]
struct FrameTelemetry {
    schema: String,
    utc_us: Option<i64>,
    position: Option<TelemetryPosition>,
    vehicle_attitude: Option<TelemetryAngles>,
    gimbal_attitude: Option<TelemetryAngles>,
    hfov_deg: Option<f64>,
}

/// Angles in radians, with the time since the measurement.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
struct TelemetryAngles {
    roll_rad: f64,
    pitch_rad: f64,
    yaw_rad: f64,
    #[serde(default)]
    age_ms: f64,
}

/// Position in degrees × 10⁷ and metres, with the time since the measurement.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
struct TelemetryPosition {
    lat_e7: f64,
    lon_e7: f64,
    alt_amsl_m: f64,
    #[serde(default)]
    age_ms: f64,
}

/// Last measurement of a source: its time and its numbers.
#[derive(Clone, Copy, Debug, Default)]
struct LastMeasurement(Option<(i64, [f64; 3])>);

impl LastMeasurement {
    /// Time of a measurement in a frame; `None` if a frame before had it or if it has expired.
    fn time_of_new(&mut self, frame_ns: i64, age_ms: f64, numbers: [f64; 3]) -> Option<i64> {
        if !(0.0..=MAX_AGE_MS).contains(&age_ms) {
            return None;
        }
        let time_ns = frame_ns.saturating_sub((age_ms * 1e6) as i64);
        let is_repeated = self.0.is_some_and(|(last_ns, last)| {
            time_ns <= last_ns || (numbers == last && time_ns.saturating_sub(last_ns) < REPEATED_NS)
        });
        if !is_repeated {
            self.0 = Some((time_ns, numbers));
        }
        (!is_repeated).then_some(time_ns)
    }
}

/// Telemetry read so far.
struct ReadMessages {
    recorded: Recorded,
    vehicle: LastMeasurement,
    gimbal: LastMeasurement,
    position: LastMeasurement,
    /// Horizontal fields of view in degrees.
    fields_of_view_deg: Vec<f64>,
}

/// Reads the messages of all frames, in nanoseconds since the start of the video; `None` without a message. The second
/// value is the horizontal field of view in degrees, the median of all frames.
pub(super) fn read(video: &Video) -> Option<(Recorded, Option<f64>)> {
    let mut state = ReadMessages {
        recorded: Recorded::new(FORMAT, ""),
        vehicle: LastMeasurement::default(),
        gimbal: LastMeasurement::default(),
        position: LastMeasurement::default(),
        fields_of_view_deg: Vec::new(),
    };
    let mut count = 0;
    video.each_message(UUID, |frame_ns, content| {
        count += 1;
        // Some writers end the text with a zero.
        let text = content.strip_suffix(&[0]).unwrap_or(content);
        match serde_json::from_slice::<FrameTelemetry>(text) {
            Ok(telemetry) if telemetry.schema == SCHEMA => state.take(frame_ns, &telemetry),
            Ok(_) => state.recorded.leave(FORMAT, "of another schema"),
            Err(_) => state.recorded.leave(FORMAT, "no JSON with the fields of apcg.telemetry.v1"),
        }
    });
    if count == 0 {
        return None;
    }
    let ReadMessages { mut recorded, fields_of_view_deg, .. } = state;
    let median_deg = median(fields_of_view_deg.iter().copied());
    let narrow = fields_of_view_deg.iter().copied().fold(f64::INFINITY, f64::min);
    let wide = fields_of_view_deg.iter().copied().fold(0.0, f64::max);
    if let Some(median) = median_deg.filter(|_| wide > narrow * 1.01) {
        recorded.notes.push(format!(
            "the camera zooms: its horizontal field of view is {narrow:.1}° to {wide:.1}°, {median:.1}° in the median; a \
             rig has one camera model: convert the parts of one zoom with --start and --duration of the commands"
        ));
    }
    Some((recorded, median_deg))
}

impl ReadMessages {
    fn take(&mut self, frame_ns: i64, telemetry: &FrameTelemetry) {
        let Self { recorded, .. } = self;
        if let Some(utc_ns) = telemetry.utc_us.and_then(|utc_us| utc_us.checked_mul(1000)).filter(|ns| *ns > 0) {
            recorded.utc.push((frame_ns, utc_ns));
        }
        if let Some(angles) = telemetry.vehicle_attitude {
            let numbers = [angles.roll_rad, angles.pitch_rad, angles.yaw_rad];
            if let Some(time_ns) = self.vehicle.time_of_new(frame_ns, angles.age_ms, numbers)
                && let Some(rotation) = from_euler(numbers)
            {
                // An autopilot's own log is preferred.
                recorded.attitudes.push((4, 0), "apcg vehicle_attitude", time_ns, rotation);
            }
        }
        if let Some(angles) = telemetry.gimbal_attitude {
            // Roll and pitch are relative to the horizon, yaw is relative to the vehicle.
            let numbers = [angles.roll_rad, angles.pitch_rad, angles.yaw_rad];
            if let Some(time_ns) = self.gimbal.time_of_new(frame_ns, angles.age_ms, numbers)
                && let Some(frame_from_camera) = from_euler(numbers)
            {
                let attitude = GimbalAttitude { frame: GimbalFrame::Vehicle, frame_from_camera };
                recorded.gimbal.push((2, 0), "apcg gimbal_attitude", time_ns, attitude);
            }
        }
        if let Some(position) = telemetry.position {
            let numbers = [position.lat_e7 * 1e-7, position.lon_e7 * 1e-7, position.alt_amsl_m];
            let [latitude_deg, longitude_deg, altitude_m] = numbers;
            if let Some(time_ns) = self.position.time_of_new(frame_ns, position.age_ms, numbers)
                && let Some(fix) = Geodetic::from_deg(latitude_deg, longitude_deg, altitude_m)
            {
                recorded.fixes.push((4, 0), "apcg position", time_ns, fix);
            }
        }
        let field_of_view = telemetry.hfov_deg.filter(|deg| (1.0..=220.0).contains(deg));
        self.fields_of_view_deg.extend(field_of_view);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    #[test]
    fn repeated_measurements_are_taken_once() {
        let mut last = LastMeasurement::default();
        let a = [0.1, 0.2, 0.3];
        assert_eq!(last.time_of_new(100 * MS, 40.0, a), Some(60 * MS));
        assert_eq!(last.time_of_new(133 * MS, 74.0, a), None, "the same one, a rounding earlier");
        assert_eq!(last.time_of_new(166 * MS, 105.0, a), None, "the same one, a rounding later");
        assert_eq!(last.time_of_new(200 * MS, 10.0, a), Some(190 * MS), "a new one of equal numbers");
        assert_eq!(last.time_of_new(210 * MS, 15.0, [0.1, 0.2, 0.4]), Some(195 * MS));
        assert_eq!(last.time_of_new(300 * MS, 10_001.0, a), None);
        assert_eq!(last.time_of_new(300 * MS, f64::NAN, a), None);
    }
}
