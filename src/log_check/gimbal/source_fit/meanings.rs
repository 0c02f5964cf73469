//! Alternative interpretations of a gimbal's attitude, and quaternions that a driver fills in wrongly.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::files::rig::attitude::entries;
use crate::log_check::permutations::permutations;
use crate::log_check::survey::attitude::AttitudeSurvey;
use crate::sensors::{AngleUnit, AttitudeFrame, AttitudeMessage, AttitudeSource, BodyAxes, GimbalRig, NamedAxes};
use crate::text::Named as _;

/// Interpretations that differ from `source` in one property, grouped by property.
pub(super) fn changes(source: &AttitudeSource, has_vehicle: bool) -> Vec<Vec<AttitudeSource>> {
    let with = |change: &dyn Fn(&mut AttitudeSource)| {
        let mut other = source.clone();
        change(&mut other);
        other
    };
    let flagged = matches!(source.message, AttitudeMessage::Mavros | AttitudeMessage::Px4);
    let frames = AttitudeFrame::all().filter(|frame| match frame {
        AttitudeFrame::Body => true,
        AttitudeFrame::Vehicle | AttitudeFrame::Earth => has_vehicle,
        AttitudeFrame::Flags => has_vehicle && flagged,
    });
    let mut all = vec![
        frames.map(|frame| with(&|other| other.frame = frame)).collect::<Vec<_>>(),
        BodyAxes::all().map(|axes| with(&|other| other.axes = axes)).collect(),
        [None, Some(NamedAxes::RDF)].into_iter().map(|axes| with(&|other| other.gimbal_axes = axes)).collect(),
        [NamedAxes::FLU, NamedAxes::FRD, NamedAxes::RDF]
            .into_iter()
            .map(|axes| with(&|other| other.imu_axes = axes))
            .collect(),
    ];
    if has_vehicle {
        let given = source.vehicle_axes.unwrap_or(source.axes);
        let axes = BodyAxes::all().filter(|axes| *axes != given);
        all.push(axes.map(|axes| with(&|other| other.vehicle_axes = Some(axes))).collect());
    }
    if let AttitudeMessage::Euler(angles) = &source.message {
        let count = angles.order.len();
        let orders = permutations(count).into_iter().map(|order| {
            let mut other = angles.clone();
            other.order = order.iter().map(|index| angles.order[*index]).collect();
            other
        });
        let fields = permutations(count).into_iter().map(|order| {
            let mut other = angles.clone();
            for (rotation, index) in other.order.iter_mut().zip(order) {
                rotation.field = angles.order[index].field;
            }
            other
        });
        let signs = (0..1_usize << count).map(|signs| {
            let mut other = angles.clone();
            for (index, rotation) in other.order.iter_mut().enumerate() {
                rotation.negative ^= signs >> index & 1 == 1;
            }
            other
        });
        let units = AngleUnit::all().map(|unit| {
            let mut other = angles.clone();
            other.unit = unit;
            other
        });
        let message = |angles| with(&|other| other.message = AttitudeMessage::Euler(Clone::clone(&angles)));
        all.push(orders.map(message).collect());
        all.push(fields.map(message).collect());
        all.push(signs.map(message).collect());
        all.push(units.map(message).collect());
    }
    for sources in &mut all {
        sources.retain(|other| other != source);
    }
    all
}

/// Entries of `gimbal.source` in which another interpretation differs.
pub(super) fn difference(gimbal: &GimbalRig, source: &AttitudeSource, other: &AttitudeSource) -> String {
    let topic = gimbal.topic.as_deref().unwrap_or_default();
    let (given, other) = (entries(topic, source), entries(topic, other));
    let mut changed: Vec<String> =
        other.iter().filter(|entry| !given.contains(entry)).map(|(key, value)| format!("{key}: {value}")).collect();
    for (key, _) in given.iter().filter(|(key, _)| !other.iter().any(|(kept, _)| kept == key)) {
        changed.push(if *key == "imu_axes" { "imu_axes: flu".to_owned() } else { format!("no {key}") });
    }
    changed.join(", ")
}

