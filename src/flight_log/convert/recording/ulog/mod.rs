//! `ULog` files of PX4 (`.ulg`).

mod formats;
mod messages;

use std::collections::BTreeMap;
use std::path::Path;

use super::super::ConvertError;
use super::super::sink::LogSink;
use super::attitude::gimbal_attitude;
use super::damage::Damage;
use super::recorded::{GimbalAttitude, GimbalFrame, Recorded, finite, from_euler, nanoseconds, rotation};
use crate::flight_log::container::file::LogFile;
use crate::flight_log::trajectory::geodesy::Geodetic;
use formats::{Formats, MessageLayout};
pub(super) use messages::MAGIC;
use messages::{HEADER_BYTES, Messages};

/// Flag of a log with data appended after its former end.
const APPENDED: u8 = 1;

/// Logged message: its format and its instance.
#[derive(Clone, Debug)]
struct Subscription {
    name: String,
    instance: u8,
}

/// Declarations of a log up to the present position.
#[derive(Debug, Default)]
struct Declarations {
    formats: Formats,
    subscriptions: BTreeMap<u16, Subscription>,
    layouts: BTreeMap<String, MessageLayout>,
    /// Ends of the parts of the log: up to the first, then from each to the next.
    parts: Vec<usize>,
    dropouts: u64,
    dropouts_ms: u64,
    /// Number of data messages without a subscription.
    orphans: u64,
    problem: Option<String>,
}

/// Reads a log in the clock of its timestamps, usually the time since the autopilot started.
pub(super) fn read(path: &Path, sink: &mut LogSink<'_>) -> Result<Recorded, ConvertError> {
    let file = LogFile::open(path, sink.limits())?;
    let mut recorded = Recorded::new("PX4 ULog", "");
    let mut state = Declarations::default();
    let mut messages = Messages::new(&file);
    let mut at = HEADER_BYTES;
    let mut part = 0;
    loop {
        let end = state.parts.get(part).copied().unwrap_or(file.len());
        let message = messages.next(at, end).map_err(|problem| ConvertError::unreadable(problem, path))?;
        let Some(message) = message else {
            let Some(next) = state.parts.get(part) else { break };
            at = *next;
            part += 1;
            continue;
        };
        take(message.kind, message.content, &mut state, &mut recorded);
        at = message.end;
        sink.advance(at, file.len())?;
    }
    report(&state, &messages.damage, &mut recorded);
    Ok(recorded)
}

fn report(state: &Declarations, damage: &Damage, recorded: &mut Recorded) {
    recorded.notes.extend(damage.notes("are no messages", |bytes| {
        format!("the log ends within a message (power lost, or the copy is incomplete): {bytes} bytes are lost")
    }));
    if state.dropouts > 0 {
        recorded.notes.push(format!(
            "dropouts of the autopilot's log: {}, {:.3} s in total",
            state.dropouts,
            state.dropouts_ms as f64 * 1e-3
        ));
    }
    if state.orphans > 0 {
        recorded.notes.push(format!("{} messages that no subscription describes are left out", state.orphans));
    }
    if let Some(problem) = &state.problem {
        recorded.notes.push(format!("a definition is not read: {problem}"));
    }
}

fn take(kind: u8, content: &[u8], state: &mut Declarations, recorded: &mut Recorded) {
    match (kind, content) {
        (b'F', text) => {
            let declared = std::str::from_utf8(text)
                .map_err(|error| format!("a format that is not UTF-8 ({error})"))
                .and_then(|text| state.formats.declare(text));
            if let Err(problem) = declared {
                state.problem.get_or_insert(problem);
            }
        }
        (b'A', [instance, low, high, name @ ..]) => {
            let name = String::from_utf8_lossy(name).into_owned();
            if is_read(&name) && !state.layouts.contains_key(&name) {
                match state.formats.layout(&name) {
                    Some(layout) => {
                        state.layouts.insert(name.clone(), layout);
                    }
                    None => {
                        state.problem.get_or_insert_with(|| format!("{name:?} has no format"));
                    }
                }
            }
            let subscription = Subscription { name, instance: *instance };
            state.subscriptions.insert(u16::from_le_bytes([*low, *high]), subscription);
        }
        (b'D', [low, high, message @ ..]) => {
            let Some(subscription) = state.subscriptions.get(&u16::from_le_bytes([*low, *high])) else {
                state.orphans += 1;
                return;
            };
            let read = match state.layouts.get(&subscription.name) {
                Some(layout) => {
                    measure(&Record { subscription, layout, message }, recorded).ok_or("with invalid numbers")
                }
                None => Err("not read"),
            };
            if let Err(reason) = read.and_then(|read| read) {
                recorded.leave(&subscription.name, reason);
            }
        }
        (b'O', [low, high, ..]) => {
            state.dropouts += 1;
            state.dropouts_ms += u64::from(u16::from_le_bytes([*low, *high]));
        }
        // Compatible flags (8), incompatible flags (8), offsets of appended data (3 × 8).
        (b'B', flags) if flags.len() >= 40 && flags[8] & APPENDED != 0 => {
            let offsets = flags[16..40].chunks_exact(8).filter_map(|bytes| bytes.try_into().ok());
            let offsets = offsets.filter_map(|bytes| usize::try_from(u64::from_le_bytes(bytes)).ok());
            state.parts = offsets.filter(|offset| *offset > HEADER_BYTES).collect();
            state.parts.sort_unstable();
        }
        _ => {}
    }
}

