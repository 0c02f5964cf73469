//! Telemetry logs of ground stations (`.tlog`): `MAVLink` messages with the times of their reception.

mod frames;
#[cfg(test)]
mod tests;
mod vehicles;

use std::collections::BTreeMap;
use std::path::Path;

use nalgebra::Vector3;

use super::super::ConvertError;
use super::super::sink::LogSink;
use super::attitude::gimbal_attitude;
use super::candidates::Preference;
use super::recorded::{GimbalAttitude, GimbalFrame, Recorded, finite, from_euler, nanoseconds, rotation};
use super::scalar::Scalar;
use crate::flight_log::container::file::LogFile;
use crate::flight_log::trajectory::geodesy::Geodetic;
use crate::sensors::STANDARD_GRAVITY_M_PER_S2;
pub(super) use frames::is_telemetry;
use frames::{Frame, Frames};
use vehicles::Vehicle;

/// Numbers of the supported messages (`MAVLink` common).
mod id {
    pub(super) const HEARTBEAT: u32 = 0;
    pub(super) const SYSTEM_TIME: u32 = 2;
    pub(super) const GPS_RAW_INT: u32 = 24;
    pub(super) const SCALED_IMU: u32 = 26;
    pub(super) const RAW_IMU: u32 = 27;
    pub(super) const ATTITUDE: u32 = 30;
    pub(super) const ATTITUDE_QUATERNION: u32 = 31;
    pub(super) const LOCAL_POSITION_NED: u32 = 32;
    pub(super) const GLOBAL_POSITION_INT: u32 = 33;
    pub(super) const HIGHRES_IMU: u32 = 105;
    pub(super) const SCALED_IMU2: u32 = 116;
    pub(super) const SCALED_IMU3: u32 = 129;
    pub(super) const MOUNT_ORIENTATION: u32 = 265;
    pub(super) const GIMBAL_DEVICE_ATTITUDE_STATUS: u32 = 285;
}

/// Name and `CRC_EXTRA` byte of a supported message.
fn described(message: u32) -> Option<(&'static str, u8)> {
    Some(match message {
        id::HEARTBEAT => ("HEARTBEAT", 50),
        id::SYSTEM_TIME => ("SYSTEM_TIME", 137),
        id::GPS_RAW_INT => ("GPS_RAW_INT", 24),
        id::SCALED_IMU => ("SCALED_IMU", 170),
        id::RAW_IMU => (RAW_IMU, 144),
        id::ATTITUDE => ("ATTITUDE", 39),
        id::ATTITUDE_QUATERNION => ("ATTITUDE_QUATERNION", 246),
        id::LOCAL_POSITION_NED => ("LOCAL_POSITION_NED", 185),
        id::GLOBAL_POSITION_INT => ("GLOBAL_POSITION_INT", 104),
        id::HIGHRES_IMU => ("HIGHRES_IMU", 93),
        id::SCALED_IMU2 => ("SCALED_IMU2", 76),
        id::SCALED_IMU3 => ("SCALED_IMU3", 46),
        id::MOUNT_ORIENTATION => ("MOUNT_ORIENTATION", 26),
        id::GIMBAL_DEVICE_ATTITUDE_STATUS => ("GIMBAL_DEVICE_ATTITUDE_STATUS", 137),
        _ => return None,
    })
}

fn checksum_byte(message: u32) -> Option<u8> {
    described(message).map(|(_, byte)| byte)
}

const RAW_IMU: &str = "RAW_IMU";
/// `MAV_AUTOPILOT_INVALID`: a component that is no autopilot.
const NO_AUTOPILOT: u8 = 8;
/// Component number of the autopilot.
const AUTOPILOT_COMPONENT: u8 = 1;
/// Times beyond this are since the epoch, others since the start of the component.
const EPOCH_TIMES_NS: i64 = 1_000_000_000_000_000_000;

/// Reads a log in UTC of the autopilot (`SYSTEM_TIME`), else of the ground station.
pub(super) fn read(path: &Path, sink: &mut LogSink<'_>) -> Result<Recorded, ConvertError> {
    let file = LogFile::open(path, sink.limits())?;
    let mut frames = Frames::new(&file, checksum_byte);
    let mut vehicles: BTreeMap<u8, Vehicle> = BTreeMap::new();
    let mut unread = vehicles::empty();
    let mut at = 0;
    while let Some(frame) = frames.next(at).map_err(|problem| ConvertError::unreadable(problem, path))? {
        at = frame.end;
        match described(frame.message) {
            Some((name, _)) => take(&frame, name, vehicles.entry(frame.system).or_default()),
            None => unread.leave(&format!("message {}", frame.message), "not read"),
        }
        sink.advance(at, file.len())?;
    }
    let damage = frames.damage;
    let mut recorded = vehicles::chosen(vehicles, sink);
    recorded.append(unread);
    recorded.notes.extend(
        damage
            .notes("are no records", |bytes| format!("the log ends within a record: its last {bytes} bytes are lost")),
    );
    // The times are UTC already.
    if let Some((time_ns, _)) = recorded.span_ns() {
        recorded.utc = vec![(time_ns, time_ns)];
    }
    Ok(recorded)
}

