//! GPMF, the telemetry in videos of `GoPro` cameras: gyroscope, accelerometer and receiver of the camera, and the
//! telemetry of a Karma drone.

mod clock;
mod items;
mod karma;

use nalgebra::Vector3;

use super::mp4::Payload;
use super::recorded::{Recorded, finite, nanoseconds};
use crate::flight_log::trajectory::geodesy::Geodetic;
use clock::{Mark, sample_times_ns};
use items::{Item, Properties, items};
use karma::Karma;

/// Name of the format in the report.
const FORMAT: &str = "GoPro GPMF";
/// Items that describe the samples after them.
const PROPERTIES: [&[u8; 4]; 16] = [
    b"STNM", b"SIUN", b"UNIT", b"SCAL", b"TYPE", b"TSMP", b"EMPT", b"TMPC", b"ORIN", b"ORIO", b"MTRX", b"TICK",
    b"TOCK", b"STMP", b"TIMO", b"RMRK",
];
/// Order of the axes of cameras that do not record it (HERO5).
const DEFAULT_AXES: &str = "ZXY";

/// Samples of a sensor in the order of the payloads.
#[derive(Debug, Default)]
struct Sensor {
    samples: Vec<Vector3<f64>>,
    marks: Vec<Mark>,
}

/// Telemetry read so far.
#[derive(Debug)]
struct ReadPayloads {
    camera: Recorded,
    karma: Karma,
    gyroscope: Sensor,
    accelerometer: Sensor,
    damaged_payloads: u64,
    problem: Option<String>,
    /// Recorded axes of the first sensor.
    axes: Option<String>,
    /// Letter of the field of view (`VFOV`).
    field_of_view: Option<String>,
}

/// Telemetry of a video, in nanoseconds since its start.
#[derive(Debug)]
pub(super) struct Telemetry {
    pub(super) camera: Recorded,
    pub(super) drone: Option<Recorded>,
    pub(super) field_of_view: Option<String>,
}

pub(super) fn read(payloads: &[Payload]) -> Telemetry {
    let mut state = ReadPayloads {
        camera: Recorded::new(FORMAT, "/camera"),
        karma: Karma::default(),
        gyroscope: Sensor::default(),
        accelerometer: Sensor::default(),
        damaged_payloads: 0,
        problem: None,
        axes: None,
        field_of_view: None,
    };
    for payload in payloads {
        if let Err(problem) = read_payload(payload, &mut state) {
            state.damaged_payloads += 1;
            state.problem.get_or_insert(problem);
        }
    }
    let ReadPayloads { mut camera, karma, gyroscope, accelerometer, damaged_payloads, problem, axes, field_of_view } =
        state;
    if let Some(problem) = problem {
        camera.notes.push(format!(
            "{damaged_payloads} of {} payloads of telemetry are damaged and read up to the damage only: {problem}",
            payloads.len()
        ));
    }
    let (gyroscope, even_gyroscope) = gyroscope.timed();
    let (accelerometer, even_accelerometer) = accelerometer.timed();
    if !(gyroscope.is_empty() && accelerometer.is_empty()) {
        if !(even_gyroscope && even_accelerometer) {
            camera
                .notes
                .push("the samples of the camera's IMU are spread evenly over each payload of telemetry".to_owned());
        }
        let axes = axes.unwrap_or_else(|| DEFAULT_AXES.to_owned());
        camera.notes.push(format!(
            "the camera's IMU is given along the camera's axes forward, left, up (the file has GoPro's axes in the order {axes})"
        ));
        let imu = camera.imu("GYRO/ACCL");
        (imu.gyroscope, imu.accelerometer) = (gyroscope, accelerometer);
    }
    Telemetry { camera, drone: karma.finish(), field_of_view }
}