/// True for supported messages.
fn is_read(name: &str) -> bool {
    [
        "sensor_combined",
        "sensor_gyro",
        "sensor_accel",
        "vehicle_attitude",
        "vehicle_local_position",
        "vehicle_gps_position",
        "sensor_gps",
        "gimbal_device_attitude_status",
        "mount_orientation",
    ]
    .contains(&name)
}

/// Data message of a subscription.
struct Record<'a> {
    subscription: &'a Subscription,
    layout: &'a MessageLayout,
    message: &'a [u8],
}

impl Record<'_> {
    /// Name of the message, with the number of its instance unless it is the first.
    fn name(&self) -> String {
        let Subscription { name, instance } = self.subscription;
        if *instance == 0 { name.clone() } else { format!("{name}[{instance}]") }
    }

    fn number(&self, name: &str) -> Option<f64> {
        self.layout.number(self.message, name)
    }

    fn numbers<const N: usize>(&self, name: &str) -> Option<[f64; N]> {
        self.layout.numbers(self.message, name)
    }

    /// Time of the measurement if it is recorded, else of the message.
    fn time_ns(&self) -> Option<i64> {
        let sampled = self.number("timestamp_sample").filter(|time| *time > 0.0);
        sampled.or_else(|| self.number("timestamp")).and_then(|microseconds| nanoseconds(microseconds, 1e3))
    }
}

/// Stores the measurement of a message: `None` for unusable numbers, the reason for a message that is left out.
fn measure(record: &Record<'_>, recorded: &mut Recorded) -> Option<Result<(), &'static str>> {
    let Subscription { name, instance } = record.subscription;
    let (time_ns, device) = (record.time_ns()?, u16::from(*instance));
    match name.as_str() {
        "sensor_combined" => {
            let rate = finite(record.numbers("gyro_rad")?)?;
            let force = finite(record.numbers("accelerometer_m_s2")?)?;
            recorded.imu(name).combined.push((time_ns, [rate, force]));
        }
        "sensor_gyro" | "sensor_accel" => {
            let components = finite([record.number("x")?, record.number("y")?, record.number("z")?])?;
            let imu = recorded.imu(&format!("sensor_gyro/accel[{instance}]"));
            let samples = if name == "sensor_gyro" { &mut imu.gyroscope } else { &mut imu.accelerometer };
            samples.push((time_ns, components));
        }
        "vehicle_attitude" => {
            let record_name = record.name();
            recorded.attitudes.push((0, device), &record_name, time_ns, rotation(record.numbers("q")?)?);
        }
        "vehicle_local_position" => {
            let is_valid = |name: &str| record.number(name).is_none_or(|valid| valid != 0.0);
            if !is_valid("xy_valid") || !is_valid("z_valid") {
                return Some(Err("marked as invalid by the autopilot"));
            }
            let position_m = finite([record.number("x")?, record.number("y")?, record.number("z")?])?;
            recorded.positions.push((0, device), &record.name(), time_ns, position_m);
        }
        "vehicle_gps_position" | "sensor_gps" => return fix(record, time_ns, recorded),
        "gimbal_device_attitude_status" => {
            let attitude = gimbal_attitude(record.number("device_flags")? as u32, record.numbers("q")?)?;
            // PX4 publishes the messages of all gimbals with the numbers that they have on the vehicle.
            let gimbal = record.number("gimbal_device_id").filter(|gimbal| *gimbal > 0.0).map(|gimbal| gimbal as u8);
            let record_name = match gimbal {
                Some(gimbal) => format!("{} of gimbal {gimbal}", record.name()),
                None => record.name(),
            };
            recorded.gimbal.push((0, (device << 8) + u16::from(gimbal.unwrap_or(0))), &record_name, time_ns, attitude);
        }
        "mount_orientation" => {
            let frame_from_camera = from_euler(record.numbers("attitude_euler_angle")?)?;
            let attitude = GimbalAttitude { frame: GimbalFrame::Vehicle, frame_from_camera };
            recorded.gimbal.push((1, device), &record.name(), time_ns, attitude);
        }
        _ => return Some(Err("not read")),
    }
    Some(Ok(()))
}

/// Smallest type of a 3D fix.
const FIX_3D: f64 = 3.0;

fn fix(record: &Record<'_>, time_ns: i64, recorded: &mut Recorded) -> Option<Result<(), &'static str>> {
    let name = record.subscription.name.as_str();
    if record.number("fix_type")? < FIX_3D {
        return Some(Err("without a fix in three dimensions"));
    }
    let fix = match record.number("latitude_deg") {
        Some(latitude_deg) => {
            Geodetic::from_deg(latitude_deg, record.number("longitude_deg")?, record.number("altitude_msl_m")?)?
        }
        None => {
            Geodetic::from_deg(record.number("lat")? / 1e7, record.number("lon")? / 1e7, record.number("alt")? / 1e3)?
        }
    };
    let preference = (u8::from(name == "sensor_gps"), u16::from(record.subscription.instance));
    recorded.fixes.push(preference, &record.name(), time_ns, fix);
    let message_ns = record.number("timestamp").and_then(|microseconds| nanoseconds(microseconds, 1e3))?;
    if let Some(utc_ns) =
        record.number("time_utc_usec").filter(|time| *time > 0.0).and_then(|time| nanoseconds(time, 1e3))
    {
        recorded.utc.push((message_ns, utc_ns));
    }
    Some(Ok(()))
}
