//! Gimbal attitude of a log: topics, clocks, chains of transforms, and the vehicle's attitude between two messages.

use std::collections::{BTreeMap, VecDeque};

use nalgebra::UnitQuaternion;

use crate::files::FileError;
use crate::flight_log::messages::{AttitudeLayout, MessageKind, bare_name, read_transforms};
use crate::flight_log::{FlightLog, LogError, messages};
use crate::sensors::{AttitudeFrame, AttitudeMessage, AttitudeSource, BodyAxes, GimbalRig};

/// Vehicle attitudes further apart are not interpolated: an agile vehicle deviates by 3° from a constant rate in this
/// time.
pub(crate) const MAX_VEHICLE_GAP_NS: i64 = 200_000_000;

/// Message types of a vehicle's attitude.
pub const VEHICLE_KINDS: [MessageKind; 6] = [
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

/// Returns the topic and message layout of the vehicle's attitude, `None` if every attitude is relative to the body.
pub(crate) fn vehicle_topic<'a>(
    log: &FlightLog,
    source: &'a AttitudeSource,
) -> Result<Option<(&'a str, AttitudeLayout)>, LogError> {
    let Some(topic) = source.vehicle_topic.as_deref().filter(|_| source.frame != AttitudeFrame::Body) else {
        return Ok(None);
    };
    let info = log.require_topic("gimbal.source.vehicle", topic, &VEHICLE_KINDS)?;
    let layout = log.attitude_layout("gimbal.source.vehicle", info)?;
    // By ROS conventions these are in FLU, but not all programs follow them.
    let conventional = matches!(layout.kind, MessageKind::Imu | MessageKind::Odometry);
    if conventional && source.axes == BodyAxes::Frd && source.vehicle_axes.is_none() {
        let problem = format!(
            "missing, expected frd or flu: '{topic}' is a {}, which should be in flu (ENU), and gimbal.source.axes is frd",
            layout.kind.schema_name()
        );
        let field = "gimbal.source.vehicle_axes".to_owned();
        return Err(FileError::Rig { field, problem, path: log.path().to_owned() }.into());
    }
    Ok(Some((topic, layout)))
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
    layout: AttitudeLayout,
    message: &[u8],
) -> Result<(i64, UnitQuaternion<f64>), String> {
    let attitude = messages::read_vehicle_attitude(layout, message).map_err(|error| error.to_string())?;
    let rotation = attitude.content.ok_or("not finite, a zero quaternion, or marked as unknown")?;
    Ok((attitude.stamp_ns, source.enu_from_flu(&rotation, layout.kind == MessageKind::Px4VehicleAttitude)))
}

/// Number of messages of a topic within which every frame must occur.
const MESSAGES_SEARCHED: usize = 5000;
/// Largest number of frames of a robot; further ones are ignored.
const MAX_FRAMES: usize = 4096;
/// Larger gaps between readings of a transform are not interpolated.
const MAX_GAP_NS: i64 = 200_000_000;

/// Transforms from a gimbal's frame to the frame that its attitude is relative to.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TransformPath {
    edges: Vec<Edge>,
}

/// Transform between a frame and its parent.
#[derive(Clone, Debug, PartialEq)]
struct Edge {
    child: String,
    /// True if the path goes from the parent to the child.
    inverted: bool,
    /// `parent_from_child` of a static transform.
    fixed: Option<UnitQuaternion<f64>>,
}

/// Parent of every frame, with the rotation of a static transform.
type Tree = BTreeMap<String, (String, Option<UnitQuaternion<f64>>)>;

impl TransformPath {
    /// Finds the path between two frames of a log: static transforms of `/tf_static` (or the topic with `_static`),
    /// others of `topic`.
    pub(crate) fn find(log: &FlightLog, topic: &str, parent: &str, child: &str) -> Result<Self, LogError> {
        let (parent, child) = (bare_name(parent), bare_name(child));
        let mut tree = Tree::new();
        for fixed in [format!("{topic}_static"), "/tf_static".to_owned()] {
            if log.topic(&fixed).is_some_and(|info| info.kind == Some(MessageKind::Transforms)) {
                collect(log, &fixed, true, &mut tree, |_| false);
            }
        }
        let mut found = Err(String::new());
        collect(log, topic, false, &mut tree, |tree| {
            found = Self::in_tree(tree, parent, child);
            found.is_ok()
        });
        if found.is_err() {
            found = Self::in_tree(&tree, parent, child);
        }
        found.map_err(|problem| LogError::NoTransform { topic: topic.to_owned(), problem, path: log.path().to_owned() })
    }

