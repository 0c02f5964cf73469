//! Gimbal attitudes of a whole log, for a rig that names an attitude in place of joint angles.

use nalgebra::UnitQuaternion;

use crate::flight_log::joints::JointReading;
use crate::flight_log::joints::attitude::{
    MAX_VEHICLE_GAP_NS, TransformMerge, TransformPath, gimbal_kinds, rotation_at, topic_field, vehicle_topic,
};
use crate::flight_log::log::relative_ns;
use crate::flight_log::messages::{self, AttitudeLayout, MessageKind};
use crate::flight_log::stamps::clock::StampClock;
use crate::flight_log::{FlightLog, LogError};
use crate::geometry::ns_from_seconds;
use crate::sensors::{AttitudeFrame, AttitudeMessage, AttitudeSource, AttitudeValue, GimbalRig};

/// Attitudes farther apart are not interpolated.
const MAX_GAP_NS: i64 = 300_000_000;

/// Attitudes of gimbal and vehicle as recorded.
#[derive(Debug)]
pub(crate) struct AttitudeSurvey {
    topic: String,
    layout: AttitudeLayout,
    clock: StampClock,
    /// For a gimbal attitude in transforms, otherwise `None`.
    merge: Option<(TransformPath, TransformMerge)>,
    /// Rotations of the moving transforms of the path, in the order of log times.
    moved: Vec<(usize, i64, UnitQuaternion<f64>)>,
    vehicle_topic: Option<(String, AttitudeLayout, StampClock)>,
    /// Attitudes with the stamps of their messages, ordered by stamp.
    pub(crate) values: Vec<(i64, AttitudeValue)>,
    /// `earth_from_vehicle` as recorded, ordered by stamp.
    pub(crate) vehicle: Vec<(i64, UnitQuaternion<f64>)>,
    pub(crate) warnings: Vec<String>,
}

/// Joint angles of one attitude.
#[derive(Clone, Debug)]
pub(crate) struct SolvedAttitude {
    pub(crate) reading: JointReading,
    /// Rotation that the joints cannot reach, in radians.
    pub(crate) unreachable_rad: f64,
    /// True if the orientation alone determines the joint angles.
    pub(crate) decided: bool,
}

impl AttitudeSurvey {
    /// Finds the topics and clocks of the attitudes; `None` for a rig with joint angles.
    pub(crate) fn new(log: &FlightLog, gimbal: &GimbalRig) -> Result<Option<Self>, LogError> {
        let (Some(source), Some(topic)) = (&gimbal.attitude, &gimbal.topic) else { return Ok(None) };
        let info = log.require_topic(topic_field(gimbal), topic, gimbal_kinds(gimbal))?;
        let layout = log.attitude_layout(topic_field(gimbal), info)?;
        let clock = match StampClock::of_rig(gimbal.use_log_time) {
            StampClock::Stamps => StampClock::of(log, topic, layout.kind)?,
            given => given,
        };
        let mut warnings: Vec<String> = clock.warning(topic).into_iter().collect();
        let merge = match &source.message {
            AttitudeMessage::Transforms { parent, child } => {
                let path = TransformPath::find(log, topic, parent, child)?;
                Some((path.clone(), TransformMerge::new(path)))
            }
            _ => None,
        };
        // Also for an attitude relative to the body: other frames are tried as well.
        let any_frame = AttitudeSource { frame: AttitudeFrame::Earth, ..source.clone() };
        let read_vehicle = if source.frame == AttitudeFrame::Body { &any_frame } else { source };
        let vehicle = match vehicle_topic(log, read_vehicle).or_else(|error| match source.frame {
            AttitudeFrame::Body => Ok(None),
            _ => Err(error),
        })? {
            None => None,
            Some((topic, layout)) => {
                let clock = StampClock::of(log, topic, layout.kind)?;
                warnings.extend(clock.warning(topic));
                Some((topic.to_owned(), layout, clock))
            }
        };
        Ok(Some(Self {
            topic: topic.clone(),
            layout,
            clock,
            merge,
            moved: Vec::new(),
            vehicle_topic: vehicle,
            values: Vec::new(),
            vehicle: Vec::new(),
            warnings,
        }))
    }

