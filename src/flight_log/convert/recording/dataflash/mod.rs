//! `DataFlash` logs of `ArduPilot` (`.bin`).

mod records;

use std::path::Path;

use nalgebra::UnitQuaternion;

use super::super::ConvertError;
use super::super::sink::LogSink;
use super::recorded::{GimbalAttitude, GimbalFrame, Recorded, finite, from_euler, nanoseconds};
use crate::flight_log::container::file::LogFile;
use crate::flight_log::trajectory::geodesy::Geodetic;
use records::Record;
pub(super) use records::START;

/// Reads a log in time since the start of the autopilot.
pub(super) fn read(path: &Path, sink: &mut LogSink<'_>) -> Result<Recorded, ConvertError> {
    let file = LogFile::open(path, sink.limits())?;
    let mut recorded = Recorded::new("ArduPilot DataFlash", "");
    let length = file.len();
    let (damage, problem) = records::walk(&file, path, |record, behind| {
        take(record, &mut recorded);
        sink.advance(behind, length)
    })?;
    recorded.notes.extend(problem.map(|problem| format!("a record type is not read: {problem}")));
    recorded.notes.extend(damage.notes("belong to no record", |bytes| {
        format!("the log ends within a record (power lost, or the copy is incomplete): its last {bytes} bytes are lost")
    }));
    Ok(recorded)
}

/// Stores the measurements of a record, or counts it as left out.
fn take(record: &Record<'_>, recorded: &mut Recorded) {
    let name = record.record_type.name.as_str();
    let taken = match name {
        "IMU" | "IMU2" | "IMU3" => imu(record, name, recorded),
        _ if name.starts_with("GYR") || name.starts_with("ACC") => one_sensor(record, name, recorded),
        "ATT" | "AHR2" => attitude(record, name, u8::from(name == "AHR2"), recorded),
        "XKF1" | "NKF1" | "EKF1" => position(record, name, recorded),
        "GPS" => fix(record, recorded),
        "POS" => camera_position(record, recorded),
        "MNT" => mount(record, recorded),
        "GIMB" => camera_gimbal(record, recorded),
        "TIME" => camera_time(record, recorded),
        "FMTU" | "UNIT" | "MULT" => Ok(()),
        _ => Err("not read"),
    };
    if let Err(reason) = taken {
        recorded.leave(name, reason);
    }
}