    fn in_tree(tree: &Tree, parent: &str, child: &str) -> Result<Self, String> {
        let ancestors = |frame: &str| {
            let mut frames = vec![frame.to_owned()];
            while let Some((above, _)) = frames.last().and_then(|last| tree.get(last)) {
                // Stop at a loop of frames.
                if frames.contains(above) {
                    break;
                }
                frames.push(above.clone());
            }
            frames
        };
        let (down, up) = (ancestors(parent), ancestors(child));
        for (frame, frames) in [(parent, &down), (child, &up)] {
            let is_parent = tree.values().any(|(above, _)| above == frame);
            if frames.len() == 1 && !is_parent {
                let known: Vec<&str> = tree.keys().map(String::as_str).take(20).collect();
                let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
                return Err(format!("there is no frame '{frame}'; the frames are {known}"));
            }
        }
        let common = up.iter().find(|frame| down.contains(*frame));
        let common = common.ok_or_else(|| format!("'{parent}' and '{child}' are not connected"))?;
        let edge = |inverted: bool| {
            move |frame: &String| {
                let fixed = tree.get(frame).and_then(|(_, fixed)| *fixed);
                Edge { child: frame.clone(), inverted, fixed }
            }
        };
        let below = |frames: &[String]| frames.iter().take_while(|frame| *frame != common).cloned().collect::<Vec<_>>();
        // From the outer frame up to the common one, then down to the gimbal.
        let mut edges: Vec<Edge> = below(&down).iter().map(edge(true)).collect();
        edges.extend(below(&up).iter().rev().map(edge(false)));
        if edges.iter().all(|edge| edge.fixed.is_some()) {
            return Err(format!("all transforms between '{parent}' and '{child}' are static"));
        }
        Ok(Self { edges })
    }

    /// Index among the changing transforms of the one with this child frame.
    pub(crate) fn moving(&self, child: &str) -> Option<usize> {
        self.edges.iter().filter(|edge| edge.fixed.is_none()).position(|edge| edge.child == child)
    }

    fn moving_count(&self) -> usize {
        self.edges.iter().filter(|edge| edge.fixed.is_none()).count()
    }

    /// Rotation from the last frame to the first, given one rotation for each changing transform.
    fn rotation(&self, moving: &[UnitQuaternion<f64>]) -> UnitQuaternion<f64> {
        let mut next = moving.iter();
        self.edges.iter().fold(UnitQuaternion::identity(), |before, edge| {
            let rotation = edge.fixed.or_else(|| next.next().copied()).unwrap_or_default();
            before * if edge.inverted { rotation.inverse() } else { rotation }
        })
    }
}

/// Adds the transforms of a topic to the tree until `complete` returns true.
fn collect(log: &FlightLog, topic: &str, fixed: bool, tree: &mut Tree, mut complete: impl FnMut(&Tree) -> bool) {
    let mut searched = 0;
    log.for_each_message(topic, |_, data| {
        let mut added = false;
        for entry in read_transforms(data).unwrap_or_default() {
            let Some(rotation) = entry.rotation.filter(|_| tree.len() < MAX_FRAMES) else { continue };
            let value = (entry.parent.to_owned(), fixed.then_some(rotation));
            added |= tree.insert(entry.child.to_owned(), value.clone()) != Some(value);
        }
        searched += 1;
        !(added && complete(tree)) && searched < MESSAGES_SEARCHED
    });
}

/// Merges the changing transforms at the stamps of the first of them; the others are interpolated.
#[derive(Clone, Debug)]
pub(crate) struct TransformMerge {
    path: TransformPath,
    /// Readings by transform, starting with the last one at or before the next stamp.
    readings: Vec<VecDeque<(i64, UnitQuaternion<f64>)>>,
    newest_ns: i64,
    ended: bool,
}

impl TransformMerge {
    pub(crate) fn new(path: TransformPath) -> Self {
        let readings = vec![VecDeque::new(); path.moving_count()];
        Self { path, readings, newest_ns: i64::MIN, ended: false }
    }

    /// Adds the next reading of a transform; one with the same stamp or an older one is left out.
    pub(crate) fn push(&mut self, transform: usize, stamp_ns: i64, rotation: UnitQuaternion<f64>) {
        self.newest_ns = self.newest_ns.max(stamp_ns);
        if let Some(queue) = self.readings.get_mut(transform)
            && queue.back().is_none_or(|(last_ns, _)| *last_ns < stamp_ns)
        {
            queue.push_back((stamp_ns, rotation));
        }
    }

    pub(crate) fn finish(&mut self) {
        self.ended = true;
    }

    /// Next rotation along the path with its stamp, `None` while later readings are needed.
    pub(crate) fn pop(&mut self) -> Option<(i64, UnitQuaternion<f64>)> {
        loop {
            let (stamp_ns, _) = *self.readings.first()?.front()?;
            for queue in &mut self.readings {
                while queue.get(1).is_some_and(|(second_ns, _)| *second_ns <= stamp_ns) {
                    queue.pop_front();
                }
            }
            let late = self.ended || self.newest_ns.saturating_sub(stamp_ns) > MAX_GAP_NS;
            let waits = |queue: &VecDeque<_>| queue.back().is_none_or(|(last_ns, _): &(i64, _)| *last_ns < stamp_ns);
            if !late && self.readings.iter().any(waits) {
                return None;
            }
            let at = |queue: &VecDeque<_>| rotation_between(queue.front(), queue.get(1), stamp_ns, MAX_GAP_NS);
            let moving: Option<Vec<UnitQuaternion<f64>>> = self.readings.iter().map(at).collect();
            self.readings[0].pop_front();
            if let Some(moving) = moving {
                return Some((stamp_ns, self.path.rotation(&moving)));
            }
        }
    }
}