fn read_payload(payload: &Payload, state: &mut ReadPayloads) -> Result<(), String> {
    for device in items(&payload.bytes) {
        let device = device?;
        if &device.key != b"DEVC" {
            continue;
        }
        for stream in items(device.data) {
            let stream = stream?;
            match (&stream.key, stream.kind) {
                (b"STRM", 0) => read_stream(&stream, payload, state)?,
                (b"VFOV", _) => state.field_of_view = Some(stream.text()),
                _ => {}
            }
        }
    }
    Ok(())
}

fn read_stream(stream: &Item<'_>, payload: &Payload, state: &mut ReadPayloads) -> Result<(), String> {
    let mut properties = Properties::default();
    for item in items(stream.data) {
        let item = item?;
        match &item.key {
            b"SCAL" => properties.scales = item.numbers(),
            b"TYPE" => properties.letters = item.text(),
            b"STNM" => properties.name = item.text(),
            b"ORIN" => properties.axes = item.text(),
            b"GPSU" => properties.utc_ns = utc_ns(&item.text()),
            b"GPSF" => properties.fix = item.numbers().first().copied(),
            key if PROPERTIES.contains(&key) => {}
            b"GYRO" | b"ACCL" => take_inertial(&item, &properties, payload, state),
            b"GPS5" | b"GPS9" => take_fixes(&item, &properties, payload, &mut state.camera),
            _ => {
                if !state.karma.take(&item, &properties, payload) {
                    let key = String::from_utf8_lossy(&item.key).into_owned();
                    let name = if properties.name.is_empty() { key } else { format!("{key} ({})", properties.name) };
                    state.camera.leave_many(&name, item.count as u64, "not read");
                }
            }
        }
    }
    Ok(())
}

/// Takes samples of the camera's gyroscope in rad/s or accelerometer in m/s².
fn take_inertial(item: &Item<'_>, properties: &Properties, payload: &Payload, state: &mut ReadPayloads) {
    let axes = if properties.axes.is_empty() { axes_of_name(&properties.name) } else { Some(properties.axes.clone()) };
    let axes = axes.unwrap_or_else(|| DEFAULT_AXES.to_owned());
    let sensor = if &item.key == b"GYRO" { &mut state.gyroscope } else { &mut state.accelerometer };
    let before = sensor.samples.len();
    let mut left = 0;
    for row in item.rows(&properties.letters, &properties.scales) {
        match along_axes(&row, &axes) {
            Some(sample) => sensor.samples.push(sample),
            None => left += 1,
        }
    }
    sensor.marks.push(Mark { before, start_ns: payload.start_ns, end_ns: payload.end_ns });
    state.axes.get_or_insert(axes);
    if left > 0 {
        let key = String::from_utf8_lossy(&item.key).into_owned();
        state.camera.leave_many(&key, left, "without three finite numbers along three axes");
    }
}

/// Axes in the name of a stream, such as `Gyroscope (z,x,y)`.
fn axes_of_name(name: &str) -> Option<String> {
    let list = name.split_once('(')?.1.split_once(')')?.0;
    let axes = list.split(',').map(str::trim).collect::<String>().to_ascii_uppercase();
    (axes.len() == 3 && axes.bytes().all(|axis| b"XYZ".contains(&axis))).then_some(axes)
}

/// Converts numbers stored along `axes` (`YxZ`: Y, −X, Z) to the camera's axes forward, left, up.
///
/// `GoPro`'s X points to the left of the camera, Y back and Z up, as the images of a HERO5 rotate.
fn along_axes(row: &[f64], axes: &str) -> Option<Vector3<f64>> {
    let [first, second, third] = *row else { return None };
    let mut components = [f64::NAN; 3];
    for (value, axis) in [first, second, third].into_iter().zip(axes.bytes()) {
        let index = usize::from(axis.to_ascii_lowercase().checked_sub(b'x')?);
        *components.get_mut(index)? = if axis.is_ascii_uppercase() { value } else { -value };
    }
    let [left, back, up] = components;
    finite([-back, left, up])
}

impl Sensor {
    /// Samples with their times, and true if they have a constant rate.
    fn timed(self) -> (Vec<(i64, Vector3<f64>)>, bool) {
        let (times_ns, constant) = sample_times_ns(&self.marks, self.samples.len());
        (times_ns.into_iter().zip(self.samples).collect(), constant)
    }
}

