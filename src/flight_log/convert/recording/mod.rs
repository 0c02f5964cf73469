//! Recordings of vehicles: an MP4 video with telemetry in it or with an autopilot's log, and autopilots' logs alone.

mod attitude;
mod camera_gimbal;
mod camm;
mod candidates;
mod damage;
mod dataflash;
mod gpmf;
mod mp4;
mod recorded;
mod rig;
mod scalar;
mod siyi;
mod telemetry;
mod tlog;
mod topics;
mod two_imus;
mod ulog;

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use super::sink::LogSink;
use super::{AutopilotLog, AutopilotLogKind, ConvertError, ConvertOptions, VideoClock};
use crate::flight_log::container::file::ZSTD_MAGIC;
use crate::geometry::{ns_from_seconds, seconds_from_ns};
use mp4::Movie;
use recorded::Recorded;
pub(super) use rig::VideoFacts;
use telemetry::VideoTelemetry;
use topics::Topics;

/// Kind of an autopilot's log by the first bytes of the file.
pub(super) fn autopilot_log_kind(start: &[u8]) -> Option<AutopilotLogKind> {
    if start.starts_with(&ulog::MAGIC) {
        Some(AutopilotLogKind::Ulog)
    } else if start.starts_with(&dataflash::START) {
        Some(AutopilotLogKind::DataFlash)
    } else if tlog::is_telemetry(start) {
        Some(AutopilotLogKind::Tlog)
    } else {
        None
    }
}

pub(super) use mp4::is_movie;

/// Number of bytes at the start that identify the kind of a log.
const START_BYTES: u64 = 16;

fn read_autopilot(log: &AutopilotLog, sink: &mut LogSink<'_>) -> Result<Recorded, ConvertError> {
    let mut start = Vec::new();
    let file = File::open(&log.path).map_err(ConvertError::io("open the log of the autopilot", &log.path))?;
    file.take(START_BYTES).read_to_end(&mut start).map_err(ConvertError::io("read", &log.path))?;
    let found = autopilot_log_kind(&start);
    // The start of a Zstandard file does not show its kind.
    if found != Some(log.kind) && !start.starts_with(&ZSTD_MAGIC) {
        let found = found.map_or("nor a log of another autopilot", AutopilotLogKind::name);
        return Err(ConvertError::NotThatLog {
            expected: log.kind.name(),
            found: found.to_owned(),
            path: log.path.clone(),
        });
    }
    match log.kind {
        AutopilotLogKind::Ulog => ulog::read(&log.path, sink),
        AutopilotLogKind::DataFlash => dataflash::read(&log.path, sink),
        AutopilotLogKind::Tlog => tlog::read(&log.path, sink),
    }
}

/// Converts an autopilot's log without a video.
pub(super) fn convert_autopilot(log: &AutopilotLog, sink: &mut LogSink<'_>) -> Result<(), ConvertError> {
    let mut recorded = read_autopilot(log, sink)?;
    to_utc(&mut recorded);
    let mut topics = Topics::default();
    topics.add_recorded(recorded, sink);
    topics.write(&log.path, None, sink)
}

/// Converts the times to UTC if the recorder had UTC.
fn to_utc(recorded: &mut Recorded) {
    match recorded.utc_offset_ns() {
        Some(offset_ns) => recorded.shift(offset_ns),
        None => recorded.notes.push(NO_UTC.to_owned()),
    }
}

const NO_UTC: &str = "the log has no UTC: its times count from the start of the autopilot";
/// Start of a video without recorded time, in nanoseconds since the epoch, because stamps of 0 count as never set.
const UNKNOWN_START_NS: i64 = 1_000_000_000;
/// Largest time zone offset between a camera's clock and UTC of a satellite receiver.
const TIME_ZONES_NS: i64 = 14 * 3600 * 1_000_000_000;