/// Takes a message of a vehicle.
fn take(frame: &Frame, name: &'static str, vehicle: &mut Vehicle) {
    if frame.message == id::HEARTBEAT {
        let autopilot = frame.payload[5];
        if autopilot != NO_AUTOPILOT {
            vehicle.take_heartbeat(autopilot);
        }
        return;
    }
    vehicle.count(name);
    let (Some(time_ns), false) = (time_ns(frame), frame.message == id::SYSTEM_TIME && unix_ns(frame).is_none()) else {
        return vehicle.recorded.leave(name, "without a time");
    };
    if frame.message == id::RAW_IMU {
        vehicle.raw_imus.insert(Component::of(frame).record(&raw_imu_name(frame)));
    }
    let recorded = if time_ns >= EPOCH_TIMES_NS { &mut vehicle.recorded } else { vehicle.session(frame, time_ns) };
    if let Err(reason) = measure(frame, name, time_ns, recorded) {
        recorded.leave(name, reason);
    }
}

/// Name of a raw IMU, with its number unless it is the first.
fn raw_imu_name(frame: &Frame) -> String {
    match frame.payload[26] {
        0 => RAW_IMU.to_owned(),
        number => format!("{RAW_IMU}[{number}]"),
    }
}

/// Sender of a message within its vehicle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Component(u8);

impl Component {
    fn of(frame: &Frame) -> Self {
        Self(frame.component)
    }

    fn is_autopilot(self) -> bool {
        self.0 == AUTOPILOT_COMPONENT
    }

    /// Name of a record of this component.
    fn record(self, name: &str) -> String {
        if self.is_autopilot() { name.to_owned() } else { format!("{name} of component {}", self.0) }
    }

    /// Preference for a measurement of the vehicle: measurements of its autopilot come before measurements of its other
    /// components.
    fn preference(self, rank: u8) -> Preference {
        if self.is_autopilot() { (rank, 0) } else { (rank + OTHER_COMPONENTS, u16::from(self.0)) }
    }
}

/// Added to the rank of a measurement that is not the autopilot's.
const OTHER_COMPONENTS: u8 = 8;

fn number(frame: &Frame, scalar: Scalar, at: usize) -> f64 {
    scalar.little_endian(&frame.payload, at).unwrap_or(f64::NAN)
}

fn numbers<const N: usize>(frame: &Frame, scalar: Scalar, at: usize) -> [f64; N] {
    std::array::from_fn(|index| number(frame, scalar, at + index * scalar.size()))
}

/// Time of a measurement, since the start of the component or since the epoch.
fn time_ns(frame: &Frame) -> Option<i64> {
    match frame.message {
        id::SYSTEM_TIME => nanoseconds(number(frame, Scalar::U32, 8), 1e6),
        id::GPS_RAW_INT | id::RAW_IMU | id::HIGHRES_IMU => nanoseconds(number(frame, Scalar::U64, 0), 1e3),
        _ => nanoseconds(number(frame, Scalar::U32, 0), 1e6),
    }
}

/// UTC of a `SYSTEM_TIME` message.
fn unix_ns(frame: &Frame) -> Option<i64> {
    nanoseconds(number(frame, Scalar::U64, 0), 1e3).filter(|time_ns| *time_ns >= EPOCH_TIMES_NS)
}

const NOT_FINITE: &str = "a number that is not finite";