/// Fault of the quaternions of an attitude.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum QuaternionFault {
    /// Conjugates: they map the reference to the body.
    Inverse,
    /// The fields x, y, z, w contain w, x, y, z.
    ScalarFirst,
    /// The fields w, x, y, z contain x, y, z, w.
    ScalarLast,
    /// Angles of this order of rotations were put together in the order yaw, pitch, roll.
    Order(Order),
}

/// Axes of the rotations by which Euler angles are put together, about moving axes: 0 is roll, 1 pitch, 2 yaw.
type Order = [usize; 3];

/// Orders other than yaw, pitch, roll, the usual one of gimbals first.
const ORDERS: [Order; 5] = [[2, 0, 1], [1, 0, 2], [0, 1, 2], [1, 2, 0], [0, 2, 1]];
const ANGLES: [&str; 3] = ["roll", "pitch", "yaw"];

/// Topics of the quaternions with a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Faulty {
    Gimbal,
    Vehicle,
    Both,
}

/// Corrected attitudes with the fault that they had, in words.
pub(super) struct Corrected {
    pub(super) attitude: AttitudeSurvey,
    pub(super) fault: String,
}

impl QuaternionFault {
    fn all() -> impl Iterator<Item = Self> {
        [Self::Inverse, Self::ScalarFirst, Self::ScalarLast].into_iter().chain(ORDERS.map(Self::Order))
    }

    fn correct(self, read: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        match self {
            Self::Inverse => read.inverse(),
            Self::ScalarFirst => UnitQuaternion::new_unchecked(Quaternion::new(read.i, read.j, read.k, read.w)),
            Self::ScalarLast => UnitQuaternion::new_unchecked(Quaternion::new(read.k, read.w, read.i, read.j)),
            Self::Order(order) => {
                let angles_rad = <[f64; 3]>::from(read.euler_angles());
                let axes = [Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis()];
                let about = |axis: usize| UnitQuaternion::from_axis_angle(&axes[axis], angles_rad[axis]);
                order.into_iter().fold(UnitQuaternion::identity(), |outer, axis| outer * about(axis))
            }
        }
    }

    fn describe(self) -> String {
        let text = match self {
            Self::Order(order) => {
                let names = order.map(|axis| ANGLES[axis]).join(", ");
                return format!("are made of angles of the order {names}, put together in the order yaw, pitch, roll");
            }
            Self::Inverse => "are inverted: they rotate the other way",
            Self::ScalarFirst => "are in the order w, x, y, z: the fields x, y, z, w contain w, x, y, z",
            Self::ScalarLast => "are in the order x, y, z, w: the fields w, x, y, z contain x, y, z, w",
        };
        text.to_owned()
    }
}

/// Attitudes without a fault that the recorded ones may have.
pub(super) fn corrected(attitude: &AttitudeSurvey) -> Vec<Corrected> {
    let places: &[Faulty] =
        if attitude.has_vehicle() { &[Faulty::Gimbal, Faulty::Vehicle, Faulty::Both] } else { &[Faulty::Gimbal] };
    let all = places.iter().flat_map(|faulty| QuaternionFault::all().map(|fault| (*faulty, fault)));
    let correct = |(faulty, fault): (Faulty, QuaternionFault)| {
        let change =
            |is_faulty: bool| move |read: &UnitQuaternion<f64>| if is_faulty { fault.correct(read) } else { *read };
        let topics = match (faulty, attitude.vehicle_topic()) {
            (Faulty::Gimbal, _) | (_, None) => attitude.topic().to_owned(),
            (Faulty::Vehicle, Some(vehicle)) => vehicle.to_owned(),
            (Faulty::Both, Some(vehicle)) => format!("{} and {vehicle}", attitude.topic()),
        };
        Corrected {
            attitude: attitude.with_rotations(change(faulty != Faulty::Vehicle), change(faulty != Faulty::Gimbal)),
            fault: format!("the quaternions of {topics} {}", fault.describe()),
        }
    };
    all.map(correct).collect()
}