/// Smallest value of a 3D fix.
const FIX_3D: f64 = 3.0;

/// Stores fixes of the camera's receiver: latitude and longitude in degrees, altitude in metres.
fn take_fixes(item: &Item<'_>, properties: &Properties, payload: &Payload, camera: &mut Recorded) {
    let key = String::from_utf8_lossy(&item.key).into_owned();
    let duration_ns = payload.end_ns.saturating_sub(payload.start_ns) as f64;
    for (index, row) in item.rows(&properties.letters, &properties.scales).enumerate() {
        let time_ns = payload.start_ns.saturating_add((duration_ns * index as f64 / item.count as f64) as i64);
        // GPS9: latitude, longitude, altitude, two speeds, days since 2000, seconds of the day, dilution, fix.
        let is_fixed = row.get(8).copied().or(properties.fix).is_none_or(|fix| fix >= FIX_3D);
        let place = || Geodetic::from_deg(*row.first()?, *row.get(1)?, *row.get(2)?);
        let Some(place) = place().filter(|_| is_fixed) else {
            camera.leave(&key, "without a fix in three dimensions");
            continue;
        };
        camera.fixes.push((u8::from(&item.key == b"GPS5"), 0), &key, time_ns, place);
        let utc_ns = match (row.get(5), row.get(6)) {
            (Some(days), Some(seconds)) => nanoseconds(EPOCH_2000_S + days * 86_400.0 + seconds, 1e9),
            _ => properties.utc_ns.filter(|_| index == 0),
        };
        camera.utc.extend(utc_ns.map(|utc_ns| (time_ns, utc_ns)));
    }
}

/// Seconds from the epoch to the first day of 2000.
const EPOCH_2000_S: f64 = 946_684_800.0;

/// Converts `yymmddhhmmss.sss` to nanoseconds since the epoch.
fn utc_ns(text: &str) -> Option<i64> {
    let two = |at: usize| text.get(at..at + 2)?.parse::<i64>().ok();
    let (year, month, day) = (2000 + two(0)?, two(2)?, two(4)?);
    let seconds: f64 = text.get(10..)?.trim().parse().ok().filter(|seconds: &f64| (0.0..61.0).contains(seconds))?;
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    // Days since the epoch in the proleptic Gregorian calendar, with years that start in March.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let days = year * 365 + year / 4 - year / 100 + year / 400 + (month * 153 + 2) / 5 + day - 1 - 719_468;
    let whole_s = days * 86_400 + two(6)? * 3600 + two(8)? * 60;
    Some(whole_s * 1_000_000_000 + (seconds * 1e9).round() as i64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_reordered() {
        assert_eq!(along_axes(&[1.0, 2.0, 3.0], "YxZ"), Some(Vector3::new(-1.0, -2.0, 3.0)));
        assert_eq!(along_axes(&[1.0, 2.0, 3.0], "ZXY"), Some(Vector3::new(-3.0, 2.0, 1.0)));
        for (row, axes) in [(&[1.0, 2.0][..], "XYZ"), (&[1.0, 2.0, 3.0], "XXY"), (&[1.0, 2.0, 3.0], "abc")] {
            assert_eq!(along_axes(row, axes), None, "{axes}");
        }
        assert_eq!(axes_of_name("Gyroscope (z,x,y)"), Some("ZXY".to_owned()));
        assert_eq!(axes_of_name("Accelerometer (up/down, right/left, forward/back)"), None);
    }

    #[test]
    fn utc_is_read() {
        assert_eq!(utc_ns("170417192753.250"), Some(1_492_457_273_250_000_000));
        assert_eq!(utc_ns("240229000000.000"), Some(1_709_164_800_000_000_000));
        assert_eq!((utc_ns("171317192753.250"), utc_ns(""), utc_ns("ünïcödé-text-123")), (None, None, None));
    }
}