    /// True if the stamps of a topic are taken from log times.
    pub(crate) fn counts_log_times(&self, topic: &str) -> bool {
        let of_vehicle = self.vehicle_topic.as_ref().filter(|(vehicle, ..)| vehicle == topic).map(|(.., clock)| *clock);
        let clock = if topic == self.topic { Some(self.clock) } else { of_vehicle };
        matches!(clock, Some(StampClock::LogTimes { .. } | StampClock::LogTimesOfRig))
    }

    /// Reads a message of any topic; `stamp_ns` and the stamps within it are relative to the log's start. Returns the
    /// problem of an invalid message.
    pub(crate) fn take(&mut self, topic: &str, stamp_ns: i64, epoch_ns: i64, data: &[u8]) -> Result<(), String> {
        const NO_ATTITUDE: &str = "the attitude is not finite, a zero quaternion, or marked as unknown";
        if topic == self.topic {
            if let Some((path, _)) = &self.merge {
                for entry in messages::read_transforms(data).map_err(|error| error.to_string())? {
                    let Some(transform) = path.moving(entry.child) else { continue };
                    let rotation = entry.rotation.ok_or(NO_ATTITUDE)?;
                    let entry_ns = match self.clock {
                        StampClock::LogTimesOfRig => stamp_ns,
                        _ => relative_ns(entry.stamp_ns, epoch_ns),
                    };
                    self.moved.push((transform, entry_ns, rotation));
                }
            } else {
                let message = messages::read_gimbal_attitude(self.layout, data).map_err(|error| error.to_string())?;
                self.values.push((stamp_ns, message.content.ok_or(NO_ATTITUDE)?));
            }
        }
        if let Some((_, layout, _)) = self.vehicle_topic.as_ref().filter(|(vehicle, ..)| vehicle == topic) {
            let message = messages::read_vehicle_attitude(*layout, data).map_err(|error| error.to_string())?;
            self.vehicle.push((stamp_ns, message.content.ok_or(NO_ATTITUDE)?));
        }
        Ok(())
    }

    /// Merges transforms, and sorts all readings by stamp.
    pub(crate) fn finish(&mut self) {
        if let Some((_, merge)) = &mut self.merge {
            self.moved.sort_by_key(|(_, stamp_ns, _)| *stamp_ns);
            for (transform, stamp_ns, rotation) in self.moved.drain(..) {
                merge.push(transform, stamp_ns, rotation);
                self.values.extend(
                    std::iter::from_fn(|| merge.pop()).map(|(stamp_ns, it)| (stamp_ns, AttitudeValue::Rotation(it))),
                );
            }
            merge.finish();
            self.values.extend(
                std::iter::from_fn(|| merge.pop()).map(|(at, rotation)| (at, AttitudeValue::Rotation(rotation))),
            );
        }
        self.values.sort_by_key(|(stamp_ns, _)| *stamp_ns);
        self.values.dedup_by_key(|(stamp_ns, _)| *stamp_ns);
        self.vehicle.sort_by_key(|(stamp_ns, _)| *stamp_ns);
        self.vehicle.dedup_by_key(|(stamp_ns, _)| *stamp_ns);
    }

    /// Attitude of the vehicle in FLU and ENU at a stamp.
    fn enu_from_flu(&self, source: &AttitudeSource, stamp_ns: i64) -> Option<UnitQuaternion<f64>> {
        let (_, layout, _) = self.vehicle_topic.as_ref()?;
        let rotation = rotation_at(&self.vehicle, stamp_ns, MAX_VEHICLE_GAP_NS)?;
        Some(source.enu_from_flu(&rotation, layout.kind == MessageKind::Px4VehicleAttitude))
    }

    /// Attitudes `enu_from_flu` of the vehicle, ordered by stamp.
    pub(crate) fn vehicle_in_enu(&self, source: &AttitudeSource) -> Vec<(i64, UnitQuaternion<f64>)> {
        let of_px4 =
            self.vehicle_topic.as_ref().is_some_and(|(_, layout, _)| layout.kind == MessageKind::Px4VehicleAttitude);
        self.vehicle.iter().map(|(stamp_ns, rotation)| (*stamp_ns, source.enu_from_flu(rotation, of_px4))).collect()
    }