/// Time since the start of the autopilot.
fn time_ns(record: &Record<'_>) -> Result<i64, &'static str> {
    let time_ns = match record.raw("TimeUS") {
        Some(microseconds) => nanoseconds(microseconds, 1e3),
        None => record.raw("TimeMS").and_then(|milliseconds| nanoseconds(milliseconds, 1e6)),
    };
    time_ns.ok_or("without a time")
}

/// Name of an instance: `IMU[1]` for `IMU` records with instance 1, and for `IMU2`.
fn instance(record: &Record<'_>, name: &str) -> String {
    let (base, number) = name.split_at(3);
    let by_name = number.parse::<u64>().ok().map(|number| number.saturating_sub(1));
    let number = by_name.unwrap_or_else(|| record.raw("I").map_or(0, |number| number as u64));
    format!("{base}[{number}]")
}

fn imu(record: &Record<'_>, name: &str, recorded: &mut Recorded) -> Result<(), &'static str> {
    let (Some(rate), Some(force)) =
        (record.numbers(["GyrX", "GyrY", "GyrZ"]), record.numbers(["AccX", "AccY", "AccZ"]))
    else {
        return Err("without angular velocity or specific force");
    };
    let (rate, force) = finite(rate).zip(finite(force)).ok_or(NOT_FINITE)?;
    let time_ns = time_ns(record)?;
    recorded.imu(&instance(record, name)).combined.push((time_ns, [rate, force]));
    Ok(())
}

const NOT_FINITE: &str = "a number that is not finite";

/// Reads `GYR` and `ACC`: raw samples of one sensor.
fn one_sensor(record: &Record<'_>, name: &str, recorded: &mut Recorded) -> Result<(), &'static str> {
    let sampled = record.raw("SampleUS").filter(|time| *time > 0.0).and_then(|time| nanoseconds(time, 1e3));
    let time_ns = sampled.map_or_else(|| time_ns(record), Ok)?;
    let instance = instance(record, name).replace("ACC", "GYR").replace("GYR", "GYR/ACC");
    if let Some(rate) = record.numbers(["GyrX", "GyrY", "GyrZ"]) {
        let rate = finite(rate).ok_or(NOT_FINITE)?;
        recorded.imu(&instance).gyroscope.push((time_ns, rate));
    } else if let Some(force) = record.numbers(["AccX", "AccY", "AccZ"]) {
        let force = finite(force).ok_or(NOT_FINITE)?;
        recorded.imu(&instance).accelerometer.push((time_ns, force));
    } else {
        return Err("not read");
    }
    Ok(())
}

fn attitude(record: &Record<'_>, name: &str, rank: u8, recorded: &mut Recorded) -> Result<(), &'static str> {
    let angles_deg = record.numbers(["Roll", "Pitch", "Yaw"]).ok_or("without roll, pitch and yaw")?;
    let rotation = from_euler(angles_deg.map(f64::to_radians)).ok_or(NOT_FINITE)?;
    recorded.attitudes.push((rank, 0), name, time_ns(record)?, rotation);
    Ok(())
}

/// Number of the device of a record by a field, and the record's name with this number unless it is 0.
fn device(record: &Record<'_>, name: &str, field: &str) -> (u16, String) {
    let number = record.raw(field).map_or(0, |number| number as u16);
    (number, if number == 0 { name.to_owned() } else { format!("{name}[{number}]") })
}

/// Reads the position of a core of a Kalman filter.
fn position(record: &Record<'_>, name: &str, recorded: &mut Recorded) -> Result<(), &'static str> {
    let (core, core_name) = device(record, name, "C");
    let position_m = record.numbers(["PN", "PE", "PD"]).ok_or("without a position")?;
    let position_m = finite(position_m).ok_or(NOT_FINITE)?;
    let rank = match name {
        "XKF1" => 0,
        "NKF1" => 1,
        _ => 2,
    };
    recorded.positions.push((rank, core), &core_name, time_ns(record)?, position_m);
    Ok(())
}

/// Smallest status of a receiver with a 3D fix.
const FIX_3D: f64 = 3.0;

fn fix(record: &Record<'_>, recorded: &mut Recorded) -> Result<(), &'static str> {
    let (receiver, receiver_name) = device(record, "GPS", "I");
    // In logs without microseconds, TimeMS is GPS time and T the time since the start.
    let time_ns = match record.raw("T") {
        Some(milliseconds) => nanoseconds(milliseconds, 1e6).ok_or("without a time")?,
        None => time_ns(record)?,
    };
    if record.raw("Status").is_some_and(|status| status < FIX_3D) {
        return Err("without a fix in three dimensions");
    }
    let [latitude_deg, longitude_deg, altitude_m] =
        record.numbers(["Lat", "Lng", "Alt"]).ok_or("without a position")?;
    let fix = Geodetic::from_deg(latitude_deg, longitude_deg, altitude_m).ok_or("without a position")?;
    recorded.fixes.push((0, receiver), &receiver_name, time_ns, fix);
    let week = record.raw("GWk").or_else(|| record.raw("Week"));
    let in_week = record.raw("GMS").or_else(|| record.raw("TimeMS"));
    if let (Some(week), Some(milliseconds)) = (week, in_week)
        && let Some(utc_ns) = utc_from_gps_ns(week, milliseconds)
    {
        recorded.utc.push((time_ns, utc_ns));
    }
    Ok(())
}

/// Seconds from the epoch to the start of GPS time, 6 January 1980.
const GPS_EPOCH_S: f64 = 315_964_800.0;
/// GPS time minus UTC in seconds, starting at each GPS time (leap seconds of 2012, 2015 and 2017).
const LEAP_SECONDS: [(f64, f64); 3] = [(1_025_136_016.0, 16.0), (1_119_744_017.0, 17.0), (1_167_264_018.0, 18.0)];

/// Converts a GPS week and its milliseconds to UTC in nanoseconds since the epoch.
pub(super) fn utc_from_gps_ns(week: f64, milliseconds: f64) -> Option<i64> {
    let gps_s = week * 604_800.0 + milliseconds * 1e-3;
    let leap_s = LEAP_SECONDS.iter().rev().find(|(from_s, _)| gps_s >= *from_s)?.1;
    nanoseconds(GPS_EPOCH_S + week * 604_800.0 + milliseconds * 1e-3 - leap_s, 1e9)
}

/// Reads gimbal angles: roll and pitch from the horizon, yaw from the vehicle (`YawB`) or from north (`YawE`, `Yaw`).
fn mount(record: &Record<'_>, recorded: &mut Recorded) -> Result<(), &'static str> {
    let (gimbal, gimbal_name) = device(record, "MNT", "I");
    let angle_deg = |name: &str| record.number(name).filter(|angle| angle.is_finite());
    let (Some(roll_deg), Some(pitch_deg)) = (angle_deg("Roll"), angle_deg("Pitch")) else {
        return Err("without measured angles");
    };
    let (frame, yaw_deg) = if let Some(yaw_deg) = angle_deg("YawB").or_else(|| angle_deg("Yaw")) {
        (GimbalFrame::Vehicle, yaw_deg)
    } else if let Some(yaw_deg) = angle_deg("YawE") {
        (GimbalFrame::Earth, yaw_deg)
    } else {
        return Err("without measured angles");
    };
    let frame_from_camera: UnitQuaternion<f64> =
        from_euler([roll_deg, pitch_deg, yaw_deg].map(f64::to_radians)).ok_or(NOT_FINITE)?;
    recorded.gimbal.push((0, gimbal), &gimbal_name, time_ns(record)?, GimbalAttitude { frame, frame_from_camera });
    Ok(())
}

/// Reads the angles in the log of `AP_CameraGimbal`: roll and pitch from the horizon, yaw from the vehicle, in degrees, at
/// the time of their measurement.
fn camera_gimbal(record: &Record<'_>, recorded: &mut Recorded) -> Result<(), &'static str> {
    let angles_deg = record.numbers(["Roll", "Pitch", "Yaw"]).ok_or("without measured angles")?;
    let frame_from_camera = from_euler(angles_deg.map(f64::to_radians)).ok_or(NOT_FINITE)?;
    let sampled = record.raw("SampleUS").filter(|time| *time > 0.0).and_then(|time| nanoseconds(time, 1e3));
    let time_ns = sampled.map_or_else(|| time_ns(record), Ok)?;
    let attitude = GimbalAttitude { frame: GimbalFrame::Vehicle, frame_from_camera };
    recorded.gimbal.push((1, 0), "GIMB", time_ns, attitude);
    Ok(())
}

/// Reads the vehicle's position in the log of `AP_CameraGimbal`, which has no records of a receiver.
fn camera_position(record: &Record<'_>, recorded: &mut Recorded) -> Result<(), &'static str> {
    // An autopilot's own log has the positions of its receiver and of its filter.
    if record.raw("BootMS").is_none() {
        return Err("not read");
    }
    let [latitude_deg, longitude_deg, altitude_m] =
        record.numbers(["Lat", "Lng", "Alt"]).ok_or("without a position")?;
    let fix = Geodetic::from_deg(latitude_deg, longitude_deg, altitude_m).ok_or("without a position")?;
    recorded.fixes.push((1, 0), "POS", time_ns(record)?, fix);
    Ok(())
}

/// Reads UTC in the log of `AP_CameraGimbal`, in microseconds since the epoch.
fn camera_time(record: &Record<'_>, recorded: &mut Recorded) -> Result<(), &'static str> {
    let utc_ns = record.raw("UTC").and_then(|microseconds| nanoseconds(microseconds, 1e3)).ok_or("without UTC")?;
    recorded.utc.push((time_ns(record)?, utc_ns));
    Ok(())
}