/// Converts a video with its telemetry, and with an autopilot's log.
pub(super) fn convert_video(
    source: &Path,
    options: &ConvertOptions,
    sink: &mut LogSink<'_>,
) -> Result<VideoFacts, ConvertError> {
    let movie = mp4::open(source, &options.limits)?;
    let telemetry = telemetry::read(&movie);
    let VideoTelemetry { mut camera, drone, gimbal, field_of_view, horizontal_deg, has_unknown_axes } = telemetry;
    let Movie { video, created_ns, firmware, notes, .. } = movie;
    for note in notes {
        sink.note(note);
    }
    let recorders = [Some(&camera), drone.as_ref(), gimbal.as_ref()];
    let video_utc_ns = recorders.into_iter().flatten().find_map(Recorded::utc_offset_ns);
    let mut topics = Topics::default();
    let mut camera_moves = false;
    let place = if let Some(log) = &options.autopilot {
        let mut recorded = read_autopilot(log, sink)?;
        to_utc(&mut recorded);
        let video_times = VideoTimes { span_ns: video.span_ns(), utc_ns: video_utc_ns.or(created_ns) };
        let place = place_video(&recorded, &camera, video_times, options.video_clock, sink);
        if let Some(drone) = drone {
            let count = drone.count();
            sink.leave("Karma", "GoPro Karma", count, "the autopilot's log is read instead");
        }
        if let Some(mut gimbal) = gimbal {
            gimbal.map_times(|time_ns| place.time_ns(time_ns));
            recorded.append(gimbal);
        }
        camera.map_times(|time_ns| place.time_ns(time_ns));
        if !place.is_guess && recorded.gimbal.count() == 0 {
            let both = two_imus::first_imu(&recorded).zip(two_imus::first_imu(&camera));
            camera_moves = both.and_then(|(vehicle, own)| two_imus::camera_moves(vehicle, own)) == Some(true);
        }
        if camera_moves {
            sink.note(
                "the IMUs of camera and autopilot rotate differently and no attitude of a gimbal is recorded: the rig has a \
                 gimbal without joint angles, and the camera's IMU as imu1",
            );
        }
        topics.add_recorded(recorded, sink);
        place
    } else {
        let start_ns = video_utc_ns.or(created_ns).unwrap_or(UNKNOWN_START_NS);
        if video_utc_ns.is_none() && created_ns.is_none() {
            sink.note("the camera recorded no time: the video starts 1 s after the epoch");
        }
        let vehicle = match (drone, gimbal) {
            (Some(mut drone), Some(gimbal)) => {
                drone.append(gimbal);
                Some(drone)
            }
            (drone, gimbal) => drone.or(gimbal),
        };
        if let Some(mut vehicle) = vehicle {
            vehicle.shift(start_ns);
            topics.add_recorded(vehicle, sink);
        }
        let place = Place { start_ns, rate: 1.0, is_guess: false };
        camera.map_times(|time_ns| place.time_ns(time_ns));
        place
    };
    topics.add_recorded(camera, sink);
    topics.add_video(&video, |time_ns| place.time_ns(time_ns));
    let facts = VideoFacts {
        resolution_px: video.resolution_px,
        firmware,
        field_of_view,
        horizontal_deg,
        has_unknown_axes,
        gimbal_frame: topics.gimbal_frame,
        camera_moves,
        has_autopilot: options.autopilot.is_some(),
    };
    topics.write(source, Some(&video), sink)?;
    Ok(facts)
}

/// Relation of the video's clock to the log's clock.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Log time at the start of the video.
    start_ns: i64,
    /// Log seconds per video second.
    rate: f64,
    /// True for a time that camera or autopilot have recorded, accurate to seconds at best.
    is_guess: bool,
}

impl Place {
    fn time_ns(self, video_ns: i64) -> i64 {
        let drifted_ns = (video_ns as f64 * (self.rate - 1.0)).round() as i64;
        self.start_ns.saturating_add(video_ns).saturating_add(drifted_ns)
    }
}

/// Times of a video on its own clock.
#[derive(Clone, Copy, Debug)]
struct VideoTimes {
    /// First and last presented time.
    span_ns: (i64, i64),
    /// UTC at the start, `None` if the camera recorded none.
    utc_ns: Option<i64>,
}

/// Relates a video to an autopilot's log: by the given clock, else by the specific forces of both IMUs, else by UTC if
/// both have it, else both start together.
fn place_video(
    recorded: &Recorded,
    camera: &Recorded,
    VideoTimes { span_ns: (first_ns, last_ns), utc_ns: video_utc_ns }: VideoTimes,
    clock: Option<VideoClock>,
    sink: &mut LogSink<'_>,
) -> Place {
    let (log_start_ns, log_end_ns) = recorded.span_ns().unwrap_or((UNKNOWN_START_NS, UNKNOWN_START_NS));
    if let Some(clock) = clock {
        let start_ns = log_start_ns.saturating_add(ns_from_seconds(clock.offset_s));
        sink.video_clock = Some(clock);
        return Place { start_ns, rate: 1.0 + clock.drift_ppm * 1e-6, is_guess: false };
    }
    let has_utc = !recorded.utc.is_empty();
    let overlaps = |start_ns: i64| {
        start_ns.saturating_add(last_ns) > log_start_ns && start_ns.saturating_add(first_ns) < log_end_ns
    };
    let (start_ns, reason) = match video_utc_ns {
        Some(start_ns) if has_utc && overlaps(start_ns) => (start_ns, "by the times of camera and autopilot"),
        Some(start_ns) if has_utc => {
            let distance_ns = start_ns.saturating_sub(log_start_ns).saturating_abs();
            let reason = if distance_ns < TIME_ZONES_NS {
                "starts aligned: by the camera's clock they do not overlap (is it set to local time?)"
            } else {
                "starts aligned: by the camera's clock they do not overlap"
            };
            (log_start_ns.saturating_sub(first_ns), reason)
        }
        _ => (log_start_ns.saturating_sub(first_ns), "starts aligned: camera or autopilot recorded no time"),
    };
    let both = two_imus::first_imu(recorded).zip(two_imus::first_imu(camera));
    if let Some(found) = both.and_then(|(vehicle, own)| two_imus::clock_by_forces(vehicle, own, start_ns)) {
        let offset_s = seconds_from_ns(found.start_ns.saturating_sub(log_start_ns));
        sink.video_clock = Some(VideoClock { offset_s, drift_ppm: 1e6 * found.drift });
        sink.forces = Some(found.agreement);
        return Place { start_ns: found.start_ns, rate: 1.0 + found.drift, is_guess: false };
    }
    let offset_s = seconds_from_ns(start_ns.saturating_sub(log_start_ns));
    sink.video_clock = Some(VideoClock { offset_s, drift_ppm: 0.0 });
    sink.note(format!(
        "the video is placed {offset_s:.3} s after the first measurement of the autopilot's log ({reason}), accurate to \
         seconds at best; give a better offset with --video-offset"
    ));
    Place { start_ns, rate: 1.0, is_guess: true }
}