    /// True if there are attitudes of the vehicle.
    pub(crate) fn has_vehicle(&self) -> bool {
        !self.vehicle.is_empty()
    }

    pub(crate) fn topic(&self) -> &str {
        &self.topic
    }

    /// Topic of the vehicle's attitude, `None` if the rig needs none.
    pub(crate) fn vehicle_topic(&self) -> Option<&str> {
        self.vehicle_topic.as_ref().map(|(topic, ..)| topic.as_str())
    }

    /// The attitudes with other rotations of gimbal and vehicle.
    pub(crate) fn with_rotations(
        &self,
        gimbal: impl Fn(&UnitQuaternion<f64>) -> UnitQuaternion<f64>,
        vehicle: impl Fn(&UnitQuaternion<f64>) -> UnitQuaternion<f64>,
    ) -> Self {
        let value = |(stamp_ns, value): &(i64, AttitudeValue)| {
            let changed = match value {
                AttitudeValue::Rotation(rotation) => AttitudeValue::Rotation(gimbal(rotation)),
                AttitudeValue::Flagged(rotation, flags) => AttitudeValue::Flagged(gimbal(rotation), *flags),
                AttitudeValue::Vector(angles) => AttitudeValue::Vector(*angles),
            };
            (*stamp_ns, changed)
        };
        Self {
            topic: self.topic.clone(),
            layout: self.layout,
            clock: self.clock,
            merge: None,
            moved: Vec::new(),
            vehicle_topic: self.vehicle_topic.clone(),
            values: self.values.iter().map(value).collect(),
            vehicle: self.vehicle.iter().map(|(at, rotation)| (*at, vehicle(rotation))).collect(),
            warnings: Vec::new(),
        }
    }

    /// Orientation `imu_from_camera` at a time, interpolated between the recorded ones; `source` may differ from the
    /// rig's.
    pub(crate) fn orientation_at(
        &self,
        source: &AttitudeSource,
        timeshift_ns: i64,
        stamp_ns: i64,
    ) -> Option<UnitQuaternion<f64>> {
        let at_ns = stamp_ns.saturating_sub(timeshift_ns);
        let after = self.values.partition_point(|(at, _)| *at <= at_ns);
        let (before_ns, before) = self.values.get(after.checked_sub(1)?)?;
        let (after_ns, after) = self.values.get(after)?;
        if after_ns - before_ns > MAX_GAP_NS {
            return None;
        }
        let fraction = (at_ns - before_ns) as f64 / (after_ns - before_ns) as f64;
        let value = source.between(before, after, fraction)?;
        source.imu_from_camera(&value, self.enu_from_flu(source, stamp_ns).as_ref())
    }

    /// Orientations `imu_from_camera` with stamps shifted by `timeshift_ns`; `source` may differ from the rig's.
    pub(crate) fn orientations(&self, source: &AttitudeSource, timeshift_ns: i64) -> Vec<(i64, UnitQuaternion<f64>)> {
        let orientation = |(at, value): &(i64, AttitudeValue)| {
            let stamp_ns = at.saturating_add(timeshift_ns);
            let attitude = self.enu_from_flu(source, stamp_ns);
            Some((stamp_ns, source.imu_from_camera(value, attitude.as_ref())?))
        };
        self.values.iter().filter_map(orientation).collect()
    }

    /// Joint angles of all attitudes by the rig.
    pub(crate) fn solve(&self, gimbal: &GimbalRig) -> Vec<SolvedAttitude> {
        let Some(source) = &gimbal.attitude else { return Vec::new() };
        let Some(inverse) = gimbal.inverse_chain() else { return Vec::new() };
        let mut previous: Option<Vec<f64>> = None;
        let orientations = self.orientations(source, ns_from_seconds(gimbal.timeshift_gimbal_imu_s));
        let solved = orientations.into_iter().map(|(stamp_ns, imu_from_camera)| {
            let solution = inverse.solve(&imu_from_camera, previous.as_deref());
            previous = Some(solution.joint_angles_rad.clone());
            let angles_rad = solution.joint_angles_rad.into_iter().map(Some).collect();
            SolvedAttitude {
                reading: JointReading { stamp_ns, angles_rad },
                unreachable_rad: solution.unreachable_rad,
                decided: solution.decided,
            }
        });
        solved.collect()
    }
}
