//! Vehicles of a telemetry log: `MAVLink` systems, whose components have clocks of their own.

use std::collections::{BTreeMap, BTreeSet};

use super::super::super::sink::LogSink;
use super::super::recorded::Recorded;
use super::frames::Frame;

/// `MAV_AUTOPILOT_ARDUPILOTMEGA`, whose `RAW_IMU` has the units of `SCALED_IMU`.
const ARDUPILOT: u8 = 3;
/// A component has restarted if its times go back by more than this.
const RESTART_NS: i64 = 10_000_000_000;

/// Measurements of a component from one start to the next, in time since its start.
#[derive(Debug)]
struct Session {
    recorded: Recorded,
    last_ns: i64,
    /// Smallest delay from a measurement to its reception: the offset of both clocks, and the fastest message's delay.
    offset_ns: i64,
}

impl Session {
    /// All measurements, at times since the epoch.
    fn finish(mut self) -> Recorded {
        let offset_ns = self.recorded.utc_offset_ns().unwrap_or(self.offset_ns);
        self.recorded.shift(offset_ns);
        self.recorded
    }
}

/// Messages of one system.
#[derive(Debug)]
pub(super) struct Vehicle {
    /// Measurements with times since the epoch.
    pub(super) recorded: Recorded,
    sessions: BTreeMap<u8, Session>,
    /// Kind of its autopilot, by its heartbeat.
    autopilot: Option<u8>,
    restarts: u64,
    /// Number of messages by name.
    counts: BTreeMap<&'static str, u64>,
    /// IMUs in units of the sensor, unless the autopilot is `ArduPilot`.
    pub(super) raw_imus: BTreeSet<String>,
}

pub(super) fn empty() -> Recorded {
    Recorded::new("MAVLink telemetry log", "")
}

impl Default for Vehicle {
    fn default() -> Self {
        Self {
            recorded: empty(),
            sessions: BTreeMap::new(),
            autopilot: None,
            restarts: 0,
            counts: BTreeMap::new(),
            raw_imus: BTreeSet::new(),
        }
    }
}

impl Vehicle {
    /// Takes the kind of autopilot of a heartbeat.
    pub(super) fn take_heartbeat(&mut self, autopilot: u8) {
        self.autopilot.get_or_insert(autopilot);
    }

    /// Counts a message by its name.
    pub(super) fn count(&mut self, name: &'static str) {
        *self.counts.entry(name).or_default() += 1;
    }

    /// Session of a component at a time since its start.
    pub(super) fn session(&mut self, frame: &Frame, time_ns: i64) -> &mut Recorded {
        let offset_ns = frame.received_ns.saturating_sub(time_ns);
        let new = || Session { recorded: empty(), last_ns: time_ns, offset_ns };
        let session = self.sessions.entry(frame.component).or_insert_with(new);
        if time_ns < session.last_ns.saturating_sub(RESTART_NS) {
            let ended = std::mem::replace(session, new());
            self.recorded.append(ended.finish());
            self.restarts += 1;
        }
        session.last_ns = time_ns;
        session.offset_ns = session.offset_ns.min(offset_ns);
        &mut session.recorded
    }

    fn measurements(&self) -> u64 {
        let of_sessions: u64 = self.sessions.values().map(|session| session.recorded.count()).sum();
        self.recorded.count() + of_sessions
    }

    /// All measurements, at times since the epoch.
    fn finish(self) -> Recorded {
        let Self { mut recorded, sessions, autopilot, restarts, raw_imus, .. } = self;
        for session in sessions.into_values() {
            recorded.append(session.finish());
        }
        if autopilot != Some(ARDUPILOT) {
            for name in raw_imus {
                let count = recorded.imus.remove(&name).map_or(0, |imu| imu.combined.len() as u64);
                recorded.leave_many(&name, count, "in units of the sensor, which are known for ArduPilot only");
            }
        }
        if restarts > 0 {
            recorded.notes.push(format!("the autopilot or the gimbal has restarted {restarts} times during the log"));
        }
        recorded
    }
}

/// Measurements of the wanted vehicle, else of the one with an autopilot and the most measurements; the messages of the
/// others are counted as left out.
pub(super) fn chosen(vehicles: BTreeMap<u8, Vehicle>, sink: &mut LogSink<'_>) -> Recorded {
    let name = |system: u8| format!("system {system}");
    let measuring: Vec<(u8, u64)> = vehicles
        .iter()
        .map(|(system, vehicle)| (*system, vehicle.measurements()))
        .filter(|(_, count)| *count > 0)
        .collect();
    for (system, _) in &measuring {
        sink.records.offer(&name(*system));
    }
    let has_autopilot = |system: u8| vehicles.get(&system).is_some_and(|vehicle| vehicle.autopilot.is_some());
    let wanted = measuring.iter().find(|(system, _)| sink.records.wants(&name(*system)));
    // Of equal ones the first.
    let best = measuring.iter().rev().max_by_key(|(system, count)| (has_autopilot(*system), *count));
    let taken = wanted.or(best).map(|(system, _)| *system);
    let mut recorded = empty();
    for (system, vehicle) in vehicles {
        if taken.is_none_or(|taken| taken == system) {
            recorded.append(vehicle.finish());
            continue;
        }
        for (message, count) in vehicle.counts {
            recorded.leave_many(&format!("{message} of {}", name(system)), count, "of another vehicle");
        }
    }
    if let (Some(taken), true) = (taken, measuring.len() > 1) {
        let list: Vec<String> =
            measuring.iter().map(|(system, count)| format!("{} ({count} measurements)", name(*system))).collect();
        recorded.notes.push(format!(
            "several vehicles: {}; {} is taken, another one with --take \"NAME\"",
            list.join(", "),
            name(taken)
        ));
    }
    recorded
}