fn measure(frame: &Frame, name: &str, time_ns: i64, recorded: &mut Recorded) -> Result<(), &'static str> {
    let sender = Component::of(frame);
    match frame.message {
        id::SYSTEM_TIME => {
            if frame.component == AUTOPILOT_COMPONENT {
                recorded.utc.extend(unix_ns(frame).map(|utc_ns| (time_ns, utc_ns)));
            }
        }
        id::SCALED_IMU | id::SCALED_IMU2 | id::SCALED_IMU3 | id::RAW_IMU => {
            let first = if frame.message == id::RAW_IMU { 8 } else { 4 };
            // Thousandths of g and of rad/s.
            let milli = |at: usize| Vector3::from(numbers::<3>(frame, Scalar::I16, at)) / 1e3;
            let sample = [milli(first + 6), milli(first) * STANDARD_GRAVITY_M_PER_S2];
            let name = if frame.message == id::RAW_IMU { raw_imu_name(frame) } else { name.to_owned() };
            push_imu(sender, &name, time_ns, sample, recorded);
        }
        id::HIGHRES_IMU => {
            // The first six bits mark new accelerations and angular rates.
            let updated = number(frame, Scalar::U16, 60) as u16;
            if updated != 0 && updated.trailing_zeros() >= 6 {
                return Err("neither acceleration nor angular rate is new");
            }
            let force = finite(numbers(frame, Scalar::F32, 8)).ok_or(NOT_FINITE)?;
            let rate = finite(numbers(frame, Scalar::F32, 20)).ok_or(NOT_FINITE)?;
            push_imu(sender, &format!("HIGHRES_IMU[{}]", frame.payload[62]), time_ns, [rate, force], recorded);
        }
        id::ATTITUDE => {
            let rotation = from_euler(numbers(frame, Scalar::F32, 4)).ok_or(NOT_FINITE)?;
            recorded.attitudes.push(sender.preference(1), &sender.record(name), time_ns, rotation);
        }
        id::ATTITUDE_QUATERNION => {
            let rotation = rotation(numbers(frame, Scalar::F32, 4)).ok_or("no unit quaternion")?;
            recorded.attitudes.push(sender.preference(0), &sender.record(name), time_ns, rotation);
        }
        id::LOCAL_POSITION_NED => {
            let position_m = finite(numbers(frame, Scalar::F32, 4)).ok_or(NOT_FINITE)?;
            recorded.positions.push(sender.preference(0), &sender.record(name), time_ns, position_m);
        }
        id::GLOBAL_POSITION_INT => push_fix(frame, name, 1, 4, time_ns, recorded)?,
        id::GPS_RAW_INT => {
            if frame.payload[28] < 3 {
                return Err("without a fix in three dimensions");
            }
            push_fix(frame, name, 0, 8, time_ns, recorded)?;
        }
        id::MOUNT_ORIENTATION => {
            let [roll_deg, pitch_deg, yaw_deg, _] = numbers(frame, Scalar::F32, 4);
            let angles_rad = [roll_deg, pitch_deg, yaw_deg].map(f64::to_radians);
            let frame_from_camera = from_euler(angles_rad).ok_or(NOT_FINITE)?;
            let attitude = GimbalAttitude { frame: GimbalFrame::Vehicle, frame_from_camera };
            recorded.gimbal.push((1, u16::from(sender.0)), &sender.record(name), time_ns, attitude);
        }
        id::GIMBAL_DEVICE_ATTITUDE_STATUS => {
            let flags = number(frame, Scalar::U16, 36) as u32;
            let attitude = gimbal_attitude(flags, numbers(frame, Scalar::F32, 4)).ok_or("no unit quaternion")?;
            // Number of a gimbal without a component of its own; 0 for a gimbal that sends itself.
            let gimbal = frame.payload[48];
            let of_gimbal = if gimbal > 0 { format!(" of gimbal {gimbal}") } else { String::new() };
            let record = format!("{}{of_gimbal}", sender.record(name));
            let device = (u16::from(sender.0) << 8) + u16::from(gimbal);
            recorded.gimbal.push((0, device), &record, time_ns, attitude);
        }
        _ => return Err("not read"),
    }
    Ok(())
}

/// Adds angular velocity and specific force of a component's IMU.
fn push_imu(sender: Component, name: &str, time_ns: i64, sample: [Vector3<f64>; 2], recorded: &mut Recorded) {
    let imu = recorded.imu(&sender.record(name));
    imu.is_of_other_device = !sender.is_autopilot();
    imu.combined.push((time_ns, sample));
}

/// Adds latitude and longitude in 1e-7 degrees and altitude in millimetres.
fn push_fix(
    frame: &Frame,
    name: &str,
    rank: u8,
    at: usize,
    time_ns: i64,
    recorded: &mut Recorded,
) -> Result<(), &'static str> {
    let [latitude, longitude, altitude] = numbers(frame, Scalar::I32, at);
    let fix = Geodetic::from_deg(latitude / 1e7, longitude / 1e7, altitude / 1e3).ok_or("without a position")?;
    let sender = Component::of(frame);
    recorded.fixes.push(sender.preference(rank), &sender.record(name), time_ns, fix);
    Ok(())
}
