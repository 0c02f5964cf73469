//! Gimbal attitude of a log: topics, clocks, chains of transforms, and the vehicle's attitude between two messages.

mod transforms;

use nalgebra::UnitQuaternion;

pub(crate) use transforms::{TransformMerge, TransformPath};

use super::messages::{self, MessageKind};
use super::{FlightLog, LogError};
use crate::sensors::{AttitudeFrame, AttitudeMessage, AttitudeSource, BodyAxes, GimbalRig};

/// Vehicle attitudes further apart are not interpolated: an agile vehicle deviates by 3° from a constant rate in this
/// time.
pub(crate) const MAX_VEHICLE_GAP_NS: i64 = 200_000_000;

/// Message types of a vehicle's attitude.
pub(crate) const VEHICLE_KINDS: [MessageKind; 6] = [
    MessageKind::QuaternionStamped,
    MessageKind::PoseStamped,
    MessageKind::Odometry,
    MessageKind::TransformStamped,
    MessageKind::Imu,
    MessageKind::Px4VehicleAttitude,
];

/// Message types of the gimbal's topic.
pub(crate) fn gimbal_kinds(gimbal: &GimbalRig) -> &'static [MessageKind] {
    let Some(source) = &gimbal.attitude else { return &[MessageKind::JointState] };
    match source.message {
        AttitudeMessage::Quaternion => &[MessageKind::QuaternionStamped],
        AttitudeMessage::Pose => &[MessageKind::PoseStamped, MessageKind::Odometry, MessageKind::TransformStamped],
        AttitudeMessage::Euler(_) => &[MessageKind::Vector3Stamped],
        AttitudeMessage::Transforms { .. } => &[MessageKind::Transforms],
        AttitudeMessage::Mavros => &[MessageKind::MavrosGimbalAttitude],
        AttitudeMessage::Px4 => &[MessageKind::Px4GimbalAttitude],
    }
}

pub(crate) fn topic_field(gimbal: &GimbalRig) -> &'static str {
    if gimbal.attitude.is_some() { "gimbal.source.topic" } else { "gimbal.rostopic" }
}

/// Returns the topic and message type of the vehicle's attitude, `None` if every attitude is relative to the body.
pub(crate) fn vehicle_topic<'a>(
    log: &FlightLog,
    source: &'a AttitudeSource,
) -> Result<Option<(&'a str, MessageKind)>, LogError> {
    let Some(topic) = source.vehicle_topic.as_deref().filter(|_| source.frame != AttitudeFrame::Body) else {
        return Ok(None);
    };
    let info = log.require_topic("gimbal.source.vehicle", topic, &VEHICLE_KINDS)?;
    let kind = info.kind.unwrap_or(MessageKind::QuaternionStamped);
    // By ROS conventions these are in FLU, but not all programs follow them.
    let conventional = matches!(kind, MessageKind::Imu | MessageKind::Odometry);
    if conventional && source.axes == BodyAxes::Frd && source.vehicle_axes.is_none() {
        let problem = format!(
            "missing, expected frd or flu: '{topic}' is a {}, which should be in flu (ENU), and gimbal.source.axes is frd",
            kind.schema_name()
        );
        let field = "gimbal.source.vehicle_axes".to_owned();
        return Err(LogError::Rig { field, problem, path: log.path().to_owned() });
    }
    Ok(Some((topic, kind)))
}

/// Interpolates samples, in the order of their stamps, at a stamp by [`rotation_between`].
pub(crate) fn rotation_at(
    samples: &[(i64, UnitQuaternion<f64>)],
    stamp_ns: i64,
    max_gap_ns: i64,
) -> Option<UnitQuaternion<f64>> {
    let after = samples.partition_point(|(at_ns, _)| *at_ns <= stamp_ns);
    let before = after.checked_sub(1).and_then(|before| samples.get(before));
    rotation_between(before, samples.get(after), stamp_ns, max_gap_ns)
}

/// Interpolates two samples at a stamp; `None` outside of them or if they are too far apart.
pub(crate) fn rotation_between(
    before: Option<&(i64, UnitQuaternion<f64>)>,
    after: Option<&(i64, UnitQuaternion<f64>)>,
    stamp_ns: i64,
    max_gap_ns: i64,
) -> Option<UnitQuaternion<f64>> {
    let (before_ns, first) = before.filter(|(before_ns, _)| *before_ns <= stamp_ns)?;
    if *before_ns == stamp_ns {
        return Some(*first);
    }
    let (after_ns, second) = after?;
    let gap_ns = after_ns.saturating_sub(*before_ns);
    if gap_ns > max_gap_ns {
        return None;
    }
    let fraction = (stamp_ns - before_ns) as f64 / gap_ns as f64;
    first.try_slerp(second, fraction, 1e-9)
}

/// Reads the vehicle's attitude from a message: the stamp since the epoch and the rotation in FLU and ENU, or a
/// description of the problem.
pub(crate) fn read_vehicle(
    source: &AttitudeSource,
    kind: MessageKind,
    message: &[u8],
) -> Result<(i64, UnitQuaternion<f64>), String> {
    let attitude = messages::read_vehicle_attitude(kind, message).map_err(|error| error.to_string())?;
    let rotation = attitude.content.ok_or("not finite, a zero quaternion, or marked as unknown")?;
    Ok((attitude.stamp_ns, source.enu_from_flu(&rotation, kind == MessageKind::Px4VehicleAttitude)))
}
