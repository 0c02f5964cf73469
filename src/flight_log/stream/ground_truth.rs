//! Ground-truth poses of a log at any stamp.

use super::super::log::relative_ns;
use super::super::messages::{self, MessageKind};
use super::super::{FlightLog, WarningKind};
use super::ordered::{Decoder, Lookup, MessageSource, OrderedSamples};
use super::read_context::{ReadContext, Refusal};
use crate::flight_log::stamps::clock::StampClock;
use crate::geometry::RigidTransform;
use crate::sensors::{NEAREST_POSE_NS, PoseSample, Rig};

/// Poses `world_from_imu` in the order of their stamps.
pub(super) struct GroundTruth {
    poses: Lookup<PoseSample>,
}

impl GroundTruth {
    /// Ground truth of a rig, `None` if the rig has no such topic or the log lacks it.
    pub(super) fn new(log: &FlightLog, rig: &Rig, from_ns: i64, context: &mut ReadContext) -> Option<Self> {
        // Positions are not poses of the IMU: they are compared with whole trajectories.
        let topic = rig.ground_truth_topic.as_ref().filter(|topic| !log.is_position_topic(topic))?;
        let kinds = [MessageKind::Odometry, MessageKind::PoseStamped, MessageKind::TransformStamped];
        let kind = match log.require_topic("ground_truth.rostopic", topic, &kinds) {
            Ok(info) => info.kind?,
            Err(error) => {
                context.warn(WarningKind::NoGroundTruth, topic, 0, format!("no ground truth: {error}"));
                return None;
            }
        };
        let decoder = pose_decoder(kind, log.epoch_ns(), StampClock::of_rig(rig.ground_truth_use_log_time));
        Some(Self { poses: Lookup::new(OrderedSamples::new(log, topic, from_ns, false, decoder)) })
    }

    /// Next pose as recorded, `None` at the end of the log; not to be mixed with [`Self::at`].
    pub(super) fn next(&mut self, context: &mut ReadContext) -> Option<PoseSample> {
        self.poses.next(context)
    }

    /// Pose interpolated at a stamp, `None` without one near it; stamps must not decrease.
    pub(super) fn at(&mut self, context: &mut ReadContext, stamp_ns: i64) -> Option<RigidTransform> {
        let [before, after] = self.poses.around(context, stamp_ns);
        let (from_ns, from) = before?;
        if *from_ns == stamp_ns {
            return Some(from.world_from_imu);
        }
        let (to_ns, to) = after?;
        if (stamp_ns - from_ns).min(to_ns - stamp_ns) > NEAREST_POSE_NS {
            return None;
        }
        let fraction = (stamp_ns - from_ns) as f64 / (to_ns - from_ns) as f64;
        Some(from.world_from_imu.interpolate(&to.world_from_imu, fraction))
    }
}

fn pose_decoder(kind: MessageKind, epoch_ns: i64, clock: StampClock) -> Decoder<PoseSample> {
    Box::new(move |source: MessageSource<'_>| {
        let message = messages::read_pose(kind, source.data).map_err(|error| Refusal::not_decodable(&error))?;
        let refusal = || Refusal { reason: "not a pose", detail: "not finite, or a zero quaternion".into() };
        let world_from_imu = message.pose.ok_or_else(refusal)?;
        let absolute_ns = clock.stamp_ns(message.stamp_ns, source.position.log_time_ns);
        Ok((absolute_ns, PoseSample { stamp_ns: relative_ns(absolute_ns, epoch_ns), world_from_imu }))
    })
}
